"""The timers of a tree's nodes."""

from collections.abc import Callable
from typing import Any


class Times:
    """The interface for the timers of a tree's nodes.

    A token represents the state of a timer. A cell stores the token.
    """

    def branch_count(self) -> int:
        """Return the number of possible results of `is_up` for a running timer."""
        return 1

    def start(self, index: int, seconds: float) -> Any:
        """Start a node's timer.

        Args:
            index: The node's index.
            seconds: The time in seconds after which the timer expires; with 0 or less, it expires at once.

        Returns:
            The timer's token.
        """
        raise NotImplementedError

    def is_up(self, index: int, token: Any) -> bool:
        """Return whether a node's timer has expired."""
        raise NotImplementedError

    def remaining_sec(self, index: int, token: Any) -> float:
        """Return the remaining seconds of a node's timer. Only called to show them in a message."""
        raise NotImplementedError


class _SteadyClock:
    """A clock that never goes back, even if the clock that it reads goes back."""

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
    """Timers that use the nodes' clocks, which may stop, go back or jump forward.

    When a clock goes back, the time that a timer has already waited is not lost. When a clock jumps forward, the skipped time counts as
    elapsed. The token of a timer is the time at which the timer expires, in seconds of the clock without its backward steps.

    Args:
        clock_of: Function that returns the clock of a node, by the node's index.
    """

    def __init__(self, clock_of: Callable[[int], Any]) -> None:
        self._clock_of = clock_of
        self._of: dict[int, _SteadyClock] = {}
        self._by_clock: dict[int, _SteadyClock] = {}

    def start(self, index: int, seconds: float) -> Any:
        """Start a node's timer with a duration in seconds, and return the token of the timer."""
        return self._now(index) + seconds

    def is_up(self, index: int, token: Any) -> bool:
        """Return whether a node's timer has expired."""
        return bool(self._now(index) >= token)

    def remaining_sec(self, index: int, token: Any) -> float:
        """Return the remaining seconds of a node's timer, or 0 if the timer has expired."""
        return max(float(token) - self._now(index), 0.0)

    def _now(self, index: int) -> float:
        steady = self._of.get(index)
        if steady is None:
            clock = self._clock_of(index)
            steady = self._of[index] = self._by_clock.setdefault(id(clock), _SteadyClock(clock))
        return steady.now()
