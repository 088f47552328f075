"""The base class of leaves that call a ROS action."""

import math
import time
from abc import abstractmethod
from collections.abc import Collection, Mapping
from typing import Any, ClassVar, cast

from py_trees.common import Status

from sar_compiler.nodes.nav2.log_lines import NAVIGATOR
from sar_compiler.nodes.spec import MARK, Use
from sar_compiler.ros.clock import Deadline
from sar_compiler.ros.leaves.arrivals import Arrival, drives_to_pose, goal_destination
from sar_compiler.ros.leaves.goals import (
    ABORTED,
    SUCCEEDED,
    ActionGoal,
    ActionPort,
    GoalSender,
    GoalStatuses,
    describe_status,
    goal_statuses_of,
)
from sar_compiler.ros.lifecycle import LifecycleNodes
from sar_compiler.ros.nav2_log import nav2_log
from sar_compiler.ros.robot_estimate import RobotEstimate, Standstill, robot_estimate
from sar_compiler.runtime.clock import clock_text

_NAV2 = "nav2_msgs."
# The maximum pause between two attempts, as a multiple of the first pause.
_LONGEST_PAUSE = 8.0
# The leaf holds after this number of consecutive goals that failed for reasons other than the goal itself.
_HOLDS_AT = 3
# If a robot has driven this distance on a goal, in metres, it makes progress, and the failures are counted from 0 again.
_PROGRESS_M = 0.5
# Nav2 logs the reason for the end of a goal at most this time, in seconds, before or after the end.
_REASON_BEFORE_SEC, _REASON_AFTER_SEC = 1.0, 0.3


class ActionLeaf(GoalSender):
    """A leaf that sends one goal to an action server in each activation, and is RUNNING until the goal has ended.

    If the leaf is interrupted, the goal is cancelled, even if the server has not accepted it yet. Responses to an
    earlier goal never affect a later goal.

    If a goal fails for a reason other than the goal itself, the leaf stays RUNNING, waits, and sends the goal again. This applies while a
    goal of another client, or a goal of `rivals`, is active. If the leaf uses `Use.nav2()`, this also applies if there is no server, the
    server does not accept the goal in time or is silent, a node of Nav2 is inactive or does not respond, or transforms have stopped. After
    `hold_timeout_sec`, the leaf calls `on_unavailable`. If two attempts in a row were rejected or aborted at once, the leaf pauses before
    the next attempt, even if the tree starts it again.

    A navigation goal that has succeeded does not prove that the robot has arrived. If the localisation places the robot farther from the
    goal than the run's `arrival_tolerance_m`, the robot has not arrived (`has_not_arrived`). If the localisation provides no pose, a
    succeeded goal counts as an arrival.

    Every failure that the target of a goal causes has an error code. So the target is not the cause if the robot has not arrived, or if
    Nav2 aborts a goal without an error code (0). A leaf that uses Nav2 then calls `on_hold`, and sends the goal again after a pause. The
    pause doubles with each such failure in a row. From the third failure on, the leaf tries for at most `hold_timeout_sec`, and then calls
    `on_unavailable`. The count starts again when the robot has driven half a metre on a goal, or a goal has ended in another way.

    The end of a goal does not prove that the robot stands still. A leaf that uses Nav2 is RUNNING until the odometry shows
    a standstill, for at most `settle_timeout_sec`. Without odometry, the leaf ends together with the goal.

    Attributes:
        action_type: `"package/action/Name"`, or the Python class.
        action_name: The (relative) name of the action.
        server_timeout_sec: The maximum wait for a server before the goal is sent, in seconds.
        acceptance_timeout_sec: The maximum wait, in seconds, for the acceptance of a goal. The same limit applies to the wait for the end
            of a goal that this node has sent to an action in `rivals`.
        feedback_timeout_sec: The maximum time without feedback after the first feedback, in seconds; None for no limit. If the server sends
            no feedback, the attribute limits the time without responses to other requests (None stands for `server_timeout_sec`). For a
            leaf that uses Nav2, the limit is 2 s while `bt_navigator` does not respond.
        feedback_period_sec: The minimum interval between two reads of feedback, in seconds; 0 to read the latest feedback in
            each tick.
        absence_timeout_sec: The maximum time for which the server may be missing from the ROS graph while the goal is active,
            in seconds.
        hold_timeout_sec: The maximum time for which an activation waits until the server can accept the goal, in seconds.
        pause_sec: The first pause between two attempts, in seconds; 0 for no pauses. The pause doubles with each failure.
        rivals: The (relative) names of other actions. While a goal of one of these actions is active, the server cannot accept a goal of
            this action.
        interface: The Python class of the action; available after the leaf's setup.
        has_not_arrived: Whether the last goal has succeeded although the robot has not arrived. The attribute is reset to False when a goal
            is sent.

    Example:
        A leaf that docks at a port's value::

            class Dock(ActionLeaf):
                action_type = "nav2_msgs/action/DockRobot"
                action_name = "dock_robot"

                def __init__(self, name: str, dock: Input[str]) -> None:
                    super().__init__(name)
                    self._dock = dock

                def goal(self) -> Any:
                    return self.interface.Goal(dock_id=self._dock.get())
    """

    required_attributes: ClassVar[Mapping[str, str]] = {
        "action_type": "nav2_msgs/action/NavigateToPose",
        "action_name": "navigate_to_pose",
    }
    """The attributes that a subclass must set, in the class or in its constructor, each with an example. `checks.leaf_classes` checks these
    attributes.
    """
    use_kind: ClassVar[str] = "action"
    """The kind of the `Use` with which a leaf is registered."""
    action_type: Any = None
    action_name: str = ""
    feedback_period_sec: float = 0.0
    hold_timeout_sec: float = 60.0
    pause_sec: float = 1.0
    rivals: Collection[str] = ()

    def __init__(self, name: str) -> None:
        super().__init__(name)
        self._port: ActionPort | None = None
        self._goals_given_up: list[ActionGoal] = []
        self._hold: Deadline | None = None
        self._held: ActionGoal | None = None
        self._pause: Deadline | None = None
        self._failures = 0
        self._has_asked = False
        self._under_way = ""
        self._next_feedback = Deadline(0.0, self._clock)
        self._robot: RobotEstimate | None = None
        self._rest: Standstill | None = None
        self._turn: Deadline | None = None
        self._arrival: Arrival | None = None
        self.has_not_arrived = False
        self._rivals: list[GoalStatuses] = []
        # The row of goals that failed for reasons other than the goal itself: the last goal, the number of goals, the last
        # reason, the deadline for attempts, and the robot's pose when it set out for the current goal.
        self._lost: ActionGoal | None = None
        self._lost_count = 0
        self._lost_words = ""
        self._lost_until: Deadline | None = None
        self._set_out_from: tuple[float, float, float] | None = None

    @abstractmethod
    def goal(self) -> Any:
        """Return the goal to send, an `interface.Goal`.

        To send no goal, return a `Status`: SUCCESS and FAILURE end the leaf. After RUNNING, this method is called again in
        the next tick.
        """

    def on_feedback(self, feedback: Any) -> Status | None:  # noqa: ARG002 - for subclasses
        """Handle the latest feedback; called at most once in `feedback_period_sec`.

        Returns:
            SUCCESS or FAILURE to end the leaf and cancel the goal; None or RUNNING to continue.
        """
        return None

    def on_result(self, status: int, result: Any) -> Status:
        """Return the leaf's status when the goal has ended; return RUNNING to send another `goal`.

        By default, the status is SUCCESS if the goal's status is `STATUS_SUCCEEDED`. Otherwise the status is FAILURE, and the leaf reports
        the error in the result.

        Args:
            status: The goal's status, a constant of `action_msgs/msg/GoalStatus`.
            result: The goal's result, an `interface.Result`.
        """
        return Status.SUCCESS if status == SUCCEEDED else self.on_failure(describe_status(status, result))

    def on_hold(self, obstacle: str) -> None:
        """Called with the reason when the leaf starts to wait for the server, or plans to send a failed goal again."""

    def on_available(self) -> None:
        """Called when the server has responded, or when a goal ends a series of failures."""

    def on_unavailable(self, reason: str) -> Status:
        """Return the leaf's status after a wait of `hold_timeout_sec`; by default, the status of `on_failure`."""
        return self.on_failure(reason)

    def nav2_reason(self) -> str:
        """Return the lines of Nav2's log that explain why the last goal has ended; empty if there are no such lines."""
        goal = self._exchange
        if goal is None or self._robot is None:
            return ""
        return nav2_log(self.node).quote(since=goal.ended_at - _REASON_BEFORE_SEC)

    def shutdown(self) -> None:
        """Cancel an active goal, and release the clients.

        While a goal may be active, the clients are not destroyed, because a goal that is accepted later must still be
        cancelled.
        """
        self._drop()
        if self._port is not None and self.is_settled():
            self._port.release()
        self._port = None
        super().shutdown()

    def is_settled(self) -> bool:
        """Return whether all goals of earlier activations have ended. Request the cancellation of active goals again.

        A goal that was abandoned because its server does not respond counts as ended when the server has disappeared.
        """
        for goal in (*self._goals_given_up, *filter(None, [self._exchange])):
            goal.chase()
        self._goals_given_up = [goal for goal in self._goals_given_up if not self._is_over(goal)]
        now = self._exchange
        return not self._goals_given_up and (now is None or now.may_be_active or self._is_over(now))

    def _is_over(self, goal: ActionGoal) -> bool:
        return goal.has_ended or bool(goal.trouble and goal.server_is_gone)

    def _server(self) -> tuple[str, str, Any]:
        return "action", self.action_name, self.action_type

    def _connect(self) -> None:
        self._port = ActionPort(self.node, self.interface, self.action_name)
        self._rivals = [goal_statuses_of(self.node, each) for each in self.rivals if each != self.action_name]
        if self._needs_nav2:
            self._robot = robot_estimate(self.node)
            self._robot.driving_nodes.update_presence()
            nav2_log(self.node)
        elif drives_to_pose(self.interface):
            robot_estimate(self.node)  # creates its subscriptions

    @property
    def _needs_nav2(self) -> bool:
        registration = getattr(type(self), MARK, None)
        return registration is not None and Use.nav2() in registration.uses

    def _message(self) -> Any:
        return self.goal()

    def _open(self, message: Any) -> ActionGoal:
        self._stop_awaiting_standstill()
        destination = goal_destination(self.interface, message)
        self._arrival = None if destination is None else Arrival(self.node, destination)
        self._set_out_from, self.has_not_arrived = None, False
        return ActionGoal(self, cast("ActionPort", self._port), message)

    def _begin(self) -> Status:
        self._has_asked = False
        if self._robot is not None:
            self._robot.driving_nodes.update_presence()
        if self._pause is not None and not self._pause.has_passed:
            self._exchange = None
            self.feedback_message = f"next attempt in {self._pause.remaining_sec:.1f} s, after {self._failures + self._lost_count} failures"
            return Status.RUNNING
        for rival in self._rivals:
            if rival.has_foreign_goal:
                self._exchange = None
                return self._wait_for_obstacle(
                    None, f"another client's goal is active on '{rival.full_name}'"
                )
            if self._waits_for_rival(rival):
                self._exchange = None
                self.feedback_message = f"waiting for the end of this mission's goal on '{rival.full_name}'"
                return Status.RUNNING
        return super()._begin()

    def _waits_for_rival(self, rival: GoalStatuses) -> bool:
        """Return whether to wait for the end of a goal that this node has sent to a rival action."""
        if not cast("ActionPort", self._port).goals.drives({rival.full_name}):
            return False
        if self._turn is None:
            self._turn = Deadline(self.acceptance_timeout_sec, self._clock)
        return not self._turn.has_passed

    def initialise(self) -> None:
        """Abandon the goal of the last activation, and send a new goal."""
        self._hold = self._turn = self._lost_until = None
        self.has_not_arrived = False
        super().initialise()

    def _judge(self, exchange: ActionGoal) -> Status:
        if (exchange.is_over or exchange.rejected) and exchange.sent and self._awaits_standstill():
            return Status.RUNNING
        if exchange.rejected or (exchange.answer is not None and exchange.answer.status != SUCCEEDED):
            return self._fail_or_hold(exchange)
        if exchange.trouble and self._robot is not None:
            return self._wait_for_server(exchange, self._robot.driving_nodes)
        if exchange.answer is not None:
            if (status := self._judge_arrival(exchange)) is not None:
                return status
            self._failures = 0
            self._clear_failures()
        return super()._judge(exchange)

    def _judge_arrival(self, goal: ActionGoal) -> Status | None:
        """Return the leaf's status if the robot may not have arrived; otherwise return None.

        The result is None if the arrival is confirmed or cannot be checked.
        """
        if self._arrival is not None and self._arrival.is_awaited():
            self.feedback_message = "waiting for the localisation to confirm the arrival"
            return Status.RUNNING
        doubt = self._arrival.reason_against if self._arrival is not None else ""
        self.has_not_arrived = bool(doubt)
        if not doubt:
            return None
        if self._robot is None:
            return self.on_unavailable(f"the server reports success, but {doubt}")
        return self._send_again(goal, doubt)

    def _wait_for_server(self, goal: ActionGoal, nodes: LifecycleNodes) -> Status:
        """Wait until the server and Nav2's nodes respond again, then send the goal again."""
        if not self._has_asked:
            self._has_asked = True
            nodes.ignore_answers()
        obstacle = nodes.obstacle()
        is_there = obstacle == "" and not goal.server_is_gone
        if is_there and self._held is goal and self._hold is not None and not self._hold.has_passed:
            return self._begin()
        return self._wait_for_obstacle(goal, obstacle or goal.trouble)

    def _awaits_standstill(self) -> bool:
        """Return whether to wait until the robot stands still."""
        if self._robot is None:
            return False
        if self._rest is None:
            self._rest = Standstill(self, self._wake, "the end of its goal")
        return self._rest.is_awaited()

    def _stop_awaiting_standstill(self) -> None:
        if self._rest is not None:
            self._rest.give_up()
            self._rest = None

    def _fail_or_hold(self, goal: ActionGoal) -> Status:
        """Send the goal again if the server was unable to accept it before; otherwise process the failure."""
        if not self._has_asked:
            self._has_asked = True
            if self._robot is not None:
                self._robot.driving_nodes.ignore_answers()
        obstacle = self._obstacle()
        if obstacle is None:
            return Status.RUNNING
        if obstacle:
            return self._wait_for_obstacle(goal, obstacle)
        if self._held is goal:
            self._hold = None
            return self._begin()
        if self._robot is not None and _is_without_code(goal):
            return self._send_again(goal)
        self._clear_failures()
        self._count_failure(goal)
        return super()._judge(goal)

    def _send_again(self, goal: ActionGoal, doubt: str = "") -> Status:
        """Send a goal again after a pause; after the third failure in a row, limit the time for further attempts.

        Args:
            goal: A goal that was aborted without an error code, or has succeeded although the robot has not arrived.
            doubt: The reason why the robot has not arrived; empty for an aborted goal.
        """
        if self._lost is not goal:
            reason = doubt or str(getattr(goal.answer.result, "error_msg", "")) or self.nav2_reason()
            # Nav2's log arrives independently of the goal's result.
            if not reason and time.monotonic() - goal.ended_at < _REASON_AFTER_SEC:
                return Status.RUNNING
            self._lost = goal
            self._lost_count += 1
            goals = "the goal" if self._lost_count == 1 else f"{self._lost_count} goals in a row"
            self._report_lost(
                f"Nav2 reports success of {goals}, but {doubt}"
                if doubt
                else f"Nav2 has aborted {goals} without an error code ({reason or 'no Nav2 node has logged a reason'})"
            )
        self.feedback_message = self._lost_words
        if self._lost_until is not None and self._lost_until.has_passed:
            self._lost_until = None
            return self.on_unavailable(f"{self._lost_words}, for {self.hold_timeout_sec:g} s")
        return self._begin() if self._pause is None or self._pause.has_passed else Status.RUNNING

    def _report_lost(self, words: str) -> None:
        """Report a failed goal whose target did not cause the failure, and start the pause before the next attempt."""
        count, self._lost_words = self._lost_count, words
        pause_sec = self.pause_sec * min(2.0 ** (count - 1), _LONGEST_PAUSE)
        self._pause = Deadline(pause_sec, self._clock)
        holds = count >= _HOLDS_AT
        if holds and self._lost_until is None:
            self._lost_until = Deadline(self.hold_timeout_sec, self._clock)
        self.on_hold(self._lost_words)
        if count <= _HOLDS_AT:  # a hold is logged once
            pauses = "after growing pauses" if holds else f"in {pause_sec:g} s"
            self.warn(
                f"'{self.name}'{' holds' if holds else ''}: {self._lost_words}. The goal is sent again {pauses}."
            )

    def _clear_failures(self) -> None:
        """Reset the number of consecutive failed goals whose targets did not cause the failures."""
        self._lost_count, self._lost_until = 0, None
        self.on_available()

    def _makes_progress(self) -> bool:
        """Return whether the robot has made progress on the current goal."""
        here = self._robot.last_pose() if self._robot is not None else None
        if here is None or self._set_out_from is None:
            self._set_out_from = here
            return False
        return math.dist(here[:2], self._set_out_from[:2]) >= _PROGRESS_M

    def _wait_for_obstacle(self, goal: ActionGoal | None, obstacle: str) -> Status:
        """Wait until the server can accept goals, for at most `hold_timeout_sec`."""
        if self._hold is None:
            self._hold = Deadline(self.hold_timeout_sec, self._clock)
        if self._held is not goal:
            self._held = goal
            self.on_hold(obstacle)
        if self._hold.has_passed:
            self._hold = None
            for statuses in (cast("ActionPort", self._port).statuses, *self._rivals):
                statuses.clear()
            return self.on_unavailable(f"{obstacle}, for {self.hold_timeout_sec:g} s")
        again = " again" if goal is not None else ""
        self.warn(f"'{self.name}' waits to send its goal{again}: {obstacle}.")
        return Status.RUNNING

    def _obstacle(self) -> str | None:
        """Return why the server cannot accept goals; return '' if it can, and None if this is still unknown."""
        port = cast("ActionPort", self._port)
        if port.statuses.has_foreign_goal:
            return f"another client's goal is active on '{port.name}'"
        if self._robot is None:
            return ""
        obstacle = self._robot.driving_nodes.obstacle()
        return self._robot.lost_transforms() if obstacle == "" else obstacle

    def _count_failure(self, goal: ActionGoal) -> None:
        self._failures += 1
        if self._failures > 1:
            pause = self.pause_sec * min(2.0 ** (self._failures - 2), _LONGEST_PAUSE)
            self._pause = Deadline(pause - goal.age_sec, self._clock)

    def _progress(self, exchange: ActionGoal) -> Status:
        # `DependencyMonitor` queries the state of the node. It is silent if it has not responded within 2 s.
        navigator = self._robot.lifecycle(NAVIGATOR) if self._robot is not None else None
        if navigator is not None and navigator.is_silent and not navigator.has_heard_nothing:
            exchange.abandon_if_silent(NAVIGATOR)
        status = super()._progress(exchange)
        if not exchange.is_accepted or status is not Status.RUNNING:
            return status
        if self._lost_count and not exchange.is_over and self._makes_progress():
            self._clear_failures()
        self._show_duration(exchange)
        if not exchange.has_feedback:
            return status
        self._hold = None
        if type(self).on_feedback is ActionLeaf.on_feedback or not self._next_feedback.has_passed:
            return status
        if self.feedback_period_sec:
            self._next_feedback = Deadline(self.feedback_period_sec, self._clock)
        verdict = self.on_feedback(exchange.pop_feedback())
        if verdict is None or verdict is Status.RUNNING:
            return Status.RUNNING
        self._cancel()
        return verdict

    def _show_duration(self, goal: ActionGoal) -> None:
        """Show how long the goal has been active, unless a subclass has set its own feedback message."""
        if self.feedback_message in (self._waits, self._under_way):
            self._under_way = self.feedback_message = f"active for {clock_text(goal.age_sec)}"

    def _explain(self, exchange: ActionGoal) -> str:
        if not (exchange.rejected and self.interface.__module__.startswith(_NAV2)):
            return exchange.trouble
        registration = getattr(type(self), MARK, None)
        if registration is None or self._needs_nav2:
            return f"{exchange.trouble} Nav2 becomes active once it has an initial pose."
        return (
            f"{exchange.trouble} Nav2 becomes active once it has an initial pose. Add `Use.nav2()` to `uses` of "
            f'`@register("{registration.tag}", …)`, so that a run sends the pose at its start and waits for Nav2.'
        )

    def _conclude(self, answer: Any) -> Status:
        return self.on_result(answer.status, answer.result)

    def _on_server_answer(self) -> None:
        if self._lost_count < _HOLDS_AT:
            self.on_available()
        self._complaints.clear()
        self._wake()

    def _cancel(self) -> None:
        goal = self._exchange
        if goal is None or not goal.may_be_active:
            return
        goal.abandon()
        if goal.was_withdrawn:
            self.log(f"Canceling the goal of '{self.name}'.")
            return
        why = (
            "its server has disappeared"
            if cast("ActionPort", self._port).is_usable
            else "ROS is shut down in this process"
        )
        self.warn(
            f"The goal of '{self.name}' could not be canceled, because {why}. The robot may still be moving."
        )

    def _drop(self) -> None:
        self._stop_awaiting_standstill()
        goal = self._exchange
        self._cancel()
        super()._drop()
        goals = (*self._goals_given_up, *filter(None, [goal]))
        self._goals_given_up = [each for each in goals if not self._is_over(each)]


def _is_without_code(goal: ActionGoal) -> bool:
    """Return whether a goal was aborted with error code 0. This code means that the target is not the cause."""
    answer = goal.answer
    return answer is not None and answer.status == ABORTED and getattr(answer.result, "error_code", None) == 0
