"""Where frames are in each other: the transforms of `/tf` and `/tf_static`, of which the last one of each frame counts.

tf2's own listener has no Python package on PyPI. Unlike it, nothing is kept of the past, and nothing is interpolated.
"""

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, NamedTuple

from sar_compiler.ros.leaves.leaf import of_node
from sar_compiler.ros.poses import yaw_of_turn

if TYPE_CHECKING:
    from rclpy.node import Node

_NANOSECONDS = 1_000_000_000
# Of tf2: how many messages are kept until they are taken, and how far from one a quaternion's length may be.
_DEPTH, _LENGTH_TOLERANCE = 100, 0.01
_MOST_FRAMES = 10_000
_Displacement = tuple[float, float, float]


class Transform(NamedTuple):
    """Where one frame is in another.

    Attributes:
        x: Metres.
        y: Metres.
        z: Metres.
        qx: A part of the rotation, a quaternion of length one; so are the following.
        qy: See `qx`.
        qz: See `qx`.
        qw: See `qx`.
    """

    x: float = 0.0
    y: float = 0.0
    z: float = 0.0
    qx: float = 0.0
    qy: float = 0.0
    qz: float = 0.0
    qw: float = 1.0

    @property
    def yaw(self) -> float:
        """The turn about z, rad."""
        return yaw_of_turn(self.qx, self.qy, self.qz, self.qw)

    def of(self, inner: "Transform") -> "Transform":
        """Return where a frame is in the outer one, given where it is in the inner one."""
        x, y, z = self._turned((inner.x, inner.y, inner.z))
        ax, ay, az, aw = self[3:]
        bx, by, bz, bw = inner[3:]
        return Transform(
            self.x + x,
            self.y + y,
            self.z + z,
            aw * bx + ax * bw + ay * bz - az * by,
            aw * by - ax * bz + ay * bw + az * bx,
            aw * bz + ax * by - ay * bx + az * bw,
            aw * bw - ax * bx - ay * by - az * bz,
        )

    @property
    def inverse(self) -> "Transform":
        """Where the outer frame is in the inner one."""
        turn = Transform(0.0, 0.0, 0.0, -self.qx, -self.qy, -self.qz, self.qw)
        x, y, z = turn._turned((self.x, self.y, self.z))
        return turn._replace(x=-x, y=-y, z=-z)

    def _turned(self, vector: _Displacement) -> _Displacement:
        axis = self.qx, self.qy, self.qz
        once = _cross(axis, vector)
        twice = _cross(axis, once)
        x, y, z = (v + 2.0 * (self.qw * a + b) for v, a, b in zip(vector, once, twice, strict=True))
        return x, y, z


class Sighting(NamedTuple):
    """What transforms say of a frame in another one.

    Attributes:
        transform: Where it is there.
        age_sec: How old the oldest of these transforms is, seconds of the node's clock; static ones do not age.
    """

    transform: Transform
    age_sec: float


class _Heard(NamedTuple):
    """The last transform of a frame, with the times of the node's clock from which it is and when it came, seconds."""

    parent: str
    transform: Transform
    of_sec: float
    came_sec: float


class FrameTree:
    """The frames that a node has heard of; use `frame_tree`.

    Args:
        node: The rclpy node.
    """

    def __init__(self, node: "Node") -> None:
        from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
        from tf2_msgs.msg import TFMessage

        self._node = node
        self._heard: dict[str, _Heard] = {}
        self._listeners: list[Callable[[], None]] = []
        moving = QoSProfile(depth=_DEPTH, reliability=ReliabilityPolicy.BEST_EFFORT)
        latched = QoSProfile(depth=_DEPTH, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        # Absolute, as tf2 has them; a node in a namespace remaps them, as Nav2 does.
        node.create_subscription(TFMessage, "/tf", self._on_moving, moving)
        node.create_subscription(TFMessage, "/tf_static", self._on_static, latched)

    def listen(self, listener: Callable[[], None]) -> None:
        """Have a function called whenever transforms have come."""
        self._listeners.append(listener)

    def withdraw(self, listener: Callable[[], None]) -> None:
        """Take back a function given to `listen`."""
        self._listeners.remove(listener)

    def look_up(self, target: str, source: str) -> Sighting | str:
        """Return where the source frame is in the target frame; in words why that is not known, if it is not."""
        target, source = _name(target), _name(source)
        up, down = self._way_up(source), self._way_up(target)
        shared = next((frame for frame in up if frame in down), None)
        if shared is None:
            known = {*self._heard, *(each.parent for each in self._heard.values())}
            missing = [f"'{frame}'" for frame in dict.fromkeys((target, source)) if frame not in known]
            return (
                f"no transform of {' and '.join(missing)} has come"
                if missing
                else f"'{next(reversed(up))}' and '{next(reversed(down))}', above them, are not connected"
            )
        outward, inward = up[shared], down[shared]
        of_sec = min(outward.of_sec, inward.of_sec)
        age_sec = max(0.0, self._now_sec() - of_sec)  # where all are static, the time is infinite
        return Sighting(inward.transform.inverse.of(outward.transform), age_sec)

    def _way_up(self, frame: str) -> dict[str, _Heard]:
        """Return the frames around a frame, the inner ones first, each with where the frame is in it, and since when."""
        now = self._now_sec()
        at = _Heard(frame, Transform(), math.inf, now)
        way = {frame: at}
        # What came later than now came before the clock began anew, as that of a simulator does.
        while (above := self._heard.get(at.parent)) is not None and above.came_sec <= now:
            if above.parent in way:  # they go round in a circle
                break
            at = _Heard(
                above.parent, above.transform.of(at.transform), min(at.of_sec, above.of_sec), above.came_sec
            )
            way[at.parent] = at
        return way

    def _on_moving(self, message: Any) -> None:
        now = self._now_sec()
        for each in message.transforms:
            stamp = each.header.stamp
            # A localisation says where a robot will have been: that is not older than what has come now.
            self._take(each, min(now, stamp.sec + stamp.nanosec / _NANOSECONDS), now)
        self._tell()

    def _on_static(self, message: Any) -> None:
        for each in message.transforms:
            self._take(each, math.inf, -math.inf)
        self._tell()

    def _take(self, message: Any, of_sec: float, came_sec: float) -> None:
        child, parent = _name(message.child_frame_id), _name(message.header.frame_id)
        place, turn = message.transform.translation, message.transform.rotation
        length = math.hypot(turn.x, turn.y, turn.z, turn.w)
        is_sound = math.isfinite(place.x + place.y + place.z) and abs(length - 1.0) <= _LENGTH_TOLERANCE
        is_known = child in self._heard or len(self._heard) < _MOST_FRAMES
        if is_sound and is_known and child and parent and child != parent:
            parts = (part / length for part in (turn.x, turn.y, turn.z, turn.w))
            transform = Transform(place.x, place.y, place.z, *parts)
            self._heard[child] = _Heard(parent, transform, of_sec, came_sec)

    def _tell(self) -> None:
        for listener in tuple(self._listeners):
            listener()

    def _now_sec(self) -> float:
        return float(self._node.get_clock().now().nanoseconds) / _NANOSECONDS


def frame_tree(node: "Node") -> FrameTree:
    """Return the frames that a node hears of, the same object in every call; it exists as long as the node."""
    return of_node(node, FrameTree, lambda: FrameTree(node))


def _name(frame: str) -> str:
    """Return the name of a frame without the slash that tf had before it."""
    return frame.removeprefix("/")


def _cross(a: _Displacement, b: _Displacement) -> _Displacement:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]
