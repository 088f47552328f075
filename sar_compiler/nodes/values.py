"""Conversion of attribute texts to typed values."""

import enum
import functools
import itertools
import json
import math
import re
import types
import typing
from collections.abc import Callable, Collection, Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from datetime import timedelta
from pathlib import Path
from typing import Annotated, NamedTuple, TypeAlias, TypeGuard, TypeVar

from sar_compiler.nodes.cpp_names import INT, LONG, STATUS, TEXT, UNSIGNED_INT, normalize
from sar_compiler.nodes.cpp_names import REAL as CPP_REAL
from sar_compiler.nodes.numbers import (
    DURATION,
    HOW_LONG,
    INTEGER,
    LONGEST,
    REAL,
    WITH_UNIT,
    PlausibleRange,
    intended_duration,
    intended_integer,
    intended_number,
    intended_plain_number,
    number_hint,
    parse_milliseconds,
)
from sar_compiler.runtime.expressions import Script
from sar_compiler.runtime.script import parse
from sar_compiler.runtime.tokens import ScriptError
from sar_compiler.tree.guessing import nearest

T = TypeVar("T")

_INT64 = range(-(2**63), 2**63)
# The format of std::from_chars for numbers without digits: upper or lower case, without a plus sign.
_NO_DIGITS = r"-?([iI][nN][fF]([iI][nN][iI][tT][yY])?|[nN][aA][nN])"
_NOT_BLANK = r"[\s\S]*\S[\s\S]*"
_SEPARATOR = ";"
_VECTOR = "std::vector<"
_JSON_LIST = r"json:\s*\[[\s\S]*\]\s*"
_NAME_OF_KEY = r"(?a) *@?[A-Za-z_]\w* *"
JSON = "json:"
"""The prefix of a text in JSON, in ports that accept any value."""
_LARGEST_UNSIGNED = 2**32 - 1
MOST_LISTED = 10
"""The maximum number of names that a message lists."""

TRUTH_VALUES = {
    "true": True,
    "false": False,
    "True": True,
    "False": False,
    "TRUE": True,
    "FALSE": False,
    "1": True,
    "0": False,
}
"""The words that BehaviorTree.CPP reads as a bool."""


@dataclass(eq=False)
class ConversionError(ValueError):
    """A text is not a value of the required type.

    Attributes:
        message: The description of the error, in the user's terms.
        suggestion: The replacement text, if it can be guessed.
        hint: A short instruction, if there is no replacement text.
        place: The start and end of the wrong part of the text; None for the whole text.
    """

    message: str
    suggestion: str | None = None
    hint: str | None = None
    place: tuple[int, int] | None = None

    def __str__(self) -> str:
        return self.message


class ValueType(NamedTuple):
    """The type of an attribute's values.

    Attributes:
        name: The name of the type in a schema.
        label: The name of the type in a sentence, with an article: `an integer`.
        convert: A function that converts a text to a value, or raises `ConversionError`.
        pattern: A regular expression for the valid texts, also valid in XSD and JSON Schema; empty if there is none.
        choices: All valid texts, if they can be listed.
        python: The Python type of the values; None for any type.
        cpp: The name of the type in a `TreeNodesModel`; empty for values of any type.
        least: The smallest value, for integers with a limit.
        most: The largest value, for integers with a limit.
        example: The text of an example value.
        names_key: Whether a value is the name of a key; `{goal}` is then equivalent to `goal`.
        keys_in: A function that returns the keys in a value such as message fields; None if values contain no keys.
        unit: The unit of plain numbers in a duration: `ms` or `s`.
        usual: The plausible numbers, if other numbers are valid as well.
        takes_braces: Whether a value may contain braces; a single name in braces is still a key.
    """

    name: str
    label: str
    convert: Callable[[str], object]
    pattern: str = ""
    choices: tuple[str, ...] = ()
    python: type | None = None
    cpp: str = ""
    least: int | None = None
    most: int | None = None
    example: str = "0"
    names_key: bool = False
    keys_in: Callable[[object], Iterable[str]] | None = None
    unit: str = ""
    usual: PlausibleRange | None = None
    takes_braces: bool = False

    def key_in(self, text: str, port: str) -> str | None:
        """Return the key to which a port's text refers; None if the text is a value. See `blackboard_key`."""
        key = blackboard_key(text, port)
        if key is not None and self.takes_braces and not re.fullmatch(_NAME_OF_KEY, key):
            return None
        return key

    @property
    def unchanged_type(self) -> type | None:
        """The type whose values `fit` returns unchanged; None if `fit` checks every value."""
        return self.python if self.least is None and self.most is None else None

    def fit(self, value: object) -> object:
        """Convert a value on the blackboard to this type.

        Strings and numbers are converted as if they were written in a tree file. An integer is accepted as a number,
        and a number as an integer if no precision is lost.

        Raises:
            ConversionError: If the value is invalid. The message contains the value.
        """
        fitted = self._as_python(value)
        if isinstance(fitted, int) and not self._is_in_range(fitted):
            raise ConversionError(f"{value!r} is not {self.label}")
        return fitted

    def _is_in_range(self, number: int) -> bool:
        return (self.least is None or self.least <= number) and (self.most is None or number <= self.most)

    def _as_python(self, value: object) -> object:
        if self.python is None or (isinstance(value, self.python) and not _is_odd_bool(value, self.python)):
            return value
        if isinstance(value, str):
            return self.convert(value)
        if isinstance(value, _NUMBERS):
            if self.python is str:
                # On the blackboard, true is 1.
                return as_text(int(value) if isinstance(value, bool) else value)
            if self.python not in _NUMBERS:
                whole = isinstance(value, float) and value.is_integer()
                return self.convert(as_text(int(value) if whole else value))
            if self.python is bool and isinstance(value, float) and not value < 0:
                return value != 0  # as C++ casts it
            with suppress(OverflowError, ValueError):  # infinity, or an integer that is too large for a float
                if value == self.python(value):
                    return self.python(value)
        raise ConversionError(f"{value!r} is not {self.label}")


def literal_value(text: str) -> int | float | str:
    """Convert a text that is passed to a subtree to a number. If it is not a number, return the text."""
    if text.startswith("+"):
        return text
    if re.fullmatch(_NO_DIGITS, text):
        return float(text)
    if re.fullmatch(INTEGER, text) and len(text) <= LONGEST and int(text) in _INT64:
        return int(text)
    if re.fullmatch(REAL, text) and math.isfinite(float(text)):
        return float(text)
    return text


def as_text(value: bool | float) -> str:
    """Convert a number to a string in the same way as BehaviorTree.CPP."""
    if isinstance(value, bool):
        return "true" if value else "false"
    return str(value) if isinstance(value, int) else f"{value:f}"


def _is_odd_bool(value: object, wanted: type) -> bool:
    """Return whether a value is a bool although another type is wanted. Python accepts bools as numbers."""
    return isinstance(value, bool) and wanted is not bool


def join_with_commas(words: Collection[str], count: int | None = None) -> str:
    """Return words separated by commas.

    If there are many words, return the first words and the number of other words.

    Args:
        words: All words, or the first `MOST_LISTED` words.
        count: The total number of words, if *words* does not contain all.
    """
    more = (len(words) if count is None else count) - MOST_LISTED
    shown = ", ".join(itertools.islice(words, MOST_LISTED))
    return f"{shown} and {more} more" if more > 0 else shown


def blackboard_key(text: str, port: str = "") -> str | None:
    """Return the key to which a text such as `{goal}` refers; None if the text is a literal.

    Args:
        text: The text.
        port: The name of the port that contains the text, to which `{=}` refers.
    """
    if "{" not in text:  # nearly all texts
        return port or None if text.strip(" ") == "=" else None
    stripped = text.strip(" ")
    if port and stripped == "{=}":
        return port
    if len(stripped) > len("{}") and stripped.startswith("{") and stripped.endswith("}"):
        return stripped[1:-1]
    return None


def value_type_of(annotation: object) -> ValueType | None:
    """Return the value type of an annotated constructor parameter.

    Args:
        annotation: The resolved annotation. `Optional[T]` is treated as `T`. `Annotated[T, value_type]` determines the type.

    Returns:
        The value type; None if a text cannot be converted to the annotated type.
    """
    annotation = strip_none(annotation)
    annotated = _annotated_type(annotation)
    if annotated is not None:
        return annotated
    if is_class(annotation) and annotation in _PLAIN:
        return _PLAIN[annotation]
    if typing.get_origin(annotation) is list:
        item = typing.get_args(annotation)[0]
        item_type = None if typing.get_origin(strip_none(item)) is list else value_type_of(item)
        return list_type(item_type) if item_type is not None else None
    if is_class(annotation) and issubclass(annotation, enum.Enum):
        members = {member.name: member for member in annotation}
        convert = functools.partial(_member, annotation)
        chosen = _choice(annotation.__name__, tuple(members), convert, _members_by_number(members))
        return chosen._replace(python=annotation)
    if typing.get_origin(annotation) is typing.Literal:
        literals = typing.get_args(annotation)
        if all(isinstance(literal, str) for literal in literals):
            return _choice(
                ".".join(("one_of", *literals)), literals, functools.partial(_choose_text, literals)
            )
    return None


def port_type_of(annotation: object) -> ValueType | None:
    """Return the value type of a port; None if a text cannot be converted to the annotated type."""
    value_type = value_type_of(annotation)
    return _OF_PORTS.get(value_type.name, value_type) if value_type is not None else None


def require_value_type(annotation: object) -> ValueType:
    """Return the value type of an annotation.

    Raises:
        TypeError: If a text cannot be converted to the annotated type.
    """
    value_type = value_type_of(annotation)
    if value_type is None:
        raise TypeError(annotation)
    return value_type


def type_of_cpp_name(name: str) -> ValueType | None:
    """Return the value type for a C++ type name in a `TreeNodesModel`; None for an unknown name."""
    name = normalize(name)
    if name.startswith(_VECTOR) and name.endswith(">"):
        item = _CPP_TYPES.get(name.removeprefix(_VECTOR).removesuffix(">"))
        return list_type(item) if item else None
    return _CPP_TYPES.get(name)


def port_type_of_cpp_name(name: str) -> ValueType:
    """Return the value type of a port that a model describes.

    A port whose type has an unknown name accepts any value.
    """
    return type_of_cpp_name(name) or ANYTHING._replace(cpp=normalize(name))


def is_class(annotation: object) -> TypeGuard[type]:
    """Return whether an annotation is a plain class.

    In Python 3.10, an annotation such as `dict[str, int]` is also an instance of `type`.
    """
    return isinstance(annotation, type) and typing.get_origin(annotation) is None


def _annotated_type(annotation: object) -> ValueType | None:
    if typing.get_origin(annotation) is not Annotated:
        return None
    return next((note for note in typing.get_args(annotation)[1:] if isinstance(note, ValueType)), None)


def strip_none(annotation: object) -> object:
    """Return `T` for the annotation `T | None`, and any other annotation unchanged.

    For `Annotated[T, ...]` without a `ValueType`, also return `T`.
    """
    if typing.get_origin(annotation) is Annotated and _annotated_type(annotation) is None:
        return strip_none(typing.get_args(annotation)[0])
    if typing.get_origin(annotation) in (typing.Union, types.UnionType):
        members = [member for member in typing.get_args(annotation) if member is not type(None)]
        if len(members) == 1:
            return strip_none(members[0])
    return annotation


def _boolean(text: str) -> bool:
    try:
        return TRUTH_VALUES[text]
    except KeyError:
        message = f"'{text}' is neither true nor false"
        raise ConversionError(message, nearest(text.strip(), ("true", "false"))) from None


def parse_integer(text: str, least: float = -math.inf, most: float = math.inf) -> int:
    """Parse an integer.

    Args:
        text: The text.
        least: The smallest number to suggest.
        most: The largest number to suggest.

    Raises:
        ConversionError: If the text is invalid.
    """
    if re.fullmatch(INTEGER, text):
        if len(text) > LONGEST:
            raise ConversionError(f"an integer of {len(text)} digits is too large")
        return int(text)
    message, meant = f"'{text}' is not an integer", intended_integer(text)
    fits = meant is not None and least <= int(meant) <= most
    raise ConversionError(message, meant if fits else None, number_hint(text))


def _parse_unsigned(text: str) -> int:
    value = parse_integer(text, 0, _LARGEST_UNSIGNED)
    if text.startswith("-") or value > _LARGEST_UNSIGNED:
        raise ConversionError(f"'{text}' is not {UNSIGNED.label}")
    return value


def at_least(least: int) -> ValueType:
    """Return the type of integers with a lower limit.

    Use the type in an annotation: `attempts: Annotated[int, at_least(1)]`.
    """
    label = f"an integer, {least} or more"
    return ValueType(
        f"integer.from.{least}",
        label,
        functools.partial(_parse_in_range, least, math.inf, label),
        pattern=INTEGER,
        python=int,
        cpp="int",
        least=least,
        example=str(least),
    )


def plausible_number(least: float, most: float = math.inf, *, is_open: bool = False) -> ValueType:
    """Return the type of numbers with a plausible range.

    Other numbers cause a warning before the run.

    Use the type in an annotation: `share: Annotated[float, plausible_number(0, 1)]`.

    Args:
        least: The smallest plausible number.
        most: The largest plausible number.
        is_open: Whether *least* itself is excluded.
    """
    return _PLAIN[float]._replace(usual=PlausibleRange(least, most, is_open))


def _sized_integer(cpp: str, bits: int, *, is_signed: bool = True) -> ValueType:
    """Return the type of C++ integers of a given size.

    BehaviorTree.CPP rejects integers that are outside the range of the type.
    """
    least, most = (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1) if is_signed else (0, 2**bits - 1)
    label = f"an integer from {least} to {most}"
    convert = functools.partial(_parse_in_range, least, most, label)
    return ValueType("integer", label, convert, pattern=INTEGER, python=int, cpp=cpp, least=least, most=most)


def _parse_in_range(least: float, most: float, label: str, text: str) -> int:
    value = parse_integer(text, least, most)
    if not least <= value <= most:
        raise ConversionError(f"'{text}' is not {label}")
    return value


def _up_to(largest: int) -> str:
    """Return a regular expression for the integers from 0 to *largest*, which must have several digits."""
    digits = str(largest)
    shorter = f"[0-9]{{1,{len(digits) - 1}}}"
    smaller = [
        f"{digits[:place]}[0-{int(digit) - 1}][0-9]{{{len(digits) - place - 1}}}"
        for place, digit in enumerate(digits)
        if digit != "0"
    ]
    return rf"\+?0*({'|'.join([shorter, *smaller, digits])})"


def parse_real(text: str) -> float:
    """Parse a finite number.

    Raises:
        ConversionError: If the text is not a number, or if the number is too large for a float.
    """
    if not re.fullmatch(REAL, text):
        raise ConversionError(f"'{text}' is not a number", intended_number(text), number_hint(text))
    value = float(text)
    if not math.isfinite(value):
        raise ConversionError(f"'{text}' is too large to be represented as a number")
    return value


def _any_real(text: str) -> float:
    return float(text) if re.fullmatch(_NO_DIGITS, text) else parse_real(text)


def _duration(text: str) -> timedelta:
    if not re.fullmatch(DURATION, text):
        raise _duration_error(text, SECONDS.label, intended_plain_number(text), _duration)
    try:
        return timedelta(seconds=_seconds(text))
    except OverflowError:
        raise ConversionError(f"'{text}' is too long for a duration") from None


def _seconds(text: str) -> float:
    if re.fullmatch(REAL, text):
        return parse_real(text)
    milliseconds = parse_milliseconds(text)
    if milliseconds is None:
        raise _duration_error(text, SECONDS.label, intended_number(text), _seconds)
    return float(milliseconds / 1000)


def _milliseconds(text: str) -> int:
    if re.fullmatch(INTEGER, text):
        return _parse_unsigned(text)
    milliseconds = parse_milliseconds(text)
    if milliseconds is None:
        raise _duration_error(text, MILLISECONDS.label, intended_integer(text), _milliseconds)
    if milliseconds % 1 or milliseconds > _LARGEST_UNSIGNED:
        raise ConversionError(f"'{text}' is not an integer of milliseconds from 0 to {_LARGEST_UNSIGNED}")
    return int(milliseconds)


def _duration_error(
    text: str, label: str, number: str | None, convert: Callable[[str], object]
) -> ConversionError:
    """Return the error for a text that is not a duration, together with a suggested duration or number."""
    label = label.removeprefix("a duration (").removesuffix(")")
    message, hint = f"'{text}' is not a duration ({label})", number_hint(text)
    ambiguous = hint is not None and "comma" in hint
    suggestion = intended_duration(text) or number
    if suggestion == text:
        suggestion = None
    if suggestion is not None:
        try:
            convert(suggestion)
        except ConversionError:  # out of range
            suggestion = None
    return ConversionError(message, suggestion, hint if ambiguous else HOW_LONG)


def _script(text: str, *, allow_empty: bool = True) -> object:
    try:
        return (_parse_any if allow_empty else _parse)(text)
    except ScriptError as error:
        raise ConversionError(str(error), error.suggestion, error.hint, (error.start, error.end)) from None


# A script from the blackboard is parsed in every tick.
_parse = functools.lru_cache(maxsize=256)(parse)
_parse_any = functools.lru_cache(maxsize=256)(functools.partial(parse, allow_empty=True))


def _choice(
    name: str, names: tuple[str, ...], convert: Callable[[str], object], numbers: Iterable[str] = ()
) -> ValueType:
    label = f"one of {', '.join(names)}"
    return ValueType(name, label, convert, choices=(*names, *numbers), python=str, cpp=TEXT, example=names[0])


def _choose_text(names: tuple[str, ...], text: str) -> str:
    if text in names:
        return text
    message = f"'{text}' is not one of {', '.join(names)}"
    raise ConversionError(message, nearest(text.strip(), names)) from None


def _member(kind: type[enum.Enum], text: str) -> enum.Enum:
    """Return the member of an enumeration that has a given name or integer value."""
    members, texts = _texts_of(kind)
    return texts[text] if text in texts else members[_choose_text(tuple(members), text)]


@functools.lru_cache(maxsize=64)
def _texts_of(kind: type[enum.Enum]) -> tuple[dict[str, enum.Enum], dict[str, enum.Enum]]:
    """Return two tables of an enumeration's members: one by name, and one by each accepted text."""
    members: dict[str, enum.Enum] = {member.name: member for member in kind}
    return members, {**_members_by_number(members), **members}


def _members_by_number(members: Mapping[str, enum.Enum]) -> dict[str, enum.Enum]:
    return {str(member.value): member for member in members.values() if isinstance(member.value, int)}


def list_type(item: ValueType) -> ValueType:
    """Return the type of lists whose items are separated by semicolons: `1;2;3`."""
    pattern = f"(({item.pattern})(;({item.pattern}))*)?" if item.pattern else ""
    article, _, noun = item.label.partition(" ")
    label = (
        f"{noun}s separated by ;"
        if article in ("a", "an")
        else f"several values separated by ;, each {item.label}"
    )
    cpp = f"std::vector<{item.cpp}>"
    if pattern:
        pattern = f"{pattern}|{_JSON_LIST}"
    convert = functools.partial(_list, item, label)
    return ValueType(f"{item.name}.list", label, convert, pattern=pattern, python=list, cpp=cpp)


def _list(item: ValueType, label: str, text: str) -> list[object]:
    """Parse items separated by semicolons, or a JSON list.

    BehaviorTree.CPP accepts JSON lists for some types.
    """
    if not text.startswith(JSON):
        return items_of(text, item.convert)
    items = _parse_any_value(text)
    are_texts = item.python is str
    if not isinstance(items, list) or any(isinstance(each, str) is not are_texts for each in items):
        raise ConversionError(f"'{text}' is not a list of {label.removesuffix(' separated by ;')} in JSON")
    return [item.fit(each) for each in items]


def items_of(text: str, convert: Callable[[str], T], *, blanks: bool = False) -> list[T]:
    """Split a text at semicolons, and convert the items.

    Args:
        text: The text; an empty text has no items.
        convert: A function that converts the text of an item, or raises `ConversionError`.
        blanks: Whether whitespace is allowed around an item.

    Raises:
        ConversionError: If an item is invalid. The error contains the location of the item.
    """
    items, start = [], 0
    for part in text.split(_SEPARATOR) if text else ():
        written = part.strip() if blanks else part
        begin = start + part.index(written)
        try:
            items.append(convert(written))
        except ConversionError as error:
            first, last = error.place or (0, len(written))
            place = (begin + first, begin + last)
            raise ConversionError(error.message, error.suggestion, error.hint, place) from None
        start += len(part) + len(_SEPARATOR)
    return items


def _parse_any_value(text: str) -> object:
    """Parse a text after the prefix `json:` as JSON. Return any other text unchanged."""
    if not text.startswith(JSON):
        return text
    try:
        return json.loads(text.removeprefix(JSON))
    except RecursionError:
        raise ConversionError("the text after json: is nested too deeply") from None
    except ValueError as error:
        raise ConversionError(f"the text after json: is not JSON: {error}") from None


_PLAIN: dict[type, ValueType] = {
    bool: ValueType(
        "boolean",
        "true or false",
        _boolean,
        choices=tuple(TRUTH_VALUES),
        python=bool,
        cpp="bool",
        example="true",
    ),
    int: ValueType("integer", "an integer", parse_integer, pattern=INTEGER, python=int, cpp="int"),
    float: ValueType("number", "a number", parse_real, pattern=REAL, python=float, cpp="double"),
    str: ValueType("string", "a string", str, python=str, cpp=TEXT),
    Path: ValueType("path", "a path", Path, python=Path, cpp=TEXT),
    Script: ValueType("script", "a script", _script, python=Script, cpp=TEXT),
    timedelta: ValueType(
        "duration", "a duration", _duration, pattern=DURATION, python=timedelta, cpp=TEXT, unit="s"
    ),
}
PLAIN = {value_type.name: value_type for value_type in _PLAIN.values()}
"""The value types of plain Python classes, by name."""
UNSIGNED = ValueType(
    "unsigned",
    f"an integer from 0 to {_LARGEST_UNSIGNED}",
    _parse_unsigned,
    pattern=_up_to(_LARGEST_UNSIGNED),
    python=int,
    cpp=UNSIGNED_INT,
    least=0,
    most=_LARGEST_UNSIGNED,
)
"""The type of BehaviorTree.CPP's `unsigned` integers."""
REAL_NUMBER = ValueType(
    "real", "a number", _any_real, pattern=f"{REAL}|{_NO_DIGITS}", python=float, cpp="double"
)
"""The type of ports for real numbers.

As in BehaviorTree.CPP, ports accept `inf` and `nan`. Other attributes do not accept them.
"""
SECONDS = ValueType(
    "seconds",
    "a duration (seconds, or a number with ms, s or min)",
    _seconds,
    pattern=f"{REAL}|{WITH_UNIT}",
    python=float,
    cpp="double",
    unit="s",
)
"""The type of durations. Numbers without a unit are in seconds."""
MILLISECONDS = ValueType(
    "milliseconds",
    f"a duration (milliseconds from 0 to {_LARGEST_UNSIGNED}, or a number with ms, s or min)",
    _milliseconds,
    pattern=f"{UNSIGNED.pattern}|{WITH_UNIT}",
    python=int,
    cpp=UNSIGNED.cpp,
    least=UNSIGNED.least,
    most=UNSIGNED.most,
    unit="ms",
)
"""The type of durations. As in BehaviorTree.CPP, numbers without a unit are in milliseconds."""
Seconds: TypeAlias = Annotated[float, SECONDS]
"""The annotation of a parameter or port in seconds.

A file can also contain a number with a unit, such as `500ms`.
"""
Milliseconds: TypeAlias = Annotated[int, MILLISECONDS]
"""The annotation of a parameter or port whose value is an integer number of milliseconds."""
_condition = functools.partial(_script, allow_empty=False)
CONDITION = ValueType("condition", "a script", _condition, pattern=_NOT_BLANK, python=Script, cpp=TEXT)
"""The type of scripts that must not be empty, such as preconditions."""
ANYTHING = ValueType("anything", "a value", _parse_any_value)
"""The type of a port for any object. Parameters that are not ports cannot have this type."""
AS_WRITTEN = ValueType("anything", "a value", str)
"""The type of a port for any object.

A text in the file is always read as a string, even if it begins with `json:`.
"""
NO_VALUE = ValueType("", "", str, python=object, cpp=TEXT)
"""The type of parameters that are not written as text.

These are references to nodes, and objects of the mission.
"""

_OF_PORTS = {_PLAIN[float].name: REAL_NUMBER, list_type(_PLAIN[float]).name: list_type(REAL_NUMBER)}
STATUSES = ("IDLE", "RUNNING", "SUCCESS", "FAILURE", "SKIPPED")
"""The words that BehaviorTree.CPP reads as a status."""
_SIZES = {"int8_t": 8, "int16_t": 16, INT: 32, LONG: 64}
_CPP_TYPES = {
    "bool": _PLAIN[bool],
    **{name: _sized_integer(name, bits) for name, bits in _SIZES.items()},
    **{
        name: _sized_integer(name, bits, is_signed=False) for name, bits in (("uint8_t", 8), ("uint16_t", 16))
    },
    UNSIGNED_INT: UNSIGNED,
    "uint64_t": _sized_integer("uint64_t", 64, is_signed=False),
    CPP_REAL: REAL_NUMBER,
    "float": REAL_NUMBER._replace(cpp="float"),
    TEXT: _PLAIN[str],
    STATUS: ValueType(
        "status",
        f"one of {', '.join(STATUSES)}",
        functools.partial(_choose_text, STATUSES),
        choices=STATUSES,
        cpp=STATUS,
    ),
}
_NUMBERS = (int, float, bool)
