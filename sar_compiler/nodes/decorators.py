"""Decorators: nodes with one child."""

from py_trees import decorators
from py_trees.behaviour import Behaviour
from py_trees.common import Status

from sar_compiler.nodes.narrow_types import KEY, VARIABLE, StatusName, queue_of
from sar_compiler.nodes.py_trees_nodes import Keys, made_by, since_2_4
from sar_compiler.nodes.register import Registration
from sar_compiler.nodes.spec import Kind, Skips
from sar_compiler.nodes.values import CONDITION, UNSIGNED
from sar_compiler.runtime import decorators as own
from sar_compiler.runtime import entries, loops, repetition, script_nodes, timers
from sar_compiler.runtime.blackboard import Scope
from sar_compiler.runtime.chosen_outcome import Outcome
from sar_compiler.runtime.enums import Enums
from sar_compiler.runtime.expressions import Script
from sar_compiler.runtime.ports import InOut, Input
from sar_compiler.runtime.py_trees_timers import Timeout
from sar_compiler.runtime.scripting import NodeScript


def condition(name: str, child: Behaviour, status: StatusName) -> decorators.Condition:
    """Succeeds once its child answers a status, and runs until then.

    Args:
        name: The node's name.
        child: The child; it is started again whenever it ends with another status.
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
        condition: The condition, a script; it is asked before every tick of the child.
        scope: Where the script's variables are.
        enums: The names that stand for numbers.
    """
    script = NodeScript(condition, name, "condition", scope, enums)
    return decorators.EternalGuard(name, child, script.holds)


def status_to_blackboard(
    name: str, child: Behaviour, variable_name: InOut[object], scope: Scope
) -> decorators.StatusToBlackboard:
    """Writes its child's status to the blackboard in every tick, and answers it.

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
    """Ticks its child for one item of a list after the other, until the child fails; from py_trees 2.4 on.

    Args:
        name: The node's name.
        child: The child; it is ticked once even if the list is empty, and never for what comes after a None.
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


_SUCCESS, _FAILURE, _RUNNING = "SUCCESS", "FAILURE", "RUNNING"
_ALL = frozenset({_SUCCESS, _FAILURE, _RUNNING})


def _shared(
    tag: str, cls: type, skip_cls: type, doc: str, *outcomes: str, skips: Skips = Skips.FROM_CHILD
) -> Registration:
    """Return a decorator that is py_trees' own unless its child can skip."""
    return Registration(
        tag,
        cls,
        Kind.DECORATOR,
        frozenset(outcomes) or _ALL,
        doc=doc,
        parameter_docs={"name": "The node's name."},
        skips=skips,
        skip_cls=skip_cls,
    )


def _own(tag: str, cls: type, skips: Skips = Skips.FROM_CHILD, **more: object) -> Registration:
    """Return a decorator of BehaviorTree.CPP's that py_trees does not have."""
    return Registration(tag, cls, Kind.DECORATOR, _ALL, skips=skips, **more)  # type: ignore[arg-type]


def _stock(
    cls: type[decorators.Decorator],
    doc: str,
    *outcomes: str,
    instead: str = "",
    variant: bool = False,
    **parameter_docs: str,
) -> Registration:
    """Return a decorator of py_trees' whose constructor can be written as it is."""
    return Registration(
        cls.__name__,
        cls,
        Kind.DECORATOR,
        frozenset(outcomes),
        skip_advice=instead,
        variant=variant,
        doc=doc,
        parameter_docs={"name": "The node's name.", **parameter_docs},
    )


BEHAVIORTREE_CPP = [
    _shared(
        "Inverter",
        decorators.Inverter,
        own.Inverter,
        "Turns success into failure and failure into success.",
    ),
    _shared(
        "ForceSuccess",
        decorators.FailureIsSuccess,
        own.ForceSuccess,
        "Succeeds whenever its child ends.",
        _SUCCESS,
        _RUNNING,
    ),
    _shared(
        "ForceFailure",
        decorators.SuccessIsFailure,
        own.ForceFailure,
        "Fails whenever its child ends.",
        _FAILURE,
        _RUNNING,
    ),
    _shared(
        "KeepRunningUntilFailure",
        decorators.SuccessIsRunning,
        own.KeepRunningUntilFailure,
        "Starts its child again after every success, until it fails.",
        _FAILURE,
        _RUNNING,
        skips=Skips.NEVER,
    ),
    _own("Repeat", repetition.Repeat),
    _own("RetryUntilSuccessful", repetition.RetryUntilSuccessful),
    _own("RunOnce", own.RunOnce, Skips.ALWAYS, defaults={"then_skip": True}, skips_if=("then_skip", True)),
    _own("Delay", timers.Delay, types={"delay_msec": UNSIGNED}),
    _own("Timeout", timers.Timeout, types={"msec": UNSIGNED}),
    _own(
        "Precondition",
        script_nodes.Precondition,
        Skips.ALWAYS,
        skips_if=("else", Outcome.SKIPPED),
        types={"if": CONDITION},
    ),
    _own("SkipUnlessUpdated", entries.SkipUnlessUpdated, Skips.ALWAYS),
    _own("WaitValueUpdate", entries.WaitValueUpdate),
    *(
        _own(
            cls.__name__,
            cls,
            Skips.ALWAYS,
            types={"queue": queue_of(cls)},
            skips_if=("if_empty", Outcome.SKIPPED),
        )
        for cls in (loops.LoopInt, loops.LoopDouble, loops.LoopBool, loops.LoopString)
    ),
]

PY_TREES = [
    _stock(
        decorators.OneShot,
        "Lets its child finish once; from then on answers what the child answered, without ticking it.",
        *_ALL,
        instead="RunOnce",
        policy="What counts as finished: any end, or only success.",
    ),
    Registration(
        "Timeout",
        Timeout,
        Kind.DECORATOR,
        _ALL,
        skip_advice='msec="..."',
        variant=True,
    ),
    _stock(
        decorators.Retry,
        "Ticks its child again after a failure, until it has failed too often.",
        *_ALL,
        instead="RetryUntilSuccessful",
        num_failures="With how many failures to fail; 1 or less: with the first one.",
    ),
    _stock(
        decorators.Repeat,
        "Ticks its child again after a success, until it has succeeded often enough.",
        *_ALL,
        instead='num_cycles="..."',
        variant=True,
        num_success="With how many successes to succeed; 0 or less: never.",
    ),
    made_by("Condition", condition, _SUCCESS, _RUNNING, kind=Kind.DECORATOR),
    _stock(
        decorators.Count,
        "Answers what its child answers, and counts how often it was ticked and how it ended.",
        *_ALL,
    ),
    made_by("EternalGuard", eternal_guard, *_ALL, kind=Kind.DECORATOR),
    _stock(decorators.PassThrough, "Answers what its child answers.", *_ALL),
    made_by(
        "StatusToBlackboard",
        status_to_blackboard,
        *_ALL,
        kind=Kind.DECORATOR,
        effects="writes to the blackboard",
        variable_name=VARIABLE,
    ),
    made_by(
        "ForEach",
        for_each,
        *_ALL,
        kind=Kind.DECORATOR,
        effects="writes to the blackboard",
        source_key=KEY,
        target_key=KEY,
    ),
    _stock(
        decorators.SuccessIsRunning,
        "Turns success into running.",
        _FAILURE,
        _RUNNING,
        instead="KeepRunningUntilFailure",
    ),
    _stock(
        decorators.SuccessIsFailure,
        "Turns success into failure.",
        _FAILURE,
        _RUNNING,
        instead="ForceFailure",
    ),
    _stock(
        decorators.FailureIsSuccess,
        "Turns failure into success.",
        _SUCCESS,
        _RUNNING,
        instead="ForceSuccess",
    ),
    _stock(decorators.FailureIsRunning, "Turns failure into running.", _SUCCESS, _RUNNING),
    _stock(decorators.RunningIsSuccess, "Turns running into success.", _SUCCESS, _FAILURE),
    _stock(decorators.RunningIsFailure, "Turns running into failure.", _SUCCESS, _FAILURE),
]

REGISTRATIONS = [*BEHAVIORTREE_CPP, *PY_TREES]
