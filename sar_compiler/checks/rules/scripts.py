"""Valid scripts that differ from what was meant, and those that can never be run."""

import itertools
from collections.abc import Iterator

from sar_compiler.checks.rules.check_context import CheckContext
from sar_compiler.nodes.binding.bound import BoundNode
from sar_compiler.nodes.btcpp.versions import STATEMENTS
from sar_compiler.nodes.values import CONDITION
from sar_compiler.runtime.expressions import (
    Assignment,
    ComparisonChain,
    Expression,
    Literal,
    Name,
    Script,
    parts,
)
from sar_compiler.runtime.tokens import excerpt
from sar_compiler.tree.diagnostic import Diagnostic

_NO_OPERATORS = frozenset({"if", "then", "else"})
_ALWAYS = "every tick that comes here raises this: calculate with numbers, join texts with .."
_CONDITIONS = frozenset({"_failureIf", "_successIf", "_skipIf", "_while"})


def check_scripts(context: CheckContext) -> Iterator[Diagnostic]:
    """Yield conditions that assign a variable instead of comparing it, and what does nothing or raises always."""
    for tree in context.trees:
        scripted = tree.nodes if tree.wrappers else tree.demanding
        for bound in scripted:
            for attribute, script in (*bound.conditions.items(), *bound.values.items()):
                if isinstance(script, Script):
                    asked = is_condition(bound, attribute)
                    if asked:
                        yield from _assigning(bound, attribute, script)
                    yield from _idle(bound, attribute, script, is_condition=asked)
                    yield from _raising(bound, attribute, script, is_condition=asked)
                    # What an older version refuses, `check_versions` tells.
                    if context.btcpp >= STATEMENTS.since:
                        yield from _touching(bound, attribute, script, is_condition=asked)


def is_condition(bound: BoundNode, attribute: str) -> bool:
    """Return whether an attribute's script is a condition."""
    parameter = bound.spec.parameters.get(attribute)
    return attribute in _CONDITIONS or (parameter is not None and parameter.value_type is CONDITION)


def is_statement(bound: BoundNode, attribute: str, start: int) -> bool:
    """Return whether the name that a script reads at a place is a statement of its own, which `check_scripts` tells of."""
    script = bound.conditions.get(attribute) or bound.values.get(attribute)
    statement = script.by_start.get(start) if isinstance(script, Script) else None
    if not isinstance(statement, Name) or not isinstance(script, Script):
        return False
    return statement is not script.statements[-1] or not is_condition(bound, attribute)


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
    yield bound.element.finding("assignment-as-condition", message, span, suggestion=suggestion, hint=hint)


def _idle(bound: BoundNode, attribute: str, script: Script, *, is_condition: bool) -> Iterator[Diagnostic]:
    """Yield statements whose value nobody gets, those that follow each other as one."""
    without_value = script.statements[:-1] if is_condition else script.statements
    for is_idle, group in itertools.groupby(without_value, _is_idle):
        statements = list(group)
        if is_idle:
            start, end = statements[0].start, statements[-1].end
            span = bound.element.within_value(attribute, start, end)
            message = f"{attribute}: '{excerpt(script.text[start:end])}' does nothing: its value goes nowhere"
            yield bound.element.finding("idle-statement", message, span, hint=_meant_by(statements))


def _is_idle(statement: Expression) -> bool:
    return not any(isinstance(part, Assignment) for part in parts(statement))


def _meant_by(statements: list[Expression]) -> str:
    if all(isinstance(each, Literal) for each in statements):
        return "; ends a statement: write a list as a text, in '...'"
    if isinstance(statements[0], ComparisonChain):
        return "it only compares: = and := give a variable a value"
    if isinstance(statements[0], Name) and statements[0].name in _NO_OPERATORS:
        return "write a choice as 'condition ? value : other value'"
    return "leave it out, or give a variable its value, as in x := ..."


def _raising(bound: BoundNode, attribute: str, script: Script, *, is_condition: bool) -> Iterator[Diagnostic]:
    """Yield what raises whatever the variables hold."""
    if all(map(_is_plain, script.statements)) and not is_condition:
        return
    from sar_compiler.checks.rules.script_values import raised_always

    for error in raised_always(script, is_condition=is_condition):
        span = bound.element.within_value(attribute, error.start, error.end)
        message = f"{attribute}: {error.message}"
        yield bound.element.finding("failing-script", message, span, hint=error.hint or _ALWAYS)


def _is_plain(statement: Expression) -> bool:
    """Return whether a statement calculates nothing: most of them only give a variable a value."""
    if not isinstance(statement, Assignment) or statement.operator not in {":=", "="}:
        return False
    return isinstance(statement.value, Literal)


def _touching(
    bound: BoundNode, attribute: str, script: Script, *, is_condition: bool
) -> Iterator[Diagnostic]:
    """Yield the first statement that stands in one line with the one before, with nothing between them."""
    for before, statement in itertools.pairwise(script.statements):
        is_value = is_condition and statement is script.statements[-1]
        if _is_idle(before) or (_is_idle(statement) and not is_value):
            continue  # that it does nothing is said already
        between = script.text[before.end : statement.start]
        span = bound.element.within_value(attribute, statement.start, statement.end)
        end = bound.element.within_value(attribute, before.end - 1, before.end)
        if span.line == end.line and not between.strip(" )("):
            written = excerpt(script.text[statement.start : statement.end])
            message = (
                f"{attribute}: '{written}' is a statement of its own: nothing joins it to the one before"
            )
            hint = "write ; between the two, or the operator that is missing"
            yield bound.element.finding("touching-statements", message, span, hint=hint)
            return
