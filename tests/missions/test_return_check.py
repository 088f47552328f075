"""Tests of the return check in simulated runs without ROS.

A robot that checks before each leg whether it can return keeps half of the reserve, within the bounds stated on the page.
"""

import math
import statistics
from dataclasses import dataclass

import numpy as np
import pytest

from search_and_rescue.energy import ConsumptionRates, EnergyModel
from search_and_rescue.homing_estimates import HomingEstimator
from search_and_rescue.search import Search
from search_and_rescue.search_theory import Ground, SearchExpectation
from search_and_rescue.sweep_record import SweepStates
from search_and_rescue.zone_manager import DETOUR, MapPose, Zone, ZoneManager
from tests.random_inputs import rounds

# Many runs of code that other tests cover.
pytestmark = pytest.mark.unmeasured

PRIOR = ConsumptionRates(per_m=0.0015, per_sec=0.0003)
SPEED_MPS, RESERVE = 0.4, 0.15
STEP_SEC = 1.0


@dataclass
class World:
    """The true values, which the robot does not know.

    Attributes:
        rates: The consumption.
        speed_mps: The speed in m/s.
        detour: Minimum and maximum length of paths, as multiples of the straight line.
    """

    rates: ConsumptionRates
    speed_mps: float
    detour: tuple[float, float]


class SimulatedRun:
    """A run that checks the return before each leg, and swaps the battery at home or at a charging place.

    Args:
        chance: The random generator for zones, paths, search times and batteries.
        world: The true values, which the robot does not know.
        wrong_by: The stated maximum error of the prior.
        charging: The number of charging places.
        pieces: Maximum number of pieces of a sweep; 0 to search from the pose of the zone.
    """

    def __init__(
        self,
        chance: np.random.Generator,
        world: World,
        wrong_by: float = 0.25,
        *,
        charging: int = 0,
        pieces: int = 0,
    ) -> None:
        self._chance, self._world, self._pieces = chance, world, pieces
        base = MapPose(x=0.0, y=0.0, yaw=0.0)
        count = int(chance.integers(4, 13))
        places = [(chance.uniform(-80, 80), chance.uniform(-80, 80)) for _ in range(count)]
        zones = [{"id": f"zone_{i}", "x": x, "y": y, "yaw": 0.0} for i, (x, y) in enumerate(places)]
        areas = {f"zone_{i}": SearchExpectation(0.05, 0.8, chance.uniform(5, 90)) for i in range(count)}
        docks = {
            f"dock_{i}": MapPose(x=chance.uniform(-80, 80), y=chance.uniform(-80, 80), yaw=0.0)
            for i in range(charging)
        }
        self.zones = ZoneManager(zones, base, areas=areas, speed_mps=SPEED_MPS, charging=docks)
        ground = Ground(((0.0, 0.0), (1.0, 0.0), (0.0, 1.0)), 1.0, 1.0)
        self.sweeps = SweepStates({zone["id"]: ground for zone in self.zones.remaining_zones()})
        energy = EnergyModel(PRIOR, wrong_by)
        self.homing = HomingEstimator(
            self.zones, energy, sweeps=self.sweeps, reserve=RESERVE, speed_mps=SPEED_MPS
        )
        self.search = Search(self.zones, homing=self.homing, sweeps=self.sweeps)
        self.share = self.lowest = 1.0
        self.at_home: list[float] = []
        self.charged_at: list[str] = []
        self._now = self._metres = 0.0
        self.homing.place = base
        self._read()

    def execute(self) -> "SimulatedRun":
        while self.zones.has_remaining():
            zone = self.zones.current_zone()
            if self._pieces:
                self._sweep(zone)
                self.zones.select_next_zone()
            elif self._is_in_reach():
                self._drive(zone)
                self._wait(self.zones.areas[zone["id"]].look_sec)
                self.zones.select_next_zone()
            else:
                self.zones.abandon("it is out of reach of any battery")
        self._go_home()
        return self

    def _sweep(self, zone: Zone) -> None:
        count = int(self._chance.integers(1, self._pieces + 1))
        self.sweeps.plan(zone["id"], "parallel", 5.0, [self._near(zone) for _ in range(count)])
        while (sweep := self.sweeps.state_of(zone["id"])).open_count:
            if self._is_in_reach():
                self._drive(sweep.pieces[sweep.done])
                self._wait(self.zones.areas[zone["id"]].look_sec / count)
                self.sweeps.finish_piece(zone["id"], None, 0.6)
            else:
                self.sweeps.skip(zone["id"], "it is out of reach of any battery")

    def _near(self, zone: Zone) -> MapPose:
        x, y = (zone[axis] + self._chance.uniform(-20, 20) for axis in ("x", "y"))
        return MapPose(x=x, y=y, yaw=0.0)

    def _is_in_reach(self) -> bool:
        """Return whether the next leg is in reach, if necessary after a swap."""
        if self.homing.shortage() and not self.homing.excess():
            self._swap()
        return not self.homing.shortage()

    def _swap(self) -> None:
        name, pose = self.homing.charging_stop()
        self.charged_at.append(name)
        if name:
            self._drive(pose)
            self.search.record.charging_reached(name)
        else:
            self._go_home()
        self.share = self._chance.uniform(0.9, 1.0)
        for _ in range(3):
            self._use(0.0, STEP_SEC)

    def _go_home(self) -> None:
        self._drive(self.zones.base_pose())
        self.search.record.base_reached()
        self.at_home.append(self.share)

    def _drive(self, target: MapPose) -> None:
        here = self.homing.place
        assert here is not None
        line = math.dist((here["x"], here["y"]), (target["x"], target["y"]))
        left = line * self._chance.uniform(*self._world.detour)
        step = self._world.speed_mps * STEP_SEC
        while left > 0.0:
            self._use(min(step, left), STEP_SEC)
            left -= step
        self.homing.place = target

    def _wait(self, seconds: float) -> None:
        while seconds > 0.0:
            self._use(0.0, STEP_SEC)
            seconds -= STEP_SEC

    def _use(self, metres: float, seconds: float) -> None:
        self.share -= metres * self._world.rates.per_m + seconds * self._world.rates.per_sec
        self.lowest = min(self.lowest, self.share)
        self._now += seconds
        self._metres += metres
        self._read()

    def _read(self) -> None:
        """Report battery (in whole percent) and odometry to the model."""
        self.homing.energy.on_odometry(self._metres, 0.0)
        self.homing.energy.read(self._now, round(self.share, 2))


def random_world(chance: np.random.Generator, wrong_by: float = 0.25) -> World:
    """Return a random world within the bounds that docs/how-to/search-by-probability.md states."""
    rates = (rate * chance.uniform(1 - wrong_by, 1 + wrong_by) for rate in PRIOR)
    return World(ConsumptionRates(*rates), SPEED_MPS * chance.uniform(0.9, 1.0), (1.0, DETOUR))


def test_random_runs_keep_half_of_reserve() -> None:
    lowest = [
        SimulatedRun(chance := np.random.default_rng(seed), random_world(chance)).execute().lowest
        for seed in range(rounds(100))
    ]
    assert min(lowest) >= RESERVE / 2, lowest.index(min(lowest))


def test_runs_with_charging_places_keep_half_of_reserve() -> None:
    """The runs terminate: there are less than 20 zones, each with at most one charge."""
    runs = [
        SimulatedRun(chance := np.random.default_rng(seed), random_world(chance), charging=2).execute()
        for seed in range(rounds(100))
    ]
    lowest = [run.lowest for run in runs]
    assert min(lowest) >= RESERVE / 2, lowest.index(min(lowest))
    stops = [stop for run in runs for stop in run.charged_at]
    assert sum(map(bool, stops)) > 20
    assert not all(stops)


@pytest.mark.costly
@pytest.mark.parametrize("charging", [0, 2])
def test_sweeps_keep_half_of_reserve(charging: int) -> None:
    runs = [
        SimulatedRun(
            chance := np.random.default_rng(seed), random_world(chance), charging=charging, pieces=12
        ).execute()
        for seed in range(rounds(50))
    ]
    lowest = [run.lowest for run in runs]
    assert min(lowest) >= RESERVE / 2, lowest.index(min(lowest))
    sweeps = [run.sweeps.state_of(zone) for run in runs for zone in run.sweeps.grounds]
    assert sum(len(run.charged_at) for run in runs) > 50
    assert sum(each.skipped for each in sweeps) < 0.1 * sum(len(each.pieces) for each in sweeps)


@pytest.mark.costly
def test_worst_case_sweeps_keep_half_of_reserve() -> None:
    worst = World(ConsumptionRates(*(1.25 * rate for rate in PRIOR)), 0.9 * SPEED_MPS, (DETOUR, DETOUR))
    lowest = [
        SimulatedRun(np.random.default_rng(seed), worst, pieces=12).execute().lowest
        for seed in range(rounds(30))
    ]
    assert min(lowest) >= RESERVE / 2, lowest.index(min(lowest))


def test_worst_case_runs_with_charging_places_keep_half_of_reserve() -> None:
    worst = World(ConsumptionRates(*(1.25 * rate for rate in PRIOR)), 0.9 * SPEED_MPS, (DETOUR, DETOUR))
    lowest = [
        SimulatedRun(np.random.default_rng(seed), worst, charging=3).execute().lowest
        for seed in range(rounds(50))
    ]
    assert min(lowest) >= RESERVE / 2, lowest.index(min(lowest))


def test_worst_case_runs_keep_half_of_reserve() -> None:
    worst = World(ConsumptionRates(*(1.25 * rate for rate in PRIOR)), 0.9 * SPEED_MPS, (DETOUR, DETOUR))
    lowest = [SimulatedRun(np.random.default_rng(seed), worst).execute().lowest for seed in range(rounds(50))]
    assert min(lowest) >= RESERVE / 2, lowest.index(min(lowest))


def test_wrong_prior_with_zero_margin_uses_up_reserve() -> None:
    worst = World(ConsumptionRates(*(1.5 * rate for rate in PRIOR)), 0.9 * SPEED_MPS, (DETOUR, DETOUR))
    lowest = [
        SimulatedRun(np.random.default_rng(seed), worst, wrong_by=0.0).execute().lowest for seed in range(50)
    ]
    assert min(lowest) < RESERVE / 2


def test_battery_is_used_below_half_and_few_zones_are_abandoned() -> None:
    runs = [
        SimulatedRun(np.random.default_rng(seed), random_world(np.random.default_rng(seed))).execute()
        for seed in range(50)
    ]
    swapped = [share for run in runs for share in run.at_home[:-1]]
    given_up = sum(len(run.zones.abandoned_zones()) for run in runs)
    assert len(swapped) > 50
    assert statistics.median(swapped) < 0.5
    assert given_up < 0.1 * sum(run.zones.total_zones() for run in runs)


@pytest.mark.parametrize("seed", range(5))
def test_zone_is_abandoned_only_if_no_battery_suffices(seed: int) -> None:
    run = SimulatedRun(np.random.default_rng(seed), random_world(np.random.default_rng(seed))).execute()
    for zone in run.zones.abandoned_zones():
        there_and_back = 2 * run.zones.path_length_m(run.zones.base_pose(), zone)
        assert there_and_back * (PRIOR.per_m + PRIOR.per_sec / SPEED_MPS) > 0.5
