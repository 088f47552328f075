"""The decorators of BehaviorTree.CPP that restart their child after it has ended."""

from collections import deque
from typing import Any, Final

from sar_compiler.runtime.frozen import freeze, thaw
from sar_compiler.runtime.kernel.cells import FAILURE, RUNNING, SKIPPED, SUCCESS, number_of
from sar_compiler.runtime.kernel.tree_nodes import DecoratorNode, NodeBuilder, Ticker, reset
from sar_compiler.runtime.queues import QueueError, queue_items
from sar_compiler.runtime.tokens import excerpt

_ENDLESS: Final = -1


class RepeatingNode(DecoratorNode):
    """Restarts the child after the outcome `goes_on`, up to a maximum number of times. Other outcomes end the node.

    Args:
        part: The builder of the node.
        times: The port with the maximum number of repetitions; -1 for no limit.
        goes_on: The outcome after which the child is restarted.
        noun: The noun for a repetition in the feedback message.

    Attributes:
        done: The cell that stores the number of repetitions so far.
        wanted: The cell that stores the maximum number of repetitions plus 2; used only during a tick.
        before: The cell that stores the status of the child before it was ticked; used only during a tick.
        fixed: The maximum number if it is a constant; otherwise `times` is read in each tick.
        shown: The number of repetitions of a node without a limit. It is only shown in the message, and not stored in a cell.
    """

    def __init__(self, part: NodeBuilder, times: Any, goes_on: int, noun: str) -> None:
        super().__init__(part)
        self.times = times
        self.goes_on = goes_on
        self.noun = noun
        self.done, self.wanted, self.before = part.cell(), part.cell(), part.cell()
        self.is_fixed: bool = self.times.entry is None
        self.fixed: int = self.times.get() if self.is_fixed else 0
        self.endless = self.is_fixed and self.fixed == _ENDLESS
        self.shown = 0

    def begin(self, ticker: Ticker) -> int:
        """Read the maximum number of repetitions, and tick the child."""
        wanted: int = self.fixed if self.is_fixed else self.times.get()
        ticker.cells[self.status_cell] = RUNNING
        return self.tick_again(ticker, wanted)

    def tick_again(self, ticker: Ticker, wanted: int) -> int:
        """Tick the child, or end the node if the maximum number of repetitions is reached."""
        cells = ticker.cells
        if not self.is_short(ticker, wanted):
            return self.end_with(ticker, self.goes_on)
        self.report_repetitions(ticker, wanted)
        cells[self.wanted] = wanted + 2
        cells[self.before] = cells[self.child.status_cell]
        return self.tick_child(self.child, ticker)

    def is_short(self, ticker: Ticker, wanted: int) -> bool:
        """Return whether the number of repetitions is still below the maximum."""
        return wanted == _ENDLESS or ticker.cells[self.done] < wanted

    def on_child_outcome(self, ticker: Ticker, outcome: int) -> int:
        """After the outcome `goes_on`, count a repetition and tick the child again. Return any other outcome."""
        cells = ticker.cells
        wanted, was_running = cells[self.wanted] - 2, cells[self.before] == RUNNING
        cells[self.wanted] = cells[self.before] = 0
        if outcome == RUNNING:
            return RUNNING
        if outcome == SKIPPED:
            reset(self.child, ticker)
            return SKIPPED
        if outcome != self.goes_on:
            return self.end_with(ticker, outcome)
        self.count_repetition(ticker)
        wanted = self.read_again(wanted)
        if not was_running and self.is_short(ticker, wanted):
            self.behaviour.wake()
            return RUNNING
        return self.tick_again(ticker, wanted)

    def read_again(self, wanted: int) -> int:
        """Return the maximum number of repetitions, which may have changed during the last repetition."""
        return wanted

    def report_repetitions(self, ticker: Ticker, wanted: int) -> None:
        """Report the number of repetitions as the feedback message."""
        if not ticker.tells:
            return
        number = (self.shown if self.endless else ticker.cells[self.done]) + 1
        limit = "" if wanted < 0 else f" of {wanted}"
        self.behaviour.feedback_message = f"{self.noun} {number}{limit}"

    def count_repetition(self, ticker: Ticker) -> None:
        """Increase the number of repetitions by one."""
        if self.endless:
            self.shown += 1
        else:
            ticker.cells[self.done] += 1

    def end_with(self, ticker: Ticker, outcome: int) -> int:
        """End the node with an outcome."""
        self.reset_cells(ticker)
        return self.set_outcome(ticker, outcome)

    def reset_cells(self, ticker: Ticker) -> None:
        """Reset the number of repetitions."""
        super().reset_cells(ticker)
        self.shown = 0


class RepeatNode(RepeatingNode):
    """Restarts its child after a success."""

    def __init__(self, part: NodeBuilder) -> None:
        super().__init__(part, part.behaviour.num_cycles, SUCCESS, "cycle")


class RetryNode(RepeatingNode):
    """Restarts the child after a failure. The child may change the maximum number of attempts."""

    def __init__(self, part: NodeBuilder) -> None:
        super().__init__(part, part.behaviour.num_attempts, FAILURE, "attempt")

    def read_again(self, wanted: int) -> int:
        """Return the maximum number of attempts, which the child may have changed in the last attempt."""
        again: int = wanted if self.is_fixed else self.times.get(wanted)
        return again


_UNSEEN: Final = 0
"""A marker for a queue that has not been read yet."""


class LoopNode(DecoratorNode):
    """Runs the child once for each item of a queue. The tag determines the type of the items.

    Attributes:
        left: The cell that stores the remaining items.
        child_runs: The cell that contains 1 while the child runs.
    """

    asks_whether_it_starts = True

    def __init__(self, part: NodeBuilder) -> None:
        super().__init__(part)
        queue = part.behaviour.queue
        self.literal: Any = _freeze_items(self.read(queue.get())) if queue.entry is None else _UNSEEN
        self.left, self.child_runs = part.value(_UNSEEN), part.cell()

    def begin(self, ticker: Ticker) -> int:
        """Tick the child. If the child is not running, write the next item first."""
        cells = ticker.cells
        if self.starts(ticker):
            ticker.values[self.left] = self.literal
            cells[self.child_runs] = 0
        if not cells[self.child_runs] and not self.next_item(ticker):
            return self.end(ticker)
        return super().begin(ticker)

    def on_child_outcome(self, ticker: Ticker, outcome: int) -> int:
        """Return FAILURE if the child has failed, otherwise RUNNING."""
        ticker.cells[self.child_runs] = int(outcome == RUNNING)
        return self.set_outcome(ticker, FAILURE if outcome == FAILURE else RUNNING)

    def end(self, ticker: Ticker) -> int:
        """Return the configured outcome when no item is left."""
        behaviour = self.behaviour
        behaviour.feedback_message = "no item left"
        return self.set_outcome(ticker, number_of(behaviour.if_empty.get().status) or SKIPPED)

    def next_item(self, ticker: Ticker) -> bool:
        """Write the next item to the output port. Return False if no item is left."""
        values = ticker.values
        shared = self.shared_queue(ticker)
        if not (values[self.left] if shared is None else shared):
            return False
        if shared is None:
            first, *others = values[self.left]
            raw, values[self.left] = thaw(first), tuple(others)
        else:
            raw = shared.popleft()
            values[self.left] = _freeze_items(shared)
        self.write(raw, len(values[self.left]))
        return True

    def read(self, queue: object) -> list[Any]:
        """Return the items of a queue.

        Raises:
            QueueError: If the value is not a queue, or an item has the wrong type.
        """
        try:
            return queue_items(queue, self.behaviour.kind)
        except QueueError as error:
            message = f"'{self.behaviour.name}': queue: {error}"
            raise QueueError(message, self.behaviour.name) from None

    def write(self, raw: object, left: int) -> None:
        """Write an item to the output port. Show the item and the number of remaining items in the message."""
        behaviour = self.behaviour
        (item,) = self.read([raw])
        if behaviour.value is not None:
            behaviour.value.set(item)
        behaviour.feedback_message = f"item {excerpt(str(item))}, {left} left"

    def shared_queue(self, ticker: Ticker) -> Any:
        """Return the queue if this node shares it with other nodes, or None if this node has a copy of the items."""
        if self.literal != _UNSEEN:
            return None
        queue = self.behaviour.queue.get()
        if isinstance(queue, deque):
            return queue
        if ticker.values[self.left] == _UNSEEN:
            ticker.values[self.left] = _freeze_items(self.read(queue))
        return None


def _freeze_items(items: Any) -> tuple[Any, ...]:
    return tuple(freeze(item) for item in items)
