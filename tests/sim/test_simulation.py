"""The simulator on ROS: topics, localiser, navigation server, faults; over real DDS."""

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


def test_the_clock_goes_on_in_equal_steps_none_left_out(simulate: Simulate, client: Client) -> None:
    from rosgraph_msgs.msg import Clock

    simulate(speed=10.0)
    ticks = client.listen(Clock, "/clock", 100)
    client.wait(lambda: len(ticks) >= 100, "100 ticks of the clock")
    times = [seconds(tick.clock) for tick in ticks]
    assert all(after - before == pytest.approx(0.05) for before, after in itertools.pairwise(times))


def test_whoever_asks_more_of_a_topic_than_it_gives_is_warned_of(
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


def test_the_speed_is_an_upper_bound(simulate: Simulate, client: Client) -> None:
    simulation = simulate(speed=5.0)
    began, start = time.monotonic(), simulation.sim_time
    client.wait(lambda: simulation.sim_time > start + 3.0, "3 simulated seconds")
    assert 3.0 / (time.monotonic() - began) < 5.5


def test_a_listener_that_does_not_follow_holds_it_to_real_time(disaster_zone: World, client: Client) -> None:
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


def test_a_speed_of_nothing_is_refused(disaster_zone: World, ros_context: Any) -> None:
    from sar_compiler.sim.simulation import Simulation, SimulationError

    with pytest.raises(SimulationError, match="above 0"):
        Simulation(disaster_zone, speed=0.0, context=ros_context)


def test_a_fault_at_a_zone_that_is_not_there_is_refused(disaster_zone: World, ros_context: Any) -> None:
    from sar_compiler.sim.simulation import Simulation

    with pytest.raises(FaultError, match="zone_x"):
        Simulation(disaster_zone, faults=plan("navigate_to_pose:abort=zone_x"), context=ros_context)


def test_stopping_twice_or_before_the_start_does_nothing(disaster_zone: World, ros_context: Any) -> None:
    from sar_compiler.sim.simulation import Simulation

    simulation = Simulation(disaster_zone, context=ros_context)
    simulation.stop()
    simulation.stop()
    assert simulation.sim_time == 0.0


def test_stopping_at_a_slow_speed_takes_less_than_a_second(simulate: Simulate) -> None:
    simulation = simulate(speed=0.001)
    watch = Stopwatch()
    simulation.stop()
    assert watch.own_sec < 1.0


def test_a_world_without_a_map_has_the_robots_topics_only(simulate: Simulate, client: Client) -> None:
    from nav_msgs.msg import Odometry

    simulate(find_world("empty"))
    odometry = client.listen(Odometry, "odometry/filtered")
    client.wait(lambda: bool(odometry), "odometry")
    assert "bt_navigator" not in client.node.get_node_names()


def test_a_velocity_command_moves_the_robot_until_it_times_out(simulate: Simulate, client: Client) -> None:
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


def test_a_scan_shows_the_walls(simulate: Simulate, client: Client) -> None:
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


def test_the_localiser_answers_an_initial_pose_and_only_then_there_is_a_map_frame(
    simulate: Simulate, client: Client
) -> None:
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


def test_the_last_pose_is_there_for_those_who_come_late(simulate: Simulate, client: Client) -> None:
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


def test_the_map_and_the_plan_are_published_as_by_nav2(simulate: Simulate, client: Client) -> None:
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
def test_an_initial_pose_that_cannot_be_is_ignored(
    simulate: Simulate, client: Client, pose: Pose2D, frame: str
) -> None:
    simulate()
    with pytest.raises(AssertionError, match="amcl_pose did not come"):
        client.set_initial_pose(pose, frame, timeout_sec=1.0)


def test_a_localisation_that_is_told_a_wrong_pose_believes_it_and_the_robot_drives_beside_its_goal(
    simulate: Simulate, client: Client
) -> None:
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


def test_a_robot_that_goes_on_where_it_stood_needs_no_pose(simulate: Simulate, client: Client) -> None:
    stood = Pose2D(-0.5, 0.8, 1.0)
    simulation = simulate(robots=[Placement("", stood, Pose2D(3.0, 2.0), localised=True)])
    client.wait(lambda: client.state_of("bt_navigator") == "active", "bt_navigator's becoming active")
    navigation = Navigation(client)
    assert navigation.result(navigation.send(0.0, 0.0)).status == SUCCEEDED
    assert simulation.robot_pose().distance_to(Pose2D(0.0, 0.0)) < 0.1
    navigation.close()


def test_the_commands_of_a_drive_are_on_cmd_vel_and_end_with_zero(simulate: Simulate, client: Client) -> None:
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


def test_a_goal_is_driven_with_feedback_at_ten_hertz(simulate: Simulate, client: Client) -> None:
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


def test_an_inactive_navigator_rejects_goals(simulate: Simulate, client: Client) -> None:
    simulate()
    navigation = Navigation(client)
    assert not navigation.send(1.0, 0.0).accepted
    navigation.close()


def test_a_cancelled_goal_ends_canceled_with_the_robot_standing(simulate: Simulate, client: Client) -> None:
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


def test_a_second_goal_pre_empts_the_first(simulate: Simulate, client: Client) -> None:
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


def test_a_goal_that_is_pre_empted_while_it_is_cancelled_ends_canceled(
    simulate: Simulate, client: Client
) -> None:
    simulation = simulate()
    client.make_ready()
    navigation = Navigation(client)
    first = navigation.send(-3.0, 3.0)
    client.wait(lambda: simulation.robot_pose().distance_to(Pose2D(0.0, 0.0)) > 0.3, "movement")
    # The two requests go to different services: which of them the server hears first is not known otherwise.
    canceling = first.cancel_goal_async()
    client.wait(canceling.done, "the answer to the cancel")
    second = navigation.send(0.5, 0.0)
    assert navigation.result(first).status == CANCELED
    assert navigation.result(second).status == SUCCEEDED
    navigation.close()


# Places on the way from home to zone_a.
ON_THE_WAY = ((-0.8, 1.0), (-1.9, 1.9), (-3.0, 3.0))


def test_poses_are_driven_through_without_a_stop_and_counted_down(simulate: Simulate, client: Client) -> None:
    simulation = simulate()
    client.make_ready()
    navigation = Navigation(client)
    handle = navigation.send_through(*ON_THE_WAY)
    odometry = client.listen(type_of_odometry(), "odometry/filtered")
    assert navigation.result(handle).status == SUCCEEDED
    assert simulation.robot_pose().distance_to(Pose2D(*ON_THE_WAY[-1])) < 0.1
    left = [each.number_of_poses_remaining for each in navigation.feedback]
    assert [number for number, _ in itertools.groupby(left)] == [3, 2, 1]
    # What is left is the whole way, and not that to the next pose.
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


def test_poses_of_which_one_cannot_be_reached_are_aborted_with_the_code_of_nav2(
    navigation: Navigation,
) -> None:
    ended = navigation.result(navigation.send_through(ON_THE_WAY[0], (3.0, -3.0)))
    assert (ended.status, ended.result.error_code) == (ABORTED, 306)


def test_a_drive_through_poses_is_cancelled_on_the_way(navigation: Navigation, client: Client) -> None:
    handle = navigation.send_through(*ON_THE_WAY)
    client.wait(
        lambda: any(each.number_of_poses_remaining == 2 for each in navigation.feedback), "the second pose"
    )
    client.result(handle.cancel_goal_async(), "the answer to the cancel request")
    assert navigation.result(handle).status == CANCELED


def test_a_goal_of_one_action_is_aborted_while_one_of_the_other_is_driven_to(navigation: Navigation) -> None:
    first = navigation.send_through(*ON_THE_WAY)
    ended = navigation.result(navigation.send(0.5, 0.0))
    assert (ended.status, ended.result.error_code) == (ABORTED, 0)
    assert navigation.result(first).status == SUCCEEDED


def test_a_goal_through_no_pose_is_aborted(navigation: Navigation) -> None:
    ended = navigation.result(navigation.send_through())
    assert (ended.status, ended.result.error_code) == (ABORTED, 309)


def test_a_goal_with_a_tree_that_is_not_there_is_aborted(navigation: Navigation) -> None:
    ended = navigation.result(navigation.send(0.5, 0.0, tree="/no/such/tree.xml"))
    assert (ended.status, ended.result.error_code) == (ABORTED, 0)
    assert "/no/such/tree.xml" in ended.result.error_msg


def test_a_second_goal_with_another_tree_is_ended_itself(navigation: Navigation) -> None:
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
def test_a_goal_that_cannot_be_is_accepted_and_aborted_with_the_code_of_nav2(
    navigation: Navigation, x: float, y: float, frame: str, code: int
) -> None:
    handle = navigation.send(x, y, frame=frame)
    assert handle.accepted
    result = navigation.result(handle)
    assert (result.status, result.result.error_code) == (ABORTED, code)
    assert result.result.error_msg


def test_the_server_survives_a_client_that_goes_away(
    simulate: Simulate, client: Client, ros_context: Any
) -> None:
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


def test_the_end_of_the_simulation_aborts_the_goal_under_way(simulate: Simulate, client: Client) -> None:
    simulation = simulate()
    client.make_ready()
    navigation = Navigation(client)
    handle = navigation.send(-3.0, 3.0)
    future = handle.get_result_async()
    client.wait(lambda: bool(navigation.feedback), "feedback")
    simulation.stop()
    assert client.result(future, "the result").status == ABORTED
    navigation.close()


def test_a_namespace_moves_everything_but_the_clock_and_tf(simulate: Simulate, ros_context: Any) -> None:
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


def test_goals_are_rejected_on_request(simulate: Simulate, client: Client) -> None:
    simulate(faults=plan("navigate_to_pose:reject=1"))
    client.make_ready()
    navigation = Navigation(client)
    assert not navigation.send(0.3, 0.0).accepted
    assert navigation.send(0.3, 0.0).accepted
    navigation.close()


def test_goals_for_a_zone_are_aborted_on_request(simulate: Simulate, client: Client) -> None:
    simulate(faults=plan("navigate_to_pose:abort=zone_b"))
    client.make_ready()
    navigation = Navigation(client)
    result = navigation.result(navigation.send(3.5, 3.0))
    assert (result.status, result.result.error_code) == (ABORTED, 208)
    assert navigation.result(navigation.send(0.3, 0.0)).status == SUCCEEDED
    navigation.close()


def test_a_goal_is_driven_until_its_code_comes_on_request(simulate: Simulate, client: Client) -> None:
    simulation = simulate(faults=plan("navigate_to_pose:code=107@zone_b,after=4s"))
    client.make_ready()
    navigation = Navigation(client)
    result = navigation.result(navigation.send(3.5, 3.0))
    assert (result.status, result.result.error_code) == (ABORTED, 107)
    assert simulation.robot_pose().distance_to(Pose2D(0.0, 0.0)) > 0.5
    assert seconds(navigation.feedback[-1].navigation_time) == pytest.approx(4.0, abs=0.2)
    navigation.close()


class Spy:
    """What the odometry says of a robot's movement."""

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


def test_a_robot_drives_on_after_an_abort_on_request(simulate: Simulate, client: Client) -> None:
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
def test_a_busy_computer_ends_every_goal_without_a_code_and_logs_the_reason_as_nav2_does(
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


def test_a_server_that_is_late_within_nav2s_time_out_harms_nothing(
    simulate: Simulate, client: Client
) -> None:
    simulate(faults=plan("navigate_to_pose:late=20ms"))
    client.make_ready()
    navigation = Navigation(client)
    assert navigation.result(navigation.send(0.5, 0.0)).status == SUCCEEDED
    navigation.close()


def test_what_drives_without_a_goal_is_stopped_by_a_cancel_of_the_path_it_follows(
    simulate: Simulate, client: Client
) -> None:
    from action_msgs.srv import CancelGoal

    simulation = simulate(speed=2.0, faults=plan("navigate_to_pose:late=50ms@zone_b,drives=60s"))
    client.make_ready()
    spy, navigation = Spy(client), Navigation(client)
    assert navigation.result(navigation.send(3.5, 3.0)).status == ABORTED
    client.wait(lambda: not spy.stands(), "a robot that drives without a goal")
    client.call(CancelGoal, "follow_path/_action/cancel_goal", CancelGoal.Request())
    assert spy.drives_for(simulation.sim_time) < 2.0
    navigation.close()


def test_goals_are_acknowledged_late_on_request(simulate: Simulate, client: Client) -> None:
    simulation = simulate(faults=plan("navigate_to_pose:delay=5s"))
    client.make_ready()
    navigation = Navigation(client)
    began = simulation.sim_time
    handle = navigation.send(0.5, 0.0)
    assert simulation.sim_time - began >= 5.0
    assert navigation.result(handle).status == SUCCEEDED
    navigation.close()


def test_a_localisation_that_dies_ends_the_drive_and_is_back_without_a_pose(
    simulate: Simulate, client: Client
) -> None:
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
    """A simulation whose stand-in drives as Nav2 does."""
    simulation = simulate(robots=[Placement("", like="nav2")])
    client.make_ready()
    navigation = Navigation(client)
    yield simulation, navigation
    navigation.close()


def test_like_nav2_a_goal_in_an_obstacle_is_208_after_recoveries_that_move_the_robot(
    like_nav2: tuple["Simulation", Navigation],
) -> None:
    simulation, navigation = like_nav2
    result = navigation.result(navigation.send(3.0, -3.0))
    assert (result.status, result.result.error_code) == (ABORTED, 208)
    assert [each.number_of_recoveries for each in navigation.feedback] == list(range(7))
    assert simulation.robot_pose().distance_to(Pose2D(0.0, 0.0)) == pytest.approx(0.3, abs=0.1)


def test_like_nav2_it_is_told_no_distance_at_first_and_ends_within_the_tolerance(
    like_nav2: tuple["Simulation", Navigation],
) -> None:
    simulation, navigation = like_nav2
    assert navigation.result(navigation.send(-1.0, 1.5)).status == SUCCEEDED
    assert navigation.feedback[0].distance_remaining == 0.0
    assert navigation.feedback[1].distance_remaining > 1.0
    assert 0.1 < simulation.robot_pose().distance_to(Pose2D(-1.0, 1.5)) < 0.3


def test_like_nav2_poses_that_were_passed_are_left_out_every_three_seconds(
    like_nav2: tuple["Simulation", Navigation],
) -> None:
    _, navigation = like_nav2
    assert navigation.result(navigation.send_through(*ON_THE_WAY)).status == SUCCEEDED
    first, *told = navigation.feedback
    assert (first.distance_remaining, first.number_of_poses_remaining) == (0.0, 3)
    for _, group in itertools.groupby(told, key=lambda each: each.number_of_poses_remaining):
        began = next(group).navigation_time
        assert (began.sec + began.nanosec / 1e9) % 3.0 < 0.2


def test_like_nav2_a_goal_beside_free_ground_is_driven_to_as_near_as_can_be(
    like_nav2: tuple["Simulation", Navigation],
) -> None:
    _, navigation = like_nav2
    assert navigation.result(navigation.send(0.15, 1.45)).status == SUCCEEDED


def test_like_nav2_a_goal_is_canceled_during_a_recovery(
    like_nav2: tuple["Simulation", Navigation], client: Client
) -> None:
    simulation, navigation = like_nav2
    handle = navigation.send(3.0, -3.0)
    began = simulation.sim_time
    client.wait(lambda: simulation.sim_time > began + 1.5, "the first spin")
    client.result(handle.cancel_goal_async(), "the answer to the cancel")
    assert navigation.result(handle).status == CANCELED


def test_a_server_that_dies_says_nothing_stands_and_stays_away(simulate: Simulate, client: Client) -> None:
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


def test_a_server_that_comes_back_serves_the_zone(simulate: Simulate, client: Client) -> None:
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
