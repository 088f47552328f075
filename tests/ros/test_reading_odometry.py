"""Tests of reading serialized odometry without creating a message object."""

import math
import struct

import pytest

pytestmark = pytest.mark.ros

FRAMES = ("", "o", "odom", "base_link", "robot1/odom")


def serialize_odometry(order: str, frame: str, child: str, numbers: list[float]) -> bytes:
    """Return an odometry message as a machine of a byte order serializes it."""
    data = struct.pack(f"{order}iI", 1, 2)
    for text in (frame, child):
        data += bytes(-len(data) % 4) + struct.pack(f"{order}I", len(text) + 1) + text.encode() + b"\0"
    data += bytes(-len(data) % 8) + struct.pack(f"{order}85d", *numbers)
    return bytes([0, order == "<", 0, 0]) + data


@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize("child", FRAMES)
@pytest.mark.parametrize("frame", FRAMES)
def test_frames_pose_and_speeds_match_message(order: str, frame: str, child: str) -> None:
    from nav_msgs.msg import Odometry
    from rclpy.serialization import deserialize_message

    from sar_compiler.ros.message_values import read_odometry
    from sar_compiler.ros.poses import yaw_of

    message = serialize_odometry(order, frame, child, [math.sin(number) for number in range(85)])
    there = deserialize_message(message, Odometry)
    reading = read_odometry(message)
    (x, y, yaw), speeds = reading.pose, reading.speeds
    assert (reading.frame, reading.child) == (there.header.frame_id, there.child_frame_id) == (frame, child)
    assert reading.stamp_sec == 1.000000002
    place, twist = there.pose.pose.position, there.twist.twist
    assert (x, y, yaw) == (place.x, place.y, yaw_of(there.pose.pose.orientation))
    linear, angular = twist.linear, twist.angular
    assert [*speeds] == [linear.x, linear.y, linear.z, angular.x, angular.y, angular.z]


def test_message_serialized_by_middleware_is_read() -> None:
    from nav_msgs.msg import Odometry
    from rclpy.serialization import serialize_message

    from sar_compiler.ros.message_values import read_odometry

    message = Odometry(child_frame_id="base")
    message.header.frame_id, message.pose.pose.position.y, message.twist.twist.linear.x = "odom", 2.5, 0.5
    reading = read_odometry(serialize_message(message))
    assert (reading.frame, reading.child) == ("odom", "base")
    assert (reading.usable_pose, [*reading.speeds]) == ((0.0, 2.5, 0.0), [0.5, 0.0, 0.0, 0.0, 0.0, 0.0])
