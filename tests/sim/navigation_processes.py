"""The stand-in for Nav2 in several processes, each of which a test can kill alone.

`python -m tests.sim.navigation_processes` simulates the world and starts the three others; with `--part NAME` it is one of these. As in Nav2,
the navigator sends its goal to the controller every second, and the previous goal ends aborted. Here `follow_path` receives the goal of
`navigate_to_pose`, not a path.
"""

import argparse
import dataclasses
import math
import subprocess
import sys
import time
from collections.abc import Callable
from typing import Any, cast

from geometry_msgs.msg import TwistStamped
from lifecycle_msgs.srv import GetState
from nav2_msgs.action import NavigateToPose
from nav_msgs.msg import Odometry
from rclpy.action import ActionClient, GoalResponse
from rclpy.action.client import ClientGoalHandle
from rclpy.action.server import ServerGoalHandle
from rclpy.context import Context
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data
from rclpy.task import Future
from rosgraph_msgs.msg import Clock
from tf2_msgs.msg import TFMessage

from sar_compiler.missions.faults import FaultPlan
from sar_compiler.process_end import dependent_environment, end_with_parent
from sar_compiler.ros.arguments import init_arguments
from sar_compiler.ros.leaves.goals import ABORTED, CANCELED, SUCCEEDED
from sar_compiler.ros.middleware import require_middleware, ros_up
from sar_compiler.ros.poses import yaw_of
from sar_compiler.ros.signals import StopSignals
from sar_compiler.sim.amcl import Amcl
from sar_compiler.sim.bt_navigator import (
    ACTIVATION_SEC,
    FOLLOW,
    NAVIGATE,
    AcceptedGoal,
    BtNavigator,
    NavigationSetup,
    end_of_replaced_goal,
    serve_goals,
)
from sar_compiler.sim.geometry import ORIGIN, Pose2D
from sar_compiler.sim.isolation import stay_on_this_machine
from sar_compiler.sim.messages import NANOSECONDS, from_pose, set_lifecycle_state, to_stamp, to_transform
from sar_compiler.sim.navigator import QUICK, DriveEnd, DriveOutcome
from sar_compiler.sim.node_host import NodeHost, PacedExecutor
from sar_compiler.sim.occupancy import OccupancyMap
from sar_compiler.sim.robot import Limits, Robot, RobotState, Twist2D
from sar_compiler.sim.simulation import STEP_NS, Simulation, navigation_in
from sar_compiler.sim.world import find_world

AMCL, CONTROLLER, NAVIGATOR = PARTS = ("amcl", "controller_server", "bt_navigator")
_WORLD = "disaster_zone"
_MAP, _ODOM, _BASE = "map", "odom", "base_link"
# The true pose and the odometry pose, for the localisation.
_PLACES = "simulator/places"
# An older transform from `map` is not used, in seconds of either clock.
_FRESH_SEC = 0.5

# How often a goal is forwarded, steady seconds: Nav2's tree replans at this rate, by this clock, and follows the new path.
_REPLANS_SEC = 1.0
# The controller sends feedback ten times a second; after such a silence it counts as crashed, seconds of both clocks.
_SILENCE_SEC = 0.5
_ENDS = {SUCCEEDED: DriveEnd.SUCCEEDED, ABORTED: DriveEnd.ABORTED}


class RemoteRobot:
    """The robot as another process knows it from messages, and drives it by `cmd_vel`.

    Args:
        host: Creates the node.
        name: The node's name.
        knows_truth: Whether its true pose is received, as by a localisation; else its odometry.

    Attributes:
        limits: The limits of its drive.
        state: Its last known state.
        is_known: Whether its true pose is known.
    """

    def __init__(self, host: NodeHost, name: str, *, knows_truth: bool = False) -> None:
        self.limits = Limits()
        self.state = RobotState(ORIGIN)
        self.is_known = False
        self._now_ns = 0
        self._offset: Pose2D | None = None
        self._heard_at = (-math.inf, -math.inf)
        node = host.create(name)
        if knows_truth:
            node.create_subscription(TFMessage, _PLACES, self._on_places, 10)
            return
        node.create_subscription(Odometry, "odometry/filtered", self._on_odometry, qos_profile_sensor_data)
        node.create_subscription(TFMessage, "/tf", self._on_transforms, 100)
        self._commands = node.create_publisher(TwistStamped, "cmd_vel", 10)

    def step(self, now_ns: int) -> None:
        """Store the simulated time, nanoseconds."""
        self._now_ns = now_ns

    def place(self) -> Pose2D | None:
        """Return its pose by the last transform from `map` and the odometry; None without a recent transform."""
        now, wall = self._now_ns / 1e9, time.monotonic()
        if self._offset is None or min(now - self._heard_at[0], wall - self._heard_at[1]) > _FRESH_SEC:
            return None
        return self._offset.compose(self.state.odometry)

    def drive(self, twist: Twist2D) -> None:
        """Send a velocity command."""
        message = TwistStamped()
        message.header.frame_id, message.header.stamp = _BASE, to_stamp(self._now_ns)
        message.twist.linear.x, message.twist.angular.z = twist.v, twist.w
        self._commands.publish(message)

    def _on_places(self, message: Any) -> None:
        pose, odometry = (_planar(each.transform) for each in message.transforms)
        self.state, self.is_known = RobotState(pose, odometry=odometry), True

    def _on_odometry(self, message: Any) -> None:
        twist, odometry = message.twist.twist, from_pose(message.pose.pose)
        if odometry is not None:
            velocity = Twist2D(twist.linear.x, twist.angular.z)
            self.state = RobotState(self.state.pose, velocity, odometry)

    def _on_transforms(self, message: Any) -> None:
        for each in message.transforms:
            if each.header.frame_id == _MAP:
                self._offset = _planar(each.transform)
                self._heard_at = self._now_ns / 1e9, time.monotonic()


def _planar(transform: Any) -> Pose2D:
    place = transform.translation
    return Pose2D(place.x, place.y, yaw_of(transform.rotation))


class Controller(BtNavigator):
    """Node `controller_server`: planner, controller and behaviours. It also plans, so its action receives the navigator's goal instead of a path."""

    node_name = CONTROLLER

    def _serve(self) -> None:
        for name in (CONTROLLER, "planner_server", "behavior_server"):
            serve_state(self._node, name, lambda: self.active)
        self._server = serve_goals(self._node, NavigateToPose, FOLLOW, self._on_goal, self._on_accepted)

    def _on_accepted(self, handle: ServerGoalHandle, action_type: Any = NavigateToPose) -> None:
        before = self._goal
        super()._on_accepted(handle, action_type)
        goal = self._goal
        if before is None or goal is None or before.handle.is_cancel_requested:
            return
        if goal.poses[0].pose == before.poses[0].pose:  # the same drive, with a new path
            goal.began, goal.localised_at = before.began, before.localised_at
            goal.drive, goal.progress = before.drive, before.progress
            goal.recovery, goal.recoveries_left = before.recovery, before.recoveries_left
            goal.recoveries_begun = before.recoveries_begun


def serve_state(node: Node, name: str, is_active: Callable[[], bool]) -> None:
    """Serve the state of a lifecycle node."""
    node.create_service(
        GetState, f"{name}/get_state", lambda _, response: set_lifecycle_state(response, active=is_active())
    )


class _ForwardedGoal(AcceptedGoal):
    """A goal that another process executes."""

    def __init__(self, handle: ServerGoalHandle, began: float) -> None:
        super().__init__(handle, began)
        self.taken: ClientGoalHandle | None = None
        self.is_cancel_sent = False
        self.sent_at = math.inf
        self.heard_at = began, time.monotonic()

    def hear(self, now: float) -> None:
        """Record that the controller has sent a message, at a simulated time, seconds."""
        self.heard_at = now, time.monotonic()

    def silence_sec(self, now: float) -> float:
        """Return for how long it has been silent, seconds of the slower clock."""
        return min(now - self.heard_at[0], time.monotonic() - self.heard_at[1])


class Navigator:
    """Node `bt_navigator`: serves `navigate_to_pose`, and forwards each goal to `follow_path` of `controller_server`.

    It forwards a goal every second, as Nav2 does with each new path: the previous goal of `follow_path` ends aborted, and the robot drives on.
    It gives a goal up with code 0, as Nav2 does, if no server accepts it within `default_server_timeout`, or if the controller falls silent;
    a controller that accepts it too late drives on.

    Args:
        host: Creates the node.
        robot: The robot; it waits for the robot's localisation.
    """

    def __init__(self, host: NodeHost, robot: RemoteRobot) -> None:
        self._now = 0.0
        self._active_at: float | None = None
        self._robot = robot
        self._goal: _ForwardedGoal | None = None
        self._node = host.create(NAVIGATOR)
        self._driver = ActionClient(self._node, NavigateToPose, FOLLOW)
        serve_state(self._node, NAVIGATOR, lambda: self.active)
        self._server = serve_goals(self._node, NavigateToPose, NAVIGATE, self._on_goal, self._on_accepted)

    @property
    def active(self) -> bool:
        """Whether the lifecycle state is active."""
        return self._active_at is not None and self._now >= self._active_at

    def step(self, _: int, now_ns: int) -> None:
        """Do the work due at the simulated time *now_ns*, nanoseconds."""
        self._now = now_ns / 1e9
        if self._active_at is None and self._robot.place() is not None and self._driver.server_is_ready():
            self._active_at = self._now + ACTIVATION_SEC
        goal = self._goal
        if goal is None:
            return
        if goal.taken is None:
            if goal.silence_sec(self._now) > QUICK.server_timeout_sec:
                self._give_up(goal, f"{FOLLOW} has not taken the goal in time")
            return
        if goal.handle.is_cancel_requested and not goal.is_cancel_sent:
            goal.is_cancel_sent = True
            goal.taken.cancel_goal_async()
        if goal.silence_sec(self._now) > _SILENCE_SEC:
            self._give_up(goal, f"{FOLLOW} has fallen silent")
        elif not goal.is_cancel_sent and time.monotonic() - goal.sent_at >= _REPLANS_SEC:
            self._forward(goal)

    def stop(self) -> bool:
        """End the current goal; return whether there was one, so that its client must be notified."""
        goal = self._goal
        if goal is not None:
            if goal.taken is not None:
                goal.taken.cancel_goal_async()
            self._give_up(goal, "the navigator stops")
        return goal is not None

    def close(self) -> None:
        """Destroy server and client."""
        self._server.destroy()
        self._driver.destroy()

    def _on_goal(self, _: Any) -> GoalResponse:
        return GoalResponse.ACCEPT if self.active else GoalResponse.REJECT

    def _on_accepted(self, handle: ServerGoalHandle) -> None:
        goal, before = _ForwardedGoal(handle, self._now), self._goal
        handle.execute(goal.run)
        if before is not None:
            before.finish(end_of_replaced_goal(before))
        self._goal = goal
        self._forward(goal)

    def _forward(self, goal: _ForwardedGoal) -> None:
        goal.sent_at = math.inf

        def on_feedback(message: Any) -> None:
            goal.hear(self._now)
            if goal is self._goal:
                goal.handle.publish_feedback(message.feedback)

        sent = self._driver.send_goal_async(goal.handle.request, on_feedback)
        sent.add_done_callback(lambda answer: self._on_answer(goal, answer))

    def _on_answer(self, goal: _ForwardedGoal, answer: Future) -> None:
        taken = answer.result()
        if not taken.accepted:
            self._give_up(goal, f"{FOLLOW} has refused the goal")
            return
        is_outlived = goal.taken is not None and goal is not self._goal
        goal.taken, goal.sent_at = taken, time.monotonic()
        goal.hear(self._now)
        if goal.is_cancel_sent or is_outlived:
            taken.cancel_goal_async()
        taken.get_result_async().add_done_callback(
            lambda result: self._on_result(goal, taken, result.result())
        )

    def _on_result(self, goal: _ForwardedGoal, taken: ClientGoalHandle, result: Any) -> None:
        if taken is not goal.taken or (result.status == ABORTED and goal.sent_at == math.inf):
            return  # of an earlier path
        ending = _ENDS.get(result.status)
        if result.status == CANCELED and goal.handle.is_cancel_requested:
            ending = DriveEnd.CANCELED
        if ending is None:
            self._give_up(goal, f"{FOLLOW} was stopped by another client")
        else:
            self._end(goal, DriveOutcome(ending, result.result.error_code, result.result.error_msg))

    def _give_up(self, goal: _ForwardedGoal, text: str) -> None:
        if goal is self._goal:
            self._node.get_logger().error(f"Goal aborted (0): {text}.")
        self._end(goal, DriveOutcome(DriveEnd.ABORTED, text=text))

    def _end(self, goal: _ForwardedGoal, outcome: DriveOutcome) -> None:
        if goal is self._goal:
            goal.finish(outcome)
            self._goal = None


# How often the stop signal is checked, and how long the ends of goals have to reach their clients, seconds.
_TURN_SEC, _FAREWELL_SEC = 0.1, 0.05


class _Localiser:
    """A localisation that starts when the pose of its robot is known."""

    def __init__(
        self, host: NodeHost, robot: RemoteRobot, occupancy: OccupancyMap, *, localised: bool
    ) -> None:
        self._robot = robot
        self._make: Callable[[], Amcl] = lambda: Amcl(
            host, cast("Robot", robot), occupancy, localised=localised
        )
        self._amcl: Amcl | None = None

    def step(self, step: int, now_ns: int) -> None:
        if self._amcl is None and self._robot.is_known:
            self._amcl = self._make()
        if self._amcl is not None:
            self._amcl.step(step, now_ns)

    def stop(self) -> bool:
        return False

    def close(self) -> None:
        pass


class Part:
    """One part of the stand-in for Nav2, in a world simulated by another process.

    Args:
        name: Which, one of `PARTS`.
        localised: Whether a localisation knows the robot's pose without an initial pose.
        context: The nodes' context.
        interrupted: Returns whether the process must end.
    """

    def __init__(
        self, name: str, *, localised: bool, context: Context, interrupted: Callable[[], bool]
    ) -> None:
        navigation = navigation_in(find_world(_WORLD), FaultPlan(places={}))
        assert navigation is not None
        self._interrupted = interrupted
        self._executor = PacedExecutor(context=context, interrupted=interrupted)
        host = NodeHost(self._executor, context)
        host.create(f"{name}_clock").create_subscription(Clock, "/clock", self._on_clock, 10)
        self._robot = RemoteRobot(host, f"{name}_robot", knows_truth=name == AMCL)
        self._part = _make_part(name, host, self._robot, navigation, localised=localised)

    def run(self) -> None:
        """Serve until the process must end; then end the current goal."""
        while not self._interrupted():
            self._executor.serve_until(time.monotonic() + _TURN_SEC)
        if self._part.stop():
            self._executor.serve_until(time.monotonic() + _FAREWELL_SEC, to_the_end=True)
        self._part.close()

    def _on_clock(self, message: Clock) -> None:
        now_ns = message.clock.sec * NANOSECONDS + message.clock.nanosec
        self._robot.step(now_ns)
        self._part.step(now_ns // STEP_NS, now_ns)


def _make_part(
    name: str, host: NodeHost, robot: Any, navigation: NavigationSetup, *, localised: bool
) -> "_Localiser | Controller | Navigator":
    if name == AMCL:
        return _Localiser(host, robot, navigation.occupancy, localised=localised)
    if name == CONTROLLER:
        return Controller(host, robot, navigation, robot.place)
    return Navigator(host, robot)


def _publish_true_pose(node: Node, simulation: Simulation) -> None:
    """Publish the true pose with each odometry message of the robot."""
    places = node.create_publisher(TFMessage, _PLACES, 10)

    def on_odometry(message: Odometry) -> None:
        stamp, (pose, odometry) = message.header.stamp, simulation._robots[""].poses
        truth, measured = to_transform(_MAP, _BASE, pose, stamp), to_transform(_ODOM, _BASE, odometry, stamp)
        places.publish(TFMessage(transforms=[truth, measured]))

    node.create_subscription(Odometry, "odometry/filtered", on_odometry, 10)


def _simulate(context: Context, speed: float, signals: StopSignals) -> None:
    """Simulate the robot in its world, with all other parts in separate processes."""
    world = dataclasses.replace(
        find_world(_WORLD), map_path=None
    )  # with a map the simulation would include navigation
    node = Node("simulator_places", context=context)
    simulation = Simulation(world, speed=speed, context=context, extra_nodes=[node])
    _publish_true_pose(node, simulation)
    command = [sys.executable, "-m", "tests.sim.navigation_processes", "--part"]
    with simulation:
        parts = {name: subprocess.Popen([*command, name], env=dependent_environment()) for name in PARTS}
        for name, process in parts.items():
            _print_line(f"{name} is process {process.pid}")
        _print_line("the world runs")
        while not signals.wait(_TURN_SEC):
            if simulation.failure is not None:
                raise simulation.failure
        for process in parts.values():
            process.terminate()
        for process in parts.values():
            process.wait()


def _print_line(line: str) -> None:
    sys.stdout.write(f"{line}\n")
    sys.stdout.flush()


def main() -> None:
    """Run the world, or one of the parts, until a signal arrives."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--part", choices=PARTS)
    parser.add_argument("--speed", type=float, default=1.0)
    parser.add_argument("--localised", action="store_true")
    options = parser.parse_args()
    signals = StopSignals()
    end_with_parent()
    require_middleware()
    stay_on_this_machine()
    with ros_up(init_arguments([])) as context:
        if options.part is None:
            _simulate(context, options.speed, signals)
            return
        part = Part(
            options.part,
            localised=options.localised,
            context=context,
            interrupted=lambda: signals.came,
        )
        _print_line(f"{options.part} runs")
        part.run()


if __name__ == "__main__":
    main()
