"""Monitor a run for violations of properties and of proofs' assumptions.

A leaf's outcome determines the facts, exactly as in a proof: its script `then` is run on facts that start as in the run. The
monitors are those of the search, and receive the same events in the same order. So a run violates a property here at the
event at which `verify` reports it.
"""

from collections import deque
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import replace
from enum import Enum
from typing import NamedTuple

from sar_compiler.analysis.simulated_tree import SimulatedTree
from sar_compiler.analysis.state_search.probabilities import LimitUse
from sar_compiler.analysis.state_search.trail import Guarded, Trail
from sar_compiler.analysis.stub_leaf import FactVariables, StubLeaf, StubLeafError
from sar_compiler.analysis.verify.limits import spending_conditions
from sar_compiler.analysis.verify.properties import ConditionError, Properties, PropertyFile, properties_of
from sar_compiler.analysis.verify.recorded_runs import OtherTreeError
from sar_compiler.analysis.verify.state import EventAlphabet, PreparedTree
from sar_compiler.compiler import CompiledTree
from sar_compiler.runtime.events import HALTED, RETURNED, STARTED, TICKED, Event
from sar_compiler.runtime.expressions import name_uses
from sar_compiler.runtime.kernel.cells import WORDS
from sar_compiler.runtime.kernel.entry_cells import EntryCells
from sar_compiler.runtime.outcomes import Outcome
from sar_compiler.runtime.script import parse
from sar_compiler.runtime.variables import ScriptValue, VariableError
from sar_compiler.runtime.walking import pre_order

_MOST_TOLD = 20
"""The number of events listed that led to an alarm, and of those that properties receive."""


class WatchedEvent(NamedTuple):
    """An event of a monitored run.

    Attributes:
        time_sec: Its time, seconds since the run's start.
        tick: Its tick, from 1.
        number: The leaf's number.
        action: The event of the leaf, in a word.
    """

    time_sec: float
    tick: int
    number: int
    action: str


class AlarmCause(Enum):
    """The cause of an alarm."""

    BROKEN = "a property was violated"
    OWED = "a required event was missing when the run was over"
    ASSUMPTION = "a verification assumption was violated"
    UNJUDGED = "a condition cannot be evaluated"

    @property
    def is_broken(self) -> bool:
        """Whether a property is violated."""
        return self in (AlarmCause.BROKEN, AlarmCause.OWED)


class WatchAlarm(NamedTuple):
    """An alarm of a monitored run.

    Attributes:
        cause: The cause.
        about: The name of the property, or the text of the assumption.
        event: The event, `OpenDoor opened`; empty for none.
        tick: The number of the tick, from 1.
        number: The leaf's number; None for no leaf.
        run: The last events that led there, in order: outcomes and halts without repetitions, and events of properties.
    """

    cause: AlarmCause
    about: str
    event: str
    tick: int
    number: int | None
    run: tuple[WatchedEvent, ...]

    @property
    def sentence(self) -> str:
        """The alarm in a sentence."""
        if self.cause is AlarmCause.ASSUMPTION:
            return f"Assumption failed: {self.about}"
        if self.cause is AlarmCause.UNJUDGED:
            return f"Not monitored: {self.about}"
        how = "pending at the end" if self.cause is AlarmCause.OWED else self.event or "at the end"
        return f"Property violated: {self.about} ({how})"


class _OwnKeys(FactVariables):
    """The variables of a monitored run: assumed facts, and keys that the tree itself writes."""

    def create(self, name: str, value: ScriptValue) -> ScriptValue:
        """Write a fact."""
        return super().create(name, value) if self.is_fact(name) else value

    def assign(self, name: str, value: ScriptValue) -> ScriptValue:
        """Write a fact."""
        return super().assign(name, value) if self.is_fact(name) else value


class _HeldCondition:
    """The value of a condition before a leaf's event changes the state."""

    def __init__(self, holds: Callable[[], bool], tell: Callable[[str], None]) -> None:
        self._holds, self._tell = holds, tell
        self.held = False

    def evaluate(self) -> None:
        """Check whether it holds."""
        try:
            self.held = self._holds()
        except ConditionError as error:
            self.held = False
            self._tell(str(error))


class RuntimeMonitor:
    """Monitors one run of a tree.

    Args:
        simulated: The tree with stub leaves, whose facts start as in the run; it is used up.
        file: The file of properties; None for none.
        tags: The tags of leaves that a tree can have.
        watched: The monitored tree, whose keys are read. By default the simulated tree's, written by its leaves' scripts only.
        clock: Returns the time, seconds since the run's start.
        limits: The facts that only limit how often an event happens. Consecutive ticks of a condition (a paused mission) are one event.

    Raises:
        TreeError: If the file does not match the tree; carries the findings.

    Attributes:
        file: The file of properties.
        properties: The properties.
        alarms: The alarms since the last read; a property and an assumption are reported once.
        broken: The names of the violated properties.
    """

    def __init__(
        self,
        simulated: SimulatedTree,
        file: PropertyFile | None,
        tags: Collection[str] = (),
        watched: CompiledTree | None = None,
        clock: Callable[[], float] = lambda: 0.0,
        limits: Collection[str] = (),
    ) -> None:
        prepared = PreparedTree(simulated, EventAlphabet(simulated))
        keys = None if watched is None else watched.instance.scope
        self.properties: Properties = properties_of(file, prepared, tags, keys)
        if watched is not None:
            _read_keys_of(watched, simulated)
        self.file = file
        self.alarms: list[WatchAlarm] = []
        self.broken: set[str] = set()
        self._told: set[str] = set()
        self._clock = clock
        self._leaves = {leaf.number: leaf for leaf in simulated.leaves}
        self._alphabet, self._facts = prepared.alphabet, simulated.facts
        self._numbers = _numbers(prepared.alphabet)
        rules = self.properties.rules
        self._looks: dict[int, list[_HeldCondition]] = {}
        guarded = {
            event: [self._guard_state(event, each) for each in some] for event, some in rules.guarded.items()
        }
        monitors = rules.monitors
        self._trail = Trail(guarded, monitors.relevant_events, monitors.next_state, EntryCells())
        self._trail.begin(0)
        self._tick, self._root = 1, ""
        # The last events that properties receive, and the last others, each with its position in the run.
        self._heard: deque[tuple[int, WatchedEvent]] = deque(maxlen=_MOST_TOLD)
        self._others: deque[tuple[int, WatchedEvent]] = deque(maxlen=_MOST_TOLD)
        self._count = 0
        self._hears = monitors.relevant_events.union(rules.guarded)
        # For each leaf: its last event, and the tick of that.
        self._last: dict[int, tuple[str, int]] = {}
        self._spending = LimitUse(
            spending_conditions(simulated, limits), [*map(simulated.facts.resolve, limits)]
        )

    @property
    def state_number(self) -> int:
        """The state of the properties as a number, which determines `pending_properties`."""
        return self._trail.watched

    @property
    def pending_properties(self) -> list[str]:
        """The names of the properties that still require an event."""
        owed = self.properties.rules.monitors.pending_monitors(self._trail.watched)
        return [name for number, name in enumerate(self.properties.names) if owed >> number & 1]

    def _guard_state(self, event: int, guard: Guarded) -> Guarded:
        leaf, _ = self._alphabet.outcomes[event]
        look = _HeldCondition(guard.holds, self._cannot_judge)
        self._looks.setdefault(leaf.number, []).append(look)
        return replace(guard, holds=lambda: look.held)

    def process_event(self, event: Event) -> None:
        """Process an event of a run that is read or replayed."""
        if event.what == TICKED:
            self.end_tick(event.status)
            return
        self.on_before_event(event.number)
        if event.what == RETURNED:
            self.on_status(event.number, event.status, event.label)
        elif event.what == STARTED:
            self.on_start(event.number)
        elif event.what == HALTED:
            self.on_halt(event.number)

    def raise_fact(self, name: str, by: int) -> None:
        """Increase a fact of the tree because of an event outside of leaves, such as a command."""
        entry = self._facts.resolve(name)
        known = entry.read() if entry.exists else None
        if isinstance(known, int | float):
            entry.write(known + by)

    def on_before_event(self, number: int) -> None:
        """Evaluate the conditions on a leaf's next event, before it changes the state."""
        for look in self._looks.get(number, ()):
            look.evaluate()

    def on_start(self, number: int) -> None:
        """Process the start of a leaf."""
        self._add_leaf_event(number, STARTED)

    def on_halt(self, number: int) -> None:
        """Process the halt of a running leaf."""
        self._add_leaf_event(number, HALTED)

    def on_status(self, number: int, status: str, label: str = "") -> None:
        """Process an outcome of a leaf.

        Args:
            number: The leaf's number.
            status: The status.
            label: The label of the outcome; empty if unknown.
        """
        numbers = self._numbers.get((number, RETURNED, status, label))
        if numbers is None:
            self._returns_unknown(number, status, label)
            return
        left = self._spending.spend(number, label or status)
        self._process_outcome(number, numbers, label or status)
        self._spending.restore(left)

    def _process_outcome(
        self, number: int, numbers: Sequence[tuple[int, Outcome | None]], action: str
    ) -> None:
        """Process a declared outcome, which may be one of several."""
        (event, outcome), excluded = numbers[0], None
        if len(numbers) > 1 or (outcome is not None and outcome.when):
            (event, outcome), excluded = self._possible(number, numbers)
        self._add_event(number, action, is_heard=event in self._hears)
        if excluded is not None:
            self._report_assumption(number, *excluded)
        self._trail.add_event(event)
        if self._trail.broken:
            self._report_violation(number, action)
        if outcome is not None and outcome.then:
            self._change(self._leaves[number], outcome)

    def end_tick(self, root: str) -> None:
        """Process the end of a tick with the root's status; empty for an unfinished tick."""
        self._root = root
        self._judge(is_over=False)
        self._spending.end_tick()
        self._spending.begin_tick()
        self._tick += 1

    def conclude(self, *, is_over: bool) -> None:
        """Process the end of the run.

        Args:
            is_over: Whether it met its own end condition, so that further ticks change nothing. Else obligations stay pending.
        """
        if is_over:
            self._tick -= 1
            self._judge(is_over=True)

    def _judge(self, *, is_over: bool) -> None:
        outcome = WORDS.index(self._root)
        try:
            judgement = self.properties.rules.judge(outcome, self._trail.watched, True if is_over else None)
        except ConditionError as error:
            self._cannot_judge(str(error))
            return
        if judgement.ends:
            self._add_alarm(judgement.broken, "", None, judgement.pending)

    def _add_leaf_event(self, number: int, what: str) -> None:
        for event, _ in self._numbers.get((number, what, "", ""), ()):
            self._add_event(number, what, is_heard=event in self._hears)
            self._trail.add_event(event)
            if self._trail.broken:
                self._report_violation(number, what)

    def _possible(
        self, number: int, numbers: Sequence[tuple[int, Outcome | None]]
    ) -> tuple[tuple[int, Outcome | None], tuple[str, str] | None]:
        """Return the possible outcome; if none is possible now, the first one with the reason (`describe_condition`)."""
        leaf = self._leaves[number]
        try:
            for event, outcome in numbers:
                if outcome is None or leaf.is_possible(outcome):
                    return (event, outcome), None
        except StubLeafError as error:
            self._cannot_judge(str(error))
            return numbers[0], None
        return numbers[0], describe_condition(
            leaf, [outcome for _, outcome in numbers if outcome is not None]
        )

    def _returns_unknown(self, number: int, status: str, label: str) -> None:
        """Process an outcome that a leaf has not declared or not identified."""
        self._add_event(number, label or status)
        leaf = self._leaves.get(number)
        if leaf is None:
            return
        known = [each for each in leaf.outcomes if each.status == status]
        if label or not known:
            self._report_assumption(number, describe_undeclared_outcome(leaf, status, label))
        else:
            listed = ", ".join(dict.fromkeys(outcome.name for outcome in known))
            self._report_assumption(
                number, f"'{leaf.name}' reports which of its outcomes it returns: {listed}"
            )

    def _change(self, leaf: StubLeaf, outcome: Outcome) -> None:
        try:
            leaf.change(outcome)
        except StubLeafError as error:
            self._cannot_judge(str(error))

    def _add_event(self, number: int, action: str, *, is_heard: bool = False) -> None:
        if action == STARTED and not is_heard:
            return
        last, self._last[number] = self._last.get(number), (action, self._tick)
        if last not in ((action, self._tick), (action, self._tick - 1)):
            self._count += 1
            event = WatchedEvent(self._clock(), self._tick, number, action)
            (self._heard if is_heard else self._others).append((self._count, event))

    def _report_violation(self, number: int, action: str) -> None:
        broken, self._trail.broken = self._trail.broken, 0
        leaf = self._leaves[number]
        word = "starts" if action == STARTED else action
        self._add_alarm(broken, f"{leaf.name} {word}", number, 0)

    def _add_alarm(self, broken: int, event: str, number: int | None, owed: int) -> None:
        for place, name in enumerate(self.properties.names):
            if broken >> place & 1 and name not in self.broken:
                self.broken.add(name)
                cause = AlarmCause.OWED if owed >> place & 1 else AlarmCause.BROKEN
                self._raise(cause, name, event, number)

    def _report_assumption(self, number: int, about: str, now: str = "") -> None:
        if about not in self._told:
            self._told.add(about)
            leaf = self._leaves[number]
            self._raise(AlarmCause.ASSUMPTION, about + now, f"{leaf.name} {self._last[number][0]}", number)

    def _cannot_judge(self, about: str) -> None:
        if about not in self._told:
            self._told.add(about)
            self._raise(AlarmCause.UNJUDGED, about, "", None)

    def _raise(self, cause: AlarmCause, about: str, event: str, number: int | None) -> None:
        run = tuple(event for _, event in sorted((*self._others, *self._heard)))
        self.alarms.append(WatchAlarm(cause, about, event, self._tick, number, run))


def describe_condition(leaf: StubLeaf, outcomes: Sequence[Outcome]) -> tuple[str, str]:
    """Describe when a leaf can return outcomes that are impossible now, and the current values."""
    whens = dict.fromkeys(outcome.when for outcome in outcomes)
    names = dict.fromkeys(use.name for when in whens for use in name_uses(parse(when)))
    values = ", ".join(f"{name} is {_value(leaf, name)}" for name in names)
    return f"'{leaf.name}' returns '{outcomes[0].name}' only when {' or '.join(whens)}", f"; {values}"


def _value(leaf: StubLeaf, name: str) -> str:
    try:
        return repr(leaf.variables.read(name))
    except VariableError:
        return "not known"


def describe_undeclared_outcome(leaf: StubLeaf, status: str, label: str) -> str:
    """Describe the declared outcomes of a leaf that has returned a different one."""
    listed = ", ".join(dict.fromkeys(outcome.name for outcome in leaf.outcomes))
    return f"'{leaf.name}' returns {listed}, but returned {label or status}"


def _read_keys_of(watched: CompiledTree, simulated: SimulatedTree) -> None:
    """Let stub leaves read the keys of a tree that is ticked.

    Raises:
        OtherTreeError: If it has other nodes.
    """
    behaviours = [*pre_order(watched.root)]
    if [each.name for each in behaviours] != [each.name for each in pre_order(simulated.root)]:
        raise OtherTreeError(
            "the tree cannot be monitored: it has nodes whose children are ticked in an unknown way"
        )
    for leaf in simulated.leaves:
        scope = watched.origins.construction(behaviours[leaf.number].id).instance.scope
        leaf.variables = _OwnKeys(simulated.facts, scope, leaf.variables.enums)


def _numbers(alphabet: EventAlphabet) -> Mapping[tuple[int, str, str, str], list[tuple[int, Outcome | None]]]:
    """Return the indices of outcome events, by the leaf's number, event, status and label.

    If a status has only one outcome, a leaf need not identify it.
    """
    numbers: dict[tuple[int, str, str, str], list[tuple[int, Outcome | None]]] = {}
    labels: dict[tuple[int, str], set[str]] = {}
    for number, (event, (_, outcome)) in enumerate(zip(alphabet.events, alphabet.outcomes, strict=True)):
        key = event.number, event.what, event.status, event.label
        numbers.setdefault(key, []).append((number, outcome))
        labels.setdefault((event.number, event.status), set()).add(event.label)
    for (leaf, status), known in labels.items():
        if status and len(known) == 1:
            numbers[leaf, RETURNED, status, ""] = numbers[leaf, RETURNED, status, known.pop()]
    return numbers
