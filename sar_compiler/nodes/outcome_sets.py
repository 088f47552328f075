"""Computation of a node's possible results from the results of its children, for `Semantics.possible`.

An outcome set is an integer with a bit for each result. A function of this module takes a node, the outcome sets of
its children, and the flag *sure*. If *sure* is False, the function returns every result that a tick may have. If *sure*
is True, it returns only the results that certainly occur in some run. This assumes that each child has each result of
its set in some run, independently of its siblings. If no result of a child is certain, the child's set is empty.

If a result depends on a key, or on a script with variables, the tick may have any result. All these results are
regarded as certain, because the tree's author presumably expects each of them. A constant has a single result.
"""

import math
from collections.abc import Callable, Iterable, Sequence
from functools import partial, reduce
from operator import and_, or_
from typing import TYPE_CHECKING, TypeAlias

from sar_compiler.runtime.constant_conditions import constant_truth
from sar_compiler.runtime.expressions import Script
from sar_compiler.runtime.operators import equal_texts
from sar_compiler.runtime.outcomes import ReturnedStatus

if TYPE_CHECKING:
    from py_trees.common import Status

    from sar_compiler.nodes.collector import NodeView

S, F, R, K = 1, 2, 4, 8
"""The bits of SUCCESS, FAILURE, RUNNING and SKIPPED."""
ALL = S | F | R | K
BITS = {"SUCCESS": S, "FAILURE": F, "RUNNING": R, "SKIPPED": K}
WORD_OF = {bit: word for word, bit in BITS.items()}
RESULTS = (S, F, R, K)
ALLOWED, SURE = False, True
"""The values of *sure*.

ALLOWED collects all results that a tick may have. SURE collects only the results that occur in some run.
"""

Number: TypeAlias = Callable[["NodeView"], float | None]
"""A function that reads a number from a node's attributes.

It returns None if the number is known only at runtime.
"""
Possible: TypeAlias = Callable[["NodeView", Sequence[int], bool], int]

# The maximum number of children of which all combinations of results are enumerated; with more, they are estimated.
_MOST_COUNTED = 12


def bit_of(status: "Status | int") -> int:
    """Convert a status to an outcome set, and return an outcome set unchanged. INVALID stands for SKIPPED."""
    return status if isinstance(status, int) else BITS.get(status.name, K)


def bits(outcomes: Iterable[str]) -> int:
    """Convert the names of results to an outcome set."""
    return union(BITS[outcome] for outcome in outcomes)


def union(sets: Iterable[int]) -> int:
    """Return the union of outcome sets."""
    return reduce(or_, sets, 0)


def intersection(sets: Iterable[int]) -> int:
    """Return the intersection of outcome sets: the results that all children may have."""
    return reduce(and_, sets, ALL)


def swap(outcomes: int) -> int:
    """Return an outcome set with SUCCESS and FAILURE swapped."""
    return outcomes & (R | K) | (F if outcomes & S else 0) | (S if outcomes & F else 0)


def unknown(_bound: "NodeView", _children: Sequence[int], sure: bool) -> int:
    """Return the outcome set of a node about which nothing is known."""
    return 0 if sure else ALL


def in_order(goes_on: int, *, pauses: bool = False, keeps_place: bool = False) -> Possible:
    """Return a function that computes the outcome set of a node that ticks its children in order.

    Args:
        goes_on: The result after which the next child is ticked: `S` for a sequence, `F` for a selector.
        pauses: Whether the node returns RUNNING between two children.
        keeps_place: Whether the node, after a restart, begins with the child that ended it or was running.
    """
    return partial(_sequential_outcomes, goes_on, pauses, keeps_place)


def _sequential_outcomes(
    goes_on: int, pauses: bool, keeps_place: bool, bound: "NodeView", children: Sequence[int], sure: bool
) -> int:
    turn = swap if goes_on == F else int
    if sure and bound.is_reactive:
        children = _before_restarts(bound, children)
    return turn(_sequence([turn(child) for child in children], sure, pauses, keeps_place))


def _before_restarts(bound: "NodeView", children: Sequence[int]) -> Sequence[int]:
    """Return the outcome sets of children, without the results of children that may never end.

    The set of a child is empty if an earlier sibling may interrupt the child in each tick.

    A leaf can end in any tick. A branch of several nodes may have to run for some ticks first. In these ticks, a reactive
    node resets the children after the branch, so these children may never end.
    """
    running = [
        not child.is_leaf and bool(known & R) for child, known in zip(bound.children, children, strict=True)
    ]
    first = running.index(True) + 1 if True in running else len(children)
    return [*children[:first], *[0] * (len(children) - first)]


def _sequence(children: Sequence[int], sure: bool, pauses: bool, keeps_place: bool) -> int:
    found = 0
    for number, child in enumerate(children, 1):
        found |= child & (F | R)
        if pauses and child & S and number < len(children):
            found |= R
        if not child & (S | K):
            return found
    # A node that begins in the middle is not skipped, even if all remaining children are skipped.
    goes_back = keeps_place and union(children[1:]) & (F if sure else F | R)
    succeeds = goes_back or union(children) & S
    return found | (S if succeeds else 0) | intersection(children) & K


def branches(_bound: "NodeView", children: Sequence[int], _sure: bool) -> int:
    """Return the outcome set of a node whose first child decides whether its second or third child is ticked."""
    asked, then, *otherwise = children
    found = asked & (R | K)
    return found | (then if asked & S else 0) | ((otherwise[0] if otherwise else F) if asked & F else 0)


def selection(bound: "NodeView", children: Sequence[int], _sure: bool) -> int:
    """Return the outcome set of a `Switch`.

    The node ticks the child whose case equals the variable, or else the last child.
    """
    names = ("variable", *(f"case_{number}" for number in range(1, len(children))))
    variable, *cases = (bound.values.get(name) for name in names)
    if variable is None or None in cases:
        return union(children)
    equal = (number for number, case in enumerate(cases) if equal_texts(str(variable), str(case), {}))
    return children[next(equal, -1)]


def attempt(_bound: "NodeView", children: Sequence[int], sure: bool) -> int:
    """Return the outcome set of a `TryCatch`.

    After a child has failed, the node ticks the last child, and then fails.
    """
    *tried, caught = children
    found = _sequence(tried, sure, pauses=False, keeps_place=False)
    ends = (caught & R) | (F if caught & ~R else 0)
    return found & ~F | (ends if found & F else 0)


def counting_results(bound: "NodeView", children: Sequence[int], sure: bool) -> int:
    """Return the outcome set of a parallel that ends as soon as enough children have succeeded or failed."""
    wanted, failures = bound.value("success_count"), bound.value("failure_count")
    if len(children) > _MOST_COUNTED or not (isinstance(wanted, int) and isinstance(failures, int)):
        return _estimate(children, sure)
    count = len(children)
    enough, too_many = _threshold(wanted, count), _threshold(failures, count)

    def decide(succeeded: int, failed: int, skipped: int) -> int:
        if succeeded + (skipped if wanted < 0 else 0) >= enough:
            return S
        return F if count - failed < enough or failed == too_many else 0

    return _count_all(children, decide, lambda _succeeded, _failed, skipped: K if skipped == count else R)


def parallel_all(bound: "NodeView", children: Sequence[int], sure: bool) -> int:
    """Return the outcome set of a parallel that waits for all its children before it counts their results."""
    failures, count = bound.value("max_failures"), len(children)
    if count > _MOST_COUNTED or not isinstance(failures, int):
        return _estimate(children, sure)
    too_many = _threshold(failures, count)

    def decide(succeeded: int, failed: int, skipped: int) -> int:
        if skipped == count:
            return K
        through = succeeded + failed + skipped == count
        return (F if failed >= too_many else S) if through else R

    return _count_all(children, lambda *_: 0, decide)


Decision: TypeAlias = Callable[[int, int, int], int]


def _count_all(children: Sequence[int], at_once: Decision, at_the_end: Decision) -> int:
    """Return the outcome set of a parallel, computed from all combinations of its children's results.

    Args:
        children: The outcome sets of the children.
        at_once: A function that returns the result for the numbers of succeeded, failed and skipped children; 0 to continue.
        at_the_end: A function that returns the result for the same numbers after all children were ticked.
    """
    found, counts = 0, {(0, 0, 0)}
    for child in children:
        following = set()
        for succeeded, failed, skipped in counts:
            for outcome in RESULTS:
                if child & outcome:
                    now = (succeeded + (outcome == S), failed + (outcome == F), skipped + (outcome == K))
                    decision = at_once(*now)
                    found |= decision
                    if not decision:
                        following.add(now)
        counts = following
    return found | union(at_the_end(*now) for now in counts)


def _threshold(wanted: int, count: int) -> int:
    return wanted if wanted >= 0 else max(count + wanted + 1, 0)


def _estimate(children: Sequence[int], sure: bool) -> int:
    """Estimate the outcome set of a parallel whose children have too many combinations of results."""
    return intersection(children) & R if sure else ALL


def parallel_by_policy(bound: "NodeView", children: Sequence[int], sure: bool) -> int:
    """Return the outcome set of py_trees' `Parallel`, which decides after all its children were ticked."""
    policy = bound.value("policy")
    if policy is None:
        return unknown(bound, children, sure)
    going = [child & (S | R) for child in children]
    found = F if union(children) & F else 0
    if not all(going):
        return found
    on_one = policy == "SuccessOnOne"
    # The selection of children is ignored.
    selects = policy == "SuccessOnSelected"
    succeeds = union(going) & S if on_one or (selects and not sure) else intersection(going) & S
    runs = intersection(going) & R if on_one or (selects and sure) else union(going) & R
    return found | succeeds | runs


def passing_results(_bound: "NodeView", children: Sequence[int], _sure: bool) -> int:
    """Return the outcome set of a decorator that returns its child's result."""
    return children[0]


def mapping_results(turns: dict[int, int]) -> Possible:
    """Return a function that computes the outcome set of a decorator that replaces results of its child."""
    return partial(_mapped_results, tuple(turns.get(each, each) for each in RESULTS))


def _mapped_results(turned: tuple[int, ...], bound: "NodeView", children: Sequence[int], sure: bool) -> int:
    turns = dict(zip(RESULTS, turned, strict=True))
    child = _sure_if_interrupted(bound, children[0]) if sure and turns[R] != R else children[0]
    return union(new for old, new in turns.items() if child & old)


def _sure_if_interrupted(bound: "NodeView", child: int) -> int:
    """Return the results that a child certainly has although it is reset each time it returns RUNNING.

    A leaf can end in any tick. A branch of several nodes may have to run for some ticks first.
    """
    return child & R if child & R and not bound.children[0].is_leaf else child


def with_own_results(own: int, _bound: "NodeView", children: Sequence[int], _sure: bool) -> int:
    """Return the outcome set of a decorator that adds results to those of its child."""
    return children[0] | own


def run_once(bound: "NodeView", children: Sequence[int], sure: bool) -> int:
    """Return the outcome set of a `RunOnce`, which may be skipped once its child has ended."""
    skips = bound.value("then_skip") is True if sure else bound.value("then_skip") is not False
    return children[0] | (K if skips and children[0] & (S | F) else 0)


def guard(condition: str, bound: "NodeView", children: Sequence[int], sure: bool) -> int:
    """Return the outcome set of a decorator that returns another result while its condition is false."""
    otherwise = _attribute_results(bound, "else", F, sure)
    holds = constant_condition(bound.values.get(condition))
    if holds is None:
        return children[0] | otherwise
    return children[0] if holds else otherwise


def rounds(count: Number, again: int, bound: "NodeView", children: Sequence[int], sure: bool) -> int:
    """Return the outcome set of a decorator that repeats its child after the result *again*.

    The child is executed at most `count` times.
    """
    child, most = children[0], count(bound)
    if most is None:
        return child & ~again if sure else child | again | R
    if most < 1:
        return again
    if most == 1:
        return child
    return (child & ~again if most == math.inf else child) | (R if child & again else 0)


def time_limit(limit_sec: Number, bound: "NodeView", children: Sequence[int], sure: bool) -> int:
    """Return the outcome set of a decorator that fails when its child has run for longer than `limit_sec`."""
    child, limit = children[0], limit_sec(bound)
    if limit is not None and limit <= 0:
        child = _sure_if_interrupted(bound, child) if sure else child
        return child & ~R | (F if child & R else 0)
    # A child that is skipped may nevertheless be running, such as one that repeats a skipped node.
    late = child & R and limit not in (None, math.inf) if sure else child & (R | K)
    return child | (F if late else 0)


def loop(bound: "NodeView", children: Sequence[int], sure: bool) -> int:
    """Return the outcome set of a decorator that ticks its child once for each item of a queue."""
    child, queue = children[0], bound.value("queue")
    empty = _attribute_results(bound, "if_empty", S, sure)
    if queue == "":
        return empty
    progress = child & (S | K)
    ends = progress or queue is None
    return child & (F | R) | (R if progress else 0) | (empty if ends else 0)


def each_item(_bound: "NodeView", children: Sequence[int], sure: bool) -> int:
    """Return the outcome set of py_trees' `ForEach`, whose list is on the blackboard and therefore unknown."""
    return children[0] & (F | R) if sure else ALL


def awaiting_results(bound: "NodeView", children: Sequence[int], sure: bool) -> int:
    """Return the outcome set of a decorator that runs until its child returns a given status."""
    wanted = BITS.get(str(bound.value("status")))
    if wanted is None:
        return unknown(bound, children, sure)
    child = _sure_if_interrupted(bound, children[0]) if sure and wanted == R else children[0]
    return (S if child & wanted else 0) | (R if child & ~wanted else 0)


def queue_results(bound: "NodeView", _children: Sequence[int], sure: bool) -> int:
    """Return the outcome set of a leaf whose statuses are listed in the attribute `queue`."""
    queue, eventually = bound.value("queue"), bound.value("eventually")
    if not isinstance(queue, list) or "eventually" in bound.keys:
        return unknown(bound, (), sure)
    return bits(map(str, queue)) | (BITS[str(eventually)] if eventually else 0)


def ticks_counted(bound: "NodeView", _children: Sequence[int], sure: bool) -> int:
    """Return the outcome set of a leaf that runs for some ticks, then returns its attribute `completion_status`."""
    end = BITS.get(str(bound.value("completion_status")))
    return unknown(bound, (), sure) if end is None else R | end


def number(bound: "NodeView", name: str) -> float | None:
    """Return the value of a constant numeric attribute; None for other attributes."""
    value = bound.value(name)
    return value if isinstance(value, (int, float)) else None


def milliseconds(bound: "NodeView", name: str) -> float | None:
    """Convert a constant attribute from milliseconds to seconds; return None for other attributes."""
    value = number(bound, name)
    return None if value is None else value / 1000


def _attribute_results(bound: "NodeView", attribute: str, default: int, sure: bool) -> int:
    """Return the outcome set for the status in an attribute. Without the attribute, return *default*."""
    if attribute not in bound.element.attributes:
        return default
    outcome = bound.values.get(attribute)
    return BITS[outcome.name] if isinstance(outcome, ReturnedStatus) else 0 if sure else ALL


def constant_condition(condition: object) -> bool | None:
    """Return the constant value of a condition; None if the value depends on the condition's variables."""
    return constant_truth(condition) if isinstance(condition, Script) else None


def condition_of_leaf(name: str, bound: "NodeView", _children: Sequence[int], _sure: bool) -> int:
    """Return the outcome set of a leaf that succeeds if its condition is true, and fails otherwise."""
    return {None: S | F, True: S, False: F}[constant_condition(bound.values.get(name))]
