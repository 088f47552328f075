"""Nodes that measure time, on the clock of the mission.

Stock py_trees reads the machine's clock, which is wrong for a robot on simulated time. The clock is looked at in
each tick; nothing happens between ticks.
"""

from py_trees import decorators
from py_trees import timers as stock
from py_trees.behaviour import Behaviour

from sar_compiler.errors import SarError
from sar_compiler.runtime.clock import Clock
from sar_compiler.runtime.kernel.stock_decorators import StockTimeoutNode
from sar_compiler.runtime.kernel.timing import DelayNode, SleepNode, TimeoutNode, WaitingNode
from sar_compiler.runtime.parents import Built, Decorator, Yielding
from sar_compiler.runtime.ports import Input

_MILLISECONDS = 1000.0


class DurationError(SarError):
    """A node is to wait for less than no time."""


class Delay(Yielding, Decorator):
    """Waits before it ticks its child for the first time.

    Stock py_trees has a Timer to put before the child, which waits again whenever the sequence starts again.

    Args:
        delay_msec: How long to wait, in milliseconds.
    """

    node_class = DelayNode

    def __init__(self, name: str, child: Behaviour, delay_msec: Input[int], clock: Clock) -> None:
        super().__init__(name, child)
        self._delay_msec = delay_msec
        self.clock = clock

    def seconds(self) -> float:
        """Return how long to wait, in seconds."""
        return seconds_of(self.name, "delay_msec", self._delay_msec.get())


class Timeout(Decorator):
    """Fails if its child is still running after a time; the child is halted without another tick.

    Stock py_trees ticks the child once more before it looks at the time, and reads the machine's clock.

    Args:
        msec: How long the child may run, in milliseconds; 0: as long as it likes.
    """

    node_class = TimeoutNode

    def __init__(self, name: str, child: Behaviour, msec: Input[int], clock: Clock) -> None:
        super().__init__(name, child)
        self._msec = msec
        self.clock = clock

    def seconds(self) -> float:
        """Return how long the child may run, in seconds."""
        return seconds_of(self.name, "msec", self._msec.get())


class Sleep(Built):
    """Waits, then succeeds.

    Stock py_trees' Timer reads the machine's clock.

    Args:
        msec: How long to wait, in milliseconds; 0: not at all.
    """

    node_class = SleepNode

    def __init__(self, name: str, msec: Input[int], clock: Clock) -> None:
        super().__init__(name)
        self._msec = msec
        self.clock = clock

    def seconds(self) -> float:
        """Return how long to wait, in seconds."""
        return seconds_of(self.name, "msec", self._msec.get())

    def tell(self, left: str) -> None:
        """Set the feedback message to the time that is left; empty at the end."""
        self.feedback_message = left


class StockTimeout(Built, decorators.Timeout):
    """Fails if its child is still running after a time, measured on the mission's clock.

    Args:
        child: The child.
        duration: How long the child may run, in seconds.
    """

    node_class = StockTimeoutNode

    def __init__(self, name: str, child: Behaviour, duration: float, clock: Clock) -> None:
        super().__init__(name=name, child=child, duration=duration)
        self.clock = clock


class Timer(Built, stock.Timer):
    """Runs until a time has passed on the mission's clock, then succeeds.

    Args:
        duration: How long to run, in seconds; 0 or less: succeed at once.
    """

    node_class = WaitingNode

    def __init__(self, name: str, clock: Clock, duration: float = 5.0) -> None:
        super().__init__(name, duration)
        self.clock = clock

    def seconds(self) -> float:
        """Return how long to run, in seconds."""
        return float(self.duration)

    def tell(self, left: str) -> None:
        """Set the feedback message as py_trees' own timer does."""
        self.feedback_message = "still running" if left else f"timer ran out [{self.duration}]"


def seconds_of(name: str, port: str, milliseconds: int) -> float:
    """Return how long a node is to wait, in seconds.

    Raises:
        DurationError: If that is less than no time.
    """
    if milliseconds < 0:
        message = f"'{name}' is to wait {milliseconds} milliseconds; {port} is 0 or more"
        raise DurationError(message)
    return milliseconds / _MILLISECONDS
