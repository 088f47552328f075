"""Tests of the simulator on ROS: topics, localiser, navigation server, faults; over real DDS."""

import itertools
import math
import time
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any

import pytest

from sar_compiler.missions.faults import NAVIGATION_FAULTS, FaultError, FaultPlan, parse_fault
from sar_compiler.sim.geometry import Pose2D
from sar_compiler.sim.placement import Placement
from sar_compiler.sim.world import World, find_world
from tests.sim.conftest import Client, Navigation
from tests.waiting import Stopwatch

if TYPE_CHECKING:
    from sar_compiler.sim.simulation import Simulation

pytestmark = pytest.mark.ros

SUCCEEDED, CANCELED, ABORTED = 4, 5, 6
Simulate = Callable[..., "Simulation"]


def plan(*texts: str) -> FaultPlan:
    return FaultPlan([parse_fault(text, NAVIGATION_FAULTS) for text in texts])


def seconds(stamp: Any) -> float:
    return float(stamp.sec + stamp.nanosec / 1e9)


def test_clock_advances_in_equal_steps(simulate: Simulate, client: Client) -> None:
    from rosgraph_msgs.msg import Clock

    simulate(speed=10.0)
    ticks = client.listen(Clock, "/clock", 100)
    client.wait(lambda: len(ticks) >= 100, "100 ticks of the clock")
    times = [seconds(tick.clock) for tick in ticks]
    assert all(after - before == pytest.approx(0.05) for before, after in itertools.pairwise(times))


def test_incompatible_subscription_is_warned_of(
    simulate: Simulate, client: Client, capfd: pytest.CaptureFixture[str]
) -> None:
    from rclpy.qos import DurabilityPolicy, QoSProfile
    from rosgraph_msgs.msg import Clock

    simulate()
    client.listen(Clock, "/clock", QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL))
    said: list[str] = []

    def warned() -> bool:
        said.extend(capfd.readouterr())
        return "'/clock', requesting incompatible QoS" in "".join(said)

    client.wait(warned, "the simulator's warning")


def test_speed_is_upper_bound(simulate: Simulate, client: Client) -> None:
    simulation = simulate(speed=5.0)
    began, start = time.monotonic(), simulation.sim_time
    client.wait(lambda: simulation.sim_time > start + 3.0, "3 simulated seconds")
    assert 3.0 / (time.monotonic() - began) < 5.5


def test_unresponsive_clock_listener_limits_simulation_to_real_time(
    disaster_zone: World, client: Client
) -> None:
    from rclpy.node import Node
    from rclpy.parameter import Parameter

    from sar_compiler.sim.simulation import Simulation

    simulated_time = [Parameter("use_sim_time", value=True)]
    deaf = Node("deaf", context=client.node.context, parameter_overrides=simulated_time)
    simulation = Simulation(disaster_zone, speed=1000.0, context=client.node.context)
    simulation.wait_for(deaf.get_clock())
    simulation.start()
    began, start = time.monotonic(), simulation.sim_time
    client.wait(lambda: simulation.sim_time > start + 1.5, "1.5 simulated seconds")
    assert 1.5 / (time.monotonic() - began) < 1.1
    simulation.stop()
    deaf.destroy_node()


def test_zero_speed_is_rejected(disaster_zone: World, ros_context: Any) -> None:
    from sar_compiler.sim.simulation import Simulation, SimulationError

    with pytest.raises(SimulationError, match="above 0"):
        Simulation(disaster_zone, speed=0.0, context=ros_context)


def test_fault_at_unknown_zone_is_rejected(disaster_zone: World, ros_context: Any) -> None:
    from sar_compiler.sim.simulation import Simulation

    with pytest.raises(FaultError, match="zone_x"):
        Simulation(disaster_zone, faults=plan("navigate_to_pose:abort=zone_x"), context=ros_context)


def test_stop_twice_or_before_start_does_nothing(disaster_zone: World, ros_context: Any) -> None:
    from sar_compiler.sim.simulation import Simulation

    simulation = Simulation(disaster_zone, context=ros_context)
    simulation.stop()
    simulation.stop()
    assert simulation.sim_time == 0.0


def test_stop_at_slow_speed_takes_less_than_one_second(simulate: Simulate) -> None:
    simulation = simulate(speed=0.001)
    watch = Stopwatch()
    simulation.stop()
    assert watch.own_sec < 1.0


def test_world_without_map_has_only_robot_topics(simulate: Simulate, client: Client) -> None:
    from nav_msgs.msg import Odometry

    simulate(find_world("empty"))
    odometry = client.listen(Odometry, "odometry/filtered")
    client.wait(lambda: bool(odometry), "odometry")
    assert "bt_navigator" not in client.node.get_node_names()


def test_velocity_command_moves_robot_until_timeout(simulate: Simulate, client: Client) -> None:
    from geometry_msgs.msg import TwistStamped
    from nav_msgs.msg import Odometry

    simulation = simulate(find_world("empty"), speed=2.0)
    odometry = client.listen(Odometry, "odometry/filtered")
    publisher = client.node.create_publisher(TwistStamped, "cmd_vel", 10)
    client.wait(lambda: publisher.get_subscription_count() > 0, "a subscriber of cmd_vel")
    order = TwistStamped()
    order.twist.linear.x = 0.5

    def moving() -> bool:
        publisher.publish(order)
        return bool(odometry) and odometry[-1].pose.pose.position.x > 0.3

    client.wait(moving, "movement")
    client.wait(lambda: odometry[-1].twist.twist.linear.x == 0.0, "the robot's standing still")
    assert odometry[-1].header.frame_id == "odom"
    assert odometry[-1].child_frame_id == "base_link"
    assert odometry[-1].pose.pose.position.x == pytest.approx(simulation.robot_pose().x, abs=0.05)


def test_scan_shows_walls(simulate: Simulate, client: Client) -> None:
    from rclpy.qos import qos_profile_sensor_data
    from sensor_msgs.msg import LaserScan

    simulate()
    scans = client.listen(LaserScan, "scan", qos_profile_sensor_data)
    client.wait(lambda: len(scans) > 2, "scans")
    scan = scans[-1]
    assert len(scan.ranges) == 360
    assert scan.header.frame_id == "base_link"
    assert scan.ranges[180 + 90] == pytest.approx(3.25 - 3.35 / 2, abs=0.06)
    assert seconds(scans[1].header.stamp) - seconds(scans[0].header.stamp) == pytest.approx(0.2)


def test_map_frame_exists_only_after_initial_pose(simulate: Simulate, client: Client) -> None:
    from tf2_msgs.msg import TFMessage

    simulation = simulate()
    transforms = client.listen(TFMessage, "/tf", 100)
    assert client.state_of("amcl") == "active"
    assert client.state_of("bt_navigator") == "inactive"
    began = simulation.sim_time
    client.wait(lambda: simulation.sim_time > began + 2.0, "2 simulated seconds")
    assert {t.header.frame_id for message in transforms for t in message.transforms} == {"odom"}
    answer = client.set_initial_pose()
    assert answer.header.frame_id == "map"
    assert answer.pose.covariance[0] > 0.0

    def seen() -> bool:
        return any(t.header.frame_id == "map" for message in transforms for t in message.transforms)

    client.wait(seen, "the transform from map")
    client.wait(lambda: client.state_of("bt_navigator") == "active", "bt_navigator's becoming active")


def test_last_pose_is_latched(simulate: Simulate, client: Client) -> None:
    from geometry_msgs.msg import PoseWithCovarianceStamped
    from rclpy.qos import DurabilityPolicy, QoSProfile

    simulate()
    client.set_initial_pose()
    late = client.listen(
        PoseWithCovarianceStamped,
        "amcl_pose",
        QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL),
    )
    client.wait(lambda: bool(late), "the latched amcl_pose")


def test_map_and_plan_are_published_like_nav2(simulate: Simulate, client: Client) -> None:
    from nav_msgs.msg import OccupancyGrid, Path
    from rclpy.qos import DurabilityPolicy, QoSProfile

    from sar_compiler.sim.messages import from_grid

    simulate()
    latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    maps, plans = client.listen(OccupancyGrid, "map", latched), client.listen(Path, "plan", 1)
    client.make_ready()
    navigation = Navigation(client)
    assert navigation.result(navigation.send(0.3, 0.0)).status == SUCCEEDED
    client.wait(lambda: bool(maps and plans), "map and plan")
    occupancy = from_grid(maps[0])
    assert occupancy is not None
    assert occupancy.cell_at(0.0, 0.0) is not None
    last = plans[0].poses[-1].pose.position
    assert (plans[0].header.frame_id, round(last.x, 2), round(last.y, 2)) == ("map", 0.3, 0.0)
    navigation.close()


@pytest.mark.parametrize(
    ("pose", "frame"),
    [(Pose2D(100.0, 0.0), "map"), (Pose2D(math.nan, 0.0), "map"), (Pose2D(0.0, 0.0), "odom")],
)
def test_invalid_initial_pose_is_ignored(
    simulate: Simulate, client: Client, pose: Pose2D, frame: str
) -> None:
    simulate()
    with pytest.raises(AssertionError, match="amcl_pose did not come"):
        client.set_initial_pose(pose, frame, timeout_sec=1.0)


def test_wrong_initial_pose_leads_robot_beside_goal(simulate: Simulate, client: Client) -> None:
    simulation = simulate()
    answer = client.set_initial_pose(Pose2D(0.5, 0.3))
    assert (answer.pose.pose.position.x, answer.pose.pose.position.y) == pytest.approx((0.5, 0.3))
    client.wait(lambda: client.state_of("bt_navigator") == "active", "bt_navigator's becoming active")
    navigation = Navigation(client)
    assert navigation.result(navigation.send(0.9, 0.6)).status == SUCCEEDED
    believed = navigation.feedback[-1].current_pose.pose.position
    assert (believed.x, believed.y) == pytest.approx((0.9, 0.6), abs=0.1)
    assert simulation.robot_pose().distance_to(Pose2D(0.4, 0.3)) < 0.1
    navigation.close()


def test_localised_robot_needs_no_initial_pose(simulate: Simulate, client: Client) -> None:
    stood = Pose2D(-0.5, 0.8, 1.0)
    simulation = simulate(robots=[Placement("", stood, Pose2D(3.0, 2.0), localised=True)])
    client.wait(lambda: client.state_of("bt_navigator") == "active", "bt_navigator's becoming active")
    navigation = Navigation(client)
    assert navigation.result(navigation.send(0.0, 0.0)).status == SUCCEEDED
    assert simulation.robot_pose().distance_to(Pose2D(0.0, 0.0)) < 0.1
    navigation.close()


def test_drive_publishes_cmd_vel_that_ends_with_zero(simulate: Simulate, client: Client) -> None:
    from geometry_msgs.msg import TwistStamped

    simulation = simulate(speed=5.0)
    commands = client.listen(TwistStamped, "cmd_vel", 1000)
    client.make_ready()
    navigation = Navigation(client)
    assert navigation.result(navigation.send(0.5, 0.0)).status == SUCCEEDED
    began = simulation.sim_time
    client.wait(lambda: simulation.sim_time > began + 1.0, "a simulated second")
    speeds = [command.twist.linear.x for command in commands]
    assert max(speeds) > 0.2
    assert speeds[-1] == 0.0
    assert simulation.robot_pose().distance_to(Pose2D(0.5, 0.0)) < 0.1
    navigation.close()


def test_drive_reports_feedback_at_ten_hertz(simulate: Simulate, client: Client) -> None:
    simulation = simulate()
    client.make_ready()
    navigation = Navigation(client)
    handle = navigation.send(-0.5, 0.8, 1.0)
    assert handle.accepted
    result = navigation.result(handle)
    assert (result.status, result.result.error_code) == (SUCCEEDED, 0)
    assert simulation.robot_pose().distance_to(Pose2D(-0.5, 0.8)) < 0.1
    assert simulation.robot_pose().yaw == pytest.approx(1.0, abs=0.1)
    stamps = [seconds(feedback.current_pose.header.stamp) for feedback in navigation.feedback]
    assert len(stamps) > 10
    assert max(after - before for before, after in itertools.pairwise(stamps)) <= 0.1 + 1e-6
    first, last = navigation.feedback[0], navigation.feedback[-1]
    assert first.current_pose.header.frame_id == "map"
    assert first.distance_remaining > 0.8 > last.distance_remaining
    assert seconds(first.estimated_time_remaining) > 0.0
    assert seconds(last.navigation_time) > seconds(first.navigation_time)
    navigation.close()


def test_inactive_navigator_rejects_goals(simulate: Simulate, client: Client) -> None:
    simulate()
    navigation = Navigation(client)
    assert not navigation.send(1.0, 0.0).accepted
    navigation.close()


def test_cancelled_goal_ends_canceled_and_robot_stands(simulate: Simulate, client: Client) -> None:
    simulation = simulate()
    client.make_ready()
    navigation = Navigation(client)
    handle = navigation.send(-3.0, 3.0)
    client.wait(lambda: simulation.robot_pose().distance_to(Pose2D(0.0, 0.0)) > 0.3, "movement")
    answer = client.result(handle.cancel_goal_async(), "the answer to the cancel")
    assert len(answer.goals_canceling) == 1
    result = navigation.result(handle)
    assert (result.status, result.result.error_code) == (CANCELED, 0)
    here, began = simulation.robot_pose(), simulation.sim_time
    client.wait(lambda: simulation.sim_time > began + 2.0, "2 simulated seconds")
    assert simulation.robot_pose().distance_to(here) < 0.01
    navigation.close()


def test_second_goal_preempts_first(simulate: Simulate, client: Client) -> None:
    simulation = simulate()
    client.make_ready()
    navigation = Navigation(client)
    first = navigation.send(-3.0, 3.0)
    second = navigation.send(0.5, 0.0)
    ended = navigation.result(first)
    assert (ended.status, ended.result.error_code) == (ABORTED, 0)
    assert navigation.result(second).status == SUCCEEDED
    assert simulation.robot_pose().distance_to(Pose2D(0.5, 0.0)) < 0.1
    navigation.close()


def test_goal_preempted_during_cancel_ends_canceled(simulate: Simulate, client: Client) -> None:
    simulation = simulate()
    client.make_ready()
    navigation = Navigation(client)
    first = navigation.send(-3.0, 3.0)
    client.wait(lambda: simulation.robot_pose().distance_to(Pose2D(0.0, 0.0)) > 0.3, "movement")
    # The two requests go to different services. Without this wait, their order of arrival is unknown.
    canceling = first.cancel_goal_async()
    client.wait(canceling.done, "the answer to the cancel")
    second = navigation.send(0.5, 0.0)
    assert navigation.result(first).status == CANCELED
    assert navigation.result(second).status == SUCCEEDED
    navigation.close()


# Positions on the path from home to zone_a.
ON_THE_WAY = ((-0.8, 1.0), (-1.9, 1.9), (-3.0, 3.0))


def test_poses_are_driven_through_without_stop_and_counted_down(simulate: Simulate, client: Client) -> None:
    simulation = simulate()
    client.make_ready()
    navigation = Navigation(client)
    handle = navigation.send_through(*ON_THE_WAY)
    odometry = client.listen(type_of_odometry(), "odometry/filtered")
    assert navigation.result(handle).status == SUCCEEDED
    assert simulation.robot_pose().distance_to(Pose2D(*ON_THE_WAY[-1])) < 0.1
    left = [each.number_of_poses_remaining for each in navigation.feedback]
    assert [number for number, _ in itertools.groupby(left)] == [3, 2, 1]
    # The remaining distance is that of the whole path, not that to the next pose.
    distances = [each.distance_remaining for each in navigation.feedback]
    assert distances[0] > 4.0
    assert all(later <= earlier + 0.2 for earlier, later in itertools.pairwise(distances))
    speeds = [each.twist.twist.linear.x for each in odometry]
    moving = [speed > 0.05 for speed in speeds]
    assert [is_moving for is_moving, _ in itertools.groupby(moving)].count(True) == 1
    navigation.close()


def type_of_odometry() -> Any:
    from nav_msgs.msg import Odometry

    return Odometry


def test_goal_through_unreachable_pose_is_aborted_with_nav2_code(
    navigation: Navigation,
) -> None:
    ended = navigation.result(navigation.send_through(ON_THE_WAY[0], (3.0, -3.0)))
    assert (ended.status, ended.result.error_code) == (ABORTED, 306)


def test_drive_through_poses_can_be_cancelled(navigation: Navigation, client: Client) -> None:
    handle = navigation.send_through(*ON_THE_WAY)
    client.wait(
        lambda: any(each.number_of_poses_remaining == 2 for each in navigation.feedback), "the second pose"
    )
    client.result(handle.cancel_goal_async(), "the answer to the cancel request")
    assert navigation.result(handle).status == CANCELED


def test_goal_is_aborted_while_goal_of_other_action_is_active(navigation: Navigation) -> None:
    first = navigation.send_through(*ON_THE_WAY)
    ended = navigation.result(navigation.send(0.5, 0.0))
    assert (ended.status, ended.result.error_code) == (ABORTED, 0)
    assert navigation.result(first).status == SUCCEEDED


def test_goal_without_poses_is_aborted(navigation: Navigation) -> None:
    ended = navigation.result(navigation.send_through())
    assert (ended.status, ended.result.error_code) == (ABORTED, 309)


def test_goal_with_missing_tree_is_aborted(navigation: Navigation) -> None:
    ended = navigation.result(navigation.send(0.5, 0.0, tree="/no/such/tree.xml"))
    assert (ended.status, ended.result.error_code) == (ABORTED, 0)
    assert "/no/such/tree.xml" in ended.result.error_msg


def test_second_goal_with_other_tree_is_aborted(navigation: Navigation) -> None:
    first = navigation.send(0.5, 0.0)
    second = navigation.send(1.0, 0.0, tree="other.xml")
    ended = navigation.result(second)
    assert (ended.status, ended.result.error_code) == (ABORTED, 0)
    assert navigation.result(first).status == SUCCEEDED


@pytest.mark.parametrize(
    ("x", "y", "frame", "code"),
    [
        (3.0, -3.0, "map", 206),
        (6.2, 0.0, "map", 206),
        (60.0, 0.0, "map", 204),
        (1.0, 0.0, "odom", 0),
        (math.nan, 0.0, "map", 0),
    ],
)
def test_invalid_goal_is_accepted_and_aborted_with_nav2_code(
    navigation: Navigation, x: float, y: float, frame: str, code: int
) -> None:
    handle = navigation.send(x, y, frame=frame)
    assert handle.accepted
    result = navigation.result(handle)
    assert (result.status, result.result.error_code) == (ABORTED, code)
    assert result.result.error_msg


def test_server_survives_client_that_leaves(simulate: Simulate, client: Client, ros_context: Any) -> None:
    simulate()
    client.make_ready()
    stranger = Client(ros_context)
    leaving = Navigation(stranger)
    leaving.send(-3.0, 3.0)
    leaving.close()
    stranger.close()
    navigation = Navigation(client)
    assert navigation.result(navigation.send(0.5, 0.0)).status == SUCCEEDED
    navigation.close()


def test_many_goals_in_a_row_are_served(navigation: Navigation) -> None:
    for _ in range(50):
        assert navigation.result(navigation.send(60.0, 0.0)).status == ABORTED


def test_end_of_simulation_aborts_active_goal(simulate: Simulate, client: Client) -> None:
    simulation = simulate()
    client.make_ready()
    navigation = Navigation(client)
    handle = navigation.send(-3.0, 3.0)
    future = handle.get_result_async()
    client.wait(lambda: bool(navigation.feedback), "feedback")
    simulation.stop()
    assert client.result(future, "the result").status == ABORTED
    navigation.close()


def test_namespace_applies_to_everything_except_clock_and_tf(simulate: Simulate, ros_context: Any) -> None:
    simulate(namespace="/robot1")
    client = Client(ros_context, namespace="/robot1")
    try:
        client.make_ready()
        navigation = Navigation(client)
        assert navigation.result(navigation.send(0.3, 0.0)).status == SUCCEEDED
        navigation.close()
        topics = {name for name, _ in client.node.get_topic_names_and_types()}
        expected = {"/clock", "/tf", "/robot1/odometry/filtered", "/robot1/scan", "/robot1/cmd_vel"}
        assert expected | {"/robot1/amcl_pose", "/robot1/initialpose"} <= topics
        assert "/robot1/clock" not in topics
    finally:
        client.close()


def test_reject_fault_rejects_first_goal(simulate: Simulate, client: Client) -> None:
    simulate(faults=plan("navigate_to_pose:reject=1"))
    client.make_ready()
    navigation = Navigation(client)
    assert not navigation.send(0.3, 0.0).accepted
    assert navigation.send(0.3, 0.0).accepted
    navigation.close()


def test_abort_fault_aborts_goals_for_zone(simulate: Simulate, client: Client) -> None:
    simulate(faults=plan("navigate_to_pose:abort=zone_b"))
    client.make_ready()
    navigation = Navigation(client)
    result = navigation.result(navigation.send(3.5, 3.0))
    assert (result.status, result.result.error_code) == (ABORTED, 208)
    assert navigation.result(navigation.send(0.3, 0.0)).status == SUCCEEDED
    navigation.close()


def test_code_fault_aborts_goal_after_given_time(simulate: Simulate, client: Client) -> None:
    simulation = simulate(faults=plan("navigate_to_pose:code=107@zone_b,after=4s"))
    client.make_ready()
    navigation = Navigation(client)
    result = navigation.result(navigation.send(3.5, 3.0))
    assert (result.status, result.result.error_code) == (ABORTED, 107)
    assert simulation.robot_pose().distance_to(Pose2D(0.0, 0.0)) > 0.5
    assert seconds(navigation.feedback[-1].navigation_time) == pytest.approx(4.0, abs=0.2)
    navigation.close()


class Spy:
    """A robot's movement according to its odometry."""

    def __init__(self, client: Client) -> None:
        from nav_msgs.msg import Odometry

        self._client, self._odometry = client, client.listen(Odometry, "odometry/filtered", 1000)

    def stands(self) -> bool:
        return bool(self._odometry) and self._odometry[-1].twist.twist.linear.x == 0.0

    def drives_for(self, ended: float) -> float:
        """Wait until the robot stands; return for how many simulated seconds it has driven since *ended*."""
        self._client.wait(self.stands, "the robot's standing still")
        moving = [each for each in self._odometry if each.twist.twist.linear.x > 0.02]
        return seconds(moving[-1].header.stamp) - ended


def test_late_fault_lets_robot_drive_after_abort(simulate: Simulate, client: Client) -> None:
    simulation = simulate(speed=5.0, faults=plan("navigate_to_pose:late=50ms@zone_b,drives=3s"))
    client.make_ready()
    spy, navigation = Spy(client), Navigation(client)
    result = navigation.result(navigation.send(3.5, 3.0))
    assert (result.status, result.result.error_code) == (ABORTED, 0)
    ended = simulation.sim_time
    client.wait(lambda: not spy.stands(), "a robot that drives without a goal")
    assert spy.drives_for(ended) == pytest.approx(3.0, abs=1.0)
    assert navigation.result(navigation.send(3.5, 3.0)).status == SUCCEEDED
    navigation.close()


@pytest.mark.parametrize(
    ("fault", "logger", "text"),
    [
        (
            "late=50ms",
            "bt_navigator_navigate_to_pose_rclcpp_node",
            "Timed out while waiting for action server to acknowledge goal request for follow_path",
        ),
        ("starved", "tf_help", "Transform data too old when converting from map to odom"),
    ],
)
def test_late_or_starved_fault_aborts_every_goal_without_code_and_logs_reason(
    simulate: Simulate, client: Client, fault: str, logger: str, text: str
) -> None:
    from rcl_interfaces.msg import Log

    lines: list[Any] = client.listen(Log, "/rosout", 100)
    simulate(speed=5.0, faults=plan(f"navigate_to_pose:{fault}"))
    client.make_ready()
    navigation = Navigation(client)
    for _ in range(2):
        result = navigation.result(navigation.send(3.5, 3.0))
        assert (result.status, result.result.error_code, result.result.error_msg) == (ABORTED, 0, "")
    client.wait(lambda: [each.msg for each in lines if each.name == logger] == [text] * 2, "the reason")
    navigation.close()


def test_delay_within_timeout_of_nav2_is_harmless(simulate: Simulate, client: Client) -> None:
    simulate(faults=plan("navigate_to_pose:late=20ms"))
    client.make_ready()
    navigation = Navigation(client)
    assert navigation.result(navigation.send(0.5, 0.0)).status == SUCCEEDED
    navigation.close()


def test_cancel_of_follow_path_stops_robot_without_goal(simulate: Simulate, client: Client) -> None:
    from action_msgs.srv import CancelGoal

    simulation = simulate(speed=2.0, faults=plan("navigate_to_pose:late=50ms@zone_b,drives=60s"))
    client.make_ready()
    spy, navigation = Spy(client), Navigation(client)
    assert navigation.result(navigation.send(3.5, 3.0)).status == ABORTED
    client.wait(lambda: not spy.stands(), "a robot that drives without a goal")
    client.call(CancelGoal, "follow_path/_action/cancel_goal", CancelGoal.Request())
    assert spy.drives_for(simulation.sim_time) < 2.0
    navigation.close()


def test_delay_fault_delays_acknowledgement_of_goals(simulate: Simulate, client: Client) -> None:
    simulation = simulate(faults=plan("navigate_to_pose:delay=5s"))
    client.make_ready()
    navigation = Navigation(client)
    began = simulation.sim_time
    handle = navigation.send(0.5, 0.0)
    assert simulation.sim_time - began >= 5.0
    assert navigation.result(handle).status == SUCCEEDED
    navigation.close()


def test_localisation_crash_ends_drive_and_restart_needs_pose(simulate: Simulate, client: Client) -> None:
    simulation = simulate(faults=plan("amcl:die@zone_b,back=5"))
    client.make_ready()
    spy, navigation = Spy(client), Navigation(client)
    result = navigation.result(navigation.send(3.5, 3.0))
    assert (result.status, result.result.error_code) == (ABORTED, 0)
    assert "pose is unknown" in result.result.error_msg
    client.wait(spy.stands, "the robot's standing still")
    assert client.state_of("bt_navigator") == "active", "it lives on"
    assert client.state_of("amcl") == "active", "back"
    assert navigation.result(navigation.send(3.5, 3.0)).status == ABORTED
    client.set_initial_pose(simulation.robot_pose())
    assert navigation.result(navigation.send(3.5, 3.0)).status == SUCCEEDED
    navigation.close()


@pytest.fixture
def like_nav2(simulate: Simulate, client: Client) -> Iterator[tuple["Simulation", Navigation]]:
    """A simulation whose stand-in drives like Nav2."""
    simulation = simulate(robots=[Placement("", like="nav2")])
    client.make_ready()
    navigation = Navigation(client)
    yield simulation, navigation
    navigation.close()


def test_nav2_mode_aborts_goal_in_obstacle_with_208_after_recoveries(
    like_nav2: tuple["Simulation", Navigation],
) -> None:
    simulation, navigation = like_nav2
    result = navigation.result(navigation.send(3.0, -3.0))
    assert (result.status, result.result.error_code) == (ABORTED, 208)
    assert [each.number_of_recoveries for each in navigation.feedback] == list(range(7))
    assert simulation.robot_pose().distance_to(Pose2D(0.0, 0.0)) == pytest.approx(0.3, abs=0.1)


def test_nav2_mode_reports_no_distance_at_first_and_ends_within_tolerance(
    like_nav2: tuple["Simulation", Navigation],
) -> None:
    simulation, navigation = like_nav2
    assert navigation.result(navigation.send(-1.0, 1.5)).status == SUCCEEDED
    assert navigation.feedback[0].distance_remaining == 0.0
    assert navigation.feedback[1].distance_remaining > 1.0
    assert 0.1 < simulation.robot_pose().distance_to(Pose2D(-1.0, 1.5)) < 0.3


def test_nav2_mode_removes_passed_poses_every_three_seconds(
    like_nav2: tuple["Simulation", Navigation],
) -> None:
    _, navigation = like_nav2
    assert navigation.result(navigation.send_through(*ON_THE_WAY)).status == SUCCEEDED
    first, *told = navigation.feedback
    assert (first.distance_remaining, first.number_of_poses_remaining) == (0.0, 3)
    for _, group in itertools.groupby(told, key=lambda each: each.number_of_poses_remaining):
        began = next(group).navigation_time
        assert (began.sec + began.nanosec / 1e9) % 3.0 < 0.2


def test_nav2_mode_accepts_goal_beside_free_ground(
    like_nav2: tuple["Simulation", Navigation],
) -> None:
    _, navigation = like_nav2
    assert navigation.result(navigation.send(0.15, 1.45)).status == SUCCEEDED


def test_nav2_mode_cancels_goal_during_recovery(
    like_nav2: tuple["Simulation", Navigation], client: Client
) -> None:
    simulation, navigation = like_nav2
    handle = navigation.send(3.0, -3.0)
    began = simulation.sim_time
    client.wait(lambda: simulation.sim_time > began + 1.5, "the first spin")
    client.result(handle.cancel_goal_async(), "the answer to the cancel")
    assert navigation.result(handle).status == CANCELED


def test_crashed_server_sends_no_result_and_does_not_return(simulate: Simulate, client: Client) -> None:
    simulation = simulate(faults=plan("navigate_to_pose:die@zone_c"))
    client.make_ready()
    navigation = Navigation(client)
    future = navigation.send(4.0, -3.0).get_result_async()
    client.wait(lambda: not navigation.server_is_ready(), "the server's disappearance")
    began = simulation.sim_time
    client.wait(lambda: simulation.sim_time > began + 20.0, "20 simulated seconds")
    assert not future.done()
    assert not navigation.server_is_ready()
    assert simulation.robot_pose().distance_to(Pose2D(4.0, -3.0)) > 1.0
    navigation.close()


def test_restarted_server_serves_zone(simulate: Simulate, client: Client) -> None:
    simulation = simulate(faults=plan("navigate_to_pose:die@zone_c,back=5"))
    client.make_ready()
    navigation = Navigation(client)
    navigation.send(4.0, -3.0)
    client.wait(lambda: not navigation.server_is_ready(), "the server's disappearance")
    client.wait(navigation.server_is_ready, "the server's return")
    client.wait(lambda: client.state_of("bt_navigator") == "active", "bt_navigator's becoming active")
    assert navigation.result(navigation.send(4.0, -3.0)).status == SUCCEEDED
    assert simulation.robot_pose().distance_to(Pose2D(4.0, -3.0)) < 0.1
    navigation.close()
