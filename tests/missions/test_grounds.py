"""Tests of the ground of zones: its parameters, and errors and notes before the run."""

from typing import Any

import pytest

from sar_compiler.missions import ParameterError, ParameterReader
from search_and_rescue.plugin import MISSION
from search_and_rescue.search import Search

SQUARE = [0.0, 0.0, 4.0, 0.0, 4.0, 4.0, 0.0, 4.0]


def begin_search(**changed: object) -> Search:
    """Begin a search of one zone with a polygon, with changed parameters; None removes a parameter."""
    given: dict[str, object] = {f"zones.a.{name}": 1.0 for name in ("x", "y", "yaw")}
    given |= {"zone_order": ["a"], "zones.a.polygon": SQUARE, "zones.a.detection_range": 2.0}
    given |= {
        key.replace("__", ".") if key.startswith("geo") else f"zones.a.{key}": value
        for key, value in changed.items()
    }
    reader = ParameterReader({key: value for key, value in given.items() if value is not None})
    search = MISSION.begin(reader)
    reader.complain()
    return search


@pytest.mark.parametrize(
    ("changed", "width", "reach"),
    [
        ({}, 3.2, 2.0),
        ({"visibility": "high"}, 3.6, 2.0),
        ({"visibility": "low"}, 2.2, 2.0),
        ({"sweep_width": 1.5}, 1.5, 2.0),
        ({"sweep_width": 3.2, "detection_range": None}, 3.2, 2.0),
    ],
)
def test_sweep_width_and_detection_range_follow_from_each_other(
    changed: dict[str, Any], width: float, reach: float
) -> None:
    ground = begin_search(**changed).sweeps.grounds["a"]
    assert ground.polygon == ((0.0, 0.0), (4.0, 0.0), (4.0, 4.0), (0.0, 4.0))
    assert list(ground[1:]) == pytest.approx([width, reach])


def test_zone_without_polygon_has_no_ground() -> None:
    search = begin_search(polygon=None, detection_range=None)
    assert search.sweeps.grounds == {}
    assert "grounds" not in search.identity()
    assert not any(each.kind == "area" for each in search.display().landmarks)


def test_area_and_gap_kinds_exist_without_any_polygon() -> None:
    search = begin_search(polygon=None, detection_range=None)
    assert {"area", "gap"} <= {kind.name for kind in search.kinds}


def test_different_ground_changes_mission_identity() -> None:
    assert begin_search().identity() != begin_search(detection_range=3.0).identity()


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"polygon": [0.0, 0.0, 1.0]}, "zones.a.polygon: must contain x and y of three or more corners"),
        ({"polygon": [0.0, 0.0, 1.0, 1.0]}, "zones.a.polygon: must contain x and y of three or more corners"),
        ({"polygon": [0.0, 0.0, 4.0, 4.0, 4.0, 0.0, 0.0, 4.0]}, "zones.a.polygon: crosses or touches itself at (2.00, 2.00)"),
        ({"polygon": [0.0, 0.0, 2.0, 2.0, 4.0, 4.0]}, "zones.a.polygon: has no area: all corners are on one line"),
        ({"polygon": "here"}, "zones.a.polygon: must be a list of numbers"),
        ({"polygon": None}, "zones.a.detection_range: has no effect without a polygon: add zones.a.polygon"),
        ({"detection_range": None}, "zones.a.sweep_width: is missing: add zones.a.detection_range"),
        ({"detection_range": -1.0}, "zones.a.detection_range: must be above 0 and at most 1000, but is -1"),
        ({"sweep_width": 0.0}, "zones.a.sweep_width: must be above 0 and at most 1000, but is 0"),
        ({"detection_range": 1e6}, "zones.a.detection_range: must be above 0 and at most 1000, but is 1e+06"),
        ({"sweep_width": 4.1}, "zones.a.sweep_width: is 4.1 m, more than twice zones.a.detection_range: write at most 4"),
        ({"visibility": "foggy"}, "zones.a.visibility: must be one of high, medium, low, but is 'foggy'"),
        ({"geofence": [-1.0, -1.0, 3.0, -1.0, 3.0, 5.0, -1.0, 5.0]}, "zones.a.polygon: has the corner (4, 0) outside the geofence"),
        ({"geofence": [-1.0, -1.0, 5.0, -1.0, 5.0, 5.0, 2.1, 5.0, 2.1, 1.0, 1.9, 1.0, 1.9, 5.0, -1.0, 5.0]}, "zones.a.polygon: leaves the geofence between two corners, at (2.10, 1.00)"),
        (
            {"polygon": [11.5, 48.1, 11.501, 48.1, 11.501, 48.101], "georeference__lat": 48.1, "georeference__lon": 11.5},
            "zones.a.polygon: looks like degrees: write metres in the frame `map`",
        ),
        (
            {"polygon": [48.1, 11.5, 48.1, 11.501, 48.101, 11.501], "georeference__lat": 48.1, "georeference__lon": 11.5},
            "zones.a.polygon: looks like degrees",
        ),
        ({"priority": "high"}, "zones.a.priority: must be a number"),
    ],
)  # fmt: skip
def test_ground_parameter_error_is_reported_before_run(changed: dict[str, Any], said: str) -> None:
    with pytest.raises(ParameterError) as raised:
        begin_search(**changed)
    [problem] = raised.value.problems
    assert str(problem).startswith(said)


@pytest.mark.parametrize(
    ("changed", "noted"),
    [
        ({}, []),
        ({"x": 6.0}, []),
        ({"x": 6.5}, ["the pose (6.5, 1) of zones.a is 2.5 m outside the polygon of zones.a"]),
        (
            {"sweep_width": 0.08},
            [
                "zones.a needs more than 2000 stops (the maximum of a sweep) at coverage 0.9: divide the zone, or check sweep_width"
            ],
        ),
        ({"sweep_width": 0.081}, []),
    ],
)
def test_suspicious_ground_is_noted_before_run(changed: dict[str, Any], noted: list[str]) -> None:
    given: dict[str, object] = {f"zones.a.{name}": 1.0 for name in ("x", "y", "yaw")}
    given |= {"zone_order": ["a"], "zones.a.polygon": SQUARE, "zones.a.detection_range": 2.0}
    reader = ParameterReader(given | {f"zones.a.{key}": value for key, value in changed.items()})
    MISSION.begin(reader)
    assert (reader.problems, reader.notes) == ([], noted)


def test_polygon_may_follow_geofence_between_its_corners() -> None:
    fence = [-1.0, 0.0, 5.0, 0.0, 5.0, 5.0, -1.0, 5.0]
    assert begin_search(geofence=fence).sweeps.grounds["a"].polygon[0] == (0.0, 0.0)


def test_polygon_in_metres_is_accepted_with_georeference() -> None:
    search = begin_search(georeference__lat=48.1, georeference__lon=11.5)
    assert search.sweeps.grounds["a"].polygon == ((0.0, 0.0), (4.0, 0.0), (4.0, 4.0), (0.0, 4.0))
