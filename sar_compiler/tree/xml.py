"""Parser of tree files in XML.

expat provides the line and column of each tag. The location of an attribute is looked up in the text only when a
finding needs it.
"""

import dataclasses
import functools
import re
from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING
from xml.parsers import expat

from sar_compiler.gc_pause import gc_paused
from sar_compiler.tree.content import MAX_ATTRIBUTES, MAX_DEPTH, MAX_ELEMENTS, make_source
from sar_compiler.tree.diagnostic import (
    AttributePlaces,
    Diagnostic,
    ElementView,
    Severity,
    Source,
    Spans,
    TreeError,
)
from sar_compiler.tree.model import (
    MODEL_TAG,
    Comment,
    Element,
    FileBeginning,
    OpenTag,
    TreeFile,
    UnfinishedFileError,
    xml_comment_text,
)

if TYPE_CHECKING:
    from sar_compiler.tree.xml_recovery import RecoveredText

_DECLARED_ENCODING = rb"""^<\?xml\b[^>]*?\bencoding\s*=\s*["']([A-Za-z0-9._\-]+)["']"""


def parse_xml(data: bytes | str, path: str = "<text>") -> TreeFile:
    """Parse the content of a tree file.

    Raises:
        TreeError: If the content is too large or too deep, or has a DOCTYPE.
        UnfinishedFileError: If the content is not well-formed XML; the error contains the elements before the location
            of the error.
    """
    declared = None
    if isinstance(data, bytes) and data.startswith(b"<?xml"):
        declared = re.match(_DECLARED_ENCODING, data)
    encoding = declared.group(1).decode("ascii") if declared else None
    return _XmlReader(make_source(data, path, _SPANS, encoding, _EMPTY_HINT)).read()


class _XmlSpans(Spans):
    """Locator of the parts of start tags in the text of an XML file."""

    def tag(self, element: ElementView) -> tuple[int, int]:
        from sar_compiler.tree.xml_recovery import NAME

        start = element.offset
        name = NAME.match(element.source.text, start)
        return start, name.end() if name else start + 1

    def attributes(self, element: ElementView) -> Iterator[tuple[str, AttributePlaces]]:
        from sar_compiler.tree.xml_recovery import ATTRIBUTE

        text, offset = element.source.text, self.tag(element)[1]
        while match := ATTRIBUTE.match(text, offset):
            yield match[1], (*match.span(1), *match.span(3))
            offset = match.end()

    def characters(self, text: str, start: int, end: int, value: str) -> Sequence[int]:
        if end - start == len(value) and text.startswith(value, start):  # nearly every value
            return range(start, end + 1)
        return _offsets(text, start, end)


@functools.lru_cache(maxsize=4)  # each error in a long value needs them
def _offsets(text: str, start: int, end: int) -> list[int]:
    from sar_compiler.tree.xml_recovery import CHARACTER

    return [found.start() for found in CHARACTER.finditer(text, start, end)] + [end]


_SPANS = _XmlSpans()
_NOTHING: tuple[str, tuple[Comment, ...]] = ("", ())
_EMPTY_HINT = 'write <root BTCPP_format="4"> with a <BehaviorTree ID="..."> in it'
_HINTS = {
    expat.errors.XML_ERROR_JUNK_AFTER_DOC_ELEMENT: "put everything into one <root>",
    expat.errors.XML_ERROR_SYNTAX: "a tree file begins with <root>",
}


class _XmlReader:
    """Parser that reads a text in one pass. An element is created, with its children, at its end tag."""

    def __init__(self, source: Source, recovered: "RecoveredText | None" = None) -> None:
        self._source = source
        self._recovered = recovered
        self._parser = parser = expat.ParserCreate(encoding="utf-8")
        parser.StartDoctypeDeclHandler = self._doctype
        parser.CommentHandler = self._comment
        parser.ProcessingInstructionHandler = self._instruction
        self._instructions: list[Diagnostic] = []
        # Open elements: tag, attributes, line, column; and, for each level, the elements that have ended.
        self._open: list[tuple[str, dict[str, str], int, int]] = []
        self._levels: list[list[Element]] = [[]]
        # The comments and texts of the open elements that have any, by the number of enclosing elements.
        self._comments: dict[int, list[Comment]] = {}
        self._texts: dict[int, list[str]] = {}
        parser.StartElementHandler, self._end = self._handlers()
        parser.EndElementHandler = self._end

    def read(self) -> TreeFile:
        recovered = self._recovered
        text = recovered.text if recovered is not None else self._source.text
        try:
            # A lone surrogate cannot be written as UTF-8; expat then reports the position of the bad byte.
            with gc_paused(len(text)):
                self._parser.Parse(text.encode("utf-8", "surrogatepass"), True)  # noqa: FBT003
        except expat.ExpatError as error:
            if recovered is None:
                from sar_compiler.tree.xml_recovery import recover

                recovered = recover(self._source)
                if recovered is not None:
                    return _XmlReader(self._source, recovered).read()
            findings = recovered.findings if recovered is not None else ()
            raise UnfinishedFileError(
                [*findings, self._explain_error(error)], self._elements_before_error()
            ) from None
        return self._file()

    def _file(self) -> TreeFile:
        findings = self._recovered.findings if self._recovered is not None else ()
        findings = (*findings, *self._instructions)
        return TreeFile(self._source, self._levels[0][0], tuple(self._comments.get(0, ())), findings)

    def _elements_before_error(self) -> FileBeginning | None:
        """Return the elements that precede the error in the file; None if no element precedes it."""
        unfinished = [OpenTag(line, column, tag) for tag, _, line, column in self._open]
        for place in reversed(unfinished):
            self._end(place.tag)
        return FileBeginning(self._file(), tuple(unfinished)) if self._levels[0] else None

    def _handlers(self) -> tuple[Callable[[str, dict[str, str]], None], Callable[[str], None]]:
        """Return the handlers for start and end tags. They are closures, which are faster than methods."""
        parser, source, opened, levels = self._parser, self._source, self._open, self._levels
        comments, texts, recovered = self._comments, self._texts, self._recovered
        count = 0

        def start(tag: str, attributes: dict[str, str]) -> None:
            nonlocal count
            count += 1
            if count > MAX_ELEMENTS:
                self._refuse("too-many-nodes", f"the file has more than {MAX_ELEMENTS:,} elements", tag)
            if len(attributes) > MAX_ATTRIBUTES:
                self._refuse("too-many-nodes", f"<{tag}> has more than {MAX_ATTRIBUTES:,} attributes", tag)
            if recovered is not None:
                attributes = {name: recovered.original(value) for name, value in attributes.items()}
            opened.append((tag, attributes, parser.CurrentLineNumber, parser.CurrentColumnNumber + 1))
            levels.append([])
            if tag == MODEL_TAG:
                # Text is read only in a model, where it describes a port.
                parser.CharacterDataHandler = self._data
            if len(opened) > MAX_DEPTH:
                self._refuse("too-deep", f"elements are nested more than {MAX_DEPTH} levels deep", tag)

        def end_element(tag: str) -> None:
            text, notes = self._extras() if comments or texts else _NOTHING
            children = tuple(levels.pop())
            _, attributes, line, column = opened.pop()
            levels[-1].append(Element(tag, attributes, children, source, line, column, text, notes))
            if tag == MODEL_TAG:
                parser.CharacterDataHandler = None

        return start, end_element

    def _extras(self) -> tuple[str, tuple[Comment, ...]]:
        """Return and clear the text and comments of the element whose end tag was read."""
        depth = len(self._open)
        text = "".join(self._texts.pop(depth, ())).strip()
        return "" if self._levels[-1] else text, tuple(self._comments.pop(depth, ()))

    def _data(self, text: str) -> None:
        text = self._recovered.original(text) if self._recovered is not None else text
        self._texts.setdefault(len(self._open), []).append(text)

    def _comment(self, data: str) -> None:
        depth, start, siblings = len(self._open), self._offset(), self._levels[-1]
        text = xml_comment_text(self._recovered.original(data) if self._recovered is not None else data)
        written = self._source.text
        # The text before the comment on its line.
        first, last = self._source.offset(self._parser.CurrentLineNumber, 1), start
        while last > first and written[last - 1].isspace():
            last -= 1
        trailing = written.endswith(">", first, last) and "\n" not in text
        if trailing and depth and not siblings and depth not in self._comments:
            self._comments[depth] = [Comment(text, trailing=True)]
        elif (
            trailing
            and siblings
            and not (siblings[-1].children or siblings[-1].comments)
            and written.endswith(("/>", f"</{siblings[-1].tag}>"), first, last)
        ):
            comment = Comment(text, trailing=True)
            siblings[-1] = dataclasses.replace(siblings[-1], comments=(comment,))
        else:
            comment = Comment(text, len(siblings), after_blank_line=self._source.has_blank_line_before(start))
            self._comments.setdefault(depth, []).append(comment)

    def _instruction(self, target: str, _data: str) -> None:
        """Report the first processing instruction that follows the start tag of the root element."""
        if (self._open or self._levels[0]) and not self._instructions:
            start = self._offset()
            span = self._source.span(start, start + len(target) + 2)
            message = f"BehaviorTree.CPP accepts processing instructions only before <root>: <?{target}?>"
            hint, severity = "put it in a comment, or delete it", Severity.WARNING
            self._instructions.append(
                Diagnostic(
                    "processing-instruction", message, self._source, span, hint=hint, severity=severity
                )
            )

    def _doctype(self, *_declaration: object) -> None:
        message = "a DOCTYPE is not allowed in a tree file (entities could hide the file's content)"
        # expat calls the handler after it has read the name in the declaration.
        start = self._source.text.rfind("<!DOCTYPE", 0, self._offset())
        self._refuse("doctype", message, "!DOCTYPE", start, hint="delete the declaration")

    def _offset(self) -> int:
        return self._source.offset(self._parser.CurrentLineNumber, self._parser.CurrentColumnNumber + 1)

    def _refuse(
        self, code: str, message: str, name: str, start: int | None = None, hint: str | None = None
    ) -> None:
        """Raise an error with a finding that is located at a `<` and the name after it."""
        start = self._offset() if start is None else start
        span = self._source.span(start, start + len(name) + 1)
        raise TreeError([Diagnostic(code, message, self._source, span, hint=hint)])

    def _explain_error(self, error: expat.ExpatError) -> Diagnostic:
        """Explain an error of expat, as a finding in terms that the user knows."""
        from sar_compiler.tree.xml_errors import find_xml_fault

        start = self._source.offset(error.lineno, error.offset + 1)
        words = expat.errors.messages.get(error.code, str(error))
        hint = _HINTS.get(words)
        found = find_xml_fault(self._source.text, start, words)
        if found is not None:
            message = f"not well-formed XML: {found.message}"
            span = self._source.span(found.start, found.end)
            return Diagnostic("malformed-xml", message, self._source, span, found.suggestion, found.hint)
        if words == expat.errors.XML_ERROR_TAG_MISMATCH and self._open:
            start -= len("</")  # expat reports the position of the name
            tag, _, opened, *_ = self._open[-1]
            words = f"the end tag does not close <{tag}>, which was opened on line {opened}"
            hint = f"</{tag}> is expected here"
        elif words == expat.errors.XML_ERROR_NO_ELEMENTS and self._open:
            tag, _, opened, *_ = self._open[-1]
            words = f"the file ends before <{tag}>, opened on line {opened}, is closed"
        span = self._source.span(start, start + 1)
        return Diagnostic("malformed-xml", f"not well-formed XML: {words}", self._source, span, hint=hint)
