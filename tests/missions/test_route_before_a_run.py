"""Tests of the route of a mission and the route report before a run."""

from pathlib import Path
from typing import Any

import pytest

from sar_compiler.missions.mission import MissionRun
from sar_compiler.missions.parameter_reader import ParameterReader, RunParameters
from search_and_rescue.plugin import MISSION
from search_and_rescue.search import Search

PARAMETERS: dict[str, object] = {
    "zone_order": ["zone_b", "zone_a"],
    **{f"zones.zone_a.{key}": value for key, value in {"x": -3.0, "y": 3.0, "yaw": 0.0}.items()},
    **{f"zones.zone_b.{key}": value for key, value in {"x": 3.5, "y": 3.0, "yaw": 0.0}.items()},
    "base_station.x": 0.5,
}


def begin_mission(**more: object) -> MissionRun:
    reader = ParameterReader(PARAMETERS | more)
    run = MISSION.begin(reader)
    reader.complain()
    return run


def test_route_visits_zones_in_order_and_returns_home() -> None:
    assert begin_mission().route() == [
        ("zone_b", 3.5, 3.0),
        ("zone_a", -3.0, 3.0),
        ("base station", 0.5, 0.0),
    ]


def test_geofence_limits_allowed_positions() -> None:
    fenced = begin_mission(geofence=[0.0, -5.0, 5.0, -5.0, 5.0, 5.0, 0.0, 5.0])
    assert [fenced.allows(3.5, 3.0), fenced.allows(-3.0, 3.0)] == [True, False]
    assert begin_mission().allows(-3.0, 3.0)


def test_default_route_visits_places_of_mission() -> None:
    class Tour(MissionRun):
        def places(self) -> dict[str, tuple[float, float]]:
            return {"gate": (1.0, 2.0), "yard": (3.0, 4.0)}

    assert Tour().route() == [("gate", 1.0, 2.0), ("yard", 3.0, 4.0)]
    assert MissionRun().route() == []


@pytest.mark.ros
class TestRouteReport:
    def report(self, mission: MissionRun, **parameters: Any) -> Any:
        from sar_compiler.execution.tree_run import RouteReport
        from sar_compiler.sim.occupancy import read_map

        occupancy = read_map(Path("maps/disaster_zone.yaml"))
        return RouteReport(mission, RunParameters(**parameters), occupancy)

    def test_stops_beyond_planning_time_are_reported_as_unchecked(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr("sar_compiler.execution.tree_run._MOST_PLANNING_SEC", 0.0)
        report = self.report(begin_mission())
        assert report.lines == []
        [problem] = report.problems
        assert problem.startswith(
            "3 of 3 stops were not checked: route planning has reached its limit of 0 s"
        )

    def test_legs_have_distance_and_time_at_cruise_speed(self) -> None:
        lines = self.report(begin_mission(), cruise_speed_mps=0.5).lines
        assert lines[0] == "The route on the map (estimated; robot radius 0.22 m, 0.5 m/s):"
        legs = [line.split() for line in lines[1:]]
        assert [words[0] for words in legs] == ["zone_b", "zone_a", "base", "total"]
        distances = [float(words[-4]) for words in legs]
        assert sum(distances[:-1]) == pytest.approx(distances[-1], abs=0.2)
        assert float(legs[-1][-2]) == pytest.approx(distances[-1] / 0.5, abs=1.0)

    def test_time_limit_below_driving_time_is_a_problem(self) -> None:
        [problem] = self.report(begin_mission(), time_limit_sec=10.0).problems
        assert problem.startswith("Driving takes ")
        assert problem.endswith(" s (estimated), but time_limit_sec is 10.")

    def test_start_outside_geofence_is_a_problem(self) -> None:
        fence = [1.0, 1.0, 5.0, 1.0, 5.0, 5.0, 1.0, 5.0]
        problems = self.report(begin_mission(geofence=fence)).problems
        assert problems[0] == "The start (0.00, 0.00) is outside the geofence."
        assert "zone_a (-3.00, 3.00): the position is outside the geofence." in problems

    def test_too_wide_robot_is_a_problem(self) -> None:
        assert self.report(begin_mission()).problems == []
        assert self.report(begin_mission(), robot_radius_m=1.5).problems != []

    def test_reachable_area_and_sweep_length_are_reported(self) -> None:
        square = [2.5, 2.0, 4.5, 2.0, 4.5, 4.0, 2.5, 4.0]
        ground = {"zones.zone_b.polygon": square, "zones.zone_b.sweep_width": 2.0}
        report = self.report(begin_mission(**ground), cruise_speed_mps=0.5)
        assert report.problems == []
        [line] = [line for line in report.lines if " m²" in line]
        name, reached, _, area, _, metres, _, seconds, _ = line.split()
        assert (name, area) == ("zone_b", "4.0")
        assert 3.0 < float(reached) <= 4.0
        assert float(metres) == pytest.approx(float(reached) / 2.0, abs=0.1)
        assert float(seconds) == pytest.approx(float(metres) / 0.5, abs=1.0)

    def test_unreachable_area_is_a_problem(self) -> None:
        away = [50.0, 2.0, 52.0, 2.0, 52.0, 4.0]
        ground = {"zones.zone_b.polygon": away, "zones.zone_b.sweep_width": 2.0}
        assert self.report(begin_mission(**ground)).problems == ["zone_b: no part of its area is reachable."]

    def test_area_outside_map_is_reported(self) -> None:
        wide = [2.5, 2.0, 52.5, 2.0, 52.5, 4.0, 2.5, 4.0]
        ground = {"zones.zone_b.polygon": wide, "zones.zone_b.sweep_width": 2.0}
        report = self.report(begin_mission(**ground))
        [line] = [line for line in report.lines if " m²" in line]
        assert line.endswith(" m² are outside the map")
        assert report.problems == []

    def test_mission_without_stops_has_empty_report(self) -> None:
        report = self.report(MissionRun())
        assert (report.lines, report.problems) == ([], [])


@pytest.mark.ros
class TestPublishedMap:
    def grid(self, data: list[int], **changes: float) -> Any:
        from nav_msgs.msg import OccupancyGrid

        grid = OccupancyGrid()
        grid.info.resolution, grid.info.width, grid.info.height = 0.5, 3, 1
        grid.info.origin.position.x = 2.0
        grid.info.origin.orientation.z = changes.get("turn", 0.0)
        grid.info.resolution = changes.get("resolution", 0.5)
        grid.data = data
        return grid

    def test_map_cells_have_the_meaning_of_nav2(self) -> None:
        from sar_compiler.sim.messages import from_grid
        from sar_compiler.sim.occupancy import FREE, OCCUPIED, UNKNOWN

        occupancy = from_grid(self.grid([0, 100, -1]))
        assert occupancy is not None
        assert occupancy.cells.tolist() == [[FREE, OCCUPIED, UNKNOWN]]
        assert (occupancy.resolution, occupancy.origin_x) == (0.5, 2.0)

    @pytest.mark.parametrize(
        ("data", "changes"),
        [
            ([], {}),
            ([0, 0], {}),
            ([0, 0, 0], {"turn": 0.7}),
            ([0, 0, 0], {"resolution": 0.0}),
            ([0, 0, 0], {"resolution": float("nan")}),
        ],
    )
    def test_invalid_map_is_rejected(self, data: list[int], changes: dict[str, float]) -> None:
        from sar_compiler.sim.messages import from_grid

        assert from_grid(self.grid(data, **changes)) is None


def test_look_time_defaults_to_sweep_time_of_area() -> None:
    square = [2.5, 2.0, 4.5, 2.0, 4.5, 4.0, 2.5, 4.0]
    likely = {f"zones.{zone}.{key}": 0.5 for zone in ("zone_a", "zone_b") for key in ("poa", "pod")}
    ground = {"zones.zone_b.polygon": square, "zones.zone_b.sweep_width": 2.0}
    search = begin_mission(**likely, **ground, cruise_speed_mps=0.5)
    assert isinstance(search, Search)
    assert search.zones.areas["zone_a"].look_sec == 0.0
    assert search.zones.areas["zone_b"].look_sec == pytest.approx(4.0 * 0.9 / 2.0 / 0.5)
    said = begin_mission(**likely, **ground, **{"zones.zone_b.look_sec": 20.0})
    assert isinstance(said, Search)
    assert said.zones.areas["zone_b"].look_sec == 20.0
