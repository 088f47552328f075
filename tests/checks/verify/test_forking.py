"""Ticks that go on from where they part, and that are not followed twice where they meet."""

import pytest

from sar_compiler.checks.verify.properties import parse_property_file, properties_of, without_properties
from sar_compiler.checks.verify.state import Prepared
from sar_compiler.checks.verify.stepping import TreeStepper
from sar_compiler.runtime.kernel.entry_cells import EntryCells
from sar_compiler.runtime.kernel.searching import explore
from sar_compiler.runtime.kernel.trail import Trail
from tests.chance import rounds
from tests.checks.verify.stage import BROKEN, PROVED, TAGS, bound, outcome, simulated_tree, verified
from tests.checks.verify.test_same_as_py_trees import trees

NEVER = 10**9
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


def graph_of(binding, few, properties=None):
    """Return all that a search finds, where ticks are seen to meet after so many of a state."""
    file = None if properties is None else parse_property_file(properties, "props.yaml")
    simulated = simulated_tree(binding, file)
    prepared = Prepared.of(simulated)
    wanted = without_properties() if file is None else properties_of(file, prepared, TAGS)
    stepper = TreeStepper(prepared, wanted.rules, few=few)
    graph = explore(stepper.steps, 3000)
    edges = [
        {(graph.targets[edge], graph.waiting[graph.waits[edge]]) for edge in graph.edges(state)}
        for state in range(graph.expanded)
    ]
    error = graph.error and (graph.error.source, graph.error.path)
    return list(graph.states), edges, graph.breaches, bytes(graph.ends), stepper.ran, error


@pytest.mark.parametrize("binding", trees(range(200, 200 + rounds(15))))
def test_where_ticks_meet_nothing_is_lost(binding):
    assert graph_of(binding, 0) == graph_of(binding, NEVER)


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
def test_where_ticks_meet_that_have_broken_other_properties_nothing_is_lost(body):
    binding = bound(body)
    assert graph_of(binding, 0, PROPERTIES) == graph_of(binding, NEVER, PROPERTIES)


def test_leaves_that_are_tried_again_in_one_tick_do_not_multiply():
    again = '<RetryUntilSuccessful num_attempts="3"><A/></RetryUntilSuccessful>'
    found = verified(f"<Sequence>{again * 40}</Sequence>")
    assert found.proved
    assert found.states == 40 * 5 + 3


def test_a_condition_that_changes_what_it_looks_at_changes_it_in_every_run():
    body = (
        '<Sequence><Script code="a := 0"/><Repeat num_cycles="3"><Sequence><A/>'
        '<ScriptCondition code="a += 1; true"/></Sequence></Repeat><ScriptCondition code="a == 3"/><A/></Sequence>'
    )
    found = verified(body)
    assert outcome(found, "every leaf can run") is PROVED
    found = verified(body.replace("a == 3", "a == 2"))
    assert outcome(found, "every leaf can run") is BROKEN


def test_a_leaf_that_begins_and_ends_in_a_tick_leaves_nothing_behind():
    """Else a tick in which much is tried again would have another middle for each of its histories."""
    trail = Trail({}, [], lambda watched, _: (watched, 0), EntryCells())
    trail.begin(0)
    leaf = trail.bit(7)
    trail.start(leaf)
    trail.go_on(leaf)
    assert (trail.going_on, trail.changed, trail.waits) == (0, leaf, 0)
    trail.end(leaf)
    assert (trail.going_on, trail.changed, trail.waits) == (0, 0, 0)


def test_a_leaf_that_runs_on_is_waited_for_until_it_ends():
    trail = Trail({}, [], lambda watched, _: (watched, 0), EntryCells())
    trail.begin(0)
    leaf = trail.bit(7)
    trail.go_on(leaf)
    assert trail.waits == leaf
    trail.end(leaf)
    assert trail.waits == 0
