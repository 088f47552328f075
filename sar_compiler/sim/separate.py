"""The stand-ins for Nav2 in processes of their own, each of which can die alone; the world is in another one, and has the clock."""

import math
import time
from collections.abc import Callable, Sequence
from typing import Any

from nav2_msgs.action import NavigateToPose
from rclpy.action import ActionClient, GoalResponse
from rclpy.action.client import ClientGoalHandle
from rclpy.action.server import ServerGoalHandle
from rclpy.context import Context
from rclpy.task import Future
from rosgraph_msgs.msg import Clock

from sar_compiler.ros.faults import FaultPlan
from sar_compiler.ros.leaves.goals import ABORTED, CANCELED, SUCCEEDED
from sar_compiler.sim.amcl import Amcl
from sar_compiler.sim.bt_navigator import (
    ACTIVATION_SEC,
    FOLLOW,
    AcceptedGoal,
    ControllerServer,
    NavigationServer,
    NavigationSetup,
    pre_empted,
)
from sar_compiler.sim.messages import NANOSECONDS
from sar_compiler.sim.navigator import DriveEnd, DriveOutcome, Manner, manner
from sar_compiler.sim.node_host import NodeHost, PacedExecutor
from sar_compiler.sim.occupancy import OccupancyMap
from sar_compiler.sim.placement import AMCL, CONTROLLER, Placement, PlacementError
from sar_compiler.sim.robot_interface import RemoteRobot
from sar_compiler.sim.simulation import STEP_NS, navigation_in
from sar_compiler.sim.world import World

# How often a goal is sent on, steady seconds: Nav2's tree plans so often, by this clock, and follows the new path.
_REPLANS_SEC = 1.0
# Who drives says ten times a second where; silent for so long, it is taken for dead, seconds of both clocks.
_SILENCE_SEC = 0.5
_ENDS = {SUCCEEDED: DriveEnd.SUCCEEDED, ABORTED: DriveEnd.ABORTED}


class _PassedOn(AcceptedGoal):
    """A goal that another process drives to."""

    def __init__(self, handle: ServerGoalHandle, began: float) -> None:
        super().__init__(handle, began)
        self.taken: ClientGoalHandle | None = None
        self.is_called_off = False
        self.sent_at = math.inf
        self.heard_at = began, time.monotonic()

    def hear(self, now: float) -> None:
        """Note that who drives has said something, at a simulated time, seconds."""
        self.heard_at = now, time.monotonic()

    def silence_sec(self, now: float) -> float:
        """Return for how long it has said nothing, seconds of the clock that is slower."""
        return min(now - self.heard_at[0], time.monotonic() - self.heard_at[1])


class SeparateNavigator(NavigationServer):
    """Node `bt_navigator`: `navigate_to_pose`, each goal of which `follow_path` of `controller_server` drives to.

    It sends a goal on every second, as Nav2 does with each new path: the goal of `follow_path` before that ends aborted, and the robot drives on.
    It gives a goal up with code 0, as Nav2 does, where nobody takes it within `default_server_timeout`, or who drives falls silent;
    what took it too late drives on.

    Args:
        host: Creates the node.
        robot: The robot, whose localisation it waits for.
        manner: Has the time-out.
    """

    def __init__(self, host: NodeHost, robot: RemoteRobot, manner: Manner) -> None:
        super().__init__()
        self._robot, self._timeout_sec = robot, manner.server_timeout_sec
        self._goal: _PassedOn | None = None
        self._node = host.create(self.node_name)
        self._driver = ActionClient(self._node, NavigateToPose, FOLLOW)
        self._server = self._serve(self._node)

    def step(self, _: int, now_ns: int) -> None:
        """Do the work due at the simulated time *now_ns*, nanoseconds."""
        self._now = now_ns / 1e9
        if self._active_at is None and self._robot.place() is not None and self._driver.server_is_ready():
            self._active_at = self._now + ACTIVATION_SEC
        goal = self._goal
        if goal is None:
            return
        if goal.taken is None:
            if goal.silence_sec(self._now) > self._timeout_sec:
                self._give_up(goal, f"{FOLLOW} has not taken the goal in time")
            return
        if goal.handle.is_cancel_requested and not goal.is_called_off:
            goal.is_called_off = True
            goal.taken.cancel_goal_async()
        if goal.silence_sec(self._now) > _SILENCE_SEC:
            self._give_up(goal, f"{FOLLOW} has fallen silent")
        elif not goal.is_called_off and time.monotonic() - goal.sent_at >= _REPLANS_SEC:
            self._send_on(goal)

    def stop(self) -> bool:
        """End the current goal; return whether there was one, whose client is still to be notified."""
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
        goal, before = _PassedOn(handle, self._now), self._goal
        handle.execute(goal.run)
        if before is not None:
            before.end(pre_empted(before))
        self._goal = goal
        self._send_on(goal)

    def _send_on(self, goal: _PassedOn) -> None:
        goal.sent_at = math.inf

        def pass_on(message: Any) -> None:
            goal.hear(self._now)
            if goal is self._goal:
                goal.handle.publish_feedback(message.feedback)

        sent = self._driver.send_goal_async(goal.handle.request, pass_on)
        sent.add_done_callback(lambda answer: self._on_answer(goal, answer))

    def _on_answer(self, goal: _PassedOn, answer: Future) -> None:
        taken = answer.result()
        if not taken.accepted:
            self._give_up(goal, f"{FOLLOW} has refused the goal")
            return
        is_outlived = goal.taken is not None and goal is not self._goal
        goal.taken, goal.sent_at = taken, time.monotonic()
        goal.hear(self._now)
        if goal.is_called_off or is_outlived:
            taken.cancel_goal_async()
        taken.get_result_async().add_done_callback(
            lambda result: self._on_result(goal, taken, result.result())
        )

    def _on_result(self, goal: _PassedOn, taken: ClientGoalHandle, result: Any) -> None:
        if taken is not goal.taken or (result.status == ABORTED and goal.sent_at == math.inf):
            return  # of a path before the last one
        ending = _ENDS.get(result.status)
        if result.status == CANCELED and goal.handle.is_cancel_requested:
            ending = DriveEnd.CANCELED
        if ending is None:
            self._give_up(goal, f"{FOLLOW} was told by somebody else to stop")
        else:
            self._end(goal, DriveOutcome(ending, result.result.error_code, result.result.error_msg))

    def _give_up(self, goal: _PassedOn, text: str) -> None:
        if goal is self._goal:
            self._node.get_logger().error(f"Goal aborted (0): {text}.")
        self._end(goal, DriveOutcome(DriveEnd.ABORTED, text=text))

    def _end(self, goal: _PassedOn, outcome: DriveOutcome) -> None:
        if goal is self._goal:
            goal.end(outcome)
            self._goal = None


# How often it is looked whether the process is to end, and how long the ends of goals have to reach their clients, seconds.
_TURN_SEC, _FAREWELL_SEC = 0.1, 0.05


class _Localiser:
    """A localisation that begins when it has heard of its robot."""

    def __init__(
        self, host: NodeHost, robot: RemoteRobot, occupancy: OccupancyMap, *, localised: bool
    ) -> None:
        self._robot = robot
        self._make: Callable[[], Amcl] = lambda: Amcl(host, robot, occupancy, localised=localised)
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


_StandIn = _Localiser | ControllerServer | SeparateNavigator


class SeparatePart:
    """One part of the stand-in for Nav2, for all robots of a world that another process simulates.

    Args:
        part: Which, one of `placement.PARTS` but the first.
        world: The world; its map is needed.
        robots: The robots in it.
        context: The nodes' context.
        interrupted: Returns whether the process is to end.

    Raises:
        PlacementError: If the world has no map.
    """

    def __init__(
        self,
        part: str,
        world: World,
        robots: Sequence[Placement],
        *,
        context: Context,
        interrupted: Callable[[], bool],
    ) -> None:
        navigation = navigation_in(world, FaultPlan(places={}))
        if navigation is None:
            raise PlacementError(
                robots[0].name, f"has no {part} in the world '{world.name}', which has no map"
            )
        self._interrupted = interrupted
        self._executor = PacedExecutor(context=context, interrupted=interrupted)
        self._host = NodeHost(self._executor, context)
        self._host.create(f"{part}_clock").create_subscription(Clock, "/clock", self._on_clock, 10)
        self._robots: list[RemoteRobot] = []
        self._parts: list[_StandIn] = []
        for placement in robots:
            host = NodeHost(self._executor, context, cli_args=placement.ros_arguments)
            robot = RemoteRobot(host, f"{part}_robot", knows_truth=part == AMCL)
            self._robots.append(robot)
            self._parts.append(_make_part(part, host, robot, navigation, placement))

    def run(self) -> None:
        """Serve until the process is to end; then end current goals."""
        while not self._interrupted():
            self._executor.serve_until(time.monotonic() + _TURN_SEC)
        if any([part.stop() for part in self._parts]):  # noqa: C419 - all have to stop
            self._executor.serve_until(time.monotonic() + _FAREWELL_SEC, to_the_end=True)
        for part in self._parts:
            part.close()

    def _on_clock(self, message: Clock) -> None:
        now_ns = message.clock.sec * NANOSECONDS + message.clock.nanosec
        for robot, part in zip(self._robots, self._parts, strict=True):
            robot.step(now_ns)
            part.step(now_ns // STEP_NS, now_ns)


def _make_part(
    part: str, host: NodeHost, robot: RemoteRobot, navigation: NavigationSetup, placement: Placement
) -> _StandIn:
    if part == AMCL:
        return _Localiser(host, robot, navigation.occupancy, localised=placement.localised)
    how = manner(placement.like)
    if part == CONTROLLER:
        return ControllerServer(host, robot, navigation, robot.place, manner=how)
    return SeparateNavigator(host, robot, how)
