"""Controls and decorators of a user's classes are ticked by their own methods, and what they remember is part of the state."""

import contextlib
import random

import pytest

from sar_compiler.nodes.registry import load_registry
from sar_compiler.compiler import bind_main
from sar_compiler.checks.verify import verify
from sar_compiler.checks.verify.verdicts import EVERY_LEAF
from sar_compiler.runtime.kernel.table import STOCK
from sar_compiler.tree.diagnostic import TreeError
from tests.checks.verify.random_trees import random_tree
from tests.checks.verify.stage import TAGS, bound, simulated_tree
from tests.checks.verify.test_same_as_py_trees import Explored
from tests.trees import forest

REGISTRY = load_registry(["tests.checks.verify.leaves", "tests.checks.verify.own_controls"])
_MOST_STATES = 2000


def as_foreign(simulated, seed):
    """Make some of py_trees' own composites and decorators objects of classes that nobody knows; return how many."""
    chance = random.Random(seed)  # noqa: S311 - the same in every run
    nodes = [node for node in simulated.root.iterate() if node.children and type(node) in STOCK]
    chosen = [node for node in nodes if chance.random() < 0.7]
    for node in chosen:
        node.__class__ = type(f"Own{type(node).__name__}", (type(node),), {})
    return len(chosen)


def seen(explored):
    """Return the ticks of a tree by what can be seen before and after them, and whether all were gone through."""
    graph = explored.graph
    states = [explored.looked_at(number) for number in range(len(graph.keys))]
    ticks = {
        (states[source], states[target], graph.ends[target])
        for source in range(graph.expanded)
        for target in graph.successors(source)
    }
    return ticks, graph.complete, graph.error is None


@pytest.mark.unmeasured
@pytest.mark.parametrize("seed", range(300, 380))
def test_a_class_that_does_as_py_trees_own_comes_to_the_same_states(seed):
    try:
        binding = bound(random_tree(seed))
    except TreeError:
        pytest.skip("the parts of this tree do not go together")
    known, foreign = simulated_tree(binding), simulated_tree(binding)
    as_foreign(foreign, seed)
    expected = seen(Explored(known, _MOST_STATES))
    # What a composite of py_trees remembers of its last child may tell states apart that look the same.
    assert not expected[1] or seen(Explored(foreign, 10 * _MOST_STATES)) == expected


def answers(body):
    """Return the answers about a tree, each with the number of ticks in which it is shown."""
    simulated = simulated_tree(bind_main(forest(body), REGISTRY))
    verification = verify(simulated, None, TAGS, _MOST_STATES)
    return {
        verdict.question: (verdict.outcome, verdict.trace and len(verdict.trace.ticks) - verdict.trace.loop)
        for verdict in verification.verdicts
    }


TWINS = ("Sequence", "Fallback", "ReactiveFallback")


@pytest.mark.unmeasured
@pytest.mark.parametrize("seed", range(400, 480))
def test_a_control_of_ones_own_has_the_answers_of_the_one_that_it_copies(seed):
    body = random_tree(seed)
    copies = body
    for tag in TWINS:
        copies = copies.replace(f"<{tag}", f"<Own{tag}").replace(f"</{tag}>", f"</Own{tag}>")
    with contextlib.suppress(TreeError):  # of the trees in which a child can be skipped
        found = answers(copies)
        assert found == answers(body)


PARTS = ("<X/>", "<Y/>", "<P/>", "<Inverter><P/></Inverter>", "<Fallback><X/><P/></Fallback>")


@pytest.mark.parametrize("first", PARTS)
@pytest.mark.parametrize("second", PARTS)
def test_a_recovery_has_the_answers_of_the_nodes_that_it_stands_for(first, second):
    known = f"<Fallback>{first}<Sequence>{second}{first}</Sequence></Fallback>"
    expected, found = answers(known), answers(f"<OwnRecovery>{first}{second}</OwnRecovery>")
    for each in (expected, found):
        del each[EVERY_LEAF]  # there are other leaves in them
    assert found == expected
