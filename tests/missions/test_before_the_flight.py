"""What the mission says of its way before the flight, and what is made of it."""

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


def begun(**more: object) -> MissionRun:
    reader = ParameterReader(PARAMETERS | more)
    run = MISSION.begin(reader)
    reader.complain()
    return run


def test_the_way_leads_through_the_zones_in_their_order_and_home() -> None:
    assert begun().route() == [("zone_b", 3.5, 3.0), ("zone_a", -3.0, 3.0), ("base station", 0.5, 0.0)]


def test_the_fence_says_where_the_robot_may_be() -> None:
    fenced = begun(geofence=[0.0, -5.0, 5.0, -5.0, 5.0, 5.0, 0.0, 5.0])
    assert [fenced.allows(3.5, 3.0), fenced.allows(-3.0, 3.0)] == [True, False]
    assert begun().allows(-3.0, 3.0)


def test_a_mission_that_names_places_drives_to_them() -> None:
    class Tour(MissionRun):
        def places(self) -> dict[str, tuple[float, float]]:
            return {"gate": (1.0, 2.0), "yard": (3.0, 4.0)}

    assert Tour().route() == [("gate", 1.0, 2.0), ("yard", 3.0, 4.0)]
    assert MissionRun().route() == []


@pytest.mark.ros
class TestTheReport:
    def report(self, mission: MissionRun, **parameters: Any) -> Any:
        from sar_compiler.execution.tree_run import RouteReport
        from sar_compiler.sim.occupancy import read_map

        occupancy = read_map(Path("maps/disaster_zone.yaml"))
        return RouteReport(mission, RunParameters(**parameters), occupancy)

    def test_places_for_which_no_time_is_left_are_counted(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr("sar_compiler.execution.tree_run._MOST_PLANNING_SEC", 0.0)
        report = self.report(begun())
        assert report.lines == []
        [problem] = report.problems
        assert problem.startswith(
            "3 of 3 stops were not checked: route planning has reached its limit of 0 s"
        )

    def test_each_leg_has_its_distance_and_its_time_at_the_cruise_speed(self) -> None:
        lines = self.report(begun(), cruise_speed_mps=0.5).lines
        assert lines[0] == "The route on the map (estimated; robot radius 0.22 m, 0.5 m/s):"
        legs = [line.split() for line in lines[1:]]
        assert [words[0] for words in legs] == ["zone_b", "zone_a", "base", "total"]
        distances = [float(words[-4]) for words in legs]
        assert sum(distances[:-1]) == pytest.approx(distances[-1], abs=0.2)
        assert float(legs[-1][-2]) == pytest.approx(distances[-1] / 0.5, abs=1.0)

    def test_a_time_limit_too_short_for_the_driving_alone_is_a_problem(self) -> None:
        [problem] = self.report(begun(), time_limit_sec=10.0).problems
        assert problem.startswith("Driving takes ")
        assert problem.endswith(" s (estimated), but time_limit_sec is 10.")

    def test_a_start_outside_the_fence_is_a_problem(self) -> None:
        fence = [1.0, 1.0, 5.0, 1.0, 5.0, 5.0, 1.0, 5.0]
        problems = self.report(begun(geofence=fence)).problems
        assert problems[0] == "The start (0.00, 0.00) is outside the geofence."
        assert "zone_a (-3.00, 3.00): the position is outside the geofence." in problems

    def test_a_wider_robot_does_not_fit_where_a_narrow_one_does(self) -> None:
        assert self.report(begun()).problems == []
        assert self.report(begun(), robot_radius_m=1.5).problems != []

    def test_of_each_area_it_is_told_how_much_can_be_driven_to_and_how_long_a_sweep_is(self) -> None:
        square = [2.5, 2.0, 4.5, 2.0, 4.5, 4.0, 2.5, 4.0]
        ground = {"zones.zone_b.polygon": square, "zones.zone_b.sweep_width": 2.0}
        report = self.report(begun(**ground), cruise_speed_mps=0.5)
        assert report.problems == []
        [line] = [line for line in report.lines if " m²" in line]
        name, reached, _, area, _, metres, _, seconds, _ = line.split()
        assert (name, area) == ("zone_b", "4.0")
        assert 3.0 < float(reached) <= 4.0
        assert float(metres) == pytest.approx(float(reached) / 2.0, abs=0.1)
        assert float(seconds) == pytest.approx(float(metres) / 0.5, abs=1.0)

    def test_an_area_of_which_nothing_can_be_driven_to_is_a_problem(self) -> None:
        away = [50.0, 2.0, 52.0, 2.0, 52.0, 4.0]
        ground = {"zones.zone_b.polygon": away, "zones.zone_b.sweep_width": 2.0}
        assert self.report(begun(**ground)).problems == ["zone_b: no part of its area is reachable."]

    def test_what_of_an_area_lies_beyond_the_map_is_told(self) -> None:
        wide = [2.5, 2.0, 52.5, 2.0, 52.5, 4.0, 2.5, 4.0]
        ground = {"zones.zone_b.polygon": wide, "zones.zone_b.sweep_width": 2.0}
        report = self.report(begun(**ground))
        [line] = [line for line in report.lines if " m²" in line]
        assert line.endswith(" m² are outside the map")
        assert report.problems == []

    def test_a_mission_that_drives_nowhere_has_nothing_to_tell(self) -> None:
        report = self.report(MissionRun())
        assert (report.lines, report.problems) == ([], [])


@pytest.mark.ros
class TestTheMap:
    def grid(self, data: list[int], **changes: float) -> Any:
        from nav_msgs.msg import OccupancyGrid

        grid = OccupancyGrid()
        grid.info.resolution, grid.info.width, grid.info.height = 0.5, 3, 1
        grid.info.origin.position.x = 2.0
        grid.info.origin.orientation.z = changes.get("turn", 0.0)
        grid.info.resolution = changes.get("resolution", 0.5)
        grid.data = data
        return grid

    def test_a_published_map_is_read_as_nav2_means_it(self) -> None:
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
    def test_a_map_that_is_none_is_not_read(self, data: list[int], changes: dict[str, float]) -> None:
        from sar_compiler.sim.messages import from_grid

        assert from_grid(self.grid(data, **changes)) is None


def test_where_nothing_is_said_of_it_a_look_takes_as_long_as_the_legs_of_a_sweep() -> None:
    square = [2.5, 2.0, 4.5, 2.0, 4.5, 4.0, 2.5, 4.0]
    likely = {f"zones.{zone}.{key}": 0.5 for zone in ("zone_a", "zone_b") for key in ("poa", "pod")}
    ground = {"zones.zone_b.polygon": square, "zones.zone_b.sweep_width": 2.0}
    search = begun(**likely, **ground, cruise_speed_mps=0.5)
    assert isinstance(search, Search)
    assert search.zones.areas["zone_a"].look_sec == 0.0
    assert search.zones.areas["zone_b"].look_sec == pytest.approx(4.0 * 0.9 / 2.0 / 0.5)
    said = begun(**likely, **ground, **{"zones.zone_b.look_sec": 20.0})
    assert isinstance(said, Search)
    assert said.zones.areas["zone_b"].look_sec == 20.0
