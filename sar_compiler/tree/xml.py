"""Reading tree files in XML.

expat does the work: it knows the line and column of every tag. Where an attribute stands is looked up
in the text only when somebody asks, which is when there is something to say about it.
"""

import codecs
import re
from pathlib import Path
from xml.parsers import expat

from sar_compiler.tree.diagnostic import Diagnostic, TreeError, UnreadableFileError
from sar_compiler.tree.model import Element, TreeFile
from sar_compiler.tree.source import Source, Span

MAX_BYTES = 32 * 1024 * 1024
"""Larger files are refused; 100,000 leaves need about a third of this."""

MAX_DEPTH = 200
"""Deeper nesting is refused: py_trees stops a tree by recursion, two frames for each level."""

_DECLARED_ENCODING = re.compile(rb"""^<\?xml\b[^>]*?\bencoding\s*=\s*["']([A-Za-z0-9._\-]+)["']""")
_BYTE_ORDER_MARKS = [
    (codecs.BOM_UTF8, "utf-8"),
    (codecs.BOM_UTF16_LE, "utf-16-le"),
    (codecs.BOM_UTF16_BE, "utf-16-be"),
]
_NAME = re.compile(r"<[^\s/>]+")
_ATTRIBUTE = re.compile(r"""\s*([^\s=/>]+)\s*=\s*(?:"([^"]*)"|'([^']*)')""")


def read_xml(path: str | Path) -> TreeFile:
    """Read a tree file.

    Args:
        path: The file.

    Returns:
        What it says, not yet checked.

    Raises:
        UnreadableFileError: If the file is not there or cannot be read.
        TreeError: If it is not well-formed XML, too large, too deep, or has a DOCTYPE.
    """
    try:
        # One byte more than allowed is enough to know, whatever is at the other end of the path.
        with Path(path).open("rb") as stream:
            data = stream.read(MAX_BYTES + 1)
    except OSError as error:
        message = f"cannot read {path}: {error.strerror or error}"
        raise UnreadableFileError(message) from error
    return parse_xml(data, str(path))


def parse_xml(data: bytes | str, path: str = "<text>") -> TreeFile:
    """Read a tree file from memory.

    Args:
        data: Its content.
        path: What to call it in findings.

    Returns:
        What it says, not yet checked.

    Raises:
        TreeError: If it is not well-formed XML, too large, too deep, or has a DOCTYPE.
    """
    if len(data) > MAX_BYTES:
        source = Source(path, "", _SPANS)
        message = f"the file is larger than {MAX_BYTES // 2**20} MiB"
        raise TreeError([Diagnostic("file-too-large", message, source, _START)])
    text = data if isinstance(data, str) else _decode(data, path)
    source = Source(path, text.removeprefix("\ufeff"), _SPANS)
    if not source.text.strip():
        raise TreeError([Diagnostic("empty-file", "the file is empty", source, _START, hint=_EMPTY_HINT)])
    return TreeFile(source, _Reader(source).read())


class _XmlSpans:
    """Finds the parts of a start tag in the text."""

    def tag(self, source: Source, element: Element) -> Span:
        start = source.offset(element.line, element.column)
        name = _NAME.match(source.text, start)
        return source.span(start, name.end() if name else start + 1)

    def attribute_name(self, source: Source, element: Element, name: str) -> Span:
        match = self._attribute(source, element, name)
        return source.span(*match.span(1)) if match else self.tag(source, element)

    def attribute_value(self, source: Source, element: Element, name: str) -> Span:
        match = self._attribute(source, element, name)
        if match is None:
            return self.tag(source, element)
        return source.span(*match.span(2 if match.group(2) is not None else 3))

    def end_of_tag(self, source: Source, element: Element) -> int:
        """Return the offset behind the last attribute of a start tag."""
        name = _NAME.match(source.text, source.offset(element.line, element.column))
        offset = name.end() if name else 0
        while match := _ATTRIBUTE.match(source.text, offset):
            offset = match.end()
        return offset

    def _attribute(self, source: Source, element: Element, name: str) -> re.Match[str] | None:
        tag = _NAME.match(source.text, source.offset(element.line, element.column))
        offset = tag.end() if tag else 0
        while match := _ATTRIBUTE.match(source.text, offset):
            if match.group(1) == name:
                return match
            offset = match.end()
        return None


_SPANS = _XmlSpans()
_START = Span(1, 1, 1, 1)
_EMPTY_HINT = 'write <root BTCPP_format="4"> with a <BehaviorTree ID="..."> in it'
_HINTS = {
    expat.errors.XML_ERROR_UNDEFINED_ENTITY: "write &amp; for an ampersand",
    expat.errors.XML_ERROR_JUNK_AFTER_DOC_ELEMENT: "a tree file has one <root> with everything in it",
    expat.errors.XML_ERROR_SYNTAX: "a tree file begins with <root>",
}


class _Reader:
    """One pass over a text; builds each element when its end comes, so that it can be frozen."""

    def __init__(self, source: Source) -> None:
        self._source = source
        self._parser = parser = expat.ParserCreate(encoding="utf-8")
        parser.StartElementHandler = self._start
        parser.EndElementHandler = self._end
        parser.StartDoctypeDeclHandler = self._doctype
        # What is open: tag, attributes, line, column; and the children collected for each level.
        self._open: list[tuple[str, dict[str, str], int, int]] = []
        self._children: list[list[Element]] = [[]]

    def read(self) -> Element:
        try:
            # A lone surrogate cannot be written as UTF-8; expat then says where the bad byte is.
            self._parser.Parse(self._source.text.encode("utf-8", "surrogatepass"), True)  # noqa: FBT003
        except expat.ExpatError as error:
            raise TreeError([self._malformed(error)]) from None
        return self._children[0][0]

    def _start(self, tag: str, attributes: dict[str, str]) -> None:
        parser = self._parser
        self._open.append((tag, attributes, parser.CurrentLineNumber, parser.CurrentColumnNumber + 1))
        self._children.append([])
        if len(self._open) > MAX_DEPTH:
            message = f"elements are nested more than {MAX_DEPTH} deep"
            self._refuse("too-deep", message, self._here(), self._here() + len(tag) + 1)

    def _end(self, _tag: str) -> None:
        tag, attributes, line, column = self._open.pop()
        children = tuple(self._children.pop())
        self._children[-1].append(Element(tag, attributes, children, self._source, line, column))

    def _doctype(self, *_declaration: object) -> None:
        message = "a DOCTYPE is not allowed in a tree file (entities could hide what the file says)"
        # expat speaks up behind the declaration's name.
        start = self._source.text.rfind("<!DOCTYPE", 0, self._here())
        self._refuse("doctype", message, start, start + len("<!DOCTYPE"), hint="delete the declaration")

    def _here(self) -> int:
        return self._source.offset(self._parser.CurrentLineNumber, self._parser.CurrentColumnNumber + 1)

    def _refuse(self, code: str, message: str, start: int, end: int, hint: str | None = None) -> None:
        raise TreeError([Diagnostic(code, message, self._source, self._source.span(start, end), hint=hint)])

    def _malformed(self, error: expat.ExpatError) -> Diagnostic:
        """Say what is wrong in the reader's words where expat's alone would not help."""
        start = self._source.offset(error.lineno, error.offset + 1)
        words = expat.errors.messages.get(error.code, str(error))
        hint = _HINTS.get(words)
        if words == expat.errors.XML_ERROR_TAG_MISMATCH and self._open:
            tag, _, opened, _ = self._open[-1]
            words = f"the end tag does not close <{tag}>, which was opened in line {opened}"
            hint = f"</{tag}> is expected here"
        elif words == expat.errors.XML_ERROR_NO_ELEMENTS and self._open:
            tag, _, opened, _ = self._open[-1]
            words = f"the file ends before <{tag}>, opened in line {opened}, is closed"
        elif words == expat.errors.XML_ERROR_INVALID_TOKEN and self._source.text[:start].rstrip().endswith(
            "="
        ):
            words = "the value of an attribute must stand in quotes"
        span = self._source.span(start, start + 1)
        return Diagnostic("malformed-xml", f"not well-formed XML: {words}", self._source, span, hint=hint)


def _decode(data: bytes, path: str) -> str:
    encoding = next((name for mark, name in _BYTE_ORDER_MARKS if data.startswith(mark)), None)
    if encoding is None:
        declared = _DECLARED_ENCODING.match(data)
        encoding = declared.group(1).decode("ascii") if declared else "utf-8"
    try:
        text = data.decode(encoding)
    except UnicodeDecodeError as error:
        place = len(data[: error.start].decode(encoding, "replace"))
        message = f"byte 0x{data[error.start]:02x} is not {encoding}"
        raise _wrong_encoding(message, path, data.decode(encoding, "replace"), place) from None
    except (LookupError, UnicodeError):
        message = f"the file declares the encoding '{encoding}', which tree files cannot have"
        raise _wrong_encoding(message, path, data.decode("utf-8", "replace")) from None
    if "\0" in text:
        message = "the file has zero bytes, as UTF-16 without a byte order mark has"
        raise _wrong_encoding(message, path, text, text.index("\0"))
    return text


def _wrong_encoding(message: str, path: str, text: str, place: int = 0) -> TreeError:
    source = Source(path, text, _SPANS)
    span = source.span(place, place + 1)
    return TreeError([Diagnostic("wrong-encoding", message, source, span, hint="write it in UTF-8")])
