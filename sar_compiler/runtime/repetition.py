"""Decorators that tick their child again when it has ended."""

from py_trees.behaviour import Behaviour

from sar_compiler.runtime.kernel.cells import FAILURE, SUCCESS
from sar_compiler.runtime.kernel.repeating import AgainNode
from sar_compiler.runtime.parents import Decorator, Yielding
from sar_compiler.runtime.ports import Input


class _Again(Yielding, Decorator):
    """Ticks its child again after one outcome, up to a number of times; the other outcome ends it.

    A child that has taken several ticks is started again in the same tick; after one that took only one, the
    node pauses.
    """

    node_class = AgainNode
    _again: int
    _counted: str

    def __init__(self, name: str, child: Behaviour, times: Input[int]) -> None:
        super().__init__(name, child)
        self._times = times

    def _read_again(self, times: int) -> int:
        """Return how often to tick the child, after one more time."""
        return times


class Repeat(_Again):
    """Repeats its child until it has succeeded num_cycles times; a failure ends it.

    Stock py_trees waits for the next tick after each success, and never ends if the number is 0.

    Args:
        num_cycles: How many successes; -1: without an end, 0: none, and the node succeeds at once.
    """

    _again = SUCCESS
    _counted = "cycle"

    def __init__(self, name: str, child: Behaviour, num_cycles: Input[int]) -> None:
        super().__init__(name, child, num_cycles)


class RetryUntilSuccessful(_Again):
    """Retries its child until it has failed num_attempts times; a success ends it.

    Stock py_trees waits for the next tick after each failure, and takes -1 for "not even once".

    Args:
        num_attempts: How many failures; -1: without an end, 0: none, and the node fails at once. Read again
            after each failure, because the child may have changed it.
    """

    _again = FAILURE
    _counted = "attempt"

    def __init__(self, name: str, child: Behaviour, num_attempts: Input[int]) -> None:
        super().__init__(name, child, num_attempts)

    def _read_again(self, times: int) -> int:
        return self._times.get(times)
