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
    """A leaf that evaluates the latest message on a topic.

    While there is no message, a leaf with `waits` returns RUNNING, and a leaf without it returns FAILURE. The leaf subscribes in its setup,
    so a message may be older than the activation; `max_age_sec` and `clearing_policy` limit the age of messages.

    A subclass sets the attributes `topic_type` and `topic_name`, in the class or its constructor. If the content of a message
    matters, it defines the method `on_message`. A message is reported once and ignored if `on_message` raises
    `UnusableValueError`, or its time stamp is in the future or older than `max_age_sec`. If `check_message` raises this error, the
    last usable message is kept.

    Attributes:
        topic_type: `"package/msg/Name"`, or the Python class.
        topic_name: The (relative) name of the topic.
        qos: `"sensor_data"` (best effort, compatible with every publisher), `"reliable"`, `"transient_local"`
            (reliable, including the last message before the setup), or an rclpy `QoSProfile`.
        max_age_sec: The maximum age of a message, in seconds of the node's clock; None for no limit.
        waits: Whether the leaf returns RUNNING, instead of FAILURE, while there is no message.
        clearing_policy: When the latest message is discarded: `ClearingPolicy.NEVER`; `ON_INITIALISE`, to use only
            messages that arrive after the leaf has started; or `ON_SUCCESS`, to use each message only once.

    Example:
        A condition on a sensor, which returns FAILURE while there is no message::

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
    """The attributes that a subclass must set, in the class or in its constructor, each with an example. `checks.leaf_classes` checks these
    attributes.
    """
    use_kind: ClassVar[str] = "topic"
    """The kind of the `Use` with which a leaf is registered."""
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
        """The latest message; None if no message has arrived, or the latest message is too old."""
        if self._message is None or self.max_age_sec is None:
            return self._message
        # If the clock jumps back, as after the restart of a simulator, every message is too old.
        age_sec = self._now_sec() - self._received_sec
        return self._message if 0.0 <= age_sec <= self.max_age_sec else None

    @property
    def absence_reason(self) -> str:
        """A sentence ending with the reason why there is no usable message.

        The reason is a problem with the last message or with the ROS graph. The text is empty if messages of a publisher reach the leaf.
        """
        if self.unusable_reason or self._node is None:
            return self.unusable_reason
        return explain_absence(self._node, self, "topic", self.topic_name)

    def setup(self, **kwargs: Any) -> None:
        """Subscribe to the topic.

        Args:
            **kwargs: `node`, and optionally `wake` (see `RosLeaf`).

        Raises:
            LeafDefinitionError: If the class does not define the topic's name, or the type is not installed.
        """
        self.shutdown()
        super().setup(**kwargs)
        self.subscribe()

    def subscribe(self) -> None:
        """Subscribe to the topic; end the previous subscription, and discard the message that it received."""
        self._unsubscribe()
        owner = type(self).__name__
        interface = find_interface(owner, "msg", self.topic_name, self.topic_type)
        qos = qos_profile(owner, self.qos)
        self._subscription = self.node.create_subscription(interface, self.topic_name, self._on_message, qos)

    def initialise(self) -> None:
        """Discard the latest message if the clearing policy is `ON_INITIALISE`."""
        if self.clearing_policy is ClearingPolicy.ON_INITIALISE:
            self._message = None

    def update(self) -> Status:
        """Return the status of `on_message` for the latest message, or of `on_silence` if there is no message."""
        message = self.message
        self.feedback_message = ""
        try:
            status = self.on_silence() if message is None else self.on_message(message)
        except UnusableValueError as error:
            self._report_unusable(error)
            self._message = None
            status = self.on_silence()
        if status is Status.SUCCESS and self.clearing_policy is ClearingPolicy.ON_SUCCESS:
            self._message = None
        return status

    def shutdown(self) -> None:
        """Discard the latest message, and end the subscription."""
        self._unsubscribe()
        super().shutdown()

    def _unsubscribe(self) -> None:
        self._message = None
        if self._subscription is not None:
            if is_node_valid(self.node):
                self.node.destroy_subscription(self._subscription)
            self._subscription = None

    def check_message(self, message: Any) -> None:
        """Check a message when it arrives; a rejected message does not replace the latest message.

        Raises:
            UnusableValueError: If the value of a field violates the message's definition.
        """

    def on_message(self, message: Any) -> Status:  # noqa: ARG002 - for subclasses
        """Return the leaf's status for the latest message, by default SUCCESS; called in every tick."""
        return Status.SUCCESS

    def on_silence(self) -> Status:
        """Return the leaf's status while there is no message: RUNNING if `waits` is set, otherwise FAILURE."""
        old = "" if self._message is None else f" within {self.max_age_sec:g} s"
        self.feedback_message = f"no message on '{self.topic_name}'{old}{self.absence_reason}"
        return Status.RUNNING if self.waits else Status.FAILURE

    @property
    def unusable_reason(self) -> str:
        """A sentence ending with the reason why the last message is unusable; empty if there is no such reason."""
        return f" ({self._problem})" if self._problem else ""

    def _on_message(self, message: Any) -> None:
        try:
            check_stamp(message, self.node, self.max_age_sec)
            self.check_message(message)
        except UnusableValueError as error:
            self._report_unusable(error)
            return
        self._problem = ""
        self._receive(message)

    def _report_unusable(self, error: UnusableValueError) -> None:
        self._problem = str(error)
        value_reports(self.node).report_problem(f"Topic '{self.topic_name}'", error)

    def _receive(self, message: Any) -> None:
        """Store a usable message, and request a tick if the leaf waits for it."""
        is_awaited = self.status is Status.RUNNING and self.message is None
        self._message, self._received_sec = message, self._now_sec()
        if is_awaited:
            self._wake()

    def _now_sec(self) -> float:
        return node_sec(self.node)
