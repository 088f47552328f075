"""The clocks: a node's as that of its trees, which may stand still and may jump; the time in which this process has run; deadlines.

Limits for others are counted in the latter. A process that is stopped, or that the machine has no time for, hears nobody meanwhile.
What it then finds late is not others' fault, and DDS may have to find them anew.
"""

import math
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from sar_compiler.ros.leaves.leaf import of_node
from sar_compiler.runtime.clock import Clock, WallClock

if TYPE_CHECKING:
    from rclpy.node import Node
    from rclpy.timer import Timer


# An executor that is turned again and again has not been for so long: nothing of this process has gone on, seconds.
_STANDSTILL_SEC = 2.0
# How long others may need to be heard again: participants of Fast DDS announce themselves every three seconds.
_RECOVERY_SEC = 5.0
# Who stands still again and again, such as by a leaf that blocks, is not spared for good.
_SPARED_EVERY_SEC = 60.0


class AwakeTime:
    """The machine's steady seconds, without those in which this process stood still, and those after them to hear others again.

    Attributes:
        stood_still_at: When a standstill was found the last time, by `time.monotonic`.
    """

    def __init__(self) -> None:
        self.stood_still_at = -math.inf
        self._left_out = 0.0
        self._turned_at: float | None = None
        self._recovered_at = -math.inf
        self._say: Callable[[str], object] = print

    def now(self) -> float:
        """Return the time in seconds; only differences mean anything."""
        steady = time.monotonic()
        if self._turned_at is not None:
            self._turn(steady, self._turned_at)
        return steady - self._left_out

    @contextmanager
    def turning(self, say: Callable[[str], object]) -> Iterator[None]:
        """A block in which the executor's loop calls `now` several times a second.

        Args:
            say: Called with a line after a standstill.
        """
        self._turned_at, self._say = time.monotonic(), say
        try:
            yield
        finally:
            self._turned_at = None

    def _turn(self, steady: float, turned_at: float) -> None:
        gap, self._turned_at = steady - turned_at, steady
        if gap <= _STANDSTILL_SEC:
            self._left_out += max(0.0, min(steady, self._recovered_at) - turned_at)
            return
        self._left_out += gap
        self.stood_still_at = steady
        if steady - self._recovered_at > _SPARED_EVERY_SEC:
            self._recovered_at = steady + _RECOVERY_SEC
            self._say(
                f"This process stood still for {gap:.1f} s (stopped, or without a processor; or a leaf blocks): it has heard "
                "nobody meanwhile, no server is to blame for that, and every deadline is longer by it."
            )


AWAKE = AwakeTime()
"""That of this process."""


_NANOSECONDS = 1_000_000_000

PATIENCE_SEC = 10.0
"""How long a clock may stand still before the machine's time counts in its place, steady seconds."""

# No simulation is so much faster than the machine's time; what is, has jumped.
_FASTEST = 200.0
_JUMP_SEC = 10.0
_INSTANT_SEC = 1e-9
# A clock that has not gone on for longer has stood still; steady seconds.
_GAP_SEC = 1.0


class NodeTime:
    """Seconds of a node's clock that never go back, never leap, and never stand still for good.

    Simulated time (`use_sim_time`) is counted as it comes, however slow or fast. A jump counts as the machine's time
    that has passed meanwhile. Of a clock that has stood still for longer than a patience, the machine's time counts in
    its place, from its last advance on, until it goes on: so every wait ends. Without simulated time the machine's
    steady clock counts, which nobody sets.

    Args:
        node: The node.
        patience_sec: How long simulated time may stand still, steady seconds.
        fastest: Simulated seconds that are counted for a steady second at most; what exceeds it is cut off.
        say: Called with a line when the clock stops, goes on, or jumps.
        steady: The machine's time.
    """

    def __init__(
        self,
        node: "Node",
        patience_sec: float = PATIENCE_SEC,
        fastest: float = math.inf,
        say: Callable[[str], Any] = lambda _: None,
        steady: Callable[[], float] | None = None,
    ) -> None:
        self._clock = node.get_clock()
        self._patience_sec, self._fastest, self._say = patience_sec, fastest, say
        self._steady = steady or time.monotonic
        self._ros = self._read()
        self._advanced_at = self._counted_to = self._steady()
        self._heard_at = AWAKE.now()
        self._now = self._ros
        self._stands_still = False

    def now(self) -> float:
        """Return the time in seconds; only differences mean anything."""
        steady, ros = self._steady(), self._read()
        if not self._clock.ros_time_is_active:
            self._count(steady, ros, steady - self._counted_to)
        elif ros != self._ros:
            self._advance(steady, ros)
        elif AWAKE.now() - self._heard_at > self._patience_sec:
            self._stand_still(steady)
        return self._now

    def _read(self) -> float:
        return int(self._clock.now().nanoseconds) / _NANOSECONDS

    def _count(self, steady: float, ros: float, seconds: float) -> None:
        self._now += seconds
        self._advanced_at = self._counted_to = steady
        self._heard_at, self._ros = AWAKE.now(), ros

    def _advance(self, steady: float, ros: float) -> None:
        step, passed = ros - self._ros, steady - self._counted_to
        # The first time that comes is no jump.
        jumped = self._ros > 0.0 and not 0.0 <= step <= _JUMP_SEC + _FASTEST * (steady - self._advanced_at)
        if jumped:
            self._say(
                f"The clock has jumped {'forward' if step > 0.0 else 'back'} by {abs(step):.1f} s; "
                f"{passed:.1f} s are counted, as the machine's clock has it."
            )
            step = passed
        elif self._ros <= 0.0:
            step = passed
        if self._stands_still:
            self._stands_still = False
            self._say("The clock goes on.")
        self._count(steady, ros, min(step, self._fastest * max(passed, _INSTANT_SEC)))

    def _stand_still(self, steady: float) -> None:
        if not self._stands_still:
            self._stands_still = True
            self._say(
                f"The clock has stood still for {self._patience_sec:g} s (is the simulator running?): until it goes "
                "on, the machine's time counts."
            )
        self._now += steady - self._counted_to
        self._counted_to = steady


class ClockedTime:
    """Awake seconds in which a node's clock went on, for deadlines of those who do nothing while it stands still.

    Without simulated time they are all that pass.

    Args:
        node: The node.
    """

    def __init__(self, node: "Node") -> None:
        self._clock = node.get_clock()
        self._ros_ns = -1
        self._now = self._counted_to = AWAKE.now()

    def now(self) -> float:
        """Return the time in seconds, to be asked for twice a second or more; only differences mean anything."""
        awake, is_simulated = AWAKE.now(), self._clock.ros_time_is_active
        ros_ns = int(self._clock.now().nanoseconds) if is_simulated else -1
        if ros_ns != self._ros_ns or not is_simulated:
            passed = awake - self._counted_to
            self._now += min(passed, _GAP_SEC) if is_simulated else passed
            self._counted_to, self._ros_ns = awake, ros_ns
        return self._now


def mission_clock(node: "Node") -> NodeTime:
    """Return the time of a mission, the same object in every call with its node: the simulator's under `use_sim_time`.

    What becomes of the clock is said in the node's log, once.
    """
    return of_node(node, NodeTime, lambda: NodeTime(node, say=lambda text: node.get_logger().warning(text)))


def steady_timer(node: "Node", period_sec: float, call: Callable[[], Any]) -> "Timer":
    """Return a timer of a node by the machine's steady clock, which no simulator stops."""
    from rclpy.clock import Clock, ClockType

    # One for all: the executor of events has a thread for each clock.
    clock = of_node(node, ClockType.STEADY_TIME, lambda: Clock(clock_type=ClockType.STEADY_TIME))
    return node.create_timer(period_sec, call, clock=clock)


# After this time without an advance, simulated time counts as stopped: long before most deadlines, which are ten.
_DEADLINES_PATIENCE_SEC = 3.0
# A fast simulation does not make the machine's network faster: a limit of 10 s takes at least one of these.
_DEADLINES_FASTEST = 10.0


class _Pace:
    fastest = _DEADLINES_FASTEST


def trust_simulation(node: "Node") -> None:
    """Have deadlines on a node count simulated time however fast it is: whoever simulates and answers waits for the node's executor."""
    of_node(node, _Pace, _Pace).fastest = math.inf


def deadline_clock(node: "Node") -> Clock:
    """Return the clock of deadlines on a node: simulated time where there is any, else the machine's.

    Simulated time counts at most ten times as fast as the machine's, unless it is to be trusted (`trust_simulation`); the machine's
    counts while it stands still. What passes while this process stands still counts in neither.
    """
    fastest = of_node(node, _Pace, _Pace).fastest
    return NodeTime(node, patience_sec=_DEADLINES_PATIENCE_SEC, fastest=fastest, steady=AWAKE.now)


def deadline_timer(node: "Node", period_sec: float, call: Callable[[], Any]) -> "Timer":
    """Return a timer of a node by simulated time where that is to be trusted, else by the machine's steady clock."""
    if of_node(node, _Pace, _Pace).fastest == math.inf:
        return node.create_timer(period_sec, call)
    return steady_timer(node, period_sec, call)


class Deadline:
    """A time limit.

    Args:
        seconds: The time until it passes, in seconds.
        clock: The clock that counts; by default the machine's steady one.
    """

    def __init__(self, seconds: float, clock: Clock | None = None) -> None:
        self._clock = clock or WallClock()
        self._at = self._clock.now() + seconds

    @property
    def left(self) -> float:
        """The seconds until it passes; 0 from then on."""
        return max(0.0, self._at - self._clock.now())

    @property
    def passed(self) -> bool:
        """Whether it has passed."""
        return self._clock.now() >= self._at
