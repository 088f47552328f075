"""The expectations of a scenario: `expect:`."""

from collections.abc import Iterator, Mapping
from pathlib import Path

from sar_compiler.checks.configuration import path_inside
from sar_compiler.checks.leaf_words import EventPattern, LeafWords
from sar_compiler.checks.simulate.scenario import Bounds, Expectations
from sar_compiler.checks.typed_values import seconds
from sar_compiler.compiler.simulated_tree import SimulatedTree
from sar_compiler.documents.located import Document, Value
from sar_compiler.runtime.answers import Fact
from sar_compiler.tree.guessing import nearest


def read_expectations(
    document: Document, value: Value | None, simulated: SimulatedTree, words: LeafWords
) -> Expectations:
    """Read what a scenario expects; reports what cannot be expected."""
    parts = {} if value is None else value.mapping
    plain = {} if value is None else value.data
    ticks, limit_sec = _within(parts["within"]) if "within" in parts else (None, None)
    return Expectations(
        root=plain.get("root"),
        ends=plain.get("ends", True),
        within_ticks=ticks,
        within_sec=limit_sec,
        facts=_facts(document, parts["facts"], simulated.fact_values()) if "facts" in parts else {},
        order=_deeds(document, parts.get("order"), words),
        never=_deeds(document, parts.get("never"), words),
        counts=_counts(document, parts["count"], words) if "count" in parts else (),
        trace=path_inside(document, Path(document.source.path).parent, parts["trace"], "trace")
        if "trace" in parts
        else None,
        lines=dict(_lines(document, parts)),
    )


def _lines(document: Document, parts: Mapping[str, Value]) -> Iterator[tuple[str, int]]:
    """Yield the names of the expectations, and their contents, with their lines."""
    for word, value in parts.items():
        yield word, document.source.place(value.start)[0]
        below = [key for key, _ in value.entries] if value.entries is not None else value.listed
        for key in below:
            yield f"{word} {key.text}", document.source.place(key.start)[0]


def _within(value: Value) -> tuple[int | None, float | None]:
    text = value.text or ""
    return (int(text.split()[0]), None) if "tick" in text else (None, seconds(value))


def _facts(document: Document, value: Value, known: Mapping[str, Fact]) -> dict[str, Fact]:
    facts: dict[str, Fact] = {}
    for key, inner in value.entries or ():
        name = key.text or ""
        if name not in known:
            message = f"there is no fact '{name}'; there is {', '.join(known) or 'none'}"
            document.report("unknown-fact", message, key, suggestion=nearest(name, known))
        else:
            facts[name] = inner.data
    return facts


def _deeds(document: Document, value: Value | None, words: LeafWords) -> tuple[EventPattern, ...]:
    deeds = [] if value is None else [words.deed(document, item) for item in value.listed]
    return tuple(deed for deed in deeds if deed is not None)


def _counts(document: Document, value: Value, words: LeafWords) -> tuple[tuple[EventPattern, Bounds], ...]:
    counts = []
    for key, inner in value.entries or ():
        deed = words.deed(document, key)
        if deed is not None:
            counts.append((deed, _bounds(inner.data)))
    return tuple(counts)


def _bounds(said: float | str) -> Bounds:
    """Read `2`, `at least 2` or `at most 2`."""
    *which, number = said.split() if isinstance(said, str) else [said]
    return Bounds(0 if "most" in which else int(number), None if "least" in which else int(number))
