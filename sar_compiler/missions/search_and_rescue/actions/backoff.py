"""Growing pauses between attempts."""

import math

from sar_compiler.runtime.clock import Clock


class Backoff:
    """The pause after a failure: twice as long after each further one.

    Args:
        clock: The clock that it is measured with.
        first_sec: The pause after the first failure, seconds; 0 for none at all.
        longest_sec: The longest pause, seconds.
    """

    def __init__(self, clock: Clock, first_sec: float, longest_sec: float) -> None:
        self._clock = clock
        self._first_sec, self._longest_sec = first_sec, max(first_sec, longest_sec)
        self._pause_sec = 0.0
        self._since = -math.inf

    @property
    def left_sec(self) -> float:
        """Seconds of the pause that are left; 0 or less if it is over."""
        elapsed = self._clock.now() - self._since
        # A clock that jumps back, as that of a simulator which starts anew, ends the pause.
        return self._pause_sec - elapsed if elapsed >= 0.0 else 0.0

    @property
    def waits(self) -> bool:
        """Whether nothing is to be tried yet."""
        return self.left_sec > 0.0

    def failed(self) -> None:
        """Begin a pause."""
        self._pause_sec = min(self._pause_sec * 2 or self._first_sec, self._longest_sec)
        self._since = self._clock.now()

    def reset(self) -> None:
        """End the pauses: an attempt has succeeded."""
        self._pause_sec = 0.0
