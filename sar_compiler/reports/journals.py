"""Displays the journal of a mission as text or as JSON."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

from sar_compiler.journal.database import VERSION, JournalFile
from sar_compiler.journal.journal_entries import JournalEntry, JournalRun, day_and_time
from sar_compiler.journal.mission_state import MissionState, tree_nodes
from sar_compiler.journal.open_tasks import find_open_tasks
from sar_compiler.journal.status_line import COMPLETE, condition, status_line_text
from sar_compiler.runtime.clock import clock_text
from sar_compiler.tree.display_text import escape_to_one_line, shorten
from sar_compiler.tree.plain import as_json

# The end of a JSON object with several lines.
_END = "\n}"


def journal_json(file: JournalFile, state: MissionState, *, with_watched: bool = False) -> Iterator[str]:
    """Yield the lines of a JSON object that contains a journal: one line for each event or observation.

    Args:
        file: The journal.
        state: The state of the mission after the journal's entries.
        with_watched: Whether to include observations.
    """
    with file.snapshot():
        data = {
            "file": str(file.path),
            "version": VERSION,
            "state": journal_state(state),
            "condition": condition(state)._asdict(),
            **file.description(),
            "runs": [run._asdict() for run in file.runs()],
        }
        yield f"{as_json(data).removesuffix(_END)},"
        yield '  "facts": ['
        yield from _json_items(file.events())
        if with_watched:
            yield '  ],\n  "watched": ['
            yield from _json_items(file.observations())
        yield "  ]\n}"


def _json_items(entries: Iterable[JournalEntry]) -> Iterator[str]:
    before = None
    for entry in entries:
        if before is not None:
            yield f"{before},"
        before = f"    {as_json(entry._asdict(), indent=None)}"
    if before is not None:
        yield before


def journal_lines(
    file: JournalFile, state: MissionState, why: str = "", *, with_watched: bool = False
) -> Iterator[str]:
    """Yield a journal as lines of text: the status of the mission, then the events of each run with times.

    Args:
        file: The journal.
        state: The state of the mission after the journal's entries.
        why: The likeliest cause of a failure; shown if the mission is not complete.
        with_watched: Whether to include observations.
    """
    runs, about = file.runs(), file.description()
    mission = about.get("mission") or "a tree without a mission"
    nodes = [node.name for node in tree_nodes(about.get("tree"))] if with_watched else []
    yield escape_to_one_line(f"{mission}, {status_line_text(state)}")
    yield from (escape_to_one_line(f"to do: {task.text}") for task in find_open_tasks(state))
    if why and condition(state).word != COMPLETE:
        yield escape_to_one_line(why)
    for run in runs:
        width = file.widest_kind(run.number, with_watched=with_watched)
        entries = file.entries(run.number, with_watched=with_watched)
        yield escape_to_one_line(_run_headline(run))
        yield from map(escape_to_one_line, _entry_lines(run, entries, nodes, width))
    if runs and runs[-1].head:
        yield f"head of the chain: {runs[-1].head}"


def journal_state(state: MissionState) -> str:
    """Return the state of the journal for scripts: `running`, `crashed`, `empty`, or how the run ended."""
    if ending := state.runs[-1].ending if state.runs else "":
        return ending
    if not state.process.is_gone:
        return "running"
    return "crashed" if state.runs else "empty"


def _run_headline(run: JournalRun) -> str:
    death = run.about.get("after")
    began = day_and_time(run.began) + (
        f" by its supervisor (the previous process has died: {death})" if death else ""
    )
    if run.ended is None:
        return f"run {run.number}, started {began}:"
    reason = f", {run.reason}" if run.reason else ""
    return f"run {run.number}, started {began}, {run.ending and run.ending.value} with status {run.status}{reason}:"


def _entry_lines(
    run: JournalRun, entries: Iterable[JournalEntry], nodes: Sequence[str], width: int
) -> Iterator[str]:
    began = run.about.get("time")
    start = began if isinstance(began, (int, float)) else 0.0
    for entry in entries:
        words = shorten(", ".join(entry_text(entry.data, nodes)))
        yield f"{clock_text(entry.time - start):>9}  {entry.kind:{width}}  {words}".rstrip()


def entry_text(data: Mapping[str, Any], nodes: Sequence[str] = ()) -> Iterator[str]:
    """Yield the fields of an entry as text.

    If *nodes* contains the names of all nodes, show names, not numbers.
    """
    for key, value in data.items():
        if key in ("node", "leaf") and isinstance(value, int) and 0 <= value < len(nodes):
            yield f"{key} '{nodes[value]}'"
        elif value != "":
            yield f"{key} {_value(value)}"


_MOST_LISTED = 12
"""The maximum length of a list whose values are printed. For longer lists, only the length is printed."""


def _value(value: object) -> str:
    if value is None:
        return "none"
    if isinstance(value, float):
        return f"{value:.2f}"
    if isinstance(value, list):
        return (
            f"({', '.join(map(_value, value))})" if len(value) <= _MOST_LISTED else f"({len(value)} values)"
        )
    return str(value)
