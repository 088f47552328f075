"""The leaves of the example `drive_to_goal` on a node whose clock and odometry a test controls."""

import math
import time

import rclpy
from geometry_msgs.msg import TwistStamped
from nav_msgs.msg import Odometry
from py_trees.common import Status
from rclpy.clock import ClockType
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rosgraph_msgs.msg import Clock

from examples.drive_to_goal import leaves
from tests.waiting import SILENCE_SEC


class Stage:
    """A node with the leaves, and a node that acts as the robot."""

    def __init__(self):
        self._context = Context()
        rclpy.init(context=self._context, args=[])
        self._node = Node(
            "leaves", context=self._context, parameter_overrides=[Parameter("use_sim_time", value=True)]
        )
        self._robot = Node("robot", context=self._context)
        self._odometry = self._robot.create_publisher(Odometry, "odometry/filtered", 10)
        self._clock = self._robot.create_publisher(Clock, "/clock", 10)
        self._commands = []
        self._robot.create_subscription(TwistStamped, "cmd_vel", self._record_command, 10)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self._node)
        self._executor.add_node(self._robot)
        self._leaves = {}
        for leaf in (leaves.GoalNotReached("GoalNotReached"), leaves.DriveForward("DriveForward"),
                     leaves.SpinInPlace("SpinInPlace")):  # fmt: skip
            leaf.setup(node=self._node)
            self._leaves[leaf.name] = leaf
        assert self._node.get_clock().clock_type == ClockType.ROS_TIME
        drivers = ("DriveForward", "SpinInPlace")
        self._spin_until(
            lambda: self._robot.count_publishers("cmd_vel") == len(drivers), "the leaves' publishers"
        )
        self._spin_until(
            lambda: self._odometry.get_subscription_count() == len(self._leaves), "the leaves' subscriptions"
        )
        self.clock(100.0)

    def _record_command(self, message):
        self._commands.append((message.twist.linear.x, message.twist.angular.z))

    def clock(self, seconds):
        """Advance the clock, and wait until the node of the leaves has received it."""
        wanted = self._node.get_clock().now().nanoseconds + int(seconds * 1e9)
        message = Clock()
        message.clock.sec, message.clock.nanosec = divmod(wanted, 10**9)

        def is_received():
            self._clock.publish(message)
            return self._node.get_clock().now().nanoseconds == wanted

        self._spin_until(is_received, "the time")

    def odometry(self, x, y, yaw):
        """Publish the robot's pose, and wait until all leaves have received it."""
        message = Odometry()
        message.pose.pose.position.x, message.pose.pose.position.y = x, y
        message.pose.pose.orientation.z = math.sin(yaw / 2)
        message.pose.pose.orientation.w = math.cos(yaw / 2)

        def is_received():
            self._odometry.publish(message)
            return all(leaf.message == message for leaf in self._leaves.values())

        self._spin_until(is_received, "the odometry")

    def tick(self, name):
        """Tick a leaf and return the name of its status."""
        self._leaves[name].tick_once()
        return self._leaves[name].status.name

    def stop_leaf(self, name):
        """Stop a leaf, as a tree does when it switches to another branch."""
        self._leaves[name].stop(Status.INVALID)

    def next_command(self):
        """Return the next velocity command."""
        self._spin_until(lambda: self._commands, "a command")
        return self._commands.pop(0)

    def _spin_until(self, condition, what, timeout_sec=SILENCE_SEC):
        deadline = time.monotonic() + timeout_sec
        while not condition():
            assert time.monotonic() < deadline, f"{what} did not come"
            self._executor.spin_once(timeout_sec=0.02)

    def close(self):
        """Shut down the nodes."""
        self._executor.shutdown()
        self._node.destroy_node()
        self._robot.destroy_node()
        self._context.try_shutdown()
