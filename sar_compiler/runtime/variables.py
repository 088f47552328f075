"""The variables of scripts: their values, their storage, and conversions in assignments."""

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import NamedTuple, Protocol

from sar_compiler.errors import SarError
from sar_compiler.runtime.context import mission_context
from sar_compiler.runtime.tokens import BOOLS, LARGEST_INTEGER, excerpt

ScriptValue = int | float | str
"""A value in a script."""

LARGEST_EXACT = 2**53 - 1
"""The limit above which not every integer is a real number."""

_NUMBER = r"(?i)-?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:e[+\-]?[0-9]+)?|-?(?:inf|infinity|nan)"
_WHOLE = r"-?[0-9]+"
# No number of 64 bits has more digits.
_LONGEST_WHOLE = len(str(LARGEST_INTEGER)) + 1
_BITS = 64


@mission_context
class Enums(NamedTuple):
    """The named constants of enumerations for scripts and Switch.

    Attributes:
        numbers: The number of each name.
    """

    numbers: Mapping[str, int] = MappingProxyType({})


class VariableError(SarError):
    """A variable cannot be read or written."""


class UnknownVariableError(VariableError):
    """A variable does not exist, or has no value yet.

    Attributes:
        name: The name, as written in the script.
    """

    def __init__(self, name: str) -> None:
        super().__init__(f"there is no variable '{name}'")
        self.name = name


class UnknownValueError(VariableError):
    """A required value is unknown without a robot.

    Attributes:
        value: The value.
    """

    def __init__(self, value: "UnknownValue") -> None:
        leaf, key = value.leaf, value.key
        super().__init__(
            f"the value of '{key}' is not known, because '{leaf}' writes it in a run. Add to the file of --properties, "
            f'or to the scenario: outcomes: {{{leaf}: [{{status: SUCCESS, then: "{key} := ..."}}]}}'
        )
        self.value = value


UNKNOWN = "unknown"
"""The name for an unknown value in the scripts of a leaf's outcomes."""


@dataclass(frozen=True)
class UnknownValue:
    """The unknown value of an entry that a leaf writes in a run without a robot.

    It can only be copied from entry to entry.

    Attributes:
        leaf: The name of the leaf that writes it.
        key: The key, as written for the leaf.
    """

    leaf: str
    key: str = ""

    def __repr__(self) -> str:
        return UNKNOWN


def unknown_value_of(error: BaseException | None) -> UnknownValue | None:
    """Return the unknown value that caused an error; None if the error has another cause."""
    while error is not None and not isinstance(error, UnknownValueError):
        error = error.__cause__
    return None if error is None else error.value


class RefusedValueError(VariableError):
    """A value is not an allowed one."""


class Variables(Protocol):
    """The variables of a script: names in its scope, or with `@` in the root's scope."""

    def read(self, name: str) -> ScriptValue:
        """Return a variable's value.

        Raises:
            UnknownVariableError: If there is none, or it has no value yet.
        """
        ...

    def create(self, name: str, value: ScriptValue) -> ScriptValue:
        """Create a variable, or assign to an existing one as `assign` does; for `:=`.

        Returns:
            The stored value.

        Raises:
            RefusedValueError: If the variable exists with another type.
        """
        ...

    def assign(self, name: str, value: ScriptValue) -> ScriptValue:
        """Assign a value to an existing variable, which keeps its type (see `fit`).

        Returns:
            The stored value.

        Raises:
            UnknownVariableError: If there is none.
            RefusedValueError: If the value does not fit the variable's type.
        """
        ...


class PlainVariables:
    """Variables without fixed types.

    Args:
        values: Their initial values.
    """

    def __init__(self, values: Mapping[str, ScriptValue]) -> None:
        self._values = dict(values)

    def read(self, name: str) -> ScriptValue:
        """Return a variable's value."""
        if name not in self._values:
            raise UnknownVariableError(name)
        return self._values[name]

    def create(self, name: str, value: ScriptValue) -> ScriptValue:
        """Assign a value to a variable."""
        self._values[name] = value
        return value

    assign = create


def fit(value: ScriptValue, kind: type, enums: Mapping[str, int] | None = None) -> ScriptValue:
    """Convert a value to the type of a variable.

    Args:
        value: The value.
        kind: The variable's type: `bool`, `int`, `float` or `str`; any other type accepts only its own values.
        enums: The named constants that a string may contain, for a numeric variable.

    Returns:
        The converted value: the number 2.0 as an `int` is 2, the string '2.5' as a `float` is 2.5.

    Raises:
        RefusedValueError: If the value would change: 2.5 or 1e30 as an `int`, 7 as a `bool`, a string that is not a
            number as a number, a number as a string.
    """
    if kind not in {bool, int, float}:
        if isinstance(value, kind):
            return value
        message = (
            f"{describe_value(value)} is not {'a string' if kind is str else f'of type {kind.__name__}'}"
        )
        raise RefusedValueError(message)
    if isinstance(value, str):
        value = parse_number_text(value, enums or {})
    if kind is float:
        return as_real(value)
    whole = to_int64(value)
    if kind is bool:
        if whole not in {0, 1}:
            raise RefusedValueError(f"{describe_value(value)} is neither true (1) nor false (0)")
        return bool(whole)
    return whole


def parse_number_text(text: str, enums: Mapping[str, int]) -> int | float:
    """Return the number in a string: digits, `true` or `false`, or a name of an enumeration.

    Raises:
        RefusedValueError: If there is none.
    """
    if text in BOOLS:
        return BOOLS[text]
    if text in enums:
        return float(enums[text])
    return number_of(text)


def number_of(text: str) -> int | float:
    """Convert a string of digits to a number.

    Raises:
        RefusedValueError: If there is none.
    """
    if len(text) <= _LONGEST_WHOLE and re.fullmatch(_WHOLE, text):
        return int(text)
    if re.fullmatch(_NUMBER, text):
        value = float(text)
        if math.isfinite(value) or text.strip("-").isalpha():
            return value
    raise RefusedValueError(f"{describe_value(text)} is not a number")


def as_real(value: ScriptValue) -> float:
    """Return a number as a real number.

    Raises:
        RefusedValueError: If it is not a number, or too large for an exact conversion.
    """
    if isinstance(value, float):
        return value
    if not isinstance(value, int):
        raise RefusedValueError(f"{describe_value(value)} is not a number")
    if not -LARGEST_EXACT <= value <= LARGEST_EXACT:
        raise RefusedValueError(
            f"{describe_value(value)} is too large to calculate with exactly (the limit is {LARGEST_EXACT})"
        )
    return float(value)


def to_int64(value: ScriptValue) -> int:
    """Return a number as a 64-bit integer.

    Raises:
        RefusedValueError: If it is not a number, has a fraction, or is too large.
    """
    if not isinstance(value, (int, float)):
        raise RefusedValueError(f"{describe_value(value)} is not a number")
    if isinstance(value, float) and not value.is_integer():
        raise RefusedValueError(f"{describe_value(value)} is not an integer")
    if not -LARGEST_INTEGER - 1 <= value <= LARGEST_INTEGER:
        message = f"{describe_value(value)} is too large for an integer (the limit is {LARGEST_INTEGER})"
        raise RefusedValueError(message)
    return int(value)


def describe_value(value: object) -> str:
    """Describe a value for messages."""
    if isinstance(value, str):
        return f"the string '{excerpt(value)}'"
    if isinstance(value, float) or (isinstance(value, int) and value.bit_length() <= _BITS):
        return str(value)
    if isinstance(value, int):
        return f"an integer of {value.bit_length()} bits"
    return f"a value of type {type(value).__name__}"
