"""Read values from ROS messages, and check each value against the definition of the message before use.

Leaves and monitors read measured fields only through this module (`tests/test_house.py`). A value that violates its definition
raises `UnusableValueError`, whose message names the likely cause. `ValueReports` logs each kind of problem once for each source,
and the value is treated as unknown.
"""

import math
import struct
import sys
from collections.abc import Callable, Sequence
from enum import Enum
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

from sar_compiler.errors import SarError
from sar_compiler.nodes import ros_interfaces
from sar_compiler.nodes.ros_fields import FieldPath
from sar_compiler.ros.clock import AWAKE
from sar_compiler.ros.leaves.leaf import interface_name, of_node
from sar_compiler.ros.poses import yaw_of, yaw_of_quaternion
from sar_compiler.tree.display_text import shorten_to_line

if TYPE_CHECKING:
    from rclpy.node import Node

T = TypeVar("T")

MAP_FRAME = "map"
"""The frame in which a mission plans."""
FARTHEST_M = 100_000.0
"""The maximum absolute value of a valid coordinate, in metres. No robot drives farther than this."""

# Maximum deviation of a quaternion's length from 1, in poses and in transforms. In hand-written poses, sine and cosine may be rounded to one
# digit. tf2 accepts a deviation of 0.01.
_ROTATION_TOLERANCE, TRANSFORM_TOLERANCE = 0.1, 0.01
# Relative rounding error of a number in single precision.
_ROUNDING = 1e-6
# Indices of the variances of x, y and yaw in the covariance of a pose. Localisations in the plane do not set the other variances.
_PLANAR_VARIANCES = (0, 7, 35)
# Maximum difference between a time stamp and the node's clock, in seconds. AMCL stamps its transforms one second ahead, and the clocks of two
# machines differ slightly. Simulated time and messages arrive late: at 50 times real time, a delay of half a second is 25 simulated seconds.
_APART_SEC, _SIMULATED_APART_SEC = 2.0, 30.0
# If a time stamp differs from the node's clock by more than this time, in seconds, the publisher uses another clock.
_ANOTHER_CLOCK_SEC = 86_400.0
# A problem is reported again if it recurs after the first of these times, in seconds. A stale time stamp is only reported if it persists for the
# second time, because after a suspension this process first receives older messages.
_AGAIN_SEC, _STAYS_SEC = 60.0, 1.0


class ValueProblem(Enum):
    """The kind of a problem with a value. Each kind is reported once for each source."""

    VALUE = "value"
    FRAME = "frame"
    FUTURE = "future"
    STALE = "stale"


class UnusableValueError(SarError, ValueError):
    """Raised if a value violates its message's definition. The value is then treated as unknown.

    Args:
        text: A message with the value, the allowed values, and the likely cause.
        problem: The kind of the problem.
    """

    def __init__(self, text: str, problem: ValueProblem = ValueProblem.VALUE) -> None:
        self.problem = problem
        super().__init__(text)


class PlanarPose(NamedTuple):
    """A pose in the plane.

    Attributes:
        x: The position's x, in metres.
        y: The position's y, in metres.
        yaw: The heading, in radians.
    """

    x: float
    y: float
    yaw: float


class _Definition(NamedTuple):
    """The valid values of a numeric field, according to the comments in the message's definition.

    Attributes:
        least: The minimum.
        most: The maximum.
        unit: The unit, for error messages.
        cause: The likely cause of an invalid value, as a question.
        has_infinity: Whether infinity is valid, as for ranges without a return (REP 117).
    """

    least: float = -math.inf
    most: float = math.inf
    unit: str = ""
    cause: str = ""
    has_infinity: bool = False

    def check(self, name: str, number: float) -> float:
        """Check a number and return it; correct a number that exceeds the valid range only by a rounding error.

        Raises:
            UnusableValueError: If the number is not valid.
        """
        if math.isnan(number):
            raise UnusableValueError(f"{name} is not a number (NaN), so it was not measured")
        if math.isinf(number) and not self.has_infinity:
            raise UnusableValueError(f"{name} is {number:g}, but must be finite")
        if math.isinf(number):
            return number
        slack = _ROUNDING * max(abs(each) for each in (self.least, self.most, 0.0) if math.isfinite(each))
        if not self.least - slack <= number <= self.most + slack:
            unit, cause = self.unit, f" ({self.cause})" if self.cause else ""
            must = (
                f"{self.least:g}{unit} or more"
                if self.most == math.inf
                else f"from {self.least:g} to {self.most:g}{unit}"
            )
            raise UnusableValueError(f"{name} is {number:g}{unit}, but must be {must}{cause}")
        return min(max(number, self.least), self.most)


_FINITE = _Definition()
_POSITIVE = _Definition(0.0)
_SHARE = _Definition(0.0, 1.0, cause="is it in percent? It must be between 0 and 1")
_DEGREES = "is the value in radians or in 1e-7 degrees, or are latitude and longitude exchanged?"
_DEFINED: dict[str, dict[str, _Definition]] = {
    "sensor_msgs/msg/BatteryState": {
        "percentage": _SHARE,
        "voltage": _Definition(0.0, 1000.0, " V", "is it in millivolts?"),
        "temperature": _Definition(-100.0, 200.0, " °C", "is it in kelvin?"),
        "current": _FINITE,
        "charge": _POSITIVE,
        "capacity": _POSITIVE,
        "design_capacity": _POSITIVE,
    },
    "sensor_msgs/msg/Temperature": {"temperature": _Definition(-273.15, unit=" °C"), "variance": _POSITIVE},
    "sensor_msgs/msg/RelativeHumidity": {"relative_humidity": _SHARE, "variance": _POSITIVE},
    "sensor_msgs/msg/FluidPressure": {"fluid_pressure": _POSITIVE, "variance": _POSITIVE},
    "sensor_msgs/msg/Illuminance": {"illuminance": _POSITIVE, "variance": _POSITIVE},
    "sensor_msgs/msg/NavSatFix": {
        "latitude": _Definition(-90.0, 90.0, "°", _DEGREES),
        "longitude": _Definition(-180.0, 180.0, "°", _DEGREES),
        "altitude": _Definition(unit=" m"),
    },
    "geographic_msgs/msg/GeoPoint": {
        "latitude": _Definition(-90.0, 90.0, "°", _DEGREES),
        "longitude": _Definition(-180.0, 180.0, "°", _DEGREES),
        "altitude": _Definition(unit=" m"),
    },
    **{
        f"geometry_msgs/msg/{name}": dict.fromkeys(fields, _FINITE)
        for name, fields in {
            "Point": "xyz",
            "Point32": "xyz",
            "Vector3": "xyz",
            "Quaternion": "xyzw",
            "Pose2D": ("x", "y", "theta"),
        }.items()
    },
}


def check_field(message: Any, name: str, path: str = "") -> Any:
    """Return the value of a message's field.

    Args:
        message: The message.
        name: The name of the field.
        path: The field's name in error messages; *name* if empty.

    Raises:
        UnusableValueError: If the value violates the message's definition.
    """
    value, kind, path = getattr(message, name), interface_name(type(message)), path or name
    if name == "covariance" or name.endswith("_covariance"):
        _check_covariance(value, path)
    elif kind == "sensor_msgs/msg/LaserScan" and name == "ranges":
        # According to the message's definition, values out of range must be discarded. They are replaced by NaN, because the index of a value
        # determines its angle.
        low, high = message.range_min, message.range_max
        return [each if low <= each <= high or math.isinf(each) else math.nan for each in value]
    elif kind == "sensor_msgs/msg/Range" and name == "range":
        return _Definition(message.min_range, message.max_range, " m", has_infinity=True).check(path, value)
    elif (definition := _DEFINED.get(kind, {}).get(name)) is not None:
        if kind == "sensor_msgs/msg/NavSatFix" and message.status.status < 0:
            raise UnusableValueError(
                f"{path} is unknown, because the receiver has no fix (status {message.status.status})"
            )
        if kind == "geometry_msgs/msg/Quaternion":
            _check_rotation(message)
        return definition.check(path, float(value))
    return value


def _check_covariance(values: Sequence[float], path: str) -> None:
    side = math.isqrt(len(values))
    if side and values[0] == -1.0:
        raise UnusableValueError(
            f"{path} starts with -1, which means that the sensor does not measure this value"
        )
    for index in range(side):
        _check_variance(float(values[index * (side + 1)]), path)


def _check_variance(variance: float, path: str) -> None:
    # Rounding in filters can lead to slightly negative variances.
    _POSITIVE.check(f"a variance of {path}", 0.0 if -_ROUNDING <= variance < 0.0 else variance)


def read_field(message: Any, path: str) -> Any:
    """Return the value of a message's field as a plain Python value.

    The field is given by its path, such as `pose.position.x` or `poses[0].header`.

    Raises:
        UnusableValueError: If the value violates the message's definition.
        InterfaceError: If the path contains an index that is out of range.
        AttributeError: If the message has no such field.
    """
    return ros_interfaces.read_field(message, FieldPath(path), check_field)


def battery_share(message: Any) -> float:
    """Return the charge of a battery, between 0 and 1, from a `sensor_msgs/msg/BatteryState`.

    Raises:
        UnusableValueError: If the charge is not measured, or is not between 0 and 1.
    """
    return _SHARE.check("percentage", float(message.percentage))


def check_position(x: float, y: float) -> tuple[float, float]:
    """Check a position and return it, in metres.

    Raises:
        UnusableValueError: If a coordinate is not finite, or larger than `FARTHEST_M`.
    """
    if not (math.isfinite(x) and math.isfinite(y)):
        raise UnusableValueError(f"({x}, {y}) is not a position")
    if max(abs(x), abs(y)) > FARTHEST_M:
        raise UnusableValueError(
            f"({x:g}, {y:g}) is out of range: coordinates must be between -{FARTHEST_M:g} and {FARTHEST_M:g} m"
        )
    return float(x), float(y)


def planar_point(stamped: Any, frame: str) -> tuple[float, float]:
    """Return x and y of a `geometry_msgs/msg/PointStamped`, in metres.

    Raises:
        UnusableValueError: If the point is not in the given frame, or not a valid position.
    """
    check_frame("the point", stamped, frame)
    return check_position(stamped.point.x, stamped.point.y)


def planar_outline(stamped: Any, frame: str) -> list[tuple[float, float]]:
    """Return the corners of the polygon in a `geometry_msgs/msg/PolygonStamped`, in metres.

    Raises:
        UnusableValueError: If the polygon is not empty and is not in the given frame.
    """
    points = stamped.polygon.points
    if points:
        check_frame("the outline", stamped, frame)
    return [(float(each.x), float(each.y)) for each in points]


def planar_pose(pose: Any) -> PlanarPose:
    """Convert a `geometry_msgs/msg/Pose` to a pose in the plane.

    Raises:
        UnusableValueError: If the position or the quaternion is invalid.
    """
    return PlanarPose(*check_position(pose.position.x, pose.position.y), _yaw(pose.orientation))


def stamped_pose(stamped: Any, frame: str) -> PlanarPose:
    """Convert a `geometry_msgs/msg/PoseStamped` or `PoseWithCovarianceStamped` to a pose in the plane.

    Raises:
        UnusableValueError: If the pose is not in the given frame, or its position or quaternion is invalid.
    """
    check_frame("the pose", stamped, frame)
    return planar_pose(getattr(stamped.pose, "pose", stamped.pose))


def goal_position(pose: Any) -> tuple[float, float] | None:
    """Return x and y of a navigation goal's pose, in metres in the frame `map`; None if the pose is in another frame."""
    return (pose.pose.position.x, pose.pose.position.y) if pose.header.frame_id == MAP_FRAME else None


def localised_pose(message: Any, node: "Node") -> PlanarPose:
    """Return the pose, in the frame `map`, from a localisation's `PoseWithCovarianceStamped` message.

    The pose may be old, because a localisation only publishes a pose after the robot has moved.

    Raises:
        UnusableValueError: If the pose is in another frame or from the future, or its numbers are invalid.
    """
    if message.header.frame_id:  # `amcl_pose` is defined in `map`
        check_frame(
            "the pose",
            message,
            MAP_FRAME,
            "does the localisation belong to another robot? If not, set its parameter global_frame_id",
        )
    stamp_age(message.header.stamp, node)
    for index in _PLANAR_VARIANCES:
        _check_variance(float(message.pose.covariance[index]), "the covariance")
    return planar_pose(message.pose.pose)


def path_points(path: Any) -> list[tuple[float, float]]:
    """Return the positions of the poses in a `nav_msgs/msg/Path`, in metres.

    Raises:
        UnusableValueError: If a position is invalid.
    """
    return [check_position(each.pose.position.x, each.pose.position.y) for each in path.poses]


def frame_of(message: Any) -> str:
    """Return the frame of a message with a header, without the leading slash of old tf names."""
    return frame_name(message.header.frame_id)


class GridGeometry(NamedTuple):
    """The position and size of a `nav_msgs/msg/OccupancyGrid`.

    Attributes:
        cell_m: The side length of a cell, in metres.
        width: The number of cells along x.
        height: The number of cells along y.
        x: The x of the lower left corner, in metres.
        y: The y of the lower left corner, in metres.
        yaw: The rotation of the grid about the lower left corner, in radians.
    """

    cell_m: float
    width: int
    height: int
    x: float
    y: float
    yaw: float

    def contains(self, x: float, y: float) -> bool:
        """Return whether a position (metres) is on the grid."""
        right, up = x - self.x, y - self.y
        along = right * math.cos(self.yaw) + up * math.sin(self.yaw)
        across = up * math.cos(self.yaw) - right * math.sin(self.yaw)
        return 0.0 <= along < self.width * self.cell_m and 0.0 <= across < self.height * self.cell_m


def grid_geometry(message: Any) -> GridGeometry:
    """Return the position and size of a `nav_msgs/msg/OccupancyGrid`.

    Raises:
        UnusableValueError: If the resolution or the origin of the grid is invalid.
    """
    info = message.info
    if not (math.isfinite(info.resolution) and info.resolution > 0.0):
        raise UnusableValueError(f"the resolution is {info.resolution:g}, but must be above 0 m")
    return GridGeometry(info.resolution, info.width, info.height, *planar_pose(info.origin))


class RigidTransform(NamedTuple):
    """The content of a `geometry_msgs/msg/TransformStamped`.

    Attributes:
        parent: The outer frame, from the header.
        child: The inner frame, whose pose the transform defines.
        offset: The translation x, y and z, in metres.
        turn: The rotation, a unit quaternion x, y, z, w.
        stamp_sec: The time stamp, in seconds.
    """

    parent: str
    child: str
    offset: tuple[float, float, float]
    turn: tuple[float, float, float, float]
    stamp_sec: float

    @property
    def planar(self) -> PlanarPose:
        """The pose of the child frame in the plane of the parent frame."""
        return PlanarPose(*self.offset[:2], yaw_of_quaternion(*self.turn))


def read_transform(message: Any) -> RigidTransform:
    """Return the content of a `geometry_msgs/msg/TransformStamped`.

    Raises:
        UnusableValueError: If the translation or the rotation is invalid.
    """
    place, turn = message.transform.translation, message.transform.rotation
    child, parent = frame_name(message.child_frame_id), frame_name(message.header.frame_id)
    if not math.isfinite(place.x + place.y + place.z):
        raise UnusableValueError(
            f"the translation of '{shorten_to_line(child)}' is ({place.x}, {place.y}, {place.z})"
        )
    length = _check_rotation(turn, TRANSFORM_TOLERANCE)
    rotation = turn.x / length, turn.y / length, turn.z / length, turn.w / length
    stamp = stamp_sec(message.header.stamp)
    return RigidTransform(parent, child, (place.x, place.y, place.z), rotation, stamp)


class OdometryReading(NamedTuple):
    """The unchecked content of a `nav_msgs/msg/Odometry`.

    Attributes:
        frame: The frame of the pose.
        child: The frame of the speeds.
        pose: The unchecked pose of the robot; see `usable_pose`.
        turn: The quaternion of the pose.
        speeds: The speeds along x, y and z (m/s), and about x, y and z (rad/s).
        stamp_sec: The time stamp, in seconds.
    """

    frame: str
    child: str
    pose: PlanarPose
    turn: Sequence[float]
    speeds: Sequence[float]
    stamp_sec: float

    @property
    def usable_pose(self) -> PlanarPose:
        """The checked pose of the robot.

        Raises:
            UnusableValueError: If the position or the quaternion is invalid.
        """
        check_position(*self.pose[:2])
        _check_length(*self.turn)
        return self.pose

    @property
    def usable_speed(self) -> tuple[float, float]:
        """The driving speed (m/s) and the turning speed (rad/s) of the robot.

        Raises:
            UnusableValueError: If a speed is not finite.
        """
        x, y, z, _, _, turning = self.speeds
        speed = math.hypot(x, y, z), abs(turning)
        if not all(map(math.isfinite, speed)):
            raise UnusableValueError(f"the speed is {speed[0]} m/s and {speed[1]} rad/s")
        return speed


# Offsets in a serialised message: the start of its content, and the end of the time stamp at this start.
_HEAD, _STAMP_END = 4, 12
_NATIVE = b"\0\x01" if sys.byteorder == "little" else b"\0\0"
_STAMP = struct.Struct("=iI")
_POSE_AND_TWIST = struct.Struct("=7d288x6d")
"""The layout of the pose and the twist. Each of the two is followed by a covariance of 36 numbers (288 bytes)."""


def read_odometry(message: bytes) -> OdometryReading:
    """Read the needed fields of a serialised `nav_msgs/msg/Odometry`.

    This is faster than deserialising the whole message.
    """
    if message[:2] != _NATIVE:  # sent by a machine with a different byte order
        from nav_msgs.msg import Odometry
        from rclpy.serialization import deserialize_message, serialize_message

        message = serialize_message(deserialize_message(message, Odometry))
    seconds, nanoseconds = _STAMP.unpack_from(message, _HEAD)
    at, frames = _STAMP_END, ["", ""]
    for number in range(2):
        length = int.from_bytes(message[at : at + 4], sys.byteorder)
        frames[number] = message[at + 4 : at + 3 + length].decode(errors="replace")
        at += (4 + length + 3) // 4 * 4
    # Numbers of eight bytes are aligned to multiples of eight bytes after the header.
    numbers = _POSE_AND_TWIST.unpack_from(message, at + (_HEAD - at) % 8)
    x, y, _, *turn = numbers[:7]
    pose = PlanarPose(x, y, yaw_of_quaternion(*turn))
    return OdometryReading(frames[0], frames[1], pose, turn, numbers[7:], seconds + nanoseconds * 1e-9)


def remaining_drive(feedback: Any) -> tuple[float, float] | None:
    """Return the remaining distance (m) and time (s) of a drive according to Nav2's feedback.

    Return None if the distance is unknown.
    """
    metres, time = feedback.distance_remaining, feedback.estimated_time_remaining
    return (metres, time.sec + time.nanosec * 1e-9) if math.isfinite(metres) and metres >= 0.0 else None


def remaining_poses(feedback: Any) -> int:
    """Return the number of remaining poses of a `NavigateThroughPoses` goal from Nav2's feedback."""
    return int(feedback.number_of_poses_remaining)


def frame_name(frame: str) -> str:
    """Return the name of a frame without the leading slash of old tf names."""
    return frame.removeprefix("/")


def check_frame(subject: str, message: Any, wanted: str, cause: str = "") -> None:
    """Check the frame of a message with a header.

    Args:
        subject: The noun for the message's content. The error message begins with this noun.
        message: The message.
        wanted: The required frame.
        cause: A possible reason for another frame, in words; empty for none.

    Raises:
        UnusableValueError: If the message is in another frame.
    """
    frame = message.header.frame_id
    if frame != wanted:
        because = f" ({cause})" if cause else ""
        text = f"{subject} is in the frame '{shorten_to_line(frame)}', but must be in '{wanted}'{because}"
        raise UnusableValueError(text, ValueProblem.FRAME)


def check_stamp(message: Any, node: "Node", max_age_sec: float | None = None) -> None:
    """Check the time stamp of a message, if the message has a header.

    Args:
        message: A message with or without a header.
        node: The node whose clock determines the age.
        max_age_sec: The maximum age, in seconds of the node's clock; None for no limit.

    Raises:
        UnusableValueError: If the time stamp is in the future, or older than *max_age_sec*.
    """
    stamp = getattr(getattr(message, "header", None), "stamp", None)
    if stamp is not None:
        stamp_age(stamp, node, math.inf if max_age_sec is None else max_age_sec)


def stamp_sec(stamp: Any) -> float:
    """Convert a `builtin_interfaces/msg/Time` to seconds."""
    return float(stamp.sec + stamp.nanosec * 1e-9)


def logged_sec(message: Any) -> float:
    """Return the time at which a message of `/rosout` was logged, in seconds."""
    return stamp_sec(message.stamp)


def node_sec(node: "Node") -> float:
    """Return the current time of a node's clock, in seconds."""
    return float(node.get_clock().now().nanoseconds * 1e-9)


def stamp_age(
    stamp: Any,
    node: "Node",
    max_age_sec: float = math.inf,
    *,
    at_sec: float | None = None,
    is_strict: bool = False,
    subject: str = "its stamp is",
) -> float:
    """Return the age of a time stamp in seconds; the age is 0 if the stamp is missing or in the near future.

    Args:
        stamp: The time stamp of a header, or its value in seconds.
        node: The node whose clock determines the age.
        max_age_sec: The maximum age, in seconds.
        is_strict: Whether *max_age_sec* applies exactly. Otherwise the clocks of the publisher and the node may differ slightly.
        at_sec: The time at which the message has arrived, in seconds of the node's clock; the current time if None.
        subject: The first words of an error message: a subject and a verb.

    Raises:
        UnusableValueError: If the time stamp is in the future, or older than *max_age_sec*.
    """
    then = stamp if isinstance(stamp, float) else stamp_sec(stamp)
    now = node_sec(node) if at_sec is None else at_sec
    is_simulated = node.get_clock().ros_time_is_active
    if then == 0.0 or (is_simulated and now == 0.0):  # there is no time stamp, or no simulated time yet
        return 0.0
    apart = _SIMULATED_APART_SEC if is_simulated else _APART_SEC
    if then - now > apart:
        text = f"{subject} {_seconds_apart(then - now)} in the future{clock_hint(then - now, node)}"
        raise UnusableValueError(text, ValueProblem.FUTURE)
    if now - then > max_age_sec + (0.0 if is_strict else apart):
        age = f"{_seconds_apart(now - then)} old, but may be at most {max_age_sec:g} s"
        text = f"{subject} {age}{clock_hint(now - then, node)}"
        raise UnusableValueError(text, ValueProblem.STALE)
    return max(0.0, now - then)


def clock_hint(apart_sec: float, node: "Node") -> str:
    """Return a sentence ending with the likely cause of a large difference between two clocks, or ''."""
    if apart_sec <= _ANOTHER_CLOCK_SEC:
        return ""
    if node.get_clock().ros_time_is_active:
        return ", because this node uses simulated time, but the publisher does not. Start the publisher with `-p use_sim_time:=true`"
    return (
        ", because this node uses the machine's clock, but the publisher does not. If you use a simulator or play a bag, add `--ros-args "
        "-p use_sim_time:=true`"
    )


def _seconds_apart(seconds: float) -> str:
    return f"{seconds:.1f} s" if seconds <= _ANOTHER_CLOCK_SEC else f"{seconds / _ANOTHER_CLOCK_SEC:.0f} days"


def _yaw(orientation: Any) -> float:
    _check_rotation(orientation)
    return yaw_of(orientation)


def _check_rotation(turn: Any, tolerance: float = _ROTATION_TOLERANCE) -> float:
    return _check_length(turn.x, turn.y, turn.z, turn.w, tolerance=tolerance)


def _check_length(*turn: float, tolerance: float = _ROTATION_TOLERANCE) -> float:
    """Check that a quaternion has the length 1, and return its length.

    Raises:
        UnusableValueError: If the length is not 1, so the quaternion is not a rotation.
    """
    length = math.hypot(*turn)
    if not abs(length - 1.0) <= tolerance:
        raise UnusableValueError(
            f"the length of the quaternion is {length:.3g}, but must be 1 (for no rotation, write w: 1.0)"
        )
    return length


class ValueReports:
    """Logs each kind of problem once for each source of values; created by `value_reports`.

    Args:
        node: The rclpy node that logs the problems.
    """

    def __init__(self, node: "Node") -> None:
        self._node = node
        self._seen: dict[tuple[str, ValueProblem], tuple[float, float]] = {}
        self._reported: set[tuple[str, ValueProblem]] = set()

    def read(self, source: str, read: Callable[[], T]) -> T | None:
        """Return the value that *read* returns. If this value is unusable, report the problem and return None.

        Args:
            source: The source of the value. A report begins with this text.
            read: Returns the value, or raises `UnusableValueError`.
        """
        try:
            return read()
        except UnusableValueError as error:
            self.report_problem(source, error)
            return None

    def report_problem(self, source: str, error: UnusableValueError) -> None:
        """Log a problem, unless it was already logged. A problem that recurs after more than a minute is logged again."""
        now, key = AWAKE.now(), (source, error.problem)
        first, last = self._seen.get(key, (now, -math.inf))
        if now - last > _AGAIN_SEC:
            first = now
            self._reported.discard(key)
        self._seen[key] = first, now
        is_sure = error.problem is not ValueProblem.STALE or now - first >= _STAYS_SEC
        if is_sure and key not in self._reported:
            self._reported.add(key)
            self._node.get_logger().warning(
                shorten_to_line(f"{source}: {error}. The value is treated as unknown.")
            )


def value_reports(node: "Node") -> ValueReports:
    """Return the `ValueReports` of a node; every call for a node returns the same object."""
    return of_node(node, ValueReports, lambda: ValueReports(node))
