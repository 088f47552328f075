"""Poses as messages: rotations about z, and the initial pose for a localisation."""

import math
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from geometry_msgs.msg import PoseWithCovarianceStamped
    from rclpy.node import Node

# Half a metre and 15 degrees of standard deviation, as variances: x and y in m², yaw in rad².
_VARIANCES = {0: 0.25, 7: 0.25, 35: 0.068}


def turn_by(orientation: Any, yaw: float) -> None:
    """Set a new quaternion to a rotation about z, by an angle in radians."""
    orientation.z, orientation.w = math.sin(yaw / 2), math.cos(yaw / 2)


def yaw_of(orientation: Any) -> float:
    """Return the angle about z of a quaternion of any length, in radians; NaN if it is not finite."""
    return yaw_of_quaternion(orientation.x, orientation.y, orientation.z, orientation.w)


def yaw_of_quaternion(x: float, y: float, z: float, w: float) -> float:
    """Return the angle about z of a quaternion, given as four numbers, in radians."""
    if not math.isfinite(math.hypot(x, y, z, w)):
        return math.nan
    return math.atan2(2.0 * (w * z + x * y), w * w + x * x - y * y - z * z)


def estimated_pose(node: "Node", x: float, y: float, yaw: float) -> "PoseWithCovarianceStamped":
    """Return a pose message for a localisation, with the current time and its own variances.

    Args:
        node: The node whose clock is used.
        x: In the frame `map`, metres.
        y: In the frame `map`, metres.
        yaw: Radians.
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
