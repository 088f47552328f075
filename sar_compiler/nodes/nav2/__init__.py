"""The nodes of Nav2's distributions: `--model nav2:jazzy`.

Controls and decorators mean what each distribution's sources say, and what can run without Nav2 does. Leaves have no class:
they are known by their ports and answers, so that trees can be checked, simulated and verified.
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

from sar_compiler.nodes.answers import answers_of
from sar_compiler.nodes.declaring import CLOCK, inout_port, input_port, signature
from sar_compiler.nodes.nav2 import outcomes
from sar_compiler.nodes.nav2.types import facts, of_port, type_of_port
from sar_compiler.nodes.outcome_sets import F, S, adding, passing
from sar_compiler.nodes.palettes import KnownSpec
from sar_compiler.nodes.semantics import Counterpart, Order, Semantics
from sar_compiler.nodes.spec import Direction, Kind, NodeSpec, Parameter, Role, Skipping, Skips
from sar_compiler.nodes.values import PLAIN, REAL_NUMBER
from sar_compiler.runtime.answers import Answer

VERSIONS = ("jazzy", "kilted", "main")


def specs(version: str) -> list[NodeSpec]:
    """Return the records of the nodes of a distribution."""
    return [*_specs_of_free_nodes(version), *_specs_of_described_nodes(version)]


_ALL = frozenset({"SUCCESS", "FAILURE", "RUNNING"})
IN_CPP = Counterpart(hint="")
"""Nav2 has the node itself."""
_RATE, _RETRIES = of_port("hz", REAL_NUMBER), of_port("number_of_retries", PLAIN["integer"])


def _specs_of_free_nodes(version: str) -> list[NodeSpec]:
    """Return the records of these nodes in a distribution."""
    return [*_EVERYWHERE, *(_MAIN if version == "main" else _BEFORE_MAIN)]


def _free_node(
    tag: str,
    doc: str,
    semantics: Semantics,
    *parameters: Parameter,
    kind: Kind = Kind.CONTROL,
    skipping: Skipping = Skipping(Skips.FROM_CHILD),  # noqa: B008 - frozen
    cls: str = "",
    **more: object,
) -> NodeSpec:
    return NodeSpec(
        tag,
        f"sar_compiler.runtime.nav2:{cls or tag}",
        kind,
        _ALL,
        semantics=replace(semantics, counterpart=IN_CPP),
        skipping=skipping,
        signature=signature(kind, doc, *parameters),
        **more,  # type: ignore[arg-type]
    )


_HANDLED = Skipping(is_handled=True)
_IN_TURN = (
    "Ticks its children in turn until one succeeds; the next start begins with the child after that one."
)

_EVERYWHERE: tuple[NodeSpec, ...] = (
    _free_node(
        "RecoveryNode",
        "Ticks its first child; when that fails, the second one, and after its success the first one again.",
        Semantics(outcomes.recovery, gates=outcomes.after_a_failure, resumes=True),
        input_port("number_of_retries", _RETRIES, "How often to recover; less than 0 counts as 1.", 1),
        child_count=(2, 2),
    ),
    _free_node(
        "PipelineSequence",
        "Ticks every child again in each tick, and the next one only when all before it have succeeded once.",
        Semantics(outcomes.pipeline, Order.IN_ORDER, S),
    ),
    _free_node(
        "RateController",
        "Ticks its child at a rate: at the start, while it runs, and when a period is over since it last succeeded.",
        Semantics(outcomes.now_and_then(), steady=True),
        CLOCK,
        input_port("hz", _RATE, "The rate, in hertz.", 10.0),
        kind=Kind.DECORATOR,
    ),
    _free_node(
        "SingleTrigger",
        "Lets its child end once; ticked again before it is reset or halted, it fails.",
        Semantics(outcomes.once_until_reset, steady=True),
        kind=Kind.DECORATOR,
    ),
)

_BEFORE_MAIN: tuple[NodeSpec, ...] = (
    _free_node(
        "RoundRobin",
        _IN_TURN,
        Semantics(outcomes.round_robin(wraps=True), resumes=True),
        cls="WrappingRoundRobin",
    ),
)

_MAIN: tuple[NodeSpec, ...] = (
    _free_node(
        "RoundRobin",
        _IN_TURN,
        Semantics(outcomes.round_robin(wraps=None), resumes=True),
        input_port(
            "wrap_around",
            bool,
            "Whether the first child follows the last one. If not, any end of the last child, a success as well, makes it "
            "fail and begin with the first child again.",
            default=False,
        ),
    ),
    _free_node(
        "NonblockingSequence",
        "Ticks all its children in every tick, those that have succeeded as well; succeeds when all do in one tick.",
        Semantics(outcomes.nonblocking, Order.TOGETHER),
        skipping=_HANDLED,
    ),
    _free_node(
        "PersistentSequence",
        "A sequence whose place is kept in a key of the blackboard, so that it goes on there after a halt.",
        Semantics(outcomes.persistent, resumes=True),
        inout_port(
            "current_child_idx",
            int,
            "The key with the index of the child in hand, counted from 0; it has to be written before.",
        ),
        skipping=_HANDLED,
    ),
)


_PORT = re.compile(
    r"(?P<direction>\w+) (?P<type>\S+) (?P<name>\w+)(?P<has_default> =(?: (?P<default>[^\s\[]\S*))?)?(?: \[(?P<versions>[\w ]+)\])?"
)
_DIRECTIONS = {"in": Direction.INPUT, "out": Direction.OUTPUT}


def _specs_of_described_nodes(version: str) -> Iterator[NodeSpec]:
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
