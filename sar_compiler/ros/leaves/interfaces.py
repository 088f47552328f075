"""Names, types and quality of service of the interfaces that a leaf's class declares."""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from py_trees.behaviour import Behaviour

from sar_compiler.nodes.spec import Use
from sar_compiler.ros.leaves.leaf import LeafDefinitionError
from sar_compiler.tree.guessing import did_you_mean, nearest

if TYPE_CHECKING:
    from rclpy.qos import QoSProfile

_QOS = {
    "sensor_data": ("best_effort", "volatile"),
    "reliable": ("reliable", "volatile"),
    "transient_local": ("reliable", "transient_local"),
}
_WORDS = {"action": "action", "srv": "service", "msg": "topic"}


def find_interface(owner: str, kind: str, name: str, written: Any) -> Any:
    """Return the Python class of an action, a service or a message.

    Args:
        owner: The class of the leaf, for messages.
        kind: `action`, `srv` or `msg`.
        name: The name of the server or topic, which must not be missing either.
        written: The type: a text such as `nav2_msgs/action/NavigateToPose`, which is resolved only here, or
            the Python class itself.

    Raises:
        LeafDefinitionError: If name or type is missing, or the type is not installed.
    """
    word = _WORDS[kind]
    if not name or not written:
        missing = f"{word}_type" if name else f"{word}_name"
        raise LeafDefinitionError(f"{owner} has no {missing}; set it on the class, or in the constructor")
    if not isinstance(written, str):
        return written
    package, _, cls = written.partition(f"/{kind}/")
    if not (package.isidentifier() and cls.isidentifier()):
        raise LeafDefinitionError(f"{owner}: {word}_type is '{written}'; write it as 'package/{kind}/Name'")
    return _imported(owner, written, package, kind, cls)


def declared_types(root: Behaviour) -> dict[Use, str]:
    """Return the types of the actions, services and topics that a tree's leaves declare, as the graph of ROS names them."""
    types: dict[Use, str] = {}
    for leaf in root.iterate():
        for word in _WORDS.values():
            name, written = getattr(leaf, f"{word}_name", None), getattr(leaf, f"{word}_type", None)
            if isinstance(name, str) and written:
                types[Use(word, name)] = written if isinstance(written, str) else interface_name(written)
    return types


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
        LeafDefinitionError: If it is any other text.
    """
    from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

    if not isinstance(written, str):
        return written
    if written not in _QOS:
        message = f"{owner}: qos is '{written}'; write one of {', '.join(_QOS)}, or an rclpy QoSProfile"
        raise LeafDefinitionError(message)
    reliability, durability = _QOS[written]
    return QoSProfile(
        depth=1,
        reliability=ReliabilityPolicy.get_from_short_key(reliability),
        durability=DurabilityPolicy.get_from_short_key(durability),
    )


def _imported(owner: str, written: str, package: str, kind: str, cls: str) -> Any:
    try:
        module = import_module(f"{package}.{kind}")
    except ImportError as error:
        message = f"{owner}: {written} cannot be imported ({error}); is its package built, and its workspace sourced?"
        raise LeafDefinitionError(message) from error
    if hasattr(module, cls):
        return getattr(module, cls)
    near = nearest(cls, dir(module))
    message = f"{owner}: there is no {written}{did_you_mean(near and f'{package}/{kind}/{near}')}"
    raise LeafDefinitionError(message)
