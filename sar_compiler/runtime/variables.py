"""The variables of scripts: what they can hold, who keeps them, and what an assignment makes of a value."""

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
"""Above it, not every whole number is a real number."""

_NUMBER = r"(?i)-?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:e[+\-]?[0-9]+)?|-?(?:inf|infinity|nan)"
_WHOLE = re.compile(r"-?[0-9]+")
# No number of 64 bits has more digits.
_LONGEST_WHOLE = len(str(LARGEST_INTEGER)) + 1
_BITS = 64


@mission_context
class Enums(NamedTuple):
    """The names of enumerations that scripts and Switch may use.

    Attributes:
        numbers: The number that each name stands for.
    """

    numbers: Mapping[str, int] = MappingProxyType({})


class VariableError(SarError):
    """A variable cannot be read or written as wanted."""


class UnknownVariableError(VariableError):
    """There is no such variable, or it holds nothing yet.

    Attributes:
        name: The name, as the script has it.
    """

    def __init__(self, name: str) -> None:
        super().__init__(f"there is no variable '{name}'")
        self.name = name


class UnknownValueError(VariableError):
    """A value is needed that is not known without a robot.

    Attributes:
        value: The value.
    """

    def __init__(self, value: "UnknownValue") -> None:
        leaf, key = value.leaf, value.key
        super().__init__(
            f"the value of '{key}' is not known, because '{leaf}' writes it in a run. Add to the file of --properties, "
            f'or to the scenario: answers: {{{leaf}: [{{status: SUCCESS, then: "{key} := ..."}}]}}'
        )
        self.value = value


UNKNOWN = "unknown"
"""The name that stands for an unknown value in the scripts of a leaf's answers."""


@dataclass(frozen=True)
class UnknownValue:
    """What an entry holds where no robot is: a leaf writes it, and nothing says what.

    It can be copied from entry to entry. Nothing else can be done with it.

    Attributes:
        leaf: The name of the leaf that writes it.
        key: The key, as the leaf has it.
    """

    leaf: str
    key: str = ""

    def __repr__(self) -> str:
        return UNKNOWN


def unknown_value_of(error: BaseException | None) -> UnknownValue | None:
    """Return the unknown value because of which something was raised; None if there is another reason."""
    while error is not None and not isinstance(error, UnknownValueError):
        error = error.__cause__
    return None if error is None else error.value


class RefusedValueError(VariableError):
    """A value is not one of those that are wanted."""


class Variables(Protocol):
    """The variables of a script: names in its scope, those with `@` in the root's."""

    def read(self, name: str) -> ScriptValue:
        """Return a variable's value.

        Raises:
            UnknownVariableError: If there is none, or it holds nothing yet.
        """
        ...

    def create(self, name: str, value: ScriptValue) -> ScriptValue:
        """Make a variable, or give the one that exists a value, as `assign` does; for `:=`.

        Returns:
            The value that is stored.

        Raises:
            RefusedValueError: If the variable exists, with another type.
        """
        ...

    def assign(self, name: str, value: ScriptValue) -> ScriptValue:
        """Give a variable that exists a value, which keeps its type (see `fit`).

        Returns:
            The value that is stored.

        Raises:
            UnknownVariableError: If there is none.
            RefusedValueError: If the value is none of the variable's type.
        """
        ...


class PlainVariables:
    """Variables of any type, each of which takes any value.

    Args:
        values: Their values at first.
    """

    def __init__(self, values: Mapping[str, ScriptValue]) -> None:
        self._values = dict(values)

    def read(self, name: str) -> ScriptValue:
        """Return a variable's value."""
        if name not in self._values:
            raise UnknownVariableError(name)
        return self._values[name]

    def create(self, name: str, value: ScriptValue) -> ScriptValue:
        """Give a variable a value."""
        self._values[name] = value
        return value

    assign = create


def fit(value: ScriptValue, kind: type, enums: Mapping[str, int] | None = None) -> ScriptValue:
    """Return what a variable with a type makes of a value that it is given.

    Args:
        value: The value.
        kind: The variable's type: `bool`, `int`, `float` or `str`; one of another type takes its like only.
        enums: The names that a text may be, for a variable with a number.

    Returns:
        The value, as one of the type: the whole number 2.0 as an `int` is 2, the text '2.5' as a `float` 2.5.

    Raises:
        RefusedValueError: If it would not be the same value: 2.5 or 1e30 as an `int`, 7 as a `bool`, a text that
            is no number as a number, a number as a text.
    """
    if kind not in {bool, int, float}:
        if isinstance(value, kind):
            return value
        message = f"{describe_value(value)} is not {'a text' if kind is str else f'of type {kind.__name__}'}"
        raise RefusedValueError(message)
    if isinstance(value, str):
        value = whole_or_real(value, enums or {})
    if kind is float:
        return as_real(value)
    whole = as_whole(value)
    if kind is bool:
        if whole not in {0, 1}:
            raise RefusedValueError(f"{describe_value(value)} is neither true (1) nor false (0)")
        return bool(whole)
    return whole


def whole_or_real(text: str, enums: Mapping[str, int]) -> int | float:
    """Return the number that a text says: digits, `true` or `false`, or a name of an enumeration.

    Raises:
        RefusedValueError: If it says none.
    """
    if text in BOOLS:
        return BOOLS[text]
    if text in enums:
        return float(enums[text])
    return number_of(text)


def number_of(text: str) -> int | float:
    """Return the number that the digits of a text say.

    Raises:
        RefusedValueError: If it says none.
    """
    if len(text) <= _LONGEST_WHOLE and _WHOLE.fullmatch(text):
        return int(text)
    if re.fullmatch(_NUMBER, text):
        value = float(text)
        if math.isfinite(value) or text.strip("-").isalpha():
            return value
    raise RefusedValueError(f"{describe_value(text)} is not a number")


def as_real(value: ScriptValue) -> float:
    """Return a number as a real one.

    Raises:
        RefusedValueError: If it is none, or too large to be the same number.
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


def as_whole(value: ScriptValue) -> int:
    """Return a number as a whole one of 64 bits.

    Raises:
        RefusedValueError: If it is none, has a fraction, or is too large.
    """
    if not isinstance(value, (int, float)):
        raise RefusedValueError(f"{describe_value(value)} is not a number")
    if isinstance(value, float) and not value.is_integer():
        raise RefusedValueError(f"{describe_value(value)} is not a whole number")
    if not -LARGEST_INTEGER - 1 <= value <= LARGEST_INTEGER:
        message = f"{describe_value(value)} is too large for a whole number (the limit is {LARGEST_INTEGER})"
        raise RefusedValueError(message)
    return int(value)


def describe_value(value: object) -> str:
    """Return a value as a message says it."""
    if isinstance(value, str):
        return f"the text '{excerpt(value)}'"
    if isinstance(value, float) or (isinstance(value, int) and value.bit_length() <= _BITS):
        return str(value)
    if isinstance(value, int):
        return f"a whole number of {value.bit_length()} bits"
    return f"a value of type {type(value).__name__}"
