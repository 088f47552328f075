"""Nodes that measure time."""

from typing import Any, Final

from sar_compiler.errors import NodeError
from sar_compiler.runtime.kernel.cells import ENDED, FAILURE, RUNNING, SUCCESS
from sar_compiler.runtime.kernel.tree_nodes import ChildlessNode, DecoratorNode, NodeBuilder, Ticker, reset

OFF: Final = 0
COUNTING: Final = 1
UP: Final = 2
UNLIMITED: Final = 3
_MILLISECONDS: Final = 1000.0
_TENTHS: Final = 10.0
_HALF: Final = 0.5
_CLOSE: Final = 1e-6


class DurationError(NodeError):
    """A node is to wait for less than no time."""


def seconds_of(behaviour: Any, port: str) -> float:
    """Return how long a node is to wait, in seconds.

    Raises:
        DurationError: If that is less than no time.
    """
    milliseconds: int = getattr(behaviour, port).get()
    if milliseconds < 0:
        message = f"'{behaviour.name}' is to wait {milliseconds} milliseconds; {port} is 0 or more"
        raise DurationError(message, behaviour.name)
    return milliseconds / _MILLISECONDS


class Countdown:
    """A node's timer: a cell with what it does, and one with its token while it counts.

    It is not asked again once it was up.

    Args:
        part: The node.
    """

    def __init__(self, part: NodeBuilder) -> None:
        self.index = part.index
        self.state = part.cell(OFF)
        self.token = part.value(0)
        # What was told last, and of how many tenths of a second: a tree may tick thousands of times in one.
        self.tenths = -1
        self.told = ""

    def start(self, seconds: float, ticker: Ticker) -> None:
        """Begin to count from a number of seconds."""
        ticker.cells[self.state] = COUNTING
        ticker.values[self.token] = ticker.times.start(self.index, seconds)

    def is_up(self, ticker: Ticker) -> bool:
        """Return whether the time is over."""
        counts = ticker.cells[self.state] == COUNTING
        if counts and ticker.times.is_up(self.index, ticker.values[self.token]):
            self.stop(ticker, UP)
        return ticker.cells[self.state] == UP

    def ways(self, ticker: Ticker) -> int:
        """Return in how many ways it may go on to count."""
        return ticker.times.ways() if ticker.cells[self.state] == COUNTING else 1

    def left(self, ticker: Ticker) -> str:
        """Return the feedback message about the time that is left."""
        if not ticker.tells:
            return ""
        seconds = ticker.times.remaining(self.index, ticker.values[self.token])
        tenths = int(seconds * _TENTHS + _HALF)
        # Halfway between two tenths, the digits that are printed depend on more than this sum.
        if tenths != self.tenths or abs(seconds * _TENTHS + _HALF - tenths) < _CLOSE:
            self.tenths, self.told = tenths, f"remaining: {seconds:.1f}s"
        return self.told

    def stop(self, ticker: Ticker, state: int = OFF) -> None:
        """Count no more."""
        ticker.cells[self.state] = state
        ticker.values[self.token] = 0


class TimedNode(DecoratorNode):
    """A decorator with a timer, which counts while the node runs."""

    def __init__(self, part: NodeBuilder) -> None:
        super().__init__(part)
        self.timer = Countdown(part)

    def ways(self, ticker: Ticker) -> int:
        """Return whether the time may be over, or not."""
        return self.timer.ways(ticker)


class DelayNode(TimedNode):
    """Waits before it ticks its child for the first time."""

    def begin(self, ticker: Ticker) -> int:
        """Tick the child if the time is over."""
        behaviour, timer = self.behaviour, self.timer
        if ticker.cells[timer.state] == OFF:
            seconds = seconds_of(behaviour, "delay_msec")
            timer.start(seconds, ticker)
            if not seconds:
                behaviour.wake()
        elif timer.is_up(ticker):
            behaviour.feedback_message = ""
            return self.tick_child(self.child, ticker)
        behaviour.feedback_message = timer.left(ticker)
        return self.come_to(ticker, RUNNING)

    def after(self, ticker: Ticker, outcome: int) -> int:
        """Pass the outcome on; after an end, the next start waits again."""
        if outcome & ENDED:
            self.timer.stop(ticker)
        return self.come_to(ticker, outcome)


class TimeoutNode(TimedNode):
    """Fails if its child is still running after a time; the child is halted without another tick."""

    def begin(self, ticker: Ticker) -> int:
        """Tick the child, unless it runs and its time is over."""
        cells, timer = ticker.cells, self.timer
        if cells[timer.state] == OFF:
            self.start(ticker)
        elif timer.is_up(ticker):
            if cells[self.child.at] == RUNNING:
                return self.time_out(ticker)
            self.start(ticker)
        limited = cells[timer.state] == COUNTING
        self.behaviour.feedback_message = timer.left(ticker) if limited else ""
        return self.tick_child(self.child, ticker)

    def start(self, ticker: Ticker) -> None:
        """Start the timer; with no seconds at all there is no limit."""
        seconds = seconds_of(self.behaviour, "msec")
        if seconds:
            self.timer.start(seconds, ticker)
        else:
            self.timer.stop(ticker, UNLIMITED)
        ticker.cells[self.at] = RUNNING

    def time_out(self, ticker: Ticker) -> int:
        """Halt the child, and fail."""
        self.timer.stop(ticker)
        reset(self.child, ticker)
        self.behaviour.feedback_message = "timed out"
        return self.come_to(ticker, FAILURE)

    def after(self, ticker: Ticker, outcome: int) -> int:
        """Pass the outcome on."""
        if outcome & ENDED:
            self.timer.stop(ticker)
            self.behaviour.feedback_message = ""
        return self.come_to(ticker, outcome)


class SleepNode(ChildlessNode):
    """A leaf that waits, then succeeds; it tells nothing any more when it is stopped."""

    def __init__(self, part: NodeBuilder) -> None:
        super().__init__(part)
        self.timer = Countdown(part)

    def ways(self, ticker: Ticker) -> int:
        """Return whether the time may be over, or not; it may be as soon as it has started."""
        return ticker.times.ways()

    def begin(self, ticker: Ticker) -> int:
        """Look at the time."""
        cells, timer = ticker.cells, self.timer
        if cells[self.at] != RUNNING:
            timer.start(self.seconds(), ticker)
        if timer.is_up(ticker):
            self.tell(ticker, "")
            timer.stop(ticker)
            cells[self.at] = SUCCESS
            return SUCCESS
        self.tell(ticker, timer.left(ticker))
        cells[self.at] = RUNNING
        return RUNNING

    def stop(self, ticker: Ticker) -> None:
        """Stop waiting."""
        super().stop(ticker)
        self.silence()

    def seconds(self) -> float:
        """Return how long to wait, in seconds."""
        return seconds_of(self.behaviour, "msec")

    def tell(self, ticker: Ticker, left: str) -> None:
        """Set the feedback message to the time that is left; empty at the end."""
        if ticker.tells:
            self.behaviour.feedback_message = left

    def silence(self) -> None:
        """Tell nothing any more, because the node is stopped."""
        self.behaviour.feedback_message = ""


class TimerNode(SleepNode):
    """A Timer, which tells what py_trees' own does, and goes on telling it when it is stopped."""

    def seconds(self) -> float:
        """Return how long to run, in seconds."""
        return float(self.behaviour.duration)

    def tell(self, ticker: Ticker, left: str) -> None:
        """Set the feedback message."""
        if not ticker.tells:
            return
        behaviour = self.behaviour
        behaviour.feedback_message = "still running" if left else f"timer ran out [{behaviour.duration}]"

    def silence(self) -> None:
        """Go on telling it."""
