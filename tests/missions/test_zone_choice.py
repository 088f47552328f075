"""Tests of zones with probabilities: parameters, choice of the next zone, and updates after searches."""

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


def make_search(areas: dict[str, SearchExpectation] | None = None) -> Search:
    """Return a search of three zones, 1, 2 and 3 m from the base station in this order."""
    plan = [{"id": name, "x": float(x), "y": 0.0, "yaw": 0.0} for x, name in enumerate("abc", 1)]
    return Search(ZoneManager(plan, BASE, areas=AREAS if areas is None else areas, speed_mps=0.5))


def many_zones(count: int, chance: np.random.Generator) -> list[dict[str, Any]]:
    """Return zones at random positions within 50 m of the base station on each axis."""
    xs, ys = chance.uniform(-50.0, 50.0, (2, count)).tolist()
    return [{"id": f"zone_{at}", "x": xs[at], "y": ys[at], "yaw": 0.0} for at in range(count)]


def order(zones: ZoneManager) -> str:
    return "".join(zone["id"] for zone in zones.remaining_zones())


def tick(leaf: ChooseZone) -> Status:
    """Tick a leaf once, and return its status."""
    leaf.tick_once()
    return leaf.status


def probabilities(**changed: object) -> dict[str, object]:
    """Return the parameters of two zones with probabilities, with changes; None removes a parameter."""
    given: dict[str, object] = {"zone_order": ["a", "b"]}
    for zone in "ab":
        given |= {f"zones.{zone}.{name}": 1.0 for name in ("x", "y", "yaw")}
        given |= {f"zones.{zone}.poa": 0.5, f"zones.{zone}.pod": 0.8}
    given |= {f"zones.{key.replace('__', '.')}": value for key, value in changed.items()}
    return {key: value for key, value in given.items() if value is not None}


def zones_from_parameters(parameters: dict[str, object]) -> ZoneManager:
    reader = ParameterReader(parameters)
    search = MISSION.begin(reader)
    reader.complain()
    return search.zones


def test_parameters_define_search_expectation() -> None:
    assert zones_from_parameters(probabilities(b__look_sec=30)).areas == {
        "a": SearchExpectation(0.5, 0.8, 0.0),
        "b": SearchExpectation(0.5, 0.8, 30.0),
    }


def test_zones_without_probabilities_have_no_areas() -> None:
    bare = {key: value for key, value in probabilities().items() if not key.endswith(("poa", "pod"))}
    assert zones_from_parameters(bare).areas == {}


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
def test_probability_error_is_reported_before_run(changed: dict[str, Any], said: str) -> None:
    with pytest.raises(ParameterError) as refused:
        zones_from_parameters(probabilities(**changed))
    assert said in str(refused.value)
    assert "mistakes" not in str(refused.value)


def test_invalid_speed_is_reported_once() -> None:
    from sar_compiler.missions.parameter_reader import read_run

    reader = ParameterReader({**probabilities(), "cruise_speed_mps": -1.0})
    MISSION.begin(reader)
    read_run(reader)
    assert [problem.key for problem in reader.problems] == ["cruise_speed_mps"]


def test_chosen_zone_comes_first_and_others_keep_their_order() -> None:
    zones = make_search().zones
    zones.choose_zone("c")
    assert order(zones) == "cab"
    zones.select_next_zone()
    zones.choose_zone("b")
    assert order(zones) == "ba"
    assert zones.current_index() == 1


def test_visited_zone_cannot_be_chosen() -> None:
    zones = make_search().zones
    zones.select_next_zone()
    with pytest.raises(ValueError, match="a is not among the remaining zones at the time of the event"):
        zones.choose_zone("a")


def test_postponed_zone_is_eligible_after_as_many_attempts_on_others() -> None:
    zones = make_search().zones
    zones.choose_zone("c")
    zones.postpone()
    assert [zone["id"] for zone in zones.eligible_zones()] == ["a", "b"]
    zones.postpone()
    zones.select_next_zone()
    assert [zone["id"] for zone in zones.eligible_zones()] == ["c", "a"]


def test_search_updates_probabilities_and_pos() -> None:
    search = make_search()
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


def test_search_without_probabilities_displays_none() -> None:
    shown = make_search({}).display()
    assert [each.name for each in shown.figures] == ["zones visited", "survivors found", "survivors reported"]
    assert not any("probability now" in each.details for each in shown.landmarks)
    assert len(make_search({}).start_lines()) == 2
    assert "areas" not in make_search({}).identity()


def test_urgent_zones_come_first_in_start_plan() -> None:
    urgent = zones_from_parameters({**probabilities(), "zones.b.priority": 1.0, "zones.a.poa": 0.5, "zones.b.poa": 0.1, "zones.b.x": 9.0, "base_station.x": 0.0, "base_station.y": 1.0, "base_station.yaw": 0.0})  # fmt: skip
    reported = [line.strip().partition(":")[0] for line in Search(urgent).start_lines()[3:]]
    assert reported == ["b", "a"]
    assert [zone["id"] for zone in urgent.eligible_zones()] == ["b"]


def test_display_computes_probabilities_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """The display is computed during ticks: computing the probabilities for each of 100 zones took 30 ms."""
    asked, now = list[PoaMap](), PoaMap.current_probabilities

    def counted(poa_map: PoaMap) -> dict[str, float]:
        asked.append(poa_map)
        return now(poa_map)

    monkeypatch.setattr(PoaMap, "current_probabilities", counted)
    make_search().display()
    assert len(asked) == 1


def test_different_probabilities_change_mission_identity() -> None:
    assert (
        make_search().identity() != make_search({**AREAS, "a": SearchExpectation(0.0, 0.5, 5.0)}).identity()
    )


def test_start_plan_lists_times_and_probabilities() -> None:
    # 3 m, 1 m and 1 m at 0.5 m/s are 9, 3 and 3 s with the detours; each look takes 5 s.
    assert make_search().start_lines()[2:] == [
        "Order by expected_find (first detection, if any, after 18 s with paths of 1.5 times the straight line):",
        "  c: searched after 14 s, POS 30%",
        "  b: searched after 22 s, POS 40%",
        "  a: searched after 30 s, POS 45%",
    ]


def test_unplanned_path_is_straight_line_with_detour() -> None:
    zones = make_search().zones
    assert zones.path_length_m(zones.base_pose(), {"x": 3.0, "y": -4.0, "yaw": 1.0}) == 7.5


def test_planned_path_has_same_length_in_both_directions() -> None:
    zones = make_search().zones
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


def test_travel_times_use_planned_and_estimated_paths() -> None:
    chance = np.random.default_rng(4)
    zones = many_zones(12, chance)
    # Two zones may have the same position.
    zones[5] |= {"x": zones[3]["x"], "y": zones[3]["y"]}
    manager = ZoneManager(zones, BASE, speed_mps=0.4)
    places = [manager.base_pose(), *manager.remaining_zones()]
    for one, other in itertools.combinations(places, 2):
        if chance.random() < 0.5:
            manager.store_path_length(one, other, chance.uniform(1.0, 90.0))
    tour = manager.tour(manager.remaining_zones())
    expected = [[manager.path_length_m(one, other) / 0.4 for other in places[1:]] for one in places[1:]]
    assert np.allclose(tour.between, expected)


def test_planner_is_asked_for_most_rewarding_zones() -> None:
    zones = many_zones(200, np.random.default_rng(5))
    # The last ten are likely, and the zone before them is at the position of the robot.
    poa = {zone["id"]: 0.001 for zone in zones} | {zone["id"]: 0.02 for zone in zones[-10:]}
    zones[-11] |= {"x": BASE["x"], "y": BASE["y"]}
    areas = {name: SearchExpectation(each, 0.9, 5.0) for name, each in poa.items()}
    manager = ZoneManager(zones, BASE, areas=areas)
    chosen = manager.zones_to_plan(manager.remaining_zones())
    assert len(chosen) == MAX_PLANNED
    assert chosen[-11:] == manager.remaining_zones()[-11:]
    # The zone at the position of the robot needs no path from there.
    assert len(manager.required_paths(chosen)) == math.comb(MAX_PLANNED, 2)
    nearest = sorted(
        manager.remaining_zones(), key=lambda zone: math.dist((zone["x"], zone["y"]), (BASE["x"], BASE["y"]))
    )
    without = ZoneManager(zones, BASE)
    assert {zone["id"] for zone in without.zones_to_plan(without.remaining_zones())} == {
        zone["id"] for zone in nearest[:MAX_PLANNED]
    }


def test_start_plan_of_many_zones_has_twenty_lines() -> None:
    zones = many_zones(60, np.random.default_rng(6))
    areas = {zone["id"]: SearchExpectation(0.01, 0.9, 5.0) for zone in zones}
    head, *lines = Search(ZoneManager(zones, BASE, areas=areas)).start_lines()[2:]
    assert head.startswith("Order by expected_find, approximated for 60 zones by probability per second (")
    assert len(lines) == 20
    assert lines[-2] == "  … 41 more zones …"
    assert lines[-1].endswith("POS 54%")


def test_required_paths_are_unique_and_connect_different_positions() -> None:
    search = make_search()
    zones = search.zones.remaining_zones()

    def needed(**options: bool) -> list[tuple[float, float]]:
        return [(start["x"], target["x"]) for start, target in search.zones.required_paths(zones, **options)]

    assert needed() == [(0.0, 1.0), (0.0, 2.0), (0.0, 3.0), (1.0, 2.0), (1.0, 3.0), (2.0, 3.0)]
    assert needed(between=False) == [(0.0, 1.0), (0.0, 2.0), (0.0, 3.0)]
    search.record.zone_searched("b", None)
    home = [[0.0, 1.0], [0.0, 2.0], [0.0, 3.0]]
    assert sorted(map(sorted, needed())) == [*home, [1.0, 2.0], [1.0, 3.0], [2.0, 3.0]]
    assert sorted(map(sorted, needed(between=False))) == [*home, [1.0, 2.0], [2.0, 3.0]]


def test_postponing_discards_planned_paths() -> None:
    zones = make_search().zones
    a, b, _ = zones.remaining_zones()
    zones.store_path_length(a, b, 9.0)
    zones.select_next_zone()
    assert zones.path_length_m(a, b) == 9.0
    zones.postpone()
    assert zones.path_length_m(a, b) == 1.5


def test_paths_start_at_last_searched_zone() -> None:
    search = make_search()
    assert search.zones.tour(search.zones.remaining_zones()).from_start == [3.0, 6.0, 9.0]
    search.record.zone_searched("c", None)
    assert search.zones.tour(search.zones.remaining_zones()).from_start == [6.0, 3.0, 0.0]
    search.record.base_reached()
    assert search.zones.tour(search.zones.remaining_zones()).from_start == [3.0, 6.0, 9.0]


@pytest.fixture
def journal(tmp_path: Path) -> Path:
    return tmp_path / "search.journal"


def test_resumed_search_has_same_probabilities_and_zone(journal: Path) -> None:
    def opened(search: Search, *, resume: bool) -> Any:
        kept = open_journal(journal, resume=resume)
        search.use_journal(kept)
        kept.begin({}, {})
        return kept

    first, second = make_search(), make_search()
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


def test_hints_multiply_and_are_resumed(journal: Path) -> None:
    first, second = make_search(), make_search()
    kept = open_journal(journal, resume=False)
    first.use_journal(kept)
    kept.begin({}, {})
    first.zones.hint("a", 3.0)
    first.zones.hint("a", 2.0)
    kept.close()
    kept = open_journal(journal, resume=True)
    second.use_journal(kept)
    reported = [second.sentence(fact) for fact in kept.earlier_events() if fact.kind == "hint_given"]
    assert reported == ["the operator: a hint on a, times 3", "the operator: a hint on a, times 2"]
    kept.close()
    assert second.zones.hints == {"a": 6.0}
    assert second.zones.poa_map().current_probabilities()["a"] == pytest.approx(0.6 / 1.5)


def test_rejected_detection_undoes_its_search_until_confirmed(journal: Path) -> None:
    first, second = make_search(), make_search()
    kept = open_journal(journal, resume=False)
    first.use_journal(kept)
    kept.begin({}, {})
    first.record.zone_searched("a", (2.0, 1.0))
    first.record.survivor_named("survivor_1", 2.0, 1.0)
    looked = first.zones.poa_map()
    for _ in range(2):
        first.record.survivor_judged("survivor_1", DetectionVerdict.REJECTED)
    assert (
        first.zones.poa_map().current_probabilities() == make_search().zones.poa_map().current_probabilities()
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


def test_rejected_detection_keeps_coverage_of_sweep() -> None:
    search = make_search()
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


def test_many_hints_keep_probabilities_finite() -> None:
    search = make_search()
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
def test_invalid_hint_is_not_recorded(zone: str, ratio: Any) -> None:
    search = make_search()
    with pytest.raises((TypeError, ValueError)):
        search.zones.hint(zone, ratio)
    assert search.zones.hints == {}


@pytest.mark.ros
class TestChooseZone:
    def take(self, stage: "Stage", search: Search, **order: Any) -> ChooseZone:
        return stage.take(ChooseZone("ChooseZone", search.zones, **order))

    def hint(self, stage: "Stage", search: Search, **values: Any) -> tuple[bool, str]:
        """Send a hint as an operator does."""
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
    def test_hint_applies_to_named_or_nearest_zone(
        self, stage: "Stage", values: dict[str, Any], zone: str
    ) -> None:
        search = make_search()
        assert self.hint(stage, search, **values) == (True, f"the hint applies to {zone}")
        assert search.zones.hints == {zone: 3.0}
        assert stage.lines == [f"Command add_hint by the operator: {zone}, times 3."]

    def test_hint_inside_polygon_applies_to_its_zone(self, stage: "Stage") -> None:
        search = make_search()
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
    def test_invalid_hint_is_rejected_with_reason(
        self, stage: "Stage", values: dict[str, Any], said: str
    ) -> None:
        search = make_search()
        assert self.hint(stage, search, **values) == (False, said)
        assert search.zones.hints == {}

    def test_setup_keeps_command_services_of_other_leaves(self, stage: "Stage") -> None:
        from std_srvs.srv import Trigger

        search = make_search()
        search.orders.offer(stage.node, "pause", lambda _request, response: response)
        self.take(stage, search, order="nearest", orders=search.orders)
        client = stage.host().node.create_client(Trigger, f"{stage.node.get_fully_qualified_name()}/pause")
        stage.until(client.service_is_ready, "the other leaf's order")

    def test_hint_service_is_absent_without_probabilities(self, stage: "Stage") -> None:
        self.take(stage, make_search({}), order="nearest")
        names = [name for name, _ in stage.node.get_service_names_and_types()]
        assert not any(name.endswith("add_hint") for name in names)

    def test_zone_with_earliest_expected_detection_is_chosen(self, stage: "Stage") -> None:
        search = make_search()
        assert stage.run(self.take(stage, search, order="expected_find")) is Status.SUCCESS
        assert order(search.zones) == "cab"
        assert stage.lines == ["Next zone by expected_find: c."]

    def test_approximate_order_of_many_zones_is_logged_once(self, stage: "Stage") -> None:
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

    def test_nearest_zone_is_chosen(self, stage: "Stage") -> None:
        search = make_search()
        search.zones.choose_zone("c")
        assert stage.run(self.take(stage, search, order="nearest")) is Status.SUCCESS
        assert order(search.zones) == "acb"

    def test_order_is_computed_between_ticks_and_requests_a_tick(self, stage: "Stage") -> None:
        leaf = self.take(stage, make_search(), order="expected_find")
        assert tick(leaf) is Status.RUNNING
        stage.until(lambda: stage.wakes == 1, "the tick that is requested")
        assert tick(leaf) is Status.SUCCESS

    def test_zone_is_chosen_again_after_each_search(self, stage: "Stage") -> None:
        search = make_search(
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

    def test_plan_is_kept_without_order(self, stage: "Stage") -> None:
        search = make_search()
        leaf = self.take(stage, search)
        leaf.tick_once()
        assert leaf.status is Status.SUCCESS
        assert order(search.zones) == "abc"
        assert (stage.lines, stage.wakes) == ([], 0)

    def test_changed_plan_is_computed_again(self, stage: "Stage") -> None:
        search = make_search()
        leaf = self.take(stage, search, order="expected_find")
        leaf.tick_once()
        stage.until(lambda: stage.wakes == 1, "the first answer")
        search.zones.choose_zone("c")
        search.zones.abandon("the operator has skipped it")
        assert tick(leaf) is Status.RUNNING
        assert stage.run(leaf) is Status.SUCCESS
        assert sorted(order(search.zones)) == ["a", "b"]

    def test_halted_leaf_starts_over(self, stage: "Stage") -> None:
        leaf = self.take(stage, make_search(), order="expected_find")
        leaf.tick_once()
        stage.until(lambda: stage.wakes == 1, "the answer")
        leaf.stop(Status.INVALID)
        leaf.tick_once()
        assert leaf.status is Status.RUNNING


class PlanningServer:
    """A `compute_path_to_pose` server with straight paths, except around walls.

    Attributes:
        detour_m: Additional length of the path between two x coordinates in metres; None for no path.
        asked: The x coordinates between which paths were requested, in order.
        planners: The planner ids of the requests.
        gate: Set unless responses are to be delayed.
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
class TestPlannerRequests:
    NEEDED = ((0.0, 1.0), (0.0, 2.0), (0.0, 3.0), (1.0, 2.0), (1.0, 3.0), (2.0, 3.0))

    def take(
        self, stage: "Stage", search: Search, order: Any = "expected_find", **options: Any
    ) -> ChooseZone:
        """Set up a leaf, and wait until it has found the planner."""
        leaf = stage.take(ChooseZone("Choose", search.zones, order=order, **options))
        planner = leaf._ways and leaf._ways._planner
        assert planner
        stage.until(lambda: planner.is_ready, "the planner")
        return leaf

    def path_length_to_c(self, zones: ZoneManager) -> float:
        """Return the assumed length of the path from the base station to zone c, in metres."""
        (zone,) = [zone for zone in zones.remaining_zones() if zone["id"] == "c"]
        return zones.path_length_m(zones.base_pose(), zone)

    def test_planned_paths_are_used_and_requested_once(self, stage: "Stage") -> None:
        server, search = PlanningServer(stage.host()), make_search()
        # A wall makes the likeliest zone the farthest one from x = 0, 1 and 2.
        server.detour_m = {frozenset({float(x), 3.0}): 40.0 for x in range(3)}
        leaf = self.take(stage, search)
        assert stage.run(leaf) is Status.SUCCESS
        assert order(search.zones) == "abc"
        assert tuple(server.asked) == self.NEEDED
        assert self.path_length_to_c(search.zones) == 43.0
        search.record.zone_searched("a", None)
        search.zones.select_next_zone()
        assert stage.run(leaf) is Status.SUCCESS
        assert order(search.zones) == "bc"
        assert tuple(server.asked) == self.NEEDED
        assert (stage.warnings, len(active_goals_of(stage.node))) == ([], 0)

    def test_nearest_order_requests_only_paths_from_robot(self, stage: "Stage") -> None:
        server, search = PlanningServer(stage.host()), make_search()
        server.detour_m = {frozenset({0.0, 1.0}): 1.5}
        assert stage.run(self.take(stage, search, "nearest", planner_id="GridBased")) is Status.SUCCESS
        assert order(search.zones) == "bac"
        assert tuple(server.asked) == self.NEEDED[:3]
        assert set(server.planners) == {"GridBased"}

    def test_missing_path_is_estimated_and_reported_once(self, stage: "Stage") -> None:
        server, search = PlanningServer(stage.host()), make_search()
        server.detour_m = {frozenset({0.0, 3.0}): None}
        leaf = self.take(stage, search)
        for _ in range(2):
            assert stage.run(leaf) is Status.SUCCESS
        assert stage.warnings == [
            "'Choose': 1 of 6 paths are estimated as 1.5 times the straight line: the planner returned no path: aborted (status 6), error code 208: there is no path to the goal."
        ]
        assert server.asked == [*self.NEEDED, (0.0, 3.0)]
        assert self.path_length_to_c(search.zones) == 4.5
        server.detour_m = {}
        assert stage.run(leaf) is Status.SUCCESS
        assert self.path_length_to_c(search.zones) == 3.0
        server.detour_m = {frozenset({0.0, 3.0}): None}
        search.zones._path_lengths.clear()
        assert stage.run(leaf) is Status.SUCCESS
        assert stage.warnings[1:] == stage.warnings[:1]

    def test_path_requests_continue_between_ticks(self, stage: "Stage") -> None:
        server = PlanningServer(stage.host())
        leaf = self.take(stage, make_search())
        assert tick(leaf) is Status.RUNNING
        stage.until(lambda: stage.wakes == 1, "the tick that is requested")
        assert tuple(server.asked) == self.NEEDED

    def test_rejected_path_request_is_estimated(self, stage: "Stage") -> None:
        server, search = PlanningServer(stage.host()), make_search()
        server.accepts = False
        assert stage.run(self.take(stage, search, "nearest")) is Status.SUCCESS
        assert stage.warnings == [
            "'Choose': 3 of 3 paths are estimated as 1.5 times the straight line: the planner returned no path: the request was rejected."
        ]

    def test_absent_planner_is_not_waited_for_and_reported_once(self, stage: "Stage") -> None:
        search = make_search()
        leaf = stage.take(ChooseZone("Choose", search.zones, order="expected_find"))
        for _ in range(2):
            assert tick(leaf) is Status.RUNNING
            assert leaf._choice
            assert stage.run(leaf) is Status.SUCCESS
        assert stage.warnings == [
            "'Choose': 6 of 6 paths are estimated as 1.5 times the straight line: no server offers compute_path_to_pose."
        ]

    def test_unanswered_path_request_is_estimated_after_timeout(self, stage: "Stage") -> None:
        server, search = PlanningServer(stage.host()), make_search()
        leaf = self.take(stage, search, ways_timeout_sec=7.0)
        assert leaf._ways
        server.gate.clear()
        stage.tick_until(leaf, lambda: server.asked, "the first question")
        assert 0.0 < leaf._ways._due.remaining_sec <= 7.0
        assert leaf._choice is None
        leaf._ways._due = Deadline(0.0)
        assert tick(leaf) is Status.RUNNING
        server.gate.set()
        assert stage.run(leaf) is Status.SUCCESS
        assert stage.warnings == [
            "'Choose': 6 of 6 paths are estimated as 1.5 times the straight line: no response within 7 s."
        ]
        assert tuple(server.asked) == self.NEEDED[:1]

    def test_halted_leaf_keeps_received_paths(self, stage: "Stage") -> None:
        server, search = PlanningServer(stage.host()), make_search()
        leaf = self.take(stage, search)
        server.detour_m = {frozenset({0.0, 1.0}): 2.0}
        stage.tick_until(leaf, lambda: len(server.asked) == 2, "the second question")
        leaf.stop(Status.INVALID)
        assert stage.run(leaf) is Status.SUCCESS
        assert server.asked.count(self.NEEDED[0]) == 1
        assert set(server.asked) == set(self.NEEDED)

    def test_changed_plan_requests_new_paths(self, stage: "Stage") -> None:
        server, search = PlanningServer(stage.host()), make_search()
        server.gate.clear()
        leaf = self.take(stage, search)
        stage.tick_until(leaf, lambda: server.asked, "the first question")
        search.zones.add({"id": "d", "x": 4.0, "y": 0.0, "yaw": 0.0})
        server.gate.set()
        assert stage.run(leaf) is Status.SUCCESS
        assert (0.0, 4.0) in server.asked
        assert stage.warnings == []

    def test_leaf_without_order_creates_no_client(self, stage: "Stage") -> None:
        PlanningServer(stage.host())
        before = len(list(stage.node.clients))
        leaf = stage.take(ChooseZone("Choose", make_search().zones))
        assert (tick(leaf), len(list(stage.node.clients))) == (Status.SUCCESS, before)

    def test_shutdown_removes_clients(self, stage: "Stage") -> None:
        before = len(list(stage.node.clients))
        leaf = stage.take(ChooseZone("Choose", make_search().zones, order="nearest"))
        assert len(list(stage.node.clients)) == before + 2
        leaf.shutdown()
        assert len(list(stage.node.clients)) == before


def test_nan_parameter_is_rejected() -> None:
    with pytest.raises(ParameterError, match="must be a finite number"):
        zones_from_parameters(probabilities(a__poa=math.nan))
