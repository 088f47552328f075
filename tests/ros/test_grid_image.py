"""Tests of converting map messages to images."""

import io
from array import array

import pytest

pytestmark = pytest.mark.ros

pytest.importorskip("PIL")


def grid(width, height, cells):
    from nav_msgs.msg import OccupancyGrid

    message = OccupancyGrid()
    message.info.width, message.info.height = width, height
    message.data = array("b", cells)
    return message


def pixels(drawn):
    from PIL import Image

    image = Image.open(io.BytesIO(drawn[3]))
    return image.size, list(image.tobytes())


def test_highest_row_is_on_top_and_occupied_cells_are_black():
    from sar_compiler.ros.robot_observer import grid_image

    drawn = grid_image(grid(3, 2, [0, 50, 100, -1, 0, 0]))
    assert drawn is not None
    assert drawn[:3] == (3, 2, 1)
    assert pixels(drawn) == ((3, 2), [205, 254, 254, 254, 127, 0])


def test_map_with_missing_cells_or_zero_size_has_no_image():
    from sar_compiler.ros.robot_observer import grid_image

    assert grid_image(grid(3, 2, [0] * 5)) is None
    assert grid_image(grid(0, 0, [])) is None


def test_huge_map_is_drawn_with_every_second_cell():
    from sar_compiler.ros.robot_observer import grid_image

    drawn = grid_image(grid(5001, 1000, [0] * 5_001_000))
    assert drawn is not None
    assert drawn[:3] == (2500, 500, 2)
    assert pixels(drawn)[0] == (2500, 500)


@pytest.mark.parametrize(("width", "height"), [(5_000_000, 1), (1, 5_000_000)])
def test_huge_map_with_one_row_or_column_keeps_it(width, height):
    from sar_compiler.ros.robot_observer import grid_image

    drawn = grid_image(grid(width, height, [0] * 5_000_000))
    assert drawn is not None
    assert drawn[:3] == (max(1, width // 2), max(1, height // 2), 2)
    assert pixels(drawn)[0] == drawn[:2]
