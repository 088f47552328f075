"""The periodic part of ticking a tree."""

from collections.abc import Callable

from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.timer import Timer

from sar_compiler.ros.failure_reports import described


class Beat:
    """Ticks by a node's clock, and by the steady clock while the node's clock is stopped.

    Args:
        node: The node whose clock is used.
        period_sec: Seconds between two ticks.
        tick: Ticks the tree.
        count: Returns the number of ticks of the tree so far, including those from elsewhere.
    """

    def __init__(
        self, node: Node, period_sec: float, tick: Callable[[], None], count: Callable[[], int]
    ) -> None:
        self._node = node
        self._tick = tick
        self._count = count
        self._seen = (-1, -1)
        self._silent = 0
        self._timers: list[Timer] = [
            node.create_timer(period_sec, tick),
            node.create_timer(period_sec, self._watch, clock=Clock(clock_type=ClockType.STEADY_TIME)),
        ]
        # A stopped clock is noticed at the first check, one period from now.
        self._look()

    def destroy(self) -> None:
        """Destroy the timers; the context may be shut down already."""
        timers, self._timers = self._timers, []
        for timer in timers:
            self._destroy(timer)

    def _destroy(self, timer: Timer) -> None:
        try:
            timer.cancel()
            self._node.destroy_timer(timer)
        except Exception as error:  # noqa: BLE001
            self._node.get_logger().debug(f"a timer could not be given back: {described(error)}")

    def _look(self) -> tuple[bool, bool]:
        """Return whether there was no tick, and whether the clock was stopped, since the last call."""
        seen = (self._count(), self._node.get_clock().now().nanoseconds)
        unticked, still = (seen[0] == self._seen[0], seen[1] == self._seen[1])
        self._seen = seen
        return unticked, still

    def _watch(self) -> None:
        """Tick if the node's clock does not, because it is paused, missing, or was set back.

        The leaves' deadlines for servers use the steady clock and must be checked nevertheless. No ticks are added
        to a simulation that is only slow.
        """
        unticked, still = self._look()
        self._silent = self._silent + 1 if unticked else 0
        # The system's clock was set back: its timer waits for the old time to come again. Once is not
        # enough to tell, because the two timers drift past each other.
        set_back = self._silent > 1 and not self._node.get_clock().ros_time_is_active
        if unticked and (still or set_back):
            self._tick()
            self._look()
