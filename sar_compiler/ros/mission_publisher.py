"""Publish a mission on ROS topics: the log and state of its tree (in Nav2's messages), diagnostics and markers."""

import math
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import Point
from nav2_msgs.msg import BehaviorTreeLog, BehaviorTreeStatusChange
from py_trees.common import Status
from py_trees.trees import BehaviourTree
from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import ColorRGBA, String
from visualization_msgs.msg import Marker, MarkerArray

from sar_compiler.compiler import CompiledTree
from sar_compiler.journal.display import DisplayState, Landmark
from sar_compiler.journal.journal_entries import CHANGED, LOG, PLAN, STATUS, JournalEntry
from sar_compiler.journal.mission_state import MissionState
from sar_compiler.journal.open_tasks import find_open_tasks
from sar_compiler.journal.status_line import ERROR
from sar_compiler.ros.engine import Engine, error_text
from sar_compiler.ros.run_extension import RunExtension
from sar_compiler.runtime.kernel.cells import RUNNING, WORDS
from sar_compiler.style import colour_of, rgb
from sar_compiler.views.numbered_tree import NumberedTree, StatusChange, StatusChanges, tree_xml

TOPIC = "behavior_tree_log"


class TreeLog:
    """Converts the status changes of each tick to a message.

    Args:
        node: The node whose clock sets the time stamps of the messages.
        tree: The tree with numbered nodes.
        tell: Called with each message, in the thread that ticks the tree.

    Attributes:
        statuses: The status of each node, indexed by node number.
    """

    def __init__(self, node: Node, tree: NumberedTree, tell: Callable[[BehaviorTreeLog], object]) -> None:
        self._node, self._tree, self._tell = node, tree, tell
        self._events: list[BehaviorTreeStatusChange] = []
        self._changes = StatusChanges(tree, lambda change: self._events.append(self._event(change)))
        self.statuses = self._changes.statuses

    def observe(self, engine: Engine) -> None:
        """Observe the engine that ticks the tree."""
        engine.add_visitor(self._changes)
        engine.add_post_tick_handler(lambda _: self._publish_events())

    def publish_result(self) -> None:
        """Publish the status changes that the last tick and the end of the run have caused."""
        self._changes.finalise()
        self._publish_events()

    def state(self) -> BehaviorTreeLog:
        """Return a message with the current status of every node."""
        events = [self._event(StatusChange(uid, now, now)) for uid, now in enumerate(self.statuses) if uid]
        return BehaviorTreeLog(timestamp=self._now(), event_log=events)

    def _event(self, change: StatusChange) -> BehaviorTreeStatusChange:
        seconds, nanoseconds = divmod(time.time_ns(), 10**9)
        return BehaviorTreeStatusChange(
            timestamp=Time(sec=seconds, nanosec=nanoseconds),
            node_name=self._tree.nodes[change.uid - 1].name,
            uid=change.uid,
            previous_status=WORDS[change.before] or "IDLE",
            current_status=WORDS[change.status] or "IDLE",
        )

    def _publish_events(self) -> None:
        if self._events:
            events, self._events = self._events, []
            self._tell(BehaviorTreeLog(timestamp=self._now(), event_log=events))

    def _now(self) -> Time:
        return self._node.get_clock().now().to_msg()


# Minimum interval between two messages of the diagnostics, and of the tree's state, in seconds of the steady clock.
_PERIOD_SEC = 1.0
# Maximum total wait until the subscribers have received the last messages, in seconds.
_LAST_MESSAGES_SEC = 1.0
_LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
# The type and diameter (in metres) of a marker, by the shape of the landmark.
_FORMS = {
    "circle": (Marker.CYLINDER, 1.0),
    "triangle": (Marker.SPHERE, 0.5),
    "house": (Marker.CUBE, 0.5),
    "square": (Marker.CUBE, 0.5),
}


class MissionPublisher(RunExtension):
    """Publishes the progress of a mission in the thread that ticks the tree.

    - `behavior_tree_log` (`nav2_msgs/msg/BehaviorTreeLog`): the status changes of each tick, with the node numbers that Groot2 uses
    - `~/tree` (`std_msgs/msg/String`, latched): the tree in XML, with these node numbers
    - `~/tree_state` (`nav2_msgs/msg/BehaviorTreeLog`, latched): the status of every node, at most once a second
    - `/diagnostics` (`diagnostic_msgs/msg/DiagnosticArray`): once a second while the tree is ticked
    - `~/markers` (`visualization_msgs/msg/MarkerArray`, latched): the landmarks in the frame `map`, and Nav2's plan

    Args:
        node: The mission's node.
    """

    def __init__(self, node: Node) -> None:
        self._node = node
        self._mission = MissionState()
        self._is_broken = False
        self._is_state_known = self._are_markers_known = False
        self._plan: Mapping[str, Any] = {}
        self._due = 0.0
        self._changes = node.create_publisher(BehaviorTreeLog, TOPIC, 10)
        self._state = node.create_publisher(BehaviorTreeLog, "~/tree_state", _LATCHED)
        self._markers = node.create_publisher(MarkerArray, "~/markers", _LATCHED)
        self._diagnostics = node.create_publisher(DiagnosticArray, "/diagnostics", 10)
        self._xml = node.create_publisher(String, "~/tree", _LATCHED)

    def on_compiled(self, tree: CompiledTree, engine: Engine) -> None:
        """Publish the tree, and observe the engine that ticks it."""
        self._tree = NumberedTree(tree)
        self._log = TreeLog(self._node, self._tree, self._publish_changes)
        self._xml.publish(String(data=tree_xml(self._tree)))
        self._log.observe(engine)
        engine.add_post_tick_handler(self._after_tick)

    def on_entry(self, entry: JournalEntry) -> None:
        """Apply an entry of the run's journal to the state that is published next."""
        if entry.kind in (STATUS, LOG):
            return
        self._mission.apply(entry)
        # Events and positions are not published, and would accumulate.
        self._mission.facts.clear()
        self._mission.trail.clear()
        if entry.kind == PLAN:
            self._plan = entry.data
        if entry.kind in (PLAN, CHANGED):
            self._are_markers_known = False

    @property
    def _situation(self) -> DisplayState:
        return self._mission.situation

    def on_end(self, *, has_begun: bool) -> None:
        """Publish the final state if the run has started."""
        if has_begun:
            self._log.publish_result()
            self._try(self._publish_state)
            self._try(self._publish_markers)
            self._try(self._wait_for_readers)

    def _publish_changes(self, message: BehaviorTreeLog) -> None:
        self._is_state_known = False
        self._try(lambda: self._changes.publish(message))

    def _after_tick(self, tree: BehaviourTree) -> None:
        if not self._are_markers_known:
            self._try(self._publish_markers)
        now = time.monotonic()
        if now >= self._due:
            self._due = now + _PERIOD_SEC
            self._try(lambda: self._diagnose(tree))
            if not self._is_state_known:
                self._try(self._publish_state)

    def _try(self, publish: Callable[[], object]) -> None:
        """Call a function that publishes a message. If it fails, log the error and stop publishing; the mission continues."""
        if self._is_broken:
            return
        try:
            publish()
        except Exception as error:  # noqa: BLE001
            self._is_broken = True
            self._node.get_logger().error(f"The mission's state is no longer published: {error_text(error)}")

    def _publish_state(self) -> None:
        self._is_state_known = True
        self._state.publish(self._log.state())

    def _wait_for_readers(self) -> None:
        """Wait briefly until reliable subscribers have received the last messages."""
        deadline = time.monotonic() + _LAST_MESSAGES_SEC
        for publisher in (self._changes, self._state, self._markers):
            publisher.wait_for_all_acked(Duration(seconds=max(0.0, deadline - time.monotonic())))

    def _diagnose(self, tree: BehaviourTree) -> None:
        running = [node for node in self._tree.nodes if self._log.statuses[node.uid] == RUNNING]
        inner = {node.parent for node in running}
        leaves = [node.behaviour for node in running if node.uid not in inner]
        doing = "; ".join(f"{each.name}: {each.feedback_message}".rstrip(": ") for each in leaves)
        failed = tree.root.status is Status.FAILURE
        tasks = find_open_tasks(self._mission)
        is_error = any(task.level == ERROR for task in tasks)
        level = (
            DiagnosticStatus.ERROR if is_error else DiagnosticStatus.WARN if tasks else DiagnosticStatus.OK
        )
        values = {
            "tree": self._tree.name,
            "root": tree.root.status.value,
            "ticks": tree.count + 1,
            **{each.name: f"{each.value:g}" for each in self._situation.figures.values()},
            **({"to do": "; ".join(task.text for task in tasks)} if tasks else {}),
        }
        status = DiagnosticStatus(
            level=DiagnosticStatus.ERROR if failed else level,
            name=f"{self._node.get_name()}: mission",
            message=doing or str(tree.root.status.value),
            hardware_id=self._node.get_fully_qualified_name(),
            values=[KeyValue(key=name, value=str(value)) for name, value in values.items()],
        )
        message = DiagnosticArray(status=[status])
        message.header.stamp = self._now()
        self._diagnostics.publish(message)

    def _publish_markers(self) -> None:
        self._are_markers_known = True
        made = [Marker(action=Marker.DELETEALL)]
        for number, landmark in enumerate(self._situation.landmarks.values()):
            kind = self._situation.kind_of(landmark)
            colour = _colour(colour_of(landmark.level, is_found=kind.is_found))
            if landmark.corners:
                made.append(_strip(landmark.kind, number, colour, (*landmark.corners, landmark.corners[0])))
            else:
                made += _shape(number, landmark, kind.shape, colour)
        made += _line(self._plan)
        for marker in made:
            marker.header.stamp = self._now()
            marker.header.frame_id = marker.header.frame_id or "map"
        self._markers.publish(MarkerArray(markers=made))

    def _now(self) -> Time:
        return self._node.get_clock().now().to_msg()


def _colour(name: str) -> ColorRGBA:
    red, green, blue = rgb(name)
    return ColorRGBA(r=red, g=green, b=blue, a=0.8)


def _strip(kind: str, number: int, colour: ColorRGBA, points: Iterable[Sequence[float]]) -> Marker:
    """Create the marker of a line through positions (x and y in metres)."""
    marker = Marker(ns=kind, id=number, type=Marker.LINE_STRIP, color=colour)
    marker.scale.x, marker.pose.orientation.w = 0.05, 1.0
    marker.points = [Point(x=float(x), y=float(y), z=0.05) for x, y in points]
    return marker


def _shape(number: int, landmark: Landmark, shape: str, colour: ColorRGBA) -> list[Marker]:
    """Create the marker of a landmark, and a marker with the landmark's name and state above it."""
    kind, size = _FORMS.get(shape, _FORMS["circle"])
    form = Marker(ns=landmark.kind, id=number, type=kind, color=colour)
    form.scale.x = form.scale.y = size
    # A circle is flat, so that a robot on it is visible.
    form.scale.z = 0.05 if kind == Marker.CYLINDER else size
    words = f"{landmark.name}\n{landmark.state}".rstrip()
    text = Marker(ns=f"{landmark.kind}_names", id=number, type=Marker.TEXT_VIEW_FACING, text=words)
    text.color, text.scale.z = _colour("ground"), 0.3
    for marker, height in ((form, form.scale.z / 2.0), (text, size + 0.4)):
        marker.pose.position = Point(x=float(landmark.x), y=float(landmark.y), z=height)
        marker.pose.orientation.w = 1.0
    return [form, text]


def _line(plan: Mapping[str, Any]) -> list[Marker]:
    """Create the marker of a plan, or no marker if the plan has fewer than two points.

    For a marker with fewer points, RViz reports an error.
    """
    points = [point for point in plan.get("points", ()) if all(map(math.isfinite, point))]
    marker = _strip("plan", 0, _colour("plan"), points)
    marker.header.frame_id = str(plan.get("frame", ""))
    return [marker] if len(points) > 1 else []
