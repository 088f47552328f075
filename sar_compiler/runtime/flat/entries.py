"""Nodes that work with entries of the blackboard and remember something: of `runtime.entries` and `script_nodes`."""

from collections.abc import Callable
from typing import Any

from sar_compiler.runtime.entries import SkipUnlessUpdated, WaitValueUpdate, WasEntryUpdated
from sar_compiler.runtime.flat.cells import (
    FAILURE,
    INVALID,
    RUNNING,
    SKIPPED,
    SUCCESS,
    Cells,
    Stop,
    Tick,
    number_of,
)
from sar_compiler.runtime.flat.decorators import halted_with_child, ticked
from sar_compiler.runtime.flat.parts import Part, builds
from sar_compiler.runtime.flat.times import Times
from sar_compiler.runtime.script_nodes import Precondition


@builds(WasEntryUpdated)
def was_entry_updated(part: Part) -> tuple[Tick, Stop]:
    """Build a WasEntryUpdated."""
    at = part.at
    come = _updates(part)

    def tick(cells: Cells, times: Times) -> int:  # noqa: ARG001
        cells[at] = SUCCESS if come(cells) else FAILURE
        return int(cells[at])

    def stop(cells: Cells, times: Times) -> None:  # noqa: ARG001
        cells[at] = INVALID

    return tick, stop


@builds(SkipUnlessUpdated, WaitValueUpdate)
def if_updated(part: Part) -> tuple[Tick, Stop]:
    """Build a SkipUnlessUpdated or a WaitValueUpdate."""
    come = _updates(part)
    otherwise = number_of(part.behaviour._otherwise) or SKIPPED
    return _guarded(part, come, lambda: otherwise, "no update")


@builds(Precondition)
def precondition(part: Part) -> tuple[Tick, Stop]:
    """Build a Precondition."""
    behaviour = part.behaviour

    def holds(cells: Cells) -> bool:  # noqa: ARG001
        return bool(behaviour._condition.holds())

    def otherwise() -> int:
        return number_of(behaviour._else.get().value) or SKIPPED

    return _guarded(part, holds, otherwise, "the condition is false")


def _guarded(
    part: Part, may_start: Callable[[Cells], bool], otherwise: Callable[[], int], why_not: str
) -> tuple[Tick, Stop]:
    """Build a decorator that asks whether its child may start, and not again while the child runs."""
    at, behaviour = part.at, part.behaviour
    tick_child = ticked(part)
    child_runs = part.cell(0)

    def tick(cells: Cells, times: Times) -> int:
        if not cells[child_runs] and not may_start(cells):
            behaviour.feedback_message = why_not
            outcome = otherwise()
        else:
            behaviour.feedback_message = ""
            outcome = tick_child(cells, times)
            cells[child_runs] = int(outcome == RUNNING)
        if outcome != SKIPPED:
            cells[at] = outcome
        return outcome

    return tick, halted_with_child(part, child_runs)


def _updates(part: Part) -> Callable[[Cells], bool]:
    """Return what says whether a node's entry was written since the node last looked."""
    updates: Any = part.behaviour._updates
    entry = updates._entry
    seen = part.cell(updates._seen)
    part.watch(entry, seen)

    def come(cells: Cells) -> bool:
        if not entry.exists:
            return False
        before, cells[seen] = cells[seen], entry.stamp
        return bool(before != cells[seen])

    return come
