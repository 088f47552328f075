"""Writer of tree files in canonical YAML.

A string is plain if every YAML parser reads it as the same string. `true`, `false` and decimal numbers are plain as well,
because all parsers return them as written. `no`, `12:30` and `1e3` are quoted. A string of several lines is a block if
a block can represent it. Message fields are written as YAML if the parser reads the same text back. A reference to a key
that contains all fields is quoted.
"""

import re
from collections.abc import Iterator

from sar_compiler.tree.diagnostic import Diagnostic, TreeError
from sar_compiler.tree.model import CHILDREN_KEY, TEXT_KEY, Comment, Element, TreeFile
from sar_compiler.tree.yaml import REFERENCE, parse_yaml
from sar_compiler.tree.yaml_fields import is_fields_attribute

_WHOLE_NUMBER = re.compile(r"0|-?[1-9][0-9]{0,14}")
_DECIMAL_NUMBER = re.compile(r"-?[0-9]{1,9}\.[0-9]{1,6}")
# Words that some YAML parsers read as a bool or as null, in upper and lower case.
_GUESSED = frozenset({"yes", "no", "on", "off", "true", "false", "null"})
_ESCAPES = {'"': '\\"', "\\": "\\\\", "\n": "\\n", "\t": "\\t", "\r": "\\r"}


def write_yaml(tree_file: TreeFile) -> str:
    """Return a tree file as YAML.

    Raises:
        TreeError: If an attribute is named `children`.
    """
    elements = [each for each in tree_file.root.iterate() if CHILDREN_KEY in each.attributes]
    if elements:
        raise TreeError(map(_children_attribute, elements))
    lines: list[str] = []
    before = [comment for comment in tree_file.comments if comment.index == 0]
    for index, comment in enumerate(before):
        lines += _comment(comment, "", after_blank_line=index > 0)
    root = tree_file.root
    if before and root.follows_blank_line:
        lines.append("")
    lines += node_lines(root, "", "")
    after = [comment for comment in tree_file.comments if comment.index > 0]
    for index, comment in enumerate(after):
        lines += _comment(comment, "", after_blank_line=index > 0 or comment.after_blank_line)
    return "\n".join(lines) + "\n"


def comment_in_yaml(text: str) -> str:
    """Return a comment's text for YAML, with unprintable characters escaped."""
    return "".join(one if one.isprintable() or one == "\n" else _escape(one) for one in text)


def scalar(text: str) -> str:
    """Write a string as a scalar on one line that every YAML parser reads as this string."""
    if _is_plain(text):
        return text
    if not text.isprintable() or ("'" in text and not set(text) & {'"', "\\"}):
        return f'"{"".join(_escape(character) for character in text)}"'
    return "'" + text.replace("'", "''") + "'"


def node_lines(element: Element, indent: str = "", dash: str = "- ") -> Iterator[str]:
    """Yield the YAML lines of an element. The tag's content is indented by four columns from the dash."""
    key = scalar(element.tag)
    below = indent + ("    " if dash else "  ")
    content = [*_attributes(element, below), *_children(element, below)]
    trailing = [comment for comment in element.comments if comment.trailing and comment.attribute is None]
    yield f"{indent}{dash}{key}{':' if content else ''}{_trailing_comment(trailing)}"
    yield from content


def _attributes(element: Element, indent: str) -> Iterator[str]:
    written = [*element.attributes.items(), *([(TEXT_KEY, element.text)] if element.text else [])]
    by_attribute: dict[str | None, list[Comment]] = {}
    for comment in element.comments:
        by_attribute.setdefault(comment.attribute, []).append(comment)
    for name, value in written:
        comments = by_attribute.get(name, [])
        above = [comment for comment in comments if not comment.trailing]
        for index, comment in enumerate(above):
            yield from _comment(comment, indent, after_blank_line=index > 0)
        trailing = [comment for comment in comments if comment.trailing]
        first, *rest = _fields(element, name, value, indent) or _value(value, indent)
        yield f"{indent}{scalar(name)}:{first and f' {first}'}{_trailing_comment(trailing)}"
        yield from rest


def _children(element: Element, indent: str) -> Iterator[str]:
    if element.children:
        yield f"{indent}{CHILDREN_KEY}:"
        indent += "  "
    last: Comment | Element | None = None
    for each in element.content():
        if isinstance(each, Comment):
            after_blank_line = isinstance(last, Comment) or (last is not None and each.after_blank_line)
            yield from _comment(each, indent, after_blank_line=after_blank_line)
        else:
            if last is not None and each.follows_blank_line:
                yield ""
            yield from node_lines(each, indent, "- ")
        last = each


def _comment(comment: Comment, indent: str, *, after_blank_line: bool) -> Iterator[str]:
    if after_blank_line:
        yield ""
    for line in comment_in_yaml(comment.text).split("\n"):
        yield f"{indent}{_mark(line)}"


def _trailing_comment(comments: list[Comment]) -> str:
    return f"  {_mark(', '.join(comment_in_yaml(comment.text) for comment in comments))}" if comments else ""


def _mark(line: str) -> str:
    return f"#{line}" if not line or line.startswith("#") else f"# {line}"


def _value(text: str, indent: str) -> list[str]:
    """Return the lines of a value. If there are several lines, those after the first are a block."""
    lines = text.split("\n")
    body = lines[:-1] if lines[-1] == "" else lines
    fits = all(line.isprintable() and line == line.rstrip() for line in body)
    if len(lines) == 1 or not body or not body[0] or body[0].startswith(" ") or not body[-1] or not fits:
        return [scalar(text)]
    return ["|" if lines[-1] == "" else "|-", *(f"{indent}  {line}".rstrip() for line in body)]


def _fields(element: Element, name: str, text: str, indent: str) -> list[str]:
    """Return the lines of message fields in YAML.

    Return an empty list if the parser would not read the same text from the lines.
    """
    if not is_fields_attribute(element.tag, element.attributes, name) or REFERENCE.fullmatch(text.strip()):
        return []
    lines = text.removesuffix("\n").split("\n")
    if len(lines) == 1 and text[:1] in ("{", "["):
        first, below = text, []
    else:
        first, below = "", [f"  {line}" if line else "" for line in lines]
    # The result is parsed again, because no simple rule decides whether it is read as the same text.
    trial = [f"{element.tag}:", f"  ID: {scalar(element.attributes.get('ID', '-'))}", f"  {name}: {first}"]
    try:
        root = parse_yaml("\n".join([*trial, *(f"  {line}" for line in below), "  name: '-'"])).root
    except TreeError:
        return []
    places = root.source.attribute(root, name)
    is_same = root.attributes.get(name) == text and "name" in root.attributes and not root.comments
    if not is_same or places is None or not root.source.spans.is_verbatim(places[2]):
        return []
    return [first, *(f"{indent}{line}" if line else "" for line in below)]


def _is_plain(text: str) -> bool:
    if _WHOLE_NUMBER.fullmatch(text) or text in ("true", "false"):
        return True
    if _DECIMAL_NUMBER.fullmatch(text):
        return str(float(text)) == text
    begins = text[:1].isalpha() or text[:1] in ("_", "/", "(", "$")
    ends = text[-1:] not in (":", " ")
    marks = ": " not in text and " #" not in text
    return bool(begins and ends and marks and text.isprintable() and text.lower() not in _GUESSED)


def _escape(character: str) -> str:
    if character in _ESCAPES:
        return _ESCAPES[character]
    if character.isprintable():
        return character
    code = ord(character)
    return f"\\x{code:02x}" if code < 0x100 else f"\\u{code:04x}" if code < 0x10000 else f"\\U{code:08x}"  # noqa: PLR2004


def _children_attribute(element: Element) -> Diagnostic:
    message = (
        f"an attribute '{CHILDREN_KEY}' cannot be written in YAML, which uses this name for a node's children"
    )
    return element.finding("not-in-yaml", message, name=CHILDREN_KEY, hint="rename it")
