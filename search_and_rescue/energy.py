"""Model the battery consumption by driving and waiting. Battery readings correct the initial estimate.

Energy is a share of a full battery, 0 to 1, as in `sensor_msgs/msg/BatteryState.percentage`.
"""

import math
from collections import deque
from dataclasses import dataclass
from statistics import median
from typing import NamedTuple

WINDOW_SHARE = 0.01
"""Two readings are compared only if the expected consumption between them is at least this share. Many batteries report
their charge with about this resolution."""
RISE_SHARE = 0.03
"""If the charge rises by at least this share, the battery is assumed to have been charged or swapped."""

# The prior has the weight of one observed consumption of this share by driving, and one of the same share by time.
_PRIOR_SHARE = 0.03
# The weight of an observation falls to 1/e after an expected consumption of this share.
_MEMORY_SHARE = 0.5
# A fall above _MAX_FACTOR * expected + _MAX_FALL is not consumption: the battery was swapped, or the gauge was recalibrated.
_MAX_FACTOR, _MAX_FALL = 5.0, 0.1
# Smaller steps of the odometry may be drift of a robot at rest; larger steps mean that the odometry was reset; metres.
_MIN_STEP_M, _MAX_STEP_M = 0.05, 2.0
# Two readings within this time, seconds, are the same message, received by two leaves.
_MIN_INTERVAL_SEC = 0.2


class TripEstimate(NamedTuple):
    """The expected distance and duration of a trip.

    Attributes:
        metres: The distance.
        seconds: The duration.
    """

    metres: float
    seconds: float


class ConsumptionRates(NamedTuple):
    """The battery consumption per metre and per second.

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
    """A model of the battery consumption by distance and time. The model learns during the run.

    Each rate is a multiple of a prior rate. The multiples are fitted by least squares to the consumption
    between battery readings, with the prior as additional observations. If the readings cannot separate the
    two rates, as in a drive at constant speed, the prior determines the ratio of the rates.

    Args:
        prior: The expected rates before the run; both are above 0.
        wrong_by: Maximum relative error of the prior: 0.25 for 25 %.

    Attributes:
        share: The charge of the battery, as the median of the last three readings; NaN before the first reading.
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
        # Least-squares sums: metres by metres, metres by seconds, seconds by seconds; metres and seconds by consumption.
        self._mm = self._ms = self._ss = self._mu = self._su = 0.0

    def on_odometry(self, x: float, y: float) -> None:
        """Update the driven distance with a new odometry position, in metres."""
        step = math.dist(self._at, (x, y)) if self._at is not None else math.inf
        if step > _MAX_STEP_M:
            # The distance driven since the last compared reading is unknown.
            self._since = None
        elif step >= _MIN_STEP_M:
            self._metres += step
        if step >= _MIN_STEP_M:
            self._at = x, y

    def read(self, now: float, share: float) -> None:
        """Process a battery reading, and update the rates.

        Args:
            now: The time, seconds of the node's clock.
            share: The charge, 1 for a full battery.
        """
        if 0.0 <= now - self.read_sec < _MIN_INTERVAL_SEC:
            return
        self.read_sec = now
        self._readings.append(share)
        self.share = median(self._readings)
        self._compare(_BatteryReading(now, self._metres, self.share))

    def _compare(self, reading: _BatteryReading) -> None:
        """Update the rates with the consumption since an earlier reading. Ignore charged or swapped batteries."""
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
            # After a slight rise, wait until the charge has fallen again or the battery was charged.
            if expected >= WINDOW_SHARE and used >= 0.0:
                if used <= _MAX_FACTOR * expected + _MAX_FALL:
                    self._add_observation(driven, waited, used)
                self._since = reading

    def _add_observation(self, driven: float, waited: float, used: float) -> None:
        """Add an observed consumption and the expected shares of driving and waiting. Older observations decay."""
        expected = driven + waited
        decay = math.exp(-expected / _MEMORY_SHARE)
        self._mm = decay * self._mm + driven * driven / expected
        self._ms = decay * self._ms + driven * waited / expected
        self._ss = decay * self._ss + waited * waited / expected
        self._mu = decay * self._mu + driven * used / expected
        self._su = decay * self._su + waited * used / expected

    @property
    def rates(self) -> ConsumptionRates:
        """The current estimate of the consumption rates."""
        by_metre, by_second = self._solve(self._mu + _PRIOR_SHARE, self._su + _PRIOR_SHARE)
        # If one rate of the optimum is negative, the best valid solution has 0 for this rate.
        if by_metre < 0.0:
            by_metre, by_second = 0.0, (self._su + _PRIOR_SHARE) / (self._ss + _PRIOR_SHARE)
        elif by_second < 0.0:
            by_metre, by_second = (self._mu + _PRIOR_SHARE) / (self._mm + _PRIOR_SHARE), 0.0
        return ConsumptionRates(by_metre * self.prior.per_m, by_second * self.prior.per_sec)

    def _solve(self, first: float, second: float) -> tuple[float, float]:
        """Solve the least-squares equations for a given right-hand side."""
        mm, ss = self._mm + _PRIOR_SHARE, self._ss + _PRIOR_SHARE
        determinant = mm * ss - self._ms * self._ms
        return (ss * first - self._ms * second) / determinant, (mm * second - self._ms * first) / determinant

    def need(self, trip: TripEstimate) -> float:
        """Return the maximum consumption of a trip, as a share of a full battery.

        The learned rates are between the true rates and the prior. The remaining weight of the prior limits
        the error for this trip.
        """
        rates, (metres, seconds) = self.rates, trip
        weights = self._solve(self.prior.per_m * metres, self.prior.per_sec * seconds)
        margin = self.wrong_by * _PRIOR_SHARE * (abs(weights[0]) + abs(weights[1]))
        return rates.per_m * metres + rates.per_sec * seconds + margin
