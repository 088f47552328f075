"""Findings as SARIF 2.1.0, which code scanning services and editors read."""

import importlib.metadata
import urllib.parse
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

from sar_compiler.checks.fixing import Fix
from sar_compiler.tree.diagnostic import Diagnostic, Severity
from sar_compiler.tree.kinds import KINDS, SEVERITIES
from sar_compiler.tree.source import Source, Span
from sar_compiler.views.findings import page_of
from sar_compiler.views.plain import as_json

_SCHEMA = "https://docs.oasis-open.org/sarif/sarif/v2.1.0/errata01/os/schemas/sarif-schema-2.1.0.json"
_LEVELS = {Severity.ERROR: "error", Severity.WARNING: "warning", Severity.INFO: "note"}


def findings_as_sarif(findings: Sequence[Diagnostic], fixes: Mapping[object, Fix]) -> str:
    """Return findings as a SARIF log with one run; columns count units of UTF-16, the standard's default.

    Args:
        findings: The findings.
        fixes: How some of them are mended without asking, by their `identity`.
    """
    codes = sorted({finding.code for finding in findings})
    driver = {
        "name": "sar-compile",
        "version": importlib.metadata.version("sar_compiler"),
        "rules": [_rule(code) for code in codes],
    }
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
    findings: Iterable[Diagnostic], codes: Sequence[str], fixes: Mapping[object, Fix]
) -> Iterable[dict[str, object]]:
    for finding in findings:
        source = finding.source
        location = {
            "artifactLocation": _artifact(source.path),
            "region": _region(source, finding.span),
        }
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


def _fix(fix: Fix) -> dict[str, object]:
    source = fix.finding.source
    replacement = {
        "deletedRegion": _region(source, source.span(fix.start, fix.end)),
        "insertedContent": {"text": fix.text},
    }
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
    """Return a column in units of UTF-16, from 1."""
    return len(source.line(line)[: column - 1].encode("utf-16-le", "surrogatepass")) // 2 + 1


def _artifact(path: str) -> dict[str, str]:
    if Path(path).is_absolute():
        return {"uri": Path(path).as_uri()}
    return {"uri": urllib.parse.quote(Path(path).as_posix()), "uriBaseId": "%SRCROOT%"}
