"""One robot's topics, those of a rosbot stack."""

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

from sar_compiler.sim.battery import Battery
from sar_compiler.sim.messages import to_pose, to_stamp, to_transform
from sar_compiler.sim.node_host import NodeHost
from sar_compiler.sim.robot import Robot, RobotState, Twist2D
from sar_compiler.sim.world import Lidar

# One scan in this many steps (5 Hz at 0.05 s).
_SCAN_EVERY = 4
# One state of the battery in this many steps (1 Hz).
_BATTERY_EVERY = 20
_ODOM, _BASE = "odom", "base_link"
# Largest number of its own commands that are on their way back to it.
_OWN_COMMANDS = 100
_CommandKey = tuple[str, int, int]


class RobotInterface:
    """Connects a robot to its topics: `cmd_vel` in; `odometry/filtered`, `scan`, `battery_state` and `/tf` out.

    Its own navigation drives it by `drive`, which takes effect in the same step and also publishes on `cmd_vel` for other
    subscribers.

    Args:
        host: Creates the node.
        robot: The robot, which is sent the latest command.
        battery: Its battery.
        seed: Seed of its scanner's noise.

    Attributes:
        limits: The limits of its drive.
    """

    def __init__(self, host: NodeHost, robot: Robot, battery: Battery, *, seed: int = 0) -> None:
        self._robot, self.limits, self._battery = robot, robot.limits, battery
        self._seed = seed
        self._lidar = Lidar()
        self._node = host.create("rosbot")
        self._odometry = self._node.create_publisher(Odometry, "odometry/filtered", 10)
        self._scan = self._node.create_publisher(LaserScan, "scan", qos_profile_sensor_data)
        self._battery_state = self._node.create_publisher(BatteryState, "battery_state", 10)
        # Absolute, as in tf2; a namespace remaps it, as Nav2 does.
        self._tf = self._node.create_publisher(TFMessage, "/tf", 100)
        self._node.create_subscription(TwistStamped, "cmd_vel", self._on_command, 10)
        self._commands = self._node.create_publisher(TwistStamped, "cmd_vel", 10)
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

    def drive(self, twist: Twist2D) -> None:
        """Command the robot, and publish the command on `cmd_vel` if there are other subscribers."""
        self._robot.command(twist)
        if self._commands.get_subscription_count() == 1:
            return
        message = _command(twist, self._stamp)
        self._own_commands.append(_key_of(message))
        self._commands.publish(message)

    def _on_command(self, message: Any) -> None:
        if _key_of(message) in self._own_commands:
            return  # already executed before it was published
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
