"""Types of attributes that are narrower than the annotations of constructor parameters."""

import math
from functools import partial
from typing import Literal

from sar_compiler.nodes.cpp_names import ANY
from sar_compiler.nodes.values import (
    ANYTHING,
    JSON,
    ConversionError,
    ValueType,
    items_of,
    real_number,
    type_of,
    whole_number,
)
from sar_compiler.runtime.blackboard import ROOT_SIGN
from sar_compiler.runtime.queues import QueueError, queue_items

StatusName = Literal["SUCCESS", "FAILURE", "RUNNING"]
"""The statuses that a tick can return, without py_trees' INVALID."""
PolicyName = Literal["SuccessOnAll", "SuccessOnOne", "SuccessOnSelected"]
"""The children of a Parallel that have to succeed, by py_trees' names."""

STATUS_NAME = type_of(StatusName)
_PROBABILITIES = "write the weights of SUCCESS, FAILURE and RUNNING, for example 2;1;1"
_HOW_MANY_PROBABILITIES = 3


def _variable(text: str) -> str:
    name = text.removeprefix(ROOT_SIGN)
    if not name or name.startswith(("/", JSON)) or text != "".join(text.split()):
        message = f"'{text}' is not a key; write its name without a leading slash and without spaces"
        raise ConversionError(message)
    if name.startswith("."):
        raise ConversionError(f"'{text}' is not a key, because it begins with a dot; write key.attribute")
    return text


def _key(text: str) -> str:
    if "." in text:
        raise ConversionError(f"'{text}' contains a dot, but this node cannot read attributes of objects")
    return _variable(text)


def _status_names(text: str) -> list[str]:
    return [str(answer) for answer in items_of(text, STATUS_NAME.convert, blanks=True)]


def _names(text: str) -> list[str]:
    return items_of(text, str, blanks=True)


def _nth(text: str) -> int:
    number = whole_number(text)
    if number == 0:
        raise ConversionError("the number must not be 0; write 1 to succeed in every tick")
    return number


def _probability(text: str) -> float:
    number = real_number(text)
    if number < 0:
        raise ConversionError(f"'{text}' is negative; write 0 for never")
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
    """Return the type of a loop's queue: a literal, or any value of an entry.

    Args:
        name: The loop's name.
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
"""A key of the blackboard by its name, or an attribute of the object that it holds."""
KEY = ValueType("key.name", "a key", _key, names_key=True)
"""A key of the blackboard by its name."""
ANY_ENTRY = ANYTHING._replace(cpp=ANY)
"""A value of any type, which a node of BehaviorTree.CPP reads unchanged."""
NTH = ValueType("nth", "an integer other than 0", _nth, python=int, cpp="int", example="1")
"""The ticks in which something happens."""
PROBABILITIES = ValueType(
    "chances",
    "three numbers separated by ;",
    _probabilities,
    python=list,
    cpp="std::vector<double>",
    example="1;1;1",
)
"""The weights of success, failure and running."""
NAMES = ValueType("names", "names separated by ;", _names, python=list, cpp="std::vector<std::string>")
"""Names of nodes."""
STATUS_NAMES = ValueType(
    "statuses",
    "SUCCESS, FAILURE or RUNNING, separated by ;",
    _status_names,
    python=list,
    cpp="std::vector<std::string>",
    example="SUCCESS",
)
"""The statuses to return in successive ticks."""
