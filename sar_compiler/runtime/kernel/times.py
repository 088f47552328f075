"""Time measurement of a tree."""

from collections.abc import Callable
from typing import Any


class Times:
    """The timers of a tree's nodes; the state of a timer is its token, which a cell holds."""

    def branch_count(self) -> int:
        """Return the number of possible results of checking a running timer."""
        return 1

    def start(self, index: int, seconds: float) -> Any:
        """Start a node's timer.

        Args:
            index: The node's index.
            seconds: The time in seconds after which it expires; with 0 or less, it expires at once.

        Returns:
            The token.
        """
        raise NotImplementedError

    def is_up(self, index: int, token: Any) -> bool:
        """Return whether a node's timer has expired."""
        raise NotImplementedError

    def remaining_sec(self, index: int, token: Any) -> float:
        """Return the remaining seconds, 0 at the end; called only if the nodes' messages are read."""
        raise NotImplementedError


class _SteadyClock:
    """A clock that stops while the underlying clock goes back."""

    def __init__(self, clock: Any) -> None:
        self._clock = clock
        self._looked: float = clock.now()
        self._gone_back = 0.0

    def now(self) -> float:
        now: float = self._clock.now()
        if now < self._looked:
            self._gone_back += self._looked - now
        self._looked = now
        return now + self._gone_back


class ClockTimes(Times):
    """Timers for clocks that may stop, and may go back.

    A clock that goes back is treated as stopped: elapsed time stays elapsed, and nothing has to be waited for twice.
    A clock that jumps forward is accepted. A token is the end of a timer, in seconds of the clock as it would be without
    going back.

    Args:
        clock_of: Function that returns the clock of a node, by its index.
    """

    def __init__(self, clock_of: Callable[[int], Any]) -> None:
        self._clock_of = clock_of
        self._of: dict[int, _SteadyClock] = {}
        self._by_clock: dict[int, _SteadyClock] = {}

    def start(self, index: int, seconds: float) -> Any:
        """Start a node's timer, in seconds."""
        return self._now(index) + seconds

    def is_up(self, index: int, token: Any) -> bool:
        """Return whether a node's timer has expired."""
        return bool(self._now(index) >= token)

    def remaining_sec(self, index: int, token: Any) -> float:
        """Return the remaining seconds, 0 at the end."""
        return max(float(token) - self._now(index), 0.0)

    def _now(self, index: int) -> float:
        steady = self._of.get(index)
        if steady is None:
            clock = self._clock_of(index)
            steady = self._of[index] = self._by_clock.setdefault(id(clock), _SteadyClock(clock))
        return steady.now()
