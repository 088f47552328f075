"""Parallels that count: children side by side, until enough of them have ended.

Stock py_trees has policies for all children and for one of them, ticks every child before it decides, and ticks
children that have failed again.
"""

from collections.abc import Sequence

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from sar_compiler.errors import SarError
from sar_compiler.runtime.parents import Control, Ticking, ended
from sar_compiler.runtime.ports import Input
from sar_compiler.runtime.skipping import SKIPPED


class ThresholdError(SarError):
    """A parallel is to wait for more children than it has."""


class _Counting(Control):
    """Children side by side; one that has ended is not ticked again until the node has."""

    def __init__(self, name: str, children: Sequence[Behaviour]) -> None:
        super().__init__(name, children)
        self._through: set[int] = set()
        self._failures = 0

    @property
    def _successes(self) -> int:
        return len(self._through) - self._failures

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

    def _tick_unless_through(self, index: int) -> Ticking:
        """Tick a child that has not ended yet, and note it if it does; return `SKIPPED` if it was skipped."""
        if index in self._through:
            return Status.SUCCESS
        outcome = yield from self._tick_child(index)
        if ended(outcome):
            self._through.add(index)
            self._failures += outcome == Status.FAILURE
        return outcome

    def _finish(self, outcome: Status) -> Status:
        self.feedback_message = f"{self._successes} succeeded, {self._failures} failed"
        self._clear()
        self._reset_children()
        return outcome

    def _clear(self) -> None:
        self._through.clear()
        self._failures = 0

    def _halt(self) -> None:
        self._clear()
        super()._halt()


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

    def _work(self) -> Ticking:
        success_count = self._success_count.get()
        enough = self._threshold("success_count", success_count)
        too_many = self._threshold("failure_count", self._failure_count.get())
        self.status = Status.RUNNING
        skipped = 0
        for index in range(len(self.children)):
            outcome = yield from self._tick_unless_through(index)
            skipped += outcome == SKIPPED
            if self._successes + (skipped if success_count < 0 else 0) >= enough:
                return self._finish(Status.SUCCESS)
            if len(self.children) - self._failures < enough or self._failures == too_many:
                return self._finish(Status.FAILURE)
        self.feedback_message = f"{self._successes} of {enough}"
        return SKIPPED if skipped == len(self.children) else Status.RUNNING


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

    def _work(self) -> Ticking:
        too_many = self._threshold("max_failures", self._max_failures.get())
        self.status = Status.RUNNING
        skipped = 0
        for index in range(len(self.children)):
            outcome = yield from self._tick_unless_through(index)
            skipped += outcome == SKIPPED
        if skipped == len(self.children):
            return SKIPPED
        if skipped + len(self._through) == len(self.children):
            return self._finish(Status.FAILURE if self._failures >= too_many else Status.SUCCESS)
        self.feedback_message = f"{len(self._through)} of {len(self.children)}"
        return Status.RUNNING
