"""What driving and waiting take from the battery: a prior that is corrected by what the robot's own battery says.

Energy is measured in shares of a full battery, as in `sensor_msgs/BatteryState.percentage`, 0 to 1.
"""

import math
from collections import deque
from dataclasses import dataclass
from statistics import median
from typing import NamedTuple

WINDOW_SHARE = 0.01
"""How much of the battery must be expected to be used between two readings that are compared: what batteries round to."""
RISE_SHARE = 0.03
"""How far a battery must have risen to be taken for charged, or for another one."""

# What the prior weighs: as much as this share of the battery that was used by driving, and as much that was used by time.
_PRIOR_SHARE = 0.03
# What is remembered: the last half of a battery.
_MEMORY_SHARE = 0.5
# A fall that is larger than both together is no consumption: it is another battery, or one that was gauged anew.
_MOST_TIMES, _MOST_FALL = 5.0, 0.1
# Below this the odometry of a robot that stands may move; above that it has begun anew, metres.
_GRAIN_M, _JUMP_M = 0.05, 2.0
# Readings that follow each other sooner are one that two leaves have heard, seconds.
_APART_SEC = 0.2


class Trip(NamedTuple):
    """What is to be driven and waited.

    Attributes:
        metres: How far it is driven.
        seconds: How long it takes.
    """

    metres: float
    seconds: float


class Rates(NamedTuple):
    """What is used.

    Attributes:
        per_m: The share of a full battery for each metre that is driven.
        per_sec: The share of a full battery for each second, driven or not.
    """

    per_m: float
    per_sec: float


class _BatteryReading(NamedTuple):
    sec: float
    metres: float
    share: float


@dataclass(eq=False)
class EnergyModel:
    """What a robot uses of its battery for metres and seconds, learned in flight.

    Both rates are multiples of a prior, fitted by least squares to what was used between readings of the battery. The prior counts as
    observations of its own; so what the flight does not tell apart, such as a drive at one speed, stays as the prior has it.

    Args:
        prior: What is expected before the flight; both rates are above 0.
        wrong_by: How wrong the prior can be, as a share of itself: 0.25 for 25 %.

    Attributes:
        share: What is in the battery: the median of the last three readings; not a number before the first one.
        read_sec: When it was read last, seconds of the node's clock.
        charges: How often the battery was charged or swapped.
    """

    prior: Rates
    wrong_by: float = 0.25

    def __post_init__(self) -> None:
        self.share, self.read_sec, self.charges = math.nan, -math.inf, 0
        self._readings: deque[float] = deque(maxlen=3)
        self._at: tuple[float, float] | None = None
        self._metres = 0.0
        self._since: _BatteryReading | None = None
        self._lowest = math.inf
        # The sums of least squares: of metres with metres, metres with seconds, seconds with seconds; of each with what was used.
        self._mm = self._ms = self._ss = self._mu = self._su = 0.0

    def moved(self, x: float, y: float) -> None:
        """Take where the robot is by its odometry, metres."""
        step = math.dist(self._at, (x, y)) if self._at is not None else math.inf
        if step > _JUMP_M:
            # How far it has driven since then is not known.
            self._since = None
        elif step >= _GRAIN_M:
            self._metres += step
        if step >= _GRAIN_M:
            self._at = x, y

    def read(self, now: float, share: float) -> None:
        """Take a reading of the battery, and learn from it.

        Args:
            now: The time, seconds of the node's clock.
            share: What is left, of 1 for a full battery.
        """
        if 0.0 <= now - self.read_sec < _APART_SEC:
            return
        self.read_sec = now
        self._readings.append(share)
        self.share = median(self._readings)
        self._compare(_BatteryReading(now, self._metres, self.share))

    def _compare(self, reading: _BatteryReading) -> None:
        """Learn from what was used since another reading, unless the battery is another one."""
        since = self._since
        self._lowest = min(self._lowest, reading.share)
        if reading.share >= self._lowest + RISE_SHARE:
            self.charges += 1
            self._lowest, self._since = reading.share, reading
        elif since is None or reading.sec < since.sec:
            self._since = reading
        else:
            driven = self.prior.per_m * (reading.metres - since.metres)
            waited = self.prior.per_sec * (reading.sec - since.sec)
            used, expected = since.share - reading.share, driven + waited
            # One that has risen a little is compared when it has come down again, or was charged.
            if expected >= WINDOW_SHARE and used >= 0.0:
                if used <= _MOST_TIMES * expected + _MOST_FALL:
                    self._learn(driven, waited, used)
                self._since = reading

    def _learn(self, driven: float, waited: float, used: float) -> None:
        """Add an observation, which weighs as much as was to be expected of it: driven and waited, as the prior has them, and used."""
        expected = driven + waited
        kept = math.exp(-expected / _MEMORY_SHARE)
        self._mm = kept * self._mm + driven * driven / expected
        self._ms = kept * self._ms + driven * waited / expected
        self._ss = kept * self._ss + waited * waited / expected
        self._mu = kept * self._mu + driven * used / expected
        self._su = kept * self._su + waited * used / expected

    @property
    def rates(self) -> Rates:
        """What is used, as far as it is known."""
        by_metre, by_second = self._solve(self._mu + _PRIOR_SHARE, self._su + _PRIOR_SHARE)
        # The best that is not negative lies on the edge where the best of all is outside.
        if by_metre < 0.0:
            by_metre, by_second = 0.0, (self._su + _PRIOR_SHARE) / (self._ss + _PRIOR_SHARE)
        elif by_second < 0.0:
            by_metre, by_second = (self._mu + _PRIOR_SHARE) / (self._mm + _PRIOR_SHARE), 0.0
        return Rates(by_metre * self.prior.per_m, by_second * self.prior.per_sec)

    def _solve(self, first: float, second: float) -> tuple[float, float]:
        """Return the solution of the equations of least squares, with the prior's observations, for a right side."""
        mm, ss = self._mm + _PRIOR_SHARE, self._ss + _PRIOR_SHARE
        determinant = mm * ss - self._ms * self._ms
        return (ss * first - self._ms * second) / determinant, (mm * second - self._ms * first) / determinant

    def need(self, trip: Trip) -> float:
        """Return what a trip takes at most, as a share of a full battery, if the prior is no more wrong than said.

        What is learned lies between the truth and the prior. How far at most it is off for this trip, the weight says that the prior has left.
        """
        rates, (metres, seconds) = self.rates, trip
        off = self._solve(self.prior.per_m * metres, self.prior.per_sec * seconds)
        margin = self.wrong_by * _PRIOR_SHARE * (abs(off[0]) + abs(off[1]))
        return rates.per_m * metres + rates.per_sec * seconds + margin
