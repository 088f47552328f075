"""How a tree measures time."""

from typing import Any


class Times:
    """The timers of a tree's nodes. What is known of a timer is its token, which a cell holds."""

    def ways(self) -> int:
        """Return in how many ways a look at a timer that counts may end."""
        return 1

    def start(self, index: int, seconds: float) -> Any:
        """Start a node's timer.

        Args:
            index: The node's index.
            seconds: After how many seconds it is up; with 0 or less it is up at once.

        Returns:
            The token.
        """
        raise NotImplementedError

    def is_up(self, index: int, token: Any) -> bool:
        """Return whether the time of a node's timer is over."""
        raise NotImplementedError

    def remaining(self, index: int, token: Any) -> float:
        """Return how many seconds are left, 0 at the end; for what a node tells of itself, and nothing else."""
        raise NotImplementedError


class ClockTimes(Times):
    """Timers on a clock that may stand still, and may go back.

    A clock that goes back counts as one that stood still: what had passed stays passed, and nothing has to be
    waited for twice. A clock that leaps forward is believed. A token is the end of a timer, in seconds of the clock as
    it would be if it had never gone back.

    Args:
        clock: The clock.
    """

    def __init__(self, clock: Any) -> None:
        self._clock = clock
        self._looked: float = clock.now()
        self._gone_back = 0.0

    def start(self, index: int, seconds: float) -> Any:  # noqa: ARG002 - whose timer it is does not matter
        """Start a timer, in seconds."""
        return self._now() + seconds

    def is_up(self, index: int, token: Any) -> bool:  # noqa: ARG002
        """Return whether a timer's time is over."""
        return bool(self._now() >= token)

    def remaining(self, index: int, token: Any) -> float:  # noqa: ARG002
        """Return how many seconds are left, 0 at the end."""
        return max(float(token) - self._now(), 0.0)

    def _now(self) -> float:
        now: float = self._clock.now()
        if now < self._looked:
            self._gone_back += self._looked - now
        self._looked = now
        return now + self._gone_back
