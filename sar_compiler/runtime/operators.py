"""The operators of scripts: BehaviorTree.CPP's rules, on Python's numbers and strings.

Every number that comes out is a real one. A `RefusedValueError` says which operand does not fit.
"""

import functools
import math
from collections.abc import Callable, Mapping
from typing import Any

from sar_compiler.runtime.variables import (
    RefusedValueError,
    ScriptValue,
    as_real,
    as_whole,
    describe_value,
    number_of,
    whole_or_real,
)

EPSILON = 2.0**-23
"""Numbers that differ by no more are equal: the step from 1 to the next number of 32 bits."""

LONGEST_TEXT = 4096
"""The most characters of a text that a script makes: one that is joined to itself in a loop would fill the memory."""


def add(left: ScriptValue, right: ScriptValue) -> ScriptValue:
    """Add two numbers or join two texts."""
    if isinstance(left, str) and isinstance(right, str):
        return _join(left, right)
    return as_real(left) + as_real(right)


def divide(left: ScriptValue, right: ScriptValue) -> ScriptValue:
    """Divide numbers; by zero gives an infinite number, or none (NaN) for zero by zero."""
    dividend, divisor = as_real(left), as_real(right)
    if divisor:
        return dividend / divisor
    if not dividend or math.isnan(dividend):
        return math.nan
    return math.copysign(math.inf, dividend) * math.copysign(1.0, divisor)


def join(left: ScriptValue, right: ScriptValue) -> ScriptValue:
    """Join two texts, or a text and a number."""
    if not isinstance(left, str) and not isinstance(right, str):
        raise RefusedValueError(f"neither {describe_value(left)} nor {describe_value(right)} is a text")
    return _join(_written(left), _written(right))


def complement(value: ScriptValue) -> ScriptValue:
    """Invert the bits of a number, of which only the whole part counts."""
    number = as_real(value)
    return float(~as_whole(float(math.trunc(number)) if math.isfinite(number) else number))


BINARY: Mapping[str, Callable[[ScriptValue, ScriptValue], ScriptValue]] = {
    "+": add,
    "-": lambda left, right: as_real(left) - as_real(right),
    "*": lambda left, right: as_real(left) * as_real(right),
    "/": divide,
    "..": join,
    "&": lambda left, right: float(_bits(left) & _bits(right)),
    "|": lambda left, right: float(_bits(left) | _bits(right)),
    "^": lambda left, right: float(_bits(left) ^ _bits(right)),
    # Both sides are calculated, and refused if they are no truth values, whatever the other is.
    "&&": lambda left, right: float(_truth(left) & _truth(right)),
    "||": lambda left, right: float(_truth(left) | _truth(right)),
}
"""The operators between two values that are no comparisons."""

PREFIX: Mapping[str, Callable[[ScriptValue], ScriptValue]] = {
    "-": lambda value: -as_real(value),
    "~": complement,
    "!": lambda value: float(as_real(value) == 0),
}
"""The operators before a value."""


def compare(operator: str, left: ScriptValue, right: ScriptValue, enums: Mapping[str, int]) -> bool:
    """Return whether a comparison is true.

    Two texts are compared letter by letter, so that '10' is less than '9'. Of a text and a number, the text
    is the number that it says. What is not a number (NaN) is different from everything, and as no order
    between it and a number can be denied, `<`, `>`, `<=` and `>=` are true of it, as in BehaviorTree.CPP.
    """
    if not (isinstance(left, str) and isinstance(right, str)):
        left, right = _comparable(left, enums), _comparable(right, enums)
    return _COMPARISONS[operator](left, right)


def is_chosen(condition: ScriptValue) -> bool:
    """Return whether the condition of `?:` chooses the first value: a number but zero, or a text that says one."""
    if isinstance(condition, str):
        condition = float(number_of(condition))
    return as_real(condition) != 0


def as_condition(value: ScriptValue) -> bool:
    """Return a script's value as the answer to a condition: of whole numbers 1 or 0, of real ones 0 or any above.

    Raises:
        RefusedValueError: If it is anything else.
    """
    if not isinstance(value, (int, float)):
        raise RefusedValueError(f"{describe_value(value)} is neither true (1) nor false (0)")
    return _truth(value)


def _same(left: Any, right: Any) -> bool:
    return bool(left == right if isinstance(left, str) else abs(left - right) <= EPSILON)


# True unless the opposite is, which differs for NaN only.
_COMPARISONS: Mapping[str, Callable[[Any, Any], bool]] = {
    "==": _same,
    "!=": lambda left, right: not _same(left, right),
    "<": lambda left, right: not left >= right,
    ">": lambda left, right: not left <= right,
    "<=": lambda left, right: not left > right,
    ">=": lambda left, right: not left < right,
}


def _comparable(value: ScriptValue, enums: Mapping[str, int]) -> float:
    return float(whole_or_real(value, enums)) if isinstance(value, str) else as_real(value)


def _join(left: str, right: str) -> str:
    length = len(left) + len(right)
    if length > LONGEST_TEXT:
        raise RefusedValueError(
            f"the text would have {length:,} characters, and a script makes texts of {LONGEST_TEXT:,} at most"
        )
    return left + right


def _written(value: object) -> str:
    """Return a value as a part of a text; real numbers have six digits after the point."""
    if isinstance(value, str):
        return value
    if isinstance(value, int):
        return str(as_whole(value))
    if isinstance(value, float):
        return f"{value:f}"
    raise RefusedValueError(f"{describe_value(value)} is neither a text nor a number")


def _bits(value: ScriptValue) -> int:
    """Return the operand of an operator on bits."""
    return as_whole(as_real(value))


def _truth(value: ScriptValue) -> bool:
    """Return what a number is where true or false is wanted, as `as_condition` has it."""
    number = as_real(value)
    if number < 0 or (isinstance(value, int) and value not in {0, 1}):
        raise RefusedValueError(f"{describe_value(value)} is neither true (1) nor false (0)")
    return number != 0


def equal_texts(first: str, second: str, names: Mapping[str, int]) -> bool:
    """Return whether two texts are equal for a Switch: as they are, as whole numbers, or as real numbers."""
    if first == second:
        return True
    one, other = (float(names[text]) if text in names else _number_in(text) for text in (first, second))
    return one is not None and other is not None and abs(one - other) <= EPSILON


@functools.lru_cache(maxsize=256)  # a Switch asks in every tick for the same cases
def _number_in(text: str) -> float | None:
    try:
        return float(number_of(text))
    except RefusedValueError:
        return None
