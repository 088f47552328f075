"""How a node has ended is forgotten where each of its starts is as the first: nothing that is proved depends on it."""

import pytest

from sar_compiler.analysis.verify import verify
from sar_compiler.tree.diagnostic import TreeError
from tests.analysis.verify.random_trees import random_tree
from tests.analysis.verify.stage import bound, simulated_tree
from tests.chance import rounds
from tests.runtime.kernel.stage import FlatStage
from tests.runtime.kernel.stage import bound as bound_tree

pytestmark = pytest.mark.unmeasured

_TREES = rounds(40)
_MOST_STATES = 3000


def verified(binding, *, forgets):
    """Return the answers to all questions, with the lengths of their runs; and the number of states, if all were found.

    A run that goes round for ever is left without a length: the fewer states there are, the sooner one comes again.
    """
    result = verify(simulated_tree(binding), None, (), _MOST_STATES, forgets=forgets)
    answers = [(verdict.question, verdict.outcome, length_of(verdict.trace)) for verdict in result.verdicts]
    return answers, result.states if result.complete else None


def length_of(trace):
    return None if trace is None or trace.loop else len(trace.ticks)


def test_random_trees_have_the_same_answers_whether_it_is_forgotten_or_not_in_no_more_states():
    fewer = 0
    for seed in range(200, 200 + _TREES):
        try:
            binding = bound(random_tree(seed))
        except TreeError:
            continue
        (answers, states), (plain_answers, plain_states) = (
            verified(binding, forgets=forgets) for forgets in (True, False)
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
def test_it_is_not_forgotten_where_a_node_heeds_it(body):
    stage = FlatStage(bound_tree(body), seed=1)
    assert any(node.heeds_end for node in stage.flat.nodes)
