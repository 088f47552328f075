"""Tests of observers of `sar-run`: Groot2, recordings and published states."""

import signal
import subprocess
import sys
from contextlib import closing

import pytest

from tests.cli.test_missing_libraries import run_without
from tests.groot2.groot2_client import Client
from tests.processes import free_port
from tests.trees import document

pytestmark = pytest.mark.ros

# The tree needs no server, and never ends.
WAITING = document('<Sequence name="Wait"><Sleep msec="1000000"/></Sequence>')
IDLE, RUNNING = 0, 1


@pytest.fixture
def tree(tmp_path):
    path = tmp_path / "tree.xml"
    path.write_text(WAITING, encoding="utf-8")
    return path


def test_groot2_client_receives_state_of_mission(start, tree):
    port = free_port()
    run = start("sar-run", tree, "--view", "text", "--groot2", port).wait_for("Wait RUNNING")
    with closing(Client(port)) as client:
        client.see({1: RUNNING, 2: RUNNING})
        assert client.ask("D") == [b"[]"]
    run.stop()


def test_port_in_use_ends_run_before_start(start, tree):
    port = free_port()
    start("sar-run", tree, "--view", "text", "--groot2", port).wait_for("Wait RUNNING")
    second = start("sar-run", tree, "--groot2", port)
    assert second.end() == 2
    assert f"sar-run: --groot2: port {port} of 127.0.0.1 cannot be used" in second.output


@pytest.mark.parametrize("library", ["zmq", "msgpack"])
def test_missing_groot2_library_is_reported_with_extra(library, tree):
    status, said = run_without(library, "sar_compiler.cli.run:main", str(tree), "--groot2", "1667")
    assert (status, "Traceback" in said) == (2, False), said
    assert f"sar-run: --groot2 needs a library that is missing (import of {library}" in said
    assert "pip install 'sar_compiler[groot2]'" in said


def test_run_is_recorded_from_start_to_end(start, tree, tmp_path):
    from tests.ros.test_mission_recording import read

    file = tmp_path / "run.mcap"
    start("sar-run", tree, "--view", "text", "--record", file).wait_for("Wait RUNNING").stop()
    found = read(file)
    assert [message.msg.partition(" ")[0] for message in found["/mission_log"]] == ["run_began", "run_ended"]
    assert [event.current_status for event in found["/behavior_tree_log"][-1].event_log] == ["IDLE", "IDLE"]
    again = start("sar-run", tree, "--record", file)
    assert again.end() == 2
    assert f"sar-run: --record: {file} already exists and is not overwritten" in again.output


def test_recording_must_have_mcap_file_name(tree):
    status, said = run_without("nothing", "sar_compiler.cli.run:main", str(tree), "--record", "out/run.bag")
    assert status == 2
    assert "--record writes an MCAP file, whose name must end with .mcap, such as out/run.mcap" in said


def test_mission_is_published_until_its_end(start, tree, ros):
    from nav2_msgs.msg import BehaviorTreeLog
    from rclpy.qos import DurabilityPolicy, QoSProfile

    seen: list[BehaviorTreeLog] = []
    latched = QoSProfile(depth=10, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    node = ros.node("witness")
    node.create_subscription(BehaviorTreeLog, "/mission/tree_state", seen.append, latched)
    run = start("sar-run", tree, "--view", "text", "--publish", "--ros-args", "-r", "__node:=mission")
    ros.spin_until(lambda: seen and seen[-1].event_log[0].current_status == "RUNNING", "the state")
    run.send(signal.SIGINT)
    ros.spin_until(lambda: seen[-1].event_log[0].current_status == "IDLE", "the last state")
    run.end()


def test_observer_libraries_are_not_imported_by_default():
    libraries = ("zmq", "msgpack", "mcap", "diagnostic_msgs", "visualization_msgs", "sar_compiler.groot2")
    program = f"import sys, sar_compiler.execution.node_run; print([each for each in {libraries} if each in sys.modules])"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout == "[]\n"
