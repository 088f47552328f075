"""Decorators of Nav2: they tick their child now and then, by the clock or by what happens in the world."""

import math
from typing import Final

from sar_compiler.runtime.kernel.cells import ENDED, FAILURE, RUNNING, SUCCESS
from sar_compiler.runtime.kernel.timing import COUNTING, Countdown
from sar_compiler.runtime.kernel.tree_nodes import DecoratorNode, NodeBuilder, OwnNode, Ticker

NO_PERIOD: Final = 0.0


class RateNode(DecoratorNode):
    """Ticks its child when it starts, while that runs, and when a period is over since it last succeeded.

    Attributes:
        period: The cell with the period, in seconds, that the last start has read.
    """

    asks_whether_it_starts = True

    def __init__(self, part: NodeBuilder) -> None:
        super().__init__(part)
        self.timer = Countdown(part)
        self.period = part.value(NO_PERIOD)

    def ways(self, ticker: Ticker) -> int:
        """Return whether the time may be over, or not."""
        waits = not self.starts(ticker) and ticker.cells[self.child.at] != RUNNING
        return self.timer.ways(ticker) if waits else 1

    def begin(self, ticker: Ticker) -> int:
        """Tick the child if it is due."""
        cells = ticker.cells
        if self.starts(ticker):
            rate: float = self.behaviour.hz.get()
            ticker.values[self.period] = 1.0 / rate if rate else math.inf
            self.wait(ticker)
        elif cells[self.child.at] != RUNNING and not self.timer.is_up(ticker):
            self.behaviour.feedback_message = (
                self.timer.left(ticker) if cells[self.timer.state] == COUNTING else ""
            )
            return self.come_to(ticker, RUNNING)
        self.behaviour.feedback_message = ""
        return super().begin(ticker)

    def after(self, ticker: Ticker, outcome: int) -> int:
        """Pass the outcome on; a success begins the next period."""
        if outcome == SUCCESS:
            self.wait(ticker)
        return self.come_to(ticker, outcome)

    def wait(self, ticker: Ticker) -> None:
        """Begin a period; one without an end is never over."""
        period: float = ticker.values[self.period]
        if period == math.inf:
            self.timer.stop(ticker)
        else:
            self.timer.start(period, ticker)

    def rest(self, ticker: Ticker) -> None:
        """Forget how the node has ended, and the period."""
        super().rest(ticker)
        self.forget(ticker)


class SingleTriggerNode(DecoratorNode):
    """Lets its child end once; ticked again before its parent has reset it, it fails.

    Attributes:
        done: The cell with 1 when the child has ended.
    """

    asks_whether_it_starts = True

    def __init__(self, part: NodeBuilder) -> None:
        super().__init__(part)
        self.done = part.cell()

    def begin(self, ticker: Ticker) -> int:
        """Tick the child, unless it has ended."""
        if self.starts(ticker):
            self.forget(ticker)
        return self.come_to(ticker, FAILURE) if ticker.cells[self.done] else super().begin(ticker)

    def after(self, ticker: Ticker, outcome: int) -> int:
        """Pass the outcome on."""
        if outcome & ENDED:
            ticker.cells[self.done] = 1
        return self.come_to(ticker, outcome)

    def rest(self, ticker: Ticker) -> None:
        """Forget how the node has ended."""
        super().rest(ticker)
        self.forget(ticker)


class AskingNode(OwnNode):
    """A decorator that asks, before it ticks its child, a leaf that represents the world.

    Attributes:
        asked: The leaf.
        child: The child.
        asking: The cell with 1 while the leaf is in hand.
        waits: Whether the leaf runs on while it answers RUNNING, as somebody who waits for what comes one day.
    """

    def __init__(self, part: NodeBuilder) -> None:
        super().__init__(part)
        self.asked, self.child = part.children
        self.asking = part.cell(of_tick=True)
        self.waits = False

    def ask(self, ticker: Ticker) -> int:
        """Tick the leaf; return the decorator's outcome, or CALLED."""
        ticker.cells[self.asking] = 1
        return self.tick_child(self.asked, ticker)

    def resume(self, ticker: Ticker, outcome: int) -> int:
        """Go on after the leaf or the child, which are left at rest if they have ended."""
        if ticker.cells[self.asking]:
            ticker.cells[self.asking] = 0
            if outcome != RUNNING or not self.waits:
                self.asked.rest(ticker)
            return self.take_answer(ticker, outcome)
        if outcome & ENDED:
            self.child.rest(ticker)
        return self.come_to(ticker, outcome)

    def take_answer(self, ticker: Ticker, outcome: int) -> int:
        """Return the outcome, given the answer of the leaf."""
        raise NotImplementedError

    def forget(self, ticker: Ticker) -> None:
        """Ask no more."""
        super().forget(ticker)
        self.asked.rest(ticker)


class WhenDueNode(AskingNode):
    """Ticks its child when it starts, while that runs, and when it is due; asks only where that decides."""

    asks_whether_it_starts = True

    def __init__(self, part: NodeBuilder) -> None:
        super().__init__(part)
        self.waits = True

    def begin(self, ticker: Ticker) -> int:
        """Tick the child, or ask whether it is due."""
        cells, starts = ticker.cells, self.starts(ticker)
        cells[self.at] = RUNNING
        if starts or cells[self.child.at] == RUNNING:
            return self.tick_child(self.child, ticker)
        return self.ask(ticker)

    def take_answer(self, ticker: Ticker, outcome: int) -> int:
        """Tick the child if it is due."""
        return self.tick_child(self.child, ticker) if outcome == SUCCESS else RUNNING


class DistanceNode(AskingNode):
    """Ticks its child when it starts, while that runs, and when the robot has driven far enough.

    It asks in every tick, and fails if the robot does not know where it is; a child that runs stays as it is then.

    Attributes:
        is_first: The cell with 1 in the first tick of an activation, while it asks.
    """

    asks_whether_it_starts = True

    def __init__(self, part: NodeBuilder) -> None:
        super().__init__(part)
        self.is_first = part.cell(of_tick=True)

    def begin(self, ticker: Ticker) -> int:
        """Ask where the robot is."""
        ticker.cells[self.is_first] = int(self.starts(ticker))
        ticker.cells[self.at] = RUNNING
        return self.ask(ticker)

    def take_answer(self, ticker: Ticker, outcome: int) -> int:
        """Tick the child if that is due."""
        cells = ticker.cells
        starts, cells[self.is_first] = cells[self.is_first], 0
        if outcome == FAILURE:
            return self.come_to(ticker, FAILURE)
        if starts or cells[self.child.at] == RUNNING or outcome == SUCCESS:
            return self.tick_child(self.child, ticker)
        return RUNNING


class LongerPathNode(AskingNode):
    """Succeeds without its child until the path becomes longer close to the goal; then it ticks the child.

    Nothing halts a child that runs when the path is no longer such a one.

    Attributes:
        seen: The cell with 1 once it has seen a path; it outlasts every end and halt.
    """

    def __init__(self, part: NodeBuilder) -> None:
        super().__init__(part)
        self.seen = part.cell(keeps=True)

    def begin(self, ticker: Ticker) -> int:
        """Ask how long the path is, if there is another one to compare it with."""
        cells = ticker.cells
        cells[self.at] = RUNNING
        if cells[self.seen]:
            return self.ask(ticker)
        cells[self.seen] = 1
        return self.come_to(ticker, SUCCESS)

    def take_answer(self, ticker: Ticker, outcome: int) -> int:
        """Tick the child if the path has become longer."""
        if outcome == SUCCESS:
            return self.tick_child(self.child, ticker)
        return self.come_to(ticker, SUCCESS)
