"""Decorators of Nav2 that tick their child repeatedly, by the clock or by events in the world."""

import math
from typing import Final

from sar_compiler.runtime.kernel.cells import ENDED, FAILURE, RUNNING, SUCCESS
from sar_compiler.runtime.kernel.timing import COUNTING, Countdown
from sar_compiler.runtime.kernel.tree_nodes import DecoratorNode, NodeBuilder, OwnNode, Ticker

NO_PERIOD: Final = 0.0


class RateNode(DecoratorNode):
    """Ticks its child at the start, while the child runs, and a period after the last success.

    Attributes:
        period: The cell with the period, in seconds, as read at the last start.
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
        """Tick the child if it is due."""
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
        """Pass on the outcome; a success begins the next period."""
        if outcome == SUCCESS:
            self.wait(ticker)
        return self.set_outcome(ticker, outcome)

    def wait(self, ticker: Ticker) -> None:
        """Begin a period; an infinite one never ends."""
        period: float = ticker.values[self.period]
        if period == math.inf:
            self.timer.stop(ticker)
        else:
            self.timer.start(period, ticker)

    def reset_outcome(self, ticker: Ticker) -> None:
        """Reset the node's outcome, and the period."""
        super().reset_outcome(ticker)
        self.reset_cells(ticker)


class SingleTriggerNode(DecoratorNode):
    """Lets its child end once; if it is ticked again before its parent has reset it, it fails.

    Attributes:
        done: The cell with 1 once the child has ended.
    """

    asks_whether_it_starts = True

    def __init__(self, part: NodeBuilder) -> None:
        super().__init__(part)
        self.done = part.cell()

    def begin(self, ticker: Ticker) -> int:
        """Tick the child, unless it has ended."""
        if self.starts(ticker):
            self.reset_cells(ticker)
        return self.set_outcome(ticker, FAILURE) if ticker.cells[self.done] else super().begin(ticker)

    def on_child_outcome(self, ticker: Ticker, outcome: int) -> int:
        """Pass on the outcome."""
        if outcome & ENDED:
            ticker.cells[self.done] = 1
        return self.set_outcome(ticker, outcome)

    def reset_outcome(self, ticker: Ticker) -> None:
        """Reset the node's outcome."""
        super().reset_outcome(ticker)
        self.reset_cells(ticker)


class AskingNode(OwnNode):
    """A decorator that first queries a leaf, which represents the world, and then decides about its child.

    Attributes:
        asked: The leaf.
        child: The child.
        asking: The cell with 1 while the leaf is ticked.
        waits: Whether the leaf stays running when it returns RUNNING, because it waits for an event.
    """

    def __init__(self, part: NodeBuilder) -> None:
        super().__init__(part)
        self.asked, self.child = part.children
        self.asking = part.cell(of_tick=True)
        self.waits = False

    def tick_query(self, ticker: Ticker) -> int:
        """Tick the leaf; return the decorator's outcome, or CALLED."""
        ticker.cells[self.asking] = 1
        return self.tick_child(self.asked, ticker)

    def resume(self, ticker: Ticker, outcome: int) -> int:
        """Continue after the leaf or the child, which are reset if they have ended."""
        if ticker.cells[self.asking]:
            ticker.cells[self.asking] = 0
            if outcome != RUNNING or not self.waits:
                self.asked.reset_outcome(ticker)
            return self.on_query_outcome(ticker, outcome)
        if outcome & ENDED:
            self.child.reset_outcome(ticker)
        return self.set_outcome(ticker, outcome)

    def on_query_outcome(self, ticker: Ticker, outcome: int) -> int:
        """Return the outcome, given the result of the leaf."""
        raise NotImplementedError

    def reset_cells(self, ticker: Ticker) -> None:
        """Stop querying."""
        super().reset_cells(ticker)
        self.asked.reset_outcome(ticker)


class WhenDueNode(AskingNode):
    """Ticks its child at the start, while the child runs, and when it is due; queries the leaf only if that decides."""

    asks_whether_it_starts = True

    def __init__(self, part: NodeBuilder) -> None:
        super().__init__(part)
        self.waits = True

    def begin(self, ticker: Ticker) -> int:
        """Tick the child, or query whether it is due."""
        cells, starts = ticker.cells, self.starts(ticker)
        cells[self.status_cell] = RUNNING
        if starts or cells[self.child.status_cell] == RUNNING:
            return self.tick_child(self.child, ticker)
        return self.tick_query(ticker)

    def on_query_outcome(self, ticker: Ticker, outcome: int) -> int:
        """Tick the child if it is due."""
        return self.tick_child(self.child, ticker) if outcome == SUCCESS else RUNNING


class DistanceNode(AskingNode):
    """Ticks its child at the start, while the child runs, and when the robot has driven far enough.

    It queries in every tick, and fails if the robot's position is unknown; a running child is then left unchanged.

    Attributes:
        is_first: The cell with 1 in the first tick of an activation, during the query.
    """

    asks_whether_it_starts = True

    def __init__(self, part: NodeBuilder) -> None:
        super().__init__(part)
        self.is_first = part.cell(of_tick=True)

    def begin(self, ticker: Ticker) -> int:
        """Query the robot's position."""
        ticker.cells[self.is_first] = int(self.starts(ticker))
        ticker.cells[self.status_cell] = RUNNING
        return self.tick_query(ticker)

    def on_query_outcome(self, ticker: Ticker, outcome: int) -> int:
        """Tick the child if it is due."""
        cells = ticker.cells
        starts, cells[self.is_first] = cells[self.is_first], 0
        if outcome == FAILURE:
            return self.set_outcome(ticker, FAILURE)
        if starts or cells[self.child.status_cell] == RUNNING or outcome == SUCCESS:
            return self.tick_child(self.child, ticker)
        return RUNNING


class LongerPathNode(AskingNode):
    """Succeeds without its child until the path becomes longer close to the goal; then it ticks the child.

    A running child is not halted when that is no longer the case.

    Attributes:
        seen: The cell with 1 once it has seen a path; it is kept after every end and halt.
    """

    def __init__(self, part: NodeBuilder) -> None:
        super().__init__(part)
        self.seen = part.cell(keeps=True)

    def begin(self, ticker: Ticker) -> int:
        """Query the length of the path, if there is an earlier path to compare it with."""
        cells = ticker.cells
        cells[self.status_cell] = RUNNING
        if cells[self.seen]:
            return self.tick_query(ticker)
        cells[self.seen] = 1
        return self.set_outcome(ticker, SUCCESS)

    def on_query_outcome(self, ticker: Ticker, outcome: int) -> int:
        """Tick the child if the path has become longer."""
        if outcome == SUCCESS:
            return self.tick_child(self.child, ticker)
        return self.set_outcome(ticker, SUCCESS)
