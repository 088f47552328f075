"""Leaves that stand for something outside the tree.

A, B, C and U act, P answers at once; X, Y and Z share a fact, about which W does not agree with them; M writes a number.
"""

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from sar_compiler.leaves import Kind, Outcome, register
from sar_compiler.runtime.ports import Output

_ACTS = {Status.SUCCESS, Status.FAILURE, Status.RUNNING}
_SAYS = {Status.SUCCESS, Status.FAILURE}


@register("A", kind=Kind.ACTION, outcomes=_ACTS)
class A(Behaviour):
    """Acts."""

    def __init__(self, name: str) -> None:
        super().__init__(name)

    def update(self) -> Status:
        """Answer what a verified tree never asks for: there, somebody else answers for it."""
        raise AssertionError


@register("B", kind=Kind.ACTION, outcomes=_ACTS)
class B(A):
    """Acts."""


@register("C", kind=Kind.ACTION, outcomes=_ACTS)
class C(A):
    """Acts."""


@register("U", kind=Kind.ACTION)
class U(A):
    """Acts, and does not say how it can end."""


@register("P", kind=Kind.CONDITION, outcomes=_SAYS)
class P(A):
    """Says yes or no."""


@register(
    "X",
    kind=Kind.ACTION,
    outcomes=[Outcome("SUCCESS", then="f = f == 2 ? 0 : f + 1"), Outcome("FAILURE"), Outcome("RUNNING")],
    facts={"f": 0},
)
class X(A):
    """Counts to two and begins again."""


@register(
    "Y",
    kind=Kind.ACTION,
    outcomes=[Outcome("SUCCESS", "counted", "f > 0", "f -= 1"), Outcome("FAILURE"), Outcome("RUNNING")],
    facts={"f": 0},
)
class Y(A):
    """Counts back."""


@register(
    "Z",
    kind=Kind.ACTION,
    outcomes=[Outcome("SUCCESS"), Outcome("RUNNING", when="f == 0"), Outcome("FAILURE", when="f == 1")],
    facts={"f": 0},
)
class Z(A):
    """Looks at the count."""


@register("W", kind=Kind.CONDITION, outcomes=_SAYS, facts={"f": 1})
class W(A):
    """Begins with another count."""


@register("M", kind=Kind.ACTION, outcomes=_SAYS)
class M(A):
    """Measures.

    Args:
        name: The node's name.
        distance: What was measured.
    """

    def __init__(self, name: str, distance: Output[float]) -> None:
        super().__init__(name)
