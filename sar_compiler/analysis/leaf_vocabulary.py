"""Parsing of leaf names, events, conditions, scripts and durations in scenario and properties files."""

import functools
from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass
from datetime import timedelta
from typing import Any, NamedTuple

from sar_compiler.analysis.simulated_tree import SimulatedTree, match_rank
from sar_compiler.analysis.stub_leaf import StubLeaf
from sar_compiler.checks.rules.entry_accesses import entry_table_of
from sar_compiler.documents.located import Document, Value
from sar_compiler.nodes.spec import NodeSpec
from sar_compiler.nodes.values import require_value_type
from sar_compiler.runtime.blackboard import ROOT_SIGN
from sar_compiler.runtime.events import HALTED, RETURNED, STARTED, Event
from sar_compiler.runtime.expressions import Access, Script, name_uses
from sar_compiler.runtime.outcomes import STATUSES, Fact
from sar_compiler.runtime.script import parse
from sar_compiler.runtime.tokens import ScriptError
from sar_compiler.tree.guessing import nearest

_DURATION = require_value_type(timedelta)


def parse_word(document: Document, value: Value, known: Iterable[str], what: str) -> str | None:
    """Return the text of a value that must be one of the known words, or report an error."""
    words = list(known)
    if value.text in words:
        return value.text
    message = f"{what} must be one of {', '.join(words)}, but is {value.kind}"
    document.report("wrong-value", message, value, suggestion=nearest(value.text or "", words))
    return None


def seconds(value: Value) -> float:
    """Convert a duration to seconds. The duration must already have been checked against a schema."""
    return parse_duration_range(value)[0]


def parse_duration_range(value: Value) -> tuple[float, float]:
    """Convert a schema-checked duration (`4s`) or range of durations (`4s to 9s`) to bounds in seconds."""
    if isinstance(value.data, (int, float)):
        return float(value.data), float(value.data)
    spans: list[Any] = [_DURATION.convert("".join(part.split())) for part in value.data.split("to")]
    times = [float(span.total_seconds()) for span in spans]
    return min(times), max(times)


def script(document: Document, value: Value | None) -> Script | None:
    """Parse a script, or report a syntax error at the error's location."""
    if value is None:
        return None
    try:
        return parse(value.text or "")
    except ScriptError as error:
        report_script(document, value, error)
        return None


def report_script(document: Document, value: Value, error: ScriptError) -> None:
    """Report a script's syntax error at the location of the error."""
    part, suggestion, hint = (error.start, error.end), error.suggestion, error.hint
    document.report("script-error", error.message, value, part, suggestion=suggestion, hint=hint)


def parameters(value: Value | None) -> dict[str, Fact]:
    """Return the values that a file's section `parameters:` sets for keys of the root blackboard."""
    return {} if value is None else dict(value.data)


class ConditionNames(NamedTuple):
    """The names that the conditions in a file can use.

    Attributes:
        known: The facts, the keys of the main tree, and the enumeration names.
        is_open: Whether the main tree may have keys that are unknown before a run.
    """

    known: tuple[str, ...]
    is_open: bool


class ConditionFault(NamedTuple):
    """An error in a condition.

    Attributes:
        message: The error.
        place: The start and the end of the error in the condition, in characters.
        suggestion: The name that probably was meant instead of an unknown name; None if there is no similar name.
        hint: The remedy for a known name; None for an unknown name.
    """

    message: str
    place: tuple[int, int]
    suggestion: str | None = None
    hint: str | None = None


def names_of(simulated: SimulatedTree) -> ConditionNames:
    """Return the names that conditions on a tree can use."""
    top = simulated.compiled.instance
    table = entry_table_of(top)
    keys = [entry.key for entry in table.entries if entry.scope is top.scope]
    for bound in top.tree.uses:
        keys += bound.remapping.keys.values()
    prefix = f"{top.scope.board.prefix}/"
    effects = (
        entry.name
        for leaf in simulated.leaves
        for entry in leaf.entries(
            f"{name} := 0" for a in leaf.outcomes if a.then for name in _created_names(a.then)
        )
    )
    for name in (*top.scope.board.names(), *effects):
        key = name.removeprefix(prefix)
        if name != key and "/" not in key:
            keys.append(key)
    return ConditionNames(
        tuple(dict.fromkeys([*simulated.fact_values(), *keys, *simulated.enums])), table.is_open
    )


def _created_names(effect: str) -> Iterator[str]:
    """Yield the names that an outcome's script creates if they do not exist."""
    return (use.name for use in name_uses(parse(effect)) if use.access is Access.CREATE)


def unknown_names(
    script: Script, names: ConditionNames, own: Collection[str] = ()
) -> Iterator[ConditionFault]:
    """Yield an error for each name in a script that neither the tree nor the script defines.

    Args:
        script: The script.
        names: The names that the tree defines.
        own: Further defined names.
    """
    known = [*names.known, *own]
    for use in name_uses(script) if not names.is_open else ():
        if use.access is not Access.CREATE and use.name.removeprefix(ROOT_SIGN) not in known:
            message = (
                f"'{use.name}' is neither a fact nor a key of this tree (known: {', '.join(known) or 'none'})"
            )
            yield ConditionFault(message, (use.start, use.end), suggestion=nearest(use.name, known))


def typos(
    script: Script, names: ConditionNames, own: Collection[str], later: Collection[str] = ()
) -> Iterator[ConditionFault]:
    """Yield the errors in a condition.

    Args:
        script: The condition.
        names: The names that the tree defines.
        own: The names of the values of the run itself, such as `tick`.
        later: The names of values that are only known at the end of a tick.
    """
    usable = True
    for use in name_uses(script):
        place = (use.start, use.end)
        if use.access is not Access.READ:
            message = f"a condition must not change '{use.name}'"
            yield ConditionFault(message, place, hint="write == to compare")
        elif use.name in later:
            message = f"'{use.name}' is only known after a tick, but events are evaluated during a tick"
            yield ConditionFault(message, place, hint="use this condition only in 'end' or 'at_end'")
        else:
            continue
        usable = False
    if usable:
        yield from unknown_names(script, names, own)


STARTS = "starts"
_EVENT_NAMES = {STARTS: STARTED, HALTED: HALTED}


@dataclass(frozen=True)
class EventPattern:
    """A pattern of leaf events, as written in a file, such as `OpenDoor opened`.

    Attributes:
        text: The pattern as written.
        leaves: The leaves whose events match.
        what: The kind of event: `STARTED`, `RETURNED` or `HALTED`.
        outcome: For `RETURNED`, the label or the status.
    """

    text: str
    leaves: tuple[StubLeaf, ...]
    what: str
    outcome: str = ""

    def matches(self, event: Event) -> bool:
        """Return whether an event matches this pattern."""
        if event.what != self.what or all(leaf.number != event.number for leaf in self.leaves):
            return False
        return self.what != RETURNED or self.outcome in (event.label, event.status)


class LeafVocabulary:
    """Parses the leaf names, events and conditions in a document, and reports errors as findings."""

    def __init__(self, document: Document, simulated: SimulatedTree) -> None:
        self.document = document
        self.leaves = simulated.leaves
        self.simulated = simulated
        self._origins = simulated.compiled.origins

    @functools.cached_property
    def names(self) -> ConditionNames:
        """The names that conditions can use."""
        return names_of(self.simulated)

    def spec(self, leaf: StubLeaf) -> NodeSpec:
        """Return the node spec of a leaf."""
        return self._origins[leaf.id].bound.spec

    def leaves_for_key(self, key: str) -> tuple[StubLeaf, ...]:
        """Return the leaves whose path, name or tag matches a key."""
        return tuple(leaf for leaf in self.leaves if match_rank(key, leaf.path, leaf.tag))

    def find(self, value: Value) -> tuple[StubLeaf, ...]:
        """Return the leaves that a value names, or report an error if it names no leaf."""
        key = value.text or ""
        found = self.leaves_for_key(key)
        if not found:
            self._report_unknown(value, key)
        return found

    def parse_outcome(self, value: Value, leaves: Sequence[StubLeaf]) -> str | None:
        """Return a value's text if it is a label or status that the leaves can return, or report an error."""
        text, known = value.text or "", outcome_words(leaves)
        if text not in known:
            message = f"'{leaves[0].name}' never returns '{text}'. It returns {', '.join(known)}"
            self.document.report("unknown-outcome", message, value, suggestion=nearest(text, known))
            return None
        return text

    def condition(
        self, value: Value | None, own: Collection[str], later: Collection[str] = ()
    ) -> Script | None:
        """Parse a condition, and report the errors in the condition.

        Args:
            value: The condition; None if there is none.
            own: The names of the values of the run itself, such as `tick`.
            later: The names of values that are only known at the end of a tick.
        """
        condition = script(self.document, value)
        if condition is None or value is None:
            return None
        found = list(typos(condition, self.names, own, later))
        for typo in found:
            code = "wrong-condition" if typo.hint else "unknown-fact"
            self.document.report(
                code, typo.message, value, typo.place, suggestion=typo.suggestion, hint=typo.hint
            )
        return None if found else condition

    def parse_event(self, value: Value) -> EventPattern | None:
        """Return the pattern of the events that a string names, or report that the string names no event."""
        text = value.text or ""
        words = text.split(" ")
        for count in range(len(words) - 1, 0, -1):
            key, rest = " ".join(words[:count]), " ".join(words[count:])
            leaves = self.leaves_for_key(key)
            if leaves:
                return self._events_of_leaves(value, leaves, (text, rest))
        known = self.leaves_for_key(text)
        if known:
            message = f"'{text}' is a leaf, not an event"
            self.document.report(
                "wrong-value", message, value, hint=f"write {text} {outcome_words(known)[0]}"
            )
        else:
            self._report_unknown(value, words[0])
        return None

    def _events_of_leaves(
        self, value: Value, leaves: tuple[StubLeaf, ...], texts: tuple[str, str]
    ) -> EventPattern | None:
        text, rest = texts
        if rest in _EVENT_NAMES:
            return EventPattern(text, leaves, _EVENT_NAMES[rest])
        known = outcome_words(leaves)
        if rest in known:
            return EventPattern(text, leaves, RETURNED, rest)
        message = f"'{leaves[0].name}' has no event '{rest}' (known: {', '.join([*known, *_EVENT_NAMES])})"
        near = nearest(rest, [*known, *_EVENT_NAMES])
        part = (len(text) - len(rest), len(text))
        self.document.report("unknown-outcome", message, value, part, suggestion=near)
        return None

    def _report_unknown(self, value: Value, key: str) -> None:
        names = list(dict.fromkeys(word for leaf in self.leaves for word in (leaf.name, leaf.tag)))
        message = f"unknown leaf '{key}' (known: {', '.join(names) or 'none'})"
        self.document.report("unknown-leaf", message, value, suggestion=nearest(key, names))


def outcome_words(leaves: Iterable[StubLeaf]) -> list[str]:
    """Return the labels of the outcomes that leaves can return, followed by the statuses."""
    labels = [outcome.label for leaf in leaves for outcome in leaf.outcomes if outcome.label]
    statuses = {outcome.status for leaf in leaves for outcome in leaf.outcomes}
    return [*dict.fromkeys(labels), *(status for status in STATUSES if status in statuses)]
