"""The properties of a file that a tree can keep or break, as monitors."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, field

from sar_compiler.checks.leaf_words import LeafWords
from sar_compiler.checks.verify.monitors import (
    LIMIT,
    MAIN,
    OTHER,
    AfterTickCondition,
    Monitor,
    Monitors,
    PropertyPattern,
    Rules,
)
from sar_compiler.checks.verify.property_conditions import AFTER_A_TICK, Condition, Surroundings
from sar_compiler.checks.verify.property_files import EventProperty, PropertyFile
from sar_compiler.checks.verify.state import Prepared
from sar_compiler.documents.located import Document, Value
from sar_compiler.runtime.kernel.trail import Guarded

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
    """

    rules: Rules
    names: tuple[str, ...] = ()
    owing: tuple[int, ...] = ()
    left_out: tuple[LeftOut, ...] = ()
    has_end: bool = True


def without_properties() -> Properties:
    """Return the properties without a file: none, and a run is over when the root has succeeded or failed."""
    return Properties(Rules(Monitors(()), {}, _root_is_over))


def properties_of(file: PropertyFile, prepared: Prepared, tags: Collection[str]) -> Properties:
    """Return the properties that a file demands of a tree.

    Args:
        file: The file.
        prepared: The tree.
        tags: The tags of leaves that a tree can have.

    Raises:
        TreeError: If the file says something that makes no sense for the tree; carries the findings.
    """
    reading = _Reading(file.document, prepared, tags)
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
    rules = Rules(
        Monitors(reading.monitors),
        reading.guarded,
        over if end is None else end.after_tick,
        [condition.after_tick for condition in conditions],
        [entry for condition in (*conditions, *([end] if end else ())) for entry in condition.entries],
    )
    owing = tuple(number for number, monitor in enumerate(reading.monitors) if monitor.owes)
    return Properties(rules, (*reading.names, *file.ends), owing, tuple(reading.left_out), has_end)


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


class _Reading:
    """Turns the properties of a file into monitors."""

    def __init__(self, document: Document, prepared: Prepared, tags: Collection[str]) -> None:
        self.monitors: list[Monitor] = []
        self.names: list[str] = []
        self.guarded: dict[int, list[Guarded]] = {}
        self.left_out: list[LeftOut] = []
        self._document = document
        self._alphabet = prepared.alphabet
        self._words = LeafWords(prepared.simulated)
        self._tags = tags
        self._surroundings = Surroundings(prepared.simulated)

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
        script = self._words.condition(self._document, value, own, later)
        return None if script is None else Condition(script, self._surroundings, owner)

    def _events(self, values: Sequence[Value]) -> _MeantEvents:
        events = _MeantEvents()
        for value in values:
            absent = self._absent(value.text or "")
            if absent is not None:
                events.missing.append(absent)
                continue
            deed = self._words.deed(self._document, value)
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
