"""The time in which this process has run: limits for others are counted in it.

A process that is stopped, or that the machine has no time for, hears nobody meanwhile. What it then finds late is not others'
fault, and DDS may have to find them anew.
"""

import math
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

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
        """Within it, `now` is called several times a second by whoever turns the executor.

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
