"""Stand-ins for controls and decorators that only a model describes, or of which only their own methods know what they do."""

import math
from collections.abc import Callable, Mapping
from functools import partial

from py_trees import decorators
from py_trees.behaviour import Behaviour

from sar_compiler.errors import UndecidableError
from sar_compiler.nodes.binding.bound import Binding, BoundNode
from sar_compiler.nodes.binding.skips import by_itself
from sar_compiler.nodes.outcome_sets import ALLOWED, BITS, F, R, S
from sar_compiler.nodes.palettes import palettes_with
from sar_compiler.nodes.semantics import Order, Semantics
from sar_compiler.nodes.spec import Kind, NodeSpec
from sar_compiler.runtime import stock
from sar_compiler.runtime.clock import Clock
from sar_compiler.runtime.kernel.table import is_known_class
from sar_compiler.runtime.kernel.timing import TimeoutNode
from sar_compiler.runtime.kernel.turning import SubTreeNode, TurningNode
from sar_compiler.runtime.parents import OwnDecorator, behaviour_class
from sar_compiler.runtime.ports import Input
from sar_compiler.tree.diagnostic import Diagnostic

Substitute = Callable[..., Behaviour]
"""Makes a stand-in, given its `name`, and its `children` or its `child`."""


class OnlyDescribedError(UndecidableError):
    """A tree has controls or decorators of which nobody here knows when they tick their children, without stand-ins.

    Attributes:
        findings: Where they are.
    """

    def __init__(self, nodes: list[BoundNode]) -> None:
        self.findings = tuple(map(_finding, {node.spec.tag: node for node in reversed(nodes)}.values()))[::-1]
        super().__init__("\n".join(finding.render() for finding in self.findings))


def _finding(bound: BoundNode) -> Diagnostic:
    tag, element = bound.spec.tag, bound.element
    replace = (
        f"say in the scenario or the file of properties which node replaces it: controls: {{{tag}: ...}}"
    )
    if not bound.spec.is_foreign:
        message = (
            f"<{tag}> has methods of its own ({bound.spec.maker_path.replace(':', '.')}), and its record does not say exactly when it ticks "
            "its children"
        )
        hint = f"derive it from sar_compiler.{bound.spec.kind.value}, with begin and resume; or register it with semantics; or {replace}"
        return element.finding("only-described", message, hint=hint)
    message = f"<{tag}> is only described by a model, and when it ticks its children is not known"
    palettes = " or ".join(palettes_with(tag))
    known = f", or the palette that knows it (--model {palettes})" if palettes else ""
    hint = f"load the module that has it (--nodes PKG.MOD){known}; or {replace}"
    return element.finding("only-described", message, hint=hint)


def described_parents(binding: Binding) -> list[BoundNode]:
    """Return the controls and decorators of a tree that only a model describes."""
    return [node for node in binding.nodes() if node.spec.is_only_described and not node.spec.kind.is_leaf]


def self_ticking_parents(binding: Binding) -> list[BoundNode]:
    """Return the controls and decorators of a tree with py_trees classes of somebody's own, whose methods say all that they do."""
    return [
        node
        for node in binding.nodes()
        if not node.spec.kind.is_leaf and node.spec.cls is not None and not is_known_class(node.spec.cls)
    ]


def by_semantics(bound: BoundNode, clock: Clock) -> Substitute | None:
    """Return what does exactly what the semantics of a node say; None if these leave anything open.

    Args:
        bound: The node, without children that can be skipped.
        clock: Measures time.
    """
    means = bound.spec.semantics
    if means.possible is None or means.once or bound.spec.references:
        return None
    if bound.spec.kind is Kind.CONTROL:
        return _in_order(bound, means)
    if means.limit_sec is not None:
        limit = means.limit_sec(bound)
        return None if limit is None else _limit(clock, limit)
    if means.repeats:
        rounds = means.rounds and means.rounds(bound)
        return partial(_repeat, means.repeats, rounds) if rounds else None
    return _turning(bound, means)


def _in_order(bound: BoundNode, means: Semantics) -> Substitute | None:
    assert means.possible is not None  # noqa: S101 - the caller has seen to it
    if means.order is not Order.IN_ORDER:
        return None
    pauses = means.possible(bound, [means.goes_on] * len(bound.children), ALLOWED) & R
    if means.resumes:
        return stock.SequenceWithMemory if means.is_sequence else None
    if pauses:
        return stock.AsyncSequence if means.is_sequence else stock.AsyncFallback
    cls = stock.Sequence if means.is_sequence else stock.Fallback
    return partial(cls, memory=not bound.is_reactive)


def _turning(bound: BoundNode, means: Semantics) -> Substitute | None:
    assert means.possible is not None  # noqa: S101 - the caller has seen to it
    words = {bit: word for word, bit in BITS.items()}
    turned = [words.get(means.possible(bound, [answer], ALLOWED)) for answer in (S, F, R)]
    if not means.steady or turned[2] != "RUNNING" or None in turned:
        return None
    return partial(behaviour_class(OwnDecorator, TurningNode), turned=(*turned[:2], "SKIPPED"))


def _limit(clock: Clock, seconds: float) -> Substitute:
    if seconds == math.inf:
        return behaviour_class(OwnDecorator, SubTreeNode)
    msec = Input(source=int(1000 * seconds))
    return partial(behaviour_class(OwnDecorator, TimeoutNode), msec=msec, clock=clock)


def _repeat(again: int, rounds: float, name: str, child: Behaviour) -> Behaviour:
    count = -1 if rounds == math.inf else int(rounds)
    return decorators.Retry(name, child, count) if again == F else decorators.Repeat(name, child, count)


def put_in_place(binding: Binding, controls: Mapping[str, NodeSpec]) -> None:
    """Put other nodes in the place of some, with the defaults of their attributes.

    Args:
        binding: The tree, which is changed.
        controls: The stand-in for each tag; it can have the children of all nodes with that tag.
    """
    for tree in binding.trees():
        for node in tree.nodes:
            if node.spec.tag in controls:
                node.spec, node.values, node.keys = controls[node.spec.tag], {}, {}
                tree.skips = tree.skips or by_itself(node)
