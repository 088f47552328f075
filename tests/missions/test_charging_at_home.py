"""Tests of the leaves that send the robot home to charge, of their events, and of the proofs of the shipped trees."""

import math
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest
import yaml
from py_trees.common import Status

from sar_compiler.journal.journal_opening import open_journal
from sar_compiler.missions import MissionPhase
from sar_compiler.runtime.clock import ManualClock
from sar_compiler.testing import simulate
from search_and_rescue.actions.return_checks import (
    AwaitCharge,
    FullBatterySuffices,
    ReturnInReach,
)
from search_and_rescue.energy import ConsumptionRates, EnergyModel
from search_and_rescue.failsafes import BatterySuffices
from search_and_rescue.homing_estimates import HomingEstimator
from search_and_rescue.search import BASE as BASE_NAME
from search_and_rescue.search import Search
from search_and_rescue.zone_manager import ZoneManager
from tests.missions.test_verified_trees import broken, verify
from tests.missions.test_zone_choice import PlanningServer

if TYPE_CHECKING:
    from tests.missions.mission_stage import Stage

BASE = {"x": 0.0, "y": 0.0, "yaw": 0.0}
TREE, SWEEPS = Path("trees/search_areas.xml"), Path("trees/search_sweeps.xml")
STRAIGHT = "'Full?': 1 of 1 paths are estimated as 1.5 times the straight line: no server offers compute_path_to_pose."
# 10 m away: 15 m with the detour, twice; at 1 % a metre and 1 m/s.
SHORT = "zone_a needs 30% of a full battery (30 m, 30 s), but the battery is at 40%, and the reserve is 15%"


class Robot:
    """A search of one zone with its leaves on a stage, and a publisher of battery states."""

    def __init__(self, stage: "Stage", **ports: Any) -> None:
        from sensor_msgs.msg import BatteryState

        self._stage, self._message = stage, BatteryState
        self.clock = ManualClock(100.0)
        plan = ZoneManager([{"id": "zone_a", "x": 10.0, "y": 0.0, "yaw": 0.0}], BASE)
        self.homing = HomingEstimator(plan, EnergyModel(ConsumptionRates(0.01, 1e-9), wrong_by=0.0))
        self.search = Search(plan, homing=self.homing)
        shared: Any = {"homing": self.homing, "clock": self.clock, "record": self.search.record}
        self._publisher = stage.host().node.create_publisher(BatteryState, "battery_state", 10)
        self.return_check = stage.take(ReturnInReach("InReach?", **shared, **ports))
        self.full_battery_check = stage.take(FullBatterySuffices("Full?", self.homing))
        self.charge_wait = stage.take(AwaitCharge("Await", **shared, patience=60.0))

    def report_battery(self, share: float) -> None:
        """Publish the battery until the model has this share: it uses the median of three readings."""

        def is_known() -> bool:
            self._publisher.publish(self._message(percentage=share))
            return math.isclose(self.homing.energy.share, share, abs_tol=1e-6)

        self._stage.until(is_known, f"a battery at {share:.0%}")

    def reach_base(self) -> None:
        self.search.record.base_reached()

    def tick_and_get_outcome(self, leaf: ReturnInReach | FullBatterySuffices | AwaitCharge) -> str:
        leaf.tick_once()
        return leaf.outcome_label

    @property
    def alarm_texts(self) -> list[str]:
        return [each.text for each in self.search.display().alarms]


@pytest.fixture
def robot(stage: "Stage") -> Robot:
    return Robot(stage)


@pytest.mark.ros
class TestReturnInReach:
    def test_sufficient_battery_lets_robot_start_leg(self, stage: "Stage", robot: Robot) -> None:
        robot.report_battery(0.9)
        assert robot.tick_and_get_outcome(robot.return_check) == "in reach"
        assert robot.return_check.status is Status.SUCCESS
        assert (stage.warnings, robot.alarm_texts) == ([], [])
        assert "metres to the point of no return" in {each.name for each in robot.search.display().figures}

    def test_insufficient_battery_sends_robot_home_and_states_figures(
        self, stage: "Stage", robot: Robot
    ) -> None:
        robot.report_battery(0.4)
        assert robot.tick_and_get_outcome(robot.return_check) == "out of reach"
        assert robot.return_check.status is Status.FAILURE
        assert stage.warnings == [f"{SHORT}: home first."]
        assert robot.alarm_texts == [f"{SHORT}: home first"]
        assert robot.search.record.alarms == ()

    def test_missing_battery_reading_is_waited_for_then_out_of_reach(
        self, stage: "Stage", robot: Robot
    ) -> None:
        assert robot.tick_and_get_outcome(robot.return_check) == "battery unknown"
        assert robot.return_check.status is Status.RUNNING
        robot.clock.advance(31.0)
        assert robot.tick_and_get_outcome(robot.return_check) == "out of reach"
        assert stage.warnings == ["no usable percentage on 'battery_state' for 30 s: home first."]

    def test_outdated_battery_reading_is_out_of_reach(self, stage: "Stage") -> None:
        robot = Robot(stage, max_age_sec=1e-9)
        robot.report_battery(0.9)
        assert robot.tick_and_get_outcome(robot.return_check) == "out of reach"

    @pytest.mark.parametrize("percentage", [math.nan, 85.0, -0.1])
    def test_invalid_percentage_is_ignored(self, robot: Robot, percentage: float) -> None:
        robot.return_check._meter._on_battery(robot._message(percentage=percentage))
        assert math.isnan(robot.homing.energy.share)
        assert robot.tick_and_get_outcome(robot.return_check) == "battery unknown"

    def test_insufficient_time_sends_robot_home(self, stage: "Stage") -> None:
        robot = Robot(stage, limit=100.0)
        robot.report_battery(0.9)
        assert robot.tick_and_get_outcome(robot.return_check) == "in reach"
        robot.clock.advance(70.0)
        assert robot.tick_and_get_outcome(robot.return_check) == "in reach"
        robot.clock.advance(1.0)
        robot.report_battery(0.9)
        assert robot.tick_and_get_outcome(robot.return_check) == "out of reach"
        reported = "zone_a and the way home need 30 s, but only 29 s of the mission time are left"
        assert stage.warnings == [f"{reported}: home first."]
        robot.reach_base()
        assert robot.tick_and_get_outcome(robot.charge_wait) == "not charged"
        assert robot.search.record.alarm == reported

    def test_check_without_zone_reports_no_zone(self, robot: Robot) -> None:
        robot.search.zones.select_next_zone()
        assert robot.tick_and_get_outcome(robot.return_check) == "no zone"
        assert robot.tick_and_get_outcome(robot.charge_wait) == "not charged"

    def test_return_is_estimated_from_robot_position(self, stage: "Stage", robot: Robot) -> None:
        from geometry_msgs.msg import PoseWithCovarianceStamped
        from rclpy.qos import DurabilityPolicy, QoSProfile

        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        pose = PoseWithCovarianceStamped()
        pose.pose.pose.position.x, pose.pose.pose.orientation.w = 20.0, 1.0
        stage.host().node.create_publisher(PoseWithCovarianceStamped, "amcl_pose", latched).publish(pose)

        def is_there() -> bool:
            robot.report_battery(0.9)
            return robot.homing.place is not None

        stage.until(is_there, "the place")
        assert robot.homing.home().metres == 30.0
        assert robot.homing.energy.share == pytest.approx(0.9)

    def test_consumption_is_learned_while_no_leaf_is_ticked(self, stage: "Stage", robot: Robot) -> None:
        from nav_msgs.msg import Odometry

        publisher, message = stage.host().node.create_publisher(Odometry, "odometry/filtered", 10), Odometry()
        message.pose.pose.orientation.w = 1.0
        began = time.monotonic()

        def has_learned() -> bool:
            # The position follows the clock: the number of calls depends on the machine, and a jump of a metre is implausible.
            message.pose.pose.position.x = 0.5 * (time.monotonic() - began)
            publisher.publish(message)
            robot._publisher.publish(robot._message(percentage=0.9 - 0.03 * message.pose.pose.position.x))
            return robot.homing.energy.rates.per_m > 0.015

        stage.until(has_learned, "a metre that takes more than was expected")


@pytest.mark.ros
class TestFullBatterySuffices:
    def test_full_battery_suffices_for_zone_near_home(self, stage: "Stage", robot: Robot) -> None:
        robot.report_battery(0.1)
        robot.homing.place = {"x": -90.0, "y": 0.0, "yaw": 0.0}
        assert robot.tick_and_get_outcome(robot.full_battery_check) == "suffices"
        assert (robot.full_battery_check.status, stage.warnings) == (Status.SUCCESS, [STRAIGHT])

    def test_full_battery_does_not_suffice_for_distant_zone(self, stage: "Stage", robot: Robot) -> None:
        robot.search.zones.add({"id": "zone_b", "x": 29.0, "y": 0.0, "yaw": 0.0})
        robot.search.zones.choose_zone("zone_b")
        assert robot.tick_and_get_outcome(robot.full_battery_check) == "too far"
        assert robot.full_battery_check.status is Status.FAILURE
        assert stage.warnings == [
            STRAIGHT,
            "zone_b needs 87% of a full battery from home and back (87 m, 87 s), but only 85% is available above the reserve.",
        ]

    def test_path_of_leg_is_requested_once(self, stage: "Stage", robot: Robot) -> None:
        server = PlanningServer(stage.host())
        server.detour_m = {frozenset({0.0, 10.0}): 40.0}
        assert stage.run(robot.full_battery_check) is Status.FAILURE
        assert stage.warnings[0].startswith(
            "zone_a needs 100% of a full battery from home and back (100 m, 100 s)"
        )
        assert stage.run(robot.full_battery_check) is Status.FAILURE
        assert server.asked == [(0.0, 10.0)]

    def test_halted_leaf_requests_path_again(self, stage: "Stage", robot: Robot) -> None:
        server = PlanningServer(stage.host())
        server.gate.clear()
        stage.tick_until(robot.full_battery_check, lambda: server.asked, "the question")
        assert robot.full_battery_check.outcome_label == "requesting paths"
        robot.full_battery_check.stop(Status.INVALID)
        server.gate.set()
        assert stage.run(robot.full_battery_check) is Status.SUCCESS
        assert server.asked == [(0.0, 10.0)] * 2

    def test_shutdown_removes_clients(self, stage: "Stage", robot: Robot) -> None:
        clients = len(list(stage.node.clients))
        robot.full_battery_check.shutdown()
        assert len(list(stage.node.clients)) == clients - 2

    def test_full_battery_check_without_zone_fails(self, robot: Robot) -> None:
        robot.search.zones.select_next_zone()
        assert robot.tick_and_get_outcome(robot.full_battery_check) == "no zone"
        assert robot.full_battery_check.status is Status.FAILURE


@pytest.mark.ros
def test_battery_failsafe_registers_highest_limit(stage: "Stage", robot: Robot) -> None:
    for limit in (0.3, 0.2):
        stage.take(BatterySuffices("Battery?", at_least=limit, homing=robot.homing))
    assert robot.homing.ends_below == 0.3


@pytest.mark.ros
class TestAwaitCharge:
    def test_leaf_waits_at_home_until_battery_is_swapped(self, stage: "Stage", robot: Robot) -> None:
        robot.report_battery(0.4)
        robot.tick_and_get_outcome(robot.return_check)
        assert robot.search.display().phase.name == ""
        robot.reach_base()
        assert robot.tick_and_get_outcome(robot.charge_wait) == "waiting"
        assert robot.charge_wait.status is Status.RUNNING
        assert robot.search.display().phase == MissionPhase("waiting", "for another battery", BASE_NAME)
        robot.report_battery(0.95)
        assert robot.tick_and_get_outcome(robot.charge_wait) == "charged"
        assert stage.lines == ["The battery is at 95%: the robot continues to zone_a."]
        assert (robot.alarm_texts, robot.search.display().phase.name) == ([], "")

    def test_insufficient_charge_keeps_leaf_waiting(self, robot: Robot) -> None:
        robot.report_battery(0.3)
        robot.tick_and_get_outcome(robot.return_check)
        robot.reach_base()
        robot.report_battery(0.4)
        assert robot.tick_and_get_outcome(robot.charge_wait) == "waiting"
        robot.report_battery(0.46)
        assert robot.tick_and_get_outcome(robot.charge_wait) == "charged"

    def test_sufficient_share_at_home_is_not_a_charge(self, robot: Robot) -> None:
        robot.report_battery(0.5)
        robot.homing.place = {"x": -10.0, "y": 0.0, "yaw": 0.0}
        robot.tick_and_get_outcome(robot.return_check)
        robot.homing.place = {"x": 0.0, "y": 0.0, "yaw": 0.0}
        robot.reach_base()
        assert robot.homing.shortage() == ""
        assert robot.tick_and_get_outcome(robot.charge_wait) == "waiting"

    def test_leaf_fails_with_alarm_after_patience(self, stage: "Stage", robot: Robot) -> None:
        robot.report_battery(0.4)
        robot.tick_and_get_outcome(robot.return_check)
        robot.reach_base()
        assert robot.tick_and_get_outcome(robot.charge_wait) == "waiting"
        robot.clock.advance(60.0)
        assert robot.tick_and_get_outcome(robot.charge_wait) == "waiting"
        robot.clock.advance(1.0)
        assert robot.tick_and_get_outcome(robot.charge_wait) == "not charged"
        assert robot.search.record.alarm == "the battery was not charged within 60 s at home"
        assert stage.warnings[-1] == "The battery was not charged within 60 s at home."
        assert robot.alarm_texts == ["the battery was not charged within 60 s at home"]
        assert robot.search.display().phase.name == ""

    def test_leaf_does_not_wait_away_from_home(self, robot: Robot) -> None:
        robot.report_battery(0.4)
        robot.tick_and_get_outcome(robot.return_check)
        assert robot.tick_and_get_outcome(robot.charge_wait) == "not charged"

    def test_battery_swapped_on_way_home_is_a_charge(self, robot: Robot) -> None:
        robot.report_battery(0.4)
        robot.tick_and_get_outcome(robot.return_check)
        robot.report_battery(0.9)
        robot.reach_base()
        assert robot.tick_and_get_outcome(robot.charge_wait) == "charged"


def make_search() -> Search:
    return Search(ZoneManager([{"id": "zone_a", "x": 10.0, "y": 0.0, "yaw": 0.0}], BASE))


def test_resumed_search_knows_reason_for_return(tmp_path: Path) -> None:
    first, second = make_search(), make_search()
    for search, resume in ((first, False), (second, True)):
        kept = open_journal(tmp_path / "search.journal", resume=resume)
        search.use_journal(kept)
        kept.begin({}, {})
        if not resume:
            search.record.home_first("zone_a", SHORT, need=0.3, share=None)
        else:
            said = [search.sentence(fact) for fact in kept.earlier_events() if fact.kind == "home_first"]
            assert said == [f"{SHORT}: home first"]
        kept.close()
    assert [each.text for each in second.display().alarms] == [f"{SHORT}: home first"]
    assert second.record.homing_for == SHORT


@pytest.mark.ros
def test_battery_swapped_between_runs_clears_alarm(robot: Robot) -> None:
    robot.search.record.home_first("zone_a", SHORT)
    robot.report_battery(0.9)
    assert robot.tick_and_get_outcome(robot.return_check) == "in reach"
    assert robot.alarm_texts == []


def test_charge_has_a_sentence() -> None:
    search = make_search()
    reported: list[str] = []
    search.record.journal.add_listener(lambda fact: reported.append(search.sentence(fact)))
    search.record.record_charge(0.954321)
    assert reported == ["the battery suffices (95%)"]


NO_UNCHECKED_LEG = "no leg starts unless the battery suffices for the way home"
# Each safeguard before a leg: its text in the tree, the replacement, and the property that is then violated.
SAFEGUARDS = {
    "check before each leg": (
        '<ReturnInReach name="ReturnInReach?"/>',
        "<AlwaysSuccess/>",
        NO_UNCHECKED_LEG,
    ),
    "wait for a charge": (
        '<AwaitCharge patience="15min"/>',
        "",
        NO_UNCHECKED_LEG,
    ),
    "failure of the wait": (
        '<AwaitCharge patience="15min"/>',
        '<ForceSuccess><AwaitCharge patience="15min"/></ForceSuccess>',
        "after a negative check, no leg starts before the battery is charged",
    ),
    "drive to charging place": (
        "<NavigateToCharge/>",
        "<AlwaysSuccess/>",
        "every leaf can run",
    ),
}


@pytest.mark.unmeasured
@pytest.mark.parametrize(
    "tree", [TREE, pytest.param(SWEEPS, marks=pytest.mark.costly)], ids=lambda tree: tree.stem
)
@pytest.mark.parametrize(("old", "new", "question"), SAFEGUARDS.values(), ids=SAFEGUARDS)
def test_removing_safeguard_violates_property(
    tmp_path: Path, tree: Path, old: str, new: str, question: str
) -> None:
    text = TREE.read_text(encoding="utf-8")
    assert text.count(old) == 1
    # The changed tree needs the other trees, which include it or are included by it.
    for shipped in TREE.parent.glob("*.xml"):
        (tmp_path / shipped.name).write_text(shipped.read_text(encoding="utf-8"), encoding="utf-8")
    (tmp_path / TREE.name).write_text(text.replace(old, new), encoding="utf-8")
    properties = f"config/{tree.stem}_properties.yaml"
    output = verify(tmp_path / tree.name, "--set", "zones_left=1", "--properties", properties)[1]
    assert question in broken(output)


@pytest.mark.unmeasured
def test_removing_check_before_pieces_violates_property(tmp_path: Path) -> None:
    asked = '<SubTree ID="InReachOrCharge"/>'
    text = SWEEPS.read_text(encoding="utf-8")
    assert text.count(asked) == 1
    for shipped in TREE.parent.glob("*.xml"):
        (tmp_path / shipped.name).write_text(shipped.read_text(encoding="utf-8"), encoding="utf-8")
    (tmp_path / SWEEPS.name).write_text(text.replace(asked, ""), encoding="utf-8")
    properties = "config/search_sweeps_properties.yaml"
    output = verify(tmp_path / SWEEPS.name, "--set", "zones_left=1", "--properties", properties)[1]
    assert broken(output) == {NO_UNCHECKED_LEG}


ONE_PASS: Any = {
    "scenario": {"facts": {"zones_left": 1}},
    "DetectSurvivor": "nothing",
    "RefineSweep": "nothing to sweep",
}


def test_sweep_resumes_same_piece_after_charge() -> None:
    run = simulate(SWEEPS, **ONE_PASS, ReturnInReach=["in reach", "out of reach", "in reach"])
    run.run_to_end().expect(
        order=[
            "AdvanceFromNobody advanced",
            "ReturnInReach out of reach",
            "NavigateToCharge arrived",
            "AwaitCharge charged",
            "NavigateToPiece arrived",
            "AdvanceFromNobody all done",
        ],
        count={"SkipPiece skipped": 0, "NavigateToCharge starts": 1},
    )


def test_piece_beyond_full_battery_is_skipped_without_drive() -> None:
    run = simulate(SWEEPS, **ONE_PASS, FullBatterySuffices=["too far", "suffices"]).run_to_end()
    run.expect(
        order=["SkipPiece skipped", "NavigateToPiece starts"],
        count={"SkipPiece skipped": 1, "NavigateToCharge starts": 0},
    )


def test_sweep_without_charge_ends_at_home() -> None:
    run = simulate(SWEEPS, ReturnInReach="out of reach", AwaitCharge="not charged").run_to_end()
    run.expect(
        order=["AwaitCharge not charged", "AbandonZones abandoned", "NavigateToBase arrived"],
        count={"NavigateToPiece starts": 0, "SkipPiece skipped": 0, "PostponeZone postponed": 0},
        root="FAILURE",
    )


def test_mission_without_charge_abandons_zones_and_ends_at_home() -> None:
    run = simulate(TREE, ReturnInReach="out of reach", AwaitCharge="not charged")
    run.run_to_end().expect(
        order=[
            "NavigateToCharge arrived",
            "AwaitCharge not charged",
            "AbandonZones abandoned",
            "NavigateToBase arrived",
        ],
        count={"PostponeZone postponed": 0, "NavigateToZone starts": 0},
        root="FAILURE",
    )


def test_zone_beyond_full_battery_is_retried_and_abandoned_without_drive() -> None:
    run = simulate(TREE, FullBatterySuffices="too far").run_to_end()
    run.expect(count={"PostponeZone postponed": 6, "AbandonZone abandoned": 3, "NavigateToZone starts": 0})


@pytest.mark.unmeasured
def test_shipped_tree_is_proved_to_start_no_leg_beyond_reserve() -> None:
    status, output = verify(TREE, "--set", "zones_left=2")
    assert (status, broken(output)) == (0, set())
    assert output.count("no leg starts") == 3


def test_search_areas_properties_match_mission_except_return() -> None:
    mission, areas = (
        yaml.safe_load(Path(f"config/{name}_properties.yaml").read_text(encoding="utf-8"))
        for name in ("mission", "search_areas")
    )
    shared = {key: value for key, value in mission["properties"].items() if "home only" not in key}
    assert {key: areas["properties"].get(key) for key in shared} == shared
    assert areas["end"] == mission["end"]
