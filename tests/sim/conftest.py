"""Fixtures of the simulator's tests: the shipped world, and a ROS client of a running simulation."""

import time
from collections.abc import Callable, Iterator
from typing import Any

import pytest

from sar_compiler.sim.geometry import Pose2D
from sar_compiler.sim.occupancy import OccupancyMap, read_map
from sar_compiler.sim.world import World, find_world
from tests.waiting import SILENCE_SEC

_AGAIN_SEC = 1.0


@pytest.fixture(scope="session")
def disaster_zone() -> World:
    return find_world("disaster_zone")


@pytest.fixture(scope="session")
def shipped_map(disaster_zone: World) -> OccupancyMap:
    assert disaster_zone.map_path is not None
    return read_map(disaster_zone.map_path)


class Client:
    """A node beside a simulation, with an executor that spins until a condition holds."""

    def __init__(self, context: Any, namespace: str | None = None) -> None:
        import rclpy
        from rclpy.executors import SingleThreadedExecutor

        self.context = context
        self.node = rclpy.create_node("client", context=context, namespace=namespace)
        self.executor = SingleThreadedExecutor(context=context)
        self.executor.add_node(self.node)

    def wait(self, happened: Callable[[], bool], what: str, timeout_sec: float = SILENCE_SEC) -> None:
        deadline = time.monotonic() + timeout_sec
        while not happened():
            assert time.monotonic() < deadline, f"{what} did not come within {timeout_sec:g} s"
            self.executor.spin_once(timeout_sec=0.1)

    def result(self, future: Any, what: str) -> Any:
        self.wait(future.done, what)
        return future.result()

    def call(self, service_type: Any, name: str, request: Any) -> Any:
        client = self.node.create_client(service_type, name)
        try:
            self.wait(client.service_is_ready, f"service {name}")
            return self.result(client.call_async(request), f"an answer of {name}")
        finally:
            self.node.destroy_client(client)

    def state_of(self, node: str) -> str:
        from lifecycle_msgs.srv import GetState

        label: str = self.call(GetState, f"{node}/get_state", GetState.Request()).current_state.label
        return label

    def listen(self, message_type: Any, topic: str, qos: Any = 10) -> list[Any]:
        received: list[Any] = []
        self.node.create_subscription(message_type, topic, received.append, qos)
        return received

    def set_initial_pose(
        self, pose: Pose2D | None = None, frame: str = "map", timeout_sec: float = SILENCE_SEC
    ) -> Any:
        """Publish the initial pose until a pose arrives on `amcl_pose`, and return this pose."""
        from geometry_msgs.msg import PoseWithCovarianceStamped
        from rclpy.qos import DurabilityPolicy, QoSProfile

        from sar_compiler.sim.messages import to_pose

        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        answers = self.listen(PoseWithCovarianceStamped, "amcl_pose", latched)
        publisher = self.node.create_publisher(PoseWithCovarianceStamped, "initialpose", 10)
        self.wait(lambda: publisher.get_subscription_count() > 0, "a subscriber of initialpose")
        message = PoseWithCovarianceStamped()
        message.header.frame_id = frame
        message.pose.pose = to_pose(pose or Pose2D(0.0, 0.0))

        due = time.monotonic()

        def answered() -> bool:
            nonlocal due
            # Rarely: a pose that is still in transit when the robot drives would reset its localisation.
            if time.monotonic() >= due:
                publisher.publish(message)
                due = time.monotonic() + _AGAIN_SEC
            return bool(answers)

        self.wait(answered, "amcl_pose", timeout_sec)
        return answers[-1]

    def make_ready(self, start: Pose2D | None = None) -> None:
        self.set_initial_pose(start)
        self.wait(lambda: self.state_of("bt_navigator") == "active", "bt_navigator's becoming active")

    def close(self) -> None:
        self.executor.shutdown()
        self.node.destroy_node()


class Navigation:
    """An action client of `navigate_to_pose`, and of `navigate_through_poses`."""

    def __init__(self, client: Client) -> None:
        from nav2_msgs.action import NavigateToPose
        from rclpy.action import ActionClient

        self._client = client
        self._action = ActionClient(client.node, NavigateToPose, "navigate_to_pose")
        self._through: Any = None
        self.feedback: list[Any] = []
        client.wait(self._action.server_is_ready, "the server of navigate_to_pose")

    def server_is_ready(self) -> bool:
        return bool(self._action.server_is_ready())

    def send(self, x: float, y: float, yaw: float = 0.0, *, frame: str = "map", tree: str = "") -> Any:
        """Send a goal, and return its handle after the response."""
        from nav2_msgs.action import NavigateToPose

        from sar_compiler.sim.messages import to_pose

        goal = NavigateToPose.Goal(behavior_tree=tree)
        goal.pose.header.frame_id = frame
        goal.pose.pose = to_pose(Pose2D(x, y, yaw))
        note = self._on_feedback
        return self._client.result(
            self._action.send_goal_async(goal, feedback_callback=note), "a goal's answer"
        )

    def send_through(self, *places: tuple[float, float]) -> Any:
        """Send a goal through several positions, and return its handle after the response."""
        from geometry_msgs.msg import PoseStamped
        from nav2_msgs.action import NavigateThroughPoses
        from rclpy.action import ActionClient

        from sar_compiler.sim.messages import to_pose

        if self._through is None:
            self._through = ActionClient(self._client.node, NavigateThroughPoses, "navigate_through_poses")
        self._client.wait(self._through.server_is_ready, "the server of navigate_through_poses")
        goal = NavigateThroughPoses.Goal(poses=[PoseStamped(pose=to_pose(Pose2D(*each))) for each in places])
        for pose in goal.poses:
            pose.header.frame_id = "map"
        note = self._on_feedback
        return self._client.result(
            self._through.send_goal_async(goal, feedback_callback=note), "a goal's answer"
        )

    def result(self, handle: Any) -> Any:
        return self._client.result(handle.get_result_async(), "a goal's result")

    def close(self) -> None:
        for action in filter(None, (self._action, self._through)):
            action.destroy()

    def _on_feedback(self, message: Any) -> None:
        self.feedback.append(message.feedback)


@pytest.fixture(scope="session")
def ros_context() -> Iterator[Any]:
    """One context for all tests of the process: many contexts do not discover each other reliably."""
    import rclpy

    context = rclpy.Context()
    context.init()
    yield context
    context.try_shutdown()


@pytest.fixture
def client(ros_context: Any) -> Iterator[Client]:
    made = Client(ros_context)
    yield made
    made.close()


@pytest.fixture
def simulate(ros_context: Any, disaster_zone: World) -> Iterator[Callable[..., Any]]:
    """Return a function that starts simulations; they end with the test, and none may have failed."""
    from sar_compiler.sim.simulation import Simulation

    running: list[Simulation] = []

    def start(world: World | None = None, *, speed: float = 20.0, **options: Any) -> Simulation:
        simulation = Simulation(world or disaster_zone, speed=speed, context=ros_context, **options)
        running.append(simulation)
        simulation.start()
        return simulation

    yield start
    for simulation in running:
        simulation.stop()
        assert simulation.failure is None


@pytest.fixture
def navigation(simulate: Callable[..., Any], client: Client) -> Iterator[Navigation]:
    """A running simulation, localised and active, and a client of its action."""
    simulate()
    client.make_ready()
    made = Navigation(client)
    yield made
    made.close()
