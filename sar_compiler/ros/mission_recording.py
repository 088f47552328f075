"""A mission in one MCAP file, with the messages of ROS 2: its topics, its tree's log, and its own.

Readers know messages by their definitions, which are read off their Python classes.
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
from sar_compiler.ros.clock import steady_timer
from sar_compiler.ros.engine import Engine, error_text
from sar_compiler.ros.leaves.leaf import interface_name
from sar_compiler.ros.mission_publisher import TOPIC, TreeLog
from sar_compiler.ros.run_extension import RunExtension
from sar_compiler.tree.json_values import json_text
from sar_compiler.views.numbered_tree import NumberedTree, tree_xml

# What a class calls a type, where a definition has another word.
_WORDS = {"boolean": "bool", "octet": "byte", "float": "float32", "double": "float64"}
_BETWEEN = f"{'=' * 80}\nMSG: "


def message_text(kind: Any) -> str:
    """Return the definition of a message in the form `ros2msg`, with those of all messages in it."""
    inner: dict[str, Any] = {}
    parts = [_fields(kind, inner)]
    # More of them come to light in those that are written down.
    seen: set[str] = set()
    while left := [name for name in inner if name not in seen]:
        for name in left:
            seen.add(name)
            parts.append(f"{_BETWEEN}{name}\n{_fields(inner[name], inner)}")
    return "".join(parts)


def _fields(kind: Any, inner: dict[str, Any]) -> str:
    """Return the lines of a message's fields, and note the messages in it."""
    for slot in kind.SLOT_TYPES:
        slot = getattr(slot, "value_type", slot)  # noqa: PLW2901 - of an array, what it has in it
        if hasattr(slot, "namespaces"):
            # The parts of an action are beside it.
            beside, there = (import_module(name) for name in (kind.__module__, ".".join(slot.namespaces)))
            found = getattr(there, slot.name, None) or getattr(beside, slot.name)
            inner.setdefault(f"{slot.namespaces[0]}/{slot.name}", found)
    return "".join(
        f"{_field_type(text)} {name}\n" for name, text in kind.get_fields_and_field_types().items()
    )


def _field_type(text: str) -> str:
    """Return a field's type as a definition has it: `float64[36]`, `string[<=10]`, `geometry_msgs/Pose[]`."""
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


# The names are what a node calls them; absolute ones move with its remappings only.
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
"""The topics of a mission, with their types; where there are several, what publishes decides."""

_LATCHED = ("/tf_static", "map", "amcl_pose", "navigate_to_pose/_action/status", "~/markers")
_UNRELIABLE = ("scan", "/clock", "odometry/filtered", "battery_state")
_DEPTH = 100
# How often it is looked which topics there are, in seconds of the steady clock.
_LOOK_SEC = 0.5
# How often what has come is handed over to the disk, in seconds of the steady clock: what a process that is killed may lose.
_FLUSH_SEC = 1.0
# What may wait to be written, in bytes; and how long nothing at all may be written before the file is given up at the end, in seconds.
_MOST_WAITING = 256 << 20
_PATIENCE_SEC = 10.0


class RecordingError(SarError):
    """A file that cannot be recorded into."""


def _type_to_record(name: str, types: Iterable[str]) -> Any:
    """Return the type of a topic that is to be recorded; None if it is not, or of another type than it should be."""
    return next((kind for kind in RECORDED.get(name, ()) if interface_name(kind) in types), None)


def _as_yaml(profiles: Iterable[QoSProfile]) -> str:
    """Return profiles as rosbag2 keeps them, by which it plays: YAML, with the numbers that its versions all read."""
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

    Messages have the time at which they came, by the machine's clock, as in rosbag2.

    Args:
        path: The name of the file.
        file: The file, open and empty.
        complain: Told in words, from any thread, what cannot be recorded; the mission goes on.
    """

    def __init__(self, path: Path, file: IO[bytes], complain: Callable[[str], object]) -> None:
        self._path, self._file, self._complain = path, file, complain
        self._waiting: SimpleQueue[_Recorded | None] = SimpleQueue()
        # In bytes; each is counted by one thread alone.
        self._put_in = self._written = 0
        self._is_broken = False
        self._channels: dict[str, int] = {}
        self._schemas: dict[str, int] = {}
        # The profiles that a topic is published with, from before its first message is put into the queue.
        self._offers: dict[str, str] = {}
        self._thread = Thread(target=self._work, name="recorder", daemon=True)
        self._thread.start()

    @classmethod
    def create(cls, path: Path, complain: Callable[[str], object]) -> "McapRecorder":
        """Make a file, and return what writes into it.

        Raises:
            RecordingError: If there is such a file, or it cannot be made.
        """
        try:
            file = path.open("xb")
        except FileExistsError as error:
            message = f"{path} is there already, and is not written over: name another one"
            raise RecordingError(message) from error
        except OSError as error:
            raise RecordingError(f"{path} cannot be made: {error.strerror}") from error
        return cls(path, file, complain)

    def listen(self, node: Node) -> None:
        """Record the topics of a mission, as they are called by its node, from when they are there with a type known."""
        left = {node.resolve_topic_name(name): name for name in RECORDED}

        def look() -> None:
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

        timer = steady_timer(node, _LOOK_SEC, look)

    def _listen_to(self, node: Node, topic: str, name: str, kind: Any) -> None:
        latched = DurabilityPolicy.TRANSIENT_LOCAL if name in _LATCHED else DurabilityPolicy.VOLATILE
        reliable = ReliabilityPolicy.BEST_EFFORT if name in _UNRELIABLE else ReliabilityPolicy.RELIABLE
        qos = QoSProfile(depth=_DEPTH, durability=latched, reliability=reliable)

        def take(data: bytes) -> None:
            if topic not in self._offers:
                self._offers[topic] = self._offers_in(node, topic)
            self._put(_Recorded(topic, kind, data, time.time_ns()))

        node.create_subscription(kind, topic, take, qos, raw=True)

    def _offers_in(self, node: Node, topic: str) -> str:
        # Asked with the first message: a topic is there already when only somebody listens to it.
        try:
            return _as_yaml(each.qos_profile for each in node.get_publishers_info_by_topic(topic))
        except Exception as error:  # noqa: BLE001 - the message itself is recorded
            self._complain(f"How {topic} is published is not recorded: {error_text(error)}")
            return _as_yaml([])

    def write(self, topic: str, message: Any, *, latched: bool = False) -> None:
        """Record a message.

        Args:
            topic: The full name of its topic.
            message: The message.
            latched: Whether who comes late has it as well, when it is played.
        """
        if latched:
            self._offers.setdefault(
                topic, _as_yaml([QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)])
            )
        self._put(_Recorded(topic, type(message), serialize_message(message), time.time_ns()))

    def _put(self, recorded: _Recorded) -> None:
        if self._is_broken:
            return
        if self._put_in - self._written > _MOST_WAITING:
            self._give_up(f"{_MOST_WAITING >> 20} MiB wait for a disk that is too slow")
            return
        self._put_in += len(recorded.data)
        self._waiting.put(recorded)

    def close(self, *, keep: bool = True) -> None:
        """Write what is left to be written, and close the file.

        Args:
            keep: Whether to keep it; one in which nothing was recorded is removed all the same.
        """
        self._waiting.put(None)
        written = -1
        while self._thread.is_alive() and written != self._written:
            written = self._written
            self._thread.join(_PATIENCE_SEC)
        if self._thread.is_alive():
            self._complain(f"{self._path} is left without its end: the disk takes nothing.")
            return
        if not (keep and self._channels):
            self._path.unlink(missing_ok=True)

    def _work(self) -> None:
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
        self._complain(f"{self._path} cannot be written any more ({reason}): the mission goes on unrecorded.")

    def _write_what_comes(self, writer: Writer) -> None:
        """Write until there is nothing more to come."""
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
            # At least the empty list: rosbag2 cannot read the empty text.
            metadata = {"offered_qos_profiles": self._offers.get(topic, _as_yaml([]))}
            self._channels[topic] = writer.register_channel(topic, "cdr", self._schemas[name], metadata)
        writer.add_message(self._channels[topic], time_ns, data, time_ns)
        self._written += len(data)


# What is in other topics of the recording.
_ELSEWHERE = (STATUS, *OF_ROBOT)


class MissionRecording(RunExtension):
    """Records a mission in an MCAP file, whether or not anything of it is published.

    Beside the topics of `ros.mission_recording.RECORDED`: `behavior_tree_log`, `~/tree` as `ros.mission_publisher` has them, and
    `mission_log` (`rcl_interfaces/msg/Log`), what the run's journal is told, but for what other topics have.

    Args:
        node: The mission's node.
        path: The file, which is made.

    Raises:
        RecordingError: If there is such a file, or it cannot be made.
    """

    def __init__(self, node: Node, path: Path) -> None:
        self._node = node
        self._recorder = McapRecorder.create(path, node.get_logger().error)
        self._tree_log: TreeLog | None = None

    def on_compiled(self, tree: CompiledTree, engine: Engine) -> None:
        """Begin to record a tree, and what ticks it."""
        numbered = NumberedTree(tree)
        self._write("~/tree", String(data=tree_xml(numbered)), latched=True)
        self._tree_log = TreeLog(self._node, numbered, lambda message: self._write(TOPIC, message))
        self._tree_log.watch(engine)
        self._recorder.listen(self._node)

    def on_entry(self, entry: JournalEntry) -> None:
        """Take an entry of the run's journal."""
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
        """Record how it has ended, and close the file; that of a run that never began is removed, so that the next try finds none."""
        try:
            if has_begun and self._tree_log is not None:
                self._tree_log.end()
        finally:
            self._recorder.close(keep=has_begun)

    def _write(self, name: str, message: object, *, latched: bool = False) -> None:
        try:
            self._recorder.write(self._node.resolve_topic_name(name), message, latched=latched)
        except Exception as error:  # noqa: BLE001 - what cannot be written is no reason to stop the mission
            self._node.get_logger().error(f"A message of {name} is not recorded: {error_text(error)}")
