"""The geofence: reading it, and what is inside."""

import pytest

from sar_compiler.missions.parameter_reader import ParameterError, ParameterReader
from search_and_rescue.zone_manager import Geofence, read_fence

ELL = Geofence([(0.0, 0.0), (4.0, 0.0), (4.0, 2.0), (2.0, 2.0), (2.0, 4.0), (0.0, 4.0)])


@pytest.mark.parametrize("corners", [ELL.corners, ELL.corners[::-1]], ids=["one way round", "the other"])
@pytest.mark.parametrize(
    ("x", "y", "inside"),
    [(1.0, 1.0, True), (3.0, 1.0, True), (1.0, 3.0, True), (3.0, 3.0, False), (-1.0, 1.0, False), (5.0, 2.0, False)],
)  # fmt: skip
def test_a_fence_contains_what_is_inside_its_corners(corners, x, y, inside):
    assert Geofence(corners).contains(x, y) is inside


def test_without_a_fence_every_place_is_allowed():
    assert not Geofence()
    assert Geofence().contains(1e9, -1e9)


def test_the_parameter_lists_the_corners():
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
def test_a_parameter_that_is_no_area_is_a_mistake(value, said):
    reader = ParameterReader({"geofence": value})
    assert not read_fence(reader)
    with pytest.raises(ParameterError, match=said):
        reader.complain()
