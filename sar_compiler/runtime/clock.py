"""The clocks that measure a tree's durations in tests, simulations and on a robot."""

import time
from typing import Protocol

from sar_compiler.runtime.context import mission_context


class WallClock:
    """The computer's monotonic clock."""

    def now(self) -> float:
        """Return the time in seconds since an arbitrary moment."""
        return time.monotonic()


class ManualClock:
    """A clock that only `advance` changes, for tests and simulated runs.

    Args:
        start: The initial time, in seconds.
    """

    def __init__(self, start: float = 0.0) -> None:
        self._now = start

    def now(self) -> float:
        """Return the time in seconds."""
        return self._now

    def advance(self, seconds: float) -> None:
        """Move the clock forward; a negative number of seconds moves the clock backward, like a simulator's reset."""
        self._now += seconds


@mission_context(preview=WallClock)
class Clock(Protocol):
    """The interface of a clock that measures the durations in a tree."""

    def now(self) -> float:
        """Return the time in seconds since an arbitrary moment."""
        ...


def clock_text(seconds: float) -> str:
    """Format a duration in seconds as minutes and seconds (`1:05`), or with hours if necessary (`2:00:00`)."""
    whole = max(0, int(seconds))
    hours, minutes = divmod(whole // 60, 60)
    return f"{hours}:{minutes:02}:{whole % 60:02}" if hours else f"{minutes}:{whole % 60:02}"
