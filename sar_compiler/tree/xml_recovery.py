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
from xml.parsers import expat

from sar_compiler.tree.diagnostic import Diagnostic, Source
from sar_compiler.tree.model import TreeFile

REFERENCE = r"&(?:amp|lt|gt|apos|quot|#[0-9]+|#x[0-9a-fA-F]+);"
"""A regular expression of what is read as another character."""
NAME = re.compile(r"<[^\s/>]+")
"""That of the beginning of a tag."""
ATTRIBUTE = re.compile(r"""\s*([^\s=/>]+)\s*=\s*(["'])(.*?)\2""", re.DOTALL)
"""That of an attribute with the blanks before it: its name, its quotation mark, its value."""
TAG_END = re.compile(r"\s*/?>")
"""That of the end of a start tag, with the blanks before it."""
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


class _PartOfFile(Enum):
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


def attributes_end(text: str, offset: int, limit: int = sys.maxsize) -> int:
    """Return where the attributes of a tag end that begin at an offset, behind its name; those before a limit count."""
    while match := ATTRIBUTE.match(text, offset, limit):
        offset = match.end()
    return offset


def recover(source: Source) -> Recovered | None:
    """Return a text with stand-ins up to the first place that is beyond recovery; None if there is nothing to recover."""
    stand_ins = _stand_ins(source.text)
    if stand_ins is None:
        return None
    text, parts, done = source.text, [], 0
    findings: list[Diagnostic] = []
    if declaration := _LATE_DECLARATION.match(text):
        parts, done = [_NOT_BLANK.sub(" ", declaration[0])], declaration.end()
        message = f"an XML declaration must be at the very beginning of a file: {_TOLD}"
        span, hint = source.span(*declaration.span(1)), "delete the blanks and lines before it"
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
    return Recovered("".join([*parts, text[done:]]), originals, tuple(findings))


def readable(tree_file: TreeFile) -> str:
    """Return the text of a file that was read, with stand-ins where it was recovered."""
    recovered = recover(tree_file.source) if tree_file.findings else None
    return recovered.text if recovered is not None else tree_file.source.text


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


def _replace(stretch: str, stand_ins: dict[int, str], part: _PartOfFile) -> str:
    if part in _PASSED:
        return _NOT_BLANK.sub(" ", stretch)
    if part is _PartOfFile.COMMENT:
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

    def stretches(self) -> Iterator[tuple[int, int, _PartOfFile]]:
        """Yield the places of texts, values and comments, and of what is not in the root."""
        offset = 0
        while (tag := self._text.find("<", offset)) >= 0:
            if self._beside < 0:
                yield offset, tag, self._part()
            found: list[tuple[int, int, _PartOfFile]] = []
            offset = self._behind_tag(tag, found)
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

    def _behind_tag(self, tag: int, found: list[tuple[int, int, _PartOfFile]]) -> int:
        """Add what is found in a tag, and return its end; 0 if it makes no sense."""
        text = self._text
        if text.startswith("<!--", tag):
            end = _behind(text, "-->", tag + len("<!--"))
            found += [(tag + len("<!--"), end - len("-->"), _PartOfFile.COMMENT)] if end else []
            return end
        if text.startswith("<![CDATA[", tag):
            end = _behind(text, "]]>", tag)
            found += [(tag, end, _PartOfFile.BESIDE_ROOT)] if end and not self._opened else []
            return end
        if text.startswith("<?", tag):
            return _behind(text, "?>", tag)
        if text.startswith("</", tag):
            end = _behind(text, ">", tag)
            closes = self._opened and text[tag + len("</") : max(end - 1, 0)].rstrip() == self._opened.pop()
            return end if closes else 0
        return self._behind_start(tag, found)

    def _behind_start(self, tag: int, found: list[tuple[int, int, _PartOfFile]]) -> int:
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


def _values(text: str, tag: int, values: list[tuple[int, int, _PartOfFile]]) -> int:
    """Add the places of a start tag's values, and return its end; 0, and none, if it makes no sense."""
    name = None if text.startswith("<!", tag) else NAME.match(text, tag)
    if name is None:
        return 0
    offset = name.end()
    while match := ATTRIBUTE.match(text, offset):
        values.append((*match.span(3), _PartOfFile.CONTENT))
        offset = match.end()
    end = TAG_END.match(text, offset)
    if end is None:
        # A value that lacks its quotation mark may have ended with another's.
        values[:] = [each for each in values if "<" not in text[each[0] : each[1]]]
        return 0
    return end.end()


_PASSED = {
    _PartOfFile.BEFORE_ROOT: ("text is not allowed before the root", "put it in a comment, or delete it"),
    _PartOfFile.BESIDE_ROOT: (
        "a file is one <root>, and this is none of it",
        "delete it, or put it into the <root>",
    ),
}
"""What is wrong with what BehaviorTree.CPP passes over, and what to do."""


def _recovery(source: Source, start: int, end: int, part: _PartOfFile) -> Diagnostic:
    """Return the finding about something that is not XML."""
    if part not in _PASSED:
        return _loose(source, start, end)
    what, hint = _PASSED[part]
    line = _LINE.match(source.text, start, end)
    message, span = f"{what}: {_TOLD_PASSED}", source.span(start, line.end() if line else end)
    return Diagnostic("stray-text", message, source, span, hint=hint)


def _loose(source: Source, start: int, end: int) -> Diagnostic:
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
    return Diagnostic("loose-xml", message, source, source.span(start, end), suggestion, hint)


_AMPERSANDS = re.compile(r"(&+)[^&;<>\"'\s]*\Z")
_UNSEEN = re.compile(r"[\u00ad\u180e\u200b-\u200f\u2060\ufeff]|[^\S \t\r\n]")
"""A character that nobody sees, or that looks like a blank and is none."""
_NEAR = 200
"""How far before a place an ampersand is looked for."""
_ENTITY = re.compile(r"&([^#&;\s][^&;\s]*);")
_BUILT_IN = frozenset(("amp", "lt", "gt", "apos", "quot"))
_ATTRIBUTE_NAME = re.compile(r"[^\s=/>\"'<]+")
_VALUELESS = re.compile(rf"\s+({_ATTRIBUTE_NAME.pattern})\s*")
_OPENED = re.compile(rf"\s*{_ATTRIBUTE_NAME.pattern}\s*=\s*([\"'])")
_OPEN_VALUE = re.compile(r"=\s*(\"[^\"<]*|'[^'<]*)\Z")


class XmlMistake(NamedTuple):
    """A mistake in a file that is not well-formed.

    Attributes:
        message: What is wrong.
        start: The offset of the first character that is.
        end: The offset after the last one.
        suggestion: What to write there.
        hint: What to do, where there is no such text.
    """

    message: str
    start: int
    end: int
    suggestion: str | None = None
    hint: str | None = None


def mistake_at(text: str, place: int, words: str) -> XmlMistake | None:
    """Return the probable mistake at the place where expat gave up.

    Returns:
        None if expat's words are all there is to say.
    """
    by_words = {
        expat.errors.XML_ERROR_UNDEFINED_ENTITY: _undefined,
        expat.errors.XML_ERROR_DUPLICATE_ATTRIBUTE: _twice,
        expat.errors.XML_ERROR_UNCLOSED_TOKEN: _unclosed,
        expat.errors.XML_ERROR_INVALID_TOKEN: _invalid,
    }
    return by_words[words](text, place) if words in by_words else None


def _invalid(text: str, place: int) -> XmlMistake | None:
    if place < len(text) and text[place] < " " and not text[place].isspace():
        message = f"the character U+{ord(text[place]):04X} is not allowed in XML"
        return XmlMistake(message, place, place + 1, hint="delete it")
    if text.rfind("<!--", 0, place) > text.rfind("-->", 0, place):
        return _in_comment(text, place)
    if _UNSEEN.match(text, place):
        return _unseen(text, place)
    return _out_of_place(text, place) or _in_tag(text, place)


def _unseen(text: str, place: int) -> XmlMistake:
    what = "looks like a blank and is none for XML" if text[place].isspace() else "is here, which nobody sees"
    hint = "write a blank in its place" if text[place].isspace() else "delete it"
    import unicodedata

    name = unicodedata.name(text[place], "").lower()
    return XmlMistake(f"the character U+{ord(text[place]):04X} ({name}) {what}", place, place + 1, hint=hint)


def _in_comment(text: str, place: int) -> XmlMistake:
    start = text.rfind("--", 0, place)
    return XmlMistake("-- is not allowed in a comment of XML", start, start + len("--"), "- -")


def _out_of_place(text: str, place: int) -> XmlMistake | None:
    before = text[max(text.rfind("<", 0, place), 0) : place]
    if before.startswith("</") and ">" in before:
        hint = "put it in a comment, or delete it"
        return XmlMistake("text is not allowed behind the root", place, place + 1, hint=hint)
    if text[place : place + 1] in (",", ";"):
        message = f"no {text[place]} stands between the attributes of a tag"
        return XmlMistake(message, place, place + 1, hint="write a blank in its place")
    return None


def _in_tag(text: str, place: int) -> XmlMistake | None:
    tag = max(text.rfind("<", 0, place), 0)
    before = text[tag:place]
    near = max(tag, place - _NEAR)
    ampersands = _AMPERSANDS.search(text[near:place])
    if ampersands is not None:
        start = near + ampersands.start()
        end = start + len(ampersands[1])
        end += text[end : end + 1] == "&"
        return XmlMistake("an & is written &amp; in XML", start, end, "&amp;" * (end - start))
    value = _OPEN_VALUE.search(before)
    if text[place : place + 1] == "<" and value is not None:
        return _in_value(text, place, tag + value.start(1))
    if before.rstrip().endswith("="):
        return XmlMistake("the value of an attribute must be in quotes", place, place + 1)
    if text.startswith("<!--", place):
        hint = "put it before or behind the tag"
        return XmlMistake("a comment is not allowed in a tag", place, place + len("<!--"), hint=hint)
    return _in_attributes(text, tag, place)


def _in_attributes(text: str, tag: int, place: int) -> XmlMistake | None:
    """Return the mistake behind the last attribute that is complete."""
    name = NAME.match(text, tag)
    if name is None:
        message = "a tag's name follows its < directly, and a < in a text is written &lt;"
        return XmlMistake(message, tag, place + 1) if text.startswith("<", tag) else None
    end = attributes_end(text, name.end(), place)
    valueless = _VALUELESS.fullmatch(text, end, place)
    if valueless is not None:
        message, written = f"the attribute '{valueless[1]}' has no value", valueless[1]
        return XmlMistake(message, *valueless.span(1), hint=f'write {written}="..."')
    if text.startswith("<", place):
        return XmlMistake("the tag that begins here has no >", tag, name.end())
    if end == place and text[place - 1] in "\"'":
        message = "a blank is missing before this, or there is a quotation mark too many before it"
        return XmlMistake(message, place, place + 1)
    return None


def _twice(text: str, place: int) -> XmlMistake | None:
    name = _ATTRIBUTE_NAME.match(text, place)
    if name is None:
        return None
    message = f"the attribute '{name[0]}' is given twice in this tag"
    return XmlMistake(message, *name.span(), hint="delete one of the two")


def _unclosed(text: str, place: int) -> XmlMistake | None:
    """Return what has no end in the whole file."""
    if text.startswith("<!--", place):
        return XmlMistake(
            "the comment that begins here has no -->", place, place + len("<!--"), hint="write --> behind it"
        )
    name = NAME.match(text, place)
    if name is None:
        return None
    quote = _OPENED.match(text, attributes_end(text, name.end()))
    if quote is not None:
        return XmlMistake("the value that begins here has no closing quotation mark", *quote.span(1))
    return XmlMistake("the tag that begins here has no >", place, name.end())


def _in_value(text: str, place: int, quote: int) -> XmlMistake:
    """Return the mistake of a < in a value: unescaped, or after a missing closing quote."""
    value = text[quote:place].rstrip(" \t")
    if value.rstrip().endswith((">", "/")) or value.endswith("\n") or text.startswith("</", place):
        return XmlMistake("the value that begins here has no closing quotation mark", quote, quote + 1)
    return XmlMistake("a < in a value is written &lt; in XML", place, place + 1, "&lt;")


def _undefined(text: str, place: int) -> XmlMistake | None:
    for entity in _ENTITY.finditer(text, place):
        if entity[1] not in _BUILT_IN:
            message = (
                f"XML does not know '{entity[0]}'; an & is written &amp;, other characters as themselves"
            )
            return XmlMistake(message, entity.start(), entity.end())
    return None
