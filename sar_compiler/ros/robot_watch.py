"""What a robot says of itself during a mission, in the mission's journal: pose, plan, and the log."""

import math
from typing import Any

from geometry_msgs.msg import PoseWithCovarianceStamped
from nav_msgs.msg import Path
from rcl_interfaces.msg import Log
from rclpy.node import Node
from rclpy.qos import QoSProfile

from sar_compiler.journal.journal import Journal

# At most one pose and one plan in so many seconds of the node's clock.
_PERIOD_SEC = 1.0
# A plan has a point every few centimetres; a drawing needs fewer.
_POINTS = 200
# Before its node has read a burst of the log, so many lines are kept.
_LINES = 200


class RobotWatch:
    """Watches topics for a journal.

    - `pose`: `x`, `y` (m) and `yaw` (rad) in the frame `map`, from `amcl_pose`
    - `plan`: `points`, x and y in metres in the plan's `frame`, from `plan`
    - `log`: `node`, `level` (as in `rcl_interfaces/msg/Log`), `text`; of other nodes than the mission's own only warnings and
      errors

    Args:
        node: The mission's node.
        journal: Where it is written.
    """

    def __init__(self, node: Node, journal: Journal) -> None:
        self._journal = journal
        self._name = node.get_logger().name
        self._due = {"pose": -math.inf, "plan": -math.inf}
        for message, topic, take, depth in (
            (PoseWithCovarianceStamped, "amcl_pose", self._on_pose, 1),
            (Path, "plan", self._on_plan, 1),
            (Log, "/rosout", self._on_log, _LINES),
        ):
            node.create_subscription(message, topic, take, QoSProfile(depth=depth))

    def _on_pose(self, message: Any) -> None:
        if self._is_due("pose"):
            place, turn = message.pose.pose.position, message.pose.pose.orientation
            yaw = 2.0 * math.atan2(turn.z, turn.w)
            self._journal.watch("pose", x=place.x, y=place.y, yaw=yaw)

    def _on_plan(self, message: Any) -> None:
        if self._is_due("plan"):
            step = max(1, math.ceil(len(message.poses) / _POINTS))
            places = [stamped.pose.position for stamped in (*message.poses[:-1:step], *message.poses[-1:])]
            points = [(round(place.x, 3), round(place.y, 3)) for place in places]
            self._journal.watch("plan", frame=message.header.frame_id, points=points)

    def _on_log(self, message: Any) -> None:
        if message.name == self._name or message.level >= Log.WARN:
            self._journal.watch("log", node=message.name, level=message.level, text=message.msg)

    def _is_due(self, kind: str) -> bool:
        now = self._journal.clock.now()
        # A clock that was set back begins anew.
        if self._due[kind] - _PERIOD_SEC <= now < self._due[kind]:
            return False
        self._due[kind] = now + _PERIOD_SEC
        return True
