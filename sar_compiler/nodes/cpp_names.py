"""Normalised names of C++ types."""

import functools
import re

TEXT = "std::string"
ANY = "BT::Any"
STATUS = "BT::NodeStatus"
REAL = "double"
INT = "int"
LONG = "int64_t"
UNSIGNED_INT = "unsigned int"
_ALIASES = {
    "AnyTypeAllowed": "",
    "BT::AnyTypeAllowed": "",
    "void": "",
    "Any": ANY,
    "NodeStatus": STATUS,
    "string": TEXT,
    "int32_t": INT,
    "uint32_t": UNSIGNED_INT,
    "size_t": "uint64_t",
}
_NORMAL = frozenset({"", "bool", TEXT, ANY, STATUS, REAL, INT, LONG, UNSIGNED_INT})
"""Type names that are already in normal form, as most type names are."""
_STD = r"\bstd::(?=(?:u?int\d+_t|size_t)\b)"
_TEXT_IN_FULL = r"std::basic_string<char(?:,std::char_traits<char>)?(?:,std::allocator<char>)?>"
_ALLOCATOR = r",std::allocator<[^<>]*(?:<[^<>]*>[^<>]*)*>"
_WORD = r"\b(?:unsigned|signed|char|short|int|long)\b"
_INTEGER_WORDS = rf"{_WORD}(?: {_WORD})*"


@functools.lru_cache(maxsize=1024)
def normalize(name: str) -> str:
    """Return the normal form of a C++ type name; empty for the type of ports that accept any value.

    Aliases and compiler-specific spellings have the same normal form. For example, `uint32_t` becomes `unsigned int`, and
    `std::__cxx11::basic_string<char, ...>` becomes `std::string`.
    """
    if name in _NORMAL:
        return name
    text = re.sub(r"\b(?:class|struct|enum) ", "", " ".join(name.split()))
    text = re.sub(r" ?([<>,*&:]) ?", r"\1", text).replace("std::__cxx11::", "std::").removeprefix("::")
    text = re.sub(_TEXT_IN_FULL, TEXT, re.sub(r"_<std::allocator<void>>", "", text))
    while (shorter := re.sub(_ALLOCATOR, "", text)) != text:
        text = shorter
    text = re.sub(_INTEGER_WORDS, _integer, re.sub(_STD, "", text))
    text = re.sub(r"(?<![\w:])(?:u?int32_t|size_t|string)(?![\w:])", lambda match: _ALIASES[match[0]], text)
    return _ALIASES.get(text, text)


def _integer(match: "re.Match[str]") -> str:
    """Return the normal form of an integer type that is written in words, such as `unsigned long`."""
    words = match[0].split()
    sign = "u" if "unsigned" in words else ""
    if "char" in words:
        return f"{sign}int8_t" if len(words) > 1 else "char"
    if "short" in words:
        return f"{sign}int16_t"
    if words.count("long") > 1:
        return "unsigned long long" if sign else "long long"
    if "long" in words:
        return f"{sign}int64_t"
    return UNSIGNED_INT if sign else INT
