"""Values with their places, so that all mistakes in a file are found at once, each as a finding."""

import math
from collections import defaultdict
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from sar_compiler.documents.schema_findings import Path, refusals
from sar_compiler.errors import SarError
from sar_compiler.nodes.values import literal_value
from sar_compiler.tree.diagnostic import Advice, Diagnostic, TreeError
from sar_compiler.tree.source import Source, Span
from sar_compiler.tree.yaml_spans import offsets_in_scalar, unquoted

if TYPE_CHECKING:
    from typing_extensions import Unpack

MAX_BYTES = 2**20
"""Larger files are refused: somebody reads these, and each value takes some thousand times its letters in memory."""

_CONSTANTS: dict[str, bool | None] = {"true": True, "false": False, "": None}


@dataclass(frozen=True)
class Value:
    """A value in a file.

    Attributes:
        start: The offset of its first character.
        end: The offset after its last one.
        data: The value as plain data; a mapping is a dict, a list a list, nothing is None.
        text: The text of a scalar; None for lists and mappings.
        items: The values of a list; None for other values.
        entries: The keys and values of a mapping; None for other values.
    """

    start: int
    end: int
    data: Any
    text: str | None = None
    items: tuple["Value", ...] | None = None
    entries: tuple[tuple["Value", "Value"], ...] | None = None

    @classmethod
    def of_items(cls, start: int, end: int, items: Iterable["Value"]) -> "Value":
        """Return a list."""
        taken = tuple(items)
        return cls(start, end, [item.data for item in taken], items=taken)

    @classmethod
    def of_entries(cls, start: int, end: int, entries: Iterable[tuple["Value", "Value"]]) -> "Value":
        """Return a mapping; its keys are unique texts."""
        taken = tuple(entries)
        return cls(start, end, {key.text: inner.data for key, inner in taken}, entries=taken)

    @property
    def is_nothing(self) -> bool:
        """Whether the value is empty."""
        return self.data is None and not self.text

    @property
    def kind(self) -> str:
        """The kind of value, as named in a sentence."""
        if self.text is None:
            return "a list" if self.entries is None else "a mapping"
        if self.is_nothing:
            return "nothing"
        is_quoted = isinstance(self.data, str) and self.meaning != self.data
        return f"the text '{self.text}'" if is_quoted else f"'{self.text}'"

    @property
    def meaning(self) -> bool | float | str | None:
        """What the text of a scalar means where no quotes are around it."""
        return meaning_of(self.text or "")

    @property
    def mapping(self) -> dict[str, "Value"]:
        """The values of a mapping by their keys; empty for other values."""
        return {key.text or "": inner for key, inner in self.entries or ()}

    @property
    def listed(self) -> tuple["Value", ...]:
        """The items of a list; a single value counts as a list of one."""
        return (self,) if self.items is None else self.items

    def at(self, path: Path) -> "Value":
        """Return the value at a path of keys and indices."""
        value = self
        for step in path:
            value = value.listed[step] if isinstance(step, int) else value.mapping[step]
        return value

    def name_at(self, path: Path) -> "Value":
        """Return the key of the value at a path; the value itself if it has none."""
        keys = (key for key, _ in self.at(path[:-1]).entries or () if path and key.text == path[-1])
        return next(keys, self.at(path))

    def without(self, paths: Iterable[Path]) -> "Value":
        """Return this value without those at given paths, none of which is empty."""
        below: defaultdict[int | str, set[Path]] = defaultdict(set)
        for path in paths:
            below[path[0]].add(path[1:])
        if self.items is not None:
            kept = [(item, below[index]) for index, item in enumerate(self.items)]
            items = [item.without(gone) if gone else item for item, gone in kept if () not in gone]
            return Value.of_items(self.start, self.end, items)
        entries = [(key, inner, below[key.text or ""]) for key, inner in self.entries or ()]
        left = [
            (key, inner.without(gone) if gone else inner) for key, inner, gone in entries if () not in gone
        ]
        return Value.of_entries(self.start, self.end, left)


def meaning_of(text: str) -> bool | float | str | None:
    """Return the value of an unquoted text: a number, a Boolean or None if it is written as one, else the text."""
    if text in _CONSTANTS:
        return _CONSTANTS[text]
    value = literal_value(text)
    return value if isinstance(value, str) or math.isfinite(value) else text


class Document:
    """A file that is being read.

    Attributes:
        source: The file.
        root: Its content; set by the reader of its format.
        findings: The mistakes found so far.
    """

    root: Value

    def __init__(self, source: Source) -> None:
        self.source = source
        self.findings: list[Diagnostic] = []

    def report(
        self,
        code: str,
        message: str,
        value: Value,
        part: tuple[int, int] | None = None,
        **advice: "Unpack[Advice]",
    ) -> None:
        """Note a mistake in a value.

        Args:
            code: The kind of the finding.
            message: The text of the finding.
            value: The value.
            part: The start and end of the wrong part of a scalar's text; None for all of it.
            **advice: As in `Diagnostic`.
        """
        self.findings.append(Diagnostic(code, message, self.source, self.span(value, part), **advice))

    def validate(self, schema: str, value: Value | None = None) -> Value:
        """Check a value by a schema, report its mistakes, and return the value without them.

        The result conforms to the schema, so that it needs no further checks.

        Args:
            schema: `scenario` for `schemas/sar_scenario.schema.json`, and so on.
            value: The value; by default the whole file.

        Raises:
            TreeError: If no part of it can be used; carries all findings.
        """
        left = self.root if value is None else value
        refused = list(refusals(left, schema))
        # If several parts of the schema refuse one value, the first finding counts.
        said: set[tuple[Path, str]] = set()
        for each in refused:
            if each.message and (each.path, each.code) not in said:
                place, suggestion, hint = each.place, each.suggestion, each.hint
                self.report(each.code, each.message, place, suggestion=suggestion, hint=hint)
                said.add((each.path, each.code))
        # A mapping that lost a key which it needs goes as well.
        while refused:
            if any(not each.path for each in refused):
                self.raise_findings()
            left = left.without([each.path for each in refused])
            refused = list(refusals(left, schema))
        return left

    @contextmanager
    def findings_first(self) -> Iterator[None]:
        """Raise the findings about the file instead of an error that may result from them.

        Raises:
            TreeError: If the file has findings and the block raises a `SarError`.
        """
        try:
            yield
        except SarError:
            self.raise_findings()
            raise

    def raise_findings(self) -> None:
        """Raise all findings about the file, in its order.

        Raises:
            TreeError: If there are findings.
        """
        if self.findings:
            found = dict.fromkeys(self.findings)
            raise TreeError(sorted(found, key=lambda each: (each.span.line, each.span.column)))

    def span(self, value: Value, part: tuple[int, int] | None = None) -> Span:
        """Return the place of a value, or of a part of its text; for lists and mappings the first line."""
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
