"""What the roots of small trees answer in all their runs, to hold the nodes' records against."""

import itertools
import random
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from py_trees.behaviour import Behaviour

from sar_compiler.checks.rules.check_context import CheckContext
from sar_compiler.checks.verify.exploring import explore
from sar_compiler.checks.verify.outcomes import WORDS
from sar_compiler.checks.verify.prepared import Prepared
from sar_compiler.checks.verify.properties import without_properties
from sar_compiler.checks.verify.stepping import State, TreeStepper
from sar_compiler.compiler import bind_main
from sar_compiler.compiler.rehearsal import rehearse
from sar_compiler.nodes.outcome_sets import BITS
from sar_compiler.nodes.registry import Registry, default_registry
from sar_compiler.nodes.semantics import Order
from sar_compiler.nodes.spec import Direction, Kind, NodeSpec, Parameter, Role
from sar_compiler.nodes.values import ConversionError, ValueType
from sar_compiler.runtime.expressions import Script
from tests.trees import forest_of

SUCCESS, FAILURE, RUNNING, SKIPPED = "SUCCESS", "FAILURE", "RUNNING", "SKIPPED"
SUBSETS = [
    subset
    for size in (1, 2, 3, 4)
    for subset in itertools.combinations((SUCCESS, FAILURE, RUNNING, SKIPPED), size)
]
"""Everything that a leaf can be able to answer."""
MOST_STATES = 3000
_SAMPLES = ("-1", "0", "1", "2", "true", "false", "SUCCESS", "FAILURE", "RUNNING", "SKIPPED", "1;2")


def _leaf_tag(outcomes: Sequence[str]) -> str:
    return "Leaf_" + "_".join(outcomes)


def _leaf(outcomes: Sequence[str]) -> NodeSpec:
    def init(self, name: str) -> None:
        Behaviour.__init__(self, name)

    tag = _leaf_tag(outcomes)
    return NodeSpec(tag, type(tag, (Behaviour,), {"__init__": init}), Kind.ACTION, frozenset(outcomes))


REGISTRY = Registry([*default_registry().specs(), *map(_leaf, SUBSETS)])
"""Everything that is installed, and a leaf for each set of answers."""


@dataclass(frozen=True)
class Form:
    """One way to write a node that has children.

    Attributes:
        spec: The node.
        attributes: What is written.
    """

    spec: NodeSpec
    attributes: tuple[tuple[str, str], ...]

    def text(self, children: Sequence[str]) -> str:
        written = "".join(f' {name}="{value}"' for name, value in self.attributes)
        return f"<{self.spec.tag}{written}>{''.join(children)}</{self.spec.tag}>"

    def count(self, wanted: int) -> int:
        """Return a number of children that it can have, as near to one as can be."""
        least, most = self.spec.child_count
        return max(least, min(wanted, wanted if most is None else most))

    @property
    def reads_keys(self) -> bool:
        """Whether what it does depends on the blackboard."""
        return _reads_keys(self.text([]))

    def __str__(self) -> str:
        return self.text([])


def forms() -> list[Form]:
    """Return ways to write every control and decorator: each attribute with every value that it takes of a few."""
    return [
        form
        for spec in default_registry()
        if not spec.kind.is_leaf and spec.tag != "ForEach"
        for form in _forms_of(spec)
    ]


def _forms_of(spec: NodeSpec) -> Iterator[Form]:
    samples = {p.name: _samples(p) for p in spec.parameters.values() if p.role is Role.ATTRIBUTE}
    samples = {name: texts for name, texts in samples.items() if name not in spec.fixed}
    usual = {p.name: samples[p.name][0] for p in spec.required}
    seen: set[tuple[tuple[str, str], ...]] = set()
    for name, text in [("", ""), *((name, text) for name, texts in samples.items() for text in texts)]:
        written = {**usual, **({name: text} if name else {})}
        if "selected" in written or ("policy" in spec.parameters and spec.semantics.order is Order.TOGETHER):
            written = {key: value for key, value in written.items() if key != "selected"}
            if written.get("policy") == "SuccessOnSelected" or (
                written.get("policy") == "SuccessOnOne" and "synchronise" in written
            ):
                continue
        if (attributes := tuple(written.items())) not in seen:
            seen.add(attributes)
            yield Form(spec, attributes)


def _samples(parameter: Parameter) -> list[str]:
    """Return a few texts for an attribute."""
    name, value_type = parameter.name, parameter.value_type
    told = {
        "entry": ["{entry}"],
        "variable": ["1", "2", "{v}"],
        **{f"case_{n}": [str(n)] for n in range(1, 7)},
    }
    is_input = parameter.direction is None or parameter.direction is Direction.INPUT
    if name in told or value_type is None or not is_input:
        return told.get(name, ["{item}"])
    if value_type.python is Script:
        return ["true", "false", "v == 1"]
    return list(value_type.choices)[:4] or [text for text in _SAMPLES if _is_value(text, value_type)]


def _is_value(text: str, value_type: ValueType) -> bool:
    try:
        value_type.convert(text)
    except ConversionError:
        return False
    return True


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


def _reads_keys(body: str) -> bool:
    return any(key in body for key in ("{v}", "{entry}", "v =="))


def answers_of(body: str) -> Answers | None:
    """Return what a tree answers; None where it does not mean anything, or one of its runs ends with an error."""
    if _reads_keys(body):
        body = _SURROUNDINGS.replace("{body}", body)
    forest = forest_of(f'<root BTCPP_format="4"><BehaviorTree ID="Main">{body}</BehaviorTree></root>')
    context = CheckContext(forest, REGISTRY)
    if not context.sound:
        return None
    root = context.trees[-1].root
    assert root is not None
    graph = explore(
        TreeStepper(Prepared.of(rehearse(bind_main(forest, REGISTRY), {})), without_properties().rules),
        MOST_STATES,
    )
    if graph.error is not None:
        return None
    seen = frozenset(WORDS[key.outcome] for key in graph.keys if isinstance(key, State)) - {""}
    return Answers(
        seen,
        _words(context.outcomes.may_return(root)),
        _words(context.outcomes.known_to_return(root)),
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
        for form in forms():
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
