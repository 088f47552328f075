"""Analyses scripts: finds comparisons with constants, and flows of values such as `y = x + 2`."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace

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
)
from sar_compiler.runtime.operators import LONGEST_TEXT

Resolve = Callable[[str], str | None]
"""A function that returns the absolute name of the entry to which a name refers, or None if there is no entry."""

_MAX_FORMS = 16
_LONGEST_NUMBER = 330
"""The maximum number of characters that a number takes within a string."""


@dataclass(frozen=True)
class FlowValue:
    """The information about the value of an expression that is known without evaluating it.

    Attributes:
        forms: The possible forms of the value: an entry plus a constant, or a constant (entry None); empty if the value
            may have other forms.
        types: The possible types of the value; an entry name stands for the types of the entry.
        names: The entries on which the value depends, except for entries that are only compared with constants.
        is_total: Whether the expression can be evaluated for all numbers in these entries.
        length: The maximum length of the value as a string, in characters.
    """

    forms: frozenset[tuple[str | None, float]]
    types: frozenset[object]
    names: frozenset[str] = frozenset()
    is_total: bool = True
    length: int = _LONGEST_NUMBER

    @property
    def is_constant(self) -> bool:
        """Whether the value is always a known constant, or always one of several known constants."""
        return bool(self.forms) and not self.names

    def plus(self, constant: float) -> "FlowValue":
        """Return what is known about the sum of this value and a constant."""
        forms = frozenset((name, offset + constant) for name, offset in self.forms)
        return replace(self, forms=forms, types=_REAL)


NUMBERS = frozenset[object]([int, float])
"""The types of numbers."""
_REAL = frozenset[object]([float])
_TEXT = frozenset[object]([str])
_TRUTH = FlowValue(frozenset([(None, 0.0), (None, 1.0)]), _REAL)


@dataclass
class ScriptFlows:
    """The ways in which scripts read and write blackboard entries.

    Args:
        enums: The numbers of the named constants in scripts.

    Attributes:
        fixed: The entries that are also used in a way that is not listed below.
        tests: The comparisons of entries with constants, each as an entry and a constant.
        flows: The assignments of an entry plus a constant, each as a target, a source and a constant.
        results: The assignments of other values, each as a target and a value.
        types: The types of the values assigned to each entry; an entry name stands for the types of the entry.
    """

    enums: Mapping[str, int]
    fixed: set[str] = field(default_factory=set)
    tests: set[tuple[str, float]] = field(default_factory=set)
    flows: set[tuple[str, str, float]] = field(default_factory=set)
    results: list[tuple[str, FlowValue]] = field(default_factory=list)
    types: dict[str, set[object]] = field(default_factory=dict)

    @property
    def read(self) -> set[str]:
        """The entries that are read for any purpose."""
        results = (name for _, value in self.results for name in value.names)
        return {
            *self.fixed,
            *(name for name, _ in self.tests),
            *(source for _, source, _ in self.flows),
            *results,
        }

    def add_script(self, script: Script, resolve: Resolve, *, is_condition: bool) -> None:
        """Add the reads and writes of a script.

        Args:
            script: The script.
            resolve: Resolves the names in the script.
            is_condition: Whether the script's value is used as a truth value.
        """
        reader = _FlowReader(self, resolve)
        for number, statement in enumerate(script.statements, 1):
            is_last = is_condition and number == len(script.statements)
            if isinstance(statement, Assignment) and not is_last:
                reader.assign(statement)
            else:
                value = reader.flow_value(statement)
                if is_last or not value.forms:
                    self.fixed |= value.names


class _FlowReader:
    """Evaluates the expressions of a script symbolically, and records which entries they read and write."""

    def __init__(self, found: ScriptFlows, resolve: Resolve) -> None:
        self._found, self._resolve = found, resolve

    def flow_value(self, node: Expression) -> FlowValue:
        """Return what is known about the value of an expression, and record the effects of the evaluation."""
        if isinstance(node, Literal):
            return _constant(node.value)
        if isinstance(node, Name):
            enums = self._found.enums
            return _constant(float(enums[node.name])) if node.name in enums else self._variable(node.name)
        if isinstance(node, Conditional):
            self._test(self.flow_value(node.condition), 0.0)
            return _join_values(self.flow_value(node.then), self.flow_value(node.otherwise))
        if isinstance(node, Assignment):
            # The value of an assignment is the stored value.
            self.assign(node)
            return self._variable(node.target.name)
        return self._calculate(node)

    def _calculate(self, node: Prefix | Operation | ComparisonChain) -> FlowValue:
        if isinstance(node, Prefix):
            return self._prefix(node.operator, self.flow_value(node.operand))
        value = self.flow_value(node.first)
        for step in node.steps:
            left, right = value, self.flow_value(step.operand)
            if isinstance(node, Operation):
                value = self._combine(step.operator, left, right)
            else:
                self._compare(left, right)
                value = right
        return _TRUTH if isinstance(node, ComparisonChain) else value

    def assign(self, node: Assignment) -> None:
        """Record an assignment."""
        found, value, target = self._found, self.flow_value(node.value), self._resolve(node.target.name)
        if node.operator not in {":=", "="}:
            value = self._combine(node.operator[0], self._variable(node.target.name), value)
        if target is None:
            found.fixed |= value.names
            return
        found.types.setdefault(target, set()).update(value.types)
        if not value.forms:
            found.results.append((target, value))
        found.flows |= {(target, name, offset) for name, offset in value.forms if name is not None}

    def _variable(self, name: str) -> FlowValue:
        entry = self._resolve(name)
        if entry is None:
            return FlowValue(frozenset(), frozenset([object]), is_total=False)
        return FlowValue(frozenset([(entry, 0.0)]), frozenset([entry]), frozenset([entry]))

    def _prefix(self, operator: str, value: FlowValue) -> FlowValue:
        if operator == "!":
            self._test(value, 0.0)
            return _TRUTH
        if operator == "-" and value.is_constant:
            return FlowValue(frozenset((None, -offset) for _, offset in value.forms), _REAL)
        return FlowValue(frozenset(), _REAL, value.names, is_total=operator == "-" and _is_number(value))

    def _combine(self, operator: str, left: FlowValue, right: FlowValue) -> FlowValue:
        if operator in {"&&", "||"}:
            self._found.fixed |= left.names | right.names
            return _TRUTH
        if operator in {"+", "-"} and left.forms and right.is_constant and len(right.forms) == 1:
            ((_, offset),) = right.forms
            return left.plus(offset if operator == "+" else -offset)
        if operator == "+" and len(left.forms) == 1 and left.is_constant and right.forms:
            return self._combine("+", right, left)
        names, are_total = left.names | right.names, left.is_total and right.is_total
        if operator == "..":
            length, is_text = left.length + right.length, _TEXT in (left.types, right.types)
            are_total = are_total and is_text and length <= LONGEST_TEXT
            return FlowValue(frozenset(), _TEXT, names, are_total, length)
        is_number = operator != "+" or any(each.types <= NUMBERS for each in (left, right))
        are_total = are_total and operator in "+-*/" and _is_number(left) and _is_number(right)
        return FlowValue(frozenset(), _REAL if is_number else _REAL | _TEXT, names, are_total)

    def _compare(self, left: FlowValue, right: FlowValue) -> None:
        for one, other in ((left, right), (right, left)):
            if one.is_constant and other.forms:
                for _, constant in one.forms:
                    self._test(other, constant)
                return
        self._found.fixed |= left.names | right.names

    def _test(self, value: FlowValue, constant: float) -> None:
        """Record that a value is compared with a constant."""
        if not value.forms:
            self._found.fixed |= value.names
        self._found.tests |= {(name, constant - offset) for name, offset in value.forms if name is not None}


def _constant(value: float | str) -> FlowValue:
    if isinstance(value, str):
        return FlowValue(frozenset(), _TEXT, length=len(value))
    return FlowValue(frozenset([(None, float(value))]), frozenset([type(value)]))


def _join_values(first: FlowValue, second: FlowValue) -> FlowValue:
    forms = (
        first.forms | second.forms if first.forms and second.forms else frozenset[tuple[str | None, float]]()
    )
    return FlowValue(
        forms if len(forms) <= _MAX_FORMS else frozenset(),
        first.types | second.types,
        first.names | second.names,
        first.is_total and second.is_total,
        max(first.length, second.length),
    )


def _is_number(value: FlowValue) -> bool:
    """Return whether a value must be a number if all entries on which the value depends contain numbers."""
    return str not in value.types and object not in value.types
