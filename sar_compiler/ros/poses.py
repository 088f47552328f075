"""Rotations about the z axis as quaternions, and the message with an initial pose for a localisation."""

import math
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from geometry_msgs.msg import PoseWithCovarianceStamped
    from rclpy.node import Node

# The variances of an initial pose by their index in the covariance: x and y in m², yaw in rad². The standard deviations are 0.5 m and 15°.
_VARIANCES = {0: 0.25, 7: 0.25, 35: 0.068}


def turn_by(orientation: Any, yaw: float) -> None:
    """Set a new quaternion message to a rotation about the z axis, given the angle in radians."""
    orientation.z, orientation.w = math.sin(yaw / 2), math.cos(yaw / 2)


def yaw_of(orientation: Any) -> float:
    """Return the rotation of a quaternion message about the z axis, in radians; NaN if a component is not finite."""
    return yaw_of_quaternion(orientation.x, orientation.y, orientation.z, orientation.w)


def yaw_of_quaternion(x: float, y: float, z: float, w: float) -> float:
    """Return the rotation of a quaternion of any length about the z axis, in radians; NaN if a component is not finite."""
    if not math.isfinite(math.hypot(x, y, z, w)):
        return math.nan
    return math.atan2(2.0 * (w * z + x * y), w * w + x * x - y * y - z * z)


def estimated_pose(node: "Node", x: float, y: float, yaw: float) -> "PoseWithCovarianceStamped":
    """Create the message that sets the pose of a localisation, with default variances.

    Args:
        node: The node whose clock sets the time stamp.
        x: The position's x, in metres in the frame `map`.
        y: The position's y, in metres in the frame `map`.
        yaw: The heading, in radians.
    """
    from geometry_msgs.msg import PoseWithCovarianceStamped

    message = PoseWithCovarianceStamped()
    message.header.frame_id = "map"
    message.header.stamp = node.get_clock().now().to_msg()
    for index, variance in _VARIANCES.items():
        message.pose.covariance[index] = variance
    message.pose.pose.position.x, message.pose.pose.position.y = float(x), float(y)
    turn_by(message.pose.pose.orientation, yaw)
    return message
