"""Rules about nodes that no tick reaches, that never end, or that have no effect or an unintended effect."""

import itertools
import math
from collections.abc import Iterator, Sequence

from sar_compiler.checks.rules import CheckContext
from sar_compiler.checks.rules.outcome_analysis import PossibleOutcomes
from sar_compiler.nodes.binding.bound import BoundNode
from sar_compiler.nodes.outcome_sets import ALLOWED, RESULTS, F, K, R, S
from sar_compiler.nodes.semantics import Gate, Order
from sar_compiler.nodes.spec import Kind
from sar_compiler.tree.diagnostic import Diagnostic, Severity

_VERBS = {S: "succeeds", F: "fails", R: "runs"}


def check_reachability(context: CheckContext) -> Iterator[Diagnostic]:
    """Yield findings about nodes that no tick reaches, and about nodes that never end."""
    if not context.is_informative:
        return
    outcomes = context.outcomes
    for bound in outcomes.blocked:
        if bound not in context.nodes_with_errors:
            yield from _check_last_reachable(bound, outcomes)
    # The root of a tree may repeat forever, which is the usual way to keep a robot running.
    tops = {top.tree.root for top in context.bound_forest.tops}
    for bound in context.parents():
        if bound.spec.semantics.order is not Order.IN_ORDER:
            if bound not in tops or not bound.spec.semantics.repeats & S:
                yield from _check_endless(bound, outcomes)
            yield from _check_gates(bound, outcomes)


def _check_endless(bound: BoundNode, outcomes: PossibleOutcomes) -> Iterator[Diagnostic]:
    if outcomes.possible_results(bound) != R or any(
        outcomes.possible_results(child) == R for child in bound.children
    ):
        return
    child = bound.children[0]
    ends = bound.spec.semantics.end_results(bound) & ~K if len(bound.children) == 1 else 0
    why = f"'{child.name}' never {_VERBS[ends]}" if ends in _VERBS else "no child can end it"
    hint = f"change '{child.name}' so that '{bound.name}' can end, or remove <{bound.spec.tag}>"
    yield bound.element.finding("never-ends", f"'{bound.name}' never ends: {why}", hint=hint)


def _check_gates(bound: BoundNode, outcomes: PossibleOutcomes) -> Iterator[Diagnostic]:
    children, means = bound.children, bound.spec.semantics
    if means.rounds is not None and means.rounds(bound) == 0:
        yield _unreachable(children[0], f"'{bound.name}' ticks it 0 times")
    for number, gate in means.gates(bound).items():
        if number < len(children) and not any(
            outcomes.possible_results(children[each]) & gate.outcomes for each in gate.children
        ):
            yield _unreachable(children[number], _gate_reason(gate, children))


def _gate_reason(gate: Gate, children: Sequence[BoundNode]) -> str:
    """Return the reason why a child is never ticked: no other child returns a result that lets it start."""
    verb = _VERBS[gate.outcomes & ~K]
    if len(gate.children) > 1:
        return f"no earlier child ever {verb}"
    return f"'{children[gate.children[0]].name}' never {verb}"


def _check_last_reachable(bound: BoundNode, outcomes: PossibleOutcomes) -> Iterator[Diagnostic]:
    """Yield a finding about the first child that is never ticked because of its predecessor's results."""
    goes_on = bound.spec.semantics.goes_on
    for before, child in itertools.pairwise(bound.children):
        results = outcomes.possible_results(before)
        if not results & (goes_on | K):
            # `_check_endless` reports the nodes that unintentionally never end.
            if results != R or not before.children:
                yield _unreachable(child, f"the previous child '{before.name}' never {_VERBS[goes_on]}")
            return


def _unreachable(bound: BoundNode, why: str) -> Diagnostic:
    message = f"'{bound.name}' is never ticked: {why}"
    return bound.element.finding("unreachable-node", message, hint="move it, or delete it")


DEFAULT_PERIOD = 0.5
"""The default tick period in seconds, for missions that do not define a period."""
_NEVER = {F: "never fails", S: "never succeeds", R: "always ends in its first tick"}
"""For each status to which a decorator reacts, the words for a child that never returns this status."""


def check_needless_nodes(context: CheckContext) -> Iterator[Diagnostic]:
    """Yield findings about nodes that are not needed, or that prevent their children from working."""
    # Nodes that are not needed are not reported in trees that another program runs, and in trees with errors.
    is_own = context.is_complete and not context.is_foreign
    for bound in context.parents():
        if len(bound.children) == len(bound.element.children) == 1:
            needless = _needless_finding(bound, bound.children[0])
            if needless is None:
                yield from _check_decorator(bound, bound.children[0], context.outcomes)
            elif is_own and not bound.conditions and bound.oneshot is None:
                yield needless


def _check_decorator(bound: BoundNode, child: BoundNode, outcomes: PossibleOutcomes) -> Iterator[Diagnostic]:
    means = bound.spec.semantics
    never = _NEVER.get(means.changes & ~K)
    if never is not None and not outcomes.possible_results(child) & means.changes:
        message = f"'{bound.name}' has no effect: '{child.name}' {never}"
        hint = f"delete <{bound.element.tag}>, or move it"
        yield bound.element.finding("without-effect", message, hint=hint)
    elif means.limit_sec is not None:
        yield from _check_timeout(bound)
    elif means.changes == R:
        yield from _check_interrupting(bound, child, outcomes)
    elif means.repeats:
        yield from _check_one_shot(bound, child, outcomes)


def _needless_finding(bound: BoundNode, child: BoundNode) -> Diagnostic | None:
    means, hint = bound.spec.semantics, f"delete <{bound.element.tag}>"
    if means.order in (Order.IN_ORDER, Order.TOGETHER):
        why = f"its only child is '{child.name}'"
    elif _cancels_inner_decorator(bound, child) and not child.conditions:
        why, hint = f"it reverses the effect of '{child.name}'", "delete both"
    elif means.rounds is not None and means.rounds(bound) == 1:
        why = f"'{child.name}' is also executed once without this decorator"
    else:
        return None
    return bound.element.finding("needless-node", f"'{bound.name}' is not needed: {why}", hint=hint)


def _cancels_inner_decorator(bound: BoundNode, child: BoundNode) -> bool:
    """Return whether a decorator reverses the effect of the decorator that is its child."""
    once, twice = child.spec.semantics.possible, bound.spec.semantics.possible
    if once is None or twice is None or {bound.spec.kind, child.spec.kind} != {Kind.DECORATOR}:
        return False
    turned = tuple(once(child, [result], ALLOWED) for result in RESULTS)
    return turned != RESULTS and tuple(twice(bound, [result], ALLOWED) for result in turned) == RESULTS


def _check_interrupting(
    bound: BoundNode, child: BoundNode, outcomes: PossibleOutcomes
) -> Iterator[Diagnostic]:
    found = outcomes.find_leaf(child, outcomes.is_work)
    if found is not None:
        message = (
            f"{found.name} is interrupted in every tick in which it runs: '{bound.name}' ends in the same "
            "tick and restarts the node in the next tick"
        )
        hint = "let this node run for several ticks, and limit its time with a <Timeout>"
        yield bound.element.finding("interrupted-action", message, hint=hint)


def _check_one_shot(bound: BoundNode, child: BoundNode, outcomes: PossibleOutcomes) -> Iterator[Diagnostic]:
    """Yield a finding about a loop whose child is executed only once."""
    retries = bound.spec.semantics.repeats == F
    once, within = _find_one_shot(child)
    if once is None or (retries and not outcomes.possible_results(within) & F):
        return
    if retries and (once.oneshot or once.values.get("policy")) == "ON_SUCCESSFUL_COMPLETION":
        return
    message = f"'{bound.name}' has no effect: '{once.name}' runs only once, and then repeats its result"
    hint = f"move <{bound.element.tag}> below the node that runs once"
    yield bound.element.finding("without-effect", message, hint=hint)


def _find_one_shot(child: BoundNode) -> tuple[BoundNode | None, BoundNode]:
    if child.oneshot is not None:
        return child, child
    if child.spec.semantics.once and child.children:
        return child, child.children[0]
    return None, child


def _check_timeout(bound: BoundNode) -> Iterator[Diagnostic]:
    seconds = _limit_sec(bound)
    if seconds == math.inf:
        message = f"'{bound.name}' has no effect: msec=\"0\" is no limit"
        hint = f"write a time limit in msec, or delete <{bound.element.tag}>"
        yield bound.element.finding("without-effect", message, hint=hint)
    elif seconds is not None and seconds <= DEFAULT_PERIOD:
        message = (
            f"'{bound.name}' gives its child little more than one tick: the limit is {seconds:g} s, and the tree is ticked every "
            f"{DEFAULT_PERIOD:g} s by default (tick_rate_hz)"
        )
        yield bound.element.finding("short-timeout", message, hint="write a longer time")
    elif seconds is not None and (found := _find_long_wait(bound.children[0], seconds)) is not None:
        wait, spent = found
        own = wait.spec.semantics.wait_sec
        own_sec = own and own(wait)
        before = f" after {spent:g} s in earlier nodes" if spent else ""
        message = (
            f"'{bound.name}' always ends before '{wait.name}': '{wait.name}' waits {own_sec:g} s{before}, but the "
            f"limit is {seconds:g} s"
        )
        hint = f"write a limit above {spent + (own_sec or 0):g} s, or shorten the wait"
        yield bound.element.finding("short-timeout", message, hint=hint, severity=Severity.WARNING)
    else:
        yield from _check_inner_limits(bound, seconds)


def _find_long_wait(
    bound: BoundNode, limit_sec: float, spent_sec: float = 0
) -> tuple[BoundNode, float] | None:
    """Return the first waiting node that a time limit always halts, and the seconds before the node starts."""
    wait = bound.spec.semantics.wait_sec
    own_sec = (wait and wait(bound)) or 0
    if own_sec and spent_sec + own_sec >= limit_sec:
        return bound, spent_sec
    inside = (
        [bound.subtree.root]
        if bound.subtree is not None and bound.subtree.root is not None
        else bound.children
    )
    spent_sec += own_sec
    for child in inside:
        found = _find_long_wait(child, limit_sec, spent_sec)
        if found is not None:
            return found
        if _runs_through(bound):
            spent_sec += _least_sec(child)
    return None


def _least_sec(bound: BoundNode) -> float:
    """Return the minimum number of seconds that a node takes to succeed."""
    if bound.conditions or bound.oneshot is not None:
        return 0
    means = bound.spec.semantics
    own_sec = (means.wait_sec and means.wait_sec(bound)) or 0
    is_run = means.rounds is None or (means.rounds(bound) or 0) >= 1
    if _runs_through(bound) or (means.steady and is_run and not means.once and not means.changes & F):
        return own_sec + sum(map(_least_sec, bound.children))
    return own_sec


def _runs_through(bound: BoundNode) -> bool:
    """Return whether a node starts with its first child, and continues only after a child has succeeded."""
    means = bound.spec.semantics
    return means.is_sequence and not bound.is_reactive and not means.resumes


def _check_inner_limits(bound: BoundNode, seconds: float | None) -> Iterator[Diagnostic]:
    waiting = list(bound.children) if seconds is not None else []
    while waiting:
        inner = waiting.pop()
        limit = _limit_sec(inner)
        if limit is not None and seconds is not None and seconds <= limit < math.inf:
            message = (
                f"'{inner.name}' has no effect: its limit of {limit:g} s never expires before the limit of {seconds:g} s of "
                f"'{bound.name}'"
            )
            yield inner.element.finding(
                "without-effect", message, hint=f"write a shorter time, or delete <{inner.element.tag}>"
            )
        elif limit is None or limit == math.inf:
            waiting.extend(inner.children)


def _limit_sec(bound: BoundNode) -> float | None:
    limit = bound.spec.semantics.limit_sec
    return None if limit is None else limit(bound)
