"""What a robot says of itself during a mission, in the mission's journal: pose, plan, map, and the log."""

import base64
import math
from typing import Any

from geometry_msgs.msg import PoseWithCovarianceStamped
from nav_msgs.msg import OccupancyGrid, Path
from rcl_interfaces.msg import Log
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile

from sar_compiler.journal.journal import Journal
from sar_compiler.ros.grid_image import grid_image

# At most one in so many seconds of the node's clock; while a map is being made there is one after the other.
_PERIODS_SEC = {"pose": 1.0, "plan": 1.0, "map": 10.0}
# A plan has a point every few centimetres; a drawing needs fewer.
_POINTS = 200
# The grey of a cell of which nothing is known.
_UNKNOWN = 205
# Before its node has read a burst of the log, so many lines are kept.
_LINES = 200


class RobotWatch:
    """Watches topics for a journal.

    - `pose`: `x`, `y` (m) and `yaw` (rad) in the frame `map`, from `amcl_pose`
    - `plan`: `points`, x and y in metres in the plan's `frame`, from `plan`
    - `map`: `png`, an image in base64 of `width` and `height` pixels of `resolution` metres, whose lower left corner is at `x`, `y`
      (m), turned by `yaw` (rad), from `map`; where it is another one than before
    - `log`: `node`, `level` (as in `rcl_interfaces/msg/Log`), `text`; of other nodes than the mission's own only warnings and
      errors

    Args:
        node: The mission's node.
        journal: Where it is written.
    """

    def __init__(self, node: Node, journal: Journal) -> None:
        self._journal = journal
        self._name = node.get_logger().name
        self._due = dict.fromkeys(_PERIODS_SEC, -math.inf)
        self._map: dict[str, Any] = {}
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        for message, topic, take, qos in (
            (PoseWithCovarianceStamped, "amcl_pose", self._on_pose, QoSProfile(depth=1)),
            (Path, "plan", self._on_plan, QoSProfile(depth=1)),
            (OccupancyGrid, "map", self._on_map, latched),
            (Log, "/rosout", self._on_log, QoSProfile(depth=_LINES)),
        ):
            node.create_subscription(message, topic, take, qos)

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

    def _on_map(self, message: Any) -> None:
        origin = message.info.origin
        numbers = (message.info.resolution, origin.position.x, origin.position.y, origin.orientation.z)
        if not (all(map(math.isfinite, numbers)) and self._is_due("map")):
            return
        if (drawn := grid_image(message)) is None:
            return
        width, height, step, png = drawn
        said = {
            "resolution": message.info.resolution * step,
            "width": width,
            "height": height,
            "x": origin.position.x,
            "y": origin.position.y,
            "yaw": 2.0 * math.atan2(origin.orientation.z, origin.orientation.w),
            "png": base64.b64encode(png).decode(),
        }
        if said != self._map:
            self._map = said
            self._journal.watch("map", **said)

    def _on_log(self, message: Any) -> None:
        if message.name == self._name or message.level >= Log.WARN:
            self._journal.watch("log", node=message.name, level=message.level, text=message.msg)

    def _is_due(self, kind: str) -> bool:
        now = self._journal.clock.now()
        # A clock that was set back begins anew.
        if self._due[kind] - _PERIODS_SEC[kind] <= now < self._due[kind]:
            return False
        self._due[kind] = now + _PERIODS_SEC[kind]
        return True
