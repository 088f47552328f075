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
looks for what is set in all ticks inside. If there is something, every run that stays here waits for it for ever, also one that stays in a
part of the component, where there is only more of it. So no component is taken apart further.

This is weak fairness. Strong fairness ("what is tried again and again succeeds one day") would promise more than a robot keeps: a goal
behind a wall is tried for ever and never reached. It would also hide the livelock of a robot that swings between a goal and its base.
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

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

from librt.vecs import append, vec
from mypy_extensions import i32, i64, u8

from sar_compiler.analysis.state_search.graph import Edge, Graph, behind


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
    can_end, ends = vec[u8](bytes(graph.places)), vec[u8](graph.ends)
    stuck: int | None = None
    circling: list[int] | None = None
    for component in components(graph, graph.ends):
        # Components come in reverse topological order: what can be reached from this one is decided already.
        if _any_goes_on(graph, component, can_end, ends):
            for place in component:
                can_end[place] = 1
        else:
            states = [place for place in component if place < len(graph.states)]
            stuck = min(states if stuck is None else [stuck, *states], default=None)
        if is_fair(graph, component):
            circling = _sooner(component, circling)
    for state in range(len(graph.states) if stuck is None else stuck):
        if ends[state] and not _any_goes_on(graph, [state], can_end, ends):
            return Endings(state, circling)
    return Endings(stuck, circling)


def owing_for_ever(graph: Graph, debt: int) -> list[int] | None:
    """Return the places of the first component in which a run can stay for ever while it owes something.

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
            circling = _sooner(component, circling)
    return circling


def _any_goes_on(graph: Graph, places: list[int], can_end: vec[u8], ends: vec[u8]) -> bool:
    """Return whether from one of some places a step leads to where a run can end."""
    for place in places:
        steps, step, behind_last = graph.leading_from(place)
        # What was not gone through may end; what only raises has.
        if step == behind_last:
            return True
        while step < behind_last:
            target = graph.place(i64(steps.targets[step]))
            if can_end[target] or (target < len(ends) and ends[target]):
                return True
            step += 1
    return False


def _sooner(component: list[int], known: list[int] | None) -> list[int]:
    """Return the component with the state that was found first."""
    return component if known is None or min(component) < min(known) else known


_NEW: Final = 0


def components(graph: Graph, excluded: bytearray) -> Iterator[list[int]]:
    """Yield the strongly connected components of a graph, each after all that can be reached from it.

    Tarjan's algorithm, as Pearce has it ("A space-efficient algorithm for finding strongly connected components", Information
    Processing Letters 116, 2016): one number a place. Its recursion is as deep as the longest path, which may be a million places,
    so the path is a stack, and `_DepthFirst` holds where each place on it goes on.

    Args:
        graph: The graph.
        excluded: 1 for each state that is taken for not being there.
    """
    walk = _DepthFirst(graph, excluded)
    path = _Stack()
    for root in range(graph.places):
        if (root < len(excluded) and excluded[root]) or walk.numbers[root] != _NEW:
            continue
        walk.begin(root)
        path.push(root)
        while path.height:
            place = path.top()
            entered = walk.enter(place)
            if entered >= 0:
                walk.begin(entered)
                path.push(entered)
                continue
            path.pop()
            if walk.leads_back[place]:
                walk.waiting.push(place)
            else:
                yield walk.component(place)


class _Stack:
    """Places upon each other. A list would take 40 bytes for each of them, and a path may be as long as there are places."""

    def __init__(self) -> None:
        self._places = vec[i32]()
        self.height: i64 = 0

    def push(self, place: int) -> None:
        """Lay a place on top."""
        if self.height == len(self._places):
            self._places = append(self._places, i32(place))
        else:
            self._places[self.height] = i32(place)
        self.height += 1

    def top(self) -> int:
        """Return the place on top."""
        return int(self._places[self.height - 1])

    def pop(self) -> int:
        """Take the place on top away, and return it."""
        self.height -= 1
        return int(self._places[self.height])


class _DepthFirst:
    """What is known of each place.

    Attributes:
        numbers: Its number in the order of the search, or that of an earlier place that it leads back to. Where its component is known, one
            that is above all of these.
        leads_back: 1 if it leads back to an earlier place.
        waiting: The places that do, and whose component is not known yet.
    """

    def __init__(self, graph: Graph, excluded: bytearray) -> None:
        zeros = bytes(graph.places)
        self.numbers, self.leads_back = vec[i32](zeros), vec[u8](zeros)
        self.waiting = _Stack()
        self._done = vec[i32](zeros)
        self._graph = graph
        self._excluded = vec[u8](excluded)
        # Those that are given next: to a place, counted up, and to a component, counted down.
        self._number, self._of_component = 1, graph.places

    def begin(self, place: int) -> None:
        """Give a place its number."""
        self.numbers[place] = i32(self._number)
        self._number += 1

    def enter(self, place: int) -> int:
        """Continue through the steps of a place; return the first new place, -1 at the end."""
        numbers, excluded, graph = self.numbers, self._excluded, self._graph
        steps, first, stop = graph.leading_from(place)
        targets = steps.targets
        step, least = first + i64(self._done[place]), numbers[place]
        found: i64 = -1
        while step < stop:
            target = graph.place(i64(targets[step]))
            if target >= len(excluded) or not excluded[target]:
                if numbers[target] == _NEW:
                    # Looked at again when it is done with.
                    found = target
                    break
                if numbers[target] < least:
                    least = numbers[target]
                    self.leads_back[place] = 1
            step += 1
        self._done[place], numbers[place] = i32(step - first), least
        return int(found)

    def component(self, first: int) -> list[int]:
        """Take the component away whose earliest place this is."""
        component = [first]
        while self.waiting.height and self.numbers[self.waiting.top()] >= self.numbers[first]:
            component.append(self.waiting.pop())
        for place in component:
            self.numbers[place] = i32(self._of_component)
        self._number -= len(component)
        self._of_component -= 1
        return component


def is_fair(graph: Graph, component: list[int]) -> bool:
    """Return whether a fair run can stay in a component for ever.

    It can if there is nothing that every tick in the component waits for: in a strongly connected component one
    round can take all of the ticks. If there is something, every round waits for it, so no run can stay.

    There may be more ticks than can be gone through. So each step is looked at once, from the states on: which of the three things a tick
    can have noted of each bit up to there.
    """
    if len(component) == 1 and not _goes_round(graph, component[0]):
        return False
    inside, states = set(component), len(graph.states)
    notes: dict[int, tuple[int, int, int]] = {}
    free, found = 0, False
    # A middle leads to middles with lower numbers.
    order = [place for place in component if place < states]
    order += sorted((place for place in component if place >= states), reverse=True)
    for place in order:
        nothing, going_on, changed = (_ALL, 0, 0) if place < states else notes[place]
        steps, first, behind_last = graph.leading_from(place)
        for step in range(first, behind_last):
            target = int(graph.place(i64(steps.targets[step])))
            if target not in inside:
                continue
            goes_on, changes, settled = graph.waits[steps.waits[step]]
            still = ~settled & nothing & ~goes_on | settled & ~goes_on & ~changes
            waits = ~settled & (going_on | nothing & goes_on) | settled & goes_on
            begun = ~settled & changed | changes
            if target < states:
                found = True
                free |= still | begun
                if free == _ALL:
                    return True
            else:
                others = notes.get(target, (0, 0, 0))
                notes[target] = still | others[0], waits | others[1], begun | others[2]
    return found and free == _ALL


def _goes_round(graph: Graph, place: int) -> bool:
    """Return whether a step leads from a place to itself."""
    steps, step, behind_last = graph.leading_from(place)
    while step < behind_last:
        if graph.place(i64(steps.targets[step])) == place:
            return True
        step += 1
    return False


_ALL: Final = -1


@dataclass(frozen=True)
class Lasso:
    """A way and a round.

    Attributes:
        stem: The states on the way, from the first one to that where the round begins.
        loop: The ticks of the round.
    """

    stem: list[int]
    loop: list[Edge]


def lasso(graph: Graph, component: list[int]) -> Lasso:
    """Return a short fair run into a component and once round in it.

    Args:
        graph: The graph.
        component: A component for which `is_fair` holds.
    """
    entry = min(component)
    return Lasso(graph.stem(entry), _round(graph, entry, set(component)))


_Moment = tuple[int, int, int, int]
"""A place, what every tick so far has waited for (-1: everything), and what the one in hand has noted: what goes on, and what has changed."""


def _round(graph: Graph, entry: int, inside: set[int]) -> list[Edge]:
    """Return the ticks of a shortest fair round from a state back to it."""
    # A shortest round back to the state may be an unfair one. So breadth first, tick by tick, over places together with what was
    # waited for in every tick so far: 0 is what the round must arrive with.
    start, states = (entry, _ALL, 0, 0), len(graph.states)
    ways: dict[_Moment, tuple[_Moment, int]] = {}
    tick = [start]
    while tick:
        following: list[_Moment] = []
        for moment in tick:
            place, waiting, going_on, changed = moment
            steps, first, behind_last = graph.leading_from(place)
            for step in range(first, behind_last):
                target = int(graph.place(i64(steps.targets[step])))
                if target not in inside:
                    continue
                after = behind(going_on, changed, graph.waits[steps.waits[step]])
                is_end = target < states
                reached = (target, waiting & after[0], 0, 0) if is_end else (target, waiting, *after)
                if reached in ways:
                    continue
                ways[reached] = moment, after[0]
                if reached == (entry, 0, 0, 0):
                    return _retrace(ways, start, reached, states)
                # What a tick comes to in its middle belongs to the tick.
                (following if is_end else tick).append(reached)
        tick = following
    message = "one cannot go round in this component"
    raise ValueError(message)


def _retrace(
    ways: dict[_Moment, tuple[_Moment, int]], start: _Moment, end: _Moment, states: int
) -> list[Edge]:
    way: list[Edge] = []
    moment = end
    while moment != start:
        before, waits = ways[moment]
        if moment[0] < states:
            way.append((moment[0], waits))
        moment = before
    return way[::-1]
