"""The goals of a node from request to end, and the statuses that servers publish.

The published statuses are a second source for the end of a goal.
"""

import math
import time
import uuid
from collections.abc import Callable, Collection
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any, NamedTuple, cast
from weakref import WeakMethod

from sar_compiler.nodes.ros_interfaces import reported_error
from sar_compiler.ros.clock import AWAKE, Deadline
from sar_compiler.ros.leaves.client_leaf import ClientLeaf, PendingCall
from sar_compiler.ros.leaves.leaf import is_node_valid, of_node, qos_profile
from sar_compiler.runtime.clock import Clock
from sar_compiler.tree.display_text import escape_to_one_line

if TYPE_CHECKING:
    from rclpy.client import Client
    from rclpy.node import Node
    from rclpy.task import Future

SUCCEEDED = 4
"""The status of a goal that has been reached, from `action_msgs/msg/GoalStatus`, like those below."""
ABORTED, CANCELED, UNKNOWN = 6, 5, 0

FINAL = (SUCCEEDED, CANCELED, ABORTED)
"""The statuses of a goal that has ended."""

_CANCEL = "/_action/cancel_goal"

_ENDS = {
    SUCCEEDED: "has arrived",
    CANCELED: "is cancelled",
    ABORTED: "was aborted",
    UNKNOWN: "the server does not know (any more)",
}

StatusListener = Callable[[int], None]
FeedbackListener = Callable[[bytes], None]

# The position of the goal's id in a serialised feedback message, after four bytes of encoding.
_GOAL_ID = slice(4, 20)


def end_in_words(status: int) -> str:
    """Describe the end of a goal, given its final status."""
    return _ENDS.get(status, f"has ended with status {status}")


def cancel_client(node: "Node", action: str) -> "Client":
    """Return a client of the service that cancels goals of an action from any client."""
    from action_msgs.srv import CancelGoal

    return node.create_client(CancelGoal, f"{action}{_CANCEL}")


def canceled_action(service: str) -> str:
    """Return the full name of the action of a cancel service."""
    return service.removesuffix(_CANCEL)


def cancel_request(goal_id: str) -> Any:
    """Return the request to cancel one goal, by its id: 32 hexadecimal digits."""
    from action_msgs.srv import CancelGoal

    request = CancelGoal.Request()
    request.goal_info.goal_id = uuid_message(goal_id)
    return request


def uuid_message(goal_id: str) -> Any:
    """Return an id, 32 hexadecimal digits, as a message."""
    from unique_identifier_msgs.msg import UUID

    return UUID(uuid=list(bytes.fromhex(goal_id)))


class GoalStatuses:
    """The latest statuses of all goals of one action, from its status topic, by their ids: 32 hexadecimal digits.

    Use `goal_statuses_of`, which knows the goals of this node.

    Args:
        node: The rclpy node.
        action: The action's (relative) name.

    Attributes:
        full_name: The full name of the action.
    """

    def __init__(self, node: "Node", action: str) -> None:
        from action_msgs.msg import GoalStatusArray

        self.full_name = canceled_action(node.resolve_service_name(f"{action}{_CANCEL}"))
        latched = qos_profile(type(self).__name__, "transient_local")
        self._listeners: dict[str, WeakMethod[StatusListener]] = {}
        self._ours: set[str] = set()
        self._latest: dict[str, int] = {}
        self._node = node
        self._topic = node.resolve_topic_name(f"{action}/_action/status")
        node.create_subscription(GoalStatusArray, f"{action}/_action/status", self._on_statuses, latched)

    @property
    def has_foreign_goal(self) -> bool:
        """Whether the server executes a goal that this node has not sent."""
        return any(status not in FINAL and goal not in self._ours for goal, status in self._latest.items())

    def end_of(self, goal: str) -> int | None:
        """Return the latest final status of a goal from the topic; None before the first one."""
        status = self._latest.get(goal)
        return status if status in FINAL else None

    def servers(self) -> frozenset[bytes]:
        """Return the identities of the action's servers: the ids of their status publishers."""
        there = self._node.get_publishers_info_by_topic(self._topic)
        return frozenset(bytes(each.endpoint_gid) for each in there)

    def clear(self) -> None:
        """Discard the latest statuses, because the server may have been replaced."""
        self._latest = {}

    def follow(self, goal: str, on_end: StatusListener) -> None:
        """Register a callback, held weakly, for the final status of this node's goals."""
        self._ours.add(goal)
        self._listeners[goal] = WeakMethod(on_end)

    def _on_statuses(self, message: Any) -> None:
        self._latest = {bytes(each.goal_info.goal_id.uuid).hex(): each.status for each in message.status_list}
        for goal, status in self._latest.items():
            if status in FINAL and (listener := self._listeners.pop(goal, lambda: None)()) is not None:
                listener(status)
        self._listeners = {goal: each for goal, each in self._listeners.items() if each() is not None}
        # A goal that has ended stays in the list for a while, and must not look foreign.
        self._ours.intersection_update({*self._latest, *self._listeners})


def goal_statuses_of(node: "Node", action: str) -> GoalStatuses:
    """Return the statuses of an action's goals, one object for the lifetime of a node."""
    return of_node(node, (GoalStatuses, action), lambda: GoalStatuses(node, action))


class GoalFeedback:
    """The serialised feedback on all goals of one action; use `goal_feedback_of`.

    Only a receiver that needs a message deserialises it.

    Args:
        node: The rclpy node.
        action_type: The action's Python type.
        action: The action's (relative) name.
    """

    def __init__(self, node: "Node", action_type: Any, action: str) -> None:
        from rclpy.qos import QoSProfile

        self._type = action_type.Impl.FeedbackMessage
        self._listeners: dict[str, WeakMethod[FeedbackListener]] = {}
        name, qos = f"{action}/_action/feedback", QoSProfile(depth=10)
        node.create_subscription(self._type, name, self._on_feedback, qos, raw=True)

    def follow(self, goal: str, on_feedback: FeedbackListener) -> None:
        """Register a callback, held weakly, for each message about a goal."""
        self._listeners = {goal: each for goal, each in self._listeners.items() if each() is not None}
        self._listeners[goal] = WeakMethod(on_feedback)

    def read(self, message: bytes) -> Any:
        """Return the feedback in a message."""
        from rclpy.serialization import deserialize_message

        return deserialize_message(message, self._type).feedback

    def _on_feedback(self, message: bytes) -> None:
        listener = self._listeners.get(message[_GOAL_ID].hex(), lambda: None)()
        if listener is not None:
            listener(message)


def goal_feedback_of(node: "Node", action_type: Any, action: str) -> GoalFeedback:
    """Return the feedback on an action's goals, one object for the lifetime of a node."""
    return of_node(node, (GoalFeedback, action_type, action), lambda: GoalFeedback(node, action_type, action))


class GoalEvent(NamedTuple):
    """A change of a goal: it is about to be sent, or has ended.

    Attributes:
        goal_id: Its id, 32 hexadecimal digits.
        action: The full name of its action.
        status: Its final status, a constant of `action_msgs/msg/GoalStatus`, 0 if no server knows it; None if it is
            about to be sent.
    """

    goal_id: str
    action: str
    status: int | None = None

    @property
    def is_over(self) -> bool:
        """Whether it has ended."""
        return self.status is not None


class ActiveGoals:
    """Notifies listeners of the goals that one node sends, by their ids (32 hexadecimal digits); use `active_goals_of`."""

    def __init__(self) -> None:
        self._active: dict[str, str] = {}
        self._lost: set[str] = set()
        self._listeners: list[Callable[[GoalEvent], None]] = []

    def __len__(self) -> int:
        """Return the number of active goals."""
        return len(self._active)

    def drives(self, actions: Collection[str]) -> bool:
        """Return whether a goal of some actions may be active, ignoring lost goals."""
        return any(action in actions and goal not in self._lost for goal, action in self._active.items())

    @property
    def may_be_active(self) -> bool:
        """Whether a goal with an observable end may be active."""
        return any(goal not in self._lost for goal in self._active)

    def active(self) -> "list[GoalEvent]":
        """Return the goals that were sent and have no observed end; thread-safe."""
        return [GoalEvent(goal_id, action) for goal_id, action in [*self._active.items()]]

    def mark_lost(self, goal_id: str) -> None:
        """Record that the server of a goal has stopped responding."""
        self._lost.add(goal_id)

    def add_listener(self, listener: Callable[[GoalEvent], None]) -> None:
        """Register a callback for each goal before it is sent and after its end."""
        self._listeners.append(listener)

    def before_sending(self, goal_id: str, action: str) -> None:
        """Record a goal just before it is sent; *action* is the full name of its action."""
        self._active[goal_id] = action
        self._notify(GoalEvent(goal_id, action))

    def mark_ended(self, goal_id: str, status: int) -> None:
        """Record that a goal was rejected or has ended.

        Args:
            goal_id: Its id.
            status: Its final status, a constant of `action_msgs/msg/GoalStatus`; 0 if it was rejected, or no server knows it.
        """
        self._lost.discard(goal_id)
        action = self._active.pop(goal_id, None)
        if action is not None:
            self._notify(GoalEvent(goal_id, action, status))

    def _notify(self, news: GoalEvent) -> None:
        for listener in self._listeners:
            listener(news)


def active_goals_of(node: "Node") -> ActiveGoals:
    """Return the goals of a node, one object for each node."""
    return of_node(node, ActiveGoals, ActiveGoals)


_FAILURES = {
    UNKNOWN: "unknown to the server (was it restarted?)",
    CANCELED: "canceled by another client",
    ABORTED: "aborted",
}
# How long the result may take after the status topic has reported the end, seconds.
_RESULT_SEC = 2.0
# This many goals in a row without an answer are no coincidence.
_UNANSWERED = 2
# An acceptance is still awaited for this many times its limit.
_LATEST = 4.0
# A navigator that neither answers nor sends feedback for this long has crashed, seconds in which this process ran.
_QUIET_SEC = 2.0
# Interval between heartbeat requests to a server, seconds.
_PULSE_SEC = 1.0
# Interval between status requests for a goal that was abandoned, seconds.
_CHASE_SEC = 1.0


def describe_status(status: int, result: Any = None) -> str:
    """Describe a goal's final status other than success, with the error in its result."""
    words = f"{_FAILURES.get(status, 'not finished')} (status {status})"
    reason = reported_error(result) if result is not None else ""
    return f"{words}: {reason}" if reason else words


class ActionPort:
    """A node's access to one action.

    Args:
        node: The rclpy node.
        action_type: The action's Python type.
        name: The action's (relative) name.

    Attributes:
        full_name: The action's full name.
        unanswered: The number of goals in a row that were neither accepted nor rejected in time.
    """

    def __init__(self, node: "Node", action_type: Any, name: str) -> None:
        self.name = name
        self.action_type = action_type
        self.unanswered = 0
        self._node = node
        self.goals = active_goals_of(node)
        self.statuses = goal_statuses_of(node, name)
        self.feedback = goal_feedback_of(node, action_type, name)
        self._connect()

    def _connect(self) -> None:
        # Not rclpy's ActionClient: it cancels only goals whose acceptance it has seen, and reads all feedback, also on others' goals.
        node, name = self._node, self.name
        self.sender = node.create_client(self.action_type.Impl.SendGoalService, f"{name}/_action/send_goal")
        self.canceller = cancel_client(node, name)
        self.full_name = canceled_action(self.canceller.service_name)
        self.prober = node.create_client(self.action_type.Impl.GetResultService, f"{name}/_action/get_result")

    @property
    def server_is_ready(self) -> bool:
        """Whether a server is available; False while ROS is shut down."""
        return self.is_usable and all(client.service_is_ready() for client in self._clients)

    @property
    def _clients(self) -> "tuple[Client, ...]":
        return self.sender, self.canceller, self.prober

    @property
    def is_usable(self) -> bool:
        """Whether messages can be sent at all: the node is alive and ROS is not shut down."""
        return is_node_valid(self._node)

    def warn(self, text: str) -> None:
        """Write a warning to the node's log."""
        self._node.get_logger().warning(escape_to_one_line(text))

    def count_unanswered(self) -> None:
        """Count a goal without a response in time; replace the clients after the second in a row."""
        self.unanswered += 1
        if self.unanswered < _UNANSWERED or not self.is_usable:
            return
        # A server that has not discovered a client's reader drops every answer to it. It may discover another client's.
        self.unanswered = 0
        self.warn(
            f"The server of '{self.name}' is present but has not answered {_UNANSWERED} goals in a row. The clients "
            "are replaced."
        )
        self.release()
        self._connect()

    def release(self) -> None:
        """Destroy the clients, unless their node was destroyed."""
        if is_node_valid(self._node):
            for client in self._clients:
                self._node.destroy_client(client)


class ServerProbe:
    """Checks that a server responds by requesting the result of an unknown goal, which it rejects at once.

    A server with a single thread does not answer while it works. So it counts as crashed only after it has answered once.

    Args:
        prober: A client of the action's result service.
        limit_sec: How long an answer may take, seconds.
        clock: The clock of the limits.
    """

    def __init__(self, prober: "Client", limit_sec: float, clock: Clock) -> None:
        self._prober, self._limit_sec, self._clock = prober, limit_sec, clock
        self._question: Future | None = None
        self._has_answered = False
        self._due = Deadline(0.0, clock)
        self._limit = Deadline(limit_sec, clock)

    def has_server_stopped(self) -> bool:
        """Send the request if due; return whether a previously responsive server has become silent."""
        if self._question is None:
            if self._due.has_passed:
                self._send_request()
        elif self._question.done():
            self._has_answered = True
            self.postpone()
        elif self._limit.has_passed:
            self._drop()
            return self._has_answered
        return False

    def postpone(self) -> None:
        """Postpone the next request: the server has sent a message."""
        self._drop()
        self._due = Deadline(_PULSE_SEC, self._clock)

    def _send_request(self) -> None:
        request: Any = self._prober.srv_type.Request()
        request.goal_id.uuid = list(uuid.uuid4().bytes)
        self._limit = Deadline(self._limit_sec, self._clock)
        self._question = self._prober.call_async(request)

    def _drop(self) -> None:
        question, self._question = self._question, None
        if question is not None:
            # Without this the client would wait for the answer for good.
            self._prober.remove_pending_request(question)


class GoalSender(ClientLeaf["ActionGoal"]):
    """The limits of a leaf that sends goals; see `ActionLeaf`."""

    acceptance_timeout_sec: float = 5.0
    feedback_timeout_sec: float | None = None
    absence_timeout_sec: float = 0.5

    def _on_server_answer(self) -> None:
        """Handle the acceptance or the success of the goal."""


class ActionGoal(PendingCall):
    """One goal, from the request to its end, sent at most once and without blocking.

    The leaf calls `advance` in every tick and reads `answer` and `trouble`. The server's messages arrive in callbacks, each bound to its own
    goal: the answer to an old goal cannot affect a new one.

    Args:
        leaf: The leaf that sends it, which is notified of its acceptance and success.
        port: The action.
        message: The goal to send.

    Attributes:
        sent, trouble: As in every `PendingCall`.
        answer: The server's final answer, with `status` (a constant of `action_msgs/msg/GoalStatus`) and
            `result`; None until then.
        rejected: Whether the server rejected the goal.
        is_result_lost: Whether the server's result did not arrive, so that the one in the answer is empty.
        ended_at: The time when its end was seen, steady seconds; infinite until then.
    """

    _server_kind = "action"
    _reply = "no response to the goal"

    _leaf: "GoalSender"

    def __init__(self, leaf: "GoalSender", port: ActionPort, message: Any) -> None:
        super().__init__(leaf, port.name, leaf.acceptance_timeout_sec)
        self.rejected = self.is_result_lost = False
        self.ended_at = math.inf
        self._port, self._message = port, message
        # An id chosen by the client, so that the goal can be cancelled before the server answers.
        self._id = uuid.uuid4().hex
        self._is_accepted = False
        self._feedback: bytes | None = None
        self._final: int | None = None
        self._result_due: Deadline | None = None
        self._heard_at = math.inf
        self._silence: Deadline | None = None
        self._doubt: Deadline | None = None
        self._absence: Deadline | None = None
        self._pulse: ServerProbe | None = None
        self._questions: list[tuple[Client, Future]] = []
        self._was_withdrawn = False
        self._granted = False
        self._chased: Deadline | None = None
        self._refused = False
        self._sent_at = math.inf
        self._servers: frozenset[bytes] = frozenset()

    @property
    def may_be_active(self) -> bool:
        """Whether the server has or may have the goal, and it has not been abandoned."""
        return self.sent and not self.is_over and not self._abandoned

    @property
    def was_withdrawn(self) -> bool:
        """Whether a request to cancel it was sent."""
        return self._was_withdrawn

    @property
    def is_accepted(self) -> bool:
        """Whether the server has accepted the goal or sent messages about it."""
        return self._is_accepted

    @property
    def has_ended(self) -> bool:
        """Whether the goal is certainly inactive."""
        return not self.sent or self._final is not None

    @property
    def _is_too_late(self) -> bool:
        """Whether no server can still accept the goal."""
        if self.age_sec <= self._reply_sec:
            return False
        # A killed server stays in the graph for a while: a server that answers has appeared since.
        return self.age_sec > _LATEST * self._reply_sec or bool(self._port.statuses.servers() - self._servers)

    @property
    def age_sec(self) -> float:
        """The seconds since it was sent."""
        return self._leaf._clock.now() - self._sent_at

    @property
    def _silence_sec(self) -> float:
        """Maximum silence of a server that sends no feedback, seconds."""
        limit_sec = self._leaf.feedback_timeout_sec
        return self._leaf.server_timeout_sec if limit_sec is None else limit_sec

    @property
    def server_is_gone(self) -> bool:
        """Whether the goal's server has disappeared, which ends the goal."""
        return not (self._port.is_usable and self._port.sender.service_is_ready())

    def abandon_if_silent(self, navigator: str) -> None:
        """Abandon the goal if its server has stopped sending feedback.

        Args:
            navigator: The lifecycle node of the server, which does not answer.
        """
        if self.may_be_active and self._final is None and AWAKE.now() - self._heard_at > _QUIET_SEC:
            self._mark_lost(
                f"the server has sent no feedback for {_QUIET_SEC:g} s, and node {navigator} does not answer"
            )

    @property
    def has_feedback(self) -> bool:
        """Whether there is feedback that has not been read."""
        return self._feedback is not None

    def pop_feedback(self) -> Any:
        """Return and clear the latest feedback, at most once per message."""
        feedback, self._feedback = self._feedback, None
        return self._port.feedback.read(cast("bytes", feedback))

    def _server_is_ready(self) -> bool:
        return self._port.server_is_ready

    def chase(self) -> None:
        """Check an abandoned goal again, and cancel it unless a cancel was granted."""
        if self.has_ended:
            self._drop_questions()
        if self.has_ended or not self._abandoned or not (self._chased is None or self._chased.has_passed):
            return
        if self._granted:
            self._query_result()
        else:
            self._cancel_sent()

    def _query_result(self) -> None:
        """Request the result again; a server that does not know the goal responds at once."""
        self._chased = self._limit(_CHASE_SEC)
        prober = self._port.prober
        if self._port.is_usable and prober.service_is_ready():
            self._request_result()

    def _drop_questions(self) -> None:
        """Discard all pending responses, once the goal's end is known."""
        pending, self._questions = self._questions, []
        for client, question in pending if self._port.is_usable else ():
            # Without this the client would wait for the answer, and keep the goal alive, for good.
            client.remove_pending_request(question)

    def _send(self) -> None:
        self._servers = self._port.statuses.servers()
        self._port.goals.before_sending(self._id, self._port.full_name)
        self._sent_at = self._leaf._clock.now()
        self._port.statuses.follow(self._id, self._on_end)
        self._port.feedback.follow(self._id, self._on_feedback)
        request = self._port.sender.srv_type.Request()
        request.goal_id, request.goal = uuid_message(self._id), self._message
        self._port.sender.call_async(request).add_done_callback(self._on_answer)

    def _cancel_sent(self) -> None:
        if not self._port.is_usable or not self._port.canceller.service_is_ready():
            return
        # Cancel by the client's own id, which works before the acceptance arrives if the server already has the goal.
        # If not, it answers that it does not know the goal, which is then cancelled when its acceptance arrives.
        self._chased = self._limit(_CHASE_SEC)
        canceller = self._port.canceller
        answer = canceller.call_async(cancel_request(self._id))
        answer.add_done_callback(self._on_cancel_answer)
        self._questions.append((canceller, answer))
        self._was_withdrawn = True

    def _watch(self) -> None:
        if self._final is not None:
            self._await_result(self._final)
        elif not self._is_accepted:
            super()._watch()
            if self.trouble:
                self._port.count_unanswered()
        elif self._silence is not None and self._silence.has_passed:
            self._mark_lost(f"the server has sent no feedback for {self._silence_sec:g} s")
        elif self.server_is_gone:
            self._miss_server()
        else:
            self._question_server()

    def _await_result(self, status: int) -> None:
        """Use the status topic if the result does not arrive."""
        if self._result_due is None:
            self._result_due = self._limit(_RESULT_SEC)
        elif self._result_due.has_passed:
            self._port.warn(
                f"The result of the goal of '{self._port.name}' is lost. The status topic reports its end: {status}."
            )
            self.is_result_lost = True
            self.answer = SimpleNamespace(status=status, result=self._port.action_type.Result())

    def _miss_server(self) -> None:
        # A server that appears instead of it does not know the goal.
        if self._absence is None:
            self._absence = self._limit(self._leaf.absence_timeout_sec)
        elif self._absence.has_passed:
            self._mark_lost(f"the server has been missing for {self._leaf.absence_timeout_sec:g} s")

    def _question_server(self) -> None:
        """Determine whether the server responds and knows the goal."""
        if self._absence is not None or (
            self._silence is None and self._doubt is not None and self._doubt.has_passed
        ):
            # This may be another server than before: one that does not know the goal answers at once.
            self._absence = None
            self._doubt = self._limit(self._silence_sec)
            self._request_result()
        if self._pulse is not None and self._pulse.has_server_stopped():
            self._mark_lost(f"the server has not answered for {self._silence_sec:g} s")

    def _mark_lost(self, trouble: str) -> None:
        self._port.goals.mark_lost(self._id)
        self._give_up(f"{trouble}. The robot may still be moving")

    def _on_answer(self, answer: "Future") -> None:
        self._port.unanswered = 0
        if not answer.result().accepted:
            self.rejected = True
            self._on_end(UNKNOWN)
            if not self._abandoned:
                self.trouble = "the server rejected the goal. Is its lifecycle state 'active'?"
            return
        self._is_accepted = True
        if self._final == UNKNOWN:  # it was considered lost
            self._final = None
            self._port.goals.before_sending(self._id, self._port.full_name)
        self._doubt = self._limit(self._silence_sec)
        self._pulse = ServerProbe(self._port.prober, self._silence_sec, self._leaf._clock)
        self._request_result()
        if self._abandoned:
            self._cancel_sent()
        else:
            self._leaf._on_server_answer()

    def _request_result(self) -> None:
        # At once, since a server forgets results.
        if not self._port.is_usable:
            return
        request = self._port.prober.srv_type.Request()
        request.goal_id = uuid_message(self._id)
        question = self._port.prober.call_async(request)
        question.add_done_callback(self._on_result)
        self._questions.append((self._port.prober, question))

    def _on_feedback(self, message: bytes) -> None:
        self._feedback, self._heard_at = message, AWAKE.now()
        if self._pulse is not None:
            self._pulse.postpone()
        if self._leaf.feedback_timeout_sec is not None:
            self._silence = self._limit(self._leaf.feedback_timeout_sec)

    def _on_end(self, status: int) -> None:
        self._final = status
        self.ended_at = min(self.ended_at, time.monotonic())
        self._port.goals.mark_ended(self._id, status)

    def _on_result(self, answer: "Future") -> None:
        result = answer.result()
        self._drop_questions()
        self._on_end(result.status)
        if self.is_over or self._abandoned:
            return
        self.answer = result
        if result.status == SUCCEEDED:
            self._leaf._on_server_answer()

    def _on_cancel_answer(self, answer: "Future") -> None:
        response = answer.result()
        if response.goals_canceling:
            self._granted = True
        if self._granted or self.has_ended:
            return
        if response.return_code == response.ERROR_GOAL_TERMINATED:
            # The goal has ended, or another client has requested to cancel it, which does not end it yet.
            self._granted = True
            self._query_result()
        elif response.return_code == response.ERROR_UNKNOWN_GOAL_ID:
            # A server that no longer knows the goal is a new one. If the goal is unknown long after it was sent, it
            # did not arrive.
            if self._is_accepted or self._is_too_late:
                self._on_end(UNKNOWN)
        elif not self._refused:
            # A server rejects the request by an empty list. Its return code may still be "no error".
            self._refused = True
            self._port.warn(
                f"The server of '{self._port.name}' did not cancel the goal (return code "
                f"{response.return_code}). The robot may still be moving."
            )
