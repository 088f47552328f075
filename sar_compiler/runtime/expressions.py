"""Parsed scripts: expressions with their locations, and the names that they use."""

import enum
import functools
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import NamedTuple, Union


# Instances are never changed, but frozen dataclasses would double the time to parse a script. Methods that are generated
# for each class would take half of the time to import this module.
@dataclass(slots=True, kw_only=True, eq=False, repr=False)
class ScriptPart:
    """A part of a script, with the offsets of its start and end in the text."""

    start: int
    end: int

    def _content(self) -> list[object]:
        names: tuple[str, ...] = self.__match_args__  # without the location, whose fields are keyword-only
        return [getattr(self, name) for name in names]

    def __eq__(self, other: object) -> bool:
        return (
            isinstance(other, ScriptPart)
            and type(other) is type(self)
            and self._content() == other._content()
        )

    def __hash__(self) -> int:
        return hash((type(self), *self._content()))

    def __repr__(self) -> str:
        return f"{type(self).__name__}({', '.join(map(repr, self._content()))})"


@dataclass(slots=True, eq=False, repr=False)
class Literal(ScriptPart):
    """A number or a string; `true` and `false` are 1.0 and 0.0."""

    value: int | float | str


@dataclass(slots=True, eq=False, repr=False)
class Name(ScriptPart):
    """A variable or a named constant."""

    name: str


@dataclass(slots=True, eq=False, repr=False)
class Prefix(ScriptPart):
    """An operand with a leading `-`, `~` or `!`."""

    operator: str
    operand: "Expression"


@dataclass(slots=True, eq=False, repr=False)
class OperatorTerm(ScriptPart):
    """An operator and the operand on its right. `start` and `end` enclose only the operator."""

    operator: str
    operand: "Expression"


@dataclass(slots=True, eq=False, repr=False)
class Operation(ScriptPart):
    """Operators of equal rank, applied from left to right: `a + b - c`."""

    first: "Expression"
    steps: tuple[OperatorTerm, ...]


@dataclass(slots=True, eq=False, repr=False)
class ComparisonChain(ScriptPart):
    """A chain of comparisons: `a < b <= c` is true if `a < b` and `b <= c` are true."""

    first: "Expression"
    steps: tuple[OperatorTerm, ...]


@dataclass(slots=True, eq=False, repr=False)
class Conditional(ScriptPart):
    """A choice between two values: `condition ? then : otherwise`."""

    condition: "Expression"
    then: "Expression"
    otherwise: "Expression"


@dataclass(slots=True, eq=False, repr=False)
class Assignment(ScriptPart):
    """An assignment to a variable with one of the operators `:=`, `=`, `+=`, `-=`, `*=` and `/=`."""

    operator: str
    target: Name
    value: "Expression"


Expression = Union[  # noqa: UP007 - `|` does not support the names in quotes
    Literal, Name, Prefix, Operation, ComparisonChain, Conditional, Assignment
]


@dataclass(frozen=True)
class Script:
    """A parsed script.

    The locations of its parts are offsets in the text, from 0; an end is the offset after the part.

    Attributes:
        text: The text as written.
        statements: The script's expressions, in order. The value of the last expression is the script's value.
    """

    text: str = field(compare=False)
    statements: tuple[Expression, ...]

    def __str__(self) -> str:
        return self.text

    @functools.cached_property
    def by_start(self) -> Mapping[int, Expression]:
        """The statements of the script, by start offset."""
        return {each.start: each for each in self.statements}

    @functools.cached_property
    def plain_form(self) -> type[Assignment] | type[ComparisonChain] | None:
        """The class of the only statement if it assigns or compares just names and literals; otherwise None."""
        if len(self.statements) != 1:
            return None
        (statement,) = self.statements
        if isinstance(statement, Assignment) and statement.operator in {":=", "="}:
            return Assignment if isinstance(statement.value, (Name, Literal)) else None
        if not isinstance(statement, ComparisonChain):
            return None
        operands = (statement.first, *(step.operand for step in statement.steps))
        return ComparisonChain if all(isinstance(each, (Name, Literal)) for each in operands) else None

    @property
    def closing_assignment(self) -> Assignment | None:
        """The last statement if it is an assignment. For example, `level = 2` may be meant as `level == 2`."""
        last = self.statements[-1] if self.statements else None
        return last if isinstance(last, Assignment) else None


class Access(enum.Enum):
    """The kinds of access to a variable in a script."""

    READ = "read"
    CREATE = "create"
    """An assignment with `:=`, which creates a missing variable."""
    CHANGE = "change"
    """An assignment with `=`, `+=` or a similar operator, which requires that the variable exists."""


class NameUse(NamedTuple):
    """A use of a name in a script.

    Attributes:
        name: The name.
        access: The kind of access.
        start: The offset of the name's start in the script's text.
        end: The offset after the name.
        certain: Whether every run of the script evaluates the name. False if the name is in a branch of `?:`, or after the second operand
            of a chain of comparisons.
    """

    name: str
    access: Access
    start: int
    end: int
    certain: bool = True


def name_uses(script: Script) -> Iterator[NameUse]:
    """Yield the uses of names in a script, in the order of evaluation.

    `x += 1` reads `x` and changes it. A named constant is reported like a variable that is read.
    """
    for statement in script.statements:
        yield from _uses(statement, certain=True)


def children(expression: Expression) -> tuple[Expression, ...]:
    """Return the operands of an expression in the order of evaluation. The target of an assignment is not included."""
    if isinstance(expression, Prefix):
        return (expression.operand,)
    if isinstance(expression, (Operation, ComparisonChain)):
        return (expression.first, *(step.operand for step in expression.steps))
    if isinstance(expression, Conditional):
        return (expression.condition, expression.then, expression.otherwise)
    if isinstance(expression, Assignment):
        return (expression.value,)
    return ()


def parts(expression: Expression) -> Iterator[Expression]:
    """Yield an expression and all expressions that are parts of it."""
    waiting = [expression]
    while waiting:
        part = waiting.pop()
        yield part
        waiting += children(part)


def _uses(expression: Expression, *, certain: bool) -> Iterator[NameUse]:
    if isinstance(expression, Name):
        yield NameUse(expression.name, Access.READ, expression.start, expression.end, certain)
    parts = children(expression)
    always = _always_evaluated(expression, len(parts))
    for index, part in enumerate(parts):
        yield from _uses(part, certain=certain and index < always)
    if isinstance(expression, Assignment):
        target = expression.target
        if expression.operator not in {":=", "="}:
            yield NameUse(target.name, Access.READ, target.start, target.end, certain)
        access = Access.CREATE if expression.operator == ":=" else Access.CHANGE
        yield NameUse(target.name, access, target.start, target.end, certain)


def _always_evaluated(expression: Expression, parts: int) -> int:
    """Return the number of leading parts of an expression that are always evaluated."""
    if isinstance(expression, Conditional):
        return 1
    if isinstance(expression, ComparisonChain):
        return 2
    return parts
