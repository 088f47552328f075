"""The smallest change of answers with which a run that was recorded would have succeeded, and what another answer would have led to.

The run is found again among all runs of the tree, tick by tick. From the last tick backwards, it is then let go on otherwise.
"""

import itertools
from collections import deque
from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

from sar_compiler.analysis.simulated_tree import SimulatedTree
from sar_compiler.analysis.verify.recorded_runs import FoundTick, TreeRuns, Way
from sar_compiler.runtime.events import Event
from sar_compiler.runtime.kernel.cells import RUNNING, SUCCESS, WORDS

_SUCCESS, _RUNNING = WORDS[SUCCESS], WORDS[RUNNING]
# Answers other than the usual ones after the change.
_MOST_UNUSUAL = 2
# Ticks that are followed after another answer.
_MOST_FOLLOWED = 12


class Counterfactual(NamedTuple):
    """How a run would have succeeded.

    Attributes:
        tick: The number of the last tick in which something can have been otherwise.
        time_sec: When that was, seconds since the run began.
        was: What the leaf has come to in that tick.
        instead: What it answers instead.
        then: What leaves answer after that, in order, those that go on running left out.
        unusual: How many of these answers are other than usual.
    """

    tick: int
    time_sec: float
    was: Event
    instead: Event
    then: tuple[Event, ...]
    unusual: int


class WhatIfResult(NamedTuple):
    """What would have followed from another answer of a leaf.

    Attributes:
        was: What the leaf has come to.
        instead: What it answers instead.
        then: What leaves answer after that, as usual where they can, those that go on running left out.
        root: What the root comes to: RUNNING, where the tree goes on beyond what was tried.
    """

    was: Event
    instead: Event
    then: tuple[Event, ...]
    root: str


def counterfactual(
    simulated: SimulatedTree, record: Iterable[Event], names: Sequence[str]
) -> Counterfactual | None:
    """Return the smallest change with which a run would have succeeded, the latest of those; None if none was found.

    The change is one leaf's answer. After it leaves answer what is usual, their first answer that is possible, with as few
    exceptions as can be, two at most.

    Args:
        simulated: The tree with stub leaves; it is used up.
        record: The run, up to the failure of its root; read once. Answers that are as the last ones may be left out, and ticks in which
            there are no others.
        names: The names of the nodes that ran, in pre-order.

    Raises:
        UndecidableError: If the tree's runs cannot be gone through, or the record is none of them.
        OtherTreeError: If the tree has nodes other than those that ran.
    """
    runs = TreeRuns(simulated, names)
    after = _Continuations(runs)
    # What could have been otherwise in a tick is a question of its ways: of ticks with the same ones, the latest is asked.
    moments: dict[int, FoundTick] = {}
    for moment in reversed(runs.replayed(record)):
        moments.setdefault(id(moment.ways), moment)
    for unusual, moment in itertools.product(range(_MOST_UNUSUAL + 1), moments.values()):
        for change in _changes(moment, runs):
            rest = after.way_to_success(change.way, unusual - change.unusual)
            if rest is not None:
                later = (answer for way in rest for answer in way.answers)
                then = [*change.way.answers[change.place + 1 :], *later]
                ended = tuple(answer for answer in then if answer.status != _RUNNING)
                return Counterfactual(
                    moment.number, moment.time_sec, change.was, change.instead, ended, unusual
                )
    return None


class WhatIfSearch:
    """What a tree would have done in a run, had a leaf answered otherwise; one question after the other.

    Args:
        simulated: The tree with stub leaves; it is used up.
        names: The names of the nodes that ran, in pre-order.

    Raises:
        UndecidableError: If the tree's runs cannot be gone through.
        OtherTreeError: If the tree has nodes other than those that ran.
    """

    def __init__(self, simulated: SimulatedTree, names: Sequence[str]) -> None:
        self._runs = TreeRuns(simulated, names)
        self._after = _Continuations(self._runs)

    def consequences(self, record: Iterable[Event], leaf: int) -> list[WhatIfResult]:
        """Return what would have followed from each other answer of a leaf in the last tick of a record.

        Args:
            record: The run up to that tick.
            leaf: The leaf's number.

        Raises:
            UndecidableError: If the record is none of the tree's runs.
        """
        self._runs.renew()
        moments = self._runs.replayed(record)
        found: dict[str, _OtherAnswer] = {}
        for change in _changes(moments[-1], self._runs) if moments else ():
            if change.was.number != leaf:
                continue
            known = found.setdefault(change.instead.answer, change)
            if change.unusual < known.unusual:
                found[change.instead.answer] = change
        return [self._after.followed(change) for change in found.values()]


class _OtherAnswer(NamedTuple):
    """An answer that could have been another one.

    Attributes:
        way: The tick with the other one.
        place: Which of its answers that is.
        was: What the leaf has answered.
    """

    way: Way
    place: int
    was: Event

    @property
    def instead(self) -> Event:
        """The other answer."""
        return self.way.answers[self.place]

    @property
    def unusual(self) -> int:
        """The number of unusual answers in the tick from this one on."""
        return sum(self.way.unusual[self.place :])


def _changes(moment: FoundTick, runs: TreeRuns) -> list[_OtherAnswer]:
    """Return the answers in a tick that could have been others, the last one first."""
    changes = []
    for state, was in moment.ways:
        for way in runs.ways(state):
            pairs = enumerate(zip(was.answers, way.answers, strict=False))
            place, other = next(((place, pair) for place, pair in pairs if pair[0] != pair[1]), (0, None))
            # Another leaf's turn is a timer's doing.
            if other is not None and other[0].number == other[1].number:
                changes.append(_OtherAnswer(way, place, other[0]))
    return sorted(changes, key=lambda change: -change.place)


class _Continuations:
    """How runs of a tree go on."""

    def __init__(self, runs: TreeRuns) -> None:
        self._runs = runs
        self._hopeless: dict[bytes, int] = {}

    def followed(self, change: _OtherAnswer) -> WhatIfResult:
        """Return what follows from another answer: some ticks as usual, at most until the tree has ended."""
        way, answers = change.way, list(change.way.answers[change.place + 1 :])
        for _ in range(_MOST_FOLLOWED):
            ways = self._runs.ways(way.state) if way.root == _RUNNING else []
            if not ways:
                break
            way = min(ways, key=lambda each: sum(each.unusual))
            answers += way.answers
        then = tuple(answer for answer in answers if answer.status != _RUNNING)
        return WhatIfResult(change.was, change.instead, then, way.root)

    def way_to_success(self, way: Way, most: int) -> list[Way] | None:
        """Return the ticks after one up to a success of the root, the fewest; None if there are none.

        Args:
            way: The tick.
            most: How many answers of them can be other than usual.
        """
        if way.root == _SUCCESS and most >= 0:
            return []
        if most < 0 or way.root != _RUNNING or self._is_hopeless(way.state, most):
            return None
        origins: dict[tuple[bytes, int], tuple[tuple[bytes, int], Way] | None] = {(way.state, 0): None}
        waiting = deque(origins)
        while waiting:
            place = waiting.popleft()
            state, used = place
            for each in self._runs.ways(state):
                after = each.state, used + sum(each.unusual)
                if after in origins or after[1] > most or self._is_hopeless(each.state, most - after[1]):
                    continue
                origins[after] = place, each
                if each.root == _SUCCESS:
                    return _back(origins, after)
                if each.root == _RUNNING:
                    waiting.append(after)
        if not self._runs.is_spent:
            for state, used in origins:
                self._hopeless[state] = max(most - used, self._hopeless.get(state, -1))
        return None

    def _is_hopeless(self, state: bytes, most: int) -> bool:
        return self._hopeless.get(state, -1) >= most


def _back(
    origins: Mapping[tuple[bytes, int], tuple[tuple[bytes, int], Way] | None], place: tuple[bytes, int]
) -> list[Way]:
    found = []
    origin = origins[place]
    while origin is not None:
        place, way = origin
        found.append(way)
        origin = origins[place]
    return found[::-1]
