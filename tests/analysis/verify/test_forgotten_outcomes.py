"""Tests of forgetting the outcomes of ended nodes: the verdicts are the same, with no more states."""

import pytest

from sar_compiler.analysis.verify import verify
from sar_compiler.tree.diagnostic import TreeError
from tests.analysis.verify.random_trees import random_tree
from tests.analysis.verify.stage import bound, simulated_tree
from tests.random_inputs import rounds
from tests.runtime.kernel.stage import FlatStage
from tests.runtime.kernel.stage import bound as bound_tree

pytestmark = pytest.mark.unmeasured

_TREES = rounds(40)
_MOST_STATES = 3000


def verify_binding(binding, *, forgets):
    """Return the verdicts with the lengths of their runs, and the number of states if the search is complete.

    A run with a loop has no length: with fewer states, a loop may be shorter.
    """
    result = verify(simulated_tree(binding), None, (), _MOST_STATES, forgets=forgets)
    answers = [(verdict.question, verdict.outcome, length_of(verdict.trace)) for verdict in result.verdicts]
    return answers, result.states if result.complete else None


def length_of(trace):
    return None if trace is None or trace.loop else len(trace.ticks)


def test_random_trees_have_same_verdicts_with_no_more_states():
    fewer = 0
    for seed in range(200, 200 + _TREES):
        try:
            binding = bound(random_tree(seed))
        except TreeError:
            continue
        (answers, states), (plain_answers, plain_states) = (
            verify_binding(binding, forgets=forgets) for forgets in (True, False)
        )
        if plain_states is None:
            continue
        assert answers == plain_answers, f"seed {seed}"
        assert states <= plain_states, f"seed {seed}"
        fewer += states < plain_states
    assert fewer > 0


@pytest.mark.parametrize(
    "body",
    [
        '<WhileDoElse><AlwaysSuccess _onSuccess="a := a + 1"/><Running/></WhileDoElse>',
        '<Parallel policy="SuccessOnAll" synchronise="true"><Script code="a := a + 1"/><Running/></Parallel>',
    ],
    ids=["a condition that is not reset", "a parallel that does not tick again what has succeeded"],
)
def test_outcome_is_kept_if_node_depends_on_it(body):
    stage = FlatStage(bound_tree(body), seed=1)
    assert any(node.heeds_end for node in stage.flat.nodes)
