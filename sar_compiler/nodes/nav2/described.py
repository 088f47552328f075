"""The nodes of Nav2 that only Nav2 can run, read from `nodes.yaml`."""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

from sar_compiler.nodes.answers import answers_of
from sar_compiler.nodes.declaring import signature
from sar_compiler.nodes.nav2 import outcomes
from sar_compiler.nodes.nav2.free_nodes import IN_CPP
from sar_compiler.nodes.nav2.types import facts, of_port, type_of_port
from sar_compiler.nodes.outcome_sets import F, S, adding, passing
from sar_compiler.nodes.palettes import KnownSpec
from sar_compiler.nodes.semantics import Semantics
from sar_compiler.nodes.spec import Direction, Kind, NodeSpec, Parameter, Role, Skipping, Skips
from sar_compiler.runtime.answers import Answer

_PORT = re.compile(
    r"(?P<direction>\w+) (?P<type>\S+) (?P<name>\w+)(?P<has_default> =(?: (?P<default>[^\s\[]\S*))?)?(?: \[(?P<versions>[\w ]+)\])?"
)
_DIRECTIONS = {"in": Direction.INPUT, "out": Direction.OUTPUT}
_ALL = frozenset({"SUCCESS", "FAILURE", "RUNNING"})


def specs(version: str) -> Iterator[NodeSpec]:
    """Yield the records of these nodes in a distribution."""
    known = facts()
    for tag, said in known["nodes"].items():
        if version in said.get("distributions", known["distributions"]):
            like = known["likes"][said["like"]]
            ports = [*like.get("ports", ()), *said.get("ports", ())]
            yield _spec(tag, {**like, **said, "ports": ports}, version)


def _spec(tag: str, said: Mapping[str, Any], version: str) -> NodeSpec:
    kind = Kind(said["kind"])
    signed = signature(kind, said["doc"], *_ports(said["ports"], version))
    if kind.is_leaf:
        statuses = said["answers"]
        by_status = {each.status: each for each in answers_of(statuses)}
        answers = tuple(by_status[status] for status in statuses)
        return KnownSpec(tag, None, kind, frozenset(statuses), answers=answers, signature=signed)
    stand_in, semantics, answers = _STAND_INS[tag]
    skipping = Skipping(Skips.NEVER if kind is Kind.CONTROL else Skips.FROM_CHILD)
    counts = (1, 4) if kind is Kind.CONTROL else (1, 1)
    return KnownSpec(
        tag,
        None,
        kind,
        _ALL,
        answers=answers,
        semantics=replace(semantics, counterpart=IN_CPP),
        skipping=skipping,
        signature=signed,
        child_count=counts,
        stand_in=f"sar_compiler.runtime.{stand_in}",
    )


def _ports(texts: Sequence[str], version: str) -> Iterator[Parameter]:
    for text in texts:
        match = _PORT.fullmatch(text)
        assert match is not None, text  # noqa: S101 - a slip in the data
        if version in (match["versions"] or version).split():
            yield _parameter(match)


def _parameter(match: "re.Match[str]") -> Parameter:
    value_type = of_port(match["name"], type_of_port(match["type"]))
    default: object = None
    if match["has_default"]:
        text = match["default"] or ""
        default = float(text) if value_type.python is float else value_type.convert(text)
    return Parameter(
        match["name"],
        Role.ATTRIBUTE,
        required=False,
        default=default,
        value_type=value_type,
        direction=_DIRECTIONS[match["direction"]],
        doc=facts()["ports"][match["name"]],
    )


_DUE = (Answer("SUCCESS", "due"), Answer("RUNNING", "waiting"))
_DRIVEN = (Answer("SUCCESS", "driven"), Answer("RUNNING", "on the way"), Answer("FAILURE", "no pose"))
_GOAL = (Answer("FAILURE", "same goal"), Answer("SUCCESS", "new goal"))
_LONGER = (Answer("FAILURE", "not longer"), Answer("SUCCESS", "longer"))
_REQUESTS = (
    Answer("SUCCESS", "no request"),
    Answer("FAILURE", "pause"),
    Answer("RUNNING", "resume"),
    Answer("SKIPPED", "resume and pause"),
)

_STAND_INS: Mapping[str, tuple[str, Semantics, tuple[Answer, ...]]] = {
    "SpeedController": ("nav2:WhenDue", Semantics(outcomes.now_and_then(), steady=True), _DUE),
    "GoalUpdatedController": ("nav2:WhenDue", Semantics(outcomes.now_and_then(), steady=True), _GOAL),
    "DistanceController": ("nav2:WhenDriven", Semantics(outcomes.now_and_then(F)), _DRIVEN),
    "PathLongerOnApproach": ("nav2:WhenPathIsLonger", Semantics(adding(S)), _LONGER),
    "GoalUpdater": ("decorators:SubTree", Semantics(passing, steady=True), ()),
    "PauseResumeController": ("nav2:PausedOnRequest", Semantics(outcomes.paused), _REQUESTS),
}
