"""Leaves that every tree may use, whatever its mission."""

import operator as operators
from collections.abc import Callable
from typing import Any, Literal

from py_trees import behaviours
from py_trees import timers as stock_timers
from py_trees.behaviour import Behaviour
from py_trees.common import ComparisonExpression, Status

from sar_compiler.nodes.py_trees_nodes import Answer, Keys, made_by, since_2_4
from sar_compiler.nodes.register import Registration
from sar_compiler.nodes.spec import Kind
from sar_compiler.nodes.values import literal_value, nearest
from sar_compiler.runtime import entries, script_nodes, timers
from sar_compiler.runtime.blackboard import Scope
from sar_compiler.runtime.clock import Clock
from sar_compiler.runtime.ports import InOut, Input

Comparison = Literal["eq", "ne", "lt", "le", "gt", "ge"]
"""A comparison, by the name that it has in Python's `operator`."""
Junction = Literal["and", "or", "xor"]
"""What joins the results of several comparisons."""

_COMPARISONS: dict[str, Callable[[Any, Any], bool]] = {
    "eq": operators.eq,
    "ne": operators.ne,
    "lt": operators.lt,
    "le": operators.le,
    "gt": operators.gt,
    "ge": operators.ge,
}
_JUNCTIONS: dict[str, Callable[[bool, bool], bool]] = {
    "and": operators.and_,
    "or": operators.or_,
    "xor": operators.xor,
}
_ANSWERS = ("SUCCESS", "FAILURE", "RUNNING")


class Timer(stock_timers.Timer):
    """Runs until a time has passed on the mission's clock, then succeeds.

    py_trees' own Timer reads the machine's clock, which is wrong for a robot on simulated time.

    Args:
        name: The node's name.
        clock: What the time is measured with.
        duration: How long to run, in seconds; 0 or less: succeed at once.
    """

    def __init__(self, name: str, clock: Clock, duration: float = 5.0) -> None:
        super().__init__(name, duration)
        self._timer = timers.Timer(clock)

    def initialise(self) -> None:
        """Start the time."""
        self._timer.start(self.duration)

    def update(self) -> Status:
        """Say whether the time is over."""
        if self._timer.remaining():
            # Without the time left, which would make every tick look like a change.
            self.feedback_message = "still running"
            return Status.RUNNING
        self.feedback_message = f"timer ran out [{self.duration}]"
        return Status.SUCCESS


def status_queue(name: str, queue: list[str], eventually: Answer | None = None) -> behaviours.StatusQueue:
    """Answers one status of a list after the other; it goes on where it was, however often it is started.

    Args:
        name: The node's name.
        queue: The statuses: `RUNNING;RUNNING;SUCCESS`.
        eventually: What to answer when the list is at its end; where it is not written, the list begins again.

    Raises:
        ValueError: If there is something else in the list, or nothing.
    """
    statuses = [_status(text.strip()) for text in queue]
    if not statuses and eventually is None:
        message = "queue: there is no status in it; write some: RUNNING;SUCCESS"
        raise ValueError(message)
    return behaviours.StatusQueue(name, statuses, Status[eventually] if eventually else None)


def success_every_n(name: str, n: int) -> behaviours.SuccessEveryN:
    """Succeeds in every n-th tick, and fails in the others.

    Args:
        name: The node's name.
        n: In which tick to succeed: 1 for every one, 2 for every other; a negative number is as good.

    Raises:
        ValueError: If it is 0.
    """
    if n == 0:
        message = "n: there is no 0th tick; write 1 to succeed in every tick"
        raise ValueError(message)
    return behaviours.SuccessEveryN(name, n)


def tick_counter(name: str, duration: int, completion_status: Answer) -> behaviours.TickCounter:
    """Runs for a number of ticks, then ends; it counts from the beginning whenever it is started.

    Args:
        name: The node's name.
        duration: For how many ticks to run; 0 or less: end at once.
        completion_status: What to answer then.
    """
    return behaviours.TickCounter(name, duration, Status[completion_status])


def probabilistic_behaviour(
    name: str, weights: list[float] | None = None
) -> behaviours.ProbabilisticBehaviour:
    """Answers by chance.

    Args:
        name: The node's name.
        weights: How often to succeed, to fail and to run, in proportion: `2;1;1`; where it is not written, all
            the same.

    Raises:
        ValueError: If these are not three numbers, one of them positive and none negative.
    """
    if weights is not None and (min(weights, default=0.0) < 0.0 or not any(weights)):
        message = "weights: none may be negative, and one must be more than 0; write three numbers: 2;1;1"
        raise ValueError(message)
    return behaviours.ProbabilisticBehaviour(name, weights)


def blackboard_to_status(
    name: str, variable_name: Input[object], scope: Scope
) -> behaviours.BlackboardToStatus:
    """Answers the status that a key holds, as StatusToBlackboard writes it.

    Args:
        name: The node's name.
        variable_name: The key, or `key.attribute`; until it holds a status, a tick ends the run with an error.
        scope: Where the key is looked up.
    """
    keys = Keys(scope)
    return keys.given_to(behaviours.BlackboardToStatus(name, keys.variable("variable_name", variable_name)))


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
    variable = keys.variable("variable_name", variable_name)
    return keys.given_to(behaviours.CheckBlackboardVariableExists(name, variable))


def wait_for(name: str, variable_name: Input[object], scope: Scope) -> behaviours.WaitForBlackboardVariable:
    """Runs until something has been written to a key, then succeeds.

    Args:
        name: The node's name.
        variable_name: The key, or `key.attribute`.
        scope: Where the key is looked up.
    """
    keys = Keys(scope)
    return keys.given_to(
        behaviours.WaitForBlackboardVariable(name, keys.variable("variable_name", variable_name))
    )


def unset_variable(name: str, key: InOut[object], scope: Scope) -> behaviours.UnsetBlackboardVariable:
    """Removes a key from the blackboard, wherever it belongs, and succeeds.

    Args:
        name: The node's name.
        key: The key.
        scope: Where the key is looked up.
    """
    keys = Keys(scope)
    return keys.given_to(behaviours.UnsetBlackboardVariable(name, keys.key("key", key)))


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
        variable_value: What to write: a number, `true`, `false`, any other text, a list or an object after `json:`, or what
            another `{key}` holds when the node is ticked.
        overwrite: Whether to replace a value; if not, the node fails where there is one.
        scope: Where the keys are looked up.
    """
    keys = Keys(scope)
    variable = keys.variable("variable_name", variable_name)
    value = _constant(variable_value) if variable_value.entry is None else variable_value.get
    return keys.given_to(behaviours.SetBlackboardVariable(name, variable, value, overwrite))


def check_value(
    name: str, variable: Input[object], operator: Comparison, value: Input[object], scope: Scope
) -> behaviours.CheckBlackboardVariableValue:
    """Succeeds if a key compares with a value as wanted; fails if not, and if nothing was written to the key.

    Args:
        name: The node's name.
        variable: The key, or `key.attribute`.
        operator: How to compare: equal, not equal, less, less or equal, greater, greater or equal. A text is
            never equal to a number, and none can be less than the other.
        value: What to compare with: a number, `true`, `false`, any other text, a list or an object after `json:`, or what
            another `{key}` holds when the node is ticked.
        scope: Where the keys are looked up.
    """
    keys = Keys(scope)
    check = _expression(keys.variable("variable", variable), operator, value)
    return keys.given_to(behaviours.CheckBlackboardVariableValue(name, check))


def wait_for_value(
    name: str, variable: Input[object], operator: Comparison, value: Input[object], scope: Scope
) -> behaviours.WaitForBlackboardVariableValue:
    """Runs until a key compares with a value as wanted, then succeeds.

    Args:
        name: The node's name.
        variable: The key, or `key.attribute`.
        operator: How to compare: equal, not equal, less, less or equal, greater, greater or equal. A text is
            never equal to a number, and none can be less than the other.
        value: What to compare with: a number, `true`, `false`, any other text, a list or an object after `json:`, or what
            another `{key}` holds when the node is ticked.
        scope: Where the keys are looked up.
    """
    keys = Keys(scope)
    check = _expression(keys.variable("variable", variable), operator, value)
    return keys.given_to(behaviours.WaitForBlackboardVariableValue(name, check))


def check_values(
    name: str,
    checks: list[str],
    operator: Junction,
    scope: Scope,
    namespace: InOut[object] | None = None,
) -> behaviours.CheckBlackboardVariableValues:
    """Compares several keys with values, and succeeds if the results together are true.

    Args:
        name: The node's name.
        checks: The comparisons, each a key, how to compare and a value: `battery gt 20;speed lt 1.5`. If nothing
            was written to one of the keys, the node fails.
        operator: How to join the results, from left to right.
        namespace: A key `results` has each result written to `results/1`, `results/2` and so on.
        scope: Where the keys are looked up.

    Raises:
        ValueError: If a comparison cannot be read, or there are less than two.
    """
    keys = Keys(scope)
    expressions = [_read_check(text.strip(), keys) for text in checks]
    folder = None if namespace is None else keys.numbered("namespace", namespace, len(expressions))
    return keys.given_to(
        behaviours.CheckBlackboardVariableValues(name, expressions, _JUNCTIONS[operator], folder)
    )


def compare_variables(
    name: str, var1_key: Input[object], var2_key: Input[object], operator: Comparison, scope: Scope
) -> Behaviour:
    """Succeeds if two keys compare as wanted; fails if not, and if one was not written; from py_trees 2.4 on.

    Args:
        name: The node's name.
        var1_key: The key on the left.
        var2_key: The key on the right.
        operator: How to compare: equal, not equal, less, less or equal, greater, greater or equal.
        scope: Where the keys are looked up.

    Raises:
        TooOldError: If py_trees does not have it yet.
        ValueError: If a key is none.
    """
    keys = Keys(scope)
    make = since_2_4(behaviours, "CompareBlackboardVariables")
    left, right = keys.key("var1_key", var1_key), keys.key("var2_key", var2_key)
    made: Behaviour = make(name, left, right, _COMPARISONS[operator])
    return keys.given_to(made)


class _Held:
    """What a key holds whenever it is looked at, for a comparison that py_trees makes once and for all."""

    def __init__(self, port: Input[object]) -> None:
        self._port = port

    def get(self) -> object:
        return self._port.get()

    def __str__(self) -> str:
        return str(self._port.get())


def _expression(variable: str, operator: str, value: Input[object]) -> ComparisonExpression:
    compare = _COMPARISONS[operator]
    if value.entry is None:
        return ComparisonExpression(variable, _constant(value), compare)
    # A function as the value would do from py_trees 2.4 on.
    return ComparisonExpression(variable, _Held(value), lambda left, right: compare(left, right.get()))


def _read_check(text: str, keys: Keys) -> ComparisonExpression:
    parts = text.split(maxsplit=2)
    if len(parts) < len(("key", "operator", "value")) or "{" in text:
        message = (
            f"checks: '{text}' is no comparison; write a key, how to compare, and a value: battery gt 20"
        )
        raise ValueError(message)
    variable, comparison, value = parts
    if comparison not in _COMPARISONS:
        message = f"checks: '{text}': '{comparison}' is not one of {', '.join(_COMPARISONS)}"
        raise ValueError(message)
    return _expression(keys.variable("checks", Input(variable)), comparison, Input(value))


def _constant(port: Input[object]) -> object:
    """Return what a constant says: texts from a file are numbers and truth values where all of them is one."""
    value = port.get()
    if not isinstance(value, str):
        return value
    return {"true": True, "false": False}.get(value, literal_value(value))


def _status(text: str) -> Status:
    if text not in _ANSWERS:
        near = nearest(text, _ANSWERS)
        advice = f"; did you mean {near}?" if near else ""
        message = f"queue: '{text}' is not one of {', '.join(_ANSWERS)}{advice}"
        raise ValueError(message)
    return Status[text]


_SUCCESS, _FAILURE, _RUNNING = "SUCCESS", "FAILURE", "RUNNING"
_ALL = (_SUCCESS, _FAILURE, _RUNNING)


def _renamed(tag: str, cls: type, doc: str, *outcomes: str) -> Registration:
    """Return a leaf of py_trees' under BehaviorTree.CPP's name."""
    return Registration(tag, cls, Kind.ACTION, frozenset(outcomes), doc=doc)


def _own(tag: str, cls: type, *outcomes: str, kind: Kind = Kind.ACTION, effects: str = "") -> Registration:
    """Return a leaf that py_trees does not have."""
    return Registration(tag, cls, kind, frozenset(outcomes), effects=effects)


def _stock(cls: type[Behaviour], doc: str, *outcomes: str, **parameter_docs: str) -> Registration:
    """Return a leaf of py_trees' whose constructor can be written as it is."""
    parameter_docs = {"name": "The node's name.", **parameter_docs}
    return Registration(
        cls.__name__, cls, Kind.ACTION, frozenset(outcomes), doc=doc, parameter_docs=parameter_docs
    )


BEHAVIORTREE_CPP = [
    _renamed("AlwaysSuccess", behaviours.Success, "Succeeds.", _SUCCESS),
    _renamed("AlwaysFailure", behaviours.Failure, "Fails.", _FAILURE),
    _own("Script", script_nodes.RunScript, _SUCCESS, effects="writes to the blackboard"),
    _own("ScriptCondition", script_nodes.ScriptCondition, _SUCCESS, _FAILURE, kind=Kind.CONDITION),
    _own("SetBlackboard", entries.SetBlackboard, _SUCCESS, effects="writes to the blackboard"),
    _own("UnsetBlackboard", entries.UnsetBlackboard, _SUCCESS, effects="removes from the blackboard"),
    _own("WasEntryUpdated", entries.WasEntryUpdated, _SUCCESS, _FAILURE),
    _own("Sleep", timers.Sleep, _SUCCESS, _RUNNING),
]

PY_TREES = [
    _stock(behaviours.Success, "Succeeds.", _SUCCESS),
    _stock(behaviours.Failure, "Fails.", _FAILURE),
    _stock(behaviours.Running, "Runs for ever.", _RUNNING),
    _stock(behaviours.Dummy, "Runs for ever, in the place of something still to be written.", _RUNNING),
    _stock(
        behaviours.Periodic,
        "Runs for some ticks, succeeds for as many, fails for as many, and so on; it goes on where it was, however "
        "often it is started.",
        *_ALL,
        n="After how many ticks the next one answers something else; 0 or less: another status in each.",
    ),
    made_by("StatusQueue", status_queue, *_ALL),
    made_by("SuccessEveryN", success_every_n, _SUCCESS, _FAILURE),
    made_by("TickCounter", tick_counter, *_ALL),
    made_by("ProbabilisticBehaviour", probabilistic_behaviour, *_ALL),
    Registration("Timer", Timer, Kind.ACTION, frozenset({_SUCCESS, _RUNNING})),
    made_by("BlackboardToStatus", blackboard_to_status, *_ALL),
    made_by("CheckBlackboardVariableExists", check_exists, _SUCCESS, _FAILURE, kind=Kind.CONDITION),
    made_by("WaitForBlackboardVariable", wait_for, _SUCCESS, _RUNNING),
    made_by("SetBlackboardVariable", set_variable, _SUCCESS, _FAILURE, effects="writes to the blackboard"),
    made_by("UnsetBlackboardVariable", unset_variable, _SUCCESS, effects="removes from the blackboard"),
    made_by("CheckBlackboardVariableValue", check_value, _SUCCESS, _FAILURE, kind=Kind.CONDITION),
    made_by("WaitForBlackboardVariableValue", wait_for_value, _SUCCESS, _RUNNING),
    made_by("CheckBlackboardVariableValues", check_values, _SUCCESS, _FAILURE, kind=Kind.CONDITION),
    made_by("CompareBlackboardVariables", compare_variables, _SUCCESS, _FAILURE, kind=Kind.CONDITION),
]

REGISTRATIONS = [*BEHAVIORTREE_CPP, *PY_TREES]
