"""Comparison of a recorded run with all possible runs of its tree.

The comparison finds the tree's possible runs that match the record, and tracks the state of the properties in each of
them. So it determines whether all, some or none of the matching runs violate a property.
"""

from collections import deque
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from enum import Enum
from functools import reduce
from itertools import islice, takewhile
from operator import and_, or_
from typing import NamedTuple

from sar_compiler.analysis.runtime_monitor import (
    RuntimeMonitor,
    WatchAlarm,
    describe_condition,
    describe_undeclared_outcome,
)
from sar_compiler.analysis.simulated_tree import SimulatedTree
from sar_compiler.analysis.state_search.searching import Judgement
from sar_compiler.analysis.stub_leaf import StubLeaf
from sar_compiler.analysis.verify.properties import (
    InapplicableProperty,
    Properties,
    PropertyFile,
    properties_of,
)
from sar_compiler.analysis.verify.recorded_runs import (
    FoundTick,
    LostTick,
    PossibleTick,
    TreeRuns,
    recorded_ticks,
    ticks_of,
)
from sar_compiler.analysis.verify.state import PreparedTree
from sar_compiler.journal.recorded_ticks import LoggedTick, TickSource
from sar_compiler.runtime.events import HALTED, RETURNED, STARTED, Event

_RUNNING, _HALTED = "RUNNING", "HALTED"
_MAX_LISTED = 12
"""The maximum number of preceding events that are listed for a violation or an impossible event."""


class PropertyResult(Enum):
    """The result of a property in a recorded run."""

    KEPT = "kept"
    BROKEN = "violated"
    """Every possible run that matches the record violates the property."""
    IN_DOUBT = "may be violated"
    """Some of the possible runs that match the record violate the property, but not all of them."""
    OPEN = "open"
    """The run was stopped before a required event happened, or the property can only be decided at the run's own end."""


class RecordedProperty(NamedTuple):
    """The result of a property in a recorded run.

    Attributes:
        name: The name of the property.
        fate: The result.
        tick: The number of the tick with the violation, from 1; 0 if there is no violation.
        time_sec: The time of the violation in seconds since the start of the run.
        event: The event that violates the property, such as `OpenDoor opened`; empty for the end of a run.
        place: The location of the event's leaf, `file:line:column`; empty for none.
        by_events: Whether the run was no longer possible for the tree, so that only its events were evaluated.
        run: The last events before the violation.
    """

    name: str
    fate: PropertyResult
    tick: int = 0
    time_sec: float = 0.0
    event: str = ""
    place: str = ""
    by_events: bool = False
    run: tuple[Event, ...] = ()


class ImpossibleEvent(NamedTuple):
    """The first event of a recorded run that is impossible for its tree.

    Attributes:
        tick: The number of the event's tick, from 1.
        time_sec: The time of the event in seconds since the start of the run.
        event: The event, such as `GuardBase lost`.
        place: The location of the event's node, `file:line:column`.
        possible: The events that were possible instead.
        why: The reason why the event is impossible; empty if the reason is unknown.
        run: The last events up to this event.
    """

    tick: int
    time_sec: float
    event: str
    place: str
    possible: tuple[str, ...]
    why: str
    run: tuple[Event, ...]


class Conformance(NamedTuple):
    """The result of comparing a recorded run with all possible runs of its tree.

    Attributes:
        ticks: The number of the last recorded tick.
        misfit: The first impossible event; None if the run was possible.
        properties: The result of each property.
        left_out: The properties that do not apply to the tree.
        assumed: The assumptions about leaves of an imported run, in words.
    """

    ticks: int
    misfit: ImpossibleEvent | None
    properties: tuple[RecordedProperty, ...]
    left_out: tuple[InapplicableProperty, ...]
    assumed: tuple[str, ...] = ()

    @property
    def is_fine(self) -> bool:
        """Whether the run was possible, and no property was violated or may have been violated."""
        wrong = (PropertyResult.BROKEN, PropertyResult.IN_DOUBT)
        return self.misfit is None and not any(each.fate in wrong for each in self.properties)


def conform(
    simulated: SimulatedTree,
    file: PropertyFile | None,
    tags: Collection[str],
    record: Iterable[Event],
    names: Sequence[str],
    *,
    is_over: bool,
    earlier: Iterable[TickSource] = (),
) -> Conformance:
    """Compare a recorded run with all possible runs of its tree.

    Args:
        simulated: The tree with stub leaves, whose facts start as in the recorded run; not usable afterwards.
        file: The properties file; None for no properties.
        tags: The tags of all leaves that a tree may contain.
        record: The events of leaves, which are read several times. Repeated outcomes may be missing, and so may ticks
            without other events.
        names: The names of the nodes that ran, in pre-order.
        is_over: Whether the run met its own end condition. If it was stopped or continues, obligations stay pending.
        earlier: The earlier runs of the same program, which has halted the tree after each run. If one of them is impossible, it is assumed
            that nodes and blackboard keep nothing from these runs.

    Raises:
        TreeError: If the properties file does not match the tree; contains the findings.
        UndecidableError: If the tree's runs cannot be enumerated.
        OtherTreeError: If the nodes that ran are not the nodes of the tree.
    """
    prepared = PreparedTree.prepare(simulated)
    properties = properties_of(file, prepared, tags)
    recorded = _ReplayedRun(TreeRuns(simulated, names, properties.rules, prepared), record, simulated)
    assumed = (
        ()
        if recorded.runs.follow(earlier)
        else (
            "nodes and blackboard keep nothing from the earlier runs, because these runs do not conform to the tree",
        )
    )
    reading = _LastTickReader(record)
    moments, lost = recorded.runs.locate(reading)
    ticks = reading.last_number()
    if lost is not None:  # add the starts and decisions of the tick
        place = len(moments) - moments.omitted
        lost = lost._replace(events=next(islice(ticks_of(record), place, None)))
    if lost is not None and not is_over and recorded.is_unfinished(lost):
        lost = None
    judged = _PropertyEvaluation(recorded, properties, moments)
    if lost is None:
        judged.conclude(is_over=is_over)
    elif file is not None:
        judged.evaluate_rest(RuntimeMonitor(recorded.tree_at_start(), file, tags), lost, is_over=is_over)
    misfit = None if lost is None else recorded.first_impossible_event(lost)
    return Conformance(ticks, misfit, judged.results(), properties.left_out, assumed)


class _LastTickReader(TickSource):
    """Yields each recorded tick once, and stores the last tick.

    Args:
        record: The events of leaves.
    """

    def __init__(self, record: Iterable[Event]) -> None:
        self._source = record if isinstance(record, TickSource) else None
        self._ticks = iter(recorded_ticks(record) if self._source is None else self._source.read_ticks())
        self._last: LoggedTick | None = None

    @property
    def omits_ticks(self) -> bool:
        """Whether ticks without a change may be missing in the record."""
        return self._source is not None and self._source.omits_ticks

    def read_ticks(self) -> Iterator[LoggedTick]:
        """Yield the ticks that were not yielded before."""
        for tick in self._ticks:
            self._last = tick
            yield tick

    def last_number(self) -> int:
        """Read the remaining ticks, and return the number of the last tick, or 0 if there are no ticks."""
        deque(self.read_ticks(), maxlen=0)
        return 0 if self._last is None else self._last.number


class _ReplayedRun:
    """A recorded run, together with all possible runs of the tree that match it."""

    def __init__(self, runs: TreeRuns, record: Iterable[Event], simulated: SimulatedTree) -> None:
        self.runs, self.record = runs, record
        self._simulated = simulated
        self._leaves = {leaf.number: leaf for leaf in simulated.leaves}
        self._judged: dict[bytes, Judgement] = {}

    def tree_at_start(self) -> SimulatedTree:
        """Restore the tree to the start of the run, and return the tree."""
        self.runs.stepper.steps.restore(min(self.runs.starts))
        return self._simulated

    def judgement(self, state: bytes) -> Judgement:
        """Return what is known about a state: whether the run is over, and which properties it violates."""
        known = self._judged.get(state)
        if known is None:
            known = self.runs.stepper.judgement(state)
            if known.is_open:
                idle = all(option.state == state for option in self.runs.possible_ticks(state))
                known = self.runs.stepper.judgement(state, idle=idle)
            self._judged[state] = known
        return known

    def node_location(self, number: int) -> str:
        """Return the location of a node, `file:line:column`."""
        behaviour = self.runs.stepper.flat.nodes[number].behaviour
        element = self._simulated.compiled.origins[behaviour.id].bound.element
        return f"{element.source.path}:{element.line}:{element.column}"

    def led_to(self, tick: int, number: int | None = None) -> tuple[Event, ...]:
        """Return the last events up to the end of a tick, or up to the event of leaf *number* in this tick."""
        led: list[Event] = []
        last: dict[int, str] = {}
        for event in takewhile(lambda each: each.tick <= tick, self.record):
            if event.what in (RETURNED, HALTED) and event.number in self._leaves:
                # A leaf that keeps running has another entry for each new message.
                if event.status != "RUNNING" or last.get(event.number) != event.action:
                    led.append(event)
                last[event.number] = event.action
            if event.tick == tick and event.number == number and event.what != STARTED:
                break
        return tuple(led[-_MAX_LISTED:])

    def _recorded_outcomes(self, lost: LostTick) -> list[Event]:
        return [event for event in lost.events if event.outcome and event.number in self._leaves]

    def is_unfinished(self, lost: LostTick) -> bool:
        """Return whether an impossible tick may just be unfinished or incompletely recorded.

        Only nodes that were running can be recorded as halted.
        """
        outcomes, recorded = self._recorded_outcomes(lost), lost.events[-1].statuses
        halted = {number for number, status in recorded if status == _HALTED}
        ran = {number for number, status in recorded if status == _RUNNING}
        return (
            lost.is_last
            and (len(lost.events) > 1 or bool(recorded))
            and any(
                option.common(outcomes, lost.observed)[0] == len(outcomes) and halted <= ran | option.running
                for state in lost.states
                for option in self.runs.beginnings(state, outcomes, lost.observed)
            )
        )

    def first_impossible_event(self, lost: LostTick) -> ImpossibleEvent:
        """Return the first impossible event of an impossible tick."""
        outcomes = self._recorded_outcomes(lost)
        tried = [
            _Attempt(state, option, *option.common(outcomes, lost.observed))
            for state in lost.states
            for option in self.runs.ticks_like(state, outcomes, lost.observed)
        ]
        most = max((each.common for each in tried), default=0)
        best = [each for each in tried if each.common == most]
        if most < len(outcomes):
            number, said, possible, why = self._wrong_outcome(outcomes, most, best)
        else:
            number, said, possible, why = self._missing_outcome(lost, best)
        run = self.led_to(lost.number, number)
        listed = tuple(dict.fromkeys(possible))
        return ImpossibleEvent(lost.number, lost.time_sec, said, self.node_location(number), listed, why, run)

    def _wrong_outcome(
        self, outcomes: Sequence[Event], most: int, best: "Sequence[_Attempt]"
    ) -> tuple[int, str, list[str], str]:
        """Describe an impossible outcome.

        Return the leaf's number, the event, the possible events and the reason.
        """
        event = outcomes[most]
        is_again = any(each.number == event.number for each in outcomes[:most])
        own = [
            (each, place)
            for each in best
            for place, outcome in enumerate(each.option.outcomes[: each.place + 1])
            if outcome.number == event.number and (place == each.place or not is_again)
        ]
        if not own:
            return (
                event.number,
                event_text(event),
                [each.next for each in best],
                "no possible run ticks this leaf at this point",
            )
        attempt, place = own[0]
        self.runs.restore_before(attempt.state, attempt.option, place)
        possible = [event_text(each.option.outcomes[place]) for each, place in own]
        return (
            event.number,
            event_text(event),
            possible,
            _violated_assumption(self._leaves[event.number], event),
        )

    def _missing_outcome(self, lost: LostTick, best: "Sequence[_Attempt]") -> tuple[int, str, list[str], str]:
        """Describe an event that is missing in the record, in the form that `_wrong_outcome` returns."""
        end, root = lost.events[-1], self.runs.names[0]
        fitting = [each.option for each in best if each.is_whole and each.option.root == end.status]
        going_on = [each for each in best if not each.is_whole]
        if going_on and not fitting:
            state, option, _, place = going_on[0]
            missing, observed = option.outcomes[place], lost.observed
            number, was = missing.number, observed.statuses.get(missing.number, "")
            possible = [each.next for each in going_on]
            if not was:
                return number, f"no outcome of {missing.leaf}", possible, ""
            again = missing._replace(status=was, label=observed.labels.get(number) or "")
            self.runs.restore_before(state, option, place)
            return (
                number,
                f"{missing.leaf} still {again.outcome}",
                possible,
                _violated_assumption(self._leaves[number], again),
            )
        if not fitting:
            return 0, f"{root} {end.status or 'did not end its tick'}", [each.next for each in best], ""
        stopped = {event.number for event in lost.events if event.what == HALTED} & self._leaves.keys()
        differing = min((stopped ^ option.halted for option in fitting), key=len)
        if not differing:
            return self._wrong_status(lost, fitting)
        number = min(differing)
        name = self.runs.names[number]
        word, instead = (HALTED, "continues") if number in stopped else ("continues", HALTED)
        return number, f"{name} {word}", [f"{name} {instead}"], ""

    def _wrong_status(
        self, lost: LostTick, fitting: Sequence[PossibleTick]
    ) -> tuple[int, str, list[str], str]:
        """Describe the impossible status of a node in a tick whose leaf outcomes are all possible."""
        recorded = lost.events[-1].statuses
        wrong = [(each, option) for option in fitting if (each := option.other_status(recorded)) is not None]
        (number, status), _ = wrong[0]
        name = self.runs.names[number]
        possible = [
            f"{name} {option.statuses[number] or 'idle'}" for (node, _), option in wrong if node == number
        ]
        return number, f"{name} {status}", possible, ""


class _Attempt(NamedTuple):
    """A possible tick, the state before it, and its comparison with a recorded tick (`PossibleTick.common`)."""

    state: bytes
    option: PossibleTick
    common: int
    place: int

    @property
    def is_whole(self) -> bool:
        """Whether all outcomes of the possible tick were recorded."""
        return self.place == len(self.option.outcomes)

    @property
    def next(self) -> str:
        """The first event of the possible tick that the recorded tick does not share."""
        if self.is_whole:
            return f"the tick ends with {self.option.root}"
        return event_text(self.option.outcomes[self.place])


def event_text(event: Event) -> str:
    """Return the text of an event as it is written in a properties file, such as `OpenDoor opened`."""
    return f"{event.leaf} {'starts' if event.what == STARTED else event.action}"


def _violated_assumption(leaf: StubLeaf, event: Event) -> str:
    """Describe the assumption that excludes an outcome now.

    Return an empty string if the outcome is possible.
    """
    known = [
        each for each in leaf.outcomes if each.status == event.status and event.label in ("", each.label)
    ]
    if not known:
        return f"it is assumed that {describe_undeclared_outcome(leaf, event.status, event.label)}"
    return (
        ""
        if any(map(leaf.is_possible, known))
        else f"it is assumed that {''.join(describe_condition(leaf, known))}"
    )


class _Violation(NamedTuple):
    """The violation of a property.

    Attributes:
        tick: The tick in which the property was violated.
        time_sec: The time of the violation, in seconds.
        event: The event that violated the property; None if the end of the run violated it.
        by_events: Whether the run was no longer possible for the tree, so that only its events were evaluated.
    """

    tick: int
    time_sec: float
    event: Event | None
    by_events: bool = False


class _PropertyEvaluation:
    """Evaluates properties tick by tick in all possible runs that match a record.

    Args:
        recorded: The recorded run.
        properties: The properties.
        moments: The ticks of the recorded run that are possible for the tree.
    """

    def __init__(self, recorded: _ReplayedRun, properties: Properties, moments: Iterable[FoundTick]) -> None:
        self._compared_run, self._properties = recorded, properties
        self._has_ended = False
        self._open = 0
        self._last = FoundTick(0, 0.0, ())
        # For each possible state of the run, as bits: the properties that some path to the state violates, or that every path violates.
        self._some = dict.fromkeys(recorded.runs.starts, 0)
        self._each = dict(self._some)
        # By property: the first violation on some path, and the tick after which every path has a violation.
        self._doubted: dict[int, _Violation] = {}
        self._broken: dict[int, _Violation] = {}
        for moment in moments:
            self._process_tick(moment)

    def _process_tick(self, moment: FoundTick) -> None:
        """Process a possible tick of the recorded run."""
        some: dict[bytes, int] = {}
        each: dict[bytes, int] = {}
        events: dict[int, Event] = {}
        for state, option in moment.matches:
            judgement = self._compared_run.judgement(option.state)
            self._has_ended |= judgement.ends
            broken = judgement.broken
            for rule, event in option.broken:
                events.setdefault(rule, event)
                broken |= 1 << rule
            some[option.state] = some.get(option.state, 0) | self._some[state] | broken
            each[option.state] = each.get(option.state, -1) & (self._each[state] | broken)
        self._last = moment
        self._record_violations(some, each, events)

    def _record_violations(
        self, some: dict[bytes, int], each: dict[bytes, int], events: Mapping[int, Event]
    ) -> None:
        """Record the properties that this tick is the first to violate, on some path or on every path."""
        self._some, self._each = some, each
        in_some, in_each = reduce(or_, some.values(), 0), reduce(and_, each.values(), -1)
        for rule in range(len(self._properties.names)):
            breakage = _Violation(self._last.number, self._last.time_sec, events.get(rule))
            if in_some >> rule & 1:
                self._doubted.setdefault(rule, breakage)
            if in_each >> rule & 1:
                self._broken.setdefault(rule, breakage)

    def conclude(self, *, is_over: bool) -> None:
        """Process the end of a run whose ticks were all possible.

        Args:
            is_over: Whether the run met its own end condition, so that further ticks would change nothing.
        """
        if is_over:
            stepper, states = self._compared_run.runs.stepper, [*self._some]
            ends = {state: stepper.judgement(state, idle=True) for state in states}
            self._has_ended |= any(each.ends for each in ends.values())
            broken = {state: each.broken for state, each in ends.items()}
            some = {state: self._some[state] | broken[state] for state in states}
            each = {state: self._each[state] | broken[state] for state in states}
            self._record_violations(some, each, {})
        pending = [self._compared_run.judgement(state).pending for state in self._some]
        self._open = reduce(or_, pending, 0)
        if not self._has_ended:
            self._open |= self._at_end

    @property
    def _at_end(self) -> int:
        """A bit set of the properties that are evaluated at the end of a run."""
        count = self._properties.rules.monitors.count
        return (1 << len(self._properties.names)) - (1 << count)

    def evaluate_rest(self, watch: RuntimeMonitor, lost: LostTick, *, is_over: bool) -> None:
        """Evaluate the properties in the rest of an impossible run, using only the run's events."""
        times, names = {}, self._properties.names
        for tick in ticks_of(self._compared_run.record):
            times[tick[-1].tick] = tick[-1].time_sec or 0.0
            for event in tick:
                watch.process_event(event)
        watch.conclude(is_over=is_over)
        for alarm in watch.alarms:
            if alarm.cause.is_broken and alarm.tick >= lost.number:
                led = None if alarm.number is None else self._find_event(alarm)
                breakage = _Violation(alarm.tick, times.get(alarm.tick, 0.0), led, by_events=True)
                self._broken.setdefault(names.index(alarm.about), breakage)
        self._open = sum(1 << names.index(name) for name in watch.pending_properties)
        if not is_over:
            self._open |= self._at_end

    def _find_event(self, alarm: WatchAlarm) -> Event | None:
        said = (
            each
            for each in self._compared_run.record
            if (each.tick, each.number) == (alarm.tick, alarm.number)
        )
        return next((each for each in said if event_text(each) == alarm.event), None)

    def results(self) -> tuple[RecordedProperty, ...]:
        """Return the result of each property."""
        return tuple(self._property_result(rule, name) for rule, name in enumerate(self._properties.names))

    def _property_result(self, rule: int, name: str) -> RecordedProperty:
        breakage, fate = self._broken.get(rule), PropertyResult.BROKEN
        if breakage is None:
            breakage, fate = self._doubted.get(rule), PropertyResult.IN_DOUBT
        if breakage is None:
            return RecordedProperty(
                name, PropertyResult.OPEN if self._open >> rule & 1 else PropertyResult.KEPT
            )
        tick, time_sec, event, by_events = breakage
        number = None if event is None else event.number
        place = "" if number is None else self._compared_run.node_location(number)
        said = "" if event is None else event_text(event)
        run = self._compared_run.led_to(tick, number)
        return RecordedProperty(name, fate, tick, time_sec, said, place, by_events, run)
