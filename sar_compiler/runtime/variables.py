"""The variables of scripts: their values, their interface, and the conversion of assigned values."""

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
"""Every integer up to this limit can be converted to a real number without a loss of precision."""

_NUMBER = r"(?i)-?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:e[+\-]?[0-9]+)?|-?(?:inf|infinity|nan)"
_WHOLE = r"-?[0-9]+"
# No 64-bit integer has more digits.
_LONGEST_WHOLE = len(str(LARGEST_INTEGER)) + 1
_BITS = 64


@mission_context
class Enums(NamedTuple):
    """The named constants (enumerators) for scripts and `Switch`.

    Attributes:
        numbers: The number of each constant, by name.
    """

    numbers: Mapping[str, int] = MappingProxyType({})


class VariableError(SarError):
    """Raised if a variable cannot be read or written."""


class UnknownVariableError(VariableError):
    """Raised if a variable does not exist, or has no value yet.

    Attributes:
        name: The variable's name, as written in the script.
    """

    def __init__(self, name: str) -> None:
        super().__init__(f"there is no variable '{name}'")
        self.name = name


class UnknownValueError(VariableError):
    """Raised if a script needs a value that only a run with a robot would provide.

    Attributes:
        value: The unknown value.
    """

    def __init__(self, value: "UnknownValue") -> None:
        leaf, key = value.leaf, value.key
        super().__init__(
            f"the value of '{key}' is not known, because '{leaf}' only writes it on a robot. Add to the property file "
            f'or to the scenario: outcomes: {{{leaf}: [{{status: SUCCESS, then: "{key} := ..."}}]}}'
        )
        self.value = value


UNKNOWN = "unknown"
"""The name that stands for an unknown value in outcome scripts."""


@dataclass(frozen=True)
class UnknownValue:
    """A placeholder that a leaf writes to an entry in a run without a robot. Nodes can only copy it.

    Attributes:
        leaf: The name of the leaf that writes the entry.
        key: The key of the entry, as an attribute of the leaf names it.
    """

    leaf: str
    key: str = ""

    def __repr__(self) -> str:
        return UNKNOWN


def unknown_value_of(error: BaseException | None) -> UnknownValue | None:
    """Return the unknown value that caused an error, or None if the error has another cause."""
    while error is not None and not isinstance(error, UnknownValueError):
        error = error.__cause__
    return None if error is None else error.value


class RefusedValueError(VariableError):
    """Raised if a value has the wrong type, or is not allowed."""


class Variables(Protocol):
    """The variables of a script. A name that begins with `@` refers to the scope of the root."""

    def read(self, name: str) -> ScriptValue:
        """Return a variable's value.

        Raises:
            UnknownVariableError: If the variable does not exist or has no value yet.
        """
        ...

    def create(self, name: str, value: ScriptValue) -> ScriptValue:
        """Create a variable, or assign to an existing one. This method implements the operator `:=`.

        Returns:
            The stored value.

        Raises:
            RefusedValueError: If the variable exists with another type.
        """
        ...

    def assign(self, name: str, value: ScriptValue) -> ScriptValue:
        """Assign a value to an existing variable. The variable keeps its type (see `fit`).

        Returns:
            The stored value.

        Raises:
            UnknownVariableError: If the variable does not exist.
            RefusedValueError: If the value cannot be converted to the variable's type.
        """
        ...


class PlainVariables:
    """Variables that accept values of any type.

    Args:
        values: The initial values of the variables.
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
        kind: The variable's type: `bool`, `int`, `float` or `str`. Any other type accepts only its own values.
        enums: The named constants, whose names a numeric variable accepts as strings.

    Returns:
        The converted value: the number 2.0 becomes the `int` 2, the string '2.5' becomes the `float` 2.5.

    Raises:
        RefusedValueError: If the conversion is impossible or would change the value. Examples: 2.5 or 1e30 to `int`, 7 to `bool`, a string
            without a number to a number, a number to a string.
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
    """Convert a string to a number. The string may also be `true`, `false` or the name of a constant.

    Raises:
        RefusedValueError: If the string contains no number.
    """
    if text in BOOLS:
        return BOOLS[text]
    if text in enums:
        return float(enums[text])
    return number_of(text)


def number_of(text: str) -> int | float:
    """Convert a string to the number that it contains.

    Raises:
        RefusedValueError: If the string contains no number.
    """
    if len(text) <= _LONGEST_WHOLE and re.fullmatch(_WHOLE, text):
        return int(text)
    if re.fullmatch(_NUMBER, text):
        value = float(text)
        if math.isfinite(value) or text.strip("-").isalpha():
            return value
    raise RefusedValueError(f"{describe_value(text)} is not a number")


def as_real(value: ScriptValue) -> float:
    """Convert an integer or a real number to a `float`.

    Raises:
        RefusedValueError: If the value is not a number, or is too large for an exact conversion.
    """
    if isinstance(value, float):
        return value
    if not isinstance(value, int):
        raise RefusedValueError(f"{describe_value(value)} is not a number")
    if not -LARGEST_EXACT <= value <= LARGEST_EXACT:
        raise RefusedValueError(
            f"{describe_value(value)} is too large for an exact calculation (the limit is {LARGEST_EXACT})"
        )
    return float(value)


def to_int64(value: ScriptValue) -> int:
    """Convert a number to a 64-bit integer.

    Raises:
        RefusedValueError: If the value is not a number, has a fraction, or is too large.
    """
    if not isinstance(value, (int, float)):
        raise RefusedValueError(f"{describe_value(value)} is not a number")
    if isinstance(value, float) and not value.is_integer():
        raise RefusedValueError(f"{describe_value(value)} is not an integer")
    if not -LARGEST_INTEGER - 1 <= value <= LARGEST_INTEGER:
        message = f"{describe_value(value)} is too large to be represented as an integer (the limit is {LARGEST_INTEGER})"
        raise RefusedValueError(message)
    return int(value)


def describe_value(value: object) -> str:
    """Describe a value in words for an error message."""
    if isinstance(value, str):
        return f"the string '{excerpt(value)}'"
    if isinstance(value, float) or (isinstance(value, int) and value.bit_length() <= _BITS):
        return str(value)
    if isinstance(value, int):
        return f"an integer of {value.bit_length()} bits"
    return f"a value of type {type(value).__name__}"
