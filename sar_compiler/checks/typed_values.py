"""Scalars of files beside a tree that are more than plain data: durations, scripts, words of a list."""

from collections.abc import Iterable
from datetime import timedelta
from typing import Any

from sar_compiler.documents.located import Document, Value
from sar_compiler.nodes.values import type_of
from sar_compiler.runtime.answers import Fact
from sar_compiler.runtime.expressions import Script
from sar_compiler.runtime.script import parse
from sar_compiler.runtime.tokens import ScriptError
from sar_compiler.tree.guessing import nearest

_DURATION = type_of(timedelta)


def word(document: Document, value: Value, known: Iterable[str], what: str) -> str | None:
    """Return the text of a scalar, one of some words; reports any other."""
    words = list(known)
    if value.text in words:
        return value.text
    message = f"{what} is one of {', '.join(words)}, and this is {value.kind}"
    document.report("wrong-value", message, value, suggestion=nearest(value.text or "", words))
    return None


def seconds(value: Value) -> float:
    """Return a duration that a schema has held, in seconds."""
    return span_sec(value)[0]


def span_sec(value: Value) -> tuple[float, float]:
    """Return the shortest and the longest of the durations that a schema has held (`4s`, `4s to 9s`), in seconds."""
    if isinstance(value.data, (int, float)):
        return float(value.data), float(value.data)
    spans: list[Any] = [_DURATION.convert("".join(part.split())) for part in value.data.split("to")]
    times = [float(span.total_seconds()) for span in spans]
    return min(times), max(times)


def script(document: Document, value: Value | None) -> Script | None:
    """Return a script; reports one that cannot be read, at its place."""
    if value is None:
        return None
    try:
        return parse(value.text or "")
    except ScriptError as error:
        report_script(document, value, error)
        return None


def report_script(document: Document, value: Value, error: ScriptError) -> None:
    """Report the mistake in a script, at its place."""
    part, suggestion, hint = (error.start, error.end), error.suggestion, error.hint
    document.report("script-error", error.message, value, part, suggestion=suggestion, hint=hint)


def parameters(value: Value | None) -> dict[str, Fact]:
    """Return the values of the keys of the root blackboard."""
    return {} if value is None else dict(value.data)
