"""Tests of effects that are undone before the leaf that needs them."""

import pytest
from py_trees.behaviour import Behaviour
from py_trees.common import Status

from sar_compiler.checks import check
from sar_compiler.leaves import Kind, Outcome, register
from sar_compiler.nodes.registry import load_registry
from tests.trees import forest


class StubLeaf(Behaviour):
    """A leaf that is never ticked."""

    def __init__(self, name: str) -> None:
        super().__init__(name)

    def update(self) -> Status:
        """Fail, because the tree is not run."""
        raise AssertionError


def leaf(tag, reads=(), writes=()):
    return register(
        tag, kind=Kind.ACTION, outcomes=[Outcome("SUCCESS"), Outcome("FAILURE")], reads=reads, writes=writes
    )


@leaf("Open", writes=["door"])
class Open(StubLeaf):
    """Opens the door."""


@leaf("Shut", writes=["door"])
class Shut(StubLeaf):
    """Shuts the door."""


@leaf("Enter", reads=["door"])
class Enter(StubLeaf):
    """Goes through the door."""


@leaf("Look", reads=["light"])
class Look(StubLeaf):
    """Looks around."""


REGISTRY = load_registry([__name__])


def findings_in(body):
    return [finding.message for finding in check(forest(f"<Sequence>{body}</Sequence>"), REGISTRY)]


UNDONE = "'Enter' needs the effect of 'Open', but 'Shut' (line 3) undoes this effect in between"


@pytest.mark.parametrize("between", ["", "<Look/>", "<Fallback><Look/><AlwaysSuccess/></Fallback>"])
def test_effect_undone_before_use_is_reported(between):
    assert UNDONE in findings_in(f"<Open/>{between}<Shut/><Enter/>")


@pytest.mark.parametrize("between", ["<Enter/>", "<Inverter><Enter/></Inverter>"])
def test_effect_undone_after_use_is_not_reported(between):
    assert findings_in(f"<Open/>{between}<Shut/><Enter/>") == []
