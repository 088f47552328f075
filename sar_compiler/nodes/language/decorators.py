"""Decorators: nodes with one child."""

import math
from collections.abc import Mapping
from functools import partial

from sar_compiler.nodes import outcome_sets
from sar_compiler.nodes.binding.attributes import ONESHOT_TYPE
from sar_compiler.nodes.btcpp import rewrites
from sar_compiler.nodes.collector import NodeView
from sar_compiler.nodes.cpp_names import STATUS
from sar_compiler.nodes.declaring import (
    CLOCK,
    ENUMS,
    SCOPE,
    attribute,
    inout_port,
    input_port,
    node_spec,
    output_port,
)
from sar_compiler.nodes.language.narrow_types import ANY_ENTRY, KEY, VARIABLE, StatusName, queue_of
from sar_compiler.nodes.language.node_rules import FROM_CHILD, language_spec, stock
from sar_compiler.nodes.outcome_sets import WORD_OF, F, K, R, S, milliseconds, number
from sar_compiler.nodes.semantics import NO_HINT, WRITES, AccessKind, Counterpart, KeyRole, Semantics
from sar_compiler.nodes.spec import Kind, NodeSpec, SkipPossibility, SkipSupport
from sar_compiler.nodes.values import CONDITION, MILLISECONDS, SECONDS, require_value_type
from sar_compiler.runtime.outcomes import ReturnedStatus
from sar_compiler.tree.model import SUBTREE_TAG

_OUTCOME = require_value_type(ReturnedStatus)._replace(cpp=STATUS)
_NOUNS = {S: "success", F: "failure", R: "running"}

_own = partial(language_spec, Kind.DECORATOR, skipping=FROM_CHILD)
_stock = partial(stock, Kind.DECORATOR)


def _successes(bound: NodeView) -> float | None:
    """Return the number of rounds of py_trees' Repeat."""
    count = number(bound, "num_success")
    # With a number below 1, py_trees never succeeds, because it compares the number with the number of successes.
    return math.inf if count is not None and count < 1 else count


def _failures(bound: NodeView) -> float | None:
    """Return the number of rounds of py_trees' Retry."""
    count = number(bound, "num_failures")
    return None if count is None else max(count, 1)


def _timeout_limit(bound: NodeView) -> float | None:
    """Return the limit of a Timeout in seconds. A limit of 0 means no limit in BehaviorTree.CPP."""
    return milliseconds(bound, "msec") or (math.inf if number(bound, "msec") == 0 else None)


def _with_rewrite(semantics: Semantics, rewrite: rewrites.Rewrite, *, built_in: bool = True) -> Semantics:
    """Return semantics with a rewrite that converts the node for BehaviorTree.CPP."""
    return semantics._replace(counterpart=Counterpart(built_in, rewrite))


def _results_after(turns: Mapping[int, int]) -> frozenset[str]:
    """Return the statuses that a decorator can return, given the results of its child that it replaces."""
    return frozenset(WORD_OF[turns.get(each, each)] for each in (S, F, R))


def _stock_unless_skipping(
    tag: str,
    stock_class: str,
    doc: str,
    turns: Mapping[int, int],
    possible: SkipPossibility = SkipPossibility.FROM_CHILD,
    repeats: int = 0,
) -> NodeSpec:
    """Return the spec of a BehaviorTree.CPP decorator implemented by a py_trees class.

    Another class replaces the py_trees class if the child can be skipped.
    """
    turned = tuple(WORD_OF[turns.get(each, each)] for each in (S, F, K))
    replacement = _own(tag, "kernel.turning:TurningNode", doc, fixed={"turned": turned})
    return _own(
        tag,
        f"py_trees.decorators:{stock_class}",
        doc,
        semantics=Semantics.mapping(turns)._replace(repeats=repeats),
        skipping=SkipSupport(possible, replacement),
        statuses=_results_after(turns),
    )


def _mapping_decorator(tag: str, old: int, new: int, instead: str = "", hint: str = NO_HINT) -> NodeSpec:
    """Return the spec of a py_trees decorator that replaces one result of its child."""
    turns = {old: new}
    rewrite = partial(rewrites.rename, instead) if instead else None
    return _stock(
        tag,
        f"Turns {_NOUNS[old]} into {_NOUNS[new]}.",
        semantics=Semantics.mapping(turns)._replace(counterpart=Counterpart(rewrite=rewrite, hint=hint)),
        statuses=_results_after(turns),
        instead=instead,
    )


def _unless_written(tag: str, otherwise: int, doc: str, skipping: SkipSupport = FROM_CHILD) -> NodeSpec:
    """Return the spec of a decorator that returns a fixed status until an entry is written."""
    return _own(
        tag,
        "kernel.turning:UpdateGuardNode",
        doc,
        input_port("entry", ANY_ENTRY, "The entry to check."),
        SCOPE,
        fixed={"unless_written": WORD_OF[otherwise]},
        semantics=Semantics(
            partial(outcome_sets.with_own_results, otherwise),
            keys={"entry": KeyRole(AccessKind.PEEK, by_name=True)},
        ),
        skipping=skipping,
    )


def _loop(tag: str, kind: type, item: str, items: str, example: str) -> NodeSpec:
    return _own(
        tag,
        "kernel.repeating:LoopNode",
        f"Ticks its child once for each {item} in a queue.",
        input_port(
            "queue",
            queue_of(tag, kind),
            f"The {items}s: `{example}`, or an entry with such a string, a list, or a `collections.deque`. Items are removed "
            "from a deque.",
        ),
        output_port("value", require_value_type(kind), f"The key to which each {items} is written.", None),
        input_port(
            "if_empty", _OUTCOME, "The status to return when no item is left.", ReturnedStatus.SUCCESS
        ),
        fixed={"kind": kind},
        semantics=Semantics(outcome_sets.loop, keys={"queue": KeyRole(AccessKind.PEEK)}),
        skipping=SkipSupport(SkipPossibility.ALWAYS, only_if=("if_empty", ReturnedStatus.SKIPPED)),
    )


_WRITTEN = KeyRole(AccessKind.WRITE)

BEHAVIORTREE_CPP = [
    _stock_unless_skipping(
        "Inverter", "Inverter", "Turns success into failure and failure into success.", {S: F, F: S}
    ),
    _stock_unless_skipping("ForceSuccess", "FailureIsSuccess", "Succeeds whenever its child ends.", {F: S}),
    _stock_unless_skipping("ForceFailure", "SuccessIsFailure", "Fails whenever its child ends.", {S: F}),
    _stock_unless_skipping(
        "KeepRunningUntilFailure",
        "SuccessIsRunning",
        "Restarts its child after every success, until the child fails.",
        {S: R, K: R},
        SkipPossibility.NEVER,
        repeats=S,
    ),
    _own(
        "Repeat",
        "kernel.repeating:RepeatNode",
        "Repeats its child until it has succeeded num_cycles times. Fails when the child fails.",
        input_port(
            "num_cycles",
            int,
            "Number of successes; -1 to repeat without end, 0 to succeed at once.",
        ),
        semantics=_with_rewrite(Semantics.restarts_child(S, "num_cycles"), rewrites.repeat),
    ),
    _own(
        "RetryUntilSuccessful",
        "kernel.repeating:RetryNode",
        "Retries its child until it has failed num_attempts times. Succeeds when the child succeeds.",
        input_port(
            "num_attempts",
            int,
            "Maximum number of attempts; -1 to retry without end, 0 to fail at once. The number is read again after each "
            "failure, because the child may have changed it.",
        ),
        semantics=Semantics.restarts_child(F, "num_attempts"),
    ),
    _own(
        "RunOnce",
        "kernel.turning:RunOnceNode",
        "Ticks its child until it has completed once. Afterwards the node is skipped, or returns the same status again.",
        input_port(
            "then_skip",
            bool,
            "If true, the node is skipped after its child has completed. If false, it returns the same status again.",
            default=True,
        ),
        semantics=Semantics(outcome_sets.run_once, once=True),
        skipping=SkipSupport(SkipPossibility.ALWAYS, only_if=("then_skip", True)),
    ),
    _own(
        "Delay",
        "kernel.timing:DelayNode",
        "Waits for a time, then ticks its child.",
        input_port("delay_msec", MILLISECONDS, "Duration of the wait, in milliseconds."),
        CLOCK,
        semantics=Semantics(
            partial(outcome_sets.with_own_results, R),
            steady=True,
            wait_sec=partial(outcome_sets.milliseconds, name="delay_msec"),
        ),
    ),
    _own(
        "Timeout",
        "kernel.timing:TimeoutNode",
        "Fails if its child is still running after the time limit. The child is then halted without another tick.",
        input_port("msec", MILLISECONDS, "Time limit of the child, in milliseconds; 0 for no limit."),
        CLOCK,
        semantics=_with_rewrite(Semantics.limits_child(_timeout_limit), rewrites.timeout),
    ),
    _own(
        "Precondition",
        "kernel.turning:PreconditionNode",
        "Ticks its child if a condition is true when the node starts. The condition is not evaluated again while the child runs.",
        input_port("if_", CONDITION, "The condition, as a script."),
        SCOPE,
        ENUMS,
        input_port(
            "else_", _OUTCOME, "The status to return if the condition is false.", ReturnedStatus.FAILURE
        ),
        semantics=Semantics(partial(outcome_sets.guard, "if")),
        skipping=SkipSupport(SkipPossibility.ALWAYS, only_if=("else", ReturnedStatus.SKIPPED)),
        former_tags=tuple(f"BlackboardCheck{kind}" for kind in ("Bool", "Double", "Int", "String")),
    ),
    _unless_written(
        "SkipUnlessUpdated",
        K,
        "Ticks its child if an entry was written since the last check; otherwise, the node is skipped.",
        SkipSupport(SkipPossibility.ALWAYS),
    ),
    _unless_written(
        "WaitValueUpdate",
        R,
        "Waits until an entry was written since the last check, then ticks its child.",
    ),
    _loop("LoopInt", int, "integer", "number", "1;2;3"),
    _loop("LoopDouble", float, "real number", "number", "1.5;2;3"),
    _loop("LoopBool", bool, "Boolean", "value", "true;false"),
    _loop("LoopString", str, "string", "string", "red;green"),
]

PY_TREES = [
    _stock(
        "OneShot",
        "Ticks its child until it has completed once. Afterwards, returns the same status without ticking the child.",
        attribute("policy", ONESHOT_TYPE, "Which results count as completion: any result, or only success."),
        semantics=Semantics(
            outcome_sets.passing_results,
            once=True,
            counterpart=Counterpart(rewrite=rewrites.oneshot, hint=rewrites.NO_ONESHOT),
        ),
        instead="RunOnce",
    ),
    node_spec(
        Kind.DECORATOR,
        "Timeout",
        "sar_compiler.runtime.stock:Timeout",
        "Fails if its child is still running after the time limit, which the mission's clock measures.",
        attribute("duration", SECONDS, "Time limit of the child, in seconds."),
        CLOCK,
        semantics=_with_rewrite(Semantics.limits_child("duration"), rewrites.timeout),
        skipping=SkipSupport(advice='msec="..."'),
        variant=True,
    ),
    _stock(
        "Retry",
        "Ticks its child again after a failure, until it has failed num_failures times.",
        attribute(
            "num_failures",
            int,
            "Number of failures after which the node fails. With 1 or less, it fails after the first failure.",
        ),
        semantics=_with_rewrite(Semantics.restarts_child(F, _failures), rewrites.retry, built_in=False),
        instead="RetryUntilSuccessful",
    ),
    _stock(
        "Repeat",
        "Ticks its child again after a success, until it has succeeded num_success times.",
        attribute(
            "num_success",
            int,
            "Number of successes after which the node succeeds. With 0 or less, it never succeeds.",
        ),
        semantics=_with_rewrite(Semantics.restarts_child(S, _successes), rewrites.repeat),
        instead='num_cycles="..."',
        variant=True,
    ),
    _stock(
        "Condition",
        "Runs until its child returns a given status, then succeeds.",
        attribute("status", StatusName, "The status that the child must return."),
        semantics=Semantics(outcome_sets.awaiting_results, steady=True),
        statuses=frozenset({"SUCCESS", "RUNNING"}),
    ),
    _stock(
        "Count",
        "Returns the status of its child, and counts the child's ticks and results.",
        semantics=Semantics.transparent(),
    ),
    _stock(
        "EternalGuard",
        "Ticks its child while a condition is true. When the condition is false, halts the child and fails.",
        input_port(
            "condition",
            CONDITION,
            "The condition, as a script that is evaluated before every tick of the child.",
        ),
        SCOPE,
        ENUMS,
        semantics=Semantics(
            partial(outcome_sets.guard, "condition"),
            counterpart=Counterpart(
                hint="use a ReactiveSequence that contains a ScriptCondition and the child, which has the same effect"
            ),
        ),
    ),
    _stock("PassThrough", "Returns the status of its child.", semantics=Semantics.transparent()),
    _stock(
        "StatusToBlackboard",
        "Writes its child's status to the blackboard in every tick, and returns this status.",
        inout_port(
            "variable_name",
            VARIABLE,
            "The key to write, or `key.attribute` of an existing object.",
        ),
        SCOPE,
        semantics=Semantics.transparent()._replace(keys={"variable_name": _WRITTEN}),
        effects=WRITES,
    ),
    _stock(
        "ForEach",
        "Ticks its child for each item of a list in turn, until the child fails. Needs py_trees 2.4.",
        input_port("source_key", KEY, "The key that contains the list."),
        inout_port("target_key", KEY, "The key to which each item is written."),
        SCOPE,
        semantics=Semantics(outcome_sets.each_item, keys={"target_key": _WRITTEN}),
        effects=WRITES,
    ),
    _mapping_decorator("SuccessIsRunning", S, R, instead="KeepRunningUntilFailure"),
    _mapping_decorator("SuccessIsFailure", S, F, instead="ForceFailure"),
    _mapping_decorator("FailureIsSuccess", F, S, instead="ForceSuccess"),
    _mapping_decorator("FailureIsRunning", F, R, hint=rewrites.NO_FAILURE_IS_RUNNING),
    _mapping_decorator("RunningIsSuccess", R, S),
    _mapping_decorator("RunningIsFailure", R, F),
]

_SUBTREE_DOC = "Runs another tree. The other attributes map keys of that tree to keys of the calling tree."
SUBTREE = _own(
    SUBTREE_TAG,
    "py_trees.decorators:PassThrough",
    _SUBTREE_DOC,
    semantics=Semantics.transparent(),
    skipping=SkipSupport(
        SkipPossibility.FROM_CHILD, _own(SUBTREE_TAG, "kernel.turning:SubTreeNode", _SUBTREE_DOC)
    ),
    child_count=(0, 0),
    former_tags=("SubTreePlus",),
    former_attributes={"__shared_blackboard": "_autoremap", "__autoremap": "_autoremap"},
)
"""The spec of the node to which a `SubTree` is compiled. Its attributes are handled when the tree is bound."""

SPECS = [*BEHAVIORTREE_CPP, *PY_TREES, SUBTREE]
