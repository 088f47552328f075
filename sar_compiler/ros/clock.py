"""The clock of a node as the clock of its trees."""

from rclpy.node import Node

_NANOSECONDS = 1_000_000_000


class RosClock:
    """The time of a node's clock in seconds, which is the simulator's under `use_sim_time`."""

    def __init__(self, node: Node) -> None:
        self._clock = node.get_clock()

    def now(self) -> float:
        """Return the time in seconds; 0 under `use_sim_time` until the first `/clock`."""
        return int(self._clock.now().nanoseconds) / _NANOSECONDS
