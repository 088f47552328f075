"""Parallels that count: those of `runtime.parallel`."""

from sar_compiler.runtime.flat.cells import (
    ENDED,
    FAILURE,
    RUNNING,
    SKIPPED,
    SUCCESS,
    Cells,
    Stop,
    Tick,
)
from sar_compiler.runtime.flat.parts import Part, builds, halted_with_children, reset_all
from sar_compiler.runtime.flat.times import Times
from sar_compiler.runtime.parallel import Parallel, ParallelAll


class _FlatCounting:
    """The counts of both: the children that have ended, as bits of a number, and how many of these have failed."""

    def __init__(self, part: Part) -> None:
        self.part = part
        self.through = part.cell(0)
        self.failures = part.cell(0)

    def tick_child(self, index: int, cells: Cells, times: Times) -> int:
        """Tick a child that has not ended yet, and note it if it does."""
        if cells[self.through] >> index & 1:
            return SUCCESS
        child, tick, _, _ = self.part.children[index]
        self.part.behaviour.current_child = child
        outcome = tick(cells, times)
        if outcome & ENDED:
            cells[self.through] |= 1 << index
            cells[self.failures] += outcome == FAILURE
        return outcome

    def ended(self, cells: Cells) -> int:
        """Return how many children have ended."""
        through: int = cells[self.through]
        return through.bit_count()

    def finish(self, outcome: int, cells: Cells, times: Times) -> int:
        failures = cells[self.failures]
        behaviour = self.part.behaviour
        behaviour.feedback_message = f"{self.ended(cells) - failures} succeeded, {failures} failed"
        cells[self.through] = cells[self.failures] = 0
        reset_all(self.part.children, cells, times)
        cells[self.part.at] = outcome
        return outcome

    def stop(self) -> Stop:
        """Return what stops the node."""
        return halted_with_children(self.part, self.through, self.failures)


@builds(Parallel)
def parallel(part: Part) -> tuple[Tick, Stop]:
    """Build a Parallel."""
    at, behaviour, count = part.at, part.behaviour, len(part.children)
    counting = _FlatCounting(part)
    failures = counting.failures

    def tick(cells: Cells, times: Times) -> int:
        success_count = behaviour._success_count.get()
        enough = behaviour._threshold("success_count", success_count)
        too_many = behaviour._threshold("failure_count", behaviour._failure_count.get())
        cells[at] = RUNNING
        skips = successes = 0
        for index in range(count):
            skips += counting.tick_child(index, cells, times) == SKIPPED
            successes = counting.ended(cells) - cells[failures]
            if successes + (skips if success_count < 0 else 0) >= enough:
                return counting.finish(SUCCESS, cells, times)
            if count - cells[failures] < enough or cells[failures] == too_many:
                return counting.finish(FAILURE, cells, times)
        behaviour.feedback_message = f"{successes} of {enough}"
        return SKIPPED if skips == count else RUNNING

    return tick, counting.stop()


@builds(ParallelAll)
def parallel_all(part: Part) -> tuple[Tick, Stop]:
    """Build a ParallelAll."""
    at, behaviour, count = part.at, part.behaviour, len(part.children)
    counting = _FlatCounting(part)

    def tick(cells: Cells, times: Times) -> int:
        too_many = behaviour._threshold("max_failures", behaviour._max_failures.get())
        cells[at] = RUNNING
        skips = 0
        for index in range(count):
            skips += counting.tick_child(index, cells, times) == SKIPPED
        if skips == count:
            return SKIPPED
        ended = counting.ended(cells)
        if skips + ended == count:
            outcome = FAILURE if cells[counting.failures] >= too_many else SUCCESS
            return counting.finish(outcome, cells, times)
        behaviour.feedback_message = f"{ended} of {count}"
        return RUNNING

    return tick, counting.stop()
