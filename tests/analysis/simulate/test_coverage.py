"""What a set of scenarios has not shown of a tree."""

from sar_compiler.analysis.simulate.scenario_run import OutcomeCoverage
from tests.analysis.simulate.stage import played


def coverage(*scenarios, body):
    collected = OutcomeCoverage()
    for text in scenarios:
        collected.add(played(text, body))
    return collected


def names(nodes):
    return [node.bound.name for node in nodes]


def unseen(collected):
    return {node.bound.name: node.unseen_outcomes for node in collected.nodes_with_unseen_outcomes}


TRY = "<Selector><NavigateToZone/><Sequence><DetectSurvivor/><AdvanceZone/></Sequence></Selector>"


def test_a_node_that_no_run_ticks_is_named():
    assert names(coverage("name: x", body=TRY).never_ticked) == ["Sequence", "DetectSurvivor", "AdvanceZone"]


def test_a_node_that_one_of_the_runs_ticks_is_covered():
    collected = coverage("name: x", "leaves: {NavigateToZone: aborted}", body=TRY)
    assert names(collected.never_ticked) == []
    assert len(collected.nodes) == 5


def test_the_answers_of_leaves_that_no_run_has_shown_are_named():
    collected = coverage("name: x", "leaves: {NavigateToZone: [RUNNING, aborted]}", body=TRY)
    assert unseen(collected) == {
        "NavigateToZone": ["no zone", "unavailable", "waiting for Nav2", "not arrived"],
        "DetectSurvivor": ["nothing", "no answer", "no zone", "searching"],
        "AdvanceZone": ["no zone"],
    }


def test_leaves_of_the_language_have_their_outcomes():
    assert unseen(coverage("name: x", body='<ScriptCondition code="1"/>')) == {"ScriptCondition": ["FAILURE"]}


def test_what_a_wrapper_answers_is_not_an_outcome_of_the_node_in_it():
    body = '<Sequence><NavigateToBase oneshot="ON_COMPLETION"/><AdvanceZone _skipIf="true"/></Sequence>'
    collected = coverage("until: tick == 2", body=body)
    assert unseen(collected) == {
        "NavigateToBase": ["aborted", "unavailable", "driving", "waiting for Nav2", "not arrived"]
    }
    assert names(collected.never_ticked) == ["AdvanceZone"]


def test_a_tree_that_is_used_twice_is_covered_where_either_is():
    body = """<Selector><SubTree ID="Drive" name="one"/><SubTree ID="Drive" name="two"/></Selector></BehaviorTree>
    <BehaviorTree ID="Drive"><NavigateToZone/>"""
    collected = coverage("tree: Main\nleaves: {one/NavigateToZone: aborted}", body=body)
    assert unseen(collected) == {
        "NavigateToZone": ["no zone", "unavailable", "driving", "waiting for Nav2", "not arrived"]
    }
