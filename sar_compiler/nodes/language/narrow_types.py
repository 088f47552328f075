"""Value types of attributes that accept fewer values than the annotations of the constructor parameters."""

import math
import operator as operators
from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, get_args

from sar_compiler.nodes.cpp_names import ANY
from sar_compiler.nodes.values import (
    ANYTHING,
    JSON,
    ConversionError,
    ValueType,
    items_of,
    literal_value,
    parse_integer,
    parse_real,
    require_value_type,
)
from sar_compiler.runtime.blackboard import ROOT_SIGN, entry_of
from sar_compiler.runtime.ports import Input
from sar_compiler.runtime.queues import QueueError, queue_items
from sar_compiler.tree.guessing import nearest

if TYPE_CHECKING:
    from py_trees.common import ComparisonExpression

StatusName = Literal["SUCCESS", "FAILURE", "RUNNING"]
"""The statuses that a tick can return, without py_trees' INVALID."""
PolicyName = Literal["SuccessOnAll", "SuccessOnOne", "SuccessOnSelected"]
"""The names of py_trees' policies, which decide which children of a Parallel must succeed."""

STATUS_NAME = require_value_type(StatusName)
_PROBABILITIES = "write the weights of SUCCESS, FAILURE and RUNNING, for example 2;1;1"
_HOW_MANY_PROBABILITIES = 3


def _variable(text: str) -> str:
    name = text.removeprefix(ROOT_SIGN)
    if not name or name.startswith(("/", JSON)) or text != "".join(text.split()):
        hint = "write the name of a key, without a leading slash and without spaces"
        raise ConversionError(f"'{text}' is not a key", hint=hint)
    if name.startswith("."):
        raise ConversionError(f"'{text}' begins with a dot, so it is not a key", hint="write key.attribute")
    return text


def _key(text: str) -> str:
    if "." in text:
        raise ConversionError(
            f"'{text}' contains a dot, but this node cannot read the attributes of an object"
        )
    return _variable(text)


def _status_names(text: str) -> list[str]:
    return [str(outcome) for outcome in items_of(text, STATUS_NAME.convert, blanks=True)]


def _names(text: str) -> list[str]:
    return items_of(text, str, blanks=True)


def _nth(text: str) -> int:
    number = parse_integer(text)
    if number == 0:
        raise ConversionError("the number must not be 0", hint="write 1 to succeed in every tick")
    return number


def _probability(text: str) -> float:
    number = parse_real(text)
    if number < 0:
        raise ConversionError(f"'{text}' is negative", hint="write 0 for a status that is never returned")
    return number


def _probabilities(text: str) -> list[float]:
    probabilities = items_of(text, _probability)
    if len(probabilities) != _HOW_MANY_PROBABILITIES:
        message = f"expected 3 weights (SUCCESS, FAILURE, RUNNING), got {len(probabilities)}"
        raise ConversionError(message, hint=_PROBABILITIES)
    if not any(probabilities):
        raise ConversionError("at least one of the three weights must be more than 0", hint=_PROBABILITIES)
    if not math.isfinite(sum(probabilities)):
        raise ConversionError("the sum of the three weights is too large", hint=_PROBABILITIES)
    return probabilities


def queue_of(name: str, kind: type) -> ValueType:
    """Return the value type of a loop's queue. The queue is a literal, or an entry with any value.

    Args:
        name: The loop's tag.
        kind: The type of the items.
    """
    return ValueType(f"queue.{name}", "items separated by ;", partial(_queue, kind))


def _queue(kind: type, text: str) -> str:
    try:
        queue_items(text, kind)
    except QueueError as error:
        raise ConversionError(str(error)) from None
    return text


VARIABLE = ValueType("variable", "a key, or key.attribute", _variable, names_key=True)
"""The type for the name of a blackboard key, or of an attribute of the object that the key contains."""
KEY = ValueType("key.name", "a key", _key, names_key=True)
"""The type for the name of a blackboard key."""
ANY_ENTRY = ANYTHING._replace(cpp=ANY)
"""The type for a value of any type, which a node of BehaviorTree.CPP does not convert."""
NTH = ValueType("nth", "an integer other than 0", _nth, python=int, cpp="int", example="1")
"""The type for a period in ticks."""
PROBABILITIES = ValueType(
    "chances",
    "three numbers separated by ;",
    _probabilities,
    python=list,
    cpp="std::vector<double>",
    example="1;1;1",
)
"""The type for the weights of success, failure and running."""
NAMES = ValueType("names", "names separated by ;", _names, python=list, cpp="std::vector<std::string>")
"""The type for a list of node names."""
STATUS_NAMES = ValueType(
    "statuses",
    "SUCCESS, FAILURE or RUNNING, separated by ;",
    _status_names,
    python=list,
    cpp="std::vector<std::string>",
    example="SUCCESS",
)
"""The type for the statuses to return in successive ticks."""


Comparison = Literal["eq", "ne", "lt", "le", "gt", "ge"]
"""The names of comparisons in Python's module `operator`."""
Junction = Literal["and", "or", "xor"]
"""The names of operators that join the results of several comparisons."""

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


class WrittenComparison(NamedTuple):
    """A comparison as it is written in a file, such as `battery gt 20`."""

    variable: str
    comparison: str
    value: str


def parse_comparison(text: str) -> WrittenComparison:
    """Parse one comparison.

    Raises:
        ConversionError: If the text is invalid.
    """
    parts = text.split(maxsplit=2)
    if len(parts) < len(WrittenComparison._fields) or "{" in text:
        raise ConversionError(f"'{text}' is not a comparison", hint=_EXAMPLE)
    check = WrittenComparison(*parts)
    VARIABLE.convert(check.variable)
    if check.comparison not in COMPARISONS:
        message = f"'{text}': '{check.comparison}' is not one of {', '.join(COMPARISONS)}"
        near = nearest(check.comparison, COMPARISONS)
        raise ConversionError(message, " ".join(check._replace(comparison=near)) if near else None)
    return check


def expression(variable: str, operator: str, value: Input[object]) -> "ComparisonExpression":
    """Return py_trees' expression for a comparison.

    Args:
        variable: The key's name in py_trees.
        operator: The name of the comparison.
        value: The value to compare with; if it is a key, the key is read at each comparison.
    """
    from py_trees.common import ComparisonExpression

    compare = COMPARISONS[operator]
    if value.entry is None:
        return ComparisonExpression(variable, constant(value), compare)
    # Since py_trees 2.4, a function could be passed as the value.
    return ComparisonExpression(variable, _KeyValue(value), lambda left, right: compare(left, right.get()))


def constant(port: Input[object]) -> object:
    """Convert a constant to a number, a bool or a string."""
    value = port.get()
    if not isinstance(value, str):
        return value
    return {"true": True, "false": False}.get(value, literal_value(value))


class _KeyValue:
    """The current value of a key.

    An expression that py_trees builds only once can use this value in each tick.
    """

    def __init__(self, port: Input[object]) -> None:
        self._port = port

    def get(self) -> object:
        return self._port.get()

    def __str__(self) -> str:
        return str(self._port.get())


def _checks(text: str) -> list[str]:
    checks = items_of(text, lambda item: " ".join(parse_comparison(item)), blanks=True)
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
"""The type for several comparisons: `battery gt 20;speed lt 1.5`."""
