"""Controls: nodes with several children."""

from dataclasses import replace
from typing import Literal

from py_trees import composites
from py_trees.behaviour import Behaviour
from py_trees.common import ParallelPolicy
from py_trees.decorators import OneShot

from sar_compiler.nodes import outcome_sets
from sar_compiler.nodes.btcpp import rewrites
from sar_compiler.nodes.language.attribute_readers import after_the_first, one_after_the_other
from sar_compiler.nodes.language.narrow_types import NAMES
from sar_compiler.nodes.language.node_rules import (
    HOW_TO_SELECT,
    clash_with,
    place_of,
    report_interruptions,
    report_policy,
    within_reach,
)
from sar_compiler.nodes.semantics import Counterpart, Semantics
from sar_compiler.nodes.spec import Kind, NodeSpec, Signature, Skipping, Skips
from sar_compiler.runtime import branches, controls, parallel
from sar_compiler.runtime.conditions import Conditions

_ALL = frozenset({"SUCCESS", "FAILURE", "RUNNING"})

_SEQUENCE = "Ticks its children in order until one does not succeed; succeeds when all have."
_SELECTOR = "Ticks its children in order until one does not fail; fails when all have."
_REACTIVE = "Looks at every child again in every tick."
_PAUSES = "Lets the rest of the robot have a turn after every child."

_PARAMETER_DOCS = {
    "name": "The node's name.",
    "memory": "Whether to go on with the child that was running (true), or to look at every child again (false).",
}


def _ordered(
    tag: str, counterpart: Counterpart, *former_tags: str, is_sequence: bool, memory: bool | None
) -> NodeSpec:
    """Return a sequence or selector; *memory* is implied by its tag, or None if it is an attribute."""
    doc = _SEQUENCE if is_sequence else _SELECTOR
    return NodeSpec(
        tag,
        composites.Sequence if is_sequence else composites.Selector,
        Kind.CONTROL,
        _ALL,
        semantics=replace(
            _IN_ORDER[is_sequence], counterpart=counterpart, with_memory=_REMEMBERING[is_sequence]
        ),
        skipping=Skipping(Skips.FROM_CHILD, controls.Sequence if is_sequence else controls.Fallback),
        signature=Signature(
            doc=doc if memory is None else f"{doc} {_REACTIVE}",
            defaults={"memory": True} if memory is None else {},
            fixed={} if memory is None else {"memory": memory},
            parameter_docs=_PARAMETER_DOCS,
        ),
        former_tags=former_tags,
        rule=report_interruptions if is_sequence else None,
    )


_IN_ORDER = {True: Semantics.sequence(), False: Semantics.selector()}
_REMEMBERING = {True: "Sequence", False: "Fallback"}
_REACTIVE_ONE = Counterpart(built_in=True, rewrite=rewrites.reactive)


def _by_memory(with_memory: str, without: str, *, built_in: bool = True) -> Counterpart:
    return Counterpart(built_in, rewrites.by_memory(with_memory, without))


def _own(tag: str, cls: type, semantics: Semantics, *former_tags: str, **more: object) -> NodeSpec:
    """Return a BehaviorTree.CPP control that py_trees does not have."""
    return NodeSpec(
        tag,
        cls,
        Kind.CONTROL,
        _ALL,
        semantics=replace(semantics, counterpart=semantics.counterpart._replace(built_in=True)),
        skipping=Skipping(Skips.FROM_CHILD),
        former_tags=former_tags,
        **more,  # type: ignore[arg-type]
    )


def _switch(cases: int) -> NodeSpec:
    names = [f"case_{number}" for number in range(1, 7)]
    return _own(
        f"Switch{cases}",
        branches.Switch,
        Semantics(outcome_sets.selection),
        signature=Signature(hidden=frozenset(names[cases:]), required=frozenset(names[:cases])),
        child_count=(cases + 1, cases + 1),
    )


Policy = Literal["SuccessOnAll", "SuccessOnOne", "SuccessOnSelected"]
"""The children of a Parallel that have to succeed, by py_trees' names."""


def stock_parallel(
    name: str,
    children: list[Behaviour],
    policy: Policy,
    synchronise: bool | None = None,
    selected: list[str] | None = None,
) -> composites.Parallel:
    """Ticks all its children in every tick; fails as soon as one of them does.

    Args:
        name: The node's name.
        children: The children.
        policy: Which children have to succeed; those still running then are interrupted.
        synchronise: Whether a child that has succeeded waits for the others, instead of being started again; not
            for `SuccessOnOne`. Where it is not written, it does.
        selected: The names of the children that have to succeed, for `SuccessOnSelected`: `left;right`.

    Raises:
        ValueError: If a name is not that of one child, or an attribute does not go with the policy.
    """
    clash = clash_with(policy, synchronise, is_selected=selected is not None)
    if clash is not None:
        raise ValueError(": ".join(clash))
    if policy == "SuccessOnOne":
        return composites.Parallel(name, ParallelPolicy.SuccessOnOne(), children)
    waits = synchronise is not False
    if policy == "SuccessOnAll":
        return composites.Parallel(name, ParallelPolicy.SuccessOnAll(waits), children)
    if not selected:
        message = f"selected: no child is named; {HOW_TO_SELECT}"
        raise ValueError(message)
    names = [_written_name(child) for child in children]
    chosen = [children[place_of(text, names)] for text in selected]
    return composites.Parallel(name, ParallelPolicy.SuccessOnSelected(chosen, waits), children)


def _written_name(child: Behaviour) -> str:
    """Return a child's name as written in the file, without the wrappers of `oneshot` and conditions."""
    if isinstance(child, Conditions):
        return child.decorated.name
    if isinstance(child, OneShot):
        inner = _written_name(child.decorated)
        return inner if child.name == f"{inner}OneShot" else child.name
    return child.name


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
        controls.AsyncSequence,
        Semantics.sequence(pauses=True),
        signature=Signature(doc=f"{_SEQUENCE} {_PAUSES}"),
    ),
    _own(
        "AsyncFallback",
        controls.AsyncFallback,
        Semantics.selector(pauses=True),
        signature=Signature(doc=f"{_SELECTOR} {_PAUSES}"),
    ),
    _own(
        "SequenceWithMemory",
        controls.SequenceWithMemory,
        Semantics.sequence(pauses=True, keeps_place=True),
        "SequenceStar",
    ),
    _own(
        "Parallel",
        parallel.Parallel,
        replace(
            Semantics.parallel(outcome_sets.counting),
            counterpart=Counterpart(built_in=True, rewrite=rewrites.parallel),
        ),
        signature=Signature(defaults={"success_count": -1, "failure_count": 1}),
        former_attributes={
            "threshold": "success_count",
            "success_threshold": "success_count",
            "failure_threshold": "failure_count",
        },
        rule=within_reach("success_count", "failure_count"),
    ),
    NodeSpec(
        "Parallel",
        composites.Parallel,
        Kind.CONTROL,
        _ALL,
        semantics=replace(Semantics.parallel(outcome_sets.by_policy), counterpart=Counterpart(built_in=True)),
        skipping=Skipping(advice='success_count="..."'),
        signature=Signature(factory=stock_parallel, types={"selected": NAMES}),
        variant=True,
        rule=report_policy,
    ),
    _own(
        "ParallelAll",
        parallel.ParallelAll,
        Semantics.parallel(outcome_sets.counting_all),
        signature=Signature(defaults={"max_failures": 1}),
        rule=within_reach("max_failures"),
    ),
    *(
        _own(cls.__name__, cls, Semantics(outcome_sets.branches, gates=after_the_first), child_count=(2, 3))
        for cls in (branches.IfThenElse, branches.WhileDoElse)
    ),
    *(_switch(cases) for cases in range(2, 7)),
    _own(
        "TryCatch",
        branches.TryCatch,
        Semantics(outcome_sets.attempt, gates=one_after_the_other, counterpart=Counterpart(since="4.9")),
        signature=Signature(defaults={"catch_on_halt": False}),
        child_count=(2, None),
    ),
]
