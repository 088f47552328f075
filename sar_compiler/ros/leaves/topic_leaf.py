"""The base class of leaves that read a ROS topic."""

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, ClassVar

from py_trees.common import ClearingPolicy, Status

from sar_compiler.ros.graph_queries import explain_absence
from sar_compiler.ros.leaves.leaf import RosLeaf, find_interface, is_node_valid, qos_profile
from sar_compiler.ros.message_values import UnusableValueError, check_stamp, node_sec, value_reports

if TYPE_CHECKING:
    from rclpy.subscription import Subscription


class TopicLeaf(RosLeaf):
    """A leaf that evaluates the latest message of a topic.

    A condition returns at once, and a leaf that `waits` is RUNNING until there is a message. It is subscribed from
    the setup on, so a message may be older than the activation; `max_age_sec` and `clearing_policy` limit its age.

    A subclass has the attributes `topic_type` and `topic_name`, of the class or set by its constructor, and, if the content of
    a message matters, the method `on_message`. A message for which that raises `UnusableValueError`, whose stamp is in the
    future, or older than `max_age_sec`, is reported once and ignored. With `check_message` the usable message before it stays.

    Attributes:
        topic_type: `"package/msg/Name"`, or the Python class.
        topic_name: The topic's (relative) name.
        qos: `"sensor_data"` (best effort, compatible with every publisher), `"reliable"`, `"transient_local"`
            (reliable, including the last message from before the setup), or an rclpy `QoSProfile`.
        max_age_sec: The maximum age of a message, seconds of the node's clock; None for no limit.
        waits: Whether the leaf is RUNNING, instead of FAILURE, while there is no message.
        clearing_policy: When the message is forgotten: `ClearingPolicy.NEVER`, `ON_INITIALISE` to use only those
            that arrive after the leaf was entered, `ON_SUCCESS` to use each only once.

    Example:
        A condition on a sensor, FAILURE also while there is no message::

            class BatteryOk(TopicLeaf):
                topic_type = "sensor_msgs/msg/BatteryState"
                topic_name = "battery"
                max_age_sec = 5.0

                def on_message(self, message: Any) -> Status:
                    # A percentage of 85, or NaN, is unknown.
                    return Status.SUCCESS if battery_share(message) > 0.2 else Status.FAILURE
    """

    required_attributes: ClassVar[Mapping[str, str]] = {
        "topic_type": "sensor_msgs/msg/BatteryState",
        "topic_name": "battery",
    }
    """The attributes that a class or its constructor must set, with examples; `checks.leaf_classes` asks for them."""
    use_kind: ClassVar[str] = "topic"
    """The kind of `Use` in the registration of a leaf."""
    topic_type: Any = None
    topic_name: str = ""
    qos: Any = "sensor_data"
    max_age_sec: float | None = None
    waits: bool = False
    clearing_policy: ClearingPolicy = ClearingPolicy.NEVER

    def __init__(self, name: str) -> None:
        super().__init__(name)
        self._subscription: Subscription | None = None
        self._message: Any = None
        self._received_sec = -math.inf
        self._problem = ""

    @property
    def message(self) -> Any:
        """The latest message; None if there is none, or it is too old."""
        if self._message is None or self.max_age_sec is None:
            return self._message
        # A clock that jumps back, as that of a restarted simulator, makes every message too old.
        age_sec = self._now_sec() - self._received_sec
        return self._message if 0.0 <= age_sec <= self.max_age_sec else None

    @property
    def absence_reason(self) -> str:
        """The reason why there is no usable message, as the end of a sentence.

        It describes the last message, or the ROS graph. It is empty if a publisher exists whose messages reach the leaf.
        """
        if self.unusable_reason or self._node is None:
            return self.unusable_reason
        return explain_absence(self._node, self, "topic", self.topic_name)

    def setup(self, **kwargs: Any) -> None:
        """Subscribe to the topic.

        Args:
            **kwargs: `node` and optionally `wake`, see `RosLeaf`.

        Raises:
            LeafDefinitionError: If the class does not name the topic, or the type is not installed.
        """
        self.shutdown()
        super().setup(**kwargs)
        self.subscribe()

    def subscribe(self) -> None:
        """Subscribe to the topic instead of the previous one, whose message is dropped."""
        self._unsubscribe()
        owner = type(self).__name__
        interface = find_interface(owner, "msg", self.topic_name, self.topic_type)
        qos = qos_profile(owner, self.qos)
        self._subscription = self.node.create_subscription(interface, self.topic_name, self._on_message, qos)

    def initialise(self) -> None:
        """Discard the earlier message if the clearing policy requires it."""
        if self.clearing_policy is ClearingPolicy.ON_INITIALISE:
            self._message = None

    def update(self) -> Status:
        """Return the status for the latest message, or for a missing one."""
        message = self.message
        self.feedback_message = ""
        try:
            status = self.on_silence() if message is None else self.on_message(message)
        except UnusableValueError as error:
            self._refuse(error)
            self._message = None
            status = self.on_silence()
        if status is Status.SUCCESS and self.clearing_policy is ClearingPolicy.ON_SUCCESS:
            self._message = None
        return status

    def shutdown(self) -> None:
        """Discard the message and end the subscription."""
        self._unsubscribe()
        super().shutdown()

    def _unsubscribe(self) -> None:
        self._message = None
        if self._subscription is not None:
            if is_node_valid(self.node):
                self.node.destroy_subscription(self._subscription)
            self._subscription = None

    def check_message(self, message: Any) -> None:
        """Check a message on arrival; a rejected message does not replace the previous one.

        Raises:
            UnusableValueError: If a field is outside its definition.
        """

    def on_message(self, message: Any) -> Status:  # noqa: ARG002 - for subclasses
        """Return the status for a message; by default SUCCESS, regardless of its content. Called in every tick."""
        return Status.SUCCESS

    def on_silence(self) -> Status:
        """Return the status while there is no message: RUNNING for a leaf that `waits`, else FAILURE."""
        old = "" if self._message is None else f" within {self.max_age_sec:g} s"
        self.feedback_message = f"no message on '{self.topic_name}'{old}{self.absence_reason}"
        return Status.RUNNING if self.waits else Status.FAILURE

    @property
    def unusable_reason(self) -> str:
        """The reason why the last message is unusable, as the end of a sentence; empty if it is usable or missing."""
        return f" ({self._problem})" if self._problem else ""

    def _on_message(self, message: Any) -> None:
        try:
            check_stamp(message, self.node, self.max_age_sec)
            self.check_message(message)
        except UnusableValueError as error:
            self._refuse(error)
            return
        self._problem = ""
        self._receive(message)

    def _refuse(self, error: UnusableValueError) -> None:
        self._problem = str(error)
        value_reports(self.node).report_problem(f"Topic '{self.topic_name}'", error)

    def _receive(self, message: Any) -> None:
        """Store a usable message."""
        awaited = self.status is Status.RUNNING and self.message is None
        self._message, self._received_sec = message, self._now_sec()
        if awaited:
            self._wake()

    def _now_sec(self) -> float:
        return node_sec(self.node)
