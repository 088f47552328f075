"""Locates a recorded run among all possible runs of the tree.

A record does not contain when timers expired, and may not contain which outcome a leaf's status stands for. So several
possible ticks may match a recorded tick.
"""

from array import array
from collections.abc import Callable, Collection, Hashable, Iterable, Iterator, Sequence
from itertools import islice
from typing import NamedTuple

from sar_compiler.analysis.simulated_tree import SimulatedTree
from sar_compiler.analysis.state_search.tick_steps import TickSteps
from sar_compiler.analysis.verify.properties import PropertyAutomata, without_properties
from sar_compiler.analysis.verify.state import PreparedTree
from sar_compiler.analysis.verify.stepping import TreeStepper
from sar_compiler.errors import UndecidableError
from sar_compiler.journal.recorded_ticks import LoggedTick, TickSource
from sar_compiler.runtime.events import HALTED, RESET, TICKED, Event
from sar_compiler.runtime.kernel.cells import WORDS
from sar_compiler.runtime.variables import unknown_value_of

# The maximum product of explored ticks and nodes. Exploring this many takes some seconds.
_MAX_EXPLORED = 5_000_000
# In a state with more ticks, only ticks that begin like the recorded tick are explored.
_MAX_TICKS = 200
_RUNNING, _HALTED, _IDLE, _SKIPPED = "RUNNING", "HALTED", "IDLE", "SKIPPED"
_ENDS = ("SUCCESS", "FAILURE")
# The maximum number of different ticks of a record that are cached. They take some ten megabytes.
_MAX_CACHED = 10_000
# The maximum number of consecutive ticks without entries, in a record that omits such ticks.
_MAX_OMITTED = 100
# The state after a tick that raised an error.
_NO_STATE = b""


class NotReplayedError(UndecidableError):
    """Raised if a recorded run is impossible in its tree, given the outcomes that the leaves declare."""


class OtherTreeError(UndecidableError):
    """Raised if a recorded run does not belong to the given tree, because the nodes differ."""


def ticks_of(record: Iterable[Event]) -> Iterator[list[Event]]:
    """Yield the ticks of a record, including ticks without recorded events."""
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
    """Yield the ticks of a record in the form of logged ticks. Include ticks without recorded events."""
    for tick in ticks_of(record):
        end = tick[-1]
        content = (*[event[1:5] for event in tick], end.statuses)
        yield LoggedTick(end.tick, end.time_sec or 0.0, content, tick.copy)


class ObservedPrefix(NamedTuple):
    """The statuses and labels that a record contains for each node, up to the end of a tick.

    Attributes:
        statuses: The last status of each node, by node number; empty for an idle node.
        labels: The label of each leaf's last outcome, by node number. If a label is None, it is unknown,
            and only the leaf's status is compared.
    """

    statuses: dict[int, str]
    labels: dict[int, str | None]

    def with_tick(self, tick: Sequence[Event]) -> "ObservedPrefix":
        """Return the statuses and labels up to the end of the next tick."""
        *events, end = tick
        outcomes = [event for event in events if event.outcome]
        statuses = {**self.statuses, 0: end.status, **{event.number: event.status for event in outcomes}}
        statuses.update({event.number: "" for event in events if event.what in (HALTED, RESET)})
        return ObservedPrefix(
            statuses, self.labels | {event.number: event.label or None for event in outcomes}
        )

    def is_known(self, outcome: Event) -> bool:
        """Return whether an outcome equals the leaf's last outcome, so that the record may omit it."""
        return _is_same(outcome, self.statuses.get(outcome.number, ""), self.labels.get(outcome.number))


def _is_same(outcome: Event, status: str, label: str | None) -> bool:
    return outcome.status == status and label in (None, outcome.label)


class PossibleTick(NamedTuple):
    """A possible tick of a state.

    Attributes:
        outcomes: The outcomes of leaves in the tick.
        root: The root's status.
        state: The state after the tick.
        unusual: For each outcome, whether it is unusual.
        halted: The numbers of the leaves that are halted in the tick, and idle at its end.
        running: The numbers of the nodes that run before the tick.
        statuses: The status of each node at the end of the tick, by node number; empty for an idle node.
        broken: The rules that the tick violates, each with the event that violates it.
    """

    outcomes: tuple[Event, ...]
    root: str
    state: bytes
    unusual: tuple[bool, ...]
    halted: frozenset[int]
    running: frozenset[int] = frozenset()
    statuses: tuple[str, ...] = ()
    broken: tuple[tuple[int, Event], ...] = ()

    def common(self, recorded: Sequence[Event], before: ObservedPrefix) -> tuple[int, int]:
        """Compare this tick with a record.

        Return how many outcomes of the record and of this tick agree at the start.

        A recorded outcome that may only be the result of a leaf's condition is ignored if this tick lacks it.

        Args:
            recorded: The recorded outcomes.
            before: The recorded results before the tick.
        """
        return _common(self.outcomes, recorded, before)

    def other_status(self, recorded: Sequence[tuple[int, str]]) -> tuple[int, str] | None:
        """Return the number and recorded status of the first node whose status differs in this tick, or None.

        Args:
            recorded: The recorded statuses of the tick, in order, each with the node's number.
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
        self, recorded: Sequence[Event], halted: Collection[int], before: ObservedPrefix, root: str
    ) -> bool:
        """Return whether this tick matches a recorded tick.

        Args:
            recorded: The recorded outcomes.
            halted: The numbers of the leaves that were halted in the recorded tick.
            before: The recorded results before the tick.
            root: The root's recorded status.
        """
        return (
            self.root == root
            and self.halted == halted
            and self.common(recorded, before) == (len(recorded), len(self.outcomes))
        )


def _common(outcomes: Sequence[Event], recorded: Sequence[Event], before: ObservedPrefix) -> tuple[int, int]:
    """Return the result of `PossibleTick.common` for a tick with the given outcomes."""
    observed = ObservedPrefix({}, {})
    count = 0
    for place, outcome in enumerate(outcomes):
        known = observed if outcome.number in observed.statuses else before
        following = count
        while following < len(recorded) - 1 and _may_be_missing(outcome, recorded[following]):
            following += 1
        if following < len(recorded) and _is_recorded(outcome, recorded[following]):
            observed.statuses[outcome.number], observed.labels[outcome.number] = outcome.status, outcome.label
            count = following + 1
        elif not known.is_known(outcome):
            return count, place
    while count < len(recorded) and recorded[count].is_unsure:
        count += 1
    return count, len(outcomes)


def _may_be_missing(outcome: Event, recorded: Event) -> bool:
    return recorded.is_unsure and not _is_recorded(outcome, recorded)


def _is_recorded(outcome: Event, recorded: Event) -> bool:
    return outcome.number == recorded.number and _is_same(outcome, recorded.status, recorded.label or None)


_Matches = list[tuple[bytes, PossibleTick]]


class FoundTick(NamedTuple):
    """A recorded tick, with the possible ticks of the tree that match it.

    Attributes:
        number: The number of the tick in the run, from 1.
        time_sec: The time of the tick in seconds since the start of the run.
        matches: The possible ticks that match, each with its initial state; equal matches are the same object.
    """

    number: int
    time_sec: float
    matches: Sequence[tuple[bytes, PossibleTick]]


class FoundTicks:
    """The recorded ticks that were located.

    They are stored compactly, because a run can have a million ticks.

    Attributes:
        omitted: The number of ticks that the record omits.
    """

    def __init__(self) -> None:
        self.omitted = 0
        self._numbers, self._times = array("q"), array("d")
        self._matches: list[_Matches] = []

    def __len__(self) -> int:
        return len(self._matches)

    def __getitem__(self, index: int) -> FoundTick:
        return FoundTick(self._numbers[index], self._times[index], self._matches[index])

    def __iter__(self) -> Iterator[FoundTick]:
        return map(FoundTick, self._numbers, self._times, self._matches)

    def __reversed__(self) -> Iterator[FoundTick]:
        return map(FoundTick, reversed(self._numbers), reversed(self._times), reversed(self._matches))

    def append(self, tick: LoggedTick, matches: "_Matches") -> None:
        """Append a recorded tick and the possible ticks that match it."""
        self._numbers.append(tick.number)
        self._times.append(tick.time_sec)
        self._matches.append(matches)

    def remove_other_ticks(self, states: Collection[bytes], shared: "Callable[[_Matches], _Matches]") -> None:
        """Remove the matches that do not lead to any of the given states after the last tick."""
        now = frozenset(states)
        known: dict[tuple[int, frozenset[bytes]], tuple[_Matches, frozenset[bytes]]] = {}
        for index in range(len(self._matches) - 1, -1, -1):
            matches = self._matches[index]
            reaching = known.get((id(matches), now))
            if reaching is None:
                left = shared([(state, option) for state, option in matches if option.state in now])
                reaching = known[id(matches), now] = left, frozenset(state for state, _ in left)
            self._matches[index], now = reaching


class LostTick(NamedTuple):
    """A recorded tick that cannot follow the previously recorded ticks.

    Attributes:
        number: The number of the tick in the run, from 1.
        time_sec: The time of the tick in seconds since the start of the run.
        events: The recorded events; the last event is the end of the tick.
        states: The possible states before the tick.
        observed: The recorded results before the tick.
        is_last: Whether the tick is the last recorded tick.
    """

    number: int
    time_sec: float
    events: Sequence[Event]
    states: Sequence[bytes]
    observed: ObservedPrefix
    is_last: bool


class _RecordPosition:
    """A position in a record, with the possible states of the tree and the previously recorded results.

    Args:
        states: The possible states of the run at this position.
        observed: The recorded results before this position.

    Attributes:
        after: The matches and the next position for each tick that was located at this position, by tick content.
    """

    def __init__(self, states: frozenset[bytes], observed: ObservedPrefix) -> None:
        self.states, self.observed = states, observed
        self.after: dict[Hashable, tuple[_Matches, _RecordPosition]] = {}

    @property
    def key(self) -> Hashable:
        """A dictionary key. Two positions with equal keys are equivalent."""
        return self.states, frozenset(self.observed.statuses.items()), frozenset(self.observed.labels.items())


class TreeRuns:
    """All possible runs of a tree. They are computed only when they are needed.

    Args:
        simulated: The tree with stub leaves; not usable afterwards.
        names: The names of the nodes that ran, in pre-order.
        rules: The monitored properties; by default none.
        prepared: The prepared tree, if it was prepared for searches before.

    Raises:
        UndecidableError: If the tree's runs cannot be searched.
        OtherTreeError: If the nodes that ran are not the nodes of the tree.

    Attributes:
        names: The names of the tree's nodes, in pre-order.
        leaves: The numbers of the tree's stub leaves.
        starts: The possible initial states.
    """

    def __init__(
        self,
        simulated: SimulatedTree,
        names: Sequence[str],
        rules: PropertyAutomata | None = None,
        prepared: PreparedTree | None = None,
    ) -> None:
        # Ticks that reach the same intermediate state are not merged, because the events of each tick are needed.
        self.stepper = TreeStepper(
            prepared or PreparedTree.prepare(simulated), rules or without_properties().rules, meets=False
        )
        self.names = [node.behaviour.name for node in self.stepper.flat.nodes]
        if self.names != list(names):
            raise OtherTreeError("the tree's nodes differ from the nodes of the run")
        self.leaves = {leaf.number for leaf in simulated.leaves}
        self._known: dict[bytes, list[PossibleTick]] = {}
        self._raising: dict[bytes, list[PossibleTick]] = {}
        self._wide: set[bytes] = set()
        # The error of a tick that needs an unknown value, by the state in which the tick starts.
        self._unknown: dict[bytes, Exception] = {}
        self.starts = frozenset({self.stepper.steps.start()})
        # The position at the end of the record that was located last.
        self._end = _RecordPosition(self.starts, ObservedPrefix({}, {}))
        self.renew()

    def renew(self) -> None:
        """Reset the counter that limits how many more ticks may be explored."""
        self._left = _MAX_EXPLORED // len(self.names)

    @property
    def is_spent(self) -> bool:
        """Whether the limit on the number of explored ticks is reached."""
        return not self._left

    def possible_ticks(self, state: bytes) -> list[PossibleTick]:
        """Return the ticks that start in a state, or an empty list if the limit on explored ticks is reached."""
        known = self._known.get(state)
        if known is not None or self.is_spent:
            return known or []
        self._explore_ticks(state)
        return self._known[state]

    def ticks_like(
        self, state: bytes, recorded: Sequence[Event], before: ObservedPrefix
    ) -> list[PossibleTick]:
        """Return the ticks from a state that resemble a recorded tick, or all ticks if there are few.

        Ticks with other outcomes are represented by one tick for each first outcome that differs. So their number
        grows with the number of ticked leaves, and not with the number of combinations of outcomes.

        Args:
            state: The state.
            recorded: The recorded outcomes.
            before: The recorded results before the tick.
        """
        if self._has_few_ticks(state):
            return self._known[state]
        return [
            option for option in self._play_ticks(state, recorded, before) if option.state is not _NO_STATE
        ]

    def _ticks_with(
        self, state: bytes, recorded: Sequence[Event], before: ObservedPrefix
    ) -> Iterable[PossibleTick]:
        """Return the ticks from a state with exactly the recorded outcomes, or all ticks if there are few."""
        if self._has_few_ticks(state):
            return self._known[state]
        matches = self._play_ticks(state, recorded, before, is_whole=True)
        return (option for option in matches if option.state is not _NO_STATE)

    def _has_few_ticks(self, state: bytes) -> bool:
        """Return whether the ticks from a state are few enough to store all of them."""
        if state not in self._known and state not in self._wide:
            if self._has_many_ticks(state):
                self._wide.add(state)
            else:
                self._explore_ticks(state)
        return state in self._known

    def _has_many_ticks(self, state: bytes) -> bool:
        """Count the ticks from a state without their records, which take much longer than the ticks."""
        limit, count = min(_MAX_TICKS, self._left), 0
        for count, step in enumerate(islice(self.stepper.ticks(state), limit), 1):  # noqa: B007
            self._note_unknown_value(state, step)
        if count < limit:
            return False
        self._left -= count
        return True

    def _explore_ticks(self, state: bytes) -> None:
        """Store the ticks from a state."""
        found = dict.fromkeys(self._play_ticks(state))
        self._known[state] = [option for option in found if option.state is not _NO_STATE]
        self._raising[state] = [option for option in found if option.state is _NO_STATE]

    def _note_unknown_value(self, state: bytes, step: TickSteps) -> None:
        if step.error is not None and unknown_value_of(step.error) is not None:
            self._unknown[state] = step.error

    def _play_ticks(
        self,
        state: bytes,
        recorded: Sequence[Event] | None = None,
        before: ObservedPrefix | None = None,
        *,
        is_whole: bool = False,
    ) -> Iterator[PossibleTick]:
        """Play the ticks of a state until the limit on explored ticks is reached.

        Args:
            state: The state.
            recorded: The recorded outcomes, if only ticks like the recorded tick are played (see `ticks_like`).
            before: The recorded results before the tick.
            is_whole: Whether only ticks with exactly the recorded outcomes are yielded.
        """
        self.stepper.steps.restore(state)
        running = frozenset(number for number, status in enumerate(self._statuses()) if status == _RUNNING)
        for step in self.stepper.ticks(state):
            if self.is_spent:
                return
            self._left -= 1
            self._note_unknown_value(state, step)
            option: PossibleTick | None = None
            if not is_whole:
                option = self._last_tick(step.state or _NO_STATE)._replace(running=running)
            if recorded is not None and before is not None:
                outcomes = self.stepper.outcomes()
                count, place = _common(outcomes, recorded, before)
                if is_whole and (count, place) == (len(recorded), len(outcomes)):
                    option = self._last_tick(step.state or _NO_STATE)._replace(running=running)
                if place < len(outcomes):
                    self.stepper.pass_over(place)
            if option is not None:
                yield option

    def beginnings(
        self, state: bytes, recorded: Sequence[Event], before: ObservedPrefix
    ) -> list[PossibleTick]:
        """Return the ticks that `ticks_like` returns, and also the ticks that raise errors."""
        if state in self._wide:
            return [*self._play_ticks(state, recorded, before)]
        return [*self.possible_ticks(state), *self._raising.get(state, ())]

    def _last_tick(self, state: bytes) -> PossibleTick:
        """Return the tick that was just played. *state* is the state after this tick."""
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
        """Return the current status of each node, in the order of node numbers.

        The status of an idle node is empty.
        """
        cells = self.stepper.ticker.cells
        return tuple(
            WORDS[cells[node.status_cell]] if cells[node.status_cell] else ""
            for node in self.stepper.flat.nodes
        )

    def restore_before(self, state: bytes, option: PossibleTick, place: int) -> None:
        """Restore the facts and keys as they were before the outcome with index *place* in a tick."""
        for step in self.stepper.ticks(state):
            if self._last_tick(step.state or _NO_STATE)._replace(running=option.running) == option:
                self.stepper.restore_before_outcome(place)
                return

    def locate(self, record: Iterable[Event] | TickSource) -> tuple[FoundTicks, LostTick | None]:
        """Locate the ticks of a recorded run, up to the first impossible tick.

        Raises:
            UndecidableError: If the tree has too many runs, or a tick depends on an unknown value.
        """
        found, known = FoundTicks(), dict[tuple[int, ...], _Matches]()

        def with_shared_ticks(matches: _Matches) -> _Matches:
            # Equal matches are replaced by the same object.
            return known.setdefault(tuple(id(option) for _, option in matches), matches)

        # The matches of a tick depend only on its content and on the position before it. A long run has few different
        # ticks, so the results are cached.
        position = _RecordPosition(self.starts, ObservedPrefix({}, {}))
        positions = {position.key: position}
        waiting = record.read_ticks() if isinstance(record, TickSource) else recorded_ticks(record)
        cached = 0
        for tick in waiting:
            after = position.after.get(tick.content)
            if after is None:
                events = tick.events()
                matches = with_shared_ticks(self._find_matches(position, events))
                if not matches and isinstance(record, TickSource) and record.omits_ticks:
                    later = self._find_later_matches(position, events)
                    for step in later[:-1]:
                        found.append(tick, step)
                    found.omitted += len(later[:-1])
                    if later:
                        matches, position = later[-1], _RecordPosition(frozenset(), position.observed)
                if events[-1].status in _ENDS and isinstance(record, TickSource) and record.omits_ticks:
                    matches = with_shared_ticks([*matches, *self._matches_before_halt(matches)])
                if not matches:
                    lost = self._lost_tick(position, events, is_last=next(waiting, None) is None)
                    found.remove_other_ticks(position.states, with_shared_ticks)
                    return found, lost
                following = _RecordPosition(
                    frozenset(option.state for _, option in matches),
                    position.observed.with_tick(events),
                )
                cached += 1
                if cached % _MAX_CACHED == 0:
                    positions.clear()
                    position.after.clear()
                after = position.after[tick.content] = matches, positions.setdefault(following.key, following)
            matches, position = after
            found.append(tick, matches)
        found.remove_other_ticks(position.states, with_shared_ticks)
        self._end = position
        return found, None

    def follow(self, earlier: Iterable[TickSource]) -> bool:
        """Start where the earlier runs of the program have ended. Return False if these runs are impossible.

        The program has halted the tree after each earlier run.

        Raises:
            UndecidableError: As for `locate`.
        """
        begin = self.starts
        for record in earlier:
            _, lost = self.locate(record)
            ends = self._states_after_silent_ticks(self._end) if lost is None else frozenset[bytes]()
            self.starts = frozenset(
                halted
                for state in sorted(ends)
                for halted in self.stepper.states_after_halt(state, begins=True)
            )
            if not self.starts:
                self.starts = begin
                return False
        return True

    def _matches_before_halt(self, matches: _Matches) -> _Matches:
        """Return the matches in which the root has ended, with the states after the program halts the tree."""
        return [
            (state, option._replace(state=halted))
            for state, option in matches
            for halted in self.stepper.states_after_halt(option.state)
            if halted != option.state
        ]

    def _states_after_silent_ticks(self, position: "_RecordPosition") -> frozenset[bytes]:
        """Return the states that can be reached by any number of ticks without recorded changes."""
        end = Event((self.names[0],), 0, TICKED, position.observed.statuses.get(0, ""))
        states, found = position.states, set(position.states)
        for _ in range(_MAX_OMITTED):
            matches = self._find_matches(_RecordPosition(states, position.observed), [end])
            states = frozenset(option.state for _, option in matches) - found
            if not states:
                break
            found |= states
        return frozenset(found)

    def _find_later_matches(self, position: "_RecordPosition", tick: Sequence[Event]) -> list[_Matches]:
        """Find matches for a recorded tick that follows ticks without changes, which the record omits.

        Return the matches of the omitted ticks and of the tick, or an empty list.
        """
        end = Event(tick[-1].path, 0, TICKED, position.observed.statuses.get(0, ""))
        now, steps = position, list[_Matches]()
        seen = {now.states}
        for _ in range(_MAX_OMITTED):
            steps.append(self._find_matches(now, [end]))
            states = frozenset(option.state for _, option in steps[-1])
            if not states or states in seen:
                break
            seen.add(states)
            now = _RecordPosition(states, position.observed)
            if matches := self._find_matches(now, tick):
                return [*steps, matches]
        return []

    def _find_matches(self, position: "_RecordPosition", tick: Sequence[Event]) -> _Matches:
        """Return the possible ticks that match a recorded tick, each with the state in which the tick starts."""
        *events, end = tick
        recorded = [event for event in events if event.outcome and event.number in self.leaves]
        halted = self.leaves.intersection(event.number for event in events if event.what == HALTED)
        return [
            (state, option)
            for state in sorted(position.states)
            for option in self._ticks_with(state, recorded, position.observed)
            if option.fits(recorded, halted, position.observed, end.status)
            and option.other_status(end.statuses) is None
        ]

    def _lost_tick(self, position: "_RecordPosition", tick: Sequence[Event], *, is_last: bool) -> LostTick:
        if self.is_spent:
            raise UndecidableError(
                "the tree has too many possible runs to locate the recorded run among them"
            )
        end, states = tick[-1], sorted(position.states)
        unknown = next(filter(None, map(self._unknown.get, states)), None)
        if unknown is not None:
            raise UndecidableError(f"tick {end.tick}: {unknown}") from unknown
        return LostTick(end.tick, end.time_sec or 0.0, tick, states, position.observed, is_last)

    def locate_all(self, record: Iterable[Event] | TickSource) -> FoundTicks:
        """Locate all ticks of a recorded run.

        Raises:
            NotReplayedError: If the recorded run is not a possible run of the tree.
            UndecidableError: If the tree has too many runs, or a tick depends on an unknown value.
        """
        moments, lost = self.locate(record)
        if lost is not None:
            raise NotReplayedError(
                f"the recorded run is impossible in this tree: the outcomes that leaves declare cannot produce "
                f"tick {lost.number} ({lost.time_sec:.1f} s)"
            )
        return moments
