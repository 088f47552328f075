"""YAML files beside a tree, such as scenarios: their values with their places, so that every mistake is a finding.

What a scalar means is asked for where it is used: without quotes `3` can be a number, `true` a truth value, and all
else is the text as it is written.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from datetime import timedelta
from pathlib import Path
from typing import Any

import yaml

from sar_compiler.nodes.values import ConversionError, literal_value, nearest, value_type_of
from sar_compiler.runtime.answers import Fact
from sar_compiler.runtime.expressions import Script
from sar_compiler.runtime.script import parse
from sar_compiler.runtime.tokens import ScriptError
from sar_compiler.tree.content import read_bytes, source_of
from sar_compiler.tree.diagnostic import Diagnostic, TreeError
from sar_compiler.tree.source import Source, Span
from sar_compiler.tree.yaml_events import Events
from sar_compiler.tree.yaml_spans import YamlSpans, offsets_in_scalar, unquoted

_BOOLS = {"true": True, "false": False}
_DURATION = value_type_of(timedelta)


@dataclass(frozen=True)
class Value:
    """A value in a file.

    Attributes:
        start: The offset of its first character.
        end: The offset behind its last one.
        text: What a scalar says; None for lists and mappings.
        plain: Whether a scalar stands without quotes.
        items: The values of a list; None for all else.
        entries: The keys and values of a mapping; None for all else.
    """

    start: int
    end: int
    text: str | None = None
    plain: bool = True
    items: tuple["Value", ...] | None = None
    entries: tuple[tuple["Value", "Value"], ...] | None = None

    @property
    def is_nothing(self) -> bool:
        """Whether nothing is written."""
        return self.text == "" and self.plain

    @property
    def kind(self) -> str:
        """What it is, in a sentence."""
        if self.entries is not None:
            return "a mapping"
        if self.items is not None:
            return "a list"
        return "nothing" if self.is_nothing else f"'{self.text}'"


class Document:
    """A YAML file that is being understood; goes on behind what is wrong, so that everything is found.

    Args:
        data: Its content.
        path: What to call it in findings.
        empty_hint: What to write in an empty file.

    Raises:
        TreeError: If it is not YAML, too large, or uses what only YAML has.

    Attributes:
        source: The file.
        root: What it says.
        findings: What is wrong with it so far.
    """

    def __init__(self, data: bytes | str, path: str, empty_hint: str) -> None:
        self.source: Source = source_of(data, path, YamlSpans(), None, empty_hint)
        self.findings: list[Diagnostic] = []
        events = Events(self.source)
        events.take()  # the stream begins
        if not isinstance(events.next, yaml.DocumentStartEvent):
            start = Span(1, 1, 1, 1)
            raise TreeError(
                [Diagnostic("empty-file", "the file is empty", self.source, start, hint=empty_hint)]
            )
        events.take()
        self.root = _value(events)
        events.take()  # the document ends
        if isinstance(events.next, yaml.DocumentStartEvent):
            mark = _start(events.next)
            message, hint = "a second document begins here; such a file is one", "put it in a file of its own"
            events.report("second-document", message, mark, mark + 3, hint=hint)
        if events.findings:
            raise TreeError(events.findings)

    @classmethod
    def read(cls, path: str | Path, empty_hint: str) -> "Document":
        """Read a file.

        Raises:
            UnreadableFileError: If it is not there or cannot be read.
            TreeError: As the constructor.
        """
        return cls(read_bytes(path), str(path), empty_hint)

    def report(
        self,
        value: Value,
        code: str,
        message: str,
        part: tuple[int, int] | None = None,
        **advice: str | None,
    ) -> None:
        """Note that something is wrong with a value.

        Args:
            value: The value.
            code: The kind of the finding.
            message: What is wrong.
            part: From and to which character of a scalar's text; None for all of it.
            advice: `suggestion` or `hint`, as `Diagnostic` has them.
        """
        self.findings.append(Diagnostic(code, message, self.source, self._span(value, part), **advice))  # type: ignore[arg-type]

    def mapping(self, value: Value, known: Sequence[str] | None, what: str) -> dict[str, Value]:
        """Return the values of a mapping by their keys.

        Args:
            value: The mapping.
            known: The keys that there can be; None for any.
            what: What the mapping is, in a sentence: "a scenario".
        """
        return {key.text or "": inner for key, inner in self.entries(value, known, what)}

    def entries(self, value: Value, known: Sequence[str] | None, what: str) -> list[tuple[Value, Value]]:
        """Return the keys and values of a mapping, as `mapping` does; each key once, and all of them texts."""
        if value.entries is None:
            listed = f" of {', '.join(known)}" if known else ""
            self.report(value, "wrong-shape", f"{what} is a mapping{listed}, and this is {value.kind}")
            return []
        found: dict[str, tuple[Value, Value]] = {}
        for key, inner in value.entries:
            if not key.text:
                self.report(key, "wrong-shape", f"a key is a word, and this is {key.kind}")
            elif key.text in found:
                self.report(key, "duplicate-key", f"'{key.text}' is written twice here")
            elif known is not None and key.text not in known:
                message = f"{what} has no '{key.text}'; it has {', '.join(known)}"
                self.report(key, "unknown-key", message, suggestion=nearest(key.text, known))
            else:
                found[key.text] = (key, inner)
        return list(found.values())

    def listed(self, value: Value) -> tuple[Value, ...]:
        """Return the items of a list; a single value counts as a list of one."""
        return (value,) if value.items is None else value.items

    def text(self, value: Value, what: str) -> str | None:
        """Return what a scalar says; reports a value that is none."""
        if not value.text:
            self.report(value, "wrong-shape", f"{what} is a text, and this is {value.kind}")
            return None
        return value.text

    def word(self, value: Value, known: Iterable[str], what: str) -> str | None:
        """Return what a scalar says, one of some words; reports anything else."""
        words = list(known)
        text = self.text(value, what)
        if text is not None and text not in words:
            message = f"{what} is one of {', '.join(words)}, and this is '{text}'"
            self.report(value, "wrong-value", message, suggestion=nearest(text, words))
            return None
        return text

    def truth(self, value: Value, what: str) -> bool | None:
        """Return whether a scalar says true; reports what says neither."""
        text = self.word(value, _BOOLS, what)
        return None if text is None else _BOOLS[text]

    def fact(self, value: Value, what: str) -> Fact | None:
        """Return a number, a truth value or a text; reports lists, mappings and nothing."""
        if value.text is None or value.is_nothing:
            message = f"{what} is a number, true, false or a text, and this is {value.kind}"
            hint = "write '' for an empty text" if value.is_nothing else None
            self.report(value, "wrong-shape", message, hint=hint)
            return None
        if not value.plain:
            return value.text
        return _BOOLS.get(value.text, literal_value(value.text))

    def whole(self, value: Value, what: str, least: int = 0) -> int | None:
        """Return a whole number; reports anything else."""
        number = literal_value(value.text) if value.text and value.plain else None
        if not isinstance(number, int) or number < least:
            message = f"{what} is a whole number from {least} on, and this is {value.kind}"
            self.report(value, "wrong-value", message)
            return None
        return number

    def seconds(self, value: Value, what: str) -> float | None:
        """Return a duration in seconds; reports anything else."""
        assert _DURATION is not None  # noqa: S101 - durations are a type
        try:
            span: Any = _DURATION.convert((value.text or "").replace(" ", ""))
        except ConversionError:
            message = f"{what} is a duration, and this is {value.kind}"
            self.report(value, "wrong-value", message, hint="write 4, 4s, 500ms or 2min")
            return None
        return float(span.total_seconds())

    def script(self, value: Value, what: str) -> Script | None:
        """Return a script; reports what cannot be read, at its place."""
        text = self.text(value, what)
        if text is None:
            return None
        try:
            return parse(text)
        except ScriptError as error:
            self.report_script(value, error)
            return None

    def report_script(self, value: Value, error: ScriptError) -> None:
        """Note what is wrong with a script, at its place."""
        advice = {"suggestion": error.suggestion, "hint": error.hint}
        self.report(value, "script-error", error.message, (error.start, error.end), **advice)

    def _span(self, value: Value, part: tuple[int, int] | None) -> Span:
        source = self.source
        if value.text is None:
            # Only its beginning: a mapping may go on for many lines.
            line = source.span(value.start, value.start).line
            end = source.offset(line, len(source.line(line)) + 1)
            return source.span(value.start, max(value.start + 1, min(value.end, end)))
        start, end = unquoted(source.text, value.start, value.end)
        if part is None:
            return source.span(start, max(start + 1, end))
        offsets = offsets_in_scalar(source.text, value.start, value.end, value.text)
        first, last = (offsets[min(place, len(offsets) - 1)] for place in part)
        return source.span(first, max(first + 1, last))


def raise_findings(documents: Iterable[Document]) -> None:
    """Raise all that is wrong with some files.

    Raises:
        TreeError: If there is anything.
    """
    findings = [finding for document in documents for finding in _in_order(document.findings)]
    if findings:
        raise TreeError(findings)


def _in_order(findings: list[Diagnostic]) -> list[Diagnostic]:
    return sorted(dict.fromkeys(findings), key=lambda found: (found.span.line, found.span.column))


def _value(events: Events) -> Value:
    """Read the value that comes next."""
    event: Any = events.take()
    start, end = _start(event), int(event.end_mark.index)
    if isinstance(event, yaml.SequenceStartEvent):
        items = []
        while not isinstance(events.next, yaml.SequenceEndEvent):
            items.append(_value(events))
        return Value(start, events.take().end_mark.index, items=tuple(items))
    if isinstance(event, yaml.MappingStartEvent):
        entries = []
        while not isinstance(events.next, yaml.MappingEndEvent):
            key = _value(events)
            entries.append((key, _value(events)))
        return Value(start, events.take().end_mark.index, entries=tuple(entries))
    if isinstance(event, yaml.AliasEvent):  # has a finding already
        return Value(start, end, text="")
    return Value(start, end, text=event.value, plain=not event.style)


def _start(event: Any) -> int:
    return int(event.start_mark.index)
