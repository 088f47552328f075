"""Runs that never end: which there are, which are fair, and how they are told."""

import random

import pytest

from sar_compiler.analysis.state_search.graph import Numbers
from sar_compiler.analysis.state_search.liveness import components, endings, is_fair, lasso, owing_for_ever
from tests.analysis.verify.handmade import explored, numbers


def circling(graph):
    """Return a round without an end that there is."""
    found = endings(graph).circling
    assert found is not None
    return found


def keys(graph, states):
    return None if states is None else sorted(numbers(graph)[state] for state in states)


def test_a_run_that_can_only_end_ends():
    graph = explored({0: [1], 1: [2]}, ends=[2])
    assert endings(graph) == endings(explored({}, ends=[0]))
    assert (endings(graph).stuck, endings(graph).circling) == (None, None)


def test_a_state_behind_which_no_end_comes_is_found():
    graph = explored({0: [1, 2], 1: [3], 3: [1]}, ends=[2])
    assert numbers(graph)[endings(graph).stuck] == 1


def test_an_end_behind_which_no_other_comes_is_found_itself():
    graph = explored({0: [1], 1: [2, 3], 2: [3], 3: [2]}, ends=[1])
    assert numbers(graph)[endings(graph).stuck] == 1


def test_a_round_that_can_be_left_but_need_not_be_is_a_livelock():
    graph = explored({0: [1], 1: [2, 3], 2: [1]}, ends=[3])
    found = endings(graph)
    assert (found.stuck, keys(graph, found.circling)) == (None, [1, 2])


def test_a_round_that_leads_through_an_end_is_none():
    assert endings(explored({0: [1], 1: [0]}, ends=[1])).circling is None


def test_to_wait_for_an_answer_for_ever_is_not_fair():
    assert endings(explored({0: [(0, 1), 1]}, ends=[1])).circling is None


def test_to_wait_for_one_answer_after_another_for_ever_is_fair():
    graph = explored({0: [(1, 0b01), 2], 1: [(0, 0b10)]}, ends=[2])
    assert keys(graph, endings(graph).circling) == [0, 1]


def test_to_wait_for_one_answer_while_others_come_is_not_fair():
    assert endings(explored({0: [(1, 0b11), 2], 1: [(0, 0b10)]}, ends=[2])).circling is None


def test_what_was_not_gone_through_may_still_end():
    assert endings(explored({number: [number + 1] for number in range(20)}, max_states=5)).stuck is None


def test_a_debt_that_is_never_paid_is_found():
    graph = explored({0: [1], 1: [2, 3], 2: [1], 3: [3]}, owing={1: 0b100, 2: 0b100})
    assert keys(graph, owing_for_ever(graph, 0b100)) == [1, 2]
    assert owing_for_ever(graph, 0b1) is None


def test_a_debt_that_is_paid_in_every_round_is_none():
    graph = explored({0: [1], 1: [2], 2: [1]}, owing={1: 1})
    assert owing_for_ever(graph, 1) is None


def test_the_livelock_that_is_told_is_one_that_fewest_ticks_lead_to():
    graph = explored({0: [1, 4], 1: [2], 2: [3], 3: [2], 4: [5], 5: [4]})
    assert keys(graph, endings(graph).circling) == [4, 5]


def test_a_lasso_is_a_shortest_way_and_a_shortest_fair_round():
    ticks = {0: [1], 1: [(1, 1), 2, 4], 2: [3], 3: [1], 4: [1]}
    graph = explored(ticks)
    found = lasso(graph, circling(graph))
    assert [numbers(graph)[state] for state in found.stem] == [0, 1]
    assert [numbers(graph)[target] for target, _ in found.loop] == [4, 1]


def test_a_round_is_gone_until_everything_that_was_waited_for_has_come():
    ticks = {0: [(1, 0b01), (2, 0b10)], 1: [(0, 0b01)], 2: [(0, 0b10)]}
    graph = explored(ticks)
    loop = lasso(graph, circling(graph)).loop
    assert sorted(numbers(graph)[target] for target, _ in loop) == [0, 0, 1, 2]


def reached(ticks, start):
    """Return what can be reached from a state, by one tick or more."""
    found, waiting = set(), list(ticks[start])
    while waiting:
        state = waiting.pop()
        if state not in found:
            found.add(state)
            waiting.extend(ticks[state])
    return found


@pytest.mark.parametrize("seed", range(40))
def test_the_components_of_random_graphs_are_those_that_reach_each_other(seed):
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
    can_reach = {key: reached(left, key) | {key} for key in left}
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
def test_a_lasso_of_a_random_graph_goes_round_and_leaves_off_waiting_for_each(seed):
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
def test_numbers_are_kept_however_large_one_of_them_is(numbers):
    held = Numbers()
    for number in numbers:
        held.append(number)
    assert [held[at] for at in range(len(numbers))] == numbers
