"""Leaves that are available in every mission's trees."""

from collections.abc import Callable, Mapping
from dataclasses import replace

from py_trees import behaviours
from py_trees.behaviour import Behaviour
from py_trees.common import Status

from sar_compiler.nodes import outcome_sets
from sar_compiler.nodes.btcpp import rewrites
from sar_compiler.nodes.language.comparisons import (
    CHECKS,
    COMPARISONS,
    JUNCTIONS,
    Comparison,
    Junction,
    constant,
    expression,
    read_check,
)
from sar_compiler.nodes.language.narrow_types import CHANCES, KEY, NTH, STATUS_NAMES, VARIABLE, StatusName
from sar_compiler.nodes.language.node_rules import NO_ANSWER, report_no_answer
from sar_compiler.nodes.language.py_trees_nodes import Keys, made_by, since_2_4
from sar_compiler.nodes.semantics import REMOVES, WRITES, AccessKind, Counterpart, KeyRole, Semantics
from sar_compiler.nodes.spec import Kind, NodeSpec, Signature
from sar_compiler.nodes.values import AS_WRITTEN, CONDITION, MILLISECONDS, SECONDS, ValueType
from sar_compiler.runtime import entries, script_nodes, timers
from sar_compiler.runtime.blackboard import Scope
from sar_compiler.runtime.ports import InOut, Input
from sar_compiler.runtime.timers import Timer


def status_queue(name: str, queue: list[str], eventually: StatusName | None = None) -> behaviours.StatusQueue:
    """Returns the statuses of a list one after the other; continues where it was, however often it is started.

    Args:
        name: The node's name.
        queue: The statuses: `RUNNING;RUNNING;SUCCESS`.
        eventually: The status to return after the end of the list; by default the list starts over.

    Raises:
        ValueError: If there are no statuses.
    """
    if not queue and eventually is None:
        raise ValueError(NO_ANSWER)
    statuses = [Status[text] for text in queue]
    return behaviours.StatusQueue(name, statuses, Status[eventually] if eventually else None)


def success_every_n(name: str, n: int) -> behaviours.SuccessEveryN:
    """Succeeds in every n-th tick, and fails in the others.

    Args:
        name: The node's name.
        n: The period of the successes in ticks: 1 for every tick, 2 for every other; the sign is ignored.
    """
    return behaviours.SuccessEveryN(name, n)


def tick_counter(name: str, duration: int, completion_status: StatusName) -> behaviours.TickCounter:
    """Runs for a number of ticks, then ends; the count starts over whenever it is started.

    Args:
        name: The node's name.
        duration: The number of ticks to run; 0 or less to end at once.
        completion_status: The status to return then.
    """
    return behaviours.TickCounter(name, duration, Status[completion_status])


def probabilistic_behaviour(
    name: str, weights: list[float] | None = None
) -> behaviours.ProbabilisticBehaviour:
    """Returns a random status.

    Args:
        name: The node's name.
        weights: The weights of success, failure and running: `2;1;1`; equal by default.
    """
    return behaviours.ProbabilisticBehaviour(name, weights)


def blackboard_to_status(
    name: str, variable_name: Input[object], scope: Scope
) -> behaviours.BlackboardToStatus:
    """Returns the status that a key holds, as written by StatusToBlackboard.

    Args:
        name: The node's name.
        variable_name: The key, or `key.attribute`; until it holds a status, a tick ends the run with an error.
        scope: Where the key is looked up.
    """
    keys = Keys(scope)
    return keys.given_to(behaviours.BlackboardToStatus(name, keys.variable(variable_name)))


def check_exists(
    name: str, variable_name: Input[object], scope: Scope
) -> behaviours.CheckBlackboardVariableExists:
    """Succeeds if something has been written to a key, else fails.

    Args:
        name: The node's name.
        variable_name: The key, or `key.attribute`.
        scope: Where the key is looked up.
    """
    keys = Keys(scope)
    variable = keys.variable(variable_name)
    return keys.given_to(behaviours.CheckBlackboardVariableExists(name, variable))


def wait_for(name: str, variable_name: Input[object], scope: Scope) -> behaviours.WaitForBlackboardVariable:
    """Runs until something has been written to a key, then succeeds.

    Args:
        name: The node's name.
        variable_name: The key, or `key.attribute`.
        scope: Where the key is looked up.
    """
    keys = Keys(scope)
    return keys.given_to(behaviours.WaitForBlackboardVariable(name, keys.variable(variable_name)))


def unset_variable(name: str, key: InOut[object], scope: Scope) -> behaviours.UnsetBlackboardVariable:
    """Removes a key from the blackboard, wherever it belongs, and succeeds.

    Args:
        name: The node's name.
        key: The key.
        scope: Where the key is looked up.
    """
    keys = Keys(scope)
    return keys.given_to(behaviours.UnsetBlackboardVariable(name, keys.key(key)))


def set_variable(
    name: str,
    variable_name: InOut[object],
    variable_value: Input[object],
    scope: Scope,
    overwrite: bool = True,
) -> behaviours.SetBlackboardVariable:
    """Writes a value to a key, and succeeds; whatever the key held before, it then holds this.

    Args:
        name: The node's name.
        variable_name: The key, or `key.attribute` of an object that is there already.
        variable_value: The value: a number, `true`, `false`, any other text, a list or an object after `json:`, or the
            value of another `{key}` at the time of the tick.
        overwrite: Whether to replace an existing value; if not, the node fails if there is one.
        scope: Where the keys are looked up.
    """
    keys = Keys(scope)
    variable = keys.variable(variable_name)
    value = constant(variable_value) if variable_value.entry is None else variable_value.get
    return keys.given_to(behaviours.SetBlackboardVariable(name, variable, value, overwrite))


def check_value(
    name: str, variable: Input[object], operator: Comparison, value: Input[object], scope: Scope
) -> behaviours.CheckBlackboardVariableValue:
    """Succeeds if the comparison of a key with a value is true; fails if it is false or nothing was written to the key.

    Args:
        name: The node's name.
        variable: The key, or `key.attribute`.
        operator: How to compare: equal, not equal, less, less or equal, greater, greater or equal. A text is
            never equal to a number, and none can be less than the other.
        value: The value to compare with: a number, `true`, `false`, any other text, a list or an object after `json:`,
            or the value of another `{key}` at the time of the tick.
        scope: Where the keys are looked up.
    """
    keys = Keys(scope)
    check = expression(keys.variable(variable), operator, value)
    return keys.given_to(behaviours.CheckBlackboardVariableValue(name, check))


def wait_for_value(
    name: str, variable: Input[object], operator: Comparison, value: Input[object], scope: Scope
) -> behaviours.WaitForBlackboardVariableValue:
    """Runs until the comparison of a key with a value is true, then succeeds.

    Args:
        name: The node's name.
        variable: The key, or `key.attribute`.
        operator: How to compare: equal, not equal, less, less or equal, greater, greater or equal. A text is
            never equal to a number, and none can be less than the other.
        value: The value to compare with: a number, `true`, `false`, any other text, a list or an object after `json:`,
            or the value of another `{key}` at the time of the tick.
        scope: Where the keys are looked up.
    """
    keys = Keys(scope)
    check = expression(keys.variable(variable), operator, value)
    return keys.given_to(behaviours.WaitForBlackboardVariableValue(name, check))


def check_values(
    name: str,
    checks: list[str],
    operator: Junction,
    scope: Scope,
    namespace: InOut[object] | None = None,
) -> behaviours.CheckBlackboardVariableValues:
    """Compares several keys with values, and succeeds if the joined results are true.

    Args:
        name: The node's name.
        checks: The comparisons, each a key, an operator and a value: `battery gt 20;speed lt 1.5`. If nothing
            was written to one of the keys, the node fails.
        operator: The operator that joins the results, from left to right.
        namespace: A key `results` has each result written to `results/1`, `results/2` and so on.
        scope: Where the keys are looked up.
    """
    keys = Keys(scope)
    expressions = [
        expression(keys.variable(Input(check.variable)), check.comparison, Input(check.value))
        for check in map(read_check, checks)
    ]
    folder = None if namespace is None else keys.numbered(namespace, len(expressions))
    return keys.given_to(
        behaviours.CheckBlackboardVariableValues(name, expressions, JUNCTIONS[operator], folder)
    )


def compare_variables(
    name: str, var1_key: Input[object], var2_key: Input[object], operator: Comparison, scope: Scope
) -> Behaviour:
    """Succeeds if the comparison of two keys is true; fails if it is false or one was not written; needs py_trees 2.4.

    Args:
        name: The node's name.
        var1_key: The key on the left.
        var2_key: The key on the right.
        operator: How to compare: equal, not equal, less, less or equal, greater, greater or equal.
        scope: Where the keys are looked up.

    Raises:
        TooOldError: If py_trees does not have it yet.
    """
    keys = Keys(scope)
    make = since_2_4(behaviours, "CompareBlackboardVariables")
    left, right = keys.key(var1_key), keys.key(var2_key)
    made: Behaviour = make(name, left, right, COMPARISONS[operator])
    return keys.given_to(made)


_SUCCESS, _FAILURE, _RUNNING = "SUCCESS", "FAILURE", "RUNNING"
_ALL = (_SUCCESS, _FAILURE, _RUNNING)
_BUILT_IN = Counterpart(built_in=True)
_PEEKS = KeyRole(AccessKind.PEEK)
_PEEKS_BY_NAME = KeyRole(AccessKind.PEEK, by_name=True)
_WRITTEN = KeyRole(AccessKind.WRITE)
_REMOVED = KeyRole(AccessKind.NONE)


def _peeking(*ports: str, resumes: bool = False) -> Semantics:
    """Return the semantics of a leaf whose key need not exist."""
    return Semantics(keys=dict.fromkeys(ports, _PEEKS), resumes=resumes)


def _question(tag: str, factory: Callable[..., Behaviour], **types: ValueType) -> NodeSpec:
    """Return a py_trees condition about keys that need not exist."""
    made = made_by(tag, factory, _SUCCESS, _FAILURE, kind=Kind.CONDITION, **types)  # type: ignore[arg-type]
    return replace(made, semantics=_peeking(*types))


def _renamed(tag: str, cls: type, doc: str, *outcomes: str) -> NodeSpec:
    """Return a py_trees leaf under BehaviorTree.CPP's name."""
    semantics, signature = Semantics(counterpart=_BUILT_IN), Signature(doc=doc)
    return NodeSpec(tag, cls, Kind.ACTION, frozenset(outcomes), semantics=semantics, signature=signature)


def _own(
    tag: str,
    cls: type,
    *outcomes: str,
    kind: Kind = Kind.ACTION,
    effects: str = "",
    keys: Mapping[str, KeyRole] | None = None,
    **types: ValueType,
) -> NodeSpec:
    """Return a BehaviorTree.CPP leaf that py_trees does not have."""
    semantics = Semantics(keys=keys or {}, counterpart=_BUILT_IN)
    signature = Signature(types=types)
    return NodeSpec(tag, cls, kind, frozenset(outcomes), effects, semantics=semantics, signature=signature)


def _stock(
    cls: type[Behaviour],
    doc: str,
    *outcomes: str,
    semantics: Semantics | None = None,
    rewrite: rewrites.Rewrite | None = None,
    **parameter_docs: str,
) -> NodeSpec:
    """Return a py_trees leaf whose constructor can be used as it is."""
    return NodeSpec(
        cls.__name__,
        cls,
        Kind.ACTION,
        frozenset(outcomes),
        semantics=semantics or Semantics(counterpart=Counterpart(rewrite=rewrite)),
        signature=Signature(doc=doc, parameter_docs={"name": "The node's name.", **parameter_docs}),
    )


BEHAVIORTREE_CPP = [
    _renamed("AlwaysSuccess", behaviours.Success, "Succeeds.", _SUCCESS),
    _renamed("AlwaysFailure", behaviours.Failure, "Fails.", _FAILURE),
    _own("Script", script_nodes.RunScript, _SUCCESS, effects=WRITES),
    _own(
        "ScriptCondition",
        script_nodes.ScriptCondition,
        _SUCCESS,
        _FAILURE,
        kind=Kind.CONDITION,
        code=CONDITION,
    ),
    _own(
        "SetBlackboard",
        entries.SetBlackboard,
        _SUCCESS,
        _FAILURE,
        effects=WRITES,
        keys={"output_key": KeyRole(AccessKind.WRITE, by_name=True, indirect=True)},
        value=AS_WRITTEN,
        output_key=AS_WRITTEN,
    ),
    _own("UnsetBlackboard", entries.UnsetBlackboard, _SUCCESS, effects=REMOVES, keys={"key": _REMOVED}),
    _own("WasEntryUpdated", entries.WasEntryUpdated, _SUCCESS, _FAILURE, keys={"entry": _PEEKS_BY_NAME}),
    _own("Sleep", timers.Sleep, _SUCCESS, _RUNNING, msec=MILLISECONDS),
]

PY_TREES = [
    _stock(behaviours.Success, "Succeeds.", _SUCCESS, rewrite=rewrites.renamed("AlwaysSuccess")),
    _stock(behaviours.Failure, "Fails.", _FAILURE, rewrite=rewrites.renamed("AlwaysFailure")),
    _stock(behaviours.Running, "Runs for ever.", _RUNNING, rewrite=rewrites.running),
    _stock(behaviours.Dummy, "Runs for ever, in the place of something still to be written.", _RUNNING),
    _stock(
        behaviours.Periodic,
        "Runs for some ticks, succeeds for as many, fails for as many, and so on; it goes on where it was, however "
        "often it is started.",
        *_ALL,
        semantics=Semantics(resumes=True),
        n="After how many ticks the next one answers something else; 0 or less: another status in each.",
    ),
    made_by(
        "StatusQueue",
        status_queue,
        *_ALL,
        rule=report_no_answer,
        semantics=Semantics(outcome_sets.queued, resumes=True),
        queue=STATUS_NAMES,
    ),
    made_by("SuccessEveryN", success_every_n, _SUCCESS, _FAILURE, n=NTH),
    made_by("TickCounter", tick_counter, *_ALL, semantics=Semantics(outcome_sets.ticks_counted)),
    made_by(
        "ProbabilisticBehaviour",
        probabilistic_behaviour,
        *_ALL,
        semantics=Semantics(resumes=True),
        weights=CHANCES,
    ),
    NodeSpec(
        "Timer",
        Timer,
        Kind.ACTION,
        frozenset({_SUCCESS, _RUNNING}),
        semantics=Semantics(counterpart=Counterpart(rewrite=rewrites.timer)),
        signature=Signature(types={"duration": SECONDS}),
    ),
    made_by(
        "BlackboardToStatus",
        blackboard_to_status,
        *_ALL,
        semantics=Semantics(resumes=True),
        variable_name=VARIABLE,
    ),
    _question("CheckBlackboardVariableExists", check_exists, variable_name=VARIABLE),
    made_by(
        "WaitForBlackboardVariable",
        wait_for,
        _SUCCESS,
        _RUNNING,
        semantics=_peeking("variable_name", resumes=True),
        variable_name=VARIABLE,
    ),
    made_by(
        "SetBlackboardVariable",
        set_variable,
        _SUCCESS,
        _FAILURE,
        effects=WRITES,
        semantics=Semantics(keys={"variable_name": _WRITTEN}),
        variable_name=VARIABLE,
    ),
    made_by(
        "UnsetBlackboardVariable",
        unset_variable,
        _SUCCESS,
        effects=REMOVES,
        semantics=Semantics(keys={"key": _REMOVED}),
        key=KEY,
    ),
    _question("CheckBlackboardVariableValue", check_value, variable=VARIABLE),
    made_by(
        "WaitForBlackboardVariableValue",
        wait_for_value,
        _SUCCESS,
        _RUNNING,
        semantics=_peeking("variable", resumes=True),
        variable=VARIABLE,
    ),
    replace(
        _question("CheckBlackboardVariableValues", check_values, checks=CHECKS, namespace=KEY),
        semantics=_peeking("checks"),
    ),
    _question("CompareBlackboardVariables", compare_variables, var1_key=KEY, var2_key=KEY),
]

SPECS = [*BEHAVIORTREE_CPP, *PY_TREES]
