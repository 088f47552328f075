"""Elements that come from no file: what a command adds to a tree, or generates."""

from collections.abc import Iterable, Mapping

from sar_compiler.tree.model import Element, TreeFile
from sar_compiler.tree.source import Form, Source, Span

_NOWHERE = Span(1, 1, 1, 1)


class _NoSpans:
    """Finds nothing, because there is no text."""

    form = Form.XML

    def tag(self, _source: Source, _element: Element) -> Span:
        return _NOWHERE

    def attribute_name(self, _source: Source, _element: Element, _name: str) -> Span:
        return _NOWHERE

    def attribute_value(self, _source: Source, _element: Element, _name: str) -> Span:
        return _NOWHERE

    def within_value(self, _source: Source, _element: Element, _name: str, _start: int, _end: int) -> Span:
        return _NOWHERE

    def follows_blank_line(self, _source: Source, _element: Element) -> bool:
        return False


NO_SPANS = _NoSpans()
"""For a text without elements."""

_SOURCE = Source("<made>", "", NO_SPANS)


def synthetic_element(
    tag: str, attributes: Mapping[str, str] | None = None, children: Iterable[Element] = (), text: str = ""
) -> Element:
    """Make an element; its line is 0."""
    return Element(tag, attributes or {}, tuple(children), _SOURCE, 0, 0, text)


def synthetic_file(root: Element) -> TreeFile:
    """Make a file of an element."""
    return TreeFile(_SOURCE, root)
