"""Record the ROS 2 messages of a mission in an MCAP file.

The file must contain the definitions of the messages, which are derived from the messages' Python classes.
"""

import json
import time
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from importlib import import_module
from pathlib import Path
from queue import Empty, SimpleQueue
from threading import Thread
from typing import IO, Any, NamedTuple

from action_msgs.msg import GoalStatusArray
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseWithCovarianceStamped, Twist, TwistStamped
from mcap.writer import Writer
from nav2_msgs.action import NavigateToPose
from nav_msgs.msg import OccupancyGrid, Odometry
from nav_msgs.msg import Path as Plan
from rcl_interfaces.msg import Log
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.serialization import serialize_message
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import BatteryState, LaserScan
from std_msgs.msg import String
from tf2_msgs.msg import TFMessage
from visualization_msgs.msg import MarkerArray

from sar_compiler.compiler import CompiledTree
from sar_compiler.errors import SarError
from sar_compiler.journal.journal_entries import OF_ROBOT, RUN_BEGAN, STATUS, JournalEntry
from sar_compiler.json_values import json_text
from sar_compiler.ros.clock import steady_timer
from sar_compiler.ros.engine import Engine, error_text
from sar_compiler.ros.leaves.leaf import interface_name
from sar_compiler.ros.mission_publisher import TOPIC, TreeLog
from sar_compiler.ros.run_extension import RunExtension
from sar_compiler.views.numbered_tree import NumberedTree, tree_xml

# The names of primitive types in message definitions, by their names in the Python classes.
_WORDS = {"boolean": "bool", "octet": "byte", "float": "float32", "double": "float64"}
_BETWEEN = f"{'=' * 80}\nMSG: "


def message_text(kind: Any) -> str:
    """Return the definitions of a message type and its nested message types, in the format `ros2msg`."""
    inner: dict[str, Any] = {}
    parts = [_fields(kind, inner)]
    # Each definition can add further nested types to `inner`.
    seen: set[str] = set()
    while left := [name for name in inner if name not in seen]:
        for name in left:
            seen.add(name)
            parts.append(f"{_BETWEEN}{name}\n{_fields(inner[name], inner)}")
    return "".join(parts)


def _fields(kind: Any, inner: dict[str, Any]) -> str:
    """Return the lines that define a message type's fields, and add the nested message types to *inner*."""
    for slot in kind.SLOT_TYPES:
        slot = getattr(slot, "value_type", slot)  # noqa: PLW2901 - the type of an array's elements
        if hasattr(slot, "namespaces"):
            # The message types of an action are in the same module as the enclosing type.
            own, nested = (import_module(name) for name in (kind.__module__, ".".join(slot.namespaces)))
            found = getattr(nested, slot.name, None) or getattr(own, slot.name)
            inner.setdefault(f"{slot.namespaces[0]}/{slot.name}", found)
    return "".join(
        f"{_field_type(text)} {name}\n" for name, text in kind.get_fields_and_field_types().items()
    )


def _field_type(text: str) -> str:
    """Convert a field's type to the notation of message definitions, such as `float64[36]` or `string[<=10]`."""
    if text.startswith("sequence<"):
        item, _, most = text.removeprefix("sequence<").removesuffix(">").partition(", ")
        return f"{_field_type(item)}[{f'<={most}' if most else ''}]"
    if text.endswith("]"):
        item, _, count = text.partition("[")
        return f"{_field_type(item)}[{count}"
    word, bound, most = text.partition("<")
    if bound:
        return f"{word}<={most.removesuffix('>')}"
    return _WORDS.get(text, text)


# The names are written as in a node, whose remappings also change absolute names.
RECORDED: dict[str, tuple[Any, ...]] = {
    "/tf": (TFMessage,),
    "/tf_static": (TFMessage,),
    "odometry/filtered": (Odometry,),
    "scan": (LaserScan,),
    "map": (OccupancyGrid,),
    "amcl_pose": (PoseWithCovarianceStamped,),
    "plan": (Plan,),
    "battery_state": (BatteryState,),
    "cmd_vel": (TwistStamped, Twist),
    "navigate_to_pose/_action/feedback": (NavigateToPose.Impl.FeedbackMessage,),
    "navigate_to_pose/_action/status": (GoalStatusArray,),
    "/clock": (Clock,),
    "/rosout": (Log,),
    "/diagnostics": (DiagnosticArray,),
    "~/markers": (MarkerArray,),
}
"""The topics to record, with their message types. If a topic has several types, the type that the publisher uses is recorded."""

_LATCHED = ("/tf_static", "map", "amcl_pose", "navigate_to_pose/_action/status", "~/markers")
_UNRELIABLE = ("scan", "/clock", "odometry/filtered", "battery_state")
_DEPTH = 100
# Interval between checks for new topics, in seconds of the steady clock.
_LOOK_SEC = 0.5
# Interval between writes to the disk, in seconds of the steady clock. If the process is killed, the messages of this time may be lost.
_FLUSH_SEC = 1.0
# Maximum size of the queue in bytes. At the end of a run, the file is abandoned if nothing is written for the second value, in seconds.
_MOST_WAITING = 256 << 20
_PATIENCE_SEC = 10.0


class RecordingError(SarError):
    """Raised if the file for a recording already exists or cannot be created."""


def _type_to_record(name: str, types: Iterable[str]) -> Any:
    """Return the Python class of the message type to record on a topic; None if the topic is not recorded."""
    return next((kind for kind in RECORDED.get(name, ()) if interface_name(kind) in types), None)


def _as_yaml(profiles: Iterable[QoSProfile]) -> str:
    """Convert QoS profiles to rosbag2's YAML format."""
    policies = ("history", "depth", "reliability", "durability", "liveliness")
    times = ("deadline", "lifespan", "liveliness_lease_duration")
    written = []
    for profile in profiles:
        values: dict[str, object] = {name: int(getattr(profile, name)) for name in policies}
        for name in times:
            seconds, nanoseconds = divmod(getattr(profile, name).nanoseconds, 10**9)
            values[name] = {"sec": seconds, "nsec": nanoseconds}
        values["avoid_ros_namespace_conventions"] = profile.avoid_ros_namespace_conventions
        written.append(values)
    return json.dumps(written)


class _Recorded(NamedTuple):
    topic: str
    kind: Any
    data: bytes
    time_ns: int


class McapRecorder:
    """Writes messages to a file in a background thread, so that a slow disk does not delay ticks.

    The time of a message is its time of arrival on the machine's clock, as in rosbag2.

    Args:
        path: The path of the file.
        file: The file, open and empty.
        complain: Called with an error message, from any thread, if a message or topic cannot be recorded.
    """

    def __init__(self, path: Path, file: IO[bytes], complain: Callable[[str], object]) -> None:
        self._path, self._file, self._complain = path, file, complain
        self._waiting: SimpleQueue[_Recorded | None] = SimpleQueue()
        # The numbers of enqueued and written bytes, each of which is changed by only one thread.
        self._enqueued = self._written = 0
        self._is_broken = False
        self._channels: dict[str, int] = {}
        self._schemas: dict[str, int] = {}
        # The QoS profiles of each topic's publishers, which are determined before the topic's first message is enqueued.
        self._offers: dict[str, str] = {}
        self._thread = Thread(target=self._write_queued, name="recorder", daemon=True)
        self._thread.start()

    @classmethod
    def create(cls, path: Path, complain: Callable[[str], object]) -> "McapRecorder":
        """Create a file, and return its recorder.

        Raises:
            RecordingError: If the file already exists, or cannot be created.
        """
        try:
            file = path.open("xb")
        except FileExistsError as error:
            message = f"{path} already exists and is not overwritten. Choose another name"
            raise RecordingError(message) from error
        except OSError as error:
            raise RecordingError(f"{path} cannot be created: {error.strerror}") from error
        return cls(path, file, complain)

    def record_topics(self, node: Node) -> None:
        """Record the topics in `RECORDED`, starting each one as soon as it is discovered with an expected type."""
        left = {node.resolve_topic_name(name): name for name in RECORDED}

        def subscribe_new_topics() -> None:
            for topic, types in node.get_topic_names_and_types():
                kind = _type_to_record(left.get(topic, ""), types)
                if kind is None:
                    continue
                try:
                    self._listen_to(node, topic, left.pop(topic), kind)
                except Exception as error:  # noqa: BLE001 - for example if this process publishes another type on the topic
                    self._complain(f"{topic} is not recorded: {error_text(error)}")
            if not left:
                timer.cancel()

        timer = steady_timer(node, _LOOK_SEC, subscribe_new_topics)

    def _listen_to(self, node: Node, topic: str, name: str, kind: Any) -> None:
        latched = DurabilityPolicy.TRANSIENT_LOCAL if name in _LATCHED else DurabilityPolicy.VOLATILE
        reliable = ReliabilityPolicy.BEST_EFFORT if name in _UNRELIABLE else ReliabilityPolicy.RELIABLE
        qos = QoSProfile(depth=_DEPTH, durability=latched, reliability=reliable)

        def on_message(data: bytes) -> None:
            if topic not in self._offers:
                self._offers[topic] = self._offers_in(node, topic)
            self._enqueue(_Recorded(topic, kind, data, time.time_ns()))

        node.create_subscription(kind, topic, on_message, qos, raw=True)

    def _offers_in(self, node: Node, topic: str) -> str:
        # Called when the first message has arrived, because before that the topic may only have subscribers.
        try:
            return _as_yaml(each.qos_profile for each in node.get_publishers_info_by_topic(topic))
        except Exception as error:  # noqa: BLE001 - the message must still be recorded
            self._complain(f"The QoS profiles of {topic} are not recorded: {error_text(error)}")
            return _as_yaml([])

    def write(self, topic: str, message: Any, *, latched: bool = False) -> None:
        """Record a message.

        Args:
            topic: The full name of the message's topic.
            message: The message.
            latched: Whether late subscribers also receive the message when the recording is played back.
        """
        if latched:
            self._offers.setdefault(
                topic, _as_yaml([QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)])
            )
        self._enqueue(_Recorded(topic, type(message), serialize_message(message), time.time_ns()))

    def _enqueue(self, recorded: _Recorded) -> None:
        if self._is_broken:
            return
        if self._enqueued - self._written > _MOST_WAITING:
            self._give_up(f"the disk is too slow: {_MOST_WAITING >> 20} MiB are waiting to be written")
            return
        self._enqueued += len(recorded.data)
        self._waiting.put(recorded)

    def close(self, *, keep: bool = True) -> None:
        """Write the rest of the queue, and close the file.

        Args:
            keep: Whether to keep the file. A recording without messages is always deleted.
        """
        self._waiting.put(None)
        written = -1
        while self._thread.is_alive() and written != self._written:
            written = self._written
            self._thread.join(_PATIENCE_SEC)
        if self._thread.is_alive():
            self._complain(
                f"The recording {self._path} is incomplete, because the disk does not accept more data."
            )
            return
        if not (keep and self._channels):
            self._path.unlink(missing_ok=True)

    def _write_queued(self) -> None:
        try:
            with self._file:
                writer = Writer(self._file)
                writer.start(profile="ros2", library="sar_compiler")
                self._write_until_closed(writer)
                writer.finish()  # type: ignore[no-untyped-call]
        except Exception as error:  # noqa: BLE001 - a failed recording must not end the mission
            self._give_up((error.strerror if isinstance(error, OSError) else None) or repr(error))

    def _give_up(self, reason: str) -> None:
        self._is_broken = True
        self._complain(
            f"The recording {self._path} cannot be written ({reason}). The mission continues without it."
        )

    def _write_until_closed(self, writer: Writer) -> None:
        """Write the queue's messages until the queue is closed and empty."""
        due = time.monotonic() + _FLUSH_SEC
        while True:
            with suppress(Empty):
                recorded = self._waiting.get(timeout=max(0.0, due - time.monotonic()))
                if recorded is None:
                    return
                self._add(writer, recorded)
            if time.monotonic() >= due:
                writer.flush()  # type: ignore[no-untyped-call]
                due = time.monotonic() + _FLUSH_SEC

    def _add(self, writer: Writer, recorded: _Recorded) -> None:
        topic, kind, data, time_ns = recorded
        if topic not in self._channels:
            name = interface_name(kind)
            if name not in self._schemas:
                self._schemas[name] = writer.register_schema(name, "ros2msg", message_text(kind).encode())
            # The value is never an empty string, which rosbag2 could not read.
            metadata = {"offered_qos_profiles": self._offers.get(topic, _as_yaml([]))}
            self._channels[topic] = writer.register_channel(topic, "cdr", self._schemas[name], metadata)
        writer.add_message(self._channels[topic], time_ns, data, time_ns)
        self._written += len(data)


# Entries that are not recorded in `mission_log`, because other recorded topics have the same content.
_ON_OTHER_TOPICS = (STATUS, *OF_ROBOT)


class MissionRecording(RunExtension):
    """Records a mission in an MCAP file. This does not require that the mission is published on ROS topics.

    The recording contains the topics in `ros.mission_recording.RECORDED`, and the messages that `ros.mission_publisher` sends on
    `behavior_tree_log` and `~/tree`. The other entries of the run's journal are recorded as messages on `mission_log`
    (`rcl_interfaces/msg/Log`).

    Args:
        node: The mission's node.
        path: The file to create.

    Raises:
        RecordingError: If the file already exists, or cannot be created.
    """

    def __init__(self, node: Node, path: Path) -> None:
        self._node = node
        self._recorder = McapRecorder.create(path, node.get_logger().error)
        self._tree_log: TreeLog | None = None

    def on_compiled(self, tree: CompiledTree, engine: Engine) -> None:
        """Record the tree, and start to record its status changes and the mission's topics."""
        numbered = NumberedTree(tree)
        self._write("~/tree", String(data=tree_xml(numbered)), latched=True)
        self._tree_log = TreeLog(self._node, numbered, lambda message: self._write(TOPIC, message))
        self._tree_log.observe(engine)
        self._recorder.record_topics(self._node)

    def on_entry(self, entry: JournalEntry) -> None:
        """Record an entry of the run's journal."""
        if entry.kind in _ON_OTHER_TOPICS:
            return
        data: Mapping[str, object] = entry.data
        if entry.kind == RUN_BEGAN:
            data = {key: value for key, value in data.items() if key != "tree"}
        message = Log(
            level=Log.INFO, name=self._node.get_logger().name, msg=f"{entry.kind} {json_text(data)}"
        )
        message.stamp.sec, message.stamp.nanosec = divmod(int(entry.wall * 1e9), 10**9)
        self._write("mission_log", message)

    def on_end(self, *, has_begun: bool) -> None:
        """Record the last status changes and close the file; if the run has not started, delete the file."""
        try:
            if has_begun and self._tree_log is not None:
                self._tree_log.publish_result()
        finally:
            self._recorder.close(keep=has_begun)

    def _write(self, name: str, message: object, *, latched: bool = False) -> None:
        try:
            self._recorder.write(self._node.resolve_topic_name(name), message, latched=latched)
        except Exception as error:  # noqa: BLE001 - a failed recording must not end the mission
            self._node.get_logger().error(f"A message of {name} is not recorded: {error_text(error)}")
