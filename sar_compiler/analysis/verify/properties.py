"""Parses properties files, and defines the conditions and monitors that detect violations."""

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import Enum
from pathlib import Path

from sar_compiler.analysis.leaf_vocabulary import LeafVocabulary, parameters
from sar_compiler.analysis.simulated_tree import SimulatedTree
from sar_compiler.analysis.state_search.searching import Judgement
from sar_compiler.analysis.state_search.trail import Guarded
from sar_compiler.analysis.stub_leaf import FactVariables
from sar_compiler.analysis.verify.state import PreparedTree
from sar_compiler.documents.located import Document, Value
from sar_compiler.errors import SarError, UndecidableError
from sar_compiler.opener import PROPERTIES
from sar_compiler.runtime.blackboard import Entry, Scope
from sar_compiler.runtime.evaluation import EvaluationError, Program
from sar_compiler.runtime.expressions import Script, name_uses
from sar_compiler.runtime.kernel.cells import WORDS
from sar_compiler.runtime.outcomes import Fact
from sar_compiler.runtime.variables import Enums, ScriptValue

ROOT = "root"
"""The name under which conditions read the status of the root after the last tick."""
IDLE = "idle"
"""The name under which conditions read whether the tree is idle: no further tick changes the tree."""
AFTER_A_TICK = (ROOT, IDLE)
"""The names under which conditions read values that are only known after a tick."""


class ConditionError(UndecidableError):
    """Raised if a condition cannot be evaluated in a reachable state.

    Args:
        owner: The name of the condition's property, or `end`.
        reason: The reason why the condition cannot be evaluated.
    """

    def __init__(self, owner: str, reason: str) -> None:
        super().__init__(f"{owner}: {reason}")
        self.owner, self.reason = owner, reason


class IdleUnknownError(SarError):
    """Raised if a condition reads whether the tree is idle, but it is not yet known whether the tree is idle."""


class PropertyScope(FactVariables):
    """The variables that conditions can read: facts, keys of the tree, and the result of the last tick.

    Args:
        simulated: The tree.
        keys: The scope of the keys; by default the scope of the simulated main tree.
    """

    def __init__(self, simulated: SimulatedTree, keys: Scope | None = None) -> None:
        super().__init__(simulated.facts, keys or simulated.compiled.instance.scope, Enums(simulated.enums))
        self._ended: dict[str, ScriptValue | None] = {}

    def end_tick(self, root: str, *, idle: bool | None) -> None:
        """Set the result of the last tick.

        Args:
            root: The root's status.
            idle: Whether every further tick leaves the tree unchanged; None if this is not known yet.
        """
        self._ended[ROOT] = root
        self._ended[IDLE] = None if idle is None else float(idle)

    def read(self, name: str) -> ScriptValue:
        """Return the value of a fact, of a key, of `root`, or of `idle`.

        Raises:
            IdleUnknownError: If the name is `idle`, and it is not known whether the tree idles.
        """
        ended = self._ended.get(name)
        if ended is None and name in self._ended:
            raise IdleUnknownError(name)
        return super().read(name) if ended is None else ended


class Condition:
    """A condition in a property, or the condition that defines the end of a run.

    Args:
        script: The script of the condition.
        surroundings: The variables that the script reads.
        owner: The name of the condition's property for messages, or `end`.
    """

    def __init__(self, script: Script, surroundings: PropertyScope, owner: str) -> None:
        self._program = Program(script, surroundings.enums.numbers)
        self._surroundings = surroundings
        self._owner = owner
        self._memo = surroundings.memo_of(self.entries)

    @property
    def script(self) -> Script:
        """The script of the condition."""
        return self._program.script

    def entry_name(self, name: str) -> str | None:
        """Return the absolute name of the entry that a variable refers to, or None for `root` and `idle`."""
        return None if name in AFTER_A_TICK else self._surroundings.entry(name).name

    @property
    def entries(self) -> list[Entry]:
        """The entries that the condition reads."""
        return [self._surroundings.entry(name) for name in self.names.difference(AFTER_A_TICK)]

    @property
    def names(self) -> set[str]:
        """The names that the condition's script uses."""
        return {use.name for use in name_uses(self.script)}

    def holds(self) -> bool:
        """Return whether the condition holds now, during a tick.

        Raises:
            ConditionError: If it cannot be evaluated, because a key has no value yet or has a value of the wrong type.
        """
        if self._memo is None:
            return self._holds()
        holds: bool = self._memo.call(self._holds)
        return holds

    def after_tick(self, root: str, idle: bool | None) -> bool:
        """Return whether the condition holds after a tick.

        The arguments are those of `PropertyScope.end_tick`.

        Raises:
            ConditionError: As for `holds`.
            IdleUnknownError: If the condition reads `idle`, and it is not known whether the tree idles.
        """
        self._surroundings.end_tick(root, idle=idle)
        return self._holds()

    def _holds(self) -> bool:
        try:
            return self._program.holds(self._surroundings)
        except EvaluationError as error:
            hint = f"; {error.hint}" if error.hint else ""
            reason = f"'{self.script.text}' cannot be evaluated in every state: {error}{hint}"
            raise ConditionError(self._owner, reason) from error


class PropertyPattern(Enum):
    """The pattern of a property, based on the specification patterns of Dwyer, Avrunin and Corbett."""

    NEVER = "never"
    """Absence: the event never happens."""
    BEFORE = "before"
    """Precedence: the event happens only if another event has happened before, or has happened since a third event."""
    AFTER = "after"
    """Response: each time the event happens, another event happens afterwards, possibly before a third event."""
    AT_MOST_ONCE = "at_most_once"
    """Bounded existence: the event happens at most once, or at most once between two occurrences of another event."""


MAIN, OTHER, LIMIT = 1, 2, 4
"""The roles that events can have in a property: main event, required event and limiting event."""


@dataclass(frozen=True)
class PropertyMonitor:
    """A monitor that checks one property about events.

    Attributes:
        form: The pattern of the property.
        roles: The roles of each event, as bits, by event number; events without a role are missing.
        owes: Whether the required event has no limit, so that the obligation is pending until the event happens.
    """

    form: PropertyPattern
    roles: Mapping[int, int]
    owes: bool = False

    def next_flag(self, flag: bool, event: int) -> tuple[bool, bool]:
        """Return the new state of the monitor after an event, and whether the event violates the property.

        Args:
            flag: The state of the monitor: whether the required event has happened (`BEFORE`), whether it is pending
                (`AFTER`), or whether the main event has happened (`AT_MOST_ONCE`).
            event: The number of the event.
        """
        roles = self.roles.get(event)
        if roles is None:
            return flag, False
        return _RULES[self.form](flag, roles)


def _never_violated(_: bool, roles: int) -> tuple[bool, bool]:
    return False, bool(roles & MAIN)


def _check_before(flag: bool, roles: int) -> tuple[bool, bool]:
    broken = bool(roles & MAIN) and not flag
    return bool(roles & OTHER) or (flag and not roles & LIMIT), broken


def _check_response(flag: bool, roles: int) -> tuple[bool, bool]:
    owed = flag and not roles & OTHER
    broken = owed and bool(roles & LIMIT)
    return bool(roles & MAIN) or (owed and not broken), broken


def _check_at_most_once(flag: bool, roles: int) -> tuple[bool, bool]:
    happened = flag and not roles & LIMIT
    return happened or bool(roles & MAIN), happened and bool(roles & MAIN)


_RULES: Mapping[PropertyPattern, Callable[[bool, int], tuple[bool, bool]]] = {
    PropertyPattern.NEVER: _never_violated,
    PropertyPattern.BEFORE: _check_before,
    PropertyPattern.AFTER: _check_response,
    PropertyPattern.AT_MOST_ONCE: _check_at_most_once,
}


class MonitorSet:
    """A set of monitors. The state of the set is a number with one bit for each monitor.

    Args:
        monitors: The monitors; the first monitor has the lowest bit.
    """

    start = 0

    def __init__(self, monitors: Sequence[PropertyMonitor]) -> None:
        self._monitors = tuple(monitors)
        self._owing = sum(1 << bit for bit, monitor in enumerate(self._monitors) if monitor.owes)

    def __getitem__(self, number: int) -> PropertyMonitor:
        return self._monitors[number]

    @property
    def count(self) -> int:
        """The number of monitors."""
        return len(self._monitors)

    @property
    def relevant_events(self) -> set[int]:
        """The numbers of the events that affect at least one monitor."""
        return {event for monitor in self._monitors for event in monitor.roles}

    def next_state(self, state: int, event: int) -> tuple[int, int]:
        """Return the state after an event, and a bit set of the monitors that report a violation."""
        following = broken = 0
        for bit, monitor in enumerate(self._monitors):
            flag, wrong = monitor.next_flag(bool(state >> bit & 1), event)
            following |= flag << bit
            broken |= wrong << bit
        return following, broken

    def pending_monitors(self, state: int) -> int:
        """Return a bit set of the monitors that have a pending obligation in the given state."""
        return state & self._owing


AfterTickCondition = Callable[[str, bool | None], bool]
"""A function that returns whether a condition holds after a tick. Its arguments are the root's status and whether the tree
is idle, or None if this is unknown. In that case, the function may raise `IdleUnknownError`.
"""


@dataclass(frozen=True)
class PropertyAutomata:
    """The properties of a tree, in the form of automata for the search.

    Attributes:
        monitors: The monitors of the properties over events. They have the lowest rule numbers.
        guarded: The second events that accompany leaf events while a condition holds, by the leaf event's number.
        ends: Returns whether a run is over.
        at_end: The conditions that must hold at the end of a run. Their rule numbers follow those of the monitors.
        entries: The entries that `at_end` and `ends` read.
    """

    monitors: MonitorSet
    guarded: Mapping[int, Sequence[Guarded]]
    ends: AfterTickCondition
    at_end: Sequence[AfterTickCondition] = ()
    entries: Sequence[Entry] = ()

    @property
    def count(self) -> int:
        """The number of properties. Rules that are not properties have higher numbers."""
        return self.monitors.count + len(self.at_end)

    def judge(self, outcome: int, watched: int, idle: bool | None) -> Judgement:
        """Judge the state after a tick: whether the run is over, and which rules are violated or pending.

        Args:
            outcome: The outcome of the root, as a number; INVALID before the first tick.
            watched: The state of the monitors.
            idle: Whether every tick leaves the state unchanged; None if this is not known yet.
        """
        owed = self.monitors.pending_monitors(watched)
        root = WORDS[outcome]
        if not root:
            return Judgement(pending=owed)
        ends = _evaluate_condition(self.ends, root, idle=idle)
        if not ends:
            return Judgement(pending=owed, is_open=ends is None)
        broken, is_open = owed, False
        for place, condition in enumerate(self.at_end):
            holds = _evaluate_condition(condition, root, idle=idle)
            is_open = is_open or holds is None
            if holds is False:
                broken |= 1 << (self.monitors.count + place)
        return Judgement(ends=True, broken=broken, pending=owed, is_open=is_open)


def _evaluate_condition(condition: AfterTickCondition, root: str, *, idle: bool | None) -> bool | None:
    """Return whether a condition holds, or None if it depends on `idle` and `idle` is not known yet."""
    try:
        return condition(root, idle)
    except IdleUnknownError:
        return None


_EMPTY_HINT = "write a property, for example: properties: {NAME: {never: LEAF OUTCOME}}"
# The keys of the main events of a property, of the required events, and of the limiting events.
_KEYS: Mapping[PropertyPattern, tuple[str, str, str]] = {
    PropertyPattern.AFTER: ("after", "eventually", "before"),
    PropertyPattern.NEVER: ("never", "", ""),
    PropertyPattern.AT_MOST_ONCE: ("at_most_once", "", "per"),
    # Last, because `before` is also the key of the limiting events of an `after` property.
    PropertyPattern.BEFORE: ("before", "comes", "since"),
}


@dataclass(frozen=True)
class EventProperty:
    """A property about events, as it is written in a file.

    Attributes:
        name: The name of the property.
        form: The pattern of the property.
        main: The main events.
        other: The required events.
        limit: The limiting events.
        condition: The condition under which the main events matter; None if they always matter.
    """

    name: str
    form: PropertyPattern
    main: tuple[Value, ...]
    other: tuple[Value, ...] = ()
    limit: tuple[Value, ...] = ()
    condition: Value | None = None


@dataclass(frozen=True)
class PropertyFile:
    """The content of a properties file.

    Attributes:
        document: The document, with its findings.
        end: The condition for the end of a run; None if a run ends when the root has succeeded or failed.
        events: The properties over events.
        ends: The conditions that must hold at the end of a run, by property name.
        facts: The initial values of facts.
        outcomes: The assumed outcomes of leaves.
        parameters: The values of keys of the root blackboard.
        controls: The replacements for controls and decorators of unknown behaviour.
        if_broken: The reaction of a run to a violation (`hold` or `abort`), by property name; by default only a report.
    """

    document: Document
    end: Value | None = None
    events: tuple[EventProperty, ...] = ()
    ends: Mapping[str, Value] = field(default_factory=dict)
    facts: Value | None = None
    outcomes: Value | None = None
    parameters: Mapping[str, Fact] = field(default_factory=dict)
    controls: Value | None = None
    if_broken: Mapping[str, Value] = field(default_factory=dict)


def read_property_file(path: str | Path) -> PropertyFile:
    """Read a properties file.

    Errors become findings of the document. `verify` raises them together with the errors that depend on a tree.

    Raises:
        UnreadableFileError: If the file does not exist or cannot be read.
        TreeError: If no part of the file can be used; contains the findings.
    """
    from sar_compiler.documents.yaml_files import read_yaml

    return _parse_document(read_yaml(path, PROPERTIES, _EMPTY_HINT))


def parse_property_file(text: str, path: str = "<text>") -> PropertyFile:
    """Parse the text of a properties file, like `read_property_file`."""
    from sar_compiler.documents.yaml_files import parse_yaml

    return _parse_document(parse_yaml(text, path, _EMPTY_HINT))


def _parse_document(document: Document) -> PropertyFile:
    parts = document.validate("properties").mapping
    written = parts["properties"].mapping if "properties" in parts else {}
    return PropertyFile(
        document,
        parts.get("end"),
        tuple(_events(name, value.mapping) for name, value in written.items() if "at_end" not in value.data),
        {name: value.mapping["at_end"] for name, value in written.items() if "at_end" in value.data},
        parts.get("facts"),
        parts.get("outcomes"),
        parameters(parts.get("parameters")),
        parts.get("controls"),
        {name: value.mapping["if_broken"] for name, value in written.items() if "if_broken" in value.data},
    )


def _events(name: str, parts: Mapping[str, Value]) -> EventProperty:
    form = next(form for form, keys in _KEYS.items() if keys[0] in parts)
    main, other, limit = (parts[key].as_list if key in parts else () for key in _KEYS[form])
    return EventProperty(name, form, main, other, limit, parts.get("while"))


NO_END = "none"
"""The value of `end` with which a file declares that runs have no end."""


@dataclass(frozen=True)
class InapplicableProperty:
    """A property that does not apply to a tree.

    Attributes:
        name: The name of the property.
        missing: The leaves that the property names but the tree does not have.
    """

    name: str
    missing: tuple[str, ...]


@dataclass(frozen=True)
class Properties:
    """The properties to check for a tree.

    Attributes:
        rules: The properties as automata for the search.
        names: The names of the properties, by rule number.
        owing: The numbers of the rules that an endless run can violate, because an obligation stays pending.
        left_out: The properties that do not apply to the tree.
        has_end: Whether runs have an end, so that there are questions about the end.
        conditions: All conditions of the properties.
    """

    rules: PropertyAutomata
    names: tuple[str, ...] = ()
    owing: tuple[int, ...] = ()
    left_out: tuple[InapplicableProperty, ...] = ()
    has_end: bool = True
    conditions: tuple[Condition, ...] = ()

    @property
    def asks_for_idle(self) -> bool:
        """Whether any condition reads `idle`. This variable is true if every tick leaves the tree unchanged."""
        return any(IDLE in condition.names for condition in self.conditions)

    def events(self, number: int) -> set[int]:
        """Return the numbers of the leaf events that a property names."""
        monitors, guarded = self.rules.monitors, self.rules.guarded
        heard = set(monitors[number].roles) if number < monitors.count else set()
        beside = {event for event, some in guarded.items() if heard & {each.number for each in some}}
        return (heard | beside).difference(each.number for some in guarded.values() for each in some)

    def without_owner(self, owner: str) -> "Properties":
        """Return all properties except *owner*.

        For `end`, exclude the properties that depend on the end of a run.
        """
        if owner in self.names:
            return self.select([number for number, each in enumerate(self.names) if each != owner])
        lasting = set(range(self.rules.monitors.count)).difference(self.owing)
        others = self.select(sorted(lasting))
        return replace(others, rules=replace(others.rules, ends=_never_over), has_end=False)

    def select(self, numbers: Sequence[int]) -> "Properties":
        """Return the properties with the given numbers, which must be in ascending order."""
        rules, count = self.rules, self.rules.monitors.count
        monitors = MonitorSet([rules.monitors[number] for number in numbers if number < count])
        at_end = [rules.at_end[number - count] for number in numbers if number >= count]
        guarded = {
            event: selected
            for event, some in rules.guarded.items()
            if (selected := [each for each in some if each.number in monitors.relevant_events])
        }
        owing = tuple(place for place, number in enumerate(numbers) if number in self.owing)
        names = tuple(self.names[number] for number in numbers)
        return replace(
            self,
            rules=replace(rules, monitors=monitors, guarded=guarded, at_end=at_end),
            names=names,
            owing=owing,
        )


def without_properties() -> Properties:
    """Return the default for trees without a properties file. A run ends when the root succeeds or fails."""
    return Properties(PropertyAutomata(MonitorSet(()), {}, _root_is_over))


def properties_of(
    file: PropertyFile | None, prepared: PreparedTree, tags: Collection[str], keys: Scope | None = None
) -> Properties:
    """Return the properties that a file defines for a tree.

    Args:
        file: The properties file; None for `without_properties`.
        prepared: The tree.
        tags: The tags of all leaves that a tree may contain.
        keys: The scope of the main tree's keys, if another tree is monitored.

    Raises:
        TreeError: If the properties file contradicts the tree; contains the findings.
    """
    if file is None:
        return without_properties()
    reading = _PropertyParser(file.document, prepared, tags, keys)
    for written in file.events:
        reading.add_property(written)
    has_end = file.end is None or file.end.text != NO_END
    if not has_end:
        for name, value in file.ends.items():
            message = f"the property '{name}' must hold at the end of a run, but 'end: {NO_END}' declares that runs have no end"
            file.document.report("conflicting-keys", message, value, hint="use 'never' instead of 'at_end'")
    at_end = [reading.condition(value, name, after_a_tick=True) for name, value in file.ends.items()]
    end = reading.condition(file.end, "end", after_a_tick=True) if file.end is not None and has_end else None
    file.document.raise_findings()
    over: AfterTickCondition = _root_is_over if file.end is None else _never_over
    conditions = [condition for condition in at_end if condition is not None]
    rules = PropertyAutomata(
        MonitorSet(reading.monitors),
        reading.guarded,
        over if end is None else end.after_tick,
        [condition.after_tick for condition in conditions],
        [entry for condition in (*conditions, *([end] if end else ())) for entry in condition.entries],
    )
    owing = tuple(number for number, monitor in enumerate(reading.monitors) if monitor.owes)
    names = (*reading.names, *file.ends)
    return Properties(rules, names, owing, tuple(reading.left_out), has_end, tuple(reading.conditions))


@dataclass
class _PropertyEvents:
    """The events that a property names for one role, such as the main event.

    Attributes:
        numbers: The numbers of the events.
        missing: The named leaves that the tree does not have.
    """

    numbers: set[int] = field(default_factory=set)
    missing: list[str] = field(default_factory=list)

    @property
    def cannot_happen(self) -> bool:
        """Whether the events cannot happen, because the tree has none of the named leaves."""
        return bool(self.missing) and not self.numbers


class _PropertyParser:
    """Converts the properties of a file to monitors."""

    def __init__(
        self, document: Document, prepared: PreparedTree, tags: Collection[str], keys: Scope | None
    ) -> None:
        self.monitors: list[PropertyMonitor] = []
        self.names: list[str] = []
        self.guarded: dict[int, list[Guarded]] = {}
        self.left_out: list[InapplicableProperty] = []
        self._alphabet = prepared.alphabet
        self._words = LeafVocabulary(document, prepared.simulated)
        self._tags = tags
        self._surroundings = PropertyScope(prepared.simulated, keys)
        self.conditions: list[Condition] = []

    def add_property(self, written: EventProperty) -> None:
        """Add a property."""
        main, other, limit = map(self._events, (written.main, written.other, written.limit))
        condition = None
        if written.condition is not None:
            condition = self.condition(written.condition, written.name, after_a_tick=False)
        if any(events.cannot_happen for events in (main, other, limit)):
            missing = dict.fromkeys(leaf for events in (main, other, limit) for leaf in events.missing)
            self.left_out.append(InapplicableProperty(written.name, tuple(missing)))
            return
        counted = main.numbers
        if condition is not None:
            counted = {
                self._guard(main.numbers, condition, comes_first=written.form is PropertyPattern.BEFORE)
            }
        roles: dict[int, int] = {}
        for numbers, role in ((counted, MAIN), (other.numbers, OTHER), (limit.numbers, LIMIT)):
            for number in numbers:
                roles[number] = roles.get(number, 0) | role
        owes = written.form is PropertyPattern.AFTER and not written.limit
        self.monitors.append(PropertyMonitor(written.form, roles, owes))
        self.names.append(written.name)

    def condition(self, value: Value, owner: str, *, after_a_tick: bool) -> Condition | None:
        """Create a condition, or return None if the condition is invalid."""
        own, later = (AFTER_A_TICK, ()) if after_a_tick else ((), AFTER_A_TICK)
        script = self._words.condition(value, own, later)
        if script is None:
            return None
        self.conditions.append(Condition(script, self._surroundings, owner))
        return self.conditions[-1]

    def _events(self, values: Sequence[Value]) -> _PropertyEvents:
        events = _PropertyEvents()
        for value in values:
            absent = self._missing_leaf(value.text or "")
            if absent is not None:
                events.missing.append(absent)
                continue
            pattern = self._words.parse_event(value)
            if pattern is not None:
                events.numbers |= self._alphabet.matching_events(pattern)
        return events

    def _missing_leaf(self, text: str) -> str | None:
        """Return the tag of the leaf that an event names, or None if the tree has this leaf."""
        words = text.split(" ")
        heads = [" ".join(words[:count]) for count in range(len(words), 0, -1)]
        if any(self._words.leaves_for_key(head) for head in heads):
            return None
        return next((head for head in heads if head in self._tags), None)

    def _guard(self, numbers: set[int], condition: Condition, *, comes_first: bool) -> int:
        """Create an additional event that occurs together with leaf events if a condition holds.

        Return its number.
        """
        companion = len(self._alphabet.events) + len(self.monitors)
        for number in numbers:
            self.guarded.setdefault(number, []).append(Guarded(companion, condition.holds, comes_first))
        return companion


def _never_over(_root: str, _idle: bool | None) -> bool:
    return False


def _root_is_over(root: str, _: bool | None) -> bool:
    return root in ("SUCCESS", "FAILURE")
