"""Liveness: what must happen one day (an end of the run, and what the run owes), and the runs in which it does not.

There are finitely many states, so a run that never ends stays in one strongly connected component from some tick on.
Not every component is one that a run can stay in. The search lets a leaf answer RUNNING for ever and a timer never be
up, which no robot does: nothing would ever be proved to end. So a run counts only if it is *fair*: whatever it waits
for comes one day. Waiting means that one activation of a leaf or timer goes on through a whole tick. One that is halted
and started again in each tick is not waited for: a reactive branch that restarts its leaf for ever is a true livelock,
and the one most often asked about. Nor is a leaf that fails each time it is tried: nothing says that it ever
succeeds.

Why one look at each component is enough. Give every leaf and timer that can be waited for a bit. A run is unfair if from some tick on
one bit is set in every tick. So "some fair run stays here" is: for each bit, a tick without it comes again and again. That is acceptance
as in a generalised Buechi automaton, with one set of *ticks* for each bit, and in a strongly connected component it can be met
if and only if every bit is missing in some tick of the component: one round can be made that takes all ticks. `is_fair` therefore
intersects the bits of all ticks inside. If something is left, every run that stays here waits for it for ever, also one that stays in a
part of the component, where the intersection is only larger. So no component is taken apart further.

This is weak fairness. Strong fairness ("what is tried again and again succeeds one day") would promise more than a robot keeps: a zone
behind a wall is tried for ever and never reached. It would also hide the livelock of the shipped tree, which swings between zone and base.
And its components would have to be taken apart again and again (Streett acceptance).

Why the bits are on ticks and not on states. Two states in a row may both have a leaf RUNNING, in one activation or in two: the branch was
halted in between and began anew. The states are equal; only the tick knows. If states had the bits, every reactive restart would look
like patience, and the livelocks that people ask about would be taken for unfair and never told.

Why two answers in `endings`. *Stuck* is where no end can be reached at all: fairness does not matter, not even luck helps. *Circling* is
where an end may be in reach, and a fair run can still avoid it. Neither implies the other, and stuck is the clearer thing to show. Ends
are excluded from the components, because a run is over there; whether ticking on behind an end leads to another end is asked apart.

Why a state that was not gone through counts as one that can end. The search may have stopped early. Then nothing is proved, and the
verdict says so; but a loop that was found is real. The states that were not gone through must not make a loop of what may be none.

Why a counterexample is searched for apart. The round that a person reads should be short, and a shortest round back to a state may be an
unfair one: waiting for one leaf for ever is the shortest round of all. `_round` searches over states together with the bits that were set
in every tick so far. The sets only shrink on the way, so there are few of them for each state.
"""

from collections import deque
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Final

from librt.vecs import vec
from mypy_extensions import i32, i64

from sar_compiler.runtime.kernel.graph import Graph


@dataclass(frozen=True)
class Endings:
    """Whether the runs end.

    Attributes:
        stuck: The first state behind which no end can be reached, whether it is an end itself or not; None if there is none.
        circling: The states of the first component that a run can go round in for ever without an end; None if
            there is none.
    """

    stuck: int | None
    circling: list[int] | None


def endings(graph: Graph) -> Endings:
    """Find the first state that cannot end, and the first component that need not.

    A state that was not gone through counts as one that can end.
    """
    can_end = bytearray(len(graph.states))
    stuck: int | None = None
    circling: list[int] | None = None
    for component in components(graph, graph.ends):
        # Components come in reverse topological order: what can be reached from this one is decided already.
        if any(_goes_on(graph, state, can_end) for state in component):
            for state in component:
                can_end[state] = 1
        else:
            stuck = _first(component, stuck)
        if is_fair(graph, component):
            circling = _sooner(graph, component, circling)
    for state in range(len(can_end) if stuck is None else stuck):
        if graph.ends[state] and not _goes_on(graph, state, can_end):
            return Endings(state, circling)
    return Endings(stuck, circling)


def owing_for_ever(graph: Graph, debt: int) -> list[int] | None:
    """Return the states of the first component in which a run can stay for ever while it owes something.

    Args:
        graph: The graph.
        debt: What is owed: its bit in `pending`.
    """
    excluded = bytearray(
        not graph.pending[state] & debt or graph.ends[state] for state in range(len(graph.states))
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
    """Return the component at the lesser distance; at the same distance the later one, which leads to the other."""
    if known is None or graph.distance(min(component)) <= graph.distance(min(known)):
        return component
    return known


def _first(component: Iterable[int], known: int | None) -> int:
    least = min(component)
    return least if known is None else min(least, known)


_NEW: Final = 0


def components(graph: Graph, excluded: bytearray) -> Iterator[list[int]]:
    """Yield the strongly connected components of a graph, each after all that can be reached from it.

    Tarjan's algorithm. Its recursion is as deep as the longest path, which may be a million states, so the path is
    a list, and `_DepthFirst.following` holds where each state on it goes on.

    Args:
        graph: The graph.
        excluded: 1 for each state that is taken for not being there.
    """
    walk = _DepthFirst(graph, excluded)
    stack: list[int] = []
    number = _NEW
    for root in range(len(graph.states)):
        if excluded[root] or walk.order[root]:
            continue
        work = [root]
        while work:
            state = work[-1]
            if walk.order[state] == _NEW:
                number += 1
                walk.begin(state, number)
                stack.append(state)
            entered = walk.enter(state)
            if entered >= 0:
                work.append(entered)
                continue
            work.pop()
            if work:
                walk.low[work[-1]] = min(walk.low[work[-1]], walk.low[state])
            if walk.low[state] == walk.order[state]:
                yield _pop_component(stack, walk.on_stack, state)


class _DepthFirst:
    """What Tarjan's algorithm knows of each state: its number in order, the least that it leads back to, and its next tick."""

    def __init__(self, graph: Graph, excluded: bytearray) -> None:
        zeros = bytes(len(graph.states))
        self.order, self.low, self.following = vec[i32](zeros), vec[i32](zeros), vec[i64](zeros)
        self.on_stack = bytearray(zeros)
        self._graph = graph
        self._excluded = excluded

    def begin(self, state: int, number: int) -> None:
        """Give a state a number."""
        self.order[state] = self.low[state] = i32(number)
        self.following[state] = self._graph.edges(state).start
        self.on_stack[state] = 1

    def enter(self, state: int) -> int:
        """Continue through the ticks of a state; return the first new state, -1 at the end."""
        order, on_stack, targets = self.order, self.on_stack, self._graph.targets
        edge, stop, least = int(self.following[state]), self._graph.edges(state).stop, self.low[state]
        found = -1
        while edge < stop and found < 0:
            target = int(targets[edge])
            edge += 1
            if self._excluded[target]:
                continue
            if order[target] == _NEW:
                found = target
            elif on_stack[target] and order[target] < least:
                least = order[target]
        self.following[state], self.low[state] = edge, least
        return found


def _pop_component(stack: list[int], on_stack: bytearray, first: int) -> list[int]:
    component = []
    while True:
        state = stack.pop()
        on_stack[state] = 0
        component.append(state)
        if state == first:
            return component


def is_fair(graph: Graph, component: list[int]) -> bool:
    """Return whether a fair run can stay in a component for ever.

    It can if there is nothing that every tick in the component waits for: in a strongly connected component one
    round can take all of the ticks. If there is something, every round waits for it, so no run can stay.
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
    """Return a short fair run into a component and once round in it.

    Args:
        graph: The graph.
        component: A component for which `is_fair` holds.
    """
    entry = min(component)
    return Lasso(graph.stem(entry), _round(graph, entry, set(component)))


def _round(graph: Graph, entry: int, inside: set[int]) -> list[int]:
    """Return the ticks of a shortest fair round from a state back to it."""
    # A shortest round back to the state may be an unfair one. So breadth first over states together with what was
    # waited for in every tick so far: -1 stands for everything, 0 is what the round must arrive with.
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
                return _retrace(ways, start, following)
            queue.append(following)
    message = "one cannot go round in this component"
    raise ValueError(message)


def _retrace(
    ways: dict[tuple[int, int], tuple[tuple[int, int], int]], start: tuple[int, int], end: tuple[int, int]
) -> list[int]:
    way: list[int] = []
    place = end
    while place != start:
        place, edge = ways[place]
        way.append(edge)
    return way[::-1]
