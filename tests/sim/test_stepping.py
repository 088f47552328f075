"""Tests of a simulation in the executor's thread: no simulated time passes while a node has work to do."""

import time
from collections.abc import Callable, Iterator
from typing import Any

import pytest

from sar_compiler.sim.placement import Placement
from sar_compiler.sim.simulation import STEP_SEC
from sar_compiler.sim.world import World

pytestmark = pytest.mark.ros

Start = Callable[..., tuple[Any, Any]]


@pytest.fixture
def start(ros_context: Any, disaster_zone: World) -> Iterator[Start]:
    """Return a function that starts a simulation, and returns it with its executor."""
    from sar_compiler.sim.node_host import SteppedExecutor
    from sar_compiler.sim.simulation import Simulation

    executor = SteppedExecutor(ros_context)
    running: list[Simulation] = []

    def begin(speed: float = 1000.0, **options: Any) -> tuple[Simulation, SteppedExecutor]:
        running.append(
            Simulation(disaster_zone, speed=speed, context=ros_context, executor=executor, **options)
        )
        running[-1].start()
        return running[-1], executor

    yield begin
    for each in running:
        each.stop()
    executor.shutdown()


def test_each_spin_makes_one_step(start: Start) -> None:
    simulation, executor = start()
    for count in range(4):
        assert simulation.sim_time == pytest.approx(count * STEP_SEC)
        executor.spin_once()


def test_response_arrives_one_step_after_request(start: Start, ros_context: Any) -> None:
    from rclpy.node import Node
    from rosgraph_msgs.msg import Clock
    from std_srvs.srv import Trigger

    node = Node("asking", context=ros_context, start_parameter_services=False)
    _, executor = start(extra_nodes=[node])
    node.create_service(Trigger, "answer", lambda _, response: response)
    client = node.create_client(Trigger, "answer")
    assert client.wait_for_service(5.0)
    asked: list[Any] = []
    heard: list[int] = []

    def ask(message: Any) -> None:
        heard.append(message.clock.nanosec)
        asked.append(client.call_async(Trigger.Request()))

    node.create_subscription(Clock, "/clock", ask, 10)
    for _ in range(3):
        executor.spin_once()
    assert len(heard) == 3
    assert [each.done() for each in asked] == [True, True, False]
    node.destroy_node()


def test_node_with_guard_condition_is_served_with_simulation(start: Start, ros_context: Any) -> None:
    from rclpy.node import Node

    from sar_compiler.ros.executors import suitable_executor

    node = Node("guarded", context=ros_context, start_parameter_services=False)
    simulation, executor = start(extra_nodes=[node])
    heard: list[str] = []
    guard = node.create_guard_condition(lambda: heard.append("the guard"))
    for _ in range(2):
        assert suitable_executor(executor, node) is executor
    guard.trigger()
    executor.spin_once()
    assert heard == ["the guard"]
    assert simulation.sim_time == pytest.approx(STEP_SEC)
    node.destroy_node()


def test_stepping_is_not_faster_than_given_speed(start: Start) -> None:
    _, executor = start(speed=2.0)
    began = time.monotonic()
    for _ in range(5):
        executor.spin_once()
    assert time.monotonic() - began >= 4 * STEP_SEC / 2.0


def test_failing_step_ends_simulation(start: Start, monkeypatch: pytest.MonkeyPatch) -> None:
    from sar_compiler.sim.simulation import SimulatedRobot

    simulation, executor = start()
    executor.spin_once()
    wrong = ValueError("wrong")

    def fail(*_: object) -> None:
        raise wrong

    with monkeypatch.context() as patch:
        patch.setattr(SimulatedRobot, "move", fail)
        executor.spin_once()
    assert simulation.failure is wrong
    before = simulation.sim_time
    executor.spin_once()
    assert simulation.sim_time == before


def test_client_receives_end_of_goal_on_stop(start: Start, ros_context: Any) -> None:
    from nav2_msgs.action import NavigateToPose
    from rclpy.action import ActionClient
    from rclpy.node import Node

    node = Node("driving", context=ros_context, start_parameter_services=False)
    simulation, executor = start(robots=[Placement("", localised=True)], extra_nodes=[node])
    client = ActionClient(node, NavigateToPose, "navigate_to_pose")
    goal = NavigateToPose.Goal()
    goal.pose.header.frame_id = "map"
    goal.pose.pose.position.x, goal.pose.pose.position.y, goal.pose.pose.orientation.w = -3.0, 3.0, 1.0
    # Nav2 takes some seconds to become active.
    for _ in range(200):
        sent = client.send_goal_async(goal)
        for _ in range(3):
            executor.spin_once()
        if (accepted := sent.result()).accepted:
            break
    ended = accepted.get_result_async()
    executor.spin_once()
    simulation.stop()
    assert ended.done()
    client.destroy()
    node.destroy_node()


def test_stopped_simulation_makes_no_step(start: Start) -> None:
    simulation, executor = start()
    executor.spin_once()
    simulation.stop()
    executor.spin_once()
    assert simulation.sim_time == pytest.approx(STEP_SEC)
