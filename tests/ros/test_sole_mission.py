"""Missions that claim the same robot."""

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


def seen(ros: Ros, one: RobotLease, number: int = 1) -> None:
    ros.spin_until(lambda: len(one._others) == number, "the other mission's claim")


def test_alone_on_a_robot_it_is_clear_after_the_look_around(ros: Ros) -> None:
    node = ros.node("first")
    alone = RobotLease(node, DRIVE, DiscoveryWait(node, 0.2))
    assert alone.poll() == "looking for another mission on this robot"
    ros.spin_until(lambda: alone.poll() is None, "the end of the look around")
    assert alone.conflict() == ""


def test_it_looks_around_anew_when_a_node_comes_into_sight(ros: Ros) -> None:
    node = ros.node("first")
    alone = RobotLease(node, DRIVE, DiscoveryWait(node, 0.2))
    ros.spin_until(lambda: alone.poll() is None, "the end of the look around")
    ros.node("another")
    ros.spin_until(alone.poll, "another look around")
    ros.spin_until(lambda: alone.poll() is None, "its end")


def test_neither_nodes_that_are_there_already_nor_its_own_ones_prolong_the_look(
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


def test_the_look_begins_with_the_node_but_claims_have_time_to_arrive(
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


def test_it_looks_around_no_longer_than_ten_times_as_long_where_nodes_keep_coming(
    ros: Ros, monkeypatch: pytest.MonkeyPatch
) -> None:
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


def test_one_that_runs_goes_before_one_that_begins_whoever_is_older(ros: Ros) -> None:
    newcomer, running = mission(ros, "newcomer"), mission(ros, "running")
    running.run()
    ros.spin_until(lambda: any(each.runs for each in newcomer._others.values()), "the claim of what runs")
    with pytest.raises(AnotherMissionError, match=r"node /running \(process \d+ on .*'/navigate_to_pose'"):
        newcomer.poll()
    assert running.conflict() == ""


def test_of_two_that_begin_at_once_the_younger_gives_way(ros: Ros) -> None:
    older, younger = mission(ros, "older"), mission(ros, "younger")
    seen(ros, older)
    seen(ros, younger)
    assert older.poll() is None
    with pytest.raises(AnotherMissionError):
        younger.poll()


def test_of_two_that_run_and_have_not_seen_each_other_the_younger_gives_way(ros: Ros, said: Said) -> None:
    older, younger = mission(ros, "older"), mission(ros, "younger")
    older.run()
    younger.run()
    for one in (older, younger):
        ros.spin_until(lambda one=one: any(each.runs for each in one._others.values()), "the claims")  # type: ignore[misc]
    assert older.conflict() == ""
    assert "node /older" in younger.conflict()
    assert said.has("Another mission claims this robot: node /younger")


def test_another_action_is_another_robot(ros: Ros) -> None:
    mission(ros, "first", ["robot1/navigate_to_pose"]).run()
    second = mission(ros, "second", ["robot2/navigate_to_pose"])
    ros.spin_for(0.3)
    assert second.poll() is None


def test_who_only_looks_claims_nothing_and_sees_all(ros: Ros) -> None:
    running = mission(ros, "running")
    running.run()
    looking = mission(ros, "looking", claims=False)
    seen(ros, looking)
    with pytest.raises(AnotherMissionError):
        looking.poll()
    assert running._others == {}


def test_one_that_has_ended_says_nothing_to_the_next(make_ros: Callable[[], Ros]) -> None:
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
def test_what_is_no_claim_is_not_heeded(ros: Ros, text: str) -> None:
    alone = mission(ros)
    alone._on_claim(String(data=text))
    assert alone.poll() is None


def test_what_another_says_of_itself_is_shown_without_what_a_terminal_would_obey() -> None:
    claim = LeaseClaim("a", runs=True, since=1, key="k", node="\x1b[2J\nfine", host="h" * 500, pid=7)
    assert claim.describe() == f"node \\x1b[2J\\nfine (process 7 on {'h' * 80})"


def claims(ros: Ros, count: int, **changes: Any) -> None:
    """Claim the robot again and again, each time as somebody else."""
    node = ros.node("stranger")
    latched = QoSProfile(depth=count, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    publisher = node.create_publisher(String, "/navigate_to_pose/_mission", latched)
    for number in range(count):
        claim = LeaseClaim("/navigate_to_pose", False, 2**62, f"key{number}", "/flood", "here", number)  # noqa: FBT003
        publisher.publish(String(data=json.dumps(claim._replace(**changes)._asdict())))


def test_claims_without_end_are_told_eight_times_and_forgotten(ros: Ros, said: Said) -> None:
    running = mission(ros, "running")
    running.run()
    claims(ros, 300)
    ros.spin_until(lambda: running.conflict() == "" and said.has("Further missions"), "the end of it")
    ros.spin_for(0.3)
    assert running.conflict() == ""
    assert len(running._others) == len(running._reported) == 8
    assert len([line for line in said.lines() if "Another mission claims this robot" in line]) == 8


def test_one_that_goes_before_is_heeded_among_claims_without_end(ros: Ros) -> None:
    running = mission(ros, "running")
    running.run()
    claims(ros, 300)
    ros.spin_until(lambda: len(running._others) == 8, "the claims")
    claims(ros, 1, runs=True, since=1, key="older")
    ros.spin_until(running.conflict, "the older mission's claim")
    assert len(running._others) == 8


def test_a_node_of_the_same_name_is_told_once_when_it_is_no_shadow(
    ros: Ros, said: Said, monkeypatch: pytest.MonkeyPatch
) -> None:
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
