"""Tests of search theory: probabilities and orders, compared with all permutations and with simulated searches."""

import itertools
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from search_and_rescue.search_theory import (
    PoaMap,
    SearchExpectation,
    TourInputs,
    parallel_sweep_pod,
    random_search_pod,
)
from search_and_rescue.zone_order import (
    BEAM_UP_TO,
    EXACT_UP_TO,
    approximation,
    beam,
    greedy_index_order,
    optimal_order,
    order_areas,
)
from tests.random_inputs import rounds

SIGMAS = 4
AREAS = 8
_ALL_ORDERS = np.array(list(itertools.permutations(range(AREAS))))


def mission(seed: int, count: int) -> tuple[TourInputs, PoaMap]:
    """Return random areas within 40 m: Pareto POA, POD 0.5 to 0.95, paths at 0.5 m/s and searches of 5 to 60 s."""
    chance = np.random.default_rng(seed)
    places = [(chance.uniform(0, 40), chance.uniform(0, 40)) for _ in range(count + 1)]
    ways = [[math.dist(a, b) / 0.5 for b in places[1:]] for a in places]
    shares = [1 + chance.pareto(1.2) for _ in range(count)]
    poa = {str(area): 0.9 * share / sum(shares) for area, share in enumerate(shares)}
    pod = {area: chance.uniform(0.5, 0.95) for area in poa}
    looks = [chance.uniform(5, 60) for _ in poa]
    return TourInputs(ways[0], ways[1:], looks, [poa[area] * pod[area] for area in poa]), PoaMap(poa, pod, {})


def least_of_all_orders(tour: TourInputs) -> float:
    steps = np.column_stack(
        [
            np.array(tour.from_start)[_ALL_ORDERS[:, 0]],
            np.array(tour.between)[_ALL_ORDERS[:, :-1], _ALL_ORDERS[:, 1:]],
        ]
    )
    ends = (steps + np.array(tour.looks)[_ALL_ORDERS]).cumsum(axis=1)
    finds = np.array(tour.finds)
    return float((ends * finds[_ALL_ORDERS]).sum(axis=1).min() / finds.sum())


@pytest.mark.unmeasured
def test_chosen_order_of_eight_areas_is_optimal() -> None:
    for seed in range(rounds(200)):
        tour, _ = mission(seed, AREAS)
        expected = tour.expected_find(order_areas("expected_find", tour))
        assert expected == pytest.approx(least_of_all_orders(tour), rel=1e-6), seed


@pytest.mark.unmeasured
@pytest.mark.parametrize("count", [15, 16, 17, 18])
def test_approximate_order_is_at_most_two_percent_longer(count: int) -> None:
    assert count > EXACT_UP_TO
    for seed in range(rounds(3)):
        tour, _ = mission(1000 * count + seed, count)
        best = tour.expected_find(optimal_order(tour))
        chosen = order_areas("expected_find", tour)
        assert sorted(chosen) == list(range(count))
        assert best * (1 - 1e-6) <= tour.expected_find(chosen) <= 1.02 * best, seed


def test_beam_of_width_one_orders_all_areas_within_ten_percent() -> None:
    for seed in range(rounds(20)):
        tour, _ = mission(seed, AREAS)
        chosen = beam(tour, width=1)
        assert sorted(chosen) == list(range(AREAS))
        assert tour.expected_find(chosen) <= 1.1 * least_of_all_orders(tour), seed


def test_index_rule_orders_eight_areas_within_ten_percent() -> None:
    for seed in range(rounds(20)):
        tour, _ = mission(seed, AREAS)
        chosen = greedy_index_order(tour)
        assert sorted(chosen) == list(range(AREAS))
        assert tour.expected_find(chosen) <= 1.1 * least_of_all_orders(tour), seed


def test_moving_one_area_does_not_improve_order_of_index_rule() -> None:
    for seed in range(rounds(5)):
        tour, _ = mission(seed, 20)
        chosen = greedy_index_order(tour)
        least = tour.expected_find(chosen) * (1 - 1e-6)
        for area, at in itertools.product(chosen, range(len(chosen))):
            moved = [each for each in chosen if each != area]
            moved.insert(at, area)
            assert tour.expected_find(moved) >= least, (seed, area, at)


def test_ordering_method_depends_on_number_of_areas() -> None:
    sizes = {EXACT_UP_TO: optimal_order, EXACT_UP_TO + 1: beam, BEAM_UP_TO + 1: greedy_index_order}
    for count, method in sizes.items():
        tour, _ = mission(count, count)
        assert order_areas("expected_find", tour) == method(tour), count
        assert (method is optimal_order) == (not approximation(count))
    assert approximation(BEAM_UP_TO) == "a beam search"
    tour, _ = mission(3, 300)
    assert sorted(order_areas("expected_find", tour)) == list(range(300))


def test_index_rule_orders_areas_without_distances_and_single_area() -> None:
    assert greedy_index_order(TourInputs([0.0], [[0.0]], [0.0], [0.5])) == [0]
    no_ways = TourInputs([0.0] * 3, [[0.0] * 3] * 3, [0.0] * 3, [0.1, 0.3, 0.2])
    assert sorted(greedy_index_order(no_ways)) == [0, 1, 2]


def test_forty_areas_are_ordered_better_than_by_nearest() -> None:
    tour, _ = mission(7, 40)
    assert tour.expected_find(order_areas("expected_find", tour)) < tour.expected_find(
        order_areas("nearest", tour)
    )


def test_listed_order_is_kept_and_nearest_order_is_greedy() -> None:
    tour = TourInputs(
        [3.0, 1.0, 2.0], [[0.0, 9.0, 1.0], [5.0, 0.0, 6.0], [1.0, 9.0, 0.0]], [0.0] * 3, [0.3] * 3
    )
    assert order_areas("listed", tour) == [0, 1, 2]
    assert order_areas("nearest", tour) == [1, 0, 2]


@pytest.mark.parametrize("order", ["listed", "nearest", "expected_find"])
def test_no_area_and_one_area_have_one_order(order: str) -> None:
    assert order_areas(order, TourInputs([], [], [], [])) == []  # type: ignore[arg-type]
    assert order_areas(order, TourInputs([1.0], [[0.0]], [1.0], [0.5])) == [0]  # type: ignore[arg-type]


def test_areas_without_probability_come_last_on_shorter_path() -> None:
    ways = [[abs(a - b) for b in (1.0, 2.0, 3.0, 9.0)] for a in (1.0, 2.0, 3.0, 9.0)]
    tour = TourInputs([1.0, 2.0, 3.0, 9.0], ways, [1.0] * 4, [0.0, 0.0, 0.0, 0.5])
    assert order_areas("expected_find", tour) == [3, 2, 1, 0]
    assert tour.expected_find([3, 2, 1, 0]) == 10.0
    certainly_empty = TourInputs([1.0, 2.0, 3.0, 9.0], ways, [1.0] * 4, [0.0] * 4)
    assert order_areas("expected_find", certainly_empty) == [0, 1, 2, 3]
    assert certainly_empty.expected_find([0, 1, 2, 3]) == 0.0


@pytest.mark.parametrize("seed", range(5))
def test_simulated_searches_match_expected_time_and_pos(seed: int) -> None:
    tour, before = mission(seed, AREAS)
    order, searches = order_areas("expected_find", tour), 10_000
    chance = np.random.default_rng(seed)
    elsewhere = 1 - sum(before.poa.values())
    where = chance.choice(AREAS + 1, size=searches, p=[*before.poa.values(), elsewhere])
    pods = np.array([*before.pod.values(), 0.0])
    found = chance.random(searches) < pods[where]
    ends = np.zeros(AREAS + 1)
    ends[order] = tour.ends(order)
    times = ends[where[found]]
    error = times.std() / math.sqrt(len(times))
    assert abs(times.mean() - tour.expected_find(order)) < SIGMAS * error
    expected = PoaMap(before.poa, before.pod, dict.fromkeys(before.poa, 1)).pos()
    assert abs(found.mean() - expected) < SIGMAS * math.sqrt(expected * (1 - expected) / searches)


maps = st.integers(1, 6).flatmap(
    lambda count: st.tuples(
        st.lists(st.floats(0.0, 1.0), min_size=count + 1, max_size=count + 1),
        st.lists(st.floats(0.0, 1.0), min_size=count, max_size=count),
        st.lists(st.integers(0, 3), min_size=count, max_size=count),
    )
)


@settings(max_examples=rounds(200))
@given(maps)
def test_probabilities_after_failed_searches_follow_bayes(
    drawn: tuple[list[float], list[float], list[int]],
) -> None:
    shares, pods, looks = drawn
    total = sum(shares) or 1.0
    poa = {str(area): share / total for area, share in enumerate(shares[:-1])}
    pod = dict(zip(poa, pods, strict=True))
    now, done, missed = dict(poa), dict.fromkeys(poa, 0), 1.0
    for area, count in zip(poa, looks, strict=True):
        for _ in range(count):
            misses = 1 - now[area] * pod[area]
            if misses < 1e-6:
                return
            now = {each: value / misses for each, value in now.items()}
            now[area] *= 1 - pod[area]
            done[area] += 1
            missed *= misses
            seen = PoaMap(poa, pod, done)
            assert seen.current_probabilities() == pytest.approx(now, rel=1e-6, abs=1e-9)
            assert seen.pos() == pytest.approx(1 - missed, rel=1e-6, abs=1e-9)


def test_failed_search_lowers_its_area_and_raises_others() -> None:
    poa, pod = {"a": 0.5, "b": 0.3}, {"a": 0.8, "b": 0.5}
    assert PoaMap(poa, pod, {}).current_probabilities() == pytest.approx(poa)
    assert PoaMap(poa, pod, {"a": 1}).current_probabilities() == pytest.approx(
        {"a": 0.1 / 0.6, "b": 0.3 / 0.6}
    )
    assert PoaMap(poa, pod, {"a": 2, "b": 1}).pos() == pytest.approx(0.5 * 0.96 + 0.3 * 0.5)


def test_certainly_empty_areas_have_no_probability() -> None:
    assert PoaMap({"a": 1.0}, {"a": 1.0}, {"a": 1}).current_probabilities() == {"a": 0.0}


@pytest.mark.parametrize(
    ("poa", "pod", "said"),
    [
        ({"a": 0.7, "b": 0.4}, {"a": 1.0, "b": 1.0}, "add up to 1.1"),
        ({"a": 1.5}, {"a": 1.0}, "a has the probability 1.5"),
        ({"a": 0.5}, {"a": -0.1}, "a has the probability -0.1"),
        ({"a": math.nan}, {"a": 0.1}, "a has the probability nan"),
        ({"a": 0.5}, {}, "a has no POD"),
    ],
)
def test_invalid_probability_is_rejected(poa: dict[str, float], pod: dict[str, float], said: str) -> None:
    with pytest.raises(ValueError, match=said):
        PoaMap(poa, pod, {})


def test_tenths_that_sum_to_one_are_not_rejected_for_rounding() -> None:
    poa = {str(area): 0.1 for area in range(10)}
    assert PoaMap(poa, dict.fromkeys(poa, 0.5), {}).pos() == 0.0


@given(
    poa=st.lists(st.floats(0.01, 1.0), min_size=1, max_size=5),
    ratio=st.floats(0.01, 100.0),
    elsewhere=st.floats(0.01, 1.0),
)
def test_hint_changes_probabilities_by_bayes(poa: list[float], ratio: float, elsewhere: float) -> None:
    total = sum(poa) + elsewhere
    areas = {str(at): SearchExpectation(each / total, 0.5) for at, each in enumerate(poa)}
    hinted = PoaMap.from_areas(areas, {}, hints={"0": ratio}).current_probabilities()
    # The likelihood of the hint: the ratio if the survivor is in the area, and 1 otherwise.
    evidence = ratio * areas["0"].poa + 1.0 - areas["0"].poa
    for name, area in areas.items():
        expected = area.poa * (ratio if name == "0" else 1.0) / evidence
        assert hinted[name] == pytest.approx(expected)


def test_search_and_hint_have_same_effect_in_either_order() -> None:
    areas = {"a": SearchExpectation(0.5, 0.8), "b": SearchExpectation(0.3, 0.5)}
    both = PoaMap.from_areas(areas, {"a": 1}, hints={"a": 4.0}).current_probabilities()
    # Bayes' rule twice: first the search, then the hint.
    looked = PoaMap.from_areas(areas, {"a": 1}).current_probabilities()
    evidence = 4.0 * looked["a"] + 1.0 - looked["a"]
    assert both["a"] == pytest.approx(4.0 * looked["a"] / evidence)


@pytest.mark.parametrize(("coverage", "at_random", "in_parallel"), [(0.0, 0.0, 0.0), (0.5, 0.393, 0.469), (1.0, 0.632, 0.790), (2.0, 0.865, 0.988)])  # fmt: skip
def test_pod_of_coverage_matches_tables(coverage: float, at_random: float, in_parallel: float) -> None:
    assert random_search_pod(coverage) == pytest.approx(at_random, abs=0.001)
    assert parallel_sweep_pod(coverage) == pytest.approx(in_parallel, abs=0.001)
