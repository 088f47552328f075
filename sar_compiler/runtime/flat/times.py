"""How a flat tree measures time."""

from collections.abc import Hashable
from typing import Any, Protocol

from sar_compiler.runtime.clock import Clock


class Times(Protocol):
    """The timers of a flat tree's nodes. What is known of a timer is its token, which a cell holds."""

    def start(self, index: int, seconds: float) -> Hashable:
        """Start a node's timer.

        Args:
            index: The node's index.
            seconds: After how many seconds it is up; with 0 or less it is up at once.

        Returns:
            The token.
        """
        ...

    def is_up(self, index: int, token: Any) -> bool:
        """Return whether the time of a node's timer is over."""
        ...

    def remaining(self, index: int, token: Any) -> float:
        """Return how many seconds are left, 0 at the end; for what a node tells of itself, and nothing else."""
        ...


class ClockTimes:
    """Timers on a clock that may stand still, and may go back.

    A clock that goes back counts as one that stood still: what had passed stays passed, and nothing has to be
    waited for twice. A clock that leaps forward is believed. A token is the end of a timer, in seconds of the clock as
    it would be if it had never gone back.

    Args:
        clock: The clock.
    """

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self._looked = clock.now()
        self._gone_back = 0.0

    def start(self, index: int, seconds: float) -> float:  # noqa: ARG002 - whose timer it is does not matter
        """Start a timer, in seconds."""
        return self._now() + seconds

    def is_up(self, index: int, token: float) -> bool:  # noqa: ARG002
        """Return whether a timer's time is over."""
        return self._now() >= token

    def remaining(self, index: int, token: float) -> float:  # noqa: ARG002
        """Return how many seconds are left, 0 at the end."""
        return max(token - self._now(), 0.0)

    def _now(self) -> float:
        now = self._clock.now()
        if now < self._looked:
            self._gone_back += self._looked - now
        self._looked = now
        return now + self._gone_back
