"""Tests of the mission publisher, as other ROS nodes see it."""

from types import SimpleNamespace
from typing import Any
from xml.etree import ElementTree as ET

import pytest

import sar_compiler
from sar_compiler import TreeRunner
from sar_compiler.journal.journal_entries import JournalEntry
from sar_compiler.leaves import Clock
from sar_compiler.style import rgb
from sar_compiler.testing import ManualClock
from tests.groot2.test_groot2 import Queue, main
from tests.trees import write

pytestmark = pytest.mark.ros

ZONE = {"kind": "zone", "name": "zone_a", "x": 1.0, "y": 2.0, "state": "visited", "level": 2}


class Witness:
    """Another node, which may subscribe late."""

    def __init__(self, ros):
        self._ros = ros
        self._node = ros.node("witness")
        self.seen: dict[str, list[Any]] = {}

    def listen(self, kind, topic, *, latched=False):
        from rclpy.qos import DurabilityPolicy, QoSProfile

        durability = DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE
        seen = self.seen[topic] = []
        self._node.create_subscription(kind, topic, seen.append, QoSProfile(depth=100, durability=durability))
        return seen

    def latched(self, kind, topic):
        """Subscribe late; return the latched message."""
        seen = self.listen(kind, topic, latched=True)
        self._ros.spin_until(lambda: seen, topic)
        return seen[-1]


@pytest.fixture
def witness(ros):
    return Witness(ros)


@pytest.fixture
def publish(ros, tmp_path):
    """Return a function that publishes a tree, and returns its runner and publisher."""
    from sar_compiler.ros.mission_publisher import MissionPublisher

    runners = []

    def begin(body):
        path = tmp_path / "tree.xml"
        write(path, *main(body), main="Main")
        tree = sar_compiler.load(path, nodes=[Queue]).compile(context={Clock: ManualClock()})
        node, runner = ros.node("mission", namespace="/robot1"), TreeRunner(tree)
        publisher = MissionPublisher(node)
        publisher.on_compiled(tree, runner)
        runner.setup(node=node)
        runners.append(runner)
        return runner, publisher

    yield begin
    for runner in runners:
        runner.shutdown()


def changes(message):
    return [
        (each.uid, each.node_name, each.previous_status, each.current_status) for each in message.event_log
    ]


def entry(kind, **data):
    return JournalEntry(1, 1, 0.0, 0.0, kind, data)


def test_tree_log_has_changes_of_each_tick_in_nav2_format(publish, witness, ros):
    from nav2_msgs.msg import BehaviorTreeLog

    log = witness.listen(BehaviorTreeLog, "/robot1/behavior_tree_log")
    runner, publisher = publish(
        '<Sequence name="both"><Queue name="one" answers="S"/><Queue name="two" answers="R"/></Sequence>'
    )
    ros.spin_until(publisher._changes.get_subscription_count, "the witness")
    runner.tick()
    ros.spin_until(lambda: log, "the log")
    assert changes(log[0]) == [
        (2, "one", "IDLE", "SUCCESS"),
        (3, "two", "IDLE", "RUNNING"),
        (1, "both", "IDLE", "RUNNING"),
    ]
    assert log[0].timestamp.sec > 0
    runner.tick()
    runner.shutdown()
    publisher.on_end(has_begun=True)
    ros.spin_until(lambda: len(log) == 2, "the end")
    assert changes(log[1]) == [
        (1, "both", "RUNNING", "IDLE"),
        (2, "one", "SUCCESS", "IDLE"),
        (3, "two", "RUNNING", "IDLE"),
    ]


def test_late_subscriber_receives_tree_and_state(publish, witness):
    from nav2_msgs.msg import BehaviorTreeLog
    from std_msgs.msg import String

    runner, _ = publish(
        '<Sequence name="both"><Queue name="one" answers="S"/><Queue name="two" answers="R"/></Sequence>'
    )
    runner.tick()
    root = ET.fromstring(witness.latched(String, "/robot1/mission/tree").data)  # noqa: S314 - our own document
    assert {each.get("name"): each.get("_uid") for each in root.iter() if each.get("_uid")} == {
        "both": "1",
        "one": "2",
        "two": "3",
    }
    state = witness.latched(BehaviorTreeLog, "/robot1/mission/tree_state")
    assert [(each.uid, each.current_status) for each in state.event_log] == [
        (1, "RUNNING"),
        (2, "SUCCESS"),
        (3, "RUNNING"),
    ]


@pytest.mark.parametrize(
    ("answers", "level", "words"), [("R", b"\x00", "one: under way"), ("F", b"\x02", "FAILURE")]
)
def test_diagnostics_show_current_leaf_and_failure(answers, level, words, publish, witness, ros):
    from diagnostic_msgs.msg import DiagnosticArray

    seen = witness.listen(DiagnosticArray, "/diagnostics")
    runner, publisher = publish(f'<Queue name="one" answers="{answers}"/>')
    publisher.on_entry(entry("changed", figures=[{"name": "zones visited", "value": 2, "of": 3}]))
    ros.spin_until(publisher._diagnostics.get_subscription_count, "the witness")
    runner.root.feedback_message = "under way"
    runner.tick()
    ros.spin_until(lambda: seen, "diagnostics")
    (status,) = seen[0].status
    assert (status.name, status.hardware_id) == ("mission: mission", "/robot1/mission")
    assert (status.level, status.message) == (level, words)
    values = {each.key: each.value for each in status.values}
    assert values == {
        "tree": "Main",
        "root": status.message if answers == "F" else "RUNNING",
        "ticks": "1",
        "zones visited": "2",
    }


def test_diagnostics_show_only_alarms_that_are_not_over(publish, witness, ros):
    from diagnostic_msgs.msg import DiagnosticArray

    seen = witness.listen(DiagnosticArray, "/diagnostics")
    runner, publisher = publish('<Queue answers="RRRR"/>')
    alarms = [{"text": "the battery is low"}, {"text": "no link", "is_over": True}]
    publisher.on_entry(entry("run_began", run={}))
    publisher.on_entry(entry("changed", alarms=alarms))
    ros.spin_until(publisher._diagnostics.get_subscription_count, "the witness")
    runner.tick()
    ros.spin_until(lambda: seen, "diagnostics")
    (status,) = seen[0].status
    assert (status.level, {each.key: each.value for each in status.values}["to do"]) == (
        b"\x02",
        "the battery is low",
    )


def test_markers_show_landmarks_and_plan(publish, witness):
    from visualization_msgs.msg import Marker, MarkerArray

    runner, publisher = publish('<Queue answers="R"/>')
    publisher.on_entry(entry("changed", landmarks=[ZONE]))
    publisher.on_entry(entry("plan", frame="map", points=[[0.0, 0.0], [1.0, 2.0], [float("nan"), 0.0]]))
    runner.tick()
    clear, form, text, plan = witness.latched(MarkerArray, "/robot1/mission/markers").markers
    assert clear.action == Marker.DELETEALL
    assert (form.ns, form.type, form.pose.position.x, form.pose.position.y) == (
        "zone",
        Marker.CYLINDER,
        1.0,
        2.0,
    )
    assert (text.ns, text.text) == ("zone_names", "zone_a\nvisited")
    for marker, colour in ((form, "success"), (plan, "plan")):
        assert (marker.color.r, marker.color.g, marker.color.b) == pytest.approx(rgb(colour))
    assert [(point.x, point.y) for point in plan.points] == [(0.0, 0.0), (1.0, 2.0)]
    assert {marker.header.frame_id for marker in (form, text, plan)} == {"map"}


def test_late_subscriber_receives_only_latest_markers(publish, witness, ros):
    from visualization_msgs.msg import MarkerArray

    runner, publisher = publish('<Queue answers="R"/>')
    for state in ("in progress", "visited"):
        publisher.on_entry(entry("changed", landmarks=[{**ZONE, "state": state}]))
        runner.tick()
    seen = witness.listen(MarkerArray, "/robot1/mission/markers", latched=True)
    ros.spin_until(lambda: seen, "the markers")
    assert [marker.text for marker in seen[0].markers if marker.text] == ["zone_a\nvisited"]


@pytest.mark.parametrize("points", [[], [[0.0, 0.0]], [[0.0, 0.0], [float("inf"), 0.0]]])
def test_plan_without_two_valid_points_has_no_marker(points, publish, witness):
    from visualization_msgs.msg import MarkerArray

    runner, publisher = publish('<Queue answers="R"/>')
    publisher.on_entry(entry("plan", frame="map", points=points))
    runner.tick()
    assert len(witness.latched(MarkerArray, "/robot1/mission/markers").markers) == 1


def test_area_is_shown_as_outline(publish, witness):
    from visualization_msgs.msg import Marker, MarkerArray

    runner, publisher = publish('<Queue answers="R"/>')
    corners = [[0.0, 0.0], [4.0, 0.0], [4.0, 4.0]]
    fence = {"kind": "geofence", "name": "geofence", "x": 0.0, "y": 0.0, "corners": corners}
    publisher.on_entry(entry("changed", landmarks=[fence]))
    runner.tick()
    _, outline = witness.latched(MarkerArray, "/robot1/mission/markers").markers
    assert (outline.ns, outline.type) == ("geofence", Marker.LINE_STRIP)
    assert [[point.x, point.y] for point in outline.points] == [*corners, corners[0]]


def test_markers_are_published_again_only_if_their_content_changed(publish, monkeypatch):
    runner, publisher = publish('<Queue answers="R"/>')
    published: list[object] = []
    monkeypatch.setattr(publisher, "_markers", SimpleNamespace(publish=published.append))
    for kind, times in (("pose", 1), ("status", 1), ("map", 1), ("changed", 2), ("log", 2), ("plan", 3)):
        publisher.on_entry(entry(kind))
        runner.tick()
        runner.tick()
        assert len(published) == times, kind


def test_end_waits_at_most_one_second_for_readers_of_last_messages(publish, monkeypatch):
    from rclpy.publisher import Publisher

    waited = {}

    def hanging(publisher, timeout):
        waited[publisher.topic_name] = timeout.nanoseconds / 1e9
        return False

    runner, publisher = publish("<Success/>")
    runner.tick()
    monkeypatch.setattr(Publisher, "wait_for_all_acked", hanging)
    publisher.on_end(has_begun=True)
    topics = {name.rpartition("/")[2] for name in waited}
    assert topics == {"behavior_tree_log", "tree_state", "markers"}
    assert all(0.0 <= seconds <= 1.0 for seconds in waited.values())


def test_mission_continues_if_publishing_fails(publish, said, monkeypatch):
    def broken():
        message = "no map"
        raise LookupError(message)

    runner, publisher = publish('<Queue answers="R"/>')
    monkeypatch.setattr(
        publisher._mission, "situation", SimpleNamespace(landmarks=SimpleNamespace(values=broken))
    )
    runner.tick()
    runner.tick()
    assert runner.count == 2
    assert sum("The mission's state is no longer published" in line for line in said.lines()) == 1
