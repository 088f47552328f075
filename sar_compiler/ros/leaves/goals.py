"""The goals that a node sends to action servers, and the goal statuses that these servers publish.

The end of a goal is known from the server's response or, if the response is lost, from the published statuses.
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
"""The status of a goal that has succeeded, as in `action_msgs/msg/GoalStatus`."""
ABORTED, CANCELED, UNKNOWN = 6, 5, 0
"""Further goal statuses, as in `action_msgs/msg/GoalStatus`."""

FINAL = (SUCCEEDED, CANCELED, ABORTED)
"""The statuses of goals that have ended."""

_CANCEL = "/_action/cancel_goal"

_ENDS = {
    SUCCEEDED: "has arrived",
    CANCELED: "is cancelled",
    ABORTED: "was aborted",
    UNKNOWN: "is unknown to the server",
}

StatusListener = Callable[[int], None]
FeedbackListener = Callable[[bytes], None]

# The position of the goal ID in a serialised feedback message, after four bytes that define the encoding.
_GOAL_ID = slice(4, 20)


def end_in_words(status: int) -> str:
    """Describe how a goal has ended, as a verb phrase such as `is cancelled`, given the goal's final status."""
    return _ENDS.get(status, f"has ended with status {status}")


def cancel_client(node: "Node", action: str) -> "Client":
    """Create a client of the service that cancels an action's goals, including goals of other clients."""
    from action_msgs.srv import CancelGoal

    return node.create_client(CancelGoal, f"{action}{_CANCEL}")


def canceled_action(service: str) -> str:
    """Return the full name of the action to which a cancel service belongs."""
    return service.removesuffix(_CANCEL)


def cancel_request(goal_id: str) -> Any:
    """Create the request to cancel one goal, given its ID (32 hexadecimal digits)."""
    from action_msgs.srv import CancelGoal

    request = CancelGoal.Request()
    request.goal_info.goal_id = uuid_message(goal_id)
    return request


def uuid_message(goal_id: str) -> Any:
    """Convert a goal ID (32 hexadecimal digits) to a message."""
    from unique_identifier_msgs.msg import UUID

    return UUID(uuid=list(bytes.fromhex(goal_id)))


class GoalStatuses:
    """Stores the latest status of each goal of one action, as published on the action's status topic.

    The statuses are stored by goal ID (32 hexadecimal digits). Create this object with `goal_statuses_of`, so that it knows all goals of
    the node.

    Args:
        node: The rclpy node that subscribes to the topic.
        action: The (relative) name of the action.

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
        """Return the final status of a goal according to the topic; None if the topic has not reported the goal's end."""
        status = self._latest.get(goal)
        return status if status in FINAL else None

    def servers(self) -> frozenset[bytes]:
        """Return the unique IDs of the status publishers, which identify the action's servers."""
        there = self._node.get_publishers_info_by_topic(self._topic)
        return frozenset(bytes(each.endpoint_gid) for each in there)

    def clear(self) -> None:
        """Discard the latest statuses, because the server may have been replaced."""
        self._latest = {}

    def follow(self, goal: str, on_end: StatusListener) -> None:
        """Call *on_end* with the final status of a goal of this node; only a weak reference to *on_end* is stored."""
        self._ours.add(goal)
        self._listeners[goal] = WeakMethod(on_end)

    def _on_statuses(self, message: Any) -> None:
        self._latest = {bytes(each.goal_info.goal_id.uuid).hex(): each.status for each in message.status_list}
        for goal, status in self._latest.items():
            if status in FINAL and (listener := self._listeners.pop(goal, lambda: None)()) is not None:
                listener(status)
        self._listeners = {goal: each for goal, each in self._listeners.items() if each() is not None}
        # A goal of this node that has ended stays in the list for a while, and must not be regarded as another client's goal.
        self._ours.intersection_update({*self._latest, *self._listeners})


def goal_statuses_of(node: "Node", action: str) -> GoalStatuses:
    """Return the statuses of an action's goals; every call for a node returns the same object."""
    return of_node(node, (GoalStatuses, action), lambda: GoalStatuses(node, action))


class GoalFeedback:
    """The serialised feedback on all goals of one action; created by `goal_feedback_of`.

    A message is only deserialised if its receiver calls `read`.

    Args:
        node: The rclpy node that subscribes to the feedback.
        action_type: The Python class of the action.
        action: The (relative) name of the action.
    """

    def __init__(self, node: "Node", action_type: Any, action: str) -> None:
        from rclpy.qos import QoSProfile

        self._type = action_type.Impl.FeedbackMessage
        self._listeners: dict[str, WeakMethod[FeedbackListener]] = {}
        name, qos = f"{action}/_action/feedback", QoSProfile(depth=10)
        node.create_subscription(self._type, name, self._on_feedback, qos, raw=True)

    def follow(self, goal: str, on_feedback: FeedbackListener) -> None:
        """Call *on_feedback* with each serialised feedback on a goal; only a weak reference to it is stored."""
        self._listeners = {goal: each for goal, each in self._listeners.items() if each() is not None}
        self._listeners[goal] = WeakMethod(on_feedback)

    def read(self, message: bytes) -> Any:
        """Deserialise a message and return the feedback in it."""
        from rclpy.serialization import deserialize_message

        return deserialize_message(message, self._type).feedback

    def _on_feedback(self, message: bytes) -> None:
        listener = self._listeners.get(message[_GOAL_ID].hex(), lambda: None)()
        if listener is not None:
            listener(message)


def goal_feedback_of(node: "Node", action_type: Any, action: str) -> GoalFeedback:
    """Return the feedback on an action's goals; every call for a node returns the same object."""
    return of_node(node, (GoalFeedback, action_type, action), lambda: GoalFeedback(node, action_type, action))


class GoalEvent(NamedTuple):
    """The event that a goal is about to be sent, or that a goal has ended.

    Attributes:
        goal_id: The goal's ID, 32 hexadecimal digits.
        action: The full name of the action.
        status: The goal's final status, a constant of `action_msgs/msg/GoalStatus` (0 if no server knows the goal); None if
            the goal is about to be sent.
    """

    goal_id: str
    action: str
    status: int | None = None

    @property
    def is_over(self) -> bool:
        """Whether the goal has ended."""
        return self.status is not None


class ActiveGoals:
    """The active goals that a node has sent, by goal ID (32 hexadecimal digits). Created by `active_goals_of`."""

    def __init__(self) -> None:
        self._active: dict[str, str] = {}
        self._lost: set[str] = set()
        self._listeners: list[Callable[[GoalEvent], None]] = []

    def __len__(self) -> int:
        """Return the number of active goals."""
        return len(self._active)

    def drives(self, actions: Collection[str]) -> bool:
        """Return whether a goal of one of the actions may be active; lost goals are ignored."""
        return any(action in actions and goal not in self._lost for goal, action in self._active.items())

    @property
    def may_be_active(self) -> bool:
        """Whether a goal may be active; lost goals are ignored."""
        return any(goal not in self._lost for goal in self._active)

    def active(self) -> "list[GoalEvent]":
        """Return the goals that were sent and whose end was not observed. Any thread may call this method."""
        return [GoalEvent(goal_id, action) for goal_id, action in [*self._active.items()]]

    def mark_lost(self, goal_id: str) -> None:
        """Mark a goal as lost, because its server has stopped responding."""
        self._lost.add(goal_id)

    def add_listener(self, listener: Callable[[GoalEvent], None]) -> None:
        """Add a callback that is called before each goal is sent and after each goal has ended."""
        self._listeners.append(listener)

    def before_sending(self, goal_id: str, action: str) -> None:
        """Add a goal just before it is sent, given its ID and the full name of its action."""
        self._active[goal_id] = action
        self._notify(GoalEvent(goal_id, action))

    def mark_ended(self, goal_id: str, status: int) -> None:
        """Remove a goal that was rejected or has ended.

        Args:
            goal_id: The goal's ID.
            status: The goal's final status, a constant of `action_msgs/msg/GoalStatus`; 0 if the goal was rejected, or if no server knows
                the goal.
        """
        self._lost.discard(goal_id)
        action = self._active.pop(goal_id, None)
        if action is not None:
            self._notify(GoalEvent(goal_id, action, status))

    def _notify(self, news: GoalEvent) -> None:
        for listener in self._listeners:
            listener(news)


def active_goals_of(node: "Node") -> ActiveGoals:
    """Return the active goals of a node; every call for a node returns the same object."""
    return of_node(node, ActiveGoals, ActiveGoals)


_FAILURES = {
    UNKNOWN: "unknown to the server (was it restarted?)",
    CANCELED: "canceled by another client",
    ABORTED: "aborted",
}
# Maximum wait for the result after the status topic has reported the end of a goal, in seconds.
_RESULT_SEC = 2.0
# After this many goals in a row without a response, the clients are replaced.
_UNANSWERED = 2
# A goal may still be accepted late, until this multiple of the limit for its acceptance.
_LATEST = 4.0
# A navigator that neither responds nor sends feedback for this time has crashed, in seconds of awake time.
_QUIET_SEC = 2.0
# Interval between two requests that check whether a server responds, in seconds.
_PULSE_SEC = 1.0
# Interval between two requests about an abandoned goal, in seconds.
_CHASE_SEC = 1.0


def describe_status(status: int, result: Any = None) -> str:
    """Describe the final status of a goal that has not succeeded, together with the error in its result."""
    words = f"{_FAILURES.get(status, 'not finished')} (status {status})"
    reason = reported_error(result) if result is not None else ""
    return f"{words}: {reason}" if reason else words


class ActionPort:
    """The clients and subscriptions through which a node uses one action.

    Args:
        node: The rclpy node.
        action_type: The Python class of the action.
        name: The (relative) name of the action.

    Attributes:
        full_name: The full name of the action.
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
        # rclpy's ActionClient is not used, because it can only cancel goals whose acceptance has arrived, and deserialises all feedback, including
        # feedback on other clients' goals.
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
        """Whether messages can be sent: the node exists and ROS is not shut down."""
        return is_node_valid(self._node)

    def warn(self, text: str) -> None:
        """Log a warning on the node."""
        self._node.get_logger().warning(escape_to_one_line(text))

    def count_unanswered(self) -> None:
        """Count a goal that got no response in time; replace the clients after the second such goal in a row."""
        self.unanswered += 1
        if self.unanswered < _UNANSWERED or not self.is_usable:
            return
        # A server that has not discovered this client's reader drops every response. It may discover the reader of a new client.
        self.unanswered = 0
        self.warn(
            f"The server of '{self.name}' is present, but has not responded to {_UNANSWERED} goals in a row. This node now creates new "
            f"clients of the action."
        )
        self.release()
        self._connect()

    def release(self) -> None:
        """Destroy the clients, unless their node is already destroyed."""
        if is_node_valid(self._node):
            for client in self._clients:
                self._node.destroy_client(client)


class ServerProbe:
    """Checks that a server responds, by requesting the result of an unknown goal. A server rejects such a request at once.

    A server with a single thread does not respond while it executes a goal. So a silent server is only regarded as crashed if it has
    responded to an earlier request.

    Args:
        prober: A client of the action's result service.
        limit_sec: The maximum wait for a response, in seconds.
        clock: The clock that measures the wait.
    """

    def __init__(self, prober: "Client", limit_sec: float, clock: Clock) -> None:
        self._prober, self._limit_sec, self._clock = prober, limit_sec, clock
        self._request: Future | None = None
        self._has_responded = False
        self._due = Deadline(0.0, clock)
        self._limit = Deadline(limit_sec, clock)

    def has_server_stopped(self) -> bool:
        """Send the next request if it is due; return whether a server that has responded before is now silent."""
        if self._request is None:
            if self._due.has_passed:
                self._send_request()
        elif self._request.done():
            self._has_responded = True
            self.postpone()
        elif self._limit.has_passed:
            self._drop()
            return self._has_responded
        return False

    def postpone(self) -> None:
        """Postpone the next request, because the server has just sent a message."""
        self._drop()
        self._due = Deadline(_PULSE_SEC, self._clock)

    def _send_request(self) -> None:
        request: Any = self._prober.srv_type.Request()
        request.goal_id.uuid = list(uuid.uuid4().bytes)
        self._limit = Deadline(self._limit_sec, self._clock)
        self._request = self._prober.call_async(request)

    def _drop(self) -> None:
        request, self._request = self._request, None
        if request is not None:
            # Otherwise the client would wait for the response forever.
            self._prober.remove_pending_request(request)


class GoalSender(ClientLeaf["ActionGoal"]):
    """The base class of `ActionLeaf`. It declares the time limits, so that `ActionGoal` need not import `ActionLeaf`."""

    acceptance_timeout_sec: float = 5.0
    feedback_timeout_sec: float | None = None
    absence_timeout_sec: float = 0.5

    def _on_server_answer(self) -> None:
        """Called when the server has accepted the goal, or when the goal has succeeded."""


class ActionGoal(PendingCall):
    """One goal, from the request to its end. The goal is sent at most once and without blocking.

    The leaf calls `poll` in every tick and reads `answer` and `trouble`. The server's messages arrive in callbacks, each of which is bound to one
    goal, so that a response to an earlier goal cannot affect a later goal.

    Args:
        leaf: The leaf that sends the goal. It is notified when the goal is accepted or has succeeded.
        port: The node's access to the action.
        message: The goal to send.

    Attributes:
        sent, trouble: See `PendingCall`.
        answer: The server's final response, with `status` (a constant of `action_msgs/msg/GoalStatus`) and `result`; None before it arrives.
        rejected: Whether the server has rejected the goal.
        is_result_lost: Whether the server's result has not arrived. In this case, the result in `answer` is empty.
        ended_at: The time when the goal's end was observed, in seconds of the steady clock; infinite before.
    """

    _server_kind = "action"
    _reply = "no response to the goal"

    _leaf: "GoalSender"

    def __init__(self, leaf: "GoalSender", port: ActionPort, message: Any) -> None:
        super().__init__(leaf, port.name, leaf.acceptance_timeout_sec)
        self.rejected = self.is_result_lost = False
        self.ended_at = math.inf
        self._port, self._message = port, message
        # The client chooses the ID, so that it can cancel the goal before the server responds.
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
        self._pending: list[tuple[Client, Future]] = []
        self._was_withdrawn = False
        self._granted = False
        self._chased: Deadline | None = None
        self._refused = False
        self._sent_at = math.inf
        self._servers: frozenset[bytes] = frozenset()

    @property
    def may_be_active(self) -> bool:
        """Whether the server may be executing the goal, and the goal was not abandoned."""
        return self.sent and not self.is_over and not self._abandoned

    @property
    def was_withdrawn(self) -> bool:
        """Whether a request to cancel the goal was sent."""
        return self._was_withdrawn

    @property
    def is_accepted(self) -> bool:
        """Whether the server has accepted the goal or sent messages about it."""
        return self._is_accepted

    @property
    def has_ended(self) -> bool:
        """Whether the goal is certainly inactive, because it was not sent or its end was observed."""
        return not self.sent or self._final is not None

    @property
    def _is_too_late(self) -> bool:
        """Whether it is too late for any server to accept the goal."""
        if self.age_sec <= self._reply_sec:
            return False
        # A killed server stays in the ROS graph for a while. If a new server has appeared, it does not know the goal.
        return self.age_sec > _LATEST * self._reply_sec or bool(self._port.statuses.servers() - self._servers)

    @property
    def age_sec(self) -> float:
        """The time since the goal was sent, in seconds."""
        return self._leaf._clock.now() - self._sent_at

    @property
    def _silence_sec(self) -> float:
        """The maximum time without a response from a server that sends no feedback, in seconds."""
        limit_sec = self._leaf.feedback_timeout_sec
        return self._leaf.server_timeout_sec if limit_sec is None else limit_sec

    @property
    def server_is_gone(self) -> bool:
        """Whether no server is available to this node: the goal's server has disappeared, or ROS is shut down."""
        return not (self._port.is_usable and self._port.sender.service_is_ready())

    def abandon_if_silent(self, navigator: str) -> None:
        """Abandon the goal if its server has stopped sending feedback, and the server's lifecycle node does not respond.

        Args:
            navigator: The name of the server's lifecycle node, which does not respond.
        """
        if self.may_be_active and self._final is None and AWAKE.now() - self._heard_at > _QUIET_SEC:
            self._mark_lost(
                f"the server has sent no feedback for {_QUIET_SEC:g} s, and node {navigator} does not respond"
            )

    @property
    def has_feedback(self) -> bool:
        """Whether feedback has arrived and was not read yet."""
        return self._feedback is not None

    def pop_feedback(self) -> Any:
        """Return the latest feedback, and mark it as read."""
        feedback, self._feedback = self._feedback, None
        return self._port.feedback.read(cast("bytes", feedback))

    def _server_is_ready(self) -> bool:
        return self._port.server_is_ready

    def chase(self) -> None:
        """Send the next request about an abandoned goal if it is due: first cancel the goal, then get the result."""
        if self.has_ended:
            self._drop_pending()
        if self.has_ended or not self._abandoned or not (self._chased is None or self._chased.has_passed):
            return
        if self._granted:
            self._query_result()
        else:
            self._cancel_sent()

    def _query_result(self) -> None:
        """Request the result again. A server that does not know the goal responds to this request at once."""
        self._chased = self._limit(_CHASE_SEC)
        prober = self._port.prober
        if self._port.is_usable and prober.service_is_ready():
            self._request_result()

    def _drop_pending(self) -> None:
        """Discard all pending requests, because the goal's end is known."""
        pending, self._pending = self._pending, []
        for client, request in pending if self._port.is_usable else ():
            # Otherwise the client would wait for the response, and keep this object in memory, forever.
            client.remove_pending_request(request)

    def _send(self) -> None:
        self._servers = self._port.statuses.servers()
        self._port.goals.before_sending(self._id, self._port.full_name)
        self._sent_at = self._leaf._clock.now()
        self._port.statuses.follow(self._id, self._on_end)
        self._port.feedback.follow(self._id, self._on_feedback)
        request = self._port.sender.srv_type.Request()
        request.goal_id, request.goal = uuid_message(self._id), self._message
        self._port.sender.call_async(request).add_done_callback(self._on_goal_response)

    def _cancel_sent(self) -> None:
        if not self._port.is_usable or not self._port.canceller.service_is_ready():
            return
        # The ID is known before the acceptance arrives, so the goal is cancelled if the server already has it. Otherwise the
        # server responds that the goal is unknown, and the goal is cancelled when its acceptance arrives.
        self._chased = self._limit(_CHASE_SEC)
        canceller = self._port.canceller
        request = canceller.call_async(cancel_request(self._id))
        request.add_done_callback(self._on_cancel_response)
        self._pending.append((canceller, request))
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
            self._wait_for_missing_server()
        else:
            self._check_server()

    def _await_result(self, status: int) -> None:
        """Wait for the result of an ended goal; if no result arrives, use the status from the status topic."""
        if self._result_due is None:
            self._result_due = self._limit(_RESULT_SEC)
        elif self._result_due.has_passed:
            self._port.warn(
                f"The result of the goal sent to '{self._port.name}' has not arrived. According to the status topic, the goal has ended "
                f"with status {status}."
            )
            self.is_result_lost = True
            self.answer = SimpleNamespace(status=status, result=self._port.action_type.Result())

    def _wait_for_missing_server(self) -> None:
        # The server may appear again after a short time. A different server would not know the goal.
        if self._absence is None:
            self._absence = self._limit(self._leaf.absence_timeout_sec)
        elif self._absence.has_passed:
            self._mark_lost(f"the server has been missing for {self._leaf.absence_timeout_sec:g} s")

    def _check_server(self) -> None:
        """Check whether the server responds and knows the goal."""
        if self._absence is not None or (
            self._silence is None and self._doubt is not None and self._doubt.has_passed
        ):
            # This may be a different server than before. A server that does not know the goal responds at once.
            self._absence = None
            self._doubt = self._limit(self._silence_sec)
            self._request_result()
        if self._pulse is not None and self._pulse.has_server_stopped():
            self._mark_lost(f"the server has not responded for {self._silence_sec:g} s")

    def _mark_lost(self, trouble: str) -> None:
        self._port.goals.mark_lost(self._id)
        self._give_up(f"{trouble}. The robot may still be moving")

    def _on_goal_response(self, future: "Future") -> None:
        self._port.unanswered = 0
        if not future.result().accepted:
            self.rejected = True
            self._on_end(UNKNOWN)
            if not self._abandoned:
                self.trouble = "the server rejected the goal. Is its lifecycle state 'active'?"
            return
        self._is_accepted = True
        if self._final == UNKNOWN:  # the goal was considered as never received
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
        # The result is requested at once, because a server discards results after some time.
        if not self._port.is_usable:
            return
        request = self._port.prober.srv_type.Request()
        request.goal_id = uuid_message(self._id)
        future = self._port.prober.call_async(request)
        future.add_done_callback(self._on_result)
        self._pending.append((self._port.prober, future))

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

    def _on_result(self, future: "Future") -> None:
        result = future.result()
        self._drop_pending()
        self._on_end(result.status)
        if self.is_over or self._abandoned:
            return
        self.answer = result
        if result.status == SUCCEEDED:
            self._leaf._on_server_answer()

    def _on_cancel_response(self, future: "Future") -> None:
        response = future.result()
        if response.goals_canceling:
            self._granted = True
        if self._granted or self.has_ended:
            return
        if response.return_code == response.ERROR_GOAL_TERMINATED:
            # The goal has ended, or is still being cancelled because another client has requested it.
            self._granted = True
            self._query_result()
        elif response.return_code == response.ERROR_UNKNOWN_GOAL_ID:
            # If a server has accepted the goal and no longer knows it, the server was restarted. If a goal is unknown long after it was sent, it
            # has not arrived.
            if self._is_accepted or self._is_too_late:
                self._on_end(UNKNOWN)
        elif not self._refused:
            # A server rejects the request with an empty list. The return code may still be "no error".
            self._refused = True
            self._port.warn(
                f"The server of '{self._port.name}' did not cancel the goal (return code "
                f"{response.return_code}). The robot may still be moving."
            )
