"""The leaf to derive from for what a ROS topic says."""

import math
from typing import TYPE_CHECKING, Any

from py_trees.common import ClearingPolicy, Status

from sar_compiler.ros.leaves.interfaces import find_interface, qos_profile
from sar_compiler.ros.leaves.leaf import RosLeaf, alive

if TYPE_CHECKING:
    from rclpy.subscription import Subscription

_NANOSECONDS = 1_000_000_000


class TopicLeaf(RosLeaf):
    """A leaf that looks at the latest message of a topic.

    A condition answers at once, and a leaf that `waits` is RUNNING until there is a message. It listens from the
    setup on, so a message may be older than the activation; `max_age_sec` and `clearing_policy` say how old.

    A subclass has the attributes `topic_type` and `topic_name`, of the class or set by its constructor, and, where
    it matters what a message says, the method `on_message`.

    Args:
        name: The leaf's name in the tree.

    Attributes:
        topic_type: `"package/msg/Name"`, or the Python class.
        topic_name: The topic's (relative) name.
        qos: `"sensor_data"` (best effort, which goes with every publisher), `"reliable"`, `"transient_local"`
            (reliable, and the last message from before the setup counts too), or an rclpy `QoSProfile`.
        max_age_sec: How long ago a message may have come, seconds of the node's clock; None for ever.
        waits: Whether the leaf is RUNNING while there is no message, and not FAILURE.
        clearing_policy: When the message is forgotten: `ClearingPolicy.NEVER`, `ON_INITIALISE` to look only at those
            that come after the leaf was entered, `ON_SUCCESS` to look at each once.

    Example:
        A condition on a sensor, FAILURE also while nobody knows::

            class BatteryOk(TopicLeaf):
                topic_type = "sensor_msgs/msg/BatteryState"
                topic_name = "battery"
                max_age_sec = 5.0

                def on_message(self, message: Any) -> Status:
                    return Status.SUCCESS if message.percentage > 0.2 else Status.FAILURE
    """

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

    @property
    def message(self) -> Any:
        """The latest message; None if there is none, or none that is young enough."""
        if self._message is None or self.max_age_sec is None:
            return self._message
        # A clock that jumps back, as that of a simulator which starts anew, makes every message too old.
        age_sec = self._now_sec() - self._received_sec
        return self._message if 0.0 <= age_sec <= self.max_age_sec else None

    def setup(self, **kwargs: Any) -> None:
        """Subscribe to the topic.

        Args:
            **kwargs: `node` and optionally `wake`, see `RosLeaf`.

        Raises:
            LeafDefinitionError: If the class does not say what to listen to, or the type is not installed.
        """
        self.shutdown()
        super().setup(**kwargs)
        owner = type(self).__name__
        interface = find_interface(owner, "msg", self.topic_name, self.topic_type)
        qos = qos_profile(owner, self.qos)
        self._subscription = self.node.create_subscription(interface, self.topic_name, self._take, qos)

    def initialise(self) -> None:
        """Forget the message from before, where the clearing policy says so."""
        if self.clearing_policy is ClearingPolicy.ON_INITIALISE:
            self._message = None

    def update(self) -> Status:
        """Return what the latest message means, or its absence."""
        message = self.message
        self.feedback_message = ""
        status = self.on_silence() if message is None else self.on_message(message)
        if status is Status.SUCCESS and self.clearing_policy is ClearingPolicy.ON_SUCCESS:
            self._message = None
        return status

    def shutdown(self) -> None:
        """Forget the message and end the subscription; where the node is gone, so is that."""
        self._message = None
        if self._subscription is not None:
            if alive(self.node):
                self.node.destroy_subscription(self._subscription)
            self._subscription = None
        super().shutdown()

    def on_message(self, message: Any) -> Status:  # noqa: ARG002 - for subclasses
        """Return what a message means; by default SUCCESS, whatever is in it. Called in every tick."""
        return Status.SUCCESS

    def on_silence(self) -> Status:
        """Return what it means that there is no message: RUNNING for a leaf that `waits`, else FAILURE."""
        old = "" if self._message is None else f" within {self.max_age_sec:g} s"
        self.feedback_message = f"no message on '{self.topic_name}'{old}"
        return Status.RUNNING if self.waits else Status.FAILURE

    def _take(self, message: Any) -> None:
        awaited = self.status is Status.RUNNING and self.message is None
        self._message, self._received_sec = message, self._now_sec()
        if awaited:
            self._wake()

    def _now_sec(self) -> float:
        return float(self.node.get_clock().now().nanoseconds) / _NANOSECONDS
