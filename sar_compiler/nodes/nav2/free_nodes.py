"""The controls and decorators of Nav2 that are the same without Nav2: what they do depends on their children and on time."""

from dataclasses import replace

from sar_compiler.nodes.nav2 import outcomes
from sar_compiler.nodes.nav2.types import of_port
from sar_compiler.nodes.outcome_sets import S
from sar_compiler.nodes.semantics import Counterpart, Order, Semantics
from sar_compiler.nodes.spec import Kind, NodeSpec, Signature, Skipping, Skips
from sar_compiler.nodes.values import PLAIN, REAL_NUMBER
from sar_compiler.runtime import nav2

_ALL = frozenset({"SUCCESS", "FAILURE", "RUNNING"})
IN_CPP = Counterpart(hint="")
"""Nav2 has the node itself."""
_RATE, _RETRIES = of_port("hz", REAL_NUMBER), of_port("number_of_retries", PLAIN["integer"])


def specs(version: str) -> list[NodeSpec]:
    """Return the records of these nodes in a distribution."""
    return [*_EVERYWHERE, *(_MAIN if version == "main" else _BEFORE_MAIN)]


def _control(
    cls: type, semantics: Semantics, skips: Skips = Skips.FROM_CHILD, tag: str = "", **more: object
) -> NodeSpec:
    skipping = Skipping(skips)
    return NodeSpec(
        tag or cls.__name__,
        cls,
        Kind.CONTROL,
        _ALL,
        semantics=replace(semantics, counterpart=IN_CPP),
        skipping=skipping,
        **more,  # type: ignore[arg-type]
    )


def _decorator(cls: type, semantics: Semantics, **more: object) -> NodeSpec:
    skipping = Skipping(Skips.FROM_CHILD)
    return NodeSpec(
        cls.__name__,
        cls,
        Kind.DECORATOR,
        _ALL,
        semantics=replace(semantics, counterpart=IN_CPP),
        skipping=skipping,
        **more,  # type: ignore[arg-type]
    )


_EVERYWHERE: tuple[NodeSpec, ...] = (
    _control(
        nav2.RecoveryNode,
        Semantics(outcomes.recovery, gates=outcomes.after_a_failure, resumes=True),
        signature=Signature(defaults={"number_of_retries": 1}, types={"number_of_retries": _RETRIES}),
        child_count=(2, 2),
    ),
    _control(nav2.PipelineSequence, Semantics(outcomes.pipeline, Order.IN_ORDER, S)),
    _decorator(
        nav2.RateController,
        Semantics(outcomes.now_and_then(), steady=True),
        signature=Signature(defaults={"hz": 10.0}, types={"hz": _RATE}),
    ),
    _decorator(nav2.SingleTrigger, Semantics(outcomes.once_until_reset, steady=True)),
)

_BEFORE_MAIN: tuple[NodeSpec, ...] = (
    _control(
        nav2.WrappingRoundRobin,
        Semantics(outcomes.round_robin(wraps=True), resumes=True),
        tag=nav2.RoundRobin.__name__,
    ),
)

_MAIN: tuple[NodeSpec, ...] = (
    _control(
        nav2.RoundRobin,
        Semantics(outcomes.round_robin(wraps=None), resumes=True),
        signature=Signature(defaults={"wrap_around": False}),
    ),
    _control(nav2.NonblockingSequence, Semantics(outcomes.nonblocking, Order.TOGETHER), Skips.NEVER),
    _control(nav2.PersistentSequence, Semantics(outcomes.persistent, resumes=True), Skips.NEVER),
)
