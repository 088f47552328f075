"""The locations of an element's parts in a YAML text."""

import bisect
import re
from array import array
from collections.abc import Iterable, Iterator, Sequence
from typing import NamedTuple

from sar_compiler.tree.diagnostic import LINE_END, AttributePlaces, ElementView, Form, Spans

_HEADER = re.compile(r"[|>][^\r\n]*(?:\r\n|\r|\n|$)")
# The written form of characters of a value: a fold, an escape, or a character itself.
_FOLD = r"(?P<fold>[ \t]*(?:\r\n|\r|\n)[ \t\r\n]*)"
_PLAIN = re.compile(rf"{_FOLD}|.", re.DOTALL)
_SINGLE = re.compile(rf"{_FOLD}|''|.", re.DOTALL)
_DOUBLE = re.compile(
    rf"{_FOLD}|(?P<joint>\\(?:\r\n|\r|\n)[ \t\r\n]*)|\\x..|\\u.{{4}}|\\U.{{8}}|\\.|.", re.DOTALL
)


class YamlSpans(Spans):
    """The locations of a file's tags, attribute names and values.

    The parser stores them as plain numbers in file order. Finding them later would require parsing the file again.
    """

    form = Form.YAML

    def __init__(self) -> None:
        # For each element: the offsets of its tag, and the range of its attributes' offsets.
        self._tags = array("L")
        self._tag_ends = array("L")
        self._first = array("L")
        # For each attribute: start and end of its name, start and end of its value with quotes.
        self._places = array("L")
        # The offsets of values that are verbatim parts of the file: lists and mappings.
        self._verbatim: set[int] = set()

    def begin(self, start: int, end: int) -> int:
        """Store the location of a tag, and return its number for `finish`."""
        self._tags.append(start)
        self._tag_ends.append(end)
        self._first.append(0)
        return len(self._tags) - 1

    def finish(self, number: int, places: Iterable[int]) -> None:
        """Store the offsets of an element's attributes, in order. Each attribute has four offsets."""
        self._first[number] = len(self._places)
        self._places.extend(places)

    def add_verbatim(self, start: int) -> None:
        """Store the offset of a list or a mapping that is the value of an attribute."""
        self._verbatim.add(start)

    def is_verbatim(self, start: int) -> bool:
        """Return whether the value at an offset is identical to the file's text, except for indentation."""
        return start in self._verbatim

    def tag(self, element: ElementView) -> tuple[int, int]:
        """Return the offsets of the element's tag."""
        number = self._number(element)
        return self._tags[number], self._tag_ends[number]

    def attributes(self, element: ElementView) -> Iterator[tuple[str, AttributePlaces]]:
        """Yield the names and offsets of an element's attributes.

        The offsets include quotes and block headers.
        """
        for index, name in enumerate(element.attributes, self._first[self._number(element)] // 4):
            start, end, begin, behind = self._places[4 * index : 4 * index + 4]
            yield name, (start, end, begin, behind)

    def inside(self, text: str, start: int, end: int) -> tuple[int, int]:
        """Return the offsets of a name or value, excluding quotes and the header of a block."""
        return (start, end) if start in self._verbatim else unquote(text, start, end)

    def characters(self, text: str, start: int, end: int, value: str) -> Sequence[int]:
        """Return the offset of each character of a parsed value, and the value's end offset."""
        if start in self._verbatim:
            return [min(offset, end) for offset in _offsets_in_literal(text, start, end, value)]
        return offsets_in_scalar(text, start, end, value)

    def _number(self, element: ElementView) -> int:
        return bisect.bisect_left(self._tags, element.offset)


def unquote(text: str, start: int, end: int) -> tuple[int, int]:
    """Return the offsets of a scalar, excluding its quotes, or the header and the end of a block."""
    if text[start : start + 1] in ("'", '"'):
        return start + 1, end - 1
    header = _HEADER.match(text, start, end)
    if header is None:
        return start, end
    block = text[header.end() : end]
    stripped = block.strip(" \t\r\n")
    begin = header.end() + (block.index(stripped) if stripped else 0)
    return begin, begin + len(stripped)


def offsets_in_scalar(text: str, start: int, end: int, value: str) -> Sequence[int]:
    """Return the offset of each character of a value in its YAML scalar, and the end offset of the value."""
    first, last = unquote(text, start, end)
    if last - first == len(value) and text.startswith(value, first):  # nearly every value
        return range(first, last + 1)
    header = _HEADER.match(text, start, end)
    if header is None:
        found = _offsets_in_line(text, start, first, last)
    elif text[start] == "|":
        found = _offsets_in_literal(text, header.end(), last, value)
    else:
        found = _offsets_in_folded(text, first, last, value)
    return [min(max(first, offset), last) for offset in [*found, last]]


def _offsets_in_line(text: str, start: int, first: int, last: int) -> list[int]:
    """Return the offsets for a plain or quoted scalar.

    YAML reads a line break in it, with the spaces around the line break, as one space.
    """
    units = {"'": _SINGLE, '"': _DOUBLE}.get(text[start], _PLAIN)
    offsets: list[int] = []
    for unit in units.finditer(text, first, last):
        groups = unit.groupdict()
        breaks = len(LINE_END.findall(unit.group()))
        if groups["fold"] is not None:
            characters = max(1, breaks - 1)
        elif groups.get("joint") is not None:
            characters = breaks - 1
        else:
            characters = 1
        offsets += [unit.start()] * characters
    return offsets


def _offsets_in_literal(text: str, start: int, last: int, value: str) -> list[int]:
    """Return the offsets for a literal block, in which each line has additional indentation."""
    offsets: list[int] = []
    for line in value.split("\n"):
        ending = LINE_END.search(text, start, last)
        end = ending.start() if ending else last
        offsets += range(max(start, end - len(line)), end + 1)
        start = ending.end() if ending else last
    return offsets


def _offsets_in_folded(text: str, first: int, last: int, value: str) -> list[int]:
    """Return the offsets for a folded block.

    Characters are matched in order. The skipped characters are whitespace.
    """
    offsets: list[int] = []
    place = first
    for character in value:
        found = place
        while found < last and text[found] != character and text[found] in " \t\r\n":
            found += 1
        offsets.append(place if character in " \n" else found)
        place = found if character in " \n" and text[found : found + 1] != character else found + 1
    return offsets


class SplitNumber(NamedTuple):
    """A number with a decimal comma between braces, where a comma ends the value.

    Attributes:
        start: The offset of the number's first character.
        written: The number as written: `0,5`.
        meant: The number with a point; None if the comma may also separate thousands.
        hint: A short instruction.
    """

    start: int
    written: str
    meant: str | None
    hint: str | None


def split_number(text: str, start: int, end: int) -> SplitNumber | None:
    """Return the number with a decimal comma whose last digits YAML has read as a key.

    The result is None for any other key.

    Args:
        text: The text of the file.
        start: The start offset of the key.
        end: The end offset of the key.
    """
    before = _BEFORE_COMMA.search(text[max(start - _LONGEST, 0) : start])
    digits = text[start:end]
    if before is None or not (digits.isascii() and digits.isdigit()):
        return None
    number = before[1]
    point, written = f"{number}.{digits}", f"{number},{digits}"
    if len(digits) == 3 and number.strip("+-0"):  # noqa: PLR2004 - the digits of a group of thousands
        hint = f"the comma is ambiguous: write {number}{digits}, or {point}"
        return SplitNumber(start - len(number) - 1, written, None, hint)
    return SplitNumber(start - len(number) - 1, written, point, None)


_LONGEST = 40
_BEFORE_COMMA = re.compile(r"(?<![\w.])([+-]?[0-9]+),$")
SPLIT = "a comma between braces ends a value, so '{}' is read as two values"
"""The message about a `SplitNumber`."""
