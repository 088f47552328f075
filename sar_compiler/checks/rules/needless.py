"""Nodes that do nothing, or not what they are for."""

from collections.abc import Iterator, Mapping

from py_trees.common import OneShotPolicy

from sar_compiler.checks.rules.natures import ORDERED, PARALLELS, Natures
from sar_compiler.checks.rules.outcomes import F, K, R, S, number
from sar_compiler.checks.rules.subject import Subject, information, warning
from sar_compiler.nodes.bound import BoundNode
from sar_compiler.tree.diagnostic import Diagnostic

DEFAULT_PERIOD = 0.5
"""Seconds between two ticks, where the mission says nothing."""
_MILLISECONDS = 1000.0

_NEEDS: Mapping[str, tuple[int, str]] = {
    "Retry": (F, "never fails"),
    "RetryUntilSuccessful": (F, "never fails"),
    "ForceSuccess": (F, "never fails"),
    "FailureIsSuccess": (F, "never fails"),
    "FailureIsRunning": (F, "never fails"),
    "Repeat": (S | K, "never succeeds"),
    "ForceFailure": (S, "never succeeds"),
    "SuccessIsFailure": (S, "never succeeds"),
    "SuccessIsRunning": (S, "never succeeds"),
    "KeepRunningUntilFailure": (S | K, "never succeeds"),
    "Timeout": (R, "always ends in its first tick"),
    "RunningIsSuccess": (R, "always ends in its first tick"),
    "RunningIsFailure": (R, "always ends in its first tick"),
}
"""What the child of a decorator must be able to answer, or the decorator has no effect."""
_INTERRUPTING = frozenset({"RunningIsSuccess", "RunningIsFailure"})
_ROUNDS = frozenset({"Repeat", "Retry", "RetryUntilSuccessful", "KeepRunningUntilFailure"})
_GROUPS = ORDERED | PARALLELS


def check_needless(subject: Subject) -> Iterator[Diagnostic]:
    """Yield nodes that could as well not be there, or that spoil what is in them."""
    # Of trees that are flown by another program, or with mistakes still in them, nothing is said in passing.
    is_own = subject.sound and not subject.is_foreign
    for tree in subject.trees:
        for bound in tree.parents:
            if len(bound.children) == 1 and len(bound.element.children) == 1 and bound not in subject.broken:
                needless = _needless(bound, bound.children[0])
                if needless is None:
                    yield from _of_one(bound, bound.children[0], subject.natures)
                elif is_own and not bound.conditions and bound.oneshot is None:
                    yield needless


def _of_one(bound: BoundNode, child: BoundNode, natures: Natures) -> Iterator[Diagnostic]:
    tag = bound.spec.tag
    if tag in _NEEDS and not natures.may(child) & _NEEDS[tag][0]:
        message = f"'{bound.name}' has no effect: '{child.name}' {_NEEDS[tag][1]}"
        yield warning(
            "without-effect", message, bound, hint=f"delete <{bound.element.tag}>, or put it elsewhere"
        )
    elif tag in _INTERRUPTING:
        yield from _interrupting(bound, child, natures)
    elif tag in _ROUNDS:
        yield from _spent(bound, child, natures)
    elif tag == "Timeout":
        yield from _timeout(bound)


def _needless(bound: BoundNode, child: BoundNode) -> Diagnostic | None:
    tag, hint = bound.spec.tag, f"delete <{bound.element.tag}>"
    if tag in _GROUPS:
        why = f"there is only '{child.name}' in it"
    elif tag == "Inverter" and child.spec.tag == "Inverter" and not child.conditions:
        why, hint = f"it takes back what '{child.name}' does", "delete both"
    elif _is_once(bound):
        why = "a single time is what a node is ticked without it"
    else:
        return None
    return information("needless-node", f"'{bound.name}' is not needed: {why}", bound, hint=hint)


def _is_once(bound: BoundNode) -> bool:
    failures = number(bound, "num_failures")
    attempts = number(bound, "num_cycles", "num_success", "num_attempts")
    return attempts == 1 or (failures is not None and failures <= 1)


def _interrupting(bound: BoundNode, child: BoundNode, natures: Natures) -> Iterator[Diagnostic]:
    found = natures.anywhere(child, natures.is_work)
    if found is not None:
        message = (
            f"{found.name} is interrupted in every tick in which it runs: '{bound.name}' ends, and what ends is "
            "started anew in the next tick"
        )
        hint = "let it run; a <Timeout> around it limits how long"
        yield warning("interrupted-action", message, bound, hint=hint)


def _spent(bound: BoundNode, child: BoundNode, natures: Natures) -> Iterator[Diagnostic]:
    """Yield rounds around something that is done only once."""
    retries = bound.spec.tag in ("Retry", "RetryUntilSuccessful")
    once, within = _done_once(child)
    if once is None or (retries and not natures.may(within) & F):
        return
    if retries and (once.oneshot or once.values.get("policy")) is OneShotPolicy.ON_SUCCESSFUL_COMPLETION:
        return
    message = f"'{bound.name}' has no effect: '{once.name}' is done once in the whole run, and then only repeats its answer"
    yield warning("without-effect", message, bound, hint=f"put <{bound.element.tag}> into what is done once")


def _done_once(child: BoundNode) -> tuple[BoundNode | None, BoundNode]:
    if child.oneshot is not None:
        return child, child
    if child.spec.tag in ("OneShot", "RunOnce") and child.children:
        return child, child.children[0]
    return None, child


def _timeout(bound: BoundNode) -> Iterator[Diagnostic]:
    seconds = time_limit(bound)
    if number(bound, "msec") == 0:
        message = f"'{bound.name}' has no effect: msec=\"0\" is no limit"
        yield warning("without-effect", message, bound, hint="write how long it may take, or delete it")
    elif seconds is not None and seconds <= DEFAULT_PERIOD:
        message = (
            f"'{bound.name}' gives its child hardly more than one tick: {seconds:g} s, where the tree is ticked every "
            f"{DEFAULT_PERIOD:g} s unless tick_rate_hz says otherwise"
        )
        yield information("short-timeout", message, bound, hint="write a longer time")
    else:
        yield from _longer_inside(bound, seconds)


def _longer_inside(bound: BoundNode, seconds: float | None) -> Iterator[Diagnostic]:
    waiting = list(bound.children) if seconds is not None else []
    while waiting:
        inner = waiting.pop()
        limit = time_limit(inner)
        if limit is not None and seconds is not None and limit >= seconds:
            message = (
                f"'{inner.name}' has no effect: its {limit:g} s are never over before the {seconds:g} s of "
                f"'{bound.name}' around it"
            )
            yield warning("without-effect", message, inner, hint="write a shorter time, or delete it")
        elif limit is None:
            waiting.extend(inner.children)


def time_limit(bound: BoundNode) -> float | None:
    """Return how long the child of a Timeout may take, in seconds; None for another node, or where it is a key."""
    if bound.spec.tag != "Timeout":
        return None
    milliseconds = number(bound, "msec")
    return milliseconds / _MILLISECONDS if milliseconds else number(bound, "duration")
