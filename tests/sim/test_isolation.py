"""Tests of isolating a simulated robot from other robots and simulations."""

import os
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from sar_compiler.sim.world import World
from tests.sim.conftest import Client

pytestmark = pytest.mark.ros


def needs_discovery_wait(context: Any) -> bool:
    """Return whether the check for other nodes has to wait for discovery."""
    from sar_compiler.sim.isolation import require_no_other_nodes

    waited: list[bool] = []
    require_no_other_nodes(context=context, look_around_sec=0.2, on_waiting=lambda: waited.append(True))
    return bool(waited)


def test_discovery_wait_is_skipped_if_domain_is_empty(ros_context: Any) -> None:
    assert not needs_discovery_wait(ros_context)


BYSTANDER = """
import rclpy
rclpy.init()
node = rclpy.create_node("bystander")
print("is there", flush=True)
input()
"""


def test_discovery_wait_is_needed_with_other_process_in_domain(ros_context: Any) -> None:
    pipe = subprocess.PIPE
    with subprocess.Popen([sys.executable, "-c", BYSTANDER], stdin=pipe, stdout=pipe) as bystander:
        assert bystander.stdout is not None
        assert bystander.stdout.readline() == b"is there\n"
        assert needs_discovery_wait(ros_context)
        bystander.communicate(b"\n")
    assert not needs_discovery_wait(ros_context)


def test_discovery_wait_is_needed_with_second_participant_of_process(ros_context: Any) -> None:
    import rclpy
    from rclpy.context import Context

    context = Context()
    rclpy.init(context=context, args=[])
    node = rclpy.create_node("other", context=context)
    try:
        assert needs_discovery_wait(ros_context)
    finally:
        node.destroy_node()
        context.try_shutdown()


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("ROS_AUTOMATIC_DISCOVERY_RANGE", "SUBNET"),
        ("ROS_STATIC_PEERS", "192.168.1.7"),
        ("FASTRTPS_DEFAULT_PROFILES_FILE", "profiles.xml"),
    ],
)
def test_discovery_wait_is_needed_if_environment_extends_discovery(
    ros_context: Any, monkeypatch: pytest.MonkeyPatch, name: str, value: str
) -> None:
    monkeypatch.setenv(name, value)
    assert needs_discovery_wait(ros_context)


def test_discovery_wait_is_needed_with_fast_dds_profile_file(
    ros_context: Any, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    (tmp_path / "DEFAULT_FASTRTPS_PROFILES.xml").touch()
    monkeypatch.chdir(tmp_path)
    assert needs_discovery_wait(ros_context)


@pytest.mark.parametrize("tables", [(Path("no/such/file"),), ()])
def test_discovery_wait_is_needed_without_socket_tables(
    ros_context: Any, monkeypatch: pytest.MonkeyPatch, tables: tuple[Path, ...]
) -> None:
    from sar_compiler.sim import isolation

    monkeypatch.setattr(isolation, "_SOCKETS", tables)
    assert needs_discovery_wait(ros_context)


def test_discovery_wait_is_needed_with_other_middleware(
    ros_context: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    from sar_compiler.sim import isolation

    monkeypatch.setattr(isolation, "get_rmw_implementation_identifier", lambda: "rmw_zenoh_cpp")
    assert needs_discovery_wait(ros_context)


def test_foreign_clock_is_named_with_its_node(ros_context: Any, client: Client) -> None:
    from rosgraph_msgs.msg import Clock

    from sar_compiler.sim.isolation import IsolationError, require_no_other_nodes

    client.node.create_publisher(Clock, "/clock", 10)
    with pytest.raises(IsolationError, match="node '/client' already provides /clock") as raised:
        require_no_other_nodes(context=ros_context)
    assert raised.value.node == "node '/client'"


def test_clock_of_unannounced_node_is_a_conflict(
    ros_context: Any, client: Client, monkeypatch: pytest.MonkeyPatch
) -> None:
    from rclpy.node import Node
    from rosgraph_msgs.msg import Clock

    from sar_compiler.sim.isolation import IsolationError, require_no_other_nodes

    client.node.create_publisher(Clock, "/clock", 10)
    (info,) = client.node.get_publishers_info_by_topic("/clock")
    info.node_name, info.node_namespace = "_NODE_NAME_UNKNOWN_", "_NODE_NAMESPACE_UNKNOWN_"
    monkeypatch.setattr(Node, "get_publishers_info_by_topic", lambda *_: [info])
    with pytest.raises(IsolationError, match=r"^another node already provides /clock"):
        require_no_other_nodes(context=ros_context, look_around_sec=0.2)


def test_foreign_navigation_server_is_named_with_its_node(ros_context: Any) -> None:
    from nav2_msgs.action import NavigateToPose
    from rclpy.action import ActionServer

    from sar_compiler.sim.isolation import IsolationError, require_no_other_nodes

    robot = Client(ros_context, namespace="/robot1")
    server = ActionServer(robot.node, NavigateToPose, "navigate_to_pose", lambda _: NavigateToPose.Result())
    try:
        require_no_other_nodes(context=ros_context, look_around_sec=0.2)
        with pytest.raises(
            IsolationError, match="node '/robot1/client' already provides the action /robot1/nav"
        ):
            require_no_other_nodes(context=ros_context, namespace="/robot1")
    finally:
        server.destroy()
        robot.close()


def test_navigation_client_is_not_a_conflict(ros_context: Any, client: Client) -> None:
    from nav2_msgs.action import NavigateToPose
    from rclpy.action import ActionClient

    from sar_compiler.sim.isolation import require_no_other_nodes

    goals = "/navigate_to_pose/_action/send_goal"
    action = ActionClient(client.node, NavigateToPose, "navigate_to_pose")
    try:
        names = [name for name, _ in client.node.get_service_names_and_types()]
        assert goals in names, "the client is not in the graph, so this would show nothing"
        require_no_other_nodes(context=ros_context, look_around_sec=0.2)
    finally:
        action.destroy()


def test_running_simulation_is_a_conflict(ros_context: Any, simulate: Callable[..., Any]) -> None:
    from sar_compiler.sim.isolation import IsolationError, require_no_other_nodes

    simulate()
    with pytest.raises(IsolationError, match="node '/simulator'"):
        require_no_other_nodes(context=ros_context)


def test_simulation_ends_when_second_clock_appears(
    ros_context: Any, client: Client, disaster_zone: World
) -> None:
    from rosgraph_msgs.msg import Clock

    from sar_compiler.sim.isolation import IsolationError
    from sar_compiler.sim.simulation import Simulation

    with Simulation(disaster_zone, context=ros_context) as simulation:
        client.node.create_publisher(Clock, "/clock", 10)
        client.wait(lambda: simulation.failure is not None, "the end of the simulation")
    assert isinstance(simulation.failure, IsolationError)
    assert "already provides /clock in this ROS domain" in str(simulation.failure)


def test_simulation_without_map_survives_second_navigation_server(
    ros_context: Any, client: Client, disaster_zone: World
) -> None:
    """A killed navigator stays in the graph for 20 s, beside its replacement."""
    from nav2_msgs.action import NavigateToPose
    from rclpy.action import ActionServer

    from sar_compiler.sim.simulation import Simulation

    goals = "/navigate_to_pose/_action/send_goal"
    with Simulation(replace(disaster_zone, map_path=None), context=ros_context) as simulation:
        servers = [
            ActionServer(client.node, NavigateToPose, "navigate_to_pose", lambda _: NavigateToPose.Result())
            for _ in range(2)
        ]
        try:
            client.wait(
                lambda: client.node.count_services(goals) == len(servers), "both servers in the graph"
            )
            seen = simulation.sim_time
            over = lambda: simulation.failure is not None or simulation.sim_time > seen + 3.0  # noqa: E731
            client.wait(over, "three more seconds")
        finally:
            for each in servers:
                each.destroy()
    assert simulation.failure is None


def test_discovery_range_of_user_is_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    from sar_compiler.sim.isolation import stay_on_this_machine

    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "SUBNET")
    stay_on_this_machine()
    assert os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] == "SUBNET"


def test_discovery_range_defaults_to_localhost(monkeypatch: pytest.MonkeyPatch) -> None:
    from sar_compiler.sim.isolation import stay_on_this_machine

    # Set first, so that the fixture restores the present value at the end.
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "")
    monkeypatch.delenv("ROS_AUTOMATIC_DISCOVERY_RANGE")
    stay_on_this_machine()
    assert os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] == "LOCALHOST"
