"""What BehaviorTree.CPP before 4.9 refuses in a script, or works out in another order.

Its operators are of three groups there: of numbers, of bits, and of texts. In one expression, parts in parentheses and between `?` and
`:` aside, only those of one may stand.
"""

import itertools
from collections.abc import Iterator
from typing import NamedTuple

from sar_compiler.nodes.btcpp.versions import OPERATORS, ORDER, STATEMENTS, Version
from sar_compiler.runtime.expressions import Operation, Script, parts
from sar_compiler.runtime.tokens import TokenKind, tokenize

_GROUPS = {
    **dict.fromkeys(("+", "-", "*", "/"), "numbers"),
    **dict.fromkeys(("~", "!", "&", "|", "^"), "bits"),
    "..": "texts",
}
_ASSIGNMENTS = (":=", "=", "+=", "-=", "*=", "/=")
_BOTH_LATER = ("works this out from the left, as (a || b) && c", "write a || (b && c)")
_IN_PARENTHESES = "put one of them with its operands in parentheses"
_FROM_THE_RIGHT = {"-": "+-", "/": "*/", "|": "^", "^": "|"}


class OlderReading(NamedTuple):
    """A place of a script that an older version refuses, or reads otherwise.

    Attributes:
        start: Where it begins, in characters of the script's text.
        end: Where it ends.
        what: What the version does there, as in "BehaviorTree.CPP 4.8 ...".
        hint: What all versions read as it is meant.
    """

    start: int
    end: int
    what: str
    hint: str


def older_readings(script: Script, version: Version) -> Iterator[OlderReading]:
    """Yield what a version refuses in a script that is one since 4.9, and what it works out otherwise."""
    if version < ORDER.since:
        yield from _from_the_right(script)
    if version < STATEMENTS.since:
        yield from _without_semicolon(script)
    if version < OPERATORS.since:
        yield from _operators(script)


def _from_the_right(script: Script) -> Iterator[OlderReading]:
    for each in itertools.chain.from_iterable(map(parts, script.statements)):
        for step, following in itertools.pairwise(each.steps if isinstance(each, Operation) else ()):
            first, second = step.operator, following.operator
            if second in _FROM_THE_RIGHT.get(first, ()):
                what = f"works this out from the right, as a {first} (b {second} c)"
                yield OlderReading(step.start, step.end, what, f"write (a {first} b) {second} c")
                break


def _without_semicolon(script: Script) -> Iterator[OlderReading]:
    for before, statement in itertools.pairwise(script.statements):
        if ";" not in script.text[before.end : statement.start]:
            what = "refuses a statement that follows another without ;"
            yield OlderReading(statement.start, statement.end, what, "write ; between the two")


class _FlatPart:
    """What was read of an expression outside of parentheses."""

    def __init__(self) -> None:
        self._first = ""
        self._is_either = self._is_chosen = self._is_assigned = False

    def take(self, sign: str) -> tuple[str, str] | None:
        """Take the next sign; return what is wrong with it, and the hint."""
        if sign == "?" or sign in _ASSIGNMENTS:
            return self._take_single(sign)
        if sign in {"||", "&&"}:
            both_later, self._is_either = self._is_either and sign == "&&", sign == "||" or self._is_either
            return _BOTH_LATER if both_later else None
        group = _GROUPS.get(sign)
        self._first = self._first or (sign if group else "")
        other = _GROUPS.get(self._first)
        if not group or group == other:
            return None
        what = f"refuses {sign} beside {self._first} without parentheses: one is of {group}, one of {other}"
        return what, _IN_PARENTHESES

    def _take_single(self, sign: str) -> tuple[str, str] | None:
        is_second = self._is_chosen if sign == "?" else self._is_assigned
        if sign == "?":
            self._is_chosen, self._is_either = True, False
        else:
            self._is_assigned = True
        return (f"refuses a second {sign} in an expression", _IN_PARENTHESES) if is_second else None


def _operators(script: Script) -> Iterator[OlderReading]:
    starts = {statement.start for statement in script.statements}
    around: list[_FlatPart] = []
    is_refused = False
    for token in tokenize(script.text):
        if token.start in starts:
            around = [_FlatPart()]
        sign = token.text if token.kind is TokenKind.SIGN else ""
        if sign in {")", ":"}:
            around.pop()
        wrong = around[-1].take(sign) if around else None
        if wrong is not None and not (is_refused and wrong is not _BOTH_LATER):
            yield OlderReading(token.start, token.end, *wrong)
            is_refused = is_refused or wrong is not _BOTH_LATER
        if sign in {"(", "?"}:
            around.append(_FlatPart())
