"""Branches: which child is ticked depends on another one, or on a value."""

from collections.abc import Sequence

from py_trees.behaviour import Behaviour

from sar_compiler.errors import SarError
from sar_compiler.runtime.enums import Enums
from sar_compiler.runtime.flat.cells import FAILURE, RUNNING, SKIPPED, SUCCESS, Cells, Stop, Tick
from sar_compiler.runtime.flat.parts import Part, builds, halted_by, halted_with_children, reset, reset_all
from sar_compiler.runtime.flat.times import Times
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
        name: The node's name.
        children: The condition, what to do if it succeeds, and perhaps what to do if it fails.
    """

    def __init__(self, name: str, children: Sequence[Behaviour]) -> None:
        super().__init__(name, children)
        _require_branches(name, len(children))


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


def _require_branches(name: str, count: int) -> None:
    if count not in (2, 3):
        message = f"'{name}' has {count} children; it needs a condition and one or two branches"
        raise ChildCountError(message)


_NONE = 0


@builds(IfThenElse)
def if_then_else(part: Part) -> tuple[Tick, Stop]:
    """Build an IfThenElse."""
    at, behaviour, children = part.at, part.behaviour, part.children
    chosen = part.cell(_NONE)
    condition = children[0]

    def tick(cells: Cells, times: Times) -> int:
        cells[at] = RUNNING
        if cells[chosen] == _NONE:
            behaviour.current_child = condition.behaviour
            outcome = condition.tick(cells, times)
            if outcome == RUNNING:
                return RUNNING
            if outcome == SKIPPED:
                reset_all(children, cells, times)
                return SKIPPED
            cells[chosen] = 1 if outcome == SUCCESS else 2
            behaviour.feedback_message = "then" if outcome == SUCCESS else "else"
        if cells[chosen] >= len(children):
            cells[chosen] = _NONE
            cells[at] = FAILURE
            return FAILURE
        branch, tick_branch, _, _ = children[cells[chosen]]
        behaviour.current_child = branch
        outcome = tick_branch(cells, times)
        if outcome != RUNNING:
            cells[chosen] = _NONE
            reset_all(children, cells, times)
        if outcome != SKIPPED:
            cells[at] = outcome
        return outcome

    return tick, halted_with_children(part, chosen)


@builds(WhileDoElse)
def while_do_else(part: Part) -> tuple[Tick, Stop]:
    """Build a WhileDoElse."""
    at, behaviour, children = part.at, part.behaviour, part.children
    condition = children[0]

    def tick(cells: Cells, times: Times) -> int:
        cells[at] = RUNNING
        behaviour.current_child = condition.behaviour
        outcome = condition.tick(cells, times)
        if outcome == RUNNING:
            return RUNNING
        if outcome != SKIPPED:
            branch, other = (1, 2) if outcome == SUCCESS else (2, 1)
            behaviour.feedback_message = "do" if branch == 1 else "else"
            if branch < len(children):
                if other < len(children):
                    reset(children[other], cells, times)
                behaviour.current_child = children[branch].behaviour
                outcome = children[branch].tick(cells, times)
        if outcome != RUNNING:
            reset_all(children, cells, times)
        if outcome != SKIPPED:
            cells[at] = outcome
        return outcome

    return tick, halted_with_children(part)


@builds(Switch)
def switch(part: Part) -> tuple[Tick, Stop]:
    """Build a Switch; which case is chosen is said by the node itself."""
    at, behaviour, children = part.at, part.behaviour, part.children
    # The number of the child that runs, counted from 1.
    running = part.cell(_NONE)
    select = behaviour._select

    def tick(cells: Cells, times: Times) -> int:
        selected = select()
        before = cells[running]
        if before not in (_NONE, selected + 1):
            reset(children[before - 1], cells, times)
        child, tick_child, _, _ = children[selected]
        behaviour.current_child = child
        outcome: int = tick_child(cells, times)
        cells[running] = selected + 1 if outcome == RUNNING else _NONE
        if outcome == SKIPPED:
            return SKIPPED
        if outcome != RUNNING:
            reset_all(children, cells, times)
        cells[at] = outcome
        return outcome

    return tick, halted_with_children(part, running)


@builds(TryCatch)
def try_catch(part: Part) -> tuple[Tick, Stop]:
    """Build a TryCatch."""
    node = _TryCatch(part)
    return node.tick, halted_by(part, node.halt)


class _TryCatch:
    def __init__(self, part: Part) -> None:
        self.part = part
        *self.tried, self.catch = part.children
        self.position, self.skips, self.catching = part.cell(0), part.cell(0), part.cell(0)

    def tick(self, cells: Cells, times: Times) -> int:
        at, behaviour = self.part.at, self.part.behaviour
        if cells[at] != RUNNING:
            self.start_over(cells)
            behaviour.feedback_message = ""
        cells[at] = RUNNING
        outcome = FAILURE if cells[self.catching] else self.attempt(cells, times)
        if cells[self.catching]:
            behaviour.current_child = self.catch.behaviour
            if self.catch.tick(cells, times) == RUNNING:
                return RUNNING
            self.start_over(cells)
            reset_all(self.part.children, cells, times)
        if outcome != SKIPPED:
            cells[at] = outcome
        return outcome

    def attempt(self, cells: Cells, times: Times) -> int:
        """Tick the children that are to be tried; FAILURE if the last one has to be ticked."""
        while cells[self.position] < len(self.tried):
            child, tick_child, _, _ = self.tried[cells[self.position]]
            self.part.behaviour.current_child = child
            outcome = tick_child(cells, times)
            if outcome == RUNNING:
                return RUNNING
            if outcome == FAILURE:
                self.part.behaviour.feedback_message = f"{child.name} failed"
                cells[self.catching] = 1
                reset_all(self.part.children, cells, times)
                return FAILURE
            cells[self.position] += 1
            cells[self.skips] += outcome == SKIPPED
        all_skipped = cells[self.skips] == len(self.tried)
        self.start_over(cells)
        reset_all(self.part.children, cells, times)
        return SKIPPED if all_skipped else SUCCESS

    def start_over(self, cells: Cells) -> None:
        cells[self.position] = cells[self.skips] = cells[self.catching] = 0

    def halt(self, cells: Cells, times: Times) -> None:
        runs = cells[self.part.at] == RUNNING and not cells[self.catching]
        try:
            if runs and self.part.behaviour._catch_on_halt.get():
                reset_all(self.tried, cells, times)
                self.catch.tick(cells, times)
        finally:
            self.start_over(cells)
            self.part.behaviour.current_child = None
            reset_all(self.part.children, cells, times)
