"""Evaluate scripts. Each script is compiled once to functions, which are called in each tick."""

from collections.abc import Callable, Mapping
from typing import Any, TypeVar

from sar_compiler.errors import SarError
from sar_compiler.runtime import operators
from sar_compiler.runtime.expressions import (
    Assignment,
    ComparisonChain,
    Conditional,
    Expression,
    Literal,
    Name,
    Operation,
    OperatorTerm,
    Prefix,
    Script,
)
from sar_compiler.runtime.tokens import excerpt
from sar_compiler.runtime.variables import (
    RefusedValueError,
    ScriptValue,
    UnknownValueError,
    UnknownVariableError,
    VariableError,
    Variables,
)

T = TypeVar("T")

Evaluate = Callable[[Variables], ScriptValue]

_NO_ENUMS: Mapping[str, int] = {}


class EvaluationError(SarError):
    """Raised if a script cannot be evaluated with the current values of its variables.

    Attributes:
        message: The description of the error.
        start: The offset, in the script's text, at which the failed expression starts.
        end: The offset directly after the failed expression.
        hint: A short instruction; None if there is no remedy.
    """

    def __init__(self, message: str, start: int, end: int, hint: str | None = None) -> None:
        super().__init__(message)
        self.message = message
        self.start = start
        self.end = end
        self.hint = hint


class Program:
    """A compiled script, which can be run any number of times.

    Args:
        script: The script.
        enums: The named constants, whose names are never read as variables.

    Attributes:
        script: The script.
        statements: A function that evaluates each statement.
    """

    def __init__(self, script: Script, enums: Mapping[str, int] = _NO_ENUMS) -> None:
        self.script = script
        maker = _ScriptCompiler(script.text, enums)
        self.statements = tuple(maker.make(statement) for statement in script.statements)

    def run(self, variables: Variables) -> ScriptValue:
        """Evaluate the script.

        Returns:
            The value of the last expression; 0.0 if the script is empty.

        Raises:
            EvaluationError: If a variable is missing or a value is invalid. Earlier assignments are not undone.
        """
        value: ScriptValue = 0.0
        for statement in self.statements:
            value = statement(variables)
        return value

    def holds(self, variables: Variables) -> bool:
        """Evaluate the script as a condition.

        Raises:
            EvaluationError: As for `run`, or if the script's value is neither true nor false.
        """
        return self.as_condition(self.run(variables))

    def as_condition(self, value: ScriptValue) -> bool:
        """Convert the script's value to True or False.

        Raises:
            EvaluationError: If the value is neither true nor false.
        """
        try:
            return operators.as_condition(value)
        except RefusedValueError as error:
            raise condition_type_error(self.script, error) from error


class _ScriptCompiler:
    def __init__(self, text: str, enums: Mapping[str, int]) -> None:
        self._text = text
        self._enums = dict(enums)
        self._makers: Mapping[type[Expression], Callable[[Any], Evaluate]] = {
            Literal: self._literal,
            Name: self._name,
            Prefix: self._prefix,
            Operation: self._operation,
            ComparisonChain: self._comparison,
            Conditional: self._conditional,
            Assignment: self._assignment,
        }

    def make(self, expression: Expression) -> Evaluate:
        """Return a function that evaluates an expression."""
        return self._makers[type(expression)](expression)

    def _literal(self, node: Literal) -> Evaluate:
        value = node.value
        return lambda _: value

    def _name(self, node: Name) -> Evaluate:
        name = node.name
        if name in self._enums:
            number = float(self._enums[name])
            return lambda _: number

        def run(variables: Variables) -> ScriptValue:
            try:
                return variables.read(name)
            except VariableError as error:
                hint = _definition_hint(name) if isinstance(error, UnknownVariableError) else None
                raise EvaluationError(str(error), node.start, node.end, hint) from error

        return run

    def _prefix(self, node: Prefix) -> Evaluate:
        operand = self.make(node.operand)
        calculate = operators.PREFIX[node.operator]

        return lambda variables: self._calculate(node, calculate, operand(variables))

    def _operation(self, node: Operation) -> Evaluate:
        first = self.make(node.first)
        steps = [(operators.BINARY[step.operator], self.make(step.operand), step) for step in node.steps]

        def run(variables: Variables) -> ScriptValue:
            value = first(variables)
            for calculate, operand, step in steps:
                right = operand(variables)
                try:
                    value = calculate(value, right)
                except RefusedValueError as error:
                    raise chain_error(self._text, node, step, error, value, right) from error
            return value

        return run

    def _comparison(self, node: ComparisonChain) -> Evaluate:
        first = self.make(node.first)
        steps = [(step.operator, self.make(step.operand), step) for step in node.steps]
        compare, enums = operators.compare, self._enums

        def run(variables: Variables) -> ScriptValue:
            left = first(variables)
            for operator, operand, step in steps:
                right = operand(variables)
                try:
                    if not compare(operator, left, right, enums):
                        return 0.0
                except RefusedValueError as error:
                    raise chain_error(self._text, node, step, error, left, right) from error
                left = right
            return 1.0

        return run

    def _conditional(self, node: Conditional) -> Evaluate:
        condition, then, otherwise = map(self.make, (node.condition, node.then, node.otherwise))

        def run(variables: Variables) -> ScriptValue:
            chosen = self._calculate(node.condition, operators.is_chosen, condition(variables))
            return then(variables) if chosen else otherwise(variables)

        return run

    def _assignment(self, node: Assignment) -> Evaluate:
        name, value = node.target.name, self.make(node.value)
        creates = node.operator == ":="
        changes = not creates and node.operator != "="
        calculate = operators.BINARY[node.operator.removesuffix("=")] if changes else None

        def run(variables: Variables) -> ScriptValue:
            result = value(variables)
            try:
                if calculate is not None:
                    # The target of an assignment is always a variable, even if it has the name of a constant.
                    result = self._calculate(node, calculate, variables.read(name), result)
                return variables.create(name, result) if creates else variables.assign(name, result)
            except VariableError as error:
                raise _assignment_failure(node, error) from error

        return run

    def _calculate(self, node: Expression, calculate: Callable[..., T], *operands: ScriptValue) -> T:
        try:
            return calculate(*operands)
        except RefusedValueError as error:
            raise failure(self._text, node, error) from error


def condition_type_error(script: Script, error: RefusedValueError) -> EvaluationError:
    """Return the error for a condition whose value is neither true nor false."""
    hint = "'=' assigns a value. Write '==' to compare" if script.closing_assignment else None
    start, end = (script.statements[-1].start, script.statements[-1].end) if script.statements else (0, 0)
    message = f"'{excerpt(script.text[start:end])}' is not a condition: {error}"
    return EvaluationError(message, start, end, hint)


def chain_error(
    text: str,
    node: Operation | ComparisonChain,
    step: OperatorTerm,
    error: VariableError,
    left: ScriptValue,
    right: ScriptValue,
) -> EvaluationError:
    """Return the error for an operator in a chain. The error location ends at the right operand."""
    following = next((later.start for later in node.steps if later.start > step.start), None)
    end = node.end if following is None else len(text[:following].rstrip())
    one_text = isinstance(left, str) != isinstance(right, str)
    hint = "'..' joins a string and a number" if step.operator == "+" and one_text else None
    message = f"'{excerpt(text[node.start : end])}' cannot be calculated: {error}"
    return EvaluationError(message, node.start, end, hint)


def _assignment_failure(node: Assignment, error: VariableError) -> EvaluationError:
    target = node.target
    if isinstance(error, UnknownVariableError | UnknownValueError):
        hint = _creation_hint(target.name) if isinstance(error, UnknownVariableError) else None
        return EvaluationError(str(error), target.start, target.end, hint)
    message = f"this value cannot be assigned to '{target.name}': {error}"
    return EvaluationError(
        message, node.start, node.end, "a variable keeps the type of the first value that was assigned to it"
    )


def failure(text: str, node: Expression, error: VariableError) -> EvaluationError:
    """Return the error for an expression whose evaluation has failed."""
    message = f"'{excerpt(text[node.start : node.end])}' cannot be calculated: {error}"
    return EvaluationError(message, node.start, node.end)


def _definition_hint(name: str) -> str:
    # An assignment to the name of a C++ program's enumerator would hide the enumerator's number.
    if name.isupper():
        enumerator = "add an enumerator of the C++ program to [language.enums] in sar.toml"
        return f"{enumerator}, or create a variable with {name} := ..."
    return _creation_hint(name)


def _creation_hint(name: str) -> str:
    return f"to create it, write {name} := ..."
