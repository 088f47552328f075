"""Clocks of a node and of this process, and deadlines.

Time limits for other programs are measured in awake time, which excludes the time in which this process is suspended or gets no processor
time. The process receives no messages during this time. So late responses are not the servers' fault, and DDS may have to discover the
servers again.
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


# The maximum time between two turns of the executor, in seconds. If more time passes, the process is assumed to have been suspended.
_STANDSTILL_SEC = 2.0
# Grace time after a suspension, in seconds. During this time, other nodes can be discovered again: participants of Fast DDS announce themselves
# every three seconds.
_RECOVERY_SEC = 5.0
# Minimum time between two grace times, in seconds, because a process may stop repeatedly, for instance if a leaf blocks.
_SPARED_EVERY_SEC = 60.0


class AwakeTime:
    """The time of the steady clock, without suspensions of this process and without the grace time after each suspension.

    Attributes:
        stood_still_at: The time at which the last suspension was detected, as given by `time.monotonic`.
    """

    def __init__(self) -> None:
        self.stood_still_at = -math.inf
        self._left_out = 0.0
        self._turned_at: float | None = None
        self._recovered_at = -math.inf
        self._say: Callable[[str], object] = print

    def now(self) -> float:
        """Return the time in seconds from an arbitrary origin."""
        steady = time.monotonic()
        if self._turned_at is not None:
            self._on_poll(steady, self._turned_at)
        return steady - self._left_out

    @contextmanager
    def mark_polling(self, say: Callable[[str], object]) -> Iterator[None]:
        """Mark a block of code in which the executor's loop calls `now` several times a second.

        Args:
            say: Called with a message after a suspension.
        """
        self._turned_at, self._say = time.monotonic(), say
        try:
            yield
        finally:
            self._turned_at = None

    def _on_poll(self, steady: float, turned_at: float) -> None:
        gap, self._turned_at = steady - turned_at, steady
        if gap <= _STANDSTILL_SEC:
            self._left_out += max(0.0, min(steady, self._recovered_at) - turned_at)
            return
        self._left_out += gap
        self.stood_still_at = steady
        if steady - self._recovered_at > _SPARED_EVERY_SEC:
            self._recovered_at = steady + _RECOVERY_SEC
            self._say(
                f"This process was suspended for {gap:.1f} s (stopped, starved of CPU time, or blocked by a "
                "leaf). Responses may be late. Every deadline is extended accordingly."
            )


AWAKE = AwakeTime()
"""The awake time of this process."""


_NANOSECONDS = 1_000_000_000

PATIENCE_SEC = 10.0
"""How long the node's clock may stand still before the machine's clock is used instead, in seconds of the steady clock."""

# The maximum speed of a simulation, in simulated seconds per second. A faster advance of more than `_JUMP_SEC` is a jump.
_FASTEST = 200.0
_JUMP_SEC = 10.0
_INSTANT_SEC = 1e-9
# If a clock has not advanced for this time, in seconds of the steady clock, it has stopped.
_GAP_SEC = 1.0


class NodeTime:
    """The time of a node's clock, without jumps, backward steps or permanent stops.

    Simulated time (`use_sim_time`) may advance at any speed. When simulated time jumps, the machine's time that has passed since the last
    reading is counted instead. When simulated time has stood still for longer than *patience_sec*, the machine's time is used until
    simulated time advances again. So every wait ends. Without simulated time, the steady clock of the machine is used, which cannot be set.

    Args:
        node: The node.
        patience_sec: The maximum time for which simulated time may stand still, in seconds of the steady clock.
        fastest: The maximum speed, in simulated seconds per second; a faster advance is limited to this speed.
        say: Called with a message when the clock stops, advances again or jumps.
        steady: Returns the machine's time, in seconds; by default the time of the steady clock.
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
        """Return the time in seconds from an arbitrary origin."""
        steady, ros = self._steady(), self._read()
        if not self._clock.ros_time_is_active:
            self._count(steady, ros, steady - self._counted_to)
        elif ros != self._ros:
            self._advance(steady, ros)
        elif AWAKE.now() - self._heard_at > self._patience_sec:
            self._on_standstill(steady)
        return self._now

    def _read(self) -> float:
        return int(self._clock.now().nanoseconds) / _NANOSECONDS

    def _count(self, steady: float, ros: float, seconds: float) -> None:
        self._now += seconds
        self._advanced_at = self._counted_to = steady
        self._heard_at, self._ros = AWAKE.now(), ros

    def _advance(self, steady: float, ros: float) -> None:
        step, passed = ros - self._ros, steady - self._counted_to
        # The first simulated time that arrives is not a jump.
        jumped = self._ros > 0.0 and not 0.0 <= step <= _JUMP_SEC + _FASTEST * (steady - self._advanced_at)
        if jumped:
            self._say(
                f"The clock has jumped {'forward' if step > 0.0 else 'back'} by {abs(step):.1f} s. "
                f"{passed:.1f} s are counted instead, according to the machine's clock."
            )
            step = passed
        elif self._ros <= 0.0:
            step = passed
        if self._stands_still:
            self._stands_still = False
            self._say("The clock advances again.")
        self._count(steady, ros, min(step, self._fastest * max(passed, _INSTANT_SEC)))

    def _on_standstill(self, steady: float) -> None:
        if not self._stands_still:
            self._stands_still = True
            self._say(
                f"The clock has stood still for {self._patience_sec:g} s (is the simulator running?). The "
                "machine's time is used until the clock advances again."
            )
        self._now += steady - self._counted_to
        self._counted_to = steady


class ClockedTime:
    """Counts the awake time during which a node's clock advances.

    Use this time for deadlines of programs that stop when the clock stops.

    Without simulated time, all awake time is counted.

    Args:
        node: The node.
    """

    def __init__(self, node: "Node") -> None:
        self._clock = node.get_clock()
        self._ros_ns = -1
        self._now = self._counted_to = AWAKE.now()

    def now(self) -> float:
        """Return the time in seconds from an arbitrary origin. Call this method at least twice a second."""
        awake, is_simulated = AWAKE.now(), self._clock.ros_time_is_active
        ros_ns = int(self._clock.now().nanoseconds) if is_simulated else -1
        if ros_ns != self._ros_ns or not is_simulated:
            passed = awake - self._counted_to
            self._now += min(passed, _GAP_SEC) if is_simulated else passed
            self._counted_to, self._ros_ns = awake, ros_ns
        return self._now


def mission_clock(node: "Node") -> NodeTime:
    """Return the node's mission clock; every call for a node returns the same object.

    The clock uses simulated time if `use_sim_time` is set. The node logs each stop and each jump of the clock once.
    """
    return of_node(node, NodeTime, lambda: NodeTime(node, say=lambda text: node.get_logger().warning(text)))


def steady_timer(node: "Node", period_sec: float, call: Callable[[], Any]) -> "Timer":
    """Create a timer that uses the machine's steady clock, which a simulator cannot stop."""
    from rclpy.clock import Clock, ClockType

    # All timers of a node share a clock, because rclpy's EventsExecutor has a thread for each clock.
    clock = of_node(node, ClockType.STEADY_TIME, lambda: Clock(clock_type=ClockType.STEADY_TIME))
    return node.create_timer(period_sec, call, clock=clock)


# The time without an advance after which simulated time has stopped for deadlines, in seconds. Most deadlines are longer (10 s).
_DEADLINES_PATIENCE_SEC = 3.0
# The maximum speed of simulated time for deadlines. A fast simulation does not make the network faster: a deadline of 10 s takes at least 1 s.
_DEADLINES_FASTEST = 10.0


class _Pace:
    fastest = _DEADLINES_FASTEST


def trust_simulation(node: "Node") -> None:
    """Measure a node's deadlines in simulated time, whatever the speed of the simulation.

    This requires that simulated servers wait for the node's executor.
    """
    of_node(node, _Pace, _Pace).fastest = math.inf


def deadline_clock(node: "Node") -> Clock:
    """Create a clock for a node's deadlines: simulated time if the node uses it, otherwise the machine's time.

    Simulated time advances at most ten times as fast as the machine's time, unless it is trusted (`trust_simulation`). While simulated time
    stands still, the machine's time is used. Suspensions of this process are excluded.
    """
    fastest = of_node(node, _Pace, _Pace).fastest
    return NodeTime(node, patience_sec=_DEADLINES_PATIENCE_SEC, fastest=fastest, steady=AWAKE.now)


def deadline_timer(node: "Node", period_sec: float, call: Callable[[], Any]) -> "Timer":
    """Create a timer that uses simulated time if the node trusts the simulation, otherwise the steady clock."""
    if of_node(node, _Pace, _Pace).fastest == math.inf:
        return node.create_timer(period_sec, call)
    return steady_timer(node, period_sec, call)


class Deadline:
    """A point in time by which something must happen.

    Args:
        seconds: The time from now to the deadline, in seconds.
        clock: The clock to use; by default the steady clock of the machine.
    """

    def __init__(self, seconds: float, clock: Clock | None = None) -> None:
        self._clock = clock or WallClock()
        self._at = self._clock.now() + seconds

    @property
    def remaining_sec(self) -> float:
        """The time until the deadline, in seconds; 0 after the deadline."""
        return max(0.0, self._at - self._clock.now())

    @property
    def has_passed(self) -> bool:
        """Whether the deadline has passed."""
        return self._clock.now() >= self._at
