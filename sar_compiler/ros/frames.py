"""Compute the pose of one frame in another frame from the latest transforms on `/tf` and `/tf_static`.

tf2's listener is not on PyPI. Unlike tf2, this module stores no history of transforms and does not interpolate.
"""

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, NamedTuple

from sar_compiler.ros.frame_sources import frame_sources
from sar_compiler.ros.graph_queries import join_names, ros_graph
from sar_compiler.ros.leaves.leaf import of_node
from sar_compiler.ros.message_values import (
    UnusableValueError,
    frame_name,
    node_sec,
    read_transform,
    stamp_age,
    value_reports,
)
from sar_compiler.ros.poses import yaw_of_quaternion
from sar_compiler.tree.guessing import did_you_mean, nearest

if TYPE_CHECKING:
    from rclpy.node import Node

# The number of messages that are queued, as in tf2.
_DEPTH = 100
_MOST_FRAMES = 10_000
_SUBJECT = "the transforms are"
# The maximum number of frames that a message names, and of frames that are compared with an unknown name.
_MOST_NAMED, _MOST_COMPARED = 8, 200
_Displacement = tuple[float, float, float]


class Transform(NamedTuple):
    """The pose of one frame in another frame.

    Attributes:
        x: The position's x, in metres.
        y: The position's y, in metres.
        z: The position's z, in metres.
        qx: The x component of the rotation, a unit quaternion.
        qy: The y component of the quaternion.
        qz: The z component of the quaternion.
        qw: The scalar component of the quaternion.
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
        """The rotation about the z axis, in radians."""
        return yaw_of_quaternion(self.qx, self.qy, self.qz, self.qw)

    def compose(self, inner: "Transform") -> "Transform":
        """Convert a pose given in the inner frame to a pose in the outer frame."""
        x, y, z = self._rotate((inner.x, inner.y, inner.z))
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
        """The pose of the outer frame in the inner frame."""
        turn = Transform(0.0, 0.0, 0.0, -self.qx, -self.qy, -self.qz, self.qw)
        x, y, z = turn._rotate((self.x, self.y, self.z))
        return turn._replace(x=-x, y=-y, z=-z)

    def _rotate(self, vector: _Displacement) -> _Displacement:
        axis = self.qx, self.qy, self.qz
        once = _cross(axis, vector)
        twice = _cross(axis, once)
        x, y, z = (v + 2.0 * (self.qw * a + b) for v, a, b in zip(vector, once, twice, strict=True))
        return x, y, z


class FramePose(NamedTuple):
    """The pose of a frame in another frame, and the age of the transforms from which it was computed.

    Attributes:
        transform: The pose.
        age_sec: The age of the oldest of these transforms, in seconds of the node's clock. Static transforms do not age.
    """

    transform: Transform
    age_sec: float


class _FrameTransform(NamedTuple):
    """The latest transform of a frame, or the composition of several consecutive transforms.

    Attributes:
        parent: The outer frame.
        transform: The pose in the outer frame.
        oldest_sec: The oldest time stamp of the transforms, in seconds; infinite if all of them are static.
        newest_sec: The newest time stamp of the transforms that are not static, in seconds; minus infinity if all of them are static.
        came_sec: The time of the node's clock at which the transform arrived, in seconds.
    """

    parent: str
    transform: Transform
    oldest_sec: float
    newest_sec: float
    came_sec: float


class FrameTree:
    """The frames whose transforms a node receives; created by `frame_tree`.

    A frame has no pose if two nodes publish it, or if it is both static and moving. In these cases it is unknown which transform is right.

    Args:
        node: The rclpy node that receives the transforms.
    """

    def __init__(self, node: "Node") -> None:
        from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
        from tf2_msgs.msg import TFMessage

        self._node = node
        self._received: dict[str, _FrameTransform] = {}
        self._listeners: list[Callable[[], None]] = []
        moving = QoSProfile(depth=_DEPTH, reliability=ReliabilityPolicy.BEST_EFFORT)
        latched = QoSProfile(depth=_DEPTH, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        # Absolute names, as in tf2. A node in a namespace remaps them, as Nav2's nodes do.
        node.create_subscription(TFMessage, "/tf", self._on_moving, moving)
        node.create_subscription(TFMessage, "/tf_static", self._on_static, latched)

    def add_listener(self, listener: Callable[[], None]) -> None:
        """Add a callback that is called when transforms have arrived."""
        self._listeners.append(listener)

    def remove_listener(self, listener: Callable[[], None]) -> None:
        """Remove a callback that was added with `add_listener`."""
        self._listeners.remove(listener)

    def look_up(self, target: str, source: str, max_age_sec: float = math.inf) -> FramePose | str:
        """Return the pose of the source frame in the target frame, or the reason why it is unknown.

        Args:
            target: The outer frame.
            source: The inner frame, whose pose is returned.
            max_age_sec: The maximum age of the transforms, in seconds of the node's clock.
        """
        target, source = frame_name(target), frame_name(source)
        up, down = self._ancestors(source), self._ancestors(target)
        shared = next((frame for frame in up if frame in down), None)
        if shared is None:
            return self._describe_gap(target, source, next(reversed(up)), next(reversed(down)))
        sources = frame_sources(self._node)
        for ancestors in (up, down):
            for frame in list(ancestors)[: list(ancestors).index(shared)]:
                if conflict := sources.frame_conflict(frame):
                    return conflict
        outward, inward = up[shared], down[shared]
        oldest = min(outward.oldest_sec, inward.oldest_sec)
        newest = max(outward.newest_sec, inward.newest_sec)
        age_sec = 0.0
        if oldest < math.inf:
            try:
                stamp_age(newest, self._node, subject=_SUBJECT)
                age_sec = stamp_age(oldest, self._node, max_age_sec, is_strict=True, subject=_SUBJECT)
            except UnusableValueError as error:
                return str(error)
        return FramePose(inward.transform.inverse.compose(outward.transform), age_sec)

    def _describe_gap(self, target: str, source: str, above_source: str, above_target: str) -> str:
        known = sorted({*self._received, *(each.parent for each in self._received.values())})
        missing = [frame for frame in dict.fromkeys((target, source)) if frame not in known]
        if not missing:
            return f"the frames have different roots, '{above_source}' and '{above_target}', and no transform connects the two roots"
        text = f"no transform of {' and '.join(map(repr, missing))} has arrived"
        if not known:
            graph = ros_graph(self._node)
            topic = self._node.resolve_topic_name("/tf")
            cause = "" if graph.publishers(topic) else f", because no node publishes on {topic}"
            elsewhere = graph.transforms()
            return f"{text}: {elsewhere}" if elsewhere else f"{text}{cause}"
        ends = {each.rpartition("/")[2]: each for each in known[:_MOST_COMPARED]}
        guesses = (ends.get(frame) or nearest(frame, known[:_MOST_COMPARED]) for frame in missing)
        near = next(filter(None, guesses), None)
        named = [*map(repr, known[:_MOST_NAMED]), *(["others"] if len(known) > _MOST_NAMED else [])]
        return (
            f"{text}, but there {'is' if len(named) == 1 else 'are'} {join_names(named)}{did_you_mean(near)}"
        )

    def _ancestors(self, frame: str) -> dict[str, _FrameTransform]:
        """Return a frame and its ancestors, innermost first, with the frame's pose in each of them."""
        now = node_sec(self._node)
        at = _FrameTransform(frame, Transform(), math.inf, -math.inf, now)
        ancestors = {frame: at}
        # If a transform has arrived after the current time, the clock has gone back since, for example because a simulator was restarted.
        while (above := self._received.get(at.parent)) is not None and above.came_sec <= now:
            if above.parent in ancestors:  # the frames form a cycle
                break
            at = _FrameTransform(
                above.parent,
                above.transform.compose(at.transform),
                min(at.oldest_sec, above.oldest_sec),
                max(at.newest_sec, above.newest_sec),
                above.came_sec,
            )
            ancestors[at.parent] = at
        return ancestors

    def _on_moving(self, message: Any) -> None:
        now = node_sec(self._node)
        for each in message.transforms:
            self._on_transform("Topic '/tf'", each, now, is_static=False)
        self._notify()

    def _on_static(self, message: Any) -> None:
        for each in message.transforms:
            self._on_transform("Topic '/tf_static'", each, -math.inf, is_static=True)
        self._notify()

    def _on_transform(self, topic: str, message: Any, came_sec: float, *, is_static: bool) -> None:
        read = value_reports(self._node).read(topic, lambda: read_transform(message))
        if read is None or not read.child or not read.parent or read.child == read.parent:
            return
        if read.child in self._received or len(self._received) < _MOST_FRAMES:
            # If a transform has no time stamp, its time of arrival is used.
            times = (math.inf, -math.inf) if is_static else (read.stamp_sec or came_sec,) * 2
            transform = Transform(*read.offset, *read.turn)
            self._received[read.child] = _FrameTransform(read.parent, transform, *times, came_sec)

    def _notify(self) -> None:
        for listener in tuple(self._listeners):
            listener()


def frame_tree(node: "Node") -> FrameTree:
    """Return the frames whose transforms a node receives; every call for a node returns the same object."""
    return of_node(node, FrameTree, lambda: FrameTree(node))


def _cross(a: _Displacement, b: _Displacement) -> _Displacement:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]
