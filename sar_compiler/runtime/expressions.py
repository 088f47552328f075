"""Parsed scripts: expressions with their places, and what can be told of them without running them."""

import enum
import functools
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import NamedTuple, Union


# Nobody changes one. To freeze them would double what it takes to read a script.
@dataclass(slots=True, kw_only=True, unsafe_hash=True)
class ScriptPart:
    """A part of a script's text: where it begins, and the first character behind it; equal ones may stand elsewhere."""

    start: int = field(compare=False)
    end: int = field(compare=False)


@dataclass(slots=True, unsafe_hash=True)
class Literal(ScriptPart):
    """A number or a text; `true` and `false` are 1.0 and 0.0."""

    value: int | float | str


@dataclass(slots=True, unsafe_hash=True)
class Name(ScriptPart):
    """A variable, or a name of an enumeration."""

    name: str


@dataclass(slots=True, unsafe_hash=True)
class Prefix(ScriptPart):
    """An operand with `-`, `~` or `!` before it."""

    operator: str
    operand: "Expression"


@dataclass(slots=True, unsafe_hash=True)
class OperatorTerm(ScriptPart):
    """An operator with the operand on its right; the place is the operator's."""

    operator: str
    operand: "Expression"


@dataclass(slots=True, unsafe_hash=True)
class Operation(ScriptPart):
    """Operators of one rank, applied from left to right: `a + b - c`."""

    first: "Expression"
    steps: tuple[OperatorTerm, ...]


@dataclass(slots=True, unsafe_hash=True)
class ComparisonChain(ScriptPart):
    """Neighbours compared: `a < b <= c` is true if `a < b` and `b <= c` are."""

    first: "Expression"
    steps: tuple[OperatorTerm, ...]


@dataclass(slots=True, unsafe_hash=True)
class Conditional(ScriptPart):
    """One of two values: `condition ? then : otherwise`."""

    condition: "Expression"
    then: "Expression"
    otherwise: "Expression"


@dataclass(slots=True, unsafe_hash=True)
class Assignment(ScriptPart):
    """A variable is given a value, by one of `:= = += -= *= /=`."""

    operator: str
    target: Name
    value: "Expression"


Expression = Union[  # noqa: UP007 - the union names classes by text
    Literal, Name, Prefix, Operation, ComparisonChain, Conditional, Assignment
]


@dataclass(frozen=True)
class Script:
    """A script that could be read.

    All places in it count characters of its text, from 0; an end is the first character that is no part.

    Attributes:
        text: How it was written.
        statements: Its expressions, in order; the last one's value is the script's.
    """

    text: str = field(compare=False)
    statements: tuple[Expression, ...]

    def __str__(self) -> str:
        return self.text

    @functools.cached_property
    def by_start(self) -> Mapping[int, Expression]:
        """The statements by the places where they begin."""
        return {each.start: each for each in self.statements}

    @functools.cached_property
    def plain_form(self) -> type[Assignment] | type[ComparisonChain] | None:
        """What it is, where it only gives a variable a value or compares, with names and literals, as most do; None of any other."""
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
        """The assignment whose value is the script's: `level = 2` where `level == 2` may be meant."""
        last = self.statements[-1] if self.statements else None
        return last if isinstance(last, Assignment) else None


class Access(enum.Enum):
    """The use of a name in a script."""

    READ = "read"
    CREATE = "create"
    """`:=`: the variable need not exist."""
    CHANGE = "change"
    """`=` and `+=` and the like: the variable must exist."""


class NameUse(NamedTuple):
    """A name in a script.

    Attributes:
        name: The name.
        access: What is done with it.
        start: Its place.
        end: Where it ends.
        certain: Whether every run of the script comes here; if not, it is a branch of `?:`, or behind the
            second operand of a chain of comparisons.
    """

    name: str
    access: Access
    start: int
    end: int
    certain: bool = True


def name_uses(script: Script) -> Iterator[NameUse]:
    """Yield what a script does with names, in the order in which it does so when it is run.

    `x += 1` reads `x`, and changes it. Names of enumerations are read as variables are.
    """
    for statement in script.statements:
        yield from _uses(statement, certain=True)


def children(expression: Expression) -> tuple[Expression, ...]:
    """Return the parts of an expression, in the order in which they are evaluated; not an assignment's target."""
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
    """Yield an expression and all of its parts."""
    left = [expression]
    while left:
        part = left.pop()
        yield part
        left += children(part)


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
    """Return how many of an expression's parts every evaluation reaches."""
    if isinstance(expression, Conditional):
        return 1
    if isinstance(expression, ComparisonChain):
        return 2
    return parts
