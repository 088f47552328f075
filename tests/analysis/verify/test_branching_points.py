"""Tests of searches that resume ticks at their branching points, and merge ticks at the same middle."""

import os
import subprocess
import sys

import pytest

from sar_compiler.analysis.state_search.liveness import endings, lasso, owing_for_ever
from sar_compiler.analysis.state_search.numbering import Middles
from sar_compiler.analysis.state_search.searching import (
    A_MIDDLE,
    A_NEW_MIDDLE,
    A_STATE,
    LEFT,
    NOTHING,
    explore,
)
from sar_compiler.analysis.state_search.trail import Trail
from sar_compiler.analysis.verify.properties import parse_property_file, properties_of
from sar_compiler.analysis.verify.state import PreparedTree
from sar_compiler.analysis.verify.stepping import TreeStepper
from sar_compiler.runtime.kernel.entry_cells import EntryCells
from tests.analysis.verify.handmade_graphs import HandMade
from tests.analysis.verify.random_branches import random_branches, random_properties
from tests.analysis.verify.random_trees import random_parallel
from tests.analysis.verify.stage import BROKEN, PROVED, TAGS, bound, outcome, simulated_tree, verified
from tests.analysis.verify.test_same_as_py_trees import trees
from tests.random_inputs import rounds

PROPERTIES = """
properties:
  one thing after the other:
    before: A SUCCESS
    comes: A FAILURE
  not twice:
    at_most_once: A FAILURE
  some day:
    after: A FAILURE
    eventually: A SUCCESS
"""


def endless_runs_of(graph):
    """Return the properties of endless runs in a graph, each loop by its number of ticks."""
    found = endings(graph)
    circling = [found.circling, *(owing_for_ever(graph, 1 << rule) for rule in range(3))]
    return found.stuck, [each and len(lasso(graph, each).loop) for each in circling]


def graph_of(binding, properties=None, *, meets):
    """Return the results of a search in which ticks are merged, or each played to the end."""
    file = None if properties is None else parse_property_file(properties, "props.yaml")
    simulated = simulated_tree(binding, file)
    prepared = PreparedTree.prepare(simulated)
    wanted = properties_of(file, prepared, TAGS)
    stepper = TreeStepper(prepared, wanted.rules, meets=meets)
    graph = explore(stepper.steps, 3000)
    ticks = [set(graph.ticks(state)) for state in range(graph.expanded_count)]
    error = graph.error and (graph.error.source, graph.error.path)
    return (
        list(graph.states),
        ticks,
        graph.breaches,
        bytes(graph.ends),
        stepper.ran,
        error,
        endless_runs_of(graph),
    )


@pytest.mark.parametrize(
    "binding", [*trees(range(200, 200 + rounds(15))), *trees(range(rounds(6)), random_parallel)]
)
def test_merged_ticks_give_same_graph(binding):
    assert graph_of(binding, meets=True) == graph_of(binding, meets=False)


@pytest.mark.parametrize(
    "body",
    [
        "<Sequence><Fallback><A/><A/><A/></Fallback><Fallback><A/><A/></Fallback><A/></Sequence>",
        (
            '<Parallel success_count="2"><RetryUntilSuccessful num_attempts="-1"><A/></RetryUntilSuccessful>'
            "<Fallback><A/><A/></Fallback><A/></Parallel>"
        ),
        '<Sequence><Timeout msec="10"><A/></Timeout><Fallback><A/><Sleep msec="10"/></Fallback><A/></Sequence>',
        (
            '<Sequence><Fallback><A/><Script code="a := 1"/></Fallback><Fallback><A/><Script code="a := 2"/></Fallback>'
            '<ScriptCondition code="a > 1"/></Sequence>'
        ),
    ],
)
def test_merged_ticks_with_different_violations_give_same_graph(body):
    binding = bound(body)
    assert graph_of(binding, PROPERTIES, meets=True) == graph_of(binding, PROPERTIES, meets=False)


def test_retries_in_one_tick_do_not_multiply_states():
    again = '<RetryUntilSuccessful num_attempts="3"><A/></RetryUntilSuccessful>'
    found = verified(f"<Sequence>{again * 40}</Sequence>")
    assert found.is_proved
    assert found.states == 40 * 5 + 3


def test_condition_with_side_effect_is_evaluated_in_every_run():
    body = (
        '<Sequence><Script code="a := 0"/><Repeat num_cycles="3"><Sequence><A/>'
        '<ScriptCondition code="a += 1; true"/></Sequence></Repeat><ScriptCondition code="a == 3"/><A/></Sequence>'
    )
    found = verified(body)
    assert outcome(found, "every leaf can run") is PROVED
    found = verified(body.replace("a == 3", "a == 2"))
    assert outcome(found, "every leaf can run") is BROKEN


def test_middle_is_discarded_if_not_reached_recently():
    middles = Middles(room=2)
    assert [middles.add(each) for each in (b"met again", b"met once", b"new")] == [0, 1, 2]
    assert middles.find(b"met again") == 0
    assert middles.add(b"newer") == 3
    assert [middles.find(b"met again"), middles.find(b"met once"), middles.find(b"new")] == [0, -1, 2]
    assert middles.add(b"met once") == 4


def test_leaf_that_starts_and_ends_in_tick_leaves_no_trace():
    """Otherwise a tick with many attempts would have a different middle for each of its histories."""
    trail = Trail({}, [], lambda watched, _: (watched, 0), EntryCells())
    trail.begin(0)
    leaf = trail.bit(7)
    trail.start(leaf)
    trail.mark_running(leaf)
    assert trail.waits == (0, leaf, leaf)
    trail.mark_ended(leaf)
    assert trail.waits == (0, 0, leaf)


def test_running_leaf_is_awaited_until_it_ends():
    trail = Trail({}, [], lambda watched, _: (watched, 0), EntryCells())
    trail.begin(0)
    leaf = trail.bit(7)
    trail.mark_running(leaf)
    assert trail.going_on == leaf
    trail.mark_ended(leaf)
    assert trail.going_on == 0


def steps_of_branches():
    """Return the steps of a tree with thousands of middles, many of which are reached again at once."""
    body = random_branches(46)
    file = parse_property_file(random_properties(body, 46), "props.yaml")
    prepared = PreparedTree.prepare(simulated_tree(bound(body), file))
    graph = explore(TreeStepper(prepared, properties_of(file, prepared, TAGS).rules).steps, 3000)
    return [[int(target) for target in steps.targets] for steps in (graph.steps, graph.middles)]


def test_graph_does_not_depend_on_hash_seed():
    code = f"from {__name__} import steps_of_branches as steps; print(steps())"
    graphs = {
        subprocess.run(
            [sys.executable, "-c", code],
            env={**os.environ, "PYTHONHASHSEED": seed},
            check=True,
            capture_output=True,
            timeout=300,
        ).stdout
        for seed in ("0", "1", "2")
    }
    assert len(graphs) == 1
    assert len(graphs.pop()) > 10_000


class RejoiningSteps(HandMade):
    """Two paths lead from the only state to a middle, the second one just after the first has left it."""

    def __init__(self):
        super().__init__({})
        self.middle = b"a middle"

    def enter(self, state, *, alone=False):
        self._to_come = [A_NEW_MIDDLE, A_STATE, LEFT, A_MIDDLE]

    def step(self):
        if not self._to_come:
            return NOTHING
        self.state, self.left = b"\0", 1
        return self._to_come.pop(0)


def test_middle_that_was_just_left_keeps_its_number():
    graph = explore(RejoiningSteps(), 10)
    assert len(graph.middles) == 1
    assert graph.ticks(0) == [(0, 0)]
