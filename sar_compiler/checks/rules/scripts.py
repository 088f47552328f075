"""Rules about valid scripts whose meaning is probably unintended, and about scripts that can never run."""

import itertools
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

from sar_compiler.checks.rules import CheckContext
from sar_compiler.nodes.binding.bound import BoundNode
from sar_compiler.nodes.btcpp import STATEMENTS
from sar_compiler.nodes.values import CONDITION
from sar_compiler.runtime import operators
from sar_compiler.runtime.constant_conditions import constant_clauses, constant_truth
from sar_compiler.runtime.evaluation import EvaluationError, chain_error, condition_type_error, failure
from sar_compiler.runtime.expressions import (
    Assignment,
    ComparisonChain,
    Conditional,
    Expression,
    Literal,
    Name,
    Operation,
    Prefix,
    Script,
    parts,
)
from sar_compiler.runtime.tokens import excerpt
from sar_compiler.runtime.variables import RefusedValueError, ScriptValue
from sar_compiler.tree.diagnostic import Diagnostic, Severity

_NO_OPERATORS = frozenset({"if", "then", "else"})
_REMEDY = "Use arithmetic operators only with numbers, and '..' to join strings"
_ALWAYS = f"this error is raised in every tick of the node. {_REMEDY}"
_IN_BRANCH = f"this error is raised in every tick that takes the branch. {_REMEDY}"
_NEVER_TICKED = frozenset({("_failureIf", True), ("_successIf", True), ("_skipIf", True), ("_while", False)})
"""Each condition attribute with the truth value for which the node is never ticked."""
_CONDITIONS = frozenset({"_failureIf", "_successIf", "_skipIf", "_while"})


def check_scripts(context: CheckContext) -> Iterator[Diagnostic]:
    """Yield findings about probable errors in conditions and statements.

    Conditions must not assign or be constant. Statements must have an effect and must not always raise an
    error.
    """
    for bound, attribute, script in context.scripts:
        asked = is_condition(bound, attribute)
        if asked:
            yield from _check_constant(bound, attribute, script)
        if script.plain_form is (ComparisonChain if asked else Assignment):
            continue  # no other rule applies to a single comparison or assignment
        if asked:
            yield from _check_assignments(bound, attribute, script)
        yield from _no_ops(bound, attribute, script, is_condition=asked)
        yield from _check_raising(bound, attribute, script, is_condition=asked)
        # `check_versions` reports syntax that an older version refuses.
        if context.version >= STATEMENTS:
            yield from _check_touching(bound, attribute, script, is_condition=asked)


def is_condition(bound: BoundNode, attribute: str) -> bool:
    """Return whether an attribute's script is a condition."""
    parameter = bound.spec.parameters.get(attribute)
    return attribute in _CONDITIONS or (parameter is not None and parameter.value_type.name == CONDITION.name)


def is_statement(bound: BoundNode, attribute: str, start: int) -> bool:
    """Return whether a name in a script is a whole statement.

    `check_scripts` reports such statements.
    """
    script = dict(bound.scripts()).get(attribute)
    statement = script.by_start.get(start) if script is not None else None
    if not isinstance(statement, Name) or script is None:
        return False
    return statement is not script.statements[-1] or not is_condition(bound, attribute)


def _check_assignments(bound: BoundNode, attribute: str, script: Script) -> Iterator[Diagnostic]:
    assignment = script.closing_assignment
    if assignment is None:
        return
    operator, target = assignment.operator, assignment.target
    start = script.text.index(operator, target.end)
    span = bound.element.value_part_span(attribute, start, start + len(operator))
    message = f"{attribute}: '{operator}' assigns to '{target.name}' in a condition"
    suggestion = "==" if operator == "=" else None
    hint = "to compare, write ==. To change variables, use _onSuccess, _onFailure or a <Script>"
    yield bound.element.finding("assignment-as-condition", message, span, suggestion=suggestion, hint=hint)


def _check_constant(bound: BoundNode, attribute: str, script: Script) -> Iterator[Diagnostic]:
    whole = constant_truth(script)
    clauses = constant_clauses(script) if whole is None else [(script.statements[-1], whole)]
    for clause, truth in clauses:
        variables = [part.name for part in parts(clause) if isinstance(part, Name)]
        start, end = (clause.start, clause.end) if whole is None else (0, len(script.text))
        message = f"{attribute}: '{excerpt(script.text[start:end])}' is always {'true' if truth else 'false'}"
        if (attribute, whole) in _NEVER_TICKED:
            message += f", so '{bound.name}' is never ticked"
        hint = "delete the condition, or compare a variable in it"
        if variables:
            names = "the variables" if len(set(variables)) > 1 else f"'{variables[0]}'"
            hint = (
                f"the result is the same for all values of {names}. Correct a comparison, or swap && and ||"
            )
        # A condition `true` or `false` may switch a node off on purpose.
        severity = Severity.WARNING if variables else Severity.INFO
        span = bound.element.value_part_span(attribute, start, end)
        yield bound.element.finding("constant-condition", message, span, hint=hint, severity=severity)


def _no_ops(bound: BoundNode, attribute: str, script: Script, *, is_condition: bool) -> Iterator[Diagnostic]:
    """Yield one finding for each series of statements whose values are not used."""
    without_value = script.statements[:-1] if is_condition else script.statements
    for is_idle, group in itertools.groupby(without_value, _is_idle):
        statements = list(group)
        if is_idle:
            start, end = statements[0].start, statements[-1].end
            span = bound.element.value_part_span(attribute, start, end)
            message = f"{attribute}: '{excerpt(script.text[start:end])}' has no effect: its value is not used"
            yield bound.element.finding("idle-statement", message, span, hint=_idle_hint(statements))


def _is_idle(statement: Expression) -> bool:
    return not any(isinstance(part, Assignment) for part in parts(statement))


def _idle_hint(statements: list[Expression]) -> str:
    if all(isinstance(each, Literal) for each in statements):
        return "';' ends a statement. Write a list as a string in quotation marks: '...'"
    if isinstance(statements[0], ComparisonChain):
        return "this statement only compares. To assign a value, use = or :="
    if isinstance(statements[0], Name) and statements[0].name in _NO_OPERATORS:
        return "write a choice as 'condition ? value : other value'"
    return "delete it, or assign the value to a variable, such as x := ..."


def _check_raising(
    bound: BoundNode, attribute: str, script: Script, *, is_condition: bool
) -> Iterator[Diagnostic]:
    """Yield findings about operations that raise an error for all values of the variables."""
    always, in_branches = find_certain_errors(script, is_condition=is_condition)
    for error in (*always, *in_branches):
        span = bound.element.value_part_span(attribute, error.start, error.end)
        message = f"{attribute}: {error.message}"
        usual, severity = (_ALWAYS, Severity.ERROR) if error in always else (_IN_BRANCH, Severity.WARNING)
        yield bound.element.finding(
            "failing-script", message, span, hint=error.hint or usual, severity=severity
        )


def _check_touching(
    bound: BoundNode, attribute: str, script: Script, *, is_condition: bool
) -> Iterator[Diagnostic]:
    """Yield a finding about the first statement that follows another in the same line without a separator."""
    for before, statement in itertools.pairwise(script.statements):
        is_value = is_condition and statement is script.statements[-1]
        if _is_idle(before) or (_is_idle(statement) and not is_value):
            continue  # `_no_ops` reports that the statement has no effect
        between = script.text[before.end : statement.start]
        span = bound.element.value_part_span(attribute, statement.start, statement.end)
        end = bound.element.value_part_span(attribute, before.end - 1, before.end)
        if span.line == end.line and not between.strip(" )("):
            written = excerpt(script.text[statement.start : statement.end])
            message = f"{attribute}: '{written}' is a separate statement, not joined to the previous one"
            hint = "write ; between the two statements, or write the missing operator"
            yield bound.element.finding("touching-statements", message, span, hint=hint)
            return


class _Samples(NamedTuple):
    """Samples of the possible values of an expression.

    Attributes:
        values: The value, if it is known. Otherwise, one value of each possible type, chosen so that
            every operator for this type accepts it.
        is_known: Whether the value is known.
    """

    values: tuple[ScriptValue, ...]
    is_known: bool = False


_NUMBER, _ANY = _Samples((1.0,)), _Samples((1.0, "1"))


def find_certain_errors(
    script: Script, *, is_condition: bool
) -> tuple[list[EvaluationError], list[EvaluationError]]:
    """Return the errors that a script always raises, and the errors in branches of `? :` that it may skip."""
    folding = _Folding(script.text)
    values = [folding.values_of(statement) for statement in script.statements]
    if is_condition and values:
        folding.apply_operator(
            operators.as_condition, lambda error, _: condition_type_error(script, error), values[-1]
        )
    return folding.errors, folding.in_branches


class _Folding:
    def __init__(self, text: str) -> None:
        self.errors: list[EvaluationError] = []
        self.in_branches: list[EvaluationError] = []
        """The errors in branches of `? :` that the script may skip."""
        self._text = text

    def values_of(self, node: Expression) -> _Samples:
        """Return the possible values of an expression; any value if the expression always raises an error."""
        if isinstance(node, Literal):
            return _Samples((node.value,), is_known=True)
        if isinstance(node, Prefix):
            return self.apply_operator(
                operators.PREFIX[node.operator], self._failure(node), self.values_of(node.operand)
            )
        if isinstance(node, Operation):
            return self._operation(node)
        if isinstance(node, ComparisonChain):
            # Enumerations of the C++ program turn strings into numbers, so they decide which values can be compared.
            for operand in (node.first, *(step.operand for step in node.steps)):
                self.values_of(operand)
            return _NUMBER
        if isinstance(node, Conditional):
            return self._conditional(node)
        if isinstance(node, Assignment):
            value = self.values_of(node.value)
            if node.operator not in {":=", "="}:
                self.apply_operator(
                    operators.BINARY[node.operator.removesuffix("=")], self._failure(node), _ANY, value
                )
        return _ANY

    def apply_operator(
        self,
        calculate: Callable[..., ScriptValue],
        error_of: Callable[[RefusedValueError, tuple[Any, ...]], EvaluationError],
        *operands: _Samples,
    ) -> _Samples:
        """Return the possible results of an operator.

        If the operator rejects all possible operands, record an error.
        """
        results: list[ScriptValue] = []
        errors = []
        for values in itertools.product(*(each.values for each in operands)):
            try:
                results.append(calculate(*values))
            except RefusedValueError as error:  # noqa: PERF203 - each call may fail
                errors.append(error_of(error, values))
        if not results:
            self.errors.append(errors[0])
            return _ANY
        if all(each.is_known for each in operands):
            return _Samples(tuple(results), is_known=True)
        kinds = {isinstance(each, str) for each in results}
        return _Samples(tuple(sample for sample in _ANY.values if isinstance(sample, str) in kinds))

    def _failure(self, node: Expression) -> Callable[[RefusedValueError, Any], EvaluationError]:
        return lambda error, _: failure(self._text, node, error)

    def _operation(self, node: Operation) -> _Samples:
        values = self.values_of(node.first)
        for step in node.steps:

            def error_of(error: RefusedValueError, sides: Any, step: Any = step) -> EvaluationError:
                return chain_error(self._text, node, step, error, *sides)

            right = self.values_of(step.operand)
            values = self.apply_operator(operators.BINARY[step.operator], error_of, values, right)
        return values

    def _conditional(self, node: Conditional) -> _Samples:
        condition = self.values_of(node.condition)
        chosen = self.apply_operator(operators.is_chosen, self._failure(node.condition), condition)
        if chosen.is_known:
            return self.values_of(node.then if chosen.values[0] else node.otherwise)
        return self._choice_values(node.then, node.otherwise)

    def _choice_values(self, then: Expression, otherwise: Expression) -> _Samples:
        """Return the possible values of a choice.

        An error in the choice is certain only if both branches raise an error.
        """
        before = len(self.errors)
        self.values_of(then)
        middle = len(self.errors)
        self.values_of(otherwise)
        if middle == before or len(self.errors) == middle:
            self.in_branches += self.errors[before:]
            del self.errors[before:]
        return _ANY
