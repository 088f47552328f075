"""The ticks of a run that was recorded, found again among all runs of its tree.

That leaves out when timers were up and what a leaf has meant by a status, which a record may not say: of a tick there can be several ways that fit.
"""

from collections.abc import Collection, Iterable, Iterator, Sequence
from typing import NamedTuple

from sar_compiler.analysis.simulated_tree import SimulatedTree
from sar_compiler.analysis.verify.properties import PropertyAutomata, without_properties
from sar_compiler.analysis.verify.state import Prepared
from sar_compiler.analysis.verify.stepping import TreeStepper
from sar_compiler.errors import UndecidableError
from sar_compiler.runtime.events import HALTED, RESET, TICKED, Event
from sar_compiler.runtime.kernel.cells import WORDS
from sar_compiler.runtime.variables import unknown_value_of

# Ticks that are tried, times the nodes of the tree: some seconds.
_MOST_TICKED = 5_000_000
_RUNNING, _HALTED, _IDLE, _SKIPPED = "RUNNING", "HALTED", "IDLE", "SKIPPED"
# The state after a tick that was broken off.
_NOWHERE = b""


class NotReplayedError(UndecidableError):
    """A recorded run is not a possible run of the tree, by the answers that its leaves declare."""


class OtherTreeError(UndecidableError):
    """A recorded run is one of a tree with other nodes."""


def ticks_of(record: Iterable[Event]) -> Iterator[list[Event]]:
    """Yield the ticks of a record, with those between in which nothing was noted."""
    tick: list[Event] = []
    before: Event | None = None
    for event in record:
        tick.append(event)
        if event.what == TICKED:
            if before is not None:
                between = range(before.tick + 1, event.tick)
                yield from ([before._replace(tick=number, statuses=())] for number in between)
            yield tick
            tick, before = [], event


class ObservedPrefix(NamedTuple):
    """What a record has told of nodes up to some moment.

    Attributes:
        statuses: What each has come to last; empty for one at rest.
        labels: Which answers that were; None where it is not known, so that the status counts.
    """

    statuses: dict[int, str]
    labels: dict[int, str | None]

    def take(self, tick: Sequence[Event]) -> None:
        """Take a tick."""
        *events, end = tick
        came = [event for event in events if event.answer]
        self.statuses.update({0: end.status, **{event.number: event.status for event in came}})
        self.labels.update({event.number: event.label or None for event in came})
        self.statuses.update({event.number: "" for event in events if event.what in (HALTED, RESET)})

    def is_known(self, answer: Event) -> bool:
        """Return whether an answer is what the leaf has come to last, so that it need not have been noted."""
        return _is_same(answer, self.statuses.get(answer.number, ""), self.labels.get(answer.number))


def _is_same(answer: Event, status: str, label: str | None) -> bool:
    return answer.status == status and label in (None, answer.label)


class Way(NamedTuple):
    """A tick from a state.

    Attributes:
        answers: What leaves answer in it.
        root: What the root comes to.
        state: The state after it.
        unusual: Which of the answers are other than usual.
        halted: The leaves that are stopped in it, and at rest at its end.
        running: The numbers of the nodes that run before it.
        statuses: The status of each node at its end, by its number; empty for a node at rest.
        broken: The rules that it breaks, each with the event that does it.
    """

    answers: tuple[Event, ...]
    root: str
    state: bytes
    unusual: tuple[bool, ...]
    halted: frozenset[int]
    running: frozenset[int] = frozenset()
    statuses: tuple[str, ...] = ()
    broken: tuple[tuple[int, Event], ...] = ()

    def common(self, noted: Sequence[Event], before: ObservedPrefix) -> tuple[int, int]:
        """Return how many of the answers that were noted in a tick this one has, in order, and how many of its own go with them.

        Args:
            noted: The answers that were noted.
            before: What was told before that tick.
        """
        told = ObservedPrefix({}, {})
        count = 0
        for place, answer in enumerate(self.answers):
            known = told if answer.number in told.statuses else before
            if count < len(noted) and _is_noted(answer, noted[count]):
                told.statuses[answer.number], told.labels[answer.number] = answer.status, answer.label
                count += 1
            elif not known.is_known(answer):
                return count, place
        return count, len(self.answers)

    def other_status(self, recorded: Sequence[tuple[int, str]]) -> tuple[int, str] | None:
        """Return the first node with a recorded status that it has not in this tick, with that status; None if all fit.

        Args:
            recorded: The statuses that were recorded in the tick, in their order, each with the node's number.
        """
        ran = {number for number, status in recorded if status == _RUNNING}.union(self.running)
        for number, status in dict(recorded).items():
            now = self.statuses[number]
            is_stopped = status == _HALTED and not now and number in ran
            is_reset = status == _IDLE and not now
            if not (is_stopped or is_reset or status in (now, _SKIPPED)):
                return number, status
        return None

    def fits(
        self, noted: Sequence[Event], halted: Collection[int], before: ObservedPrefix, root: str
    ) -> bool:
        """Return whether this tick matches a recorded one.

        Args:
            noted: The answers that were noted in the tick.
            halted: The leaves that were stopped in it.
            before: What was told before it.
            root: What the root came to.
        """
        return (
            self.root == root
            and self.halted == halted
            and self.common(noted, before) == (len(noted), len(self.answers))
        )


def _is_noted(answer: Event, noted: Event) -> bool:
    return answer.number == noted.number and _is_same(answer, noted.status, noted.label or None)


class FoundTick(NamedTuple):
    """A recorded tick, found among the tree's runs.

    Attributes:
        number: Which tick it was, from 1.
        time_sec: When it was, seconds since the run began.
        ways: What it can have been, with the states that it can have begun in; ticks with equal ones share the same object.
    """

    number: int
    time_sec: float
    ways: Sequence[tuple[bytes, Way]]


class LostTick(NamedTuple):
    """A recorded tick that no run of the tree has, after those before it.

    Attributes:
        number: Which tick it was, from 1.
        time_sec: When it was, seconds since the run began.
        events: What was recorded; the last event is its end.
        states: The states that it can have begun in.
        told: What was told before it.
        is_last: Whether the record ends with it.
    """

    number: int
    time_sec: float
    events: Sequence[Event]
    states: Sequence[bytes]
    told: ObservedPrefix
    is_last: bool


class TreeRuns:
    """All runs of a tree, computed lazily.

    Args:
        simulated: The tree with stub leaves; it is used up.
        names: The names of the nodes that ran, in pre-order.
        rules: The properties that are watched; by default none.
        prepared: The tree, prepared for the search, where it is already.

    Raises:
        UndecidableError: If the tree's runs cannot be gone through.
        OtherTreeError: If the tree has nodes other than those that ran.

    Attributes:
        names: The names of its nodes.
        leaves: The numbers of its stub leaves.
    """

    def __init__(
        self,
        simulated: SimulatedTree,
        names: Sequence[str],
        rules: PropertyAutomata | None = None,
        prepared: Prepared | None = None,
    ) -> None:
        # Ticks of one state are all told apart, even where they meet again, for what happened in them is asked.
        self.stepper = TreeStepper(
            prepared or Prepared.of(simulated), rules or without_properties().rules, meets=False
        )
        self.names = [node.behaviour.name for node in self.stepper.flat.nodes]
        if self.names != list(names):
            raise OtherTreeError("the tree has nodes other than those that ran")
        self.leaves = {leaf.number for leaf in simulated.leaves}
        self._known: dict[bytes, list[Way]] = {}
        self._raising: dict[bytes, list[Way]] = {}
        # Of the states with a tick that needs a value that is not known: what that raises.
        self._unknown: dict[bytes, Exception] = {}
        self.renew()

    def renew(self) -> None:
        """Have as many ticks tried anew as may be."""
        self._left = _MOST_TICKED // len(self.names)

    @property
    def start(self) -> bytes:
        """The state before the first tick."""
        return self.stepper.steps.start()

    @property
    def is_spent(self) -> bool:
        """Whether the limit of tried ticks is reached."""
        return not self._left

    def ways(self, state: bytes) -> list[Way]:
        """Return the ticks of a state; none once too many were tried."""
        known = self._known.get(state)
        if known is not None or self.is_spent:
            return known or []
        self.stepper.steps.restore(state)
        running = frozenset(number for number, status in enumerate(self._statuses()) if status == _RUNNING)
        found: dict[Way, None] = {}
        for step in self.stepper.ticks(state):
            found[self._way(step.state or _NOWHERE)._replace(running=running)] = None
            if step.error is not None and unknown_value_of(step.error) is not None:
                self._unknown[state] = step.error
            self._left -= 1
            if not self._left:
                break
        known = self._known[state] = [way for way in found if way.state is not _NOWHERE]
        self._raising[state] = [way for way in found if way.state is _NOWHERE]
        return known

    def beginnings(self, state: bytes) -> list[Way]:
        """Return the ticks of a state, with those that a node breaks off because it raises."""
        return [*self.ways(state), *self._raising.get(state, ())]

    def _way(self, state: bytes) -> Way:
        """Return the last tick, after which there is a state."""
        statuses = self._statuses()
        tick, broken = self.stepper.played(), self.stepper.broken()
        answers = tuple(event for event in tick.events if event.answer)
        last = {event.number: event.what for event in tick.events if event.what != TICKED}
        halted = frozenset(number for number, what in last.items() if what == HALTED)
        return Way(
            answers, tick.root, state, self.stepper.unusual(), halted, statuses=statuses, broken=broken
        )

    def _statuses(self) -> tuple[str, ...]:
        """Return what the cells of nodes hold now, in words; empty for a node at rest."""
        cells = self.stepper.ticker.cells
        return tuple(WORDS[cells[node.at]] if cells[node.at] else "" for node in self.stepper.flat.nodes)

    def put_before(self, state: bytes, way: Way, place: int) -> None:
        """Have facts and keys hold what they held before an answer of a tick, by its place among the tick's answers."""
        for step in self.stepper.ticks(state):
            if self._way(step.state or _NOWHERE)._replace(running=way.running) == way:
                self.stepper.before_answer(place)
                return

    def found_again(self, record: Iterable[Event]) -> tuple[list[FoundTick], LostTick | None]:
        """Return the ticks of a run, found again, up to the first that is none of the tree's.

        Raises:
            UndecidableError: If the tree has too many runs, or a tick depends on a value that is not known.
        """
        told = ObservedPrefix({}, {})
        moments: list[FoundTick] = []
        # A tick of a state is one object, which is kept.
        known: dict[tuple[int, ...], list[tuple[bytes, Way]]] = {}

        def shared(ways: list[tuple[bytes, Way]]) -> list[tuple[bytes, Way]]:
            return known.setdefault(tuple(id(way) for _, way in ways), ways)

        now, lost = {self.start}, None
        waiting = ticks_of(record)
        for tick in waiting:
            *events, end = tick
            noted = [event for event in events if event.answer and event.number in self.leaves]
            halted = self.leaves.intersection(event.number for event in events if event.what == HALTED)
            ways = [
                (state, way)
                for state in sorted(now)
                for way in self.ways(state)
                if way.fits(noted, halted, told, end.status) and way.other_status(end.statuses) is None
            ]
            if not ways and self.is_spent:
                raise UndecidableError("the tree has too many runs to find this one again among them")
            if not ways:
                unknown = next(filter(None, map(self._unknown.get, now)), None)
                if unknown is not None:
                    raise UndecidableError(f"tick {end.tick}: {unknown}") from unknown
                is_last = next(waiting, None) is None
                lost = LostTick(end.tick, end.time_sec or 0.0, tick, sorted(now), told, is_last)
                break
            moments.append(FoundTick(end.tick, end.time_sec or 0.0, shared(ways)))
            now = {way.state for _, way in ways}
            told.take(tick)
        for index in range(len(moments) - 1, -1, -1):  # what leads nowhere was not so
            moment = moments[index]
            moments[index] = moment._replace(
                ways=shared([(state, way) for state, way in moment.ways if way.state in now])
            )
            now = {state for state, _ in moments[index].ways}
        return moments, lost

    def replayed(self, record: Iterable[Event]) -> list[FoundTick]:
        """Return the ticks of a run, found again.

        Raises:
            NotReplayedError: If the run is none of the tree's.
            UndecidableError: If the tree has too many.
        """
        moments, lost = self.found_again(record)
        if lost is not None:
            raise NotReplayedError(
                f"the run cannot be found again in the tree from tick {lost.number} on, {lost.time_sec:.1f} s: "
                "no leaf is known to answer like that there"
            )
        return moments
