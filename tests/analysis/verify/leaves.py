"""Leaves that stand for systems outside the tree.

A, B, C and U are actions, P is a condition; X, Y and Z share a fact, for which W declares another initial
value; M writes a number.
"""

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from sar_compiler.leaves import Kind, Outcome, register
from sar_compiler.runtime.ports import Output

_ACTS = {Status.SUCCESS, Status.FAILURE, Status.RUNNING}
_SAYS = {Status.SUCCESS, Status.FAILURE}


@register("A", kind=Kind.ACTION, outcomes=_ACTS)
class A(Behaviour):
    """An action."""

    def __init__(self, name: str) -> None:
        super().__init__(name)

    def update(self) -> Status:
        """Fail, because a stub leaf replaces this leaf in a verified tree."""
        raise AssertionError


@register("B", kind=Kind.ACTION, outcomes=_ACTS)
class B(A):
    """An action."""


@register("C", kind=Kind.ACTION, outcomes=_ACTS)
class C(A):
    """An action."""


@register("U", kind=Kind.ACTION)
class U(A):
    """An action that does not declare its outcomes."""


@register("P", kind=Kind.CONDITION, outcomes=_SAYS)
class P(A):
    """A condition."""


@register(
    "X",
    kind=Kind.ACTION,
    outcomes=[Outcome("SUCCESS", then="f = f == 2 ? 0 : f + 1"), Outcome("FAILURE"), Outcome("RUNNING")],
    facts={"f": 0},
)
class X(A):
    """Counts to two and starts over."""


@register(
    "Y",
    kind=Kind.ACTION,
    outcomes=[Outcome("SUCCESS", "counted", "f > 0", "f -= 1"), Outcome("FAILURE"), Outcome("RUNNING")],
    facts={"f": 0},
)
class Y(A):
    """Counts down."""


@register(
    "Z",
    kind=Kind.ACTION,
    outcomes=[Outcome("SUCCESS"), Outcome("RUNNING", when="f == 0"), Outcome("FAILURE", when="f == 1")],
    facts={"f": 0},
)
class Z(A):
    """Reads the count."""


@register("W", kind=Kind.CONDITION, outcomes=_SAYS, facts={"f": 1})
class W(A):
    """Declares another initial count."""


@register("M", kind=Kind.ACTION, outcomes=_SAYS)
class M(A):
    """Measures a distance.

    Args:
        name: The node's name.
        distance: The measured distance.
    """

    def __init__(self, name: str, distance: Output[float]) -> None:
        super().__init__(name)
