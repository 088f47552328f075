"""A text, where it came from, and places in it."""

import bisect
import functools
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from enum import Enum
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from sar_compiler.tree.model import Element

# What XML and YAML both take for the end of a line; str.splitlines() knows more kinds.
_LINE_END = re.compile(r"\r\n|\r|\n")


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


class Spans:
    """Finds the parts of elements in a text; each form of tree file has its own, and a text without elements this one."""

    form = Form.XML

    def tag(self, _element: "Element") -> tuple[int, int]:
        """Return the offsets at which an element begins and its tag's name ends."""
        return 0, 0

    def attributes(self, _element: "Element") -> Iterator[tuple[str, AttributePlaces]]:
        """Yield the names and the places of an element's attributes, in the order of the text."""
        return iter(())

    def inside(self, _text: str, start: int, end: int) -> tuple[int, int]:
        """Return the place of a name or a value without its quotes."""
        return start, end

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
        return [0, *(end.end() for end in _LINE_END.finditer(self.text))]

    @property
    def line_end(self) -> str:
        """What ends the first line, as it does the others of nearly every file."""
        end = _LINE_END.search(self.text)
        return end[0] if end else "\n"

    @functools.cached_property
    def _wide(self) -> dict[tuple[int, int], dict[str, AttributePlaces]]:
        """The places of the attributes of those elements that have many, or long ones."""
        return {}

    def attribute(self, element: "Element", name: str) -> AttributePlaces | None:
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
        return len(_LINE_END.findall(self.text, start, offset)) > 1
