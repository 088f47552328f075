"""Decorators that turn one end of their child into another: those of `runtime.decorators`."""

from sar_compiler.runtime.decorators import (
    ForceFailure,
    ForceSuccess,
    Inverter,
    KeepRunningUntilFailure,
    RunOnce,
    SubTree,
)
from sar_compiler.runtime.flat.cells import (
    ENDED,
    FAILURE,
    INVALID,
    RUNNING,
    SKIPPED,
    SUCCESS,
    Cells,
    Stop,
    Tick,
)
from sar_compiler.runtime.flat.parts import Part, builds, halted_by, reset
from sar_compiler.runtime.flat.times import Times


@builds(Inverter)
def inverter(part: Part) -> tuple[Tick, Stop]:
    """Build an Inverter."""
    return _turning(part, success=FAILURE, failure=SUCCESS, skipped=SKIPPED)


@builds(ForceSuccess)
def force_success(part: Part) -> tuple[Tick, Stop]:
    """Build a ForceSuccess."""
    return _turning(part, success=SUCCESS, failure=SUCCESS, skipped=SKIPPED)


@builds(ForceFailure)
def force_failure(part: Part) -> tuple[Tick, Stop]:
    """Build a ForceFailure."""
    return _turning(part, success=FAILURE, failure=FAILURE, skipped=SKIPPED)


@builds(KeepRunningUntilFailure)
def keep_running_until_failure(part: Part) -> tuple[Tick, Stop]:
    """Build a KeepRunningUntilFailure."""
    return _turning(part, success=RUNNING, failure=FAILURE, skipped=RUNNING)


def _turning(part: Part, *, success: int, failure: int, skipped: int) -> tuple[Tick, Stop]:
    at = part.at
    tick_child = ticked(part)
    turned = (INVALID, RUNNING, success, failure, skipped)

    def tick(cells: Cells, times: Times) -> int:
        cells[at] = RUNNING
        outcome = turned[tick_child(cells, times)]
        if outcome != SKIPPED:
            cells[at] = outcome
        return outcome

    return tick, halted_with_child(part)


@builds(RunOnce)
def run_once(part: Part) -> tuple[Tick, Stop]:
    """Build a RunOnce. The outcome of its child is kept for good."""
    at, behaviour = part.at, part.behaviour
    tick_child = ticked(part)
    answer = part.cell(INVALID)

    def tick(cells: Cells, times: Times) -> int:
        then_skip = behaviour._then_skip.get()
        if cells[answer]:
            behaviour.feedback_message = "has run"
            if then_skip:
                return SKIPPED
            cells[at] = cells[answer]
            return int(cells[at])
        cells[at] = RUNNING
        outcome = tick_child(cells, times)
        if outcome & ENDED:
            cells[answer] = cells[at] = outcome
        return outcome

    return tick, halted_with_child(part)


@builds(SubTree)
def subtree(part: Part) -> tuple[Tick, Stop]:
    """Build a SubTree."""
    at = part.at
    tick_child = ticked(part)

    def tick(cells: Cells, times: Times) -> int:
        if cells[at] == INVALID:
            cells[at] = RUNNING
        outcome = tick_child(cells, times)
        if outcome != SKIPPED:
            cells[at] = outcome
        return outcome

    return tick, halted_with_child(part)


def ticked(part: Part) -> Tick:
    """Return what ticks the child of a decorator, and leaves it at rest if it has ended."""
    ((_, tick_child, _, cell),) = part.children

    def tick(cells: Cells, times: Times) -> int:
        outcome = tick_child(cells, times)
        if outcome & ENDED:
            cells[cell] = INVALID
        return outcome

    return tick


def halted_with_child(part: Part, *forgotten: int) -> Stop:
    """Return what stops a decorator that forgets where it was and halts its child.

    Args:
        part: The decorator.
        *forgotten: The cells that are set to 0.
    """
    (child,) = part.children

    def halt(cells: Cells, times: Times) -> None:
        for number in forgotten:
            cells[number] = 0
        reset(child, cells, times)

    return halted_by(part, halt)
