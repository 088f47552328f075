"""Tests of missions that claim the same robot."""

import json
from collections.abc import Callable
from typing import Any

import pytest
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import String

from sar_compiler.ros.discovery_wait import DiscoveryWait
from sar_compiler.ros.robot_lease import AnotherMissionError, LeaseClaim, RobotLease
from tests.ros.conftest import Ros, Said

pytestmark = pytest.mark.ros

DRIVE = ["navigate_to_pose"]


def mission(ros: Ros, name: str = "first", actions: list[str] = DRIVE, **options: bool) -> RobotLease:
    node = ros.node(name)
    return RobotLease(node, actions, DiscoveryWait(node, 0.0), **options)


def wait_for_claims(ros: Ros, one: RobotLease, number: int = 1) -> None:
    ros.spin_until(lambda: len(one._others) == number, "the other mission's claim")


def test_lease_is_clear_after_discovery_wait(ros: Ros) -> None:
    node = ros.node("first")
    alone = RobotLease(node, DRIVE, DiscoveryWait(node, 0.2))
    assert alone.poll() == "looking for another mission on this robot"
    ros.spin_until(lambda: alone.poll() is None, "the end of the look around")
    assert alone.conflict() == ""


def test_new_node_restarts_discovery_wait(ros: Ros) -> None:
    node = ros.node("first")
    alone = RobotLease(node, DRIVE, DiscoveryWait(node, 0.2))
    ros.spin_until(lambda: alone.poll() is None, "the end of the look around")
    ros.node("another")
    ros.spin_until(alone.poll, "another look around")
    ros.spin_until(lambda: alone.poll() is None, "its end")


def test_existing_and_own_nodes_do_not_extend_discovery_wait(
    ros: Ros, monkeypatch: pytest.MonkeyPatch
) -> None:
    node, now = ros.node("first"), [100.0]
    monkeypatch.setattr("sar_compiler.ros.discovery_wait.time.monotonic", lambda: now[0])
    names = ["first", "controller"]
    monkeypatch.setattr(node, "get_node_names_and_namespaces", lambda: [(name, "/") for name in names])
    alone = RobotLease(node, DRIVE, DiscoveryWait(node, 1.0))
    now[0] = 100.9
    assert alone.poll()
    names.append("_first_frames")
    now[0] = 101.0
    assert alone.poll() is None
    names.append("_first_frames")  # that of another mission of this name
    assert alone.poll()


def test_discovery_wait_begins_with_node_and_leaves_time_for_claims(
    ros: Ros, monkeypatch: pytest.MonkeyPatch
) -> None:
    node, now = ros.node("first"), [100.0]
    monkeypatch.setattr("sar_compiler.ros.discovery_wait.time.monotonic", lambda: now[0])
    monkeypatch.setattr(node, "get_node_names_and_namespaces", list)
    early, late = DiscoveryWait(node, 1.0), DiscoveryWait(node, 1.0)
    now[0] = 100.3
    soon = RobotLease(node, DRIVE, early)
    now[0] = 101.0
    assert soon.poll() is None
    alone = RobotLease(node, DRIVE, late)
    now[0] = 101.4
    assert alone.poll()
    now[0] = 101.5
    assert alone.poll() is None


def test_discovery_wait_is_limited_to_ten_times_its_length(ros: Ros, monkeypatch: pytest.MonkeyPatch) -> None:
    node, now = ros.node("first"), [100.0]
    monkeypatch.setattr("sar_compiler.ros.discovery_wait.time.monotonic", lambda: now[0])
    names: list[str] = []
    monkeypatch.setattr(node, "get_node_names_and_namespaces", lambda: [(name, "/") for name in names])
    alone = RobotLease(node, DRIVE, DiscoveryWait(node, 1.0))
    for number in range(100):
        names.append(f"node_{number}")
        if alone.poll() is None:
            break
        now[0] += 0.5
    assert now[0] == 110.0


def test_running_mission_takes_precedence_over_older_starting_mission(ros: Ros) -> None:
    newcomer, running = mission(ros, "newcomer"), mission(ros, "running")
    running.run()
    ros.spin_until(lambda: any(each.runs for each in newcomer._others.values()), "the claim of what runs")
    with pytest.raises(AnotherMissionError, match=r"node /running \(process \d+ on .*'/navigate_to_pose'"):
        newcomer.poll()
    assert running.conflict() == ""


def test_younger_of_two_starting_missions_gives_way(ros: Ros) -> None:
    older, younger = mission(ros, "older"), mission(ros, "younger")
    wait_for_claims(ros, older)
    wait_for_claims(ros, younger)
    assert older.poll() is None
    with pytest.raises(AnotherMissionError):
        younger.poll()


def test_younger_of_two_running_missions_gives_way(ros: Ros, said: Said) -> None:
    older, younger = mission(ros, "older"), mission(ros, "younger")
    older.run()
    younger.run()
    for one in (older, younger):
        ros.spin_until(lambda one=one: any(each.runs for each in one._others.values()), "the claims")  # type: ignore[misc]
    assert older.conflict() == ""
    assert "node /older" in younger.conflict()
    assert said.has("Another mission claims this robot: node /younger")


def test_different_action_means_different_robot(ros: Ros) -> None:
    mission(ros, "first", ["robot1/navigate_to_pose"]).run()
    second = mission(ros, "second", ["robot2/navigate_to_pose"])
    ros.spin_for(0.3)
    assert second.poll() is None


def test_observer_claims_nothing_and_sees_running_mission(ros: Ros) -> None:
    running = mission(ros, "running")
    running.run()
    looking = mission(ros, "looking", claims=False)
    wait_for_claims(ros, looking)
    with pytest.raises(AnotherMissionError):
        looking.poll()
    assert running._others == {}


def test_ended_mission_does_not_affect_next_one(make_ros: Callable[[], Ros]) -> None:
    first = make_ros()
    mission(first).run()
    first.close()
    second = make_ros()
    next_one = mission(second)
    second.spin_for(0.3)
    assert next_one.poll() is None


@pytest.mark.parametrize(
    "text",
    [
        "",
        "[]",
        "{}",
        "5",
        '"claim"',
        json.dumps({**LeaseClaim("a", True, 1, "k", "n", "h", 2)._asdict(), "since": "x"}),  # noqa: FBT003
        "[" * 100_000,
    ],
)
def test_invalid_claim_is_ignored(ros: Ros, text: str) -> None:
    alone = mission(ros)
    alone._on_claim(String(data=text))
    assert alone.poll() is None


def test_claim_description_escapes_control_characters_and_is_shortened() -> None:
    claim = LeaseClaim("a", runs=True, since=1, key="k", node="\x1b[2J\nfine", host="h" * 500, pid=7)
    assert claim.describe() == f"node \\x1b[2J\\nfine (process 7 on {'h' * 80})"


def publish_claims(ros: Ros, count: int, **changes: Any) -> None:
    """Claim the robot again and again, each time as another mission."""
    node = ros.node("stranger")
    latched = QoSProfile(depth=count, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    publisher = node.create_publisher(String, "/navigate_to_pose/_mission", latched)
    for number in range(count):
        claim = LeaseClaim("/navigate_to_pose", False, 2**62, f"key{number}", "/flood", "here", number)  # noqa: FBT003
        publisher.publish(String(data=json.dumps(claim._replace(**changes)._asdict())))


def test_flood_of_claims_is_reported_eight_times_and_limited(ros: Ros, said: Said) -> None:
    running = mission(ros, "running")
    running.run()
    publish_claims(ros, 300)
    ros.spin_until(lambda: running.conflict() == "" and said.has("Further missions"), "the end of it")
    ros.spin_for(0.3)
    assert running.conflict() == ""
    assert len(running._others) == len(running._reported) == 8
    assert len([line for line in said.lines() if "Another mission claims this robot" in line]) == 8


def test_claim_with_precedence_is_honoured_during_flood(ros: Ros) -> None:
    running = mission(ros, "running")
    running.run()
    publish_claims(ros, 300)
    ros.spin_until(lambda: len(running._others) == 8, "the claims")
    publish_claims(ros, 1, runs=True, since=1, key="older")
    ros.spin_until(running.conflict, "the older mission's claim")
    assert len(running._others) == 8


def test_node_of_same_name_is_reported_once(ros: Ros, said: Said, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sar_compiler.ros.robot_lease.SHADOW_SEC", 0.2)
    running = mission(ros, "search_and_rescue")
    assert running.conflict() == ""
    ros.node("search_and_rescue")
    ros.spin_until(
        lambda: running.conflict() == "" and said.has("Another node is also called /search_and_rescue,"),
        "the word of the other node",
    )
    ros.spin_for(0.5)
    assert running.conflict() == ""
    assert len([line for line in said.lines() if "is also called" in line]) == 1
