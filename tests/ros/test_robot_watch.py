"""What a journal is told of a robot."""

import base64
import io
import math
from array import array
from typing import Any

import pytest

from sar_compiler.journal.journal import Journal

pytestmark = pytest.mark.ros


@pytest.fixture
def told(make_ros):
    """Return what a journal is told of a map."""
    from nav_msgs.msg import OccupancyGrid
    from rclpy.qos import DurabilityPolicy, QoSProfile

    from sar_compiler.ros.robot_watch import RobotWatch

    def tell(cells, width, height, **turn):
        ros = make_ros()
        entries: list[Any] = []
        node, robot = ros.node("mission"), ros.node("map_server")
        journal = Journal()
        journal.listen(entries.append)
        RobotWatch(node, journal)
        grid = OccupancyGrid(data=array("b", cells))
        grid.info.width, grid.info.height, grid.info.resolution = width, height, 0.5
        grid.info.origin.position.x, grid.info.origin.position.y = -1.0, -2.0
        for name, value in turn.items():
            setattr(grid.info.origin.orientation, name, value)
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        robot.create_publisher(OccupancyGrid, "map", latched).publish(grid)
        node.create_subscription(OccupancyGrid, "map", lambda _: seen.append(1), latched)
        seen: list[int] = []
        ros.spin_until(lambda: seen, "the map")
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
