"""What the roots of small trees answer in all their runs, to hold the nodes' records against."""

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
"""Everything that a leaf can be able to answer."""
MOST_STATES = 3000


def _leaf_tag(outcomes: Sequence[str]) -> str:
    return "Leaf_" + "_".join(outcomes)


def _leaf(outcomes: Sequence[str]) -> NodeSpec:
    def init(self, name: str) -> None:
        Dummy.__init__(self, name)

    tag = _leaf_tag(outcomes)
    return NodeSpec(tag, type(tag, (Dummy,), {"__init__": init}), Kind.ACTION, frozenset(outcomes))


REGISTRY = Registry([*load_registry(palettes=["nav2:main"]).specs(), *map(_leaf, SUBSETS)])
"""Everything that is installed, the nodes of Nav2, and a leaf for each set of answers."""


def leaf(outcomes: Sequence[str], name: str) -> str:
    """Return a leaf that can answer these."""
    return f'<{_leaf_tag(outcomes)} name="{name}"/>'


@dataclass(frozen=True)
class Answers:
    """What the root of a tree answers.

    Attributes:
        seen: In any of its runs.
        may: What the records allow.
        known: What the records say is certainly possible.
        complete: Whether every run was seen.
    """

    seen: frozenset[str]
    may: frozenset[str]
    known: frozenset[str]
    complete: bool


# Whoever reads v or entry finds other values in every tick. What stands in WhileDoElse answers what the whole does.
_SURROUNDINGS = """<WhileDoElse>
<Sequence>
<ForceSuccess><Leaf_SUCCESS_FAILURE _onSuccess="v := 0" _onFailure="v := 1"/></ForceSuccess>
<ForceSuccess><Leaf_SUCCESS_FAILURE _onSuccess="v = v + 2; entry := v"/></ForceSuccess>
<ForceSuccess><Leaf_SUCCESS_FAILURE _onSuccess="v = v + 4"/></ForceSuccess>
</Sequence>
{body}
</WhileDoElse>"""


def outcomes_of(body: str) -> Answers | None:
    """Return what a tree answers; None where it does not mean anything, or one of its runs ends with an error."""
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
    return Answers(
        seen,
        _words(context.outcomes.possible_results(root)),
        _words(context.outcomes.certain_results(root)),
        graph.complete,
    )


def _words(bits: int) -> frozenset[str]:
    return frozenset(word for word, bit in BITS.items() if bits & bit)


class RandomTrees:
    """Trees by chance, of every control and decorator; in each at most one node reads keys, which all have one source.

    Args:
        seed: What they depend on.
    """

    def __init__(self, seed: int) -> None:
        self._draw = random.Random(seed)  # noqa: S311 - the same trees in every run
        self._forms: dict[str, list[Form]] = {}
        for form in forms(REGISTRY):
            self._forms.setdefault(form.spec.tag, []).append(form)
        self._number = itertools.count()
        self._reads_keys = False

    def tree(self, depth: int) -> str:
        """Return a tree of nodes in nodes, at most so many of them around each leaf."""
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
