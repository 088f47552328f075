"""The way over the map, before the flight."""

import numpy as np
import pytest

from sar_compiler.sim.occupancy import FREE, OCCUPIED, OccupancyMap
from sar_compiler.sim.planner import plan_route

RADIUS = 0.2


@pytest.fixture(scope="module")
def two_rooms():
    """Two rooms of 4 m by 4 m, from (0, 0) on, with a wall at x = 4 that has no door."""
    cells = np.full((40, 81), FREE, dtype=np.int8)
    cells[:, 40] = OCCUPIED
    return OccupancyMap(cells, 0.1, 0.0, 0.0)


def test_distances_are_those_of_the_way_from_place_to_place(two_rooms):
    stops = [("there", 3.0, 1.0), ("back", 1.0, 1.0)]
    legs = plan_route(two_rooms, RADIUS, (1.0, 1.0), stops)
    assert [leg.trouble for leg in legs] == ["", ""]
    assert [leg.distance for leg in legs] == pytest.approx([2.0, 2.0], abs=0.15)


@pytest.mark.parametrize(
    ("x", "y", "trouble"),
    [
        (9.0, 1.0, "it is outside the map"),
        (4.05, 1.0, "the robot does not fit on free ground there"),
        (3.9, 1.0, "the robot does not fit on free ground there"),
        (6.0, 1.0, "no way leads there"),
    ],
)
def test_a_place_that_cannot_be_reached_is_named_with_the_reason(two_rooms, x, y, trouble):
    [leg] = plan_route(two_rooms, RADIUS, (1.0, 1.0), [("away", x, y)])
    assert (leg.distance, leg.trouble) == (None, trouble)


def test_the_way_goes_on_from_the_last_place_that_can_be_reached(two_rooms):
    stops = [("first", 3.0, 1.0), ("behind the wall", 6.0, 1.0), ("second", 3.0, 3.0)]
    legs = plan_route(two_rooms, RADIUS, (1.0, 1.0), stops)
    assert legs[1].distance is None
    assert legs[2].distance == pytest.approx(2.0, abs=0.15)


def test_a_start_in_a_wall_is_told_of_every_place(two_rooms):
    legs = plan_route(two_rooms, RADIUS, (4.05, 1.0), [("a", 1.0, 1.0), ("b", 2.0, 1.0)])
    assert {leg.trouble for leg in legs} == {"the robot does not fit on free ground at its start"}


def test_a_place_outside_the_geofence_and_a_way_that_leaves_it_are_told_apart(two_rooms):
    stops = [("outside", 2.0, 1.0), ("inside", 3.5, 1.0)]
    legs = plan_route(two_rooms, RADIUS, (0.5, 1.0), stops, lambda x, _: not 1.5 < x < 3.0)
    assert [leg.trouble for leg in legs] == [
        "it is outside the geofence",
        "the way there leaves the geofence",
    ]
    assert [leg.distance for leg in legs] == [None, pytest.approx(3.0, abs=0.15)]
