"""Tests of the exploration of states, in the order of their distance from the start."""

from tests.analysis.verify.handmade_graphs import explored, numbers


def test_every_reachable_state_is_found_once():
    graph = explored({0: [1, 2], 1: [3], 2: [3, 0]})
    assert sorted(numbers(graph)) == [0, 1, 2, 3]
    assert graph.complete


def test_states_are_numbered_by_distance():
    graph = explored({0: [1, 5], 1: [2], 2: [5]})
    assert numbers(graph) == [0, 1, 5, 2]
    assert [len(graph.stem(number)) - 1 for number in range(4)] == [0, 1, 1, 2]


def test_path_to_state_is_shortest():
    graph = explored({0: [1, 2], 1: [3], 3: [4], 2: [4]})
    assert [numbers(graph)[state] for state in graph.stem(numbers(graph).index(4))] == [0, 2, 4]


def test_ticks_with_same_target_and_waits_are_merged():
    graph = explored({0: [(1, 1), (1, 1), (1, 2)]})
    assert graph.ticks(0) == [(1, 1), (1, 2)]


def test_each_of_many_ticks_is_kept_once():
    many = [(state, waits) for state in range(60) for waits in (1, 1 << 30)]
    graph = explored({0: many * 2})
    assert graph.ticks(0) == many


def test_first_violation_of_rule_is_kept_with_its_tick():
    graph = explored({0: [1, 2], 1: [3], 2: [3]}, broken={2: 0b10, 3: 0b11})
    first, second = graph.breaches[0], graph.breaches[1]
    assert (numbers(graph)[second.source], second.path) == (0, (1,))
    assert (numbers(graph)[first.source], first.path) == (1, (0,))


def test_idleness_is_known_after_all_ticks_of_state():
    graph = explored({0: [1], 1: [1, 2]}, idle_ends=[1, 2])
    assert list(graph.ends) == [0, 0, 1]


def test_state_unchanged_by_every_tick_is_idle():
    graph = explored({0: [1, 2], 1: [1, 0]}, idle_ends=[1, 2])
    assert [key for key, ends in zip(numbers(graph), graph.ends, strict=True) if ends] == [2]


def test_state_limit_ends_exploration():
    graph = explored({number: [number + 1] for number in range(100)}, max_states=10)
    assert (len(numbers(graph)), graph.complete) == (10, False)


def test_unexplored_state_has_no_ticks():
    graph = explored({0: [1, 2], 1: [3, 4]}, max_states=3)
    assert (graph.expanded_count, graph.ticks(1)) == (1, [])


def test_sufficient_limit_leaves_graph_complete():
    assert explored({0: [1], 1: [2]}, max_states=3).complete


def test_explored_depth_is_known():
    ticks = {0: [1, 2], 1: [3], 2: [4], 3: [5], 4: [6]}
    assert explored(ticks, max_states=5).depth == 2
    assert explored(ticks).depth == 3
