"""What a journal is told of a robot."""

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
    """Return the QoS of what is kept for latecomers."""
    from rclpy.qos import DurabilityPolicy, QoSProfile

    return QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)


@pytest.fixture
def told(ros):
    """Return what a journal is told of a map."""
    from nav_msgs.msg import OccupancyGrid

    from sar_compiler.ros.robot_observer import RobotObserver

    def tell(cells, width, height, **turn):
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

    return tell


def test_the_map_is_an_image_with_its_place(told):
    from PIL import Image

    (data,) = told([0, 100, -1, 50, 0, 0], 3, 2)
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


def test_of_a_map_that_is_turned_the_angle_is_told(told):
    (data,) = told([0, 0], 2, 1, z=0.7, w=0.7)
    assert data["yaw"] == pytest.approx(math.pi / 2.0)


def test_a_map_that_has_not_as_many_cells_as_it_says_is_left_out(told):
    assert told([0, 0, 0], 2, 1) == []


def test_of_a_map_whose_angle_is_no_number_nothing_is_told(told):
    assert told([0, 0], 2, 1, z=0.7, w=math.nan) == []


class Watched:
    """What a journal is told of a robot that is a test; its clock stands still."""

    def __init__(self, ros):
        from sar_compiler.ros.robot_observer import RobotObserver

        self.ros, self.robot, node = ros, ros.node("robot"), ros.node("mission")
        self.journal = Journal()
        self._entries: list[JournalEntry] = []
        self.journal.clock = self.clock = ManualClock()
        self.journal.add_listener(self._entries.append)
        self.watch = RobotObserver(node, self.journal)

    def told(self, kind):
        return [entry.data for entry in self._entries if entry.kind == kind]

    def is_newest(self, x):
        message = self.watch._newest.get("pose")
        return message is not None and message.x == x

    def wait(self, kind, count):
        self.ros.spin_until(lambda: len(self.told(kind)) == count, f"{count} of {kind}")


@pytest.fixture
def watched(ros):
    return Watched(ros)


def pose(x):
    from geometry_msgs.msg import PoseWithCovarianceStamped

    message = PoseWithCovarianceStamped()
    message.pose.pose.position.x = x
    return message


def test_where_a_robot_stands_is_told_though_it_has_said_so_before(ros):
    poses = ros.node("localisation").create_publisher(type(pose(0.0)), "amcl_pose", latched())
    poses.publish(pose(1.0))
    watched = Watched(ros)
    watched.wait("pose", 1)
    assert watched.told("pose")[0]["x"] == 1.0


def test_the_last_pose_is_told_where_the_robot_then_stands_still(watched):
    poses = watched.robot.create_publisher(type(pose(0.0)), "amcl_pose", latched())
    watched.ros.spin_until(poses.get_subscription_count, "who listens")
    poses.publish(pose(1.0))
    watched.wait("pose", 1)
    for x in (2.0, 3.0):
        poses.publish(pose(x))
        watched.ros.spin_until(lambda: watched.is_newest(x), "the pose")  # noqa: B023
    assert len(watched.told("pose")) == 1
    watched.clock.advance(1.0)
    watched.wait("pose", 2)
    assert [each["x"] for each in watched.told("pose")] == [1.0, 3.0]


def test_a_map_is_told_to_who_comes_after_it(ros):
    from nav_msgs.msg import OccupancyGrid

    grid = OccupancyGrid(data=array("b", [0]))
    grid.info.resolution = 0.05
    grid.info.width = grid.info.height = 1
    ros.node("map_server").create_publisher(OccupancyGrid, "map", latched()).publish(grid)
    Watched(ros).wait("map", 1)


def test_a_map_that_came_soon_after_another_one_is_told_later(watched):
    from nav_msgs.msg import OccupancyGrid

    for cell in (0, 100):
        grid = OccupancyGrid(data=array("b", [cell]))
        grid.info.resolution = 0.05
        grid.info.width = grid.info.height = 1
        watched.watch._on_message("map", grid)
    assert len(watched.told("map")) == 1
    watched.clock.advance(10.0)
    watched.wait("map", 2)


def test_a_plan_is_not_told_after_the_end_of_its_goal(watched):
    from nav_msgs.msg import Path

    for _ in range(2):
        watched.watch._on_message("plan", Path())
    watched.journal.record_observation("goal_ended", goal="a")
    watched.clock.advance(1.0)
    watched.watch._record_postponed()
    assert len(watched.told("plan")) == 1


@pytest.mark.parametrize(("count", "told"), [(1, 1), (200, 200), (201, 101), (1000, 201)])
def test_of_a_long_plan_some_200_points_are_told_and_the_goal_among_them(watched, count, told):
    from geometry_msgs.msg import PoseStamped
    from nav_msgs.msg import Path

    plan = Path(poses=[PoseStamped() for _ in range(count)])
    for number, stamped in enumerate(plan.poses):
        stamped.pose.position.x = float(number)
    watched.watch._on_message("plan", plan)
    (points,) = [data["points"] for data in watched.told("plan")]
    assert len(points) == told
    assert (points[0], points[-1]) == ((0.0, 0.0), (count - 1.0, 0.0))


def test_of_others_warnings_only_so_many_and_so_much_is_written(watched):
    from rcl_interfaces.msg import Log

    for level in (20, 30):
        for _ in range(50):
            watched.watch._on_log(Log(name="other", level=level, msg="w" * 9_000))
    watched.watch._record_postponed()
    lines = watched.told("log")
    assert len(lines) == 21
    assert {len(line["text"]) for line in lines[:-1]} == {2006}
    assert lines[-1]["text"] == "30 further warnings of other nodes within 0.5 s are omitted."
    watched.watch._on_log(Log(name="mission", level=20, msg="mine"))
    assert watched.told("log")[-1] == {"node": "mission", "level": 20, "text": "mine", "stamp": 0.0}
