"""A run that never ends, as somebody can read it: a way into a round, and once round."""

from collections import deque
from dataclasses import dataclass

from sar_compiler.checks.verify.graph import Graph


@dataclass(frozen=True)
class Lasso:
    """A way and a round.

    Attributes:
        stem: The states on the way, from the first one to that where the round begins.
        loop: The ticks of the round, as numbers of edges.
    """

    stem: list[int]
    loop: list[int]


def lasso(graph: Graph, component: list[int]) -> Lasso:
    """Return a run that goes round in a component and waits for nothing all the time; both parts are short.

    Args:
        graph: The graph.
        component: A component for which `is_fair` holds.
    """
    entry = min(component)
    return Lasso(graph.stem(entry), _round(graph, entry, set(component)))


def _round(graph: Graph, entry: int, inside: set[int]) -> list[int]:
    """Return the ticks of a shortest way from a state back to it in which nothing is waited for all the time."""
    # What has been waited for all the way is part of the place: -1 stands for everything.
    start = (entry, -1)
    ways: dict[tuple[int, int], tuple[tuple[int, int], int]] = {}
    queue = deque([start])
    while queue:
        place = queue.popleft()
        state, waiting = place
        for edge in graph.edges(state):
            target = graph.targets[edge]
            following = (target, waiting & graph.waiting[graph.waits[edge]])
            if target not in inside or following in ways:
                continue
            ways[following] = (place, edge)
            if following == (entry, 0):
                return _retraced(ways, start, following)
            queue.append(following)
    message = "one cannot go round in this component"
    raise ValueError(message)


def _retraced(
    ways: dict[tuple[int, int], tuple[tuple[int, int], int]], start: tuple[int, int], end: tuple[int, int]
) -> list[int]:
    way: list[int] = []
    place = end
    while place != start:
        place, edge = ways[place]
        way.append(edge)
    return way[::-1]
