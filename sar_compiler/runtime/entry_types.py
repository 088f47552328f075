"""Conversion of new values to the types of blackboard entries."""

import enum
from collections.abc import Mapping
from contextlib import suppress

from sar_compiler.runtime.variables import (
    RefusedValueError,
    ScriptValue,
    UnknownValue,
    UnknownValueError,
    fit,
    number_of,
    parse_number_text,
)

_PLAIN = (bool, int, float, str)
_NUMBERS = (bool, int, float)
_BOOLS = ("True", "TRUE", "False", "FALSE")


def value_to_keep(current: object, value: object, enums: Mapping[str, int]) -> object:
    """Return the value to store when a new value is written to an entry with a value.

    Args:
        current: The current value; None if there is none.
        value: The new value.
        enums: The named constants.

    Returns:
        The new value with the current value's type: numbers and strings are converted if no precision is lost. A bool
            may be replaced by any other value, because it is an integer to a script.

    Raises:
        RefusedValueError: If the value cannot be converted.
    """
    kind = type(current)
    if isinstance(current, UnknownValue | None) or (isinstance(value, kind) and not isinstance(value, bool)):
        return value
    plain = value_of(value)
    if plain is None or (kind not in _PLAIN and not isinstance(current, enum.Enum)):
        message = f"the entry has the type {kind.__name__}, but the new value has {type(value).__name__}"
        raise RefusedValueError(message)
    if issubclass(kind, enum.Enum):
        return _member(kind, plain, enums)
    if kind is bool:
        whole = fit(plain, int, enums)
        return bool(whole) if whole in {0, 1} else whole
    return fit(plain, kind, enums)


def read_as(text: str, kind: type) -> ScriptValue:
    """Return the value of a string for an entry that was declared with a type.

    Args:
        text: The string.
        kind: The type: `bool`, `int`, `float` or `str`.

    Raises:
        RefusedValueError: If the string is not such a value.
    """
    if kind is str:
        return text
    return fit(text.lower() if text in _BOOLS else text, bool) if kind is bool else fit(number_of(text), kind)


def value_to_assign(held: object, kind: type | None, value: ScriptValue, enums: Mapping[str, int]) -> object:
    """Return the value to store when a script assigns to an entry.

    Args:
        held: The current value; None if there is none.
        kind: The declared type; None if it has only that of its value.
        value: The new value.
        enums: The named constants.

    Returns:
        The value with the entry's type; a string for a number without a declared type becomes a real number.

    Raises:
        RefusedValueError: If the value cannot be converted.
    """
    if isinstance(value, str) and not isinstance(held, str):
        if kind is not None:
            return read_as(value, kind)
        if isinstance(held, (int, float)) and not isinstance(held, bool):
            return float(parse_number_text(value, enums))
    return value_to_keep(held, value, enums)


def value_to_write(held: object, value: object) -> object:
    """Return the value to store when a port writes to an entry."""
    numbers = type(held) in _NUMBERS and type(value) in _NUMBERS
    if numbers and type(held) is not type(value) and held is not None:
        with suppress(RefusedValueError):
            return value_to_keep(held, value, {})
    return value


def value_of(value: object) -> ScriptValue | None:
    """Return the value that a script reads from an entry; None if it cannot calculate with it.

    A bool is read as 1 or 0, and a member of an enumeration as its number.

    Raises:
        UnknownValueError: If the value is unknown.
    """
    if isinstance(value, UnknownValue):
        raise UnknownValueError(value)
    if isinstance(value, enum.Enum):
        value = value.value
    if isinstance(value, bool):
        return int(value)
    return value if isinstance(value, (int, float, str)) else None


def _member(kind: type[enum.Enum], value: ScriptValue, enums: Mapping[str, int]) -> enum.Enum:
    number = fit(value, int, enums)
    try:
        return kind(number)
    except ValueError:
        raise RefusedValueError(f"the type {kind.__name__} of the entry has no member {number}") from None
