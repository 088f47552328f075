"""What must come one day: an end of the run, and what the run owes."""

from collections.abc import Iterable
from dataclasses import dataclass

from sar_compiler.checks.verify.components import components, is_fair
from sar_compiler.checks.verify.graph import Graph


@dataclass(frozen=True)
class Endings:
    """Whether the runs end.

    Attributes:
        stuck: The first state from which no end can be reached; None if there is none.
        circling: The states of the first component that a run can go round in for ever without an end; None if
            there is none.
    """

    stuck: int | None
    circling: list[int] | None


def endings(graph: Graph) -> Endings:
    """Find the states that cannot end, and those that need not.

    A state that was not gone through counts as one that can end.
    """
    can_end = bytearray(len(graph.keys))
    stuck: int | None = None
    circling: list[int] | None = None
    for component in components(graph, graph.ends):
        # What can be reached from it has its answer already.
        if any(_goes_on(graph, state, can_end) for state in component):
            for state in component:
                can_end[state] = 1
        else:
            stuck = _first(component, stuck)
        if is_fair(graph, component):
            circling = _sooner(graph, component, circling)
    return Endings(stuck, circling)


def owing_for_ever(graph: Graph, debt: int) -> list[int] | None:
    """Return the states of the first component that a run can go round in and owe something for ever.

    Args:
        graph: The graph.
        debt: What is owed: its bit in `pending`.
    """
    excluded = bytearray(
        not graph.pending[state] & debt or graph.ends[state] for state in range(len(graph.keys))
    )
    circling: list[int] | None = None
    for component in components(graph, excluded):
        if is_fair(graph, component):
            circling = _sooner(graph, component, circling)
    return circling


def _goes_on(graph: Graph, state: int, can_end: bytearray) -> bool:
    # What was not gone through may end; what only raises has.
    if not graph.edges(state):
        return True
    return any(graph.ends[target] or can_end[target] for target in graph.successors(state))


def _sooner(graph: Graph, component: list[int], known: list[int] | None) -> list[int]:
    """Return the component that fewer ticks lead to; where they are as many, the later one, which leads to the other."""
    if known is None or graph.distance(min(component)) <= graph.distance(min(known)):
        return component
    return known


def _first(component: Iterable[int], known: int | None) -> int:
    least = min(component)
    return least if known is None else min(least, known)
