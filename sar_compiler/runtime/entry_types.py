"""Entries keep their type: what an entry of the blackboard makes of a value that it is given."""

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
    whole_or_real,
)

_PLAIN = (bool, int, float, str)
_NUMBERS = (bool, int, float)
_BOOLS = ("True", "TRUE", "False", "FALSE")


def value_to_keep(current: object, value: object, enums: Mapping[str, int]) -> object:
    """Return what is stored when an entry that holds one value is given another.

    Args:
        current: What the entry holds; None if nothing yet.
        value: What it is given.
        enums: The names that stand for numbers.

    Returns:
        The value, as one of the current value's type: numbers and texts are converted where nothing is lost. A truth
        value is a whole number to a script, so any other one may take its place.

    Raises:
        RefusedValueError: If it is none.
    """
    kind = type(current)
    if isinstance(current, UnknownValue | None) or (isinstance(value, kind) and not isinstance(value, bool)):
        return value
    plain = value_of(value)
    if plain is None or (kind not in _PLAIN and not isinstance(current, enum.Enum)):
        message = f"the entry holds a value of type {kind.__name__}, which one of type {type(value).__name__} cannot replace"
        raise RefusedValueError(message)
    if issubclass(kind, enum.Enum):
        return _member(kind, plain, enums)
    if kind is bool:
        whole = fit(plain, int, enums)
        return bool(whole) if whole in {0, 1} else whole
    return fit(plain, kind, enums)


def read_as(text: str, kind: type) -> ScriptValue:
    """Return what an entry that was made with a type reads in a text.

    Args:
        text: The text.
        kind: The type: `bool`, `int`, `float` or `str`.

    Raises:
        RefusedValueError: If the text says no such value.
    """
    if kind is str:
        return text
    return fit(text.lower() if text in _BOOLS else text, bool) if kind is bool else fit(number_of(text), kind)


def value_to_assign(held: object, kind: type | None, value: ScriptValue, enums: Mapping[str, int]) -> object:
    """Return what an entry stores that a script gives a value.

    Args:
        held: What the entry holds; None if nothing yet.
        kind: The type that it was made with; None if it has no other than that of its value.
        value: What it is given.
        enums: The names that stand for numbers.

    Returns:
        The value, as one of the entry's type; a text given to a number without a type of its own is a real number.

    Raises:
        RefusedValueError: If it is none.
    """
    if isinstance(value, str) and not isinstance(held, str):
        if kind is not None:
            return read_as(value, kind)
        if isinstance(held, (int, float)) and not isinstance(held, bool):
            return float(whole_or_real(value, enums))
    return value_to_keep(held, value, enums)


def value_to_write(held: object, value: object) -> object:
    """Return what an entry stores that a port gives a value: a number stays whole or real, where nothing is lost."""
    numbers = type(held) in _NUMBERS and type(value) in _NUMBERS
    if numbers and type(held) is not type(value) and held is not None:
        with suppress(RefusedValueError):
            return value_to_keep(held, value, {})
    return value


def value_of(value: object) -> ScriptValue | None:
    """Return what a script sees of an entry's value; None if it cannot calculate with it.

    A truth value is 1 or 0 to it, and a member of an enumeration is its number.

    Raises:
        UnknownValueError: If the value is not known.
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
        raise RefusedValueError(f"the entry holds a {kind.__name__}, and none of these is {number}") from None
