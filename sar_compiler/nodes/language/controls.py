"""Controls: nodes with several children."""

from dataclasses import replace

from sar_compiler.nodes import outcome_sets
from sar_compiler.nodes.btcpp import rewrites
from sar_compiler.nodes.declaring import ENUMS, attribute, input_port, signature
from sar_compiler.nodes.language.attribute_readers import after_the_first, one_after_the_other
from sar_compiler.nodes.language.narrow_types import NAMES, PolicyName
from sar_compiler.nodes.language.node_rules import report_interruptions, report_policy, within_reach
from sar_compiler.nodes.semantics import Counterpart, Semantics
from sar_compiler.nodes.spec import Kind, NodeSpec, Parameter, Skipping, Skips

_ALL = frozenset({"SUCCESS", "FAILURE", "RUNNING"})

_SEQUENCE = "Ticks its children in order until one does not succeed; succeeds when all have."
_SELECTOR = "Ticks its children in order until one does not fail; fails when all have."
_REACTIVE = "Looks at every child again in every tick."
_PAUSES = "Lets the rest of the robot have a turn after every child."
_MEMORY = "Whether to go on with the child that was running (true), or to look at every child again (false)."


def _ordered(
    tag: str, counterpart: Counterpart, *former_tags: str, is_sequence: bool, memory: bool | None
) -> NodeSpec:
    """Return a sequence or selector; *memory* is implied by its tag, or None if it is an attribute."""
    doc = _SEQUENCE if is_sequence else _SELECTOR
    if memory is None:
        signed = signature(Kind.CONTROL, doc, attribute("memory", bool, _MEMORY, default=True))
    else:
        implied = attribute("memory", bool, _MEMORY)
        signed = signature(Kind.CONTROL, f"{doc} {_REACTIVE}", implied, fixed={"memory": memory})
    return NodeSpec(
        tag,
        f"py_trees.composites:{'Sequence' if is_sequence else 'Selector'}",
        Kind.CONTROL,
        _ALL,
        semantics=replace(
            _IN_ORDER[is_sequence], counterpart=counterpart, with_memory=_REMEMBERING[is_sequence]
        ),
        skipping=Skipping(
            Skips.FROM_CHILD, f"sar_compiler.runtime.controls:{'Sequence' if is_sequence else 'Fallback'}"
        ),
        signature=signed,
        former_tags=former_tags,
        rule=report_interruptions if is_sequence else None,
    )


_IN_ORDER = {True: Semantics.sequence(), False: Semantics.selector()}
_REMEMBERING = {True: "Sequence", False: "Fallback"}
_REACTIVE_ONE = Counterpart(built_in=True, rewrite=rewrites.reactive)


def _by_memory(with_memory: str, without: str, *, built_in: bool = True) -> Counterpart:
    return Counterpart(built_in, rewrites.by_memory(with_memory, without))


def _own(
    tag: str,
    path: str,
    semantics: Semantics,
    doc: str,
    *parameters: Parameter,
    former_tags: tuple[str, ...] = (),
    **more: object,
) -> NodeSpec:
    """Return a BehaviorTree.CPP control that py_trees does not have; *path* is that of its class in `runtime`."""
    return NodeSpec(
        tag,
        f"sar_compiler.runtime.{path}",
        Kind.CONTROL,
        _ALL,
        semantics=replace(semantics, counterpart=semantics.counterpart._replace(built_in=True)),
        skipping=Skipping(Skips.FROM_CHILD),
        signature=signature(Kind.CONTROL, doc, *parameters),
        former_tags=former_tags,
        **more,  # type: ignore[arg-type]
    )


def _switch(cases: int) -> NodeSpec:
    ordinals = ("first", "second", "third", "fourth", "fifth", "sixth")[:cases]
    return _own(
        f"Switch{cases}",
        "controls:Switch",
        Semantics(outcome_sets.selection),
        "Ticks the child whose case is equal to a variable, and the last one if none is.",
        input_port(
            "variable",
            str,
            "What to compare with the cases: as text, as a whole number or a name of an enumeration, or as a real "
            "number. Without a value, none of them is equal.",
        ),
        ENUMS,
        *(
            input_port(f"case_{number}", str, f"The {ordinal} child's case.")
            for number, ordinal in enumerate(ordinals, 1)
        ),
        child_count=(cases + 1, cases + 1),
    )


def _branching(tag: str, doc: str) -> NodeSpec:
    means = Semantics(outcome_sets.branches, gates=after_the_first)
    return _own(tag, f"controls:{tag}", means, doc, child_count=(2, 3))


SPECS = [
    _ordered("Sequence", _by_memory("Sequence", "ReactiveSequence"), is_sequence=True, memory=None),
    _ordered(
        "Selector",
        _by_memory("Fallback", "ReactiveFallback", built_in=False),
        "Chooser",
        is_sequence=False,
        memory=None,
    ),
    _ordered(
        "Fallback", _by_memory("Fallback", "ReactiveFallback"), "FallbackStar", is_sequence=False, memory=None
    ),
    _ordered("ReactiveSequence", _REACTIVE_ONE, is_sequence=True, memory=False),
    _ordered("ReactiveFallback", _REACTIVE_ONE, "ReactiveSelector", is_sequence=False, memory=False),
    _own(
        "AsyncSequence",
        "controls:AsyncSequence",
        Semantics.sequence(pauses=True),
        f"{_SEQUENCE} {_PAUSES}",
    ),
    _own(
        "AsyncFallback",
        "controls:AsyncFallback",
        Semantics.selector(pauses=True),
        f"{_SELECTOR} {_PAUSES}",
    ),
    _own(
        "SequenceWithMemory",
        "controls:SequenceWithMemory",
        Semantics.sequence(pauses=True, keeps_place=True),
        "A sequence that goes on with the child that failed or was halted when it is started again.",
        former_tags=("SequenceStar",),
    ),
    _own(
        "Parallel",
        "controls:Parallel",
        replace(
            Semantics.parallel(outcome_sets.counting),
            counterpart=Counterpart(built_in=True, rewrite=rewrites.parallel),
        ),
        "Succeeds after success_count successes; fails after failure_count failures or when success is out of reach.",
        input_port(
            "success_count",
            int,
            "How many successes make a success; negative: counted from the end, -1 is all, and then a skipped child "
            "counts as one that succeeded.",
            -1,
        ),
        input_port(
            "failure_count",
            int,
            "How many failures make a failure; negative: counted from the end.",
            1,
        ),
        former_attributes={
            "threshold": "success_count",
            "success_threshold": "success_count",
            "failure_threshold": "failure_count",
        },
        rule=within_reach("success_count", "failure_count"),
    ),
    NodeSpec(
        "Parallel",
        "py_trees.composites:Parallel",
        Kind.CONTROL,
        _ALL,
        semantics=replace(Semantics.parallel(outcome_sets.by_policy), counterpart=Counterpart(built_in=True)),
        skipping=Skipping(advice='success_count="..."'),
        signature=signature(
            Kind.CONTROL,
            "Ticks all its children in every tick; fails as soon as one of them does.",
            attribute(
                "policy",
                PolicyName,
                "Which children have to succeed; those still running then are interrupted.",
            ),
            attribute(
                "synchronise",
                bool,
                "Whether a child that has succeeded waits for the others, instead of being started again; not for "
                "`SuccessOnOne`. Where it is not written, it does.",
                None,
            ),
            attribute(
                "selected",
                NAMES,
                "The names of the children that have to succeed, for `SuccessOnSelected`: `left;right`.",
                None,
            ),
            factory="sar_compiler.nodes.language.py_trees_nodes:stock_parallel",
        ),
        variant=True,
        rule=report_policy,
    ),
    _own(
        "ParallelAll",
        "controls:ParallelAll",
        Semantics.parallel(outcome_sets.counting_all),
        "Waits for all children, then fails if too many of them have failed.",
        input_port(
            "max_failures",
            int,
            "With how many failures it fails; negative: counted from the end, 0: always.",
            1,
        ),
        rule=within_reach("max_failures"),
    ),
    _branching(
        "IfThenElse",
        "Ticks its second child if the first one succeeds, else the third; asks the first one only once.",
    ),
    _branching(
        "WhileDoElse",
        "Ticks its second child as long as the first one succeeds, and the third as long as it fails.",
    ),
    *(_switch(cases) for cases in range(2, 7)),
    _own(
        "TryCatch",
        "controls:TryCatch",
        Semantics(outcome_sets.attempt, gates=one_after_the_other, counterpart=Counterpart(since="4.9")),
        "Ticks its children in order but for the last one, which is ticked when one of them has failed.",
        input_port(
            "catch_on_halt",
            bool,
            "Whether to tick the last child, once, also when the node is halted.",
            default=False,
        ),
        child_count=(2, None),
    ),
]
