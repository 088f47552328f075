"""Nodes that observe a mission from outside: odometry, goal states and frames."""

import bisect
import math
import threading

import rclpy
from action_msgs.msg import GoalStatusArray
from nav_msgs.msg import Odometry
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from tf2_msgs.msg import TFMessage

from tests.waiting import News

LATCHED = QoSProfile(
    depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL, reliability=ReliabilityPolicy.RELIABLE
)


class Watcher:
    """A node that spins in its own thread until it is closed.

    Args:
        name: Its name.
        namespace: Its namespace.
    """

    def __init__(self, name, namespace="/"):
        self._context = Context()
        rclpy.init(context=self._context, args=[])
        self.node = Node(name, context=self._context, namespace=namespace)
        self._news = News()
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self.node)
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._spin, daemon=True)

    def watch(self):
        """Start the thread, after all subscriptions have been created."""
        self._thread.start()

    def wait_until(self, wanted, what):
        """Wait until a condition is true; `what` names the awaited event in the error message."""
        with self._news:
            self._news.wait_until(wanted, lambda: f"{what} did not come")

    def _spin(self):
        while not self._closing.is_set():
            self._executor.spin_once(timeout_sec=0.1)

    def close(self):
        """Stop the thread; the context is shut down last, because the thread waits with it."""
        self._closing.set()
        self._executor.wake()
        self._thread.join()
        self._executor.shutdown()
        self.node.destroy_node()
        self._context.try_shutdown()


class Witness(Watcher):
    """A node that observes one robot.

    Args:
        namespace: The robot's namespace.
    """

    def __init__(self, namespace):
        super().__init__("witness", namespace)
        self._times = []
        self._places = []
        self._statuses = {}
        self._yaw = 0.0
        self.node.create_subscription(Odometry, "odometry/filtered", self._on_odometry, 100)
        self.node.create_subscription(
            GoalStatusArray, "navigate_to_pose/_action/status", self._on_statuses, LATCHED
        )
        self.watch()

    def _on_odometry(self, message, info):
        position, orientation = message.pose.pose.position, message.pose.pose.orientation
        with self._news:
            # The time at which it was sent; a busy machine may process it much later.
            self._times.append(info["source_timestamp"] / 1e9)
            self._places.append((position.x, position.y))
            yaw = 2.0 * math.atan2(orientation.z, orientation.w)
            if len(self._places) == 1 or (yaw, self._places[-1]) != (self._yaw, self._places[-2]):
                self._news.tell()
            self._yaw = yaw

    def _on_statuses(self, message):
        with self._news:
            for status in message.status_list:
                self._statuses[bytes(status.goal_info.goal_id.uuid)] = status.status
            self._news.tell()

    def goals(self):
        """Return the last known states of all goals, in order of their arrival."""
        with self._news:
            return list(self._statuses.values())

    def wait_for_goals(self, wanted):
        """Wait until a function of the goals' states is true; fail with the states if it never is."""
        self._wait(
            lambda: wanted(list(self._statuses.values())),
            lambda: f"the goals' states are {list(self._statuses.values())}",
        )

    def wait_until_moving(self):
        """Wait until the robot has left its first known position."""
        self._wait(
            lambda: self._places and math.dist(self._places[0], self._places[-1]) > 0.3,
            lambda: "the robot did not move",
        )

    def wait_until_seen(self):
        """Wait for the first odometry."""
        self._wait(lambda: self._places, lambda: "no odometry came")

    def wait_for_yaw(self, wanted):
        """Wait until a function of the robot's heading is true."""
        self._wait(lambda: wanted(self._yaw), lambda: f"the robot's heading is {self._yaw}")

    def _wait(self, wanted, complaint):
        with self._news:
            self._news.wait_until(wanted, complaint)

    def place(self):
        """Return the last known position of the robot, metres."""
        with self._news:
            return self._places[-1]

    def place_at(self, wall_time):
        """Return the position of the robot at a wall time, metres."""
        with self._news:
            return self._places[max(0, bisect.bisect_right(self._times, wall_time) - 1)]

    def frames(self, names, topic="/tf_static"):
        """Subscribe now, and return parent, x and y of the static frames of these names."""
        found = {}

        def on_transforms(message):
            with self._news:
                for transform in message.transforms:
                    place = transform.transform.translation
                    found[transform.child_frame_id] = (transform.header.frame_id, place.x, place.y)
                self._news.tell()

        self.node.create_subscription(TFMessage, topic, on_transforms, LATCHED)
        self._wait(
            lambda: set(names) <= set(found), lambda: f"of the frames {names} only {sorted(found)} came"
        )
        return {name: found[name] for name in names}
