"""Branches: which child is ticked depends on another one, or on a value."""

from collections.abc import Mapping, Sequence

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from sar_compiler.errors import SarError
from sar_compiler.runtime.enums import Enums
from sar_compiler.runtime.parents import Control, Ticking, ended
from sar_compiler.runtime.ports import Input
from sar_compiler.runtime.skipping import SKIPPED, reset
from sar_compiler.runtime.variables import RefusedValueError, number_of

_FLOAT_EPSILON = 2.0**-23
"""Two real numbers of a Switch are equal if they are no further apart, as in scripts."""


class ChildCountError(SarError):
    """A node has too many or too few children."""


class IfThenElse(Control):
    """Ticks its second child if the first one succeeds, else the third; asks the first one only once.

    Stock py_trees has no such node, only an idiom of several that asks again in every tick. A condition that is
    skipped makes the whole node skipped.

    Args:
        name: The node's name.
        children: The condition, what to do if it succeeds, and perhaps what to do if it fails.
    """

    def __init__(self, name: str, children: Sequence[Behaviour]) -> None:
        super().__init__(name, children)
        _require_branches(name, len(children))
        self._branch = 0

    def _work(self) -> Ticking:
        self.status = Status.RUNNING
        if self._branch == 0:
            condition = yield from self._tick_child(0)
            if condition == Status.RUNNING:
                return condition
            if condition == SKIPPED:
                self._reset_children()
                return SKIPPED
            self._branch = 1 if condition == Status.SUCCESS else 2
            self.feedback_message = "then" if condition == Status.SUCCESS else "else"
        if self._branch >= len(self.children):
            # The condition keeps its status: as in BehaviorTree.CPP nothing is reset here.
            self._branch = 0
            return Status.FAILURE
        outcome = yield from self._tick_child(self._branch)
        if outcome != Status.RUNNING:
            self._branch = 0
            self._reset_children()
        return outcome

    def _halt(self) -> None:
        self._branch = 0
        super()._halt()


class WhileDoElse(Control):
    """Ticks its second child as long as the first one succeeds, and the third as long as it fails.

    Stock py_trees has no such node: EternalGuard knows no third child. A condition that is skipped halts the
    branch that is running, and makes the whole node skipped.

    Args:
        name: The node's name.
        children: The condition, what to do while it succeeds, and perhaps what to do while it fails.
    """

    def __init__(self, name: str, children: Sequence[Behaviour]) -> None:
        super().__init__(name, children)
        _require_branches(name, len(children))

    def _work(self) -> Ticking:
        self.status = Status.RUNNING
        outcome = yield from self._tick_child(0)
        if outcome == Status.RUNNING:
            return outcome
        if outcome != SKIPPED:
            branch, other = (1, 2) if outcome == Status.SUCCESS else (2, 1)
            self.feedback_message = "do" if branch == 1 else "else"
            if branch < len(self.children):
                if other < len(self.children):
                    reset(self.children[other])
                outcome = yield from self._tick_child(branch)
        if outcome != Status.RUNNING:
            self._reset_children()
        return outcome


class Switch(Control):
    """Ticks the child whose case is equal to a variable, and the last one if none is.

    Stock py_trees has no such node. The variable is looked at in every tick; if another child has been running,
    it is halted.

    Args:
        name: The node's name.
        children: One child for each case, and the one for all others.
        variable: What to compare with the cases: as text, as a whole number or a name of an enumeration, or as
            a real number. Without a value, none of them is equal.
        enums: The names that stand for numbers.
        case_1: The first child's case.
        case_2: The second child's case.
        case_3: The third child's case.
        case_4: The fourth child's case.
        case_5: The fifth child's case.
        case_6: The sixth child's case.
    """

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
        self._running: Behaviour | None = None

    def _work(self) -> Ticking:
        selected = self._select()
        child = self.children[selected]
        if self._running not in (None, child):
            reset(self._running)
        outcome = yield from self._tick_child(selected)
        self._running = child if outcome == Status.RUNNING else None
        if ended(outcome):
            self._reset_children()
        return outcome

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

    def _halt(self) -> None:
        self._running = None
        super()._halt()


class TryCatch(Control):
    """Ticks its children in order but for the last one, which is ticked when one of them has failed.

    Stock py_trees can tidy up (`OnTerminate`), but not over several ticks, and not after a failure only. After
    the last child has ended, however it did, the node fails.

    Args:
        name: The node's name.
        children: What to try, and last what to do if that fails.
        catch_on_halt: Whether to tick the last child, once, also when the node is halted.
    """

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
        self._index = 0
        self._skipped = 0
        self._catching = False

    def _work(self) -> Ticking:
        if self.status != Status.RUNNING:
            self._start_over()
            self.feedback_message = ""
        self.status = Status.RUNNING
        if not self._catching:
            outcome = yield from self._try()
            if not self._catching:
                return outcome
        outcome = yield from self._tick_child(-1)
        if outcome == Status.RUNNING:
            return outcome
        self._start_over()
        self._reset_children()
        return Status.FAILURE

    def _try(self) -> Ticking:
        tried = len(self.children) - 1
        while self._index < tried:
            child = self.children[self._index]
            outcome = yield from self._tick_child(self._index)
            if outcome == Status.RUNNING:
                return outcome
            if outcome == Status.FAILURE:
                self.feedback_message = f"{child.name} failed"
                self._catching = True
                self._reset_children()
                return outcome
            self._index += 1
            self._skipped += outcome == SKIPPED
        all_skipped = self._skipped == tried
        self._start_over()
        self._reset_children()
        return SKIPPED if all_skipped else Status.SUCCESS

    def _start_over(self) -> None:
        self._index = self._skipped = 0
        self._catching = False

    def _halt(self) -> None:
        if self.status == Status.RUNNING and not self._catching and self._catch_on_halt.get():
            *tried, catch = self.children
            for child in tried:
                reset(child)
            try:
                catch.tick_once()
            finally:
                self._start_over()
                super()._halt()
        else:
            self._start_over()
            super()._halt()


def equal_texts(first: str, second: str, names: Mapping[str, int]) -> bool:
    """Return whether two texts are equal for a Switch: as they are, as whole numbers, or as real numbers.

    Args:
        first: A text.
        second: Another one.
        names: Names that stand for numbers.
    """
    if first == second:
        return True
    try:
        return abs(_real(first, names) - _real(second, names)) <= _FLOAT_EPSILON
    except RefusedValueError:
        return False


def _require_branches(name: str, count: int) -> None:
    if count not in (2, 3):
        message = f"'{name}' has {count} children; it needs a condition and one or two branches"
        raise ChildCountError(message)


def _real(text: str, names: Mapping[str, int]) -> float:
    return float(names[text] if text in names else number_of(text))
