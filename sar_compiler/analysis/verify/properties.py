"""Properties that a tree can keep or break: the files that demand them, their conditions, and the monitors that watch runs for them."""

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import Enum
from pathlib import Path

from sar_compiler.analysis.leaf_vocabulary import LeafVocabulary, parameters
from sar_compiler.analysis.simulated_tree import SimulatedTree
from sar_compiler.analysis.state_search.searching import Judgement
from sar_compiler.analysis.state_search.trail import Guarded
from sar_compiler.analysis.stub_leaf import FactVariables
from sar_compiler.analysis.verify.state import Prepared
from sar_compiler.documents.located import Document, Value
from sar_compiler.errors import SarError, UndecidableError
from sar_compiler.opener import PROPERTIES
from sar_compiler.runtime.answers import Fact
from sar_compiler.runtime.blackboard import Entry, Scope
from sar_compiler.runtime.evaluation import EvaluationError, Program
from sar_compiler.runtime.expressions import Script, name_uses
from sar_compiler.runtime.kernel.cells import WORDS
from sar_compiler.runtime.variables import Enums, ScriptValue

ROOT = "root"
"""The root's status after the last tick."""
IDLE = "idle"
"""Whether every tick from now on leaves the tree as it is."""
AFTER_A_TICK = (ROOT, IDLE)
"""The names that are known only when a tick is over."""


class ConditionError(UndecidableError):
    """A condition of a property cannot be evaluated in a state that a run reaches.

    Args:
        owner: The name of the property.
        reason: The reason.
    """

    def __init__(self, owner: str, reason: str) -> None:
        super().__init__(f"{owner}: {reason}")
        self.owner, self.reason = owner, reason


class IdleUnknownError(SarError):
    """A condition asks whether the tree idles, which is not known yet."""


class PropertyScope(FactVariables):
    """The variables of conditions: facts, keys of the tree, and the end of the last tick.

    Args:
        simulated: The tree.
        keys: The keys, where they are those of another tree.
    """

    def __init__(self, simulated: SimulatedTree, keys: Scope | None = None) -> None:
        super().__init__(simulated.facts, keys or simulated.compiled.instance.scope, Enums(simulated.enums))
        self._ended: dict[str, ScriptValue | None] = {}

    def end_tick(self, root: str, *, idle: bool | None) -> None:
        """Set the result of the last tick.

        Args:
            root: The root's status.
            idle: Whether every tick from now on leaves the tree as it is; None if that is not known yet.
        """
        self._ended[ROOT] = root
        self._ended[IDLE] = None if idle is None else float(idle)

    def read(self, name: str) -> ScriptValue:
        """Return the value of a fact, of a key, or of what is known of the last tick.

        Raises:
            IdleUnknownError: If that is whether the tree idles, and it is not known.
        """
        ended = self._ended.get(name)
        if ended is None and name in self._ended:
            raise IdleUnknownError(name)
        return super().read(name) if ended is None else ended


class Condition:
    """A condition that can be evaluated.

    Args:
        script: What it says.
        surroundings: What it reads.
        owner: The name of its property, for messages.
    """

    def __init__(self, script: Script, surroundings: PropertyScope, owner: str) -> None:
        self._program = Program(script, surroundings.enums.numbers)
        self._surroundings = surroundings
        self._owner = owner
        self._memo = surroundings.memo_of(self.entries)

    @property
    def script(self) -> Script:
        """What it says."""
        return self._program.script

    def entry_name(self, name: str) -> str | None:
        """Return the absolute name of the entry that a name in it means; None for what is known of the last tick."""
        return None if name in AFTER_A_TICK else self._surroundings.entry(name).name

    @property
    def entries(self) -> list[Entry]:
        """The entries that it reads."""
        return [self._surroundings.entry(name) for name in self.names.difference(AFTER_A_TICK)]

    @property
    def names(self) -> set[str]:
        """The names in it."""
        return {use.name for use in name_uses(self.script)}

    def holds(self) -> bool:
        """Return whether it holds now, in a tick.

        Raises:
            ConditionError: If it cannot be evaluated, because a key has no value yet or one that does not fit.
        """
        if self._memo is None:
            return self._holds()
        held: bool = self._memo.call(self._holds)
        return held

    def after_tick(self, root: str, idle: bool | None) -> bool:
        """Return whether it holds when a tick is over; see `PropertyScope.end_tick`.

        Raises:
            ConditionError: As `holds`.
            IdleUnknownError: If it asks whether the tree idles, and that is not known.
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
    """The pattern of a property, after the specification patterns of Dwyer, Avrunin and Corbett."""

    NEVER = "never"
    """Absence: the event does not happen."""
    BEFORE = "before"
    """Precedence: before the event comes another one (since a third)."""
    AFTER = "after"
    """Response: after the event another one comes (before a third)."""
    AT_MOST_ONCE = "at_most_once"
    """Bounded existence: the event happens once at most (between two of another)."""


MAIN, OTHER, LIMIT = 1, 2, 4
"""The roles of an event in a property: the one that it is about, the one that must come, the one that bounds it."""


@dataclass(frozen=True)
class Monitor:
    """One property over events.

    Attributes:
        form: What it says.
        roles: What each event is in it, as bits; events that are nothing are left out.
        owes: Whether what must come can come at any time, so that it is owed until it comes.
    """

    form: PropertyPattern
    roles: Mapping[int, int]
    owes: bool = False

    def after(self, flag: bool, event: int) -> tuple[bool, bool]:
        """Return the flag after an event, and whether the event breaks the property.

        Args:
            flag: What is remembered: that the other event has come (`BEFORE`), that it has still to come
                (`AFTER`), that the event has happened (`AT_MOST_ONCE`).
            event: The event.
        """
        roles = self.roles.get(event)
        if roles is None:
            return flag, False
        return _RULES[self.form](flag, roles)


def _never(_: bool, roles: int) -> tuple[bool, bool]:
    return False, bool(roles & MAIN)


def _before(flag: bool, roles: int) -> tuple[bool, bool]:
    broken = bool(roles & MAIN) and not flag
    return bool(roles & OTHER) or (flag and not roles & LIMIT), broken


def _after(flag: bool, roles: int) -> tuple[bool, bool]:
    owed = flag and not roles & OTHER
    broken = owed and bool(roles & LIMIT)
    return bool(roles & MAIN) or (owed and not broken), broken


def _at_most_once(flag: bool, roles: int) -> tuple[bool, bool]:
    happened = flag and not roles & LIMIT
    return happened or bool(roles & MAIN), happened and bool(roles & MAIN)


_RULES: Mapping[PropertyPattern, Callable[[bool, int], tuple[bool, bool]]] = {
    PropertyPattern.NEVER: _never,
    PropertyPattern.BEFORE: _before,
    PropertyPattern.AFTER: _after,
    PropertyPattern.AT_MOST_ONCE: _at_most_once,
}


class Monitors:
    """Several monitors as one, whose state is a number: a bit for each.

    Args:
        monitors: The monitors; the first has the lowest bit.
    """

    start = 0

    def __init__(self, monitors: Sequence[Monitor]) -> None:
        self._monitors = tuple(monitors)
        self._owing = sum(1 << bit for bit, monitor in enumerate(self._monitors) if monitor.owes)

    def __getitem__(self, number: int) -> Monitor:
        return self._monitors[number]

    @property
    def count(self) -> int:
        """How many there are."""
        return len(self._monitors)

    @property
    def heard(self) -> set[int]:
        """The events that matter to at least one of them."""
        return {event for monitor in self._monitors for event in monitor.roles}

    def after(self, state: int, event: int) -> tuple[int, int]:
        """Return the state after an event, and the monitors that it breaks, as bits."""
        following = broken = 0
        for bit, monitor in enumerate(self._monitors):
            flag, wrong = monitor.after(bool(state >> bit & 1), event)
            following |= flag << bit
            broken |= wrong << bit
        return following, broken

    def owed(self, state: int) -> int:
        """Return the monitors that still owe something in a state, as bits."""
        return state & self._owing


AfterTickCondition = Callable[[str, bool | None], bool]
"""Returns whether a condition holds after a tick, given the root's status and whether the tree idles: every tick from
now on leaves it as it is. None if that is not known yet: then it may raise `IdleUnknownError`."""


@dataclass(frozen=True)
class PropertyAutomata:
    """The properties of a tree, ready to be watched.

    Attributes:
        monitors: Those over events; the first rules.
        guarded: The events that count only while a condition holds, by the number of the event without it.
        ends: Says whether a run is over.
        at_end: What must hold when it is over; the rules behind those over events.
        entries: The entries that these and the end look at.
    """

    monitors: Monitors
    guarded: Mapping[int, Sequence[Guarded]]
    ends: AfterTickCondition
    at_end: Sequence[AfterTickCondition] = ()
    entries: Sequence[Entry] = ()

    @property
    def count(self) -> int:
        """How many there are; rules of others have higher numbers."""
        return self.monitors.count + len(self.at_end)

    def judge(self, outcome: int, watched: int, idle: bool | None) -> Judgement:
        """Judge the state after a tick.

        Args:
            outcome: The outcome of the root, as a number; INVALID before the first tick.
            watched: What the monitors remember.
            idle: Whether every tick leaves it as it is; None if that is not known yet.
        """
        owed = self.monitors.owed(watched)
        root = WORDS[outcome]
        if not root:
            return Judgement(pending=owed)
        ends = _answer(self.ends, root, idle=idle)
        if not ends:
            return Judgement(pending=owed, is_open=ends is None)
        broken, is_open = owed, False
        for place, condition in enumerate(self.at_end):
            holds = _answer(condition, root, idle=idle)
            is_open = is_open or holds is None
            if holds is False:
                broken |= 1 << (self.monitors.count + place)
        return Judgement(ends=True, broken=broken, pending=owed, is_open=is_open)


def _answer(condition: AfterTickCondition, root: str, *, idle: bool | None) -> bool | None:
    """Return whether a condition holds; None if that depends on what is not known yet."""
    try:
        return condition(root, idle)
    except IdleUnknownError:
        return None


_EMPTY_HINT = "write properties: and below it a name, and below that never: LEAF ANSWER"
# The keys of the events that a property is about, of those that must come, and of those that bound it.
_KEYS: Mapping[PropertyPattern, tuple[str, str, str]] = {
    PropertyPattern.AFTER: ("after", "eventually", "before"),
    PropertyPattern.NEVER: ("never", "", ""),
    PropertyPattern.AT_MOST_ONCE: ("at_most_once", "", "per"),
    # Last, because what comes after something may have to come before something else.
    PropertyPattern.BEFORE: ("before", "comes", "since"),
}


@dataclass(frozen=True)
class EventProperty:
    """A property that speaks of events, as it is written.

    Attributes:
        name: What it is called.
        form: What it says.
        main: The events that it is about.
        other: The events that must come.
        limit: The events that bound it.
        condition: While what the first ones count; None for always.
    """

    name: str
    form: PropertyPattern
    main: tuple[Value, ...]
    other: tuple[Value, ...] = ()
    limit: tuple[Value, ...] = ()
    condition: Value | None = None


@dataclass(frozen=True)
class PropertyFile:
    """The content of a file of properties.

    Attributes:
        document: The file, with its findings.
        end: When a run is over; None for when the root has succeeded or failed.
        events: The properties that speak of events.
        ends: What must hold at the end of a run, by the names of these properties.
        facts: What it says of facts.
        answers: What it says of what leaves answer.
        parameters: The keys of the root blackboard.
        controls: What it says of controls and decorators that only a model describes.
        if_broken: What is done in a run that breaks a property, by its name, where that is more than to tell it: `hold` or `abort`.
    """

    document: Document
    end: Value | None = None
    events: tuple[EventProperty, ...] = ()
    ends: Mapping[str, Value] = field(default_factory=dict)
    facts: Value | None = None
    answers: Value | None = None
    parameters: Mapping[str, Fact] = field(default_factory=dict)
    controls: Value | None = None
    if_broken: Mapping[str, Value] = field(default_factory=dict)


def read_property_file(path: str | Path) -> PropertyFile:
    """Read a file of properties.

    What is wrong with it is noted in its document, and raised by `verify` with what only a tree shows.

    Raises:
        UnreadableFileError: If it is not there or cannot be read.
        TreeError: If nothing of it can be used; carries the findings.
    """
    from sar_compiler.documents.yaml_files import read_yaml

    return _understood(read_yaml(path, PROPERTIES, _EMPTY_HINT))


def parse_property_file(text: str, path: str = "<text>") -> PropertyFile:
    """Read a file of properties from memory; raises as `read_property_file`."""
    from sar_compiler.documents.yaml_files import parse_yaml

    return _understood(parse_yaml(text, path, _EMPTY_HINT))


def _understood(document: Document) -> PropertyFile:
    parts = document.validate("properties").mapping
    written = parts["properties"].mapping if "properties" in parts else {}
    return PropertyFile(
        document,
        parts.get("end"),
        tuple(_events(name, value.mapping) for name, value in written.items() if "at_end" not in value.data),
        {name: value.mapping["at_end"] for name, value in written.items() if "at_end" in value.data},
        parts.get("facts"),
        parts.get("answers"),
        parameters(parts.get("parameters")),
        parts.get("controls"),
        {name: value.mapping["if_broken"] for name, value in written.items() if "if_broken" in value.data},
    )


def _events(name: str, parts: Mapping[str, Value]) -> EventProperty:
    form = next(form for form, keys in _KEYS.items() if keys[0] in parts)
    main, other, limit = (parts[key].listed if key in parts else () for key in _KEYS[form])
    return EventProperty(name, form, main, other, limit, parts.get("while"))


NO_END = "none"
"""What `end` says where runs have no end."""


@dataclass(frozen=True)
class LeftOut:
    """A property that does not apply to a tree.

    Attributes:
        name: What it is called.
        missing: The leaves that it speaks of and the tree does not have.
    """

    name: str
    missing: tuple[str, ...]


@dataclass(frozen=True)
class Properties:
    """The properties of a tree, as they are checked.

    Attributes:
        rules: The properties, as the exploration uses them.
        names: What they are called, by the number of the rule.
        owing: The rules that can be broken by a run that goes on for ever, with what it then owes.
        left_out: Those that say nothing about the tree.
        has_end: Whether runs have an end, and so whether they come to it is asked.
        conditions: All conditions in them.
    """

    rules: PropertyAutomata
    names: tuple[str, ...] = ()
    owing: tuple[int, ...] = ()
    left_out: tuple[LeftOut, ...] = ()
    has_end: bool = True
    conditions: tuple[Condition, ...] = ()

    @property
    def asks_for_idle(self) -> bool:
        """Whether a condition asks whether every tick leaves the tree as it is."""
        return any(IDLE in condition.names for condition in self.conditions)

    def events(self, number: int) -> set[int]:
        """Return the numbers of the events that a property speaks of."""
        monitors, guarded = self.rules.monitors, self.rules.guarded
        heard = set(monitors[number].roles) if number < monitors.count else set()
        beside = {event for event, some in guarded.items() if heard & {each.number for each in some}}
        return (heard | beside).difference(each.number for some in guarded.values() for each in some)

    def without(self, owner: str) -> "Properties":
        """Return the properties without one of them, or without the end of a run and those that depend on it."""
        if owner in self.names:
            return self.only([number for number, each in enumerate(self.names) if each != owner])
        lasting = set(range(self.rules.monitors.count)).difference(self.owing)
        others = self.only(sorted(lasting))
        return replace(others, rules=replace(others.rules, ends=_never_over), has_end=False)

    def only(self, numbers: Sequence[int]) -> "Properties":
        """Return some of the properties, by their numbers in ascending order."""
        rules, count = self.rules, self.rules.monitors.count
        monitors = Monitors([rules.monitors[number] for number in numbers if number < count])
        at_end = [rules.at_end[number - count] for number in numbers if number >= count]
        guarded = {
            event: kept
            for event, some in rules.guarded.items()
            if (kept := [each for each in some if each.number in monitors.heard])
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
    """Return the properties without a file: none, and a run is over when the root has succeeded or failed."""
    return Properties(PropertyAutomata(Monitors(()), {}, _root_is_over))


def properties_of(
    file: PropertyFile | None, prepared: Prepared, tags: Collection[str], keys: Scope | None = None
) -> Properties:
    """Return the properties that a file demands of a tree.

    Args:
        file: The file; None for `without_properties`.
        prepared: The tree.
        tags: The tags of leaves that a tree can have.
        keys: The keys of the main tree, where another one is watched.

    Raises:
        TreeError: If the file says something that makes no sense for the tree; carries the findings.
    """
    if file is None:
        return without_properties()
    reading = _PropertyParser(file.document, prepared, tags, keys)
    for written in file.events:
        reading.take(written)
    has_end = file.end is None or file.end.text != NO_END
    if not has_end:
        for name, value in file.ends.items():
            message = f"'{name}' is to hold at the end, and end: {NO_END} says that there is none"
            file.document.report("conflicting-keys", message, value, hint="say when it must hold, with never")
    at_end = [reading.condition(value, name, after_a_tick=True) for name, value in file.ends.items()]
    end = reading.condition(file.end, "end", after_a_tick=True) if file.end is not None and has_end else None
    file.document.raise_findings()
    over: AfterTickCondition = _root_is_over if file.end is None else _never_over
    conditions = [condition for condition in at_end if condition is not None]
    rules = PropertyAutomata(
        Monitors(reading.monitors),
        reading.guarded,
        over if end is None else end.after_tick,
        [condition.after_tick for condition in conditions],
        [entry for condition in (*conditions, *([end] if end else ())) for entry in condition.entries],
    )
    owing = tuple(number for number, monitor in enumerate(reading.monitors) if monitor.owes)
    names = (*reading.names, *file.ends)
    return Properties(rules, names, owing, tuple(reading.left_out), has_end, tuple(reading.conditions))


@dataclass
class _MeantEvents:
    """The events that some texts of a property mean.

    Attributes:
        numbers: The events.
        missing: The leaves that the tree does not have.
    """

    numbers: set[int] = field(default_factory=set)
    missing: list[str] = field(default_factory=list)

    @property
    def cannot_happen(self) -> bool:
        """Whether they name only leaves that the tree does not have."""
        return bool(self.missing) and not self.numbers


class _PropertyParser:
    """Turns the properties of a file into monitors."""

    def __init__(
        self, document: Document, prepared: Prepared, tags: Collection[str], keys: Scope | None
    ) -> None:
        self.monitors: list[Monitor] = []
        self.names: list[str] = []
        self.guarded: dict[int, list[Guarded]] = {}
        self.left_out: list[LeftOut] = []
        self._alphabet = prepared.alphabet
        self._words = LeafVocabulary(document, prepared.simulated)
        self._tags = tags
        self._surroundings = PropertyScope(prepared.simulated, keys)
        self.conditions: list[Condition] = []

    def take(self, written: EventProperty) -> None:
        """Add a property."""
        main, other, limit = map(self._events, (written.main, written.other, written.limit))
        condition = None
        if written.condition is not None:
            condition = self.condition(written.condition, written.name, after_a_tick=False)
        if any(events.cannot_happen for events in (main, other, limit)):
            missing = dict.fromkeys(leaf for events in (main, other, limit) for leaf in events.missing)
            self.left_out.append(LeftOut(written.name, tuple(missing)))
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
        self.monitors.append(Monitor(written.form, roles, owes))
        self.names.append(written.name)

    def condition(self, value: Value, owner: str, *, after_a_tick: bool) -> Condition | None:
        """Return a condition; None if it makes no sense."""
        own, later = (AFTER_A_TICK, ()) if after_a_tick else ((), AFTER_A_TICK)
        script = self._words.condition(value, own, later)
        if script is None:
            return None
        self.conditions.append(Condition(script, self._surroundings, owner))
        return self.conditions[-1]

    def _events(self, values: Sequence[Value]) -> _MeantEvents:
        events = _MeantEvents()
        for value in values:
            absent = self._absent(value.text or "")
            if absent is not None:
                events.missing.append(absent)
                continue
            deed = self._words.deed(value)
            if deed is not None:
                events.numbers |= self._alphabet.meant_by(deed)
        return events

    def _absent(self, text: str) -> str | None:
        """Return the leaf that a text speaks of, if it is one that a tree can have and this one does not."""
        words = text.split(" ")
        heads = [" ".join(words[:count]) for count in range(len(words), 0, -1)]
        if any(self._words.named(head) for head in heads):
            return None
        return next((head for head in heads if head in self._tags), None)

    def _guard(self, numbers: set[int], condition: Condition, *, comes_first: bool) -> int:
        """Return the number of an event that goes with others while a condition holds."""
        companion = len(self._alphabet.events) + len(self.monitors)
        for number in numbers:
            self.guarded.setdefault(number, []).append(Guarded(companion, condition.holds, comes_first))
        return companion


def _never_over(_root: str, _idle: bool | None) -> bool:
    return False


def _root_is_over(root: str, _: bool | None) -> bool:
    return root in ("SUCCESS", "FAILURE")
