"""Time limits on the machinery: steady seconds, since ROS time may stand still or jump."""

import time


class Deadline:
    """A moment that will have passed.

    Args:
        seconds: How far it lies in the future.
    """

    def __init__(self, seconds: float) -> None:
        self._at = time.monotonic() + seconds

    @property
    def passed(self) -> bool:
        """Whether the moment is over."""
        return time.monotonic() >= self._at
