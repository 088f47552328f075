"""Tests of the energy model: consumption is learned, except across battery swaps and implausible readings."""

import math

import numpy as np
import pytest

from search_and_rescue.energy import ConsumptionRates, EnergyModel, TripEstimate
from tests.random_inputs import rounds

PRIOR = ConsumptionRates(per_m=0.0005, per_sec=0.0001)
TRIP = TripEstimate(100.0, 250.0)


class Robot:
    """A robot on the x axis, whose battery is read once a second.

    Args:
        model: The model that learns from this robot.
        times: Its consumption per metre and per second, as multiples of the prior.
        grain: The resolution of its battery readings.
    """

    def __init__(
        self, model: EnergyModel, times: tuple[float, float] = (1.0, 1.0), grain: float = 0.01
    ) -> None:
        self.model, self._grain = model, grain
        self.rates = ConsumptionRates(PRIOR.per_m * times[0], PRIOR.per_sec * times[1])
        self.now, self.x, self.share = 100.0, 0.0, 1.0

    def go(self, seconds: int, speed: float = 0.4) -> "Robot":
        for _ in range(seconds):
            self.now, self.x = self.now + 1.0, self.x + speed
            self.share -= speed * self.rates.per_m + self.rates.per_sec
            self.model.on_odometry(self.x, 0.0)
            self.model.read(self.now, round(self.share / self._grain) * self._grain)
        return self

    def used(self, trip: TripEstimate) -> float:
        return trip.metres * self.rates.per_m + trip.seconds * self.rates.per_sec


def test_initial_need_is_prior_with_full_margin() -> None:
    model = EnergyModel(PRIOR, wrong_by=0.25)
    assert model.rates == PRIOR
    assert model.need(TRIP) == pytest.approx(1.25 * (0.05 + 0.025))
    assert EnergyModel(PRIOR, wrong_by=0.0).need(TRIP) == pytest.approx(0.075)
    assert math.isnan(model.share)


@pytest.mark.parametrize("times", [(1.25, 1.25), (0.75, 1.25), (1.25, 0.75), (0.75, 0.75)])
def test_both_rates_are_learned_from_driving_and_standing(times: tuple[float, float]) -> None:
    robot = Robot(EnergyModel(PRIOR), times, grain=0.001)
    for _ in range(4):
        robot.go(400).go(500, speed=0.0)
    assert robot.model.rates.per_m == pytest.approx(robot.rates.per_m, rel=0.12)
    assert robot.model.rates.per_sec == pytest.approx(robot.rates.per_sec, rel=0.12)


def test_learning_reduces_margin() -> None:
    robot = Robot(EnergyModel(PRIOR))
    before = robot.model.need(TRIP)
    after = robot.go(1500).model.need(TRIP)
    assert robot.used(TRIP) < after < 1.1 * robot.used(TRIP) < before


@pytest.mark.parametrize("times", [(2.0, 2.0), (0.3, 1.0), (1.0, 3.0), (0.0, 1.0)])
def test_wrong_prior_is_corrected(times: tuple[float, float]) -> None:
    robot = Robot(EnergyModel(PRIOR), times)
    while robot.share > 0.2:
        robot.go(200).go(50, speed=0.0)
    learned = robot.model.rates
    error = abs(learned.per_m * 100 + learned.per_sec * 250 - robot.used(TRIP))
    assert error < 0.5 * abs(PRIOR.per_m * 100 + PRIOR.per_sec * 250 - robot.used(TRIP))
    assert min(learned) >= 0.0


def test_rates_never_become_negative() -> None:
    heated = Robot(EnergyModel(PRIOR), (0.0, 10.0)).go(300, speed=0.0)
    heated.rates = ConsumptionRates(0.0, 0.0)
    learned = heated.go(200, speed=1.0).model.rates
    assert (learned.per_m, learned.per_sec > 2 * PRIOR.per_sec) == (0.0, True)
    fast = Robot(EnergyModel(PRIOR), (10.0, 0.0)).go(100, speed=1.0)
    fast.rates = ConsumptionRates(0.0, 0.0)
    learned = fast.go(900, speed=0.1).model.rates
    assert (learned.per_m > 2 * PRIOR.per_m, learned.per_sec) == (True, 0.0)


def test_rates_are_learned_from_coarse_battery_readings() -> None:
    robot = Robot(EnergyModel(PRIOR), (2.0, 2.0), grain=0.1).go(1400)
    assert robot.model.need(TRIP) == pytest.approx(robot.used(TRIP), rel=0.15)


def test_need_is_never_too_low_within_stated_error() -> None:
    for seed in range(rounds(60)):
        chance = np.random.default_rng(seed)
        times = chance.uniform(0.75, 1.25), chance.uniform(0.75, 1.25)
        robot = Robot(EnergyModel(PRIOR, wrong_by=0.25), times, grain=1e-6)
        while robot.share > 0.2:
            trip = TripEstimate(chance.uniform(0.0, 200.0), chance.uniform(0.0, 900.0))
            # The median of three readings lags by one second.
            assert robot.model.need(trip) >= robot.used(trip) * 0.99, seed
            robot.go(int(chance.integers(10, 300)), float(chance.choice([0.0, 0.2, 0.4])))


def test_swapped_battery_is_detected_and_not_learned_from() -> None:
    robot = Robot(EnergyModel(PRIOR)).go(1000)
    known = robot.model.rates
    robot.share = 0.95
    robot.go(3)
    assert (robot.model.charges, robot.model.rates) == (1, known)
    assert robot.model.share == pytest.approx(0.95, abs=0.01)
    robot.rates = ConsumptionRates(3 * PRIOR.per_m, 3 * PRIOR.per_sec)
    assert robot.go(300).model.rates.per_m > 1.5 * PRIOR.per_m


def test_slow_charge_is_detected_and_not_learned_from() -> None:
    robot = Robot(EnergyModel(PRIOR), grain=0.001).go(1000)
    known, begun = robot.model.rates, robot.share
    robot.rates = ConsumptionRates(0.0, -0.0001)
    while robot.share < begun + 0.1:
        robot.go(60, speed=0.0)
    assert robot.model.charges == 3
    assert robot.model.rates.per_sec == pytest.approx(known.per_sec, rel=0.02)


@pytest.mark.parametrize("share", [0.3, 0.0])
def test_unexplained_drop_is_not_learned_from(share: float) -> None:
    robot = Robot(EnergyModel(PRIOR)).go(1000)
    known = robot.model.rates
    robot.share = share + 0.05
    robot.go(90)
    assert robot.model.rates.per_m == pytest.approx(known.per_m, rel=0.1)
    assert robot.model.share == pytest.approx(share + 0.02, abs=0.01)


def test_single_wrong_reading_is_ignored() -> None:
    robot = Robot(EnergyModel(PRIOR)).go(1000)
    known = robot.model.rates
    robot.model.read(robot.now + 0.5, 0.0)
    assert robot.model.share == pytest.approx(robot.share, abs=0.01)
    robot.go(2)
    assert (robot.model.charges, robot.model.rates) == (0, known)


def test_readings_in_quick_succession_count_once() -> None:
    model = EnergyModel(PRIOR)
    model.read(1.0, 0.5)
    model.read(1.1, 0.9)
    assert model.share == 0.5
    model.read(0.0, 0.9)
    assert model.share == pytest.approx(0.7)


def test_odometry_jitter_adds_no_distance() -> None:
    def standing(tremble: float) -> EnergyModel:
        robot = Robot(EnergyModel(PRIOR), (1.0, 2.0), grain=0.001)
        for second in range(3000):
            robot.x = tremble * (second % 2)
            robot.go(1, speed=0.0)
        return robot.model

    assert standing(0.02).rates == standing(0.0).rates
    assert standing(0.0).rates.per_sec == pytest.approx(2 * PRIOR.per_sec, rel=0.15)


def test_odometry_reset_is_not_learned_from() -> None:
    robot = Robot(EnergyModel(PRIOR), (1.0, 3.0), grain=0.001).go(20)
    robot.x += 1000.0
    robot.go(30)
    assert robot.model.rates == PRIOR


def test_clock_reset_is_not_learned_from() -> None:
    robot = Robot(EnergyModel(PRIOR), (3.0, 3.0), grain=0.001).go(25)
    robot.now = 0.0
    robot.go(30)
    assert robot.model.rates == PRIOR
    assert robot.go(10).model.rates != PRIOR
