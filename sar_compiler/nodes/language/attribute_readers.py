"""Semantics that depend on a node's attributes: numbers of rounds, time limits, and the gates of branches."""

import math
from collections.abc import Mapping

from sar_compiler.nodes.binding.bound import BoundNode
from sar_compiler.nodes.outcome_sets import F, K, S, number
from sar_compiler.nodes.semantics import Gate

_MILLISECONDS = 1000.0


def successes(bound: BoundNode) -> float | None:
    """Return the rounds of py_trees' Repeat."""
    count = number(bound, "num_success")
    # py_trees compares the number of successes with it: no success is the last one below 1.
    return math.inf if count is not None and count < 1 else count


def failures(bound: BoundNode) -> float | None:
    """Return the rounds of py_trees' Retry."""
    count = number(bound, "num_failures")
    return None if count is None else max(count, 1)


def within(bound: BoundNode) -> float | None:
    """Return the limit of a Timeout in seconds; BehaviorTree.CPP's 0 is no limit."""
    milliseconds = number(bound, "msec")
    return milliseconds and milliseconds / _MILLISECONDS if milliseconds != 0 else math.inf


def after_the_first(_bound: BoundNode) -> Mapping[int, Gate]:
    """Return the gates of the branches: the second child is ticked if the first succeeds, the third if it fails."""
    return {1: Gate((0,), S), 2: Gate((0,), F)}


def one_after_the_other(bound: BoundNode) -> Mapping[int, Gate]:
    """Return the gates of a try-catch: its children in order, and last the one that handles a failure."""
    *tried, last = range(len(bound.children))
    catches = {last: Gate(tuple(tried), F)} if bound.value("catch_on_halt") is False else {}
    return {**{number: Gate((number - 1,), S | K) for number in tried[1:]}, **catches}
