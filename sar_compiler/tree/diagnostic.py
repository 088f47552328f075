"""A text with the places in it, and a finding about one: what is wrong there, and what to write instead."""

import bisect
import functools
import itertools
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from enum import Enum
from typing import Any, NamedTuple, Protocol, TypedDict

from sar_compiler.errors import SarError
from sar_compiler.tree.severity import Severity as Severity
from sar_compiler.tree.showing import in_one_line, shortened, visible

LINE_END = re.compile(r"\r\n|\r|\n")
"""What XML and YAML both take for the end of a line; str.splitlines() knows more kinds."""


class Span(NamedTuple):
    """A stretch of a text; lines and columns count characters from 1, the end is exclusive.

    Attributes:
        line: The first character's line.
        column: The first character's column.
        end_line: The line of the character behind the last one.
        end_column: The column of the character behind the last one.
    """

    line: int
    column: int
    end_line: int
    end_column: int


class Form(str, Enum):
    """The form of a tree file."""

    XML = "xml"
    YAML = "yaml"


AttributePlaces = tuple[int, int, int, int]
"""The offsets at which an attribute's name and its value begin and end."""


class ElementView(Protocol):
    """What is asked of an element to find its parts in the text."""

    @property
    def source(self) -> "Source":
        """The file."""

    @property
    def place(self) -> tuple[int, int]:
        """The line and the column where it begins."""

    @property
    def offset(self) -> int:
        """The offset of its first character."""

    @property
    def attributes(self) -> Mapping[str, str]:
        """Its attributes, in the order written."""


class Spans:
    """Finds the parts of elements in a text; each form of tree file has its own, and a text without elements this one."""

    form = Form.XML

    def tag(self, _element: ElementView) -> tuple[int, int]:
        """Return the offsets at which an element begins and its tag's name ends."""
        return 0, 0

    def attributes(self, _element: ElementView) -> Iterator[tuple[str, AttributePlaces]]:
        """Yield the names and the places of an element's attributes, in the order of the text."""
        return iter(())

    def inside(self, _text: str, start: int, end: int) -> tuple[int, int]:
        """Return the place of a name or a value without its quotes."""
        return start, end

    def is_verbatim(self, _start: int) -> bool:
        """Return whether a value that begins there stands in the file as it is read, but for its indentation."""
        return False

    def characters(self, _text: str, start: int, end: int, _value: str) -> Sequence[int]:
        """Return the place of each character of a value as it was read, and of its end."""
        return range(start, end + 1)


_FEW, _SHORT = 16, 1000
"""Up to this number of attributes, and of characters in them, places are looked up again each time they are asked for."""


@dataclass(frozen=True)
class Source:
    """The text of a file.

    Attributes:
        path: The file's path, as its user wrote it.
        text: The whole text.
        spans: Finds parts of elements in it.
        encoding: How the text is encoded in the file.
        bom: The byte order mark before it; empty where there is none.
    """

    path: str
    text: str = field(repr=False)
    spans: Spans = field(repr=False)
    encoding: str = "utf-8"
    bom: str = field(default="", repr=False)

    @property
    def form(self) -> Form:
        """The form of the text."""
        return self.spans.form

    @functools.cached_property
    def line_starts(self) -> list[int]:
        """The offset of each line's first character."""
        if "\r" not in self.text:  # nearly always, and much faster
            return [*itertools.accumulate([len(line) + 1 for line in self.text.split("\n")[:-1]], initial=0)]
        return [0, *(end.end() for end in LINE_END.finditer(self.text))]

    @property
    def line_end(self) -> str:
        """What ends the first line, as it does the others of nearly every file."""
        end = LINE_END.search(self.text)
        return end[0] if end else "\n"

    @functools.cached_property
    def _wide(self) -> dict[tuple[int, int], dict[str, AttributePlaces]]:
        """The places of the attributes of those elements that have many, or long ones."""
        return {}

    def attribute(self, element: ElementView, name: str) -> AttributePlaces | None:
        """Return the places of an attribute; None if the text of the element has none of this name."""
        values, attributes = element.attributes.values(), self.spans.attributes(element)
        if len(values) <= _FEW and sum(map(len, values)) <= _SHORT:
            return next((places for each, places in attributes if each == name), None)
        if element.place not in self._wide:
            self._wide[element.place] = dict(attributes)
        return self._wide[element.place].get(name)

    def offset(self, line: int, column: int) -> int:
        """Return the offset of a place given by line and column."""
        return self.line_starts[line - 1] + column - 1

    def offsets(self, span: Span) -> tuple[int, int]:
        """Return the offsets at which a stretch begins and ends."""
        return self.offset(span.line, span.column), self.offset(span.end_line, span.end_column)

    def line(self, number: int) -> str:
        """Return a line without its end; an empty text for lines that are not there."""
        if not 1 <= number <= len(self.line_starts):
            return ""
        end = self.line_starts[number] if number < len(self.line_starts) else len(self.text)
        return self.text[self.line_starts[number - 1] : end].rstrip("\r\n")

    def span(self, start: int, end: int) -> Span:
        """Return the stretch between two offsets."""
        return Span(*self.place(start), *self.place(end))

    def inside(self, start: int, end: int) -> Span:
        """Return the stretch of a name or a value, without its quotes."""
        return self.span(*self.spans.inside(self.text, start, end))

    def place(self, offset: int) -> tuple[int, int]:
        """Return the line and the column of an offset."""
        line = bisect.bisect_right(self.line_starts, offset)
        return line, offset - self.line_starts[line - 1] + 1

    def blank_before(self, offset: int, passing: str = " \t\r\n") -> bool:
        """Return whether a blank line is before an offset, with only characters of *passing* in between."""
        start = offset
        while start and self.text[start - 1] in passing:
            start -= 1
        return len(LINE_END.findall(self.text, start, offset)) > 1


WIDTH = 128
"""The width of a finding as text, where nothing says how wide it may be."""

_MARGIN, _LEAST = 8, 40
"""The columns before an excerpt, and the fewest characters that are shown of a long line."""


AS_DECLARED: Any = None
"""In place of a severity: the one that the kind of the finding is declared with."""


def _plain(text: str, _part: str) -> str:
    return text


class Cause(NamedTuple):
    """What findings with several messages come of: one thing to do about all of them.

    Attributes:
        text: What is wrong with all of their subjects, as the beginning of a sentence that lists them.
        subject: What this finding is about: a name of the file.
    """

    text: str
    subject: str


class Advice(TypedDict, total=False):
    """What a finding has besides its kind, its message and its place; see `Diagnostic`."""

    suggestion: str | None
    hint: str | None
    severity: Severity
    common_cause: Cause | None


@dataclass(frozen=True)
class Diagnostic:
    """One finding.

    Making one of a code that is not declared raises a `KeyError`.

    Attributes:
        code: Its kind, declared in `tree.kinds`.
        message: What is wrong, in the reader's words.
        source: The file.
        span: Its place.
        suggestion: The text to put in its place, where that can be guessed.
        hint: What to do about it, in a few words, where there is no such text.
        severity: Its severity; given only where this one is worse than its kind, or not as bad.
        common_cause: What it comes of, if findings with other messages come of the same.
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
        # Most files have no finding, and need not wait for the kinds.
        from sar_compiler.tree.kinds import SEVERITIES

        declared = SEVERITIES[self.code]
        object.__setattr__(self, "severity", self.severity or declared)
        # A value that is quoted may be as long as a file.
        object.__setattr__(self, "message", shortened(self.message))
        object.__setattr__(self, "hint", self.hint and shortened(self.hint))

    @property
    def identity(self) -> tuple[object, ...]:
        """What it has in common with the same finding of another check: a file may be included by several."""
        return self.source.path, self.span, self.code, self.message

    @property
    def cause(self) -> str:
        """What it comes of, equal for all findings that come of the same."""
        return f"{self.code}: {self.common_cause.text if self.common_cause else self.message}"

    @property
    def advice(self) -> str:
        """The advice on what to write or do instead; empty if there is none."""
        if not self.suggestion:
            return self.hint or ""
        quote = next((mark for mark in "'\"`" if mark not in self.suggestion), "")
        return f"did you mean {quote}{shortened(self.suggestion)}{quote}?"

    def render(self, width: int = WIDTH, paint: Callable[[str, str], str] = _plain) -> str:
        """Return the finding as text: place, message, the line itself with carets, the suggestion.

        Args:
            width: The columns that there are for the line.
            paint: Colours a text by what it is: `place`, `error`, `warning`, `info`, `margin`, `carets`, `advice`.
        """
        span, severity = self.span, self.severity.value
        place = paint(in_one_line(f"{self.source.path}:{span.line}:{span.column}:"), "place")
        head = f"{place} {paint(f'{severity}[{self.code}]', severity)}: {in_one_line(self.message)}"
        line, most = self.source.line(span.line), max(width - _MARGIN, _LEAST)
        advice = paint(in_one_line(self.advice), "advice")
        empty = paint("      |", "margin")
        if not line.strip():
            return f"{head}\n{empty} {advice}" if advice else head
        start = span.column - 1
        end = span.end_column - 1 if span.end_line == span.line else len(line)
        if line[start : start + 1] == "<" and end > start + 1:
            start += 1  # the carets stand under the tag's name
        if len(line) > most:
            left = max(0, min(start - most // 2, len(line) - most))
            line, start, end = line[left : left + most], start - left, min(end - left, most)
        before, marked = visible(line[:start]), visible(line[start:end])
        line = f"{before}{marked}{visible(line[end:])}"
        # A tab stays a tab, so that the carets stand right at any tab width.
        indent = "".join("\t" if character == "\t" else " " for character in before)
        carets = paint("^" * max(1, end - start, len(marked)), "carets")
        number = paint(f"{span.line:5} |", "margin")
        return f"{head}\n{number} {line}\n{empty} {indent}{carets} {advice}".rstrip()


class TreeError(SarError):
    """A tree file that cannot be used.

    Attributes:
        findings: Everything that is wrong with it.
    """

    def __init__(self, findings: Iterable[Diagnostic]) -> None:
        self.findings = tuple(findings)
        super().__init__("\n".join(finding.render() for finding in self.findings))

    def __reduce__(self) -> tuple[object, ...]:
        return type(self), (self.findings,)
