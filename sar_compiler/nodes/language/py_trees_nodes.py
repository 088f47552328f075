"""Makers of py_trees' own nodes of what is written in a tree file.

The nodes keep their names, their arguments, and their treatment of unusual values (a count of 0 or below), as
described in each spec. Only values that would raise an error in the middle of a run are refused.
The differences: their keys are the tree's, and none of their children may be one that can be skipped.

A node that the installed py_trees lacks has a spec nevertheless: whether a file is correct does not depend on the machine.
"""

from collections.abc import Callable, Mapping
from typing import Any

from py_trees import composites, decorators
from py_trees.behaviour import Behaviour
from py_trees.common import OneShotPolicy, ParallelPolicy, Status
from py_trees.version import __version__ as py_trees_version

from sar_compiler.errors import SarError
from sar_compiler.nodes.binding.attributes import ONESHOT_TYPE
from sar_compiler.nodes.language.comparisons import (
    COMPARISONS,
    JUNCTIONS,
    Comparison,
    Junction,
    constant,
    expression,
    read_check,
)
from sar_compiler.nodes.language.narrow_types import KEY, STATUS_NAME, STATUS_NAMES, VARIABLE, PolicyName
from sar_compiler.nodes.language.node_rules import HOW_TO_SELECT, NO_ANSWER, clash_with, place_of
from sar_compiler.nodes.language.py_trees_keys import Keys
from sar_compiler.nodes.spec import NodeSpec
from sar_compiler.nodes.values import ANYTHING, CONDITION, type_of
from sar_compiler.runtime.blackboard import Scope
from sar_compiler.runtime.enums import Enums
from sar_compiler.runtime.language_nodes import Conditions
from sar_compiler.runtime.ports import InOut, Input
from sar_compiler.runtime.scripting import NodeScript


class TooOldError(SarError):
    """The installed py_trees does not have a node yet."""


# What py_trees is given for a value, by the name of its type.
_GIVEN: Mapping[str, Callable[[Any], object]] = {
    STATUS_NAME.name: lambda word: Status[word],
    STATUS_NAMES.name: lambda words: [Status[word] for word in words],
    ONESHOT_TYPE.name: lambda word: OneShotPolicy[word],
    type_of(Comparison).name: lambda word: COMPARISONS[word],
    ANYTHING.name: lambda port: constant(port) if port.entry is None else port.get,
}


def stock(
    spec: NodeSpec, name: str, scope: Scope | None = None, enums: Enums | None = None, **written: Any
) -> Behaviour:
    """Make a node by the constructor of its class.

    Args:
        spec: The node's record.
        name: Its name.
        scope: Where its keys are looked up, if it has any.
        enums: The names that stand for numbers, if it has a script.
        **written: What is written for its other parameters.

    Raises:
        TooOldError: If the installed py_trees does not have it yet.
    """
    keys = Keys(scope) if scope is not None else None
    arguments: dict[str, Any] = {}
    for parameter, value in written.items():
        value_type = spec.parameters[parameter].value_type
        kind = value_type.name if value_type is not None else ""
        if keys is not None and kind in (KEY.name, VARIABLE.name):
            value = keys.key(value) if kind == KEY.name else keys.variable(value)  # noqa: PLW2901
        elif scope is not None and enums is not None and kind == CONDITION.name:
            value = NodeScript(value, name, parameter, scope, enums).holds  # noqa: PLW2901
        elif kind in _GIVEN and value is not None:
            value = _GIVEN[kind](value)  # noqa: PLW2901
        arguments[parameter] = value
    made: Behaviour = _class_of(spec)(name=name, **arguments)
    return made if keys is None else keys.give_to(made)


def status_queue(spec: NodeSpec, name: str, queue: list[str], eventually: str | None = None) -> Behaviour:
    """Make StatusQueue.

    Raises:
        ValueError: If there are no statuses.
    """
    if not queue and eventually is None:
        raise ValueError(NO_ANSWER)
    return stock(spec, name, queue=queue, eventually=eventually)


def parallel(
    _spec: NodeSpec,
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
        raise ValueError(f"selected: no child is named; {HOW_TO_SELECT}")
    names = [_written_name(child) for child in children]
    chosen = [children[place_of(text, names)] for text in selected]
    return composites.Parallel(name, ParallelPolicy.SuccessOnSelected(chosen, waits), children)


def comparing(
    spec: NodeSpec,
    name: str,
    variable: Input[object],
    operator: Comparison,
    value: Input[object],
    scope: Scope,
) -> Behaviour:
    """Make a node that compares a key with a value."""
    keys = Keys(scope)
    return keys.give_to(_class_of(spec)(name, expression(keys.variable(variable), operator, value)))


def check_values(
    spec: NodeSpec,
    name: str,
    checks: list[str],
    operator: Junction,
    scope: Scope,
    namespace: InOut[object] | None = None,
) -> Behaviour:
    """Make CheckBlackboardVariableValues."""
    keys = Keys(scope)
    expressions = [
        expression(keys.variable(Input(check.variable)), check.comparison, Input(check.value))
        for check in map(read_check, checks)
    ]
    folder = None if namespace is None else keys.number_keys(namespace, len(expressions))
    return keys.give_to(_class_of(spec)(name, expressions, JUNCTIONS[operator], folder))


def _written_name(child: Behaviour) -> str:
    """Return a child's name as written in the file, without the wrappers of `oneshot` and conditions."""
    if isinstance(child, Conditions):
        return child.decorated.name
    if isinstance(child, decorators.OneShot):
        inner = _written_name(child.decorated)
        return inner if child.name == f"{inner}OneShot" else child.name
    return child.name


def _class_of(spec: NodeSpec) -> Callable[..., Behaviour]:
    """Return the class of a node.

    Raises:
        TooOldError: If the installed py_trees does not have it yet.
    """
    try:
        found = spec.cls
    except AttributeError:
        message = f"py_trees {py_trees_version} does not have {spec.tag}; it takes 2.4 or later"
        raise TooOldError(message) from None
    assert found is not None  # noqa: S101 - it is named
    return found
