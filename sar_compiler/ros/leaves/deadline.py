"""Time limits for servers: on the steady clock, since ROS time may stop or jump."""

import time


class Deadline:
    """A time limit on the steady clock.

    Args:
        seconds: The time until it passes, in seconds.
    """

    def __init__(self, seconds: float) -> None:
        self._at = time.monotonic() + seconds

    @property
    def passed(self) -> bool:
        """Whether it has passed."""
        return time.monotonic() >= self._at
