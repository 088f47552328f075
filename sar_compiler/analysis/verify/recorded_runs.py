"""Finding a recorded run among all runs of its tree.

A record may omit when timers expired and which outcome of a leaf a status stands for. So several ways may match one
recorded tick.
"""

from array import array
from collections.abc import Callable, Collection, Hashable, Iterable, Iterator, Sequence
from typing import NamedTuple

from sar_compiler.analysis.simulated_tree import SimulatedTree
from sar_compiler.analysis.verify.properties import PropertyAutomata, without_properties
from sar_compiler.analysis.verify.state import PreparedTree
from sar_compiler.analysis.verify.stepping import TreeStepper
from sar_compiler.errors import UndecidableError
from sar_compiler.journal.recorded_ticks import LoggedTick, TickSource
from sar_compiler.runtime.events import HALTED, RESET, TICKED, Event
from sar_compiler.runtime.kernel.cells import WORDS
from sar_compiler.runtime.variables import unknown_value_of

# The maximum number of explored ticks times the nodes of the tree: some seconds.
_MOST_TICKED = 5_000_000
# For a state with more ticks, only those are tried that begin like the recorded one.
_MOST_WAYS = 200
_RUNNING, _HALTED, _IDLE, _SKIPPED = "RUNNING", "HALTED", "IDLE", "SKIPPED"
_ENDS = ("SUCCESS", "FAILURE")
# The maximum number of different ticks of a record to keep: some ten megabytes.
_MOST_KEPT = 10_000
# The maximum number of ticks without entries before one with entries, if a record omits these.
_MOST_OMITTED = 100
# The state after a tick that raised.
_NOWHERE = b""


class NotReplayedError(UndecidableError):
    """A recorded run is not a possible run of the tree with the declared outcomes of its leaves."""


class OtherTreeError(UndecidableError):
    """A recorded run belongs to a tree with different nodes."""


def ticks_of(record: Iterable[Event]) -> Iterator[list[Event]]:
    """Yield the ticks of a record, including those without recorded events."""
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


def recorded_ticks(record: Iterable[Event]) -> Iterator[LoggedTick]:
    """Yield the ticks of a record; see `ticks_of`."""
    for tick in ticks_of(record):
        end = tick[-1]
        content = (*[event[1:5] for event in tick], end.statuses)
        yield LoggedTick(end.tick, end.time_sec or 0.0, content, tick.copy)


class ObservedPrefix(NamedTuple):
    """The results of nodes in a record up to a tick.

    Attributes:
        statuses: The last status of each node; empty for one at rest.
        labels: The labels of the last outcomes; None if unknown, so that only the status is compared.
    """

    statuses: dict[int, str]
    labels: dict[int, str | None]

    def with_tick(self, tick: Sequence[Event]) -> "ObservedPrefix":
        """Return the results up to the end of a further tick."""
        *events, end = tick
        came = [event for event in events if event.outcome]
        statuses = {**self.statuses, 0: end.status, **{event.number: event.status for event in came}}
        statuses.update({event.number: "" for event in events if event.what in (HALTED, RESET)})
        return ObservedPrefix(statuses, self.labels | {event.number: event.label or None for event in came})

    def is_known(self, outcome: Event) -> bool:
        """Return whether a result equals the leaf's last one, so that the record may omit it."""
        return _is_same(outcome, self.statuses.get(outcome.number, ""), self.labels.get(outcome.number))


def _is_same(outcome: Event, status: str, label: str | None) -> bool:
    return outcome.status == status and label in (None, outcome.label)


class PossibleTick(NamedTuple):
    """A tick from a state.

    Attributes:
        outcomes: The outcomes of leaves in it.
        root: The root's status.
        state: The state after it.
        unusual: Which of the outcomes are unusual.
        halted: The leaves that are halted in it, and at rest at its end.
        running: The numbers of the nodes that run before it.
        statuses: The status of each node at its end, by its number; empty for a node at rest.
        broken: The rules that it violates, each with the violating event.
    """

    outcomes: tuple[Event, ...]
    root: str
    state: bytes
    unusual: tuple[bool, ...]
    halted: frozenset[int]
    running: frozenset[int] = frozenset()
    statuses: tuple[str, ...] = ()
    broken: tuple[tuple[int, Event], ...] = ()

    def common(self, noted: Sequence[Event], before: ObservedPrefix) -> tuple[int, int]:
        """Return how many recorded outcomes this tick has in order, and how many of its own outcomes match.

        An outcome that may be that of a leaf's condition is passed over if this tick lacks it.

        Args:
            noted: The recorded outcomes.
            before: The state recorded before that tick.
        """
        return _common(self.outcomes, noted, before)

    def other_status(self, recorded: Sequence[tuple[int, str]]) -> tuple[int, str] | None:
        """Return the first node with a different recorded status, and that status; None if all match.

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
            noted: The outcomes recorded in the tick.
            halted: The leaves that were halted in it.
            before: The state recorded before it.
            root: The root's status.
        """
        return (
            self.root == root
            and self.halted == halted
            and self.common(noted, before) == (len(noted), len(self.outcomes))
        )


def _common(outcomes: Sequence[Event], noted: Sequence[Event], before: ObservedPrefix) -> tuple[int, int]:
    """Return what `PossibleTick.common` returns for a tick with these outcomes."""
    told = ObservedPrefix({}, {})
    count = 0
    for place, outcome in enumerate(outcomes):
        known = told if outcome.number in told.statuses else before
        following = count
        while following < len(noted) - 1 and _may_be_missing(outcome, noted[following]):
            following += 1
        if following < len(noted) and _is_noted(outcome, noted[following]):
            told.statuses[outcome.number], told.labels[outcome.number] = outcome.status, outcome.label
            count = following + 1
        elif not known.is_known(outcome):
            return count, place
    while count < len(noted) and noted[count].is_unsure:
        count += 1
    return count, len(outcomes)


def _may_be_missing(outcome: Event, noted: Event) -> bool:
    return noted.is_unsure and not _is_noted(outcome, noted)


def _is_noted(outcome: Event, noted: Event) -> bool:
    return outcome.number == noted.number and _is_same(outcome, noted.status, noted.label or None)


_FoundWays = list[tuple[bytes, PossibleTick]]


class FoundTick(NamedTuple):
    """A recorded tick, located among the tree's runs.

    Attributes:
        number: Its number in the run, from 1.
        time_sec: Its time, seconds since the start of the run.
        ways: Its possible ways, with their possible initial states; ticks with equal ones share the same object.
    """

    number: int
    time_sec: float
    ways: Sequence[tuple[bytes, PossibleTick]]


class FoundTicks:
    """The located ticks of a record, in order, stored compactly, because a run can have a million.

    Attributes:
        omitted: The number of ticks that the record omits.
    """

    def __init__(self) -> None:
        self.omitted = 0
        self._numbers, self._times = array("q"), array("d")
        self._ways: list[_FoundWays] = []

    def __len__(self) -> int:
        return len(self._ways)

    def __getitem__(self, index: int) -> FoundTick:
        return FoundTick(self._numbers[index], self._times[index], self._ways[index])

    def __iter__(self) -> Iterator[FoundTick]:
        return map(FoundTick, self._numbers, self._times, self._ways)

    def __reversed__(self) -> Iterator[FoundTick]:
        return map(FoundTick, reversed(self._numbers), reversed(self._times), reversed(self._ways))

    def append(self, tick: LoggedTick, ways: "_FoundWays") -> None:
        """Add a tick with its possible continuations."""
        self._numbers.append(tick.number)
        self._times.append(tick.time_sec)
        self._ways.append(ways)

    def remove_other_ticks(
        self, states: Collection[bytes], shared: "Callable[[_FoundWays], _FoundWays]"
    ) -> None:
        """Remove the continuations that reach none of the last tick's states."""
        now = frozenset(states)
        known: dict[tuple[int, frozenset[bytes]], tuple[_FoundWays, frozenset[bytes]]] = {}
        for index in range(len(self._ways) - 1, -1, -1):
            ways = self._ways[index]
            kept = known.get((id(ways), now))
            if kept is None:
                left = shared([(state, way) for state, way in ways if way.state in now])
                kept = known[id(ways), now] = left, frozenset(state for state, _ in left)
            self._ways[index], now = kept


class LostTick(NamedTuple):
    """A recorded tick that is impossible after the previous ticks.

    Attributes:
        number: Its number in the run, from 1.
        time_sec: Its time, seconds since the start of the run.
        events: The recorded events; the last one is its end.
        states: Its possible initial states.
        told: The state recorded before it.
        is_last: Whether the record ends with it.
    """

    number: int
    time_sec: float
    events: Sequence[Event]
    states: Sequence[bytes]
    told: ObservedPrefix
    is_last: bool


class _RecordPosition:
    """A position in a record, with the possible states and the previous results.

    Args:
        states: The states that the run can be in.
        told: The recorded results up to here.

    Attributes:
        states, told: The same.
        after: The matching ways and the next position, for each content of a next tick that was looked up.
    """

    def __init__(self, states: frozenset[bytes], told: ObservedPrefix) -> None:
        self.states, self.told = states, told
        self.after: dict[Hashable, tuple[_FoundWays, _RecordPosition]] = {}

    @property
    def key(self) -> Hashable:
        """A key that is equal for equivalent positions."""
        return self.states, frozenset(self.told.statuses.items()), frozenset(self.told.labels.items())


class TreeRuns:
    """All runs of a tree, computed lazily.

    Args:
        simulated: The tree with stub leaves; not usable afterwards.
        names: The names of the nodes that ran, in pre-order.
        rules: The monitored properties; by default none.
        prepared: The tree, if it is prepared for the search already.

    Raises:
        UndecidableError: If the tree's runs cannot be searched.
        OtherTreeError: If the tree has nodes other than those that ran.

    Attributes:
        names: The names of its nodes.
        leaves: The numbers of its stub leaves.
        starts: The possible initial states.
    """

    def __init__(
        self,
        simulated: SimulatedTree,
        names: Sequence[str],
        rules: PropertyAutomata | None = None,
        prepared: PreparedTree | None = None,
    ) -> None:
        # Ticks of a state are distinguished even if they merge again, because their events are needed.
        self.stepper = TreeStepper(
            prepared or PreparedTree.prepare(simulated), rules or without_properties().rules, meets=False
        )
        self.names = [node.behaviour.name for node in self.stepper.flat.nodes]
        if self.names != list(names):
            raise OtherTreeError("the tree's nodes differ from those of the run")
        self.leaves = {leaf.number for leaf in simulated.leaves}
        self._known: dict[bytes, list[PossibleTick]] = {}
        self._raising: dict[bytes, list[PossibleTick]] = {}
        self._wide: set[bytes] = set()
        # For states with a tick that needs an unknown value: the error.
        self._unknown: dict[bytes, Exception] = {}
        self.starts = frozenset({self.stepper.steps.start()})
        # The position at the end of the record that was located last.
        self._end = _RecordPosition(self.starts, ObservedPrefix({}, {}))
        self.renew()

    def renew(self) -> None:
        """Reset the limit of tried ticks."""
        self._left = _MOST_TICKED // len(self.names)

    @property
    def is_spent(self) -> bool:
        """Whether the limit on explored ticks is reached."""
        return not self._left

    def possible_ticks(self, state: bytes) -> list[PossibleTick]:
        """Return the ticks of a state; none once the limit on explored ticks is reached."""
        known = self._known.get(state)
        if known is not None or self.is_spent:
            return known or []
        self._explore_ticks(state, self._left)
        return self._known[state]

    def ticks_like(self, state: bytes, noted: Sequence[Event], before: ObservedPrefix) -> list[PossibleTick]:
        """Return the ticks of a state with the recorded outcomes; all ticks if they are few.

        Ticks with other outcomes are represented by one tick for each first outcome that differs. So their number
        grows with the number of ticked leaves, and not with the number of combinations of their outcomes.

        Args:
            state: The state.
            noted: The outcomes recorded in the tick.
            before: The statuses before it.
        """
        if self._has_few_ticks(state):
            return self._known[state]
        return [way for way in self._play_ticks(state, noted, before) if way.state is not _NOWHERE]

    def _ticks_with(
        self, state: bytes, noted: Sequence[Event], before: ObservedPrefix
    ) -> Iterable[PossibleTick]:
        """Return the ticks of a state with exactly the recorded outcomes; all ticks if the state has few."""
        if self._has_few_ticks(state):
            return self._known[state]
        ways = self._play_ticks(state, noted, before, is_whole=True)
        return (way for way in ways if way.state is not _NOWHERE)

    def _has_few_ticks(self, state: bytes) -> bool:
        """Return whether a state has so few ticks that all are known."""
        if (
            state not in self._known
            and state not in self._wide
            and not self._explore_ticks(state, _MOST_WAYS)
        ):
            del self._known[state]
            self._wide.add(state)
        return state in self._known

    def _explore_ticks(self, state: bytes, most: int) -> bool:
        """Store the ticks of a state; return whether they are complete and few."""
        found: dict[PossibleTick, None] = {}
        for count, way in enumerate(self._play_ticks(state), 1):
            found[way] = None
            if count >= most:
                break
        self._known[state] = [way for way in found if way.state is not _NOWHERE]
        self._raising[state] = [way for way in found if way.state is _NOWHERE]
        return not found or count < most

    def _play_ticks(
        self,
        state: bytes,
        noted: Sequence[Event] | None = None,
        before: ObservedPrefix | None = None,
        *,
        is_whole: bool = False,
    ) -> Iterator[PossibleTick]:
        """Play the ticks of a state until too many were tried.

        Args:
            state: The state.
            noted: Recorded outcomes: only ticks like it are played (see `ticks_like`).
            before: The statuses before it.
            is_whole: Whether only ticks with no other outcomes are yielded.
        """
        self.stepper.steps.restore(state)
        running = frozenset(number for number, status in enumerate(self._statuses()) if status == _RUNNING)
        for step in self.stepper.ticks(state):
            if self.is_spent:
                return
            self._left -= 1
            if step.error is not None and unknown_value_of(step.error) is not None:
                self._unknown[state] = step.error
            way: PossibleTick | None = None
            if not is_whole:
                way = self._last_tick(step.state or _NOWHERE)._replace(running=running)
            if noted is not None and before is not None:
                outcomes = self.stepper.outcomes()
                count, place = _common(outcomes, noted, before)
                if is_whole and (count, place) == (len(noted), len(outcomes)):
                    way = self._last_tick(step.state or _NOWHERE)._replace(running=running)
                if place < len(outcomes):
                    self.stepper.pass_over(place)
            if way is not None:
                yield way

    def beginnings(self, state: bytes, noted: Sequence[Event], before: ObservedPrefix) -> list[PossibleTick]:
        """Return the ticks of a state as `ticks_like` does, including those in which a node raises."""
        if state in self._wide:
            return [*self._play_ticks(state, noted, before)]
        return [*self.possible_ticks(state), *self._raising.get(state, ())]

    def _last_tick(self, state: bytes) -> PossibleTick:
        """Return the last tick, which has not raised an error."""
        statuses = self._statuses()
        tick, broken = self.stepper.tick_record(), self.stepper.violated_properties()
        outcomes = tuple(event for event in tick.events if event.outcome)
        last = {event.number: event.what for event in tick.events if event.what != TICKED}
        halted = frozenset(number for number, what in last.items() if what == HALTED)
        return PossibleTick(
            outcomes,
            tick.root,
            state,
            self.stepper.unusual_outcomes(),
            halted,
            statuses=statuses,
            broken=broken,
        )

    def _statuses(self) -> tuple[str, ...]:
        """Return the statuses of the nodes from their cells; empty for idle nodes."""
        cells = self.stepper.ticker.cells
        return tuple(
            WORDS[cells[node.status_cell]] if cells[node.status_cell] else ""
            for node in self.stepper.flat.nodes
        )

    def restore_before(self, state: bytes, way: PossibleTick, place: int) -> None:
        """Restore the facts and keys before an outcome of a tick, given its index."""
        for step in self.stepper.ticks(state):
            if self._last_tick(step.state or _NOWHERE)._replace(running=way.running) == way:
                self.stepper.restore_before_outcome(place)
                return

    def locate(self, record: Iterable[Event] | TickSource) -> tuple[FoundTicks, LostTick | None]:
        """Find the ticks of a recorded run in the tree, up to the first impossible one.

        Raises:
            UndecidableError: If the tree has too many runs, or a tick depends on an unknown value.
        """
        found, known = FoundTicks(), dict[tuple[int, ...], _FoundWays]()

        def with_shared_ticks(ways: _FoundWays) -> _FoundWays:
            # The ways of equal ticks are one object, which is kept.
            return known.setdefault(tuple(id(way) for _, way in ways), ways)

        # The ways of a tick depend only on its content and on the position before it. A long run has few different
        # ticks, so the results are cached.
        position = _RecordPosition(self.starts, ObservedPrefix({}, {}))
        positions = {position.key: position}
        waiting = record.read_ticks() if isinstance(record, TickSource) else recorded_ticks(record)
        kept = 0
        for tick in waiting:
            after = position.after.get(tick.content)
            if after is None:
                events = tick.events()
                ways = with_shared_ticks(self._find_ways(position, events))
                if not ways and isinstance(record, TickSource) and record.omits_ticks:
                    later = self._find_later_ways(position, events)
                    for step in later[:-1]:
                        found.append(tick, step)
                    found.omitted += len(later[:-1])
                    if later:
                        ways, position = later[-1], _RecordPosition(frozenset(), position.told)
                if events[-1].status in _ENDS and isinstance(record, TickSource) and record.omits_ticks:
                    ways = with_shared_ticks([*ways, *self._halted_ways(ways)])
                if not ways:
                    lost = self._lost_tick(position, events, is_last=next(waiting, None) is None)
                    found.remove_other_ticks(position.states, with_shared_ticks)
                    return found, lost
                following = _RecordPosition(
                    frozenset(way.state for _, way in ways), position.told.with_tick(events)
                )
                kept += 1
                if kept % _MOST_KEPT == 0:
                    positions.clear()
                    position.after.clear()
                after = position.after[tick.content] = ways, positions.setdefault(following.key, following)
            ways, position = after
            found.append(tick, ways)
        found.remove_other_ticks(position.states, with_shared_ticks)
        self._end = position
        return found, None

    def follow(self, earlier: Iterable[TickSource]) -> bool:
        """Begin after earlier runs of the same program, which has halted the tree after each; return False if they are impossible.

        Raises:
            UndecidableError: As `locate`.
        """
        begin = self.starts
        for record in earlier:
            _, lost = self.locate(record)
            ends = self._with_silent_ticks(self._end) if lost is None else frozenset[bytes]()
            self.starts = frozenset(
                halted for state in sorted(ends) for halted in self.stepper.halted(state, begins=True)
            )
            if not self.starts:
                self.starts = begin
                return False
        return True

    def _halted_ways(self, ways: _FoundWays) -> _FoundWays:
        """Return ticks in which the root ends, with the states after the program has halted the tree, which changes no status."""
        return [
            (state, way._replace(state=halted))
            for state, way in ways
            for halted in self.stepper.halted(way.state)
            if halted != way.state
        ]

    def _with_silent_ticks(self, position: "_RecordPosition") -> frozenset[bytes]:
        """Return the states after any number of ticks without a change."""
        end = Event((self.names[0],), 0, TICKED, position.told.statuses.get(0, ""))
        states, found = position.states, set(position.states)
        for _ in range(_MOST_OMITTED):
            ways = self._find_ways(_RecordPosition(states, position.told), [end])
            states = frozenset(way.state for _, way in ways) - found
            if not states:
                break
            found |= states
        return frozenset(found)

    def _find_later_ways(self, position: "_RecordPosition", tick: Sequence[Event]) -> list[_FoundWays]:
        """Return the ways of ticks without any change, and then those of a recorded tick; empty if there are none."""
        end = Event(tick[-1].path, 0, TICKED, position.told.statuses.get(0, ""))
        now, steps = position, list[_FoundWays]()
        seen = {now.states}
        for _ in range(_MOST_OMITTED):
            steps.append(self._find_ways(now, [end]))
            states = frozenset(way.state for _, way in steps[-1])
            if not states or states in seen:
                break
            seen.add(states)
            now = _RecordPosition(states, position.told)
            if ways := self._find_ways(now, tick):
                return [*steps, ways]
        return []

    def _find_ways(self, position: "_RecordPosition", tick: Sequence[Event]) -> _FoundWays:
        """Return the possible ticks that match a recorded one."""
        *events, end = tick
        noted = [event for event in events if event.outcome and event.number in self.leaves]
        halted = self.leaves.intersection(event.number for event in events if event.what == HALTED)
        return [
            (state, way)
            for state in sorted(position.states)
            for way in self._ticks_with(state, noted, position.told)
            if way.fits(noted, halted, position.told, end.status) and way.other_status(end.statuses) is None
        ]

    def _lost_tick(self, position: "_RecordPosition", tick: Sequence[Event], *, is_last: bool) -> LostTick:
        if self.is_spent:
            raise UndecidableError("the tree has too many runs to locate this one among them")
        end, states = tick[-1], sorted(position.states)
        unknown = next(filter(None, map(self._unknown.get, states)), None)
        if unknown is not None:
            raise UndecidableError(f"tick {end.tick}: {unknown}") from unknown
        return LostTick(end.tick, end.time_sec or 0.0, tick, states, position.told, is_last)

    def locate_all(self, record: Iterable[Event] | TickSource) -> FoundTicks:
        """Find all ticks of a recorded run in the tree.

        Raises:
            NotReplayedError: If the run is not one of the tree's runs.
            UndecidableError: If the tree has too many.
        """
        moments, lost = self.locate(record)
        if lost is not None:
            raise NotReplayedError(
                f"the run is not possible in the tree from tick {lost.number} on, {lost.time_sec:.1f} s: "
                "no declared outcome of a leaf matches it there"
            )
        return moments
