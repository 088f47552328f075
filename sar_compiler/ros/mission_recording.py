"""Record a mission in an MCAP file as ROS 2 messages.

Readers need the definitions of the messages, which are derived from their Python classes.
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

# Names of types in the Python classes that differ from those in definitions.
_WORDS = {"boolean": "bool", "octet": "byte", "float": "float32", "double": "float64"}
_BETWEEN = f"{'=' * 80}\nMSG: "


def message_text(kind: Any) -> str:
    """Return the definition of a message and its nested messages in the format `ros2msg`."""
    inner: dict[str, Any] = {}
    parts = [_fields(kind, inner)]
    # The definitions written so far add more types to this list.
    seen: set[str] = set()
    while left := [name for name in inner if name not in seen]:
        for name in left:
            seen.add(name)
            parts.append(f"{_BETWEEN}{name}\n{_fields(inner[name], inner)}")
    return "".join(parts)


def _fields(kind: Any, inner: dict[str, Any]) -> str:
    """Return the lines of a message's fields, and collect the messages in it."""
    for slot in kind.SLOT_TYPES:
        slot = getattr(slot, "value_type", slot)  # noqa: PLW2901 - of an array, what it has in it
        if hasattr(slot, "namespaces"):
            # The parts of an action are in the same module.
            beside, there = (import_module(name) for name in (kind.__module__, ".".join(slot.namespaces)))
            found = getattr(there, slot.name, None) or getattr(beside, slot.name)
            inner.setdefault(f"{slot.namespaces[0]}/{slot.name}", found)
    return "".join(
        f"{_field_type(text)} {name}\n" for name, text in kind.get_fields_and_field_types().items()
    )


def _field_type(text: str) -> str:
    """Return the type of a field as in a definition: `float64[36]`, `string[<=10]`, `geometry_msgs/Pose[]`."""
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


# Relative names, as a node uses them; its remappings change absolute names, too.
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
"""The topics of a mission with their types. If there are several, the publisher decides."""

_LATCHED = ("/tf_static", "map", "amcl_pose", "navigate_to_pose/_action/status", "~/markers")
_UNRELIABLE = ("scan", "/clock", "odometry/filtered", "battery_state")
_DEPTH = 100
# Interval between checks for new topics, seconds of the steady clock.
_LOOK_SEC = 0.5
# Interval between writes to the disk, seconds of the steady clock. A process that is killed may lose this much.
_FLUSH_SEC = 1.0
# Limits of the queue: its size in bytes, and the seconds without any write after which the end gives up the file.
_MOST_WAITING = 256 << 20
_PATIENCE_SEC = 10.0


class RecordingError(SarError):
    """A file cannot be used for a recording."""


def _type_to_record(name: str, types: Iterable[str]) -> Any:
    """Return the type of a recorded topic; None if it is not recorded, or has an unexpected type."""
    return next((kind for kind in RECORDED.get(name, ()) if interface_name(kind) in types), None)


def _as_yaml(profiles: Iterable[QoSProfile]) -> str:
    """Return quality-of-service profiles in rosbag2's YAML format."""
    policies = ("history", "depth", "reliability", "durability", "liveliness")
    times = ("deadline", "lifespan", "liveliness_lease_duration")
    written = []
    for profile in profiles:
        of_profile: dict[str, object] = {name: int(getattr(profile, name)) for name in policies}
        for name in times:
            seconds, nanoseconds = divmod(getattr(profile, name).nanoseconds, 10**9)
            of_profile[name] = {"sec": seconds, "nsec": nanoseconds}
        of_profile["avoid_ros_namespace_conventions"] = profile.avoid_ros_namespace_conventions
        written.append(of_profile)
    return json.dumps(written)


class _Recorded(NamedTuple):
    topic: str
    kind: Any
    data: bytes
    time_ns: int


class McapRecorder:
    """Writes messages from a background thread, so that a slow disk never delays a tick.

    Messages are stamped with their arrival by the machine's clock, as in rosbag2.

    Args:
        path: The name of the file.
        file: The file, open and empty.
        complain: Called with a text, from any thread, if something cannot be recorded. The mission continues.
    """

    def __init__(self, path: Path, file: IO[bytes], complain: Callable[[str], object]) -> None:
        self._path, self._file, self._complain = path, file, complain
        self._waiting: SimpleQueue[_Recorded | None] = SimpleQueue()
        # In bytes; each counter is changed by one thread only.
        self._put_in = self._written = 0
        self._is_broken = False
        self._channels: dict[str, int] = {}
        self._schemas: dict[str, int] = {}
        # The profiles of a topic's publishers, collected before its first message enters the queue.
        self._offers: dict[str, str] = {}
        self._thread = Thread(target=self._write_queued, name="recorder", daemon=True)
        self._thread.start()

    @classmethod
    def create(cls, path: Path, complain: Callable[[str], object]) -> "McapRecorder":
        """Create a file, and return its writer.

        Raises:
            RecordingError: If the file exists, or cannot be created.
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
        """Record a mission's topics, each as soon as it appears with a known type."""
        left = {node.resolve_topic_name(name): name for name in RECORDED}

        def subscribe_new_topics() -> None:
            for topic, types in node.get_topic_names_and_types():
                kind = _type_to_record(left.get(topic, ""), types)
                if kind is None:
                    continue
                try:
                    self._listen_to(node, topic, left.pop(topic), kind)
                except Exception as error:  # noqa: BLE001 - such as of another type than this process publishes there
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
        # Queried with the first message, because a topic also exists if it only has subscribers.
        try:
            return _as_yaml(each.qos_profile for each in node.get_publishers_info_by_topic(topic))
        except Exception as error:  # noqa: BLE001 - the message itself is recorded
            self._complain(f"The quality of service of {topic} is not recorded: {error_text(error)}")
            return _as_yaml([])

    def write(self, topic: str, message: Any, *, latched: bool = False) -> None:
        """Record a message.

        Args:
            topic: The full name of its topic.
            message: The message.
            latched: Whether late subscribers receive it, too, when it is played back.
        """
        if latched:
            self._offers.setdefault(
                topic, _as_yaml([QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)])
            )
        self._enqueue(_Recorded(topic, type(message), serialize_message(message), time.time_ns()))

    def _enqueue(self, recorded: _Recorded) -> None:
        if self._is_broken:
            return
        if self._put_in - self._written > _MOST_WAITING:
            self._give_up(f"{_MOST_WAITING >> 20} MiB are waiting because the disk is too slow")
            return
        self._put_in += len(recorded.data)
        self._waiting.put(recorded)

    def close(self, *, keep: bool = True) -> None:
        """Write the rest of the queue, and close the file.

        Args:
            keep: Whether to keep it. An empty recording is removed in any case.
        """
        self._waiting.put(None)
        written = -1
        while self._thread.is_alive() and written != self._written:
            written = self._written
            self._thread.join(_PATIENCE_SEC)
        if self._thread.is_alive():
            self._complain(f"{self._path} is incomplete: the disk accepts no data.")
            return
        if not (keep and self._channels):
            self._path.unlink(missing_ok=True)

    def _write_queued(self) -> None:
        try:
            with self._file:
                writer = Writer(self._file)
                writer.start(profile="ros2", library="sar_compiler")
                self._write_what_comes(writer)
                writer.finish()  # type: ignore[no-untyped-call]
        except Exception as error:  # noqa: BLE001 - whatever it is, the mission goes on
            self._give_up((error.strerror if isinstance(error, OSError) else None) or repr(error))

    def _give_up(self, reason: str) -> None:
        self._is_broken = True
        self._complain(
            f"{self._path} cannot be written ({reason}). The mission continues without a recording."
        )

    def _write_what_comes(self, writer: Writer) -> None:
        """Write until the queue is closed and empty."""
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
            # At least the empty list: rosbag2 cannot read an empty string.
            metadata = {"offered_qos_profiles": self._offers.get(topic, _as_yaml([]))}
            self._channels[topic] = writer.register_channel(topic, "cdr", self._schemas[name], metadata)
        writer.add_message(self._channels[topic], time_ns, data, time_ns)
        self._written += len(data)


# Other topics of the recording have the content of these entries.
_ELSEWHERE = (STATUS, *OF_ROBOT)


class MissionRecording(RunExtension):
    """Records a mission in an MCAP file, even if the mission publishes nothing.

    In addition to the topics of `ros.mission_recording.RECORDED` it records `behavior_tree_log` and `~/tree` as in
    `ros.mission_publisher`, and `mission_log` (`rcl_interfaces/msg/Log`): the other entries of the run's journal.

    Args:
        node: The mission's node.
        path: The file to create.

    Raises:
        RecordingError: If the file exists, or cannot be created.
    """

    def __init__(self, node: Node, path: Path) -> None:
        self._node = node
        self._recorder = McapRecorder.create(path, node.get_logger().error)
        self._tree_log: TreeLog | None = None

    def on_compiled(self, tree: CompiledTree, engine: Engine) -> None:
        """Start recording a tree and the engine that ticks it."""
        numbered = NumberedTree(tree)
        self._write("~/tree", String(data=tree_xml(numbered)), latched=True)
        self._tree_log = TreeLog(self._node, numbered, lambda message: self._write(TOPIC, message))
        self._tree_log.observe(engine)
        self._recorder.record_topics(self._node)

    def on_entry(self, entry: JournalEntry) -> None:
        """Record an entry of the run's journal."""
        if entry.kind in _ELSEWHERE:
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
        """Record the result and close the file; if the run never started, remove the file."""
        try:
            if has_begun and self._tree_log is not None:
                self._tree_log.publish_result()
        finally:
            self._recorder.close(keep=has_begun)

    def _write(self, name: str, message: object, *, latched: bool = False) -> None:
        try:
            self._recorder.write(self._node.resolve_topic_name(name), message, latched=latched)
        except Exception as error:  # noqa: BLE001 - what cannot be written is no reason to stop the mission
            self._node.get_logger().error(f"A message of {name} is not recorded: {error_text(error)}")
