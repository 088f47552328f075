"""Detect frames whose transforms come from several nodes, for example from two robots on the same `/tf`."""

import math
import time
from typing import TYPE_CHECKING, Literal, NamedTuple

from sar_compiler.ros.graph_queries import join_names, ros_graph
from sar_compiler.ros.leaves.leaf import is_node_valid, of_node
from sar_compiler.ros.message_values import RigidTransform, UnusableValueError, frame_name, read_transform

if TYPE_CHECKING:
    from collections.abc import Iterable

    from rclpy.node import Node

# The number of messages that are queued until the next query. A busy robot sends this many in half a second.
_DEPTH = 100
_MOST_FRAMES = 10_000
# The time, in seconds, in which two publishers of a frame are detected if each of them sends one transform a second.
_CONFLICT_SEC = 2.0
# The time, in seconds, for which a conflict is reported after the last moving transform of a static frame.
_MOVING_SEC = 1.0
# The sizes of parts of a serialised message, in bytes: the header, a time stamp, and the seven numbers of a transform.
_HEAD, _STAMP, _NUMBERS = 4, 8, 56
_NANOSECONDS = 1_000_000_000


class PublisherAlternation:
    """Detects frames whose transforms come from alternating publishers.

    rclpy does not identify the publisher of a message, but provides the sequence number that the publisher has assigned to it. The numbers of a
    single publisher increase. They decrease once if the publisher is restarted, and repeatedly if two publishers alternate.
    """

    def __init__(self) -> None:
        self._numbers: dict[str, int] = {}
        self._falls: dict[str, tuple[float, float]] = {}

    def add(self, children: "Iterable[str]", number: int, at_sec: float) -> None:
        """Process a message with transforms.

        Args:
            children: The child frames of the transforms.
            number: The sequence number that the publisher has assigned to the message.
            at_sec: The time at which the message has arrived, in seconds.
        """
        for child in children:
            last = self._numbers.get(child)
            if last is None and len(self._numbers) >= _MOST_FRAMES:
                continue
            self._numbers[child] = number
            if last is not None and number <= last:
                self._falls[child] = (self._falls.get(child, (-math.inf, -math.inf))[1], at_sec)

    def contested_frames(self, now_sec: float) -> list[str]:
        """Return the frames with several publishers.

        *now_sec* is the current time on the clock whose times were passed to `add`.
        """
        return sorted(child for child, (at, _) in self._falls.items() if now_sec - at <= _CONFLICT_SEC)


class _StaticFrame(NamedTuple):
    """The last static transform of a frame, its sequence number, and the publishers that disagree about the transform."""

    transform: RigidTransform
    number: int
    rivals: frozenset[bytes]


def listener_name(node: "Node") -> str:
    """Return the name of the auxiliary node that listens to frames."""
    return f"_{node.get_name()}_frames"


class FrameSources:
    """Listens to transforms and to the sequence numbers of their messages; created by `frame_sources`.

    The listener has its own node, which is never spun. Messages are queued until the next query, and take no processor time until then. (A
    subscription's callback is not possible, because rclpy's EventsExecutor cannot pass the sequence number.)

    Args:
        node: The node whose remappings determine the topics.
    """

    def __init__(self, node: "Node") -> None:
        from rclpy.node import Node
        from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
        from tf2_msgs.msg import TFMessage

        self._node = node
        self._turns, self._moved_at = PublisherAlternation(), dict[str, float]()
        self._static: dict[str, _StaticFrame] = {}
        self._topics = tuple(node.resolve_topic_name(topic) for topic in ("/tf", "/tf_static"))
        # The arguments of the process are not used, because they may set the name of the mission's node.
        self._listener = Node(
            listener_name(node),
            namespace=node.get_namespace(),
            context=node.context,
            use_global_arguments=False,
            start_parameter_services=False,
            enable_rosout=False,
        )
        moving = QoSProfile(depth=_DEPTH, reliability=ReliabilityPolicy.BEST_EFFORT)
        latched = QoSProfile(depth=_DEPTH, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self._subscriptions = [
            self._listener.create_subscription(TFMessage, topic, lambda _: None, qos, raw=True)
            for topic, qos in zip(self._topics, (moving, latched), strict=True)
        ]

    def conflict(self) -> str:
        """Describe the first frame that several nodes publish; return an empty string if there is no such frame."""
        self._listen()
        found = (
            self._describe(child) for child in (*self._turns.contested_frames(time.time()), *self._static)
        )
        return next(filter(None, found), "")

    def frame_conflict(self, child: str) -> str:
        """Describe the nodes that publish a frame; return an empty string if only one node publishes it."""
        self._listen()
        return self._describe(child)

    def _describe(self, child: str) -> str:
        if child in self._turns.contested_frames(time.time()):
            return self._two_sources(child, self._topics[0])
        static = self._static.get(child)
        if static is None:
            return ""
        graph, (moving_topic, static_topic) = ros_graph(self._node), self._topics
        if static.rivals and static.rivals <= graph.publisher_ids(static_topic):
            return self._two_sources(child, static_topic)
        fixed, moving = graph.publishers(static_topic), graph.publishers(moving_topic)
        if not fixed or not moving or time.time() - self._moved_at.get(child, -math.inf) > _MOVING_SEC:
            return ""
        return (
            f"frame '{child}' is published as static ({static_topic}, by {join_names(fixed)}) and as moving ({moving_topic}, by {join_names(moving)}). "
            f"Stop one of these nodes"
        )

    def _two_sources(self, child: str, topic: str) -> str:
        nodes = ros_graph(self._node).publishers(topic)
        # If the topic has more than two publishers, the sequence numbers do not show which of them alternate.
        among = f"among its {len(nodes)} publishers " if len(nodes) > 2 else ""  # noqa: PLR2004
        who = f"{among}{join_names(nodes)}" if nodes else "two publishers"
        return (
            f"frame '{child}' has two sources on {topic}, {who}. Stop one of these nodes, or give each robot its own namespace and "
            f"transforms (`-r __ns:=/robot1 -r /tf:=tf -r /tf_static:=tf_static`)"
        )

    def _listen(self) -> None:
        """Read the messages received since the last call."""
        if not is_node_valid(self._listener):
            return
        for subscription, on_message in zip(
            self._subscriptions, (self._on_moving, self._on_static), strict=True
        ):
            with subscription.handle:
                # `rclpy.wait_for_message` reads messages in the same way.
                while (came := subscription.handle.take_message(subscription.msg_type, True)) is not None:  # noqa: FBT003
                    message, info = came
                    number = info.get("publication_sequence_number")
                    if number is not None:  # not every middleware provides it
                        at_sec = info["received_timestamp"] / _NANOSECONDS or time.time()
                        on_message(message, number, at_sec)

    def _on_moving(self, message: bytes, number: int, at_sec: float) -> None:
        children = child_frames(message)
        self._turns.add(children, number, at_sec)
        for child in children:
            if child in self._static:
                self._moved_at[child] = at_sec

    def _on_static(self, message: bytes, number: int, _: float) -> None:
        from rclpy.serialization import deserialize_message
        from tf2_msgs.msg import TFMessage

        there = ros_graph(self._node).publisher_ids(self._topics[1])
        for each in deserialize_message(message, TFMessage).transforms:
            try:
                transform = read_transform(each)._replace(stamp_sec=0.0)
            except UnusableValueError:
                continue  # `FrameTree` reports the invalid transform
            before = self._static.get(transform.child)
            if before is None and len(self._static) >= _MOST_FRAMES:
                continue
            rivals = before.rivals if before is not None else frozenset[bytes]()
            # A different transform of the same publisher, which has a higher number, is a correction. Otherwise it is a conflict.
            if (
                before is not None
                and number <= before.number
                and transform != before.transform
                and len(there) > 1
            ):
                rivals = there
            self._static[transform.child] = _StaticFrame(transform, number, rivals)


def frame_sources(node: "Node") -> FrameSources:
    """Return the `FrameSources` of a node, which all callers share."""
    return of_node(node, FrameSources, lambda: FrameSources(node))


def child_frames(message: bytes) -> list[str]:
    """Return the child frames of all complete transforms in a serialised message of `/tf`."""
    order: Literal["little", "big"] = "little" if message[1:2] == b"\1" else "big"
    at, children = _HEAD + 4, []
    for _ in range(int.from_bytes(message[_HEAD : _HEAD + 4], order)):
        at += _STAMP
        for _ in range(2):  # the parent, and the child
            length = int.from_bytes(message[at : at + 4], order)
            name = message[at + 4 : at + 3 + length]
            at = (at + 4 + length + 3) // 4 * 4
        # Numbers of eight bytes are aligned to multiples of eight bytes after the header.
        at += (_HEAD - at) % 8 + _NUMBERS
        if at > len(message):
            break
        children.append(frame_name(name.decode(errors="replace")))
    return children
