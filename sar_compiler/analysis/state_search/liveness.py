"""Checks liveness: finds runs in which a required event, such as the end of the run, never happens.

There are finitely many states, so an endless run stays in one strongly connected component from some tick on. But not
every component can contain an endless run. The search allows a leaf to return RUNNING forever and a timer never to
expire. Neither happens on a robot, and with such runs nothing could be proved to end. So only *fair* runs are
considered, in which everything that the run waits for eventually happens. A run waits for a leaf or timer if one
activation of it lasts through a whole tick. A run does not wait for a leaf that is halted and restarted in each tick: a
reactive branch that restarts its leaf forever is a true livelock, which users want to find most often. Nor does a run
wait for a leaf that fails on every attempt, because nothing guarantees that the leaf ever succeeds.

Why one check of each component is enough: every leaf and timer has a bit, which is set in the ticks that wait for it. A
run is unfair if from some tick on one bit is set in every tick. So a fair run stays in a component if, for each bit,
ticks without the bit occur repeatedly. That is the acceptance condition of a generalised Buechi automaton, with one set
of *ticks* for each bit. In a strongly connected component the condition can be met if and only if every bit is missing
in some tick of the component, because one loop can contain all ticks. So `is_fair` searches for bits that are set in
all ticks of the component. If there is such a bit, every run that stays in the component waits for it forever. In a
part of the component, even more bits may be set in all ticks, but not fewer. So no component is split further.

This is weak fairness. Strong fairness ("repeated attempts eventually succeed") would promise more than a robot
achieves: a goal beyond a wall is tried forever and never reached. It would also hide the livelock of a robot that
oscillates between a goal and its base. And components would have to be split repeatedly (Streett acceptance).

Why ticks have the bits, and not states: a leaf may be RUNNING in two consecutive states in one activation, or in two
activations if its branch was halted in between and restarted. The states are equal, and only the tick shows the
difference. If states had the bits, every reactive restart would look like waiting, and the livelocks that users want to
find would be considered unfair and not reported.

Why `endings` has two results: from a *stuck* state no end can be reached at all, so fairness does not matter. In a
*circling* component an end may be reachable, but a fair run can avoid it. Neither implies the other, and a stuck state
is easier to understand. Ends are excluded from the components, because the run is over. Whether further ticks after an
end lead to another end is decided separately.

Why an unexplored state is treated as a state from which a run can end: the search may have stopped early. Then nothing
is proved, and the verdict says so. But a loop that was found is real, so unexplored states must not create a loop that
may not exist.

Why a counterexample is searched separately: the loop that is shown to the user should be short, but a shortest loop
back to a state may be unfair, since waiting for one leaf forever is the shortest loop. `_round` searches over states
together with the bits that were set in every tick so far. These sets of bits only shrink along a path, so there are few
of them for each state.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

from librt.vecs import append, vec
from mypy_extensions import i32, i64, u8

from sar_compiler.analysis.state_search.graph import Edge, Graph, append_waits


@dataclass(frozen=True)
class Endings:
    """The result of checking whether every fair run of a tree ends.

    Attributes:
        stuck: The first state, possibly an end itself, from which no end can be reached; None if there is none.
        circling: The places of the first component in which a run can stay forever without an end; None if there is
            none.
    """

    stuck: int | None
    circling: list[int] | None


def endings(graph: Graph) -> Endings:
    """Find the first state from which no run can end, and the first component that a run may never leave.

    From an unexplored state, an end is assumed to be reachable.
    """
    can_end, ends = vec[u8](bytes(graph.places)), vec[u8](graph.ends)
    stuck: int | None = None
    circling: list[int] | None = None
    for component in components(graph, graph.ends):
        # In reverse topological order: the components that this component reaches are already decided.
        if _can_any_end(graph, component, can_end, ends):
            for place in component:
                can_end[place] = 1
        else:
            states = [place for place in component if place < len(graph.states)]
            stuck = min(states if stuck is None else [stuck, *states], default=None)
        if is_fair(graph, component):
            circling = _earlier_component(component, circling)
    for state in range(len(graph.states) if stuck is None else stuck):
        if ends[state] and not _can_any_end(graph, [state], can_end, ends):
            return Endings(state, circling)
    return Endings(stuck, circling)


def owing_for_ever(graph: Graph, debt: int) -> list[int] | None:
    """Return the places of the first component in which a run can stay forever with a pending obligation.

    Args:
        graph: The graph.
        debt: The bit of the obligation in `Graph.pending`.
    """
    excluded = bytearray(
        not graph.pending[state] & debt or graph.ends[state] for state in range(len(graph.states))
    )
    circling: list[int] | None = None
    for component in components(graph, excluded):
        if is_fair(graph, component):
            circling = _earlier_component(component, circling)
    return circling


def _can_any_end(graph: Graph, places: list[int], can_end: vec[u8], ends: vec[u8]) -> bool:
    """Return whether any step from the given places leads to a place from which a run can end."""
    for place in places:
        steps, step, behind_last = graph.leading_from(place)
        # From an unexplored place an end may be reachable. If all steps raise errors, the run has ended.
        if step == behind_last:
            return True
        while step < behind_last:
            target = graph.target_place(i64(steps.targets[step]))
            if can_end[target] or (target < len(ends) and ends[target]):
                return True
            step += 1
    return False


def _earlier_component(component: list[int], known: list[int] | None) -> list[int]:
    """Return one of two components: the one whose earliest state was found first."""
    return component if known is None or min(component) < min(known) else known


_NEW: Final = 0


def components(graph: Graph, excluded: bytearray) -> Iterator[list[int]]:
    """Yield the strongly connected components of a graph.

    A component is yielded after the components that are reachable from it.

    This is Tarjan's algorithm in Pearce's form ("A space-efficient algorithm for finding strongly connected
    components", Information Processing Letters 116, 2016), which needs one number for each place. A recursion would be
    as deep as the longest path, which may contain a million places. So the path is a stack, and `_DepthFirst` stores
    the next step of each place.

    Args:
        graph: The graph.
        excluded: 1 for each state that is ignored, 0 for each other state.
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
    """A stack of places.

    The stack may contain all places, and needs less memory than a list.
    """

    def __init__(self) -> None:
        self._places = vec[i32]()
        self.height: i64 = 0

    def push(self, place: int) -> None:
        """Push a place."""
        if self.height == len(self._places):
            self._places = append(self._places, i32(place))
        else:
            self._places[self.height] = i32(place)
        self.height += 1

    def top(self) -> int:
        """Return the place on top of the stack."""
        return int(self._places[self.height - 1])

    def pop(self) -> int:
        """Remove the place on top of the stack, and return this place."""
        self.height -= 1
        return int(self._places[self.height])


class _DepthFirst:
    """The data of the depth-first search for components.

    Attributes:
        numbers: By place: its number in the order of the search, or the number of an earlier place to which it leads
            back; or, once its component is known, a number above all of these.
        leads_back: By place: 1 if it leads back to an earlier place.
        waiting: The places that lead back to an earlier place, and whose component is not known yet.
    """

    def __init__(self, graph: Graph, excluded: bytearray) -> None:
        zeros = bytes(graph.places)
        self.numbers, self.leads_back = vec[i32](zeros), vec[u8](zeros)
        self.waiting = _Stack()
        self._done = vec[i32](zeros)
        self._graph = graph
        self._excluded = vec[u8](excluded)
        # The next number of a place, which counts up, and the next number of a component, which counts down.
        self._number, self._of_component = 1, graph.places

    def begin(self, place: int) -> None:
        """Assign the next number to a place."""
        self.numbers[place] = i32(self._number)
        self._number += 1

    def enter(self, place: int) -> int:
        """Follow the next steps from a place. Return the next place not yet visited, or -1 if there is none."""
        numbers, excluded, graph = self.numbers, self._excluded, self._graph
        steps, first, stop = graph.leading_from(place)
        targets = steps.targets
        step, least = first + i64(self._done[place]), numbers[place]
        found: i64 = -1
        while step < stop:
            target = graph.target_place(i64(targets[step]))
            if target >= len(excluded) or not excluded[target]:
                if numbers[target] == _NEW:
                    # The step is checked again after the new place is finished.
                    found = target
                    break
                if numbers[target] < least:
                    least = numbers[target]
                    self.leads_back[place] = 1
            step += 1
        self._done[place], numbers[place] = i32(step - first), least
        return int(found)

    def component(self, first: int) -> list[int]:
        """Return the component whose earliest place is *first*, and remove its places from the search."""
        component = [first]
        while self.waiting.height and self.numbers[self.waiting.top()] >= self.numbers[first]:
            component.append(self.waiting.pop())
        for place in component:
            self.numbers[place] = i32(self._of_component)
        self._number -= len(component)
        self._of_component -= 1
        return component


def is_fair(graph: Graph, component: list[int]) -> bool:
    """Return whether a fair run can stay in a component forever.

    It can unless every tick in the component waits for the same leaf or timer, because in a strongly connected
    component one loop can contain all ticks. If every tick waits for it, so does every loop, and no fair run can stay.

    The ticks may be too many to enumerate. So each step is visited once, states first, with the three possible records
    of each bit in the ticks up to the step.
    """
    if len(component) == 1 and not _has_self_loop(graph, component[0]):
        return False
    inside, states = set(component), len(graph.states)
    notes: dict[int, tuple[int, int, int]] = {}
    free, found = 0, False
    # An intermediate state leads to intermediate states with lower numbers.
    order = [place for place in component if place < states]
    order += sorted((place for place in component if place >= states), reverse=True)
    for place in order:
        nothing, going_on, changed = (_ALL, 0, 0) if place < states else notes[place]
        steps, first, behind_last = graph.leading_from(place)
        for step in range(first, behind_last):
            target = int(graph.target_place(i64(steps.targets[step])))
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


def _has_self_loop(graph: Graph, place: int) -> bool:
    """Return whether a step leads from a place to itself."""
    steps, step, behind_last = graph.leading_from(place)
    while step < behind_last:
        if graph.target_place(i64(steps.targets[step])) == place:
            return True
        step += 1
    return False


_ALL: Final = -1


@dataclass(frozen=True)
class Lasso:
    """A path from the start to a loop, and the loop itself.

    Attributes:
        stem: The states on the path, from the first state to the first state of the loop.
        loop: The ticks of the loop.
    """

    stem: list[int]
    loop: list[Edge]


def lasso(graph: Graph, component: list[int]) -> Lasso:
    """Return a short fair run: a path to a component, and a loop that stays in this component.

    Args:
        graph: The graph.
        component: A component for which `is_fair` holds.
    """
    entry = min(component)
    return Lasso(graph.stem(entry), _round(graph, entry, set(component)))


_Moment = tuple[int, int, int, int]
"""A place, the bits set in all ticks so far (-1 stands for all bits), and the waits of the current tick."""


def _round(graph: Graph, entry: int, inside: set[int]) -> list[Edge]:
    """Return the ticks of a shortest fair loop that leads from a state back to the same state."""
    # A shortest loop may be unfair. So the search is breadth first, tick by tick, over places together with the bits
    # that were set in every tick so far. At the end of the loop there must be no such bits.
    start, states = (entry, _ALL, 0, 0), len(graph.states)
    origins: dict[_Moment, tuple[_Moment, int]] = {}
    tick = [start]
    while tick:
        following: list[_Moment] = []
        for moment in tick:
            place, waiting, going_on, changed = moment
            steps, first, behind_last = graph.leading_from(place)
            for step in range(first, behind_last):
                target = int(graph.target_place(i64(steps.targets[step])))
                if target not in inside:
                    continue
                after = append_waits(going_on, changed, graph.waits[steps.waits[step]])
                is_end = target < states
                reached = (target, waiting & after[0], 0, 0) if is_end else (target, waiting, *after)
                if reached in origins:
                    continue
                origins[reached] = moment, after[0]
                if reached == (entry, 0, 0, 0):
                    return _path_back(origins, start, reached, states)
                # An intermediate state belongs to the tick that reaches it.
                (following if is_end else tick).append(reached)
        tick = following
    message = "this component has no fair loop"
    raise ValueError(message)


def _path_back(
    origins: dict[_Moment, tuple[_Moment, int]], start: _Moment, end: _Moment, states: int
) -> list[Edge]:
    path: list[Edge] = []
    moment = end
    while moment != start:
        before, waits = origins[moment]
        if moment[0] < states:
            path.append((moment[0], waits))
        moment = before
    return path[::-1]
