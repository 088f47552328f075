"""What is done and undone before a leaf that needed it."""

import pytest
from py_trees.behaviour import Behaviour
from py_trees.common import Status

from sar_compiler.checks import check
from sar_compiler.leaves import Kind, Outcome, register
from sar_compiler.nodes.registry import load_registry
from tests.trees import forest


class Told(Behaviour):
    """A leaf of which the answers are known."""

    def __init__(self, name: str) -> None:
        super().__init__(name)

    def update(self) -> Status:
        """Answer what nobody asks for here."""
        raise AssertionError


def leaf(tag, reads=(), writes=()):
    return register(
        tag, kind=Kind.ACTION, outcomes=[Outcome("SUCCESS"), Outcome("FAILURE")], reads=reads, writes=writes
    )


@leaf("Open", writes=["door"])
class Open(Told):
    """Opens the door."""


@leaf("Shut", writes=["door"])
class Shut(Told):
    """Shuts the door."""


@leaf("Enter", reads=["door"])
class Enter(Told):
    """Goes through the door."""


@leaf("Look", reads=["light"])
class Look(Told):
    """Looks around."""


REGISTRY = load_registry([__name__])


def found(body):
    return [finding.message for finding in check(forest(f"<Sequence>{body}</Sequence>"), REGISTRY)]


UNDONE = "'Enter' needs the effect of 'Open', but 'Shut' (line 3) undoes this effect in between"


@pytest.mark.parametrize("between", ["", "<Look/>", "<Fallback><Look/><AlwaysSuccess/></Fallback>"])
def test_what_is_undone_before_it_is_used_is_found_also_if_something_else_is_looked_at_between(between):
    assert UNDONE in found(f"<Open/>{between}<Shut/><Enter/>")


@pytest.mark.parametrize("between", ["<Enter/>", "<Inverter><Enter/></Inverter>"])
def test_what_was_used_may_be_undone(between):
    assert found(f"<Open/>{between}<Shut/><Enter/>") == []
