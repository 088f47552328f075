"""Tests of charging places besides the base station: parameters, choice of the place, and display."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest
from py_trees.common import Status

from sar_compiler.missions import MissionPhase, ParameterError, ParameterReader
from sar_compiler.missions.parameter_reader import RunParameters
from sar_compiler.runtime.clock import ManualClock
from sar_compiler.sim.occupancy import read_map
from search_and_rescue.actions.return_checks import (
    AwaitCharge,
    NavigateToCharge,
    ReturnInReach,
)
from search_and_rescue.energy import ConsumptionRates, EnergyModel
from search_and_rescue.homing_estimates import HomingEstimator
from search_and_rescue.plugin import MISSION
from search_and_rescue.search import Search
from search_and_rescue.zone_manager import MapPose, ZoneManager

if TYPE_CHECKING:
    from tests.missions.mission_stage import Stage

GIVEN: dict[str, object] = {"zone_order": ["a"], "zones.a.x": 1.0, "zones.a.y": 0.0, "zones.a.yaw": 0.0}


def pose(x: float) -> MapPose:
    return MapPose(x=x, y=0.0, yaw=0.0)


def begin_search(**charging: object) -> Search:
    places = {f"charging.{key.replace('__', '.')}": value for key, value in charging.items()}
    fence = places.pop("charging.geofence", None)
    reader = ParameterReader({**GIVEN, **places, **({"geofence": fence} if fence else {})})
    search = MISSION.begin(reader)
    reader.complain()
    return search


def searching(share: float, here: float, zone: float = 10.0, **docks: float) -> Search:
    """Return a search of one zone: a metre takes 1 %, paths are 1.5 times the straight line, and all positions are on a line."""
    plan = ZoneManager(
        [{"id": "zone_a", **pose(zone)}],
        pose(0.0),
        charging={name: pose(x) for name, x in docks.items()},
    )
    homing = HomingEstimator(plan, EnergyModel(ConsumptionRates(0.01, 1e-9), wrong_by=0.0))
    homing.energy.read(0.0, share)
    homing.place = pose(here)
    return Search(plan, homing=homing)


def home_of(search: Search) -> HomingEstimator:
    found = search.context[HomingEstimator]
    assert isinstance(found, HomingEstimator)
    return found


def charging_stop(*where: Any, **docks: float) -> str:
    return home_of(searching(*where, **docks)).charging_stop()[0]


def test_charging_places_come_from_parameters_and_are_displayed() -> None:
    search = begin_search(dock__x=2.0, dock__y=3.0, dock__yaw=1.0)
    assert search.zones.charging == {"dock": {"x": 2.0, "y": 3.0, "yaw": 1.0}}
    [shown] = [each for each in search.display().landmarks if each.kind == "charging place"]
    assert (shown.name, shown.x, shown.y) == ("dock", 2.0, 3.0)
    assert "charging place" in {kind.name for kind in search.kinds}
    assert search.identity() != begin_search().identity()


def test_mission_without_charging_places_displays_none() -> None:
    search = begin_search()
    assert "charging" not in search.identity()
    assert "charging place" not in {kind.name for kind in search.kinds}


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"dock__x": 2.0}, "charging.dock.y: is missing: add x and y of the charging place, in metres"),
        ({"dock__x": 2.0, "dock__y": "far"}, "charging.dock.y: must be a number"),
        ({"dock__x": 2.0, "dock__y": 1.0, "dock__z": 1.0}, "charging.dock.z: is unknown"),
        (
            {"dock__x": 20.0, "dock__y": 1.0, "geofence": [-9.0, -9.0, 9.0, -9.0, 9.0, 9.0, -9.0, 9.0]},
            "charging.dock.x: is at (20, 1), outside the geofence",
        ),
    ],
)
def test_charging_parameter_error_is_reported_before_run(given: dict[str, Any], said: str) -> None:
    with pytest.raises(ParameterError) as refused:
        begin_search(**given)
    assert said in str(refused.value)


@pytest.mark.ros
def test_route_check_reports_unreachable_charging_place() -> None:
    from sar_compiler.execution.tree_run import RouteReport

    occupancy = read_map(Path("maps/disaster_zone.yaml"))
    good, bad = (
        RouteReport(begin_search(dock__x=x, dock__y=3.0), RunParameters(), occupancy) for x in (-3.0, 99.0)
    )
    assert not any("dock" in problem for problem in good.problems)
    assert [line for line in good.lines if line.startswith("  dock, from the start: ")]
    assert "dock (99.00, 3.00): the position is outside the map." in bad.problems


def test_nearest_charging_place_within_reserve_is_chosen() -> None:
    # At 10 m: home takes 15 %, near 3 %, far 6 %.
    assert charging_stop(0.4, 10.0, near=12.0, far=14.0) == "near"
    assert charging_stop(0.4, 3.0, near=12.0, far=14.0) == ""
    # 2 % above the reserve suffice for no charging place, and the reserve is for the way home.
    assert charging_stop(0.17, 10.0, near=12.0) == ""


def test_charging_place_too_far_from_zone_is_not_chosen() -> None:
    # From far, the 120 m of path to the zone and home need more than a full battery.
    assert charging_stop(0.9, -20.0, 10.0, far=-40.0) == ""


def test_charging_place_extends_reach_beyond_home() -> None:
    # From home and back, 87 m take more than 85 %. From halfway they take less.
    assert home_of(searching(0.9, 0.0, 29.0)).excess()
    assert not home_of(searching(0.9, 0.0, 29.0, dock=15.0)).excess()
    assert home_of(searching(0.2, 0.0, 29.0, dock=15.0)).excess()


def test_required_paths_include_charging_places() -> None:
    zones = searching(0.9, 0.0, dock=15.0).zones
    ways = {(start["x"], end["x"]) for start, end in zones.required_paths(zones.remaining_zones())}
    assert ways == {(0.0, 10.0), (15.0, 10.0), (0.0, 15.0)}


def test_robot_is_at_charging_place_until_it_leaves() -> None:
    search = searching(0.4, 10.0, dock=12.0)
    sentences: list[str] = []
    search.record.journal.add_listener(lambda fact: sentences.append(search.sentence(fact)))
    search.record.home_first("zone_a", "zone_a is far", "dock")
    search.record.charging_reached("dock")
    assert sentences == ["zone_a is far: dock first", "reached charging place dock"]
    assert search.zones.last_pose() == pose(12.0)
    assert [each.text for each in search.display().alarms] == ["zone_a is far: dock first"]
    assert search.display().phase == MissionPhase("waiting", "for another battery", "dock")
    assert [each.state for each in search.display().landmarks if each.name == "dock"] == [
        "the robot is there"
    ]
    search.record.zone_started("zone_a")
    assert search.record.charging_at == ""


@pytest.mark.ros
class TestChargingLeaves:
    def test_insufficient_battery_sends_robot_to_charging_place(self, stage: "Stage") -> None:
        search = searching(0.4, 10.0, 20.0, dock=12.0)
        homing, clock = home_of(search), ManualClock(100.0)
        shared: Any = {"homing": homing, "clock": clock, "record": search.record}
        asks = stage.take(ReturnInReach("InReach?", **shared, max_age_sec=1e12))
        waits = stage.take(AwaitCharge("Await", **shared, patience=60.0))
        asks.tick_once()
        assert asks.status is Status.FAILURE
        [warning] = stage.warnings
        assert warning.endswith(
            "the reserve is 15%: the robot drives to dock first (3 m away; home is 15 m away)."
        )
        drives = stage.take(NavigateToCharge("Drive", search.zones, record=search.record, homing=homing))
        drives.tick_once()
        drives.stop(Status.INVALID)
        assert "dock is 3 m away and takes 3% of the battery, which is at 40%." in stage.lines
        search.record.charging_reached("dock")
        waits.tick_once()
        assert waits.status is Status.RUNNING
        clock.advance(61.0)
        waits.tick_once()
        assert search.record.alarm == "the battery was not charged within 60 s at dock"
