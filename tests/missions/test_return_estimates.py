"""Tests of return estimates: parameters, the next leg, and the point of no return."""

from typing import Any

import pytest

from sar_compiler.missions import ParameterError, ParameterReader
from search_and_rescue.energy import ConsumptionRates, EnergyModel, TripEstimate
from search_and_rescue.homing_estimates import PRIOR, RESERVE, HomingEstimator
from search_and_rescue.plugin import MISSION
from search_and_rescue.search import Search
from search_and_rescue.search_theory import Ground, SearchExpectation
from search_and_rescue.sweep_record import SweepStates
from search_and_rescue.zone_manager import MapPose, ZoneManager

BASE = MapPose(x=0.0, y=0.0, yaw=0.0)


def pose(x: float) -> MapPose:
    return MapPose(x=x, y=0.0, yaw=0.0)


def homing(share: float | None = 0.5, **options: Any) -> HomingEstimator:
    """Return an estimator with zones 10 and 20 m away, where a metre takes 1 % and time takes almost nothing."""
    zones = [{"id": "a", **pose(10.0)}, {"id": "b", **pose(20.0)}]
    areas = {"a": SearchExpectation(0.5, 0.5, 8.0), "b": SearchExpectation(0.5, 0.5, 0.0)}
    energy = EnergyModel(ConsumptionRates(0.01, 1e-9), wrong_by=0.0)
    made = HomingEstimator(ZoneManager(zones, BASE, areas=areas), energy, speed_mps=0.5, **options)
    if share is not None:
        energy.read(0.0, share)
    return made


def homing_from_parameters(**energy: object) -> HomingEstimator:
    given = {"zone_order": ["a"], "zones.a.x": 1.0, "zones.a.y": 0.0, "zones.a.yaw": 0.0}
    reader = ParameterReader({**given, **{f"energy.{name}": value for name, value in energy.items()}})
    search = MISSION.begin(reader)
    reader.complain()
    found = search.context[HomingEstimator]
    assert isinstance(found, HomingEstimator)
    return found


def test_energy_parameters_set_rates_and_reserve() -> None:
    made = homing_from_parameters(per_m=0.002, per_sec=0.001, wrong_by=0.5, reserve=0.3)
    assert (made.energy.prior, made.energy.wrong_by, made.reserve) == (
        ConsumptionRates(0.002, 0.001),
        0.5,
        0.3,
    )
    plain = homing_from_parameters()
    assert (plain.energy.prior, plain.energy.wrong_by, plain.reserve) == (PRIOR, 0.25, RESERVE)


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"per_m": 0}, "energy.per_m: must be above 0, but is 0"),
        ({"per_sec": -1}, "energy.per_sec: must be a share from 0 to 1, but is -1"),
        (
            {"reserve": 15},
            "energy.reserve: must be a share from 0 to 1, but is 15; 15 percent are 0.15: write 0.15",
        ),
        ({"reserve": 1.0}, "energy.reserve: is 1: write a share of at least 0 and below 1"),
        ({"wrong_by": -0.1}, "energy.wrong_by: must be a share from 0 to 1, but is -0.1"),
        ({"per_metre": 0.1}, "energy.per_metre: is unknown, did you mean 'per_m'?"),
        ({"reserve": "much"}, "energy.reserve: must be a number"),
    ],
)
def test_energy_parameter_error_is_reported_before_run(given: dict[str, Any], said: str) -> None:
    with pytest.raises(ParameterError) as refused:
        homing_from_parameters(**given)
    assert said in str(refused.value)


def test_leg_includes_outward_path_search_and_return() -> None:
    made = homing()
    # Paths are 1.5 times the straight line.
    assert made.leg() == TripEstimate(30.0, 30.0 / 0.5 + 8.0)
    made.place = pose(-10.0)
    assert made.leg() == TripEstimate(45.0, 45.0 / 0.5 + 8.0)
    assert made.home() == TripEstimate(15.0, 30.0)


def homing_in_sweep(**options: Any) -> tuple[HomingEstimator, SweepStates]:
    """Return an estimator in a sweep of zone a with four pieces, 5 to 8 m away."""
    sweeps = SweepStates({"a": Ground(((5.0, 0.0), (9.0, 0.0), (9.0, 1.0)), 1.0, 1.0)})
    made = homing(sweeps=sweeps, **options)
    Search(made.zones, homing=made, sweeps=sweeps)
    sweeps.plan("a", "parallel", 1.0, [pose(5.0 + piece) for piece in range(4)])
    return made, sweeps


def test_leg_of_sweep_goes_to_open_piece_with_share_of_search_time() -> None:
    made, sweeps = homing_in_sweep()
    assert made.leg() == TripEstimate(15.0, 15.0 / 0.5 + 2.0)
    sweeps.finish_piece("a", None, 0.5)
    assert made.leg().metres == pytest.approx(1.5 * (1.0 + 6.0))
    assert made.home().metres == 7.5
    for _ in range(3):
        sweeps.skip("a", "it was not reached")
    assert made.leg().metres == pytest.approx(1.5 * (5.0 + 10.0))


def test_shortage_for_piece_names_its_number() -> None:
    made, _ = homing_in_sweep(share=0.2)
    assert made.shortage().startswith(
        "piece 1/4 of a needs 15% of a full battery (15 m, 32 s), but the battery is at 20%"
    )
    made.ends_at = 20.0
    assert made.late(0.0).startswith("piece 1/4 of a and the way home need 32 s")
    far, _ = homing_in_sweep(reserve=0.9)
    assert far.excess().startswith(
        "piece 1/4 of a needs 15% of a full battery from home and back (15 m, 32 s)"
    )


def test_skipping_piece_discards_its_planned_path() -> None:
    made, sweeps = homing_in_sweep()
    ways = made.required_paths()
    assert [(start["x"], end["x"]) for start, end in ways] == [(0.0, 5.0)]
    made.zones.store_path_length(*ways[0], 40.0)
    assert made.leg().metres == 80.0
    sweeps.skip("a", "it was not reached")
    assert not made.zones.has_path_length(*ways[0])


def test_reserve_is_added_to_failsafe_limit() -> None:
    made = homing(share=0.64)
    assert made.shortage() == ""
    made.ends_below = 0.2
    assert made.shortage().endswith("the reserve is 15% above the limit of 20% that ends the mission")
    made.energy.read(1.0, 0.66)
    made.energy.read(2.0, 0.66)
    assert made.shortage() == ""
    made.zones.choose_zone("b")
    assert made.excess() == ""
    made.ends_below = 0.3
    assert made.excess().endswith("only 55% is available above the reserve")


def test_robot_without_pose_is_assumed_at_last_searched_zone() -> None:
    search = Search(ZoneManager([{"id": "a", **pose(10.0)}], BASE))
    found = search.context[HomingEstimator]
    assert isinstance(found, HomingEstimator)
    assert found.home().metres == 0.0
    search.record.zone_searched("a", None)
    assert found.home().metres == 15.0
    search.record.base_reached()
    assert found.home().metres == 0.0


def test_planned_path_is_used_near_its_start() -> None:
    made = homing()
    zones = made.zones
    zones.store_path_length(BASE, zones.current_zone(), 40.0)
    assert made.leg().metres == 80.0
    made.place = pose(0.5)
    assert made.leg().metres == 80.75
    assert made.home().metres == 0.75
    made.place = pose(1.5)
    assert made.leg().metres == pytest.approx(1.5 * 8.5 + 40.0)


def test_shortage_for_leg_states_figures() -> None:
    assert homing(share=0.46).shortage() == ""
    assert (
        homing(share=0.44).shortage()
        == "a needs 30% of a full battery (30 m, 68 s), but the battery is at 44%, and the reserve is 15%"
    )
    assert homing(share=0.44, reserve=0.1).shortage() == ""


def test_figures_are_empty_if_unused_or_without_battery_reading() -> None:
    assert homing().figures() == []
    silent = homing(share=None)
    silent.is_asked = True
    assert silent.figures() == []


def test_point_of_no_return_leaves_reserve_at_home() -> None:
    made = homing(share=0.55)
    made.place = pose(10.0)
    made.is_asked = True
    # Home is 15 m away. Reserve and way home leave 25 % of 55 %: 12.5 m away and back.
    assert [each.text.rpartition(" ")[0] for each in made.figures()[:2]] == [
        "battery for the way home 15",
        "metres to the point of no return 12",
    ]
    assert made.figures()[2].value == pytest.approx(0.25 / 1e-9)
    made.place = pose(50.0)
    assert [each.value for each in made.figures()[1:]] == [0, 0]


def test_search_displays_return_figures_if_used() -> None:
    plan = ZoneManager([{"id": "a", **pose(10.0)}], BASE)
    made = HomingEstimator(plan)
    search = Search(plan, homing=made)
    made.energy.read(0.0, 1.0)
    before = [each.name for each in search.display().figures]
    made.is_asked = True
    assert [each.name for each in search.display().figures[len(before) :]] == [
        "battery for the way home",
        "metres to the point of no return",
        "seconds to the point of no return",
    ]
