"""What can never be ticked, and what can never end."""

import itertools
from collections.abc import Iterator, Sequence

from sar_compiler.checks.rules.natures import ORDERED, SEQUENCES, Natures
from sar_compiler.checks.rules.outcomes import F, K, R, S, number
from sar_compiler.checks.rules.subject import Subject, warning
from sar_compiler.nodes.bound import BoundNode
from sar_compiler.tree.diagnostic import Diagnostic

_STATUS_NAMES = {S: "succeeds", F: "fails"}
_NO_END: dict[str, str] = {
    "Repeat": "fails",
    "KeepRunningUntilFailure": "fails",
    "SuccessIsRunning": "fails",
    "RetryUntilSuccessful": "succeeds",
    "FailureIsRunning": "succeeds",
}
"""What the child of a decorator must do so that it can end."""


def check_reach(subject: Subject) -> Iterator[Diagnostic]:
    """Yield nodes that no tick comes to, and nodes that run for ever."""
    if not subject.is_telling:
        return
    natures = subject.natures
    for bound in natures.blocked:
        if bound not in subject.broken:
            yield from _behind(bound.children, S if bound.spec.tag in SEQUENCES else F, natures)
    for tree in subject.trees:
        for bound in tree.parents:
            if bound.spec.tag not in ORDERED and bound not in subject.broken:
                yield from _endless(bound, natures)
                yield from _unreached(bound, natures)


def _endless(bound: BoundNode, natures: Natures) -> Iterator[Diagnostic]:
    if natures.may(bound) != R or any(natures.may(child) == R for child in bound.children):
        return
    child, tag = bound.children[0], bound.spec.tag
    why = f"'{child.name}' never {_NO_END[tag]}" if tag in _NO_END else "nothing in it can end it"
    if tag == "Condition":
        why = f"'{child.name}' never answers {bound.values.get('status')}"
    message = f"'{bound.name}' never ends: {why}"
    yield warning(
        "never-ends", message, bound, hint=f"let '{child.name}' be able to end it, or take <{tag}> away"
    )


def _unreached(bound: BoundNode, natures: Natures) -> Iterator[Diagnostic]:
    tag, children = bound.spec.tag, bound.children
    if (
        tag == "TryCatch"
        and bound.values.get("catch_on_halt") is not True
        and "catch_on_halt" not in bound.keys
    ):
        if len(children) > 1 and not any(natures.may(child) & F for child in children[:-1]):
            yield _unreachable(children[-1], "what is tried before it never fails")
    elif tag in ("IfThenElse", "WhileDoElse"):
        for branch, outcome in zip(children[1:], (S, F), strict=False):
            if not natures.may(children[0]) & outcome:
                yield _unreachable(branch, f"'{children[0].name}' never {_STATUS_NAMES[outcome]}")
    elif tag in ("Repeat", "RetryUntilSuccessful"):
        count = number(bound, "num_cycles", "num_attempts")
        if children and count is not None and (count == 0 or count < -1):
            yield _unreachable(children[0], f"'{bound.name}' ticks it {count} times")


def _behind(children: Sequence[BoundNode], passing: int, natures: Natures) -> Iterator[Diagnostic]:
    """Yield the first child behind one that never answers so that a tick goes on to the next."""
    for before, child in itertools.pairwise(children):
        answers = natures.may(before)
        if not answers & (passing | K):
            # Of what runs for ever by a mistake, `_endless` speaks.
            if answers != R or not before.children:
                yield _unreachable(child, f"'{before.name}' before it never {_STATUS_NAMES[passing]}")
            return


def _unreachable(bound: BoundNode, why: str) -> Diagnostic:
    message = f"'{bound.name}' is never ticked: {why}"
    return warning("unreachable-node", message, bound, hint="put it elsewhere, or delete it")
