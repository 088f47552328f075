"""Findings as SARIF 2.1.0, which code scanning services and editors read."""

import importlib.metadata
import urllib.parse
from collections.abc import Iterable, Sequence
from pathlib import Path

from sar_compiler.checks.kinds import KINDS, page_of
from sar_compiler.tree.diagnostic import Diagnostic, Severity
from sar_compiler.tree.source import Source
from sar_compiler.views.plain import as_json

_SCHEMA = "https://docs.oasis-open.org/sarif/sarif/v2.1.0/errata01/os/schemas/sarif-schema-2.1.0.json"
_LEVELS = {Severity.ERROR: "error", Severity.WARNING: "warning", Severity.INFO: "note"}


def findings_as_sarif(findings: Sequence[Diagnostic]) -> str:
    """Return findings as a SARIF log with one run; columns count units of UTF-16, the standard's default."""
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
        "results": list(_results(findings, codes)),
    }
    return as_json({"$schema": _SCHEMA, "version": "2.1.0", "runs": [run]})


def _rule(code: str) -> dict[str, object]:
    kind, page = KINDS[code], page_of(code)
    return {
        "id": code,
        "shortDescription": {"text": kind.summary},
        "help": {"text": page, "markdown": page},
        "defaultConfiguration": {"level": _LEVELS[kind.severity]},
    }


def _results(findings: Iterable[Diagnostic], codes: Sequence[str]) -> Iterable[dict[str, object]]:
    for finding in findings:
        span, source = finding.span, finding.source
        region = {
            "startLine": span.line,
            "startColumn": _column(source, span.line, span.column),
            "endLine": span.end_line,
            "endColumn": _column(source, span.end_line, span.end_column),
        }
        location = {"artifactLocation": _artifact(source.path), "region": region}
        yield {
            "ruleId": finding.code,
            "ruleIndex": codes.index(finding.code),
            "level": _LEVELS[finding.severity],
            "message": {"text": f"{finding.message}\n{finding.advice}".rstrip()},
            "locations": [{"physicalLocation": location}],
            "properties": {"cause": finding.cause},
        }


def _column(source: Source, line: int, column: int) -> int:
    """Return a column in units of UTF-16, from 1."""
    return len(source.line(line)[: column - 1].encode("utf-16-le", "surrogatepass")) // 2 + 1


def _artifact(path: str) -> dict[str, str]:
    if Path(path).is_absolute():
        return {"uri": Path(path).as_uri()}
    return {"uri": urllib.parse.quote(Path(path).as_posix()), "uriBaseId": "%SRCROOT%"}
