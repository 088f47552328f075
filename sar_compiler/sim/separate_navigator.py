"""The stand-in for Nav2's navigator in a process of its own, which has another one drive."""

import time
from typing import Any

from lifecycle_msgs.srv import GetState
from nav2_msgs.action import NavigateToPose
from rclpy.action import ActionClient, ActionServer, CancelResponse, GoalResponse
from rclpy.action.client import ClientGoalHandle
from rclpy.action.server import ServerGoalHandle
from rclpy.task import Future

from sar_compiler.ros.leaves.goal_statuses import ABORTED, CANCELED, SUCCEEDED
from sar_compiler.sim.bt_navigator import (
    ACTIVATION_SEC,
    FOLLOW,
    NAVIGATE,
    RESULT_TIMEOUT_SEC,
    AcceptedGoal,
    tell_state,
)
from sar_compiler.sim.manner import Manner
from sar_compiler.sim.navigator import DriveEnd, DriveOutcome
from sar_compiler.sim.node_host import NodeHost
from sar_compiler.sim.remote_robot import RemoteRobot

# Who drives says ten times a second where; silent for so long, it is taken for dead, seconds of both clocks.
_SILENCE_SEC = 0.5
_ENDS = {SUCCEEDED: DriveEnd.SUCCEEDED, ABORTED: DriveEnd.ABORTED}


class _PassedOn(AcceptedGoal):
    """A goal that another process drives to."""

    def __init__(self, handle: ServerGoalHandle, began: float) -> None:
        super().__init__(handle, began)
        self.taken: ClientGoalHandle | None = None
        self.is_called_off = False
        self.heard_at = began, time.monotonic()

    def hear(self, now: float) -> None:
        """Note that who drives has said something, at a simulated time, seconds."""
        self.heard_at = now, time.monotonic()

    def silence_sec(self, now: float) -> float:
        """Return for how long it has said nothing, seconds of the clock that is slower."""
        return min(now - self.heard_at[0], time.monotonic() - self.heard_at[1])


class SeparateNavigator:
    """Node `bt_navigator`: `navigate_to_pose`, each goal of which `follow_path` of `controller_server` drives to.

    It gives a goal up with code 0, as Nav2 does, where nobody takes it within `default_server_timeout`, or who drives falls silent;
    what took it too late drives on.

    Args:
        host: Creates the node.
        robot: The robot, whose localisation it waits for.
        manner: Has the time-out.
    """

    def __init__(self, host: NodeHost, robot: RemoteRobot, manner: Manner) -> None:
        self._robot, self._timeout_sec = robot, manner.server_timeout_sec
        self._now = 0.0
        self._active_at: float | None = None
        self._goal: _PassedOn | None = None
        self._node = host.create("bt_navigator")
        self._node.create_service(
            GetState, "bt_navigator/get_state", lambda _, response: tell_state(response, active=self.active)
        )
        self._driver = ActionClient(self._node, NavigateToPose, FOLLOW)
        self._server = ActionServer(
            self._node,
            NavigateToPose,
            NAVIGATE,
            execute_callback=lambda _: NavigateToPose.Result(),
            goal_callback=lambda _: GoalResponse.ACCEPT if self.active else GoalResponse.REJECT,
            handle_accepted_callback=self._on_accepted,
            cancel_callback=lambda _: CancelResponse.ACCEPT,
            result_timeout=RESULT_TIMEOUT_SEC,
        )

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
            if goal.silence_sec(self._now) > self._timeout_sec:
                self._give_up(goal, f"{FOLLOW} has not taken the goal in time")
            return
        if goal.handle.is_cancel_requested and not goal.is_called_off:
            goal.is_called_off = True
            goal.taken.cancel_goal_async()
        if goal.silence_sec(self._now) > _SILENCE_SEC:
            self._give_up(goal, f"{FOLLOW} has fallen silent")

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

    def _on_accepted(self, handle: ServerGoalHandle) -> None:
        goal, before = _PassedOn(handle, self._now), self._goal
        handle.execute(goal.run)
        if before is not None:
            before.end(DriveOutcome(DriveEnd.ABORTED, text="pre-empted by another goal"))
        self._goal = goal

        def pass_on(message: Any) -> None:
            goal.hear(self._now)
            if goal is self._goal:
                handle.publish_feedback(message.feedback)

        sent = self._driver.send_goal_async(handle.request, pass_on)
        sent.add_done_callback(lambda answer: self._on_answer(goal, answer))

    def _on_answer(self, goal: _PassedOn, answer: Future) -> None:
        taken = answer.result()
        if not taken.accepted:
            self._give_up(goal, f"{FOLLOW} has refused the goal")
            return
        goal.taken = taken
        goal.hear(self._now)
        taken.get_result_async().add_done_callback(lambda result: self._on_result(goal, result.result()))

    def _on_result(self, goal: _PassedOn, result: Any) -> None:
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
