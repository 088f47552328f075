"""Findings as JSON, for editors and continuous integration."""

import json
from collections.abc import Iterable

from sar_compiler.tree.diagnostic import Diagnostic


def findings_as_json(findings: Iterable[Diagnostic]) -> str:
    """Return findings as a JSON array; lines and columns from 1, the end exclusive."""
    return json.dumps([_as_dict(finding) for finding in findings], indent=2, ensure_ascii=False)


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
    }
