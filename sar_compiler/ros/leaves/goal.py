"""One goal of a ROS action, from the request to its end, without blocking.

The leaf calls `advance` in every tick and reads `answer` and `trouble`. The server's messages arrive in callbacks,
each bound to its own goal: the answer to an old goal cannot affect a new one.
"""

import uuid
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any
from weakref import WeakMethod

from sar_compiler.ros.leaves.client_leaf import Exchange
from sar_compiler.ros.leaves.deadline import Deadline
from sar_compiler.ros.leaves.goals_under_way import goals_under_way
from sar_compiler.ros.leaves.leaf import alive
from sar_compiler.tree.showing import in_one_line

if TYPE_CHECKING:
    from rclpy.action.client import ClientGoalHandle
    from rclpy.node import Node
    from rclpy.task import Future

SUCCEEDED = 4
"""`action_msgs/msg/GoalStatus.STATUS_SUCCEEDED`."""
_ENDS = {0: "unknown to the server (was it restarted?)", 5: "canceled by somebody else", 6: "aborted"}


def describe_status(status: int) -> str:
    """Return a goal's final status other than success, in words and as a number."""
    return f"{_ENDS.get(status, 'not finished')} (status {status})"


class ActionPort:
    """A node's access to one action.

    Args:
        node: The rclpy node.
        action_type: The action's Python type.
        name: The action's (relative) name.
    """

    def __init__(self, node: "Node", action_type: Any, name: str) -> None:
        from action_msgs.srv import CancelGoal
        from rclpy.action import ActionClient

        self.name = name
        self._node = node
        self.client = ActionClient(node, action_type, name)
        # rclpy's action client cancels only goals whose acceptance it has seen.
        self.canceller = node.create_client(CancelGoal, f"{name}/_action/cancel_goal")
        self.goals = goals_under_way(node)

    @property
    def server_is_ready(self) -> bool:
        """Whether a server is available; False while ROS is shut down."""
        return self.usable and self.client.server_is_ready()

    @property
    def usable(self) -> bool:
        """Whether messages can be sent at all: the node is alive and ROS is not shut down."""
        return alive(self._node)

    def warn(self, text: str) -> None:
        """Write a warning to the node's log."""
        self._node.get_logger().warning(in_one_line(text))

    def release(self) -> None:
        """Destroy the clients; does nothing if the node, which owned them, is gone."""
        if alive(self._node):
            self.client.destroy()
            self._node.destroy_client(self.canceller)


@dataclass(frozen=True)
class GoalDeadlines:
    """The time limits of a goal, in seconds of the steady clock.

    Attributes:
        server_sec: Until there is a server.
        acceptance_sec: From sending to acceptance or rejection.
        feedback_sec: Between two feedback messages, once there was one; None for no limit.
    """

    server_sec: float
    acceptance_sec: float
    feedback_sec: float | None

    @property
    def absence_sec(self) -> float:
        """How long the server may be missing from the graph while the goal is in flight."""
        return self.server_sec if self.feedback_sec is None else self.feedback_sec


class ActionGoal(Exchange):
    """One goal, sent at most once.

    Args:
        port: The action.
        message: The goal to send.
        deadlines: The limits to keep.
        on_sending: Called just before the goal is sent.
        on_news: Called when the goal is accepted and when it has succeeded.

    Attributes:
        sent, trouble: As in every `Exchange`.
        answer: The server's final answer, with `status` (a constant of `action_msgs/msg/GoalStatus`) and
            `result`; None until then.
        rejected: Whether the server refused the goal.
    """

    _server_kind = "action"
    _reply = "no answer to the goal"

    def __init__(
        self,
        port: ActionPort,
        message: Any,
        deadlines: GoalDeadlines,
        on_sending: Callable[[], None],
        on_news: Callable[[], None],
    ) -> None:
        from unique_identifier_msgs.msg import UUID

        super().__init__(port.name, deadlines.server_sec, deadlines.acceptance_sec, on_sending)
        self.rejected = False
        self._port = port
        self._message = message
        self._deadlines = deadlines
        self._on_news = on_news
        # Its own id, so that it can be cancelled before the server has said anything.
        self._id = UUID(uuid=list(uuid.uuid4().bytes))
        self._handle: ClientGoalHandle | None = None
        self._feedback: Any = None
        self._answered = False
        self._silence: Deadline | None = None
        self._doubt: Deadline | None = None
        self._absence: Deadline | None = None
        self._cancels_under_way = 0

    @property
    def in_flight(self) -> bool:
        """Whether the server has or may have the goal, and it has not been given up."""
        return self.sent and not self.over and not self._abandoned

    @property
    def settled(self) -> bool:
        """Whether all cancel requests are answered, and no acceptance is pending that would have to be cancelled."""
        return self._cancels_under_way == 0 and not (self._abandoned and self.sent and not self._answered)

    def take_feedback(self) -> Any:
        """Return the latest feedback message, once; None if there is no new one."""
        feedback, self._feedback = self._feedback, None
        return feedback

    def _server_is_ready(self) -> bool:
        return self._port.server_is_ready

    def _send(self) -> None:
        self._port.goals.sending(self._id, self._port.canceller.service_name)
        answer = self._port.client.send_goal_async(self._message, self._weak_on_feedback(), self._id)
        answer.add_done_callback(self._on_answer)

    def _withdraw(self) -> None:
        if not self._port.usable:
            return
        if self._handle is not None:
            self._expect(self._handle.cancel_goal_async(), self._judge_cancel)
        elif self._port.canceller.service_is_ready():
            # Of use only if the server has the goal already; if not, it answers that it does not know it, and
            # the goal is cancelled when its acceptance arrives.
            from action_msgs.srv import CancelGoal

            request = CancelGoal.Request()
            request.goal_info.goal_id = self._id
            self._expect(self._port.canceller.call_async(request), lambda _: None)

    def _watch(self) -> None:
        if self._handle is None:
            super()._watch()
            return
        # The graph alone does not do: it believes in a killed server for some 20 s. Feedback alone does not do
        # either: not every server sends any.
        if self._silence is not None and self._silence.passed:
            self._give_up(f"the server has sent no feedback for {self._deadlines.feedback_sec:g} s")
        elif self._silence is None and self._doubt is not None and self._doubt.passed:
            # It may never send any, or have been replaced unnoticed: ask the server that is there now.
            self._doubt = Deadline(self._deadlines.absence_sec)
            self._request_result()
        elif self._port.server_is_ready:
            if self._absence is not None:
                # Perhaps another server than before: one that does not know the goal answers at once.
                self._absence = None
                self._request_result()
        elif self._absence is None:
            self._absence = Deadline(self._deadlines.absence_sec)
        elif self._absence.passed:
            self._give_up(f"the server has been gone for {self._deadlines.absence_sec:g} s")

    def _on_answer(self, answer: "Future") -> None:
        self._answered = True
        handle: ClientGoalHandle = answer.result()
        if not handle.accepted:
            self.rejected = True
            self._port.goals.ended(self._id)
            if not self._abandoned:
                self.trouble = "the server rejected the goal; is it active (its lifecycle state)?"
            return
        self._handle = handle
        self._doubt = Deadline(self._deadlines.absence_sec)
        self._request_result()
        if self._abandoned:
            self._withdraw()
        else:
            self._on_news()

    def _request_result(self) -> None:
        # At once, since a server forgets results; and of every goal, since rclpy keeps what it knows of a goal
        # until the result has come.
        if self._handle is not None:
            self._handle.get_result_async().add_done_callback(self._on_result)

    def _weak_on_feedback(self) -> Callable[[Any], None]:
        # rclpy never lets go of the callback of a goal that is rejected; the goal need not stay with it.
        method = WeakMethod(self._on_feedback)

        def on_feedback(message: Any) -> None:
            listener = method()
            if listener is not None:
                listener(message)

        return on_feedback

    def _on_feedback(self, message: Any) -> None:
        self._feedback = message.feedback
        if self._deadlines.feedback_sec is not None:
            self._silence = Deadline(self._deadlines.feedback_sec)

    def _on_result(self, answer: "Future") -> None:
        self._port.goals.ended(self._id)
        if self.over or self._abandoned:
            return
        self.answer = answer.result()
        if self.answer.status == SUCCEEDED:
            self._on_news()

    def _expect(self, answer: "Future", judge: Callable[[Any], None]) -> None:
        self._cancels_under_way += 1

        def on_answer(future: "Future") -> None:
            self._cancels_under_way -= 1
            judge(future.result())

        answer.add_done_callback(on_answer)

    def _judge_cancel(self, response: Any) -> None:
        # A server that refuses says so by an empty list; its return code may still be "no error".
        if response.goals_canceling:
            self._port.goals.ended(self._id)
        elif response.return_code != response.ERROR_GOAL_TERMINATED:
            self._port.warn(
                f"The server of '{self._port.name}' did not cancel the goal (return code "
                f"{response.return_code}): the robot may still be moving."
            )
