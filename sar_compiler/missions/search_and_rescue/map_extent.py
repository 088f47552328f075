"""Where on the map a position can be: nobody is rescued from infinity, or from beyond the map."""

import math
from typing import TYPE_CHECKING, Any

from sar_compiler.ros.leaves.interfaces import qos_profile
from sar_compiler.ros.of_node import of_node
from sar_compiler.ros.poses import yaw_of

if TYPE_CHECKING:
    from nav_msgs.msg import MapMetaData
    from rclpy.node import Node

TOPIC = "map"
"""What Nav2's map server, or SLAM, publishes the map on, for late subscribers as well."""

FARTHEST = 100_000.0
"""No robot drives so far, metres: the limit of a coordinate while nobody publishes a map."""


class MapExtent:
    """The rectangle of the map that a node last received, if any.

    Use `map_extent_of`: one subscription does for all leaves.

    Args:
        node: The rclpy node that subscribes.
    """

    def __init__(self, node: "Node") -> None:
        from nav_msgs.msg import OccupancyGrid

        self._info: MapMetaData | None = None
        latched = qos_profile(type(self).__name__, "transient_local")
        node.create_subscription(OccupancyGrid, TOPIC, self._take, latched)

    def objection(self, x: float, y: float) -> str:
        """Return why nothing can be at a position, metres in the frame `map`; empty if something can."""
        if not (math.isfinite(x) and math.isfinite(y)):
            return f"({x}, {y}) is no position"
        if max(abs(x), abs(y)) > FARTHEST:
            return f"({x:g}, {y:g}) is farther away than any robot drives"
        if self._info is not None and not _contains(self._info, x, y):
            return f"({x:.2f}, {y:.2f}) is not on the map"
        return ""

    def _take(self, message: Any) -> None:
        info = message.info
        origin, turn = info.origin.position, info.origin.orientation
        numbers = (info.resolution, origin.x, origin.y, yaw_of(turn))
        if all(map(math.isfinite, numbers)) and info.resolution > 0.0:  # else it is no map
            self._info = info


def _contains(info: "MapMetaData", x: float, y: float) -> bool:
    origin, yaw = info.origin.position, yaw_of(info.origin.orientation)
    right, up = x - origin.x, y - origin.y
    along = right * math.cos(yaw) + up * math.sin(yaw)
    across = up * math.cos(yaw) - right * math.sin(yaw)
    return bool(0.0 <= along < info.width * info.resolution and 0.0 <= across < info.height * info.resolution)


def map_extent_of(node: "Node") -> MapExtent:
    """Return the extent of a node's map, the same object in every call."""
    return of_node(node, MapExtent, lambda: MapExtent(node))
