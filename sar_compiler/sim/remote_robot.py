"""A simulated robot as the other processes of its simulation see it: by its topics."""

import math
import time
from typing import Any

from geometry_msgs.msg import TwistStamped
from nav_msgs.msg import Odometry
from rclpy.qos import qos_profile_sensor_data
from tf2_msgs.msg import TFMessage

from sar_compiler.ros.poses import yaw_of
from sar_compiler.sim.geometry import ORIGIN, Pose2D
from sar_compiler.sim.messages import from_pose, to_stamp, to_transform
from sar_compiler.sim.node_host import NodeHost
from sar_compiler.sim.robot import Limits, Robot, RobotState, Twist2D

# The true pose and that of the odometry, of one step.
_PLACES = "simulator/places"
_MAP, _ODOM, _BASE = "map", "odom", "base_link"
# A transform from `map` that is older says nothing of now, in seconds of either clock.
_FRESH_SEC = 0.5


class TruePlaces:
    """Tells the localisation of a robot, where that is another process, where the robot truly is.

    Args:
        host: Creates the node.
        robot: The robot.
    """

    def __init__(self, host: NodeHost, robot: Robot) -> None:
        self._robot = robot
        self._publisher = host.create("simulator_places").create_publisher(TFMessage, _PLACES, 10)

    def publish(self, now_ns: int) -> None:
        """Publish both at a simulated time, nanoseconds."""
        state, stamp = self._robot.state, to_stamp(now_ns)
        transforms = [
            to_transform(_MAP, _BASE, state.pose, stamp),
            to_transform(_ODOM, _BASE, state.odometry, stamp),
        ]
        self._publisher.publish(TFMessage(transforms=transforms))


class RemoteRobot:
    """The robot, of which a process knows what it hears, and which it drives by `cmd_vel`.

    Args:
        host: Creates the node.
        name: The node's name.
        knows_truth: Whether its true place is known, as to a localisation; else its odometry is.

    Attributes:
        limits: The limits of its drive.
        state: Its state, as far as it is known.
        is_known: Whether its true place is.
    """

    def __init__(self, host: NodeHost, name: str, *, knows_truth: bool = False) -> None:
        self.limits = Limits()
        self.state = RobotState(ORIGIN)
        self.is_known = False
        self._now_ns = 0
        self._offset: Pose2D | None = None
        self._heard_at = (-math.inf, -math.inf)
        node = host.create(name)
        if knows_truth:
            node.create_subscription(TFMessage, _PLACES, self._on_places, 10)
            return
        node.create_subscription(Odometry, "odometry/filtered", self._on_odometry, qos_profile_sensor_data)
        node.create_subscription(TFMessage, "/tf", self._on_transforms, 100)
        self._commands = node.create_publisher(TwistStamped, "cmd_vel", 10)

    @property
    def robot(self) -> "RemoteRobot":
        """Itself, as a `RobotInterface` has its robot."""
        return self

    def step(self, now_ns: int) -> None:
        """Note the simulated time, nanoseconds."""
        self._now_ns = now_ns

    def place(self) -> Pose2D | None:
        """Return where it is by the last transform from `map` and the odometry; None without a fresh one."""
        now, wall = self._now_ns / 1e9, time.monotonic()
        if self._offset is None or min(now - self._heard_at[0], wall - self._heard_at[1]) > _FRESH_SEC:
            return None
        return self._offset.compose(self.state.odometry)

    def drive(self, twist: Twist2D) -> None:
        """Command it."""
        message = TwistStamped()
        message.header.frame_id, message.header.stamp = _BASE, to_stamp(self._now_ns)
        message.twist.linear.x, message.twist.angular.z = twist.v, twist.w
        self._commands.publish(message)

    def _on_places(self, message: Any) -> None:
        pose, odometry = (_planar(each.transform) for each in message.transforms)
        self.state, self.is_known = RobotState(pose, odometry=odometry), True

    def _on_odometry(self, message: Any) -> None:
        twist, odometry = message.twist.twist, from_pose(message.pose.pose)
        if odometry is not None:
            velocity = Twist2D(twist.linear.x, twist.angular.z)
            self.state = RobotState(self.state.pose, velocity, odometry)

    def _on_transforms(self, message: Any) -> None:
        for each in message.transforms:
            if each.header.frame_id == _MAP:
                self._offset = _planar(each.transform)
                self._heard_at = self._now_ns / 1e9, time.monotonic()


def _planar(transform: Any) -> Pose2D:
    place = transform.translation
    return Pose2D(place.x, place.y, yaw_of(transform.rotation))
