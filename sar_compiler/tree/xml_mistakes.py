"""Characters that XML does not allow at their place, with what to write instead."""

import re
from dataclasses import dataclass
from xml.parsers import expat

_AMPERSANDS = re.compile(r"(&+)[^&;<>\"'\s]*\Z")
_ENTITY = re.compile(r"&([^#&;\s][^&;\s]*);")
_BUILT_IN = frozenset(("amp", "lt", "gt", "apos", "quot"))
_OPEN_VALUE = re.compile(r"=\s*(\"[^\"<]*|'[^'<]*)\Z")


@dataclass(frozen=True)
class XmlMistake:
    """A mistake in a file that is not well-formed.

    Attributes:
        message: What is wrong.
        start: The offset of the first character that is.
        end: The offset after the last one.
        suggestion: What to write there.
    """

    message: str
    start: int
    end: int
    suggestion: str | None = None


def mistake_at(text: str, place: int, words: str) -> XmlMistake | None:
    """Return the probable mistake at the place where expat gave up.

    Returns:
        None if expat's words are all there is to say.
    """
    if words == expat.errors.XML_ERROR_UNDEFINED_ENTITY:
        return _undefined(text, place)
    if words != expat.errors.XML_ERROR_INVALID_TOKEN:
        return None
    if text.rfind("<!--", 0, place) > text.rfind("-->", 0, place):
        return _in_comment(text, place)
    return _in_tag(text, place)


def _in_comment(text: str, place: int) -> XmlMistake:
    start = text.rfind("--", 0, place)
    return XmlMistake("-- cannot stand in a comment of XML", start, start + len("--"), "- -")


def _in_tag(text: str, place: int) -> XmlMistake | None:
    tag = max(text.rfind("<", 0, place), 0)
    before = text[tag:place]
    ampersands = _AMPERSANDS.search(before)
    if ampersands is not None:
        start = tag + ampersands.start()
        end = start + len(ampersands[1])
        end += text[end : end + 1] == "&"
        return XmlMistake("an & is written &amp; in XML", start, end, "&amp;" * (end - start))
    value = _OPEN_VALUE.search(before)
    if text[place : place + 1] == "<" and value is not None:
        return _in_value(text, place, tag + value.start(1))
    if before.rstrip().endswith("="):
        return XmlMistake("the value of an attribute must stand in quotes", place, place + 1)
    return None


def _in_value(text: str, place: int, quote: int) -> XmlMistake:
    """Return the mistake of a < in a value: unescaped, or after a missing closing quote."""
    if text[quote:place].rstrip().endswith((">", "/")):
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
