"""Outcome sets of Nav2's controls and decorators, computed from the outcome sets of their children."""

from collections.abc import Mapping, Sequence

from sar_compiler.nodes.collector import NodeView
from sar_compiler.nodes.outcome_sets import F, K, R, S, intersection, union
from sar_compiler.nodes.semantics import Gate

_ENDS = S | F | K


def _sequential_results(children: Sequence[int], passed: int, goes_on: int) -> tuple[int, bool]:
    """Return the results that a node passes on, and whether each child can have a result in *goes_on*.

    Args:
        children: The outcome sets of the children.
        passed: The results of a child that the node returns as well.
        goes_on: The results after which the node ticks the next child.
    """
    found = 0
    for child in children:
        found |= child & passed
        if not child & goes_on:
            return found, False
    return found, True


def recovery(bound: NodeView, children: Sequence[int], sure: bool) -> int:
    """Return the outcome set of a node that retries its first child after its second child has succeeded."""
    main, recovering = children
    retries = bound.value("number_of_retries")
    found = main & ~F
    if not main & F:
        return found
    if retries == 0 or recovering & _ENDS or (retries is None and not sure):
        found |= F
    return found | (recovering & R if retries != 0 else 0)


def pipeline(bound: NodeView, children: Sequence[int], sure: bool) -> int:
    """Return the outcome set of a node that, in each tick, ticks all children up to the furthest one reached."""
    if sure:
        # A branch of several nodes keeps its state between ticks, so it is unknown whether later children can end.
        leaves = [child.is_leaf for child in bound.children]
        known = leaves.index(False) + 1 if False in leaves else len(children)
        children = [*children[:known], *[0] * (len(children) - known)]
    found, comes_through = _sequential_results(children, F | R, S | K)
    if not comes_through:
        return found
    # If an earlier child runs again while the others are skipped, the node succeeds: not all children are skipped.
    runs = sum(1 for child in children if child & R) > 1
    succeeds = union(children) & S or (runs and not sure)
    return found | (S if succeeds else 0) | intersection(children) & K


def round_robin(bound: NodeView, children: Sequence[int], sure: bool, *, wraps: bool | None) -> int:
    """Return the outcome set of a node that ticks its children in turn.

    Args:
        bound: The node.
        children: The outcome sets of the children.
        sure: Whether to include only results that certainly occur.
        wraps: Whether the first child follows the last child; None to use the attribute `wrap_around`.
    """
    if wraps is None:
        wraps = bound.value("wrap_around")  # type: ignore[assignment]
    if wraps is None:
        both = _wrapping_results(children), _not_wrapping(children)
        return both[0] & both[1] if sure else both[0] | both[1]
    return _wrapping_results(children) if wraps else _not_wrapping(children)


def _wrapping_results(children: Sequence[int]) -> int:
    found, comes_through = _sequential_results(children, S | R, _ENDS)
    if not comes_through:
        return found
    fails = all(child & (F | K) for child in children) and union(children) & F
    return found | (F if fails else 0) | intersection(children) & K


def _not_wrapping(children: Sequence[int]) -> int:
    *others, last = children
    found, comes_through = _sequential_results(others, S | R, _ENDS)
    if not comes_through:
        return found
    found |= last & R
    began_later = union(others) & (S | F) or union(children[1:]) & R
    if last & (S | F) or (last & K and began_later):
        found |= F
    return found | intersection(children) & K


def nonblocking_results(_bound: NodeView, children: Sequence[int], _sure: bool) -> int:
    """Return the outcome set of a node that ticks all its children in every tick."""
    found, comes_through = _sequential_results(children, F, S | R)
    if not comes_through:
        return found
    runs = union(children) & R
    return found | runs | intersection(children) & S


def persistent(_bound: NodeView, children: Sequence[int], sure: bool) -> int:
    """Return the outcome set of a sequence whose current child's index is on the blackboard."""
    if not sure:
        return union(children) & (F | R) | S
    found, comes_through = _sequential_results(children, F | R, S | K)
    return found | (S if comes_through else 0)


def pausing_results(_bound: NodeView, children: Sequence[int], sure: bool) -> int:
    """Return the outcome set of a node that ticks its first child until the node is paused."""
    work = children[0]
    own = (S if work & (S | K) else 0) | work & (F | R)
    return own | R | (0 if sure else union(children[1:]) & F)


def periodic(own: int, _bound: NodeView, children: Sequence[int], sure: bool) -> int:
    """Return the outcome set of a decorator that ticks its child at intervals.

    The decorator itself can return the results *own*.
    """
    return children[0] | own | (0 if sure else R)


def once_until_reset(_bound: NodeView, children: Sequence[int], sure: bool) -> int:
    """Return the outcome set of a decorator that fails from the end of its child until it is reset."""
    return children[0] | (F if not sure and children[0] & (S | F) else 0)


def recovery_gates(_bound: NodeView) -> Mapping[int, Gate]:
    """Return the gate of the recovery child, which is ticked only after the main child has failed."""
    return {1: Gate((0,), F)}
