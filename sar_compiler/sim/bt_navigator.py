"""The stand-in for Nav2's navigator: the action `navigate_to_pose`, as served by Jazzy's bt_navigator."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from lifecycle_msgs.msg import State
from lifecycle_msgs.srv import GetState
from nav2_msgs.action import NavigateToPose
from nav_msgs.msg import Path as PathMessage
from rclpy.action import ActionServer, CancelResponse, GoalResponse
from rclpy.action.server import ServerGoalHandle
from rclpy.task import Future

from sar_compiler.ros.faults import GoalFate, NavigationFaults
from sar_compiler.sim.geometry import ORIGIN, Pose2D
from sar_compiler.sim.messages import from_pose, to_duration, to_path, to_pose, to_stamp
from sar_compiler.sim.navigator import Drive, DriveEnd, DriveOutcome, DriveProgress
from sar_compiler.sim.node_host import NodeHost
from sar_compiler.sim.planner import NavCode, Planner, PlanningError
from sar_compiler.sim.robot import STAND
from sar_compiler.sim.robot_interface import RobotInterface

_MAP = "map"
# One feedback in this many steps (10 Hz at 0.05 s).
_FEEDBACK_EVERY = 2
# Simulated seconds between the first transform to `map` and the navigator's becoming active.
_ACTIVATION_SEC = 1.0
# A goal nearer than this to a zone is a goal for that zone, metres.
_ZONE_REACH = 0.5
# A server that is to die does so after this long on the way, simulated seconds.
_DIES_AFTER_SEC = 1.0
# How long results of ended goals are kept for those who ask late, seconds. Nav2 keeps them 900 s.
_RESULT_TIMEOUT_SEC = 60


class _Goal:
    """An accepted goal, from acceptance to its end."""

    def __init__(self, handle: ServerGoalHandle, fate: GoalFate) -> None:
        self.handle, self.fate = handle, fate
        self.drive: Drive | None = None
        self._outcome = Future()

    def end(self, outcome: DriveOutcome) -> None:
        """End the goal; the client is notified in the executor's next round."""
        self._outcome.set_result(outcome)

    async def run(self, handle: ServerGoalHandle) -> Any:
        """Wait for the end and return the result."""
        outcome: DriveOutcome = await self._outcome
        if outcome.ending is DriveEnd.SUCCEEDED:
            handle.succeed()
        elif outcome.ending is DriveEnd.CANCELED:
            handle.canceled()
        else:
            handle.abort()
        return NavigateToPose.Result(error_code=int(outcome.code), error_msg=outcome.text)


class BtNavigator:
    """Node `bt_navigator`: `navigate_to_pose`, `bt_navigator/get_state`, and the topic `plan` of Nav2's planner.

    A new goal pre-empts the current one, which ends aborted with error code 0. A new goal with another
    behaviour tree than the current one is aborted instead.

    Args:
        host: Creates the node.
        rosbot: The robot to drive, by its topic `cmd_vel`.
        planner: Plans the paths.
        localise: Returns the robot's pose in `map`, or None while there is no such transform.
        zones: Zone positions, metres, frame `map`, for faults.
        faults: The faults to inject.
    """

    def __init__(
        self,
        host: NodeHost,
        rosbot: RobotInterface,
        planner: Planner,
        localise: Callable[[], Pose2D | None],
        *,
        zones: Mapping[str, tuple[float, float]],
        faults: NavigationFaults,
    ) -> None:
        self._host, self._rosbot, self._planner, self._localise = host, rosbot, planner, localise
        self._zones, self._faults = zones, faults
        self._now = 0.0
        self._active_at: float | None = None
        self._back_at: float | None = None
        self._goal: _Goal | None = None
        self._server: ActionServer | None = None
        self._open()

    @property
    def active(self) -> bool:
        """Whether the lifecycle state is active."""
        return self._active_at is not None and self._now >= self._active_at

    def step(self, step: int, now_ns: int) -> None:
        """Do the work due at the simulated time *now_ns*, nanoseconds."""
        self._now = now_ns / 1e9
        if self._server is None:
            if self._back_at is not None and self._now >= self._back_at:
                self._open()
            return
        if self._active_at is None and self._localise() is not None:
            self._active_at = self._now + _ACTIVATION_SEC
        if self._goal is not None:
            self._attend(self._goal, feedback_due=step % _FEEDBACK_EVERY == 0)

    def stop(self) -> bool:
        """End the current goal; return whether there was one, whose client is still to be notified."""
        goal = self._goal
        if goal is not None and goal.handle.is_cancel_requested:
            self._end(DriveOutcome(DriveEnd.CANCELED))
        else:
            self._end(DriveOutcome(DriveEnd.ABORTED, text="the simulation stops"))
        return goal is not None

    def close(self) -> None:
        """Destroy the server and the node, without notifying clients."""
        self._goal = None
        if self._server is not None:
            # A server that lives on keeps its node in the graph.
            self._server.destroy()
            self._server = None
            self._host.destroy(self._node)

    def _open(self) -> None:
        self._active_at = None
        self._node = self._host.create("bt_navigator")
        self._node.create_service(GetState, "bt_navigator/get_state", self._on_get_state)
        self._plan = self._node.create_publisher(PathMessage, "plan", 1)
        self._server = ActionServer(
            self._node,
            NavigateToPose,
            "navigate_to_pose",
            execute_callback=lambda _: NavigateToPose.Result(),
            goal_callback=self._on_goal,
            handle_accepted_callback=self._on_accepted,
            cancel_callback=lambda _: CancelResponse.ACCEPT,
            result_timeout=_RESULT_TIMEOUT_SEC,
        )

    def _die(self, back_sec: float | None) -> None:
        """Disappear without notice, like a killed process."""
        self._node.get_logger().warning("Fault: bt_navigator disappears.")
        self._back_at = None if back_sec is None else self._now + back_sec
        # The goal's coroutine waits for ever: to end it would be to send its result.
        self.close()

    def _on_get_state(self, _: Any, response: Any) -> Any:
        if self.active:
            response.current_state = State(id=State.PRIMARY_STATE_ACTIVE, label="active")
        else:
            response.current_state = State(id=State.PRIMARY_STATE_INACTIVE, label="inactive")
        return response

    def _on_goal(self, _: Any) -> GoalResponse:
        if not self.active:
            self._node.get_logger().warning("Goal rejected: bt_navigator is not active.")
            return GoalResponse.REJECT
        if self._faults.rejects_next():
            self._node.get_logger().warning("Fault: a goal is rejected.")
            return GoalResponse.REJECT
        return GoalResponse.ACCEPT

    def _on_accepted(self, handle: ServerGoalHandle) -> None:
        target = from_pose(handle.request.pose.pose)
        if target is not None:
            place = f"({target.x:.2f}, {target.y:.2f}, yaw {target.yaw:.2f})"
            self._node.get_logger().debug(f"Goal accepted: {place}.")
        fate = self._faults.accepted(self._zone_of(target))
        goal = _Goal(handle, fate)
        handle.execute(goal.run)
        under_way = self._goal
        if under_way is not None and handle.request.behavior_tree != under_way.handle.request.behavior_tree:
            text = "another goal is under way with another behaviour tree"
            self._node.get_logger().warning(f"Goal aborted: {text}.")
            goal.end(DriveOutcome(DriveEnd.ABORTED, text=text))
            return
        if under_way is not None:
            under_way.end(DriveOutcome(DriveEnd.ABORTED, text="pre-empted by another goal"))
        self._goal = goal

    def _attend(self, goal: _Goal, *, feedback_due: bool) -> None:
        outcome = None
        if goal.drive is None:
            outcome = self._set_out(goal)
        if goal.drive is not None:
            if goal.handle.is_cancel_requested:
                goal.drive.brake()
            state = self._rosbot.robot.state
            progress = goal.drive.step(replace(state, pose=self._localise() or state.pose), self._now)
            self._rosbot.drive(progress.command)
            outcome = progress.outcome
            if feedback_due:
                goal.handle.publish_feedback(self._feedback(progress))
            if goal.fate.die and progress.elapsed_sec >= _DIES_AFTER_SEC:
                self._die(goal.fate.back_sec)
                return
        if outcome is not None:
            self._end(outcome)

    def _set_out(self, goal: _Goal) -> DriveOutcome | None:
        """Plan the path to a new goal, or return why there is none."""
        if goal.handle.is_cancel_requested:
            return DriveOutcome(DriveEnd.CANCELED)
        request = goal.handle.request.pose
        target, here = from_pose(request.pose), self._localise()
        tree = goal.handle.request.behavior_tree
        if tree and not Path(tree).is_file():
            return DriveOutcome(DriveEnd.ABORTED, text=f"there is no behaviour tree '{tree}'")
        frame = request.header.frame_id
        if frame != _MAP or target is None or here is None:
            reason = (
                f"the goal's frame is '{frame}', not '{_MAP}'" if frame != _MAP else "a pose is not known"
            )
            return DriveOutcome(DriveEnd.ABORTED, text=reason)
        if goal.fate.abort:
            return DriveOutcome(DriveEnd.ABORTED, NavCode.NO_VALID_PATH, "fault: the zone is out of reach")
        try:
            goal.drive = Drive(self._planner, self._rosbot.robot.limits, target, here, self._now)
        except PlanningError as error:
            return DriveOutcome(DriveEnd.ABORTED, error.code, str(error))
        self._plan.publish(to_path(goal.drive.path, to_stamp(round(self._now * 1e9))))
        return None

    def _end(self, outcome: DriveOutcome) -> None:
        if self._goal is None:
            return
        if outcome.ending is DriveEnd.ABORTED:
            self._node.get_logger().warning(f"Goal aborted ({int(outcome.code)}): {outcome.text}.")
        self._rosbot.drive(STAND)
        self._goal.end(outcome)
        self._goal = None

    def _feedback(self, progress: DriveProgress) -> Any:
        message = NavigateToPose.Feedback(
            navigation_time=to_duration(progress.elapsed_sec),
            estimated_time_remaining=to_duration(progress.time_remaining_sec),
            distance_remaining=progress.distance_remaining,
        )
        message.current_pose.header.frame_id = _MAP
        message.current_pose.header.stamp = to_stamp(round(self._now * 1e9))
        message.current_pose.pose = to_pose(self._localise() or ORIGIN)
        return message

    def _zone_of(self, goal: Pose2D | None) -> str | None:
        if goal is None or not self._zones:
            return None
        away = {zone: goal.distance_to(Pose2D(*place)) for zone, place in self._zones.items()}
        nearest = min(away, key=away.__getitem__)
        return nearest if away[nearest] < _ZONE_REACH else None
