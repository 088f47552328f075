"""What a robot says of itself during a mission, in the mission's journal: pose, plan, map, and the log."""

import base64
import math
import struct
import zlib
from typing import Any

from geometry_msgs.msg import PoseWithCovarianceStamped
from nav_msgs.msg import OccupancyGrid, Path
from rcl_interfaces.msg import Log
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile

from sar_compiler.journal.journal import Journal

# At most one of each in so many seconds of the node's clock; a map that is being made changes all the time.
_PERIODS_SEC = {"pose": 1.0, "plan": 1.0, "map": 60.0}
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
    - `map`: `x`, `y` of its lower left corner and the edge `resolution` of a cell, metres, `width` and `height` in cells, and
      `png`, the image in base64: free is white, occupied black, unknown grey; from `map`. One that is turned is left out
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
        info, origin = message.info, message.info.origin
        size = {"width": info.width, "height": info.height}
        if (
            origin.orientation.z == 0.0
            and 0 < info.width * info.height == len(message.data)
            and self._is_due("map")
        ):
            place = {"x": origin.position.x, "y": origin.position.y, "resolution": info.resolution}
            self._journal.watch("map", **place, **size, png=_png(message.data, **size))

    def _on_log(self, message: Any) -> None:
        if message.name == self._name or message.level >= Log.WARN:
            self._journal.watch("log", node=message.name, level=message.level, text=message.msg)

    def _is_due(self, kind: str) -> bool:
        now = self._journal.clock.now()
        # A clock that was set back begins anew.
        period = _PERIODS_SEC[kind]
        if self._due[kind] - period <= now < self._due[kind]:
            return False
        self._due[kind] = now + period
        return True


def _png(cells: Any, width: int, height: int) -> str:
    """Return an occupancy grid, whose first row is the lowest, as a grey image in base64."""
    grey = bytes(255 - cell * 255 // 100 if cell <= 100 else _UNKNOWN for cell in range(256))  # noqa: PLR2004 - per cent
    pixels = cells.tobytes().translate(grey)
    rows = (b"\0" + pixels[row * width : (row + 1) * width] for row in reversed(range(height)))
    header = struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0)
    parts = ((b"IHDR", header), (b"IDAT", zlib.compress(b"".join(rows), 9)), (b"IEND", b""))
    chunks = (
        struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
        for kind, data in parts
    )
    return base64.b64encode(b"\x89PNG\r\n\x1a\n" + b"".join(chunks)).decode()
