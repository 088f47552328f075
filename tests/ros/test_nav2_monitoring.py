"""Tests of monitoring Nav2 while a tree runs, such as a localisation that is restarted."""

import math
import time
from typing import Any

import pytest

from sar_compiler.runtime.clock import ManualClock
from tests.faults.conftest import serve
from tests.ros.conftest import Ros, Said

__all__ = ["serve"]

pytestmark = pytest.mark.ros


class Nav2:
    """Nav2 as the monitor sees it, and the robot's odometry."""

    def __init__(self, ros: Ros) -> None:
        from geometry_msgs.msg import PoseWithCovarianceStamped
        from lifecycle_msgs.srv import GetState
        from nav_msgs.msg import Odometry
        from rclpy.qos import DurabilityPolicy, QoSProfile

        self.ros = ros
        self.navigator = "active"
        self.given: list[tuple[float, float]] = []
        self._pose, self._odometry = PoseWithCovarianceStamped, Odometry
        self._latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self._other = ros.node("nav2")
        self._other.create_service(GetState, "bt_navigator/get_state", self._state)
        self._other.create_subscription(PoseWithCovarianceStamped, "initialpose", self._take, 10)
        self._odometry_publisher = self._other.create_publisher(Odometry, "odometry/filtered", 10)
        self.start_amcl()

    def start_amcl(self) -> None:
        from lifecycle_msgs.srv import GetState

        self._amcl = self.ros.node("amcl")
        self._amcl.create_service(GetState, "amcl/get_state", self._active)
        self._poses = self._amcl.create_publisher(self._pose, "amcl_pose", self._latched)

    def stop_amcl(self) -> None:
        self.ros.remove(self._amcl)
        self.navigator = "inactive"

    def publish_pose(self, x: float, y: float) -> None:
        message = self._pose()
        message.header.frame_id = "map"
        message.pose.pose.position.x, message.pose.pose.position.y = x, y
        message.pose.pose.orientation.w = 1.0
        self._poses.publish(message)

    def publish_odometry(self, x: float) -> None:
        message = self._odometry()
        message.pose.pose.position.x = x
        message.pose.pose.orientation.w = 1.0
        self._odometry_publisher.publish(message)

    def _take(self, message: Any) -> None:
        self.given.append((message.pose.pose.position.x, message.pose.pose.position.y))

    def _state(self, _: Any, response: Any) -> Any:
        response.current_state.label = self.navigator
        return response

    def _active(self, _: Any, response: Any) -> Any:
        response.current_state.label = "active"
        return response


class Scene:
    """A monitor that the test polls."""

    def __init__(self, ros: Ros, said: Said) -> None:
        from sar_compiler.nodes.spec import Use
        from sar_compiler.ros.dependency_monitor import DependencyMonitor

        self.ros, self.said, self.nav2 = ros, said, Nav2(ros)
        self.watch: DependencyMonitor = DependencyMonitor(ros.node("mission"), [Use.nav2()])

    def until(self, wanted: Any, what: str) -> None:
        def looked() -> object:
            self.watch.poll()
            return wanted()

        self.ros.spin_until(looked, what)

    def begin(self, odometry: float | None = 0.0, pose: tuple[float, float] | None = (1.5, -2.0)) -> None:
        """Localise the robot, and wait until the monitor knows it."""
        known = self.watch._localisation
        assert known is not None
        if odometry is not None:
            self.measured(odometry)
        if pose is not None:
            self.nav2.publish_pose(*pose)
            self.until(lambda: known._robot.pose, "the pose")
        self.until(lambda: known._known, "Nav2's being active")

    def measured(self, odometry: float) -> None:
        """Publish odometry with the robot so many metres ahead, until it has arrived."""
        known = self.watch._localisation
        assert known is not None

        def has_come() -> bool:
            self.nav2.publish_odometry(odometry)
            return known._robot.odometry is not None and known._robot.odometry[0] == odometry

        self.until(has_come, "the odometry")

    def restart_amcl(self) -> None:
        self.nav2.stop_amcl()
        self.until(lambda: self.said.has("Nav2 is no longer active"), "the loss")
        self.nav2.start_amcl()


@pytest.fixture
def scene(ros: Ros, said: Said, monkeypatch: pytest.MonkeyPatch) -> Scene:
    from sar_compiler.ros import dependency_monitor

    monkeypatch.setattr(dependency_monitor, "_LOST_SEC", 0.3)
    return Scene(ros, said)


def test_last_pose_is_sent_again_if_robot_has_not_moved(scene: Scene) -> None:
    scene.begin()
    scene.restart_amcl()
    scene.until(lambda: scene.nav2.given, "the pose")
    assert scene.nav2.given == [(1.5, -2.0)]
    assert scene.said.has("The localisation is back. Its last pose (1.50, -2.00) is sent again")
    scene.nav2.navigator = "active"
    scene.until(lambda: scene.said.has("Nav2 is active again."), "the end of the loss")


def test_unconfigured_node_is_named_once_with_start_command(
    scene: Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    from sar_compiler.ros import dependency_monitor

    monkeypatch.setattr(dependency_monitor, "_RESPAWN_SEC", 0.3)
    scene.begin()
    scene.nav2.navigator = "unconfigured"
    line = (
        "bt_navigator was restarted, but Nav2's lifecycle manager has not configured it. Run: ros2 lifecycle set /bt_navigator configure && "
        "ros2 lifecycle set /bt_navigator activate"
    )
    scene.until(lambda: scene.said.has(line), "the remedy")
    scene.nav2.navigator = "active"
    scene.until(lambda: scene.said.has("Nav2 is active again."), "the end of the loss")
    assert sum("has not configured it" in each for each in scene.said.lines()) == 1


def test_operator_is_asked_for_pose_if_robot_has_moved(scene: Scene) -> None:
    scene.begin()
    scene.measured(0.3)
    scene.restart_amcl()
    scene.until(lambda: scene.said.has("the robot has moved by 0.30 m", "2D Pose Estimate"), "the question")
    assert scene.nav2.given == []


def test_operator_is_asked_for_pose_without_odometry(scene: Scene) -> None:
    scene.begin(odometry=None)
    scene.restart_amcl()
    scene.until(
        lambda: scene.said.has("without odometry it is unknown whether the robot has moved"), "the question"
    )
    assert scene.nav2.given == []


def test_operator_is_asked_for_pose_without_last_pose(scene: Scene) -> None:
    scene.begin(pose=None)
    scene.restart_amcl()
    scene.until(lambda: scene.said.has("its last pose is unknown"), "the question")
    assert scene.nav2.given == []


def test_no_pose_is_sent_if_only_navigator_is_inactive(scene: Scene) -> None:
    scene.begin()
    scene.nav2.navigator = "inactive"
    scene.until(lambda: scene.said.has("Nav2 is no longer active"), "the loss")
    end = time.monotonic() + 0.5
    scene.until(lambda: time.monotonic() > end, "some time in which nothing is sent")
    assert scene.nav2.given == []
    assert not scene.said.has("The localisation is back")


def test_missing_navigation_is_in_journal_until_it_is_back(scene: Scene) -> None:
    from sar_compiler.journal.journal import Journal
    from sar_compiler.ros.robot_observer import RobotObserver

    journal, told = Journal(), []
    journal.add_listener(lambda entry: told.append(entry.data["text"]) if entry.kind == "lacks" else None)
    RobotObserver(scene.watch._node, journal)
    scene.begin()
    scene.nav2.navigator = "inactive"
    scene.until(lambda: told, "the loss")
    scene.nav2.navigator = "active"
    scene.until(lambda: len(told) == 2, "its end")
    assert told == [
        "the navigation (Nav2) is not active: node bt_navigator: state 'inactive', must be 'active'",
        "",
    ]


def test_battery_changes_are_in_journal(scene: Scene) -> None:
    from sensor_msgs.msg import BatteryState

    from sar_compiler.journal.journal import Journal
    from sar_compiler.ros.robot_observer import RobotObserver

    journal, told = Journal(), []
    journal.clock = clock = ManualClock()
    journal.add_listener(lambda entry: told.append(entry.data["share"]) if entry.kind == "battery" else None)
    observer = RobotObserver(scene.watch._node, journal)
    for share in (0.904, 0.896, math.nan, 0.85):
        observer._on_message("battery", BatteryState(percentage=share))
        clock.advance(2.0)
    assert told == [0.9, 0.85]


def test_lost_discovery_replaces_other_missing_items(scene: Scene, monkeypatch: pytest.MonkeyPatch) -> None:
    scene.begin()
    known = scene.watch._localisation
    assert known is not None
    known._robot.lacks = "what was lacked before"
    monkeypatch.setattr(known, "_lost_discovery", lambda: "it receives nothing from amcl")
    scene.watch.poll()
    assert known._robot.lacks == scene.watch.lost_discovery == "it receives nothing from amcl"


def test_node_is_missing_until_it_responds_again(scene: Scene) -> None:
    scene.begin()
    robot = scene.watch._localisation._robot  # type: ignore[union-attr]
    scene.nav2.stop_amcl()
    scene.nav2.navigator = "active"
    scene.until(
        lambda: robot.lacks.startswith("the navigation (Nav2) is not active: node amcl: missing"), "the loss"
    )
    scene.nav2.start_amcl()
    lacks: list[str] = []

    def is_back() -> bool:
        lacks.append(robot.lacks)
        return scene.said.has("Nav2 is active again.")

    scene.until(is_back, "its return")
    assert all(lacks[:-1]), "it was not lacked before it had answered"
    assert lacks[-1] == ""


def test_state_of_node_is_shared_with_its_age(ros: Ros) -> None:
    from sar_compiler.ros.robot_estimate import robot_estimate

    Nav2(ros)
    node = ros.node("mission")
    amcl = robot_estimate(node).lifecycle("amcl")
    assert amcl.age_sec == float("inf")
    start = robot_estimate(node).lifecycle("amcl")
    ros.spin_until(lambda: start.poll() is None, "its state")
    assert (amcl.state, amcl.is_awaited()) == ("active", False)
    assert amcl.age_sec < 60.0
    drives = robot_estimate(node).driving_nodes
    ros.spin_until(lambda: drives.obstacle() == "", "the states of both")
    drives.ignore_answers()
    # Earlier answers are no longer used, and one query serves all users.
    assert drives.obstacle() is None
    ros.spin_until(lambda: drives.obstacle() == "", "their answers")
    assert len([each for each in node.clients if each.srv_name == "amcl/get_state"]) == 1


def test_stop_and_return_of_transforms_are_reported(scene: Scene, monkeypatch: pytest.MonkeyPatch) -> None:
    from geometry_msgs.msg import TransformStamped
    from rclpy.serialization import serialize_message
    from tf2_msgs.msg import TFMessage

    from sar_compiler.ros import robot_estimate

    monkeypatch.setattr(robot_estimate, "TRANSFORM_SEC", 0.3)
    known = scene.watch._localisation
    assert known is not None
    frame = TransformStamped()
    frame.header.frame_id, frame.child_frame_id = "map", "odom"
    publisher = scene.ros.node("tf").create_publisher(TFMessage, "/tf", 10)
    assert robot_estimate.FROM_MAP in serialize_message(TFMessage(transforms=[frame]))
    scene.begin()
    scene.until(
        lambda: (publisher.publish(TFMessage(transforms=[frame])), known._robot.transform_at)[1],
        "a transform",
    )
    scene.until(lambda: scene.said.has("No transform from 'map' has arrived for 0.3 s"), "the silence")
    scene.until(
        lambda: (
            publisher.publish(TFMessage(transforms=[frame])),
            scene.said.has("Transforms from 'map' arrive again."),
        )[1],
        "their return",
    )


def test_transforms_between_other_frames_are_not_from_map(scene: Scene) -> None:
    from geometry_msgs.msg import TransformStamped
    from rclpy.serialization import serialize_message
    from tf2_msgs.msg import TFMessage

    from sar_compiler.ros import robot_estimate

    frame = TransformStamped()
    frame.header.frame_id, frame.child_frame_id = "odom", "base_link"
    assert robot_estimate.FROM_MAP not in serialize_message(TFMessage(transforms=[frame]))


@pytest.mark.slow
@pytest.mark.parametrize("transforms", [True, False])
def test_killed_localisation_is_reported_within_four_seconds(
    ros: Ros, said: Said, serve: Any, *, transforms: bool
) -> None:
    from lifecycle_msgs.srv import GetState

    from sar_compiler.nodes.spec import Use
    from sar_compiler.ros.dependency_monitor import DependencyMonitor
    from tests.waiting import Stopwatch

    def active(_: Any, response: Any) -> Any:
        response.current_state.label = "active"
        return response

    ros.node("nav2").create_service(GetState, "bt_navigator/get_state", active)
    localiser = serve("localiser", transforms=transforms)
    watch = DependencyMonitor(ros.node("mission"), [Use.nav2()])
    known = watch._localisation
    assert known is not None
    ros.spin_until(lambda: all(each.state == "active" for each in known._nodes), "Nav2's being active")
    if transforms:
        ros.spin_until(lambda: known._robot.transform_at is not None, "a transform")
    localiser.kill()
    stopwatch = Stopwatch()
    ros.spin_until(lambda: said.has("Nav2 is no longer active: node amcl: /amcl/get_state"), "the loss")
    assert stopwatch.own_sec < 4.0
    if transforms:
        ros.spin_until(lambda: said.has("No transform from 'map' has arrived for 3 s"), "their silence")
        assert stopwatch.own_sec < 4.0


@pytest.mark.slow
def test_stop_of_transforms_is_reported_while_nav2_node_is_unresponsive(
    ros: Ros, said: Said, serve: Any
) -> None:
    from sar_compiler.nodes.spec import Use
    from sar_compiler.ros.dependency_monitor import DependencyMonitor

    navigation = serve("navigation", states={"amcl": None})
    localiser = serve("localiser")
    watch = DependencyMonitor(ros.node("mission"), [Use.nav2()])
    known = watch._localisation
    assert known is not None
    ros.spin_until(lambda: known._robot.transform_at is not None, "a transform")
    navigation.freeze()
    localiser.order(transforms=False)
    ros.spin_until(lambda: said.has("No transform from 'map' has arrived for 3 s"), "their silence")
