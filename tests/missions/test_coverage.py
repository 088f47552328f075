"""Tests of coverage: random search formula, obstacles, and comparison with shapely."""

import math

import numpy as np
import numpy.typing as npt
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from search_and_rescue.coverage import CoverageRaster, ObstacleMap, Points
from search_and_rescue.search_theory import Ground
from search_and_rescue.sweeps import sweep
from search_and_rescue.zone_manager import MapPose

FIELD = ((0.0, 0.0), (40.0, 0.0), (40.0, 30.0), (0.0, 30.0))


def field(reach: float = 2.0, width: float = 3.2) -> Ground:
    return Ground(FIELD, width, reach)


def room(*walls: tuple[float, float, float, float]) -> ObstacleMap:
    """Return a map of 10 x 10 m in cells of 0.05 m, with walls given by two corners."""
    blocked = np.zeros((200, 200), bool)
    for left, low, right, high in walls:
        blocked[round(low * 20) : round(high * 20), round(left * 20) : round(right * 20)] = True
    return ObstacleMap(blocked, 0.05)


def test_effort_of_drive_is_sweep_width_times_length() -> None:
    raster = CoverageRaster(field())
    inside = raster.drive([(10.0, 15.0), (30.0, 15.0), (30.0, 10.0)])
    assert inside == pytest.approx(25.0)
    assert raster.area_m2() == pytest.approx(1200.0, rel=0.01)
    assert raster.mean_coverage() == pytest.approx(3.2 * 25.0 / 1200.0, rel=0.005)


def test_even_coverage_has_pod_of_random_search() -> None:
    raster = CoverageRaster(Ground(((10.0, 10.0), (30.0, 10.0), (30.0, 20.0), (10.0, 20.0)), 3.2, 2.0))
    for y in np.arange(6.0, 24.0, 0.5):
        raster.drive([(5.0, y), (35.0, y)])
    coverage = 3.2 / 0.5
    assert raster.mean_coverage() == pytest.approx(coverage, rel=0.005)
    assert raster.pod() == pytest.approx(1.0 - math.exp(-coverage), abs=0.001)


def test_repeated_passes_add_up() -> None:
    once, twice = CoverageRaster(field()), CoverageRaster(field())
    way = [(10.0, 15.0), (30.0, 15.0)]
    once.drive(way)
    for _ in range(2):
        twice.drive(way)
    assert twice.coverage == pytest.approx(2.0 * once.coverage)
    assert twice.pod() > once.pod()
    assert twice.seen_share() == once.seen_share()


def test_drive_outside_ground_sees_cells_but_adds_no_length() -> None:
    raster = CoverageRaster(field())
    assert raster.drive([(-1.0, 10.0), (-1.0, 20.0)]) == 0.0
    assert 0.0 < raster.seen_share() < 0.05


def test_walls_block_sight_and_are_not_searchable() -> None:
    wall = room((4.9, 0.0, 5.1, 10.0))
    raster = CoverageRaster(Ground(((0.0, 0.0), (10.0, 0.0), (10.0, 10.0), (0.0, 10.0)), 4.0, 20.0), wall)
    raster.drive([(2.0, 2.0), (2.0, 8.0)])
    seen = raster.coverage > 0.0
    assert seen[raster.centres[:, 0] < 4.8].all()
    assert not seen[raster.centres[:, 0] > 5.2].any()
    assert raster.seen_share() == pytest.approx(0.5, abs=0.02)
    assert raster.area_m2() == pytest.approx(98.0, abs=2.5)


def test_ground_beyond_map_is_not_searchable() -> None:
    raster = CoverageRaster(Ground(((5.0, 0.0), (15.0, 0.0), (15.0, 10.0), (5.0, 10.0)), 4.0, 3.0), room())
    assert raster.area_m2() == pytest.approx(50.0, rel=0.03)


def test_rotated_map_is_read_with_its_rotation() -> None:
    turned = ObstacleMap(room((0.0, 0.0, 1.0, 2.0)).blocked, 0.05, (3.0, 1.0, math.pi / 2))
    points = np.array([[2.0, 1.5], [2.9, 1.1], [1.1, 1.9], [0.9, 1.5], [2.0, 2.1], [3.1, 1.5]])
    assert turned.are_blocked(points).tolist() == [True, True, True, False, False, True]


@given(
    x=st.floats(0.5, 9.5),
    y=st.floats(0.5, 9.5),
    walls=st.lists(st.tuples(st.integers(1, 8), st.integers(1, 8), st.booleans()), max_size=4),
)
def test_visible_cells_match_sight_lines_of_shapely(
    x: float, y: float, walls: list[tuple[int, int, bool]]
) -> None:
    """Reference: shapely's lines from the robot to each cell, intersected with the walls as boxes."""
    boxes = [(a, b, a + (2.0 if lies else 0.2), b + (0.2 if lies else 2.0)) for a, b, lies in walls]
    obstacles = room(*boxes)
    if obstacles.are_blocked(np.array([[x, y]])).any():
        return
    raster = CoverageRaster(Ground(((0.0, 0.0), (10.0, 0.0), (10.0, 10.0), (0.0, 10.0)), 4.0, 4.0), obstacles)
    mine = np.zeros(len(raster.centres), bool)
    mine[raster.seen_from(x, y, 4.0)] = True
    solid = shapely.union_all([shapely.box(*box) for box in boxes])
    lines = [shapely.LineString([(x, y), centre]) for centre in raster.centres]
    theirs = ~shapely.intersects(lines, solid) & (shapely.length(lines) <= 4.0)
    assert np.mean(mine != theirs) <= 0.02


@pytest.mark.parametrize("yaw", [0.0, 2.5])
def test_pillar_hides_exactly_its_shadow(yaw: float) -> None:
    """The shadow of a pillar of 1 m at a distance of 5 m is a wedge, also on a rotated map."""
    turned = np.array([[math.cos(yaw), math.sin(yaw)], [-math.sin(yaw), math.cos(yaw)]])
    corners = np.array([[0.0, 0.0], [25.0, 0.0], [25.0, 25.0], [0.0, 25.0]]) @ turned
    blocked = np.zeros((500, 500), bool)
    blocked[240:260, 140:160] = True
    raster = CoverageRaster(
        Ground(tuple(map(tuple, corners)), 40.0, 25.0), ObstacleMap(blocked, 0.05, (0.0, 0.0, yaw))
    )
    seen = np.zeros(len(raster.centres), bool)
    x, y = np.array([2.0, 12.5]) @ turned
    seen[raster.seen_from(x, y, 25.0)] = True
    along, across = (raster.centres @ turned.T - (2.0, 12.5)).T
    hidden = (along > 5.0) & (abs(across) <= 0.1 * along)
    apart = np.hypot(along, across)
    assert np.mean((seen != ~hidden)[apart < 24.9]) < 0.003


def test_each_cell_is_looked_up_once_at_any_range(monkeypatch: pytest.MonkeyPatch) -> None:
    """Drives are computed during ticks: sampling rays took seconds per metre at a range of 20 m."""
    looked_up, at = list[int](), ObstacleMap.are_blocked

    def counted(self: ObstacleMap, points: Points) -> npt.NDArray[np.bool_]:
        looked_up.append(points.size // 2)
        return at(self, points)

    monkeypatch.setattr(ObstacleMap, "are_blocked", counted)
    raster = CoverageRaster(Ground(((0.0, 0.0), (10.0, 0.0), (10.0, 10.0), (0.0, 10.0)), 32.0, 20.0), room())
    raster.seen_from(5.0, 5.0, 20.0)
    assert sum(looked_up) <= len(raster.centres) + 1


def test_coverage_among_walls_matches_shapely_within_two_percent() -> None:
    """Reference: points of a finer grid, and shapely's sight lines to them from every 0.1 m of the drive."""
    boxes = [(4.0, 0.0, 4.2, 3.0), (4.0, 5.0, 4.2, 8.0), (7.0, 2.0, 10.0, 2.2)]
    ground = Ground(((0.5, 0.5), (9.5, 0.5), (9.5, 8.5), (6.0, 9.5), (0.5, 8.5)), 4.0, 2.5)
    drive = [(1.0, 1.0), (3.0, 4.0), (6.0, 4.0), (6.0, 7.0), (9.0, 7.0), (9.0, 4.0)]
    raster = CoverageRaster(ground, room(*boxes))
    raster.drive(drive)
    solid, way = shapely.union_all([shapely.box(*box) for box in boxes]), shapely.LineString(drive)
    searchable = shapely.Polygon(ground.polygon).difference(solid)
    grid = np.stack(np.meshgrid(np.arange(0.6, 9.5, 0.15), np.arange(0.6, 9.5, 0.15)), -1).reshape(-1, 2)
    places = grid[shapely.contains_xy(searchable, grid)]
    covered, eyes = (
        np.zeros(len(places)),
        shapely.line_interpolate_point(way, np.arange(0.05, way.length, 0.1)),
    )
    for eye in shapely.get_coordinates(eyes):
        [near] = np.nonzero(np.hypot(*(places - eye).T) <= 2.5)
        lines = shapely.linestrings(np.stack([np.broadcast_to(eye, (len(near), 2)), places[near]], axis=1))
        covered[near[~shapely.intersects(lines, solid)]] += 4.0 * 0.1 / (math.pi * 2.5**2)
    assert raster.mean_coverage() == pytest.approx(covered.mean(), rel=0.02)
    assert raster.pod() == pytest.approx((1.0 - np.exp(-covered)).mean(), rel=0.02)


def test_raster_text_restores_coverage_to_a_thousandth() -> None:
    raster = CoverageRaster(field())
    raster.drive([(10.0, 15.0), (30.0, 12.0)])
    again = CoverageRaster(field(), cells=raster.share_text())
    assert again.coverage == pytest.approx(raster.coverage, abs=0.0005)
    assert again.share_text() == raster.share_text()


@pytest.mark.parametrize("cells", ["no base64!", "AAAA"])
def test_invalid_raster_text_is_rejected(cells: str) -> None:
    with pytest.raises(ValueError, match="the text of the raster is invalid"):
        CoverageRaster(field(), cells=cells)


def test_raster_of_another_area_is_rejected() -> None:
    cells = CoverageRaster(Ground(((0.0, 0.0), (9.0, 0.0), (0.0, 9.0)), 3.2, 2.0)).share_text()
    with pytest.raises(ValueError, match="the raster belongs to another area"):
        CoverageRaster(field(), cells=cells)


def test_gaps_cover_cells_below_required_pod() -> None:
    raster = CoverageRaster(field(reach=3.0, width=6.0))
    for y in np.arange(8.0, 23.0, 2.0):
        raster.drive([(8.0, y), (32.0, y)])
    gaps = [shapely.Polygon(corners) for corners in raster.gaps(0.5)]
    missed = raster.centres[1.0 - np.exp(-raster.coverage) < 0.5]
    assert all(gap.is_valid for gap in gaps)
    assert sum(gap.area for gap in gaps) == pytest.approx(len(missed) * raster.cell_m**2, rel=0.01)
    joined = shapely.union_all(gaps)
    assert shapely.contains_xy(joined.buffer(1e-6), missed).all()
    assert not shapely.contains_xy(joined, 20.0, 15.0)


@given(seen=st.lists(st.booleans(), min_size=64, max_size=64))
def test_gaps_of_any_shape_are_valid_and_can_be_swept(seen: list[bool]) -> None:
    raster = CoverageRaster(Ground(((0.0, 0.0), (2.0, 0.0), (2.0, 2.0), (0.0, 2.0)), 4.0, 3.0))
    raster.coverage = np.where(seen, 9.0, 0.0)
    gaps = raster.gaps(0.8)
    assert all(shapely.Polygon(corners).is_valid for corners in gaps)
    if gaps:
        assert sweep(gaps, "parallel", 0.5, MapPose(x=0.0, y=0.0, yaw=0.0))


@given(x=st.floats(-50.0, 50.0), y=st.floats(-50.0, 50.0))
def test_unsearched_ground_is_one_gap(x: float, y: float) -> None:
    corners = ((x, y), (x + 4.0, y), (x + 4.0, y + 3.0), (x, y + 3.0))
    [gap] = CoverageRaster(Ground(corners, 4.0, 3.0)).gaps(0.5)
    assert len(gap) == 4


def test_well_searched_ground_has_no_gaps() -> None:
    raster = CoverageRaster(Ground(((0.0, 0.0), (2.0, 0.0), (2.0, 2.0), (0.0, 2.0)), 4.0, 3.0))
    for _ in range(20):
        raster.drive([(0.0, 1.0), (2.0, 1.0)])
    assert raster.gaps(0.8) == []
