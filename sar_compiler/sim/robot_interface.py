"""One robot's topics, those of a rosbot stack: where it is simulated, and as the other processes of its simulation see it."""

import math
import time
from array import array
from collections import deque
from typing import Any

import numpy as np
from builtin_interfaces.msg import Time
from geometry_msgs.msg import TwistStamped
from nav_msgs.msg import Odometry
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import BatteryState, LaserScan
from tf2_msgs.msg import TFMessage

from sar_compiler.ros.poses import yaw_of
from sar_compiler.sim.battery import Battery
from sar_compiler.sim.geometry import ORIGIN, Pose2D
from sar_compiler.sim.messages import from_pose, to_pose, to_stamp, to_transform
from sar_compiler.sim.node_host import NodeHost
from sar_compiler.sim.robot import Limits, Robot, RobotState, Twist2D
from sar_compiler.sim.world import Lidar

# One scan in this many steps (5 Hz at 0.05 s).
_SCAN_EVERY = 4
# One state of the battery in this many steps (1 Hz).
_BATTERY_EVERY = 20
# The true pose and that of the odometry, of one step.
_PLACES = "simulator/places"
_MAP, _ODOM, _BASE = "map", "odom", "base_link"
# So many of its own commands can be on their way back to it.
_OWN_COMMANDS = 100
_CommandKey = tuple[str, int, int]


class RobotInterface:
    """Connects a robot to its topics: `cmd_vel` in; `odometry/filtered`, `scan`, `battery_state` and `/tf` out.

    Its own navigation drives it by `drive`, which takes effect in the step in which it is said, and is on `cmd_vel` for
    whoever listens.

    Args:
        host: Creates the node.
        robot: The robot, which is sent the latest command.
        battery: Its battery.
        seed: Seed of its scanner's noise.
        tells_truth: Whether to tell its localisation, which is another process, where it truly is.

    Attributes:
        limits: The limits of its drive.
    """

    def __init__(
        self, host: NodeHost, robot: Robot, battery: Battery, *, seed: int = 0, tells_truth: bool = False
    ) -> None:
        self._robot, self.limits, self._battery = robot, robot.limits, battery
        self._seed = seed
        self._lidar = Lidar()
        self._node = host.create("rosbot")
        self._odometry = self._node.create_publisher(Odometry, "odometry/filtered", 10)
        self._scan = self._node.create_publisher(LaserScan, "scan", qos_profile_sensor_data)
        self._battery_state = self._node.create_publisher(BatteryState, "battery_state", 10)
        # Absolute, as tf2 has it; in a namespace it is remapped, as Nav2 does.
        self._tf = self._node.create_publisher(TFMessage, "/tf", 100)
        self._node.create_subscription(TwistStamped, "cmd_vel", self._on_command, 10)
        self._commands = self._node.create_publisher(TwistStamped, "cmd_vel", 10)
        self._places = (
            host.create("simulator_places").create_publisher(TFMessage, _PLACES, 10) if tells_truth else None
        )
        self._own_commands: deque[_CommandKey] = deque(maxlen=_OWN_COMMANDS)
        self._stamp = to_stamp(0)
        self._odometry_message = Odometry(child_frame_id=_BASE)
        self._odometry_message.header.frame_id = _ODOM
        self._scan_message = self._empty_scan()

    @property
    def state(self) -> RobotState:
        """The robot's state."""
        return self._robot.state

    def publish(self, step: int, now_ns: int) -> None:
        """Publish the robot's sensor data at the end of a step.

        Args:
            step: The step's number.
            now_ns: The simulated time at its end, nanoseconds.
        """
        state = self._robot.state
        stamp = self._stamp = to_stamp(now_ns)
        message = self._odometry_message
        message.header.stamp = stamp
        message.pose.pose = to_pose(state.odometry)
        message.twist.twist.linear.x = state.velocity.v
        message.twist.twist.angular.z = state.velocity.w
        self._odometry.publish(message)
        self._tf.publish(TFMessage(transforms=[to_transform(_ODOM, _BASE, state.odometry, stamp)]))
        if step % _BATTERY_EVERY == 0:
            told = BatteryState(percentage=self._battery.share, present=True)
            told.header.stamp = stamp
            self._battery_state.publish(told)
        # The noise depends on the step alone, not on subscribers.
        if step % _SCAN_EVERY == 0 and self._scan.get_subscription_count():
            random = np.random.default_rng([self._seed, 3, step])
            ranges = self._lidar.scan(self._robot.surroundings(), state.pose, random)
            self._scan_message.header.stamp = stamp
            self._scan_message.ranges = array("f", ranges.astype(np.float32).tobytes())
            self._scan.publish(self._scan_message)
        if self._places is not None:
            truth = to_transform(_MAP, _BASE, state.pose, stamp)
            measured = to_transform(_ODOM, _BASE, state.odometry, stamp)
            self._places.publish(TFMessage(transforms=[truth, measured]))

    def drive(self, twist: Twist2D) -> None:
        """Command the robot, and say so on `cmd_vel` if anybody else listens."""
        self._robot.command(twist)
        if self._commands.get_subscription_count() == 1:
            return
        message = _command(twist, self._stamp)
        self._own_commands.append(_key_of(message))
        self._commands.publish(message)

    def _on_command(self, message: Any) -> None:
        if _key_of(message) in self._own_commands:
            return  # obeyed before it was on its way
        self._robot.command(Twist2D(message.twist.linear.x, message.twist.angular.z))

    def _empty_scan(self) -> LaserScan:
        angles = self._lidar.angles
        message = LaserScan(
            angle_min=float(angles[0]),
            angle_max=float(angles[-1]),
            angle_increment=self._lidar.increment,
            range_min=self._lidar.range_min,
            range_max=self._lidar.range_max,
        )
        message.header.frame_id = _BASE
        return message


def _command(twist: Twist2D, stamp: Time) -> TwistStamped:
    message = TwistStamped()
    message.header.frame_id, message.header.stamp = _BASE, stamp
    message.twist.linear.x, message.twist.angular.z = twist.v, twist.w
    return message


def _key_of(command: TwistStamped) -> _CommandKey:
    stamp = command.header.stamp
    return command.header.frame_id, stamp.sec, stamp.nanosec


# A transform from `map` that is older says nothing of now, in seconds of either clock.
_FRESH_SEC = 0.5


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
        self._commands.publish(_command(twist, to_stamp(self._now_ns)))

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
