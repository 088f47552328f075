"""Tests of the robot observer, which records a robot in the journal."""

import base64
import io
import math
from array import array
from typing import Any

import pytest

from sar_compiler.journal.journal import Journal
from sar_compiler.journal.journal_entries import JournalEntry
from sar_compiler.runtime.clock import ManualClock

pytestmark = pytest.mark.ros


def latched():
    """Return the QoS of latched topics."""
    from rclpy.qos import DurabilityPolicy, QoSProfile

    return QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)


@pytest.fixture
def record_map(ros):
    """Return a function that returns the journal's entries for a map."""
    from nav_msgs.msg import OccupancyGrid

    from sar_compiler.ros.robot_observer import RobotObserver

    def record(cells, width, height, **turn):
        entries: list[Any] = []
        journal = Journal()
        journal.add_listener(entries.append)
        watch = RobotObserver(ros.node("mission"), journal)
        grid = OccupancyGrid(data=array("b", cells))
        grid.info.width, grid.info.height, grid.info.resolution = width, height, 0.5
        grid.info.origin.position.x, grid.info.origin.position.y = -1.0, -2.0
        for name, value in turn.items():
            setattr(grid.info.origin.orientation, name, value)
        watch._on_message("map", grid)
        return [entry.data for entry in entries if entry.kind == "map"]

    return record


def test_map_is_recorded_as_image_with_position(record_map):
    from PIL import Image

    (data,) = record_map([0, 100, -1, 50, 0, 0], 3, 2)
    assert (data["x"], data["y"], data["resolution"], data["width"], data["height"]) == (
        -1.0,
        -2.0,
        0.5,
        3,
        2,
    )
    image = Image.open(io.BytesIO(base64.b64decode(data["png"])))
    assert (image.size, image.mode) == ((3, 2), "L")
    # The lowest row of the map is the last one of the image.
    assert list(image.tobytes()) == [127, 254, 254, 254, 0, 205]


def test_yaw_of_rotated_map_is_recorded(record_map):
    (data,) = record_map([0, 0], 2, 1, z=0.7, w=0.7)
    assert data["yaw"] == pytest.approx(math.pi / 2.0)


def test_map_with_wrong_cell_count_is_not_recorded(record_map):
    assert record_map([0, 0, 0], 2, 1) == []


def test_map_with_invalid_yaw_is_not_recorded(record_map):
    assert record_map([0, 0], 2, 1, z=0.7, w=math.nan) == []


class ObserverScene:
    """An observer of a robot that the test controls, and its journal, whose clock the test advances."""

    def __init__(self, ros):
        from sar_compiler.ros.robot_observer import RobotObserver

        self.ros, self.robot, node = ros, ros.node("robot"), ros.node("mission")
        self.journal = Journal()
        self._entries: list[JournalEntry] = []
        self.journal.clock = self.clock = ManualClock()
        self.journal.add_listener(self._entries.append)
        self.watch = RobotObserver(node, self.journal)

    def data_of(self, kind):
        return [entry.data for entry in self._entries if entry.kind == kind]

    def is_newest(self, x):
        message = self.watch._newest.get("pose")
        return message is not None and message.x == x

    def wait(self, kind, count):
        self.ros.spin_until(lambda: len(self.data_of(kind)) == count, f"{count} of {kind}")


@pytest.fixture
def scene(ros):
    return ObserverScene(ros)


def pose(x):
    from geometry_msgs.msg import PoseWithCovarianceStamped

    message = PoseWithCovarianceStamped()
    message.pose.pose.position.x = x
    return message


def test_latched_pose_is_recorded(ros):
    poses = ros.node("localisation").create_publisher(type(pose(0.0)), "amcl_pose", latched())
    poses.publish(pose(1.0))
    scene = ObserverScene(ros)
    scene.wait("pose", 1)
    assert scene.data_of("pose")[0]["x"] == 1.0


def test_last_pose_is_recorded_after_robot_stops(scene):
    poses = scene.robot.create_publisher(type(pose(0.0)), "amcl_pose", latched())
    scene.ros.spin_until(poses.get_subscription_count, "who listens")
    poses.publish(pose(1.0))
    scene.wait("pose", 1)
    for x in (2.0, 3.0):
        poses.publish(pose(x))
        scene.ros.spin_until(lambda: scene.is_newest(x), "the pose")  # noqa: B023
    assert len(scene.data_of("pose")) == 1
    scene.clock.advance(1.0)
    scene.wait("pose", 2)
    assert [each["x"] for each in scene.data_of("pose")] == [1.0, 3.0]


def test_latched_map_is_recorded(ros):
    from nav_msgs.msg import OccupancyGrid

    grid = OccupancyGrid(data=array("b", [0]))
    grid.info.resolution = 0.05
    grid.info.width = grid.info.height = 1
    ros.node("map_server").create_publisher(OccupancyGrid, "map", latched()).publish(grid)
    ObserverScene(ros).wait("map", 1)


def test_map_soon_after_another_is_recorded_later(scene):
    from nav_msgs.msg import OccupancyGrid

    for cell in (0, 100):
        grid = OccupancyGrid(data=array("b", [cell]))
        grid.info.resolution = 0.05
        grid.info.width = grid.info.height = 1
        scene.watch._on_message("map", grid)
    assert len(scene.data_of("map")) == 1
    scene.clock.advance(10.0)
    scene.wait("map", 2)


def test_plan_is_not_recorded_after_end_of_goal(scene):
    from nav_msgs.msg import Path

    for _ in range(2):
        scene.watch._on_message("plan", Path())
    scene.journal.record_observation("goal_ended", goal="a")
    scene.clock.advance(1.0)
    scene.watch._record_postponed()
    assert len(scene.data_of("plan")) == 1


@pytest.mark.parametrize(("count", "told"), [(1, 1), (200, 200), (201, 101), (1000, 201)])
def test_long_plan_is_thinned_to_about_200_points_including_goal(scene, count, told):
    from geometry_msgs.msg import PoseStamped
    from nav_msgs.msg import Path

    plan = Path(poses=[PoseStamped() for _ in range(count)])
    for number, stamped in enumerate(plan.poses):
        stamped.pose.position.x = float(number)
    scene.watch._on_message("plan", plan)
    (points,) = [data["points"] for data in scene.data_of("plan")]
    assert len(points) == told
    assert (points[0], points[-1]) == ((0.0, 0.0), (count - 1.0, 0.0))


def test_warnings_of_other_nodes_are_limited_in_number_and_length(scene):
    from rcl_interfaces.msg import Log

    for level in (20, 30):
        for _ in range(50):
            scene.watch._on_log(Log(name="other", level=level, msg="w" * 9_000))
    scene.watch._record_postponed()
    lines = scene.data_of("log")
    assert len(lines) == 21
    assert {len(line["text"]) for line in lines[:-1]} == {2006}
    assert lines[-1]["text"] == "30 further warnings of other nodes within 0.5 s are omitted."
    scene.watch._on_log(Log(name="mission", level=20, msg="mine"))
    assert scene.data_of("log")[-1] == {"node": "mission", "level": 20, "text": "mine", "stamp": 0.0}
