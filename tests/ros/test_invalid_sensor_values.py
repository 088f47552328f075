"""Tests that a sensor value outside the definition of its message is not used, is reported once, and leaves the last value in place."""

import math
from collections.abc import Callable
from typing import Any

import pytest
from py_trees.common import Status

from sar_compiler.nodes.ros_fields import read_path
from sar_compiler.ros.leaves.attribute_leaves import RosTopic, RosTransform
from sar_compiler.ros.leaves.topic_leaf import TopicLeaf
from sar_compiler.ros.message_values import battery_share
from sar_compiler.ros.robot_estimate import RobotEstimate, robot_estimate
from sar_compiler.runtime.ports import Input, Output
from tests.ros.conftest import Ros

pytestmark = pytest.mark.ros

DAY_SEC = 86_400


def capture_warnings(node: Any, monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Return a list to which the node's further warnings are added."""
    lines: list[str] = []
    monkeypatch.setattr(node.get_logger(), "warning", lines.append)
    return lines


def stamp_after(node: Any, seconds: float) -> Any:
    """Return the stamp of a time after now by a node's clock."""
    from rclpy.duration import Duration

    return (node.get_clock().now() + Duration(seconds=seconds)).to_msg()


class Robot:
    """A robot whose localisation and odometry the test controls, and the estimate of another node."""

    def __init__(self, ros: Ros, monkeypatch: pytest.MonkeyPatch) -> None:
        from geometry_msgs.msg import PoseWithCovarianceStamped
        from nav_msgs.msg import Odometry
        from rclpy.qos import DurabilityPolicy, QoSProfile
        from tf2_msgs.msg import TFMessage

        self.ros, self.node = ros, ros.node("robot")
        mission = ros.node("mission")
        self.warnings = capture_warnings(mission, monkeypatch)
        self.estimate: RobotEstimate = robot_estimate(mission)
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self._poses = self.node.create_publisher(PoseWithCovarianceStamped, "amcl_pose", latched)
        self._odometry = self.node.create_publisher(Odometry, "odometry/filtered", 10)
        self._transforms = self.node.create_publisher(TFMessage, "/tf", 10)

    def until(self, send: Callable[[], object], condition: Callable[[], object], what: str) -> None:
        self.ros.spin_until(lambda: (send(), condition())[1], what)

    def pose(self, change: Callable[[Any], object] = lambda _: None, x: float = 1.0) -> Any:
        from geometry_msgs.msg import PoseWithCovarianceStamped

        message = PoseWithCovarianceStamped()
        message.header.frame_id, message.header.stamp = "map", stamp_after(self.node, 0.0)
        message.pose.pose.position.x = x
        change(message)
        self._poses.publish(message)
        return message

    def odometry(self, change: Callable[[Any], object] = lambda _: None, x: float = 1.0) -> None:
        from nav_msgs.msg import Odometry

        message = Odometry(child_frame_id="base_link")
        message.header.frame_id, message.header.stamp = "odom", stamp_after(self.node, 0.0)
        message.pose.pose.position.x = message.twist.twist.linear.x = x
        change(message)
        self._odometry.publish(message)

    def transform(self, change: Callable[[Any], object] = lambda _: None) -> None:
        from geometry_msgs.msg import TransformStamped
        from tf2_msgs.msg import TFMessage

        frame = TransformStamped(child_frame_id="odom")
        frame.header.frame_id, frame.header.stamp = "map", stamp_after(self.node, 0.0)
        frame.transform.translation.x = 2.0
        change(frame)
        self._transforms.publish(TFMessage(transforms=[frame]))


@pytest.fixture
def robot(ros: Ros, monkeypatch: pytest.MonkeyPatch) -> Robot:
    return Robot(ros, monkeypatch)


def setter(path: str, value: Any) -> Callable[[Any], None]:
    *outer, last = path.split(".")

    def change(message: Any) -> None:
        for each in outer:
            message = getattr(message, each)
        setattr(message, last, value)

    return change


def shift_stamp(seconds: float) -> Callable[[Any], None]:
    """Return a function that shifts the stamp of a message."""

    def change(message: Any) -> None:
        message.header.stamp.sec += round(seconds)

    return change


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (setter("pose.pose.position.y", math.nan), "is not a position"),
        (setter("pose.pose.position.y", math.inf), "is not a position"),
        (setter("pose.pose.orientation.w", 0.0), "the length of the quaternion is 0, but must be 1"),
        (lambda message: message.pose.covariance.__setitem__(7, math.nan), "is not a number (NaN)"),
        (lambda message: message.pose.covariance.__setitem__(0, -0.5), "must be 0 or more"),
        (lambda message: message.pose.covariance.__setitem__(35, -0.5), "must be 0 or more"),
        (setter("header.frame_id", "robot1/map"), "is in the frame 'robot1/map', but must be in 'map'"),
        (shift_stamp(3600.0), "in the future"),
        (shift_stamp(2 * DAY_SEC), "use_sim_time"),
    ],
)  # fmt: skip
def test_invalid_pose_is_reported_and_last_pose_is_kept(
    robot: Robot, change: Callable[[Any], None], said: str
) -> None:
    robot.until(robot.pose, lambda: robot.estimate.pose, "a pose")
    robot.until(lambda: robot.pose(change, x=9.0), lambda: robot.estimate.pose_problem, "the unusable pose")
    assert robot.estimate.last_pose() == (1.0, 0.0, 0.0)
    assert said in robot.estimate.pose_problem
    assert [said in each and "'amcl_pose'" in each for each in robot.warnings] == [True]
    robot.until(
        lambda: robot.pose(x=3.0), lambda: robot.estimate.last_pose() == (3.0, 0.0, 0.0), "the next pose"
    )
    assert robot.estimate.pose_problem == ""


def test_rounded_negative_or_non_planar_variance_is_accepted(robot: Robot) -> None:
    def change(message: Any) -> None:
        message.pose.covariance[0], message.pose.covariance[14] = -1e-12, math.nan

    robot.until(lambda: robot.pose(change), lambda: robot.estimate.pose, "the pose")
    assert robot.warnings == []


def test_old_pose_is_accepted(robot: Robot) -> None:
    robot.until(lambda: robot.pose(shift_stamp(-DAY_SEC)), lambda: robot.estimate.pose, "an old pose")
    assert robot.warnings == []


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (setter("pose.pose.position.x", math.nan), "is not a position"),
        (setter("pose.pose.orientation.w", 0.0), "the length of the quaternion"),
        (setter("twist.twist.linear.x", math.nan), "the speed is nan m/s"),
        (shift_stamp(3600.0), "in the future"),
        (shift_stamp(-3600.0), " s old, but may be at most 30 s"),
        (shift_stamp(-2 * DAY_SEC), "use_sim_time"),
    ],
)  # fmt: skip
def test_invalid_odometry_is_reported_and_last_odometry_is_kept(
    robot: Robot, change: Callable[[Any], None], said: str
) -> None:
    robot.until(robot.odometry, lambda: robot.estimate.odometry, "odometry")
    robot.until(lambda: robot.odometry(change, x=9.0), lambda: robot.warnings, "the report")
    assert robot.estimate.odometry == (1.0, 0.0, 0.0)
    assert said in robot.warnings[0]


def test_speed_is_used_although_odometry_pose_is_invalid(robot: Robot) -> None:
    lost = setter("pose.pose.position.x", math.nan)
    robot.until(lambda: robot.odometry(lost), lambda: robot.estimate.moves, "the speed")
    assert robot.estimate.odometry is None


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (setter("transform.translation.x", math.nan), "the translation of 'odom' is (nan, 0.0, 0.0)"),
        (setter("transform.rotation.w", 0.5), "the length of the quaternion is 0.5"),
        (shift_stamp(3600.0), "in the future"),
        (shift_stamp(-3600.0), "s old, but may be at most 30 s"),
    ],
)
def test_invalid_transform_is_reported_and_gives_no_pose(
    robot: Robot, change: Callable[[Any], None], said: str
) -> None:
    def both() -> None:
        robot.odometry()
        robot.transform(change)
        robot.estimate.last_pose()

    robot.until(both, lambda: robot.warnings, "the report")
    assert robot.estimate.last_pose() is None
    assert said in robot.warnings[0]
    assert "'/tf'" in robot.warnings[0]


def publish_and_tick(
    leaf: TopicLeaf, ros: Ros, publisher: Any, message: Any, condition: Callable[[], object]
) -> None:
    ros.spin_until(lambda: (publisher.publish(message), condition())[1], "what comes of the message")
    leaf.tick_once()


class TestTopicLeaf:
    """Tests of a leaf by attributes, as an example of every `TopicLeaf`."""

    def leaf(
        self, ros: Ros, monkeypatch: pytest.MonkeyPatch, field: str = "percentage"
    ) -> tuple[RosTopic, Output[object], list[str], Any]:
        from sensor_msgs.msg import BatteryState

        node, value = ros.node("mission"), Output[object]()
        lines = capture_warnings(node, monkeypatch)
        leaf = RosTopic(
            "Battery", Input("battery"), "sensor_msgs/msg/BatteryState", field=read_path(field), value=value
        )
        leaf.setup(node=node)
        return leaf, value, lines, ros.node("driver").create_publisher(BatteryState, "battery", 10)

    @pytest.mark.parametrize("percentage", [85.0, math.nan, math.inf, -0.1])
    def test_message_with_invalid_value_is_ignored(
        self, ros: Ros, monkeypatch: pytest.MonkeyPatch, percentage: float
    ) -> None:
        from sensor_msgs.msg import BatteryState

        leaf, value, lines, publisher = self.leaf(ros, monkeypatch)
        publish_and_tick(leaf, ros, publisher, BatteryState(percentage=percentage), lambda: lines)
        assert (leaf.status, value.value) == (Status.FAILURE, None)
        assert "no message on 'battery' (percentage is " in leaf.feedback_message
        publish_and_tick(leaf, ros, publisher, BatteryState(percentage=0.25), lambda: leaf.message)
        assert (leaf.status, value.value) == (Status.SUCCESS, 0.25)
        assert len(lines) == 1

    def test_unread_field_may_be_invalid(self, ros: Ros, monkeypatch: pytest.MonkeyPatch) -> None:
        from sensor_msgs.msg import BatteryState

        leaf, value, lines, publisher = self.leaf(ros, monkeypatch, "voltage")
        message = BatteryState(percentage=math.nan, voltage=24.5)
        publish_and_tick(leaf, ros, publisher, message, lambda: leaf.message)
        assert (leaf.status, value.value, lines) == (Status.SUCCESS, 24.5, [])

    @pytest.mark.parametrize(
        ("seconds", "said"),
        [(60.0, "in the future"), (-60.0, " s old, but may be at most 5 s"), (-10 * DAY_SEC, "use_sim_time")],
    )
    def test_message_with_implausible_stamp_is_ignored(
        self, ros: Ros, monkeypatch: pytest.MonkeyPatch, seconds: float, said: str
    ) -> None:
        from sensor_msgs.msg import BatteryState

        leaf, _, lines, publisher = self.leaf(ros, monkeypatch)
        message = BatteryState(percentage=0.5)
        message.header.stamp = stamp_after(leaf.node, seconds)
        publish_and_tick(leaf, ros, publisher, message, lambda: lines)
        assert leaf.status is Status.FAILURE
        assert said in lines[0]


def test_leaf_fails_on_unusable_message(ros: Ros, monkeypatch: pytest.MonkeyPatch) -> None:
    from sensor_msgs.msg import BatteryState

    class Charged(TopicLeaf):
        topic_type, topic_name = BatteryState, "battery"

        def on_message(self, message: Any) -> Status:
            return Status.SUCCESS if battery_share(message) > 0.2 else Status.FAILURE

    leaf = Charged("Charged?")
    leaf.setup(node=ros.node("mission"))
    lines = capture_warnings(leaf.node, monkeypatch)
    publisher = ros.node("driver").create_publisher(BatteryState, "battery", 10)
    for share, status in ((85.0, Status.FAILURE), (0.5, Status.SUCCESS)):
        publish_and_tick(leaf, ros, publisher, BatteryState(percentage=share), lambda: leaf.message)
        assert leaf.status is status
    assert [line.startswith("Topic 'battery': percentage is 85") for line in lines] == [True]


@pytest.mark.parametrize(("seconds", "said"), [(60.0, "s in the future"), (-2 * DAY_SEC, "use_sim_time")])
def test_transform_with_implausible_stamp_is_not_used(ros: Ros, seconds: float, said: str) -> None:
    from geometry_msgs.msg import TransformStamped
    from tf2_msgs.msg import TFMessage

    leaf = RosTransform("Where", Input("map"), Input("base_link"), timeout_sec=1000.0)
    leaf.setup(node=ros.node("mission"))
    publisher = ros.node("localisation").create_publisher(TFMessage, "/tf", 10)
    frames = [TransformStamped(child_frame_id=child) for child in ("odom", "base_link")]
    # Only one of two chained transforms is wrong, the other one is current.
    frames[0].header.frame_id, frames[0].header.stamp = "map", stamp_after(leaf.node, seconds)
    frames[1].header.frame_id, frames[1].header.stamp = "odom", stamp_after(leaf.node, 0.0)

    def fails_with_the_reason() -> bool:
        publisher.publish(TFMessage(transforms=frames))
        leaf.tick_once()
        return said in leaf.feedback_message

    ros.spin_until(fails_with_the_reason, said)
    assert leaf.status is Status.RUNNING
