"""Source texts, and findings about them with locations and suggested replacements."""

import bisect
import functools
import itertools
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from enum import Enum
from typing import Any, NamedTuple, Protocol, TypedDict

from sar_compiler.errors import SarError
from sar_compiler.tree.display_text import escape_to_one_line, shorten, visible
from sar_compiler.tree.severity import Severity as Severity

LINE_END = re.compile(r"\r\n|\r|\n")
"""The line endings of XML and YAML. `str.splitlines()` also splits at other characters."""


class Span(NamedTuple):
    """A range of characters in a text. Lines and columns begin at 1, and the end is exclusive.

    Attributes:
        line: The line of the first character.
        column: The column of the first character.
        end_line: The line of the first character after the range.
        end_column: The column of the first character after the range.
    """

    line: int
    column: int
    end_line: int
    end_column: int


class Form(str, Enum):
    """The format of a tree file."""

    XML = "xml"
    YAML = "yaml"


AttributePlaces = tuple[int, int, int, int]
"""The start and end offsets of an attribute's name, and the start and end offsets of the attribute's value."""


class ElementView(Protocol):
    """The properties of an element that are needed to find the element's parts in the text."""

    @property
    def source(self) -> "Source":
        """The file that contains the element."""

    @property
    def position(self) -> tuple[int, int]:
        """The line and the column of the element's first character."""

    @property
    def offset(self) -> int:
        """The offset of the element's first character."""

    @property
    def attributes(self) -> Mapping[str, str]:
        """The element's attributes, in the order of the file."""


class Spans:
    """Locator of elements' tags, attribute names and values in a text. Each format has a subclass."""

    form = Form.XML

    def tag(self, _element: ElementView) -> tuple[int, int]:
        """Return the start offset of an element and the end offset of its tag name."""
        return 0, 0

    def attributes(self, _element: ElementView) -> Iterator[tuple[str, AttributePlaces]]:
        """Yield the names and offsets of an element's attributes, in the order of the text."""
        return iter(())

    def inside(self, _text: str, start: int, end: int) -> tuple[int, int]:
        """Return the start and end offsets of a name or value, excluding the quotes around it."""
        return start, end

    def is_verbatim(self, _start: int) -> bool:
        """Return whether the value at an offset is identical to the file's text, except for indentation."""
        return False

    def characters(self, _text: str, start: int, end: int, _value: str) -> Sequence[int]:
        """Return the offset of each character of a parsed value, and the value's end offset."""
        return range(start, end + 1)


_FEW, _SHORT = 16, 1000
"""The numbers of attributes and of characters above which the offsets of an element's attributes are cached."""


@dataclass(frozen=True)
class Source:
    """The text of a file.

    Attributes:
        path: The file's path, as the user wrote it.
        text: The whole text, without a byte order mark.
        spans: The locator of the parts of elements in the text.
        encoding: The encoding of the file.
        bom: The byte order mark of the file; empty if the file has no byte order mark.
    """

    path: str
    text: str = field(repr=False)
    spans: Spans = field(repr=False)
    encoding: str = "utf-8"
    bom: str = field(default="", repr=False)

    @property
    def form(self) -> Form:
        """The format of the text."""
        return self.spans.form

    @functools.cached_property
    def line_starts(self) -> list[int]:
        """The offset of each line's first character."""
        if "\r" not in self.text:  # nearly always, and much faster
            return [*itertools.accumulate([len(line) + 1 for line in self.text.split("\n")[:-1]], initial=0)]
        return [0, *(end.end() for end in LINE_END.finditer(self.text))]

    @property
    def line_end(self) -> str:
        """The line ending of the first line. If the text has only one line, the ending is a newline."""
        end = LINE_END.search(self.text)
        return end[0] if end else "\n"

    @functools.cached_property
    def _many_attributes(self) -> dict[tuple[int, int], dict[str, AttributePlaces]]:
        """The cached attribute offsets of elements with many or long attributes, by element position."""
        return {}

    def attribute(self, element: ElementView, name: str) -> AttributePlaces | None:
        """Return the offsets of an attribute; None if the text of the element lacks the attribute."""
        values, attributes = element.attributes.values(), self.spans.attributes(element)
        if len(values) <= _FEW and sum(map(len, values)) <= _SHORT:
            return next((places for each, places in attributes if each == name), None)
        if element.position not in self._many_attributes:
            self._many_attributes[element.position] = dict(attributes)
        return self._many_attributes[element.position].get(name)

    def offset(self, line: int, column: int) -> int:
        """Return the offset of a line and column."""
        return self.line_starts[line - 1] + column - 1

    def offsets(self, span: Span) -> tuple[int, int]:
        """Return the start and end offsets of a span."""
        return self.offset(span.line, span.column), self.offset(span.end_line, span.end_column)

    def line(self, number: int) -> str:
        """Return a line without its line end. If the line does not exist, return an empty string."""
        if not 1 <= number <= len(self.line_starts):
            return ""
        end = self.line_starts[number] if number < len(self.line_starts) else len(self.text)
        return self.text[self.line_starts[number - 1] : end].rstrip("\r\n")

    def span(self, start: int, end: int) -> Span:
        """Return the span between two offsets."""
        return Span(*self.position_of(start), *self.position_of(end))

    def inside(self, start: int, end: int) -> Span:
        """Return the span of a name or value, excluding the quotes around it."""
        return self.span(*self.spans.inside(self.text, start, end))

    def position_of(self, offset: int) -> tuple[int, int]:
        """Return the line and the column of an offset."""
        line = bisect.bisect_right(self.line_starts, offset)
        return line, offset - self.line_starts[line - 1] + 1

    def has_blank_line_before(self, offset: int, passing: str = " \t\r\n") -> bool:
        """Return whether a blank line precedes an offset.

        Only characters of *passing* may be between the blank line and the offset.
        """
        start = offset
        while start and self.text[start - 1] in passing:
            start -= 1
        return len(LINE_END.findall(self.text, start, offset)) > 1


WIDTH = 128
"""The default width of a finding as text, in columns."""

_MARGIN, _LEAST = 8, 40
"""The number of columns before an excerpt, and the minimum number of characters to show of a long line."""


AS_DECLARED: Any = None
"""A placeholder for the declared severity of the finding's kind."""


def _keep_text(text: str, _part: str) -> str:
    return text


class Cause(NamedTuple):
    """The common cause of findings that have different messages but are resolved by the same change.

    Attributes:
        text: The error that all subjects share, as the beginning of a sentence that lists the subjects.
        subject: The subject of this finding: a name from the file.
    """

    text: str
    subject: str


class Advice(TypedDict, total=False):
    """The optional attributes of a finding; see `Diagnostic`."""

    suggestion: str | None
    hint: str | None
    severity: Severity
    common_cause: Cause | None


@dataclass(frozen=True)
class Diagnostic:
    """An error, a warning or a note about a file.

    The constructor raises `KeyError` if the code is not declared.

    Attributes:
        code: The kind of the finding, declared in `tree.kinds`.
        message: The description of the error, in the user's terms.
        source: The file that the finding is about.
        span: The location in the file.
        suggestion: The replacement text, if it can be guessed.
        hint: A short instruction, if there is no replacement text.
        severity: The severity; pass it only if it differs from the severity of the kind.
        common_cause: The cause, if findings with other messages share it.
    """

    code: str
    message: str
    source: Source
    span: Span
    suggestion: str | None = None
    hint: str | None = None
    severity: Severity = AS_DECLARED
    common_cause: Cause | None = None

    def __post_init__(self) -> None:
        # Most files have no findings, so the kinds are imported late.
        from sar_compiler.tree.kinds import SEVERITIES

        declared = SEVERITIES[self.code]
        object.__setattr__(self, "severity", self.severity or declared)
        # A quoted value may be as long as a file.
        object.__setattr__(self, "message", shorten(self.message))
        object.__setattr__(self, "hint", self.hint and shorten(self.hint))

    @property
    def identity(self) -> tuple[object, ...]:
        """The key that duplicates of a finding share.

        Duplicates occur, for example, if several files include the file with the finding.
        """
        return self.source.path, self.span, self.code, self.message

    @property
    def cause(self) -> str:
        """The key by which findings with the same cause are grouped."""
        return f"{self.code}: {self.common_cause.text if self.common_cause else self.message}"

    @property
    def advice(self) -> str:
        """The suggested replacement or instruction; empty if the finding suggests nothing."""
        if not self.suggestion:
            return self.hint or ""
        quote = next((mark for mark in "'\"`" if mark not in self.suggestion), "")
        return f"did you mean {quote}{shorten(self.suggestion)}{quote}?"

    def render(self, width: int = WIDTH, paint: Callable[[str, str], str] = _keep_text) -> str:
        """Return the finding as text, with its location, message, line with carets, and suggestion.

        Args:
            width: The number of available columns.
            paint: A function that colours a text by role: `place`, `error`, `warning`, `info`, `margin`, `carets`, `advice`.
        """
        span, severity = self.span, self.severity.value
        place = paint(escape_to_one_line(f"{self.source.path}:{span.line}:{span.column}:"), "place")
        head = f"{place} {paint(f'{severity}[{self.code}]', severity)}: {escape_to_one_line(self.message)}"
        line, most = self.source.line(span.line), max(width - _MARGIN, _LEAST)
        advice = paint(escape_to_one_line(self.advice), "advice")
        empty = paint("      |", "margin")
        if not line.strip():
            return f"{head}\n{empty} {advice}" if advice else head
        start = span.column - 1
        end = span.end_column - 1 if span.end_line == span.line else len(line)
        if line[start : start + 1] == "<" and end > start + 1:
            start += 1  # the carets mark the tag's name
        if len(line) > most:
            left = max(0, min(start - most // 2, len(line) - most))
            line, start, end = line[left : left + most], start - left, min(end - left, most)
        before, marked = visible(line[:start]), visible(line[start:end])
        line = f"{before}{marked}{visible(line[end:])}"
        # A tab stays a tab, so that the carets are right at any tab width.
        indent = "".join("\t" if character == "\t" else " " for character in before)
        carets = paint("^" * max(1, end - start, len(marked)), "carets")
        number = paint(f"{span.line:5} |", "margin")
        return f"{head}\n{number} {line}\n{empty} {indent}{carets} {advice}".rstrip()


class TreeError(SarError):
    """A tree file cannot be used.

    Attributes:
        findings: All findings of the file.
    """

    def __init__(self, findings: Iterable[Diagnostic]) -> None:
        self.findings = tuple(findings)
        super().__init__("\n".join(finding.render() for finding in self.findings))

    def __reduce__(self) -> tuple[object, ...]:
        return type(self), (self.findings,)
