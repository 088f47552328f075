"""The data model of tree files in XML and YAML: elements, attributes and their locations."""

import bisect
import functools
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple
from xml.parsers import expat

from sar_compiler.tree.diagnostic import Advice, Diagnostic, Form, Source, Span, Spans, TreeError

if TYPE_CHECKING:
    from typing_extensions import Unpack


ROOT_TAG = "root"
TREE_TAG = "BehaviorTree"
MODEL_TAG = "TreeNodesModel"
INCLUDE_TAG = "include"
SUBTREE_TAG = "SubTree"
SECTIONS = (TREE_TAG, INCLUDE_TAG, MODEL_TAG)
"""The sections that are allowed directly in the root element."""

PROJECT_ATTRIBUTE = "project_name"
"""The attribute of the root element that is written only in Groot2 projects (`.btproj`)."""
EDITOR_ATTRIBUTES = ("xmlns", "xsi:")
"""The prefixes of attributes that are meant for XML editors and do not affect the tree."""

CHILDREN_KEY = "children"
TEXT_KEY = "$text"
"""The YAML keys for an element's children and its text."""


@dataclass(slots=True)
class Comment:
    """A comment and its position.

    Attributes:
        text: The text, without comment marks, common indentation and surrounding blank lines.
        index: The index of the child that follows the comment; the number of children if no child follows.
        attribute: The attribute that the comment belongs to; only in YAML. None if it belongs to the element.
        trailing: Whether the comment is on the line of its attribute or, without one, on the line of the element's tag.
        after_blank_line: Whether a blank line precedes the comment.
    """

    text: str
    index: int = 0
    attribute: str | None = None
    trailing: bool = False
    after_blank_line: bool = False


class FindingDetails(Advice, total=False):
    """The optional arguments for a finding about an element; see `Element.finding`."""

    name: str | None
    value: str | None


@dataclass(slots=True)
class Element:
    """One element of a tree file.

    Two elements are equal if their content is equal; locations, comments and the order of attributes are ignored.

    Attributes:
        tag: The element's tag.
        attributes: The attributes, in the order of the file.
        children: The child elements.
        source: The file that contains the element.
        line: The line of the element's first character, from 1.
        column: The column of the element's first character, from 1.
        text: The description of a port in a `TreeNodesModel`; empty for other elements.
        comments: The comments that belong to the element, in the order of the file.
    """

    tag: str
    attributes: Mapping[str, str]
    children: "tuple[Element, ...]"
    source: Source = field(repr=False, compare=False)
    line: int = field(repr=False, compare=False)
    column: int = field(repr=False, compare=False)
    text: str = field(default="", repr=False)
    comments: tuple[Comment, ...] = field(default=(), repr=False, compare=False)

    @property
    def position(self) -> tuple[int, int]:
        """The line and the column of the element's first character."""
        return self.line, self.column

    @property
    def offset(self) -> int:
        """The offset of the element's first character in the text of the file."""
        return self.source.offset(self.line, self.column)

    @property
    def file_and_line(self) -> str:
        """The location as text, for messages: `mission.xml:12`."""
        return f"{self.source.path}:{self.line}"

    @property
    def follows_blank_line(self) -> bool:
        """Whether a blank line directly precedes the element."""
        return self.line > 0 and self.source.has_blank_line_before(self.offset, passing="- \t\r\n")

    def tag_span(self) -> Span:
        """Return the span from the element's first character to the end of its tag name."""
        return self.source.inside(*self.source.spans.tag(self))

    def name_span(self, attribute: str) -> Span:
        """Return the span of an attribute's name."""
        places = self.source.attribute(self, attribute)
        return self.source.inside(*places[:2]) if places else self.tag_span()

    def value_span(self, attribute: str) -> Span:
        """Return the span of an attribute's value, without quotes."""
        places = self.source.attribute(self, attribute)
        return self.source.inside(*places[2:]) if places else self.tag_span()

    def value_part_span(self, attribute: str, start: int, end: int) -> Span:
        """Return the span of the characters from *start* to *end* in an attribute's parsed value."""
        source = self.source
        places = source.attribute(self, attribute)
        if places is None:
            return self.tag_span()
        offsets = source.spans.characters(source.text, *places[2:], self.attributes[attribute])
        return source.span(*(offsets[min(index, len(offsets) - 1)] for index in (start, end)))

    def finding(
        self,
        code: str,
        message: str,
        span: Span | None = None,
        *,
        name: str | None = None,
        value: str | None = None,
        **advice: "Unpack[Advice]",
    ) -> Diagnostic:
        """Return a finding about the element, or about a part of it.

        Args:
            code: As in `Diagnostic`.
            message: As in `Diagnostic`.
            span: The span of the part; None for the element's tag.
            name: The attribute whose name the finding is about.
            value: The attribute whose value the finding is about.
            **advice: As in `Diagnostic`.
        """
        if name is not None:
            span = self.name_span(name)
        elif value is not None:
            span = self.value_span(value)
        return Diagnostic(code, message, self.source, span or self.tag_span(), **advice)

    def content(self) -> "Iterator[Comment | Element]":
        """Yield the children, and the comments before, between and after the children, in file order."""
        comments = [each for each in self.comments if each.attribute is None and not each.trailing]
        comments.sort(key=lambda each: each.index)
        done = 0
        for index, child in enumerate(self.children):
            while done < len(comments) and comments[done].index <= index:
                yield comments[done]
                done += 1
            yield child
        yield from comments[done:]

    def iterate(self) -> Iterator["Element"]:
        """Yield the element and its descendants, in the order of the file."""
        waiting = [self]
        while waiting:
            element = waiting.pop()
            yield element
            if element.children:
                waiting.extend(reversed(element.children))


def last_element_before(elements: "Sequence[Element]", place: tuple[int, int]) -> Element | None:
    """Return the last element that begins at or before a location. *elements* must be in file order."""
    index = bisect.bisect_right(elements, place, key=lambda each: each.position)
    return elements[index - 1] if index else None


@dataclass(frozen=True)
class TreeFile:
    """A file with behaviour trees.

    Attributes:
        source: The file's text and name.
        root: The outermost element.
        comments: The comments before the root (index 0) and after it (index 1).
        findings: The findings about errors that the parser has recovered from.
        is_named: Whether the user named the file; False if it was only found beside other files.
    """

    source: Source
    root: Element
    comments: tuple[Comment, ...] = field(default=(), repr=False, compare=False)
    findings: tuple[Diagnostic, ...] = field(default=(), repr=False, compare=False)
    is_named: bool = True

    @functools.cached_property
    def trees(self) -> tuple[Element, ...]:
        """The `BehaviorTree` elements, in the order of the file."""
        return tuple(child for child in self.root.children if child.tag == TREE_TAG)

    @property
    def main_tree_name(self) -> str | None:
        """The ID of the tree to execute, given by the root's `main_tree_to_execute`; None without it."""
        return self.root.attributes.get("main_tree_to_execute")


def is_groot2_project(tree_file: TreeFile) -> bool:
    """Return whether a file is a Groot2 project, which lists files and contains models of their nodes."""
    return tree_file.source.path.endswith(".btproj") or PROJECT_ATTRIBUTE in tree_file.root.attributes


class OpenTag(NamedTuple):
    """The location of a start tag.

    Attributes:
        line: The line, from 1.
        column: The column, from 1.
        tag: The element's tag.
    """

    line: int
    column: int
    tag: str


class FileBeginning(NamedTuple):
    """The content of a malformed file up to the first error.

    Attributes:
        tree_file: The elements that begin before the error.
        unfinished: The elements that do not end before the error.
    """

    tree_file: TreeFile
    unfinished: tuple[OpenTag, ...]


class UnfinishedFileError(TreeError):
    """A file is malformed, but its beginning can be read.

    Attributes:
        beginning: The content before the error; None if no element begins before it.
    """

    def __init__(self, findings: Iterable[Diagnostic], beginning: FileBeginning | None) -> None:
        super().__init__(findings)
        self.beginning = beginning

    def __reduce__(self) -> tuple[object, ...]:
        return type(self), (self.findings, self.beginning)


def xml_comment_text(data: str) -> str:
    """Return the text of a comment, given the characters between the marks `<!--` and `-->`."""
    first, *rest = data.split("\n")
    # The first line begins after the mark, so its indentation is not compared with that of the other lines.
    return _without_blank_ends([first.strip(), *_dedent(rest)])


def yaml_comment_text(lines: Sequence[str]) -> str:
    """Return the text of consecutive comment lines, given the characters after `#` in each line."""
    return _without_blank_ends(_dedent([line.removeprefix(" ") for line in lines]))


def _dedent(lines: Iterable[str]) -> list[str]:
    expanded = [line.expandtabs().rstrip() for line in lines]
    margin = min((len(line) - len(line.lstrip(" ")) for line in expanded if line), default=0)
    return [line[margin:] for line in expanded]


def _without_blank_ends(lines: Sequence[str]) -> str:
    return "\n".join(lines).strip("\n")


_NAME = r"[A-Za-z_:][A-Za-z0-9_:.\-]*"
# An exact expression would take too long to compile. Names are mostly ASCII, and expat checks all others.
_PERHAPS = r"[A-Za-z0-9_:.\-\u0080-\U0010ffff]+"


@functools.lru_cache(maxsize=1024)
def is_name(text: str) -> bool:
    """Return whether a text is a valid tag or attribute name."""
    if re.fullmatch(_NAME, text):
        return True
    if text.isascii() or not re.fullmatch(_PERHAPS, text):
        return False
    # expat knows which letters of all alphabets XML allows.
    try:
        expat.ParserCreate(encoding="utf-8").Parse(f"<{text}/>".encode("utf-8", "surrogatepass"), True)  # noqa: FBT003
    except expat.ExpatError:
        return False
    return True


class _SpansOfYaml(Spans):
    form = Form.YAML


NO_SPANS, NO_SPANS_OF_YAML = Spans(), _SpansOfYaml()
"""The locators for files in XML and YAML whose elements have no known locations."""

_SOURCE = Source("<made>", "", NO_SPANS)


def synthetic_element(
    tag: str, attributes: Mapping[str, str] | None = None, children: Iterable[Element] = (), text: str = ""
) -> Element:
    """Create an element that is not in a file. The element's line is 0."""
    return Element(tag, attributes or {}, tuple(children), _SOURCE, 0, 0, text)


def synthetic_file(root: Element) -> TreeFile:
    """Create a tree file from its root element. The file has no text."""
    return TreeFile(_SOURCE, root)
