"""A tree file as data: elements, attributes and their places, whatever form the file had."""

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
"""The sections that may be directly in the root element."""

PROJECT_ATTRIBUTE = "project_name"
"""The attribute of the root element that only a Groot2 project (`.btproj`) has."""
EDITOR_ATTRIBUTES = ("xmlns", "xsi:")
"""How the names of its attributes begin that tell an editor about XML, and nothing of the tree."""

CHILDREN_KEY = "children"
TEXT_KEY = "$text"
"""The keys under which YAML has an element's children and its text."""


@dataclass(frozen=True, slots=True)
class Comment:
    """A comment, and where it belongs.

    Attributes:
        text: What it says: lines without the marks of the form, the indentation they share, or blank ones
            around them.
        index: The child before which it stands; the number of children if it stands behind the last one.
        attribute: The attribute to which it belongs instead, which only YAML can have.
        trailing: It shares the line of what it belongs to: of the attribute, or else of the element's tag.
        after_blank_line: A blank line stands before it.
    """

    text: str
    index: int = 0
    attribute: str | None = None
    trailing: bool = False
    after_blank_line: bool = False


class About(Advice, total=False):
    """What a finding about an element has besides; see `Element.finding`."""

    name: str | None
    value: str | None


@dataclass(slots=True)
class Element:
    """One element of a tree file.

    Two elements are equal if they say the same; places, comments and the order of attributes do not count.

    Attributes:
        tag: Its tag.
        attributes: Its attributes, in the order written.
        children: The elements in it.
        source: The file.
        line: The line where it begins, from 1.
        column: The column where it begins, from 1.
        text: The text in it: the description of a port in a `TreeNodesModel`; empty elsewhere.
        comments: The comments in it and beside it, in the order of the file.
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
    def place(self) -> tuple[int, int]:
        """The line and the column where it begins."""
        return self.line, self.column

    @property
    def offset(self) -> int:
        """The offset of its first character in the text of the file."""
        return self.source.offset(self.line, self.column)

    @property
    def file_and_line(self) -> str:
        """Where it is, for people."""
        return f"{self.source.path}:{self.line}"

    @property
    def follows_blank_line(self) -> bool:
        """Whether a blank line is directly before it."""
        return self.line > 0 and self.source.blank_before(self.offset, passing="- \t\r\n")

    def tag_span(self) -> Span:
        """Return where it begins, up to the end of its tag's name."""
        return self.source.inside(*self.source.spans.tag(self))

    def name_span(self, attribute: str) -> Span:
        """Return where the name of one of its attributes is."""
        places = self.source.attribute(self, attribute)
        return self.source.inside(*places[:2]) if places else self.tag_span()

    def value_span(self, attribute: str) -> Span:
        """Return where the value of one of its attributes is, without quotes."""
        places = self.source.attribute(self, attribute)
        return self.source.inside(*places[2:]) if places else self.tag_span()

    def within_value(self, attribute: str, start: int, end: int) -> Span:
        """Return where the characters from *start* to *end* of an attribute's value as it was read are."""
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
        """Return a finding about a part of it, or about it as a whole.

        Args:
            code: As in `Diagnostic`.
            message: As in `Diagnostic`.
            span: The part.
            name: The attribute whose name is the part.
            value: The attribute whose value is the part.
            **advice: As in `Diagnostic`.
        """
        if name is not None:
            span = self.name_span(name)
        elif value is not None:
            span = self.value_span(value)
        return Diagnostic(code, message, self.source, span or self.tag_span(), **advice)

    def content(self) -> "Iterator[Comment | Element]":
        """Yield its children and the comments before, between and after them, in the order of the file."""
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
        """Yield it and everything in it, in the order of the file."""
        waiting = [self]
        while waiting:
            element = waiting.pop()
            yield element
            if element.children:
                waiting.extend(reversed(element.children))


def last_before(elements: "Sequence[Element]", place: tuple[int, int]) -> Element | None:
    """Return the last of some elements, which are in the order of the file, that begins at a place or before it."""
    index = bisect.bisect_right(elements, place, key=lambda each: each.place)
    return elements[index - 1] if index else None


@dataclass(frozen=True)
class TreeFile:
    """A file with behaviour trees.

    Attributes:
        source: The file's text and name.
        root: Its outermost element.
        comments: The comments before (index 0) and behind it (index 1).
        findings: What reading it has mended.
        is_named: Whether somebody has named it, and it does not only lie beside others.
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
        """The tree that the file itself names as the one to execute."""
        return self.root.attributes.get("main_tree_to_execute")


def is_groot2_project(tree_file: TreeFile) -> bool:
    """Return whether a file is what Groot2 keeps of a project: the files in it, and models of their nodes."""
    return tree_file.source.path.endswith(".btproj") or PROJECT_ATTRIBUTE in tree_file.root.attributes


class OpenTag(NamedTuple):
    """Where an element begins.

    Attributes:
        line: The line, from 1.
        column: The column, from 1.
        tag: The element's tag.
    """

    line: int
    column: int
    tag: str


class FileBeginning(NamedTuple):
    """What a file says before the place where it goes wrong.

    Attributes:
        tree_file: The elements that begin before it.
        unfinished: Those that do not end before it.
    """

    tree_file: TreeFile
    unfinished: tuple[OpenTag, ...]


class UnfinishedFileError(TreeError):
    """A file that goes wrong somewhere, after a beginning that can be read.

    Attributes:
        beginning: What it says before that place; None where that is not known.
    """

    def __init__(self, findings: Iterable[Diagnostic], beginning: FileBeginning | None) -> None:
        super().__init__(findings)
        self.beginning = beginning

    def __reduce__(self) -> tuple[object, ...]:
        return type(self), (self.findings, self.beginning)


def text_of_xml(data: str) -> str:
    """Return the text of a comment, given what is between `<!--` and `-->`."""
    first, *rest = data.split("\n")
    # The first line begins after the mark, so its indentation says nothing about the others'.
    return _without_blank_ends([first.strip(), *_dedented(rest)])


def text_of_yaml(lines: Sequence[str]) -> str:
    """Return the text of consecutive comment lines, given what follows the `#` of each."""
    return _without_blank_ends(_dedented([line.removeprefix(" ") for line in lines]))


def _dedented(lines: Iterable[str]) -> list[str]:
    expanded = [line.expandtabs().rstrip() for line in lines]
    margin = min((len(line) - len(line.lstrip(" ")) for line in expanded if line), default=0)
    return [line[margin:] for line in expanded]


def _without_blank_ends(lines: Sequence[str]) -> str:
    return "\n".join(lines).strip("\n")


_NAME = r"[A-Za-z_:][A-Za-z0-9_:.\-]*"
# It takes as long to compile as all others together, and names are seldom in another script.
_PERHAPS = r"[A-Za-z0-9_:.\-\u0080-\U0010ffff]+"


@functools.lru_cache(maxsize=1024)
def is_name(text: str) -> bool:
    """Return whether a text can be the name of a tag or an attribute."""
    if re.fullmatch(_NAME, text):
        return True
    if text.isascii() or not re.fullmatch(_PERHAPS, text):
        return False
    # Which letters of the world XML allows, expat knows.
    try:
        expat.ParserCreate(encoding="utf-8").Parse(f"<{text}/>".encode("utf-8", "surrogatepass"), True)  # noqa: FBT003
    except expat.ExpatError:
        return False
    return True


class _SpansOfYaml(Spans):
    form = Form.YAML


NO_SPANS, NO_SPANS_OF_YAML = Spans(), _SpansOfYaml()
"""For a text without elements, or without their places; for one in YAML."""

_SOURCE = Source("<made>", "", NO_SPANS)


def synthetic_element(
    tag: str, attributes: Mapping[str, str] | None = None, children: Iterable[Element] = (), text: str = ""
) -> Element:
    """Make an element; its line is 0."""
    return Element(tag, attributes or {}, tuple(children), _SOURCE, 0, 0, text)


def synthetic_file(root: Element) -> TreeFile:
    """Make a file of an element."""
    return TreeFile(_SOURCE, root)
