"""Confidence intervals of a success rate."""

from math import sqrt
from statistics import NormalDist
from typing import NamedTuple


class Interval(NamedTuple):
    """An interval of probabilities.

    Attributes:
        low: Its lower bound.
        high: Its upper bound.
    """

    low: float
    high: float

    @property
    def half_width(self) -> float:
        """Half the distance of the bounds."""
        return (self.high - self.low) / 2.0


def wilson(successes: int, runs: int, confidence: float) -> Interval:
    """Return Wilson's score interval of a success rate; unlike the normal one it is right near 0 and 1, too.

    Args:
        successes: The number of runs that have succeeded.
        runs: The number of runs; without any, the interval is all probabilities.
        confidence: The probability with which such an interval contains the true rate, between 0 and 1.
    """
    if not runs:
        return Interval(0.0, 1.0)
    z = NormalDist().inv_cdf((1.0 + confidence) / 2.0)
    rate, weight = successes / runs, 1.0 + z * z / runs
    centre = (rate + z * z / (2.0 * runs)) / weight
    spread = z * sqrt(rate * (1.0 - rate) / runs + z * z / (4.0 * runs * runs)) / weight
    low = 0.0 if successes == 0 else centre - spread
    return Interval(low, 1.0 if successes == runs else centre + spread)
