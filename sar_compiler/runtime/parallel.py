"""Parallels that count: children side by side, until enough of them have ended.

Stock py_trees has policies for all children and for one of them, ticks every child before it decides, and ticks
children that have failed again.
"""

from collections.abc import Sequence

from py_trees.behaviour import Behaviour

from sar_compiler.errors import SarError
from sar_compiler.runtime.flat.cells import ENDED, FAILURE, RUNNING, SKIPPED, SUCCESS, Cells, Stop, Tick
from sar_compiler.runtime.flat.parts import Part, builds, halted_with_children, reset_all
from sar_compiler.runtime.flat.times import Times
from sar_compiler.runtime.parents import Control
from sar_compiler.runtime.ports import Input


class ThresholdError(SarError):
    """A parallel is to wait for more children than it has."""


class _Counting(Control):
    """Children side by side; one that has ended is not ticked again until the node has."""

    def _threshold(self, port: str, wanted: int) -> int:
        """Return how many children an attribute means; counted from the end if it is negative.

        Raises:
            ThresholdError: If they are more than there are.
        """
        count = len(self.children)
        if wanted > count:
            message = (
                f"'{self.name}' can never count {wanted} children, because it has {count}; "
                f"{port} is at most {count}, or negative to count from the end (-1: all)"
            )
            raise ThresholdError(message)
        return wanted if wanted >= 0 else max(count + wanted + 1, 0)


class Parallel(_Counting):
    """Succeeds after success_count successes; fails after failure_count failures or when success is out of reach.

    It decides after every child: the ones behind the child that decides are not ticked any more in that tick.
    Stock py_trees cannot count to anything but one and all.

    Args:
        name: The node's name.
        children: The children, in order.
        success_count: How many successes make a success; negative: counted from the end, -1 is all, and then
            a skipped child counts as one that succeeded.
        failure_count: How many failures make a failure; negative: counted from the end.
    """

    def __init__(
        self,
        name: str,
        children: Sequence[Behaviour],
        success_count: Input[int] | None = None,
        failure_count: Input[int] | None = None,
    ) -> None:
        super().__init__(name, children)
        self._success_count = success_count or Input(-1)
        self._failure_count = failure_count or Input(1)


class ParallelAll(_Counting):
    """Waits for all children, then fails if too many of them have failed.

    Stock py_trees fails with the first child that does.

    Args:
        name: The node's name.
        children: The children, in order.
        max_failures: With how many failures it fails; negative: counted from the end, 0: always.
    """

    def __init__(
        self, name: str, children: Sequence[Behaviour], max_failures: Input[int] | None = None
    ) -> None:
        super().__init__(name, children)
        self._max_failures = max_failures or Input(1)


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
