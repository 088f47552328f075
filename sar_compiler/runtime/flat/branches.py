"""Branches: those of `runtime.branches`."""

from sar_compiler.runtime.branches import IfThenElse, Switch, TryCatch, WhileDoElse
from sar_compiler.runtime.flat.cells import FAILURE, RUNNING, SKIPPED, SUCCESS, Cells, Stop, Tick
from sar_compiler.runtime.flat.parts import Part, builds, halted_by, halted_with_children, reset, reset_all
from sar_compiler.runtime.flat.times import Times

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
