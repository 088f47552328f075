"""Branches: which child is ticked depends on another one, or on a value."""

from collections.abc import Sequence

from py_trees.behaviour import Behaviour

from sar_compiler.errors import SarError
from sar_compiler.runtime.enums import Enums
from sar_compiler.runtime.kernel.branching import (
    IfThenElseNode,
    SwitchNode,
    TryCatchNode,
    WhileDoElseNode,
)
from sar_compiler.runtime.operators import equal_texts
from sar_compiler.runtime.parents import Control
from sar_compiler.runtime.ports import Input


class ChildCountError(SarError):
    """A node has too many or too few children."""


class IfThenElse(Control):
    """Ticks its second child if the first one succeeds, else the third; asks the first one only once.

    Stock py_trees has no such node, only an idiom of several that asks again in every tick. A condition that is
    skipped makes the whole node skipped.

    Args:
        children: The condition, what to do if it succeeds, and perhaps what to do if it fails.
    """

    node_class = IfThenElseNode

    def __init__(self, name: str, children: Sequence[Behaviour]) -> None:
        super().__init__(name, children)
        _require_branches(name, len(children))


class WhileDoElse(Control):
    """Ticks its second child as long as the first one succeeds, and the third as long as it fails.

    Stock py_trees has no such node: EternalGuard knows no third child. A condition that is skipped halts the
    branch that is running, and makes the whole node skipped.

    Args:
        children: The condition, what to do while it succeeds, and perhaps what to do while it fails.
    """

    node_class = WhileDoElseNode

    def __init__(self, name: str, children: Sequence[Behaviour]) -> None:
        super().__init__(name, children)
        _require_branches(name, len(children))


class Switch(Control):
    """Ticks the child whose case is equal to a variable, and the last one if none is.

    Stock py_trees has no such node. The variable is looked at in every tick; if another child has been running,
    it is halted.

    Args:
        children: One child for each case, and the one for all others.
        variable: What to compare with the cases: as text, as a whole number or a name of an enumeration, or as
            a real number. Without a value, none of them is equal.
        case_1: The first child's case.
        case_2: The second child's case.
        case_3: The third child's case.
        case_4: The fourth child's case.
        case_5: The fifth child's case.
        case_6: The sixth child's case.
    """

    node_class = SwitchNode

    def __init__(  # noqa: PLR0913 - its tags have so many attributes
        self,
        name: str,
        children: Sequence[Behaviour],
        variable: Input[str],
        enums: Enums,
        case_1: Input[str],
        case_2: Input[str],
        *,
        case_3: Input[str] | None = None,
        case_4: Input[str] | None = None,
        case_5: Input[str] | None = None,
        case_6: Input[str] | None = None,
    ) -> None:
        super().__init__(name, children)
        given = (case_1, case_2, case_3, case_4, case_5, case_6)
        self._cases = [case for case in given if case is not None]
        if len(children) != len(self._cases) + 1:
            message = (
                f"'{name}' has {len(self._cases)} cases and {len(children)} children; "
                "it needs one child for each case, and a last one for all others"
            )
            raise ChildCountError(message)
        self._variable = variable
        self._names = enums.numbers

    def _select(self) -> int:
        variable = self._variable.get(None)
        if variable is not None:
            for index, case in enumerate(self._cases):
                text = case.get(None)
                if text is not None and equal_texts(variable, text, self._names):
                    self.feedback_message = f"case {index + 1}"
                    return index
        self.feedback_message = "no case"
        return len(self._cases)


class TryCatch(Control):
    """Ticks its children in order but for the last one, which is ticked when one of them has failed.

    Stock py_trees can tidy up (`OnTerminate`), but not over several ticks, and not after a failure only. After
    the last child has ended, however it did, the node fails.

    Args:
        children: What to try, and last what to do if that fails.
        catch_on_halt: Whether to tick the last child, once, also when the node is halted.
    """

    node_class = TryCatchNode

    def __init__(
        self, name: str, children: Sequence[Behaviour], catch_on_halt: Input[bool] | None = None
    ) -> None:
        super().__init__(name, children)
        if len(children) < 2:  # noqa: PLR2004 - the least that makes sense
            message = (
                f"'{name}' has {len(children)} children; it needs something to try, and a last child to catch"
            )
            raise ChildCountError(message)
        self._catch_on_halt = catch_on_halt or Input(source=False)


def _require_branches(name: str, count: int) -> None:
    if count not in (2, 3):
        message = f"'{name}' has {count} children; it needs a condition and one or two branches"
        raise ChildCountError(message)
