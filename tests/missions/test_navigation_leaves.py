"""Tests of NavigateToZone and NavigateToBase with a scripted action server."""

import gc
import math
import weakref
from typing import TYPE_CHECKING, Any

import pytest
from py_trees.common import Status

from sar_compiler.nodes.spec import Use
from sar_compiler.ros.clock import Deadline
from sar_compiler.ros.robot_estimate import robot_estimate
from sar_compiler.runtime.clock import ManualClock
from search_and_rescue import SPECS
from search_and_rescue.actions.navigation import NavigateToBase, NavigateToZone
from search_and_rescue.failsafes import NavigationAvailable

if TYPE_CHECKING:
    from collections.abc import Callable

    from tests.missions.mission_stage import NavServer, Stage

pytestmark = pytest.mark.ros


def drive(stage: "Stage", **options: Any) -> NavigateToZone:
    return stage.take(NavigateToZone("NavigateToZone", stage.zones, record=stage.record, **options))


def drive_home(stage: "Stage", **options: Any) -> NavigateToBase:
    return stage.take(NavigateToBase("NavigateToBase", stage.zones, record=stage.record, **options))


def tick_until_accepted(
    stage: "Stage", leaf: NavigateToZone | NavigateToBase, server: "NavServer", goals: int = 1
) -> None:
    """Tick until the leaf knows that the server has accepted its goal."""
    wakes = stage.wakes
    stage.tick_until(
        leaf, lambda: stage.wakes > wakes and len(server.goals) == goals, f"acceptance of goal {goals}"
    )
    assert leaf.status is Status.RUNNING


def pending_results(leaf: NavigateToZone) -> int:
    assert leaf._port is not None
    return len(leaf._port.prober._pending_requests)


def visit_every_zone(stage: "Stage") -> None:
    while stage.zones.has_remaining():
        stage.zones.select_next_zone()


@pytest.mark.parametrize(
    "spec", [spec for spec in SPECS if spec.tag.startswith("Navigate")], ids=lambda spec: spec.tag
)
def test_every_navigation_leaf_uses_nav2(spec: Any) -> None:
    assert Use.nav2() in spec.uses


class TestGoal:
    def test_current_zone_is_sent_in_map_frame_with_yaw_as_quaternion(self, stage: "Stage") -> None:
        server = stage.nav_server()
        leaf = drive(stage)
        tick_until_accepted(stage, leaf, server)
        half = 1.57 / 2
        assert server.goals[0].pose == pytest.approx(("map", -3.0, 3.0, math.sin(half), math.cos(half)))
        assert server.goals[0].goal.behavior_tree == ""

    def test_home_goal_is_base_station(self, stage: "Stage") -> None:
        server = stage.nav_server()
        tick_until_accepted(stage, drive_home(stage), server)
        half = 3.14 / 2
        assert server.goals[0].pose == pytest.approx(("map", 0.5, -0.25, math.sin(half), math.cos(half)))

    def test_activation_sends_one_goal(self, stage: "Stage") -> None:
        server = stage.nav_server()
        server.script = ["feedback"]
        leaf = drive(stage)
        stage.tick_until(leaf, lambda: "2.50 m" in leaf.feedback_message, "feedback")
        for _ in range(20):
            leaf.tick_once()
        server.order("succeed")
        assert stage.run(leaf) is Status.SUCCESS
        assert server.requests == 1

    def test_initialise_sends_goal_to_available_server(self, stage: "Stage") -> None:
        server = stage.nav_server()
        leaf = drive(stage)
        stage.until(lambda: leaf._port is not None and leaf._port.server_is_ready, "the server")
        leaf.initialise()
        stage.until(lambda: server.goals, "the goal")

    def test_action_name_is_configurable(self, stage: "Stage") -> None:
        server = stage.nav_server("drive/there")
        server.script = ["succeed"]
        assert stage.run(drive(stage, action="drive/there")) is Status.SUCCESS

    def test_reentered_leaf_sends_next_goal(self, stage: "Stage") -> None:
        server = stage.nav_server()
        server.script = ["succeed"]
        leaf = drive(stage)
        assert stage.run(leaf) is Status.SUCCESS
        stage.zones.select_next_zone()
        assert stage.run(leaf) is Status.SUCCESS
        assert [goal.pose[1] for goal in server.goals] == [-3.0, 3.5]

    def test_leaf_without_zone_fails(self, stage: "Stage") -> None:
        leaf = drive(stage)
        visit_every_zone(stage)
        assert stage.run(leaf) is Status.FAILURE
        assert "has no target" in stage.warnings[0]
        assert leaf.is_settled()


def test_remaining_distance_is_recorded_in_journal(stage: "Stage") -> None:
    entries: list[Any] = []
    stage.record.journal.add_listener(entries.append)
    server = stage.nav_server()
    server.script = ["feedback"]
    leaf = drive(stage)
    stage.tick_until(leaf, lambda: "2.50 m" in leaf.feedback_message, "feedback")
    reported = [entry.data for entry in entries if entry.kind == "progress"]
    assert reported == [{"target": "zone_a", "distance": 2.5, "time_left": 0.0}]


class TestLog:
    def test_start_drive_and_arrival_at_zone_are_logged(self, stage: "Stage") -> None:
        stage.nav_server().script = ["feedback", "succeed"]
        leaf = drive(stage)
        stage.until(lambda: leaf._port is not None and leaf._port.server_is_ready, "the server")
        stage.run(leaf)
        assert stage.lines == [
            "--- Zone 1/2: zone_a (-3.00, 3.00) ---",
            "Navigating to zone_a...",
            "Reached zone_a.",
        ]

    def test_retried_zone_is_announced_once(self, stage: "Stage") -> None:
        stage.nav_server().script = ["abort"]
        leaf = drive(stage)
        stage.run(leaf)
        stage.run(leaf)
        assert sum("Zone 1/2" in line for line in stage.lines) == 1
        assert stage.lines.count("Navigating to zone_a...") == 2

    def test_return_after_all_zones_completes_mission_once(self, stage: "Stage") -> None:
        stage.nav_server().script = ["succeed"]
        leaf = drive_home(stage)
        stage.until(lambda: leaf._port is not None and leaf._port.server_is_ready, "the server")
        visit_every_zone(stage)
        assert stage.run(leaf) is Status.SUCCESS
        assert stage.lines == [
            "All zones visited. Returning to base.",
            "Navigating to base station...",
            "Reached base station.",
            "Mission complete.",
        ]
        stage.run(leaf)
        assert stage.lines.count("Mission complete.") == 1
        assert stage.lines.count("Reached base station.") == 2

    def test_return_with_abandoned_zone_leaves_mission_incomplete(self, stage: "Stage") -> None:
        stage.nav_server().script = ["succeed"]
        stage.zones.abandon()
        visit_every_zone(stage)
        assert stage.run(drive_home(stage)) is Status.SUCCESS
        assert "No zone is left. Abandoned zones: zone_a. Returning to base." in stage.lines
        assert stage.lines[-1] == (
            "Back at base with the mission incomplete: zone_a was abandoned after attempt 1."
        )

    def test_return_logs_unacknowledged_survivor_once_and_completion_later(self, stage: "Stage") -> None:
        stage.nav_server().script = ["succeed"]
        stage.record.zone_searched("zone_a", (1.0, 2.0))
        stage.record.survivor_named("survivor_1", 1.0, 2.0)
        visit_every_zone(stage)
        leaf = drive_home(stage)
        incomplete = (
            "Back at base with the mission incomplete: "
            "The base station did not acknowledge survivor_1 in zone_a at (1.00, 2.00)."
        )
        assert stage.run(leaf) is Status.SUCCESS
        assert stage.lines[-1] == incomplete
        stage.run(leaf)
        assert stage.lines.count(incomplete) == 1
        stage.record.record_acknowledgement("survivor_1")
        stage.run(leaf)
        assert stage.lines[-1] == "Mission complete."

    def test_return_with_remaining_zones_does_not_claim_completion(self, stage: "Stage") -> None:
        stage.nav_server().script = ["succeed"]
        assert stage.run(drive_home(stage)) is Status.SUCCESS
        assert "All zones visited. Returning to base." not in stage.lines
        assert "Mission complete." not in stage.lines
        assert "zone_a and zone_b were not visited." in stage.lines[-1]
        assert stage.record.home


class Odometry:
    """The odometry of the stage's robot."""

    def __init__(self, stage: "Stage") -> None:
        from nav_msgs.msg import Odometry as Message

        self.speed = 0.3
        self._message = Message()
        node = stage.host().node
        self._publisher = node.create_publisher(Message, "odometry/filtered", 10)
        node.create_timer(0.02, self._publish)

    def _publish(self) -> None:
        self._message.twist.twist.linear.x = self.speed
        self._publisher.publish(self._message)


class TestStandstill:
    @pytest.mark.parametrize(("order", "end"), [("succeed", Status.SUCCESS), ("abort", Status.FAILURE)])
    def test_ended_goal_waits_until_robot_stands(self, stage: "Stage", order: str, end: Status) -> None:
        server, odometry = stage.nav_server(), Odometry(stage)
        leaf = drive(stage)
        tick_until_accepted(stage, leaf, server)
        robot = leaf._robot
        assert robot is not None
        stage.until(lambda: robot.moves, "the movement")
        robot.settle_timeout_sec = 60.0
        server.order(order)
        stage.tick_until(leaf, lambda: leaf.feedback_message.startswith("waiting for the robot"), "the wait")
        assert leaf.status is Status.RUNNING
        wakes, odometry.speed = stage.wakes, 0.0
        stage.until(lambda: stage.wakes > wakes, "the wake")
        assert stage.run(leaf) is end

    def test_wait_for_standstill_is_limited(self, stage: "Stage", monkeypatch: pytest.MonkeyPatch) -> None:
        # On a loaded machine the odometry may arrive late.
        monkeypatch.setattr("sar_compiler.ros.robot_estimate._FRESH_SEC", 60.0)
        server, _ = stage.nav_server(), Odometry(stage)
        leaf = drive(stage)
        tick_until_accepted(stage, leaf, server)
        robot = leaf._robot
        assert robot is not None
        stage.until(lambda: robot.moves, "the movement")
        robot.settle_timeout_sec = 0.3
        server.order("succeed")
        assert stage.run(leaf) is Status.SUCCESS
        assert (
            "the robot still moves (0.30 m/s, 0.00 rad/s) 0.3 s after the end of its goal"
            in stage.warnings[0]
        )


class TestRecord:
    def test_drive_to_zone_ends_being_home(self, stage: "Stage") -> None:
        stage.record.base_reached()
        drive(stage).tick_once()
        assert not stage.record.home

    def test_failed_return_is_not_home(self, stage: "Stage") -> None:
        stage.nav_server().script = ["abort"]
        assert stage.run(drive_home(stage)) is Status.FAILURE
        assert not stage.record.home


class TestFailure:
    def test_rejected_goal_fails(self, stage: "Stage") -> None:
        stage.nav_server().accept = False
        leaf = drive(stage)
        assert stage.run(leaf) is Status.FAILURE
        assert "zone_a" in stage.warnings[0]
        assert "rejected" in stage.warnings[0]
        assert leaf.is_settled()

    def test_aborted_goal_is_explained(self, stage: "Stage") -> None:
        server = stage.nav_server()
        server.script = ["abort"]
        server.error_code = 206
        assert stage.run(drive(stage)) is Status.FAILURE
        assert stage.warnings == [
            "Navigation to zone_a failed: aborted (status 6), error code 206: the goal is in an obstacle"
        ]

    def test_server_message_is_escaped_and_shortened_in_log(self, stage: "Stage") -> None:
        leaf = drive(stage)
        message = "\x1b[2Jno\n[INFO] [0.0] [search_and_rescue]: Reached zone_b." + "!" * 10_000
        leaf.on_result(6, leaf.interface.Result(error_code=100, error_msg=message))
        (reported,) = stage.warnings
        assert "error code 100: \\x1b[2Jno\\n[INFO] [0.0]" in reported
        assert "\n" not in reported
        assert len(reported) < 500

    def test_goal_in_obstacle_is_resent_after_a_minute(self, stage: "Stage") -> None:
        server = stage.nav_server()
        server.script, server.error_code = ["abort"], 206
        leaf = drive(stage)
        clock = leaf._clock = ManualClock()
        stage.run(leaf)
        clock.advance(59.0)
        assert stage.run(leaf) is Status.FAILURE
        assert server.requests == 1
        clock.advance(2.0)
        stage.run(leaf)
        assert server.requests == 2

    def test_goal_outside_map_is_never_resent(self, stage: "Stage") -> None:
        server = stage.nav_server()
        server.script, server.error_code = ["abort"], 204
        leaf = drive(stage)
        clock = leaf._clock = ManualClock()
        stage.run(leaf)
        clock.advance(1e6)
        assert stage.run(leaf) is Status.FAILURE
        assert "the goal is outside the map; the goal is not sent again" in stage.warnings[0]
        assert server.requests == 1
        stage.zones.select_next_zone()
        server.script = ["succeed"]
        assert stage.run(leaf) is Status.SUCCESS

    def test_goal_canceled_by_another_client_fails(self, stage: "Stage") -> None:
        from action_msgs.srv import CancelGoal

        server = stage.nav_server()
        leaf = drive(stage)
        tick_until_accepted(stage, leaf, server)
        other = stage.node.create_client(CancelGoal, "navigate_to_pose/_action/cancel_goal")
        stage.until(other.service_is_ready, "the cancel service")
        other.call_async(CancelGoal.Request())
        assert stage.run(leaf) is Status.FAILURE
        assert "canceled by another client (status 5)" in stage.warnings[0]

    def test_missing_server_fails_after_deadline(self, stage: "Stage") -> None:
        leaf = drive(stage, server_timeout_sec=0.05, hold_timeout_sec=0.0)
        leaf.tick_once()
        assert leaf.status is Status.RUNNING
        assert "Waiting for the action server navigate_to_pose..." in stage.lines
        assert stage.run(leaf) is Status.FAILURE
        assert "no server for the action 'navigate_to_pose' within 0.05 s" in stage.warnings[0]

    def test_result_stays_until_next_activation(self, stage: "Stage") -> None:
        server = stage.nav_server()
        server.script = ["succeed"]
        leaf = drive(stage)
        stage.run(leaf)
        assert leaf.update() is Status.SUCCESS
        leaf.terminate(Status.INVALID)
        assert leaf.update() is Status.SUCCESS
        assert server.cancels == 0
        assert stage.lines.count("Reached zone_a.") == 1

    def test_late_server_receives_goal(self, stage: "Stage") -> None:
        leaf = drive(stage)
        leaf.tick_once()
        assert leaf.status is Status.RUNNING
        stage.nav_server().script = ["succeed"]
        assert stage.run(leaf) is Status.SUCCESS

    def test_unanswered_goal_fails_and_is_canceled_if_accepted_later(self, stage: "Stage") -> None:
        server = stage.nav_server()
        acceptance = server.hold()
        leaf = drive(stage, acceptance_timeout_sec=0.05, hold_timeout_sec=0.0)
        assert stage.run(leaf) is Status.FAILURE
        assert "no response to the goal within 0.05 s" in stage.warnings[0]
        assert not leaf.is_settled()
        acceptance.set()
        stage.until(
            lambda: server.goals and server.goals[0].final, "the end of the goal that was accepted later"
        )
        assert server.goals[0].final == "canceled"
        stage.until(leaf.is_settled, "calm")

    def test_goal_of_silent_server_fails_and_is_canceled(self, stage: "Stage") -> None:
        server = stage.nav_server()
        server.script = ["feedback"]
        leaf = drive(stage, feedback_timeout_sec=0.1, hold_timeout_sec=0.0)
        assert stage.run(leaf) is Status.FAILURE
        assert "no feedback for 0.1 s" in stage.warnings[0]
        stage.until(lambda: server.goals[0].final == "canceled", "the cancel")

    def test_server_that_never_sends_feedback_is_not_silent(self, stage: "Stage") -> None:
        server = stage.nav_server()
        leaf = drive(stage, feedback_timeout_sec=0.0)
        tick_until_accepted(stage, leaf, server)
        server.order("succeed")
        assert stage.run(leaf) is Status.SUCCESS

    def test_goal_of_vanished_server_fails(self, stage: "Stage") -> None:
        host = stage.host()
        server = stage.nav_server_on(host)
        leaf = drive(stage, hold_timeout_sec=0.0)
        tick_until_accepted(stage, leaf, server)
        host.close()
        assert stage.run(leaf) is Status.FAILURE
        assert "missing for 0.5 s. The robot may still be moving" in stage.warnings[0]
        assert leaf.is_settled(), "nobody is there to answer the cancel"

    def test_goal_fails_if_server_is_replaced_before_first_feedback(self, stage: "Stage") -> None:
        host = stage.host()
        leaf = drive(stage, feedback_timeout_sec=0.2)
        tick_until_accepted(stage, leaf, stage.nav_server_on(host))
        host.close()
        stage.nav_server()
        stage.until(lambda: leaf._port is not None and leaf._port.server_is_ready, "the new server")
        assert stage.run(leaf) is Status.FAILURE
        assert "unknown to the server (was it restarted?) (status 0)" in stage.warnings[0]

    def test_goal_fails_if_restarted_server_does_not_know_it(self, stage: "Stage") -> None:
        host = stage.host()
        leaf = drive(stage)
        leaf.absence_timeout_sec = 60.0
        tick_until_accepted(stage, leaf, stage.nav_server_on(host))
        host.close()
        stage.tick_until(leaf, lambda: not leaf._port.server_is_ready, "the server's absence")  # type: ignore[union-attr]
        stage.nav_server()
        assert stage.run(leaf) is Status.FAILURE
        assert "unknown to the server (was it restarted?) (status 0)" in stage.warnings[0]


class Lifecycle:
    """A lifecycle node of Nav2 whose state the test sets."""

    def __init__(self, stage: "Stage", name: str, state: str) -> None:
        from lifecycle_msgs.srv import GetState

        self.state = state
        stage.host().node.create_service(GetState, f"{name}/get_state", self._answer)

    def _answer(self, _: Any, response: Any) -> Any:
        response.current_state.label = self.state
        return response


class TestNavigationUnavailable:
    """A drive that fails because Nav2 is unavailable is no failed attempt on the zone."""

    def test_absent_server_is_waited_for_and_recorded(self, stage: "Stage") -> None:
        leaf = drive(stage, server_timeout_sec=0.05)
        stage.tick_until(leaf, lambda: stage.record.navigation_lost, "the wait")
        assert leaf.status is Status.RUNNING
        assert "waits to send its goal again: no server for the action" in stage.warnings[0]
        stage.nav_server().script = ["succeed"]
        assert stage.run(leaf) is Status.SUCCESS
        assert stage.record.navigation_lost == ""

    def test_goal_is_resent_when_crashed_server_returns(self, stage: "Stage") -> None:
        host, leaf = stage.host(), drive(stage)
        tick_until_accepted(stage, leaf, stage.nav_server_on(host))
        host.close()
        stage.tick_until(leaf, lambda: stage.record.navigation_lost, "the wait")
        stage.nav_server().script = ["succeed"]
        assert stage.run(leaf) is Status.SUCCESS
        assert not any("failed" in line or "unavailable" in line for line in stage.warnings)

    def test_navigation_is_unavailable_until_next_result_of_nav2(self, stage: "Stage") -> None:
        leaf = drive(stage, server_timeout_sec=0.05, hold_timeout_sec=0.1)
        available = stage.take(NavigationAvailable("NavigationAvailable?", record=stage.record))
        assert stage.run(available) is Status.SUCCESS
        assert stage.run(leaf) is Status.FAILURE
        assert "Navigation to zone_a is unavailable: no server for the action" in stage.warnings[-1]
        assert stage.run(available) is Status.FAILURE
        assert stage.record.alarm.startswith("navigation is unavailable (no server for the action")
        stage.nav_server().script = ["abort"]
        assert stage.run(leaf) is Status.FAILURE
        assert stage.run(available) is Status.SUCCESS

    def test_navigation_stays_unavailable_after_halt_of_waiting_drive(self, stage: "Stage") -> None:
        leaf = drive(stage, server_timeout_sec=0.05)
        stage.tick_until(leaf, lambda: stage.record.navigation_lost, "the wait")
        leaf.stop(Status.INVALID)
        available = stage.take(NavigationAvailable("NavigationAvailable?", record=stage.record))
        assert stage.run(available) is Status.FAILURE

    @pytest.mark.parametrize("name", ["controller_server", "planner_server", "behavior_server", "amcl"])
    @pytest.mark.parametrize("code", [0, 208])
    def test_abort_with_inactive_nav2_node_is_waited_for(self, stage: "Stage", name: str, code: int) -> None:
        server, node = stage.nav_server(), Lifecycle(stage, name, "inactive")
        server.error_code = code
        leaf = drive(stage)
        tick_until_accepted(stage, leaf, server)
        stage.until(lambda: robot_estimate(leaf.node).lifecycle(name).is_there, "the node")
        server.order("abort")
        stage.tick_until(leaf, lambda: stage.record.navigation_lost, "the wait")
        assert f"{name}/get_state" not in stage.record.navigation_lost
        assert f"node {name}" in stage.record.navigation_lost
        server.script = ["succeed"]
        node.state = "active"
        assert stage.run(leaf) is Status.SUCCESS

    def test_nodes_in_same_state_share_one_line(self, stage: "Stage") -> None:
        server, leaf = stage.nav_server(), drive(stage)
        names = ("amcl", "planner_server", "controller_server")
        for name in names:
            Lifecycle(stage, name, "unconfigured")
        tick_until_accepted(stage, leaf, server)
        robot = robot_estimate(leaf.node)
        stage.until(lambda: all(robot.lifecycle(name).is_there for name in names), "the nodes")
        server.order("abort")
        stage.tick_until(leaf, lambda: stage.record.navigation_lost, "the wait")
        assert (
            stage.record.navigation_lost
            == f"nodes {', '.join(names)}: state 'unconfigured', must be 'active'"
        )

    def test_abort_after_loss_of_transforms_is_waited_for(
        self, stage: "Stage", monkeypatch: pytest.MonkeyPatch
    ) -> None:
        from geometry_msgs.msg import TransformStamped
        from tf2_msgs.msg import TFMessage

        from sar_compiler.ros import robot_estimate as estimate

        monkeypatch.setattr(estimate, "TRANSFORM_SEC", 0.3)
        server, leaf = stage.nav_server(), drive(stage)
        frame, publisher = TransformStamped(), stage.host().node.create_publisher(TFMessage, "/tf", 10)
        frame.header.frame_id, frame.child_frame_id = "map", "odom"
        tick_until_accepted(stage, leaf, server)
        robot = leaf._robot
        assert robot is not None

        def has_transform() -> bool:
            publisher.publish(TFMessage(transforms=[frame]))
            return robot.transform_at is not None

        stage.until(has_transform, "a transform")
        stage.until(robot.lost_transforms, "their end")
        server.order("abort")
        stage.tick_until(leaf, lambda: stage.record.navigation_lost, "the wait")
        assert "No transform from 'map' has arrived for 0.3 s" in stage.record.navigation_lost


def server_without_error_code(stage: "Stage") -> "NavServer":
    """Return a Nav2 server that aborts each goal without an error code."""
    server = stage.nav_server()
    server.script, server.error_code = ["abort"], 0
    return server


def has_warning(stage: "Stage", text: str) -> "Callable[[], bool]":
    return lambda: any(text in line for line in stage.warnings)


class TestAbortsWithoutErrorCode:
    """Nav2 aborts a goal without a code if its own nodes fail. This does not mean that the zone is unreachable."""

    @pytest.mark.parametrize("leaf_of", [drive, drive_home])
    def test_goal_is_resent_after_doubling_pauses_and_drive_holds_after_third(
        self, stage: "Stage", leaf_of: "Callable[[Stage], NavigateToZone]"
    ) -> None:
        server, leaf = server_without_error_code(stage), leaf_of(stage)
        pauses: list[int] = []
        while len(pauses) < 6:
            stage.tick_until(leaf, lambda: leaf._lost_count > len(pauses), f"end {len(pauses) + 1}")
            assert leaf._pause is not None
            pauses.append(math.ceil(leaf._pause.remaining_sec))
            leaf._pause = None  # do not wait for its end
        assert pauses == [1, 2, 4, 8, 8, 8]
        assert leaf.outcome_label == "waiting for Nav2"
        assert [line.rpartition("). ")[2] for line in stage.warnings] == [
            "The goal is sent again in 1 s.",
            "The goal is sent again in 2 s.",
            "The goal is sent again after growing pauses.",
        ]
        assert " holds: Nav2 has aborted 3 goals in a row without an error code (" in stage.warnings[-1]
        server.script = ["succeed"]
        assert stage.run(leaf) is Status.SUCCESS
        assert stage.record.navigation_lost == ""

    def test_navigation_is_unavailable_after_hold_timeout(self, stage: "Stage") -> None:
        server_without_error_code(stage)
        leaf = drive(stage, hold_timeout_sec=0.3)
        leaf.pause_sec = 0.001
        available = stage.take(NavigationAvailable("NavigationAvailable?", record=stage.record))
        assert stage.run(leaf) is Status.FAILURE
        assert leaf.outcome_label == "unavailable"
        assert (
            "goals in a row without an error code (no Nav2 node has logged a reason), for 0.3 s"
            in stage.warnings[-1]
        )
        assert stage.run(available) is Status.FAILURE

    def test_hold_timeout_can_expire_during_pause(self, stage: "Stage") -> None:
        server = server_without_error_code(stage)
        leaf = drive(stage, hold_timeout_sec=0.1)
        leaf.pause_sec = 0.01
        stage.tick_until(leaf, has_warning(stage, "holds"), "the hold")
        leaf._pause = Deadline(3600.0, leaf._clock)
        assert stage.run(leaf) is Status.FAILURE
        assert (leaf.outcome_label, len(server.goals)) == ("unavailable", 3)

    def test_next_activation_continues_count_with_new_hold_timeout(self, stage: "Stage") -> None:
        server = server_without_error_code(stage)
        leaf = drive(stage, hold_timeout_sec=0.1)
        leaf.pause_sec = 0.01
        stage.run(leaf)
        before, leaf.hold_timeout_sec = len(server.goals), 60.0
        stage.tick_until(leaf, lambda: len(server.goals) == before + 2, "the next goals")
        assert leaf._lost_count == before + 1
        assert leaf.status is Status.RUNNING

    def test_abort_with_error_code_resets_count(self, stage: "Stage") -> None:
        server, leaf = server_without_error_code(stage), drive(stage)
        leaf.pause_sec = 0.01
        stage.tick_until(leaf, has_warning(stage, "holds"), "the hold")
        server.error_code = 208
        assert stage.run(leaf) is Status.FAILURE
        assert (leaf.outcome_label, stage.record.navigation_lost) == ("aborted", "")
        server.error_code = 0
        stage.tick_until(leaf, has_warning(stage, "aborted the goal without an error code"), "a new row")

    def test_progress_of_half_a_metre_resets_count(self, stage: "Stage") -> None:
        from geometry_msgs.msg import PoseWithCovarianceStamped
        from rclpy.qos import DurabilityPolicy, QoSProfile

        server, leaf = server_without_error_code(stage), drive(stage)
        leaf.pause_sec = 0.01
        pose = PoseWithCovarianceStamped()
        pose.header.frame_id, pose.pose.pose.orientation.w = "map", 1.0
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        publisher = stage.host().node.create_publisher(PoseWithCovarianceStamped, "amcl_pose", latched)

        def move_to(x: float) -> None:
            pose.pose.pose.position.x = x
            robot = robot_estimate(stage.node)

            def is_there() -> bool:
                publisher.publish(pose)
                leaf.tick_once()
                return robot.pose is not None and robot.pose.x == x

            stage.until(is_there, f"the pose {x}")

        stage.tick_until(leaf, has_warning(stage, "holds"), "the hold")
        server.script = []
        goals = len(server.goals)
        stage.tick_until(leaf, lambda: len(server.goals) > goals, "a goal under way")
        move_to(0.0)
        move_to(0.4)
        assert stage.record.navigation_lost
        move_to(0.5)
        stage.tick_until(leaf, lambda: not stage.record.navigation_lost, "the end of the row")
        assert leaf.outcome_label == "driving"


class TestNav2Reason:
    def test_nav2_log_line_is_quoted_on_abort(self, stage: "Stage") -> None:
        from rcl_interfaces.msg import Log
        from rclpy.qos import DurabilityPolicy, QoSProfile

        from sar_compiler.ros.nav2_log import nav2_log

        server, leaf = stage.nav_server(), drive(stage)
        latched = QoSProfile(depth=10, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        rosout = stage.host().node.create_publisher(Log, "/rosout", latched)
        prefix = stage.namespace.strip("/")
        tick_until_accepted(stage, leaf, server)

        def publish_log() -> str:
            for name, text in (
                ("bt_navigator", "Goal failed"),
                ("bt_navigator", "Initial robot pose is not available."),
                ("rviz", "is no part of it"),
            ):
                rosout.publish(Log(level=Log.ERROR, name=f"{prefix}.{name}", msg=text))
            return nav2_log(stage.node).quote()

        stage.until(publish_log, "the line")
        server.order("abort")
        assert stage.run(leaf) is Status.FAILURE
        assert (
            'error code 105: the robot makes no progress (bt_navigator: "Initial robot pose is not available.")'
            in stage.warnings[0]
        )


class TestHalt:
    def test_active_goal_is_canceled(self, stage: "Stage") -> None:
        server = stage.nav_server()
        leaf = drive(stage)
        tick_until_accepted(stage, leaf, server)
        leaf.stop(Status.INVALID)
        assert not leaf.is_settled()
        stage.until(leaf.is_settled, "the answer to the cancel")
        stage.until(lambda: server.goals[0].final == "canceled", "the end of the goal")
        assert stage.warnings == []
        assert server.cancels == 1

    @pytest.mark.parametrize("accept_after", [0.0, 0.05, 0.3])
    def test_unaccepted_goal_is_canceled(self, stage: "Stage", accept_after: float) -> None:
        server = stage.nav_server()
        server.accept_after = accept_after
        leaf = drive(stage)
        stage.tick_until(leaf, lambda: "Navigating to zone_a..." in stage.lines, "sending")
        leaf.stop(Status.INVALID)
        assert not leaf.is_settled()
        stage.until(leaf.is_settled, "calm")
        stage.until(lambda: server.goals and server.goals[0].final, "the end of the goal")
        assert server.goals[0].final == "canceled"
        assert stage.wakes == 0
        assert stage.warnings == []

    def test_every_halt_cancels_its_goal(self, stage: "Stage") -> None:
        server = stage.nav_server()
        server.accept_after = 0.3
        leaf = drive(stage)
        for times in range(1, 6):
            stage.tick_until(leaf, lambda: server.requests == times, f"goal {times}")  # noqa: B023 - used at once
            leaf.stop(Status.INVALID)
            stage.until(leaf.is_settled, "calm")
        stage.until(lambda: all(goal.final for goal in server.goals), "the end of every goal")
        assert [goal.final for goal in server.goals] == ["canceled"] * 5

    def test_goal_with_unseen_acceptance_is_canceled_by_id(self, stage: "Stage") -> None:
        server = stage.nav_server()
        leaf = drive(stage)
        stage.tick_until(leaf, lambda: "Navigating to zone_a..." in stage.lines, "sending")
        server.wait_for_start()
        leaf.stop(Status.INVALID)
        server.wait_for_end()  # the mission's node does not spin meanwhile
        assert server.goals[0].final == "canceled"
        stage.until(leaf.is_settled, "calm")
        assert stage.warnings == []

    def test_goal_rejected_after_halt_is_settled(self, stage: "Stage") -> None:
        server = stage.nav_server()
        server.accept = False
        server.accept_after = 0.1
        leaf = drive(stage)
        stage.tick_until(leaf, lambda: "Navigating to zone_a..." in stage.lines, "sending")
        leaf.stop(Status.INVALID)
        stage.until(leaf.is_settled, "calm")
        assert stage.warnings == []

    def test_halt_before_server_appears_sends_nothing(self, stage: "Stage") -> None:
        leaf = drive(stage)
        leaf.tick_once()
        leaf.stop(Status.INVALID)
        assert leaf.is_settled()
        server = stage.nav_server()
        stage.until(lambda: leaf._port is not None and leaf._port.server_is_ready, "the server")
        assert leaf.is_settled()
        assert server.requests == 0

    def test_leaf_without_goal_can_be_halted(self, stage: "Stage") -> None:
        leaf = drive(stage)
        leaf.stop(Status.INVALID)
        assert leaf.is_settled()
        assert leaf.update() is Status.INVALID

    def test_halted_leaf_is_not_running(self, stage: "Stage") -> None:
        leaf = drive(stage)
        leaf.tick_once()
        leaf.stop(Status.INVALID)
        assert leaf.update() is Status.FAILURE

    def test_refused_cancel_is_reported(self, stage: "Stage") -> None:
        server = stage.nav_server()
        server.heed_cancel = False
        leaf = drive(stage)
        tick_until_accepted(stage, leaf, server)
        leaf.stop(Status.INVALID)
        stage.until(lambda: stage.warnings, "the answer to the cancel")
        assert "did not cancel the goal" in stage.warnings[0]
        assert not leaf.is_settled()
        server.order("succeed")
        stage.until(leaf.is_settled, "the end of the goal")

    def test_cancel_of_ended_goal_causes_no_warning(self, stage: "Stage") -> None:
        server = stage.nav_server()
        leaf = drive(stage)
        tick_until_accepted(stage, leaf, server)
        server.order("succeed")
        server.wait_for_end()
        leaf.stop(Status.INVALID)
        stage.until(leaf.is_settled, "the answer to the cancel")
        assert stage.warnings == []

    def test_success_and_failure_cancel_nothing(self, stage: "Stage") -> None:
        server = stage.nav_server()
        server.script = ["succeed"]
        leaf = drive(stage)
        stage.run(leaf)
        leaf.terminate(Status.SUCCESS)
        leaf.terminate(Status.FAILURE)
        assert leaf.is_settled()
        assert server.cancels == 0


class TestOldGoals:
    def test_old_goal_does_not_affect_reentered_leaf(self, stage: "Stage") -> None:
        server = stage.nav_server()
        leaf = drive(stage)
        tick_until_accepted(stage, leaf, server)
        leaf.stop(Status.INVALID)
        tick_until_accepted(stage, leaf, server, goals=2)
        stage.tick_until(
            leaf, lambda: leaf.is_settled() and pending_results(leaf) == 1, "the old goal's result"
        )
        assert leaf.status is Status.RUNNING
        server.order("succeed")
        assert stage.run(leaf) is Status.SUCCESS

    def test_acceptance_of_old_goal_is_not_taken_for_new_goal(self, stage: "Stage") -> None:
        server = stage.nav_server()
        acceptance = server.hold()
        leaf = drive(stage)
        stage.tick_until(leaf, lambda: server.requests == 1, "the first goal")
        leaf.stop(Status.INVALID)
        stage.zones.select_next_zone()
        tick_until_accepted(stage, leaf, server)
        server.order("feedback")
        acceptance.set()
        stage.tick_until(
            leaf, lambda: len(server.goals) == 2 and leaf.is_settled(), "the old goal's acceptance"
        )
        finals = {goal.pose[1]: goal for goal in server.goals}
        stage.until(lambda: finals[-3.0].final == "canceled", "the old goal's end")
        assert leaf.status is Status.RUNNING
        finals[3.5].orders.put("succeed")
        assert stage.run(leaf) is Status.SUCCESS

    def test_goal_orphaned_by_exception_is_canceled_on_next_entry(self, stage: "Stage") -> None:
        server = stage.nav_server()
        leaf = drive(stage)
        tick_until_accepted(stage, leaf, server)
        leaf.status = Status.INVALID  # the state after an exception in the tree: no leaf was terminated
        tick_until_accepted(stage, leaf, server, goals=2)
        stage.until(lambda: server.goals[0].final == "canceled", "the old goal's end")

    def test_late_result_after_failure_changes_nothing(self, stage: "Stage") -> None:
        server = stage.nav_server()
        server.heed_cancel = False
        server.script = ["feedback"]
        leaf = drive(stage, feedback_timeout_sec=0.05, hold_timeout_sec=0.0)
        assert stage.run(leaf) is Status.FAILURE
        wakes = stage.wakes
        server.order("succeed")
        server.wait_for_end()
        stage.until(lambda: leaf.is_settled() and pending_results(leaf) == 0, "the result")
        assert leaf.update() is Status.FAILURE
        assert stage.wakes == wakes

    @pytest.mark.parametrize("accept", [True, False])
    def test_old_goal_is_garbage_collected(self, stage: "Stage", accept: bool) -> None:
        server = stage.nav_server()
        server.accept = accept
        leaf = drive(stage)
        stage.tick_until(leaf, lambda: server.requests == 1 and leaf._exchange is not None, "the goal")
        assert leaf._exchange is not None
        old = weakref.ref(leaf._exchange)
        leaf.stop(Status.INVALID)
        stage.until(lambda: leaf.is_settled() and pending_results(leaf) == 0, "calm")
        gc.collect()
        assert old() is None


class TestWake:
    def test_acceptance_and_success_wake_the_tree(self, stage: "Stage") -> None:
        server = stage.nav_server()
        leaf = drive(stage)
        tick_until_accepted(stage, leaf, server)
        assert stage.wakes == 1
        server.order("succeed")
        stage.run(leaf)
        assert stage.wakes == 2

    def test_rejection_does_not_wake_tree(self, stage: "Stage") -> None:
        stage.nav_server().accept = False
        stage.run(drive(stage))
        assert stage.wakes == 0

    def test_abort_does_not_wake_tree(self, stage: "Stage") -> None:
        stage.nav_server().script = ["abort"]
        stage.run(drive(stage))
        assert stage.wakes == 1, "the acceptance alone"

    def test_leaf_works_without_wake_callback(self, stage: "Stage") -> None:
        stage.nav_server().script = ["succeed"]
        leaf = drive(stage)
        leaf.setup(node=stage.node)
        assert stage.run(leaf) is Status.SUCCESS
        assert stage.wakes == 0


class TestShutdown:
    def test_shutdown_cancels_active_goal(self, stage: "Stage") -> None:
        server = stage.nav_server()
        leaf = drive(stage)
        tick_until_accepted(stage, leaf, server)
        leaf.shutdown()
        leaf.shutdown()
        stage.until(lambda: server.goals[0].final == "canceled", "the end of the goal")
        stage.until(leaf.is_settled, "the end's being known")

    def test_goal_accepted_after_shutdown_is_canceled(self, stage: "Stage") -> None:
        server = stage.nav_server()
        server.accept_after = 0.3
        leaf = drive(stage)
        stage.tick_until(leaf, lambda: server.requests == 1, "the goal's arrival")
        leaf.stop(Status.INVALID)
        leaf.shutdown()
        stage.until(lambda: server.goals and server.goals[0].final, "the end of the goal")
        assert server.goals[0].final == "canceled"

    def test_second_setup_leaves_no_extra_clients(self, stage: "Stage") -> None:
        leaf = drive(stage)
        waitables, clients = len(list(stage.node.waitables)), len(list(stage.node.clients))
        leaf.setup(node=stage.node)
        assert len(list(stage.node.waitables)) == waitables
        assert len(list(stage.node.clients)) == clients
