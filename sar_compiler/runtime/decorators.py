"""Decorators that turn one end of their child into another."""

from py_trees.behaviour import Behaviour

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
from sar_compiler.runtime.flat.parts import Part, builds, halted_with_child, ticked
from sar_compiler.runtime.flat.times import Times
from sar_compiler.runtime.parents import Wrapper
from sar_compiler.runtime.ports import Input


class Inverter(Wrapper):
    """Turns success into failure and failure into success; a child that is skipped makes it skipped.

    Stock py_trees passes a skipped tick on as if the child had been interrupted.

    Args:
        name: The node's name.
        child: The child.
    """


class ForceSuccess(Wrapper):
    """Succeeds when its child ends, however it does; a child that is skipped makes it skipped.

    Stock py_trees passes a skipped tick on as if the child had been interrupted.

    Args:
        name: The node's name.
        child: The child.
    """


class ForceFailure(ForceSuccess):
    """Fails when its child ends, however it does; a child that is skipped makes it skipped.

    Stock py_trees passes a skipped tick on as if the child had been interrupted.

    Args:
        name: The node's name.
        child: The child.
    """


class KeepRunningUntilFailure(Wrapper):
    """Answers RUNNING until its child fails, also when the child succeeds or is skipped.

    Stock py_trees' SuccessIsRunning is stopped by a child that is skipped.

    Args:
        name: The node's name.
        child: The child.
    """


class RunOnce(Wrapper):
    """Lets its child end once; from then on it is skipped, or answers what the child did.

    Stock py_trees' OneShot can only do the second. A child that was halted has not ended, and may run again.

    Args:
        name: The node's name.
        child: The child.
        then_skip: Whether to be skipped afterwards (true), or to answer the same again (false).
    """

    def __init__(self, name: str, child: Behaviour, then_skip: Input[bool] | None = None) -> None:
        super().__init__(name, child)
        self._then_skip = then_skip or Input(source=True)


class SubTree(Wrapper):
    """The root of a subtree: passes on what its child answers.

    Stock py_trees' PassThrough does it for children that are never skipped.

    Args:
        name: The node's name.
        child: The root of what the subtree consists of.
    """


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
