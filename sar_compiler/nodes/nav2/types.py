"""The types of Nav2's ports: what a text in a tree file is to look like, as its conversions for BehaviorTree.CPP read it."""

import functools
import re
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from sar_compiler.nodes.numbers import SensibleNumbers, number_hint, number_in, unit_words
from sar_compiler.nodes.values import (
    ANYTHING,
    JSON,
    PLAIN,
    REAL_NUMBER,
    UNSIGNED,
    ConversionError,
    ValueType,
    list_of,
    real_number,
    type_of_cpp_name,
    whole_number,
)

_POSE = 9
_STATUS = 13
_HEADER = 2
_SEPARATOR = ";"
_HIGHEST_COST = 255
_MILLISECONDS = re.compile(r"\+?(\d+)(ms)?")


def type_of_port(name: str) -> ValueType:
    """Return the type of a name in `nodes.yaml`: `double`, `string[]`, `Path`."""
    if name in _TYPES:
        return _TYPES[name]
    if name.endswith("[]"):
        return list_of(type_of_port(name.removesuffix("[]")))
    known = type_of_cpp_name(name)
    assert known is not None, name  # noqa: S101 - a slip in the data
    return known


def of_port(name: str, value_type: ValueType) -> ValueType:
    """Return the type of a port whose name has a unit, or bounds, in `nodes.yaml`."""
    unit, bounds = _units().get(name), _bounds().get(name)
    if unit is not None and value_type.python is float:
        label = f"a number of {unit_words(unit)}"
        value_type = replace(
            value_type, label=label, convert=functools.partial(_with_unit, unit, label), unit=unit
        )
    return replace(value_type, usual=bounds) if value_type.python in (int, float) else value_type


@functools.cache
def facts() -> Mapping[str, Any]:
    """Return what `nodes.yaml` says."""
    import yaml

    text = Path(__file__).with_name("nodes.yaml").read_text(encoding="utf-8")
    found: Mapping[str, Any] = yaml.load(text, getattr(yaml, "CSafeLoader", yaml.SafeLoader))  # noqa: S506 - safe ones
    return found


@functools.cache
def _units() -> Mapping[str, str]:
    return {name: unit for unit, names in facts()["units"].items() for name in names}


@functools.cache
def _bounds() -> Mapping[str, SensibleNumbers]:
    kinds = {
        "positive": SensibleNumbers(0, is_open=True),
        "not negative": SensibleNumbers(0),
        "cost": SensibleNumbers(0, _HIGHEST_COST),
    }
    return {name: kinds[kind] for kind, names in facts()["bounds"].items() for name in names}


def _with_unit(unit: str, label: str, text: str) -> object:
    try:
        return REAL_NUMBER.convert(text)
    except ConversionError:
        message = f"'{text}' is not {label}"
        raise ConversionError(message, number_in(text, unit), number_hint(text, unit)) from None


def _milliseconds(text: str) -> int:
    match = _MILLISECONDS.fullmatch(text)
    if match is None:
        message, meant = f"'{text}' is not a number of milliseconds", number_in(text, "ms")
        suggestion = meant if meant is not None and meant.isdecimal() else None
        raise ConversionError(message, suggestion, "write whole milliseconds, without a unit")
    return int(match[1])


def _fields(first: int, each: int, label: str, text: str) -> object:
    """Check the number of fields between the semicolons of a text.

    Args:
        first: How many come once, before the others.
        each: How many belong together, as often as there are any; negative: exactly so many.
        label: What the text is to be.
        text: The text.
    """
    if text.startswith(JSON):
        return ANYTHING.convert(text)
    fields = text.split(_SEPARATOR)
    rest = len(fields) - first
    if rest != -each if each < 0 else rest % each or rest < 0:
        message = f"'{text}' is not {label}: it has {len(fields)} fields"
        hint = "give it a {key}; a pose is a time, a frame, and 7 numbers, with ; between them"
        raise ConversionError(message, hint=hint)
    # A pose is a time, a frame, and seven numbers; each has these at its end.
    for place in range(first, len(fields), abs(each)):
        whole_number(fields[place])
        for field in fields[place + 2 : place + _POSE if abs(each) == _POSE else place]:
            real_number(field)
    return text


def _no_text(label: str, text: str) -> object:
    if text.startswith(JSON):
        return ANYTHING.convert(text)
    raise ConversionError(f"'{text}' is not {label}: no text is one", hint="give it a {key}")


def _message(name: str, label: str, cpp: str, convert: Callable[[str, str], object]) -> ValueType:
    """Return the type of a ROS message; each is a type of its own on the blackboard."""
    python = type(name, (), {})
    return ValueType(f"nav2.{name}", label, functools.partial(convert, label), python=python, cpp=cpp)


def _of_fields(name: str, label: str, cpp: str, first: int, each: int) -> ValueType:
    return _message(name, label, cpp, functools.partial(_fields, first, each))


_TYPES = {
    "integer": PLAIN["integer"],
    "uint16_t": replace(PLAIN["integer"], cpp="uint16_t"),
    "milliseconds": replace(
        UNSIGNED,
        name="nav2.milliseconds",
        label="a number of milliseconds",
        convert=_milliseconds,
        pattern=r"\+?[0-9]+(ms)?",
        cpp="std::chrono::milliseconds",
        unit="ms",
    ),
    "PoseStamped": _of_fields("PoseStamped", "a pose", "geometry_msgs::msg::PoseStamped", 0, -_POSE),
    "PoseStamped[]": _of_fields(
        "Poses", "several poses", "std::vector<geometry_msgs::msg::PoseStamped>", 0, _POSE
    ),
    "Goals": _of_fields("Goals", "a list of goals", "nav_msgs::msg::Goals", _HEADER, _POSE),
    "Path": _of_fields("Path", "a path", "nav_msgs::msg::Path", _HEADER, _POSE),
    "WaypointStatus[]": _of_fields(
        "WaypointStatuses", "the statuses of goals", "std::vector<nav2_msgs::msg::WaypointStatus>", 0, _STATUS
    ),
    "Duration": _message("Duration", "a duration of ROS", "builtin_interfaces::msg::Duration", _no_text),
    "Route": _message("Route", "a route", "nav2_msgs::msg::Route", _no_text),
    "TrackingFeedback": _message(
        "TrackingFeedback", "a message about the robot's path", "nav2_msgs::msg::TrackingFeedback", _no_text
    ),
}
