"""Zones with probabilities: their parameters, the choice of the next one, and what looks make of the map."""

import itertools
import math
import threading
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from py_trees.common import Status

from sar_compiler.journal.journal_opening import open_journal
from sar_compiler.missions import ParameterError, ParameterReader
from sar_compiler.ros.clock import Deadline
from sar_compiler.ros.leaves.goals import active_goals_of
from search_and_rescue.actions.zones import ChooseZone
from search_and_rescue.plugin import MISSION
from search_and_rescue.record import DetectionVerdict
from search_and_rescue.search import Search
from search_and_rescue.search_theory import Ground, PoaMap, SearchExpectation
from search_and_rescue.zone_manager import MAX_PLANNED, MapPose, ZoneManager

if TYPE_CHECKING:
    from tests.missions.mission_stage import Host, Stage

BASE = {"x": 0.0, "y": 0.0, "yaw": 0.0}
AREAS = {
    "a": SearchExpectation(0.1, 0.5, 5.0),
    "b": SearchExpectation(0.2, 0.5, 5.0),
    "c": SearchExpectation(0.6, 0.5, 5.0),
}


def searching(areas: dict[str, SearchExpectation] | None = None) -> Search:
    """Return a search of three zones, 1, 2 and 3 m from the base station in this order."""
    plan = [{"id": name, "x": float(x), "y": 0.0, "yaw": 0.0} for x, name in enumerate("abc", 1)]
    return Search(ZoneManager(plan, BASE, areas=AREAS if areas is None else areas, speed_mps=0.5))


def many_zones(count: int, chance: np.random.Generator) -> list[dict[str, Any]]:
    """Return zones by chance, in 50 m around the base station."""
    xs, ys = chance.uniform(-50.0, 50.0, (2, count)).tolist()
    return [{"id": f"zone_{at}", "x": xs[at], "y": ys[at], "yaw": 0.0} for at in range(count)]


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
    assert begun(probabilities(b__look_sec=30)).areas == {
        "a": SearchExpectation(0.5, 0.8, 0.0),
        "b": SearchExpectation(0.5, 0.8, 30.0),
    }


def test_without_probabilities_there_is_no_map() -> None:
    bare = {key: value for key, value in probabilities().items() if not key.endswith(("poa", "pod"))}
    assert begun(bare).areas == {}


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        (
            {"a__poa": 0.6},
            "zones.a.poa: the poa values of all zones add up to 1.1: the sum must be at most 1",
        ),
        ({"a__poa": 1.5}, "zones.a.poa: must be a share from 0 to 1, but is 1.5"),
        ({"b__pod": -0.5}, "zones.b.pod: must be a share from 0 to 1, but is -0.5"),
        ({"b__poa": None}, "zones.b.poa: is missing"),
        ({"b__pod": None}, "zones.b.pod: is missing"),
        ({"a__look_sec": -1}, "zones.a.look_sec: must be seconds from 0 to 1000000000, but is -1"),
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
    from sar_compiler.missions.parameter_reader import read_run

    reader = ParameterReader({**probabilities(), "cruise_speed_mps": -1.0})
    MISSION.begin(reader)
    read_run(reader)
    assert [problem.key for problem in reader.problems] == ["cruise_speed_mps"]


def test_the_chosen_zone_is_the_current_one_and_the_others_keep_their_order() -> None:
    zones = searching().zones
    zones.choose_zone("c")
    assert order(zones) == "cab"
    zones.select_next_zone()
    zones.choose_zone("b")
    assert order(zones) == "ba"
    assert zones.current_index() == 1


def test_a_zone_that_is_not_left_cannot_be_chosen() -> None:
    zones = searching().zones
    zones.select_next_zone()
    with pytest.raises(ValueError, match="a is not among the remaining zones at the time of the event"):
        zones.choose_zone("a")


def test_a_postponed_zone_may_be_chosen_again_when_all_others_were_tried_as_often() -> None:
    zones = searching().zones
    zones.choose_zone("c")
    zones.postpone()
    assert [zone["id"] for zone in zones.eligible_zones()] == ["a", "b"]
    zones.postpone()
    zones.select_next_zone()
    assert [zone["id"] for zone in zones.eligible_zones()] == ["c", "a"]


def test_each_look_lowers_its_zone_raises_the_others_and_counts_for_success() -> None:
    search = searching()
    search.record.zone_searched("c", None)
    assert search.zones.poa_map().current_probabilities() == pytest.approx(
        {"a": 0.1 / 0.7, "b": 0.2 / 0.7, "c": 0.3 / 0.7}
    )
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
    assert len(searching({}).start_lines()) == 2
    assert "areas" not in searching({}).identity()


def test_the_plan_that_is_told_has_urgent_zones_first_as_the_flight_has() -> None:
    urgent = begun({**probabilities(), "zones.b.priority": 1.0, "zones.a.poa": 0.5, "zones.b.poa": 0.1, "zones.b.x": 9.0, "base_station.x": 0.0, "base_station.y": 1.0, "base_station.yaw": 0.0})  # fmt: skip
    told = [line.strip().partition(":")[0] for line in Search(urgent).start_lines()[3:]]
    assert told == ["b", "a"]
    assert [zone["id"] for zone in urgent.eligible_zones()] == ["b"]


def test_what_is_shown_computes_once_where_somebody_may_be(monkeypatch: pytest.MonkeyPatch) -> None:
    """It is asked for in the ticks: once for each zone took 30 ms of a hundred zones."""
    asked, now = list[PoaMap](), PoaMap.current_probabilities

    def counted(poa_map: PoaMap) -> dict[str, float]:
        asked.append(poa_map)
        return now(poa_map)

    monkeypatch.setattr(PoaMap, "current_probabilities", counted)
    searching().display()
    assert len(asked) == 1


def test_other_probabilities_make_another_mission() -> None:
    assert searching().identity() != searching({**AREAS, "a": SearchExpectation(0.0, 0.5, 5.0)}).identity()


def test_the_plan_is_told_before_the_flight_with_its_times_and_chances() -> None:
    # 3 m, 1 m and 1 m at 0.5 m/s are 9, 3 and 3 s with the detours; each look takes 5 s.
    assert searching().start_lines()[2:] == [
        "Order by expected_find (first detection, if any, after 18 s with paths of 1.5 times the straight line):",
        "  c: searched after 14 s, POS 30%",
        "  b: searched after 22 s, POS 40%",
        "  a: searched after 30 s, POS 45%",
    ]


def test_a_way_that_nobody_has_planned_is_the_straight_line_with_detours() -> None:
    zones = searching().zones
    assert zones.path_length_m(zones.base_pose(), {"x": 3.0, "y": -4.0, "yaw": 1.0}) == 7.5


def test_a_way_that_is_planned_is_as_long_in_both_directions() -> None:
    zones = searching().zones
    a, b, c = zones.remaining_zones()
    zones.store_path_length(a, c, 9.0)
    assert (zones.path_length_m(a, c), zones.path_length_m(c, {"x": a["x"], "y": a["y"], "yaw": 1.0})) == (
        9.0,
        9.0,
    )
    assert (zones.path_length_m(a, b), zones.has_path_length(a, b), zones.has_path_length(c, a)) == (
        1.5,
        False,
        True,
    )
    tour = zones.tour([a, c])
    assert tour.from_start == [3.0, 9.0]
    assert np.array_equal(tour.between, [[0.0, 18.0], [18.0, 0.0]])


def test_the_times_between_zones_are_those_of_their_ways_planned_or_not() -> None:
    chance = np.random.default_rng(4)
    zones = many_zones(12, chance)
    # Two zones in one place, as their poses may be.
    zones[5] |= {"x": zones[3]["x"], "y": zones[3]["y"]}
    manager = ZoneManager(zones, BASE, speed_mps=0.4)
    places = [manager.base_pose(), *manager.remaining_zones()]
    for one, other in itertools.combinations(places, 2):
        if chance.random() < 0.5:
            manager.store_path_length(one, other, chance.uniform(1.0, 90.0))
    tour = manager.tour(manager.remaining_zones())
    expected = [[manager.path_length_m(one, other) / 0.4 for other in places[1:]] for one in places[1:]]
    assert np.allclose(tour.between, expected)


def test_of_many_zones_the_planner_is_asked_for_those_that_reward_their_time_most() -> None:
    zones = many_zones(200, np.random.default_rng(5))
    # The last ones are likely, and the one before them is where the robot is.
    poa = {zone["id"]: 0.001 for zone in zones} | {zone["id"]: 0.02 for zone in zones[-10:]}
    zones[-11] |= {"x": BASE["x"], "y": BASE["y"]}
    areas = {name: SearchExpectation(each, 0.9, 5.0) for name, each in poa.items()}
    manager = ZoneManager(zones, BASE, areas=areas)
    chosen = manager.zones_to_plan(manager.remaining_zones())
    assert len(chosen) == MAX_PLANNED
    assert chosen[-11:] == manager.remaining_zones()[-11:]
    # One of them is where the robot is.
    assert len(manager.required_paths(chosen)) == math.comb(MAX_PLANNED, 2)
    nearest = sorted(
        manager.remaining_zones(), key=lambda zone: math.dist((zone["x"], zone["y"]), (BASE["x"], BASE["y"]))
    )
    without = ZoneManager(zones, BASE)
    assert {zone["id"] for zone in without.zones_to_plan(without.remaining_zones())} == {
        zone["id"] for zone in nearest[:MAX_PLANNED]
    }


def test_the_plan_of_many_zones_says_how_they_are_ordered_in_twenty_lines() -> None:
    zones = many_zones(60, np.random.default_rng(6))
    areas = {zone["id"]: SearchExpectation(0.01, 0.9, 5.0) for zone in zones}
    head, *lines = Search(ZoneManager(zones, BASE, areas=areas)).start_lines()[2:]
    assert head.startswith("Order by expected_find, approximated for 60 zones by probability per second (")
    assert len(lines) == 20
    assert lines[-2] == "  … 41 more zones …"
    assert lines[-1].endswith("POS 54%")


def test_each_way_is_needed_once_and_none_from_a_place_to_itself() -> None:
    search = searching()
    zones = search.zones.remaining_zones()

    def needed(**options: bool) -> list[tuple[float, float]]:
        return [(start["x"], target["x"]) for start, target in search.zones.required_paths(zones, **options)]

    assert needed() == [(0.0, 1.0), (0.0, 2.0), (0.0, 3.0), (1.0, 2.0), (1.0, 3.0), (2.0, 3.0)]
    assert needed(between=False) == [(0.0, 1.0), (0.0, 2.0), (0.0, 3.0)]
    search.record.zone_searched("b", None)
    home = [[0.0, 1.0], [0.0, 2.0], [0.0, 3.0]]
    assert sorted(map(sorted, needed())) == [*home, [1.0, 2.0], [1.0, 3.0], [2.0, 3.0]]
    assert sorted(map(sorted, needed(between=False))) == [*home, [1.0, 2.0], [2.0, 3.0]]


def test_a_drive_that_has_failed_may_have_changed_every_way() -> None:
    zones = searching().zones
    a, b, _ = zones.remaining_zones()
    zones.store_path_length(a, b, 9.0)
    zones.select_next_zone()
    assert zones.path_length_m(a, b) == 9.0
    zones.postpone()
    assert zones.path_length_m(a, b) == 1.5


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
        search.use_journal(kept)
        kept.begin({}, {})
        return kept

    first, second = searching(), searching()
    kept = opened(first, resume=False)
    first.zones.choose_zone("c")
    first.record.zone_searched("c", None)
    first.zones.select_next_zone()
    first.zones.choose_zone("b")
    kept.close()
    kept = opened(second, resume=True)
    assert [second.sentence(fact) for fact in kept.earlier_events() if fact.kind == "zone_chosen"] == [
        "chose c",
        "chose b",
    ]
    kept.close()
    assert second.zones.poa_map() == first.zones.poa_map()
    assert order(second.zones) == order(first.zones) == "ba"
    tours = [each.zones.tour(each.zones.remaining_zones()) for each in (first, second)]
    assert len({(*tour.from_start, *np.ravel(tour.between), *tour.finds) for tour in tours}) == 1


def test_hints_multiply_and_a_resumed_search_has_them(journal: Path) -> None:
    first, second = searching(), searching()
    kept = open_journal(journal, resume=False)
    first.use_journal(kept)
    kept.begin({}, {})
    first.zones.hint("a", 3.0)
    first.zones.hint("a", 2.0)
    kept.close()
    kept = open_journal(journal, resume=True)
    second.use_journal(kept)
    told = [second.sentence(fact) for fact in kept.earlier_events() if fact.kind == "hint_given"]
    assert told == ["the operator: a hint on a, times 3", "the operator: a hint on a, times 2"]
    kept.close()
    assert second.zones.hints == {"a": 6.0}
    assert second.zones.poa_map().current_probabilities()["a"] == pytest.approx(0.6 / 1.5)


def test_a_look_whose_find_is_rejected_counts_as_none_until_it_is_confirmed_after_all(journal: Path) -> None:
    first, second = searching(), searching()
    kept = open_journal(journal, resume=False)
    first.use_journal(kept)
    kept.begin({}, {})
    first.record.zone_searched("a", (2.0, 1.0))
    first.record.survivor_named("survivor_1", 2.0, 1.0)
    looked = first.zones.poa_map()
    for _ in range(2):
        first.record.survivor_judged("survivor_1", DetectionVerdict.REJECTED)
    assert (
        first.zones.poa_map().current_probabilities() == searching().zones.poa_map().current_probabilities()
    )
    assert first.zones.poa_map().pos() == 0.0
    first.record.survivor_judged("survivor_1", DetectionVerdict.CONFIRMED)
    assert first.zones.poa_map() == looked
    first.record.survivor_judged("survivor_1", DetectionVerdict.REJECTED)
    kept.close()
    kept = open_journal(journal, resume=True)
    second.use_journal(kept)
    kept.close()
    assert second.zones.poa_map() == first.zones.poa_map()


def test_a_rejected_find_leaves_what_a_sweep_has_seen() -> None:
    search = searching()
    search.sweeps.grounds["a"] = Ground(((0.0, 0.0), (4.0, 0.0), (0.0, 4.0)), 2.0, 2.0)
    search.sweeps.plan("a", "parallel", 2.0, [MapPose(x=1.0, y=1.0, yaw=0.0)] * 2)
    search.sweeps.drive("a", [(1.0, 1.0), (2.0, 1.0)], None)
    search.sweeps.finish_piece("a", None, 0.5)
    search.record.zone_searched("a", (2.0, 1.0))
    search.record.survivor_named("survivor_1", 2.0, 1.0)
    seen = search.zones.poa_map()
    assert seen.pos() > 0.0
    search.record.survivor_judged("survivor_1", DetectionVerdict.REJECTED)
    assert search.zones.poa_map() == seen


def test_any_number_of_hints_leaves_a_map() -> None:
    search = searching()
    for _ in range(150):
        search.zones.hint("a", 1000.0)
        search.zones.hint("b", 0.001)
    now = search.zones.poa_map().current_probabilities()
    assert now["a"] == pytest.approx(1.0)
    assert 0.0 <= now["b"] < 1e-6
    assert math.isfinite(search.zones.poa_map().pos())


@pytest.mark.parametrize(
    ("zone", "ratio"), [("z", 2.0), ("a", 0.0), ("a", math.nan), ("a", 1001.0), ("a", "much")]
)
def test_a_hint_that_cannot_be_is_no_fact(zone: str, ratio: Any) -> None:
    search = searching()
    with pytest.raises((TypeError, ValueError)):
        search.zones.hint(zone, ratio)
    assert search.zones.hints == {}


@pytest.mark.ros
class TestChooseZone:
    def take(self, stage: "Stage", search: Search, **order: Any) -> ChooseZone:
        return stage.take(ChooseZone("ChooseZone", search.zones, **order))

    def hint(self, stage: "Stage", search: Search, **values: Any) -> tuple[bool, str]:
        """Give a hint as an operator does."""
        from sar_interfaces.srv import AddHint

        self.take(stage, search, order="expected_find", sweeps=search.sweeps)
        request = AddHint.Request(zone_id=values.get("zone", ""), likelihood_ratio=values.get("times", 3.0))
        request.point.header.frame_id = values.get("frame", "map")
        request.point.point.x = values.get("x", 0.0)
        client = stage.host().node.create_client(AddHint, f"{stage.node.get_fully_qualified_name()}/add_hint")
        stage.until(client.service_is_ready, "the service")
        answer = client.call_async(request)
        stage.until(answer.done, "the answer")
        response: Any = answer.result()
        return response.success, response.message

    @pytest.mark.parametrize(("values", "zone"), [({"zone": "a"}, "a"), ({"x": 2.4}, "b"), ({"x": 2.6}, "c")])
    def test_a_hint_counts_for_the_zone_it_names_or_the_one_nearest_to_the_place(
        self, stage: "Stage", values: dict[str, Any], zone: str
    ) -> None:
        search = searching()
        assert self.hint(stage, search, **values) == (True, f"the hint applies to {zone}")
        assert search.zones.hints == {zone: 3.0}
        assert stage.lines == [f"Command add_hint by the operator: {zone}, times 3."]

    def test_a_hint_on_a_place_in_an_outline_counts_for_that_zone(self, stage: "Stage") -> None:
        search = searching()
        search.sweeps.grounds["a"] = Ground(((0.5, -1.0), (2.5, -1.0), (2.5, 1.0), (0.5, 1.0)), 3.2, 2.0)
        assert self.hint(stage, search, x=2.4) == (True, "the hint applies to a")

    @pytest.mark.parametrize(
        ("values", "said"),
        [
            ({"zone": "z"}, "there is no zone 'z' with a probability"),
            ({"x": math.nan}, "(nan, 0.0) is not a position"),
            ({"frame": "odom"}, "the point is in the frame 'odom', but must be in 'map'"),
            (
                {"zone": "a", "times": 0.0},
                "the likelihood ratio is 0: write a number from 0.001 to 1000",
            ),
            (
                {"zone": "a", "times": math.inf},
                "the likelihood ratio is inf: write a number from 0.001 to 1000",
            ),
        ],
    )
    def test_a_hint_that_makes_no_sense_is_refused_with_the_reason(
        self, stage: "Stage", values: dict[str, Any], said: str
    ) -> None:
        search = searching()
        assert self.hint(stage, search, **values) == (False, said)
        assert search.zones.hints == {}

    def test_the_orders_that_other_leaves_heed_stay_where_it_is_set_up_after_them(
        self, stage: "Stage"
    ) -> None:
        from std_srvs.srv import Trigger

        search = searching()
        search.orders.offer(stage.node, "pause", lambda _request, response: response)
        self.take(stage, search, order="nearest", orders=search.orders)
        client = stage.host().node.create_client(Trigger, f"{stage.node.get_fully_qualified_name()}/pause")
        stage.until(client.service_is_ready, "the other leaf's order")

    def test_where_no_zone_has_a_probability_no_hints_are_taken(self, stage: "Stage") -> None:
        self.take(stage, searching({}), order="nearest")
        names = [name for name, _ in stage.node.get_service_names_and_types()]
        assert not any(name.endswith("add_hint") for name in names)

    def test_the_zone_that_finds_soonest_is_chosen(self, stage: "Stage") -> None:
        search = searching()
        assert stage.run(self.take(stage, search, order="expected_find")) is Status.SUCCESS
        assert order(search.zones) == "cab"
        assert stage.lines == ["Next zone by expected_find: c."]

    def test_that_many_zones_are_not_in_the_best_order_is_logged_once(self, stage: "Stage") -> None:
        zones = many_zones(60, np.random.default_rng(1))
        areas = {zone["id"]: SearchExpectation(0.01, 0.5, 5.0) for zone in zones}
        leaf = self.take(stage, Search(ZoneManager(zones, BASE, areas=areas)), order="expected_find")
        for _ in range(2):
            assert stage.run(leaf) is Status.SUCCESS
        first, *others = stage.lines
        assert first == (
            "'ChooseZone': 60 zones are ordered by probability per second, which gives an order close to the best one."
        )
        assert [line.partition(":")[0] for line in others] == ["Next zone by expected_find"] * 2

    def test_the_nearest_is_chosen(self, stage: "Stage") -> None:
        search = searching()
        search.zones.choose_zone("c")
        assert stage.run(self.take(stage, search, order="nearest")) is Status.SUCCESS
        assert order(search.zones) == "acb"

    def test_it_is_computed_beside_the_ticks_and_a_tick_is_requested_then(self, stage: "Stage") -> None:
        leaf = self.take(stage, searching(), order="expected_find")
        assert status(leaf) is Status.RUNNING
        stage.until(lambda: stage.wakes == 1, "the tick that is requested")
        assert status(leaf) is Status.SUCCESS

    def test_after_each_look_it_is_chosen_anew(self, stage: "Stage") -> None:
        search = searching(
            {**AREAS, "a": SearchExpectation(0.15, 1.0, 5.0), "c": SearchExpectation(0.6, 0.95, 5.0)}
        )
        leaf, visited = self.take(stage, search, order="expected_find"), []
        while search.zones.has_remaining():
            assert stage.run(leaf) is Status.SUCCESS
            visited.append(search.zones.current_zone()["id"])
            search.record.zone_searched(visited[-1], None)
            search.zones.select_next_zone()
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
        search.zones.choose_zone("c")
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


class PlanningServer:
    """A `compute_path_to_pose` whose ways are straight, but those around a wall.

    Attributes:
        detour_m: How much longer than straight the ways between two x coordinates are, metres; None for no way.
        asked: Between which x coordinates ways were asked for, in order.
        planners: The planners that were asked.
        gate: Set unless the answers are to be held back.
        accepts: Whether goals are accepted.
    """

    def __init__(self, host: "Host") -> None:
        from nav2_msgs.action import ComputePathToPose
        from rclpy.action import ActionServer, GoalResponse

        self.detour_m: dict[frozenset[float], float | None] = {}
        self.asked: list[tuple[float, float]] = []
        self.planners: list[str] = []
        self.accepts = True
        self.gate = threading.Event()
        self.gate.set()
        self._result = ComputePathToPose.Result
        self._server = ActionServer(
            host.node,
            ComputePathToPose,
            "compute_path_to_pose",
            execute_callback=self._plan,
            goal_callback=lambda _: GoalResponse.ACCEPT if self.accepts else GoalResponse.REJECT,
            callback_group=host.group,
        )
        host.at_close(self.gate.set)
        host.at_end(self._server.destroy)

    def _plan(self, handle: Any) -> Any:
        from geometry_msgs.msg import PoseStamped

        goal, result = handle.request, self._result()
        start, end = goal.start.pose.position.x, goal.goal.pose.position.x
        self.asked.append((start, end))
        self.planners.append(goal.planner_id)
        self.gate.wait()
        detour_m = self.detour_m.get(frozenset({start, end}), 0.0)
        if detour_m is None or not goal.use_start or {goal.start.header.frame_id} != {"map"}:
            result.error_code = result.NO_VALID_PATH
            handle.abort()
            return result
        for x, y in ((start, detour_m / 2), (start, 0.0)):
            pose = PoseStamped()
            pose.pose.position.x, pose.pose.position.y = x, y
            result.path.poses.append(pose)
        handle.succeed()
        return result


@pytest.mark.ros
class TestAskingThePlanner:
    NEEDED = ((0.0, 1.0), (0.0, 2.0), (0.0, 3.0), (1.0, 2.0), (1.0, 3.0), (2.0, 3.0))

    def take(
        self, stage: "Stage", search: Search, order: Any = "expected_find", **options: Any
    ) -> ChooseZone:
        """Return a leaf that has found the planner."""
        leaf = stage.take(ChooseZone("Choose", search.zones, order=order, **options))
        planner = leaf._ways and leaf._ways._planner
        assert planner
        stage.until(lambda: planner.is_ready, "the planner")
        return leaf

    def to_c(self, zones: ZoneManager) -> float:
        """Return how long the way from the base station to zone c is taken to be, metres."""
        (zone,) = [zone for zone in zones.remaining_zones() if zone["id"] == "c"]
        return zones.path_length_m(zones.base_pose(), zone)

    def test_the_ways_are_those_of_the_planner_and_each_is_asked_for_once(self, stage: "Stage") -> None:
        server, search = PlanningServer(stage.host()), searching()
        # A wall makes the likeliest zone the one that is farthest away: from 0, 1 and 2.
        server.detour_m = {frozenset({float(x), 3.0}): 40.0 for x in range(3)}
        leaf = self.take(stage, search)
        assert stage.run(leaf) is Status.SUCCESS
        assert order(search.zones) == "abc"
        assert tuple(server.asked) == self.NEEDED
        assert self.to_c(search.zones) == 43.0
        search.record.zone_searched("a", None)
        search.zones.select_next_zone()
        assert stage.run(leaf) is Status.SUCCESS
        assert order(search.zones) == "bc"
        assert tuple(server.asked) == self.NEEDED
        assert (stage.warnings, len(active_goals_of(stage.node))) == ([], 0)

    def test_for_the_nearest_only_the_ways_from_here_are_asked_for(self, stage: "Stage") -> None:
        server, search = PlanningServer(stage.host()), searching()
        server.detour_m = {frozenset({0.0, 1.0}): 1.5}
        assert stage.run(self.take(stage, search, "nearest", planner_id="GridBased")) is Status.SUCCESS
        assert order(search.zones) == "bac"
        assert tuple(server.asked) == self.NEEDED[:3]
        assert set(server.planners) == {"GridBased"}

    def test_a_way_that_the_planner_does_not_give_is_a_straight_line_which_is_told_once(
        self, stage: "Stage"
    ) -> None:
        server, search = PlanningServer(stage.host()), searching()
        server.detour_m = {frozenset({0.0, 3.0}): None}
        leaf = self.take(stage, search)
        for _ in range(2):
            assert stage.run(leaf) is Status.SUCCESS
        assert stage.warnings == [
            "'Choose': 1 of 6 paths are estimated as 1.5 times the straight line: the planner returned no path: aborted (status 6), error code 208: there is no path to the goal."
        ]
        assert server.asked == [*self.NEEDED, (0.0, 3.0)]
        assert self.to_c(search.zones) == 4.5
        server.detour_m = {}
        assert stage.run(leaf) is Status.SUCCESS
        assert self.to_c(search.zones) == 3.0
        server.detour_m = {frozenset({0.0, 3.0}): None}
        search.zones._path_lengths.clear()
        assert stage.run(leaf) is Status.SUCCESS
        assert stage.warnings[1:] == stage.warnings[:1]

    def test_the_questions_follow_one_another_beside_the_ticks(self, stage: "Stage") -> None:
        server = PlanningServer(stage.host())
        leaf = self.take(stage, searching())
        assert status(leaf) is Status.RUNNING
        stage.until(lambda: stage.wakes == 1, "the tick that is requested")
        assert tuple(server.asked) == self.NEEDED

    def test_a_planner_that_rejects_gives_no_ways(self, stage: "Stage") -> None:
        server, search = PlanningServer(stage.host()), searching()
        server.accepts = False
        assert stage.run(self.take(stage, search, "nearest")) is Status.SUCCESS
        assert stage.warnings == [
            "'Choose': 3 of 3 paths are estimated as 1.5 times the straight line: the planner returned no path: the request was rejected."
        ]

    def test_nobody_waits_for_a_planner_that_is_not_there_which_is_told_once(self, stage: "Stage") -> None:
        search = searching()
        leaf = stage.take(ChooseZone("Choose", search.zones, order="expected_find"))
        for _ in range(2):
            assert status(leaf) is Status.RUNNING
            assert leaf._choice
            assert stage.run(leaf) is Status.SUCCESS
        assert stage.warnings == [
            "'Choose': 6 of 6 paths are estimated as 1.5 times the straight line: no server offers compute_path_to_pose."
        ]

    def test_what_is_not_answered_in_time_is_a_straight_line(self, stage: "Stage") -> None:
        server, search = PlanningServer(stage.host()), searching()
        leaf = self.take(stage, search, ways_timeout_sec=7.0)
        assert leaf._ways
        server.gate.clear()
        stage.tick_until(leaf, lambda: server.asked, "the first question")
        assert 0.0 < leaf._ways._due.remaining_sec <= 7.0
        assert leaf._choice is None
        leaf._ways._due = Deadline(0.0)
        assert status(leaf) is Status.RUNNING
        server.gate.set()
        assert stage.run(leaf) is Status.SUCCESS
        assert stage.warnings == [
            "'Choose': 6 of 6 paths are estimated as 1.5 times the straight line: no response within 7 s."
        ]
        assert tuple(server.asked) == self.NEEDED[:1]

    def test_one_that_is_halted_asks_no_further_and_keeps_what_it_was_told(self, stage: "Stage") -> None:
        server, search = PlanningServer(stage.host()), searching()
        leaf = self.take(stage, search)
        server.detour_m = {frozenset({0.0, 1.0}): 2.0}
        stage.tick_until(leaf, lambda: len(server.asked) == 2, "the second question")
        leaf.stop(Status.INVALID)
        assert stage.run(leaf) is Status.SUCCESS
        assert server.asked.count(self.NEEDED[0]) == 1
        assert set(server.asked) == set(self.NEEDED)

    def test_a_plan_that_changes_meanwhile_is_asked_for_anew(self, stage: "Stage") -> None:
        server, search = PlanningServer(stage.host()), searching()
        server.gate.clear()
        leaf = self.take(stage, search)
        stage.tick_until(leaf, lambda: server.asked, "the first question")
        search.zones.add({"id": "d", "x": 4.0, "y": 0.0, "yaw": 0.0})
        server.gate.set()
        assert stage.run(leaf) is Status.SUCCESS
        assert (0.0, 4.0) in server.asked
        assert stage.warnings == []

    def test_who_keeps_the_order_of_the_plan_has_no_client(self, stage: "Stage") -> None:
        PlanningServer(stage.host())
        before = len(list(stage.node.clients))
        leaf = stage.take(ChooseZone("Choose", searching().zones))
        assert (status(leaf), len(list(stage.node.clients))) == (Status.SUCCESS, before)

    def test_its_clients_are_gone_with_it(self, stage: "Stage") -> None:
        before = len(list(stage.node.clients))
        leaf = stage.take(ChooseZone("Choose", searching().zones, order="nearest"))
        assert len(list(stage.node.clients)) == before + 2
        leaf.shutdown()
        assert len(list(stage.node.clients)) == before


def test_nothing_that_is_read_is_no_number() -> None:
    with pytest.raises(ParameterError, match="must be a finite number"):
        begun(probabilities(a__poa=math.nan))
