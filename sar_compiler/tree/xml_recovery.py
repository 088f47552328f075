"""Recovery of malformed XML files that BehaviorTree.CPP accepts, such as files with an unescaped & or <.

Each such character is replaced by a stand-in: one character that the file does not contain. expat can then parse the
text, all lines and columns stay the same, and the original characters are restored in the parsed text. Spaces replace an
XML declaration after blank lines, and content outside of the root.
"""

import itertools
import re
import sys
from collections.abc import Iterator
from enum import Enum
from typing import NamedTuple

from sar_compiler.tree.diagnostic import Diagnostic, Source
from sar_compiler.tree.model import TreeFile

REFERENCE = r"&(?:amp|lt|gt|apos|quot|#[0-9]+|#x[0-9a-fA-F]+);"
"""A regular expression for an entity or character reference, which XML reads as one character."""
CHARACTER = re.compile(rf"{REFERENCE}|\r\n|.", re.DOTALL)
"""A regular expression for the written form of one character of a value."""
NAME = re.compile(r"<[^\s/>]+")
"""A regular expression for the beginning of a start tag, up to the end of its name."""
ATTRIBUTE = re.compile(r"""\s*([^\s=/>]+)\s*=\s*(["'])(.*?)\2""", re.DOTALL)
"""A regular expression for whitespace and an attribute.

The groups are the name, the quotation mark and the value.
"""
TAG_END = re.compile(r"\s*/?>")
"""A regular expression for the end of a start tag and the whitespace before it."""
_LONE = rf"(?!{REFERENCE})&"
_RAW = re.compile(rf"(?:{_LONE})+|<")
_NUMBERED = r"&#(?:x0*([0-9a-fA-F]{1,6})|0*([0-9]{1,7}));"
_NAMED = re.compile(r"&[^\W\d][\w.\-]*;")
_LATE_DECLARATION = r"\s+(<\?xml\s[^>]*\?>)"
_NOT_BLANK = r"\S"
_LINE = re.compile(r"\S(?:[^\r\n]*\S)?")
_DASHES = re.compile(r"-{2,}|-\Z")
_PRIVATE = (range(0xE000, 0xF900), range(0xF0000, 0xFFFFE))
_REPLACEABLE = "&<-"
_MOST = 1000
"""The maximum number of findings that are reported in a file."""
_IGNORED_BY_BTCPP = "BehaviorTree.CPP ignores it, but other XML parsers reject the file"
_ACCEPTED_BY_BTCPP = "BehaviorTree.CPP accepts it, but other XML parsers reject the file"
UNDEFINED_ENTITY_HINT = "write the character itself, or &amp; for a literal &"


class _PartOfFile(Enum):
    """A part of an XML text.

    The value is a regular expression for the characters that are forbidden there.
    """

    BEFORE_ROOT = _LINE
    BESIDE_ROOT = re.compile(r"\S(?:.*\S)?", re.DOTALL)
    CONTENT = _RAW
    COMMENT = _DASHES


class RecoveredText(NamedTuple):
    """A malformed text in which characters are replaced so that expat can parse it.

    Attributes:
        text: The text with stand-ins.
        originals: The original character of each stand-in, for `str.translate`.
        findings: A finding for each recovered part.
    """

    text: str
    originals: dict[int, str]
    findings: tuple[Diagnostic, ...]

    def original(self, text: str) -> str:
        """Return a parsed text with the original characters."""
        return text.translate(self.originals)


def attributes_end(text: str, offset: int, limit: int = sys.maxsize) -> int:
    """Return the end of the last attribute that ends before *limit*; *offset* is the end of the tag's name."""
    while match := ATTRIBUTE.match(text, offset, limit):
        offset = match.end()
    return offset


def recover(source: Source) -> RecoveredText | None:
    """Replace the invalid characters of a text, up to the first irrecoverable error.

    Return None if there is nothing to replace.
    """
    stand_ins = _stand_ins(source.text)
    if stand_ins is None:
        return None
    text, parts, done = source.text, [], 0
    findings: list[Diagnostic] = []
    if declaration := re.match(_LATE_DECLARATION, text):
        parts, done = [re.sub(_NOT_BLANK, " ", declaration[0])], declaration.end()
        message = f"an XML declaration must be at the very beginning of a file: {_ACCEPTED_BY_BTCPP}"
        span, hint = source.span(*declaration.span(1)), "delete the spaces and lines before it"
        findings.append(Diagnostic("loose-xml", message, source, span, hint=hint))
    for start, end, part in _TagWalk(text).stretches():
        raw = part.value
        if raw.search(text, start, end) is None:
            continue
        parts += [text[done:start], _replace(text[start:end], stand_ins, part)]
        done = end
        runs = itertools.islice(raw.finditer(text, start, end), _MOST - len(findings))
        findings += [_recovery(source, *run.span(), part) for run in runs]
    if not parts:
        return None
    originals = {ord(stand_in): chr(character) for character, stand_in in stand_ins.items()}
    return RecoveredText("".join([*parts, text[done:]]), originals, tuple(findings))


def readable(tree_file: TreeFile) -> str:
    """Return the text of a parsed file. If the file was recovered, the text contains stand-ins."""
    recovered = recover(tree_file.source) if tree_file.findings else None
    return recovered.text if recovered is not None else tree_file.source.text


def escape_xml(written: str) -> str:
    """Escape each unescaped & and < in a part of a value."""
    return _RAW.sub(lambda raw: _replacement(raw[0]), written)


def _replacement(raw: str) -> str:
    return "&lt;" if raw == "<" else "&amp;" * len(raw)


def _stand_ins(text: str) -> dict[int, str] | None:
    """Return an unused private-use character for each character to replace; None if too few are unused."""
    used = set(text)
    codes = (
        int(hexadecimal, 16) if hexadecimal else int(decimal)
        for hexadecimal, decimal in re.findall(_NUMBERED, text)
    )
    used.update(chr(code) for code in codes if code <= sys.maxunicode)
    free = itertools.islice(
        (chr(each) for each in itertools.chain(*_PRIVATE) if chr(each) not in used), len(_REPLACEABLE)
    )
    found = {ord(character): stand_in for character, stand_in in zip(_REPLACEABLE, free, strict=False)}
    return found if len(found) == len(_REPLACEABLE) else None


def _replace(stretch: str, stand_ins: dict[int, str], part: _PartOfFile) -> str:
    if part in _IGNORED:
        return re.sub(_NOT_BLANK, " ", stretch)
    if part is _PartOfFile.COMMENT:
        return stretch.replace("-", stand_ins[ord("-")])
    return re.sub(_LONE, stand_ins[ord("&")], stretch).replace("<", stand_ins[ord("<")])


class _TagWalk:
    """An iterator over the tags of a text, up to the first tag that cannot be parsed."""

    def __init__(self, text: str) -> None:
        self._text = text
        self._has_root = False
        self._opened: list[str] = []
        # The offset of the current element outside of the root; -1 if there is none.
        self._beside = -1

    def stretches(self) -> Iterator[tuple[int, int, _PartOfFile]]:
        """Yield the offsets of texts, values, comments, and content outside of the root."""
        offset = 0
        while (tag := self._text.find("<", offset)) >= 0:
            if self._beside < 0:
                yield offset, tag, self._part()
            found: list[tuple[int, int, _PartOfFile]] = []
            offset = self._end_of_tag(tag, found)
            yield from found if self._beside < 0 else ()
            if not offset:
                return
            if self._beside >= 0 and not self._opened:
                yield self._beside, offset, _PartOfFile.BESIDE_ROOT
                self._beside = -1

    def _part(self) -> _PartOfFile:
        if not self._has_root:
            return _PartOfFile.BEFORE_ROOT
        return _PartOfFile.CONTENT if self._opened else _PartOfFile.BESIDE_ROOT

    def _end_of_tag(self, tag: int, found: list[tuple[int, int, _PartOfFile]]) -> int:
        """Add the parts of a tag to *found*, and return the end offset of the tag.

        The result is 0 if the tag cannot be parsed.
        """
        text = self._text
        if text.startswith("<!--", tag):
            end = _end_after(text, "-->", tag + len("<!--"))
            found += [(tag + len("<!--"), end - len("-->"), _PartOfFile.COMMENT)] if end else []
            return end
        if text.startswith("<![CDATA[", tag):
            end = _end_after(text, "]]>", tag)
            found += [(tag, end, _PartOfFile.BESIDE_ROOT)] if end and not self._opened else []
            return end
        if text.startswith("<?", tag):
            return _end_after(text, "?>", tag)
        if text.startswith("</", tag):
            end = _end_after(text, ">", tag)
            closes = self._opened and text[tag + len("</") : max(end - 1, 0)].rstrip() == self._opened.pop()
            return end if closes else 0
        return self._end_of_start_tag(tag, found)

    def _end_of_start_tag(self, tag: int, found: list[tuple[int, int, _PartOfFile]]) -> int:
        if self._has_root and not self._opened:
            self._beside = tag
        self._has_root = True
        end, name = _values(self._text, tag, found), NAME.match(self._text, tag)
        if name is not None and end and not self._text.endswith("/>", tag, end):
            self._opened.append(name[0].removeprefix("<"))
        return end


def _end_after(text: str, end: str, start: int) -> int:
    found = text.find(end, start)
    return found + len(end) if found >= 0 else 0


def _values(text: str, tag: int, values: list[tuple[int, int, _PartOfFile]]) -> int:
    """Add the offsets of a start tag's values to *values*, and return the end offset of the tag.

    The result is 0 if the tag cannot be parsed.
    """
    name = None if text.startswith("<!", tag) else NAME.match(text, tag)
    if name is None:
        return 0
    offset = name.end()
    while match := ATTRIBUTE.match(text, offset):
        values.append((*match.span(3), _PartOfFile.CONTENT))
        offset = match.end()
    end = TAG_END.match(text, offset)
    if end is None:
        # A value without a closing quotation mark may seem to end at the mark of another value.
        values[:] = [each for each in values if "<" not in text[each[0] : each[1]]]
        return 0
    return end.end()


_IGNORED = {
    _PartOfFile.BEFORE_ROOT: ("text is not allowed before <root>", "put it in a comment, or delete it"),
    _PartOfFile.BESIDE_ROOT: (
        "content outside of <root> is not allowed",
        "delete it, or move it into the <root>",
    ),
}
"""The message and the hint for content that BehaviorTree.CPP ignores."""


def _recovery(source: Source, start: int, end: int, part: _PartOfFile) -> Diagnostic:
    """Return the finding about content that is not allowed in XML."""
    if part not in _IGNORED:
        return _loose(source, start, end)
    what, hint = _IGNORED[part]
    line = _LINE.match(source.text, start, end)
    message, span = f"{what}: {_IGNORED_BY_BTCPP}", source.span(start, line.end() if line else end)
    return Diagnostic("stray-text", message, source, span, hint=hint)


def _loose(source: Source, start: int, end: int) -> Diagnostic:
    raw, named = source.text[start:end], _NAMED.match(source.text, start)
    suggestion, hint = None, None
    if "-" in raw:
        message = f"-- is not allowed in an XML comment: {_ACCEPTED_BY_BTCPP}"
        suggestion = " ".join(raw) if len(raw) > 1 else "- "
        if source.text.startswith("<!--", start - 2):
            start, suggestion = start - 2, None
            message, hint = "a comment begins inside another comment", "end the first comment with -->"
    elif named is not None:
        message, end = f"'{named[0]}' is not an XML entity: {_ACCEPTED_BY_BTCPP}", named.end()
        hint = UNDEFINED_ENTITY_HINT
    else:
        what, suggestion = "&" if raw != "<" else "<", _replacement(raw)
        escaped = f"{what} must be written as {_replacement(what)} in XML"
        message = f"{escaped}: BehaviorTree.CPP accepts {what}, but other XML parsers reject the file"
    return Diagnostic("loose-xml", message, source, source.span(start, end), suggestion, hint)
