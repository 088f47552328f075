"""Find conditions that have the same result for all values of their variables, such as `x < 1 && x > 2`.

A comparison of a variable with literals changes its result only at these literals. So it is enough to evaluate the condition with the
literals and one value between each two of them, for all combinations of the variables. Any other comparison, such as `x < y + 1`, is
replaced by a Boolean variable. Equal comparisons are replaced by the same variable, and opposite comparisons by its negation.
"""

import functools
import itertools
import math
from collections.abc import Iterable, Iterator
from contextlib import suppress
from dataclasses import replace

from sar_compiler.runtime.evaluation import EvaluationError, Program
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
    ScriptPart,
    parts,
)
from sar_compiler.runtime.variables import PlainVariables, RefusedValueError, ScriptValue, number_of

_MOST_COMBINATIONS = 4096
"""A condition is not analysed if its variables have more combinations of sampled values than this number."""
_LOGICAL = frozenset({"&&", "||"})
_OF_EQUALS = {"==": 1, "<=": 1, ">=": 1, "!=": 0, "<": 0, ">": 0}
"""The result of each comparison operator when a value is compared with itself."""


def constant_truth(script: Script) -> bool | None:
    """Return True if a condition is always true, False if it is always false, and None otherwise.

    Args:
        script: The condition.

    Returns:
        True or False; None if the result depends on the variables, or if the condition assigns a variable or always raises an error.
    """
    # This quick check answers most calls, and is faster than a lookup in the cache of `_sampled_truth`.
    if not script.statements or _is_decided_by_a_value(script):
        return None
    return _sampled_truth(script)


def constant_clauses(script: Script) -> Iterator[tuple[Expression, bool]]:
    """Yield each largest part of a condition that contains variables but is always true or always false.

    Args:
        script: The condition. Its parts are the operands of `&&`, `||` and `!`.
    """
    waiting = [*script.statements[-1:]]
    while waiting:
        clause = waiting.pop()
        truth = constant_truth(replace(script, statements=(clause,)))
        if truth is not None and any(isinstance(part, Name) for part in parts(clause)):
            yield clause, truth
        elif isinstance(clause, Prefix) and clause.operator == "!":
            waiting.append(clause.operand)
        elif isinstance(clause, Operation) and clause.steps[0].operator in _LOGICAL:
            waiting += [clause.first, *(step.operand for step in clause.steps)][::-1]


@functools.lru_cache(maxsize=4096)
def _sampled_truth(script: Script) -> bool | None:
    if any(isinstance(part, Assignment) for each in script.statements for part in parts(each)):
        return None
    return _SampledCondition(script).constant_truth()


def _is_decided_by_a_value(script: Script) -> bool:
    """Return whether a script, like most conditions, only compares one variable with one literal."""
    chain = script.statements[0]
    if script.plain_form is not ComparisonChain or not isinstance(chain, ComparisonChain):
        return False
    return len(chain.steps) == 1 and isinstance(chain.first, Name) != isinstance(chain.steps[0].operand, Name)


class _SampledCondition:
    """A rewritten condition that can be decided by testing only a few values of each variable.

    Args:
        script: The condition, without assignments.
    """

    def __init__(self, script: Script) -> None:
        self._values: dict[str, set[ScriptValue]] = {}
        self._literals: dict[str, set[ScriptValue]] = {}
        self._unjudged: dict[Expression, Name] = {}
        self._script = replace(script, statements=(self._rewrite(script.statements[-1]),))

    def constant_truth(self) -> bool | None:
        """Return whether the condition is always true or always false; None if this depends on the values."""
        choices = [{0, 1, *_representatives(literals)} for literals in self._literals.values()]
        if math.prod(map(len, choices)) > _MOST_COMBINATIONS:
            return None
        program, found = Program(self._script), set()
        for values in itertools.product(*choices):
            with suppress(EvaluationError):
                found.add(program.holds(PlainVariables(dict(zip(self._literals, values, strict=True)))))
            if len(found) > 1:
                return None
        return found.pop() if found else None

    def _rewrite(self, node: Expression) -> Expression:
        if isinstance(node, Name):
            self._literals.setdefault(node.name, set())
            return node
        if isinstance(node, Prefix) and node.operator == "!":
            return replace(node, operand=self._rewrite(node.operand))
        if isinstance(node, Operation) and all(step.operator in _LOGICAL for step in node.steps):
            steps = tuple(replace(step, operand=self._rewrite(step.operand)) for step in node.steps)
            return replace(node, first=self._rewrite(node.first), steps=steps)
        if isinstance(node, Conditional):
            condition, then, otherwise = map(self._rewrite, (node.condition, node.then, node.otherwise))
            return replace(node, condition=condition, then=then, otherwise=otherwise)
        if isinstance(node, ComparisonChain):
            lefts = (node.first, *(step.operand for step in node.steps))
            links = [self._compare(left, step) for left, step in zip(lefts, node.steps, strict=False)]
            # As in a run, a comparison is not evaluated if the previous one is false.
            no = Literal(0, **_source_range(node))
            return functools.reduce(
                lambda rest, link: Conditional(link, rest, no, **_source_range(node)), reversed(links)
            )
        return self._unknown(node) if any(isinstance(part, Name) for part in parts(node)) else node

    def _compare(self, left: Expression, step: OperatorTerm) -> Expression:
        """Return the rewritten comparison of two neighbouring operands in a chain of comparisons."""
        operator, right = step.operator, step.operand
        if not any(isinstance(part, Name) for side in (left, right) for part in parts(side)):
            return _comparison(left, operator, right)
        if left == right:
            return Literal(_OF_EQUALS[operator], **_source_range(step))
        for name, other in ((left, right), (right, left)):
            if isinstance(name, Name) and isinstance(other, Literal):
                self._literals.setdefault(name.name, set()).add(other.value)
                return _comparison(left, operator, right)
        if operator in {"!=", ">=", "<="}:
            opposite = {"!=": "==", ">=": "<", "<=": ">"}[operator]
            term = replace(step, operator=opposite)
            return Prefix("!", self._compare(left, term), **_source_range(step))
        mirrored = _comparison(right, operator.replace(">", "<"), left)
        if operator == ">" or (operator == "==" and mirrored in self._unjudged):
            return self._unknown(mirrored)
        return self._unknown(_comparison(left, operator, right))

    def _unknown(self, node: Expression) -> Name:
        """Return a variable to replace a part that is not analysed. Equal parts get the same variable."""
        name = self._unjudged.setdefault(node, Name(f"?{len(self._unjudged)}", **_source_range(node)))
        self._literals.setdefault(name.name, set())
        return name


def _representatives(literals: Iterable[ScriptValue]) -> Iterator[ScriptValue]:
    """Yield all literals, and one value from each interval between neighbouring literals."""
    numbers, texts = set(), {""}
    for literal in literals:
        if not isinstance(literal, str):
            numbers.add(float(literal))
            continue
        texts |= {literal, literal + "\x01"}  # the literal and the string that follows it in order
        with suppress(RefusedValueError):
            numbers.add(float(number_of(literal)))
    if len(texts) > 1:
        yield from texts
    bounds = sorted(each for each in numbers if math.isfinite(each))
    yield from bounds
    yield from ((lower + upper) / 2 for lower, upper in itertools.pairwise(bounds))
    yield from (sign * (abs(bound) + 1) * 2 for bound in (bounds[:1] + bounds[-1:]) for sign in (1, -1))


def _comparison(left: Expression, operator: str, right: Expression) -> ComparisonChain:
    place = _source_range(left)
    return ComparisonChain(left, (OperatorTerm(operator, right, **place),), **place)


def _source_range(part: ScriptPart) -> dict[str, int]:
    return {"start": part.start, "end": part.end}
