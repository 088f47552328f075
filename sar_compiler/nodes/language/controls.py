"""Controls: nodes with several children."""

from collections.abc import Mapping
from functools import partial

from sar_compiler.nodes import outcome_sets
from sar_compiler.nodes.btcpp import rewrites
from sar_compiler.nodes.collector import NodeView
from sar_compiler.nodes.declaring import ENUMS, attribute, input_port, node_spec
from sar_compiler.nodes.language.narrow_types import NAMES, PolicyName
from sar_compiler.nodes.language.node_rules import (
    FROM_CHILD,
    language_spec,
    report_excessive_counts,
    report_interruptions,
    report_policy,
    stock,
)
from sar_compiler.nodes.outcome_sets import F, K, S
from sar_compiler.nodes.semantics import Counterpart, Gate, Semantics
from sar_compiler.nodes.spec import Kind, NodeSpec, SkipPossibility, SkipSupport

_SEQUENCE = "Ticks its children in order until one does not succeed. Succeeds when all have succeeded."
_SELECTOR = "Ticks its children in order until one does not fail. Fails when all have failed."
_REACTIVE = "Starts at the first child in every tick."
_PAUSES = "Returns RUNNING after each child, so that other branches are ticked in between."
_MEMORY = (
    "If true, the next tick resumes at the running child. If false, the next tick starts at the first child."
)

_own = partial(language_spec, Kind.CONTROL, skipping=FROM_CHILD)


def _first_child_gates(_bound: NodeView) -> Mapping[int, Gate]:
    """Return the gates of the branches. Each gate requires a result of the first child."""
    return {1: Gate((0,), S), 2: Gate((0,), F)}


def _try_catch_gates(bound: NodeView) -> Mapping[int, Gate]:
    """Return the gates of a `TryCatch`, whose last child handles a failure of the other children."""
    *tried, last = range(len(bound.children))
    catches = {last: Gate(tuple(tried), F)} if bound.value("catch_on_halt") is False else {}
    return {**{number: Gate((number - 1,), S | K) for number in tried[1:]}, **catches}


def _sequential_control(
    tag: str, counterpart: Counterpart, *former_tags: str, is_sequence: bool, memory: bool | None
) -> NodeSpec:
    """Return the spec of a sequence or selector; *memory* is the value implied by the tag, or None."""
    if is_sequence:
        doc, stock_class, own_class = _SEQUENCE, "Sequence", "Sequence"
        means, rule = Semantics.sequence(), report_interruptions
    else:
        doc, stock_class, own_class = _SELECTOR, "Selector", "Fallback"
        means, rule = Semantics.selector(), None
    implied = {} if memory is None else {"memory": memory}
    parameter = attribute("memory", bool, _MEMORY, default=True if memory is None else ...)
    return node_spec(
        Kind.CONTROL,
        tag,
        f"py_trees.composites:{stock_class}",
        doc if memory is None else f"{doc} {_REACTIVE}",
        parameter,
        fixed=implied,
        semantics=means._replace(counterpart=counterpart, with_memory=own_class),
        skipping=SkipSupport(SkipPossibility.FROM_CHILD, _own(tag, f"stock:{own_class}", doc)),
        former_tags=former_tags,
        rule=rule,
    )


_REACTIVE_ONE = Counterpart(built_in=True, rewrite=rewrites.reactive)


def _memory_counterpart(with_memory: str, without: str, *, built_in: bool = True) -> Counterpart:
    return Counterpart(built_in, partial(rewrites.select_tag_by_memory, with_memory, without))


def _switch(cases: int) -> NodeSpec:
    ordinals = ("first", "second", "third", "fourth", "fifth", "sixth")[:cases]
    return _own(
        f"Switch{cases}",
        "kernel.branching:SwitchNode",
        "Ticks the child whose case matches the variable, or the last child if no case matches.",
        input_port(
            "variable",
            str,
            "The value to compare with the cases. A case matches if both are equal as strings, integers, enumeration names "
            "or real numbers. If the variable has no value, no case matches.",
        ),
        ENUMS,
        *(
            input_port(f"case_{number}", str, f"The case for the {ordinal} child.")
            for number, ordinal in enumerate(ordinals, 1)
        ),
        semantics=Semantics(outcome_sets.selection),
        child_count=(cases + 1, cases + 1),
    )


def _branching_spec(tag: str, doc: str) -> NodeSpec:
    means = Semantics(outcome_sets.branches, gates=_first_child_gates)
    return _own(tag, f"kernel.branching:{tag}Node", doc, semantics=means, child_count=(2, 3))


SPECS = [
    _sequential_control(
        "Sequence", _memory_counterpart("Sequence", "ReactiveSequence"), is_sequence=True, memory=None
    ),
    _sequential_control(
        "Selector",
        _memory_counterpart("Fallback", "ReactiveFallback", built_in=False),
        "Chooser",
        is_sequence=False,
        memory=None,
    ),
    _sequential_control(
        "Fallback",
        _memory_counterpart("Fallback", "ReactiveFallback"),
        "FallbackStar",
        is_sequence=False,
        memory=None,
    ),
    _sequential_control("ReactiveSequence", _REACTIVE_ONE, is_sequence=True, memory=False),
    _sequential_control(
        "ReactiveFallback", _REACTIVE_ONE, "ReactiveSelector", is_sequence=False, memory=False
    ),
    _own(
        "AsyncSequence",
        "stock:AsyncSequence",
        f"{_SEQUENCE} {_PAUSES}",
        semantics=Semantics.sequence(pauses=True),
    ),
    _own(
        "AsyncFallback",
        "stock:AsyncFallback",
        f"{_SELECTOR} {_PAUSES}",
        semantics=Semantics.selector(pauses=True),
    ),
    _own(
        "SequenceWithMemory",
        "stock:SequenceWithMemory",
        "A sequence that starts with the failed or halted child when it is started again.",
        semantics=Semantics.sequence(pauses=True, keeps_place=True),
        former_tags=("SequenceStar",),
    ),
    _own(
        "Parallel",
        "kernel.counting:ParallelNode",
        "Succeeds when success_count children have succeeded. Fails when failure_count children have failed, or when it can no "
        "longer succeed.",
        input_port(
            "success_count",
            int,
            "Required number of successes. A negative number counts down from the number of children: -1 means all, -2 "
            "all but one. Skipped children then count as successes.",
            -1,
        ),
        input_port(
            "failure_count",
            int,
            "Number of failed children at which the node fails. -1 means all children, -2 all but one, and so on.",
            1,
        ),
        semantics=Semantics.parallel(
            outcome_sets.counting_results, ("success_count", "failure_count")
        )._replace(counterpart=Counterpart(rewrite=rewrites.parallel)),
        former_attributes={
            "threshold": "success_count",
            "success_threshold": "success_count",
            "failure_threshold": "failure_count",
        },
        rule=report_excessive_counts,
    ),
    stock(
        Kind.CONTROL,
        "Parallel",
        "Ticks all its children in every tick. Fails when one of its children fails.",
        attribute(
            "policy",
            PolicyName,
            "The children that must succeed. When they have succeeded, the children that are still running are halted.",
        ),
        attribute(
            "synchronise",
            bool,
            "If true (the default), a child that has succeeded waits for the other children. If false, it is started again. "
            "Not allowed with `SuccessOnOne`.",
            None,
        ),
        attribute(
            "selected",
            NAMES,
            "The names of the children that must succeed, for `SuccessOnSelected`: `left;right`.",
            None,
        ),
        made_by="parallel",
        instead='success_count="..."',
        semantics=Semantics.parallel(outcome_sets.parallel_by_policy)._replace(
            counterpart=Counterpart(built_in=True)
        ),
        variant=True,
        rule=report_policy,
    ),
    _own(
        "ParallelAll",
        "kernel.counting:ParallelAllNode",
        "Waits until all children have ended, then fails if too many of them have failed.",
        input_port(
            "max_failures",
            int,
            "Number of failed children at which the node fails. -1 means all children, -2 all but one, and so on. With "
            "0 the node always fails.",
            1,
        ),
        semantics=Semantics.parallel(outcome_sets.parallel_all, ("max_failures",)),
        rule=report_excessive_counts,
    ),
    _branching_spec(
        "IfThenElse",
        "Ticks its second child if the first child succeeds, otherwise the third child. The first child is ticked only until it completes.",
    ),
    _branching_spec(
        "WhileDoElse",
        "Ticks its second child as long as the first child succeeds, and its third child as long as the first child fails.",
    ),
    *(_switch(cases) for cases in range(2, 7)),
    _own(
        "TryCatch",
        "kernel.branching:TryCatchNode",
        "Ticks all children except the last in order. If one of them fails, ticks the last child, then fails.",
        input_port(
            "catch_on_halt",
            bool,
            "Whether to tick the last child once when the node is halted.",
            default=False,
        ),
        semantics=Semantics(
            outcome_sets.attempt, gates=_try_catch_gates, counterpart=Counterpart(since="4.9")
        ),
        child_count=(2, None),
    ),
]
