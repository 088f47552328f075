"""Decorators: nodes with one child."""

from collections.abc import Mapping
from dataclasses import replace

from py_trees import decorators
from py_trees.behaviour import Behaviour
from py_trees.common import OneShotPolicy, Status

from sar_compiler.nodes import outcome_sets
from sar_compiler.nodes.binding.attributes import OneShotPolicyName
from sar_compiler.nodes.btcpp import rewrites
from sar_compiler.nodes.language.attribute_readers import failures, successes, within
from sar_compiler.nodes.language.narrow_types import KEY, VARIABLE, StatusName, queue_of
from sar_compiler.nodes.language.py_trees_nodes import Keys, made_by, since_2_4
from sar_compiler.nodes.outcome_sets import K, R, S
from sar_compiler.nodes.semantics import NO_HINT, WRITES, AccessKind, Counterpart, KeyRole, Semantics
from sar_compiler.nodes.spec import Kind, NodeSpec, Parameter, Role, Signature, Skipping, Skips
from sar_compiler.nodes.values import CONDITION, MILLISECONDS, SECONDS, type_of
from sar_compiler.runtime import decorators as own
from sar_compiler.runtime import entries, loops, repetition, script_nodes, timers
from sar_compiler.runtime.blackboard import Scope
from sar_compiler.runtime.chosen_outcome import Outcome
from sar_compiler.runtime.enums import Enums
from sar_compiler.runtime.expressions import Script
from sar_compiler.runtime.ports import InOut, Input
from sar_compiler.runtime.scripting import NodeScript
from sar_compiler.tree.model import SUBTREE_TAG


def one_shot(name: str, child: Behaviour, policy: OneShotPolicyName) -> decorators.OneShot:
    """Lets its child finish once; from then on answers what the child answered, without ticking it.

    Args:
        name: The node's name.
        child: The child.
        policy: What counts as finished: any end, or only success.
    """
    return decorators.OneShot(name, child, OneShotPolicy[policy])


def condition(name: str, child: Behaviour, status: StatusName) -> decorators.Condition:
    """Runs until its child returns a given status, then succeeds.

    Args:
        name: The node's name.
        child: The child; it is restarted whenever it ends with another status.
        status: The status to wait for.
    """
    return decorators.Condition(name, child, Status[status])


def eternal_guard(
    name: str, child: Behaviour, condition: Input[Script], scope: Scope, enums: Enums
) -> decorators.EternalGuard:
    """Ticks its child as long as a condition is true; when it is not, interrupts the child and fails.

    Args:
        name: The node's name.
        child: The child.
        condition: The condition, a script; it is evaluated before every tick of the child.
        scope: Where the script's variables are.
        enums: The names that stand for numbers.
    """
    script = NodeScript(condition, name, "condition", scope, enums)
    return decorators.EternalGuard(name, child, script.holds)


def status_to_blackboard(
    name: str, child: Behaviour, variable_name: InOut[object], scope: Scope
) -> decorators.StatusToBlackboard:
    """Writes its child's status to the blackboard in every tick, and returns it.

    Args:
        name: The node's name.
        child: The child.
        variable_name: The key to write, or `key.attribute` of an object that is there already.
        scope: Where the key is looked up.
    """
    keys = Keys(scope)
    variable = keys.variable(variable_name)
    return keys.given_to(decorators.StatusToBlackboard(name, child, variable))


def for_each(
    name: str, child: Behaviour, source_key: Input[object], target_key: InOut[object], scope: Scope
) -> Behaviour:
    """Ticks its child for each item of a list in turn, until the child fails; needs py_trees 2.4.

    Args:
        name: The node's name.
        child: The child; it is ticked once even if the list is empty, and never for the items after a None.
        source_key: The key of the list.
        target_key: The key to which each item is written.
        scope: Where the keys are looked up.

    Raises:
        TooOldError: If py_trees does not have it yet.
    """
    keys = Keys(scope)
    make = since_2_4(decorators, "ForEach")
    made: Behaviour = make(name, child, keys.key(source_key), keys.key(target_key))
    return keys.given_to(made)


_ALL = frozenset({"SUCCESS", "FAILURE", "RUNNING"})
_NOUNS = {Status.SUCCESS: "success", Status.FAILURE: "failure", Status.RUNNING: "running"}
_NAME = {"name": "The node's name."}


def _rewritten(semantics: Semantics, rewrite: rewrites.Rewrite, *, built_in: bool = True) -> Semantics:
    """Return semantics with what the node becomes in BehaviorTree.CPP."""
    return replace(semantics, counterpart=Counterpart(built_in, rewrite))


def _results_after(turns: Mapping[Status, Status]) -> frozenset[str]:
    """Return the outcomes of a decorator that replaces some results of its child."""
    return frozenset(turns.get(each, each).name for each in (Status.SUCCESS, Status.FAILURE, Status.RUNNING))


def _own(
    tag: str,
    cls: type,
    semantics: Semantics,
    skipping: Skipping = Skipping(Skips.FROM_CHILD),  # noqa: B008 - frozen
    outcomes: frozenset[str] = _ALL,
    **more: object,
) -> NodeSpec:
    """Return a decorator of BehaviorTree.CPP's, of a class that py_trees does not have."""
    means = replace(semantics, counterpart=semantics.counterpart._replace(built_in=True))
    return NodeSpec(tag, cls, Kind.DECORATOR, outcomes, semantics=means, skipping=skipping, **more)  # type: ignore[arg-type]


def _shared(
    tag: str, cls: type, skipping: Skipping, doc: str, turns: Mapping[Status, Status], repeats: int = 0
) -> NodeSpec:
    """Return a decorator of BehaviorTree.CPP's that is py_trees' own unless its child can skip."""
    semantics = replace(Semantics.turning(turns), repeats=repeats)
    signature = Signature(doc=doc, parameter_docs=_NAME)
    return _own(tag, cls, semantics, skipping, _results_after(turns), signature=signature)


def _stock(
    cls: type[decorators.Decorator],
    doc: str,
    semantics: Semantics,
    outcomes: frozenset[str] = _ALL,
    instead: str = "",
    **parameter_docs: str,
) -> NodeSpec:
    """Return a py_trees decorator whose constructor can be used as it is."""
    return NodeSpec(
        cls.__name__,
        cls,
        Kind.DECORATOR,
        outcomes,
        semantics=semantics,
        skipping=Skipping(advice=instead),
        signature=Signature(doc=doc, parameter_docs={**_NAME, **parameter_docs}),
    )


def _turning(
    cls: type[decorators.Decorator],
    old: Status,
    new: Status,
    instead: str = "",
    hint: str = NO_HINT,
) -> NodeSpec:
    """Return a py_trees decorator that replaces one result of its child."""
    turns = {old: new}
    rewrite = rewrites.renamed(instead) if instead else None
    semantics = replace(Semantics.turning(turns), counterpart=Counterpart(rewrite=rewrite, hint=hint))
    doc = f"Turns {_NOUNS[old]} into {_NOUNS[new]}."
    return _stock(cls, doc, semantics, _results_after(turns), instead)


def _unless_updated(own: int) -> Semantics:
    """Return the semantics of a decorator that returns a status of its own until an entry is written."""
    return Semantics(
        outcome_sets.adding(own),
        keys={"entry": KeyRole(AccessKind.PEEK, by_name=True)},
    )


_QUEUE = {"queue": KeyRole(AccessKind.PEEK)}
_WRITTEN = KeyRole(AccessKind.WRITE)

BEHAVIORTREE_CPP = [
    _shared(
        "Inverter",
        decorators.Inverter,
        Skipping(Skips.FROM_CHILD, own.Inverter),
        "Turns success into failure and failure into success.",
        {Status.SUCCESS: Status.FAILURE, Status.FAILURE: Status.SUCCESS},
    ),
    _shared(
        "ForceSuccess",
        decorators.FailureIsSuccess,
        Skipping(Skips.FROM_CHILD, own.ForceSuccess),
        "Succeeds whenever its child ends.",
        {Status.FAILURE: Status.SUCCESS},
    ),
    _shared(
        "ForceFailure",
        decorators.SuccessIsFailure,
        Skipping(Skips.FROM_CHILD, own.ForceFailure),
        "Fails whenever its child ends.",
        {Status.SUCCESS: Status.FAILURE},
    ),
    _shared(
        "KeepRunningUntilFailure",
        decorators.SuccessIsRunning,
        Skipping(Skips.NEVER, own.KeepRunningUntilFailure),
        "Starts its child again after every success, until it fails.",
        {Status.SUCCESS: Status.RUNNING, Status.INVALID: Status.RUNNING},
        repeats=S,
    ),
    _own(
        "Repeat",
        repetition.Repeat,
        _rewritten(Semantics.repeating(Status.SUCCESS, "num_cycles"), rewrites.repeat),
    ),
    _own(
        "RetryUntilSuccessful",
        repetition.RetryUntilSuccessful,
        Semantics.repeating(Status.FAILURE, "num_attempts"),
    ),
    _own(
        "RunOnce",
        own.RunOnce,
        Semantics(outcome_sets.run_once, once=True),
        Skipping(Skips.ALWAYS, only_if=("then_skip", True)),
        signature=Signature(defaults={"then_skip": True}),
    ),
    _own(
        "Delay",
        timers.Delay,
        Semantics(outcome_sets.adding(R), steady=True),
        signature=Signature(types={"delay_msec": MILLISECONDS}),
    ),
    _own(
        "Timeout",
        timers.Timeout,
        _rewritten(Semantics.limiting(within), rewrites.timeout),
        signature=Signature(types={"msec": MILLISECONDS}),
    ),
    _own(
        "Precondition",
        script_nodes.Precondition,
        Semantics(outcome_sets.guard("if")),
        Skipping(Skips.ALWAYS, only_if=("else", Outcome.SKIPPED)),
        signature=Signature(types={"if": CONDITION}),
        former_tags=tuple(f"BlackboardCheck{kind}" for kind in ("Bool", "Double", "Int", "String")),
    ),
    _own("SkipUnlessUpdated", entries.SkipUnlessUpdated, _unless_updated(K), Skipping(Skips.ALWAYS)),
    _own("WaitValueUpdate", entries.WaitValueUpdate, _unless_updated(R)),
    *(
        _own(
            cls.__name__,
            cls,
            Semantics(outcome_sets.loop, keys=_QUEUE),
            Skipping(Skips.ALWAYS, only_if=("if_empty", Outcome.SKIPPED)),
            signature=Signature(
                types={"queue": queue_of(cls.__name__, cls.kind), "value": type_of(cls.kind)}
            ),
        )
        for cls in (loops.LoopInt, loops.LoopDouble, loops.LoopBool, loops.LoopString)
    ),
]

PY_TREES = [
    replace(
        made_by(
            "OneShot",
            one_shot,
            *_ALL,
            kind=Kind.DECORATOR,
            semantics=Semantics(
                outcome_sets.passing,
                once=True,
                counterpart=Counterpart(rewrite=rewrites.oneshot, hint=rewrites.NO_ONESHOT),
            ),
        ),
        skipping=Skipping(advice="RunOnce"),
    ),
    NodeSpec(
        "Timeout",
        timers.StockTimeout,
        Kind.DECORATOR,
        _ALL,
        semantics=_rewritten(Semantics.limiting("duration"), rewrites.timeout),
        signature=Signature(types={"duration": SECONDS}),
        skipping=Skipping(advice='msec="..."'),
        variant=True,
    ),
    _stock(
        decorators.Retry,
        "Ticks its child again after a failure, until it has failed too often.",
        _rewritten(Semantics.repeating(Status.FAILURE, failures), rewrites.retry, built_in=False),
        instead="RetryUntilSuccessful",
        num_failures="With how many failures to fail; 1 or less: with the first one.",
    ),
    replace(
        _stock(
            decorators.Repeat,
            "Ticks its child again after a success, until it has succeeded often enough.",
            _rewritten(Semantics.repeating(Status.SUCCESS, successes), rewrites.repeat),
            instead='num_cycles="..."',
            num_success="With how many successes to succeed; 0 or less: never.",
        ),
        variant=True,
    ),
    made_by(
        "Condition",
        condition,
        "SUCCESS",
        "RUNNING",
        kind=Kind.DECORATOR,
        semantics=Semantics(outcome_sets.awaiting, steady=True),
    ),
    _stock(
        decorators.Count,
        "Answers what its child answers, and counts how often it was ticked and how it ended.",
        Semantics.passing(),
    ),
    made_by(
        "EternalGuard",
        eternal_guard,
        *_ALL,
        kind=Kind.DECORATOR,
        semantics=Semantics(
            outcome_sets.guard("condition"),
            counterpart=Counterpart(
                hint="a ReactiveSequence of a ScriptCondition and its child does the same"
            ),
        ),
        condition=CONDITION,
    ),
    _stock(decorators.PassThrough, "Answers what its child answers.", Semantics.passing()),
    made_by(
        "StatusToBlackboard",
        status_to_blackboard,
        *_ALL,
        kind=Kind.DECORATOR,
        effects=WRITES,
        semantics=replace(Semantics.passing(), keys={"variable_name": _WRITTEN}),
        variable_name=VARIABLE,
    ),
    made_by(
        "ForEach",
        for_each,
        *_ALL,
        kind=Kind.DECORATOR,
        effects=WRITES,
        semantics=Semantics(outcome_sets.each_item, keys={"target_key": _WRITTEN}),
        source_key=KEY,
        target_key=KEY,
    ),
    _turning(decorators.SuccessIsRunning, Status.SUCCESS, Status.RUNNING, instead="KeepRunningUntilFailure"),
    _turning(decorators.SuccessIsFailure, Status.SUCCESS, Status.FAILURE, instead="ForceFailure"),
    _turning(decorators.FailureIsSuccess, Status.FAILURE, Status.SUCCESS, instead="ForceSuccess"),
    _turning(
        decorators.FailureIsRunning, Status.FAILURE, Status.RUNNING, hint=rewrites.NO_FAILURE_IS_RUNNING
    ),
    _turning(decorators.RunningIsSuccess, Status.RUNNING, Status.SUCCESS),
    _turning(decorators.RunningIsFailure, Status.RUNNING, Status.FAILURE),
]

SUBTREE = NodeSpec(
    SUBTREE_TAG,
    decorators.PassThrough,
    Kind.DECORATOR,
    _ALL,
    semantics=replace(Semantics.passing(), counterpart=Counterpart(built_in=True)),
    skipping=Skipping(Skips.FROM_CHILD, own.SubTree),
    signature=Signature(
        doc="Another tree of the file. Its other attributes say which keys around it its keys stand for.",
        described={
            "name": Parameter("name", Role.NAME, required=False, value_type=type_of(str)),
            "child": Parameter("child", Role.CHILD, required=True),
        },
    ),
    child_count=(0, 0),
    former_tags=("SubTreePlus",),
    former_attributes={"__shared_blackboard": "_autoremap", "__autoremap": "_autoremap"},
)
"""The node that a `SubTree` is compiled to; its attributes are handled by binding."""

SPECS = [*BEHAVIORTREE_CPP, *PY_TREES, SUBTREE]
