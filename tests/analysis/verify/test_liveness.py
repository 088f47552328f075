"""Tests of endless runs: their detection, their fairness, and the traces that show them."""

import random

import pytest

from sar_compiler.analysis.state_search.graph import Numbers
from sar_compiler.analysis.state_search.liveness import components, endings, is_fair, lasso, owing_for_ever
from tests.analysis.verify.handmade_graphs import explored, numbers


def circling_states(graph):
    """Return the states of an endless loop, which must exist."""
    found = endings(graph).circling
    assert found is not None
    return found


def keys(graph, states):
    return None if states is None else sorted(numbers(graph)[state] for state in states)


def test_run_that_can_only_end_has_no_endless_loop():
    graph = explored({0: [1], 1: [2]}, ends=[2])
    assert endings(graph) == endings(explored({}, ends=[0]))
    assert (endings(graph).stuck, endings(graph).circling) == (None, None)


def test_state_without_reachable_end_is_stuck():
    graph = explored({0: [1, 2], 1: [3], 3: [1]}, ends=[2])
    assert numbers(graph)[endings(graph).stuck] == 1


def test_end_without_further_end_is_stuck():
    graph = explored({0: [1], 1: [2, 3], 2: [3], 3: [2]}, ends=[1])
    assert numbers(graph)[endings(graph).stuck] == 1


def test_loop_that_need_not_be_left_is_livelock():
    graph = explored({0: [1], 1: [2, 3], 2: [1]}, ends=[3])
    found = endings(graph)
    assert (found.stuck, keys(graph, found.circling)) == (None, [1, 2])


def test_loop_through_end_is_not_livelock():
    assert endings(explored({0: [1], 1: [0]}, ends=[1])).circling is None


def test_waiting_forever_for_one_answer_is_not_fair():
    assert endings(explored({0: [(0, 1), 1]}, ends=[1])).circling is None


def test_waiting_forever_for_alternating_answers_is_fair():
    graph = explored({0: [(1, 0b01), 2], 1: [(0, 0b10)]}, ends=[2])
    assert keys(graph, endings(graph).circling) == [0, 1]


def test_waiting_for_one_answer_while_others_arrive_is_not_fair():
    assert endings(explored({0: [(1, 0b11), 2], 1: [(0, 0b10)]}, ends=[2])).circling is None


def test_unexplored_states_may_still_end():
    assert endings(explored({number: [number + 1] for number in range(20)}, max_states=5)).stuck is None


def test_obligation_that_is_never_met_is_found():
    graph = explored({0: [1], 1: [2, 3], 2: [1], 3: [3]}, owing={1: 0b100, 2: 0b100})
    assert keys(graph, owing_for_ever(graph, 0b100)) == [1, 2]
    assert owing_for_ever(graph, 0b1) is None


def test_obligation_met_in_every_loop_is_not_reported():
    graph = explored({0: [1], 1: [2], 2: [1]}, owing={1: 1})
    assert owing_for_ever(graph, 1) is None


def test_livelock_with_shortest_path_is_reported():
    graph = explored({0: [1, 4], 1: [2], 2: [3], 3: [2], 4: [5], 5: [4]})
    assert keys(graph, endings(graph).circling) == [4, 5]


def test_lasso_has_shortest_stem_and_shortest_fair_loop():
    ticks = {0: [1], 1: [(1, 1), 2, 4], 2: [3], 3: [1], 4: [1]}
    graph = explored(ticks)
    found = lasso(graph, circling_states(graph))
    assert [numbers(graph)[state] for state in found.stem] == [0, 1]
    assert [numbers(graph)[target] for target, _ in found.loop] == [4, 1]


def test_loop_continues_until_all_awaited_answers_have_arrived():
    ticks = {0: [(1, 0b01), (2, 0b10)], 1: [(0, 0b01)], 2: [(0, 0b10)]}
    graph = explored(ticks)
    loop = lasso(graph, circling_states(graph)).loop
    assert sorted(numbers(graph)[target] for target, _ in loop) == [0, 0, 1, 2]


def reachable_states(ticks, start):
    """Return the states that can be reached from a state by one tick or more."""
    found, waiting = set(), list(ticks[start])
    while waiting:
        state = waiting.pop()
        if state not in found:
            found.add(state)
            waiting.extend(ticks[state])
    return found


@pytest.mark.parametrize("seed", range(40))
def test_components_of_random_graphs_are_mutually_reachable_states(seed):
    chance = random.Random(seed)  # noqa: S311 - the same in every run
    count = chance.randint(1, 30)
    ticks = {state: [chance.randrange(count) for _ in range(chance.randint(1, 3))] for state in range(count)}
    graph = explored(ticks)
    excluded = bytearray(chance.random() < 0.1 for _ in numbers(graph))
    left = {
        key: [target for target in ticks[key] if not excluded[numbers(graph).index(target)]]
        for number, key in enumerate(numbers(graph))
        if not excluded[number]
    }
    can_reach = {key: reachable_states(left, key) | {key} for key in left}
    expected = {frozenset(other for other in can_reach[key] if key in can_reach[other]) for key in left}
    found = list(components(graph, excluded))
    assert {frozenset(numbers(graph)[state] for state in component) for component in found} == expected
    order = {state: place for place, component in enumerate(found) for state in component}
    assert all(
        order[target] <= order[state]
        for state in order
        for target, _ in graph.ticks(state)
        if target in order
    ), "what can be reached comes first"


@pytest.mark.parametrize("seed", range(40))
def test_lasso_of_random_graph_is_fair_loop(seed):
    chance = random.Random(seed)  # noqa: S311 - the same in every run
    count = chance.randint(2, 12)
    graph = explored(
        {
            state: [(chance.randrange(count), chance.randrange(8)) for _ in range(chance.randint(1, 3))]
            for state in range(count)
        }
    )
    for component in components(graph, bytearray(len(numbers(graph)))):
        if not is_fair(graph, component):
            continue
        found = lasso(graph, component)
        state, waiting = found.stem[-1], -1
        for target, waits in found.loop:
            assert (target, waits) in graph.ticks(state)
            state, waiting = target, waiting & waits
        assert (state, waiting) == (found.stem[-1], 0)


@pytest.mark.parametrize(
    "numbers",
    [[7, 32_767, 32_768, 3], [7, 1 << 31, 32_768, 3], [7, 40_000, (1 << 31) - 1, 1 << 31, 3]],
    ids=["four bytes", "eight bytes", "one after the other"],
)
def test_large_numbers_are_stored(numbers):
    held = Numbers()
    for number in numbers:
        held.append(number)
    assert [held[at] for at in range(len(numbers))] == numbers
