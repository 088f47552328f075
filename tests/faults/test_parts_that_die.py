"""The parts of Nav2's stand-in, each a process of its own, killed alone while a mission drives: what is said, and what it costs."""

import os
import re
import signal

import pytest

from tests.waiting import Stopwatch

pytestmark = [pytest.mark.ros, pytest.mark.slow]

PARTS = "python", "-m", "tests.sim.parts"


class Flight:
    """A mission on its way to its first zone, in a world of four processes.

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

    def stands(self):
        self._ros.spin_until(lambda: not any(self._speed[-10:]), "the robot's standing")

    def begin_again(self, part, *options):
        self._begun.append(self._start(*PARTS, "--part", part, *options).wait_for(f"{part} runs"))

    def completes_at_no_cost(self):
        assert self.mission.end() == 0, self.mission.output
        assert "postponed" not in self.mission.output
        assert "abandoned" not in self.mission.output

    def end(self):
        """End the world, and wait until the shadows of the dead are gone, beside which no other world would begin."""
        for each in (*self._begun, self._world):
            each.stop(within_sec=20.0)
        goals = "/navigate_to_pose/_action/send_goal"
        self._ros.spin_until(lambda: not self._node.count_services(goals), "the end of the navigators")


@pytest.fixture
def flight(start, serve, ros):
    """A mission on its way to its first zone."""
    flight = Flight(start, serve, ros)
    yield flight
    flight.end()


def test_a_localisation_that_is_killed_alone_is_told_within_four_seconds_and_costs_no_attempt(flight):
    stopwatch = flight.kill("amcl")
    flight.mission.wait_for("Nav2 is no longer active: node amcl: /amcl/get_state has not responded")
    assert stopwatch.own_sec < 4.0
    flight.stands()
    flight.mission.wait_for("waits to send its goal again: node amcl")
    flight.begin_again("amcl", "--localised")
    flight.completes_at_no_cost()


def test_nothing_drives_when_the_controller_is_killed_alone_and_it_costs_no_attempt(flight):
    flight.kill("controller_server")
    flight.stands()
    flight.mission.wait_for("node controller_server: /controller_server/get_state has not responded for 2 s")
    assert "follow_path has fallen silent" in flight._world.output
    flight.begin_again("controller_server")
    flight.completes_at_no_cost()


def test_a_navigator_that_is_killed_alone_is_told_and_costs_no_attempt_though_its_controller_drives_on(
    flight,
):
    flight.kill("bt_navigator")
    flight.mission.wait_for(
        "Nav2 is no longer active: node bt_navigator: /bt_navigator/get_state has not responded"
    )
    flight.mission.wait_for(
        "waits to send its goal again: the server has sent no feedback for 2 s, and node bt_navigator does not respond"
    )
    flight.mission.wait_for("Cancelling every goal (")
    flight.stands()
    flight.begin_again("bt_navigator")
    flight.completes_at_no_cost()


def test_a_goal_is_sent_on_to_the_controller_every_second_as_by_nav2_and_the_drive_goes_on(flight, ros):
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
        flight._node.create_subscription(GoalStatusArray, topic, on_message, 10)
    flight._node.create_subscription(
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
    flight.completes_at_no_cost()
