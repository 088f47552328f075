"""Tests of several robots of one simulation on ROS, each in its own namespace, over real DDS."""

from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any

import pytest

from sar_compiler.missions.faults import NAVIGATION_FAULTS, FaultPlan, parse_fault
from sar_compiler.sim.geometry import Pose2D
from sar_compiler.sim.placement import Placement, PlacementError
from sar_compiler.sim.world import World
from tests.sim.conftest import Client, Navigation

if TYPE_CHECKING:
    from sar_compiler.sim.simulation import Simulation

pytestmark = pytest.mark.ros

SUCCEEDED, CANCELED, ABORTED = 4, 5, 6
Simulate = Callable[..., "Simulation"]
PAIR = (Placement("robot1", Pose2D(-0.7, 0.0, 3.14)), Placement("robot2", Pose2D(0.7, 0.0)))


@pytest.fixture
def clients(ros_context: Any) -> Iterator[tuple[Client, Client]]:
    """A client in the namespace of each robot."""
    made = Client(ros_context, namespace="/robot1"), Client(ros_context, namespace="/robot2")
    yield made
    for each in made:
        each.close()


@pytest.fixture
def navigations(
    simulate: Simulate, clients: tuple[Client, Client]
) -> Iterator[tuple["Simulation", Navigation, Navigation]]:
    """A simulation of both robots, localised and active, and an action client of each."""
    simulation = simulate(robots=PAIR)
    for client, robot in zip(clients, PAIR, strict=True):
        client.make_ready(robot.start)
    one, other = Navigation(clients[0]), Navigation(clients[1])
    yield simulation, one, other
    one.close()
    other.close()


def test_topics_and_nodes_of_robot_are_in_its_namespace(
    simulate: Simulate, clients: tuple[Client, Client]
) -> None:
    simulate(robots=PAIR)
    wanted = {
        f"/{robot}/{name}"
        for robot in ("robot1", "robot2")
        for name in (
            "tf",
            "odometry/filtered",
            "scan",
            "battery_state",
            "cmd_vel",
            "amcl_pose",
            "initialpose",
            "map",
            "plan",
        )
    } | {"/clock"}
    node = clients[0].node

    def topics() -> set[str]:
        return {name for name, _ in node.get_topic_names_and_types()}

    clients[0].wait(lambda: wanted <= topics(), "the topics of both robots")
    actions = {topic for topic in topics() if "/_action/" in topic}
    assert topics() - wanted - actions <= {"/rosout", "/parameter_events"}
    assert {topic.split("/")[1] for topic in actions} <= {"robot1", "robot2"}
    nodes = set(node.get_node_names_and_namespaces())
    assert {
        (name, f"/{robot.name}") for robot in PAIR for name in ("rosbot", "amcl", "bt_navigator")
    } <= nodes
    assert ("simulator", "/") in nodes


def test_all_robots_share_one_clock(simulate: Simulate, clients: tuple[Client, Client]) -> None:
    from rosgraph_msgs.msg import Clock

    simulate(robots=PAIR)
    ticks = clients[0].listen(Clock, "/clock", 100)
    clients[0].wait(lambda: len(ticks) > 2, "the clock")
    assert clients[0].node.count_publishers("/clock") == 1


def test_each_transform_tree_contains_only_its_robot(
    simulate: Simulate, clients: tuple[Client, Client]
) -> None:
    from tf2_msgs.msg import TFMessage

    simulate(robots=PAIR)
    heard = [client.listen(TFMessage, "tf", 100) for client in clients]
    clients[0].set_initial_pose(PAIR[0].start)

    def frames(messages: list[Any]) -> set[str]:
        return {transform.child_frame_id for message in messages for transform in message.transforms}

    clients[0].wait(lambda: frames(heard[0]) == {"odom", "base_link"}, "the transforms of robot1")
    clients[1].wait(lambda: bool(heard[1]), "the transforms of robot2")
    assert frames(heard[1]) == {"base_link"}, "robot2, not localised yet, has robot1's transform"


def test_each_localiser_reports_pose_of_its_robot(simulate: Simulate, clients: tuple[Client, Client]) -> None:
    simulate(robots=PAIR)
    for client, robot in zip(clients, PAIR, strict=True):
        assert robot.start is not None
        answer = client.set_initial_pose(robot.start)
        assert answer.pose.pose.position.x == pytest.approx(robot.start.x)


def test_two_robots_drive_to_own_goals_at_same_time(
    navigations: tuple["Simulation", Navigation, Navigation],
) -> None:
    simulation, one, other = navigations
    handles = one.send(-1.0, 0.9), other.send(1.0, -0.9)
    assert one.result(handles[0]).status == SUCCEEDED
    assert other.result(handles[1]).status == SUCCEEDED
    assert simulation.robot_pose("robot1").distance_to(Pose2D(-1.0, 0.9)) < 0.1
    assert simulation.robot_pose("robot2").distance_to(Pose2D(1.0, -0.9)) < 0.1


def test_cancel_of_one_goal_does_not_stop_other_robot(
    navigations: tuple["Simulation", Navigation, Navigation],
    clients: tuple[Client, Client],
) -> None:
    simulation, one, other = navigations
    cancelled, kept = one.send(-3.0, 3.0), other.send(3.5, 3.0)
    answer = clients[0].result(cancelled.cancel_goal_async(), "the answer to the cancel")
    assert len(answer.goals_canceling) == 1
    assert one.result(cancelled).status == CANCELED
    assert other.result(kept).status == SUCCEEDED
    assert simulation.robot_pose("robot2").distance_to(Pose2D(3.5, 3.0)) < 0.1


def test_goals_of_robots_that_block_each_other_are_aborted(
    navigations: tuple["Simulation", Navigation, Navigation],
) -> None:
    simulation, one, other = navigations
    handles = one.send(0.7, 0.0), other.send(-0.7, 0.0)
    for navigation, handle in zip((one, other), handles, strict=True):
        ended = navigation.result(handle)
        assert (ended.status, ended.result.error_code) == (ABORTED, 105)
        assert "an obstacle that is not on the map blocks the path" in ended.result.error_msg
    apart = simulation.robot_pose("robot1").distance_to(simulation.robot_pose("robot2"))
    assert apart == pytest.approx(0.44, abs=1e-3)


def test_scan_shows_other_robot(simulate: Simulate, clients: tuple[Client, Client]) -> None:
    from rclpy.qos import qos_profile_sensor_data
    from sensor_msgs.msg import LaserScan

    simulate(robots=PAIR)
    scans = clients[1].listen(LaserScan, "scan", qos_profile_sensor_data)
    clients[1].wait(lambda: bool(scans), "a scan")
    assert scans[-1].ranges[0] == pytest.approx(1.4 - 0.22, abs=0.06), "robot1 stands behind robot2"


def test_fault_applies_to_every_robot_with_separate_counts(
    simulate: Simulate, clients: tuple[Client, Client]
) -> None:
    simulate(robots=PAIR, faults=FaultPlan([parse_fault("navigate_to_pose:reject=1", NAVIGATION_FAULTS)]))
    for client, robot in zip(clients, PAIR, strict=True):
        client.make_ready(robot.start)
        navigation = Navigation(client)
        assert not navigation.send(0.0, 0.9).accepted
        assert navigation.send(0.0, 0.9).accepted
        navigation.close()


def test_end_of_simulation_aborts_goals_of_all_robots(
    navigations: tuple["Simulation", Navigation, Navigation],
    clients: tuple[Client, Client],
) -> None:
    simulation, one, other = navigations
    results = [one.send(-3.0, 3.0).get_result_async(), other.send(3.5, 3.0).get_result_async()]
    for client, navigation in zip(clients, (one, other), strict=True):
        client.wait(lambda navigation=navigation: bool(navigation.feedback), "feedback")  # type: ignore[misc]
    simulation.stop()
    for client, result in zip(clients, results, strict=True):
        assert client.result(result, "the result").status == ABORTED


def test_robots_in_contact_are_rejected_before_nodes_are_created(
    disaster_zone: World, ros_context: Any, client: Client
) -> None:
    from sar_compiler.sim.simulation import Simulation

    with pytest.raises(PlacementError, match="in contact with robot 'robot1'"):
        Simulation(disaster_zone, [Placement("robot1"), Placement("robot2")], context=ros_context)
    assert "simulator" not in client.node.get_node_names()


def test_existing_server_of_one_robot_is_a_conflict(ros_context: Any, clients: tuple[Client, Client]) -> None:
    from nav2_msgs.action import NavigateToPose
    from rclpy.action import ActionServer

    from sar_compiler.sim.isolation import IsolationError, require_no_other_nodes

    server = ActionServer(
        clients[1].node, NavigateToPose, "navigate_to_pose", lambda _: NavigateToPose.Result()
    )
    try:
        with pytest.raises(
            IsolationError,
            match="'/robot2/client' already provides the action /robot2/navigate_to_pose in this ROS domain",
        ):
            require_no_other_nodes(context=ros_context, actions=[robot.action for robot in PAIR])
    finally:
        server.destroy()


def test_simulation_ends_when_other_node_serves_action_of_its_robot(
    ros_context: Any, clients: tuple[Client, Client], disaster_zone: World
) -> None:
    from nav2_msgs.action import NavigateToPose
    from rclpy.action import ActionServer

    from sar_compiler.sim.isolation import IsolationError
    from sar_compiler.sim.simulation import Simulation

    with Simulation(disaster_zone, PAIR, context=ros_context) as simulation:
        rival = ActionServer(
            clients[1].node, NavigateToPose, "navigate_to_pose", lambda _: NavigateToPose.Result()
        )
        try:
            clients[1].wait(lambda: simulation.failure is not None, "the end of the simulation")
        finally:
            rival.destroy()
    assert isinstance(simulation.failure, IsolationError)
    assert "the action /robot2/navigate_to_pose" in str(simulation.failure)
