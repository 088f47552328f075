"""Conversion between the simulator's dataclasses and ROS messages."""

import math
from array import array
from typing import Any

import numpy as np
from builtin_interfaces.msg import Duration, Time
from geometry_msgs.msg import Pose, PoseStamped, TransformStamped
from lifecycle_msgs.msg import State
from nav_msgs.msg import OccupancyGrid, Path

from sar_compiler.ros.poses import turn_by, yaw_of
from sar_compiler.sim.follower import Path2D
from sar_compiler.sim.geometry import Pose2D
from sar_compiler.sim.occupancy import FREE, OCCUPIED, UNKNOWN, OccupancyMap

NANOSECONDS = 1_000_000_000
# A quaternion is accepted as a rotation if its length deviates from 1 by at most this value.
_UNIT_TOLERANCE = 0.1
# A quaternion whose imaginary parts are at most this value rotates by about a degree at most.
_STRAIGHT = 0.01
# The thresholds of a published map, in percent, as in nav2_map_server.
_FREE_BELOW, _OCCUPIED_ABOVE = 20, 65


def to_stamp(now_ns: int) -> Time:
    """Convert a simulated time in nanoseconds to a message."""
    return Time(sec=now_ns // NANOSECONDS, nanosec=now_ns % NANOSECONDS)


def set_lifecycle_state(response: Any, *, active: bool) -> Any:
    """Fill in and return the response of an active or inactive node to `get_state`."""
    number = State.PRIMARY_STATE_ACTIVE if active else State.PRIMARY_STATE_INACTIVE
    response.current_state = State(id=number, label="active" if active else "inactive")
    return response


def to_duration(seconds: float) -> Duration:
    """Convert a duration in seconds to a message."""
    nanoseconds = round(seconds * NANOSECONDS)
    return Duration(sec=nanoseconds // NANOSECONDS, nanosec=nanoseconds % NANOSECONDS)


def to_pose(pose: Pose2D) -> Pose:
    """Convert a planar pose to a message."""
    message = Pose()
    turn_by(message.orientation, pose.yaw)
    message.position.x, message.position.y = pose.x, pose.y
    return message


def to_transform(parent: str, child: str, pose: Pose2D, stamp: Time) -> TransformStamped:
    """Create the transform message that gives the pose of the frame *child* in the frame *parent*."""
    message = TransformStamped(child_frame_id=child)
    message.header.frame_id, message.header.stamp = parent, stamp
    message.transform.translation.x, message.transform.translation.y = pose.x, pose.y
    turn_by(message.transform.rotation, pose.yaw)
    return message


def from_pose(message: Any) -> Pose2D | None:
    """Convert a pose message to a planar pose; None if the pose is not finite or its quaternion is not a rotation."""
    turn = message.orientation
    if not abs(math.hypot(turn.x, turn.y, turn.z, turn.w) - 1.0) < _UNIT_TOLERANCE:
        return None
    pose = Pose2D(message.position.x, message.position.y, yaw_of(turn))
    return pose if pose.is_finite else None


def to_grid(occupancy: OccupancyMap) -> OccupancyGrid:
    """Convert an occupancy map to a message."""
    message = OccupancyGrid()
    message.header.frame_id = "map"
    message.info.resolution = occupancy.resolution
    message.info.height, message.info.width = occupancy.cells.shape
    place = message.info.origin.position
    place.x, place.y = occupancy.origin_x, occupancy.origin_y
    message.data = array("b", occupancy.cells.tobytes())
    return message


def to_path(path: Path2D, stamp: Time) -> Path:
    """Convert a path to a message. All poses in the message have yaw 0."""
    message = Path()
    message.header.frame_id, message.header.stamp = "map", stamp
    for x, y in path.points.tolist():
        message.poses.append(PoseStamped(header=message.header, pose=to_pose(Pose2D(x, y))))
    return message


def from_grid(message: OccupancyGrid) -> OccupancyMap | None:
    """Convert a map message to an occupancy map; None if the map is empty, rotated or inconsistent.

    Cells between the thresholds for free and occupied become unknown.
    """
    info, turn = message.info, message.info.origin.orientation
    cells = np.array(message.data, dtype=np.int8)
    straight = max(abs(turn.x), abs(turn.y), abs(turn.z)) < _STRAIGHT
    place = (info.origin.position.x, info.origin.position.y)
    if not (cells.size and cells.size == info.width * info.height and straight):
        return None
    if not (info.resolution > 0.0 and all(map(math.isfinite, (info.resolution, *place)))):
        return None
    known = np.full(cells.shape, UNKNOWN, dtype=np.int8)
    known[(cells >= 0) & (cells < _FREE_BELOW)] = FREE
    known[cells > _OCCUPIED_ABOVE] = OCCUPIED
    return OccupancyMap(known.reshape(info.height, info.width), float(info.resolution), *place)
