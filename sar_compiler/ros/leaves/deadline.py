"""Time limits for servers, which must end also where simulated time stands still or jumps."""

from typing import TYPE_CHECKING

from sar_compiler.ros.clock import AWAKE, NodeTime
from sar_compiler.runtime.clock import WallClock

if TYPE_CHECKING:
    from rclpy.node import Node

    from sar_compiler.runtime.clock import Clock

# After this time without an advance, simulated time counts as stopped: long before most deadlines, which are ten.
_PATIENCE_SEC = 3.0
# A fast simulation does not make the machine's network faster: a limit of 10 s takes at least one of these.
_FASTEST = 10.0


def deadline_clock(node: "Node") -> "Clock":
    """Return the clock of deadlines on a node: simulated time where there is any, else the machine's.

    Simulated time counts at most ten times as fast as the machine's; the machine's counts while it stands still. What passes
    while this process stands still counts in neither.
    """
    return NodeTime(node, patience_sec=_PATIENCE_SEC, fastest=_FASTEST, steady=AWAKE.now)


class Deadline:
    """A time limit.

    Args:
        seconds: The time until it passes, in seconds.
        clock: The clock that counts; by default the machine's steady one.
    """

    def __init__(self, seconds: float, clock: "Clock | None" = None) -> None:
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
