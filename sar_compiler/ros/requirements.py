"""The requirements that a mission may have to wait for, one class each; none of them blocks."""

import math
import time
from abc import ABC, abstractmethod
from typing import Any

from geometry_msgs.msg import PoseWithCovarianceStamped
from lifecycle_msgs.srv import GetState
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.task import Future

InitialPose = tuple[float, float, float]
"""x and y in metres, yaw in radians."""

_INITIAL_POSE_PERIOD_SEC = 1.0
_ASK_PERIOD_SEC = 0.5
_ANSWER_DEADLINE_SEC = 2.0

# Half a metre and 15 degrees of standard deviation, as variances: x, y, yaw.
_INITIAL_VARIANCES = {0: 0.25, 7: 0.25, 35: 0.068}


class Requirement(ABC):
    """A requirement that must be fulfilled before the first tick."""

    @abstractmethod
    def missing(self) -> str | None:
        """Take the next step, and describe what is missing; None if nothing is."""

    def close(self) -> None:  # noqa: B027 - most have created nothing
        """Destroy what was created on the node."""


class OneServer(Requirement):
    """An action or a service that must have exactly one server.

    Args:
        node: The node that will call it.
        kind: `action` or `service`.
        name: Its relative name.
    """

    def __init__(self, node: Node, kind: str, name: str) -> None:
        self._node = node
        self._service = node.resolve_service_name(f"{name}/_action/send_goal" if kind == "action" else name)
        self._resolved = self._service.removesuffix("/_action/send_goal")
        self._title = f"{kind} {_with_full_name(name, self._resolved)}"

    @property
    def contested(self) -> bool:
        """Whether several servers would accept the same call."""
        return int(self._node.count_services(self._service)) > 1

    def missing(self) -> str | None:
        """Describe a missing server, or several of them; None for exactly one."""
        servers = int(self._node.count_services(self._service))
        if servers == 1:
            return None
        if not servers:
            return f"{self._title}: no server"
        number, which = ("two", "one") if servers == 2 else (servers, "all but one")  # noqa: PLR2004
        return f"{self._title}: {number} servers answer to {self._resolved}: stop {which}"


class Published(Requirement):
    """A topic that must have a publisher."""

    def __init__(self, node: Node, name: str) -> None:
        self._node = node
        self._topic = node.resolve_topic_name(name)
        self._title = f"topic {_with_full_name(name, self._topic)}"

    def missing(self) -> str | None:
        """Describe a missing publisher; None if there is one."""
        return None if self._node.count_publishers(self._topic) else f"{self._title}: no publisher"


class ClockRuns(Requirement):
    """Simulated time that must have started."""

    def __init__(self, node: Node) -> None:
        self._clock = node.get_clock()

    def missing(self) -> str | None:
        """Describe a missing clock; None once there is a time."""
        came = not self._clock.ros_time_is_active or self._clock.now().nanoseconds > 0
        return None if came else "use_sim_time is set and no /clock has come"


class Localised(Requirement):
    """A localisation that must have accepted the initial pose.

    The pose is published until an answer arrives. The subscription excludes earlier answers: an old pose,
    kept by the publisher for late subscribers, does not confirm this one.

    Args:
        node: The node to publish with.
        pose: The robot's pose, in the frame `map`.
    """

    def __init__(self, node: Node, pose: InitialPose) -> None:
        self._node = node
        self._pose = pose
        self._sent_at = -math.inf
        self._answered = False
        self._answers, self._poses = (
            _with_full_name(topic, node.resolve_topic_name(topic)) for topic in ("amcl_pose", "initialpose")
        )
        self._publisher = node.create_publisher(PoseWithCovarianceStamped, "initialpose", QoSProfile(depth=1))
        # QoSProfile is reliable and volatile unless it is told otherwise.
        self._subscription = node.create_subscription(
            PoseWithCovarianceStamped, "amcl_pose", self._on_answer, QoSProfile(depth=10)
        )

    def missing(self) -> str | None:
        """Publish the pose if it is due, and describe a missing answer; None once there is one."""
        if self._answered:
            return None
        now = time.monotonic()
        heard = self._publisher.get_subscription_count() > 0
        if heard and now - self._sent_at >= _INITIAL_POSE_PERIOD_SEC:
            self._sent_at = now
            self._publisher.publish(self._message())
        x, y, yaw = self._pose
        deaf = "" if heard else f", and nobody listens to {self._poses}"
        return f"topic {self._answers}: no answer to the initial pose ({x:.2f}, {y:.2f}, yaw {yaw:.2f}){deaf}"

    def close(self) -> None:
        """Destroy the publisher and the subscription."""
        self._node.destroy_publisher(self._publisher)
        self._node.destroy_subscription(self._subscription)

    def _on_answer(self, _: PoseWithCovarianceStamped) -> None:
        self._answered = self._answered or self._sent_at > -math.inf

    def _message(self) -> PoseWithCovarianceStamped:
        x, y, yaw = self._pose
        message = PoseWithCovarianceStamped()
        message.header.frame_id = "map"
        message.header.stamp = self._node.get_clock().now().to_msg()
        message.pose.pose.position.x, message.pose.pose.position.y = float(x), float(y)
        message.pose.pose.orientation.z = math.sin(yaw / 2)
        message.pose.pose.orientation.w = math.cos(yaw / 2)
        for index, variance in _INITIAL_VARIANCES.items():
            message.pose.covariance[index] = variance
        return message


class NodeActive(Requirement):
    """A lifecycle node that must be active.

    It is asked repeatedly, even after it was active: it may no longer be when the other requirements are fulfilled.
    An answer that is lost, as may happen while the two sides still discover each other, is not waited for.

    Args:
        node: The node to ask with.
        name: The relative name of the lifecycle node.
    """

    def __init__(self, node: Node, name: str) -> None:
        self._node = node
        self._client: Any = node.create_client(GetState, f"{name}/get_state")
        self._service = node.resolve_service_name(f"{name}/get_state")
        self._name = name
        self._title = f"node {_with_full_name(name, self._service.removesuffix('/get_state'))}"
        self._call: Future | None = None
        self._asked_at = -math.inf
        self._state: str | None = None
        self._lost = 0

    def missing(self) -> str | None:
        """Ask if it is due, and describe the last answer; None if that was `active`."""
        if not self._client.service_is_ready():
            self._drop()
            self._state = None
            return f"node {self._name}: not there (no service {self._service})"
        self._take_answer()
        if self._call is None and time.monotonic() - self._asked_at >= _ASK_PERIOD_SEC:
            self._asked_at = time.monotonic()
            self._call = self._client.call_async(GetState.Request())
        if self._state is None:
            return f"node {self._name}: {self._service} has not answered" + (" in time" if self._lost else "")
        return None if self._state == "active" else f"{self._title}: state '{self._state}', must be 'active'"

    def close(self) -> None:
        """Destroy the client."""
        self._drop()
        self._node.destroy_client(self._client)

    def _take_answer(self) -> None:
        if self._call is None:
            return
        if self._call.done():
            answer = self._call.result()
            self._call = None
            self._state = _name_of(answer.current_state) if answer is not None else None
        elif time.monotonic() - self._asked_at > _ANSWER_DEADLINE_SEC:
            self._lost += 1
            self._state = None
            self._drop()

    def _drop(self) -> None:
        call, self._call = self._call, None
        if call is not None:
            self._client.remove_pending_request(call)


def _with_full_name(name: str, resolved: str) -> str:
    """Return a name, followed by its resolved form in brackets if that is not obvious."""
    return name if resolved == f"/{name.lstrip('/')}" else f"{name} ({resolved})"


def _name_of(state: Any) -> str:
    """Return a lifecycle state's name; some servers fill in only its number."""
    from lifecycle_msgs.msg import State

    known = {State.PRIMARY_STATE_ACTIVE: "active", State.PRIMARY_STATE_INACTIVE: "inactive"}
    return state.label or known.get(state.id, f"number {state.id}")
