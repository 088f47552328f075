"""Tests of the geofence: its parameter, and the positions inside."""

import pytest

from sar_compiler.missions.parameter_reader import ParameterError, ParameterReader
from search_and_rescue.zone_manager import Geofence, read_fence

ELL = Geofence([(0.0, 0.0), (4.0, 0.0), (4.0, 2.0), (2.0, 2.0), (2.0, 4.0), (0.0, 4.0)])


@pytest.mark.parametrize("corners", [ELL.corners, ELL.corners[::-1]], ids=["one way round", "the other"])
@pytest.mark.parametrize(
    ("x", "y", "inside"),
    [(1.0, 1.0, True), (3.0, 1.0, True), (1.0, 3.0, True), (3.0, 3.0, False), (-1.0, 1.0, False), (5.0, 2.0, False)],
)  # fmt: skip
def test_geofence_contains_positions_inside_its_corners(corners, x, y, inside):
    assert Geofence(corners).contains(x, y) is inside


def test_empty_geofence_allows_every_position():
    assert not Geofence()
    assert Geofence().contains(1e9, -1e9)


def test_parameter_lists_corners():
    reader = ParameterReader({"geofence": [0.0, 0.0, 4.0, 0.0, 0.0, 3.0]})
    assert read_fence(reader).corners == ((0.0, 0.0), (4.0, 0.0), (0.0, 3.0))
    assert reader.problems == []


@pytest.mark.parametrize(
    ("value", "said"),
    [
        ([0.0, 1.0, 2.0, 3.0], "contains 4 numbers"),
        ([0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0], "contains 7 numbers"),
        ([0.0, 1.0, 2.0, 3.0, 4.0, float("nan")], "contains the number nan"),
        ("everywhere", "must be a list of numbers, but is the string 'everywhere'"),
        (["a"], "contains the string 'a'"),
        ([True] * 6, "contains true"),
    ],
)
def test_invalid_parameter_is_reported(value, said):
    reader = ParameterReader({"geofence": value})
    assert not read_fence(reader)
    with pytest.raises(ParameterError, match=said):
        reader.complain()
