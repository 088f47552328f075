"""Battery consumption of driving and waiting: a prior estimate, corrected by the robot's own battery readings.

Energy is measured as a share of a full battery, as in `sensor_msgs/BatteryState.percentage`, 0 to 1.
"""

import math
from collections import deque
from dataclasses import dataclass
from statistics import median
from typing import NamedTuple

WINDOW_SHARE = 0.01
"""Smallest expected consumption between two compared readings; batteries round to about this share."""
RISE_SHARE = 0.03
"""Rise of the battery from which it is regarded as charged or swapped."""

# Weight of the prior: as if this share of the battery had been used by driving, and the same share by time.
_PRIOR_SHARE = 0.03
# Older observations are forgotten: the last half of a battery is remembered.
_MEMORY_SHARE = 0.5
# A larger fall than both together is not consumption: the battery was swapped, or its gauge recalibrated.
_MOST_TIMES, _MOST_FALL = 5.0, 0.1
# Below this a robot's odometry may drift at rest; above that it was reset, metres.
_GRAIN_M, _JUMP_M = 0.05, 2.0
# Readings closer together are the same one, received by two leaves, seconds.
_APART_SEC = 0.2


class TripEstimate(NamedTuple):
    """Distance and duration of a trip.

    Attributes:
        metres: The distance.
        seconds: The duration.
    """

    metres: float
    seconds: float


class ConsumptionRates(NamedTuple):
    """Rates of consumption.

    Attributes:
        per_m: Share of a full battery for each metre driven.
        per_sec: Share of a full battery for each second, driving or not.
    """

    per_m: float
    per_sec: float


class _BatteryReading(NamedTuple):
    sec: float
    metres: float
    share: float


@dataclass(eq=False)
class EnergyModel:
    """Battery consumption of a robot by distance and time, learned during the run.

    Both rates are multiples of a prior, fitted by least squares to the consumption between battery readings. The prior enters as
    observations of its own. It therefore decides whatever the run cannot distinguish, such as both rates in a drive at one speed.

    Args:
        prior: The expected rates before the run; both are above 0.
        wrong_by: Largest error of the prior, as a share of itself: 0.25 for 25 %.

    Attributes:
        share: The charge of the battery: the median of the last three readings; NaN before the first one.
        read_sec: Time of the last reading, seconds of the node's clock.
        charges: Number of times the battery was charged or swapped.
    """

    prior: ConsumptionRates
    wrong_by: float = 0.25

    def __post_init__(self) -> None:
        self.share, self.read_sec, self.charges = math.nan, -math.inf, 0
        self._readings: deque[float] = deque(maxlen=3)
        self._at: tuple[float, float] | None = None
        self._metres = 0.0
        self._since: _BatteryReading | None = None
        self._lowest = math.inf
        # Least-squares sums: metres by metres, metres by seconds, seconds by seconds; each with the consumption.
        self._mm = self._ms = self._ss = self._mu = self._su = 0.0

    def on_odometry(self, x: float, y: float) -> None:
        """Update the robot's position from its odometry, metres."""
        step = math.dist(self._at, (x, y)) if self._at is not None else math.inf
        if step > _JUMP_M:
            # The distance driven since then is unknown.
            self._since = None
        elif step >= _GRAIN_M:
            self._metres += step
        if step >= _GRAIN_M:
            self._at = x, y

    def read(self, now: float, share: float) -> None:
        """Process a battery reading and learn from it.

        Args:
            now: The time, seconds of the node's clock.
            share: The charge, 1 for a full battery.
        """
        if 0.0 <= now - self.read_sec < _APART_SEC:
            return
        self.read_sec = now
        self._readings.append(share)
        self.share = median(self._readings)
        self._compare(_BatteryReading(now, self._metres, self.share))

    def _compare(self, reading: _BatteryReading) -> None:
        """Learn from the consumption since an earlier reading, unless the battery was swapped."""
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
            # A reading that rose slightly is ignored until it has fallen again, or the battery was charged.
            if expected >= WINDOW_SHARE and used >= 0.0:
                if used <= _MOST_TIMES * expected + _MOST_FALL:
                    self._add_observation(driven, waited, used)
                self._since = reading

    def _add_observation(self, driven: float, waited: float, used: float) -> None:
        """Add an observation of driving, waiting and consumption, weighted by the consumption that the prior expects."""
        expected = driven + waited
        kept = math.exp(-expected / _MEMORY_SHARE)
        self._mm = kept * self._mm + driven * driven / expected
        self._ms = kept * self._ms + driven * waited / expected
        self._ss = kept * self._ss + waited * waited / expected
        self._mu = kept * self._mu + driven * used / expected
        self._su = kept * self._su + waited * used / expected

    @property
    def rates(self) -> ConsumptionRates:
        """Current estimate of the rates."""
        by_metre, by_second = self._solve(self._mu + _PRIOR_SHARE, self._su + _PRIOR_SHARE)
        # If the optimum has a negative rate, the best valid solution has that rate at 0.
        if by_metre < 0.0:
            by_metre, by_second = 0.0, (self._su + _PRIOR_SHARE) / (self._ss + _PRIOR_SHARE)
        elif by_second < 0.0:
            by_metre, by_second = (self._mu + _PRIOR_SHARE) / (self._mm + _PRIOR_SHARE), 0.0
        return ConsumptionRates(by_metre * self.prior.per_m, by_second * self.prior.per_sec)

    def _solve(self, first: float, second: float) -> tuple[float, float]:
        """Solve the least-squares equations for a right-hand side."""
        mm, ss = self._mm + _PRIOR_SHARE, self._ss + _PRIOR_SHARE
        determinant = mm * ss - self._ms * self._ms
        return (ss * first - self._ms * second) / determinant, (mm * second - self._ms * first) / determinant

    def need(self, trip: TripEstimate) -> float:
        """Return the maximum consumption of a trip, as a share of a full battery.

        The learned rate is between the truth and the prior. The remaining weight of the prior bounds its error for this trip.
        """
        rates, (metres, seconds) = self.rates, trip
        off = self._solve(self.prior.per_m * metres, self.prior.per_sec * seconds)
        margin = self.wrong_by * _PRIOR_SHARE * (abs(off[0]) + abs(off[1]))
        return rates.per_m * metres + rates.per_sec * seconds + margin
