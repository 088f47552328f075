"""How the text of an attribute becomes a typed value, with nothing left over."""

import difflib
import enum
import math
import re
import types
import typing
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from datetime import timedelta
from pathlib import Path
from typing import TypeGuard

# No number that a robot needs has more digits.
_LONGEST_INTEGER = 100
_INTEGER = r"[+\-]?[0-9]+"
_REAL = r"[+\-]?([0-9]+(\.[0-9]*)?|\.[0-9]+)([eE][+\-]?[0-9]+)?"
_DURATION = r"([0-9]+(\.[0-9]*)?|\.[0-9]+)(ms|s|min)?"
_SECONDS_PER_UNIT = {"ms": 0.001, "s": 1.0, "min": 60.0}

# What BehaviorTree.CPP reads as a bool.
_BOOLS = {
    "true": True,
    "false": False,
    "True": True,
    "False": False,
    "TRUE": True,
    "FALSE": False,
    "1": True,
    "0": False,
}


class ConversionError(ValueError):
    """A text is not a value of the wanted type.

    Args:
        message: What is wrong, in the words of the person who wrote the text.
        suggestion: What to write instead, where that can be guessed.
    """

    def __init__(self, message: str, suggestion: str | None = None) -> None:
        super().__init__(message)
        self.message = message
        self.suggestion = suggestion


@dataclass(frozen=True)
class ValueType:
    """A type that an attribute can have.

    Attributes:
        name: Its name in a schema.
        label: Its name in a sentence, with its article: `a whole number`.
        convert: Makes the value of a text or raises `ConversionError`.
        pattern: A regular expression (as XSD and JSON Schema both read it) of its texts; empty: any.
        choices: All its texts, where they can be listed.
    """

    name: str
    label: str
    convert: Callable[[str], object]
    pattern: str = ""
    choices: tuple[str, ...] = ()


def nearest(word: str, known: Iterable[str]) -> str | None:
    """Return the known word that was probably meant, or None."""
    candidates = list(known)
    by_case = [candidate for candidate in candidates if candidate.lower() == word.lower()]
    found = by_case or difflib.get_close_matches(word, candidates, n=1, cutoff=0.6)
    return found[0] if found else None


def blackboard_key(text: str) -> str | None:
    """Return the key that a text such as `{goal}` refers to; None if the text is a literal."""
    stripped = text.strip(" ")
    if len(stripped) > len("{}") and stripped.startswith("{") and stripped.endswith("}"):
        return stripped[1:-1]
    return None


def value_type_of(annotation: object) -> ValueType | None:
    """Return how values of an annotated constructor parameter are written.

    Args:
        annotation: The resolved annotation; `Optional[T]` counts as `T`.

    Returns:
        The type, or None if no text can become such a value.
    """
    annotation = without_none(annotation)
    if is_class(annotation) and annotation in _PLAIN:
        return _PLAIN[annotation]
    if is_class(annotation) and issubclass(annotation, enum.Enum):
        return _choice(annotation.__name__, {member.name: member for member in annotation})
    if typing.get_origin(annotation) is typing.Literal:
        literals = typing.get_args(annotation)
        if all(isinstance(literal, str) for literal in literals):
            return _choice(".".join(("one_of", *literals)), {literal: literal for literal in literals})
    return None


def is_class(annotation: object) -> TypeGuard[type]:
    """Say whether an annotation is a plain class (Python 3.10 takes `dict[str, int]` for one)."""
    return isinstance(annotation, type) and typing.get_origin(annotation) is None


def without_none(annotation: object) -> object:
    """Return `T` for `T | None`, anything else as it is."""
    if typing.get_origin(annotation) in (typing.Union, types.UnionType):
        members = [member for member in typing.get_args(annotation) if member is not type(None)]
        if len(members) == 1:
            return members[0]
    return annotation


def _boolean(text: str) -> bool:
    try:
        return _BOOLS[text]
    except KeyError:
        message = f"'{text}' is neither true nor false"
        raise ConversionError(message, nearest(text.strip(), ("true", "false"))) from None


def _integer(text: str) -> int:
    if re.fullmatch(_INTEGER, text):
        if len(text) > _LONGEST_INTEGER:
            message = f"a whole number of {len(text)} digits is too large"
            raise ConversionError(message)
        return int(text)
    message = f"'{text}' is not a whole number"
    raise ConversionError(message, _leading(_INTEGER, text))


def _real(text: str) -> float:
    if not re.fullmatch(_REAL, text):
        message = f"'{text}' is not a number"
        raise ConversionError(message, _leading(_REAL, text))
    value = float(text)
    if not math.isfinite(value):
        message = f"'{text}' is too large for a number"
        raise ConversionError(message)
    return value


def _duration(text: str) -> timedelta:
    match = re.fullmatch(_DURATION, text)
    if not match:
        message = f"'{text}' is not a duration (seconds, or a number with ms, s or min)"
        raise ConversionError(message, _leading(_DURATION, text))
    unit = match.group(3) or "s"
    try:
        return timedelta(seconds=float(text.removesuffix(match.group(3) or "")) * _SECONDS_PER_UNIT[unit])
    except OverflowError:
        message = f"'{text}' is too long for a duration"
        raise ConversionError(message) from None


def _leading(pattern: str, text: str) -> str | None:
    """Return the part of a text with something left over that would be a value ("12abc": 12)."""
    match = re.match(pattern, text.strip())
    return match.group(0) if match else None


def _choice(name: str, members: dict[str, object]) -> ValueType:
    names = tuple(members)

    def convert(text: str) -> object:
        try:
            return members[text]
        except KeyError:
            message = f"'{text}' is not one of {', '.join(names)}"
            raise ConversionError(message, nearest(text.strip(), names)) from None

    return ValueType(name, f"one of {', '.join(names)}", convert, choices=names)


_PLAIN: dict[type, ValueType] = {
    bool: ValueType("boolean", "true or false", _boolean, choices=tuple(_BOOLS)),
    int: ValueType("integer", "a whole number", _integer, pattern=_INTEGER),
    float: ValueType("number", "a number", _real, pattern=_REAL),
    str: ValueType("string", "a text", str),
    Path: ValueType("path", "a path", Path),
    timedelta: ValueType("duration", "a duration", _duration, pattern=_DURATION),
}
