"""Comparisons of blackboard keys with values, for py_trees' nodes."""

import operator as operators
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, get_args

from sar_compiler.nodes.language.narrow_types import VARIABLE
from sar_compiler.nodes.values import ConversionError, ValueType, items_of, literal_value
from sar_compiler.runtime.blackboard import entry_of
from sar_compiler.runtime.ports import Input
from sar_compiler.tree.guessing import nearest

if TYPE_CHECKING:
    from py_trees.common import ComparisonExpression

Comparison = Literal["eq", "ne", "lt", "le", "gt", "ge"]
"""A comparison, by its name in Python's `operator`."""
Junction = Literal["and", "or", "xor"]
"""The operator that joins the results of several comparisons."""

COMPARISONS: dict[str, Callable[[Any, Any], bool]] = {
    name: getattr(operators, name) for name in get_args(Comparison)
}
JUNCTIONS: dict[str, Callable[[bool, bool], bool]] = {
    "and": operators.and_,
    "or": operators.or_,
    "xor": operators.xor,
}
_EXAMPLE = "write a key, a comparison and a value, for example battery gt 20"
_LEAST_CHECKS = 2


class Check(NamedTuple):
    """A comparison as written in a file: `battery gt 20`."""

    variable: str
    comparison: str
    value: str


def read_check(text: str) -> Check:
    """Read one comparison.

    Raises:
        ConversionError: If the text is invalid.
    """
    parts = text.split(maxsplit=2)
    if len(parts) < len(Check._fields) or "{" in text:
        raise ConversionError(f"'{text}' is not a comparison; {_EXAMPLE}")
    check = Check(*parts)
    VARIABLE.convert(check.variable)
    if check.comparison not in COMPARISONS:
        message = f"'{text}': '{check.comparison}' is not one of {', '.join(COMPARISONS)}"
        near = nearest(check.comparison, COMPARISONS)
        raise ConversionError(message, " ".join(check._replace(comparison=near)) if near else None)
    return check


def expression(variable: str, operator: str, value: Input[object]) -> "ComparisonExpression":
    """Return py_trees' expression for a comparison.

    Args:
        variable: The key, by its py_trees name.
        operator: The comparison.
        value: The value to compare with; a key is read at each comparison.
    """
    from py_trees.common import ComparisonExpression

    compare = COMPARISONS[operator]
    if value.entry is None:
        return ComparisonExpression(variable, constant(value), compare)
    # Since py_trees 2.4, the value itself could be a function.
    return ComparisonExpression(variable, _Held(value), lambda left, right: compare(left, right.get()))


def constant(port: Input[object]) -> object:
    """Return the value of a constant: a string from a file is a number or a bool if all of it is one."""
    value = port.get()
    if not isinstance(value, str):
        return value
    return {"true": True, "false": False}.get(value, literal_value(value))


class _Held:
    """The current value of a key, for a comparison expression that py_trees builds only once."""

    def __init__(self, port: Input[object]) -> None:
        self._port = port

    def get(self) -> object:
        return self._port.get()

    def __str__(self) -> str:
        return str(self._port.get())


def _checks(text: str) -> list[str]:
    checks = items_of(text, lambda item: " ".join(read_check(item)), blanks=True)
    if len(checks) < _LEAST_CHECKS:
        message = f"at least two comparisons are required, but there is {len(checks) or 'none'}"
        raise ConversionError(message, hint="for one comparison, use CheckBlackboardVariableValue")
    return checks


def _keys_in(checks: object) -> list[str]:
    assert isinstance(checks, list)  # noqa: S101 - the type is known
    return [entry_of(check.split(" ", 1)[0]) for check in checks]


CHECKS = ValueType(
    "checks",
    "comparisons separated by ;",
    _checks,
    python=list,
    cpp="std::vector<std::string>",
    example="a eq 0;b eq 0",
    keys_in=_keys_in,
)
"""Comparisons: `battery gt 20;speed lt 1.5`."""
