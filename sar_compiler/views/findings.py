"""Findings as text, JSON, SARIF and GitHub workflow commands."""

import re
import urllib.parse
from collections import Counter
from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from sar_compiler.commands import version_of
from sar_compiler.resources import shared_file_path
from sar_compiler.tree.diagnostic import Cause, Diagnostic, Severity, Source, Span
from sar_compiler.tree.display_text import visible
from sar_compiler.tree.kinds import KINDS, SEVERITIES
from sar_compiler.tree.plain import as_json, count_with_noun

if TYPE_CHECKING:
    from sar_compiler.checks.fixing import Fix

_COMMANDS = {Severity.ERROR: "error", Severity.WARNING: "warning", Severity.INFO: "notice"}
# The characters to escape in messages and properties, and further ones to escape in properties.
_ALWAYS = {"%": "%25", "\r": "%0D", "\n": "%0A"}
_IN_MESSAGES = str.maketrans(_ALWAYS)
_IN_PROPERTIES = str.maketrans({**_ALWAYS, ":": "%3A", ",": "%2C"})


def findings_as_json(findings: Iterable[Diagnostic]) -> str:
    """Return findings as a JSON array.

    Lines and columns are counted from 1, and the end column is exclusive.
    """
    return as_json([*map(finding_data, findings)])


def finding_data(finding: Diagnostic) -> dict[str, object]:
    """Convert a finding to an object for the array of `findings_as_json`."""
    return {
        "file": finding.source.path,
        **finding.span._asdict(),
        "severity": finding.severity.value,
        "code": finding.code,
        "message": finding.message,
        "suggestion": finding.suggestion,
        "hint": finding.hint,
        "cause": finding.cause,
    }


def findings_as_github(findings: Iterable[Diagnostic]) -> str:
    """Return a GitHub workflow command for each finding, which annotates the finding's lines."""
    return "\n".join(_command(finding) for finding in findings)


def _command(finding: Diagnostic) -> str:
    span = finding.span
    properties: dict[str, object] = {"file": finding.source.path, "line": span.line}
    if span.line == span.end_line:  # columns need a single line, and the end is inclusive
        properties["col"] = span.column
    properties["endLine"] = span.end_line
    if span.line == span.end_line:
        properties["endColumn"] = max(span.column, span.end_column - 1)
    properties["title"] = finding.code
    listed = ",".join(f"{name}={str(value).translate(_IN_PROPERTIES)}" for name, value in properties.items())
    message = "\n".join(map(visible, (finding.message, finding.advice))).rstrip()
    return f"::{_COMMANDS[finding.severity]} {listed}::{message.translate(_IN_MESSAGES)}"


def page_of(code: str) -> str:
    """Return the Markdown page about the findings that have a given code.

    Raises:
        ResourceError: If the page is not installed.
    """
    return shared_file_path("docs/findings", f"{code}.md").read_text("utf-8")


def plain_text(page: str, paint: Callable[[str, str], str]) -> str:
    """Format a Markdown page for a terminal. Code blocks are indented, and headings are coloured.

    Args:
        page: The page, in Markdown.
        paint: Colours a text, given the kind of the text. Headings have the kind `place`.
    """
    lines, is_code = [], False
    for line in page.splitlines():
        if line.startswith("```"):
            is_code = not is_code
        else:
            lines.append(f"    {line}".rstrip() if is_code else _plain_line(line, paint))
    return "\n".join([*lines, ""])


def _plain_line(line: str, paint: Callable[[str, str], str]) -> str:
    """Return a line of Markdown without markup. Links are replaced by their texts."""
    text = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", line)
    text = re.sub(r"\*\*?([^*]+)\*\*?", r"\1", text).replace("`", "")
    heading = re.match(r"#+ (.*)", text)
    return text if heading is None else paint(heading[1], "place")


FEW = 3
"""The maximum number of findings with one message, or of messages with one cause, that are not merged."""

_NAMED = 8


def group_by_cause(findings: Iterable[Diagnostic]) -> list[Diagnostic]:
    """Merge findings with the same cause into one finding that lists the other locations or subjects.

    Up to `FEW` findings with the same message in one file are not merged. If a cause has up to `FEW` different messages,
    at least one finding remains for each message.
    """
    causes = _groups(findings, lambda each: (each.cause, each.severity))
    return [merged for group in causes for merged in _merge_cause(group)]


def _groups(findings: Iterable[Diagnostic], key: Callable[[Diagnostic], Hashable]) -> list[list[Diagnostic]]:
    """Group findings by key, in the order in which the keys first occur."""
    groups: dict[Hashable, list[Diagnostic]] = {}
    for each in findings:
        groups.setdefault(key(each), []).append(each)
    return list(groups.values())


def _merge_cause(group: Sequence[Diagnostic]) -> list[Diagnostic]:
    by_message = _groups(group, lambda each: each.message)
    cause = group[0].common_cause
    if cause is not None and len(by_message) > FEW:
        return [replace(group[0], message=_cause_text(cause, group), suggestion=None)]
    return [merged for places in by_message for merged in _merge_message(places)]


def _merge_message(places: Sequence[Diagnostic]) -> Sequence[Diagnostic]:
    if len(places) <= FEW and len({each.source.path for each in places}) == 1:
        return places
    first, others = places[0], places[1:]
    near = ", ".join(f"{each.source.path}:{each.span.line}" for each in others[:FEW])
    more = ", ..." if others[FEW:] else ""
    where = f"also in {count_with_noun(len(others), 'other place')}: {near}{more}"
    return [replace(first, message=f"{first.message} ({where})")]


def _cause_text(cause: Cause, group: Iterable[Diagnostic]) -> str:
    """Return a message that lists the subjects of a cause, starting with the most frequent one."""
    counts = Counter(each.common_cause.subject for each in group if each.common_cause)
    named = ", ".join(f"'{subject}' ({number:,})" for subject, number in counts.most_common(_NAMED))
    others = f" and {len(counts) - _NAMED:,} more" if len(counts) > _NAMED else ""
    return f"{cause.text}: {named}{others}, in {count_with_noun(counts.total(), 'place')}"


_SCHEMA = "https://docs.oasis-open.org/sarif/sarif/v2.1.0/errata01/os/schemas/sarif-schema-2.1.0.json"
_LEVELS = {Severity.ERROR: "error", Severity.WARNING: "warning", Severity.INFO: "note"}


def findings_as_sarif(findings: Sequence[Diagnostic], fixes: Mapping[object, "Fix"]) -> str:
    """Return findings as a SARIF log with one run.

    As SARIF requires, columns are counted in UTF-16 code units.

    Args:
        findings: The findings.
        fixes: The safe fixes, by the `identity` of the finding.
    """
    codes = sorted({finding.code for finding in findings})
    rules = [_rule(code) for code in codes]
    driver = {"name": "sar-compile", "version": version_of("sar_compiler"), "rules": rules}
    run = {
        "tool": {"driver": driver},
        "columnKind": "utf16CodeUnits",
        "newlineSequences": ["\r\n", "\r", "\n"],
        "results": list(_results(findings, codes, fixes)),
    }
    return as_json({"$schema": _SCHEMA, "version": "2.1.0", "runs": [run]})


def _rule(code: str) -> dict[str, object]:
    page = page_of(code)
    return {
        "id": code,
        "shortDescription": {"text": KINDS[code]},
        "help": {"text": page, "markdown": page},
        "defaultConfiguration": {"level": _LEVELS[SEVERITIES[code]]},
    }


def _results(
    findings: Iterable[Diagnostic], codes: Sequence[str], fixes: Mapping[object, "Fix"]
) -> Iterable[dict[str, object]]:
    for finding in findings:
        source = finding.source
        location = {"artifactLocation": _artifact(source.path), "region": _region(source, finding.span)}
        fix = fixes.get(finding.identity)
        yield {
            "ruleId": finding.code,
            "ruleIndex": codes.index(finding.code),
            "level": _LEVELS[finding.severity],
            "message": {"text": f"{finding.message}\n{finding.advice}".rstrip()},
            "locations": [{"physicalLocation": location}],
            "properties": {"cause": finding.cause},
            **({"fixes": [_fix(fix)]} if fix is not None else {}),
        }


def _fix(fix: "Fix") -> dict[str, object]:
    source = fix.finding.source
    deleted = _region(source, source.span(fix.start, fix.end))
    replacement = {"deletedRegion": deleted, "insertedContent": {"text": fix.text}}
    change = {"artifactLocation": _artifact(source.path), "replacements": [replacement]}
    return {"description": {"text": fix.finding.advice}, "artifactChanges": [change]}


def _region(source: Source, span: Span) -> dict[str, int]:
    return {
        "startLine": span.line,
        "startColumn": _column(source, span.line, span.column),
        "endLine": span.end_line,
        "endColumn": _column(source, span.end_line, span.end_column),
    }


def _column(source: Source, line: int, column: int) -> int:
    """Convert a column from characters to UTF-16 code units; both count from 1."""
    return len(source.line(line)[: column - 1].encode("utf-16-le", "surrogatepass")) // 2 + 1


def _artifact(path: str) -> dict[str, str]:
    if Path(path).is_absolute():
        return {"uri": Path(path).as_uri()}
    return {"uri": urllib.parse.quote(Path(path).as_posix()), "uriBaseId": "%SRCROOT%"}
