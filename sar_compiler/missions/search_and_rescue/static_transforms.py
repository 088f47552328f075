"""Static frames, published so that a late subscriber receives all of them.

`/tf_static` keeps one message for late subscribers, so that message must contain every frame published so far,
and a frame that is sent again must replace its earlier version. (tf2_ros for Python ignores the second sending.)
"""

from typing import TYPE_CHECKING

from sar_compiler.ros.leaves.interfaces import qos_profile
from sar_compiler.ros.of_node import of_node

if TYPE_CHECKING:
    from geometry_msgs.msg import TransformStamped
    from rclpy.node import Node

TOPIC = "/tf_static"
"""Absolute, like tf2's own; a mission in a namespace remaps `/tf_static:=tf_static`, as Nav2 does."""


class StaticTransforms:
    """The static frames of one node.

    Use `static_transforms_of`: of two publishers on one node each would send late subscribers only its own frames.

    Args:
        node: The rclpy node that publishes.
    """

    def __init__(self, node: "Node") -> None:
        from tf2_msgs.msg import TFMessage

        latched = qos_profile(type(self).__name__, "transient_local")
        self._message_type = TFMessage
        self._publisher = node.create_publisher(TFMessage, TOPIC, latched)
        self._transforms: dict[str, TransformStamped] = {}

    def put(self, transform: "TransformStamped") -> None:
        """Publish a frame, together with all earlier ones; one with the same child frame is replaced."""
        self._transforms[transform.child_frame_id] = transform
        self._publisher.publish(self._message_type(transforms=list(self._transforms.values())))


def static_transforms_of(node: "Node") -> StaticTransforms:
    """Return the static frames of a node, the same object in every call.

    They exist as long as the node: frames of a finished mission remain known.
    """
    return of_node(node, StaticTransforms, lambda: StaticTransforms(node))
