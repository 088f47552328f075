"""The tokens of a script: numbers, strings, names and signs, each with its location."""

import enum
import functools
import math
import re
from collections.abc import Iterator
from typing import NamedTuple

from sar_compiler.errors import SarError

LARGEST_INTEGER = 2**63 - 1
"""The largest integer in a script. Integers have 64 bits."""

_SPACE = " \t\r\n"
_WORDS_PATTERN = r"""
    [ \t\r\n]*
    (?:
    (?P<real>[0-9]+(?:\.[0-9]+(?:[eE][+\-]?[0-9]+)?|[eE][+\-]?[0-9]+))
    | (?P<integer>0[xX][0-9a-fA-F]+|[0-9]+)
    | (?P<name>[A-Za-z_@][A-Za-z0-9_]*)
    | (?P<text>'[^']*'|"[^"]*")
    | (?P<sign>\.\.|&&|\|\||[=!<>:+\-*/]=|[+\-*/&|^~!<>=?:();])
    )
    """
# Characters directly after a number that make it invalid; two points are an operator.
_STUCK = re.compile(r"(?:[A-Za-z0-9_@]|\.(?!\.))*")
_DOTTED = re.compile(r"(?:\.[A-Za-z0-9_@]+)+|\.")
_BRACED = re.compile(r"\{([^{}]*)\}")
_NAME = r"[A-Za-z_@][A-Za-z0-9_]*"
_WORD_BEFORE = r"[A-Za-z_@][A-Za-z0-9_]*$"

# Quotation marks of other languages, with their closing quotation marks.
_OTHER_QUOTES = {'"': '"', "`": "`", "\u201c": "\u201d", "\u2018": "\u2019"}
# Statements of other languages.
_STATEMENTS = frozenset(("if", "while", "for", "switch"))
_CALLED = re.compile(r"\s*\(")
_INSTEAD_OF_STATEMENTS = "use the node's attribute _skipIf or _while, or choose a value with x ? a : b"
BOOLS = {"true": 1.0, "false": 0.0}
"""The values of the literals `true` and `false`."""
_HINTS = {
    "%": "scripts have no remainder operator. Calculate the remainder in a leaf",
    ",": "separate expressions with ';'",
    "[": "scripts have only numbers and strings, no lists",
    "]": "scripts have only numbers and strings, no lists",
    "#": "a script has no comments",
    "\\": "strings have no escape sequences. Use a backslash only inside '...', where it is an ordinary character",
    "$": "write only the variable's name",
}
# The maximum number of characters of a script that a message shows.
_LONGEST_EXCERPT = 40


class ScriptError(SarError):
    """Raised if the syntax of a script is wrong.

    Attributes:
        message: The description of the error.
        start: The offset in the script's text at which the wrong part starts.
        end: The offset directly after the wrong part.
        suggestion: The replacement of the wrong part, if it can be guessed.
        hint: A short instruction, if there is no replacement.
    """

    def __init__(
        self, message: str, start: int, end: int, suggestion: str | None = None, hint: str | None = None
    ) -> None:
        super().__init__(message)
        self.message = message
        self.start = start
        self.end = end
        self.suggestion = suggestion
        self.hint = hint


class TokenKind(enum.Enum):
    """The kind of a token."""

    LITERAL = enum.auto()
    NAME = enum.auto()
    SIGN = enum.auto()
    END = enum.auto()


# Stored in variables, because access to a member of an enumeration is slow.
_LITERAL, _NAME_TOKEN, _SIGN = TokenKind.LITERAL, TokenKind.NAME, TokenKind.SIGN


class Token(NamedTuple):
    """One token of a script.

    Attributes:
        kind: The kind of token.
        text: The text as written.
        start: The offset in the script's text at which the token starts.
        end: The offset directly after the token.
        value: The value of a literal.
    """

    kind: TokenKind
    text: str
    start: int
    end: int
    value: int | float | str = 0


@functools.cache
def _token_pattern() -> re.Pattern[str]:
    """Return the pattern that a token matches. It is compiled only when a file contains scripts."""
    return re.compile(_WORDS_PATTERN, re.VERBOSE)


def tokenize(text: str) -> Iterator[Token]:
    """Yield the tokens of a script. The last token has the kind `END`.

    Raises:
        ScriptError: If a part of the text is not a token.
    """
    position, end = 0, len(text.rstrip(_SPACE))
    pattern = _token_pattern()
    while position < end:
        match = pattern.match(text, position)
        if match is None or match.lastgroup is None:
            raise _token_error(text, end - len(text[position:end].lstrip(_SPACE)))
        position = match.end()
        word = match[match.lastgroup]
        if match.lastgroup == "sign":
            yield Token(_SIGN, word, position - len(word), position)
        else:
            yield _token(text, match.lastgroup, word, position)
    yield Token(TokenKind.END, "", len(text), len(text))


def excerpt(text: str) -> str:
    """Shorten a part of a script so that a message can quote it."""
    return text if len(text) <= _LONGEST_EXCERPT else text[: _LONGEST_EXCERPT - 3] + "..."


def _token(text: str, group: str, word: str, end: int) -> Token:
    start = end - len(word)
    if group == "name":
        if word in _STATEMENTS and _CALLED.match(text, end):
            raise ScriptError(f"a script cannot contain '{word}'", start, end, hint=_INSTEAD_OF_STATEMENTS)
        return (
            Token(_LITERAL, word, start, end, BOOLS[word])
            if word in BOOLS
            else Token(_NAME_TOKEN, word, start, end)
        )
    if group == "text":
        return Token(_LITERAL, word, start, end, word[1:-1])
    _check_end_of_number(text, word, start)
    return Token(_LITERAL, word, start, end, (_integer if group == "integer" else _real)(word, start))


def _integer(word: str, start: int) -> int:
    base = 16 if word[1:2] in {"x", "X"} else 10
    digits = word[2:] if base != 10 else word  # noqa: PLR2004 - ten is ten
    digits = digits.lstrip("0") or "0"
    value = int(digits, base) if len(digits) < len(str(LARGEST_INTEGER)) + 1 else LARGEST_INTEGER + 1
    if value > LARGEST_INTEGER:
        message = f"{excerpt(word)} is too large to be represented as an integer"
        hint = f"write an integer of at most {LARGEST_INTEGER}, or a real number such as 1e20"
        raise ScriptError(message, start, start + len(word), hint=hint)
    return value


def _real(word: str, start: int) -> float:
    value = float(word)
    if math.isinf(value):
        raise ScriptError(
            f"{excerpt(word)} is too large to be represented as a number", start, start + len(word)
        )
    return value


def _check_end_of_number(text: str, number: str, start: int) -> None:
    """Raise an error if a number is followed by wrong characters, as in `3m`, `1.` or `0xFG`."""
    stuck = _STUCK.match(text, start + len(number))
    rest = stuck.group() if stuck else ""
    if not rest and number[1:2] in {"x", "X"} and text.startswith(".", start + len(number)):
        rest = "."
    if not rest:
        return
    word = number + rest
    end = start + len(word)
    shown = excerpt(word)
    if re.fullmatch(r"[0-9]+\.", word):
        message = f"'{shown}' is not a number: digits are missing after the point"
        raise ScriptError(message, start, end, suggestion=word + "0")
    if re.fullmatch(r"0[xX]", word):
        message = f"digits of a hexadecimal number are missing after '{shown}'"
        raise ScriptError(message, start, end, hint="write for example 0xFF")
    if re.fullmatch(r"[0-9]+(\.[0-9]+)?[eE]", word):
        message = f"digits of the exponent are missing after '{shown}'"
        raise ScriptError(message, start, end, hint="write for example 1e3 or 1.5e-3")
    message = f"'{shown}' is neither a number nor a name"
    hint = "write numbers as 12, 0xFF, 1.5 or 1e3, and begin names with a letter"
    raise ScriptError(message, start, end, hint=hint)


def _token_error(text: str, position: int) -> ScriptError:
    """Return the error for a position at which no valid token begins."""
    character = text[position]
    if character == "'":
        message = "this string has no closing quotation mark"
        hint = "add a single quotation mark at the end of the string. The string itself cannot contain this character"
        return ScriptError(message, position, len(text), hint=hint)
    if character in _OTHER_QUOTES:
        return _wrong_quotes(text, position)
    if character == ".":
        return _wrong_dot(text, position)
    if character == "{":
        return _braces(text, position)
    if character.isalpha():
        message = f"'{character}' is not allowed in a name"
        hint = "use the letters a to z and A to Z, digits and _, and a leading @ for a key of the root blackboard"
        return ScriptError(message, position, position + 1, hint=hint)
    shown = character if character.isprintable() and character != " " else f"U+{ord(character):04X}"
    message = f"'{shown}' is not allowed in a script"
    advice = "write an ordinary space" if character.isspace() else _HINTS.get(character)
    if (
        character == ","
        and text[position - 1 : position].isdigit()
        and text[position + 1 : position + 2].isdigit()
    ):
        advice = f"write a number as 1.5, without a thousands separator, or {advice}"
    return ScriptError(message, position, position + 1, hint=advice)


def _wrong_quotes(text: str, start: int) -> ScriptError:
    close = text.find(_OTHER_QUOTES[text[start]], start + 1)
    end = close + 1 if close > 0 else len(text)
    inside = text[start + 1 : close] if close > 0 else "'"
    message = f"a string must be in single quotation marks, not in {text[start]}"
    suggestion = None if "'" in inside else f"'{inside}'"
    hint = "write '...'. The string cannot contain a single quotation mark" if not suggestion else None
    return ScriptError(message, start, end, suggestion, hint)


def _wrong_dot(text: str, position: int) -> ScriptError:
    match = _DOTTED.match(text, position)
    end = match.end() if match else position + 1
    # Search the start of the name only as far back as the message would show it.
    before = re.search(_WORD_BEFORE, text[max(0, position - _LONGEST_EXCERPT) : position])
    if before:
        start = position - len(before.group())
        message = f"a name cannot contain a point: '{excerpt(text[start:end])}'"
        return ScriptError(
            message, start, end, hint="write a variable as a single name, or join strings with '..'"
        )
    if text[position + 1 : end].isdecimal():
        message = f"'{excerpt(text[position:end])}' is not a number: a digit is missing before the point"
        return ScriptError(message, position, end, suggestion="0" + text[position:end])
    message = "'.' is not allowed here"
    return ScriptError(message, position, position + 1, hint="join strings with '..', or write 0.5 for .5")


def _braces(text: str, start: int) -> ScriptError:
    match = _BRACED.match(text, start)
    inside = match.group(1).strip() if match else ""
    end = match.end() if match else start + 1
    message = "a variable in a script is written without braces"
    if re.fullmatch(_NAME, inside):
        return ScriptError(message, start, end, suggestion=inside)
    return ScriptError(message, start, end, hint="write only the variable's name")
