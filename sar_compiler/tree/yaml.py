"""Parser of tree files in YAML. Each element in YAML corresponds to an XML element.

A node is a mapping with one key, its tag. Below the tag are the attributes and, under `children`, a list of nodes.
A node without content is a bare tag. The value of an attribute is its text, exactly as written.
"""

import re
from typing import Any, NoReturn

import yaml

from sar_compiler.tree.content import MAX_ATTRIBUTES, MAX_DEPTH, MAX_ELEMENTS, make_source
from sar_compiler.tree.diagnostic import Advice, Diagnostic, Source, TreeError
from sar_compiler.tree.display_text import UNSPEAKABLE, escape_to_one_line
from sar_compiler.tree.model import (
    CHILDREN_KEY,
    MODEL_TAG,
    ROOT_TAG,
    TEXT_KEY,
    Comment,
    Element,
    FileBeginning,
    OpenTag,
    TreeFile,
    UnfinishedFileError,
    is_name,
    yaml_comment_text,
)
from sar_compiler.tree.yaml_events import YamlEvents
from sar_compiler.tree.yaml_fields import dedent, is_fields_attribute
from sar_compiler.tree.yaml_spans import SPLIT, YamlSpans, split_number

_EMPTY_HINT = "write 'root:', and below it 'BTCPP_format: 4' and 'children:'"
_ROOT_KEYS = ("BTCPP_format", "main_tree_to_execute", CHILDREN_KEY)
# A comment that may be a part of the plain string before it: one space precedes the #, and no space follows it.
_CUT = re.compile(r" #[^\s#!][^\r\n]*")
_HEADER_COMMENT = re.compile(r"[^\r\n#]*#([^\r\n]*)")
REFERENCE = re.compile(r"\{[^{}:,\s]+\}")
"""A regular expression for a reference such as `{zone}`.

Without quotes, YAML reads a reference as a mapping.
"""
# A plain string continues on a line with more indentation, whatever that line begins with.
_CONTINUED = re.compile(r"[\r\n][ \t]*(- [^\r\n]*)")


def parse_yaml(data: bytes | str, path: str = "<text>") -> TreeFile:
    """Parse the content of a tree file.

    Raises:
        TreeError: If the content is not YAML, not a tree, too large or too deep, or uses a YAML feature that XML lacks.
    """
    spans = YamlSpans()
    return _YamlReader(make_source(data, path, spans, None, _EMPTY_HINT), spans).read()


class _Parts:
    """The parts of an element that is being read."""

    __slots__ = ("attributes", "children", "comments", "places", "seen", "text", "unquoted")

    def __init__(self) -> None:
        self.attributes: dict[str, str] = {}
        self.children: list[Element] = []
        self.comments: list[Comment] = []
        self.text = ""
        # Start and end of the name and of the value of each attribute.
        self.places: list[int] = []
        # The offset of each key.
        self.seen: dict[str, int] = {}
        # Findings about attributes whose values are lists or mappings, unless the attributes accept message fields.
        self.unquoted: dict[str, Diagnostic] = {}


class _YamlReader:
    """Parser that reads a text in one pass. After an error, it continues in order to find further errors."""

    def __init__(self, source: Source, spans: YamlSpans) -> None:
        self._source = source
        self._spans = spans
        self._events = YamlEvents(source, closing=True)
        # Elements that are incomplete or wrong.
        self._unfinished: list[OpenTag] = []
        # Warnings: the text may be as intended.
        self._doubts: list[Diagnostic] = []
        self._report = self._events.report_finding
        self._depth = 0
        self._count = 0
        self._models = 0

    def read(self) -> TreeFile:
        events = self._events
        events.pop()  # the stream begins
        self._document()
        root = None
        before = [_comment(one, 0) for one in events.comments()]
        if isinstance(events.next, yaml.CollectionStartEvent | yaml.ScalarEvent | yaml.AliasEvent):
            root = self._node()
        after = [_comment(one, 1) for one in events.comments()]
        events.pop()  # the document ends
        after += [_comment(one, 1) for one in events.comments()]
        if isinstance(events.next, yaml.DocumentStartEvent):
            start, end = _mark_position(events.next)
            message = "a second document begins here, but a tree file has only one"
            self._report(
                "second-document", message, start, end, hint="move the second document to a separate file"
            )
        tree_file = (
            TreeFile(self._source, root, (*before, *after), tuple(self._doubts)) if root is not None else None
        )
        if events.findings or tree_file is None:
            findings = sorted(events.findings, key=lambda found: (found.span.line, found.span.column))
            read = FileBeginning(tree_file, tuple(self._unfinished)) if tree_file is not None else None
            raise UnfinishedFileError(findings, read)
        return tree_file

    def _document(self) -> None:
        start: Any = self._events.pop()
        if not isinstance(start, yaml.DocumentStartEvent):
            self._report("empty-file", "the file is empty", 0, 0, hint=_EMPTY_HINT)
        elif start.version or start.tags:
            message = "YAML directives are not allowed in a tree file"
            self._report(
                "yaml-directive", message, *_mark_position(start), hint="delete the lines that begin with %"
            )

    def _node(self) -> Element | None:
        events = self._events
        first: Any = events.next
        if isinstance(first, yaml.ScalarEvent):
            return self._bare(events.pop())
        if not isinstance(first, yaml.MappingStartEvent):
            end = events.skip()
            if isinstance(first, yaml.SequenceStartEvent):
                what = f"a tree file begins with '{ROOT_TAG}:'" if not self._depth else "a node is expected"
                hint = (
                    f"write the node's tag, and put a list of nodes under its '{CHILDREN_KEY}:'"
                    if self._depth
                    else f"delete the '- ' before '{ROOT_TAG}:', and put a list of nodes under its '{CHILDREN_KEY}:'"
                )
                self._report(
                    "wrong-shape", f"{what}, but this is a list", _mark_position(first)[0], end, hint=hint
                )
            return None
        events.pop()
        if isinstance(events.next, yaml.MappingEndEvent):
            events.pop()
            self._report(
                "wrong-shape", "these braces are empty, but a node needs a tag", *_mark_position(first)
            )
            return None
        if not self._depth and getattr(events.next, "value", None) in _ROOT_KEYS:
            return self._read_without_root()
        tag = self._key()
        element = self._read_tagged(tag, events.trailing) if tag is not None else None
        if tag is None:
            events.skip()
        while not isinstance(events.next, yaml.MappingEndEvent):
            self._stray_key(tag)
        events.pop()
        return element

    def _read_without_root(self) -> Element | None:
        """Read the content of the root if the key of the root is missing."""
        first, parts = self._events.next, _Parts()
        message = f"a tree file begins with '{ROOT_TAG}:', and '{first.value}' belongs below it"
        hint = f"write '{ROOT_TAG}:' above, and indent the following lines"
        self._report("wrong-root", message, *_mark_position(first), hint=hint)
        number = self._spans.begin(*_mark_position(first))
        self._depth += 1
        self._content(ROOT_TAG, parts)
        self._depth -= 1
        tag = yaml.ScalarEvent(None, None, (True, False), ROOT_TAG, first.start_mark, first.end_mark)
        return self._element(tag, parts, number)

    def _bare(self, tag: Any) -> Element | None:
        """Create an element from a tag without content."""
        if tag.start_mark.index == tag.end_mark.index:
            message = "there is nothing after this '-'"
            start = self._source.text.rfind("-", 0, tag.start_mark.index)
            self._report("wrong-shape", message, start, start + 1, hint="write a node, or delete the line")
            return None
        parts = _Parts()
        if self._events.trailing is not None:
            parts.comments.append(Comment(self._events.trailing, trailing=True))
        return self._element(tag, parts, self._spans.begin(*_mark_position(tag)))

    def _read_tagged(self, tag: Any, trailing: str | None) -> Element | None:
        events, parts = self._events, _Parts()
        wrong = len(events.findings)
        number = self._spans.begin(*_mark_position(tag))
        if trailing is not None:
            parts.comments.append(Comment(trailing, trailing=True))
        content = events.next
        if isinstance(content, yaml.MappingStartEvent):
            self._depth += 1
            self._models += tag.value == MODEL_TAG
            if self._depth > MAX_DEPTH:
                self._refuse("too-deep", tag, f"elements are nested more than {MAX_DEPTH} deep")
            events.pop()
            self._content(tag.value, parts)
            self._depth -= 1
            self._models -= tag.value == MODEL_TAG
        elif _is_nothing(content):
            events.pop()
            if events.trailing is not None:
                parts.comments.append(Comment(events.trailing, trailing=True))
            column = self._source.position_of(tag.start_mark.index)[1]
            parts.comments += [_comment(one, 0) for one in events.comments(column + 1)]
        else:
            end = events.skip()
            message = f"the content of '{tag.value}' must be attributes (name: value) and '{CHILDREN_KEY}:'"
            hint = f"put a list of nodes under '{CHILDREN_KEY}:'"
            if isinstance(content, yaml.ScalarEvent):
                what = f"- {content.value}" if is_name(content.value) else "- "
                hint = f"write a child node below '{CHILDREN_KEY}:', as '{what}'"
            if not isinstance(content, yaml.AliasEvent):  # an alias has its own finding
                self._report("wrong-shape", message, _mark_position(content)[0], end, hint=hint)
        if len(events.findings) > wrong or events.is_cut or isinstance(content, yaml.AliasEvent):
            self._unfinished.append(OpenTag(*self._source.position_of(tag.start_mark.index), tag.value))
        return self._element(tag, parts, number)

    def _refuse(self, code: str, tag: Any, message: str) -> NoReturn:
        self._report(code, message, *_mark_position(tag))
        raise TreeError(self._events.findings)

    def _element(self, tag: Any, parts: _Parts, number: int) -> Element | None:
        if not is_name(tag.value):
            self._wrong_name(tag, "a tag")
            return None
        self._count += 1
        if self._count > MAX_ELEMENTS:
            self._refuse("too-many-nodes", tag, f"the file has more than {MAX_ELEMENTS:,} elements")
        if len(parts.attributes) > MAX_ATTRIBUTES:
            self._refuse("too-many-nodes", tag, f"'{tag.value}' has more than {MAX_ATTRIBUTES:,} attributes")
        self._spans.finish(number, parts.places)
        place = self._source.position_of(tag.start_mark.index)
        children, comments = tuple(parts.children), tuple(parts.comments)
        return Element(tag.value, parts.attributes, children, self._source, *place, parts.text, comments)

    def _content(self, tag: str, parts: _Parts) -> None:
        """Read attributes and children up to the end of the mapping that contains them."""
        events = self._events
        column = self._source.position_of(events.next.start_mark.index)[1]
        while not isinstance(events.next, yaml.MappingEndEvent):
            waiting = events.comments()
            key = self._key()
            name = key.value if key is not None else None
            attribute = name if name != CHILDREN_KEY else None
            parts.comments += [_comment(one, 0, attribute) for one in waiting]
            trailing = events.trailing
            if key is None or self._is_wrong(key, parts):
                events.skip()
                continue
            parts.seen[key.value] = key.start_mark.index
            if name == CHILDREN_KEY:
                parts.comments += [Comment(trailing)] if trailing is not None else []
                self._children(parts, key)
            else:
                self._attribute(parts, key, trailing)
        parts.comments += [_comment(one, len(parts.children)) for one in events.comments(column)]
        self._refuse_structures(tag, parts)
        if parts.text and parts.children:
            place, message = parts.seen[TEXT_KEY], "an element can have children or text, but not both"
            self._report("wrong-shape", message, place, place + len(TEXT_KEY))
        events.pop()

    def _attribute(self, parts: _Parts, key: Any, trailing: str | None) -> None:
        events = self._events
        value = events.next
        if not isinstance(value, yaml.ScalarEvent):
            self._structure(parts, key, trailing)
            return
        events.pop()
        for said in (trailing, _header_comment(self._source.text, value), events.trailing):
            if said is not None:
                parts.comments.append(Comment(said, attribute=key.value, trailing=True))
        if self._is_no_string(key, value):
            pass
        elif value.style == '"' and (unspeakable := re.search(UNSPEAKABLE, value.value)):
            message = (
                f"{key.value}: a tree file cannot contain the character U+{ord(unspeakable.group()):04X}"
            )
            self._report("wrong-character", message, *_mark_position(value), hint="delete it")
        elif value.tag is not None:
            pass  # a YAML tag has its own finding
        elif key.value != TEXT_KEY:
            parts.attributes[key.value] = value.value
            parts.places += (*_mark_position(key), *_mark_position(value))
            if events.trailing is not None:
                self._report_cut_string(key, value)
        elif self._models:
            parts.text = value.value.strip()
        else:
            message = f"'{TEXT_KEY}' is allowed only in the ports of a {MODEL_TAG}"
            self._report("wrong-shape", message, *_mark_position(key), hint="write a comment instead")

    def _report_cut_string(self, key: Any, value: Any) -> None:
        """Report an unquoted string that a # has perhaps cut off by mistake."""
        start, end = _mark_position(value)
        cut = _CUT.match(self._source.text, end) if not value.style and value.value[:1].isalpha() else None
        if cut is None or cut[0].startswith(" #sar:"):
            return
        written = self._source.text[start : cut.end()].rstrip()
        message = f"{key.value}: a # after a space begins a comment, so the value is '{value.value}'"
        hint = f"put '{written}' in quotes, or begin the comment with '# '"
        span = self._source.span(end + 1, cut.end())
        self._doubts.append(Diagnostic("cut-text", message, self._source, span, hint=hint))

    def _structure(self, parts: _Parts, key: Any, trailing: str | None) -> None:
        """Read a list or a mapping. Its text becomes the value of an attribute."""
        events, value = self._events, self._events.next
        if isinstance(value, yaml.AliasEvent):
            events.skip()
            return
        parts.comments += [_comment(one, 0, key.value) for one in events.comments()]
        start = _mark_position(value)[0]
        end, behind = events.skip_fields()
        for said in (trailing, behind.text if behind is not None else None):
            if said is not None:
                parts.comments.append(Comment(said, attribute=key.value, trailing="\n" not in said))
        if not events.is_cut and value.tag is None:
            parts.unquoted[key.value] = self._no_string_finding(parts, key, value, end)
            parts.attributes[key.value] = dedent(
                self._source.text[start:end], self._source.position_of(start)[1]
            )
            parts.places += (*_mark_position(key), start, end)
            self._spans.add_verbatim(start)

    def _refuse_structures(self, tag: str, parts: _Parts) -> None:
        """Report lists and mappings in place of strings.

        This must follow the last attribute, because the ID determines which attributes take message fields.
        """
        for name, finding in parts.unquoted.items():
            if not is_fields_attribute(tag, parts.attributes, name):
                index = 4 * [*parts.attributes].index(name)
                del parts.attributes[name], parts.places[index : index + 4]
                self._events.findings.append(finding)

    def _no_string_finding(self, parts: _Parts, key: Any, value: Any, end: int) -> Diagnostic:
        """Return the finding about a list or a mapping in place of a string."""
        start = _mark_position(value)[0]
        written = self._source.text[start:end]
        if value.flow_style and REFERENCE.fullmatch(written):
            message = f"{key.value}: YAML reads braces as a mapping, so a reference must be in quotes"
            span = self._source.span(start, end)
            return Diagnostic("wrong-shape", message, self._source, span, suggestion=f"'{written}'")
        what = "a list" if isinstance(value, yaml.SequenceStartEvent) else "a mapping"
        message = f"the value of the attribute '{key.value}' must be a string, but is {what}"
        hint = f"write nodes under '{CHILDREN_KEY}:', or put a string that begins with {{ or [ in quotes"
        block = isinstance(value, yaml.SequenceStartEvent) and not value.flow_style
        meant = CHILDREN_KEY if block and CHILDREN_KEY not in parts.seen else None
        span = self._source.span(*_mark_position(key))
        return Diagnostic("wrong-shape", message, self._source, span, suggestion=meant, hint=hint)

    def _children(self, parts: _Parts, key: Any) -> None:
        events = self._events
        start: Any = events.next
        if not isinstance(start, yaml.SequenceStartEvent):
            events.skip()
            message = f"'{CHILDREN_KEY}' must be a list of nodes"
            hint = (
                "begin each node with '- '"
                if not _is_nothing(start)
                else "write the nodes, or delete the line"
            )
            self._report("wrong-shape", message, *_mark_position(key), hint=hint)
            return
        events.pop()
        column = 0 if start.flow_style else self._source.position_of(_mark_position(start)[0])[1]
        while not isinstance(events.next, yaml.SequenceEndEvent):
            parts.comments += [_comment(one, len(parts.children)) for one in events.comments()]
            child = self._node()
            if child is not None:
                parts.children.append(child)
        parts.comments += [_comment(one, len(parts.children)) for one in events.comments(column)]
        events.pop()

    def _key(self) -> Any:
        """Read the next key. If the key is not a string, report an error and return None."""
        key = self._events.next
        if isinstance(key, yaml.ScalarEvent):
            return self._events.pop()
        end = self._events.skip()
        if not isinstance(key, yaml.AliasEvent):
            hint = "put a name that begins with { or [ in quotes"
            self._report("wrong-shape", "a key must be a name", _mark_position(key)[0], end, hint=hint)
        return None

    def _is_wrong(self, key: Any, parts: _Parts) -> bool:
        name = key.value
        if name in parts.seen:
            line = self._source.position_of(parts.seen[name])[0]
            message = f"'{name}' is given twice, first on line {line}"
            self._report("duplicate-key", message, *_mark_position(key), hint="delete one of them")
            return True
        if name == "<<" and not key.style:
            message = "'<<' is a YAML merge key, which is not allowed in a tree file"
            self._report("yaml-merge", message, *_mark_position(key), hint="write out the attributes")
            return True
        split = (
            split_number(self._source.text, *_mark_position(key)) if _is_nothing(self._events.next) else None
        )
        if split is not None:
            message = SPLIT.format(split.written)
            advice = Advice(suggestion=split.meant, hint=split.hint)
            self._report("wrong-value", message, split.start, _mark_position(key)[1], **advice)
            return True
        if name != TEXT_KEY and not is_name(name):
            self._wrong_name(key, "an attribute")
            return True
        return False

    def _is_no_string(self, key: Any, value: Any) -> bool:
        """Report an attribute's value that is not a valid string, and return whether it is invalid.

        A value is invalid if it is empty, or if indentation makes a node a part of the value.
        """
        if _is_nothing(value):
            message = f"'{key.value}' has no value"
            hint = f"write {key.value}: '' for an empty string, or delete the line"
            self._report("missing-value", message, *_mark_position(key), hint=hint)
            return True
        return self._is_too_deep(value)

    def _is_too_deep(self, scalar: Any) -> bool:
        """Report a node that is indented so far that it continues the string above it.

        Return whether there is such a node.
        """
        start, end = _mark_position(scalar)
        node = _CONTINUED.search(self._source.text, start, end) if not scalar.style else None
        if node is None:
            return False
        above = escape_to_one_line(self._source.text[start : node.start()].strip())
        message = f"this line is indented deeper than '{above}', so it continues that string"
        hint = "indent this line like the lines with the '- ' of its siblings"
        self._report("wrong-shape", message, node.start(1), node.end(1), hint=hint)
        return True

    def _wrong_name(self, scalar: Any, what: str) -> None:
        if self._is_too_deep(scalar):
            return
        written = scalar.value if len(scalar.value) < 40 else f"{scalar.value[:40]}..."  # noqa: PLR2004
        message = f"'{written}' cannot be the name of {what}" if written else f"{what} needs a name"
        if "\n" in written or not written.isprintable():
            message = f"this cannot be the name of {what}"
        hint = "use letters, digits, '_', '-' and '.', and begin with a letter or '_'"
        self._report("wrong-name", message, *_mark_position(scalar), hint=hint)

    def _stray_key(self, tag: Any) -> None:
        """Report a key at the same level as a node's tag."""
        key = self._key()
        self._events.skip()
        if key is None or tag is None:
            return
        if not self._depth:
            message = f"a tree file has one top-level key, but '{key.value}' is beside '{tag.value}'"
        else:
            message = f"'{key.value}' is beside '{tag.value}', not below it"
        hint = "indent this key further, or begin a node with '- '"
        self._report("wrong-shape", message, *_mark_position(key), hint=hint)


def _mark_position(event: Any) -> tuple[int, int]:
    return event.start_mark.index, event.end_mark.index


def _is_nothing(event: Any) -> bool:
    start, end = _mark_position(event)
    return isinstance(event, yaml.ScalarEvent) and start == end


def _comment(waiting: Any, index: int, attribute: str | None = None) -> Comment:
    return Comment(waiting.text, index, attribute, after_blank_line=waiting.after_blank_line)


def _header_comment(text: str, value: Any) -> str | None:
    """Return the comment on the line with the `|` or `>` of a block."""
    if value.style not in ("|", ">"):
        return None
    match = _HEADER_COMMENT.match(text, value.start_mark.index)
    return yaml_comment_text([match.group(1)]) if match else None
