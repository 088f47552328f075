"""Tests of a robot that moves although no goal of its mission is active."""

import uuid
from typing import Any

import pytest

from sar_compiler.runtime.clock import ManualClock
from tests.ros.conftest import Ros, Said
from tests.waiting import Stopwatch

pytestmark = pytest.mark.ros

SERVERS = ("navigate_to_pose", "follow_path", "spin", "backup")
ACTION = "/navigate_to_pose"
SUCCEEDED, ABORTED = 4, 6


class Robot:
    """A robot whose speed the test sets, servers that record cancel requests, and the goals of a mission."""

    def __init__(self, ros: Ros) -> None:
        from action_msgs.msg import GoalStatusArray
        from action_msgs.srv import CancelGoal
        from nav_msgs.msg import Odometry
        from rclpy.qos import DurabilityPolicy, QoSProfile

        from sar_compiler.ros.dependency_monitor import UnrequestedMotion
        from sar_compiler.ros.leaves.goals import active_goals_of
        from sar_compiler.ros.robot_estimate import robot_estimate

        self.ros = ros
        self.speed: float | None = 0.0
        self.cancelled: list[tuple[str, Any]] = []
        other, node = ros.node("nav2"), ros.node("mission")
        self.node = node
        self._type, self._odometry = Odometry, other.create_publisher(Odometry, "odometry/filtered", 10)
        other.create_timer(0.02, self._publish)
        for name in SERVERS:
            other.create_service(CancelGoal, f"{name}/_action/cancel_goal", self._cancel_of(name))
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self.statuses = other.create_publisher(GoalStatusArray, "navigate_to_pose/_action/status", latched)
        self.estimate, self._goals = robot_estimate(node), active_goals_of(node)
        self.motion = UnrequestedMotion(node, ["navigate_to_pose"])
        ros.spin_until(lambda: self.estimate.is_standing, "the first odometry")
        ros.spin_until(self._sees_all_servers, "the servers")

    def _sees_all_servers(self) -> bool:
        return all(client.service_is_ready() for client in self.motion._cancellers.values())

    def _publish(self) -> None:
        if self.speed is not None:
            message = self._type()
            message.twist.twist.linear.x = self.speed
            self._odometry.publish(message)

    def _cancel_of(self, name: str) -> Any:
        def cancel(request: Any, response: Any) -> Any:
            self.cancelled.append((name, request.goal_info))
            return response

        return cancel

    def drive(self) -> str:
        """Start a goal of the mission, and return its id."""
        goal = uuid.uuid4().hex
        self._goals.before_sending(goal, ACTION)
        return goal

    def end(self, goal: str, status: int = ABORTED) -> None:
        self._goals.mark_ended(goal, status)


@pytest.fixture
def robot(ros: Ros) -> Robot:
    return Robot(ros)


def test_possible_motion_after_abort_is_cancelled_before_report(
    robot: Robot, said: Said, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("sar_compiler.ros.dependency_monitor._BRAKES_SEC", 3600.0)
    robot.speed = 0.25
    goal = robot.drive()
    robot.ros.spin_until(lambda: robot.estimate.moves, "the movement")
    robot.end(goal)
    robot.ros.spin_until(lambda: len(robot.cancelled) >= len(SERVERS), "the cancels")
    assert {name for name, _ in robot.cancelled} == set(SERVERS)
    assert not said.has("The robot moves")


def test_motion_after_abort_is_reported_and_all_goals_are_cancelled(robot: Robot, said: Said) -> None:
    robot.end(robot.drive())
    watch = Stopwatch()
    robot.speed = 0.25
    robot.ros.spin_until(lambda: said.has("The robot moves (0.25 m/s, 0.00 rad/s) although"), "the warning")
    assert watch.own_sec < 2.0
    robot.ros.spin_until(lambda: len(robot.cancelled) >= len(SERVERS), "the cancels")
    assert {name for name, _ in robot.cancelled} == set(SERVERS)
    for _, info in robot.cancelled:
        assert not any(info.goal_id.uuid)
        assert (info.stamp.sec, info.stamp.nanosec) == (0, 0)
    robot.speed = 0.0
    robot.ros.spin_until(lambda: said.has("The robot has stopped."), "its stop")


def test_motion_that_begins_seconds_after_abort_is_cancelled(
    robot: Robot, said: Said, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A starved controller of Nav2 was observed to start a goal 3 s after its navigator had given it up."""
    monkeypatch.setattr("sar_compiler.ros.dependency_monitor._LATEST_SEC", 0.1)
    robot.end(robot.drive())
    robot.ros.spin_for(1.0)
    robot.speed = 0.25
    robot.ros.spin_until(lambda: said.has("The robot moves (0.25 m/s, 0.00 rad/s) although"), "the warning")
    robot.ros.spin_until(lambda: len(robot.cancelled) >= len(SERVERS), "the cancels")


@pytest.mark.parametrize(("status", "latest"), [(SUCCEEDED, "_LATEST_SEC"), (ABORTED, "_LATEST_ABORTED_SEC")])
def test_later_motion_is_only_reported(
    robot: Robot, said: Said, monkeypatch: pytest.MonkeyPatch, status: int, latest: str
) -> None:
    monkeypatch.setattr(f"sar_compiler.ros.dependency_monitor.{latest}", 0.1)
    robot.end(robot.drive(), status)
    robot.ros.spin_until(lambda: not robot.motion._has_sent, "the end of the time")
    robot.speed = 0.25
    robot.ros.spin_until(lambda: said.has("no goal of this mission is active"), "the warning")
    assert robot.cancelled == []


def test_persistent_motion_is_cancelled_again(robot: Robot) -> None:
    robot.end(robot.drive())
    robot.speed = 0.25
    robot.ros.spin_until(lambda: len(robot.cancelled) >= 2 * len(SERVERS), "the second cancels")


def test_motion_after_lost_goal_is_cancelled(robot: Robot) -> None:
    goal = robot.drive()
    robot.speed = 0.25
    robot._goals.mark_lost(goal)
    robot.ros.spin_until(lambda: robot.cancelled, "the cancels")


def test_motion_is_not_cancelled_while_mission_goal_is_active(robot: Robot, said: Said) -> None:
    robot.end(robot.drive())
    robot.drive()
    robot.speed = 0.25
    robot.ros.spin_until(lambda: robot.estimate.moves, "the movement")
    robot.ros.spin_for(1.0)
    assert robot.cancelled == []
    assert not said.has("The robot moves")


def test_goal_of_other_client_is_not_cancelled_and_motion_is_reported(robot: Robot, said: Said) -> None:
    from action_msgs.msg import GoalStatus, GoalStatusArray

    foreign = GoalStatus(status=GoalStatus.STATUS_EXECUTING)
    foreign.goal_info.goal_id.uuid = list(uuid.uuid4().bytes)
    robot.statuses.publish(GoalStatusArray(status_list=[foreign]))
    robot.ros.spin_until(lambda: robot.motion._statuses[0].has_foreign_goal, "the other client's goal")
    robot.end(robot.drive())
    robot.speed = 0.25
    robot.ros.spin_until(lambda: said.has("no goal of this mission is active"), "the warning")
    assert robot.cancelled == []


def test_manual_driving_is_only_reported(robot: Robot, said: Said) -> None:
    robot.speed = 0.25
    robot.ros.spin_until(
        lambda: said.has(
            "The robot moves (0.25 m/s, 0.00 rad/s), although no goal of this mission is active."
        ),
        "the warning",
    )
    assert robot.cancelled == []


def test_braking_robot_is_not_reported(robot: Robot, said: Said, monkeypatch: pytest.MonkeyPatch) -> None:
    goal, clock = robot.drive(), ManualClock()
    monkeypatch.setattr(robot.motion, "_now", lambda: (clock.now(), clock.now()))
    robot.speed = 0.25
    robot.ros.spin_until(lambda: robot.estimate.moves, "the movement")
    robot.end(goal)
    robot.ros.spin_until(lambda: robot.motion._since, "the first look at the movement")
    clock.advance(0.2)
    robot.motion.poll()
    robot.speed = 0.0
    robot.ros.spin_until(lambda: robot.estimate.is_standing, "its stop")
    assert robot.cancelled == []
    assert not said.has("The robot moves")


def test_missing_odometry_is_reported_once_after_end_of_goal(robot: Robot, said: Said) -> None:
    robot.speed = None
    robot.ros.spin_until(lambda: robot.estimate.moves is None, "the silence")
    robot.end(robot.drive())
    for _ in range(3):
        robot.motion.poll()
    robot.ros.spin_until(lambda: said.has("No odometry arrives on odometry/filtered"), "the note")
    assert sum("No odometry arrives" in line for line in said.lines()) == 1
    assert robot.estimate.is_standing is None


def test_invalid_speed_makes_motion_unknown(robot: Robot) -> None:
    robot.speed = float("nan")
    robot.ros.spin_until(lambda: robot.estimate.moves is None, "the end of what it said before")
