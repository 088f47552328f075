"""The expectations of a scenario: `expect:`."""

import re
from collections.abc import Iterator, Mapping
from pathlib import Path

from sar_compiler.checks.leaf_words import EventPattern, LeafWords
from sar_compiler.checks.simulate.scenario import Bounds, Expectations
from sar_compiler.checks.yaml_values import Document, Value
from sar_compiler.compiler.simulated_tree import SimulatedTree
from sar_compiler.nodes.values import nearest
from sar_compiler.runtime.answers import Fact

_KEYS = ("root", "ends", "within", "facts", "order", "never", "count", "trace")
_ROOT = ("SUCCESS", "FAILURE", "RUNNING", "SKIPPED")
_BOUNDS = re.compile(r"(at least|at most)? *([0-9]{1,9})")
_TICKS = re.compile(r"([0-9]{1,9}) ticks?")


def read_expectations(
    document: Document, value: Value | None, simulated: SimulatedTree, words: LeafWords
) -> Expectations:
    """Read what a scenario expects; reports what cannot be expected."""
    parts = {} if value is None else document.mapping(value, _KEYS, "expect")
    root, ends, within, facts, order, never, count, trace = (parts.get(key) for key in _KEYS)
    ticks, seconds = _within(document, within) if within else (None, None)
    name = document.text(trace, "the file of the trace") if trace else None
    return Expectations(
        root=document.word(root, _ROOT, "what the root comes to") if root else None,
        ends=ends is None or document.truth(ends, "ends") is not False,
        within_ticks=ticks,
        within_sec=seconds,
        facts=_facts(document, facts, simulated.fact_values()) if facts else {},
        order=_deeds(document, order, words) if order else (),
        never=_deeds(document, never, words) if never else (),
        counts=_counts(document, count, words) if count else (),
        trace=Path(document.source.path).parent / name if name else None,
        lines=dict(_lines(document, parts)),
    )


def _lines(document: Document, parts: Mapping[str, Value]) -> Iterator[tuple[str, int]]:
    """Yield the names of the expectations, and their contents, with their lines."""
    for word, value in parts.items():
        yield word, document.source.place(value.start)[0]
        below = [key for key, _ in value.entries] if value.entries is not None else document.listed(value)
        for key in below:
            yield f"{word} {key.text}", document.source.place(key.start)[0]


def _within(document: Document, value: Value) -> tuple[int | None, float | None]:
    match = _TICKS.fullmatch(value.text or "")
    if match:
        return int(match[1]), None
    before = len(document.findings)
    seconds = document.seconds(value, "within")
    if len(document.findings) > before:
        finding = document.findings.pop()
        document.report(value, finding.code, finding.message, hint="write 20 ticks, 10s or 2min")
    return None, seconds


def _facts(document: Document, value: Value, known: Mapping[str, Fact]) -> dict[str, Fact]:
    facts: dict[str, Fact] = {}
    for key, inner in document.entries(value, None, "facts"):
        name = key.text or ""
        fact = document.fact(inner, f"the fact '{name}'")
        if name not in known:
            message = f"there is no fact '{name}'; there is {', '.join(known) or 'none'}"
            document.report(key, "unknown-fact", message, suggestion=nearest(name, known))
        elif fact is not None:
            facts[name] = fact
    return facts


def _deeds(document: Document, value: Value, words: LeafWords) -> tuple[EventPattern, ...]:
    deeds = [words.deed(document, item) for item in document.listed(value)]
    return tuple(deed for deed in deeds if deed is not None)


def _counts(document: Document, value: Value, words: LeafWords) -> tuple[tuple[EventPattern, Bounds], ...]:
    counts = []
    for key, inner in document.entries(value, None, "count"):
        deed = words.deed(document, key)
        match = _BOUNDS.fullmatch(inner.text or "")
        if match is None:
            message = f"a count is a whole number, and this is {inner.kind}"
            document.report(inner, "wrong-value", message, hint="write 2, at least 2 or at most 2")
        elif deed is not None:
            number = int(match[2])
            least = 0 if match[1] == "at most" else number
            most = None if match[1] == "at least" else number
            counts.append((deed, Bounds(least, most)))
    return tuple(counts)
