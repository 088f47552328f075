"""The topics of a simulated robot, which are those of a ROSbot."""

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

# The number of steps between two scans (5 Hz with steps of 0.05 s).
_SCAN_EVERY = 4
# The number of steps between two messages about the battery (1 Hz).
_BATTERY_EVERY = 20
_ODOM, _BASE = "odom", "base_link"
# The maximum number of published commands that the node recognises as its own when it receives them.
_OWN_COMMANDS = 100
_CommandKey = tuple[str, int, int]


class RobotInterface:
    """Connects a robot to the topic `cmd_vel`, and publishes `odometry/filtered`, `scan`, `battery_state` and `/tf`.

    The simulated navigation commands the robot with `drive`, which takes effect in the same step and also publishes the command on
    `cmd_vel` for other subscribers.

    Args:
        host: Creates the node.
        robot: The robot, which follows the latest command.
        battery: The robot's battery.
        seed: The seed of the scanner's noise.

    Attributes:
        limits: The limits of the robot's drive.
    """

    def __init__(self, host: NodeHost, robot: Robot, battery: Battery, *, seed: int = 0) -> None:
        self._robot, self.limits, self._battery = robot, robot.limits, battery
        self._seed = seed
        self._lidar = Lidar()
        self._node = host.create("rosbot")
        self._odometry = self._node.create_publisher(Odometry, "odometry/filtered", 10)
        self._scan = self._node.create_publisher(LaserScan, "scan", qos_profile_sensor_data)
        self._battery_state = self._node.create_publisher(BatteryState, "battery_state", 10)
        # The name is absolute, as in tf2; for a robot with a namespace it is remapped, as in Nav2.
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
            step: The number of the step.
            now_ns: The simulated time at the end of the step, nanoseconds.
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
            battery_state = BatteryState(percentage=self._battery.share, present=True)
            battery_state.header.stamp = stamp
            self._battery_state.publish(battery_state)
        # The noise is seeded by the step, so that it does not depend on subscribers.
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
        message = _command_message(twist, self._stamp)
        self._own_commands.append(_key_of(message))
        self._commands.publish(message)

    def _on_command(self, message: Any) -> None:
        if _key_of(message) in self._own_commands:
            return  # `drive` has already executed the command
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


def _command_message(twist: Twist2D, stamp: Time) -> TwistStamped:
    message = TwistStamped()
    message.header.frame_id, message.header.stamp = _BASE, stamp
    message.twist.linear.x, message.twist.angular.z = twist.v, twist.w
    return message


def _key_of(command: TwistStamped) -> _CommandKey:
    stamp = command.header.stamp
    return command.header.frame_id, stamp.sec, stamp.nanosec
