"""Specs of the nodes in the distributions of Nav2: `--model nav2:jazzy`.

`nodes.yaml` contains the declarations of the nodes. Controls and decorators behave as in the sources of each
distribution, and those that do not need Nav2 can be run. Leaves have no class, but their ports and outcomes are known, so
that trees can be checked, simulated and verified.
"""

import functools
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

from sar_compiler.nodes.declaring import CLOCK, signature
from sar_compiler.nodes.nav2 import control_outcomes
from sar_compiler.nodes.numbers import PlausibleRange, convert_with_unit, number_hint, unit_name
from sar_compiler.nodes.outcome_sets import F, S, passing_results, with_own_results
from sar_compiler.nodes.outcomes import outcomes_of
from sar_compiler.nodes.palettes import KnownSpec
from sar_compiler.nodes.semantics import Counterpart, Order, Semantics
from sar_compiler.nodes.spec import (
    Direction,
    Kind,
    NodeSpec,
    Parameter,
    ParameterRole,
    SkipPossibility,
    SkipSupport,
)
from sar_compiler.nodes.values import (
    ANYTHING,
    JSON,
    PLAIN,
    REAL_NUMBER,
    UNSIGNED,
    ConversionError,
    ValueType,
    list_type,
    parse_integer,
    parse_real,
    type_of_cpp_name,
)
from sar_compiler.runtime.outcomes import Outcome
from sar_compiler.runtime.ports import Input

_POSE = 9
_STATUS = 13
_HEADER = 2
_SEPARATOR = ";"
_HIGHEST_COST = 255
_MILLISECONDS = re.compile(r"\+?(\d+)(ms)?")


def type_of_port(name: str) -> ValueType:
    """Return the value type for a type name in `nodes.yaml`, such as `double`, `string[]` or `Path`."""
    if name in _TYPES:
        return _TYPES[name]
    if name.endswith("[]"):
        return list_type(type_of_port(name.removesuffix("[]")))
    known = type_of_cpp_name(name)
    assert known is not None, name  # noqa: S101 - an error in the data
    return known


def port_type(name: str, value_type: ValueType) -> ValueType:
    """Return the value type of a port, with the unit and bounds that `nodes.yaml` has for its name."""
    unit, bounds = _units().get(name), _bounds().get(name)
    if unit is not None and value_type.python is float:
        label = f"a number of {unit_name(unit)}"
        value_type = value_type._replace(label=label, convert=partial(_with_unit, unit, label), unit=unit)
    return value_type._replace(usual=bounds) if value_type.python in (int, float) else value_type


@functools.cache
def facts() -> Mapping[str, Any]:
    """Return the content of `nodes.yaml`."""
    import yaml

    text = Path(__file__).with_name("nodes.yaml").read_text(encoding="utf-8")
    found: Mapping[str, Any] = yaml.load(text, getattr(yaml, "CSafeLoader", yaml.SafeLoader))  # noqa: S506 - safe ones
    return found


@functools.cache
def _units() -> Mapping[str, str]:
    return {name: unit for unit, names in facts()["units"].items() for name in names}


@functools.cache
def _bounds() -> Mapping[str, PlausibleRange]:
    kinds = {
        "positive": PlausibleRange(0, is_open=True),
        "not negative": PlausibleRange(0),
        "cost": PlausibleRange(0, _HIGHEST_COST),
    }
    return {name: kinds[kind] for kind, names in facts()["bounds"].items() for name in names}


def _with_unit(unit: str, label: str, text: str) -> object:
    try:
        return REAL_NUMBER.convert(text)
    except ConversionError:
        message = f"'{text}' is not {label}"
        raise ConversionError(message, convert_with_unit(text, unit), number_hint(text, unit)) from None


def _milliseconds(text: str) -> int:
    match = _MILLISECONDS.fullmatch(text)
    if match is None:
        message, meant = f"'{text}' is not a number of milliseconds", convert_with_unit(text, "ms")
        suggestion = meant if meant is not None and meant.isdecimal() else None
        raise ConversionError(message, suggestion, "write an integer in milliseconds, without a unit")
    return int(match[1])


def _fields(first: int, each: int, label: str, text: str) -> object:
    """Check the number of fields in a text, in which semicolons separate the fields.

    Args:
        first: The number of fields that are not repeated.
        each: The number of fields in each repetition; negative for exactly one repetition.
        label: The description of the expected value.
        text: The text.
    """
    if text.startswith(JSON):
        return ANYTHING.convert(text)
    fields = text.split(_SEPARATOR)
    rest = len(fields) - first
    if rest != -each if each < 0 else rest % each or rest < 0:
        message = f"'{text}' is not {label}: it has {len(fields)} fields"
        hint = "write a {key}, or write each pose as a time, a frame and 7 numbers, separated by ;"
        raise ConversionError(message, hint=hint)
    # A pose is a time, a frame and seven numbers.
    for place in range(first, len(fields), abs(each)):
        parse_integer(fields[place])
        for field in fields[place + 2 : place + _POSE if abs(each) == _POSE else place]:
            parse_real(field)
    return text


def _reject_text(label: str, text: str) -> object:
    if text.startswith(JSON):
        return ANYTHING.convert(text)
    raise ConversionError(
        f"expected {label}, but got the text '{text}'; a value of this type cannot be written as text",
        hint="write a {key}",
    )


def _message(name: str, label: str, cpp: str, convert: Callable[[str, str], object]) -> ValueType:
    """Return the value type of a ROS message on the blackboard."""
    python = type(name, (), {})
    return ValueType(f"nav2.{name}", label, partial(convert, label), python=python, cpp=cpp)


def _message_type(name: str, label: str, cpp: str, first: int, each: int) -> ValueType:
    return _message(name, label, cpp, partial(_fields, first, each))


_TYPES = {
    "integer": PLAIN["integer"],
    "uint16_t": PLAIN["integer"]._replace(cpp="uint16_t"),
    "milliseconds": UNSIGNED._replace(
        name="nav2.milliseconds",
        label="a number of milliseconds",
        convert=_milliseconds,
        pattern=r"\+?[0-9]+(ms)?",
        cpp="std::chrono::milliseconds",
        unit="ms",
    ),
    "PoseStamped": _message_type("PoseStamped", "a pose", "geometry_msgs::msg::PoseStamped", 0, -_POSE),
    "PoseStamped[]": _message_type(
        "Poses", "several poses", "std::vector<geometry_msgs::msg::PoseStamped>", 0, _POSE
    ),
    "Goals": _message_type("Goals", "a list of goals", "nav_msgs::msg::Goals", _HEADER, _POSE),
    "Path": _message_type("Path", "a path", "nav_msgs::msg::Path", _HEADER, _POSE),
    "WaypointStatus[]": _message_type(
        "WaypointStatuses", "the statuses of goals", "std::vector<nav2_msgs::msg::WaypointStatus>", 0, _STATUS
    ),
    "Duration": _message("Duration", "a duration of ROS", "builtin_interfaces::msg::Duration", _reject_text),
    "Route": _message("Route", "a route", "nav2_msgs::msg::Route", _reject_text),
    "TrackingFeedback": _message(
        "TrackingFeedback",
        "a message about the robot's path",
        "nav2_msgs::msg::TrackingFeedback",
        _reject_text,
    ),
}


_KERNEL = "sar_compiler.runtime.kernel."
VERSIONS = ("jazzy", "kilted", "main")
_PORT = re.compile(
    r"(?P<direction>\w+) (?P<type>\S+) (?P<name>\w+)(?P<has_default> =(?: (?P<default>[^\s\[]\S*))?)?(?: \[(?P<versions>[\w ]+)\])?"
)
_DIRECTIONS = {"in": Direction.INPUT, "out": Direction.OUTPUT, "inout": Direction.INOUT}
_ALL = frozenset({"SUCCESS", "FAILURE", "RUNNING"})
_IN_CPP = Counterpart(hint="")
"""The counterpart of a node that Nav2 itself provides."""


def specs(version: str) -> Iterator[NodeSpec]:
    """Yield the specs of the nodes of a distribution."""
    known = facts()
    for tag, data in known["nodes"].items():
        if version in data.get("distributions", known["distributions"]):
            like = known["likes"][data["like"]]
            ports = [*like.get("ports", ()), *data.get("ports", ())]
            yield _spec(tag, {**like, **data, "ports": ports}, version)


def _spec(tag: str, data: Mapping[str, Any], version: str) -> NodeSpec:
    kind = Kind(data["kind"])
    if kind.is_leaf:
        statuses, ports = data["outcomes"], _ports(data["ports"], version)
        by_status = {each.status: each for each in outcomes_of(statuses)}
        outcomes = tuple(by_status[status] for status in statuses)
        signed = signature(kind, data["doc"], *ports)
        return KnownSpec(tag, None, kind, frozenset(statuses), outcomes=outcomes, signature=signed)
    free = _FREE.get(f"{tag} {version}") or _FREE.get(tag)
    if free is None:
        stand_in, semantics, outcomes = _STAND_INS[tag]
        made = NodeSpec(tag, f"{_KERNEL}{stand_in}", kind)
        spec: NodeSpec = KnownSpec(tag, None, kind, _ALL, outcomes=outcomes, stand_in=made)
        counts = (1, 4) if kind is Kind.CONTROL else (1, 1)
        free = _FreeNode(
            "",
            semantics,
            SkipPossibility.NEVER if kind is Kind.CONTROL else SkipPossibility.FROM_CHILD,
            counts,
        )
    else:
        spec = NodeSpec(tag, f"{_KERNEL}{free.node}", kind, _ALL)
    ports = _ports(data["ports"], version, is_free=not spec.stand_in)
    return replace(
        spec,
        semantics=free.semantics._replace(counterpart=_IN_CPP),
        skipping=SkipSupport(
            free.skips, is_handled=free.skips is SkipPossibility.NEVER and not spec.stand_in
        ),
        signature=signature(kind, data["doc"], *free.handed_over, *ports, fixed=free.fixed),
        child_count=free.child_count or spec.child_count,
    )


def _ports(texts: Sequence[str], version: str, *, is_free: bool = False) -> Iterator[Parameter]:
    """Yield the ports of a node in a distribution.

    If *is_free* is set, this project has a class for the node, and ports without a default are required.
    """
    for text in texts:
        match = _PORT.fullmatch(text)
        assert match is not None, text  # noqa: S101 - an error in the data
        if version in (match["versions"] or version).split():
            yield _parameter(match, required=is_free and not match["has_default"])


def _parameter(match: "re.Match[str]", *, required: bool) -> Parameter:
    value_type = port_type(match["name"], type_of_port(match["type"]))
    default: object = None
    if match["has_default"]:
        text = match["default"] or ""
        default = float(text) if value_type.python is float else value_type.convert(text)
    return Parameter(
        match["name"],
        ParameterRole.ATTRIBUTE,
        required,
        default=default,
        value_type=value_type,
        direction=_DIRECTIONS[match["direction"]],
        doc=facts()["ports"][match["name"]],
    )


class _FreeNode(NamedTuple):
    """A control or decorator that works without Nav2.

    The node depends only on its children and on time.

    Attributes:
        node: The class in the kernel; empty for a node with a stand-in.
        semantics: The semantics of the node.
        skips: Whether the node can be skipped; a node that is never skipped handles skipped children itself.
        child_count: The minimum and maximum number of children; None for the default of the kind.
        handed_over: The context parameters in addition to the ports.
        fixed: The values that the tag implies.
    """

    node: str
    semantics: Semantics
    skips: SkipPossibility = SkipPossibility.FROM_CHILD
    child_count: tuple[int, int | None] | None = None
    handed_over: Sequence[Parameter] = ()
    fixed: Mapping[str, object] = {}


_RECOVERY = Semantics(control_outcomes.recovery, gates=control_outcomes.recovery_gates, resumes=True)
_TIMED = Semantics(partial(control_outcomes.periodic, 0), steady=True)
_TURNS = "nav2_controls:RoundRobinNode"
_FREE: Mapping[str, _FreeNode] = {
    "RecoveryNode": _FreeNode("nav2_controls:RecoveringNode", _RECOVERY, child_count=(2, 2)),
    "PipelineSequence": _FreeNode(
        "nav2_controls:PipelineNode", Semantics(control_outcomes.pipeline, Order.IN_ORDER, S)
    ),
    "RateController": _FreeNode("nav2_decorators:RateNode", _TIMED, handed_over=[CLOCK]),
    "SingleTrigger": _FreeNode(
        "nav2_decorators:SingleTriggerNode", Semantics(control_outcomes.once_until_reset, steady=True)
    ),
    "RoundRobin": _FreeNode(
        _TURNS,
        Semantics(partial(control_outcomes.round_robin, wraps=True), resumes=True),
        fixed={"wrap_around": Input(source=True)},
    ),
    "RoundRobin main": _FreeNode(
        _TURNS, Semantics(partial(control_outcomes.round_robin, wraps=None), resumes=True)
    ),
    "NonblockingSequence": _FreeNode(
        "nav2_controls:NonblockingNode",
        Semantics(control_outcomes.nonblocking_results, Order.TOGETHER),
        SkipPossibility.NEVER,
    ),
    "PersistentSequence": _FreeNode(
        "nav2_controls:PersistentNode",
        Semantics(control_outcomes.persistent, resumes=True),
        SkipPossibility.NEVER,
    ),
}

_DUE = (Outcome("SUCCESS", "due"), Outcome("RUNNING", "waiting"))
_DRIVEN = (Outcome("SUCCESS", "driven"), Outcome("RUNNING", "on the way"), Outcome("FAILURE", "no pose"))
_GOAL = (Outcome("FAILURE", "same goal"), Outcome("SUCCESS", "new goal"))
_LONGER = (Outcome("FAILURE", "not longer"), Outcome("SUCCESS", "longer"))
_REQUESTS = (
    Outcome("SUCCESS", "no request"),
    Outcome("FAILURE", "pause"),
    Outcome("RUNNING", "resume"),
    Outcome("SKIPPED", "resume and pause"),
)
# The stand-ins for nodes that depend on the world. Each stand-in queries a leaf that represents the world.
_STAND_INS: Mapping[str, tuple[str, Semantics, tuple[Outcome, ...]]] = {
    "SpeedController": ("nav2_decorators:WhenDueNode", _TIMED, _DUE),
    "GoalUpdatedController": ("nav2_decorators:WhenDueNode", _TIMED, _GOAL),
    "DistanceController": (
        "nav2_decorators:DistanceNode",
        Semantics(partial(control_outcomes.periodic, F)),
        _DRIVEN,
    ),
    "PathLongerOnApproach": (
        "nav2_decorators:LongerPathNode",
        Semantics(partial(with_own_results, S)),
        _LONGER,
    ),
    "GoalUpdater": ("turning:SubTreeNode", Semantics(passing_results, steady=True), ()),
    "PauseResumeController": (
        "nav2_controls:PauseResumeNode",
        Semantics(control_outcomes.pausing_results),
        _REQUESTS,
    ),
}
