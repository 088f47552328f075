"""Skeletons of scripts, without names and constants; scripts of the same structure have equal ones."""

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
    """A variable."""

    number: int


class ConstantSlot(NamedTuple):
    """A constant; `kind` is float for every number that a script can calculate with."""

    number: int
    kind: type


class Applied(NamedTuple):
    """A sign with its operands."""

    sign: str
    operands: "tuple[SkeletonPart, ...]"


class Chain(NamedTuple):
    """Operators of one rank, from left to right; there is one more operand than signs."""

    signs: tuple[str, ...]
    operands: "tuple[SkeletonPart, ...]"


SkeletonPart = VariableSlot | ConstantSlot | Applied | Chain


class _InnerAssignmentError(Exception):
    """An expression assigns before it is evaluated."""


class Skeleton:
    """A script without its names and constants.

    Args:
        script: The script.
        enums: The named constants.

    Attributes:
        statements: Its statements; None for one that assigns in the middle of an expression.
        names: Its variables, by their numbers.
        constants: Its constants, by their numbers.
        reals: The constants, as real numbers if a script can calculate with them.
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
