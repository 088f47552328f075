"""Several processes find what one finds."""

import dataclasses
import multiprocessing

import pytest

from sar_compiler.checks.verify.processes import SearchProcesses
from sar_compiler.checks.verify.properties import parse_property_file, properties_of
from sar_compiler.checks.verify.state import Prepared
from sar_compiler.checks.verify.stepping import TreeStepper
from sar_compiler.runtime.kernel.searching import explore
from tests.checks.verify.stage import TAGS, bound, simulated_tree

BODY = """
<Parallel success_count="3" failure_count="3">
  <RetryUntilSuccessful num_attempts="3"><A/></RetryUntilSuccessful>
  <Sequence><B/><Sleep msec="10"/><X/></Sequence>
  <Fallback><Timeout msec="10"><C/></Timeout><P/></Fallback>
</Parallel>
"""
PROPERTIES = """
properties:
  never this: {never: C SUCCESS}
  not twice: {at_most_once: X SUCCESS}
  some day: {after: A FAILURE, eventually: X SUCCESS}
  in the end: {at_end: f == 1}
"""


def found(count, report=lambda _: None):
    """Return all that a number of processes find, which help from the first state on."""
    file = parse_property_file(PROPERTIES, "props.yaml")
    prepared = Prepared.of(simulated_tree(bound(BODY), file))
    stepper = TreeStepper(prepared, properties_of(file, prepared, TAGS).rules)
    helpers = SearchProcesses(stepper, count, many=2)
    try:
        graph = explore(stepper.steps, 3000, report, helpers=helpers)
    finally:
        helpers.close()
    names = {each.name for each in dataclasses.fields(graph)} - {"states", "waits"}
    waits = [graph.waits[edge] for edge in range(len(graph.targets))]
    return [list(graph.states), waits, *(getattr(graph, name) for name in sorted(names)), stepper.ran]


@pytest.fixture(scope="module")
def alone():
    return found(1)


def test_the_graph_is_the_same(alone):
    seen = set()
    assert found(2, lambda _: seen.update(multiprocessing.active_children())) == alone
    assert len(seen) >= 2, "nobody has helped"


def test_processes_that_are_killed_change_nothing(alone):
    killed = []

    def kill(_):
        for child in multiprocessing.active_children()[:1]:
            child.kill()
            killed.append(child)

    assert found(2, kill) == alone
    assert killed


def test_they_end_with_the_search():
    found(2)
    for child in multiprocessing.active_children():
        child.join(10)
    assert not multiprocessing.active_children()
