"""The operators of scripts. They follow BehaviorTree.CPP's rules, but use Python's numbers and strings.

Every numeric result is a real number. If an operand is invalid, a `RefusedValueError` names this operand.
"""

import functools
import math
from collections.abc import Callable, Mapping
from typing import Any

from sar_compiler.runtime.variables import (
    RefusedValueError,
    ScriptValue,
    as_real,
    describe_value,
    number_of,
    parse_number_text,
    to_int64,
)

EPSILON = 2.0**-23
"""Numbers are equal if they differ by at most this tolerance, the distance from 1 to the next 32-bit float."""

LONGEST_TEXT = 4096
"""The maximum length of a joined string. Without it, a script that doubles a string in each tick would fill the memory."""


def add(left: ScriptValue, right: ScriptValue) -> ScriptValue:
    """Add two numbers, or join two strings."""
    if isinstance(left, str) and isinstance(right, str):
        return _join(left, right)
    return as_real(left) + as_real(right)


def divide(left: ScriptValue, right: ScriptValue) -> ScriptValue:
    """Divide two numbers.

    Division of a number by zero returns infinity with the sign of the quotient. Division of zero by zero returns NaN.
    """
    dividend, divisor = as_real(left), as_real(right)
    if divisor:
        return dividend / divisor
    if not dividend or math.isnan(dividend):
        return math.nan
    return math.copysign(math.inf, dividend) * math.copysign(1.0, divisor)


def join(left: ScriptValue, right: ScriptValue) -> ScriptValue:
    """Join two strings, or a string and a number."""
    if not isinstance(left, str) and not isinstance(right, str):
        raise RefusedValueError(f"neither {describe_value(left)} nor {describe_value(right)} is a string")
    return _join(_as_text(left), _as_text(right))


def complement(value: ScriptValue) -> ScriptValue:
    """Invert the bits of the integer part of a number."""
    number = as_real(value)
    return float(~to_int64(float(math.trunc(number)) if math.isfinite(number) else number))


BINARY: Mapping[str, Callable[[ScriptValue, ScriptValue], ScriptValue]] = {
    "+": add,
    "-": lambda left, right: as_real(left) - as_real(right),
    "*": lambda left, right: as_real(left) * as_real(right),
    "/": divide,
    "..": join,
    "&": lambda left, right: float(_bits(left) & _bits(right)),
    "|": lambda left, right: float(_bits(left) | _bits(right)),
    "^": lambda left, right: float(_bits(left) ^ _bits(right)),
    # Both operands are always evaluated, and rejected if they are neither true nor false.
    "&&": lambda left, right: float(_is_true(left) & _is_true(right)),
    "||": lambda left, right: float(_is_true(left) | _is_true(right)),
}
"""The binary operators that are not comparisons."""

PREFIX: Mapping[str, Callable[[ScriptValue], ScriptValue]] = {
    "-": lambda value: -as_real(value),
    "~": complement,
    "!": lambda value: float(as_real(value) == 0),
}
"""The unary operators."""


def compare(operator: str, left: ScriptValue, right: ScriptValue, enums: Mapping[str, int]) -> bool:
    """Return whether a comparison is true.

    Two strings are compared character by character, so '10' is less than '9'. A string that is compared with a number
    is converted to a number. If one operand is NaN, `<`, `>`, `<=`, `>=` and `!=` are true, as in BehaviorTree.CPP.
    """
    if not (isinstance(left, str) and isinstance(right, str)):
        left, right = _comparable(left, enums), _comparable(right, enums)
    return _COMPARISONS[operator](left, right)


def is_chosen(condition: ScriptValue) -> bool:
    """Return whether the condition of `?:` selects the first value."""
    if isinstance(condition, str):
        condition = float(number_of(condition))
    return as_real(condition) != 0


def as_condition(value: ScriptValue) -> bool:
    """Convert a script's value to True or False. Valid values are 0, 1 and non-negative real numbers.

    Raises:
        RefusedValueError: If the value is another integer, a negative number or a string.
    """
    if not isinstance(value, (int, float)):
        raise RefusedValueError(f"{describe_value(value)} is neither true (1) nor false (0)")
    return _is_true(value)


def _are_equal(left: Any, right: Any) -> bool:
    return bool(left == right if isinstance(left, str) else abs(left - right) <= EPSILON)


# `<`, `>`, `<=` and `>=` are the negations of the opposite comparisons. This makes a difference only for NaN.
_COMPARISONS: Mapping[str, Callable[[Any, Any], bool]] = {
    "==": _are_equal,
    "!=": lambda left, right: not _are_equal(left, right),
    "<": lambda left, right: not left >= right,
    ">": lambda left, right: not left <= right,
    "<=": lambda left, right: not left > right,
    ">=": lambda left, right: not left < right,
}


def _comparable(value: ScriptValue, enums: Mapping[str, int]) -> float:
    return float(parse_number_text(value, enums)) if isinstance(value, str) else as_real(value)


def _join(left: str, right: str) -> str:
    length = len(left) + len(right)
    if length > LONGEST_TEXT:
        raise RefusedValueError(
            f"the string would have {length:,} characters, but the limit is {LONGEST_TEXT:,}"
        )
    return left + right


def _as_text(value: object) -> str:
    """Convert a value to text for joining. A real number is written with six decimal places."""
    if isinstance(value, str):
        return value
    if isinstance(value, int):
        return str(to_int64(value))
    if isinstance(value, float):
        return f"{value:f}"
    raise RefusedValueError(f"{describe_value(value)} is neither a string nor a number")


def _bits(value: ScriptValue) -> int:
    """Convert the operand of a bit operator to a 64-bit integer."""
    return to_int64(as_real(value))


def _is_true(value: ScriptValue) -> bool:
    """Convert a number to True or False by the rules of `as_condition`."""
    number = as_real(value)
    if number < 0 or (isinstance(value, int) and value not in {0, 1}):
        raise RefusedValueError(f"{describe_value(value)} is neither true (1) nor false (0)")
    return number != 0


def equal_texts(first: str, second: str, names: Mapping[str, int]) -> bool:
    """Return whether a Switch treats two strings as equal: they are identical, or name equal numbers."""
    if first == second:
        return True
    one, other = (float(names[text]) if text in names else _number_in(text) for text in (first, second))
    return one is not None and other is not None and abs(one - other) <= EPSILON


@functools.lru_cache(maxsize=256)  # a Switch compares the same cases in each tick
def _number_in(text: str) -> float | None:
    try:
        return float(number_of(text))
    except RefusedValueError:
        return None
