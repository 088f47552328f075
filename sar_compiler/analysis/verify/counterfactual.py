"""Counterfactuals: the smallest change that makes a recorded run succeed, and effects of other outcomes.

The recorded run is located among all runs of the tree, tick by tick. From the last tick backwards, the search then
tries other continuations.
"""

import functools
import itertools
from collections import deque
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import NamedTuple

from sar_compiler.analysis.simulated_tree import SimulatedTree
from sar_compiler.analysis.verify.recorded_runs import FoundTick, PossibleTick, TreeRuns
from sar_compiler.journal.recorded_ticks import TickSource
from sar_compiler.runtime.events import Event
from sar_compiler.runtime.kernel.cells import RUNNING, SUCCESS, WORDS

_SUCCESS, _RUNNING = WORDS[SUCCESS], WORDS[RUNNING]
# The maximum number of unusual outcomes after the change.
_MOST_UNUSUAL = 2
# The number of ticks that are explored after a changed outcome.
_MOST_FOLLOWED = 12


class Counterfactual(NamedTuple):
    """A change of an outcome that makes a run succeed.

    Attributes:
        tick: The number of the last tick that could have been different.
        time_sec: The time of this tick, seconds since the start of the run.
        was: The outcome of the leaf in this tick.
        instead: The changed outcome.
        then: The outcomes of leaves after that, in order, without those that keep running.
        unusual: How many of these outcomes are unusual.
    """

    tick: int
    time_sec: float
    was: Event
    instead: Event
    then: tuple[Event, ...]
    unusual: int


class WhatIfResult(NamedTuple):
    """The consequence of another outcome of a leaf.

    Attributes:
        was: The outcome of the leaf.
        instead: The changed outcome.
        then: The outcomes of leaves after that, usual ones if possible, without those that keep running.
        root: The final status of the root; RUNNING if the tree continues beyond the explored ticks.
    """

    was: Event
    instead: Event
    then: tuple[Event, ...]
    root: str


def counterfactual(
    simulated: SimulatedTree, record: Iterable[Event] | TickSource, names: Sequence[str]
) -> Counterfactual | None:
    """Return the latest of the smallest changes that make a run succeed; None if none was found.

    The change is one leaf's outcome. After it, leaves have their usual outcome, the first possible one, with as few
    exceptions as possible and at most two.

    Args:
        simulated: The tree with stub leaves; not usable afterwards.
        record: The run, up to the failure of its root; read once. Outcomes equal to the previous one may be left out,
            and so may ticks without others.
        names: The names of the nodes that ran, in pre-order.

    Raises:
        UndecidableError: If the tree's runs cannot be searched, or the record is not one of them.
        OtherTreeError: If the tree has nodes other than those that ran.
    """
    runs = TreeRuns(simulated, names)
    after = _Continuations(runs)
    # The possible changes of a tick depend only on its ways: of ticks with equal ways, keep the latest.
    moments: dict[int, FoundTick] = {}
    for moment in reversed(runs.locate_all(record)):
        moments.setdefault(id(moment.ways), moment)
    for unusual, moment in itertools.product(range(_MOST_UNUSUAL + 1), moments.values()):
        for change in _changes(moment, functools.partial(after.ways_to_success, most=unusual)):
            rest = after.way_to_success(change.way, unusual - change.unusual_count)
            if rest is not None:
                later = (outcome for way in rest for outcome in way.outcomes)
                then = [*change.way.outcomes[change.place + 1 :], *later]
                ended = tuple(outcome for outcome in then if outcome.status != _RUNNING)
                return Counterfactual(
                    moment.number, moment.time_sec, change.was, change.instead, ended, unusual
                )
    return None


class WhatIfSearch:
    """Answers queries about the effect of another outcome in a run.

    Args:
        simulated: The tree with stub leaves; not usable afterwards.
        names: The names of the nodes that ran, in pre-order.

    Raises:
        UndecidableError: If the tree's runs cannot be searched.
        OtherTreeError: If the tree has nodes other than those that ran.
    """

    def __init__(self, simulated: SimulatedTree, names: Sequence[str]) -> None:
        self._runs = TreeRuns(simulated, names)
        self._after = _Continuations(self._runs)

    def consequences(self, record: Iterable[Event], leaf: int) -> list[WhatIfResult]:
        """Return the consequences of each other outcome of a leaf in a record's last tick.

        Args:
            record: The run up to that tick.
            leaf: The leaf's number.

        Raises:
            UndecidableError: If the record is not one of the tree's runs.
        """
        self._runs.renew()
        moments = self._runs.locate_all(record)
        found: dict[str, _OtherOutcome] = {}
        for change in _changes(moments[-1], self._runs.possible_ticks) if moments else ():
            if change.was.number != leaf:
                continue
            known = found.setdefault(change.instead.outcome, change)
            if change.unusual_count < known.unusual_count:
                found[change.instead.outcome] = change
        return [self._after.follow(change) for change in found.values()]


class _OtherOutcome(NamedTuple):
    """An outcome that could have been different.

    Attributes:
        way: The tick with the other outcome.
        place: The index of the outcome in the tick.
        was: The leaf's outcome in the run.
    """

    way: PossibleTick
    place: int
    was: Event

    @property
    def instead(self) -> Event:
        """The other outcome."""
        return self.way.outcomes[self.place]

    @property
    def unusual_count(self) -> int:
        """The number of unusual outcomes in the rest of the tick."""
        return sum(self.way.unusual[self.place :])


def _changes(moment: FoundTick, ways_of: Callable[[bytes], Iterable[PossibleTick]]) -> list[_OtherOutcome]:
    """Return the outcomes in a tick that could have been different, the last one first.

    Args:
        moment: The tick.
        ways_of: Returns the other ticks of a state.
    """
    changes = []
    for state, was in moment.ways:
        for way in ways_of(state):
            for place, (one, other) in enumerate(zip(was.outcomes, way.outcomes, strict=False)):
                if one != other:
                    # If another leaf follows, a timer caused the difference.
                    if one.number == other.number:
                        changes.append(_OtherOutcome(way, place, one))
                    break
    return sorted(changes, key=lambda change: -change.place)


class _Continuations:
    """Continuations of a tree's runs."""

    def __init__(self, runs: TreeRuns) -> None:
        self._runs = runs
        self._hopeless: dict[bytes, int] = {}
        self._successful: dict[tuple[bytes, int], list[PossibleTick]] = {}

    def follow(self, change: _OtherOutcome) -> WhatIfResult:
        """Return the consequence of another outcome: some usual ticks until the tree has ended."""
        way, outcomes = change.way, list(change.way.outcomes[change.place + 1 :])
        for _ in range(_MOST_FOLLOWED):
            ways = self._runs.possible_ticks(way.state) if way.root == _RUNNING else []
            if not ways:
                break
            way = min(ways, key=lambda each: sum(each.unusual))
            outcomes += way.outcomes
        then = tuple(outcome for outcome in outcomes if outcome.status != _RUNNING)
        return WhatIfResult(change.was, change.instead, then, way.root)

    def ways_to_success(self, state: bytes, most: int) -> list[PossibleTick]:
        """Return the ticks of a state that can lead to a success of the root.

        Args:
            state: The state.
            most: The maximum number of unusual outcomes from the last one of the tick on.
        """
        # Most ticks of a long run lead to few states.
        found = self._successful.get((state, most))
        if found is None:
            ways = [way for way in self._runs.possible_ticks(state) if way.outcomes]
            found = [way for way in ways if self.way_to_success(way, most - way.unusual[-1]) is not None]
            self._successful[state, most] = found
        return found

    def way_to_success(self, way: PossibleTick, most: int) -> list[PossibleTick] | None:
        """Return the shortest sequence of ticks to a success of the root; None if there is none.

        Args:
            way: The tick.
            most: The maximum number of unusual outcomes in these ticks.
        """
        if way.root == _SUCCESS and most >= 0:
            return []
        if most < 0 or way.root != _RUNNING or self._is_hopeless(way.state, most):
            return None
        origins: dict[tuple[bytes, int], tuple[tuple[bytes, int], PossibleTick] | None] = {
            (way.state, 0): None
        }
        waiting = deque(origins)
        while waiting:
            place = waiting.popleft()
            state, used = place
            for each in self._runs.possible_ticks(state):
                after = each.state, used + sum(each.unusual)
                if after in origins or after[1] > most or self._is_hopeless(each.state, most - after[1]):
                    continue
                origins[after] = place, each
                if each.root == _SUCCESS:
                    return _trace_back(origins, after)
                if each.root == _RUNNING:
                    waiting.append(after)
        if not self._runs.is_spent:
            for state, used in origins:
                self._hopeless[state] = max(most - used, self._hopeless.get(state, -1))
        return None

    def _is_hopeless(self, state: bytes, most: int) -> bool:
        return self._hopeless.get(state, -1) >= most


def _trace_back(
    origins: Mapping[tuple[bytes, int], tuple[tuple[bytes, int], PossibleTick] | None],
    place: tuple[bytes, int],
) -> list[PossibleTick]:
    found = []
    origin = origins[place]
    while origin is not None:
        place, way = origin
        found.append(way)
        origin = origins[place]
    return found[::-1]
