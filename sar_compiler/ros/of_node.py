"""Objects of which each node has one, however many leaves use it."""

from collections.abc import Callable, Hashable
from typing import TYPE_CHECKING, Any, TypeVar, cast

if TYPE_CHECKING:
    from rclpy.node import Node

T = TypeVar("T")

_ATTRIBUTE = "_sar_compiler_of_node"


def of_node(node: "Node", key: Hashable, make: Callable[[], T]) -> T:
    """Return the node's object of a key, the same in every call; it exists as long as the node.

    The node itself has it, so that it may refer to the node.

    Args:
        node: The node.
        key: Says what it is.
        make: Makes it, in the first call.
    """
    held: dict[Hashable, Any] = vars(node).setdefault(_ATTRIBUTE, {})
    if key not in held:
        held[key] = make()
    return cast("T", held[key])
