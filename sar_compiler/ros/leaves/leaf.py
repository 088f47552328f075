"""The base class of leaves that use ROS 2, and objects that the leaves of a node share."""

from collections.abc import Callable, Hashable
from importlib import import_module
from typing import TYPE_CHECKING, Any, TypeVar, cast

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from sar_compiler.errors import SarError
from sar_compiler.runtime.leaf_protocol import Wake, ignore_wake
from sar_compiler.tree.display_text import shorten_to_line
from sar_compiler.tree.guessing import did_you_mean, nearest

if TYPE_CHECKING:
    from rclpy.node import Node
    from rclpy.qos import QoSProfile

T = TypeVar("T")


def is_node_valid(node: "Node") -> bool:
    """Return whether a node exists and its context is not shut down."""
    from rclpy.exceptions import InvalidHandle

    try:
        with node.handle:
            return bool(node.context.ok())
    except InvalidHandle:
        return False


_ATTRIBUTE = "_sar_compiler_of_node"


def of_node(node: "Node", key: Hashable, make: Callable[[], T]) -> T:
    """Return the object that is stored on a node under a key; the first call creates the object.

    The object is part of the node, so it may refer to the node.

    Args:
        node: The node.
        key: The key of the object.
        make: Creates the object.
    """
    objects: dict[Hashable, Any] = vars(node).setdefault(_ATTRIBUTE, {})
    if key not in objects:
        objects[key] = make()
    return cast("T", objects[key])


class MissingNodeError(SarError, KeyError):
    """Raised if a leaf that needs a ROS node was set up without one, or ticked before its setup.

    The class is also a `KeyError`, because py_trees' own ROS leaves raise a `KeyError` in this case.

    Args:
        leaf_name: The leaf's name.
        leaf_class: The name of the leaf's class.
    """

    def __init__(self, leaf_name: str, leaf_class: str) -> None:
        self.leaf_name = leaf_name
        self.leaf_class = leaf_class
        super().__init__(leaf_name, leaf_class)

    def __str__(self) -> str:
        return (
            f"'{self.leaf_name}' ({self.leaf_class}) uses ROS, but has no ROS node. Pass an rclpy node when you set up the tree: "
            f"setup(node=my_node)"
        )


class LeafDefinitionError(SarError):
    """Raised if a required attribute of a leaf is missing or invalid, or the leaf's interface type is not installed."""


class RosLeaf(Behaviour):
    """A leaf that has a ROS node, and can request a tick of its tree.

    Args:
        name: The leaf's name.

    Attributes:
        outcome_label: The label of the last declared outcome, which distinguishes outcomes with the same status (`outcome`).
    """

    def __init__(self, name: str) -> None:
        super().__init__(name)
        self.outcome_label = ""
        self._node: Node | None = None
        self._wake: Wake = ignore_wake

    def setup(self, **kwargs: Any) -> None:
        """Store the rclpy node, without blocking.

        Args:
            **kwargs: `node`, the rclpy node, and optionally `wake`, a function that requests a tick.

        Raises:
            MissingNodeError: If `node` is missing.
        """
        if kwargs.get("node") is None:
            raise MissingNodeError(self.name, type(self).__name__)
        self._node = kwargs["node"]
        self._wake = kwargs.get("wake", ignore_wake)

    def require_definition(self) -> None:
        """Check the attributes in the tree file; called before a run waits for the tree's requirements.

        Raises:
            LeafDefinitionError: If an attribute is invalid.
        """

    def shutdown(self) -> None:
        """Release the node."""
        self._node = None

    @property
    def node(self) -> "Node":
        """The rclpy node with which the leaf was set up.

        Raises:
            MissingNodeError: If the leaf was not set up, or has been shut down.
        """
        if self._node is None:
            raise MissingNodeError(self.name, type(self).__name__)
        return self._node

    def outcome(self, status: Status, label: str) -> Status:
        """Return the status, and store the label of the declared outcome.

        Args:
            status: The status of the outcome.
            label: The label of the outcome; empty if the outcome is not declared.
        """
        self.outcome_label = label
        return status

    def log(self, text: str) -> None:
        """Log a message on one line; line breaks and unprintable characters are escaped, and a long message is shortened."""
        self.node.get_logger().info(shorten_to_line(text))

    def warn(self, text: str) -> None:
        """Log a warning on one line, like `log`, and store it as the leaf's feedback message."""
        self.feedback_message = text
        self.node.get_logger().warning(shorten_to_line(text))


NAMED_QOS = {
    "sensor_data": ("best_effort", "volatile"),
    "reliable": ("reliable", "volatile"),
    "transient_local": ("reliable", "transient_local"),
}
"""The reliability and durability of each named QoS profile, least demanding first."""
WORDS = {"action": "action", "srv": "service", "msg": "topic"}
"""The word for an endpoint, such as `service`, by the kind of its interface."""


def find_interface(owner: str, kind: str, name: str, written: Any) -> Any:
    """Return the Python class of an action, service or message type.

    Args:
        owner: The name of the leaf's class, for error messages.
        kind: `action`, `srv` or `msg`.
        name: The name of the server or topic, which must not be empty.
        written: The type, as a string such as `nav2_msgs/action/NavigateToPose` or as the Python class itself.

    Raises:
        LeafDefinitionError: If the name or type is missing, or the type is not installed.
    """
    word = WORDS[kind]
    if not name or not written:
        missing = f"{word}_type" if name else f"{word}_name"
        raise LeafDefinitionError(
            f"{owner} has no {missing}. Set the attribute in the class or its constructor"
        )
    if not isinstance(written, str):
        return written
    package, _, cls = written.partition(f"/{kind}/")
    if not (package.isidentifier() and cls.isidentifier()):
        raise LeafDefinitionError(f"{owner}: {word}_type is '{written}'. Write it as 'package/{kind}/Name'")
    return _import_interface(owner, written, package, kind, cls)


def interface_name(interface: Any) -> str:
    """Return the full ROS name of an interface's Python class, such as `package/srv/Name`."""
    package, kind, *_ = f"{interface.__module__}.".split(".")
    return f"{package}/{kind}/{interface.__name__}"


def qos_profile(owner: str, written: Any) -> "QoSProfile":
    """Create the QoS profile of a subscription that keeps only the latest message.

    Args:
        owner: The name of the leaf's class, for error messages.
        written: `sensor_data`, `reliable`, `transient_local`, or an rclpy `QoSProfile`, which is returned unchanged.

    Raises:
        LeafDefinitionError: If *written* is any other string.
    """
    from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

    if not isinstance(written, str):
        return written
    if written not in NAMED_QOS:
        message = f"{owner}: qos is '{written}'. Write one of {', '.join(NAMED_QOS)}, or an rclpy QoSProfile"
        raise LeafDefinitionError(message)
    reliability, durability = NAMED_QOS[written]
    return QoSProfile(
        depth=1,
        reliability=ReliabilityPolicy.get_from_short_key(reliability),
        durability=DurabilityPolicy.get_from_short_key(durability),
    )


def _import_interface(owner: str, written: str, package: str, kind: str, cls: str) -> Any:
    try:
        module = import_module(f"{package}.{kind}")
    except ImportError as error:
        message = (
            f"{owner}: {written} cannot be imported ({error}). Build its package, and source its workspace"
        )
        raise LeafDefinitionError(message) from error
    if hasattr(module, cls):
        return getattr(module, cls)
    near = nearest(cls, dir(module))
    message = f"{owner}: there is no {written}{did_you_mean(near and f'{package}/{kind}/{near}')}"
    raise LeafDefinitionError(message)
