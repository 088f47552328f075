"""Makers of py_trees' own nodes whose arguments cannot be written in a tree file as they are.

The nodes keep their names, their arguments, and their treatment of unusual values (a count of 0 or below), as
described in each spec. Only values that would raise an error in the middle of a run are refused.
The differences: their keys are the tree's, and none of their children may be one that can be skipped.

A node that the installed py_trees lacks has a spec nevertheless: whether a file is correct does not depend on the machine.
"""

from collections.abc import Callable
from typing import Any

from py_trees import behaviours, composites, decorators
from py_trees.behaviour import Behaviour
from py_trees.common import OneShotPolicy, ParallelPolicy, Status
from py_trees.version import __version__ as py_trees_version

from sar_compiler.errors import SarError
from sar_compiler.nodes.binding.attributes import OneShotPolicyName
from sar_compiler.nodes.language.comparisons import (
    COMPARISONS,
    JUNCTIONS,
    Comparison,
    Junction,
    constant,
    expression,
    read_check,
)
from sar_compiler.nodes.language.narrow_types import PolicyName, StatusName
from sar_compiler.nodes.language.node_rules import HOW_TO_SELECT, NO_ANSWER, clash_with, place_of
from sar_compiler.nodes.language.py_trees_keys import Keys
from sar_compiler.runtime.blackboard import Scope
from sar_compiler.runtime.enums import Enums
from sar_compiler.runtime.expressions import Script
from sar_compiler.runtime.ports import InOut, Input
from sar_compiler.runtime.script_nodes import Conditions
from sar_compiler.runtime.scripting import NodeScript


class TooOldError(SarError):
    """The installed py_trees does not have a node yet."""


def stock_parallel(
    name: str,
    children: list[Behaviour],
    policy: PolicyName,
    synchronise: bool | None = None,
    selected: list[str] | None = None,
) -> composites.Parallel:
    """Make Parallel with one of its policies.

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


def one_shot(name: str, child: Behaviour, policy: OneShotPolicyName) -> decorators.OneShot:
    """Make OneShot."""
    return decorators.OneShot(name, child, OneShotPolicy[policy])


def condition(name: str, child: Behaviour, status: StatusName) -> decorators.Condition:
    """Make Condition."""
    return decorators.Condition(name, child, Status[status])


def eternal_guard(
    name: str, child: Behaviour, condition: Input[Script], scope: Scope, enums: Enums
) -> decorators.EternalGuard:
    """Make EternalGuard."""
    script = NodeScript(condition, name, "condition", scope, enums)
    return decorators.EternalGuard(name, child, script.holds)


def status_to_blackboard(
    name: str, child: Behaviour, variable_name: InOut[object], scope: Scope
) -> decorators.StatusToBlackboard:
    """Make StatusToBlackboard."""
    keys = Keys(scope)
    variable = keys.variable(variable_name)
    return keys.given_to(decorators.StatusToBlackboard(name, child, variable))


def for_each(
    name: str, child: Behaviour, source_key: Input[object], target_key: InOut[object], scope: Scope
) -> Behaviour:
    """Make ForEach.

    Raises:
        TooOldError: If py_trees does not have it yet.
    """
    keys = Keys(scope)
    make = _since_2_4(decorators, "ForEach")
    made: Behaviour = make(name, child, keys.key(source_key), keys.key(target_key))
    return keys.given_to(made)


def status_queue(name: str, queue: list[str], eventually: StatusName | None = None) -> behaviours.StatusQueue:
    """Make StatusQueue.

    Raises:
        ValueError: If there are no statuses.
    """
    if not queue and eventually is None:
        raise ValueError(NO_ANSWER)
    statuses = [Status[text] for text in queue]
    return behaviours.StatusQueue(name, statuses, Status[eventually] if eventually else None)


def success_every_n(name: str, n: int) -> behaviours.SuccessEveryN:
    """Make SuccessEveryN."""
    return behaviours.SuccessEveryN(name, n)


def tick_counter(name: str, duration: int, completion_status: StatusName) -> behaviours.TickCounter:
    """Make TickCounter."""
    return behaviours.TickCounter(name, duration, Status[completion_status])


def probabilistic_behaviour(
    name: str, weights: list[float] | None = None
) -> behaviours.ProbabilisticBehaviour:
    """Make ProbabilisticBehaviour."""
    return behaviours.ProbabilisticBehaviour(name, weights)


def blackboard_to_status(
    name: str, variable_name: Input[object], scope: Scope
) -> behaviours.BlackboardToStatus:
    """Make BlackboardToStatus."""
    keys = Keys(scope)
    return keys.given_to(behaviours.BlackboardToStatus(name, keys.variable(variable_name)))


def check_exists(
    name: str, variable_name: Input[object], scope: Scope
) -> behaviours.CheckBlackboardVariableExists:
    """Make CheckBlackboardVariableExists."""
    keys = Keys(scope)
    variable = keys.variable(variable_name)
    return keys.given_to(behaviours.CheckBlackboardVariableExists(name, variable))


def wait_for(name: str, variable_name: Input[object], scope: Scope) -> behaviours.WaitForBlackboardVariable:
    """Make WaitForBlackboardVariable."""
    keys = Keys(scope)
    return keys.given_to(behaviours.WaitForBlackboardVariable(name, keys.variable(variable_name)))


def unset_variable(name: str, key: InOut[object], scope: Scope) -> behaviours.UnsetBlackboardVariable:
    """Make UnsetBlackboardVariable."""
    keys = Keys(scope)
    return keys.given_to(behaviours.UnsetBlackboardVariable(name, keys.key(key)))


def set_variable(
    name: str,
    variable_name: InOut[object],
    variable_value: Input[object],
    scope: Scope,
    overwrite: bool = True,
) -> behaviours.SetBlackboardVariable:
    """Make SetBlackboardVariable."""
    keys = Keys(scope)
    variable = keys.variable(variable_name)
    value = constant(variable_value) if variable_value.entry is None else variable_value.get
    return keys.given_to(behaviours.SetBlackboardVariable(name, variable, value, overwrite))


def check_value(
    name: str, variable: Input[object], operator: Comparison, value: Input[object], scope: Scope
) -> behaviours.CheckBlackboardVariableValue:
    """Make CheckBlackboardVariableValue."""
    keys = Keys(scope)
    check = expression(keys.variable(variable), operator, value)
    return keys.given_to(behaviours.CheckBlackboardVariableValue(name, check))


def wait_for_value(
    name: str, variable: Input[object], operator: Comparison, value: Input[object], scope: Scope
) -> behaviours.WaitForBlackboardVariableValue:
    """Make WaitForBlackboardVariableValue."""
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
    """Make CheckBlackboardVariableValues."""
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
    """Make CompareBlackboardVariables.

    Raises:
        TooOldError: If py_trees does not have it yet.
    """
    keys = Keys(scope)
    make = _since_2_4(behaviours, "CompareBlackboardVariables")
    left, right = keys.key(var1_key), keys.key(var2_key)
    made: Behaviour = make(name, left, right, COMPARISONS[operator])
    return keys.given_to(made)


def _written_name(child: Behaviour) -> str:
    """Return a child's name as written in the file, without the wrappers of `oneshot` and conditions."""
    if isinstance(child, Conditions):
        return child.decorated.name
    if isinstance(child, decorators.OneShot):
        inner = _written_name(child.decorated)
        return inner if child.name == f"{inner}OneShot" else child.name
    return child.name


def _since_2_4(module: object, name: str) -> Callable[..., Any]:
    """Return a class that py_trees has had since its version 2.4.

    Raises:
        TooOldError: If the installed one is older.
    """
    if not hasattr(module, name):
        message = f"py_trees {py_trees_version} does not have {name}; it takes 2.4 or later"
        raise TooOldError(message)
    made: Callable[..., Any] = getattr(module, name)
    return made
