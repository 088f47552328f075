"""Zones with probabilities: their parameters, the choice of the next one, and what looks make of the map."""

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest
from py_trees.common import Status

from sar_compiler.journal.opening import open_journal
from sar_compiler.missions import ParameterError, ParameterReader
from sar_compiler.missions.search_and_rescue.actions.zones import ChooseZone
from sar_compiler.missions.search_and_rescue.plugin import MISSION
from sar_compiler.missions.search_and_rescue.search import Search
from sar_compiler.missions.search_and_rescue.search_theory import Area
from sar_compiler.missions.search_and_rescue.zone_manager import ZoneManager

if TYPE_CHECKING:
    from tests.missions.mission_stage import Stage

BASE = {"x": 0.0, "y": 0.0, "yaw": 0.0}
AREAS = {"a": Area(0.1, 0.5, 5.0), "b": Area(0.2, 0.5, 5.0), "c": Area(0.6, 0.5, 5.0)}


def searching(areas: dict[str, Area] | None = None) -> Search:
    """Return a search of three zones, 1, 2 and 3 m from the base station in this order."""
    plan = [{"id": name, "x": float(x), "y": 0.0, "yaw": 0.0} for x, name in enumerate("abc", 1)]
    return Search(ZoneManager(plan, BASE, areas=AREAS if areas is None else areas, speed_mps=0.5))


def order(zones: ZoneManager) -> str:
    return "".join(zone["id"] for zone in zones.remaining_zones())


def status(leaf: ChooseZone) -> Status:
    """Return what one tick of a leaf comes to."""
    leaf.tick_once()
    return leaf.status


def probabilities(**changed: object) -> dict[str, object]:
    """Return the parameters of two zones with probabilities, some of them changed; None for none."""
    given: dict[str, object] = {"zone_order": ["a", "b"]}
    for zone in "ab":
        given |= {f"zones.{zone}.{name}": 1.0 for name in ("x", "y", "yaw")}
        given |= {f"zones.{zone}.poa": 0.5, f"zones.{zone}.pod": 0.8}
    given |= {f"zones.{key.replace('__', '.')}": value for key, value in changed.items()}
    return {key: value for key, value in given.items() if value is not None}


def begun(parameters: dict[str, object]) -> ZoneManager:
    reader = ParameterReader(parameters)
    search = MISSION.begin(reader)
    reader.complain()
    return search.zones


def test_the_parameters_say_what_is_expected_of_a_look() -> None:
    assert begun(probabilities(b__look_sec=30)).areas == {"a": Area(0.5, 0.8, 0.0), "b": Area(0.5, 0.8, 30.0)}


def test_without_probabilities_there_is_no_map() -> None:
    bare = {key: value for key, value in probabilities().items() if not key.endswith(("poa", "pod"))}
    assert begun(bare).areas == {}


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"a__poa": 0.6}, "zones.a.poa: the zones' poa sum to 1.1: write 1 at most"),
        ({"a__poa": 1.5}, "zones.a.poa: must be a probability from 0 to 1, is 1.5"),
        ({"b__pod": -0.5}, "zones.b.pod: must be a probability from 0 to 1, is -0.5"),
        ({"b__poa": None}, "zones.b.poa: is missing"),
        ({"b__pod": None}, "zones.b.pod: is missing"),
        ({"a__look_sec": -1}, "zones.a.look_sec: must be 0 or above, is -1"),
        ({"a__poa": "half"}, "zones.a.poa: must be a number"),
    ],
)
def test_each_mistake_in_the_probabilities_is_named_before_the_flight(
    changed: dict[str, Any], said: str
) -> None:
    with pytest.raises(ParameterError) as refused:
        begun(probabilities(**changed))
    assert said in str(refused.value)
    assert "mistakes" not in str(refused.value)


def test_a_speed_that_is_none_is_told_once() -> None:
    from sar_compiler.ros.parameter_reader import read_run

    reader = ParameterReader({**probabilities(), "cruise_speed_mps": -1.0})
    MISSION.begin(reader)
    read_run(reader)
    assert [problem.key for problem in reader.problems] == ["cruise_speed_mps"]


def test_the_chosen_zone_is_the_current_one_and_the_others_keep_their_order() -> None:
    zones = searching().zones
    zones.choose("c")
    assert order(zones) == "cab"
    zones.advance()
    zones.choose("b")
    assert order(zones) == "ba"
    assert zones.current_index() == 1


def test_a_zone_that_is_not_left_cannot_be_chosen() -> None:
    zones = searching().zones
    zones.advance()
    with pytest.raises(ValueError, match="a is not left then"):
        zones.choose("a")


def test_a_postponed_zone_may_be_chosen_again_when_all_others_were_tried_as_often() -> None:
    zones = searching().zones
    zones.choose("c")
    zones.postpone()
    assert [zone["id"] for zone in zones.eligible_zones()] == ["a", "b"]
    zones.postpone()
    zones.advance()
    assert [zone["id"] for zone in zones.eligible_zones()] == ["c", "a"]


def test_each_look_lowers_its_zone_raises_the_others_and_counts_for_success() -> None:
    search = searching()
    search.record.zone_searched("c", None)
    assert search.zones.poa_map().now() == pytest.approx({"a": 0.1 / 0.7, "b": 0.2 / 0.7, "c": 0.3 / 0.7})
    search.record.zone_searched("b", (2.0, 1.0))
    assert search.zones.poa_map().pos() == pytest.approx(0.6 * 0.5 + 0.2 * 0.5)
    shown = search.display()
    assert [each.text for each in shown.figures][-1] == "probability of success 40 %"
    details = {
        each.name: each.details.get("probability now") for each in shown.landmarks if each.kind == "zone"
    }
    assert details == {"a": "16.7%", "b": "16.7%", "c": "50.0%"}


def test_a_search_without_probabilities_shows_what_it_did_before() -> None:
    shown = searching({}).display()
    assert [each.name for each in shown.figures] == ["zones visited", "survivors found", "survivors reported"]
    assert not any("probability now" in each.details for each in shown.landmarks)
    assert len(searching({}).greeting()) == 2
    assert "areas" not in searching({}).identity()


def test_other_probabilities_make_another_mission() -> None:
    assert searching().identity() != searching({**AREAS, "a": Area(0.0, 0.5, 5.0)}).identity()


def test_the_plan_is_told_before_the_flight_with_its_times_and_chances() -> None:
    # 3 m, 1 m and 1 m at 0.5 m/s are 9, 3 and 3 s with the detours; each look takes 5 s.
    assert searching().greeting()[2:] == [
        "By expected_find (18 s to the first find, if there is one; ways are straight lines times 1.5):",
        "  c: searched after 14 s, POS 30%",
        "  b: searched after 22 s, POS 40%",
        "  a: searched after 30 s, POS 45%",
    ]


def test_a_way_that_nobody_has_planned_is_the_straight_line_with_detours() -> None:
    zones = searching().zones
    assert zones.way_m(zones.base_pose(), {"x": 3.0, "y": -4.0, "yaw": 1.0}) == 7.5


def test_ways_begin_where_it_was_looked_last() -> None:
    search = searching()
    assert search.zones.tour(search.zones.remaining_zones()).from_start == [3.0, 6.0, 9.0]
    search.record.zone_searched("c", None)
    assert search.zones.tour(search.zones.remaining_zones()).from_start == [6.0, 3.0, 0.0]
    search.record.base_reached()
    assert search.zones.tour(search.zones.remaining_zones()).from_start == [3.0, 6.0, 9.0]


@pytest.fixture
def journal(tmp_path: Path) -> Path:
    return tmp_path / "search.journal"


def test_a_resumed_search_has_the_same_map_and_the_same_zone(journal: Path) -> None:
    def opened(search: Search, *, resume: bool) -> Any:
        kept = open_journal(journal, resume=resume)
        search.keep_in(kept)
        kept.begin({}, {})
        return kept

    first, second = searching(), searching()
    kept = opened(first, resume=False)
    first.zones.choose("c")
    first.record.zone_searched("c", None)
    first.zones.advance()
    first.zones.choose("b")
    kept.close()
    kept = opened(second, resume=True)
    assert [second.sentence(fact) for fact in kept.facts() if fact.kind == "zone_chosen"] == [
        "chose c",
        "chose b",
    ]
    kept.close()
    assert second.zones.poa_map() == first.zones.poa_map()
    assert order(second.zones) == order(first.zones) == "ba"
    tours = [each.zones.tour(each.zones.remaining_zones()) for each in (first, second)]
    assert tours[0] == tours[1]


@pytest.mark.ros
class TestChooseZone:
    def take(self, stage: "Stage", search: Search, **order: Any) -> ChooseZone:
        return stage.take(ChooseZone("ChooseZone", search.zones, **order))

    def test_the_zone_that_finds_soonest_is_chosen(self, stage: "Stage") -> None:
        search = searching()
        assert stage.run(self.take(stage, search, order="expected_find")) is Status.SUCCESS
        assert order(search.zones) == "cab"
        assert stage.lines == ["Next zone by expected_find: c."]

    def test_the_nearest_is_chosen(self, stage: "Stage") -> None:
        search = searching()
        search.zones.choose("c")
        assert stage.run(self.take(stage, search, order="nearest")) is Status.SUCCESS
        assert order(search.zones) == "acb"

    def test_it_is_computed_beside_the_ticks_and_a_tick_is_requested_then(self, stage: "Stage") -> None:
        leaf = self.take(stage, searching(), order="expected_find")
        assert status(leaf) is Status.RUNNING
        stage.until(lambda: stage.wakes == 1, "the tick that is requested")
        assert status(leaf) is Status.SUCCESS

    def test_after_each_look_it_is_chosen_anew(self, stage: "Stage") -> None:
        search = searching({**AREAS, "a": Area(0.15, 1.0, 5.0), "c": Area(0.6, 0.95, 5.0)})
        leaf, visited = self.take(stage, search, order="expected_find"), []
        while search.zones.has_remaining():
            assert stage.run(leaf) is Status.SUCCESS
            visited.append(search.zones.current_zone()["id"])
            search.record.zone_searched(visited[-1], None)
            search.zones.advance()
        assert visited == ["c", "b", "a"]
        assert stage.run(leaf) is Status.FAILURE

    def test_without_an_order_the_plan_is_kept_and_nothing_is_noted(self, stage: "Stage") -> None:
        search = searching()
        leaf = self.take(stage, search)
        leaf.tick_once()
        assert leaf.status is Status.SUCCESS
        assert order(search.zones) == "abc"
        assert (stage.lines, stage.wakes) == ([], 0)

    def test_a_plan_that_changes_meanwhile_is_computed_again(self, stage: "Stage") -> None:
        search = searching()
        leaf = self.take(stage, search, order="expected_find")
        leaf.tick_once()
        stage.until(lambda: stage.wakes == 1, "the first answer")
        search.zones.choose("c")
        search.zones.abandon("the operator has skipped it")
        assert status(leaf) is Status.RUNNING
        assert stage.run(leaf) is Status.SUCCESS
        assert sorted(order(search.zones)) == ["a", "b"]

    def test_one_that_was_halted_begins_anew(self, stage: "Stage") -> None:
        leaf = self.take(stage, searching(), order="expected_find")
        leaf.tick_once()
        stage.until(lambda: stage.wakes == 1, "the answer")
        leaf.stop(Status.INVALID)
        leaf.tick_once()
        assert leaf.status is Status.RUNNING


def test_nothing_that_is_read_is_no_number() -> None:
    with pytest.raises(ParameterError, match="must be a finite number"):
        begun(probabilities(a__poa=math.nan))
