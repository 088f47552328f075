"""The parser for scripts in the attribute `code` of `<Script>` and in pre- and postconditions.

The parser uses precedence climbing with the ranks of BehaviorTree.CPP 4. A higher rank binds tighter:

==== =========================== =======================================
rank operators
==== =========================== =======================================
2    `:= = += -= *= /=`          the right side is a whole expression
4    `? :`
6    `||`
8    `&&`
10   `== != < > <= >=`           neighbours are compared: `a < b < c`
12   `|` `^`
14   `&`
16   `+ - ..`
18   `* /`
20   `- ~ !` before an operand
==== =========================== =======================================
"""

import functools
import itertools
import re

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
    children,
)
from sar_compiler.runtime.tokens import ScriptError, Token, TokenKind, excerpt, tokenize

MAX_DEPTH = 100
"""The maximum depth of nested expressions."""

MAX_WORDS = 100_000
"""The maximum number of tokens (numbers, strings, names and signs) of a script."""

# Stored in variables, because access to a member of an enumeration is slow.
_END, _LITERAL, _NAME, _SIGN = TokenKind.END, TokenKind.LITERAL, TokenKind.NAME, TokenKind.SIGN
_ANY, _CONDITIONAL, _COMPARISON, _PREFIX = 0, 4, 10, 20
_ASSIGNMENTS = (":=", "=", "+=", "-=", "*=", "/=")
_RANKS = {
    **dict.fromkeys(_ASSIGNMENTS, 2),
    "?": _CONDITIONAL,
    "||": 6,
    "&&": 8,
    **dict.fromkeys(("==", "!=", "<", ">", "<=", ">="), _COMPARISON),
    **dict.fromkeys(("|", "^"), 12),
    "&": 14,
    **dict.fromkeys(("+", "-", ".."), 16),
    **dict.fromkeys(("*", "/"), 18),
}
_SIMPLE = r"""
    [ \t\r\n]*([A-Za-z_@][A-Za-z0-9_]*)
    [ \t\r\n]*(:=|==|!=|<=|>=|[+\-*/]=|[=<>])
    [ \t\r\n]*(([0-9]{1,15})|[0-9]{1,15}\.[0-9]{1,15}|'[^']*'|([A-Za-z_@][A-Za-z0-9_]*))
    [ \t\r\n]*
    """
_NO_NAMES = frozenset(("true", "false", "not", "and", "or"))
_PREFIXES = {"-", "~", "!"}
# Operators of other languages that are words, with the operators that replace them.
_WORDS = {"and": "&&", "or": "||"}
# Operators of other languages, as the two tokens into which they are split, with the operators that replace them.
_OTHER_OPERATORS = {
    ("==", "="): "==",
    ("!=", "="): "!=",
    ("~", "="): "!=",
    ("<", ">"): "!=",
    ("=", "<"): "<=",
    ("=", ">"): ">=",
    ("=", "+"): "+=",
    ("=", "*"): "*=",
    ("=", "/"): "/=",
}
_NO_OPERATORS = {
    ("+", "+"): "write 'x += 1'",
    ("*", "*"): "scripts have no power operator. Multiply, or calculate the power in a leaf",
    ("/", "/"): "a script has no comments",
    ("/", "*"): "a script has no comments",
    ("<", "<"): "scripts have no operators that shift bits. Multiply by 2, 4, 8...",
    (">", ">"): "scripts have no operators that shift bits. Divide by 2, 4, 8...",
    ("|", "="): "write 'x = x | y'",
    ("&", "="): "write 'x = x & y'",
    ("^", "="): "write 'x = x ^ y'",
    ("&&", "="): "write 'x = x && y'",
    ("||", "="): "write 'x = x || y'",
}


def parse(text: str, *, allow_empty: bool = False) -> Script:
    """Parse a script.

    Args:
        text: The script's text, with XML entities resolved.
        allow_empty: Whether the script may be empty, as in a `<Script>` node but not in an attribute such as `_skipIf`.

    Raises:
        ScriptError: If the script has a syntax error. The exception describes the first error.
    """
    simple = _parse_simple(text)
    script = _ScriptParser(text).script() if simple is None else Script(text, (simple,))
    if not script.statements and not allow_empty:
        raise ScriptError(
            "this script is empty", 0, len(text), hint="write an expression, for example x == 1"
        )
    return script


@functools.cache
def _simple_pattern() -> re.Pattern[str]:
    """Return the pattern that simple scripts match. It is compiled only when a file contains scripts."""
    return re.compile(_SIMPLE, re.VERBOSE)


def _parse_simple(text: str) -> Expression | None:
    """Parse a script with one variable, one operator and one value. Return None for any other script."""
    match = _simple_pattern().fullmatch(text)
    if match is None:
        return None
    name, sign, written, whole, word = match.groups()
    if name in _NO_NAMES or word in _NO_NAMES:
        return None
    (start, behind), (begin, end) = match.span(1), match.span(3)
    if word:
        value: Expression = Name(word, start=begin, end=end)
    else:
        known = int(whole) if whole else written[1:-1] if written[0] == "'" else float(written)
        value = Literal(known, start=begin, end=end)
    target = Name(name, start=start, end=behind)
    if sign in _ASSIGNMENTS:
        return Assignment(sign, target, value, start=start, end=end)
    begin, behind = match.span(2)
    return ComparisonChain(
        target, (OperatorTerm(sign, value, start=begin, end=behind),), start=start, end=end
    )


class _ScriptParser:
    """The parser of one script. Its method `script` may be called only once."""

    def __init__(self, text: str) -> None:
        self._text = text
        self._tokens = list(itertools.islice(tokenize(text), MAX_WORDS + 1))
        if len(self._tokens) > MAX_WORDS:
            last = self._tokens[-1]
            message = f"the script has more than {MAX_WORDS:,} numbers, strings, names and signs"
            raise ScriptError(message, last.start, last.end, hint="move the calculation to a leaf")
        self._index = 0
        self._next = self._tokens[0]
        self._depth = 0

    def script(self) -> Script:
        """Return the parsed script."""
        statements: list[Expression] = []
        while self._next.kind is not _END:
            statements.append(self._expression(_ANY))
            if len(self._tokens) > MAX_DEPTH:  # each level has at least one token
                _check_depth(statements[-1])
            self._refuse_word()
            while self._consume(";"):
                pass
        return Script(self._text, tuple(statements))

    def _previous(self, count: int = 1) -> Token | None:
        """Return the token *count* positions before the next token, or None if there is no such token."""
        return self._tokens[self._index - count] if self._index >= count else None

    def _advance(self) -> Token:
        token = self._next
        if token.kind is not _END:
            self._index += 1
            self._next = self._tokens[self._index]
        return token

    def _is_next(self, sign: str) -> bool:
        return self._next.text == sign  # no other token looks like a sign

    def _consume(self, sign: str) -> bool:
        found = self._is_next(sign)
        if found:
            self._advance()
        return found

    @property
    def _end(self) -> int:
        """The offset after the last token that was read."""
        return self._tokens[self._index - 1].end if self._index else 0

    def _rank(self) -> int:
        """Return the precedence of the next token if this token is an operator, and otherwise -1."""
        return _RANKS.get(self._next.text, -1)

    def _expression(self, least: int) -> Expression:
        """Parse an expression that contains only operators with at least the precedence *least*."""
        start = self._next.start
        self._depth += 1
        if self._depth > MAX_DEPTH:
            raise _too_deep(start, self._next.end)
        left = self._operand()
        while (rank := self._rank()) >= least:
            if self._next.text in _ASSIGNMENTS:
                left = self._assignment(left, start)
                break
            if rank == _CONDITIONAL:
                left = self._conditional(left, start)
                break
            left = self._chain(left, rank, start)
        self._depth -= 1
        return left

    def _operand(self) -> Expression:
        token = self._advance()
        if token.kind is _LITERAL:
            return Literal(token.value, start=token.start, end=token.end)
        if token.kind is _NAME:
            self._check_name(token)
            return Name(token.text, start=token.start, end=token.end)
        if token.kind is _SIGN and token.text in _PREFIXES:
            operand = self._expression(_PREFIX)
            return Prefix(token.text, operand, start=token.start, end=self._end)
        if token.kind is _SIGN and token.text == "(":
            return self._bracketed_expression(token)
        if token.kind is _SIGN:
            self._index -= 1
            self._next = token
        raise self._explain_no_operand()

    def _bracketed_expression(self, opening: Token) -> Expression:
        inner = self._expression(_ANY)
        if self._consume(")"):
            return inner
        self._refuse_word()
        if self._next.kind is _END:
            message = "this '(' is not closed"
            raise ScriptError(message, opening.start, opening.end, hint="write the missing ')'")
        message = f"')' is missing before '{excerpt(self._next.text)}'"
        raise ScriptError(
            message, self._next.start, self._next.end, hint="parentheses contain one expression"
        )

    def _assignment(self, target: Expression, start: int) -> Assignment:
        operator = self._advance()
        if not isinstance(target, Name):
            end = self._tokens[self._index - 2].end
            message = (
                f"only variables can be assigned to, and '{excerpt(self._text[start:end])}' is not a variable"
            )
            if operator.text == "=":
                hint = "write '==' to compare, or enclose the assignment in parentheses"
                raise ScriptError(message, start, operator.end, hint=hint)
            raise ScriptError(message, start, operator.end, hint="enclose the assignment in parentheses")
        value = self._expression(_ANY)
        return Assignment(operator.text, target, value, start=start, end=self._end)

    def _conditional(self, condition: Expression, start: int) -> Conditional:
        question = self._advance()
        then = self._expression(_ANY)
        if not self._consume(":"):
            self._refuse_word()
            message = "this '?' has no ':'"
            raise ScriptError(
                message, question.start, question.end, hint="write 'condition ? value : other value'"
            )
        otherwise = self._expression(_CONDITIONAL)
        return Conditional(condition, then, otherwise, start=start, end=self._end)

    def _chain(self, first: Expression, rank: int, start: int) -> Operation | ComparisonChain:
        steps: list[OperatorTerm] = []
        while self._rank() == rank:
            operator = self._advance()
            operand = self._expression(rank + 1)
            steps.append(OperatorTerm(operator.text, operand, start=operator.start, end=operator.end))
        if rank == _COMPARISON:
            return ComparisonChain(first, tuple(steps), start=start, end=self._end)
        return Operation(first, tuple(steps), start=start, end=self._end)

    def _check_name(self, name: Token) -> None:
        """Raise an error if a name was probably intended as the operator `not` or as a function."""
        following = self._next
        opens = following.kind is _SIGN and following.text in {"(", "!", "~"}
        if name.text == "not" and (opens or following.kind in {_NAME, _LITERAL}):
            raise ScriptError("there is no operator 'not'", name.start, name.end, suggestion="!")
        if self._is_next("(") and following.start == name.end and name.text not in _WORDS:
            message = f"a script cannot call '{excerpt(name.text)}', because scripts have no functions"
            hint = "move the calculation to a leaf, or separate two expressions with ';'"
            raise ScriptError(message, name.start, following.end, hint=hint)

    def _refuse_word(self) -> None:
        """Raise an error if the next token is `and` or `or`, used as an operator after an expression."""
        word = self._next
        if word.kind is not _NAME or word.text not in _WORDS:
            return
        following = self._tokens[self._index + 1]
        if following.kind is _SIGN and following.text in _ASSIGNMENTS:
            return
        message = f"there is no operator '{word.text}'"
        raise ScriptError(message, word.start, word.end, suggestion=_WORDS[word.text])

    def _explain_no_operand(self) -> ScriptError:
        """Return the error for a missing operand at the next token."""
        token, before = self._next, self._previous()
        if before is not None and before.kind is _SIGN:
            other = self._other_operator(before, token)
            if other is not None:
                return other
            if (before.text, token.text) == ("(", ")"):
                return ScriptError("these parentheses are empty", before.start, token.end)
            if before.text != ";" and (token.kind is _END or token.text in {")", ";", ":"}):
                return self._explain_missing_value(before)
        return _explain_misplaced(token)

    def _explain_missing_value(self, sign: Token) -> ScriptError:
        message = f"a value is missing after '{sign.text}'"
        before = self._previous(2)
        if sign.text == "-" and before is not None and before.text == "-" and before.end == sign.start:
            return ScriptError("there is no operator '--'", before.start, sign.end, hint="write 'x -= 1'")
        return ScriptError(message, sign.start, sign.end)

    def _other_operator(self, before: Token, token: Token) -> ScriptError | None:
        """Return the error for two tokens that form an operator of another language, or None for other tokens."""
        signs = (before.text, token.text)
        if before.end != token.start or token.kind is not _SIGN:
            return None
        message = f"there is no operator '{before.text}{token.text}'"
        if signs in _OTHER_OPERATORS:
            return ScriptError(message, before.start, token.end, suggestion=_OTHER_OPERATORS[signs])
        if signs in _NO_OPERATORS:
            return ScriptError(message, before.start, token.end, hint=_NO_OPERATORS[signs])
        return None


def _check_depth(statement: Expression) -> None:
    """Raise an error if the expressions of a statement are nested too deeply: `((a * b + c) * d + e) * ...`."""
    level: tuple[Expression, ...] = (statement,)
    for _ in range(MAX_DEPTH):
        level = tuple(part for expression in level for part in children(expression))
        if not level:
            return
    raise _too_deep(level[0].start, level[0].end)


def _too_deep(start: int, end: int) -> ScriptError:
    message = f"expressions are nested more than {MAX_DEPTH} levels deep"
    return ScriptError(message, start, end, hint="assign parts of the expression to variables first")


def _explain_misplaced(token: Token) -> ScriptError:
    """Return the error for a token that was found instead of the beginning of an expression."""
    if token.text == ")":
        return ScriptError("this ')' has no '('", token.start, token.end)
    if token.text == ":":
        hint = "write 'condition ? value : other value'"
        return ScriptError("this ':' has no '?'", token.start, token.end, hint=hint)
    if token.text in _ASSIGNMENTS:
        message = f"only variables can be assigned to, and no variable precedes '{token.text}'"
        hint = "enclose an assignment that is part of another expression in parentheses: (x := 1)"
        return ScriptError(message, token.start, token.end, hint=hint)
    advice = "write the number without '+'" if token.text == "+" else None
    return ScriptError(f"a value is missing before '{token.text}'", token.start, token.end, hint=advice)
