"""The base class of leaves that use ROS 2, and objects shared by a node's leaves."""

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
    """Return the object that a node has for a key; create it in the first call.

    It is an attribute of the node, so it may refer to the node.

    Args:
        node: The node.
        key: The key of the object.
        make: Creates the object in the first call.
    """
    held: dict[Hashable, Any] = vars(node).setdefault(_ATTRIBUTE, {})
    if key not in held:
        held[key] = make()
    return cast("T", held[key])


class MissingNodeError(SarError, KeyError):
    """A leaf that needs a ROS node was set up without one, or ticked before its setup.

    It is also a `KeyError`, which is what py_trees' own ROS leaves raise.

    Args:
        leaf_name: The node's name.
        leaf_class: The name of its class.
    """

    def __init__(self, leaf_name: str, leaf_class: str) -> None:
        self.leaf_name = leaf_name
        self.leaf_class = leaf_class
        super().__init__(leaf_name, leaf_class)

    def __str__(self) -> str:
        return (
            f"'{self.leaf_name}' ({self.leaf_class}) uses ROS but has no node: pass an rclpy node to the "
            "tree's setup, as in setup(node=my_node)"
        )


class LeafDefinitionError(SarError):
    """The class of a leaf lacks a required attribute, or its interface type is not installed."""


class RosLeaf(Behaviour):
    """A leaf that has a node, and may wake its tree's engine.

    Args:
        name: The node's name.

    Attributes:
        outcome_label: The label of the declared outcome that it has returned, if its status has several (`outcome`).
    """

    def __init__(self, name: str) -> None:
        super().__init__(name)
        self.outcome_label = ""
        self._node: Node | None = None
        self._wake: Wake = ignore_wake

    def setup(self, **kwargs: Any) -> None:
        """Store the node to use, without blocking.

        Args:
            **kwargs: `node`, the rclpy node; and optionally `wake`, which requests a tick.

        Raises:
            MissingNodeError: If there is no `node`.
        """
        if kwargs.get("node") is None:
            raise MissingNodeError(self.name, type(self).__name__)
        self._node = kwargs["node"]
        self._wake = kwargs.get("wake", ignore_wake)

    def require_definition(self) -> None:
        """Check the attributes from the file, before waiting for requirements.

        Raises:
            LeafDefinitionError: If an attribute is invalid.
        """

    def shutdown(self) -> None:
        """Release the node."""
        self._node = None

    @property
    def node(self) -> "Node":
        """The node that the leaf was set up with.

        Raises:
            MissingNodeError: If it was not set up, or has been shut down.
        """
        if self._node is None:
            raise MissingNodeError(self.name, type(self).__name__)
        return self._node

    def outcome(self, status: Status, label: str) -> Status:
        """Return a status, and record the label of its declared outcome.

        Args:
            status: The status.
            label: The label of the outcome; empty for no declared outcome.
        """
        self.outcome_label = label
        return status

    def log(self, text: str) -> None:
        """Write a line to the mission's log; line breaks and unprintable characters are escaped."""
        self.node.get_logger().info(shorten_to_line(text))

    def warn(self, text: str) -> None:
        """Log a warning, as `log` does, and store it as the leaf's feedback message."""
        self.feedback_message = text
        self.node.get_logger().warning(shorten_to_line(text))


NAMED_QOS = {
    "sensor_data": ("best_effort", "volatile"),
    "reliable": ("reliable", "volatile"),
    "transient_local": ("reliable", "transient_local"),
}
"""The qualities of service that have a name, the least demanding first: reliability and durability."""
WORDS = {"action": "action", "srv": "service", "msg": "topic"}
"""The kinds of interfaces, and the words for their endpoints."""


def find_interface(owner: str, kind: str, name: str, written: Any) -> Any:
    """Return the Python class of an action, a service or a message.

    Args:
        owner: The class of the leaf, for messages.
        kind: `action`, `srv` or `msg`.
        name: The name of the server or topic, which is required as well.
        written: The type: a string such as `nav2_msgs/action/NavigateToPose`, which is resolved only here, or the
            Python class itself.

    Raises:
        LeafDefinitionError: If name or type is missing, or the type is not installed.
    """
    word = WORDS[kind]
    if not name or not written:
        missing = f"{word}_type" if name else f"{word}_name"
        raise LeafDefinitionError(f"{owner} has no {missing}. Set it on the class, or in the constructor")
    if not isinstance(written, str):
        return written
    package, _, cls = written.partition(f"/{kind}/")
    if not (package.isidentifier() and cls.isidentifier()):
        raise LeafDefinitionError(f"{owner}: {word}_type is '{written}'. Write it as 'package/{kind}/Name'")
    return _import_interface(owner, written, package, kind, cls)


def interface_name(interface: Any) -> str:
    """Return the full name of a Python class of an interface or a message: `package/srv/Name`."""
    package, kind, *_ = f"{interface.__module__}.".split(".")
    return f"{package}/{kind}/{interface.__name__}"


def qos_profile(owner: str, written: Any) -> "QoSProfile":
    """Return the quality of service of a subscription that keeps only the latest message.

    Args:
        owner: The class of the leaf, for messages.
        written: `sensor_data`, `reliable`, `transient_local`, or an rclpy `QoSProfile`.

    Raises:
        LeafDefinitionError: If it is any other string.
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
