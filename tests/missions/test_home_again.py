"""The leaves that bring the robot home before it goes on, what is remembered of that, and what the shipped tree is proved to do."""

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
from tests.missions.test_both_trees_verified import broken, verify
from tests.missions.test_choosing_zones import PlanningServer

if TYPE_CHECKING:
    from tests.missions.mission_stage import Stage

BASE = {"x": 0.0, "y": 0.0, "yaw": 0.0}
TREE, SWEEPS = Path("trees/search_areas.xml"), Path("trees/search_sweeps.xml")
STRAIGHT = "'Full?': 1 of 1 paths are estimated as 1.5 times the straight line: no server offers compute_path_to_pose."
# 10 m away: 15 m with the detour, twice; at 1 % a metre and 1 m/s.
SHORT = "zone_a needs 30% of a full battery (30 m, 30 s), but the battery is at 40%, and the reserve is 15%"


class Robot:
    """A search of one zone, with the leaves on a stage, and the battery that is told on its topic."""

    def __init__(self, stage: "Stage", **ports: Any) -> None:
        from sensor_msgs.msg import BatteryState

        self._stage, self._message = stage, BatteryState
        self.clock = ManualClock(100.0)
        plan = ZoneManager([{"id": "zone_a", "x": 10.0, "y": 0.0, "yaw": 0.0}], BASE)
        self.homing = HomingEstimator(plan, EnergyModel(ConsumptionRates(0.01, 1e-9), wrong_by=0.0))
        self.search = Search(plan, homing=self.homing)
        shared: Any = {"homing": self.homing, "clock": self.clock, "record": self.search.record}
        self._publisher = stage.host().node.create_publisher(BatteryState, "battery_state", 10)
        self.asks = stage.take(ReturnInReach("InReach?", **shared, **ports))
        self.full = stage.take(FullBatterySuffices("Full?", self.homing))
        self.waits = stage.take(AwaitCharge("Await", **shared, patience=60.0))

    def tells(self, share: float) -> None:
        """Tell of the battery until that is known: the model takes the median of three readings."""

        def is_known() -> bool:
            self._publisher.publish(self._message(percentage=share))
            return math.isclose(self.homing.energy.share, share, abs_tol=1e-6)

        self._stage.until(is_known, f"a battery at {share:.0%}")

    def comes_home(self) -> None:
        self.search.record.base_reached()

    def answer(self, leaf: ReturnInReach | FullBatterySuffices | AwaitCharge) -> str:
        leaf.tick_once()
        return leaf.outcome_label

    @property
    def facts(self) -> list[str]:
        return [each.text for each in self.search.display().alarms]


@pytest.fixture
def robot(stage: "Stage") -> Robot:
    return Robot(stage)


@pytest.mark.ros
class TestReturnInReach:
    def test_a_battery_that_suffices_lets_the_robot_go(self, stage: "Stage", robot: Robot) -> None:
        robot.tells(0.9)
        assert robot.answer(robot.asks) == "in reach"
        assert robot.asks.status is Status.SUCCESS
        assert (stage.warnings, robot.facts) == ([], [])
        assert "metres to the point of no return" in {each.name for each in robot.search.display().figures}

    def test_one_that_does_not_brings_it_home_first_and_is_told_with_figures(
        self, stage: "Stage", robot: Robot
    ) -> None:
        robot.tells(0.4)
        assert robot.answer(robot.asks) == "out of reach"
        assert robot.asks.status is Status.FAILURE
        assert stage.warnings == [f"{SHORT}: home first."]
        assert robot.facts == [f"{SHORT}: home first"]
        assert robot.search.record.alarms == ()

    def test_it_waits_for_the_first_word_of_the_battery_and_then_takes_silence_for_empty(
        self, stage: "Stage", robot: Robot
    ) -> None:
        assert robot.answer(robot.asks) == "battery unknown"
        assert robot.asks.status is Status.RUNNING
        robot.clock.advance(31.0)
        assert robot.answer(robot.asks) == "out of reach"
        assert stage.warnings == ["no usable percentage on 'battery_state' for 30 s: home first."]

    def test_a_battery_that_has_fallen_silent_suffices_for_nothing(self, stage: "Stage") -> None:
        robot = Robot(stage, max_age_sec=1e-9)
        robot.tells(0.9)
        assert robot.answer(robot.asks) == "out of reach"

    @pytest.mark.parametrize("percentage", [math.nan, 85.0, -0.1])
    def test_what_is_no_share_says_nothing(self, robot: Robot, percentage: float) -> None:
        robot.asks._meter._on_battery(robot._message(percentage=percentage))
        assert math.isnan(robot.homing.energy.share)
        assert robot.answer(robot.asks) == "battery unknown"

    def test_time_that_does_not_suffice_brings_the_robot_home_too(self, stage: "Stage") -> None:
        robot = Robot(stage, limit=100.0)
        robot.tells(0.9)
        assert robot.answer(robot.asks) == "in reach"
        robot.clock.advance(70.0)
        assert robot.answer(robot.asks) == "in reach"
        robot.clock.advance(1.0)
        robot.tells(0.9)
        assert robot.answer(robot.asks) == "out of reach"
        told = "zone_a and the way home need 30 s, but only 29 s of the mission time are left"
        assert stage.warnings == [f"{told}: home first."]
        robot.comes_home()
        assert robot.answer(robot.waits) == "not charged"
        assert robot.search.record.alarm == told

    def test_without_a_zone_there_is_nowhere_to_go(self, robot: Robot) -> None:
        robot.search.zones.select_next_zone()
        assert robot.answer(robot.asks) == "no zone"
        assert robot.answer(robot.waits) == "not charged"

    def test_it_is_weighed_from_where_the_robot_is(self, stage: "Stage", robot: Robot) -> None:
        from geometry_msgs.msg import PoseWithCovarianceStamped
        from rclpy.qos import DurabilityPolicy, QoSProfile

        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        pose = PoseWithCovarianceStamped()
        pose.pose.pose.position.x, pose.pose.pose.orientation.w = 20.0, 1.0
        stage.host().node.create_publisher(PoseWithCovarianceStamped, "amcl_pose", latched).publish(pose)

        def is_there() -> bool:
            robot.tells(0.9)
            return robot.homing.place is not None

        stage.until(is_there, "the place")
        assert robot.homing.home().metres == 30.0
        assert robot.homing.energy.share == pytest.approx(0.9)

    def test_what_is_driven_is_learned_while_no_leaf_is_ticked(self, stage: "Stage", robot: Robot) -> None:
        from nav_msgs.msg import Odometry

        publisher, message = stage.host().node.create_publisher(Odometry, "odometry/filtered", 10), Odometry()
        message.pose.pose.orientation.w = 1.0
        began = time.monotonic()

        def has_learned() -> bool:
            # By the clock: how often this is called depends on the machine, and nothing drives a metre in a moment.
            message.pose.pose.position.x = 0.5 * (time.monotonic() - began)
            publisher.publish(message)
            robot._publisher.publish(robot._message(percentage=0.9 - 0.03 * message.pose.pose.position.x))
            return robot.homing.energy.rates.per_m > 0.015

        stage.until(has_learned, "a metre that takes more than was expected")


@pytest.mark.ros
class TestFullBatterySuffices:
    def test_a_zone_from_which_a_full_battery_brings_the_robot_home_is_one_to_charge_for(
        self, stage: "Stage", robot: Robot
    ) -> None:
        robot.tells(0.1)
        robot.homing.place = {"x": -90.0, "y": 0.0, "yaw": 0.0}
        assert robot.answer(robot.full) == "suffices"
        assert (robot.full.status, stage.warnings) == (Status.SUCCESS, [STRAIGHT])

    def test_no_charge_helps_for_one_that_is_too_far(self, stage: "Stage", robot: Robot) -> None:
        robot.search.zones.add({"id": "zone_b", "x": 29.0, "y": 0.0, "yaw": 0.0})
        robot.search.zones.choose_zone("zone_b")
        assert robot.answer(robot.full) == "too far"
        assert robot.full.status is Status.FAILURE
        assert stage.warnings == [
            STRAIGHT,
            "zone_b needs 87% of a full battery from home and back (87 m, 87 s), but only 85% is available above the reserve.",
        ]

    def test_it_asks_the_planner_for_the_ways_of_the_leg_and_for_none_twice(
        self, stage: "Stage", robot: Robot
    ) -> None:
        server = PlanningServer(stage.host())
        server.detour_m = {frozenset({0.0, 10.0}): 40.0}
        assert stage.run(robot.full) is Status.FAILURE
        assert stage.warnings[0].startswith(
            "zone_a needs 100% of a full battery from home and back (100 m, 100 s)"
        )
        assert stage.run(robot.full) is Status.FAILURE
        assert server.asked == [(0.0, 10.0)]

    def test_one_that_is_halted_asks_anew_when_it_is_its_turn_again(
        self, stage: "Stage", robot: Robot
    ) -> None:
        server = PlanningServer(stage.host())
        server.gate.clear()
        stage.tick_until(robot.full, lambda: server.asked, "the question")
        assert robot.full.outcome_label == "requesting paths"
        robot.full.stop(Status.INVALID)
        server.gate.set()
        assert stage.run(robot.full) is Status.SUCCESS
        assert server.asked == [(0.0, 10.0)] * 2

    def test_its_client_is_gone_with_it(self, stage: "Stage", robot: Robot) -> None:
        clients = len(list(stage.node.clients))
        robot.full.shutdown()
        assert len(list(stage.node.clients)) == clients - 2

    def test_without_a_zone_there_is_nothing_to_weigh(self, robot: Robot) -> None:
        robot.search.zones.select_next_zone()
        assert robot.answer(robot.full) == "no zone"
        assert robot.full.status is Status.FAILURE


@pytest.mark.ros
def test_a_failsafe_that_ends_the_mission_at_a_limit_lets_it_be_known(stage: "Stage", robot: Robot) -> None:
    for limit in (0.3, 0.2):
        stage.take(BatterySuffices("Battery?", at_least=limit, homing=robot.homing))
    assert robot.homing.ends_below == 0.3


@pytest.mark.ros
class TestAwaitCharge:
    def test_it_waits_at_home_until_the_battery_was_swapped(self, stage: "Stage", robot: Robot) -> None:
        robot.tells(0.4)
        robot.answer(robot.asks)
        assert robot.search.display().phase.name == ""
        robot.comes_home()
        assert robot.answer(robot.waits) == "waiting"
        assert robot.waits.status is Status.RUNNING
        assert robot.search.display().phase == MissionPhase("waiting", "for another battery", BASE_NAME)
        robot.tells(0.95)
        assert robot.answer(robot.waits) == "charged"
        assert stage.lines == ["The battery is at 95%: the robot continues to zone_a."]
        assert (robot.facts, robot.search.display().phase.name) == ([], "")

    def test_a_battery_that_is_charged_a_little_does_not_suffice(self, robot: Robot) -> None:
        robot.tells(0.3)
        robot.answer(robot.asks)
        robot.comes_home()
        robot.tells(0.4)
        assert robot.answer(robot.waits) == "waiting"
        robot.tells(0.46)
        assert robot.answer(robot.waits) == "charged"

    def test_a_reserve_that_suffices_at_home_is_no_charge(self, robot: Robot) -> None:
        robot.tells(0.5)
        robot.homing.place = {"x": -10.0, "y": 0.0, "yaw": 0.0}
        robot.answer(robot.asks)
        robot.homing.place = {"x": 0.0, "y": 0.0, "yaw": 0.0}
        robot.comes_home()
        assert robot.homing.shortage() == ""
        assert robot.answer(robot.waits) == "waiting"

    def test_its_patience_ends_with_the_reason_for_which_the_zones_are_given_up(
        self, stage: "Stage", robot: Robot
    ) -> None:
        robot.tells(0.4)
        robot.answer(robot.asks)
        robot.comes_home()
        assert robot.answer(robot.waits) == "waiting"
        robot.clock.advance(60.0)
        assert robot.answer(robot.waits) == "waiting"
        robot.clock.advance(1.0)
        assert robot.answer(robot.waits) == "not charged"
        assert robot.search.record.alarm == "the battery was not charged within 60 s at home"
        assert stage.warnings[-1] == "The battery was not charged within 60 s at home."
        assert robot.facts == ["the battery was not charged within 60 s at home"]
        assert robot.search.display().phase.name == ""

    def test_away_from_home_there_is_nothing_to_wait_for(self, robot: Robot) -> None:
        robot.tells(0.4)
        robot.answer(robot.asks)
        assert robot.answer(robot.waits) == "not charged"

    def test_a_battery_that_was_swapped_on_the_way_home_counts(self, robot: Robot) -> None:
        robot.tells(0.4)
        robot.answer(robot.asks)
        robot.tells(0.9)
        robot.comes_home()
        assert robot.answer(robot.waits) == "charged"


def searching() -> Search:
    return Search(ZoneManager([{"id": "zone_a", "x": 10.0, "y": 0.0, "yaw": 0.0}], BASE))


def test_a_resumed_search_knows_why_the_robot_comes_home(tmp_path: Path) -> None:
    first, second = searching(), searching()
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
def test_a_battery_that_was_swapped_while_no_run_was_there_ends_the_alarm(robot: Robot) -> None:
    robot.search.record.home_first("zone_a", SHORT)
    robot.tells(0.9)
    assert robot.answer(robot.asks) == "in reach"
    assert robot.facts == []


def test_a_charge_is_told_in_a_sentence() -> None:
    search = searching()
    told: list[str] = []
    search.record.journal.add_listener(lambda fact: told.append(search.sentence(fact)))
    search.record.record_charge(0.954321)
    assert told == ["the battery suffices (95%)"]


UNASKED = "no leg starts unless the battery suffices for the way home"
# What the tree does before a leg, taken out, and what does not hold any more.
NEEDED = {
    "the question before each leg": (
        '<ReturnInReach name="ReturnInReach?"/>',
        "<AlwaysSuccess/>",
        UNASKED,
    ),
    "the wait for a battery": (
        '<AwaitCharge patience="15min"/>',
        "",
        UNASKED,
    ),
    "the wait after the last failure too": (
        '<AwaitCharge patience="15min"/>',
        '<ForceSuccess><AwaitCharge patience="15min"/></ForceSuccess>',
        "after a negative check, no leg starts before the battery is charged",
    ),
    "the drive to where it waits": (
        "<NavigateToCharge/>",
        "<AlwaysSuccess/>",
        "every leaf can run",
    ),
}


@pytest.mark.unmeasured
@pytest.mark.parametrize(
    "tree", [TREE, pytest.param(SWEEPS, marks=pytest.mark.costly)], ids=lambda tree: tree.stem
)
@pytest.mark.parametrize(("old", "new", "question"), NEEDED.values(), ids=NEEDED)
def test_the_tree_needs(tmp_path: Path, tree: Path, old: str, new: str, question: str) -> None:
    text = TREE.read_text(encoding="utf-8")
    assert text.count(old) == 1
    # Beside the trees that include it, and that it includes.
    for shipped in TREE.parent.glob("*.xml"):
        (tmp_path / shipped.name).write_text(shipped.read_text(encoding="utf-8"), encoding="utf-8")
    (tmp_path / TREE.name).write_text(text.replace(old, new), encoding="utf-8")
    properties = f"config/{tree.stem}_properties.yaml"
    output = verify(tmp_path / tree.name, "--set", "zones_left=1", "--properties", properties)[1]
    assert question in broken(output)


@pytest.mark.unmeasured
def test_a_sweep_needs_the_question_before_each_piece(tmp_path: Path) -> None:
    asked = '<SubTree ID="InReachOrCharge"/>'
    text = SWEEPS.read_text(encoding="utf-8")
    assert text.count(asked) == 1
    for shipped in TREE.parent.glob("*.xml"):
        (tmp_path / shipped.name).write_text(shipped.read_text(encoding="utf-8"), encoding="utf-8")
    (tmp_path / SWEEPS.name).write_text(text.replace(asked, ""), encoding="utf-8")
    properties = "config/search_sweeps_properties.yaml"
    output = verify(tmp_path / SWEEPS.name, "--set", "zones_left=1", "--properties", properties)[1]
    assert broken(output) == {UNASKED}


ONE_PASS: Any = {
    "scenario": {"facts": {"zones_left": 1}},
    "DetectSurvivor": "nothing",
    "RefineSweep": "nothing to sweep",
}


def test_a_sweep_goes_on_with_the_same_piece_after_a_charge() -> None:
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


def test_a_piece_for_which_no_battery_suffices_is_left_out_without_a_drive() -> None:
    run = simulate(SWEEPS, **ONE_PASS, FullBatterySuffices=["too far", "suffices"]).run_to_end()
    run.expect(
        order=["SkipPiece skipped", "NavigateToPiece starts"],
        count={"SkipPiece skipped": 1, "NavigateToCharge starts": 0},
    )


def test_where_no_battery_comes_a_sweep_ends_at_home() -> None:
    run = simulate(SWEEPS, ReturnInReach="out of reach", AwaitCharge="not charged").run_to_end()
    run.expect(
        order=["AwaitCharge not charged", "AbandonZones abandoned", "NavigateToBase arrived"],
        count={"NavigateToPiece starts": 0, "SkipPiece skipped": 0, "PostponeZone postponed": 0},
        root="FAILURE",
    )


def test_where_no_battery_comes_the_zones_that_are_left_are_given_up_and_the_mission_ends_at_home() -> None:
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


def test_a_zone_for_which_no_battery_suffices_is_come_back_to_and_abandoned_without_a_drive() -> None:
    run = simulate(TREE, FullBatterySuffices="too far").run_to_end()
    run.expect(count={"PostponeZone postponed": 6, "AbandonZone abandoned": 3, "NavigateToZone starts": 0})


@pytest.mark.unmeasured
def test_the_shipped_tree_is_proved_to_begin_no_leg_that_would_hurt_the_reserve() -> None:
    status, output = verify(TREE, "--set", "zones_left=2")
    assert (status, broken(output)) == (0, set())
    assert output.count("no leg starts") == 3


def test_its_properties_are_those_of_the_mission_but_for_coming_home() -> None:
    mission, areas = (
        yaml.safe_load(Path(f"config/{name}_properties.yaml").read_text(encoding="utf-8"))
        for name in ("mission", "search_areas")
    )
    shared = {key: value for key, value in mission["properties"].items() if "home only" not in key}
    assert {key: areas["properties"].get(key) for key in shared} == shared
    assert areas["end"] == mission["end"]
