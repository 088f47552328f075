"""Values of ROS messages, checked against the definition of their message before use.

Leaves and watches read measured fields through this module only (`tests/test_house.py`). A value outside its definition
raises `UnusableValueError`, whose text names the likely cause. `ValueReports` reports each cause once for each source,
and the value counts as unknown.
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
"""No robot drives so far: the limit of a coordinate, metres."""

# tf2 accepts quaternions whose length is off by 0.01. In hand-written poses sin and cos are rounded to one digit.
_ROTATION_TOLERANCE, TRANSFORM_TOLERANCE = 0.1, 0.01
# Relative rounding error of a number in single precision.
_ROUNDING = 1e-6
# Indices of x, y and yaw in the covariance of a pose. Localisations in the plane do not fill in the others.
_PLANAR_VARIANCES = (0, 7, 35)
# AMCL stamps its transforms a second ahead, and clocks of two machines differ a little. A simulated clock and messages come late: at 50
# times the machine's speed, half a second of the machine is 25 s.
_APART_SEC, _SIMULATED_APART_SEC = 2.0, 30.0
# Clocks that differ by more are different clocks.
_ANOTHER_CLOCK_SEC = 86_400.0
# A problem is reported again if it did not occur for this long, seconds. A stale stamp is reported only if it
# persists for this long, because after a standstill this process reads older messages first.
_AGAIN_SEC, _STAYS_SEC = 60.0, 1.0


class ValueProblem(Enum):
    """The kind of problem with a value; each kind is reported once for each source."""

    VALUE = "value"
    FRAME = "frame"
    FUTURE = "future"
    STALE = "stale"


class UnusableValueError(SarError, ValueError):
    """A value is outside its message's definition, and is treated as unknown.

    Args:
        text: The value, its allowed values, and the likely cause.
        problem: The kind.
    """

    def __init__(self, text: str, problem: ValueProblem = ValueProblem.VALUE) -> None:
        self.problem = problem
        super().__init__(text)


class PlanarPose(NamedTuple):
    """A pose in the plane.

    Attributes:
        x: Metres.
        y: Metres.
        yaw: Radians.
    """

    x: float
    y: float
    yaw: float


class _Definition(NamedTuple):
    """The valid numbers of a field, according to the comments of its message.

    Attributes:
        least: The lowest.
        most: The highest.
        unit: The unit, for messages.
        cause: The likely cause of a number outside, as a question.
        has_infinity: Whether infinity has a meaning: REP 117 uses it for ranges without a return.
    """

    least: float = -math.inf
    most: float = math.inf
    unit: str = ""
    cause: str = ""
    has_infinity: bool = False

    def check(self, name: str, number: float) -> float:
        """Return the number, rounding removed.

        Raises:
            UnusableValueError: If the field cannot have this value.
        """
        if math.isnan(number):
            raise UnusableValueError(f"{name} is not a number (NaN): it was not measured")
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
_DEGREES = "is it in radians, in 1e-7 degrees, or are latitude and longitude exchanged?"
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
    """Return a field of a message.

    Args:
        message: The message.
        name: The field.
        path: Its name in messages; *name* if empty.

    Raises:
        UnusableValueError: If its value is outside the definition of the message.
    """
    value, kind, path = getattr(message, name), interface_name(type(message)), path or name
    if name == "covariance" or name.endswith("_covariance"):
        _check_covariance(value, path)
    elif kind == "sensor_msgs/msg/LaserScan" and name == "ranges":
        # The message's definition says to discard such values, but a list without them would have other angles.
        low, high = message.range_min, message.range_max
        return [each if low <= each <= high or math.isinf(each) else math.nan for each in value]
    elif kind == "sensor_msgs/msg/Range" and name == "range":
        return _Definition(message.min_range, message.max_range, " m", has_infinity=True).check(path, value)
    elif (definition := _DEFINED.get(kind, {}).get(name)) is not None:
        if kind == "sensor_msgs/msg/NavSatFix" and message.status.status < 0:
            raise UnusableValueError(
                f"{path} is not known: the receiver has no fix (status {message.status.status})"
            )
        if kind == "geometry_msgs/msg/Quaternion":
            _check_rotation(message)
        return definition.check(path, float(value))
    return value


def _check_covariance(values: Sequence[float], path: str) -> None:
    side = math.isqrt(len(values))
    if side and values[0] == -1.0:
        raise UnusableValueError(f"{path} starts with -1: the sensor does not measure it")
    for index in range(side):
        _check_variance(float(values[index * (side + 1)]), path)


def _check_variance(variance: float, path: str) -> None:
    # Filters can return slightly negative variances by rounding.
    _POSITIVE.check(f"a variance of {path}", 0.0 if -_ROUNDING <= variance < 0.0 else variance)


def read_field(message: Any, path: str) -> Any:
    """Return a field of a message by its path, such as `pose.position.x` or `poses[0].header`, as a plain value.

    Raises:
        UnusableValueError: If its value is outside the definition of the message.
        InterfaceError: If a list has no such element.
        AttributeError: If there is no such field.
    """
    return ros_interfaces.read_field(message, FieldPath(path), check_field)


def battery_share(message: Any) -> float:
    """Return the charge of a battery from a `sensor_msgs/msg/BatteryState`, as a share of 1.

    Raises:
        UnusableValueError: If its percentage is invalid: not measured, or in percent.
    """
    return _SHARE.check("percentage", float(message.percentage))


def check_position(x: float, y: float) -> tuple[float, float]:
    """Return a position, metres.

    Raises:
        UnusableValueError: If it is not finite, or farther away than any robot drives.
    """
    if not (math.isfinite(x) and math.isfinite(y)):
        raise UnusableValueError(f"({x}, {y}) is not a position")
    if max(abs(x), abs(y)) > FARTHEST_M:
        raise UnusableValueError(f"({x:g}, {y:g}) is farther away than any robot drives")
    return float(x), float(y)


def planar_point(stamped: Any, frame: str) -> tuple[float, float]:
    """Return x and y of a `geometry_msgs/msg/PointStamped`, metres in a frame.

    Raises:
        UnusableValueError: If it is in another frame, or not a position.
    """
    check_frame("the point", stamped, frame)
    return check_position(stamped.point.x, stamped.point.y)


def planar_outline(stamped: Any, frame: str) -> list[tuple[float, float]]:
    """Return the corners of a `geometry_msgs/msg/PolygonStamped`, metres in a frame; empty if it has none, in any frame.

    Raises:
        UnusableValueError: If it is in another frame.
    """
    points = stamped.polygon.points
    if points:
        check_frame("the outline", stamped, frame)
    return [(float(each.x), float(each.y)) for each in points]


def planar_pose(pose: Any) -> PlanarPose:
    """Return a `geometry_msgs/msg/Pose` in the plane.

    Raises:
        UnusableValueError: If its position or its quaternion is invalid.
    """
    return PlanarPose(*check_position(pose.position.x, pose.position.y), _yaw(pose.orientation))


def stamped_pose(stamped: Any, frame: str) -> PlanarPose:
    """Return a `geometry_msgs/msg/PoseStamped` or `PoseWithCovarianceStamped` in the plane, in a frame.

    Raises:
        UnusableValueError: If it is in another frame, or `planar_pose` raises it.
    """
    check_frame("the pose", stamped, frame)
    return planar_pose(getattr(stamped.pose, "pose", stamped.pose))


def goal_position(pose: Any) -> tuple[float, float] | None:
    """Return x and y of a navigation goal's pose, metres in the frame `map`; None if it is in another frame."""
    return (pose.pose.position.x, pose.pose.position.y) if pose.header.frame_id == MAP_FRAME else None


def localised_pose(message: Any, node: "Node") -> PlanarPose:
    """Return the pose of a localisation, a `geometry_msgs/msg/PoseWithCovarianceStamped`, in the frame `map`.

    It may be old: a localisation publishes a pose only after the robot has moved.

    Raises:
        UnusableValueError: If it is in another frame or from the future, or its numbers are invalid.
    """
    if message.header.frame_id:  # `amcl_pose` is defined in `map`
        check_frame(
            "the pose", message, MAP_FRAME, "another robot's? Or set the localisation's global_frame_id"
        )
    stamp_age(message.header.stamp, node)
    for index in _PLANAR_VARIANCES:
        _check_variance(float(message.pose.covariance[index]), "the covariance")
    return planar_pose(message.pose.pose)


def path_points(path: Any) -> list[tuple[float, float]]:
    """Return the points of a `nav_msgs/msg/Path`, metres.

    Raises:
        UnusableValueError: If one of them is not a position.
    """
    return [check_position(each.pose.position.x, each.pose.position.y) for each in path.poses]


def frame_of(message: Any) -> str:
    """Return the frame of a message with a header, without the leading slash of old tf names."""
    return frame_name(message.header.frame_id)


class GridGeometry(NamedTuple):
    """The position and size of the cells of a `nav_msgs/msg/OccupancyGrid`.

    Attributes:
        cell_m: The side of a cell, metres.
        width: The number of cells along x.
        height: The number of cells along y.
        x: The lower left corner, metres.
        y: The lower left corner, metres.
        yaw: The rotation of the grid about this corner, radians.
    """

    cell_m: float
    width: int
    height: int
    x: float
    y: float
    yaw: float

    def contains(self, x: float, y: float) -> bool:
        """Return whether a position is on the grid."""
        right, up = x - self.x, y - self.y
        along = right * math.cos(self.yaw) + up * math.sin(self.yaw)
        across = up * math.cos(self.yaw) - right * math.sin(self.yaw)
        return 0.0 <= along < self.width * self.cell_m and 0.0 <= across < self.height * self.cell_m


def grid_geometry(message: Any) -> GridGeometry:
    """Return the position and size of the cells of a `nav_msgs/msg/OccupancyGrid`.

    Raises:
        UnusableValueError: If the message is not a valid map.
    """
    info = message.info
    if not (math.isfinite(info.resolution) and info.resolution > 0.0):
        raise UnusableValueError(f"the resolution is {info.resolution:g}, but must be above 0 m")
    return GridGeometry(info.resolution, info.width, info.height, *planar_pose(info.origin))


class RigidTransform(NamedTuple):
    """The content of a `geometry_msgs/msg/TransformStamped`.

    Attributes:
        parent: The frame of the header.
        child: The frame whose pose is given.
        offset: x, y and z, metres.
        turn: The quaternion x, y, z, w of length one.
        stamp_sec: The stamp, seconds.
    """

    parent: str
    child: str
    offset: tuple[float, float, float]
    turn: tuple[float, float, float, float]
    stamp_sec: float

    @property
    def planar(self) -> PlanarPose:
        """The pose of the child in the plane of the parent."""
        return PlanarPose(*self.offset[:2], yaw_of_quaternion(*self.turn))


def read_transform(message: Any) -> RigidTransform:
    """Return the content of a transform.

    Raises:
        UnusableValueError: If its numbers are invalid.
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
    """The content of a `nav_msgs/msg/Odometry`, unchecked.

    Attributes:
        frame: The frame of the pose.
        child: The frame of the speeds.
        pose: The pose of the robot, not yet checked.
        turn: The quaternion of the pose.
        speeds: Along and about x, y and z: m/s, rad/s.
        stamp_sec: The stamp, seconds.
    """

    frame: str
    child: str
    pose: PlanarPose
    turn: Sequence[float]
    speeds: Sequence[float]
    stamp_sec: float

    @property
    def usable_pose(self) -> PlanarPose:
        """The pose.

        Raises:
            UnusableValueError: If it is not a valid pose.
        """
        check_position(*self.pose[:2])
        _check_length(*self.turn)
        return self.pose

    @property
    def usable_speed(self) -> tuple[float, float]:
        """The driving and turning speeds of the robot: m/s, rad/s.

        Raises:
            UnusableValueError: If a speed is not finite.
        """
        x, y, z, _, _, turning = self.speeds
        speed = math.hypot(x, y, z), abs(turning)
        if not all(map(math.isfinite, speed)):
            raise UnusableValueError(f"the speed is {speed[0]} m/s and {speed[1]} rad/s")
        return speed


# Offsets in a serialised message: its content, and the end of the stamp at its beginning.
_HEAD, _STAMP_END = 4, 12
_NATIVE = b"\0\x01" if sys.byteorder == "little" else b"\0\0"
_STAMP = struct.Struct("=iI")
_POSE_AND_TWIST = struct.Struct("=7d288x6d")
"""A covariance of 36 numbers follows each of them."""


def read_odometry(message: bytes) -> OdometryReading:
    """Read odometry from a serialised message, which is faster than deserialisation."""
    if message[:2] != _NATIVE:  # from a machine with the other byte order
        from nav_msgs.msg import Odometry
        from rclpy.serialization import deserialize_message, serialize_message

        message = serialize_message(deserialize_message(message, Odometry))
    seconds, nanoseconds = _STAMP.unpack_from(message, _HEAD)
    at, frames = _STAMP_END, ["", ""]
    for number in range(2):
        length = int.from_bytes(message[at : at + 4], sys.byteorder)
        frames[number] = message[at + 4 : at + 3 + length].decode(errors="replace")
        at += (4 + length + 3) // 4 * 4
    # Numbers of eight bytes are aligned to multiples of eight, counted from the end of the head.
    numbers = _POSE_AND_TWIST.unpack_from(message, at + (_HEAD - at) % 8)
    x, y, _, *turn = numbers[:7]
    pose = PlanarPose(x, y, yaw_of_quaternion(*turn))
    return OdometryReading(frames[0], frames[1], pose, turn, numbers[7:], seconds + nanoseconds * 1e-9)


def remaining_drive(feedback: Any) -> tuple[float, float] | None:
    """Return the remaining metres and seconds of a drive from Nav2's feedback; None if the feedback has none."""
    metres, time = feedback.distance_remaining, feedback.estimated_time_remaining
    return (metres, time.sec + time.nanosec * 1e-9) if math.isfinite(metres) and metres >= 0.0 else None


def remaining_poses(feedback: Any) -> int:
    """Return the number of remaining poses of a goal through poses, from Nav2's feedback."""
    return int(feedback.number_of_poses_remaining)


def frame_name(frame: str) -> str:
    """Return the name of a frame without the leading slash of old tf names."""
    return frame.removeprefix("/")


def check_frame(subject: str, message: Any, wanted: str, cause: str = "") -> None:
    """Check the frame of a message with a header.

    Args:
        subject: The object in the frame, as the beginning of a sentence.
        message: The message.
        wanted: The required frame.
        cause: A possible reason for another frame, in words.

    Raises:
        UnusableValueError: If it is in another frame.
    """
    frame = message.header.frame_id
    if frame != wanted:
        because = f" ({cause})" if cause else ""
        text = f"{subject} is in the frame '{shorten_to_line(frame)}', but must be in '{wanted}'{because}"
        raise UnusableValueError(text, ValueProblem.FRAME)


def check_stamp(message: Any, node: "Node", max_age_sec: float | None = None) -> None:
    """Check the stamp of a message, if it has one.

    Args:
        message: A message, with a header or without.
        node: The node.
        max_age_sec: The largest accepted age, seconds of the node's clock; None for no limit.

    Raises:
        UnusableValueError: If it is from the future, or older.
    """
    stamp = getattr(getattr(message, "header", None), "stamp", None)
    if stamp is not None:
        stamp_age(stamp, node, math.inf if max_age_sec is None else max_age_sec)


def stamp_sec(stamp: Any) -> float:
    """Return a `builtin_interfaces/msg/Time` in seconds."""
    return float(stamp.sec + stamp.nanosec * 1e-9)


def logged_sec(message: Any) -> float:
    """Return the time at which a line of `/rosout` was logged, seconds."""
    return stamp_sec(message.stamp)


def node_sec(node: "Node") -> float:
    """Return the time of a node's clock, seconds."""
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
    """Return the age of a stamp on a node's clock, at least 0 s; a missing stamp has age 0.

    Args:
        stamp: The stamp of a header, or its seconds.
        node: The node.
        max_age_sec: The largest accepted age, seconds.
        is_strict: Whether both clocks must be the same; else they may differ as much as those of two machines.
        at_sec: The time at which its message arrived, by the node's clock; now if None.
        subject: The beginning of a sentence about it.

    Raises:
        UnusableValueError: If it is from the future, or older.
    """
    then = stamp if isinstance(stamp, float) else stamp_sec(stamp)
    now = node_sec(node) if at_sec is None else at_sec
    is_simulated = node.get_clock().ros_time_is_active
    if then == 0.0 or (is_simulated and now == 0.0):  # no stamp, or no time yet
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
    """Return the likely cause of a stamp's large difference from a node's time; empty if unknown."""
    if apart_sec <= _ANOTHER_CLOCK_SEC:
        return ""
    if node.get_clock().ros_time_is_active:
        return ": this node has a simulated clock, and the publisher another one. Start it with `-p use_sim_time:=true`"
    return (
        ": this node has the machine's clock, and the publisher another one. With a simulator or a bag, "
        "add `--ros-args -p use_sim_time:=true`"
    )


def _seconds_apart(seconds: float) -> str:
    return f"{seconds:.1f} s" if seconds <= _ANOTHER_CLOCK_SEC else f"{seconds / _ANOTHER_CLOCK_SEC:.0f} days"


def _yaw(orientation: Any) -> float:
    _check_rotation(orientation)
    return yaw_of(orientation)


def _check_rotation(turn: Any, tolerance: float = _ROTATION_TOLERANCE) -> float:
    return _check_length(turn.x, turn.y, turn.z, turn.w, tolerance=tolerance)


def _check_length(*turn: float, tolerance: float = _ROTATION_TOLERANCE) -> float:
    """Return the length of a quaternion.

    Raises:
        UnusableValueError: If it is not one, so the quaternion is not a rotation.
    """
    length = math.hypot(*turn)
    if not abs(length - 1.0) <= tolerance:
        raise UnusableValueError(
            f"the length of the quaternion is {length:.3g}, but must be 1 (for no turn write w: 1.0)"
        )
    return length


class ValueReports:
    """Logs invalid values once for each source and kind of problem; obtain it with `value_reports`.

    Args:
        node: The rclpy node.
    """

    def __init__(self, node: "Node") -> None:
        self._node = node
        self._seen: dict[tuple[str, ValueProblem], tuple[float, float]] = {}
        self._reported: set[tuple[str, ValueProblem]] = set()

    def read(self, source: str, read: Callable[[], T]) -> T | None:
        """Return a value; None if it is outside its definition, which is reported.

        Args:
            source: The source of the value, as the beginning of a sentence.
            read: Reads it, and may raise `UnusableValueError`.
        """
        try:
            return read()
        except UnusableValueError as error:
            self.report_problem(source, error)
            return None

    def report_problem(self, source: str, error: UnusableValueError) -> None:
        """Report a problem, unless it occurred within the last minute."""
        now, key = AWAKE.now(), (source, error.problem)
        first, last = self._seen.get(key, (now, -math.inf))
        if now - last > _AGAIN_SEC:
            first = now
            self._reported.discard(key)
        self._seen[key] = first, now
        is_sure = error.problem is not ValueProblem.STALE or now - first >= _STAYS_SEC
        if is_sure and key not in self._reported:
            self._reported.add(key)
            self._node.get_logger().warning(shorten_to_line(f"{source}: {error}. It is treated as unknown."))


def value_reports(node: "Node") -> ValueReports:
    """Return the reports of a node's unusable values, one object for the lifetime of the node."""
    return of_node(node, ValueReports, lambda: ValueReports(node))
