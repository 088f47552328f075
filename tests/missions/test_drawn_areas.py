"""Tests of areas that the operator draws during a mission."""

import math
from collections.abc import Sequence
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import pytest

from sar_compiler.journal.journal_entries import JournalEntry
from sar_compiler.missions.parameter_reader import ParameterReader
from search_and_rescue.actions.sweep_leaves import PlanSweep
from search_and_rescue.drawn_areas import DrawingError, DrawnAreas
from search_and_rescue.plugin import MISSION
from search_and_rescue.search import Search

if TYPE_CHECKING:
    from tests.missions.mission_stage import Stage

SQUARE = [(4.0, 0.0), (8.0, 0.0), (8.0, 4.0), (4.0, 4.0)]
PARAMETERS: dict[str, object] = {
    "zone_order": ["a", "b"],
    **{f"zones.a.{key}": value for key, value in {"x": 1.0, "y": 0.0, "yaw": 0.0}.items()},
    **{f"zones.b.{key}": value for key, value in {"x": 3.0, "y": 0.0, "yaw": 0.0}.items()},
    "base_station.x": 0.0,
    "cruise_speed_mps": 0.5,
    "geofence": [-10.0, -10.0, 10.0, -10.0, 10.0, 10.0, -10.0, 10.0],
    "zones.b.polygon": [2.0, -1.0, 4.0, -1.0, 4.0, 1.0, 2.0, 1.0],
    "zones.b.detection_range": 1.0,
    "zones.b.visibility": "low",
}
LIKELY: dict[str, object] = {"zones.a.poa": 0.6, "zones.a.pod": 0.8, "zones.b.poa": 0.4, "zones.b.pod": 0.5}


def begin_search(**more: object) -> Search:
    reader = ParameterReader(PARAMETERS | more)
    run = MISSION.begin(reader)
    reader.complain()
    assert isinstance(run, Search)
    return run


def area_request(zone: str = "c", corners: Sequence[tuple[float, float]] = SQUARE, **values: Any) -> Any:
    points = [SimpleNamespace(x=x, y=y) for x, y in corners]
    header = SimpleNamespace(frame_id=values.get("frame", "map"))
    return SimpleNamespace(
        zone_id=zone,
        outline=SimpleNamespace(header=header, polygon=SimpleNamespace(points=points)),
        poa=values.get("poa", math.nan),
        detection_range=values.get("detection_range", math.nan),
    )


def draw(search: Search, *what: Any, **values: Any) -> str:
    def off_map(x: float, y: float) -> str:
        return f"({x:g}, {y:g}) is not on the map" if x > 9.0 else ""

    return DrawnAreas(search.zones, search.sweeps, search.fence, off_map).add_area(
        area_request(*what, **values)
    )


def test_drawn_area_is_searched_last_from_inside() -> None:
    search = begin_search()
    assert draw(search) == "'c' was added"
    *_, last = search.zones.remaining_zones()
    assert (last["id"], last["x"], last["y"]) == ("c", 6.0, 2.0)
    assert search.sweeps.grounds["c"].polygon == tuple(SQUARE)
    assert [each.name for each in search.display().landmarks if each.kind == "area"] == ["b", "c"]


def test_detection_range_defaults_to_that_of_other_areas() -> None:
    search = begin_search()
    draw(search)
    draw(search, "d", detection_range=3.0)
    assert search.sweeps.grounds["c"][1:] == pytest.approx((1.1, 1.0))
    assert search.sweeps.grounds["d"][1:] == pytest.approx((3.3, 3.0))


def test_new_probability_scales_down_others_if_sum_exceeds_one() -> None:
    search = begin_search(**LIKELY)
    assert draw(search, poa=0.5) == "'c' was added, and the POA of every other zone was multiplied by 0.50"
    assert {name: area.poa for name, area in search.zones.areas.items()} == pytest.approx(
        {"a": 0.3, "b": 0.2, "c": 0.5}
    )
    look = search.zones.areas["c"]
    assert (look.pod, look.look_sec) == pytest.approx((0.593, 16.0 * 0.9 / 1.1 / 0.5), rel=0.01)


def test_other_probabilities_stay_if_sum_allows() -> None:
    search = begin_search(**LIKELY | {"zones.a.poa": 0.3})
    assert draw(search, poa=0.3) == "'c' was added"
    assert [area.poa for area in search.zones.areas.values()] == pytest.approx([0.3, 0.4, 0.3])


def test_area_can_be_changed_before_its_search() -> None:
    search = begin_search(**LIKELY)
    assert draw(search, "b", (), poa=0.2) == "'b' was changed"
    assert search.zones.areas["b"].poa == 0.2
    assert search.zones.areas["b"].pod == 0.5
    draw(search, "b")
    assert search.sweeps.grounds["b"].polygon == tuple(SQUARE)
    assert search.zones.areas["b"].poa == 0.2
    assert [zone["id"] for zone in search.zones.remaining_zones()] == ["a", "b"]
    assert search.zones.remaining_zones()[1]["x"] == 6.0


@pytest.mark.parametrize("zone", ["a", "b"])
def test_area_cannot_be_changed_after_start_of_its_search(zone: str) -> None:
    search = begin_search()
    search.zones.select_next_zone()
    with pytest.raises(
        DrawingError, match=f"the search of '{zone}' has already started: draw an area with another name"
    ):
        draw(search, zone)


@pytest.mark.parametrize(
    ("what", "values", "said"),
    [
        ((""), {}, "the area has no name"),
        (("c", SQUARE[:2]), {}, "the polygon has 2 corners: draw at least three"),
        (("c", ()), {}, "the area has no polygon: draw at least three corners"),
        (("c", [(0.0, 0.0), (4.0, 4.0), (4.0, 0.0), (0.0, 4.0)]), {}, "crosses or touches itself at"),
        (
            ("c", [(0.0, 0.0), (0.0, 9.0), (-12.0, 0.0)]),
            {},
            r"has the corner \(-12, 0\) outside the geofence",
        ),
        (
            ("c", [(0.0, 0.0), (0.0, 9.0), (9.5, 0.0)]),
            {},
            r"has an invalid corner: \(9.5, 0\) is not on the map",
        ),
        (("c",), {"frame": "odom"}, "the outline is in the frame 'odom', but must be in 'map'"),
        (("c",), {"detection_range": 0.0}, "the detection range is 0: write metres above 0"),
        (("c",), {"poa": 1.5}, "the probability is 1.5: write a number from 0 to 1"),
        (("c",), {}, r"the probability \(poa\) is missing"),
    ],
)
def test_invalid_area_is_rejected_with_reason(what: Any, values: dict[str, Any], said: str) -> None:
    search = begin_search(**LIKELY)
    with pytest.raises(DrawingError, match=said):
        draw(search, *(what or ("",)), **values)
    assert [zone["id"] for zone in search.zones.remaining_zones()] == ["a", "b"]
    assert set(search.sweeps.grounds) == {"b"}


def test_probability_is_rejected_if_no_zone_has_one() -> None:
    with pytest.raises(DrawingError, match="no zone of this mission has a probability"):
        draw(begin_search(), poa=0.2)


def test_area_is_rejected_on_way_home() -> None:
    search = begin_search()
    search.zones.select_next_zone()
    search.zones.select_next_zone()
    with pytest.raises(DrawingError, match="the robot returns home"):
        draw(search)


def test_detection_range_is_required_without_other_areas() -> None:
    bare = {
        key: value
        for key, value in PARAMETERS.items()
        if key.rpartition(".")[2] not in ("polygon", "detection_range", "visibility")
    }
    reader = ParameterReader(bare)
    search = MISSION.begin(reader)
    assert isinstance(search, Search)
    with pytest.raises(DrawingError, match="the detection range is missing"):
        draw(search)
    draw(search, detection_range=2.0)
    assert search.sweeps.grounds["c"].sweep_width == pytest.approx(3.2)


def test_later_run_has_drawn_areas() -> None:
    events: list[tuple[str, dict[str, Any]]] = []
    search = begin_search(**LIKELY)
    search.zones.journal.record_event = lambda kind, **data: events.append((kind, data))  # type: ignore[method-assign]
    draw(search, poa=0.5)
    [(kind, data)] = events
    later = begin_search(**LIKELY)
    later.apply(JournalEntry(1, 1, 0.0, 0.0, kind, data))
    assert later.sweeps.grounds["c"].polygon == tuple(SQUARE)
    assert later.zones.areas["a"].poa == pytest.approx(0.3)
    assert (
        later.sentence(JournalEntry(1, 1, 0.0, 0.0, kind, data))
        == "the operator: the area c was drawn, with 4 corners"
    )
    assert later.places()["c"] == (6.0, 2.0)


@pytest.mark.ros
def test_add_area_service_responds_and_logs(stage: "Stage") -> None:
    from geometry_msgs.msg import Point32
    from sar_interfaces.srv import AddArea

    search = begin_search()
    leaf = stage.take(
        PlanSweep("PlanSweep", search.zones, search.sweeps, orders=search.orders, fence=search.fence)
    )
    client = stage.host().node.create_client(AddArea, f"{stage.node.get_fully_qualified_name()}/add_area")
    stage.until(client.service_is_ready, "the service")

    def answered(name: str) -> tuple[bool, str]:
        request = AddArea.Request(zone_id=name, poa=math.nan, detection_range=math.nan)
        request.outline.header.frame_id = "map"
        request.outline.polygon.points = [Point32(x=x, y=y) for x, y in SQUARE]
        answer = client.call_async(request)
        stage.until(answer.done, "the answer")
        response: Any = answer.result()
        return response.success, response.message

    assert answered("c") == (True, "'c' was added")
    assert answered("") == (False, "the area has no name: write a name")
    assert stage.lines == ["Command add_area by the operator: 'c' was added."]
    assert stage.warnings == [
        "Command add_area by the operator: refused, the area has no name: write a name."
    ]
    leaf.shutdown()
    stage.until(lambda: not client.service_is_ready(), "the end of the service")
