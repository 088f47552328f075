"""The values that a script's expressions can have whatever its variables hold, and what raises whatever they hold."""

import itertools
from collections.abc import Callable
from typing import Any, NamedTuple

from sar_compiler.runtime import operators
from sar_compiler.runtime.evaluation import EvaluationError, failure, no_condition, step_failure
from sar_compiler.runtime.expressions import (
    Assignment,
    ComparisonChain,
    Conditional,
    Expression,
    Literal,
    Operation,
    Prefix,
    Script,
)
from sar_compiler.runtime.variables import RefusedValueError, ScriptValue


class _Samples(NamedTuple):
    """The possible values of an expression.

    Attributes:
        values: The value, if it is known; else, for each possible type, a value that every operator takes that takes any of the type.
        is_known: Whether it is known.
    """

    values: tuple[ScriptValue, ...]
    is_known: bool = False


_NUMBER, _ANY = _Samples((1.0,)), _Samples((1.0, "1"))


def raised_always(script: Script, *, is_condition: bool) -> list[EvaluationError]:
    """Return the errors of the parts of a script that raise whenever they are calculated."""
    folding = _Folding(script.text)
    values = [folding.values_of(statement) for statement in script.statements]
    if is_condition and values:
        folding.applied(operators.as_condition, lambda error, _: no_condition(script, error), values[-1])
    return folding.errors


class _Folding:
    def __init__(self, text: str) -> None:
        self.errors: list[EvaluationError] = []
        self._text = text

    def values_of(self, node: Expression) -> _Samples:
        """Return the possible values of an expression; of one that raises always, any."""
        if isinstance(node, Literal):
            return _Samples((node.value,), is_known=True)
        if isinstance(node, Prefix):
            return self.applied(
                operators.PREFIX[node.operator], self._failure(node), self.values_of(node.operand)
            )
        if isinstance(node, Operation):
            return self._operation(node)
        if isinstance(node, ComparisonChain):
            # What can be compared, a program's enumerations decide: they make numbers of texts.
            for operand in (node.first, *(step.operand for step in node.steps)):
                self.values_of(operand)
            return _NUMBER
        if isinstance(node, Conditional):
            return self._conditional(node)
        if isinstance(node, Assignment):
            value = self.values_of(node.value)
            if node.operator not in {":=", "="}:
                self.applied(
                    operators.BINARY[node.operator.removesuffix("=")], self._failure(node), _ANY, value
                )
        return _ANY

    def applied(
        self,
        calculate: Callable[..., ScriptValue],
        error_of: Callable[[RefusedValueError, tuple[Any, ...]], EvaluationError],
        *operands: _Samples,
    ) -> _Samples:
        """Return the possible results of an operator; keep its error if it has none."""
        results: list[ScriptValue] = []
        errors = []
        for values in itertools.product(*(each.values for each in operands)):
            try:
                results.append(calculate(*values))
            except RefusedValueError as error:  # noqa: PERF203 - each may fail
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
                return step_failure(self._text, node, step, error, *sides)

            right = self.values_of(step.operand)
            values = self.applied(operators.BINARY[step.operator], error_of, values, right)
        return values

    def _conditional(self, node: Conditional) -> _Samples:
        condition = self.values_of(node.condition)
        chosen = self.applied(operators.chosen, self._failure(node.condition), condition)
        if chosen.is_known:
            return self.values_of(node.then if chosen.values[0] else node.otherwise)
        self.values_of(node.then)
        self.values_of(node.otherwise)
        return _ANY
