"""Flights without ROS: whoever asks before each leg whether he comes home keeps half of the reserve, within the bounds that the page names."""

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
from tests.chance import rounds

# Many flights, of code that other tests reach.
pytestmark = pytest.mark.unmeasured

PRIOR = ConsumptionRates(per_m=0.0015, per_sec=0.0003)
SPEED_MPS, RESERVE = 0.4, 0.15
STEP_SEC = 1.0


@dataclass
class World:
    """What the robot does not know.

    Attributes:
        rates: What it uses.
        speed_mps: How fast it drives.
        detour: How many times as long as the straight line its ways are, at most and at least.
    """

    rates: ConsumptionRates
    speed_mps: float
    detour: tuple[float, float]


class Flight:
    """A flight that asks before each leg, and swaps the battery at home.

    Args:
        chance: Where zones, ways, looks and readings come from.
        world: What the robot does not know.
        wrong_by: How wrong the prior is said to be at most.
        charging: How many charging places there are.
        pieces: Of how many pieces the sweep of a zone is at most; 0 for a look at its pose.
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

    def fly(self) -> "Flight":
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
        """Return whether the next leg is, if need be after a swap."""
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
        """Tell what a battery tells, in percent, and the odometry."""
        self.homing.energy.on_odometry(self._metres, 0.0)
        self.homing.energy.read(self._now, round(self.share, 2))


def unlike(chance: np.random.Generator, wrong_by: float = 0.25) -> World:
    """Return a world within the bounds that docs/how-to/search-by-probability.md names."""
    rates = (rate * chance.uniform(1 - wrong_by, 1 + wrong_by) for rate in PRIOR)
    return World(ConsumptionRates(*rates), SPEED_MPS * chance.uniform(0.9, 1.0), (1.0, DETOUR))


def test_in_flights_by_chance_half_of_the_reserve_is_always_left() -> None:
    lowest = [
        Flight(chance := np.random.default_rng(seed), unlike(chance)).fly().lowest
        for seed in range(rounds(100))
    ]
    assert min(lowest) >= RESERVE / 2, lowest.index(min(lowest))


def test_with_charging_places_half_of_the_reserve_is_always_left_too() -> None:
    """Bounded: less than 20 zones a flight, each with one charge at most."""
    flights = [
        Flight(chance := np.random.default_rng(seed), unlike(chance), charging=2).fly()
        for seed in range(rounds(100))
    ]
    lowest = [flight.lowest for flight in flights]
    assert min(lowest) >= RESERVE / 2, lowest.index(min(lowest))
    stops = [stop for flight in flights for stop in flight.charged_at]
    assert sum(map(bool, stops)) > 20
    assert not all(stops)


@pytest.mark.costly
@pytest.mark.parametrize("charging", [0, 2])
def test_in_sweeps_half_of_the_reserve_is_always_left_too(charging: int) -> None:
    flights = [
        Flight(chance := np.random.default_rng(seed), unlike(chance), charging=charging, pieces=12).fly()
        for seed in range(rounds(50))
    ]
    lowest = [flight.lowest for flight in flights]
    assert min(lowest) >= RESERVE / 2, lowest.index(min(lowest))
    sweeps = [flight.sweeps.state_of(zone) for flight in flights for zone in flight.sweeps.grounds]
    assert sum(len(flight.charged_at) for flight in flights) > 50
    assert sum(each.skipped for each in sweeps) < 0.1 * sum(len(each.pieces) for each in sweeps)


@pytest.mark.costly
def test_in_the_worst_world_sweeps_do_not_cost_the_reserve_either() -> None:
    worst = World(ConsumptionRates(*(1.25 * rate for rate in PRIOR)), 0.9 * SPEED_MPS, (DETOUR, DETOUR))
    lowest = [
        Flight(np.random.default_rng(seed), worst, pieces=12).fly().lowest for seed in range(rounds(30))
    ]
    assert min(lowest) >= RESERVE / 2, lowest.index(min(lowest))


def test_in_the_worst_world_charging_places_do_not_cost_the_reserve_either() -> None:
    worst = World(ConsumptionRates(*(1.25 * rate for rate in PRIOR)), 0.9 * SPEED_MPS, (DETOUR, DETOUR))
    lowest = [
        Flight(np.random.default_rng(seed), worst, charging=3).fly().lowest for seed in range(rounds(50))
    ]
    assert min(lowest) >= RESERVE / 2, lowest.index(min(lowest))


def test_in_the_worst_world_of_the_page_half_of_the_reserve_is_always_left() -> None:
    worst = World(ConsumptionRates(*(1.25 * rate for rate in PRIOR)), 0.9 * SPEED_MPS, (DETOUR, DETOUR))
    lowest = [Flight(np.random.default_rng(seed), worst).fly().lowest for seed in range(rounds(50))]
    assert min(lowest) >= RESERVE / 2, lowest.index(min(lowest))


def test_whoever_takes_a_prior_that_is_half_wrong_for_right_uses_the_reserve_up() -> None:
    worst = World(ConsumptionRates(*(1.5 * rate for rate in PRIOR)), 0.9 * SPEED_MPS, (DETOUR, DETOUR))
    lowest = [Flight(np.random.default_rng(seed), worst, wrong_by=0.0).fly().lowest for seed in range(50)]
    assert min(lowest) < RESERVE / 2


def test_the_battery_is_used_and_not_only_spared() -> None:
    flights = [
        Flight(np.random.default_rng(seed), unlike(np.random.default_rng(seed))).fly() for seed in range(50)
    ]
    swapped = [share for flight in flights for share in flight.at_home[:-1]]
    given_up = sum(len(flight.zones.abandoned_zones()) for flight in flights)
    assert len(swapped) > 50
    assert statistics.median(swapped) < 0.5
    assert given_up < 0.1 * sum(flight.zones.total_zones() for flight in flights)


@pytest.mark.parametrize("seed", range(5))
def test_a_zone_is_given_up_only_where_no_battery_suffices(seed: int) -> None:
    flight = Flight(np.random.default_rng(seed), unlike(np.random.default_rng(seed))).fly()
    for zone in flight.zones.abandoned_zones():
        there_and_back = 2 * flight.zones.path_length_m(flight.zones.base_pose(), zone)
        assert there_and_back * (PRIOR.per_m + PRIOR.per_sec / SPEED_MPS) > 0.5
