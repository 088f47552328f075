"""Explanations of errors in malformed XML. This module is imported only if a file is malformed."""

import re
from typing import NamedTuple
from xml.parsers import expat

from sar_compiler.tree.xml_recovery import NAME, UNDEFINED_ENTITY_HINT, attributes_end

_AMPERSANDS = re.compile(r"(&+)[^&;<>\"'\s]*\Z")
_UNSEEN = re.compile(r"[\u00ad\u180e\u200b-\u200f\u2060\ufeff]|[^\S \t\r\n]")
"""A regular expression for a character that is invisible or looks like a space."""
_NEAR = 200
"""The number of characters before an error that are searched for an ampersand."""
_ENTITY = re.compile(r"&([^#&;\s][^&;\s]*);")
_BUILT_IN = frozenset(("amp", "lt", "gt", "apos", "quot"))
_ATTRIBUTE_NAME = re.compile(r"[^\s=/>\"'<]+")
_VALUELESS = re.compile(rf"\s+({_ATTRIBUTE_NAME.pattern})\s*")
_OPENED = re.compile(rf"\s*{_ATTRIBUTE_NAME.pattern}\s*=\s*([\"'])")
_OPEN_VALUE = re.compile(r"=\s*(\"[^\"<]*|'[^'<]*)\Z")


class XmlFault(NamedTuple):
    """An error in an XML file that is not well-formed.

    Attributes:
        message: The description of the error.
        start: The offset of the first wrong character.
        end: The offset after the last wrong character.
        suggestion: The replacement text.
        hint: A short instruction, if there is no replacement text.
    """

    message: str
    start: int
    end: int
    suggestion: str | None = None
    hint: str | None = None


def find_xml_fault(text: str, place: int, words: str) -> XmlFault | None:
    """Return the probable error, given the position at which expat has stopped.

    Returns:
        The error; None if expat's message is sufficient.
    """
    by_words = {
        expat.errors.XML_ERROR_UNDEFINED_ENTITY: _find_undefined_entity,
        expat.errors.XML_ERROR_DUPLICATE_ATTRIBUTE: _find_duplicate_attribute,
        expat.errors.XML_ERROR_UNCLOSED_TOKEN: _find_unclosed,
        expat.errors.XML_ERROR_INVALID_TOKEN: _invalid,
    }
    return by_words[words](text, place) if words in by_words else None


def _invalid(text: str, place: int) -> XmlFault | None:
    if place < len(text) and text[place] < " " and not text[place].isspace():
        message = f"the character U+{ord(text[place]):04X} is not allowed in XML"
        return XmlFault(message, place, place + 1, hint="delete it")
    if text.rfind("<!--", 0, place) > text.rfind("-->", 0, place):
        return _comment_error(text, place)
    if _UNSEEN.match(text, place):
        return _invisible_character(text, place)
    return _out_of_place(text, place) or _tag_error(text, place)


def _invisible_character(text: str, place: int) -> XmlFault:
    is_space = text[place].isspace()
    what = "looks like a space, but XML does not treat it as a space" if is_space else "is invisible"
    hint = "replace it by a space" if is_space else "delete it"
    import unicodedata

    name = unicodedata.name(text[place], "").lower()
    return XmlFault(f"the character U+{ord(text[place]):04X} ({name}) {what}", place, place + 1, hint=hint)


def _comment_error(text: str, place: int) -> XmlFault:
    start = text.rfind("--", 0, place)
    return XmlFault("-- is not allowed in an XML comment", start, start + len("--"), "- -")


def _out_of_place(text: str, place: int) -> XmlFault | None:
    before = text[max(text.rfind("<", 0, place), 0) : place]
    if before.startswith("</") and ">" in before:
        hint = "put it in a comment, or delete it"
        return XmlFault("text is not allowed after </root>", place, place + 1, hint=hint)
    if text[place : place + 1] in (",", ";"):
        message = f"a {text[place]} is not allowed between the attributes of a tag"
        return XmlFault(message, place, place + 1, hint="replace it by a space")
    return None


def _tag_error(text: str, place: int) -> XmlFault | None:
    tag = max(text.rfind("<", 0, place), 0)
    before = text[tag:place]
    near = max(tag, place - _NEAR)
    ampersands = _AMPERSANDS.search(text[near:place])
    if ampersands is not None:
        start = near + ampersands.start()
        end = start + len(ampersands[1])
        end += text[end : end + 1] == "&"
        return XmlFault("a literal & must be written as &amp; in XML", start, end, "&amp;" * (end - start))
    value = _OPEN_VALUE.search(before)
    if text[place : place + 1] == "<" and value is not None:
        return _value_error(text, place, tag + value.start(1))
    if before.rstrip().endswith("="):
        return XmlFault("the value of an attribute must be in quotes", place, place + 1)
    if text.startswith("<!--", place):
        hint = "move the comment before or after the tag"
        return XmlFault("a comment is not allowed in a tag", place, place + len("<!--"), hint=hint)
    return _attribute_error(text, tag, place)


def _attribute_error(text: str, tag: int, place: int) -> XmlFault | None:
    """Return the error that follows the last complete attribute of a tag."""
    name = NAME.match(text, tag)
    if name is None:
        message = "a tag's name must directly follow the <, and a literal < must be written as &lt;"
        return XmlFault(message, tag, place + 1) if text.startswith("<", tag) else None
    end = attributes_end(text, name.end(), place)
    valueless = _VALUELESS.fullmatch(text, end, place)
    if valueless is not None:
        message, written = f"the attribute '{valueless[1]}' has no value", valueless[1]
        return XmlFault(message, *valueless.span(1), hint=f'write {written}="..."')
    if text.startswith("<", place):
        return XmlFault("the tag that begins here has no >", tag, name.end())
    if end == place and text[place - 1] in "\"'":
        message = "a space is missing before this character, or the quotation mark before it is not needed"
        return XmlFault(message, place, place + 1)
    return None


def _find_duplicate_attribute(text: str, place: int) -> XmlFault | None:
    name = _ATTRIBUTE_NAME.match(text, place)
    if name is None:
        return None
    message = f"the attribute '{name[0]}' is given twice in this tag"
    return XmlFault(message, *name.span(), hint="delete one of the two")


def _find_unclosed(text: str, place: int) -> XmlFault | None:
    """Return the error about a comment, a value or a tag without an end."""
    if text.startswith("<!--", place):
        return XmlFault(
            "the comment that begins here has no -->", place, place + len("<!--"), hint="write --> after it"
        )
    name = NAME.match(text, place)
    if name is None:
        return None
    quote = _OPENED.match(text, attributes_end(text, name.end()))
    if quote is not None:
        return XmlFault("the value that begins here has no closing quotation mark", *quote.span(1))
    return XmlFault("the tag that begins here has no >", place, name.end())


def _value_error(text: str, place: int, quote: int) -> XmlFault:
    """Return the error about a < in a value.

    Either the < is unescaped, or the closing quotation mark of the value is missing.
    """
    value = text[quote:place].rstrip(" \t")
    if value.rstrip().endswith((">", "/")) or value.endswith("\n") or text.startswith("</", place):
        return XmlFault("the value that begins here has no closing quotation mark", quote, quote + 1)
    return XmlFault("a literal < must be written as &lt; in a value", place, place + 1, "&lt;")


def _find_undefined_entity(text: str, place: int) -> XmlFault | None:
    for entity in _ENTITY.finditer(text, place):
        if entity[1] not in _BUILT_IN:
            message, hint = f"'{entity[0]}' is not an XML entity", UNDEFINED_ENTITY_HINT
            return XmlFault(message, entity.start(), entity.end(), hint=hint)
    return None
