"""Tests of recording a mission in an MCAP file, read back by an independent reader."""

import io
import re
import struct
import threading
import time
from contextlib import suppress
from typing import Any

import pytest

import sar_compiler
from sar_compiler import TreeRunner
from sar_compiler.journal.journal_entries import JournalEntry
from sar_compiler.leaves import Clock
from sar_compiler.testing import ManualClock
from tests.groot2.test_groot2 import Queue, main
from tests.launch.test_search_and_rescue_launch import FILE
from tests.trees import write
from tests.waiting import SILENCE_SEC

pytestmark = pytest.mark.ros


def read(path):
    """Return the messages of a recording by topic, decoded by the definitions in the file."""
    from rosbags.highlevel import AnyReader

    found: dict[str, list[Any]] = {}
    with AnyReader([path]) as reader:
        for connection, _, data in reader.messages():
            found.setdefault(connection.topic, []).append(reader.deserialize(data, connection.msgtype))
    return found


@pytest.fixture
def tree(tmp_path):
    path = tmp_path / "tree.xml"
    write(
        path,
        *main('<Sequence><Queue name="one" answers="S"/><Queue name="two" answers="S"/></Sequence>'),
        main="Main",
    )
    return sar_compiler.load(path, nodes=[Queue]).compile(context={Clock: ManualClock()})


@pytest.fixture
def record(ros, tree, tmp_path):
    """Return the recording of a tree, the tree's runner, and its node."""
    from sar_compiler.ros.mission_recording import MissionRecording

    node, runner = ros.node("mission", namespace="/robot1"), TreeRunner(tree)
    recording = MissionRecording(node, tmp_path / "run.mcap")
    recording.on_compiled(tree, runner)
    runner.setup(node=node)
    yield recording, runner, node
    runner.shutdown()


def test_tree_log_and_mission_log_are_read_back(record, tmp_path):
    recording, runner, _ = record
    runner.tick()
    recording.on_entry(JournalEntry(1, 1, 1e9 + 0.5, 0.0, "zone_visited", {"zone": "zone_a"}))
    for kind in ("status", "pose", "plan", "map", "log"):
        recording.on_entry(JournalEntry(1, 1, 1e9, 0.0, kind, {"x": 1.0}))
    recording.on_end(has_begun=True)
    found = read(tmp_path / "run.mcap")
    (tree,), (log,), (said,) = (
        found[f"/robot1/{name}"] for name in ("mission/tree", "behavior_tree_log", "mission_log")
    )
    assert 'name="two" _uid="3"' in tree.data
    assert [
        (each.uid, each.node_name, each.previous_status, each.current_status) for each in log.event_log
    ] == [
        (2, "one", "IDLE", "SUCCESS"),
        (3, "two", "IDLE", "SUCCESS"),
        (1, "Sequence", "IDLE", "SUCCESS"),
        (1, "Sequence", "SUCCESS", "IDLE"),
        (2, "one", "SUCCESS", "IDLE"),
        (3, "two", "SUCCESS", "IDLE"),
    ]
    assert (said.name, said.msg) == ("robot1.mission", 'zone_visited {"zone": "zone_a"}')
    assert (said.stamp.sec, said.stamp.nanosec) == (10**9, 5 * 10**8)


def test_mission_topics_are_recorded(record, ros, tmp_path):
    from geometry_msgs.msg import Twist, TwistStamped
    from nav2_msgs.action import NavigateToPose
    from sensor_msgs.msg import LaserScan

    recording, _, node = record
    feedback = NavigateToPose.Impl.FeedbackMessage()
    feedback.feedback.distance_remaining = 2.5
    sent = {
        "cmd_vel": Twist(),
        "scan": LaserScan(ranges=[1.0, 2.0]),
        "navigate_to_pose/_action/feedback": feedback,
    }
    sent["cmd_vel"].linear.x = 0.5
    publishers = {name: node.create_publisher(type(message), name, 10) for name, message in sent.items()}
    # Another node publishes another type on this name.
    node.create_publisher(TwistStamped, "plan", 10)
    ros.spin_until(lambda: all(each.get_subscription_count() for each in publishers.values()), "the recorder")
    for name, message in sent.items():
        publishers[name].publish(message)
    ros.spin_until(lambda: len(recording._recorder._channels) == 4, "the messages")
    assert node.get_subscriptions_info_by_topic("/robot1/plan") == []
    recording.on_end(has_begun=True)
    found = read(tmp_path / "run.mcap")
    assert found["/robot1/cmd_vel"][0].linear.x == 0.5
    assert list(found["/robot1/scan"][0].ranges) == [1.0, 2.0]
    assert found["/robot1/navigate_to_pose/_action/feedback"][0].feedback.distance_remaining == 2.5


def test_recorded_topics_keep_their_qos(record, ros, tmp_path):
    from nav_msgs.msg import OccupancyGrid
    from rclpy.qos import DurabilityPolicy, QoSProfile
    from rosbags.highlevel import AnyReader
    from rosbags.interfaces import QosDurability, QosReliability
    from sensor_msgs.msg import LaserScan

    recording, _, node = record
    latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    node.create_publisher(OccupancyGrid, "map", latched).publish(OccupancyGrid())
    scans = node.create_publisher(LaserScan, "scan", 10)
    ros.spin_until(scans.get_subscription_count, "the recorder")
    scans.publish(LaserScan())
    recording.on_entry(JournalEntry(1, 1, 1e9, 0.0, "zone_visited", {}))
    ros.spin_until(lambda: len(recording._recorder._channels) == 4, "the messages")
    recording.on_end(has_begun=True)
    with AnyReader([tmp_path / "run.mcap"]) as reader:
        connections: list[Any] = [*reader.connections]
        offered = {each.topic: each.ext.offered_qos_profiles for each in connections}
    assert {
        topic: [(each.durability, each.reliability) for each in profiles]
        for topic, profiles in offered.items()
    } == {
        "/robot1/map": [(QosDurability.TRANSIENT_LOCAL, QosReliability.RELIABLE)],
        "/robot1/mission/tree": [(QosDurability.TRANSIENT_LOCAL, QosReliability.RELIABLE)],
        "/robot1/scan": [(QosDurability.VOLATILE, QosReliability.RELIABLE)],
        "/robot1/mission_log": [],
    }


def test_failing_subscription_is_reported_and_other_topics_are_recorded(make_ros, ros, tmp_path):
    from geometry_msgs.msg import Twist, TwistStamped
    from sensor_msgs.msg import LaserScan

    from sar_compiler.ros.mission_recording import McapRecorder

    # A process cannot subscribe to a topic with a type other than the one that it publishes.
    node = ros.node("mission")
    node.create_publisher(Twist, "cmd_vel", 10)
    make_ros().node("other").create_publisher(TwistStamped, "cmd_vel", 10)
    scans = node.create_publisher(LaserScan, "scan", 10)
    ros.spin_until(lambda: node.count_publishers("cmd_vel") == 2, "the other process")
    complaints: list[str] = []
    recorder = McapRecorder.create(tmp_path / "run.mcap", complaints.append)
    recorder.record_topics(node)
    ros.spin_until(lambda: complaints and scans.get_subscription_count(), "the recorder")
    ros.spin_for(0.6)
    recorder.close()
    (complaint,) = complaints
    assert complaint.startswith("/cmd_vel is not recorded: RCLError: ")


def test_existing_file_is_not_overwritten(tmp_path):
    from sar_compiler.ros.mission_recording import McapRecorder, RecordingError

    path = tmp_path / "run.mcap"
    path.write_text("somebody's")
    with pytest.raises(RecordingError, match=re.escape(f"{path} already exists and is not overwritten")):
        McapRecorder.create(path, print)
    assert path.read_text() == "somebody's"


def test_empty_recording_leaves_no_file(tmp_path):
    from sar_compiler.ros.mission_recording import McapRecorder

    McapRecorder.create(tmp_path / "run.mcap", print).close()
    assert list(tmp_path.iterdir()) == []


def test_messages_are_on_disk_before_recording_ends(tmp_path):
    from mcap.exceptions import McapError
    from mcap.reader import NonSeekingReader
    from std_msgs.msg import String

    from sar_compiler.ros.mission_recording import McapRecorder

    path = tmp_path / "run.mcap"
    recorder = McapRecorder.create(path, print)
    recorder.write("/text", String(data="x"))
    found: list[str] = []
    deadline = time.monotonic() + SILENCE_SEC
    while not found:
        assert time.monotonic() < deadline
        with suppress(McapError, struct.error), path.open("rb") as file:
            for _, channel, _ in NonSeekingReader(file).iter_messages(log_time_order=False):
                found.append(channel.topic)
    assert found == ["/text"]
    recorder.close()


def test_run_that_never_began_leaves_no_file(ros, tree, tmp_path):
    from sar_compiler.ros.mission_recording import MissionRecording

    path = tmp_path / "run.mcap"
    recording = MissionRecording(ros.node("mission"), path)
    recording.on_compiled(tree, TreeRunner(tree))
    ros.spin_until(lambda: recording._recorder._channels, "the tree in the file")
    recording.on_end(has_begun=False)
    assert not path.exists()


def test_full_disk_ends_recording_and_is_reported(tmp_path):
    from std_msgs.msg import String

    from sar_compiler.ros.mission_recording import McapRecorder

    said: list[str] = []
    path = tmp_path / "run.mcap"
    path.symlink_to("/dev/full")
    recorder = McapRecorder(path, path.open("wb"), said.append)
    recorder.write("/text", String(data="x"))
    recorder.close()
    assert said == [
        f"The recording {path} cannot be written (No space left on device). The mission continues without it."
    ]


class Disk(io.BytesIO):
    """A file that blocks each write until `may` is set."""

    def __init__(self):
        super().__init__()
        self.may = threading.Event()

    def write(self, data):
        self.may.wait()
        return super().write(data)


@pytest.fixture
def disk():
    made = Disk()
    yield made
    made.may.set()


def test_slow_disk_ends_recording_before_memory_is_full(disk, tmp_path, monkeypatch):
    from std_msgs.msg import String

    from sar_compiler.ros import mission_recording

    monkeypatch.setattr(mission_recording, "_MOST_WAITING", 2 << 20)
    said: list[str] = []
    path = tmp_path / "run.mcap"
    recorder = mission_recording.McapRecorder(path, disk, said.append)
    for _ in range(10):
        recorder.write("/text", String(data="x" * (1 << 20)))
    assert recorder._waiting.qsize() == 2
    assert said == [
        f"The recording {path} cannot be written (the disk is too slow: 2 MiB are waiting to be written). The mission continues without it."
    ]


def test_blocked_disk_does_not_delay_end(disk, tmp_path, monkeypatch):
    from std_msgs.msg import String

    from sar_compiler.ros import mission_recording

    monkeypatch.setattr(mission_recording, "_PATIENCE_SEC", 0.01)
    said: list[str] = []
    path = tmp_path / "run.mcap"
    recorder = mission_recording.McapRecorder(path, disk, said.append)
    recorder.write("/text", String(data="x"))
    recorder.close()
    assert said == [f"The recording {path} is incomplete, because the disk does not accept more data."]


def test_definitions_of_recorded_messages_match_jazzy():
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    from sar_compiler.ros.leaves.leaf import interface_name
    from sar_compiler.ros.mission_recording import RECORDED, message_text

    jazzy = get_typestore(Stores.ROS2_JAZZY)
    for kinds in RECORDED.values():
        for kind in kinds:
            types = get_types_from_msg(message_text(kind), interface_name(kind))
            known = {name: fields for name, fields in types.items() if name in jazzy.fielddefs}
            assert all(fields[1] == jazzy.fielddefs[name][1] for name, fields in known.items()), kind


def test_launch_file_records_same_topics():
    from sar_compiler.ros.mission_recording import RECORDED

    launched = {*FILE.constant("RECORDED"), *FILE.constant("RECORDED_GLOBALLY")}  # type: ignore[misc]
    # A bag records these from their topics; the run writes them itself.
    launched -= {"behavior_tree_log", "search_and_rescue/tree"}
    named = {name.replace("~", "search_and_rescue").removeprefix("/") for name in RECORDED}
    assert named == {name.removeprefix("/") for name in launched}
