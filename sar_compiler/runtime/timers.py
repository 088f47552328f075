"""Nodes that measure time, on the clock of the mission.

Stock py_trees reads the machine's clock, which is wrong for a robot on simulated time. The clock is looked at in
each tick; nothing happens between ticks.
"""

from dataclasses import dataclass

from py_trees import decorators
from py_trees import timers as stock
from py_trees.behaviour import Behaviour

from sar_compiler.runtime.clock import Clock
from sar_compiler.runtime.kernel import timing
from sar_compiler.runtime.kernel.stock_decorators import StockTimeoutNode
from sar_compiler.runtime.parents import Built, OwnDecorator
from sar_compiler.runtime.ports import Input


@dataclass(eq=False, repr=False)
class Delay(OwnDecorator):
    """Waits before it ticks its child for the first time.

    Stock py_trees has a Timer to put before the child, which waits again whenever the sequence starts again.
    """

    node_class = timing.DelayNode
    delay_msec: Input[int]
    clock: Clock


@dataclass(eq=False, repr=False)
class Timeout(OwnDecorator):
    """Fails if its child is still running after a time; the child is halted without another tick.

    Stock py_trees ticks the child once more before it looks at the time, and reads the machine's clock.
    """

    node_class = timing.TimeoutNode
    msec: Input[int]
    clock: Clock


class Sleep(Built):
    """Waits, then succeeds.

    Stock py_trees' Timer reads the machine's clock.
    """

    node_class = timing.SleepNode

    def __init__(self, name: str, msec: Input[int], clock: Clock) -> None:
        super().__init__(name)
        self.msec = msec
        self.clock = clock


class StockTimeout(Built, decorators.Timeout):
    """Fails if its child is still running after a time, measured on the mission's clock."""

    node_class = StockTimeoutNode

    def __init__(self, name: str, child: Behaviour, duration: float, clock: Clock) -> None:
        super().__init__(name=name, child=child, duration=duration)
        self.clock = clock


class Timer(Built, stock.Timer):
    """Runs until a time has passed on the mission's clock, then succeeds."""

    node_class = timing.TimerNode

    def __init__(self, name: str, clock: Clock, duration: float = 5.0) -> None:
        super().__init__(name, duration)
        self.clock = clock
