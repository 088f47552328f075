"""Tests of reading the parameters of Nav2's nodes from their parameter services."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from sar_compiler.ros.nav2_parameters import Nav2Parameters
    from tests.ros.conftest import Ros

pytestmark = pytest.mark.ros

FILE = "in Nav2's parameter file, and restart Nav2"


def nav2_node(ros: Ros, name: str, **values: Any) -> Any:
    """Make a node with parameters; a dot in a name is written `__`."""
    node = ros.node(name)
    for key, value in values.items():
        node.declare_parameter(key.replace("__", "."), value)
    return node


def query_parameters(ros: Ros, node: Any) -> Nav2Parameters:
    """Query until all nodes have responded; at least one must exist."""
    from sar_compiler.ros.nav2_parameters import nav2_parameters

    parameters = nav2_parameters(node)
    ros.spin_until(parameters.are_awaited, "a node of Nav2")
    ros.spin_until(lambda: not parameters.are_awaited(), "the parameters")
    return parameters


def test_short_timeouts_are_named_with_remedy(ros: Ros) -> None:
    nav2_node(ros, "bt_navigator", default_server_timeout=20, wait_for_service_timeout=499, other=1)
    assert query_parameters(ros, ros.node()).advice() == [
        f"{key} of bt_navigator is {value} ms. So bt_navigator aborts a goal if another Nav2 node takes longer than that to respond. "
        f"Write `{key}: 1000` under `bt_navigator: ros__parameters:` {FILE}"
        for key, value in (("default_server_timeout", 20), ("wait_for_service_timeout", 499))
    ]


def test_timeouts_of_half_second_and_missing_timeouts_have_no_advice(ros: Ros) -> None:
    nav2_node(ros, "bt_navigator", default_server_timeout=500)
    nav2_node(ros, "controller_server")
    assert query_parameters(ros, ros.node()).advice() == []


def test_shipped_parameter_file_has_no_advice(ros: Ros) -> None:
    from sar_compiler import resources
    from sar_compiler.missions.parameter_file import read_parameter_file

    file = resources.shared_file_path("config", "nav2_params.yaml")
    for name in ("bt_navigator", "controller_server", "behavior_server", "velocity_smoother"):
        values = read_parameter_file(file, f"/{name}")
        node = ros.node(name)
        for key, value in values.items():
            node.declare_parameter(key, value)
    mission = ros.node()
    add_robot_base(ros, mission, "TwistStamped")
    publish_odometry(ros, mission, "odometry/filtered")
    assert query_parameters(ros, mission).advice() == []


@pytest.mark.parametrize(
    ("values", "tolerance"),
    [
        (
            {"goal_checker_plugins": ["near"], "near__xy_goal_tolerance": 0.4, "far__xy_goal_tolerance": 2.0},
            0.4,
        ),
        ({"goal_checker_plugins": ["a", "b"], "a__xy_goal_tolerance": 0.1, "b__xy_goal_tolerance": 0.6}, 0.6),
        ({"goal_checker_plugins": ["a"], "a__xy_goal_tolerance": float("nan")}, 0.25),
        ({"goal_checker_plugins": ["a"]}, 0.25),
        ({}, 0.25),
    ],
)
def test_goal_tolerance_is_read_from_active_goal_checkers(
    ros: Ros, values: dict[str, Any], tolerance: float
) -> None:
    nav2_node(ros, "controller_server", **values)
    assert query_parameters(ros, ros.node()).goal_tolerance == tolerance


def test_nothing_is_awaited_without_nav2(ros: Ros) -> None:
    from sar_compiler.ros.nav2_parameters import nav2_parameters

    parameters = nav2_parameters(ros.node())
    assert not parameters.are_awaited()
    assert (parameters.goal_tolerance, parameters.advice()) == (0.25, [])


def test_unresponsive_node_is_given_up(ros: Ros, monkeypatch: pytest.MonkeyPatch) -> None:
    from sar_compiler.ros import nav2_parameters as module

    monkeypatch.setattr(module, "_RESPONSE_SEC", 0.3)
    frozen = nav2_node(ros, "bt_navigator", default_server_timeout=20)
    ros.executor.remove_node(frozen)
    assert query_parameters(ros, ros.node()).advice() == []
    frozen.destroy_node()


def add_robot_base(ros: Ros, mission: Any, kind: str) -> None:
    """Make a robot's base that subscribes to velocity commands of a type."""
    import geometry_msgs.msg

    base = ros.node("base")
    base.create_subscription(getattr(geometry_msgs.msg, kind), "cmd_vel", lambda _: None, 1)
    ros.spin_until(lambda: mission.count_subscribers("cmd_vel"), "the robot")


def publish_odometry(ros: Ros, mission: Any, topic: str) -> None:
    """Make a node that publishes odometry on a topic."""
    from nav_msgs.msg import Odometry

    ros.node("odometer").create_publisher(Odometry, topic, 1)
    ros.spin_until(lambda: mission.count_publishers(topic), "the odometry")


@pytest.mark.parametrize(
    ("kind", "is_stamped", "line"),
    [("TwistStamped", False, "true"), ("Twist", True, "false")],
)
def test_mismatched_velocity_command_type_is_named(ros: Ros, kind: str, is_stamped: bool, line: str) -> None:
    nav2_node(ros, "controller_server", enable_stamped_cmd_vel=not is_stamped)
    nav2_node(ros, "behavior_server", enable_stamped_cmd_vel=is_stamped)
    mission = ros.node()
    add_robot_base(ros, mission, kind)
    assert query_parameters(ros, mission).advice() == [
        (
            f"the robot accepts {kind} on cmd_vel, but behavior_server sends the other type. "
            f"Write `enable_stamped_cmd_vel: {line}` under `behavior_server: ros__parameters:` {FILE}"
        )
    ]


def test_odometry_missing_for_nav2_is_named_with_parameter(ros: Ros) -> None:
    nav2_node(ros, "bt_navigator", odom_topic="odom")
    mission = ros.node()
    publish_odometry(ros, mission, "odometry/filtered")
    assert query_parameters(ros, mission).advice() == [
        (
            "bt_navigator reads odometry from /odom, but no node publishes on this topic. "
            f"Write `odom_topic: odometry/filtered` under `bt_navigator: ros__parameters:` {FILE}"
        )
    ]


def test_odometry_missing_for_mission_is_named_with_remapping(ros: Ros) -> None:
    nav2_node(ros, "bt_navigator", odom_topic="odom")
    nav2_node(ros, "controller_server", odom_topic="odom")
    mission = ros.node()
    publish_odometry(ros, mission, "odom")
    assert query_parameters(ros, mission).advice() == [
        (
            "no node publishes on /odometry/filtered, and bt_navigator reads odometry from /odom. "
            "Add `--ros-args -r odometry/filtered:=odom` to the command"
        )
    ]


def test_startup_wait_requests_parameters(ros: Ros) -> None:
    from sar_compiler.nodes.spec import Use
    from sar_compiler.ros.nav2_parameters import nav2_parameters
    from tests.ros.test_readiness import FakeNav2, readiness, wait

    FakeNav2(nav2_node(ros, "bt_navigator", default_server_timeout=20))
    node = ros.node()
    wait(ros, readiness(node, Use.nav2()))
    assert "default_server_timeout" in nav2_parameters(node).advice()[0]
