"""Entries keep their type: what an entry of the blackboard makes of a value that it is given."""

import enum
from collections.abc import Mapping

from sar_compiler.runtime.variables import RefusedValueError, Value, fit

_PLAIN = (bool, int, float, str)


def kept(current: object, value: object, enums: Mapping[str, int]) -> object:
    """Return what is stored when an entry that holds one value is given another.

    Args:
        current: What the entry holds; None if nothing yet.
        value: What it is given.
        enums: The names that stand for numbers.

    Returns:
        The value, as one of the current value's type: numbers and texts are converted where nothing is lost.

    Raises:
        RefusedValueError: If it is none.
    """
    kind = type(current)
    if current is None or (isinstance(value, kind) and not isinstance(value, bool)):
        return value
    plain = value_of(value)
    if plain is None or (kind not in _PLAIN and not isinstance(current, enum.Enum)):
        message = f"the entry holds a value of type {kind.__name__}, which one of type {type(value).__name__} cannot replace"
        raise RefusedValueError(message)
    return _member(kind, plain, enums) if issubclass(kind, enum.Enum) else fit(plain, kind, enums)


def value_of(value: object) -> Value | None:
    """Return what a script sees of an entry's value; None if it cannot calculate with it.

    `true` and `false` are 1.0 and 0.0 to it, and a member of an enumeration is its number.
    """
    if isinstance(value, enum.Enum):
        value = value.value
    if isinstance(value, bool):
        return float(value)
    return value if isinstance(value, (int, float, str)) else None


def _member(kind: type[enum.Enum], value: Value, enums: Mapping[str, int]) -> enum.Enum:
    number = fit(value, int, enums)
    try:
        return kind(number)
    except ValueError:
        message = f"the entry holds a {kind.__name__}, and none of these is {number}"
        raise RefusedValueError(message) from None
