"""Findings for editors and continuous integration, as JSON and as commands of GitHub Actions; pages about their kinds."""

from collections.abc import Iterable

from sar_compiler.resources import shipped
from sar_compiler.tree.diagnostic import Diagnostic, Severity
from sar_compiler.tree.showing import visible
from sar_compiler.views.plain import as_json

_COMMANDS = {Severity.ERROR: "error", Severity.WARNING: "warning", Severity.INFO: "notice"}
# The characters that would end a message, and those that would end a property as well.
_IN_MESSAGES = {"%": "%25", "\r": "%0D", "\n": "%0A"}
_IN_PROPERTIES = {**_IN_MESSAGES, ":": "%3A", ",": "%2C"}


def findings_as_json(findings: Iterable[Diagnostic]) -> str:
    """Return findings as a JSON array; lines and columns from 1, the end exclusive."""
    return as_json([_as_dict(finding) for finding in findings])


def _as_dict(finding: Diagnostic) -> dict[str, object]:
    span = finding.span
    return {
        "file": finding.source.path,
        "line": span.line,
        "column": span.column,
        "end_line": span.end_line,
        "end_column": span.end_column,
        "severity": finding.severity.value,
        "code": finding.code,
        "message": finding.message,
        "suggestion": finding.suggestion,
        "hint": finding.hint,
        "cause": finding.cause,
    }


def findings_as_github(findings: Iterable[Diagnostic]) -> str:
    """Return a workflow command for each finding, which GitHub shows as an annotation of its lines."""
    return "\n".join(_command(finding) for finding in findings)


def _command(finding: Diagnostic) -> str:
    span = finding.span
    properties: dict[str, object] = {"file": finding.source.path, "line": span.line}
    if span.line == span.end_line:  # columns go with one line only, and the last one belongs to the place
        properties["col"] = span.column
        properties["endLine"] = span.end_line
        properties["endColumn"] = max(span.column, span.end_column - 1)
    else:
        properties["endLine"] = span.end_line
    properties["title"] = finding.code
    listed = ",".join(f"{name}={_escaped(str(value), _IN_PROPERTIES)}" for name, value in properties.items())
    message = "\n".join(map(visible, (finding.message, finding.advice))).rstrip()
    return f"::{_COMMANDS[finding.severity]} {listed}::{_escaped(message, _IN_MESSAGES)}"


def _escaped(text: str, escapes: dict[str, str]) -> str:
    return "".join(escapes.get(character, character) for character in text)


def page_of(code: str) -> str:
    """Return the page about a kind of finding, in Markdown.

    Raises:
        ResourceError: If it is not installed.
    """
    return shipped("docs/findings", f"{code}.md").read_text("utf-8")
