"""Monitors a run for violations of properties and of the assumptions on which proofs depend.

As in a proof, the outcomes of leaves determine the facts: the script `then` of an outcome changes facts that start as in
the run. The monitors are the same as in the search of `verify`, and receive the same events in the same order. So a
violation is reported at the same event as by `verify`.
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

_MAX_LISTED = 20
"""The maximum number of events listed before an alarm, separately for events that properties use and for others."""


class WatchedEvent(NamedTuple):
    """An event of a monitored run.

    Attributes:
        time_sec: The time of the event in seconds since the start of the run.
        tick: The number of the tick, from 1.
        number: The leaf's number.
        action: The label or status of an outcome, or the kind of another event.
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
        event: The event that caused the alarm, such as `OpenDoor opened`; empty for none.
        tick: The number of the tick, from 1.
        number: The leaf's number; None for no leaf.
        run: The last events before the alarm: outcomes and halts without repetitions, and events that properties name.
    """

    cause: AlarmCause
    about: str
    event: str
    tick: int
    number: int | None
    run: tuple[WatchedEvent, ...]

    @property
    def sentence(self) -> str:
        """The alarm as a message."""
        if self.cause is AlarmCause.ASSUMPTION:
            return f"Assumption failed: {self.about}"
        if self.cause is AlarmCause.UNJUDGED:
            return f"Not monitored: {self.about}"
        how = "pending at the end" if self.cause is AlarmCause.OWED else self.event or "at the end"
        return f"Property violated: {self.about} ({how})"


class _ReadOnlyKeys(FactVariables):
    """The variables of a monitored run: facts, and keys that only the running tree writes."""

    def create(self, name: str, value: ScriptValue) -> ScriptValue:
        """Write a value to a fact. Do not write to a key, because only the running tree writes keys."""
        return super().create(name, value) if self.is_fact(name) else value

    def assign(self, name: str, value: ScriptValue) -> ScriptValue:
        """Write a value to a fact. Do not write to a key, because only the running tree writes keys."""
        return super().assign(name, value) if self.is_fact(name) else value


class _EarlyCondition:
    """A condition that is evaluated before a leaf's event changes the state."""

    def __init__(self, holds: Callable[[], bool], report: Callable[[str], None]) -> None:
        self._holds, self._report = holds, report
        self.value = False

    def evaluate(self) -> None:
        """Evaluate the condition and store the result.

        If the evaluation fails, report the error and store False.
        """
        try:
            self.value = self._holds()
        except ConditionError as error:
            self.value = False
            self._report(str(error))


class RuntimeMonitor:
    """Monitors one run of a tree.

    Args:
        simulated: The tree with stub leaves, whose facts start as in the run; not usable afterwards.
        file: The properties file; None for no properties.
        tags: The tags of all leaves that a tree may contain.
        watched: The running tree, whose keys conditions read; by default the simulated tree.
        clock: Returns the time in seconds since the start of the run.
        limits: The facts that limit how often an event can happen. An outcome that a condition repeats on consecutive
            ticks, such as during a pause, decreases them once.

    Raises:
        TreeError: If the properties file does not match the tree; contains the findings.

    Attributes:
        file: The properties file.
        properties: The properties.
        alarms: The alarms so far. Each property and each assumption is reported once.
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
            _bind_keys(watched, simulated)
        self.file = file
        self.alarms: list[WatchAlarm] = []
        self.broken: set[str] = set()
        self._reported: set[str] = set()
        self._clock = clock
        self._leaves = {leaf.number: leaf for leaf in simulated.leaves}
        self._alphabet, self._facts = prepared.alphabet, simulated.facts
        self._numbers = _numbers(prepared.alphabet)
        rules = self.properties.rules
        self._conditions: dict[int, list[_EarlyCondition]] = {}
        guarded = {
            event: [self._guard_state(event, each) for each in some] for event, some in rules.guarded.items()
        }
        monitors = rules.monitors
        self._trail = Trail(guarded, monitors.relevant_events, monitors.next_state, EntryCells())
        self._trail.begin(0)
        self._tick, self._root = 1, ""
        # The last events that properties receive, and the last other events, each with its position in the run.
        self._relevant: deque[tuple[int, WatchedEvent]] = deque(maxlen=_MAX_LISTED)
        self._others: deque[tuple[int, WatchedEvent]] = deque(maxlen=_MAX_LISTED)
        self._count = 0
        self._relevant_numbers = monitors.relevant_events.union(rules.guarded)
        # For each leaf: the last event and its tick.
        self._last: dict[int, tuple[str, int]] = {}
        self._spending = LimitUse(
            spending_conditions(simulated, limits), [*map(simulated.facts.resolve, limits)]
        )

    @property
    def state_number(self) -> int:
        """A number for the state of the properties. If two numbers are equal, so are the `pending_properties`."""
        return self._trail.watched

    @property
    def pending_properties(self) -> list[str]:
        """The names of the properties that require an event that has not happened yet."""
        pending = self.properties.rules.monitors.pending_monitors(self._trail.watched)
        return [name for number, name in enumerate(self.properties.names) if pending >> number & 1]

    def _guard_state(self, event: int, guard: Guarded) -> Guarded:
        leaf, _ = self._alphabet.outcomes[event]
        condition = _EarlyCondition(guard.holds, self._cannot_judge)
        self._conditions.setdefault(leaf.number, []).append(condition)
        return replace(guard, holds=lambda: condition.value)

    def process_event(self, event: Event) -> None:
        """Process an event of a recorded or replayed run."""
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
        """Increase a numeric fact by *by* because of an event outside the tree, such as a command."""
        entry = self._facts.resolve(name)
        known = entry.read() if entry.exists else None
        if isinstance(known, int | float):
            entry.write(known + by)

    def on_before_event(self, number: int) -> None:
        """Evaluate the conditions on a leaf's events before the leaf's next event changes the state."""
        for condition in self._conditions.get(number, ()):
            condition.evaluate()

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
            label: The label of the outcome; empty if the label is unknown.
        """
        numbers = self._numbers.get((number, RETURNED, status, label))
        if numbers is None:
            self._process_undeclared(number, status, label)
            return
        left = self._spending.spend(number, label or status)
        self._process_outcome(number, numbers, label or status)
        self._spending.restore(left)

    def _process_outcome(
        self, number: int, numbers: Sequence[tuple[int, Outcome | None]], action: str
    ) -> None:
        """Process a declared outcome of a leaf. *numbers* are the numbers and outcomes of all matching events."""
        (event, outcome), excluded = numbers[0], None
        if len(numbers) > 1 or (outcome is not None and outcome.when):
            (event, outcome), excluded = self._select_outcome(number, numbers)
        self._add_event(number, action, is_relevant=event in self._relevant_numbers)
        if excluded is not None:
            self._report_assumption(number, *excluded)
        self._trail.add_event(event)
        if self._trail.broken:
            self._report_violation(number, action)
        if outcome is not None and outcome.then:
            self._apply_effects(self._leaves[number], outcome)

    def end_tick(self, root: str) -> None:
        """Process the end of a tick. *root* is the status of the root, and is empty for an unfinished tick."""
        self._root = root
        self._judge(is_over=False)
        self._spending.end_tick()
        self._spending.begin_tick()
        self._tick += 1

    def conclude(self, *, is_over: bool) -> None:
        """Process the end of the run.

        Args:
            is_over: Whether the run met its own end condition. If it was stopped, obligations stay pending.
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
            self._add_event(number, what, is_relevant=event in self._relevant_numbers)
            self._trail.add_event(event)
            if self._trail.broken:
                self._report_violation(number, what)

    def _select_outcome(
        self, number: int, numbers: Sequence[tuple[int, Outcome | None]]
    ) -> tuple[tuple[int, Outcome | None], tuple[str, str] | None]:
        """Return the first outcome that is possible now.

        If no outcome is possible, return the first one and why it is impossible.
        """
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

    def _process_undeclared(self, number: int, status: str, label: str) -> None:
        """Process an outcome that a leaf does not declare, or that a leaf reports without the declared label."""
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
                number, f"'{leaf.name}' reports the label of each returned outcome ({listed})"
            )

    def _apply_effects(self, leaf: StubLeaf, outcome: Outcome) -> None:
        try:
            leaf.change(outcome)
        except StubLeafError as error:
            self._cannot_judge(str(error))

    def _add_event(self, number: int, action: str, *, is_relevant: bool = False) -> None:
        if action == STARTED and not is_relevant:
            return
        last, self._last[number] = self._last.get(number), (action, self._tick)
        if last not in ((action, self._tick), (action, self._tick - 1)):
            self._count += 1
            event = WatchedEvent(self._clock(), self._tick, number, action)
            (self._relevant if is_relevant else self._others).append((self._count, event))

    def _report_violation(self, number: int, action: str) -> None:
        broken, self._trail.broken = self._trail.broken, 0
        leaf = self._leaves[number]
        word = "starts" if action == STARTED else action
        self._add_alarm(broken, f"{leaf.name} {word}", number, 0)

    def _add_alarm(self, broken: int, event: str, number: int | None, pending: int) -> None:
        for place, name in enumerate(self.properties.names):
            if broken >> place & 1 and name not in self.broken:
                self.broken.add(name)
                cause = AlarmCause.OWED if pending >> place & 1 else AlarmCause.BROKEN
                self._raise(cause, name, event, number)

    def _report_assumption(self, number: int, about: str, now: str = "") -> None:
        if about not in self._reported:
            self._reported.add(about)
            leaf = self._leaves[number]
            self._raise(AlarmCause.ASSUMPTION, about + now, f"{leaf.name} {self._last[number][0]}", number)

    def _cannot_judge(self, about: str) -> None:
        if about not in self._reported:
            self._reported.add(about)
            self._raise(AlarmCause.UNJUDGED, about, "", None)

    def _raise(self, cause: AlarmCause, about: str, event: str, number: int | None) -> None:
        run = tuple(event for _, event in sorted((*self._others, *self._relevant)))
        self.alarms.append(WatchAlarm(cause, about, event, self._tick, number, run))


def describe_condition(leaf: StubLeaf, outcomes: Sequence[Outcome]) -> tuple[str, str]:
    """Describe the conditions that make a leaf's outcomes impossible now, and the current values in them."""
    whens = dict.fromkeys(outcome.when for outcome in outcomes)
    names = dict.fromkeys(use.name for when in whens for use in name_uses(parse(when)))
    values = ", ".join(f"{name} is {_value(leaf, name)}" for name in names)
    return (
        f"'{leaf.name}' returns '{outcomes[0].name}' only when {' or '.join(whens)}",
        f" ({values})" if values else "",
    )


def _value(leaf: StubLeaf, name: str) -> str:
    try:
        return repr(leaf.variables.read(name))
    except VariableError:
        return "unknown"


def describe_undeclared_outcome(leaf: StubLeaf, status: str, label: str) -> str:
    """Describe the declared outcomes of a leaf that has returned a different outcome."""
    listed = ", ".join(dict.fromkeys(outcome.name for outcome in leaf.outcomes))
    return f"'{leaf.name}' returns only {listed}, but returned {label or status}"


def _bind_keys(watched: CompiledTree, simulated: SimulatedTree) -> None:
    """Make the stub leaves of a simulated tree read the blackboard keys of a running tree.

    Raises:
        OtherTreeError: If the running tree has other nodes than the simulated tree.
    """
    behaviours = [*pre_order(watched.root)]
    if [each.name for each in behaviours] != [each.name for each in pre_order(simulated.root)]:
        raise OtherTreeError(
            "the tree cannot be monitored, because it is unknown when some of its nodes tick their children"
        )
    for leaf in simulated.leaves:
        scope = watched.origins.construction(behaviours[leaf.number].id).instance.scope
        leaf.variables = _ReadOnlyKeys(simulated.facts, scope, leaf.variables.enums)


def _numbers(
    alphabet: EventAlphabet,
) -> Mapping[tuple[int, str, str, str], list[tuple[int, Outcome | None]]]:
    """Return events as numbers with outcomes, grouped by leaf number, kind of event, status and label.

    The label may be empty if the leaf has only one outcome with this status.
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
