"""The decorators of Nav2 that tick their child again after some time, or after an event in the world."""

import math
from typing import Final

from sar_compiler.runtime.kernel.cells import ENDED, FAILURE, RUNNING, SUCCESS
from sar_compiler.runtime.kernel.timing import COUNTING, Countdown
from sar_compiler.runtime.kernel.tree_nodes import DecoratorNode, NodeBuilder, OwnNode, Ticker

NO_PERIOD: Final = 0.0


class RateNode(DecoratorNode):
    """Ticks the child at the start, while the child is running, and one period after its last success.

    Attributes:
        period: The cell that stores the period in seconds. The period is read at each start.
    """

    asks_whether_it_starts = True

    def __init__(self, part: NodeBuilder) -> None:
        super().__init__(part)
        self.timer = Countdown(part)
        self.period = part.value(NO_PERIOD)

    def branch_count(self, ticker: Ticker) -> int:
        """Return the number of possible results of the timer check."""
        waits = not self.starts(ticker) and ticker.cells[self.child.status_cell] != RUNNING
        return self.timer.branch_count(ticker) if waits else 1

    def begin(self, ticker: Ticker) -> int:
        """Tick the child at the start, while it is running, or when the period has passed."""
        cells = ticker.cells
        if self.starts(ticker):
            rate: float = self.behaviour.hz.get()
            ticker.values[self.period] = 1.0 / rate if rate else math.inf
            self.wait(ticker)
        elif cells[self.child.status_cell] != RUNNING and not self.timer.is_up(ticker):
            self.behaviour.feedback_message = (
                self.timer.remaining_message(ticker) if cells[self.timer.state] == COUNTING else ""
            )
            return self.set_outcome(ticker, RUNNING)
        self.behaviour.feedback_message = ""
        return super().begin(ticker)

    def on_child_outcome(self, ticker: Ticker, outcome: int) -> int:
        """Return the child's outcome. If the child has succeeded, begin the next period."""
        if outcome == SUCCESS:
            self.wait(ticker)
        return self.set_outcome(ticker, outcome)

    def wait(self, ticker: Ticker) -> None:
        """Start the timer with the period. If the period is infinite, the timer never expires."""
        period: float = ticker.values[self.period]
        if period == math.inf:
            self.timer.stop(ticker)
        else:
            self.timer.start(period, ticker)

    def reset_outcome(self, ticker: Ticker) -> None:
        """Reset the node's outcome and period."""
        super().reset_outcome(ticker)
        self.reset_cells(ticker)


class SingleTriggerNode(DecoratorNode):
    """Ticks its child until the child has ended once, and then fails until the node's parent resets it.

    Attributes:
        done: The cell that contains 1 once the child has ended.
    """

    asks_whether_it_starts = True

    def __init__(self, part: NodeBuilder) -> None:
        super().__init__(part)
        self.done = part.cell()

    def begin(self, ticker: Ticker) -> int:
        """Tick the child, or return FAILURE if the child has already ended."""
        if self.starts(ticker):
            self.reset_cells(ticker)
        return self.set_outcome(ticker, FAILURE) if ticker.cells[self.done] else super().begin(ticker)

    def on_child_outcome(self, ticker: Ticker, outcome: int) -> int:
        """Return the child's outcome, and store whether the child has ended."""
        if outcome & ENDED:
            ticker.cells[self.done] = 1
        return self.set_outcome(ticker, outcome)

    def reset_outcome(self, ticker: Ticker) -> None:
        """Reset the node's outcome and cells."""
        super().reset_outcome(ticker)
        self.reset_cells(ticker)


class AskingNode(OwnNode):
    """A decorator with an extra leaf that represents the world. The leaf's outcome decides whether the child is ticked.

    Attributes:
        asked: The leaf that represents the world.
        child: The child.
        asking: The cell that contains 1 while the leaf is ticked.
        waits: Whether the leaf waits for an event, and therefore is not reset when it returns RUNNING.
    """

    def __init__(self, part: NodeBuilder) -> None:
        super().__init__(part)
        self.asked, self.child = part.children
        self.asking = part.cell(of_tick=True)
        self.waits = False

    def tick_query(self, ticker: Ticker) -> int:
        """Tick the leaf that represents the world. Return the decorator's outcome, or CALLED."""
        ticker.cells[self.asking] = 1
        return self.tick_child(self.asked, ticker)

    def resume(self, ticker: Ticker, outcome: int) -> int:
        """Process the outcome of the leaf or of the child, and reset the one that has ended."""
        if ticker.cells[self.asking]:
            ticker.cells[self.asking] = 0
            if outcome != RUNNING or not self.waits:
                self.asked.reset_outcome(ticker)
            return self.on_query_outcome(ticker, outcome)
        if outcome & ENDED:
            self.child.reset_outcome(ticker)
        return self.set_outcome(ticker, outcome)

    def on_query_outcome(self, ticker: Ticker, outcome: int) -> int:
        """Process the outcome of the leaf. Return the decorator's outcome, or CALLED to tick the child first."""
        raise NotImplementedError

    def reset_cells(self, ticker: Ticker) -> None:
        """Reset the cells of the node, and reset the leaf that represents the world."""
        super().reset_cells(ticker)
        self.asked.reset_outcome(ticker)


class WhenDueNode(AskingNode):
    """Ticks the child at the start, while the child is running, and when an extra leaf succeeds."""

    asks_whether_it_starts = True

    def __init__(self, part: NodeBuilder) -> None:
        super().__init__(part)
        self.waits = True

    def begin(self, ticker: Ticker) -> int:
        """Tick the child in the first tick and while it is running. In other ticks, tick the extra leaf."""
        cells, starts = ticker.cells, self.starts(ticker)
        cells[self.status_cell] = RUNNING
        if starts or cells[self.child.status_cell] == RUNNING:
            return self.tick_child(self.child, ticker)
        return self.tick_query(ticker)

    def on_query_outcome(self, ticker: Ticker, outcome: int) -> int:
        """Tick the child if the extra leaf has succeeded. Otherwise return RUNNING."""
        return self.tick_child(self.child, ticker) if outcome == SUCCESS else RUNNING


class DistanceNode(AskingNode):
    """Ticks the child at the start, while the child is running, and when the robot has driven far enough.

    The node ticks the extra leaf in every tick, and fails without halting the child if the robot's position is unknown.

    Attributes:
        is_first: The cell that contains 1 in the first tick of an activation, while the leaf is ticked.
    """

    asks_whether_it_starts = True

    def __init__(self, part: NodeBuilder) -> None:
        super().__init__(part)
        self.is_first = part.cell(of_tick=True)

    def begin(self, ticker: Ticker) -> int:
        """Tick the leaf that compares the robot's position with an earlier position."""
        ticker.cells[self.is_first] = int(self.starts(ticker))
        ticker.cells[self.status_cell] = RUNNING
        return self.tick_query(ticker)

    def on_query_outcome(self, ticker: Ticker, outcome: int) -> int:
        """Tick the child if this is the start, the child is running, or the robot has driven far enough."""
        cells = ticker.cells
        starts, cells[self.is_first] = cells[self.is_first], 0
        if outcome == FAILURE:
            return self.set_outcome(ticker, FAILURE)
        if starts or cells[self.child.status_cell] == RUNNING or outcome == SUCCESS:
            return self.tick_child(self.child, ticker)
        return RUNNING


class LongerPathNode(AskingNode):
    """Ticks the child if the path has become longer close to the goal. Otherwise returns SUCCESS.

    A running child is not halted when the path has not become longer.

    Attributes:
        seen: The cell that contains 1 after the first path. The value remains when the node ends or is halted.
    """

    def __init__(self, part: NodeBuilder) -> None:
        super().__init__(part)
        self.seen = part.cell(keeps=True)

    def begin(self, ticker: Ticker) -> int:
        """Tick the leaf that compares the path with the previous one. Succeed if there is no previous path."""
        cells = ticker.cells
        cells[self.status_cell] = RUNNING
        if cells[self.seen]:
            return self.tick_query(ticker)
        cells[self.seen] = 1
        return self.set_outcome(ticker, SUCCESS)

    def on_query_outcome(self, ticker: Ticker, outcome: int) -> int:
        """Tick the child if the path has become longer. Otherwise return SUCCESS."""
        if outcome == SUCCESS:
            return self.tick_child(self.child, ticker)
        return self.set_outcome(ticker, SUCCESS)
