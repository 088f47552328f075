"""Going through states, those that fewest ticks lead to first."""

from tests.analysis.verify.handmade import explored, numbers


def test_every_state_that_can_be_reached_is_found_once():
    graph = explored({0: [1, 2], 1: [3], 2: [3, 0]})
    assert sorted(numbers(graph)) == [0, 1, 2, 3]
    assert graph.complete


def test_a_state_is_numbered_by_how_many_ticks_lead_to_it():
    graph = explored({0: [1, 5], 1: [2], 2: [5]})
    assert numbers(graph) == [0, 1, 5, 2]
    assert [len(graph.stem(number)) - 1 for number in range(4)] == [0, 1, 1, 2]


def test_the_way_to_a_state_is_a_shortest_one():
    graph = explored({0: [1, 2], 1: [3], 3: [4], 2: [4]})
    assert [numbers(graph)[state] for state in graph.stem(numbers(graph).index(4))] == [0, 2, 4]


def test_ticks_that_come_to_the_same_and_wait_for_the_same_are_one():
    graph = explored({0: [(1, 1), (1, 1), (1, 2)]})
    assert graph.ticks(0) == [(1, 1), (1, 2)]


def test_of_many_ticks_each_is_kept_once():
    many = [(state, waits) for state in range(60) for waits in (1, 1 << 30)]
    graph = explored({0: many * 2})
    assert graph.ticks(0) == many


def test_the_first_breach_of_a_rule_is_kept_with_its_tick():
    graph = explored({0: [1, 2], 1: [3], 2: [3]}, broken={2: 0b10, 3: 0b11})
    first, second = graph.breaches[0], graph.breaches[1]
    assert (numbers(graph)[second.source], second.path) == (0, (1,))
    assert (numbers(graph)[first.source], first.path) == (1, (0,))


def test_whether_a_state_idles_is_known_once_all_its_ticks_are():
    graph = explored({0: [1], 1: [1, 2]}, idle_ends=[1, 2])
    assert list(graph.ends) == [0, 0, 1]


def test_a_state_that_every_tick_leaves_as_it_is_is_judged_as_idle():
    graph = explored({0: [1, 2], 1: [1, 0]}, idle_ends=[1, 2])
    assert [key for key, ends in zip(numbers(graph), graph.ends, strict=True) if ends] == [2]


def test_the_bound_ends_the_exploration_and_says_so():
    graph = explored({number: [number + 1] for number in range(100)}, max_states=10)
    assert (len(numbers(graph)), graph.complete) == (10, False)


def test_what_was_not_gone_through_has_no_ticks():
    graph = explored({0: [1, 2], 1: [3, 4]}, max_states=3)
    assert (graph.expanded_count, graph.ticks(1)) == (1, [])


def test_a_bound_that_is_just_enough_is_no_bound():
    assert explored({0: [1], 1: [2]}, max_states=3).complete


def test_how_many_ticks_every_run_was_followed_for_is_known():
    ticks = {0: [1, 2], 1: [3], 2: [4], 3: [5], 4: [6]}
    assert explored(ticks, max_states=5).depth == 2
    assert explored(ticks).depth == 3
