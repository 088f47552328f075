"""The smallest change of answers with which a run that was recorded would have succeeded, and what another answer would have led to.

The run is found again among all runs of the tree, tick by tick: that leaves out when timers were up and what a leaf has meant
by a status, which a record does not say. From the last tick backwards, it is then let go on otherwise.
"""

import itertools
from collections import deque
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from typing import NamedTuple

from sar_compiler.checks.verify.properties import without_properties
from sar_compiler.checks.verify.state import Prepared
from sar_compiler.checks.verify.stepping import TreeStepper
from sar_compiler.compiler.simulated_tree import SimulatedTree
from sar_compiler.errors import UndecidableError
from sar_compiler.runtime.events import HALTED, RESET, TICKED, Event
from sar_compiler.runtime.expressions import Assignment
from sar_compiler.runtime.kernel.cells import RUNNING, SUCCESS, WORDS
from sar_compiler.runtime.script import parse

_SUCCESS, _RUNNING = WORDS[SUCCESS], WORDS[RUNNING]
# Answers other than the usual ones after the change, and ticks that are tried, times the nodes of the tree: some seconds.
_MOST_UNUSUAL = 2
_MOST_TICKED = 2_000_000
# Ticks that are followed after another answer.
_MOST_FOLLOWED = 12
# A number that is the same with one less.
_WITHOUT_END = 1e18


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


class Consequence(NamedTuple):
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


class NotReplayedError(UndecidableError):
    """A recorded run is not a possible run of the tree, by the answers that its leaves declare."""


class OtherTreeError(UndecidableError):
    """A recorded run is one of a tree with other nodes."""


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
    runs = _runs_of(simulated, names)
    # What could have been otherwise in a tick is a question of its ways: of ticks with the same ones, the latest is asked.
    moments: dict[int, _FoundTick] = {}
    for moment in reversed(_replayed(runs, record)):
        moments.setdefault(id(moment.ways), moment)
    for unusual, moment in itertools.product(range(_MOST_UNUSUAL + 1), moments.values()):
        for change in moment.changes(runs):
            rest = runs.way_to_success(change.way, unusual - change.unusual)
            if rest is not None:
                later = (answer for way in rest for answer in way.answers)
                then = [*change.way.answers[change.place + 1 :], *later]
                ended = tuple(answer for answer in then if answer.status != _RUNNING)
                return Counterfactual(
                    moment.number, moment.time_sec, change.was, change.instead, ended, unusual
                )
    return None


class Retrospect:
    """What a tree would have done in a run, had a leaf answered otherwise; one question after the other.

    Args:
        simulated: The tree with stub leaves; it is used up.
        names: The names of the nodes that ran, in pre-order.

    Raises:
        UndecidableError: If the tree's runs cannot be gone through.
        OtherTreeError: If the tree has nodes other than those that ran.
    """

    def __init__(self, simulated: SimulatedTree, names: Sequence[str]) -> None:
        self._runs = _runs_of(simulated, names)

    def consequences(self, record: Iterable[Event], leaf: int) -> list[Consequence]:
        """Return what would have followed from each other answer of a leaf in the last tick of a record.

        Args:
            record: The run up to that tick.
            leaf: The leaf's number.

        Raises:
            UndecidableError: If the record is none of the tree's runs.
        """
        self._runs.renew()
        moments = _replayed(self._runs, record)
        found: dict[str, _OtherAnswer] = {}
        for change in moments[-1].changes(self._runs) if moments else ():
            if change.was.number != leaf:
                continue
            known = found.setdefault(change.instead.answer, change)
            if change.unusual < known.unusual:
                found[change.instead.answer] = change
        return [self._runs.followed(change) for change in found.values()]


def lift_limits(simulated: SimulatedTree, known: Collection[str]) -> bool:
    """Let a tree's leaves do as often as they like what is assumed to happen so many times at most; return whether there is such a thing.

    These are the facts that answers only lower: an operator's orders, losses of a connection. Proofs need a limit for them; a
    record shows how often it was.

    Args:
        simulated: The tree with stub leaves.
        known: The facts of which a run has said how much there was.
    """
    scripts = [parse(answer.then) for leaf in simulated.leaves for answer in leaf.answers if answer.then]
    changes = [each for script in scripts for each in script.statements if isinstance(each, Assignment)]
    others = {each.target.name for each in changes if each.operator != "-="}.union(known)
    limits = simulated.fact_values().keys() & {each.target.name for each in changes} - others
    for name in limits:
        simulated.facts.resolve(name).write(_WITHOUT_END)
    return bool(limits)


def _runs_of(simulated: SimulatedTree, names: Sequence[str]) -> "_Runs":
    runs = _Runs(simulated)
    if runs.names != list(names):
        raise OtherTreeError("the tree has nodes other than those that ran")
    return runs


def _ticks(record: Iterable[Event]) -> Iterator[list[Event]]:
    """Yield the ticks of a record, with those between in which nothing was noted."""
    tick: list[Event] = []
    before: Event | None = None
    for event in record:
        tick.append(event)
        if event.what == TICKED:
            if before is not None:
                yield from ([before._replace(tick=number)] for number in range(before.tick + 1, event.tick))
            yield tick
            tick, before = [], event


class _Way(NamedTuple):
    """A tick from a state.

    Attributes:
        answers: What leaves answer in it.
        root: What the root comes to.
        state: The state after it.
        unusual: Which of the answers are other than usual.
    """

    answers: tuple[Event, ...]
    root: str
    state: bytes
    unusual: tuple[bool, ...]

    def fits(self, noted: Collection[int], told: Mapping[int, str], labels: Mapping[int, str | None]) -> bool:
        """Return whether this tick matches a recorded one.

        Args:
            noted: The leaves that were noted in the tick.
            told: What each node has come to last, with this tick.
            labels: Which answers that were, where it is known; else their status counts.
        """
        came = {each.number: each.status for each in self.answers}
        return (
            self.root == told.get(0)
            and all(told.get(node) == status for node, status in came.items())
            and all(labels.get(each.number) in (None, each.label) for each in self.answers)
            and all(node in came for node in noted)
        )


class _OtherAnswer(NamedTuple):
    """An answer that could have been another one.

    Attributes:
        way: The tick with the other one.
        place: Which of its answers that is.
        was: What the leaf has answered.
    """

    way: _Way
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


class _FoundTick(NamedTuple):
    """A recorded tick, found among the tree's runs.

    Attributes:
        number: Which tick it was, from 1.
        time_sec: When it was, seconds since the run began.
        ways: What it can have been, with the states that it can have begun in; ticks with equal ones share the same object.
    """

    number: int
    time_sec: float
    ways: Sequence[tuple[bytes, _Way]]

    def changes(self, runs: "_Runs") -> list[_OtherAnswer]:
        """Return the answers in it that could have been others, the last one first."""
        changes = []
        for state, was in self.ways:
            for way in runs.ways(state):
                pairs = enumerate(zip(was.answers, way.answers, strict=False))
                place, other = next(((place, pair) for place, pair in pairs if pair[0] != pair[1]), (0, None))
                # Another leaf's turn is a timer's doing.
                if other is not None and other[0].number == other[1].number:
                    changes.append(_OtherAnswer(way, place, other[0]))
        return sorted(changes, key=lambda change: -change.place)


class _Runs:
    """All runs of a tree, computed lazily."""

    def __init__(self, simulated: SimulatedTree) -> None:
        # Ticks of one state are all told apart, even where they meet again, for what happened in them is asked.
        stepper = TreeStepper(Prepared.of(simulated), without_properties().rules, meets=False)
        self._stepper = stepper
        self.names = [node.behaviour.name for node in stepper.flat.nodes]
        self.leaves = {leaf.number for leaf in simulated.leaves}
        self._known: dict[bytes, list[_Way]] = {}
        self._hopeless: dict[bytes, int] = {}
        self.renew()

    def renew(self) -> None:
        """Have as many ticks tried anew as may be."""
        self._left = _MOST_TICKED // len(self.names)

    @property
    def start(self) -> bytes:
        """The state before the first tick."""
        return self._stepper.steps.start()

    @property
    def is_spent(self) -> bool:
        """Whether the limit of tried ticks is reached."""
        return not self._left

    def ways(self, state: bytes) -> list[_Way]:
        """Return the ticks of a state; none once too many were tried."""
        known = self._known.get(state)
        if known is not None or self.is_spent:
            return known or []
        found: dict[_Way, None] = {}
        for step in self._stepper.ticks(state):
            if step.state is not None:
                tick = self._stepper.played()
                answers = tuple(event for event in tick.events if event.answer)
                found[_Way(answers, tick.root, step.state, self._stepper.unusual())] = None
            self._left -= 1
            if not self._left:
                break
        known = self._known[state] = list(found)
        return known

    def followed(self, change: _OtherAnswer) -> Consequence:
        """Return what follows from another answer: some ticks as usual, at most until the tree has ended."""
        way, answers = change.way, list(change.way.answers[change.place + 1 :])
        for _ in range(_MOST_FOLLOWED):
            ways = self.ways(way.state) if way.root == _RUNNING else []
            if not ways:
                break
            way = min(ways, key=lambda each: sum(each.unusual))
            answers += way.answers
        then = tuple(answer for answer in answers if answer.status != _RUNNING)
        return Consequence(change.was, change.instead, then, way.root)

    def way_to_success(self, way: _Way, most: int) -> list[_Way] | None:
        """Return the ticks after one up to a success of the root, the fewest; None if there are none.

        Args:
            way: The tick.
            most: How many answers of them can be other than usual.
        """
        if way.root == _SUCCESS and most >= 0:
            return []
        if most < 0 or way.root != _RUNNING or self._is_hopeless(way.state, most):
            return None
        origins: dict[tuple[bytes, int], tuple[tuple[bytes, int], _Way] | None] = {(way.state, 0): None}
        waiting = deque(origins)
        while waiting:
            place = waiting.popleft()
            state, used = place
            for each in self.ways(state):
                after = each.state, used + sum(each.unusual)
                if after in origins or after[1] > most or self._is_hopeless(each.state, most - after[1]):
                    continue
                origins[after] = place, each
                if each.root == _SUCCESS:
                    return _back(origins, after)
                if each.root == _RUNNING:
                    waiting.append(after)
        if not self.is_spent:
            for state, used in origins:
                self._hopeless[state] = max(most - used, self._hopeless.get(state, -1))
        return None

    def _is_hopeless(self, state: bytes, most: int) -> bool:
        return self._hopeless.get(state, -1) >= most


def _back(
    origins: Mapping[tuple[bytes, int], tuple[tuple[bytes, int], _Way] | None], place: tuple[bytes, int]
) -> list[_Way]:
    found = []
    origin = origins[place]
    while origin is not None:
        place, way = origin
        found.append(way)
        origin = origins[place]
    return found[::-1]


def _replayed(runs: _Runs, record: Iterable[Event]) -> list[_FoundTick]:
    """Return the ticks of a run, found again.

    Raises:
        NotReplayedError: If the run is none of the tree's.
    """
    told: dict[int, str] = {}
    labels: dict[int, str | None] = {}
    moments: list[_FoundTick] = []
    # A tick of a state is one object, which `runs` keeps.
    known: dict[tuple[int, ...], list[tuple[bytes, _Way]]] = {}

    def shared(ways: list[tuple[bytes, _Way]]) -> list[tuple[bytes, _Way]]:
        return known.setdefault(tuple(id(way) for _, way in ways), ways)

    now = {runs.start}
    for *events, end in _ticks(record):
        came = {event.number: event for event in events if event.answer}
        told |= {0: end.status, **{node: event.status for node, event in came.items()}}
        labels |= {node: event.label or None for node, event in came.items()}
        noted = runs.leaves.intersection(came)
        ways = [
            (state, way) for state in sorted(now) for way in runs.ways(state) if way.fits(noted, told, labels)
        ]
        if not ways and runs.is_spent:
            raise UndecidableError("the tree has too many runs to find this one again among them")
        if not ways:
            raise NotReplayedError(
                f"the run cannot be found again in the tree from tick {end.tick} on, {end.time_sec or 0.0:.1f} s: "
                "no leaf is known to answer like that there"
            )
        moments.append(_FoundTick(end.tick, end.time_sec or 0.0, shared(ways)))
        now = {way.state for _, way in ways}
        told |= {event.number: "" for event in events if event.what in (HALTED, RESET)}
    for index in range(len(moments) - 1, -1, -1):  # what leads nowhere was not so
        moment = moments[index]
        moments[index] = moment._replace(
            ways=shared([(state, way) for state, way in moment.ways if way.state in now])
        )
        now = {state for state, _ in moments[index].ways}
    return moments
