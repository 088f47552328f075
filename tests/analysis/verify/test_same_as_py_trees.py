"""Tests that the verified runs are those of the running tree: py_trees reaches the same states."""

import contextlib

import pytest

from sar_compiler.analysis.state_search.choices import Choices
from sar_compiler.analysis.state_search.searching import explore
from sar_compiler.analysis.verify.properties import without_properties
from sar_compiler.analysis.verify.state import PreparedTree
from sar_compiler.analysis.verify.state_space import StateSpace
from sar_compiler.analysis.verify.stepping import TreeStepper
from sar_compiler.runtime.events import RETURNED
from sar_compiler.runtime.kernel.cells import STATUSES
from sar_compiler.tree.diagnostic import TreeError
from tests.analysis.verify.random_trees import random_tree
from tests.analysis.verify.stage import bound, simulated_tree
from tests.random_inputs import rounds

pytestmark = pytest.mark.unmeasured

# Every run of this many ticks is played with py_trees, unless there are too many.
TICKS = 3
_MOST_RUNS = 1500
_MOST_STATES = 400


def looked_at(simulated):
    """Return the observable state of a tree that py_trees ticks."""
    return (
        tuple(node.status for node in simulated.root.iterate()),
        values(simulated.compiled.board),
        values(simulated.facts.board),
    )


def values(board):
    return tuple(
        sorted(
            (name.removeprefix(board.prefix), board.get(name)) for name in board.names() if board.has(name)
        )
    )


class Explored:
    """The states of a tree in flat form, with the observable part of each."""

    def __init__(self, simulated, max_states, *, forgets=False):
        self.stepper = TreeStepper(
            PreparedTree.prepare(simulated), without_properties().rules, forgets=forgets
        )
        self.graph = explore(self.stepper.steps, max_states)
        self._simulated = simulated
        # The order of `iterate` of py_trees: children before parents.
        index = {id(node.behaviour): node.index for node in self.stepper.flat.nodes}
        self._order = [index[id(node)] for node in simulated.root.iterate()]

    def looked_at(self, number):
        state = self.graph.states[number]
        self.stepper.states.values_in(state)
        cells = self.stepper.ticker.cells
        return (
            tuple(STATUSES[cells[index]] for index in self._order),
            values(self._simulated.compiled.board),
            values(self._simulated.facts.board),
        )


def trees(seeds, written=random_tree):
    """Return random trees, bound, except those with errors."""
    found = []
    for seed in seeds:
        with contextlib.suppress(TreeError):
            found.append(pytest.param(bound(written(seed)), id=str(seed)))
    return found


class CombinationPolicy:
    """Chooses outcomes by the combination that is played."""

    def __init__(self, choices):
        self._choices = choices

    def choose(self, leaf, options):
        return options[self._choices.pick(len(options))]


def tick_sequences(binding):
    """Yield the results of every run with py_trees, then None if there are too many."""
    choices = Choices()
    choices.begin()
    for _ in range(_MOST_RUNS):
        simulated = simulated_tree(binding)
        simulated.policy = CombinationPolicy(choices)
        yield looked_at(simulated)
        for _ in range(TICKS):
            try:
                simulated.root.tick_once()
            except Exception:  # noqa: BLE001 - scripts of random trees go wrong
                break
            yield looked_at(simulated)
        if choices.advance() < 0:
            return
    yield None


@pytest.mark.parametrize("binding", trees(range(rounds(15))))
def test_states_match_py_trees(binding):
    seen = set(tick_sequences(binding))
    assert None not in seen, f"more than {_MOST_RUNS} runs: let the trees be smaller"
    explored = Explored(simulated_tree(binding), 50_000)
    graph = explored.graph
    near = [number for number in range(len(graph.states)) if len(graph.stem(number)) <= TICKS + 1]
    assert {explored.looked_at(number) for number in near} == seen


class TracePolicy:
    """Returns the outcomes of a trace, in order."""

    def __init__(self, trace):
        self._answers = [
            (event.path, event.status, event.label) for event in trace.events if event.what == RETURNED
        ]

    def choose(self, leaf, options):
        path, *answer = self._answers.pop(0)
        assert path == leaf.path
        return next(option for option in options if [option.status, option.label] == answer)


@pytest.mark.parametrize("binding", trees(range(100, 100 + rounds(8))))
def test_trace_leads_py_trees_to_same_state(binding):
    explored = Explored(simulated_tree(binding), _MOST_STATES)
    space = StateSpace(explored.stepper, explored.graph)
    for number in range(0, len(explored.graph.states), 7):
        trace = space.trace_to(number)
        simulated = simulated_tree(binding)
        simulated.policy = TracePolicy(trace)
        for _ in trace.ticks:
            simulated.root.tick_once()
        assert looked_at(simulated) == explored.looked_at(number)
