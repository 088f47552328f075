"""Tests of killing single parts of Nav2's stand-in, each a separate process, while a mission drives."""

import os
import re
import signal

import pytest

from tests.waiting import Stopwatch

pytestmark = [pytest.mark.ros, pytest.mark.slow]

PARTS = "python", "-m", "tests.sim.navigation_processes"


class DrivingMission:
    """A mission that drives to its first zone, in a world of four processes.

    Attributes:
        mission: The command.
    """

    def __init__(self, start, serve, ros):
        self._start, self._ros = start, ros
        self._speed, self._begun = [0.0], []
        serve("survivors")
        self._world = start(*PARTS, "--speed", 2).wait_for("the world runs")
        parameters = ("-p", "use_sim_time:=true", "-p", "zone_order:=[zone_a]")
        self.mission = start(
            "sar-run", "search_and_rescue_resilient", "--until", "complete", "--ros-args", *parameters
        )
        self._listen()
        self.mission.wait_for("Navigating to zone_a...")
        ros.spin_until(lambda: self._speed[-1] > 0.3, "the robot's driving")

    def _listen(self):
        from nav_msgs.msg import Odometry

        self._node = self._ros.node("watching")
        self._node.create_subscription(
            Odometry,
            "odometry/filtered",
            lambda message: self._speed.append(message.twist.twist.linear.x),
            10,
        )

    def kill(self, part):
        (found,) = re.findall(rf"{part} is process (\d+)", self._world.output)
        os.kill(int(found), signal.SIGKILL)
        return Stopwatch(self.mission.pid)

    def wait_for_standstill(self):
        self._ros.spin_until(lambda: not any(self._speed[-10:]), "the robot's standing")

    def restart(self, part, *options):
        self._begun.append(self._start(*PARTS, "--part", part, *options).wait_for(f"{part} runs"))

    def require_completion_without_lost_attempt(self):
        assert self.mission.end() == 0, self.mission.output
        assert "postponed" not in self.mission.output
        assert "abandoned" not in self.mission.output

    def end(self):
        """End the world, and wait until killed processes have left the graph, because the next world would not start otherwise."""
        for each in (*self._begun, self._world):
            each.stop(within_sec=20.0)
        goals = "/navigate_to_pose/_action/send_goal"
        self._ros.spin_until(lambda: not self._node.count_services(goals), "the end of the navigators")


@pytest.fixture
def driving(start, serve, ros):
    """Return a mission that drives to its first zone."""
    driving = DrivingMission(start, serve, ros)
    yield driving
    driving.end()


def test_killed_localisation_is_reported_within_4_s_and_costs_no_attempt(driving):
    stopwatch = driving.kill("amcl")
    driving.mission.wait_for("Nav2 is no longer active: node amcl: /amcl/get_state has not responded")
    assert stopwatch.own_sec < 4.0
    driving.wait_for_standstill()
    driving.mission.wait_for("waits to send its goal again: node amcl")
    driving.restart("amcl", "--localised")
    driving.require_completion_without_lost_attempt()


def test_robot_stops_if_controller_is_killed_and_it_costs_no_attempt(driving):
    driving.kill("controller_server")
    driving.wait_for_standstill()
    driving.mission.wait_for("node controller_server: /controller_server/get_state has not responded for 2 s")
    assert "follow_path has fallen silent" in driving._world.output
    driving.restart("controller_server")
    driving.require_completion_without_lost_attempt()


def test_killed_navigator_is_reported_and_costs_no_attempt(
    driving,
):
    driving.kill("bt_navigator")
    driving.mission.wait_for(
        "Nav2 is no longer active: node bt_navigator: /bt_navigator/get_state has not responded"
    )
    driving.mission.wait_for(
        "waits to send its goal again: the server has sent no feedback for 2 s, and node bt_navigator does not respond"
    )
    driving.mission.wait_for("Cancelling every goal (")
    driving.wait_for_standstill()
    driving.restart("bt_navigator")
    driving.require_completion_without_lost_attempt()


def test_navigator_resends_goal_to_controller_without_interrupting_drive(driving, ros):
    """Each goal of `follow_path` but the last one ends aborted."""
    from action_msgs.msg import GoalStatusArray
    from nav2_msgs.action import NavigateToPose

    statuses: dict[str, dict[bytes, int]] = {"follow_path": {}, "navigate_to_pose": {}}
    driven_sec: list[int] = []

    def on_statuses(name, message):
        for each in message.status_list:
            statuses[name][bytes(each.goal_info.goal_id.uuid)] = each.status

    for name in statuses:
        topic, on_message = f"{name}/_action/status", lambda message, name=name: on_statuses(name, message)
        driving._node.create_subscription(GoalStatusArray, topic, on_message, 10)
    driving._node.create_subscription(
        NavigateToPose.Impl.FeedbackMessage,
        "navigate_to_pose/_action/feedback",
        lambda message: driven_sec.append(message.feedback.navigation_time.sec),
        10,
    )
    succeeded, aborted = 4, 6
    ros.spin_until(
        lambda: [*statuses["follow_path"].values()].count(aborted) >= 2,
        "two ends of `follow_path`",
        timeout_sec=60.0,
    )
    ros.spin_until(
        lambda: succeeded in statuses["navigate_to_pose"].values(), "the end of the drive", timeout_sec=60.0
    )
    assert aborted not in statuses["navigate_to_pose"].values()
    assert max(driven_sec) >= 5
    driving.require_completion_without_lost_attempt()
