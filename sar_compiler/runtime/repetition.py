"""Decorators that tick their child again when it has ended."""

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from sar_compiler.runtime.parents import Ticking, Wrapper, Yielding
from sar_compiler.runtime.ports import Input
from sar_compiler.runtime.skipping import SKIPPED, reset

ENDLESS = -1
"""A number of times without an end."""


class _Again(Yielding, Wrapper):
    """Ticks its child again after one outcome, up to a number of times; the other outcome ends it.

    A child that has taken several ticks is started again in the same tick; after one that took only one, the
    node pauses.
    """

    _again: Status
    _counted: str

    def __init__(self, name: str, child: Behaviour, times: Input[int]) -> None:
        super().__init__(name, child)
        self._times = times
        self._done = 0

    def _work(self) -> Ticking:
        times = self._times.get()
        self.status = Status.RUNNING
        while self._done < times or times == ENDLESS:
            self.feedback_message = f"{self._counted} {self._done + 1}" + (
                "" if times < 0 else f" of {times}"
            )
            was_running = self.decorated.status == Status.RUNNING
            outcome = yield from self._tick_child()
            if outcome == Status.RUNNING:
                return outcome
            if outcome == SKIPPED:
                reset(self.decorated)
                return outcome
            if outcome != self._again:
                self._done = 0
                return outcome
            self._done += 1
            times = self._read_again(times)
            if not was_running and (self._done < times or times == ENDLESS):
                return self._pause()
        self._done = 0
        return self._again

    def _read_again(self, times: int) -> int:
        """Return how often to tick the child, after one more time."""
        return times

    def _halt(self) -> None:
        self._done = 0
        super()._halt()


class Repeat(_Again):
    """Repeats its child until it has succeeded num_cycles times; a failure ends it.

    Stock py_trees waits for the next tick after each success, and never ends if the number is 0.

    Args:
        name: The node's name.
        child: The child.
        num_cycles: How many successes; -1: without an end, 0: none, and the node succeeds at once.
    """

    _again = Status.SUCCESS
    _counted = "cycle"

    def __init__(self, name: str, child: Behaviour, num_cycles: Input[int]) -> None:
        super().__init__(name, child, num_cycles)


class RetryUntilSuccessful(_Again):
    """Retries its child until it has failed num_attempts times; a success ends it.

    Stock py_trees waits for the next tick after each failure, and takes -1 for "not even once".

    Args:
        name: The node's name.
        child: The child.
        num_attempts: How many failures; -1: without an end, 0: none, and the node fails at once. Read again
            after each failure, because the child may have changed it.
    """

    _again = Status.FAILURE
    _counted = "attempt"

    def __init__(self, name: str, child: Behaviour, num_attempts: Input[int]) -> None:
        super().__init__(name, child, num_attempts)

    def _read_again(self, times: int) -> int:
        return self._times.get(times)
