"""Runs that never end, in a graph of states: components that can be gone round in, and whether that is fair."""

from array import array
from collections.abc import Iterator

from sar_compiler.checks.verify.graph import Graph

_NEW = 0


def components(graph: Graph, excluded: bytearray) -> Iterator[list[int]]:
    """Yield the strongly connected components of a graph, each behind all that can be reached from it.

    Tarjan's way, with a stack of its own in place of recursion.

    Args:
        graph: The graph.
        excluded: 1 for each state that is taken for not being there.
    """
    count = len(graph.keys)
    order, low = array("I", bytes(4 * count)), array("I", bytes(4 * count))
    on_stack = bytearray(count)
    following = array("Q", bytes(8 * count))
    stack: list[int] = []
    number = _NEW
    for root in range(count):
        if excluded[root] or order[root]:
            continue
        work = [root]
        while work:
            state = work[-1]
            edges = graph.edges(state)
            if order[state] == _NEW:
                number += 1
                order[state] = low[state] = number
                following[state] = edges.start
                stack.append(state)
                on_stack[state] = 1
            entered = _enter(graph, state, edges.stop, (order, low, on_stack, following, excluded))
            if entered is not None:
                work.append(entered)
                continue
            work.pop()
            if work:
                low[work[-1]] = min(low[work[-1]], low[state])
            if low[state] == order[state]:
                yield _popped(stack, on_stack, state)


_Arrays = tuple["array[int]", "array[int]", bytearray, "array[int]", bytearray]


def _enter(graph: Graph, state: int, stop: int, arrays: _Arrays) -> int | None:
    """Go on through the ticks of a state; return the first state that is new, None at the end."""
    order, low, on_stack, following, excluded = arrays
    targets = graph.targets
    edge, least = following[state], low[state]
    found = None
    while edge < stop:
        target = targets[edge]
        edge += 1
        if excluded[target]:
            continue
        if order[target] == _NEW:
            found = target
            break
        if on_stack[target] and order[target] < least:
            least = order[target]
    following[state], low[state] = edge, least
    return found


def _popped(stack: list[int], on_stack: bytearray, first: int) -> list[int]:
    component = []
    while True:
        state = stack.pop()
        on_stack[state] = 0
        component.append(state)
        if state == first:
            return component


def is_fair(graph: Graph, component: list[int]) -> bool:
    """Say whether one can go round in a component for ever without waiting for the same thing all the time.

    What is waited for (the answer of a leaf, the end of a time) comes one day. A round that never leaves off
    waiting for one of them is none that a run can stay in.
    """
    inside = set(component)
    waiting, found = -1, False
    for state in component:
        for edge in graph.edges(state):
            if graph.targets[edge] in inside:
                found = True
                waiting &= graph.waiting[graph.waits[edge]]
                if not waiting:
                    return True
    return found and not waiting
