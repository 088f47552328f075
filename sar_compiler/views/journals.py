"""A mission's journal, as text and as plain data."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

from sar_compiler.journal.database import VERSION, JournalFile, is_locked
from sar_compiler.journal.journal_entries import JournalEntry, JournalRun, day_and_time
from sar_compiler.journal.mission_state import tree_nodes
from sar_compiler.tree.showing import in_one_line, shortened
from sar_compiler.views.plain import as_json

# How the JSON of an object ends that is in several lines.
_END = "\n}"
_RUNNING, _BROKEN_OFF, _EMPTY = "running", "broken off", "empty"


def journal_json(file: JournalFile, *, with_watched: bool = False) -> Iterator[str]:
    """Yield a journal as the lines of a JSON object, with a line for each fact and each watched entry.

    Args:
        file: The journal.
        with_watched: Whether what was watched is part of it.
    """
    # Before the snapshot: to look at the lock takes away those of whoever reads the file in this process.
    state = _state(file, file.runs())
    with file.snapshot():
        data = {
            "file": str(file.path),
            "version": VERSION,
            "state": state,
            **file.about(),
            "runs": [run._asdict() for run in file.runs()],
        }
        yield f"{as_json(data).removesuffix(_END)},"
        yield '  "facts": ['
        yield from _json_items(file.facts())
        if with_watched:
            yield '  ],\n  "watched": ['
            yield from _json_items(file.watched())
        yield "  ]\n}"


def _json_items(entries: Iterable[JournalEntry]) -> Iterator[str]:
    before = None
    for entry in entries:
        if before is not None:
            yield f"{before},"
        before = f"    {as_json(entry._asdict(), indent=None)}"
    if before is not None:
        yield before


def journal_lines(file: JournalFile, *, with_watched: bool = False) -> Iterator[str]:
    """Yield a journal as text: the mission, its runs, and the facts of each, with the seconds since its beginning.

    Args:
        file: The journal.
        with_watched: Whether what was watched is told as well.
    """
    runs, about = file.runs(), file.about()
    mission = about.get("mission") or "a tree of no mission"
    nodes = [node.name for node in tree_nodes(about.get("tree"))] if with_watched else []
    yield in_one_line(f"{mission}, {_state(file, runs)}")
    for run in runs:
        width = file.widest_kind(run.number, with_watched=with_watched)
        entries = file.entries(run.number, with_watched=with_watched)
        yield in_one_line(_headline(run))
        yield from map(in_one_line, _table(run, entries, nodes, width))


def _state(file: JournalFile, runs: Sequence[JournalRun]) -> str:
    if is_locked(file.path):
        return _RUNNING
    if not runs:
        return _EMPTY
    return _BROKEN_OFF if runs[-1].ending is None else runs[-1].ending.value


def _headline(run: JournalRun) -> str:
    death = run.about.get("after")
    began = day_and_time(run.began) + (
        f" by its supervisor (the one before has died: {death})" if death else ""
    )
    if run.ended is None:
        return f"run {run.number}, begun {began}:"
    reason = f", {run.reason}" if run.reason else ""
    return f"run {run.number}, begun {began}, {run.ending and run.ending.value} with status {run.status}{reason}:"


def _table(
    run: JournalRun, entries: Iterable[JournalEntry], nodes: Sequence[str], width: int
) -> Iterator[str]:
    began = run.about.get("time")
    start = began if isinstance(began, (int, float)) else 0.0
    for entry in entries:
        words = shortened(", ".join(entry_words(entry.data, nodes)))
        yield f"{entry.time - start:9.1f} s  {entry.kind:{width}}  {words}".rstrip()


def entry_words(data: Mapping[str, Any], nodes: Sequence[str] = ()) -> Iterator[str]:
    """Yield the data of an entry as text; a node by its name, if the names of all are given."""
    for key, value in data.items():
        if key in ("node", "leaf") and isinstance(value, int) and 0 <= value < len(nodes):
            yield f"{key} '{nodes[value]}'"
        elif value != "":
            yield f"{key} {_value(value)}"


def _value(value: object) -> str:
    if value is None:
        return "none"
    if isinstance(value, float):
        return f"{value:.2f}"
    if isinstance(value, list):
        return f"({', '.join(map(_value, value))})"
    return str(value)
