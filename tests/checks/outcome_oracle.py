"""Compute the outcomes of the roots of small trees in all their runs, to compare them with the outcome records of the nodes."""

import itertools
import random
from collections.abc import Sequence
from dataclasses import dataclass

from py_trees.behaviours import Dummy

from sar_compiler.analysis.simulated_tree import compile_simulated
from sar_compiler.analysis.state_search.searching import explore
from sar_compiler.analysis.verify.properties import without_properties
from sar_compiler.analysis.verify.state import PreparedTree
from sar_compiler.analysis.verify.stepping import TreeStepper
from sar_compiler.checks.rules import CheckContext
from sar_compiler.compiler import bind_main
from sar_compiler.nodes.outcome_sets import BITS
from sar_compiler.nodes.registry import Registry, load_registry
from sar_compiler.nodes.spec import Kind, NodeSpec
from sar_compiler.runtime.kernel.cells import WORDS
from tests.node_forms import Form, forms, reads_keys
from tests.trees import forest_of

SUCCESS, FAILURE, RUNNING, SKIPPED = "SUCCESS", "FAILURE", "RUNNING", "SKIPPED"
SUBSETS = [
    subset
    for size in (1, 2, 3, 4)
    for subset in itertools.combinations((SUCCESS, FAILURE, RUNNING, SKIPPED), size)
]
"""The possible sets of a leaf's outcomes."""
MOST_STATES = 3000


def _leaf_tag(outcomes: Sequence[str]) -> str:
    return "Leaf_" + "_".join(outcomes)


def _leaf(outcomes: Sequence[str]) -> NodeSpec:
    def init(self, name: str) -> None:
        Dummy.__init__(self, name)

    tag = _leaf_tag(outcomes)
    return NodeSpec(tag, type(tag, (Dummy,), {"__init__": init}), Kind.ACTION, frozenset(outcomes))


REGISTRY = Registry([*load_registry(palettes=["nav2:main"]).specs(), *map(_leaf, SUBSETS)])
"""The installed nodes, the nodes of Nav2, and a leaf for each set of outcomes."""


def leaf(outcomes: Sequence[str], name: str) -> str:
    """Return a leaf that can return these outcomes."""
    return f'<{_leaf_tag(outcomes)} name="{name}"/>'


@dataclass(frozen=True)
class RootOutcomes:
    """The outcomes of the root of a tree.

    Attributes:
        seen: The outcomes in any of its runs.
        may: The outcomes that the records allow.
        known: The outcomes that are certainly possible according to the records.
        complete: Whether every run was seen.
    """

    seen: frozenset[str]
    may: frozenset[str]
    known: frozenset[str]
    complete: bool


# In every tick, v and entry have other values. The whole tree returns the outcome of the body in WhileDoElse.
_SURROUNDINGS = """<WhileDoElse>
<Sequence>
<ForceSuccess><Leaf_SUCCESS_FAILURE _onSuccess="v := 0" _onFailure="v := 1"/></ForceSuccess>
<ForceSuccess><Leaf_SUCCESS_FAILURE _onSuccess="v = v + 2; entry := v"/></ForceSuccess>
<ForceSuccess><Leaf_SUCCESS_FAILURE _onSuccess="v = v + 4"/></ForceSuccess>
</Sequence>
{body}
</WhileDoElse>"""


def outcomes_of(body: str) -> RootOutcomes | None:
    """Return the outcomes of a tree; None if the tree is invalid, or if one of its runs ends with an error."""
    if reads_keys(body):
        body = _SURROUNDINGS.replace("{body}", body)
    forest = forest_of(f'<root BTCPP_format="4"><BehaviorTree ID="Main">{body}</BehaviorTree></root>')
    context = CheckContext(forest, REGISTRY)
    if not context.is_complete:
        return None
    root = context.trees[-1].root
    assert root is not None
    prepared = PreparedTree.prepare(compile_simulated(bind_main(forest, REGISTRY), {}))
    stepper = TreeStepper(prepared, without_properties().rules)
    graph = explore(stepper.steps, MOST_STATES)
    if graph.error is not None:
        return None
    seen = frozenset(WORDS[stepper.steps.restore(key)[0]] for key in graph.states) - {""}
    return RootOutcomes(
        seen,
        _words(context.outcomes.possible_results(root)),
        _words(context.outcomes.certain_results(root)),
        graph.complete,
    )


def _words(bits: int) -> frozenset[str]:
    return frozenset(word for word, bit in BITS.items() if bits & bit)


class RandomTrees:
    """Random trees of all controls and decorators.

    At most one node of a tree reads keys, because all keys have the same source.

    Args:
        seed: The seed of the random generator.
    """

    def __init__(self, seed: int) -> None:
        self._draw = random.Random(seed)  # noqa: S311 - the same trees in every run
        self._forms: dict[str, list[Form]] = {}
        for form in forms(REGISTRY):
            self._forms.setdefault(form.spec.tag, []).append(form)
        self._number = itertools.count()
        self._reads_keys = False

    def tree(self, depth: int) -> str:
        """Return a tree of nested nodes, with at most `depth` nodes around each leaf."""
        self._reads_keys = False
        return self._node(depth)

    def _node(self, depth: int) -> str:
        if depth == 0:
            return leaf(self._draw.choice(SUBSETS), f"leaf{next(self._number)}")
        of_tag = self._forms[self._draw.choice(list(self._forms))]
        form = self._draw.choice(
            [form for form in of_tag if not (self._reads_keys and form.reads_keys)] or of_tag
        )
        if form.reads_keys and self._reads_keys:
            return self._node(depth)
        self._reads_keys = self._reads_keys or form.reads_keys
        is_control = form.spec.kind is Kind.CONTROL
        below = [self._draw.randint(0, depth - 1) if is_control else depth - 1 for _ in range(form.count(2))]
        return form.text([self._node(each) for each in below])
