"""Tests of planning the route on the map before a run."""

import numpy as np
import pytest

from sar_compiler.sim.occupancy import FREE, OCCUPIED, OccupancyMap
from sar_compiler.sim.planner import Planner, plan_route, reachable_areas

RADIUS = 0.2


@pytest.fixture(scope="module")
def two_rooms():
    """Two rooms of 4 m by 4 m, beginning at (0, 0), with a wall at x = 4 without a door."""
    cells = np.full((40, 81), FREE, dtype=np.int8)
    cells[:, 40] = OCCUPIED
    return OccupancyMap(cells, 0.1, 0.0, 0.0)


def test_distances_follow_route_between_stops(two_rooms):
    stops = [("there", 3.0, 1.0), ("back", 1.0, 1.0)]
    legs = plan_route(Planner(two_rooms, RADIUS), (1.0, 1.0), stops)
    assert [leg.trouble for leg in legs] == ["", ""]
    assert [leg.distance for leg in legs] == pytest.approx([2.0, 2.0], abs=0.15)


@pytest.mark.parametrize(
    ("x", "y", "trouble"),
    [
        (9.0, 1.0, "the position is outside the map"),
        (4.05, 1.0, "there is not enough free ground for the robot at this position"),
        (3.9, 1.0, "there is not enough free ground for the robot at this position"),
        (6.0, 1.0, "no path leads to this position"),
    ],
)
def test_unreachable_stop_is_reported_with_reason(two_rooms, x, y, trouble):
    [leg] = plan_route(Planner(two_rooms, RADIUS), (1.0, 1.0), [("away", x, y)])
    assert (leg.distance, leg.trouble) == (None, trouble)


def test_route_continues_from_last_reachable_stop(two_rooms):
    stops = [("first", 3.0, 1.0), ("behind the wall", 6.0, 1.0), ("second", 3.0, 3.0)]
    legs = plan_route(Planner(two_rooms, RADIUS), (1.0, 1.0), stops)
    assert legs[1].distance is None
    assert legs[2].distance == pytest.approx(2.0, abs=0.15)


def test_start_in_wall_is_reported_for_every_stop(two_rooms):
    legs = plan_route(Planner(two_rooms, RADIUS), (4.05, 1.0), [("a", 1.0, 1.0), ("b", 2.0, 1.0)])
    assert {leg.trouble for leg in legs} == {"there is not enough free ground for the robot at its start"}


def test_stop_outside_geofence_and_path_leaving_geofence_are_distinguished(two_rooms):
    stops = [("outside", 2.0, 1.0), ("inside", 3.5, 1.0)]
    legs = plan_route(Planner(two_rooms, RADIUS), (0.5, 1.0), stops, lambda x, _: not 1.5 < x < 3.0)
    assert [leg.trouble for leg in legs] == [
        "the position is outside the geofence",
        "the path to this position leaves the geofence",
    ]
    assert [leg.distance for leg in legs] == [None, pytest.approx(3.0, abs=0.15)]


class TestAreas:
    def reach(self, occupancy, *corners, start=(1.0, 1.0)):
        [found] = reachable_areas(Planner(occupancy, RADIUS), start, [corners])
        return found

    def test_room_is_reached_except_corners(self, two_rooms):
        room = self.reach(two_rooms, (0.0, 0.0), (4.0, 0.0), (4.0, 4.0), (0.0, 4.0))
        assert room.area_m2 == pytest.approx(16.0)
        assert room.reached_m2 == pytest.approx(16.0, abs=0.3)
        assert (room.cut_off_m2, room.cut_off_at) == (0.0, None)

    def test_ground_behind_wall_is_cut_off_and_located(self, two_rooms):
        both = self.reach(two_rooms, (0.0, 0.0), (8.0, 0.0), (8.0, 4.0), (0.0, 4.0))
        assert both.reached_m2 == pytest.approx(16.0, abs=0.3)
        assert both.cut_off_m2 == pytest.approx(15.6, abs=0.3)
        assert both.cut_off_at == pytest.approx((6.1, 2.0), abs=0.3)

    def test_largest_cut_off_part_is_located(self, two_rooms):
        cells = two_rooms.cells.copy()
        cells[10, 41:] = OCCUPIED
        split = OccupancyMap(cells, 0.1, 0.0, 0.0)
        beyond = self.reach(split, (4.1, 0.0), (8.0, 0.0), (8.0, 4.0), (4.1, 4.0))
        assert beyond.reached_m2 == 0.0
        assert beyond.cut_off_m2 == pytest.approx(15.2, abs=0.3)
        assert beyond.cut_off_at[1] == pytest.approx(2.5, abs=0.4)

    def test_ground_off_map_is_neither_reached_nor_cut_off(self, two_rooms):
        away = self.reach(two_rooms, (-4.0, 0.0), (0.0, 0.0), (0.0, 4.0), (-4.0, 4.0))
        assert (away.reached_m2, away.cut_off_m2) == (0.0, 0.0)
        half = self.reach(two_rooms, (-3.0, 0.0), (3.0, 0.0), (3.0, 4.0), (-3.0, 4.0))
        assert [each.off_map_m2 for each in (away, half)] == pytest.approx([16.0, 12.0])

    def test_door_too_narrow_for_robot_is_impassable(self, two_rooms):
        cells = two_rooms.cells.copy()
        cells[18:21, 40] = FREE
        doored = OccupancyMap(cells, 0.1, 0.0, 0.0)
        assert self.reach(doored, (5.0, 1.0), (7.0, 1.0), (7.0, 3.0), (5.0, 3.0)).reached_m2 == 0.0
        cells = cells.copy()
        cells[15:24, 40] = FREE
        wide = OccupancyMap(cells, 0.1, 0.0, 0.0)
        room = self.reach(wide, (5.0, 1.0), (7.0, 1.0), (7.0, 3.0), (5.0, 3.0))
        assert room.reached_m2 == pytest.approx(4.0, abs=0.1)
