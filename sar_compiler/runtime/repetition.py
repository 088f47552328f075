"""Decorators that tick their child again when it has ended."""

from py_trees.behaviour import Behaviour

from sar_compiler.runtime.flat.cells import FAILURE, RUNNING, SKIPPED, SUCCESS, Cells, Stop, Tick
from sar_compiler.runtime.flat.parts import Part, builds, halted_by, reset, ticked
from sar_compiler.runtime.flat.times import Times
from sar_compiler.runtime.parents import Wrapper, Yielding
from sar_compiler.runtime.ports import Input

ENDLESS = -1
"""A number of times without an end."""


class _Again(Yielding, Wrapper):
    """Ticks its child again after one outcome, up to a number of times; the other outcome ends it.

    A child that has taken several ticks is started again in the same tick; after one that took only one, the
    node pauses.
    """

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
        name: The node's name.
        child: The child.
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
        name: The node's name.
        child: The child.
        num_attempts: How many failures; -1: without an end, 0: none, and the node fails at once. Read again
            after each failure, because the child may have changed it.
    """

    _again = FAILURE
    _counted = "attempt"

    def __init__(self, name: str, child: Behaviour, num_attempts: Input[int]) -> None:
        super().__init__(name, child, num_attempts)

    def _read_again(self, times: int) -> int:
        return self._times.get(times)


@builds(Repeat, RetryUntilSuccessful)
def again(part: Part) -> tuple[Tick, Stop]:
    """Build a Repeat or a RetryUntilSuccessful."""
    node = _FlatAgain(part)
    return node.tick, halted_by(part, node.halt)


class _FlatAgain:
    """A decorator that ticks its child again after one end; the other end ends it."""

    def __init__(self, part: Part) -> None:
        self.part = part
        self.tick_child = ticked(part)
        self.goes_on = part.behaviour._again
        self.times = part.behaviour._times
        self.done = part.cell(0)
        # How often one without an end has ticked its child makes no difference: it is told, and in no cell.
        self.endless = self.times.entry is None and self.times.get() == ENDLESS
        self.told = 0

    def tick(self, cells: Cells, times: Times) -> int:
        behaviour, (child,), done = self.part.behaviour, self.part.children, self.done
        wanted = self.times.get()
        cells[self.part.at] = RUNNING
        while cells[done] < wanted or wanted == ENDLESS:
            self.tell(cells, wanted)
            was_running = cells[child.at] == RUNNING
            outcome = self.tick_child(cells, times)
            if outcome == RUNNING:
                return RUNNING
            if outcome == SKIPPED:
                reset(child, cells, times)
                return SKIPPED
            if outcome != self.goes_on:
                return self.end(outcome, cells)
            self.count(cells)
            wanted = behaviour._read_again(wanted)
            if not was_running and (cells[done] < wanted or wanted == ENDLESS):
                behaviour._wake()
                return RUNNING
        return self.end(self.goes_on, cells)

    def halt(self, cells: Cells, times: Times) -> None:
        cells[self.done] = self.told = 0
        reset(self.part.children[0], cells, times)

    def tell(self, cells: Cells, wanted: int) -> None:
        number = (self.told if self.endless else cells[self.done]) + 1
        limit = "" if wanted < 0 else f" of {wanted}"
        self.part.behaviour.feedback_message = f"{self.part.behaviour._counted} {number}{limit}"

    def count(self, cells: Cells) -> None:
        if self.endless:
            self.told += 1
        else:
            cells[self.done] += 1

    def end(self, outcome: int, cells: Cells) -> int:
        cells[self.done] = self.told = 0
        cells[self.part.at] = outcome
        return outcome
