"""Edits of a tree file in YAML.

A node is moved as whole lines, from its dash on, together with the comments directly above it and the indented comments
below it. A node in brackets may share lines with other nodes, so `expand` first rewrites it without brackets.
"""

import re
from dataclasses import dataclass, field
from typing import Any

import yaml

from sar_compiler.editing.text_edits import (
    EditError,
    Snippet,
    SnippetLine,
    TextEdit,
    cut_lines,
    indent_lines,
    join_lines,
)
from sar_compiler.tree.diagnostic import LINE_END
from sar_compiler.tree.model import CHILDREN_KEY, Element, TreeFile
from sar_compiler.tree.yaml_events import masked_events
from sar_compiler.tree.yaml_fields import end_of_block
from sar_compiler.tree.yaml_writer import node_lines, scalar

_COMMENT_LINE = re.compile(r"([ \t]*)(#[^\r\n]*)?(\r\n|\r|\n|\Z)")
_REST_OF_LINE = re.compile(r"[^\r\n]*(?:\r\n|\r|\n|\Z)")
_MEANT_IN_FLOW = re.compile(r"[,\[\]{}#]")
_BLANKS_BEFORE_COMMENT = re.compile(r"[ \t]+(?=#)")
_BESIDE_ENTRY = re.compile(r"\s*,\s*")


@dataclass
class _NodeExtent:
    """The offsets of an element.

    Attributes:
        start: The offset of the node's first character, after its dash.
        end: The offset after the node's last character.
        tag_end: The offset after the tag.
        content: The offset of the content's first character; None if there is no content.
        children: The offset of the key `children`; None if there is no such key.
        is_flow: Whether the node, its content or its children are in brackets.
        has_content: Whether a colon follows the tag.
        values: The offset after each attribute's value, by attribute.
    """

    start: int
    end: int = 0
    tag_end: int = 0
    content: int | None = None
    children: int | None = None
    is_flow: bool = False
    has_content: bool = False
    values: dict[str, int] = field(default_factory=dict)


def _start(event: Any) -> int:
    return int(event.start_mark.index)


def _end(event: Any) -> int:
    return int(event.end_mark.index)


class _ExtentReader:
    """The reader of the extents of all elements in a file.

    Attributes:
        found: The extents, by the offset of the element.
    """

    def __init__(self, text: str) -> None:
        self._text = text
        self._events = masked_events(text)
        self.found: dict[int, _NodeExtent] = {}
        event = self._next()
        while not isinstance(event, yaml.NodeEvent):
            event = self._next()
        self._node(event, is_flow=False)

    def _next(self) -> Any:
        return next(self._events)

    def _node(self, event: Any, *, is_flow: bool) -> _NodeExtent:
        extent = _NodeExtent(_start(event), is_flow=is_flow)
        if isinstance(event, yaml.ScalarEvent):
            extent.tag_end = extent.end = _end(event)
            self.found[extent.start] = extent
            return extent
        key = self._next()
        self.found[_start(key)] = extent
        extent.tag_end = _end(key)
        extent.end = self._text.index(":", extent.tag_end) + 1
        extent.has_content, extent.is_flow = True, is_flow or event.flow_style
        content = self._next()
        if isinstance(content, yaml.MappingStartEvent):
            extent.content = _start(content)
            extent.is_flow = extent.is_flow or bool(content.flow_style)
            self._content(extent)
        extent.end = self._collection_end(self._next(), extent.end)
        return extent

    def _content(self, extent: _NodeExtent) -> None:
        while not isinstance(key := self._next(), yaml.MappingEndEvent):
            value = self._next()
            if key.value != CHILDREN_KEY:
                extent.values[key.value] = extent.end = self._skip(value)
                continue
            extent.children = _start(key)
            extent.is_flow = extent.is_flow or value.flow_style
            while not isinstance(event := self._next(), yaml.SequenceEndEvent):
                extent.end = self._node(event, is_flow=extent.is_flow).end
            extent.end = self._collection_end(event, extent.end)
        extent.end = self._collection_end(key, extent.end)

    def _skip(self, value: Any) -> int:
        """Read the events of a value; return the offset after the value."""
        if isinstance(value, yaml.ScalarEvent):
            start, end = _start(value), _end(value)
            if value.style not in ("|", ">"):
                return end
            text = self._text[start : end_of_block(self._text, start, end, value.value)]
            return start + len(text.rstrip("\r\n"))
        end = _start(value)
        while not isinstance(event := self._next(), yaml.CollectionEndEvent):
            end = self._skip(event)
        return self._collection_end(event, end)

    @staticmethod
    def _collection_end(event: Any, end: int) -> int:
        """Return the offset after a collection. A block collection ends where its content ends."""
        return _end(event) if _start(event) < _end(event) else end


class YamlText:
    """Edits of a file in YAML.

    Args:
        tree_file: The file.
    """

    def __init__(self, tree_file: TreeFile) -> None:
        self._source = tree_file.source
        self._text = tree_file.source.text
        self._parents = {child.offset: each for each in tree_file.root.iterate() for child in each.children}
        self._extents = _ExtentReader(self._text).found

    def outermost_flow(self, element: Element) -> Element | None:
        """Return the outermost element in brackets around an element, or the element itself; None without brackets."""
        ancestor: Element | None = element
        found = None
        while ancestor is not None:
            found = ancestor if self._extents[ancestor.offset].is_flow else found
            ancestor = self._parents.get(ancestor.offset)
        return found

    def expand(self, element: Element) -> list[TextEdit]:
        """Return the edits that rewrite an element in brackets so that it has no brackets."""
        extent = self._extents[element.offset]
        dash = "- " if element.offset in self._parents else ""
        lines = [SnippetLine(each) for each in node_lines(element, "", dash)]
        lines[0] = SnippetLine(lines[0].text.removeprefix(dash))
        column = self._source.position_of(extent.start)[1] - 1 - len(dash)
        text, end = self._join(lines, " " * column), extent.end
        if comment := _BLANKS_BEFORE_COMMENT.match(
            self._text, end
        ):  # a block scalar would contain the comment
            text, end = f"{text}{self._source.line_end}{' ' * column}", comment.end()
        return [TextEdit(extent.start, end, text)]

    def format_new(self, element: Element) -> Snippet:
        """Return the lines of a new element."""
        return [SnippetLine(each) for each in node_lines(element)]

    def wrap(self, wrapper: Element, lines: Snippet) -> Snippet:
        """Return the lines of a new element with other lines as its children."""
        first, *rest = node_lines(wrapper)
        colon = "" if rest else ":"
        start = [SnippetLine(f"{first}{colon}"), *map(SnippetLine, rest), SnippetLine(f"    {CHILDREN_KEY}:")]
        return [*start, *indent_lines(lines, " " * 6)]

    def copy(self, first: Element, last: Element) -> Snippet:
        """Return the lines of consecutive siblings, with their comments."""
        return cut_lines(self._text[self._start(first) : self._end(last)], self._dash(first)[1])

    def contents(self, element: Element) -> Snippet:
        """Return the lines of all children of an element, with their comments."""
        return self.copy(element.children[0], element.children[-1])

    def replace(
        self, first: Element, last: Element, lines: Snippet, *, with_comments: bool = True
    ) -> list[TextEdit]:
        """Return the edits that replace consecutive siblings by lines; see `XmlText.replace` for the arguments."""
        line, indent = self._dash(first)
        start, end = self._start(first) if with_comments else line, self._end(last)
        line_end = self._source.line_end if self._text[:end].endswith(("\n", "\r")) else ""
        return [TextEdit(start, end, f"{indent}{self._join(lines, indent)}{line_end}")]

    def insert(self, parent: Element, index: int, lines: Snippet) -> list[TextEdit]:
        """Return the edits that insert lines before the child at an index, or after the last child."""
        if index < len(parent.children):
            child = parent.children[index]
            start, indent = self._start(child), self._dash(child)[1]
            return [TextEdit(start, start, indent + self._join(lines, indent) + self._source.line_end)]
        if parent.children:
            child = parent.children[-1]
            return [self._line_at(self._end(child), self._dash(child)[1], lines)]
        extent = self._extents[parent.offset]
        children = [SnippetLine(f"{CHILDREN_KEY}:"), *indent_lines(lines, "  ")]
        return self._add(parent, extent, max(extent.values.values(), default=extent.end), children)

    def _add(self, element: Element, extent: _NodeExtent, offset: int, lines: Snippet) -> list[TextEdit]:
        """Return the edits that add lines to an element's content, below the line that contains an offset."""
        if extent.content is None:
            column = self._source.position_of(self._source.spans.tag(element)[0])[1] + 1
            below = self._line_at(self._next_line(extent.end), " " * column, lines)
            if extent.has_content:
                return [below]
            if below.start == extent.tag_end:  # the end of a file without a final line end
                return [below._replace(text=f":{below.text}")]
            return [TextEdit(extent.tag_end, extent.tag_end, ":"), below]
        column = self._source.position_of(extent.content)[1] - 1
        return [self._line_at(self._next_line(offset), " " * column, lines)]

    def delete_element(self, element: Element) -> list[TextEdit]:
        """Return the edits that remove an element and its comments.

        If no child is left, the edits also remove the key `children`. They indent the comments below this key like the
        key itself, because YAML could read a deeper comment as a part of the text above it.
        """
        parent = self._parents[element.offset]
        key = self._extents[parent.offset].children
        start, end = self._start(element), self._end(element)
        if len(parent.children) > 1 or key is None:
            return [TextEdit(start, end, "")]
        start = self._line(key)
        indent, below, kept = self._text[start:key], end, ""
        while (found := _COMMENT_LINE.match(self._text, below)) and found[2] is not None:
            if len(found[1]) <= len(indent):
                break
            below = found.end()
            kept += indent + found[0][len(found[1]) :]
        return [TextEdit(start, below if kept else end, kept)]

    def set_attribute(self, element: Element, name: str, value: str | None) -> list[TextEdit]:
        """Return the edits that set an attribute's value; None removes the attribute."""
        extent = self._extents[element.offset]
        places = self._source.attribute(element, name)
        if value is None:
            return (
                self._remove_attribute(places[0], extent, extent.values[name]) if places is not None else []
            )
        written = _scalar_in_flow(value) if extent.is_flow else scalar(value)
        if places is not None:
            return [TextEdit(places[2], extent.values[name], written)]
        entry = f"{scalar(name)}: {written}"
        behind = max(extent.values.values(), default=None)
        if extent.is_flow and (extent.content is None or self._text[extent.content] == "{"):
            return [_entry_in_flow(extent, behind, entry, has_children=bool(element.children))]
        if behind is None and extent.content is not None:
            start = self._line(extent.content)
            indent = " " * (extent.content - start)
            return [TextEdit(start, start, f"{indent}{entry}{self._source.line_end}")]
        return self._add(element, extent, behind or 0, [SnippetLine(entry)])

    def _remove_attribute(self, start: int, extent: _NodeExtent, end: int) -> list[TextEdit]:
        """Return the edits that remove an attribute with its lines or, inside brackets, with its comma."""
        if extent.content is None or self._text[extent.content] != "{":
            return [TextEdit(self._line(start), self._next_line(end), "")]
        behind = _BESIDE_ENTRY.match(self._text, end)
        if behind is not None:
            return [TextEdit(start, behind.end(), "")]
        before = len(self._text[:start].rstrip())
        return [TextEdit(before - 1 if self._text[before - 1] == "," else start, end, "")]

    def _line(self, offset: int) -> int:
        """Return the start of the line that contains an offset."""
        return self._source.offset(self._source.position_of(offset)[0], 1)

    def _next_line(self, offset: int) -> int:
        """Return the start of the line after the line that contains an offset."""
        rest = _REST_OF_LINE.match(self._text, offset)
        return rest.end() if rest is not None else len(self._text)

    def _dash(self, element: Element) -> tuple[int, str]:
        """Return the start of the line that contains an element's dash, and the line's indentation.

        Raises:
            EditError: If the element is not on a separate line.
        """
        dash = self._text.rfind("-", 0, self._extents[element.offset].start)
        line = self._line(dash)
        if dash < 0 or self._text[line:dash].strip(" "):
            message = f"<{element.tag}> in line {element.line} is not on a separate line. Run sar-compile format first"
            raise EditError(message)
        return line, self._text[line:dash]

    def _start(self, element: Element) -> int:
        """Return the start of an element's lines, which include the comments directly above it."""
        line, indent = self._dash(element)
        while line:
            above = self._line(line - 1)
            if not self._text.startswith(f"{indent}#", above):
                break
            line = above
        return line

    def _end(self, element: Element) -> int:
        """Return the end of an element's lines, which include the indented comments below it."""
        indent = len(self._dash(element)[1])
        end = line = self._next_line(self._extents[element.offset].end)
        while line < len(self._text) and (found := _COMMENT_LINE.match(self._text, line)):
            line = found.end()
            if found[2] is None:
                continue
            if len(found[1]) <= indent:
                break
            end = line
        return end

    def _line_at(self, offset: int, indent: str, lines: Snippet) -> TextEdit:
        """Return the edit that inserts lines at the start of a line.

        The line may be the end of a file without a final line end.
        """
        text, end = indent + self._join(lines, indent), self._source.line_end
        is_start = not offset or LINE_END.match(self._text, offset - 1) is not None
        return TextEdit(offset, offset, f"{text}{end}" if is_start else f"{end}{text}")

    def _join(self, lines: Snippet, indent: str) -> str:
        """Return lines as text; the first line is already indented."""
        return join_lines([lines[0], *indent_lines(lines[1:], indent)], self._source.line_end)


def _entry_in_flow(extent: _NodeExtent, last: int | None, entry: str, *, has_children: bool) -> TextEdit:
    """Return the edit that adds an attribute in brackets, after the last attribute if there is one."""
    if extent.content is None:
        return TextEdit(extent.end, extent.end, f"{'' if extent.has_content else ':'} {{{entry}}}")
    if last is not None:
        return TextEdit(last, last, f", {entry}")
    start = extent.content + 1
    return TextEdit(start, start, f"{entry}, " if has_children else entry)


def _scalar_in_flow(value: str) -> str:
    written = scalar(value)
    return f"'{value}'" if written == value and _MEANT_IN_FLOW.search(value) else written
