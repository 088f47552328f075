"""The harness: the number of measurements, and the conditions under which a measurement is refused.

Both sides of a ratio are warmed up by one call that is not timed, and are timed by the same number of calls in turns. A measurement has two
halves. If their medians differ by more than `AGREE`, it is repeated. After `ATTEMPTS` the row states that it could not be measured.
"""

import gc
import statistics
import time
from collections.abc import Callable, Sequence
from typing import NamedTuple

AGREE = 1.5
"""The two halves of a measurement may differ by this factor."""
ATTEMPTS = 4
_AT_LEAST_SEC = 0.05
_MOST_CALLS = 10_000_000
_GROWTH = 10

Calls = Callable[[int], float]
"""A function that makes a number of calls, and returns the mean seconds of one."""


class Effort(NamedTuple):
    """The amount of measurement.

    Attributes:
        rounds: The number of rounds of a short measurement.
        share: The size of trees, files and journals, as a share of the size in the table; below 1 only in a trial.
    """

    rounds: int
    share: float

    @property
    def few(self) -> int:
        """The number of rounds of a measurement that takes seconds."""
        return min(self.rounds, 4)

    def size(self, whole: int, least: int = 10) -> int:
        """Return a size for this effort."""
        return max(int(whole * self.share), least)


class UnmeasurableError(Exception):
    """There is no reliable value, or a requirement of the measurement is missing."""


class Comparison(NamedTuple):
    """A comparison of two things.

    Attributes:
        ratio: The median of the ratios of all rounds.
        ours: The median of the first one, in seconds.
        theirs: The median of the second one, in seconds.
    """

    ratio: float
    ours: float
    theirs: float


def timed(action: Callable[[], object], count: int = 1) -> float:
    """Return the CPU seconds of this process that an action takes, as the mean of this number of calls."""
    gc.collect()
    start = time.process_time()
    for _ in range(count):
        action()
    return (time.process_time() - start) / count


def measured(once: Callable[[], Sequence[float]], rounds: int) -> list[tuple[float, ...]]:
    """Return the values of an even number of rounds; the medians of both halves agree in each value.

    Args:
        once: Measures one round.
        rounds: The number of rounds.

    Raises:
        UnmeasurableError: The halves differ in each attempt, or a value is not above 0.
    """
    half = max(1, rounds // 2)
    apart = ""
    for _ in range(ATTEMPTS):
        taken = [tuple(once()) for _ in range(2 * half)]
        if any(value <= 0.0 for values in taken for value in values):
            raise UnmeasurableError("the measurement shows 0, so it does not work")
        apart = _apart(taken[:half], taken[half:])
        if not apart:
            return taken
    raise UnmeasurableError(f"{apart}, in {ATTEMPTS} attempts")


def medians(once: Callable[[], Sequence[float]], rounds: int) -> tuple[float, ...]:
    """Return the median of each value; see `measured`."""
    return tuple(map(statistics.median, zip(*measured(once, rounds), strict=True)))


def compared(once: Callable[[], tuple[float, float]], rounds: int) -> Comparison:
    """Return the comparison of two things that each round measures in turns; see `measured`."""
    taken = measured(once, rounds)
    ours, theirs = zip(*taken, strict=True)
    ratio = statistics.median(one / other for one, other in taken)
    return Comparison(ratio, statistics.median(ours), statistics.median(theirs))


def compared_calls(ours: Calls, theirs: Calls, rounds: int) -> Comparison:
    """Return the comparison of two functions by equal numbers of calls.

    Raises:
        UnmeasurableError: See `measured`.
    """
    count = max(enough_calls(ours), enough_calls(theirs))
    return compared(lambda: (ours(count), theirs(count)), rounds)


def enough_calls(calls: Calls) -> int:
    """Return the number of calls that take long enough to be timed; the first call is not timed.

    The first call of many things does more than all later ones: it fills caches, or runs every leaf of a tree that remembers.
    """
    calls(1)
    count = 1
    while (taken := calls(count) * count) < _AT_LEAST_SEC and count < _MOST_CALLS:
        wanted = count * _AT_LEAST_SEC / max(taken, 1e-9)
        # Not at once: the second call may still be slower than later ones.
        count = min(int(min(wanted * 1.1, count * _GROWTH)) + 1, _MOST_CALLS)
    return count


def _apart(one: Sequence[Sequence[float]], other: Sequence[Sequence[float]]) -> str:
    """Return the difference of two halves in words if it is too large; else an empty string."""
    for first, second in zip(zip(*one, strict=True), zip(*other, strict=True), strict=True):
        low, high = sorted((statistics.median(first), statistics.median(second)))
        if high > AGREE * low:
            return f"the two halves differ by a factor of {high / low:.1f}"
    return ""
