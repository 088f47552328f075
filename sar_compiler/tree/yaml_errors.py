"""Errors of the YAML parser, reworded for authors of trees."""

import re
from typing import NamedTuple

import yaml

from sar_compiler.tree.diagnostic import Diagnostic
from sar_compiler.tree.source import Source


class _Rewording(NamedTuple):
    problem: re.Pattern[str]
    message: str
    hint: str | None


# What libyaml and PyYAML say, and what to say instead; the first that fits counts.
_WORDS = [
    _Rewording(re.compile(pattern), message, hint)
    for pattern, message, hint in [
        (r"tab", "there is a tab", "indent with spaces"),
        (r"node content", "something is missing here", "write it; put punctuation in quotes"),
        (
            r"line break|expected ' '|\btag\b",
            "'|', '>' and '!' begin something special in YAML, and this is not it",
            "put a text that begins with one of them in quotes",
        ),
        (
            r"alphabetic or numeric",
            "'&' and '*' begin an anchor or an alias, which is not allowed here",
            "put a text that begins with one of them in quotes",
        ),
        (
            r"mapping values are not allowed",
            "a ':' with a space behind it has no place here",
            "check the indentation; put a text with ': ' in it in quotes",
        ),
        (
            r"sequence entries are not allowed",
            "a '-' with a space behind it has no place here",
            "begin a new line; put a text that begins with '- ' in quotes",
        ),
        (r"end of stream|stream end|document (indicator|separator)", "what begins here has no end", None),
        (
            r"unknown escape character",
            "a backslash in double quotes begins an escape, and there is none like this",
            "write two backslashes, or put the text in single quotes",
        ),
        (
            r"simple key|could not find expected ':'",
            "the ':' behind this key is missing",
            "begin a node with '- ', write an attribute as name: value in one line",
        ),
        (
            r"',' or|\[|\{|flow",
            "the list or mapping in brackets that begins here goes wrong further on",
            "separate its parts by commas and close its bracket; put a text that begins with { or [ in quotes",
        ),
        (
            r"expected key|block end|expected '-' indicator|<scalar>",
            "this does not belong to the lines above it",
            "indent it as the line it belongs to; put a text in quotes as a whole or not at all",
        ),
        (r"document start", "the file continues after the end of its document", "delete the lines of '...'"),
        (r"directive|%", "directives of YAML are not allowed here", "delete the line"),
        (
            r"indentation|indent",
            "the indentation is wrong",
            "indent with two spaces more than the line above",
        ),
    ]
]


def malformed(source: Source, error: yaml.YAMLError) -> Diagnostic:
    """Return the finding for a text that the parser of YAML refuses."""
    problem, start = str(error), 0
    if isinstance(error, yaml.MarkedYAMLError):
        problem = f"{error.problem}"
        mark = error.problem_mark or error.context_mark
        start = min(mark.index, len(source.text)) if mark is not None else 0
        if error.context_mark is not None and re.search(r"quoted|flow|simple key", error.context or ""):
            start = error.context_mark.index if "escape" not in problem else start
            problem = f"{problem} {error.context}" if "flow" in (error.context or "") else problem
    message, hint = _said(source.text[start : start + 1], problem)
    span = source.span(start, min(start + 1, len(source.text)))
    return Diagnostic("malformed-yaml", f"not well-formed YAML: {message}", source, span, hint=hint)


def _said(character: str, problem: str) -> tuple[str, str | None]:
    if "cannot start any token" in problem and character != "\t":
        return f"a text cannot begin with {character}", "put it in quotes"
    for words in _WORDS:
        if words.problem.search("tab" if character == "\t" else problem):
            return words.message, words.hint
    return problem, None
