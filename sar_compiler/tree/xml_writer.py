"""Writer of tree files in canonical XML.

Each element has its own line, each level is indented by two spaces, and attributes keep their order. A start tag longer
than 100 columns has one attribute per line. Comments keep their positions, line breaks within values are kept, and
consecutive blank lines become one.
"""

import re
from collections.abc import Iterator

from sar_compiler.tree.diagnostic import Form
from sar_compiler.tree.model import Comment, Element, TreeFile
from sar_compiler.tree.xml_recovery import escape_xml

WIDTH = 100
DECLARATION = '<?xml version="1.0" encoding="UTF-8"?>'
_ESCAPES = {"&": "&amp;", "<": "&lt;", '"': "&quot;", "\n": "&#10;", "\r": "&#13;", "\t": "&#9;"}
_TEXT_ESCAPES = {"&": "&amp;", "<": "&lt;", ">": "&gt;", "\r": "&#13;"}


def write_xml(tree_file: TreeFile) -> str:
    """Return a tree file as XML."""
    lines = [DECLARATION]
    for comment in tree_file.comments:
        if comment.index == 0:
            lines += _comment(comment, "", after_blank_line=comment.after_blank_line and len(lines) > 1)
    lines += element_lines(
        tree_file.root, "", after_blank_line=len(lines) > 1 and tree_file.root.follows_blank_line
    )
    for comment in tree_file.comments:
        if comment.index > 0:
            lines += _comment(comment, "", after_blank_line=comment.after_blank_line)
    return "\n".join(lines) + "\n"


def comment_in_xml(text: str) -> str:
    """Return the text of a comment for XML. Consecutive hyphens are separated by spaces."""
    return re.sub("-(?=-)", "- ", text)


def element_lines(element: Element, indent: str = "", *, after_blank_line: bool = False) -> Iterator[str]:
    """Yield the XML lines of an element."""
    if after_blank_line:
        yield ""
    for comment in element.comments:
        if comment.attribute is not None:  # XML allows no comment in a tag
            yield from _comment(comment, indent, after_blank_line=False)
    trailing = "".join(
        f"  <!-- {comment_in_xml(one.text)} -->"
        for one in element.comments
        if one.trailing and one.attribute is None
    )
    inner = list(element.content())
    if not inner:
        end = f">{_escape(element.text, _TEXT_ESCAPES)}</{element.tag}>" if element.text else "/>"
        yield from _start_tag(element, indent, end, trailing)
        return
    yield from _start_tag(element, indent, ">", trailing)
    if element.text:
        yield f"{indent}  {_escape(element.text, _TEXT_ESCAPES)}"
    yield from _content(inner, f"{indent}  ")
    yield f"{indent}</{element.tag}>"


def _content(content: list[Comment | Element], indent: str) -> Iterator[str]:
    for number, each in enumerate(content):
        if isinstance(each, Comment):
            yield from _comment(each, indent, after_blank_line=each.after_blank_line and number > 0)
        else:
            yield from element_lines(each, indent, after_blank_line=number > 0 and each.follows_blank_line)


def _start_tag(element: Element, indent: str, end: str, trailing: str) -> Iterator[str]:
    attributes = [
        f'{name}="{_as_broken(element, name, value) or _escape(value, _ESCAPES)}"'
        for name, value in element.attributes.items()
    ]
    line = f"{indent}<{' '.join([element.tag, *attributes])}{end}"
    if max(map(len, line.split("\n"))) <= WIDTH or not attributes:
        yield f"{line}{trailing}"
        return
    yield f"{indent}<{element.tag}"
    for attribute in attributes[:-1]:
        yield f"{indent}    {attribute}"
    yield f"{indent}    {attributes[-1]}{end}{trailing}"


def _as_broken(element: Element, name: str, value: str) -> str | None:
    """Return an attribute's value with the line breaks of the XML file; None without line breaks."""
    source = element.source
    if source.form is not Form.XML or " " not in value:
        return None
    span = element.value_span(name)
    if span.line == span.end_line:
        return None
    from html import unescape  # all entities of HTML, which few files need

    start, end = source.offsets(span)
    broken = re.sub(r"\r\n?", "\n", source.text[start:end]).replace('"', "&quot;").replace("\t", " ")
    # The element may have been given another value after parsing.
    return escape_xml(broken) if unescape(broken.replace("\n", " ")) == value else None


def _comment(comment: Comment, indent: str, *, after_blank_line: bool) -> Iterator[str]:
    if after_blank_line:
        yield ""
    first, *rest = comment_in_xml(comment.text).split("\n")
    if not rest:
        yield f"{indent}<!-- {first} -->"
        return
    yield f"{indent}<!--"
    for line in (first, *rest):
        yield f"{indent}  {line}".rstrip()
    yield f"{indent}-->"


def escape_value(value: str, quote: str = '"') -> str:
    """Escape the value of an attribute so that it can be enclosed in quotation marks."""
    escaped_value = _escape(value, _ESCAPES)
    return escaped_value if quote == '"' else escaped_value.replace(quote, "&apos;")


def _escape(text: str, escapes: dict[str, str]) -> str:
    return "".join(escapes.get(character, character) for character in text)


def xml_with_tag_per_line(root: Element) -> str:
    """Return an element as XML with one start tag per line, for tools that count lines."""
    return "\n".join(_tags(root))


def _tags(element: Element) -> Iterator[str]:
    attributes = [f' {name}="{_escape(value, _ESCAPES)}"' for name, value in element.attributes.items()]
    start = f"<{element.tag}{''.join(attributes)}>{_escape(element.text, {**_TEXT_ESCAPES, chr(10): ' '})}"
    lines = [start, *(line for child in element.children for line in _tags(child))]
    lines[-1] += f"</{element.tag}>"
    yield from lines
