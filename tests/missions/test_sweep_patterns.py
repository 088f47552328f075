"""Tests of sweep patterns: stops, their order, and obstacles."""

import itertools
import math
from typing import Any

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from search_and_rescue.coverage import ObstacleMap
from search_and_rescue.sweeps import MAX_PIECES, GroundError, sweep
from search_and_rescue.zone_manager import MapPose

OBLONG = ((0.0, 0.0), (8.0, 0.0), (8.0, 4.0), (0.0, 4.0))
DATUM = MapPose(x=0.0, y=0.0, yaw=0.0)


def places(poses: list[MapPose]) -> list[tuple[float, float]]:
    return [(round(pose["x"], 6), round(pose["y"], 6)) for pose in poses]


def sweep_stops(
    pattern: Any, spacing: float = 2.0, polygon: Any = OBLONG, datum: MapPose = DATUM, **more: Any
) -> Any:
    return places(sweep([polygon], pattern, spacing, datum, **more))


def test_parallel_legs_follow_long_side_half_a_spacing_from_edge() -> None:
    assert sweep_stops("parallel") == [(1, 1), (3, 1), (5, 1), (7, 1), (7, 3), (5, 3), (3, 3), (1, 3)]


def test_ground_behind_wall_between_legs_is_swept() -> None:
    blocked = np.zeros((60, 100), dtype=bool)
    blocked[28:32, :] = True
    wall = ObstacleMap(blocked, 0.1, (-1.0, -1.0, 0.0))
    stops = sweep_stops("parallel", spacing=4.0, obstacles=wall, clearance=0.3)
    assert sorted({y for _, y in stops}) == pytest.approx([0.75, 3.25], abs=0.1)
    assert sorted({x for x, _ in stops}) == [2.0, 6.0]


def test_corner_visible_from_leg_needs_no_leg_of_its_own() -> None:
    blocked = np.zeros((60, 100), dtype=bool)
    blocked[38:42, :20] = blocked[42:, 18:20] = True
    corner = ObstacleMap(blocked, 0.1, (-1.0, -1.0, 0.0))
    assert {y for _, y in sweep_stops("parallel", spacing=4.0, obstacles=corner)} == {2.0}


def test_creeping_line_follows_short_side() -> None:
    assert sweep_stops("creeping_line") == [(1, 1), (1, 3), (3, 3), (3, 1), (5, 1), (5, 3), (7, 3), (7, 1)]


def test_sweep_starts_at_nearest_end() -> None:
    assert sweep_stops("parallel", datum=MapPose(x=9.0, y=4.0, yaw=0.0))[0] == (7, 3)


def test_expanding_square_grows_around_datum() -> None:
    around = ((-9.0, -9.0), (9.0, -9.0), (9.0, 9.0), (-9.0, 9.0))
    assert sweep_stops("expanding_square", polygon=around)[:10] == [
        (0, 0), (2, 0), (2, 2), (0, 2), (-2, 2), (-2, 0), (-2, -2), (0, -2), (2, -2), (4, -2),
    ]  # fmt: skip


def test_datum_patterns_start_at_datum() -> None:
    around = ((-9.0, -9.0), (9.0, -9.0), (9.0, 9.0), (-9.0, 9.0))
    datum = MapPose(x=1.0, y=2.0, yaw=0.0)
    assert sweep_stops("expanding_square", polygon=around, datum=datum)[:3] == [(1, 2), (3, 2), (3, 4)]
    assert sweep_stops("sector", polygon=around, datum=datum)[0] == (1, 2)
    with pytest.raises(GroundError):
        sweep_stops("sector", polygon=((50.0, 0.0), (50.1, 0.0), (50.1, 0.1)), datum=datum)


def test_single_stop_faces_along_x() -> None:
    [only] = sweep([((0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0))], "parallel", 2.0, DATUM)
    assert only == MapPose(x=0.5, y=0.5, yaw=0.0)


def test_expanding_square_reaches_every_corner() -> None:
    around = ((-5.0, -3.0), (5.0, -3.0), (5.0, 3.0), (-5.0, 3.0))
    stops = sweep_stops("expanding_square", polygon=around)
    assert all(min(math.dist(corner, stop) for stop in stops) <= 2.0 for corner in around)
    assert all(abs(x) <= 5.0 and abs(y) <= 3.0 for x, y in stops)


def test_sector_search_crosses_datum_with_turns_of_120_degrees() -> None:
    around = ((-20.0, -20.0), (20.0, -20.0), (20.0, 20.0), (-20.0, 20.0))
    reach = 20.0 * math.sqrt(2.0)
    stops = sweep_stops("sector", spacing=15.0, polygon=around)
    half = reach / 2
    turns = [round(math.degrees(math.atan2(y, x))) % 360 for x, y in stops[1:]]
    assert all(round(math.hypot(x, y) % half, 3) in (0.0, round(half, 3)) for x, y in stops)
    assert [turn for turn, _ in itertools.groupby(turns)] == [0, 60, 240, 300, 120, 180]


def test_poses_face_along_path_and_last_one_like_the_one_before() -> None:
    yaws = [pose["yaw"] for pose in sweep([OBLONG], "parallel", 2.0, DATUM)]
    assert yaws == pytest.approx([0, 0, 0, math.pi / 2, math.pi, math.pi, math.pi, math.pi])


def obstacle_map(*boxes: tuple[float, float, float, float]) -> ObstacleMap:
    blocked = np.zeros((200, 200), bool)
    for left, low, right, high in boxes:
        blocked[round(low * 20) : round(high * 20), round(left * 20) : round(right * 20)] = True
    return ObstacleMap(blocked, 0.05)


def test_stops_keep_clearance_from_obstacles() -> None:
    box = (3.0, 0.0, 5.0, 2.0)
    stops = sweep_stops("parallel", spacing=1.0, obstacles=obstacle_map(box), clearance=0.4)
    solid = shapely.box(*box)
    assert min(shapely.distance(shapely.Point(stop), solid) for stop in stops) >= 0.4 - 0.05
    assert any(x < 3.0 and y < 2.0 for x, y in stops)
    assert any(x > 5.0 and y < 2.0 for x, y in stops)


def test_several_polygons_are_swept_in_one_path() -> None:
    far = ((20.0, 0.0), (24.0, 0.0), (24.0, 4.0), (20.0, 4.0))
    stops = places(sweep([OBLONG, far], "parallel", 2.0, DATUM))
    assert {x > 10.0 for x, _ in stops} == {True, False}
    sides = [side for side, _ in itertools.groupby(x > 10.0 for x, _ in stops)]
    assert sides == [False, True] or len(sides) <= 4


def test_completely_blocked_ground_is_rejected() -> None:
    with pytest.raises(GroundError, match="every stop is blocked"):
        sweep_stops("parallel", obstacles=obstacle_map((0.0, 0.0, 9.0, 9.0)))


def test_sweep_with_too_many_stops_is_rejected_with_numbers() -> None:
    with pytest.raises(
        GroundError, match=rf"32 m² with a spacing of 0.05 m need more than {MAX_PIECES} stops"
    ):
        sweep_stops("parallel", spacing=0.05)


@pytest.mark.parametrize(
    ("pattern", "spacing", "polygon", "datum", "reason"),
    [
        # A small area, but thousands of kilometres of legs.
        (
            "parallel",
            1.0,
            ((0, 0), (30_000, 0), (30_000, 0.01), (0.01, 0.01), (0.01, 30_000), (0, 30_000)),
            DATUM,
            "which is too large for legs 1.00 m apart",
        ),
        (
            "expanding_square",
            1.0,
            OBLONG,
            MapPose(x=600.0, y=0.0, yaw=0.0),
            "move the pose inside the ground",
        ),
        (
            "parallel",
            1.0,
            ((0, 0), (1500, 0), (1500, 0.5), (0.5, 0.5), (0.5, 1500), (0, 1500)),
            DATUM,
            r"which has too many map cells of 0\.\d+ m",
        ),
    ],
)
def test_ground_of_small_area_but_large_extent_is_rejected(
    pattern: Any, spacing: float, polygon: Any, datum: MapPose, reason: str
) -> None:
    with pytest.raises(GroundError, match=reason):
        sweep_stops(pattern, spacing, polygon, datum, obstacles=obstacle_map((0.0, 0.0, 1.0, 1.0)))


def test_datum_may_be_far_from_ground() -> None:
    assert sweep_stops("parallel", datum=MapPose(x=5000.0, y=0.0, yaw=0.0))[0] == (7, 1)


@given(
    turn=st.floats(0.0, math.pi),
    width=st.floats(1.0, 30.0),
    height=st.floats(1.0, 30.0),
    spacing=st.floats(0.8, 5.0),
    pattern=st.sampled_from(["parallel", "creeping_line"]),
)
def test_every_point_of_rotated_rectangle_is_near_a_stop(
    turn: float, width: float, height: float, spacing: float, pattern: Any
) -> None:
    flat = shapely.box(0.0, 0.0, width, height)
    lying = shapely.affinity.rotate(flat, turn, origin=(0.0, 0.0), use_radians=True)
    corners: Any = tuple(lying.exterior.coords[:-1])
    stops = shapely.MultiPoint(places(sweep([corners], pattern, spacing, DATUM)))
    # The distance between legs and between stops is at most the spacing.
    across, along = np.meshgrid(np.linspace(0.0, width, 12), np.linspace(0.0, height, 12))
    anywhere = shapely.affinity.rotate(
        shapely.MultiPoint(np.column_stack([across.ravel(), along.ravel()])),
        turn,
        (0.0, 0.0),
        use_radians=True,
    )
    assert max(shapely.distance(list(anywhere.geoms), stops)) <= spacing * math.sqrt(0.5) + 1e-5
    assert lying.buffer(1e-5).contains(stops)
