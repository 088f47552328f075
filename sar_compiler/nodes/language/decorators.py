"""Decorators: nodes with one child."""

from collections.abc import Mapping
from dataclasses import replace

from sar_compiler.nodes import outcome_sets
from sar_compiler.nodes.binding.attributes import ONESHOT_TYPE
from sar_compiler.nodes.btcpp import rewrites
from sar_compiler.nodes.declaring import (
    CLOCK,
    ENUMS,
    SCOPE,
    attribute,
    inout_port,
    input_port,
    output_port,
    signature,
)
from sar_compiler.nodes.language.attribute_readers import failures, successes, within
from sar_compiler.nodes.language.narrow_types import KEY, VARIABLE, StatusName, queue_of
from sar_compiler.nodes.outcome_sets import BITS, F, K, R, S
from sar_compiler.nodes.semantics import NO_HINT, WRITES, AccessKind, Counterpart, KeyRole, Semantics
from sar_compiler.nodes.spec import Kind, NodeSpec, Parameter, Skipping, Skips
from sar_compiler.nodes.values import CONDITION, MILLISECONDS, SECONDS, type_of
from sar_compiler.runtime.chosen_outcome import Outcome
from sar_compiler.tree.model import SUBTREE_TAG

_ALL = frozenset({"SUCCESS", "FAILURE", "RUNNING"})
_NOUNS = {S: "success", F: "failure", R: "running"}


def _rewritten(semantics: Semantics, rewrite: rewrites.Rewrite, *, built_in: bool = True) -> Semantics:
    """Return semantics with what the node becomes in BehaviorTree.CPP."""
    return replace(semantics, counterpart=Counterpart(built_in, rewrite))


def _results_after(turns: Mapping[int, int]) -> frozenset[str]:
    """Return the outcomes of a decorator that replaces some results of its child."""
    results = {turns.get(each, each) for each in (S, F, R)}
    return frozenset(name for name, bit in BITS.items() if bit in results)


def _own(
    tag: str,
    path: str,
    semantics: Semantics,
    doc: str,
    *parameters: Parameter,
    skipping: Skipping = Skipping(Skips.FROM_CHILD),  # noqa: B008 - frozen
    outcomes: frozenset[str] = _ALL,
    former_tags: tuple[str, ...] = (),
) -> NodeSpec:
    """Return a decorator of BehaviorTree.CPP's; *path* is that of its class in `runtime`, or in py_trees."""
    return NodeSpec(
        tag,
        path if path.startswith("py_trees.") else f"sar_compiler.runtime.{path}",
        Kind.DECORATOR,
        outcomes,
        semantics=replace(semantics, counterpart=semantics.counterpart._replace(built_in=True)),
        skipping=skipping,
        signature=signature(Kind.DECORATOR, doc, *parameters),
        former_tags=former_tags,
    )


def _shared(
    tag: str,
    stock: str,
    doc: str,
    turns: Mapping[int, int],
    possible: Skips = Skips.FROM_CHILD,
    repeats: int = 0,
) -> NodeSpec:
    """Return a decorator of BehaviorTree.CPP's that is py_trees' own, called *stock* there, unless its child can skip."""
    semantics = replace(Semantics.turning(turns), repeats=repeats)
    skipping = Skipping(possible, f"sar_compiler.runtime.decorators:{tag}")
    return _own(
        tag,
        f"py_trees.decorators:{stock}",
        semantics,
        doc,
        skipping=skipping,
        outcomes=_results_after(turns),
    )


def _stock(
    tag: str,
    doc: str,
    semantics: Semantics,
    *parameters: Parameter,
    outcomes: frozenset[str] = _ALL,
    instead: str = "",
    effects: str = "",
    made_by: str = "",
    variant: bool = False,
) -> NodeSpec:
    """Return a py_trees decorator; *made_by* names a function of `py_trees_nodes` in place of its constructor."""
    factory = f"sar_compiler.nodes.language.py_trees_nodes:{made_by}" if made_by else ""
    return NodeSpec(
        tag,
        f"py_trees.decorators:{tag}",
        Kind.DECORATOR,
        outcomes,
        effects,
        semantics=semantics,
        skipping=Skipping(advice=instead),
        signature=signature(Kind.DECORATOR, doc, *parameters, factory=factory),
        variant=variant,
    )


def _turning(tag: str, old: int, new: int, instead: str = "", hint: str = NO_HINT) -> NodeSpec:
    """Return a py_trees decorator that replaces one result of its child."""
    turns = {old: new}
    rewrite = rewrites.renamed(instead) if instead else None
    semantics = replace(Semantics.turning(turns), counterpart=Counterpart(rewrite=rewrite, hint=hint))
    doc = f"Turns {_NOUNS[old]} into {_NOUNS[new]}."
    return _stock(tag, doc, semantics, outcomes=_results_after(turns), instead=instead)


def _unless_updated(own: int) -> Semantics:
    """Return the semantics of a decorator that returns a status of its own until an entry is written."""
    return Semantics(
        outcome_sets.adding(own),
        keys={"entry": KeyRole(AccessKind.PEEK, by_name=True)},
    )


def _loop(tag: str, kind: type, item: str, items: str, example: str) -> NodeSpec:
    return _own(
        tag,
        f"decorators:{tag}",
        Semantics(outcome_sets.loop, keys={"queue": KeyRole(AccessKind.PEEK)}),
        f"Ticks its child once for each {item} of a queue.",
        input_port(
            "queue",
            queue_of(tag, kind),
            f"The {items}s: `{example}`, or an entry with such a text, a list, or a `collections.deque`, of which the items "
            "are taken away.",
        ),
        output_port("value", type_of(kind), f"Where each {items} is written.", None),
        input_port("if_empty", Outcome, "What to answer when none is left.", None),
        skipping=Skipping(Skips.ALWAYS, only_if=("if_empty", Outcome.SKIPPED)),
    )


_ENTRY = input_port("entry", object, "The entry.")
_WRITTEN = KeyRole(AccessKind.WRITE)

BEHAVIORTREE_CPP = [
    _shared("Inverter", "Inverter", "Turns success into failure and failure into success.", {S: F, F: S}),
    _shared("ForceSuccess", "FailureIsSuccess", "Succeeds whenever its child ends.", {F: S}),
    _shared("ForceFailure", "SuccessIsFailure", "Fails whenever its child ends.", {S: F}),
    _shared(
        "KeepRunningUntilFailure",
        "SuccessIsRunning",
        "Starts its child again after every success, until it fails.",
        {S: R, K: R},
        Skips.NEVER,
        repeats=S,
    ),
    _own(
        "Repeat",
        "decorators:Repeat",
        _rewritten(Semantics.repeating(S, "num_cycles"), rewrites.repeat),
        "Repeats its child until it has succeeded num_cycles times; a failure ends it.",
        input_port(
            "num_cycles",
            int,
            "How many successes; -1: without an end, 0: none, and the node succeeds at once.",
        ),
    ),
    _own(
        "RetryUntilSuccessful",
        "decorators:RetryUntilSuccessful",
        Semantics.repeating(F, "num_attempts"),
        "Retries its child until it has failed num_attempts times; a success ends it.",
        input_port(
            "num_attempts",
            int,
            "How many failures; -1: without an end, 0: none, and the node fails at once. Read again after each failure, "
            "because the child may have changed it.",
        ),
    ),
    _own(
        "RunOnce",
        "decorators:RunOnce",
        Semantics(outcome_sets.run_once, once=True),
        "Lets its child end once; from then on it is skipped, or answers what the child did.",
        input_port(
            "then_skip",
            bool,
            "Whether to be skipped afterwards (true), or to answer the same again (false).",
            default=True,
        ),
        skipping=Skipping(Skips.ALWAYS, only_if=("then_skip", True)),
    ),
    _own(
        "Delay",
        "timers:Delay",
        Semantics(outcome_sets.adding(R), steady=True),
        "Waits before it ticks its child for the first time.",
        input_port("delay_msec", MILLISECONDS, "How long to wait, in milliseconds."),
        CLOCK,
    ),
    _own(
        "Timeout",
        "timers:Timeout",
        _rewritten(Semantics.limiting(within), rewrites.timeout),
        "Fails if its child is still running after a time; the child is halted without another tick.",
        input_port(
            "msec",
            MILLISECONDS,
            "How long the child may run, in milliseconds; 0: as long as it likes.",
        ),
        CLOCK,
    ),
    _own(
        "Precondition",
        "script_nodes:Precondition",
        Semantics(outcome_sets.guard("if")),
        "Ticks its child if a condition is true when it starts; while the child runs, it does not ask again.",
        input_port("if_", CONDITION, "The condition, a script."),
        SCOPE,
        ENUMS,
        input_port("else_", Outcome, "What to answer if it is false.", None),
        skipping=Skipping(Skips.ALWAYS, only_if=("else", Outcome.SKIPPED)),
        former_tags=tuple(f"BlackboardCheck{kind}" for kind in ("Bool", "Double", "Int", "String")),
    ),
    _own(
        "SkipUnlessUpdated",
        "entries:SkipUnlessUpdated",
        _unless_updated(K),
        "Ticks its child if an entry was written since this node last looked, and is skipped if not.",
        _ENTRY,
        SCOPE,
        skipping=Skipping(Skips.ALWAYS),
    ),
    _own(
        "WaitValueUpdate",
        "entries:WaitValueUpdate",
        _unless_updated(R),
        "Ticks its child once an entry was written since this node last looked, and waits until then.",
        _ENTRY,
        SCOPE,
    ),
    _loop("LoopInt", int, "whole number", "number", "1;2;3"),
    _loop("LoopDouble", float, "real number", "number", "1.5;2;3"),
    _loop("LoopBool", bool, "truth value", "value", "true;false"),
    _loop("LoopString", str, "text", "text", "red;green"),
]

PY_TREES = [
    _stock(
        "OneShot",
        "Lets its child finish once; from then on answers what the child answered, without ticking it.",
        Semantics(
            outcome_sets.passing,
            once=True,
            counterpart=Counterpart(rewrite=rewrites.oneshot, hint=rewrites.NO_ONESHOT),
        ),
        attribute("policy", ONESHOT_TYPE, "What counts as finished: any end, or only success."),
        instead="RunOnce",
        made_by="one_shot",
    ),
    NodeSpec(
        "Timeout",
        "sar_compiler.runtime.timers:StockTimeout",
        Kind.DECORATOR,
        _ALL,
        semantics=_rewritten(Semantics.limiting("duration"), rewrites.timeout),
        skipping=Skipping(advice='msec="..."'),
        signature=signature(
            Kind.DECORATOR,
            "Fails if its child is still running after a time, measured on the mission's clock.",
            attribute("duration", SECONDS, "How long the child may run, in seconds."),
            CLOCK,
        ),
        variant=True,
    ),
    _stock(
        "Retry",
        "Ticks its child again after a failure, until it has failed too often.",
        _rewritten(Semantics.repeating(F, failures), rewrites.retry, built_in=False),
        attribute("num_failures", int, "With how many failures to fail; 1 or less: with the first one."),
        instead="RetryUntilSuccessful",
    ),
    _stock(
        "Repeat",
        "Ticks its child again after a success, until it has succeeded often enough.",
        _rewritten(Semantics.repeating(S, successes), rewrites.repeat),
        attribute("num_success", int, "With how many successes to succeed; 0 or less: never."),
        instead='num_cycles="..."',
        variant=True,
    ),
    _stock(
        "Condition",
        "Runs until its child returns a given status, then succeeds.",
        Semantics(outcome_sets.awaiting, steady=True),
        attribute("status", StatusName, "The status to wait for."),
        outcomes=frozenset({"SUCCESS", "RUNNING"}),
        made_by="condition",
    ),
    _stock(
        "Count",
        "Answers what its child answers, and counts how often it was ticked and how it ended.",
        Semantics.passing(),
    ),
    _stock(
        "EternalGuard",
        "Ticks its child as long as a condition is true; when it is not, interrupts the child and fails.",
        Semantics(
            outcome_sets.guard("condition"),
            counterpart=Counterpart(
                hint="a ReactiveSequence of a ScriptCondition and its child does the same"
            ),
        ),
        input_port(
            "condition",
            CONDITION,
            "The condition, a script; it is evaluated before every tick of the child.",
        ),
        SCOPE,
        ENUMS,
        made_by="eternal_guard",
    ),
    _stock("PassThrough", "Answers what its child answers.", Semantics.passing()),
    _stock(
        "StatusToBlackboard",
        "Writes its child's status to the blackboard in every tick, and returns it.",
        replace(Semantics.passing(), keys={"variable_name": _WRITTEN}),
        inout_port(
            "variable_name",
            VARIABLE,
            "The key to write, or `key.attribute` of an object that is there already.",
        ),
        SCOPE,
        effects=WRITES,
        made_by="status_to_blackboard",
    ),
    _stock(
        "ForEach",
        "Ticks its child for each item of a list in turn, until the child fails; needs py_trees 2.4.",
        Semantics(outcome_sets.each_item, keys={"target_key": _WRITTEN}),
        input_port("source_key", KEY, "The key of the list."),
        inout_port("target_key", KEY, "The key to which each item is written."),
        SCOPE,
        effects=WRITES,
        made_by="for_each",
    ),
    _turning("SuccessIsRunning", S, R, instead="KeepRunningUntilFailure"),
    _turning("SuccessIsFailure", S, F, instead="ForceFailure"),
    _turning("FailureIsSuccess", F, S, instead="ForceSuccess"),
    _turning("FailureIsRunning", F, R, hint=rewrites.NO_FAILURE_IS_RUNNING),
    _turning("RunningIsSuccess", R, S),
    _turning("RunningIsFailure", R, F),
]

SUBTREE = NodeSpec(
    SUBTREE_TAG,
    "py_trees.decorators:PassThrough",
    Kind.DECORATOR,
    _ALL,
    semantics=replace(Semantics.passing(), counterpart=Counterpart(built_in=True)),
    skipping=Skipping(Skips.FROM_CHILD, "sar_compiler.runtime.decorators:SubTree"),
    signature=signature(
        Kind.DECORATOR,
        "Another tree of the file. Its other attributes say which keys around it its keys stand for.",
    ),
    child_count=(0, 0),
    former_tags=("SubTreePlus",),
    former_attributes={"__shared_blackboard": "_autoremap", "__autoremap": "_autoremap"},
)
"""The node that a `SubTree` is compiled to; its attributes are handled by binding."""

SPECS = [*BEHAVIORTREE_CPP, *PY_TREES, SUBTREE]
