"""Edits of a tree file in XML.

An element that shares no line with other elements is moved as whole lines, together with the comments directly above it
and at the end of its last line. Any other element is moved as a part of its line.
"""

import bisect
import operator
import re
from collections.abc import Sequence
from typing import NamedTuple

from sar_compiler.editing.text_edits import (
    Snippet,
    SnippetLine,
    TextEdit,
    cut_lines,
    indent_lines,
    join_lines,
)
from sar_compiler.tree.diagnostic import LINE_END
from sar_compiler.tree.model import Element, TreeFile
from sar_compiler.tree.xml_recovery import ATTRIBUTE, TAG_END, attributes_end, readable
from sar_compiler.tree.xml_writer import element_lines, escape_value

_PIECE = re.compile(
    r"(?P<comment><!--.*?-->)|<\?.*?\?>|<!\[CDATA\[.*?\]\]>|(?P<end></)[^>]*>"
    r"""|(?P<start><)(?:"[^"]*"|'[^']*'|[^"'>])*>""",
    re.DOTALL,
)
_offset = operator.attrgetter("offset")
_BLANK = " \t"
_REST = re.compile(r"[ \t]*(?:<!--(?:(?!-->)[^\r\n])*-->)?[ \t]*(?:\r\n|\r|\n|\Z)")
_BEFORE = re.compile(r"[ \t]*(?:\r\n|\r|\n)[ \t]*\Z")


class _TagExtent(NamedTuple):
    """The offsets of an element: the start tag from *start* to *opened*, and the end tag from *closing* to *end*."""

    start: int
    opened: int
    closing: int
    end: int


class _ElementBlock(NamedTuple):
    """The part of a file that is moved with an element.

    Attributes:
        start: The offset of the part's first character, which may belong to a comment above the element.
        own: The offset of the element's first character.
        end: The offset after the part's last character.
        indent: The indentation of the element.
        has_lines: Whether the part consists of whole lines.
    """

    start: int
    own: int
    end: int
    indent: str
    has_lines: bool


class XmlText:
    """Edits of a file in XML.

    Args:
        tree_file: The file.
    """

    def __init__(self, tree_file: TreeFile) -> None:
        self._source = tree_file.source
        self._text = tree_file.source.text
        self._elements = [*tree_file.root.iterate()]
        self._parents = {child.offset: each for each in self._elements for child in each.children}
        self._extents: dict[int, _TagExtent] = {}
        # The start offset of each comment, by the offset of its end.
        self._comments: dict[int, int] = {}
        self._scan(readable(tree_file))
        self._unit = self._indentation()

    def _scan(self, text: str) -> None:
        opened: list[tuple[int, int]] = []
        for piece in _PIECE.finditer(text):
            kind = piece.lastgroup
            if kind == "comment":
                self._comments[piece.end()] = piece.start()
            elif kind == "end":
                start, tag_end = opened.pop()
                self._extents[start] = _TagExtent(start, tag_end, piece.start(), piece.end())
            elif kind == "start" and piece[0].endswith("/>"):
                self._extents[piece.start()] = _TagExtent(
                    piece.start(), piece.end(), piece.end(), piece.end()
                )
            elif kind == "start":
                opened.append((piece.start(), piece.end()))

    def format_new(self, element: Element) -> Snippet:
        """Return the lines of a new element."""
        return [SnippetLine(each) for each in element_lines(element)]

    def wrap(self, wrapper: Element, lines: Snippet) -> Snippet:
        """Return the lines of a new element with other lines as its content."""
        *first, last = element_lines(wrapper)
        start = [SnippetLine(each) for each in (*first, f"{last.removesuffix('/>')}>")]
        return [*start, *indent_lines(lines, self._unit), SnippetLine(f"</{wrapper.tag}>")]

    def copy(self, first: Element, last: Element) -> Snippet:
        """Return the lines of consecutive siblings, with their comments."""
        start, end = self._block(first), self._block(last)
        if start.has_lines and end.has_lines:
            return self._cut(start.start, end.end, start.indent)
        return self._cut(start.own, self._extents[last.offset].end, start.indent)

    def contents(self, element: Element) -> Snippet:
        """Return the lines between the tags of an element."""
        extent = self._extents[element.offset]
        start, end = extent.opened, extent.closing
        while start < end and self._text[start] in _BLANK:
            start += 1
        line_end = LINE_END.match(self._text, start)
        start = line_end.end() if line_end is not None and line_end.end() < end else start
        end = start + len(self._text[start:end].rstrip())
        first = element.children[0]
        return self._cut(start, end, self._block(first).indent)

    def replace(
        self, first: Element, last: Element, lines: Snippet, *, with_comments: bool = True
    ) -> list[TextEdit]:
        """Return the edits that replace consecutive siblings by lines.

        Args:
            first: The first sibling.
            last: The last sibling.
            lines: The lines.
            with_comments: Whether the siblings' comments are replaced, too.
        """
        start, end = self._block(first), self._block(last)
        text = self._join(lines, start.indent)
        if not (with_comments and start.has_lines and end.has_lines):
            return [TextEdit(start.own, self._extents[last.offset].end, text)]
        line_end = self._source.line_end if self._text[: end.end].endswith(("\n", "\r")) else ""
        return [TextEdit(start.start, end.end, f"{start.indent}{text}{line_end}")]

    def insert(self, parent: Element, index: int, lines: Snippet) -> list[TextEdit]:
        """Return the edits that insert lines before the child at an index, or after the last child."""
        if not parent.children:
            return self._insert_first(parent, lines)
        is_last = index == len(parent.children)
        block = self._block(parent.children[-1 if is_last else index])
        text, offset = self._join(lines, block.indent), block.end if is_last else block.start
        if block.has_lines:
            text = f"{block.indent}{text}{self._source.line_end}"
        return [TextEdit(offset, offset, text)]

    def _insert_first(self, parent: Element, lines: Snippet) -> list[TextEdit]:
        extent, end = self._extents[parent.offset], self._source.line_end
        outer = self._line(extent.start)[1]
        inner = outer + self._unit
        text = inner + self._join(lines, inner) + end
        if extent.opened == extent.end:
            tag_end = TAG_END.match(self._text, attributes_end(self._text, self._source.spans.tag(parent)[1]))
            start = tag_end.start() if tag_end is not None else extent.opened - 2
            return [TextEdit(start, extent.opened, f">{end}{text}{outer}</{parent.tag}>")]
        line, lead = self._line(extent.closing)
        if line + len(lead) == extent.closing and line > extent.opened:
            return [TextEdit(line, line, text)]
        inside = self._text[extent.opened : extent.closing]
        start = extent.closing if inside.strip() else extent.opened
        return [TextEdit(start, extent.closing, f"{end}{text}{outer}")]

    def delete_element(self, element: Element) -> list[TextEdit]:
        """Return the edits that remove an element and its comments.

        A parent that has no other content becomes an empty tag.
        """
        block = self._block(element)
        parent = self._parents[element.offset]
        around = self._extents[parent.offset]
        rest = self._text[around.opened : block.start] + self._text[block.end : around.closing]
        if len(parent.children) == 1 and not rest.strip():
            return [TextEdit(around.opened - 1, around.end, "/>")]
        return [TextEdit(block.start, block.end, "")]

    def set_attribute(self, element: Element, name: str, value: str | None) -> list[TextEdit]:
        """Return the edits that set an attribute's value; None removes the attribute."""
        places = self._source.attribute(element, name)
        if places is not None and value is None:
            start = len(self._text[: places[0]].rstrip())
            return [TextEdit(start, places[3] + 1, "")]
        if places is not None and value is not None:
            return [TextEdit(places[2], places[3], escape_value(value, self._text[places[2] - 1]))]
        if value is None:
            return []
        end, separator = self._source.spans.tag(element)[1], " "
        while found := ATTRIBUTE.match(self._text, end):
            blanks = self._text[end : found.start(1)]
            separator, end = blanks if _BEFORE.match(blanks) else " ", found.end()
        return [TextEdit(end, end, f'{separator}{name}="{escape_value(value)}"')]

    def _indentation(self) -> str:
        """Return the indentation of one level, which is that of the first indented child."""
        for each in self._elements[1:]:
            outer, inner = (self._line(one.offset) for one in (self._parents[each.offset], each))
            if outer[0] < inner[0] and inner[1].startswith(outer[1]):
                return inner[1].removeprefix(outer[1]) or "  "
        return "  "

    def _line(self, offset: int) -> tuple[int, str]:
        """Return the start of the line that contains an offset, and the line's indentation before the offset."""
        start = self._source.offset(self._source.position_of(offset)[0], 1)
        lead = self._text[start:offset]
        return start, lead[: len(lead) - len(lead.lstrip(_BLANK))]

    def _block(self, element: Element) -> _ElementBlock:
        extent = self._extents[element.offset]
        line, indent = self._line(extent.start)
        rest = _REST.match(self._text, extent.end)
        if line + len(indent) != extent.start or rest is None:
            return _ElementBlock(extent.start, extent.start, extent.end, indent, has_lines=False)
        return _ElementBlock(self._with_comments(line), extent.start, rest.end(), indent, has_lines=True)

    def _with_comments(self, line: int) -> int:
        """Return the start of the comments directly above a line; without comments, the start of the line."""
        while line:
            end = line - (2 if self._text.endswith("\r\n", 0, line) else 1)
            while self._text[end - 1] in _BLANK:
                end -= 1
            start = self._comments.get(end)
            if start is None:
                break
            first, lead = self._line(start)
            if first + len(lead) != start:
                break
            line = first
        return line

    def _cut(self, start: int, end: int, indent: str) -> Snippet:
        """Return a part of the text as lines.

        Lines that begin inside an attribute's value keep their indentation.
        """
        fixed = []
        for element in self._inside(start, end):
            for _, (*_, first, last) in self._source.spans.attributes(element):
                ends = LINE_END.finditer(self._text, first, last)
                fixed += [each.end() - start for each in ends]
        return cut_lines(self._text[start:end], indent, fixed)

    def _inside(self, start: int, end: int) -> Sequence[Element]:
        first, last = (bisect.bisect_left(self._elements, each, key=_offset) for each in (start, end))
        return self._elements[first:last]

    def _join(self, lines: Snippet, indent: str) -> str:
        """Return lines as text; the first line is already indented."""
        return join_lines([lines[0], *indent_lines(lines[1:], indent)], self._source.line_end)
