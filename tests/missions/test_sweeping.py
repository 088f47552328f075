"""Tests of sweeping a zone: planning, driving to pieces, coverage, repeated passes and resuming."""

import math
from pathlib import Path
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import pytest
from py_trees.common import Status

from sar_compiler.errors import SarError
from sar_compiler.journal.journal_opening import open_journal
from sar_compiler.missions import Level
from sar_compiler.runtime.clock import ManualClock
from search_and_rescue.actions import sweep_leaves
from search_and_rescue.actions.survivors import DetectSurvivor, map_extent_of
from search_and_rescue.homing_estimates import HomingEstimator
from search_and_rescue.search import Search
from search_and_rescue.search_theory import Ground, SearchExpectation
from search_and_rescue.sweep_record import SweepStates
from search_and_rescue.zone_manager import MapPose, ZoneManager

if TYPE_CHECKING:
    from tests.missions.mission_stage import Stage

BASE = {"x": 0.0, "y": 0.0, "yaw": 0.0}
GROUND = Ground(((0.0, 0.0), (4.0, 0.0), (4.0, 4.0), (0.0, 4.0)), 2.0, 1.25)
SEEN = {"area_m2": 16.0, "coverage": 0.0, "pod": 0.0, "seen": 0.0}
PIECES = [(1.0, 1.0), (3.0, 1.0), (3.0, 3.0), (1.0, 3.0)]


def searching(**areas: SearchExpectation) -> Search:
    """Return a search of zone `a` with ground and zone `b` without."""
    plan = [{"id": name, "x": 2.0 * x, "y": 0.0, "yaw": 0.0} for x, name in enumerate("ab")]
    return Search(ZoneManager(plan, BASE, areas=areas), sweeps=SweepStates({"a": GROUND}))


def planned(search: Search, count: int = 4) -> Search:
    search.sweeps.plan("a", "parallel", 2.0, [MapPose(x=x, y=y, yaw=0.0) for x, y in PIECES[:count]])
    return search


def places(search: Search) -> list[tuple[float, float]]:
    return [(pose["x"], pose["y"]) for pose in search.sweeps.state_of("a").pieces]


def tick(leaf: Any) -> Status:
    """Tick a leaf once, and return its status."""
    leaf.tick_once()
    answered: Status = leaf.status
    return answered


def test_search_during_sweep_counts_by_coverage_not_by_zone_pose() -> None:
    search = planned(searching(a=SearchExpectation(0.5, 0.9), b=SearchExpectation(0.3, 0.5)))
    for _ in range(3):
        search.record.zone_searched("a", None)
    assert search.zones.poa_map().pos() == 0.0
    search.sweeps.drive("a", [(0.0, 2.0), (4.0, 2.0)], None)
    search.sweeps.finish_piece("a", None, 0.5)
    pod = search.sweeps.state_of("a").pod
    assert 0.2 < pod < 0.5
    assert search.zones.poa_map().pos() == pytest.approx(0.5 * pod)
    assert search.zones.poa_map().current_probabilities()["a"] == pytest.approx(
        0.5 * (1 - pod) / (1 - 0.5 * pod)
    )


def test_finished_piece_includes_drive_since_previous_one() -> None:
    search = planned(searching())
    search.sweeps.drive("a", [(0.0, 2.0), (4.0, 2.0)], None)
    search.sweeps.finish_piece("a", None, 0.5)
    first = search.sweeps.state_of("a")
    search.sweeps.finish_piece("a", None, 0.5)
    second = search.sweeps.state_of("a")
    assert (first.metres, second.metres) == (4.0, 4.0)
    assert (first.done, second.done) == (1, 2)
    assert first.area_m2 == 16.0
    # On two of the four metres, half of the range is outside the ground.
    assert 0.3 < first.coverage < 2.0 * 4.0 / 16.0
    assert second.cells == first.cells


def test_drive_in_one_zone_counts_in_no_other() -> None:
    zones = [{"id": name, "x": 0.0, "y": 0.0, "yaw": 0.0} for name in "ab"]
    search = Search(ZoneManager(zones, BASE), sweeps=SweepStates({"a": GROUND, "b": GROUND}))
    for zone in "ab":
        search.sweeps.plan(zone, "parallel", 2.0, [MapPose(x=1.0, y=1.0, yaw=0.0)])
    search.sweeps.drive("a", [(0.0, 2.0), (3.0, 2.0)], None)
    for zone in "ba":
        search.sweeps.finish_piece(zone, None, 0.5)
    assert [search.sweeps.state_of(zone).metres for zone in "ab"] == [3.0, 0.0]


def test_gaps_are_computed_only_at_end_of_pass() -> None:
    search = planned(searching(), count=2)
    search.sweeps.finish_piece("a", None, 0.5)
    assert search.sweeps.state_of("a").gaps == ()
    search.sweeps.finish_piece("a", None, 0.5)
    [gap] = search.sweeps.state_of("a").gaps
    assert sorted(gap) == sorted(GROUND.polygon)


def test_display_shows_area_figures_and_gaps() -> None:
    search = planned(searching(a=SearchExpectation(0.5, 0.9), b=SearchExpectation(0.3, 0.5)), count=1)
    search.sweeps.drive("a", [(0.0, 2.0), (4.0, 2.0)], None)
    search.sweeps.finish_piece("a", None, 0.9)
    area, *gaps = [each for each in search.display().landmarks if each.corners]
    assert (area.kind, area.name, area.state) == ("area", "a", "1 of 1 pieces")
    assert area.corners == GROUND.polygon
    assert {key: area.details[key] for key in ("sweep width W", "track length L", "area A", "POA before", "passes", "gaps")} == {
        "sweep width W": "2 m",
        "track length L": "4.0 m",
        "area A": "16.0 m²",
        "POA before": "50.0%",
        "passes": 1,
        "gaps": 1,
    }  # fmt: skip
    assert [(gap.kind, gap.name, gap.level) for gap in gaps] == [("gap", "a gap 1", Level.GIVEN_UP)]


def test_pod_with_exact_legs_is_displayed_only_after_complete_first_pass() -> None:
    search = planned(searching(), count=2)

    def reported() -> object:
        [area] = [each for each in search.display().landmarks if each.kind == "area"]
        return area.details["POD with exact legs"]

    search.sweeps.drive("a", [(0.0, 1.0), (4.0, 1.0)] * 2, None)
    search.sweeps.finish_piece("a", None, 0.5)
    assert reported() == ""
    search.sweeps.finish_piece("a", None, 0.5)
    covered = search.sweeps.state_of("a").coverage
    assert reported() == f"{math.erf(math.sqrt(math.pi) / 2 * covered):.1%}"
    search.sweeps.plan("a", "gaps", 2.0, [MapPose(x=1.0, y=3.0, yaw=0.0)])
    search.sweeps.finish_piece("a", None, 0.5)
    assert reported() == ""


def test_skipped_piece_removes_pod_with_exact_legs() -> None:
    search = planned(searching(), count=1)
    search.sweeps.skip("a", "not reached, or not searched")
    assert search.sweeps.state_of("a").pod_of_legs is None


def test_figures_state_swept_distance_and_seen_area() -> None:
    search = planned(searching())
    assert [each.text for each in search.display().figures[-2:]] == ["swept 0 m", "seen 0 of 16 m²"]
    search.sweeps.drive("a", [(0.0, 1.0), (4.0, 1.0)], None)
    search.sweeps.finish_piece("a", None, 0.5)
    assert [each.text for each in search.display().figures[-2:]] == ["swept 4 m", "seen 9 of 16 m²"]


def test_raster_is_displayed_after_first_finished_piece() -> None:
    search = planned(searching())
    search.sweeps.drive("a", [(0.0, 1.0), (4.0, 1.0)], None)
    assert search.display().rasters == []
    search.sweeps.finish_piece("a", None, 0.5)
    [layer] = search.display().rasters
    assert (layer.name, layer.meaning, layer.columns) == ("a", "searched, POD", 16)
    assert (layer.x, layer.y, layer.cell_m) == (0.0, 0.0, 0.25)
    # The upper rows are farther from y = 1 than the detection range.
    assert layer.cells.endswith("16-" * 6)
    assert set("abcdefghij") & set(layer.cells.removesuffix("16-" * 6))


def test_area_is_shaded_by_current_probability() -> None:
    search = searching(a=SearchExpectation(0.5, 0.9), b=SearchExpectation(0.3, 0.5))
    search.record.zone_searched("b", None)
    [area] = [each for each in search.display().landmarks if each.kind == "area"]
    assert area.shade == pytest.approx(0.5 / (1 - 0.3 * 0.5), abs=0.0001)
    [unknown] = [each for each in searching().display().landmarks if each.kind == "area"]
    assert unknown.shade is None


def test_unswept_area_displays_neither_size_nor_pieces() -> None:
    [area] = [each for each in searching().display().landmarks if each.corners]
    assert (area.state, area.details["area A"], area.details["POD"]) == ("", "", "0.0%")


def test_sweep_events_have_sentences() -> None:
    search = searching()
    reported: list[str] = []
    search.sweeps.journal.add_listener(lambda entry: reported.append(search.sentence(entry)))
    planned(search)
    search.sweeps.finish_piece("a", None, 0.5)
    search.sweeps.skip("a", "not reached, or not searched")
    assert [line for line in reported if line] == [
        "planned to sweep a in 4 pieces (parallel, 2 m apart)",
        "swept piece 1 of a: 0% seen, POD 0%",
        "skipped piece 2 of a: not reached, or not searched",
    ]
    assert search.sweeps.state_of("a").skipped == 1


def open_and_begin(place: Path, search: Search, *, resume: bool) -> Any:
    kept = open_journal(place, resume=resume)
    search.use_journal(kept)
    kept.begin({}, {})
    return kept


def test_resumed_sweep_has_same_open_pieces_and_coverage(tmp_path: Path) -> None:
    first, second = searching(), searching()
    kept = open_and_begin(tmp_path / "sweep.journal", first, resume=False)
    planned(first)
    first.sweeps.drive("a", [(0.0, 2.0), (4.0, 2.0)], None)
    first.sweeps.finish_piece("a", None, 0.5)
    first.sweeps.skip("a", "not reached, or not searched")
    kept.close()
    open_and_begin(tmp_path / "sweep.journal", second, resume=True).close()
    assert second.sweeps.state_of("a") == first.sweeps.state_of("a")
    assert second.sweeps.state_of("a").open_count == 2
    assert second.sweeps.raster("a", None).pod() == pytest.approx(first.sweeps.state_of("a").pod, abs=0.001)
    assert second.display().rasters == first.display().rasters
    assert second.zones.poa_map() == first.zones.poa_map()


@pytest.mark.parametrize(
    ("kind", "data"),
    [
        ("piece_skipped", {"zone": "a", "piece": 1, "reason": ""}),
        ("piece_skipped", {"zone": "b", "piece": 0, "reason": ""}),
        ("sweep_planned", {"zone": "b", "pattern": "parallel", "spacing": 1.0, "pieces": [[0, 0, 0]]}),
        ("sweep_planned", {"zone": "a", "pattern": "parallel", "spacing": 1.0, "pieces": [[0, 0]]}),
        ("sweep_planned", {"zone": "a", "pattern": "parallel", "spacing": math.nan, "pieces": [[0, 0, 0]]}),
        ("sweep_planned", {"zone": "a", "pattern": "parallel", "spacing": 1.0, "pieces": [[math.inf, 0, 0]]}),
        ("piece_swept", {"zone": "a", "piece": 0, "metres": 1.0, "cells": "", "gaps": [], "pod": "much"}),
        ("piece_swept", {"zone": "a", "piece": 0, "metres": 1.0, "cells": "x", "gaps": [], **SEEN}),
    ],
)
def test_invalid_sweep_event_is_rejected(kind: str, data: dict[str, Any]) -> None:
    search = planned(searching())
    before = search.sweeps.state_of("a")
    with pytest.raises((ArithmeticError, LookupError, TypeError, ValueError, SarError)):
        search.sweeps.journal.record_event(kind, **data)
    assert search.sweeps.state_of("a") == before


class TestIsFindNew:
    def tick_leaf(self, search: Search, place: tuple[float, float] | None) -> Status:
        detect = DetectSurvivor("DetectSurvivor", search.zones, record=search.record)
        detect.survivor_pose = lambda: place  # type: ignore[method-assign]
        leaf = sweep_leaves.IsFindNew("IsFindNew", detect, search.record, same_within=1.0)
        leaf.tick_once()
        return leaf.status

    def test_missing_detection_is_not_new(self) -> None:
        assert self.tick_leaf(searching(), None) is Status.FAILURE

    def test_unnamed_detection_is_new(self) -> None:
        search = searching()
        search.record.zone_searched("a", (1.0, 1.0))
        assert self.tick_leaf(search, (1.0, 1.0)) is Status.SUCCESS

    def test_detection_near_named_survivor_is_not_new(self) -> None:
        search = searching()
        search.record.survivor_named("survivor_1", 1.0, 1.0)
        assert self.tick_leaf(search, (1.0, 2.0)) is Status.FAILURE
        assert self.tick_leaf(search, (1.0, 2.01)) is Status.SUCCESS

    def test_detection_near_rejected_survivor_is_new(self) -> None:
        from search_and_rescue.record import DetectionVerdict

        search = searching()
        search.record.survivor_named("survivor_1", 1.0, 1.0)
        search.record.survivor_judged("survivor_1", DetectionVerdict.REJECTED)
        assert self.tick_leaf(search, (1.0, 1.0)) is Status.SUCCESS

    def test_survivor_named_by_earlier_run_at_open_piece_is_handled_again(self, tmp_path: Path) -> None:
        first, second = searching(), searching()
        kept = open_and_begin(tmp_path / "sweep.journal", first, resume=False)
        planned(first)
        first.record.zone_searched("a", (1.0, 1.0))
        first.record.survivor_named("survivor_1", 1.0, 1.0)
        kept.close()
        open_and_begin(tmp_path / "sweep.journal", second, resume=True).close()
        assert self.tick_leaf(second, (1.0, 1.0)) is Status.SUCCESS


@pytest.mark.ros
class TestSweepLeaves:
    def take(self, stage: "Stage", search: Search, name: str, **ports: Any) -> Any:
        return stage.take(getattr(sweep_leaves, name)(name, search.zones, sweeps=search.sweeps, **ports))

    def publish_walled_map(self, stage: "Stage", left: float, cells: int = 2500) -> Any:
        """Publish a map of 5 x 5 m that is blocked for x of `left` or more."""
        from nav_msgs.msg import OccupancyGrid
        from rclpy.qos import DurabilityPolicy, QoSProfile

        grid = OccupancyGrid()
        grid.info.resolution, grid.info.width, grid.info.height = 0.1, 50, 50
        grid.data = [100 if (at % 50) * 0.1 >= left else 0 for at in range(cells)]
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        publisher = stage.host().node.create_publisher(OccupancyGrid, "map", latched)
        publisher.publish(grid)
        extent = map_extent_of(stage.node)
        stage.until(lambda: extent.why_impossible(6.0, 6.0) != "", "the map")
        return publisher

    def test_sweep_is_planned_between_ticks(self, stage: "Stage") -> None:
        search = searching()
        leaf = self.take(stage, search, "PlanSweep", coverage=1.0)
        assert tick(leaf) is Status.RUNNING
        stage.until(lambda: stage.wakes == 1, "the tick that is requested")
        assert tick(leaf) is Status.SUCCESS
        assert places(search) == PIECES
        assert stage.lines == [
            "a is swept in 4 pieces (parallel, 2.00 m apart). The POD is at least 63%, and 79% if the robot follows the legs exactly."
        ]
        assert stage.warnings == [
            "No map has been received: the sweep of a is planned as if there were no obstacles."
        ]

    def test_planned_sweep_continues_with_open_pieces(self, stage: "Stage") -> None:
        search = planned(searching())
        search.sweeps.skip("a", "not reached, or not searched")
        leaf = self.take(stage, search, "PlanSweep", pattern="sector")
        leaf.tick_once()
        assert leaf.status is Status.SUCCESS
        assert (search.sweeps.state_of("a").passes, search.sweeps.state_of("a").open_count) == (1, 3)

    def test_finished_sweep_is_not_planned_again(self, stage: "Stage") -> None:
        search = planned(searching(), count=1)
        search.sweeps.skip("a", "not reached, or not searched")
        assert stage.run(self.take(stage, search, "PlanSweep")) is Status.SUCCESS
        assert (search.sweeps.state_of("a").passes, search.sweeps.state_of("a").open_count) == (1, 0)

    def test_zone_without_polygon_cannot_be_swept(self, stage: "Stage") -> None:
        search = searching()
        search.zones.select_next_zone()
        assert stage.run(self.take(stage, search, "ZoneHasGround")) is Status.FAILURE
        assert stage.run(self.take(stage, search, "PlanSweep")) is Status.FAILURE
        assert stage.warnings == ["b cannot be swept: it has no polygon."]

    @pytest.mark.parametrize("coverage", [0.0, -1.0, math.nan])
    def test_coverage_that_is_not_positive_is_rejected(self, stage: "Stage", coverage: float) -> None:
        assert stage.run(self.take(stage, searching(), "PlanSweep", coverage=coverage)) is Status.FAILURE
        assert "write a coverage above 0, for example 0.9" in stage.warnings[0]

    def test_planning_and_refining_fail_without_zone(self, stage: "Stage") -> None:
        search = searching()
        search.zones.select_next_zone()
        search.zones.select_next_zone()
        assert stage.run(self.take(stage, search, "PlanSweep")) is Status.FAILURE
        assert stage.run(self.take(stage, search, "RefineSweep")) is Status.FAILURE

    def test_blocked_positions_are_left_out_of_plan(self, stage: "Stage") -> None:
        search = searching()
        leaf = self.take(stage, search, "PlanSweep", coverage=1.0, clearance=0.3)
        publisher = self.publish_walled_map(stage, 2.0)
        assert stage.run(leaf) is Status.SUCCESS
        assert all(x <= 1.75 for x, _ in places(search))
        assert publisher.topic_name.endswith("map")

    def test_incomplete_map_is_ignored(self, stage: "Stage") -> None:
        search = searching()
        leaf = self.take(stage, search, "PlanSweep", coverage=1.0)
        publisher = self.publish_walled_map(stage, 2.0, cells=1000)
        assert stage.run(leaf) is Status.SUCCESS
        assert places(search) == PIECES
        assert stage.warnings == [
            "No map has been received: the sweep of a is planned as if there were no obstacles."
        ]
        assert publisher.topic_name.endswith("map")

    def test_completely_blocked_ground_cannot_be_swept(self, stage: "Stage") -> None:
        search = searching()
        leaf = self.take(stage, search, "PlanSweep")
        publisher = self.publish_walled_map(stage, 0.0)
        assert stage.run(leaf) is Status.FAILURE
        assert "a cannot be swept: every stop is blocked" in stage.warnings[0]
        assert publisher.topic_name.endswith("map")

    def test_completely_blocked_gaps_are_not_swept(self, stage: "Stage") -> None:
        search = planned(searching(), count=1)
        search.sweeps.skip("a", "not reached, or not searched")
        leaf = self.take(stage, search, "RefineSweep")
        publisher = self.publish_walled_map(stage, 0.0)
        assert stage.run(leaf) is Status.FAILURE
        assert leaf.feedback_message == "a: the gaps are too scattered to be swept, or not on the map"
        assert (stage.warnings, publisher.topic_name[-3:]) == ([], "map")

    def start_drive_to_piece(self, stage: "Stage", search: Search) -> tuple[Any, ManualClock]:
        """Return a leaf that drives to the first piece with the robot at (0, 1), and its clock."""
        server = stage.nav_server()
        leaf = self.take(stage, search, "NavigateToPiece", record=search.record)
        leaf._clock = clock = ManualClock()
        leaf._robot.last_pose = lambda: (0.0, 1.0, 0.0)
        stage.tick_until(leaf, lambda: server.goals, "the goal")
        return leaf, clock

    @pytest.mark.parametrize(("seconds", "metres"), [(1.0, 0.0), (5.0, 3.0)])
    def test_distant_position_counts_as_driven_only_if_time_sufficed(
        self, seconds: float, metres: float, stage: "Stage"
    ) -> None:
        search = planned(searching())
        leaf, clock = self.start_drive_to_piece(stage, search)
        clock.advance(seconds)
        leaf._robot.last_pose = lambda: (3.0, 1.0, 0.0)
        leaf.tick_once()
        assert self.take(stage, search, "AdvancePiece").tick_once() is None
        assert search.sweeps.state_of("a").metres == pytest.approx(metres)

    def test_drive_during_unknown_position_is_not_counted(self, stage: "Stage") -> None:
        search = planned(searching())
        leaf, clock = self.start_drive_to_piece(stage, search)
        for place in (None, (3.0, 1.0, 0.0)):
            clock.advance(5.0 if place is None else 0.1)
            leaf._robot.last_pose = lambda place=place: place
            leaf.tick_once()
        assert self.take(stage, search, "AdvancePiece").tick_once() is None
        assert search.sweeps.state_of("a").metres == 0.0

    def make_drive_through(self, stage: "Stage", search: Search) -> Any:
        ports = {"record": search.record, "homing": search.context[HomingEstimator], "clock": ManualClock()}
        return self.take(stage, search, "NavigateThroughPieces", until_pod=0.5, **ports)

    def test_open_pieces_are_sent_as_one_goal(self, stage: "Stage") -> None:
        server = stage.through_server()
        search = planned(searching())
        search.sweeps.skip("a", "not reached, or not searched")
        leaf = self.make_drive_through(stage, search)
        stage.until(leaf._port.statuses.servers, "the server")
        leaf.tick_once()
        stage.tick_until(leaf, lambda: server.goals, "the goal")
        poses = [(each.pose.position.x, each.pose.position.y) for each in server.goals[0].goal.poses]
        assert poses == PIECES[1:]
        assert {each.header.frame_id for each in server.goals[0].goal.poses} == {"map"}
        assert (leaf.status, leaf.outcome_label) == (Status.RUNNING, "driving")
        assert "Navigating to pieces 2 to 4 of a..." in stage.lines
        assert search.record.zone == "a"

    def test_passed_pieces_are_finished_with_coverage_until_then(self, stage: "Stage") -> None:
        server = stage.through_server()
        search = planned(searching())
        leaf = self.make_drive_through(stage, search)
        robot = [(0.0, 1.0, 0.0)]
        leaf._robot.last_pose = lambda: robot[0]
        stage.until(leaf._port.statuses.servers, "the server")
        stage.tick_until(leaf, lambda: server.goals, "the goal")
        # A server that has not started reports 0 remaining poses, which does not mean the end.
        server.order("0 left", "3 left")
        stage.tick_until(leaf, lambda: search.sweeps.state_of("a").done, "a piece that was passed")
        assert search.sweeps.state_of("a").done == 1
        robot[0] = (1.0, 1.0, 0.0)
        leaf.tick_once()
        server.order("1 left")
        stage.tick_until(leaf, lambda: search.sweeps.state_of("a").done > 1, "two more")
        assert search.sweeps.state_of("a").done == 3
        assert search.sweeps.state_of("a").metres == pytest.approx(1.0)
        robot[0] = (2.0, 1.0, 0.0)
        server.order("succeed")
        assert stage.run(leaf) is Status.SUCCESS
        sweep = search.sweeps.state_of("a")
        assert (leaf.outcome_label, sweep.open_count) == ("all done", 0)
        assert sweep.metres == pytest.approx(2.0)
        assert search.record.is_searched
        assert stage.lines[-2] == f"a: {sweep.seen:.0%} seen, POD {sweep.pod:.0%}, {len(sweep.gaps)} gaps."

    @pytest.mark.parametrize(("share", "ending"), [(0.9, "driving"), (0.1, "piece by piece")])
    def test_drive_through_ends_before_piece_beyond_reserve(
        self, share: float, ending: str, stage: "Stage"
    ) -> None:
        server = stage.through_server()
        search = planned(searching())
        leaf = self.make_drive_through(stage, search)
        leaf._robot.last_pose = lambda: (1.0, 1.0, 0.0)
        homing = search.context[HomingEstimator]
        homing.is_asked = True
        homing.energy.read(0.0, share)
        stage.until(leaf._port.statuses.servers, "the server")
        stage.tick_until(leaf, lambda: server.goals, "the goal")
        assert leaf.status is Status.RUNNING
        server.order("3 left")
        stage.tick_until(leaf, lambda: search.sweeps.state_of("a").done, "a piece that was passed")
        assert leaf.outcome_label == ending
        assert search.sweeps.state_of("a").open_count == 3

    def test_absent_server_makes_robot_drive_piece_by_piece(self, stage: "Stage") -> None:
        stage.nav_server()
        search = planned(searching())
        leaf = self.make_drive_through(stage, search)
        leaf.tick_once()
        assert (leaf.status, leaf.outcome_label) == (Status.FAILURE, "piece by piece")
        assert (search.sweeps.state_of("a").open_count, search.record.navigation_lost) == (4, "")

    def test_earlier_search_at_open_piece_is_not_driven_past(self, stage: "Stage", tmp_path: Path) -> None:
        server = stage.through_server()
        first, second = searching(), searching()
        kept = open_and_begin(tmp_path / "sweep.journal", first, resume=False)
        planned(first)
        first.record.zone_searched("a", None)
        kept.close()
        open_and_begin(tmp_path / "sweep.journal", second, resume=True).close()
        leaf = self.make_drive_through(stage, second)
        stage.until(leaf._port.statuses.servers, "the server")
        leaf.tick_once()
        assert (leaf.status, leaf.outcome_label) == (Status.FAILURE, "piece by piece")
        assert server.requests == 0

    def test_aborted_drive_through_leaves_remaining_pieces_open(self, stage: "Stage") -> None:
        server = stage.through_server()
        server.error_code = 308
        search = planned(searching())
        leaf = self.make_drive_through(stage, search)
        stage.until(leaf._port.statuses.servers, "the server")
        stage.tick_until(leaf, lambda: server.goals, "the goal")
        server.order("3 left")
        stage.tick_until(leaf, lambda: search.sweeps.state_of("a").done, "a piece that was passed")
        server.order("abort")
        assert stage.run(leaf) is Status.FAILURE
        assert (leaf.outcome_label, search.sweeps.state_of("a").open_count) == ("aborted", 3)
        assert stage.warnings[-1].endswith("error code 308: there is no path to the goal")

    def test_drive_through_without_path_is_not_repeated_until_piece_is_skipped(self, stage: "Stage") -> None:
        server = stage.through_server()
        server.script, server.error_code = ["abort"], 308
        search = planned(searching())
        leaf = self.make_drive_through(stage, search)
        stage.until(leaf._port.statuses.servers, "the server")
        assert stage.run(leaf) is Status.FAILURE
        assert self.take(stage, search, "AdvancePiece").tick_once() is None
        leaf.tick_once()
        assert (leaf.status, leaf.outcome_label, server.requests) == (Status.FAILURE, "piece by piece", 1)
        search.sweeps.skip("a", "not reached, or not searched")
        server.script = ["succeed"]
        assert stage.run(leaf) is Status.SUCCESS

    def test_drive_through_without_open_piece_fails(self, stage: "Stage") -> None:
        leaf = self.make_drive_through(stage, searching())
        leaf.tick_once()
        assert (leaf.status, leaf.outcome_label) == (Status.FAILURE, "no piece")

    def test_goal_with_nested_poses_is_filled_in(self, stage: "Stage") -> None:
        later = SimpleNamespace(poses=SimpleNamespace(goals=[]))
        leaf = self.make_drive_through(stage, searching())
        leaf._interface = SimpleNamespace(Goal=lambda: later)
        assert leaf._message_to(["a pose"]) is later
        assert later.poses.goals == ["a pose"]

    def test_cells_seen_on_drive_to_piece_are_counted(self, stage: "Stage") -> None:
        server = stage.nav_server()
        search = planned(searching())
        leaf = self.take(stage, search, "NavigateToPiece", record=search.record)
        robot = [(0.0, 1.0, 0.0)]
        leaf._robot.last_pose = lambda: robot[0]
        leaf.tick_once()
        stage.tick_until(leaf, lambda: server.goals, "the goal")
        for step in range(11):
            robot[0] = (step / 10.0, 1.0, 0.0)
            leaf.tick_once()
        robot[0] = (9.0, 9.0, 0.0)
        leaf.tick_once()
        server.goals[0].orders.put("succeed")
        assert stage.run(leaf) is Status.SUCCESS
        assert server.goals[0].pose[:3] == ("map", 1.0, 1.0)
        assert "Navigating to piece 1/4 of a..." in stage.lines
        assert self.take(stage, search, "AdvancePiece").tick_once() is None
        assert search.sweeps.state_of("a").metres == pytest.approx(1.0)
        assert search.record.zone == "a"

    def test_obstacle_at_piece_does_not_block_same_number_in_next_pass(self, stage: "Stage") -> None:
        server = stage.nav_server()
        server.error_code, server.script = 206, ["abort"]
        search = planned(searching(), count=1)
        leaf = self.take(stage, search, "NavigateToPiece", record=search.record)
        assert stage.run(leaf) is Status.FAILURE
        search.sweeps.skip("a", "not reached, or not searched")
        server.script = ["succeed"]
        search.sweeps.plan("a", "gaps", 2.0, [MapPose(x=3.0, y=3.0, yaw=0.0)])
        assert stage.run(leaf) is Status.SUCCESS
        assert [goal.pose[1:3] for goal in server.goals] == [(1.0, 1.0), (3.0, 3.0)]

    def test_drive_to_piece_without_open_piece_fails(self, stage: "Stage") -> None:
        search = searching()
        assert stage.run(self.take(stage, search, "NavigateToPiece", record=search.record)) is Status.FAILURE
        assert stage.warnings == ["'NavigateToPiece' has no target: no piece is open."]

    @pytest.mark.parametrize(
        ("name", "labels"),
        [
            ("AdvancePiece", ["advanced", "all done", "no piece"]),
            ("SkipPiece", ["skipped", "skipped the last", "no piece"]),
        ],
    )
    def test_outcome_states_whether_piece_was_the_last(
        self, name: str, labels: list[str], stage: "Stage"
    ) -> None:
        search = planned(searching(), count=2)
        remaining, leaf = self.take(stage, search, "PiecesRemaining"), self.take(stage, search, name)
        for label in labels:
            is_open = stage.run(remaining) is Status.SUCCESS
            assert is_open is (label != "no piece")
            assert stage.run(leaf) is Status.SUCCESS
            assert leaf.outcome_label == label

    def test_skipped_piece_and_end_of_pass_are_logged(self, stage: "Stage") -> None:
        search = planned(searching(), count=2)
        stage.run(self.take(stage, search, "SkipPiece"))
        stage.run(self.take(stage, search, "AdvancePiece"))
        assert stage.warnings == ["Skipping piece 1/2 of a."]
        assert stage.lines == ["a: 0% seen, POD 0%, 1 gaps."]

    def test_outcome_of_planning_states_open_or_finished_sweep(self, stage: "Stage") -> None:
        search = planned(searching(), count=1)
        leaf = self.take(stage, search, "PlanSweep")
        assert stage.run(leaf) is Status.SUCCESS
        assert leaf.outcome_label == "going on"
        search.sweeps.skip("a", "not reached, or not searched")
        assert stage.run(leaf) is Status.SUCCESS
        assert leaf.outcome_label == "swept before"
        assert search.sweeps.state_of("a").passes == 1

    def test_missed_ground_is_swept_again_up_to_max_passes(self, stage: "Stage") -> None:
        search = planned(searching(), count=1)
        search.sweeps.drive("a", [(0.0, 1.0), (4.0, 1.0)] * 4, None)
        stage.run(self.take(stage, search, "AdvancePiece"))
        leaf = self.take(stage, search, "RefineSweep", until_pod=0.8, max_passes=2)
        assert stage.run(leaf) is Status.SUCCESS
        assert (search.sweeps.state_of("a").pattern, search.sweeps.state_of("a").passes) == ("gaps", 2)
        # The ground beyond the range of the drive at y = 1 is swept in legs along its long side.
        assert {round(y, 2) for _, y in places(search)} == {3.12}
        while search.sweeps.state_of("a").open_count:
            search.sweeps.skip("a", "not reached, or not searched")
        assert stage.run(leaf) is Status.FAILURE

    def test_sufficiently_searched_ground_is_not_swept_again(self, stage: "Stage") -> None:
        search = planned(searching(), count=1)
        for y in (0.5, 1.5, 2.5, 3.5):
            search.sweeps.drive("a", [(0.0, y), (4.0, y)] * 2, None)
        stage.run(self.take(stage, search, "AdvancePiece"))
        assert search.sweeps.state_of("a").pod > 0.6
        leaf = self.take(stage, search, "RefineSweep", until_pod=0.6)
        assert stage.run(leaf) is Status.FAILURE
        assert leaf.feedback_message.startswith("a: POD")
