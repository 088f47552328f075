"""Nodes that can never be ticked, and nodes that can never end."""

import itertools
from collections.abc import Iterator, Sequence

from sar_compiler.checks.rules.check_context import CheckContext
from sar_compiler.checks.rules.outcome_analysis import PossibleOutcomes
from sar_compiler.nodes.binding.bound import BoundNode
from sar_compiler.nodes.outcome_sets import F, K, R, S
from sar_compiler.nodes.semantics import Gate, Order
from sar_compiler.tree.diagnostic import Diagnostic

_VERBS = {S: "succeeds", F: "fails", R: "runs"}


def check_reach(context: CheckContext) -> Iterator[Diagnostic]:
    """Yield nodes that no tick reaches, and nodes that never end."""
    if not context.is_telling:
        return
    outcomes = context.outcomes
    for bound in outcomes.blocked:
        if bound not in context.broken:
            yield from _after_the_last(bound, outcomes)
    # At the very top, what begins again after each success is how a robot is told never to stop.
    tops = {top.tree.root for top in context.bound.tops}
    for tree in context.trees:
        for bound in tree.parents:
            if bound.spec.semantics.order is not Order.IN_ORDER and bound not in context.broken:
                if bound not in tops or not bound.spec.semantics.repeats & S:
                    yield from _endless(bound, outcomes)
                yield from _unreached(bound, outcomes)


def _endless(bound: BoundNode, outcomes: PossibleOutcomes) -> Iterator[Diagnostic]:
    if outcomes.may_return(bound) != R or any(outcomes.may_return(child) == R for child in bound.children):
        return
    child = bound.children[0]
    ends = bound.spec.semantics.ends_by(bound) & ~K if len(bound.children) == 1 else 0
    why = f"'{child.name}' never {_VERBS[ends]}" if ends in _VERBS else "nothing in it can end it"
    hint = f"let '{child.name}' be able to end it, or take <{bound.spec.tag}> away"
    yield bound.element.finding("never-ends", f"'{bound.name}' never ends: {why}", hint=hint)


def _unreached(bound: BoundNode, outcomes: PossibleOutcomes) -> Iterator[Diagnostic]:
    children, means = bound.children, bound.spec.semantics
    if means.rounds is not None and means.rounds(bound) == 0:
        yield _unreachable(children[0], f"'{bound.name}' ticks it 0 times")
    for number, gate in means.gates(bound).items():
        if number < len(children) and not _opens(gate, children, outcomes):
            yield _unreachable(children[number], _shut(gate, children))


def _opens(gate: Gate, children: Sequence[BoundNode], outcomes: PossibleOutcomes) -> bool:
    return any(outcomes.may_return(children[number]) & gate.answers for number in gate.children)


def _shut(gate: Gate, children: Sequence[BoundNode]) -> str:
    """Return why a child is never ticked, if it is ticked only after certain results of others."""
    verb = _VERBS[gate.answers & ~K]
    if len(gate.children) > 1:
        return f"what is tried before it never {verb}"
    return f"'{children[gate.children[0]].name}' never {verb}"


def _after_the_last(bound: BoundNode, outcomes: PossibleOutcomes) -> Iterator[Diagnostic]:
    """Yield the first child after one whose results never let a tick continue to the next."""
    goes_on = bound.spec.semantics.goes_on
    for before, child in itertools.pairwise(bound.children):
        answers = outcomes.may_return(before)
        if not answers & (goes_on | K):
            # `_endless` reports nodes that never end by mistake.
            if answers != R or not before.children:
                yield _unreachable(child, f"'{before.name}' before it never {_VERBS[goes_on]}")
            return


def _unreachable(bound: BoundNode, why: str) -> Diagnostic:
    message = f"'{bound.name}' is never ticked: {why}"
    return bound.element.finding("unreachable-node", message, hint="put it elsewhere, or delete it")
