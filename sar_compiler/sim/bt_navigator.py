"""A substitute for Nav2's navigator. Like bt_navigator in Jazzy, it serves `navigate_to_pose` and `navigate_through_poses`."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

from action_msgs.srv import CancelGoal
from lifecycle_msgs.srv import GetState
from nav2_msgs.action import NavigateThroughPoses, NavigateToPose
from nav_msgs.msg import Path as PathMessage
from rcl_interfaces.msg import Log
from rclpy.action import ActionServer, CancelResponse, GoalResponse
from rclpy.action.server import ServerGoalHandle
from rclpy.logging import LoggingSeverity
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.task import Future

from sar_compiler.missions.faults import LOCALISATION, Fault, FaultPlan
from sar_compiler.opener import is_file
from sar_compiler.sim.geometry import ORIGIN, Pose2D
from sar_compiler.sim.messages import from_pose, set_lifecycle_state, to_duration, to_path, to_pose, to_stamp
from sar_compiler.sim.navigator import (
    QUICK,
    Drive,
    DriveEnd,
    DriveOutcome,
    DriveProgress,
    DrivingManner,
    Recovery,
)
from sar_compiler.sim.node_host import NodeHost
from sar_compiler.sim.occupancy import OccupancyMap
from sar_compiler.sim.planner import NavCode, Planner, PlanningError
from sar_compiler.sim.planner_server import PlannerServer
from sar_compiler.sim.robot import STAND
from sar_compiler.sim.robot_interface import RobotInterface

NAVIGATE, THROUGH, FOLLOW = "navigate_to_pose", "navigate_through_poses", "follow_path"
"""The actions of Nav2's navigator and of its controller."""

_MAP = "map"
# The number of steps between two feedback messages (10 Hz with steps of 0.05 s).
_FEEDBACK_EVERY = 2
# Simulated seconds between the first transform to `map` and the activation of the navigator.
ACTIVATION_SEC = 1.0
# The distance within which an intermediate pose counts as passed, metres, as for `RemovePassedGoals` in Nav2's tree.
_PASSED_M = 0.7
# The number that Nav2 adds to the planner's error codes for `navigate_through_poses`.
_THROUGH_CODES = 100
# Nav2's error code for an empty list of poses.
_NO_POSES = 309
# The distance from a location within which a goal counts as a goal for this location, metres.
_PLACE_REACH = 0.5
# The driving time after which a `die` or `starved` fault occurs, simulated seconds.
_DIES_AFTER_SEC = 1.0
# Nav2's default for `default_server_timeout`, seconds; a shorter delay of the response has no effect.
_SERVER_TIMEOUT_SEC = 0.02
# The integer value of WARN in rcl_interfaces/msg/Log, where the constant is a byte.
_LEVEL = LoggingSeverity.WARN.value
# The logger of the node that calls other servers for one of the navigator's actions.
_CLIENT = "bt_navigator_{}_rclcpp_node"
# The time for which a drive continues without localisation, simulated seconds.
_LOST_AFTER_SEC = 0.5
# The error codes after which Nav2 starts a recovery.
_RECOVERABLE = (NavCode.NO_VALID_PATH, NavCode.FAILED_TO_MAKE_PROGRESS)
# The time for which results of ended goals are stored for late clients, seconds. Nav2 stores them for 900 s.
_RESULT_TIMEOUT_SEC = 60


def serve_goals(
    node: Node,
    action_type: Any,
    action: str,
    on_goal: Callable[[Any], Any],
    on_accepted: Callable[[ServerGoalHandle], None],
) -> ActionServer:
    """Create an action server; each goal ends with the result of the goal's `AcceptedGoal`."""
    return ActionServer(
        node,
        action_type,
        action,
        execute_callback=lambda _: action_type.Result(),
        goal_callback=on_goal,
        handle_accepted_callback=on_accepted,
        cancel_callback=lambda _: CancelResponse.ACCEPT,
        result_timeout=_RESULT_TIMEOUT_SEC,
    )


class AcceptedGoal:
    """An accepted goal, from acceptance to its end.

    Args:
        handle: The goal's handle.
        began: The time of acceptance, simulated seconds.
        action_type: The type of the goal's action.
    """

    def __init__(self, handle: ServerGoalHandle, began: float, action_type: Any = NavigateToPose) -> None:
        self.handle, self.began, self.action_type = handle, began, action_type
        self._outcome = Future()

    def finish(self, outcome: DriveOutcome) -> None:
        """End the goal; the client is notified in the executor's next round."""
        self._outcome.set_result(outcome)

    async def run(self, handle: ServerGoalHandle) -> Any:
        """Wait for the end of the goal, and return the goal's result."""
        outcome: DriveOutcome = await self._outcome
        if outcome.ending is DriveEnd.SUCCEEDED:
            handle.succeed()
        elif outcome.ending is DriveEnd.CANCELED:
            handle.canceled()
        else:
            handle.abort()
        return self.action_type.Result(error_code=self._error_code(outcome.code), error_msg=outcome.text)

    def _error_code(self, code: int) -> int:
        return int(code)


class _Goal(AcceptedGoal):
    """A goal that the robot drives to.

    Attributes:
        poses: The remaining poses in order; a goal of `navigate_to_pose` has a single pose.
        tree: The file of the requested behaviour tree; empty for the default tree.
    """

    def __init__(
        self,
        handle: ServerGoalHandle,
        fault: Fault | None,
        began: float,
        manner: DrivingManner,
        action_type: Any,
    ) -> None:
        super().__init__(handle, began, action_type)
        self.leads_through = action_type is not NavigateToPose
        self.poses = poses_of(handle.request)
        self.tree = str(handle.request.behavior_tree)
        self.fault = fault
        self.drive: Drive | None = None
        self.progress: DriveProgress | None = None
        self.recovery: tuple[Recovery, float] | None = None
        self.recoveries_left = list(manner.recoveries)
        self.recoveries_begun = 0
        self.localised_at = began
        self._check_interval_sec, self._next_check = manner.looks_back_sec, began

    def remove_passed_poses(self, here: Pose2D, now: float) -> bool:
        """Remove the intermediate poses that the robot has passed; return whether any were removed."""
        if now < self._next_check or self.handle.is_cancel_requested:
            return False
        self._next_check = now + self._check_interval_sec
        before = len(self.poses)
        while self.poses[1:] and _distance(self.poses[0], here) < _PASSED_M:
            del self.poses[0]
        return len(self.poses) < before

    def count_remaining_poses(self, message: Any) -> Any:
        """Add the number of remaining poses to a feedback message of `navigate_through_poses`; return the message."""
        if self.leads_through:
            message.number_of_poses_remaining = len(self.poses)
        return message

    def _error_code(self, code: int) -> int:
        of_planner = self.leads_through and NavCode.TF_ERROR <= code <= NavCode.NO_VALID_PATH
        return int(code) + (_THROUGH_CODES if of_planner else 0)


def _refusal(goal: _Goal, active_goal: _Goal | None) -> DriveOutcome | None:
    """Return the outcome of an accepted goal that is aborted at once; None if the robot drives to the goal."""
    if active_goal is not None and active_goal.action_type is not goal.action_type:
        return DriveOutcome(DriveEnd.ABORTED, text="another navigator is processing")
    if not goal.poses:
        return DriveOutcome(DriveEnd.ABORTED, _NO_POSES, "the goal contains no pose to drive through")
    if active_goal is not None and goal.tree != active_goal.tree:
        return DriveOutcome(DriveEnd.ABORTED, text="another goal with another behaviour tree is active")
    return None


def end_of_replaced_goal(goal: AcceptedGoal) -> DriveOutcome:
    """Return the outcome of a goal that another goal replaces: cancelled if this was requested, else aborted."""
    if goal.handle.is_cancel_requested:
        return DriveOutcome(DriveEnd.CANCELED)
    return DriveOutcome(DriveEnd.ABORTED, text="pre-empted by another goal")


def _distance(pose: Any, here: Pose2D) -> float:
    return math.hypot(pose.pose.position.x - here.x, pose.pose.position.y - here.y)


def poses_of(request: Any) -> list[Any]:
    """Return the poses of a goal of `navigate_to_pose` or `navigate_through_poses`."""
    return list(request.poses) if hasattr(request, "poses") else [request.pose]


@dataclass(frozen=True)
class NavigationSetup:
    """The data shared by the Nav2 substitutes of all robots.

    Attributes:
        occupancy: The map.
        planner: Plans the paths on the map.
        places: The positions of the locations to which faults refer, metres, frame `map`.
        faults: The faults to inject in the navigation of each robot.
    """

    occupancy: OccupancyMap
    planner: Planner
    places: Mapping[str, tuple[float, float]]
    faults: FaultPlan


class BtNavigator:
    """The node `bt_navigator`, which serves `navigate_to_pose`, `navigate_through_poses` and `bt_navigator/get_state`.

    The node also serves `compute_path_to_pose` and publishes the topic `plan`, like Nav2's planner.

    A new goal preempts the current goal, which is aborted with error code 0. A new goal that belongs to the other action, or has another
    behaviour tree than the current goal, is itself aborted instead.

    Args:
        host: Creates the node.
        rosbot: The robot to drive with velocity commands.
        navigation: The data that the Nav2 substitutes of all robots share.
        localise: Returns the robot's pose in `map`, or None while there is no transform.
        lose_localisation: Makes the localisation disappear, until a simulated time in seconds or permanently (None).
        manner: The manner of driving.

    Attributes:
        node_name: The name of the node.
    """

    node_name = "bt_navigator"

    def __init__(
        self,
        host: NodeHost,
        rosbot: RobotInterface,
        navigation: NavigationSetup,
        localise: Callable[[], Pose2D | None],
        *,
        lose_localisation: Callable[[float | None], object] = lambda _: None,
        manner: DrivingManner = QUICK,
    ) -> None:
        self._now = 0.0
        self._active_at: float | None = None
        self._host, self._rosbot, self._localise, self._manner = host, rosbot, localise, manner
        self._lose_localisation = lose_localisation
        self._planner, self._places = navigation.planner, navigation.places
        self._faults = navigation.faults.for_navigation()
        self._back_at: float | None = None
        self._goal: _Goal | None = None
        # A drive that outlasts its goal, with the time at which it ends, and the delayed goal responses, with their times.
        self._orphaned_drive: tuple[Drive, float] | None = None
        self._delayed: list[tuple[float, Future]] = []
        self._server: ActionServer | None = None
        self._through: ActionServer | None = None
        self._planner_server: PlannerServer | None = None
        self._open()

    @property
    def active(self) -> bool:
        """Whether the lifecycle state is active."""
        return self._active_at is not None and self._now >= self._active_at

    def step(self, step: int, now_ns: int) -> None:
        """Advance the navigation to the simulated time *now_ns*, in nanoseconds."""
        self._now = now_ns / 1e9
        if self._server is None:
            if self._back_at is not None and self._now >= self._back_at:
                self._open()
            return
        if self._active_at is None and self._localise() is not None:
            self._active_at = self._now + ACTIVATION_SEC
        self._send_delayed_responses()
        if self._goal is not None:
            self._update_goal(self._goal, feedback_due=step % _FEEDBACK_EVERY == 0)
        elif self._orphaned_drive is not None:
            self._continue_orphaned_drive(*self._orphaned_drive)

    def stop(self) -> bool:
        """End the current goal; return whether there was a goal. The client of this goal must still be notified."""
        goal = self._goal
        if goal is not None and goal.handle.is_cancel_requested:
            self._end(DriveOutcome(DriveEnd.CANCELED))
        else:
            self._end(DriveOutcome(DriveEnd.ABORTED, text="the simulation has stopped"))
        return goal is not None

    def close(self) -> None:
        """Destroy the servers and the node without notifying clients."""
        self._goal = None
        if self._server is not None:
            # A server that is not destroyed keeps its node in the graph.
            for server in filter(None, (self._server, self._through, self._planner_server)):
                server.destroy()
            self._server = None
            self._host.destroy(self._node)

    def _open(self) -> None:
        self._active_at = None
        self._node = self._host.create(self.node_name)
        self._lines: Publisher | None = None
        self._plan = self._node.create_publisher(PathMessage, "plan", 1)
        self._serve()
        self._planner_server = PlannerServer(
            self._node,
            self._planner,
            self._localise,
            lambda: self.active,
            tolerance=self._manner.tolerance,
        )

    def _serve(self) -> None:
        """Serve the navigator's actions and report its lifecycle state."""
        self._node.create_service(
            GetState,
            f"{self.node_name}/get_state",
            lambda _, response: set_lifecycle_state(response, active=self.active),
        )
        # With this service, other nodes can stop a drive whose goal has ended, as with Nav2's controller_server.
        self._node.create_service(CancelGoal, f"{FOLLOW}/_action/cancel_goal", self._on_stop)
        self._server = serve_goals(self._node, NavigateToPose, NAVIGATE, self._on_goal, self._on_accepted)
        self._through = serve_goals(
            self._node,
            NavigateThroughPoses,
            THROUGH,
            self._on_goal,
            partial(self._on_accepted, action_type=NavigateThroughPoses),
        )

    def _die(self, back_sec: float | None) -> None:
        """Disappear without notice, like a killed process."""
        self._node.get_logger().warning(f"Fault: {self.node_name} disappears.")
        self._back_at = None if back_sec is None else self._now + back_sec
        # The goal's coroutine is never resumed, because ending the goal would send a result.
        self.close()

    def _on_stop(self, _: Any, response: Any) -> Any:
        if self._goal is None and self._orphaned_drive is not None:
            self._orphaned_drive = None
            self._rosbot.drive(STAND)
        return response

    def _send_delayed_responses(self) -> None:
        """Send the delayed goal responses that are due."""
        due = [each for each in self._delayed if self._now >= each[0]]
        self._delayed = [each for each in self._delayed if each not in due]
        for _, response in due:
            response.set_result(None)

    async def _on_goal(self, _: Any) -> GoalResponse:
        if self._faults.delay_sec:
            self._node.get_logger().warning("Fault: the response to a goal is delayed.")
            response = Future()
            self._delayed.append((self._now + self._faults.delay_sec, response))
            await response
        if not self.active:
            self._node.get_logger().warning(f"A goal was rejected, because {self.node_name} is not active.")
            return GoalResponse.REJECT
        if self._faults.should_reject():
            self._node.get_logger().warning("Fault: a goal is rejected.")
            return GoalResponse.REJECT
        return GoalResponse.ACCEPT

    def _on_accepted(self, handle: ServerGoalHandle, action_type: Any = NavigateToPose) -> None:
        poses = poses_of(handle.request)
        target = from_pose(poses[0].pose) if poses else None
        if target is not None:
            place = f"({target.x:.2f}, {target.y:.2f}, yaw {target.yaw:.2f})"
            self._node.get_logger().debug(f"Goal accepted: {place}.")
        fault = self._faults.fault_for_goal(self._nearest_location(target))
        goal = _Goal(handle, fault, self._now, self._manner, action_type)
        handle.execute(goal.run)
        active_goal = self._goal
        refused = _refusal(goal, active_goal)
        if refused is not None:
            self._node.get_logger().warning(f"Goal aborted ({int(refused.code)}): {refused.text}.")
            goal.finish(refused)
            return
        if active_goal is not None:
            active_goal.finish(end_of_replaced_goal(active_goal))
        self._goal, self._orphaned_drive = goal, None

    def _update_goal(self, goal: _Goal, *, feedback_due: bool) -> None:
        is_first = goal.drive is None and goal.recovery is None
        if is_first and not self._manner.knows_distance_at_once:
            message = goal.action_type.Feedback(number_of_recoveries=goal.recoveries_begun)
            goal.handle.publish_feedback(goal.count_remaining_poses(message))
        outcome = self._end_by_fault(goal) or (
            self._drive_step(goal) if goal.recovery is None else self._recover(goal)
        )
        if feedback_due and goal.progress is not None:
            goal.handle.publish_feedback(self._feedback(goal, goal.progress))
        fault, is_driving = goal.fault, goal.drive is not None and self._now - goal.began >= _DIES_AFTER_SEC
        if fault is not None and fault.kind == "die" and is_driving:
            goal.fault = None
            self._kill(fault)
        elif outcome is not None:
            self._end(outcome)

    def _kill(self, fault: Fault) -> None:
        """Make the node that is named by a fault disappear."""
        if fault.target == LOCALISATION:
            self._lose_localisation(None if fault.back is None else self._now + fault.back)
        else:
            self._die(fault.back)

    def _end_by_fault(self, goal: _Goal) -> DriveOutcome | None:
        """Return the outcome that a fault causes for a goal; None if the fault is not due or causes no outcome."""
        fault = goal.fault
        if fault is None or fault.kind == "die":
            return None
        if fault.kind == "succeed":
            self._node.get_logger().warning("Fault: a goal succeeds, although the robot has not moved.")
            return DriveOutcome(DriveEnd.SUCCEEDED)
        if fault.kind == "late":
            return self._end_late(goal, fault)
        due_sec = _DIES_AFTER_SEC if fault.kind == "starved" else fault.seconds
        if self._now - goal.began < due_sec or (fault.kind == "starved" and goal.drive is None):
            return None
        if fault.kind == "starved":
            self._log_for_node("tf_help", "Transform data too old when converting from map to odom")
            return DriveOutcome(DriveEnd.ABORTED)
        code = fault.code or NavCode.NO_VALID_PATH
        return DriveOutcome(DriveEnd.ABORTED, code, "fault: the goal is aborted")

    def _end_late(self, goal: _Goal, fault: Fault) -> DriveOutcome | None:
        """Return the outcome of a goal that `controller_server` accepts too late; let the robot drive nevertheless."""
        if fault.seconds <= _SERVER_TIMEOUT_SEC:
            return None
        outcome = self._start_drive(goal)
        if goal.drive is not None:
            self._orphaned_drive = goal.drive, self._now + fault.drives
        text = f"Timed out while waiting for action server to acknowledge goal request for {FOLLOW}"
        client = _CLIENT.format(THROUGH if goal.leads_through else NAVIGATE)
        namespace = self._node.get_namespace().strip("/").replace("/", ".")
        self._log_for_node(f"{namespace}.{client}".lstrip("."), text)
        return outcome or DriveOutcome(DriveEnd.ABORTED)

    def _log_for_node(self, name: str, text: str) -> None:
        """Log a line under the name of another node's logger."""
        if self._lines is None:
            latched = QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL)
            self._lines = self._node.create_publisher(Log, "/rosout", latched)
        stamp = to_stamp(round(self._now * 1e9))
        self._lines.publish(Log(stamp=stamp, level=_LEVEL, name=name, msg=text))
        self._node.get_logger().info(f"Fault, as {name}: {text}.")

    def _drive_step(self, goal: _Goal) -> DriveOutcome | None:
        """Drive for a step; return the outcome if the goal ends."""
        if goal.drive is None and (refused := self._start_drive(goal)) is not None:
            return self._recover_or_end(goal, refused)
        here = self._localise()
        if goal.drive is None or here is None:
            is_lost = self._now - goal.localised_at > _LOST_AFTER_SEC
            return DriveOutcome(DriveEnd.ABORTED, text="the robot's pose is unknown") if is_lost else None
        goal.localised_at = self._now
        if goal.handle.is_cancel_requested:
            goal.drive.brake()
        goal.progress = self._step(goal.drive, here)
        outcome = goal.progress.outcome
        if outcome is None and goal.remove_passed_poses(here, self._now):
            outcome = self._start_drive(goal)
        return None if outcome is None else self._recover_or_end(goal, outcome)

    def _step(self, drive: Drive, here: Pose2D) -> DriveProgress:
        progress = drive.step(replace(self._rosbot.state, pose=here), self._now)
        self._rosbot.drive(progress.command)
        return progress

    def _recover_or_end(self, goal: _Goal, outcome: DriveOutcome) -> DriveOutcome | None:
        """Start a recovery after a failed attempt; if no recovery is left or possible, return the goal's outcome."""
        if outcome.code not in _RECOVERABLE or not goal.recoveries_left:
            return outcome
        recovery = goal.recoveries_left.pop(0)
        goal.recoveries_begun += 1
        self._node.get_logger().info(f"{outcome.text}: the robot {recovery.name}.")
        goal.recovery, goal.drive = (recovery, self._now + recovery.duration_sec), None
        return None

    def _recover(self, goal: _Goal) -> DriveOutcome | None:
        assert goal.recovery is not None  # noqa: S101 - the caller checks it
        recovery, until = goal.recovery
        if goal.handle.is_cancel_requested:
            self._rosbot.drive(STAND)
            return DriveOutcome(DriveEnd.CANCELED) if self._rosbot.state.velocity == STAND else None
        over = self._now >= until
        self._rosbot.drive(STAND if over else recovery.command)
        if over:
            goal.recovery = None
        return None

    def _continue_orphaned_drive(self, drive: Drive, until: float) -> None:
        """Follow the path of a goal that has already ended."""
        here = self._localise()
        if here is not None and self._now < until and self._step(drive, here).outcome is None:
            return
        self._orphaned_drive = None
        self._rosbot.drive(STAND)

    def _start_drive(self, goal: _Goal) -> DriveOutcome | None:
        """Plan the path through the remaining poses of a goal; if there is no path, return the goal's outcome."""
        if goal.handle.is_cancel_requested:
            return DriveOutcome(DriveEnd.CANCELED)
        targets, here = [from_pose(each.pose) for each in goal.poses], self._localise()
        if goal.tree and not is_file(goal.tree):
            return DriveOutcome(DriveEnd.ABORTED, text=f"there is no behaviour tree '{goal.tree}'")
        wrong_frame = next(
            (each.header.frame_id for each in goal.poses if each.header.frame_id != _MAP), None
        )
        known = [each for each in targets if each is not None]
        if wrong_frame is not None or here is None or len(known) < len(targets):
            reason = "the robot's pose is unknown" if here is None else "a pose of the goal is malformed"
            if wrong_frame is not None:
                reason = f"the goal's frame is '{wrong_frame}', not '{_MAP}'"
            return DriveOutcome(DriveEnd.ABORTED, text=reason)
        *via, last = known
        limits = self._rosbot.limits
        try:
            goal.drive = Drive(self._planner, limits, last, here, self._now, self._manner, via)
        except PlanningError as error:
            goal.drive = None
            return DriveOutcome(DriveEnd.ABORTED, error.code, str(error))
        self._plan.publish(to_path(goal.drive.path, to_stamp(round(self._now * 1e9))))
        return None

    def _end(self, outcome: DriveOutcome) -> None:
        if self._goal is None:
            return
        if outcome.ending is DriveEnd.ABORTED and outcome.text:
            self._node.get_logger().warning(f"Goal aborted ({int(outcome.code)}): {outcome.text}.")
        if self._orphaned_drive is None:
            self._rosbot.drive(STAND)
        self._goal.finish(outcome)
        self._goal = None

    def _feedback(self, goal: _Goal, progress: DriveProgress) -> Any:
        message = goal.action_type.Feedback(
            navigation_time=to_duration(self._now - goal.began),
            estimated_time_remaining=to_duration(progress.time_remaining_sec),
            number_of_recoveries=goal.recoveries_begun,
            distance_remaining=progress.distance_remaining,
        )
        message.current_pose.header.frame_id = _MAP
        message.current_pose.header.stamp = to_stamp(round(self._now * 1e9))
        message.current_pose.pose = to_pose(self._localise() or ORIGIN)
        return goal.count_remaining_poses(message)

    def _nearest_location(self, goal: Pose2D | None) -> str | None:
        if goal is None or not self._places:
            return None
        distances = {name: goal.distance_to(Pose2D(*place)) for name, place in self._places.items()}
        nearest = min(distances, key=distances.__getitem__)
        return nearest if distances[nearest] < _PLACE_REACH else None
