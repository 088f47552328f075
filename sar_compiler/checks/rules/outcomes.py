"""What a node makes of its children's answers, for each control and decorator of the language.

Answers are sets in the bits of a number. Each function takes a node, the sets of its children, and what is to be
added where more depends on than the children: everything for what a node may answer, nothing for what it is known
to be able to answer.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import TypeAlias

from sar_compiler.nodes.bound import BoundNode

S, F, R, K = 1, 2, 4, 8
"""SUCCESS, FAILURE, RUNNING and skipped."""
ALL = S | F | R | K
BITS: Mapping[str, int] = {"SUCCESS": S, "FAILURE": F, "RUNNING": R, "SKIPPED": K}

Outcomes: TypeAlias = Callable[[BoundNode, Sequence[int], int], int]

_AND_ELSE = 3


def sequence(children: Sequence[int]) -> int:
    """Return what a sequence answers; what stands behind a child that never succeeds counts for nothing."""
    ends = S if any(child & S for child in children) else 0
    found = 0
    for child in children:
        found |= child & (F | R)
        if not child & (S | K):
            return found
    return found | ends | (K if all(child & K for child in children) else 0)


def swapped(outcomes: int) -> int:
    """Return a set with success for failure and the other way round."""
    return outcomes & (R | K) | (F if outcomes & S else 0) | (S if outcomes & F else 0)


def instead(outcomes: int, old: int, new: int) -> int:
    """Return a set with one answer in the place of others."""
    return (outcomes & ~old) | new if outcomes & old else outcomes


def _sequence(_bound: BoundNode, children: Sequence[int], _more: int) -> int:
    return sequence(children)


def _selector(_bound: BoundNode, children: Sequence[int], _more: int) -> int:
    return swapped(sequence([swapped(child) for child in children]))


def _pausing(outcomes: Outcomes) -> Outcomes:
    """Return the same for a node that answers RUNNING between its children."""

    def pausing(bound: BoundNode, children: Sequence[int], more: int) -> int:
        return outcomes(bound, children, more) | (R if len(children) > 1 else 0)

    return pausing


def _parallel(bound: BoundNode, children: Sequence[int], more: int) -> int:
    together = _union(children)
    if "policy" not in bound.spec.parameters:
        skipped = K if all(child & K for child in children) else 0
        found = together & (F | R) | (S if together & (S | K) else 0) | (R if together & K else 0) | skipped
        return found | (more if bound.values or bound.keys else 0)
    if "policy" not in bound.values:
        return together | more
    on_all = bound.values["policy"] == "SuccessOnAll"
    succeeds = all(child & S for child in children) if on_all else together & S
    stays = more & R if not on_all or bound.values.get("synchronise") is False else 0
    return together & (F | R) | (S if succeeds else 0) | stays


def _either(bound: BoundNode, children: Sequence[int], more: int) -> int:
    """Return what `IfThenElse` and `WhileDoElse` answer."""
    if len(children) < _AND_ELSE - 1 or bound.element.children[_AND_ELSE:]:
        return more
    asked, otherwise = children[0], children[2] if len(children) == _AND_ELSE else F
    found = asked & (R | K)
    return found | (children[1] if asked & S else 0) | (otherwise if asked & F else 0)


def _switch(_bound: BoundNode, children: Sequence[int], _more: int) -> int:
    return _union(children)


def _try(_bound: BoundNode, children: Sequence[int], more: int) -> int:
    if len(children) < len(("try", "catch")):
        return more
    tried = sequence(children[:-1])
    return tried | (children[-1] & R if tried & F else 0)


def _passing(_bound: BoundNode, children: Sequence[int], more: int) -> int:
    return children[0] if children else more


def _adding(added: int) -> Outcomes:
    """Return what a decorator answers that has an answer of its own besides its child's."""

    def adding(_bound: BoundNode, children: Sequence[int], more: int) -> int:
        return children[0] | added if children else more

    return adding


def _replacing(old: int, new: int) -> Outcomes:
    def replacing(_bound: BoundNode, children: Sequence[int], more: int) -> int:
        return instead(children[0], old, new) if children else more

    return replacing


def _inverter(_bound: BoundNode, children: Sequence[int], more: int) -> int:
    return swapped(children[0]) if children else more


def number(bound: BoundNode, *names: str) -> float | None:
    """Return the first of some attributes that is written as a number."""
    found = (bound.values.get(name) for name in names)
    return next((value for value in found if isinstance(value, (int, float))), None)


def _repeat(bound: BoundNode, children: Sequence[int], more: int) -> int:
    return _rounds(number(bound, "num_cycles"), number(bound, "num_success"), children, more)


def _retry(bound: BoundNode, children: Sequence[int], more: int) -> int:
    failures = number(bound, "num_failures")
    if failures is not None:
        failures = max(failures, 1)  # one or less: with the first one
    children = [swapped(child) for child in children]
    return swapped(_rounds(number(bound, "num_attempts"), failures, children, swapped(more)))


def _rounds(own: float | None, stock: float | None, children: Sequence[int], more: int) -> int:
    """Return what `Repeat` answers; *own* is the count of BehaviorTree.CPP's, *stock* that of py_trees'."""
    if not children or (own is None and stock is None):
        return more
    child, count = children[0], own if own is not None else stock
    if own is not None and (own == 0 or own < -1):
        return S
    if count == 1:
        return child
    again = R if child & S else 0
    return (child if count is not None and count > 1 else child & ~S) | again


def _timeout(bound: BoundNode, children: Sequence[int], more: int) -> int:
    if not children:
        return more
    return children[0] | (F if children[0] & R and bound.values.get("msec") != 0 else 0)


def _delay(bound: BoundNode, children: Sequence[int], more: int) -> int:
    if not children:
        return more
    return children[0] | (more if "delay_msec" in bound.keys else R if number(bound, "delay_msec") else 0)


def _run_once(bound: BoundNode, children: Sequence[int], more: int) -> int:
    skips = K if bound.values.get("then_skip") is not False else 0
    return children[0] | skips if children else more


def _precondition(bound: BoundNode, children: Sequence[int], more: int) -> int:
    otherwise = F if "else" not in bound.element.attributes else more
    return children[0] | otherwise if children else more


def _loop(bound: BoundNode, children: Sequence[int], more: int) -> int:
    if not children:
        return more
    empty = S if "if_empty" not in bound.element.attributes else more
    return children[0] & (F | R) | (R if children[0] & (S | K) else 0) | empty


def _for_each(_bound: BoundNode, children: Sequence[int], more: int) -> int:
    return children[0] | more if children else more


def _waiting(bound: BoundNode, children: Sequence[int], more: int) -> int:
    """Return what the decorator `Condition` answers."""
    wanted = BITS.get(str(bound.values.get("status")))
    if not children or wanted is None:
        return more
    return (S if children[0] & wanted else 0) | (R if children[0] & ~wanted else 0)


def _union(children: Sequence[int]) -> int:
    together = 0
    for child in children:
        together |= child
    return together


OF: Mapping[str, Outcomes] = {
    "Sequence": _sequence,
    "ReactiveSequence": _sequence,
    "AsyncSequence": _pausing(_sequence),
    "SequenceWithMemory": _pausing(_sequence),
    "Selector": _selector,
    "Fallback": _selector,
    "ReactiveFallback": _selector,
    "AsyncFallback": _pausing(_selector),
    "Parallel": _parallel,
    "ParallelAll": _parallel,
    "IfThenElse": _either,
    "WhileDoElse": _either,
    **{f"Switch{cases}": _switch for cases in range(2, 7)},
    "TryCatch": _try,
    "Inverter": _inverter,
    "ForceSuccess": _replacing(F, S),
    "FailureIsSuccess": _replacing(F, S),
    "ForceFailure": _replacing(S, F),
    "SuccessIsFailure": _replacing(S, F),
    "KeepRunningUntilFailure": _replacing(S | K, R),
    "SuccessIsRunning": _replacing(S, R),
    "FailureIsRunning": _replacing(F, R),
    "RunningIsSuccess": _replacing(R, S),
    "RunningIsFailure": _replacing(R, F),
    "Repeat": _repeat,
    "RetryUntilSuccessful": _retry,
    "Retry": _retry,
    "RunOnce": _run_once,
    "OneShot": _passing,
    "Delay": _delay,
    "Timeout": _timeout,
    "Precondition": _precondition,
    "SkipUnlessUpdated": _adding(K),
    "WaitValueUpdate": _adding(R),
    **{f"Loop{kind}": _loop for kind in ("Int", "Double", "Bool", "String")},
    "ForEach": _for_each,
    "Condition": _waiting,
    "Count": _passing,
    "PassThrough": _passing,
    "StatusToBlackboard": _passing,
    "EternalGuard": _adding(F),
}
"""By the tag."""
