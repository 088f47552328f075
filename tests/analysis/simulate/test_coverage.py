"""Tests of coverage: which nodes and outcomes a set of scenarios does not show."""

from sar_compiler.analysis.simulate.scenario_run import OutcomeCoverage
from tests.analysis.simulate.stage import played


def coverage(*scenarios, body):
    collected = OutcomeCoverage()
    for text in scenarios:
        collected.add(played(text, body))
    return collected


def names(nodes):
    return [node.bound.name for node in nodes]


def unseen_by_name(collected):
    return {node.bound.name: node.unseen_outcomes for node in collected.nodes_with_unseen_outcomes}


TRY = "<Selector><NavigateToZone/><Sequence><DetectSurvivor/><AdvanceZone/></Sequence></Selector>"


def test_nodes_never_ticked_are_listed():
    assert names(coverage("name: x", body=TRY).never_ticked) == ["Sequence", "DetectSurvivor", "AdvanceZone"]


def test_node_ticked_in_one_run_is_covered():
    collected = coverage("name: x", "leaves: {NavigateToZone: aborted}", body=TRY)
    assert names(collected.never_ticked) == []
    assert len(collected.nodes) == 5


def test_unseen_outcomes_of_leaves_are_listed():
    collected = coverage("name: x", "leaves: {NavigateToZone: [RUNNING, aborted]}", body=TRY)
    assert unseen_by_name(collected) == {
        "NavigateToZone": ["no zone", "unavailable", "waiting for Nav2", "not arrived"],
        "DetectSurvivor": ["nothing", "no answer", "no zone", "searching"],
        "AdvanceZone": ["no zone"],
    }


def test_built_in_leaves_have_outcomes():
    assert unseen_by_name(coverage("name: x", body='<ScriptCondition code="1"/>')) == {
        "ScriptCondition": ["FAILURE"]
    }


def test_outcome_of_wrapper_is_not_outcome_of_wrapped_node():
    body = '<Sequence><NavigateToBase oneshot="ON_COMPLETION"/><AdvanceZone _skipIf="true"/></Sequence>'
    collected = coverage("until: tick == 2", body=body)
    assert unseen_by_name(collected) == {
        "NavigateToBase": ["aborted", "unavailable", "driving", "waiting for Nav2", "not arrived"]
    }
    assert names(collected.never_ticked) == ["AdvanceZone"]


def test_subtree_used_twice_is_covered_by_either_use():
    body = """<Selector><SubTree ID="Drive" name="one"/><SubTree ID="Drive" name="two"/></Selector></BehaviorTree>
    <BehaviorTree ID="Drive"><NavigateToZone/>"""
    collected = coverage("tree: Main\nleaves: {one/NavigateToZone: aborted}", body=body)
    assert unseen_by_name(collected) == {
        "NavigateToZone": ["no zone", "unavailable", "driving", "waiting for Nav2", "not arrived"]
    }
