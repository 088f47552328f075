"""Skeletons of scripts. A skeleton has no names and constants, so similar scripts have the same skeleton."""

from collections.abc import Mapping
from typing import NamedTuple

from sar_compiler.runtime.expressions import (
    Assignment,
    Conditional,
    Expression,
    Literal,
    Name,
    Prefix,
    Script,
)
from sar_compiler.runtime.variables import LARGEST_EXACT, ScriptValue


class VariableSlot(NamedTuple):
    """The position of a variable in a skeleton. The variable's name is `Skeleton.names[number]`."""

    number: int


class ConstantSlot(NamedTuple):
    """The position of a constant in a skeleton. `kind` is `int` only for integers above `LARGEST_EXACT`."""

    number: int
    kind: type


class Applied(NamedTuple):
    """A prefix operator, the operator `?:` or an assignment operator, together with the operands."""

    sign: str
    operands: "tuple[SkeletonPart, ...]"


class Chain(NamedTuple):
    """Operators of equal precedence, applied from left to right, and their operands."""

    signs: tuple[str, ...]
    operands: "tuple[SkeletonPart, ...]"


SkeletonPart = VariableSlot | ConstantSlot | Applied | Chain


class _InnerAssignmentError(Exception):
    """Raised if an assignment is part of another expression."""


class Skeleton:
    """A script in which slots replace all names and constants.

    Args:
        script: The script.
        enums: The named constants.

    Attributes:
        statements: The script's statements; None for a statement with an assignment in the middle of an expression.
        names: The names of the script's variables, by the number of the variable.
        constants: The script's constants, by the number of the constant.
        reals: The constants, with integers up to `LARGEST_EXACT` converted to real numbers.
    """

    def __init__(self, script: Script, enums: Mapping[str, int]) -> None:
        self._enums = enums
        self.names: list[str] = []
        self.constants: list[ScriptValue] = []
        self.reals: list[ScriptValue] = []
        self.statements = tuple(self._statement(each) for each in script.statements)

    def _statement(self, node: Expression) -> SkeletonPart | None:
        try:
            if not isinstance(node, Assignment):
                return self._part(node)
            return Applied(node.operator, (self._variable_slot(node.target.name), self._part(node.value)))
        except _InnerAssignmentError:
            return None

    def _part(self, node: Expression) -> SkeletonPart:
        if isinstance(node, Literal):
            return self._constant_slot(node.value)
        if isinstance(node, Name):
            number = self._enums.get(node.name)
            return self._variable_slot(node.name) if number is None else self._constant_slot(float(number))
        if isinstance(node, Prefix):
            return Applied(node.operator, (self._part(node.operand),))
        if isinstance(node, Conditional):
            return Applied("?", tuple(map(self._part, (node.condition, node.then, node.otherwise))))
        if isinstance(node, Assignment):
            raise _InnerAssignmentError
        operands = (node.first, *(step.operand for step in node.steps))
        return Chain(tuple(step.operator for step in node.steps), tuple(map(self._part, operands)))

    def _variable_slot(self, name: str) -> VariableSlot:
        if name not in self.names:
            self.names.append(name)
        return VariableSlot(self.names.index(name))

    def _constant_slot(self, value: ScriptValue) -> ConstantSlot:
        self.constants.append(value)
        self.reals.append(float(value) if isinstance(value, int) and value <= LARGEST_EXACT else value)
        return ConstantSlot(len(self.constants) - 1, type(self.reals[-1]))
