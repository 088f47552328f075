"""Recovery of files that only BehaviorTree.CPP's reader takes: & and < as themselves, -- in comments, content outside the root.

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

from sar_compiler.tree.diagnostic import Diagnostic
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
    BESIDE_ROOT = re.compile(r"\S(?:.*\S)?", re.DOTALL)
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
    for start, end, part in _TagWalk(text).stretches():
        raw = part.value
        if raw.search(text, start, end) is None:
            continue
        parts += [text[done:start], _replaced(text[start:end], stand_ins, part)]
        done = end
        runs = itertools.islice(raw.finditer(text, start, end), _MOST - len(findings))
        tell = _TELLING.get(part, _finding)
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
    if part in _TELLING:
        return _NOT_BLANK.sub(" ", stretch)
    if part is _Stretch.COMMENT:
        return stretch.replace("-", stand_ins[ord("-")])
    return _LONE.sub(stand_ins[ord("&")], stretch).replace("<", stand_ins[ord("<")])


class _TagWalk:
    """A way through a text from tag to tag, until one cannot be understood."""

    def __init__(self, text: str) -> None:
        self._text = text
        self._has_root = False
        self._opened: list[str] = []
        # Where an element begins that is not in the root.
        self._beside = -1

    def stretches(self) -> Iterator[tuple[int, int, _Stretch]]:
        """Yield the places of texts, values and comments, and of what is not in the root."""
        offset = 0
        while (tag := self._text.find("<", offset)) >= 0:
            if self._beside < 0:
                yield offset, tag, self._part()
            found: list[tuple[int, int, _Stretch]] = []
            offset = self._behind_tag(tag, found)
            yield from found if self._beside < 0 else ()
            if not offset:
                return
            if self._beside >= 0 and not self._opened:
                yield self._beside, offset, _Stretch.BESIDE_ROOT
                self._beside = -1

    def _part(self) -> _Stretch:
        if not self._has_root:
            return _Stretch.BEFORE_ROOT
        return _Stretch.CONTENT if self._opened else _Stretch.BESIDE_ROOT

    def _behind_tag(self, tag: int, found: list[tuple[int, int, _Stretch]]) -> int:
        """Add what is found in a tag, and return its end; 0 if it makes no sense."""
        text = self._text
        if text.startswith("<!--", tag):
            end = _behind(text, "-->", tag + len("<!--"))
            found += [(tag + len("<!--"), end - len("-->"), _Stretch.COMMENT)] if end else []
            return end
        if text.startswith("<![CDATA[", tag):
            end = _behind(text, "]]>", tag)
            found += [(tag, end, _Stretch.BESIDE_ROOT)] if end and not self._opened else []
            return end
        if text.startswith("<?", tag):
            return _behind(text, "?>", tag)
        if text.startswith("</", tag):
            end = _behind(text, ">", tag)
            closes = self._opened and text[tag + len("</") : max(end - 1, 0)].rstrip() == self._opened.pop()
            return end if closes else 0
        return self._behind_start(tag, found)

    def _behind_start(self, tag: int, found: list[tuple[int, int, _Stretch]]) -> int:
        if self._has_root and not self._opened:
            self._beside = tag
        self._has_root = True
        end, name = _values(self._text, tag, found), NAME.match(self._text, tag)
        if name is not None and end and not self._text.endswith("/>", tag, end):
            self._opened.append(name[0].removeprefix("<"))
        return end


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
    return Diagnostic("loose-xml", message, source, span, hint=hint)


def _stray_text(source: Source, start: int, end: int) -> Diagnostic:
    message = f"text is not allowed before the root: {_TOLD_PASSED}"
    hint, span = "put it in a comment, or delete it", source.span(start, end)
    return Diagnostic("stray-text", message, source, span, hint=hint)


def _beside_root(source: Source, start: int, end: int) -> Diagnostic:
    line = _LINE.match(source.text, start, end)
    message = f"a file is one <root>, and this is none of it: {_TOLD_PASSED}"
    hint, span = "delete it, or put it into the <root>", source.span(start, line.end() if line else end)
    return Diagnostic("stray-text", message, source, span, hint=hint)


_TELLING = {_Stretch.BEFORE_ROOT: _stray_text, _Stretch.BESIDE_ROOT: _beside_root}


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
    return Diagnostic("loose-xml", message, source, span, suggestion, hint)
