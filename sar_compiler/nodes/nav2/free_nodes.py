"""The controls and decorators of Nav2 that are the same without Nav2: what they do depends on their children and on time."""

from dataclasses import replace

from sar_compiler.nodes.declaring import CLOCK, inout_port, input_port, signature
from sar_compiler.nodes.nav2 import outcomes
from sar_compiler.nodes.nav2.types import of_port
from sar_compiler.nodes.outcome_sets import S
from sar_compiler.nodes.semantics import Counterpart, Order, Semantics
from sar_compiler.nodes.spec import Kind, NodeSpec, Parameter, Skipping, Skips
from sar_compiler.nodes.values import PLAIN, REAL_NUMBER

_ALL = frozenset({"SUCCESS", "FAILURE", "RUNNING"})
IN_CPP = Counterpart(hint="")
"""Nav2 has the node itself."""
_RATE, _RETRIES = of_port("hz", REAL_NUMBER), of_port("number_of_retries", PLAIN["integer"])


def specs(version: str) -> list[NodeSpec]:
    """Return the records of these nodes in a distribution."""
    return [*_EVERYWHERE, *(_MAIN if version == "main" else _BEFORE_MAIN)]


def _node(
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
    _node(
        "RecoveryNode",
        "Ticks its first child; when that fails, the second one, and after its success the first one again.",
        Semantics(outcomes.recovery, gates=outcomes.after_a_failure, resumes=True),
        input_port("number_of_retries", _RETRIES, "How often to recover; less than 0 counts as 1.", 1),
        child_count=(2, 2),
    ),
    _node(
        "PipelineSequence",
        "Ticks every child again in each tick, and the next one only when all before it have succeeded once.",
        Semantics(outcomes.pipeline, Order.IN_ORDER, S),
    ),
    _node(
        "RateController",
        "Ticks its child at a rate: at the start, while it runs, and when a period is over since it last succeeded.",
        Semantics(outcomes.now_and_then(), steady=True),
        CLOCK,
        input_port("hz", _RATE, "The rate, in hertz.", 10.0),
        kind=Kind.DECORATOR,
    ),
    _node(
        "SingleTrigger",
        "Lets its child end once; ticked again before it is reset or halted, it fails.",
        Semantics(outcomes.once_until_reset, steady=True),
        kind=Kind.DECORATOR,
    ),
)

_BEFORE_MAIN: tuple[NodeSpec, ...] = (
    _node(
        "RoundRobin",
        _IN_TURN,
        Semantics(outcomes.round_robin(wraps=True), resumes=True),
        cls="WrappingRoundRobin",
    ),
)

_MAIN: tuple[NodeSpec, ...] = (
    _node(
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
    _node(
        "NonblockingSequence",
        "Ticks all its children in every tick, those that have succeeded as well; succeeds when all do in one tick.",
        Semantics(outcomes.nonblocking, Order.TOGETHER),
        skipping=_HANDLED,
    ),
    _node(
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
