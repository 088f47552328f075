"""Recovery of files that only BehaviorTree.CPP's reader takes: & and < as themselves, -- in comments, text before the root.

Each such character is replaced by a stand-in of one character, which nothing else in the file is. So expat can read
the text, every line and column stays, and what was read gets its characters back. An XML declaration behind empty
lines becomes empty lines, too, and so does text before the root.
"""

import itertools
import re
import sys
from collections.abc import Iterator
from enum import Enum
from typing import NamedTuple

from sar_compiler.tree.diagnostic import Diagnostic, Severity
from sar_compiler.tree.source import Source

REFERENCE = r"&(?:amp|lt|gt|apos|quot|#[0-9]+|#x[0-9a-fA-F]+);"
"""A regular expression of what is read as another character."""
NAME = re.compile(r"<[^\s/>]+")
"""That of the beginning of a tag."""
ATTRIBUTE = re.compile(r"""\s*([^\s=/>]+)\s*=\s*(["'])(.*?)\2""", re.DOTALL)
"""That of an attribute with the blanks before it: its name, its quotation mark, its value."""
_TAG_END = re.compile(r"\s*/?>")
_LONE = re.compile(rf"(?!{REFERENCE})&")
_RAW = re.compile(rf"(?:{_LONE.pattern})+|<")
_NUMBERED = re.compile(r"&#(?:x0*([0-9a-fA-F]{1,6})|0*([0-9]{1,7}));")
_NAMED = re.compile(r"&[^\W\d][\w.\-]*;")
_LATE_DECLARATION = re.compile(r"\s+(<\?xml\s[^>]*\?>)")
_NOT_BLANK = re.compile(r"\S")
_LINE = re.compile(r"\S(?:[^\r\n]*\S)?")
_DASHES = re.compile(r"-{2,}|-\Z")
_PRIVATE = (range(0xE000, 0xF900), range(0xF0000, 0xFFFFE))
_STANDING_ALONE = "&<-"
_MOST = 1000
"""The most findings in a file."""
_TOLD_PASSED = "BehaviorTree.CPP passes over it, other readers of XML do not"
_TOLD = "BehaviorTree.CPP takes it as it is, other readers of XML do not"


class _Stretch(Enum):
    """What a stretch of a text is, with the regular expression of what is not XML in it."""

    BEFORE_ROOT = _LINE
    CONTENT = _RAW
    COMMENT = _DASHES


class Recovered(NamedTuple):
    """A text that expat can read.

    Attributes:
        text: The text, with stand-ins.
        originals: The character that each stand-in is for, for `str.translate`.
        findings: What was recovered, at its place.
    """

    text: str
    originals: dict[int, str]
    findings: tuple[Diagnostic, ...]

    def original(self, text: str) -> str:
        """Return what a text that was read says."""
        return text.translate(self.originals)


def recover(source: Source) -> Recovered | None:
    """Return a text with stand-ins up to the first place that is beyond recovery; None if there is nothing to recover."""
    stand_ins = _stand_ins(source.text)
    if stand_ins is None:
        return None
    text, parts, done = source.text, [], 0
    findings: list[Diagnostic] = []
    if declaration := _LATE_DECLARATION.match(text):
        parts, done = [_NOT_BLANK.sub(" ", declaration[0])], declaration.end()
        findings.append(_late_declaration(source, *declaration.span(1)))
    for start, end, part in _stretches(text):
        raw = part.value
        if raw.search(text, start, end) is None:
            continue
        parts += [text[done:start], _replaced(text[start:end], stand_ins, part)]
        done = end
        runs = itertools.islice(raw.finditer(text, start, end), _MOST - len(findings))
        tell = _stray_text if part is _Stretch.BEFORE_ROOT else _finding
        findings += [tell(source, *run.span()) for run in runs]
    if not parts:
        return None
    originals = {ord(stand_in): chr(character) for character, stand_in in stand_ins.items()}
    return Recovered("".join([*parts, text[done:]]), originals, tuple(findings))


def readable(source: Source) -> str:
    """Return the text of a file that was read, with stand-ins where it was recovered."""
    recovered = recover(source)
    return recovered.text if recovered is not None else source.text


def escaped(written: str) -> str:
    """Return a piece of a value as XML has it."""
    return _RAW.sub(lambda raw: _replacement(raw[0]), written)


def _replacement(raw: str) -> str:
    return "&lt;" if raw == "<" else "&amp;" * len(raw)


def _stand_ins(text: str) -> dict[int, str] | None:
    """Return a character that the text does not have for each that is replaced; None if it has too many."""
    used = set(text)
    codes = (
        int(hexadecimal, 16) if hexadecimal else int(decimal)
        for hexadecimal, decimal in _NUMBERED.findall(text)
    )
    used.update(chr(code) for code in codes if code <= sys.maxunicode)
    free = itertools.islice(
        (chr(each) for each in itertools.chain(*_PRIVATE) if chr(each) not in used), len(_STANDING_ALONE)
    )
    found = {ord(character): stand_in for character, stand_in in zip(_STANDING_ALONE, free, strict=False)}
    return found if len(found) == len(_STANDING_ALONE) else None


def _replaced(stretch: str, stand_ins: dict[int, str], part: _Stretch) -> str:
    if part is _Stretch.BEFORE_ROOT:
        return _NOT_BLANK.sub(" ", stretch)
    if part is _Stretch.COMMENT:
        return stretch.replace("-", stand_ins[ord("-")])
    return _LONE.sub(stand_ins[ord("&")], stretch).replace("<", stand_ins[ord("<")])


def _stretches(text: str) -> Iterator[tuple[int, int, _Stretch]]:
    """Yield the places of texts, values and comments, until a tag cannot be understood."""
    offset, part = 0, _Stretch.BEFORE_ROOT
    while (tag := text.find("<", offset)) >= 0:
        yield offset, tag, part
        if text.startswith("<!--", tag):
            offset = _behind(text, "-->", tag + len("<!--"))
            if offset:
                yield tag + len("<!--"), offset - len("-->"), _Stretch.COMMENT
        elif text.startswith("<![CDATA[", tag):
            offset = _behind(text, "]]>", tag)
        elif text.startswith("<?", tag):
            offset = _behind(text, "?>", tag)
        elif text.startswith("</", tag):
            offset = _behind(text, ">", tag)
        else:
            part = _Stretch.CONTENT
            values: list[tuple[int, int, _Stretch]] = []
            offset = _values(text, tag, values)
            yield from values
        if not offset:
            return


def _behind(text: str, end: str, start: int) -> int:
    found = text.find(end, start)
    return found + len(end) if found >= 0 else 0


def _values(text: str, tag: int, values: list[tuple[int, int, _Stretch]]) -> int:
    """Add the places of a start tag's values, and return its end; 0, and none, if it makes no sense."""
    name = None if text.startswith("<!", tag) else NAME.match(text, tag)
    if name is None:
        return 0
    offset = name.end()
    while match := ATTRIBUTE.match(text, offset):
        values.append((*match.span(3), _Stretch.CONTENT))
        offset = match.end()
    end = _TAG_END.match(text, offset)
    if end is None:
        # A value that lacks its quotation mark may have ended with another's.
        values[:] = [each for each in values if "<" not in text[each[0] : each[1]]]
        return 0
    return end.end()


def _late_declaration(source: Source, start: int, end: int) -> Diagnostic:
    message = f"an XML declaration must be at the very beginning of a file: {_TOLD}"
    hint, span = "delete the blanks and lines before it", source.span(start, end)
    return Diagnostic("loose-xml", message, source, span, hint=hint, severity=Severity.WARNING)


def _stray_text(source: Source, start: int, end: int) -> Diagnostic:
    message = f"text is not allowed before the root: {_TOLD_PASSED}"
    hint, span = "put it in a comment, or delete it", source.span(start, end)
    return Diagnostic("stray-text", message, source, span, hint=hint, severity=Severity.WARNING)


def _finding(source: Source, start: int, end: int) -> Diagnostic:
    raw, named = source.text[start:end], _NAMED.match(source.text, start)
    suggestion, hint = None, None
    if "-" in raw:
        message = f"-- is not allowed in a comment of XML: {_TOLD}"
        suggestion = " ".join(raw) if len(raw) > 1 else "- "
        if source.text.startswith("<!--", start - 2):
            start, suggestion = start - 2, None
            message, hint = "a comment begins in another one", "end the first one with -->"
    elif named is not None:
        message, end = f"XML does not know '{named[0]}': {_TOLD}", named.end()
        hint = "an & is written &amp;, other characters as themselves"
    else:
        what = "an &" if raw != "<" else "a <"
        message, suggestion = f"{what} is written {_replacement(raw[:1])} in XML: {_TOLD}", _replacement(raw)
    span = source.span(start, end)
    return Diagnostic("loose-xml", message, source, span, suggestion, hint, Severity.WARNING)
