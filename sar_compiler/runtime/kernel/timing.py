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
    """Raised if the duration of a node is negative."""


def seconds_of(behaviour: Any, port: str) -> float:
    """Return the duration in a node's port, converted from milliseconds to seconds.

    Raises:
        DurationError: If the duration is negative.
    """
    milliseconds: int = getattr(behaviour, port).get()
    if milliseconds < 0:
        message = f"'{behaviour.name}' cannot wait {milliseconds} milliseconds. Write 0 or more as {port}"
        raise DurationError(message, behaviour.name)
    return milliseconds / _MILLISECONDS


class Countdown:
    """The timer of a node. One cell stores the state of the timer, and another cell stores its token.

    A timer that has expired is not checked again.

    Args:
        part: The builder of the node.
    """

    def __init__(self, part: NodeBuilder) -> None:
        self.index = part.index
        self.state = part.cell(OFF)
        self.token = part.value(0)
        # The last message and its tenths of a second are cached, because a tree may tick thousands of times in a tenth.
        self.tenths = -1
        self.message = ""

    def start(self, seconds: float, ticker: Ticker) -> None:
        """Start the timer with a duration in seconds."""
        ticker.cells[self.state] = COUNTING
        ticker.values[self.token] = ticker.times.start(self.index, seconds)

    def is_up(self, ticker: Ticker) -> bool:
        """Return whether the timer has expired."""
        counts = ticker.cells[self.state] == COUNTING
        if counts and ticker.times.is_up(self.index, ticker.values[self.token]):
            self.stop(ticker, UP)
        return ticker.cells[self.state] == UP

    def branch_count(self, ticker: Ticker) -> int:
        """Return the number of possible results of the next call of `is_up`."""
        return ticker.times.branch_count() if ticker.cells[self.state] == COUNTING else 1

    def remaining_message(self, ticker: Ticker) -> str:
        """Return the feedback message about the remaining time."""
        if not ticker.tells:
            return ""
        seconds = ticker.times.remaining_sec(self.index, ticker.values[self.token])
        tenths = int(seconds * _TENTHS + _HALF)
        # Close to the middle between two tenths, a rounding error could make the cached digit wrong.
        if tenths != self.tenths or abs(seconds * _TENTHS + _HALF - tenths) < _CLOSE:
            self.tenths, self.message = tenths, f"remaining: {seconds:.1f}s"
        return self.message

    def stop(self, ticker: Ticker, state: int = OFF) -> None:
        """Stop the timer, and set the state of the timer to *state*."""
        ticker.cells[self.state] = state
        ticker.values[self.token] = 0


class TimedNode(DecoratorNode):
    """A decorator with a timer."""

    def __init__(self, part: NodeBuilder) -> None:
        super().__init__(part)
        self.timer = Countdown(part)

    def branch_count(self, ticker: Ticker) -> int:
        """Return the number of possible results of the timer check."""
        return self.timer.branch_count(ticker)


class DelayNode(TimedNode):
    """Waits for a given time before it ticks its child for the first time."""

    def begin(self, ticker: Ticker) -> int:
        """Tick the child if the timer has expired."""
        behaviour, timer = self.behaviour, self.timer
        if ticker.cells[timer.state] == OFF:
            seconds = seconds_of(behaviour, "delay_msec")
            timer.start(seconds, ticker)
            if not seconds:
                behaviour.wake()
        elif timer.is_up(ticker):
            behaviour.feedback_message = ""
            return self.tick_child(self.child, ticker)
        behaviour.feedback_message = timer.remaining_message(ticker)
        return self.set_outcome(ticker, RUNNING)

    def on_child_outcome(self, ticker: Ticker, outcome: int) -> int:
        """Return the child's outcome. If the child has ended, stop the timer, so that the next start waits again."""
        if outcome & ENDED:
            self.timer.stop(ticker)
        return self.set_outcome(ticker, outcome)


class TimeoutNode(TimedNode):
    """Halts its child and fails if the child is still running after a time limit."""

    def begin(self, ticker: Ticker) -> int:
        """Tick the child. If the child is running and the time limit has expired, halt the child instead."""
        cells, timer = ticker.cells, self.timer
        if cells[timer.state] == OFF:
            self.start(ticker)
        elif timer.is_up(ticker):
            if cells[self.child.status_cell] == RUNNING:
                return self.time_out(ticker)
            self.start(ticker)
        limited = cells[timer.state] == COUNTING
        self.behaviour.feedback_message = timer.remaining_message(ticker) if limited else ""
        return self.tick_child(self.child, ticker)

    def start(self, ticker: Ticker) -> None:
        """Start the timer with the time limit. A duration of zero means that there is no limit."""
        seconds = seconds_of(self.behaviour, "msec")
        if seconds:
            self.timer.start(seconds, ticker)
        else:
            self.timer.stop(ticker, UNLIMITED)
        ticker.cells[self.status_cell] = RUNNING

    def time_out(self, ticker: Ticker) -> int:
        """Halt the child, and return FAILURE."""
        self.timer.stop(ticker)
        reset(self.child, ticker)
        self.behaviour.feedback_message = "timed out"
        return self.set_outcome(ticker, FAILURE)

    def on_child_outcome(self, ticker: Ticker, outcome: int) -> int:
        """Return the child's outcome. If the child has ended, stop the timer."""
        if outcome & ENDED:
            self.timer.stop(ticker)
            self.behaviour.feedback_message = ""
        return self.set_outcome(ticker, outcome)


class SleepNode(ChildlessNode):
    """A leaf that waits and then succeeds. Stopping the leaf clears its feedback message."""

    def __init__(self, part: NodeBuilder) -> None:
        super().__init__(part)
        self.timer = Countdown(part)

    def branch_count(self, ticker: Ticker) -> int:
        """Return the number of possible results of the timer check. Even the first tick checks the timer."""
        return ticker.times.branch_count()

    def begin(self, ticker: Ticker) -> int:
        """Start the timer if the leaf is not running. Return SUCCESS if the timer has expired, else RUNNING."""
        cells, timer = ticker.cells, self.timer
        if cells[self.status_cell] != RUNNING:
            timer.start(self.seconds(), ticker)
        if timer.is_up(ticker):
            self.set_message(ticker, "")
            timer.stop(ticker)
            cells[self.status_cell] = SUCCESS
            return SUCCESS
        self.set_message(ticker, timer.remaining_message(ticker))
        cells[self.status_cell] = RUNNING
        return RUNNING

    def stop(self, ticker: Ticker) -> None:
        """Stop waiting."""
        super().stop(ticker)
        self.clear_message()

    def seconds(self) -> float:
        """Return the time to wait, in seconds."""
        return seconds_of(self.behaviour, "msec")

    def set_message(self, ticker: Ticker, left: str) -> None:
        """Set the feedback message to the remaining time *left* (empty at the end), if messages are read."""
        if ticker.tells:
            self.behaviour.feedback_message = left

    def clear_message(self) -> None:
        """Clear the feedback message when the node is stopped."""
        self.behaviour.feedback_message = ""


class TimerNode(SleepNode):
    """The node for a Timer of py_trees, with the mission's clock. The message remains when the node is stopped."""

    def seconds(self) -> float:
        """Return the duration, in seconds."""
        return float(self.behaviour.duration)

    def set_message(self, ticker: Ticker, left: str) -> None:
        """Set the same feedback message as py_trees, if messages are read. *left* is empty at the end."""
        if not ticker.tells:
            return
        behaviour = self.behaviour
        behaviour.feedback_message = "still running" if left else f"timer ran out [{behaviour.duration}]"

    def clear_message(self) -> None:
        """Do nothing, because py_trees' Timer also keeps its message."""
