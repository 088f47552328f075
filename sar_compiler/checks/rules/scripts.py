"""Valid scripts that differ from what was meant."""

from collections.abc import Iterator

from sar_compiler.checks.rules.check_context import CheckContext, warning
from sar_compiler.nodes.binding.bound import BoundNode
from sar_compiler.nodes.values import CONDITION
from sar_compiler.runtime.expressions import Script
from sar_compiler.tree.diagnostic import Diagnostic

_CONDITIONS = frozenset({"_failureIf", "_successIf", "_skipIf", "_while"})


def check_scripts(context: CheckContext) -> Iterator[Diagnostic]:
    """Yield conditions that assign a variable instead of comparing it."""
    for tree in context.trees:
        scripted = tree.nodes if tree.wrappers else tree.demanding
        for bound in scripted:
            for attribute, script in (*bound.conditions.items(), *bound.values.items()):
                if isinstance(script, Script) and is_condition(bound, attribute):
                    yield from _assigning(bound, attribute, script)


def is_condition(bound: BoundNode, attribute: str) -> bool:
    """Return whether an attribute's script is a condition."""
    parameter = bound.spec.parameters.get(attribute)
    return attribute in _CONDITIONS or (parameter is not None and parameter.value_type is CONDITION)


def _assigning(bound: BoundNode, attribute: str, script: Script) -> Iterator[Diagnostic]:
    assignment = script.closing_assignment
    if assignment is None:
        return
    operator, target = assignment.operator, assignment.target
    start = script.text.index(operator, target.end)
    span = bound.element.within_value(attribute, start, start + len(operator))
    message = f"{attribute}: '{operator}' gives '{target.name}' a value, where a condition is wanted"
    suggestion = "==" if operator == "=" else None
    hint = "compare with ==, and change variables in _onSuccess, _onFailure or a <Script>"
    yield warning("assignment-as-condition", message, bound, span, suggestion, hint)
