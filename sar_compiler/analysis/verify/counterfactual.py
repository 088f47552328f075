"""Finds the smallest change that lets a recorded run succeed, and the effects of other outcomes.

The recorded run is located among all runs of the tree, tick by tick. Then the search tries other continuations, from
the last tick backwards.
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
# The maximum number of unusual outcomes after the changed outcome.
_MAX_UNUSUAL = 2
# The maximum number of ticks that are explored after a changed outcome.
_MAX_FOLLOWED = 12


class Counterfactual(NamedTuple):
    """A changed outcome that would have made a run succeed.

    Attributes:
        tick: The number of the latest tick in which the outcome could have been different.
        time_sec: The time of this tick in seconds since the start of the run.
        was: The outcome of the leaf in this tick.
        instead: The changed outcome.
        then: The leaf outcomes after the changed outcome, in order, except for RUNNING.
        unusual: The number of unusual outcomes in `then`.
    """

    tick: int
    time_sec: float
    was: Event
    instead: Event
    then: tuple[Event, ...]
    unusual: int


class WhatIfResult(NamedTuple):
    """The consequence that a different outcome of a leaf would have had.

    Attributes:
        was: The outcome of the leaf.
        instead: The changed outcome.
        then: The leaf outcomes after the changed outcome, except for RUNNING. Usual outcomes are preferred.
        root: The final status of the root; RUNNING if the tree continues after the explored ticks.
    """

    was: Event
    instead: Event
    then: tuple[Event, ...]
    root: str


def counterfactual(
    simulated: SimulatedTree, record: Iterable[Event] | TickSource, names: Sequence[str]
) -> Counterfactual | None:
    """Return the latest of the smallest changes that make a run succeed, or None if there is none.

    The change is another outcome of one leaf. After the change, leaves return their usual outcomes, which are their
    first possible outcomes, with as few exceptions as possible and at most two.

    Args:
        simulated: The tree with stub leaves; not usable afterwards.
        record: The run, up to the failure of its root; read once. Repeated outcomes of a leaf may be missing, and so
            may ticks without other outcomes.
        names: The names of the nodes that ran, in pre-order.

    Raises:
        UndecidableError: If the tree's runs cannot be searched, or the recorded run is not a possible run.
        OtherTreeError: If the nodes that ran are not the nodes of the tree.
    """
    runs = TreeRuns(simulated, names)
    after = _Continuations(runs)
    # The possible changes of a tick depend only on its matches. So among ticks with equal matches, only the latest is kept.
    moments: dict[int, FoundTick] = {}
    for moment in reversed(runs.locate_all(record)):
        moments.setdefault(id(moment.matches), moment)
    for unusual, moment in itertools.product(range(_MAX_UNUSUAL + 1), moments.values()):
        for change in _changes(moment, functools.partial(after.ticks_to_success, most=unusual)):
            rest = after.path_to_success(change.tick, unusual - change.unusual_count)
            if rest is not None:
                later = (outcome for tick in rest for outcome in tick.outcomes)
                then = [*change.tick.outcomes[change.place + 1 :], *later]
                ended = tuple(outcome for outcome in then if outcome.status != _RUNNING)
                return Counterfactual(
                    moment.number, moment.time_sec, change.was, change.instead, ended, unusual
                )
    return None


class WhatIfSearch:
    """Finds the effects that different outcomes of a leaf would have had in a recorded run.

    Args:
        simulated: The tree with stub leaves; not usable afterwards.
        names: The names of the nodes that ran, in pre-order.

    Raises:
        UndecidableError: If the tree's runs cannot be searched.
        OtherTreeError: If the nodes that ran are not the nodes of the tree.
    """

    def __init__(self, simulated: SimulatedTree, names: Sequence[str]) -> None:
        self._runs = TreeRuns(simulated, names)
        self._after = _Continuations(self._runs)

    def consequences(self, record: Iterable[Event], leaf: int) -> list[WhatIfResult]:
        """Return the consequences of all other outcomes that a leaf could have had in the last recorded tick.

        Args:
            record: The recorded run, up to the tick.
            leaf: The leaf's number.

        Raises:
            UndecidableError: If the recorded run is not a possible run of the tree.
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
        tick: The tick with the other outcome.
        place: The index of the other outcome in the tick.
        was: The leaf's outcome in the recorded run.
    """

    tick: PossibleTick
    place: int
    was: Event

    @property
    def instead(self) -> Event:
        """The other outcome."""
        return self.tick.outcomes[self.place]

    @property
    def unusual_count(self) -> int:
        """The number of unusual outcomes in the tick, counted from the different outcome on."""
        return sum(self.tick.unusual[self.place :])


def _changes(
    moment: FoundTick, ticks_of_state: Callable[[bytes], Iterable[PossibleTick]]
) -> list[_OtherOutcome]:
    """Return the outcomes of a tick that could have been different. The latest outcome comes first.

    Args:
        moment: The recorded tick.
        ticks_of_state: Returns the ticks of a state that may replace the recorded tick.
    """
    changes = []
    for state, was in moment.matches:
        for tick in ticks_of_state(state):
            for place, (one, other) in enumerate(zip(was.outcomes, tick.outcomes, strict=False)):
                if one != other:
                    # If the next outcome is of another leaf, a timer caused the difference.
                    if one.number == other.number:
                        changes.append(_OtherOutcome(tick, place, one))
                    break
    return sorted(changes, key=lambda change: -change.place)


class _Continuations:
    """Searches for ways in which the runs of a tree can continue."""

    def __init__(self, runs: TreeRuns) -> None:
        self._runs = runs
        self._hopeless: dict[bytes, int] = {}
        self._successful: dict[tuple[bytes, int], list[PossibleTick]] = {}

    def follow(self, change: _OtherOutcome) -> WhatIfResult:
        """Find the consequence of a changed outcome. Play the most usual ticks until the root has ended."""
        tick, outcomes = change.tick, list(change.tick.outcomes[change.place + 1 :])
        for _ in range(_MAX_FOLLOWED):
            ticks = self._runs.possible_ticks(tick.state) if tick.root == _RUNNING else []
            if not ticks:
                break
            tick = min(ticks, key=lambda each: sum(each.unusual))
            outcomes += tick.outcomes
        then = tuple(outcome for outcome in outcomes if outcome.status != _RUNNING)
        return WhatIfResult(change.was, change.instead, then, tick.root)

    def ticks_to_success(self, state: bytes, most: int) -> list[PossibleTick]:
        """Return the ticks from a state after which the root can still succeed.

        Args:
            state: The state.
            most: The maximum number of unusual outcomes, from the last outcome of the tick on.
        """
        # Most ticks of a long run lead to few states.
        found = self._successful.get((state, most))
        if found is None:
            ticks = [tick for tick in self._runs.possible_ticks(state) if tick.outcomes]
            found = [
                tick for tick in ticks if self.path_to_success(tick, most - tick.unusual[-1]) is not None
            ]
            self._successful[state, most] = found
        return found

    def path_to_success(self, tick: PossibleTick, most: int) -> list[PossibleTick] | None:
        """Return the fewest ticks after *tick* with which the root succeeds, or None if that is impossible.

        Args:
            tick: The tick.
            most: The maximum number of unusual outcomes in the sequence.
        """
        if tick.root == _SUCCESS and most >= 0:
            return []
        if most < 0 or tick.root != _RUNNING or self._is_hopeless(tick.state, most):
            return None
        origins: dict[tuple[bytes, int], tuple[tuple[bytes, int], PossibleTick] | None] = {
            (tick.state, 0): None
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
        place, tick = origin
        found.append(tick)
        origin = origins[place]
    return found[::-1]
