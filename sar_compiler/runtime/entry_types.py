"""Convert values that are written to blackboard entries to the types of these entries."""

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
    """Convert a new value to the type of the current value of an entry.

    Args:
        current: The current value of the entry; None if it has no value.
        value: The new value.
        enums: The named constants.

    Returns:
        The new value with the current value's type. Numbers and strings are converted if no precision is lost. Any
            integer may replace a bool, because scripts read a bool as an integer.

    Raises:
        RefusedValueError: If the value cannot be converted.
    """
    kind = type(current)
    if isinstance(current, UnknownValue | None) or (isinstance(value, kind) and not isinstance(value, bool)):
        return value
    plain = value_of(value)
    if plain is None or (kind not in _PLAIN and not isinstance(current, enum.Enum)):
        message = (
            f"the entry has the type {kind.__name__}, but the new value is of type {type(value).__name__}"
        )
        raise RefusedValueError(message)
    if issubclass(kind, enum.Enum):
        return _member(kind, plain, enums)
    if kind is bool:
        whole = fit(plain, int, enums)
        return bool(whole) if whole in {0, 1} else whole
    return fit(plain, kind, enums)


def read_as(text: str, kind: type) -> ScriptValue:
    """Convert a string to the declared type of an entry.

    Args:
        text: The string.
        kind: The declared type: `bool`, `int`, `float` or `str`.

    Raises:
        RefusedValueError: If the string is not a value of the type.
    """
    if kind is str:
        return text
    return fit(text.lower() if text in _BOOLS else text, bool) if kind is bool else fit(number_of(text), kind)


def value_to_assign(old: object, kind: type | None, value: ScriptValue, enums: Mapping[str, int]) -> object:
    """Convert a value that a script assigns to an entry to the type of the entry.

    Args:
        old: The current value of the entry; None if it has no value.
        kind: The declared type of the entry; None if no type was declared.
        value: The new value.
        enums: The named constants.

    Returns:
        The value with the entry's type. If the entry contains a number and has no declared type, a string is converted to a real number.

    Raises:
        RefusedValueError: If the value cannot be converted.
    """
    if isinstance(value, str) and not isinstance(old, str):
        if kind is not None:
            return read_as(value, kind)
        if isinstance(old, (int, float)) and not isinstance(old, bool):
            return float(parse_number_text(value, enums))
    return value_to_keep(old, value, enums)


def value_to_write(old: object, value: object) -> object:
    """Return the value to store when a port writes to an entry. Numbers are converted if no precision is lost."""
    numbers = type(old) in _NUMBERS and type(value) in _NUMBERS
    if numbers and type(old) is not type(value) and old is not None:
        with suppress(RefusedValueError):
            return value_to_keep(old, value, {})
    return value


def value_of(value: object) -> ScriptValue | None:
    """Convert the value of an entry for use in scripts. Return None if scripts cannot use the value.

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
