"""A node beside the mission that sees what anybody can see: odometry, the states of goals, frames."""

import bisect
import math
import threading

import rclpy
from action_msgs.msg import GoalStatusArray
from nav_msgs.msg import Odometry
from rclpy.context import Context
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from tf2_msgs.msg import TFMessage

LATCHED = QoSProfile(
    depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL, reliability=ReliabilityPolicy.RELIABLE
)


class Witness:
    """Watches one robot from a thread of its own.

    Args:
        namespace: The robot's namespace.
    """

    def __init__(self, namespace):
        self._context = Context()
        rclpy.init(context=self._context, args=[])
        self.node = Node("witness", context=self._context, namespace=namespace)
        self._news = threading.Condition()
        self._times = []
        self._places = []
        self._statuses = {}
        self._yaw = 0.0
        self.node.create_subscription(Odometry, "odometry/filtered", self._on_odometry, 100)
        self.node.create_subscription(
            GoalStatusArray, "navigate_to_pose/_action/status", self._on_statuses, LATCHED
        )
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self.node)
        self._thread = threading.Thread(target=self._spin, daemon=True)
        self._thread.start()

    def _spin(self):
        try:
            self._executor.spin()
        except ExternalShutdownException:
            return

    def _on_odometry(self, message, info):
        position, orientation = message.pose.pose.position, message.pose.pose.orientation
        with self._news:
            # When it was sent; on a busy machine it may be taken much later.
            self._times.append(info["source_timestamp"] / 1e9)
            self._places.append((position.x, position.y))
            self._yaw = 2.0 * math.atan2(orientation.z, orientation.w)
            self._news.notify_all()

    def _on_statuses(self, message):
        with self._news:
            for status in message.status_list:
                self._statuses[bytes(status.goal_info.goal_id.uuid)] = status.status
            self._news.notify_all()

    def goals(self):
        """The last known state of every goal there was, in the order in which they came."""
        with self._news:
            return list(self._statuses.values())

    def wait_for_goals(self, wanted, timeout_sec=20.0):
        """Wait until a function of the goals' states is true; fail with the states if it never is."""
        with self._news:
            came = self._news.wait_for(lambda: wanted(list(self._statuses.values())), timeout_sec)
            assert came, f"the goals' states are {list(self._statuses.values())}"

    def wait_until_moving(self, timeout_sec=20.0):
        """Wait until the robot has left the place where it was first seen."""
        with self._news:
            came = self._news.wait_for(
                lambda: self._places and math.dist(self._places[0], self._places[-1]) > 0.3, timeout_sec
            )
            assert came, "the robot did not move"

    def wait_until_seen(self, timeout_sec=30.0):
        """Wait for the first odometry."""
        with self._news:
            assert self._news.wait_for(lambda: self._places, timeout_sec), "no odometry came"

    def wait_for_yaw(self, wanted, timeout_sec=20.0):
        """Wait until a function of the robot's heading is true."""
        with self._news:
            came = self._news.wait_for(lambda: wanted(self._yaw), timeout_sec)
            assert came, f"the robot's heading is {self._yaw}"

    def place(self):
        """Where the robot was seen last, metres."""
        with self._news:
            return self._places[-1]

    def place_at(self, wall_time):
        """Where the robot was at a wall time, metres."""
        with self._news:
            return self._places[max(0, bisect.bisect_right(self._times, wall_time) - 1)]

    def frames(self, names, topic="/tf_static", timeout_sec=10.0):
        """Join late and return the static frames of these names: parent, x, y."""
        found = {}

        def take(message):
            with self._news:
                for transform in message.transforms:
                    place = transform.transform.translation
                    found[transform.child_frame_id] = (transform.header.frame_id, place.x, place.y)
                self._news.notify_all()

        self.node.create_subscription(TFMessage, topic, take, LATCHED)
        with self._news:
            came = self._news.wait_for(lambda: set(names) <= set(found), timeout_sec)
            assert came, f"of the frames {names} only {sorted(found)} came"
        return {name: found[name] for name in names}

    def close(self):
        """Stop watching."""
        self._context.try_shutdown()
        self._thread.join(5.0)
        self._executor.shutdown()
        self.node.destroy_node()
