"""Tests of the failsafes: precedence and effects of the responses, and the operator's commands over ROS."""

import math
from collections.abc import Callable, Sequence
from contextlib import redirect_stderr, redirect_stdout
from functools import partial
from io import StringIO
from itertools import count
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from py_trees.common import Status

from sar_compiler import load
from sar_compiler.analysis.simulated_tree import Assumptions, SimulatedTree, compile_simulated
from sar_compiler.analysis.stub_leaf import StubLeaf
from sar_compiler.cli.compile import main
from sar_compiler.journal.journal_entries import JournalEntry
from sar_compiler.runtime.clock import ManualClock
from sar_compiler.runtime.outcomes import Outcome, nominal
from sar_compiler.testing import assert_scenario_holds
from search_and_rescue.actions.zones import AbandonZones
from search_and_rescue.failsafes import (
    BaseInReach,
    BatterySuffices,
    InsideFence,
    MissionTimeLeft,
    NotAborted,
    NotRecalled,
)
from search_and_rescue.operator_commands import OperatorCommands
from search_and_rescue.operator_leaves import AwaitStandstill, NotHeld
from search_and_rescue.record import MissionRecord
from search_and_rescue.search import Search
from search_and_rescue.zone_manager import Geofence, ZoneManager
from tests.processes import in_order
from tests.ros.conftest import Said
from tests.ros.test_unexpected_motion import Robot

GUARDED = Path("trees/search_and_rescue_guarded.xml")
EXAMPLE = Path("examples/failsafes")

# The outcome of each condition that triggers its response.
TROUBLES = {
    "NotHeld?": "held",
    "NotAborted?": "aborted",
    "InsideFence?": "outside",
    "NotRecalled?": "recalled",
    "BatterySuffices?": "low",
    "MissionTimeLeft?": "time is up",
    "BaseInReach?": "lost",
}
EMERGENCIES = ("NotAborted?", "InsideFence?")
CONTINGENCIES = ("NotRecalled?", "BatterySuffices?", "MissionTimeLeft?", "BaseInReach?")


class ScriptedPolicy:
    """Lets leaves return scripted outcomes, and their nominal ones otherwise; a drive to a zone keeps running."""

    def __init__(self) -> None:
        self.wrong: dict[str, str] = {"NavigateToZone": "driving"}

    def choose(self, leaf: StubLeaf, options: Sequence[Outcome]) -> Outcome:
        said = self.wrong.get(leaf.name)
        return next((answer for answer in options if answer.name == said), nominal(options))


class GuardedMission:
    """The simulated guarded mission while it drives to its first zone."""

    def __init__(self, **facts: int) -> None:
        self.day = ScriptedPolicy()
        self.tree: SimulatedTree = compile_simulated(load(GUARDED).binding(), {}, Assumptions(facts))
        self.tree.policy = self.day
        self.tick()

    def tick(self, seconds: float = 1.0) -> Status:
        self.tree.clock.advance(seconds)
        self.tree.root.tick_once()
        return self.tree.root.status

    def trouble(self, *conditions: str) -> None:
        self.day.wrong |= {condition: TROUBLES[condition] for condition in conditions}

    def run_to_end(self) -> Status:
        for _ in range(100):
            if self.tick(40.0) is not Status.RUNNING:
                return self.tree.root.status
        message = f"the flight did not end; facts: {self.tree.fact_values()}"
        raise AssertionError(message)

    def answered(self) -> list[str]:
        return [f"{event.leaf} {event.outcome}" for event in self.tree.events if event.outcome]


def test_mission_without_trouble_is_completed() -> None:
    mission = GuardedMission()
    mission.day.wrong.clear()
    assert mission.run_to_end() is Status.SUCCESS
    assert mission.answered().count("AdvanceZone advanced") == 3
    assert "ComeHome arrived" not in mission.answered()


@pytest.mark.parametrize("condition", CONTINGENCIES)
def test_contingency_brings_robot_home_and_ends_mission(condition: str) -> None:
    mission = GuardedMission()
    mission.trouble(condition)
    assert mission.run_to_end() is Status.FAILURE
    facts = mission.tree.fact_values()
    assert (facts["at"], facts["zones_left"], facts["zones_abandoned"]) == ("base", 0, 3)


@pytest.mark.parametrize("condition", EMERGENCIES)
def test_emergency_ends_mission_at_current_location(condition: str) -> None:
    mission = GuardedMission()
    mission.trouble(condition)
    assert mission.tick() is Status.FAILURE
    facts = mission.tree.fact_values()
    assert (facts["at"], facts["zones_left"]) == ("", 0)
    assert not any("ComeHome" in line for line in mission.answered())


@pytest.mark.parametrize("milder", CONTINGENCIES)
@pytest.mark.parametrize("severer", EMERGENCIES)
def test_emergency_takes_precedence_over_contingency(severer: str, milder: str) -> None:
    mission = GuardedMission()
    mission.trouble(milder, severer)
    assert mission.tick() is Status.FAILURE
    assert mission.tree.fact_values()["at"] == ""


def test_emergency_interrupts_return_home() -> None:
    mission = GuardedMission()
    mission.day.wrong["ComeHome"] = "driving"
    mission.trouble("BatterySuffices?")
    assert mission.tick() is Status.RUNNING
    mission.trouble("InsideFence?")
    assert mission.tick() is Status.FAILURE
    assert mission.tree.fact_values()["at"] == ""


def test_return_home_continues_after_its_reason_has_gone() -> None:
    mission = GuardedMission()
    mission.day.wrong["ComeHome"] = "driving"
    mission.trouble("BatterySuffices?")
    mission.tick()
    del mission.day.wrong["BatterySuffices?"]
    assert mission.tick() is Status.RUNNING
    assert mission.answered()[-1] == "ComeHome driving"


def test_pause_takes_precedence_over_all_failsafes() -> None:
    mission = GuardedMission(orders_left=9)
    mission.tree.events.clear()
    mission.trouble("NotHeld?", *EMERGENCIES, *CONTINGENCIES)
    assert [mission.tick() for _ in range(3)] == [Status.RUNNING] * 3
    assert mission.answered() == ["NotHeld? held", "AwaitStandstillAndHold stands", *["NotHeld? held"] * 2]


def test_emergency_ends_mission_when_robot_stands() -> None:
    mission = GuardedMission()
    mission.trouble("NotAborted?")
    mission.day.wrong["AwaitStandstillAndStop"] = "moves"
    assert [mission.tick() for _ in range(2)] == [Status.RUNNING] * 2
    assert mission.tree.fact_values()["zones_left"] == 0
    del mission.day.wrong["AwaitStandstillAndStop"]
    assert mission.tick() is Status.FAILURE


def test_paused_mission_resumes_with_same_zone() -> None:
    mission = GuardedMission(orders_left=9)
    mission.trouble("NotHeld?")
    mission.tick()
    mission.day.wrong.clear()
    assert mission.run_to_end() is Status.SUCCESS
    assert mission.answered().count("AdvanceZone advanced") == 3


def test_unreachable_base_is_awaited_before_return_home() -> None:
    mission = GuardedMission()
    mission.trouble("BaseInReach?")
    assert [mission.tick(30.0) for _ in range(2)] == [Status.RUNNING] * 2
    assert "ComeHome arrived" not in mission.answered()
    mission.day.wrong.clear()
    assert mission.run_to_end() is Status.SUCCESS


def verify(text: str, *options: str) -> tuple[int, str]:
    """Return the exit status and the output of `verify` for a tree with one zone."""
    out = StringIO()
    with redirect_stdout(out), redirect_stderr(StringIO()):
        status = main(["verify", text, "--set", "zones_left=1", *options])
    return status, out.getvalue()


@pytest.mark.unmeasured
def test_guarded_mission_is_verified() -> None:
    status, output = verify(str(GUARDED))
    assert status == 0, output
    assert output.count("proved") > 10


_LAST = "AlwaysFailure/>\n    </Sequence>\n  </BehaviorTree>\n</root>"
# The changes of the files, and the property that no longer holds.
NEEDED = {
    "the zone that is left before anybody is told": (
        {
            "<KeepReport/>\n          <AdvanceZone/>": "<KeepReport/>",
            '<NotifyBase server_timeout_sec="5"/>\n          </ForceSuccess>': (
                '<NotifyBase server_timeout_sec="5"/></ForceSuccess><AdvanceZone/>'
            ),
        },
        "one id per survivor",
    ),
    "the zones that are given up": (
        {'<AbandonZones name="AbandonZonesAndGoHome"/>': "<AlwaysSuccess/>"},
        "home only when no zone remains",
    ),
    "the failure at the end of the way home": (
        {_LAST: _LAST.replace("Failure", "Success")},
        "every run ends",
    ),
}


@pytest.mark.unmeasured
@pytest.mark.parametrize(("changes", "question"), NEEDED.values(), ids=NEEDED)
def test_removing_required_part_of_failsafes_violates_property(
    tmp_path: Path, changes: dict[str, str], question: str
) -> None:
    included = (GUARDED.name, "failsafes.xml", "search_and_rescue_resilient.xml")
    texts = {name: GUARDED.with_name(name).read_text(encoding="utf-8") for name in included}
    for old, new in changes.items():
        assert sum(old in text for text in texts.values()) == 1, old
        texts = {name: text.replace(old, new) for name, text in texts.items()}
    for name, text in texts.items():
        (tmp_path / name).write_text(text, encoding="utf-8")
    # The violation is found within a limited number of states.
    status, output = verify(str(tmp_path / GUARDED.name), "--max-states", "20000")
    assert status == 1
    assert f"{question}: does not hold" in " ".join(output.split()), output


@pytest.mark.unmeasured
def test_properties_of_abort_example_hold() -> None:
    status, output = verify(str(GUARDED), "--properties", str(EXAMPLE / "abort.yaml"))
    assert status == 0, output


def test_low_battery_scenario_holds() -> None:
    assert_scenario_holds(GUARDED, EXAMPLE / "low_battery.yaml")


class WarningCollector:
    """Collects the warnings of a leaf without a node in a list."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.warnings: list[str] = []
        self._patch = monkeypatch

    def to(self, leaf: Any, now: Callable[[], float] = lambda: 0.0) -> Any:
        self._patch.setattr(leaf, "warn", self.warnings.append)
        if hasattr(leaf, "_now_sec"):
            self._patch.setattr(leaf, "_now_sec", now)
        return leaf


@pytest.fixture
def collector(monkeypatch: pytest.MonkeyPatch) -> WarningCollector:
    return WarningCollector(monkeypatch)


@pytest.fixture
def record() -> MissionRecord:
    return MissionRecord()


class TestConditions:
    def test_mission_time_starts_at_first_tick_and_includes_halt(
        self, collector: WarningCollector, record: MissionRecord
    ) -> None:
        clock = ManualClock(1000.0)
        leaf = collector.to(MissionTimeLeft("Left?", 60.0, clock, record=record))
        assert leaf.update() is Status.SUCCESS
        clock.advance(59.0)
        leaf.stop(Status.INVALID)
        assert leaf.update() is Status.SUCCESS
        clock.advance(2.0)
        assert leaf.update() is Status.FAILURE
        assert record.alarm == "the mission's time limit of 60 s has expired"

    @pytest.mark.parametrize(
        ("share", "status", "alarm"),
        [
            (0.21, Status.SUCCESS, ""),
            (0.19, Status.FAILURE, "the battery is at 19%, below 20%"),
        ],
    )
    def test_battery_is_checked_by_percentage(
        self, collector: WarningCollector, record: MissionRecord, share: float, status: Status, alarm: str
    ) -> None:
        leaf = collector.to(BatterySuffices("Battery?", record=record))
        assert leaf.on_message(SimpleNamespace(percentage=share)) is status
        assert record.alarm == alarm

    def test_battery_limit_is_recorded_once(self, collector: WarningCollector, record: MissionRecord) -> None:
        told: list[JournalEntry] = []
        record.journal.add_listener(told.append)
        leaf = collector.to(BatterySuffices("Battery?", record=record, at_least=0.3))
        for share in (0.9, 0.8):
            leaf.on_message(SimpleNamespace(percentage=share))
        assert [(each.kind, each.data) for each in told] == [("battery", {"share": 0.9, "at_least": 0.3})]

    def test_silent_battery_is_low_after_timeout(
        self, collector: WarningCollector, record: MissionRecord
    ) -> None:
        clock = ManualClock(5.0)
        leaf = collector.to(BatterySuffices("Battery?", record=record), clock.now)
        assert leaf.update() is Status.SUCCESS
        clock.advance(31.0)
        assert leaf.update() is Status.FAILURE
        assert record.alarm == "no message on 'battery_state' for 30 s"

    @pytest.mark.ros
    @pytest.mark.parametrize("percentage", [85.0, float("nan")])
    def test_battery_with_invalid_percentage_is_low_after_timeout(
        self, ros: Any, monkeypatch: pytest.MonkeyPatch, record: MissionRecord, percentage: float
    ) -> None:
        from sensor_msgs.msg import BatteryState

        clock = ManualClock(5.0)
        leaf = BatterySuffices("Battery?", record=record)
        leaf.setup(node=ros.node("mission"))
        monkeypatch.setattr(leaf, "_now_sec", clock.now)
        publisher = ros.node("driver").create_publisher(BatteryState, "battery_state", 10)
        message = BatteryState(percentage=percentage)
        ros.spin_until(lambda: (publisher.publish(message), leaf.unusable_reason)[1], "the battery")
        assert leaf.update() is Status.SUCCESS
        clock.advance(31.0)
        assert leaf.update() is Status.FAILURE
        assert record.alarm.startswith("no message on 'battery_state' for 30 s (percentage is ")

    def test_battery_that_becomes_silent_is_low(
        self, collector: WarningCollector, record: MissionRecord
    ) -> None:
        clock = ManualClock(5.0)
        leaf = collector.to(BatterySuffices("Battery?", record=record), clock.now)
        leaf._receive(SimpleNamespace(percentage=0.9))
        assert leaf.update() is Status.SUCCESS
        clock.advance(31.0)
        assert leaf.update() is Status.FAILURE

    def test_failsafe_warning_is_repeated_only_after_recovery(self, collector: WarningCollector) -> None:
        leaf = collector.to(BatterySuffices("Battery?"))
        for share in (0.19, 0.18, 0.5, 0.17):
            leaf.on_message(SimpleNamespace(percentage=share))
        assert collector.warnings == [
            "Failsafe: the battery is at 19%, below 20%.",
            "Failsafe: the battery is at 17%, below 20%.",
        ]

    def test_zones_are_abandoned_with_reason_of_alarm(
        self, collector: WarningCollector, record: MissionRecord
    ) -> None:
        zones = ZoneManager(
            [{"id": name, "x": 0, "y": 0, "yaw": 0} for name in ("zone_a", "zone_b")], {"x": 0, "y": 0, "yaw": 0}
        )  # fmt: skip
        Search(zones, record)
        record.record_alarm("the battery is low")
        assert collector.to(AbandonZones("Abandon", zones, record=record)).update() is Status.SUCCESS
        assert not zones.has_remaining()
        assert record.shortfalls(zones)[0] == "zone_a and zone_b were abandoned: the battery is low."


@pytest.mark.ros
class TestFence:
    """`InsideFence` with a robot that publishes its position."""

    def test_robot_outside_geofence_is_reported_with_position(self, ros: Any, record: MissionRecord) -> None:
        from geometry_msgs.msg import PoseWithCovarianceStamped
        from rclpy.qos import DurabilityPolicy, QoSProfile

        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        robot = ros.node("robot").create_publisher(PoseWithCovarianceStamped, "amcl_pose", latched)
        leaf = geofence_condition(ros, record)
        assert leaf.update() is Status.SUCCESS

        def comes_to(status: Status, x: float) -> None:
            message = PoseWithCovarianceStamped()
            message.pose.pose.position.x, message.pose.pose.position.y = x, 1.0
            ros.spin_until(lambda: (robot.publish(message), leaf.update())[1] is status, f"{status} at {x}")

        comes_to(Status.FAILURE, 3.0)
        assert record.alarm == "the robot is at (3.00, 1.00), outside the geofence"
        comes_to(Status.SUCCESS, 1.0)
        comes_to(Status.FAILURE, float("nan"))
        assert record.alarm == "the last pose of the localisation is unusable: (nan, 1.0) is not a position"
        comes_to(Status.SUCCESS, 1.0)

    def test_odometry_updates_position_between_localisation_poses(
        self, ros: Any, record: MissionRecord
    ) -> None:
        from geometry_msgs.msg import TransformStamped
        from nav_msgs.msg import Odometry
        from tf2_msgs.msg import TFMessage

        node = ros.node("robot")
        transforms, odometry = (
            node.create_publisher(TFMessage, "/tf", 10),
            node.create_publisher(Odometry, "odometry/filtered", 10),
        )
        leaf = geofence_condition(ros, record)
        frame, measured = TransformStamped(child_frame_id="odom"), Odometry(child_frame_id="base_link")
        frame.header.frame_id, measured.header.frame_id = "map", "odom"
        frame.transform.translation.x, frame.transform.translation.y = 1.5, 1.0
        frame.transform.rotation.w = measured.pose.pose.orientation.w = 1.0
        measured.pose.pose.position.x = 0.6

        def is_told() -> bool:
            transforms.publish(TFMessage(transforms=[frame]))
            odometry.publish(measured)
            return leaf.update() is Status.FAILURE

        ros.spin_until(is_told, "the alarm")
        assert record.alarm == "the robot is at (2.10, 1.00), outside the geofence"


def geofence_condition(ros: Any, record: MissionRecord) -> InsideFence:
    """Return the condition for a geofence of 2 m by 2 m, set up on a node."""
    leaf = InsideFence("Inside?", Geofence([(0.0, 0.0), (2.0, 0.0), (2.0, 2.0), (0.0, 2.0)]), record=record)
    leaf.setup(node=ros.node("mission"))
    return leaf


@pytest.mark.ros
class TestOperatorCommands:
    """The command services of the mission's node."""

    @pytest.fixture
    def orders(self) -> OperatorCommands:
        return OperatorCommands()

    @pytest.fixture
    def zones(self) -> ZoneManager:
        return ZoneManager(
            [{"id": name, "x": 0, "y": 0, "yaw": 0} for name in ("zone_a", "zone_b")], {"x": 0, "y": 0, "yaw": 0}
        )  # fmt: skip

    @pytest.fixture
    def not_held(self, ros: Any, orders: OperatorCommands, zones: ZoneManager, record: MissionRecord) -> Any:
        fence = Geofence([(-9.0, -9.0), (9.0, -9.0), (9.0, 9.0), (-9.0, 9.0)])
        Search(zones, record, orders=orders)
        leaf = NotHeld("NotHeld?", orders, zones, fence=fence, record=record)
        leaf.setup(node=ros.node("mission"))
        yield leaf
        leaf.shutdown()

    def call(self, ros: Any, verb: str, **fields: Any) -> tuple[bool, str]:
        from sar_interfaces.srv import AddZone, JudgeSurvivor
        from std_srvs.srv import Trigger

        kind = {"add_zone": AddZone, "judge_survivor": JudgeSurvivor}.get(verb, Trigger)
        node = ros.node("operator")
        client = node.create_client(kind, f"/mission/{verb}")
        ros.spin_until(client.service_is_ready, f"the service {verb}")
        answer = client.call_async(kind.Request(**fields))
        ros.spin_until(answer.done, f"the answer of {verb}")
        ros.remove(node)
        response = answer.result()
        return response.success, response.message

    def test_pause_command_pauses_and_resume_command_resumes(self, ros: Any, not_held: NotHeld) -> None:
        assert not_held.update() is Status.SUCCESS
        assert self.call(ros, "pause") == (True, "done")
        assert [not_held.update(), not_held.update()] == [Status.FAILURE] * 2
        assert not_held.outcome_label == "held"
        assert self.call(ros, "resume") == (True, "done")
        assert not_held.update() is Status.SUCCESS

    def test_skipped_zone_is_abandoned_and_plan_is_reevaluated(
        self, ros: Any, not_held: NotHeld, zones: ZoneManager, record: MissionRecord
    ) -> None:
        assert self.call(ros, "skip_zone") == (True, "done")
        assert zones.current_zone()["id"] == "zone_b"
        assert "zone_a was abandoned: skipped by the operator." in record.shortfalls(zones)
        assert not_held.update() is Status.FAILURE
        assert not_held.outcome_label == "zone skipped"
        assert not_held.update() is Status.SUCCESS

    def test_skip_without_remaining_zone_is_refused(
        self, ros: Any, not_held: NotHeld, zones: ZoneManager
    ) -> None:
        zones.abandon()
        zones.abandon()
        assert self.call(ros, "skip_zone") == (False, "no zone is left")
        assert not_held.update() is Status.SUCCESS

    def place(self, x: float = 1.0, y: float = 2.0, frame: str = "map") -> Any:
        from geometry_msgs.msg import PoseStamped

        message = PoseStamped()
        message.header.frame_id = frame
        message.pose.position.x, message.pose.position.y = x, y
        message.pose.orientation.z = message.pose.orientation.w = 0.5**0.5
        return message

    def test_added_zone_comes_last(self, ros: Any, not_held: NotHeld, zones: ZoneManager) -> None:
        assert self.call(ros, "add_zone", zone_id="zone_e", pose=self.place()) == (True, "done")
        added = zones.remaining_zones()[-1]
        assert added == {"id": "zone_e", "x": 1.0, "y": 2.0, "yaw": pytest.approx(1.5708, abs=1e-3)}
        assert not_held.update() is Status.SUCCESS

    def test_zone_added_during_return_home_becomes_current_zone(
        self, ros: Any, not_held: NotHeld, zones: ZoneManager
    ) -> None:
        zones.select_next_zone()
        zones.select_next_zone()
        self.call(ros, "add_zone", zone_id="zone_e", pose=self.place())
        assert [not_held.update(), not_held.update()] == [Status.FAILURE, Status.SUCCESS]
        assert zones.current_zone()["id"] == "zone_e"

    @pytest.mark.parametrize(
        ("zone_id", "x", "frame", "said"),
        [
            ("zone_a", 1.0, "map", "zone 'zone_a' exists: choose another name"),
            ("", 1.0, "map", "the zone has no name"),
            ("zone_e", 1.0, "odom", "the pose is in the frame 'odom', but must be in 'map'"),
            ("zone_e", float("nan"), "map", "(nan, 2.0) is not a position"),
            ("zone_e", 20.0, "map", "(20.00, 2.00) is outside the geofence"),
        ],
    )
    def test_invalid_zone_is_refused(
        self, ros: Any, not_held: NotHeld, zones: ZoneManager, zone_id: str, x: float, frame: str, said: str
    ) -> None:
        assert self.call(ros, "add_zone", zone_id=zone_id, pose=self.place(x, frame=frame)) == (False, said)
        assert len(zones.remaining_zones()) == 2

    @pytest.mark.parametrize(
        ("make", "verb", "said"),
        [
            (NotAborted, "abort", "the mission was aborted by the operator"),
            (NotRecalled, "go_home", "the robot was called home by the operator"),
        ],
    )
    def test_abort_or_go_home_ends_pause(
        self, ros: Any, orders: OperatorCommands, record: MissionRecord, make: Any, verb: str, said: str
    ) -> None:
        leaf = make("Condition?", orders, record=record)
        leaf.setup(node=ros.node("mission"))
        orders.held = True
        assert leaf.update() is Status.SUCCESS
        assert self.call(ros, verb) == (True, said)
        assert leaf.update() is Status.FAILURE
        assert not orders.held
        assert record.alarm == said
        leaf.shutdown()


@pytest.mark.ros
class TestStandstill:
    """`AwaitStandstill` with a robot whose motion the test controls."""

    @pytest.fixture
    def robot(self, ros: Any, monkeypatch: pytest.MonkeyPatch) -> Robot:
        # Otherwise odometry becomes old while this process waits for a processor, and a robot without odometry counts as standing.
        monkeypatch.setattr("sar_compiler.ros.robot_estimate._FRESH_SEC", math.inf)
        return Robot(ros)

    @pytest.fixture
    def leaf(self, robot: Robot) -> AwaitStandstill:
        leaf = AwaitStandstill("Rest")
        leaf.setup(node=robot.node, wake=lambda: None)
        return leaf

    def test_wait_ends_when_odometry_reports_standstill(self, robot: Robot, leaf: AwaitStandstill) -> None:
        robot.speed = 0.25
        robot.ros.spin_until(lambda: robot.estimate.moves, "the movement")
        assert (tick_once(leaf), leaf.feedback_message) == (Status.RUNNING, "waiting for the robot to stop")
        robot.speed = 0.0
        robot.ros.spin_until(lambda: robot.estimate.is_standing, "its stop")
        assert (tick_once(leaf), leaf.feedback_message) == (Status.SUCCESS, "")

    def test_wait_ends_at_settle_timeout_with_warning(
        self, robot: Robot, leaf: AwaitStandstill, said: Said
    ) -> None:
        clock = keep_driving(robot, limit_sec=0.2)
        assert tick_once(leaf) is Status.RUNNING
        clock.advance(0.2)
        assert tick_once(leaf) is Status.SUCCESS
        assert said.has(
            "'Rest': the robot still moves (0.25 m/s, 0.00 rad/s) 0.2 s after the command to stop."
        )

    def test_settle_timeout_within_tick_is_reported(
        self, robot: Robot, leaf: AwaitStandstill, said: Said
    ) -> None:
        keep_driving(robot, limit_sec=0.2)
        robot.estimate.clock = SimpleNamespace(now=partial(next, count(0.0, 0.15)))
        robot.ros.spin_until(lambda: tick_once(leaf) is Status.SUCCESS, "the end of its patience")
        assert said.has("'Rest': the robot still moves")

    def test_moving_robot_is_reported_once_at_any_speed(
        self, robot: Robot, leaf: AwaitStandstill, said: Said
    ) -> None:
        from sar_compiler.ros.robot_estimate import Standstill

        clock = keep_driving(robot, limit_sec=0.2)
        rest = Standstill(leaf, lambda: None, "the end of its goal")
        assert rest.is_awaited()
        clock.advance(0.2)
        assert not rest.is_awaited()
        robot.speed = 0.5
        robot.ros.spin_until(lambda: robot.estimate.speed[0] == 0.5, "another speed")
        assert not rest.is_awaited()
        leaf.warn("the end")
        robot.ros.spin_until(lambda: said.has("the end"), "the last line")
        assert len([line for line in said.lines() if "still moves" in line]) == 1

    def test_interrupted_wait_requests_no_tick(self, robot: Robot) -> None:
        ticks: list[None] = []
        leaf = AwaitStandstill("Rest")
        leaf.setup(node=robot.node, wake=lambda: ticks.append(None))
        leaf.stop(Status.INVALID)
        robot.speed = 0.25
        robot.ros.spin_until(lambda: robot.estimate.moves, "the movement")
        assert tick_once(leaf) is Status.RUNNING
        leaf.stop(Status.INVALID)
        others: list[None] = []
        robot.estimate.call_at_standstill(lambda: others.append(None))
        robot.speed = 0.0
        robot.ros.spin_until(lambda: others, "its stop")
        assert ticks == []

    def test_standing_robot_is_awaited_while_goal_may_be_active(
        self, robot: Robot, leaf: AwaitStandstill
    ) -> None:
        goal = robot.drive()
        assert robot.estimate.is_standing
        assert tick_once(leaf) is Status.RUNNING
        robot.end(goal)
        assert tick_once(leaf) is Status.SUCCESS

    def test_wait_without_odometry_ends_with_goals(
        self, robot: Robot, leaf: AwaitStandstill, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr("sar_compiler.ros.robot_estimate._FRESH_SEC", 0.0)
        robot.speed = None
        robot.ros.spin_until(lambda: robot.estimate.moves is None, "the silence")
        goal = robot.drive()
        assert tick_once(leaf) is Status.RUNNING
        robot.end(goal)
        assert tick_once(leaf) is Status.SUCCESS


def keep_driving(robot: Robot, limit_sec: float) -> ManualClock:
    """Let the robot move; return the clock for its settle timeout."""
    robot.estimate.clock = clock = ManualClock()
    robot.speed, robot.estimate.settle_timeout_sec = 0.25, limit_sec
    robot.ros.spin_until(lambda: robot.estimate.moves, "the movement")
    return clock


def tick_once(leaf: AwaitStandstill) -> Status:
    leaf.tick_once()
    return leaf.status


@pytest.mark.ros
def test_base_is_lost_after_being_away_longer_than_patience(ros: Any, record: MissionRecord) -> None:
    from sar_interfaces.srv import ReportSurvivor

    base, clock = ros.node("base"), ManualClock()
    base.create_service(ReportSurvivor, "report_survivor", lambda _, response: response)
    leaf = BaseInReach("Base?", clock, record=record, patience=60.0)
    node = ros.node("mission")
    leaf.setup(node=node)
    ros.spin_until(lambda: node.count_services("/report_survivor") == 1, "base")
    clock.advance(100.0)
    assert leaf.update() is Status.SUCCESS
    clock.advance(100.0)
    ros.spin_until(lambda: leaf.update() is Status.SUCCESS, "base in reach")
    ros.remove(base)
    ros.spin_until(lambda: node.count_services("/report_survivor") == 0, "base gone")
    assert leaf.update() is Status.SUCCESS
    clock.advance(61.0)
    assert leaf.update() is Status.FAILURE
    assert record.alarm == "the base station ('report_survivor') has been unreachable for 61 s"
    leaf.shutdown()


@pytest.mark.ros
def test_operator_pauses_skips_and_calls_home_running_mission(start: Any, ros: Any) -> None:
    from std_srvs.srv import Trigger

    run = start(
        "sar-run", "search_and_rescue_guarded", "--sim", "--speed", 5, "--ros-args", "-p",
        "zone_order:=[zone_b, zone_c, zone_d]",
    )  # fmt: skip
    operator = ros.node("operator")

    def order(verb: str) -> None:
        client = operator.create_client(Trigger, f"/search_and_rescue/{verb}")
        ros.spin_until(client.service_is_ready, f"the service {verb}")
        answer = client.call_async(Trigger.Request())
        ros.spin_until(answer.done, f"the answer of {verb}")
        assert answer.result().success, answer.result().message

    run.wait_for("Navigating to zone_b...")
    order("pause")
    run.wait_for("Canceling the goal of 'NavigateToZone'.")
    order("resume")
    ros.spin_until(lambda: run.log.count("Navigating to zone_b...") == 2, "the second drive to zone_b")
    order("skip_zone")
    run.wait_for("Navigating to zone_c...")
    order("go_home")
    assert run.end() == 1, run.output
    told = [
        "Command pause by a service call.",
        "Canceling the goal of 'NavigateToZone'.",
        "Command resume by a service call.",
        "Command skip_zone by a service call.",
        "Navigating to zone_c...",
        "Failsafe: the robot was called home by a service call.",
        "zone_d is abandoned: the robot was called home by a service call.",
        "Reached base station.",
    ]
    assert in_order(told, run.log) is None, run.output
    assert "missing:         zone_b was abandoned: skipped by a service call." in run.output
    assert "  back at base:    yes" in run.output


@pytest.mark.ros
def test_robot_that_leaves_geofence_is_stopped(start: Any) -> None:
    run = start(
        "sar-run", "search_and_rescue_guarded", "--sim", "--speed", 10, "--ros-args", "-p",
        "zone_order:=[zone_b]", "-p", "geofence:=[-1.0, -1.0, 1.0, -1.0, 1.0, 1.0, -1.0, 1.0]",
    )  # fmt: skip
    assert run.end() == 1, run.output
    assert ", outside the geofence." in run.output
    assert "Navigating to base station..." not in run.log
    assert "  back at base:    no" in run.output
