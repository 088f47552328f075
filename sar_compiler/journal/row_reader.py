"""Read the rows of a journal as entries, with a fast path for repeated statuses.

Condensed reading omits rows that repeat a running node's status with another message; a reader needs the last one. A leaf
that drives reports its distance in every tick, and such rows are most of a long journal. The results computed from statuses
(`mission_state`, `reports.why`, `reports.leaf_statistics`) are the same without them, because a tick in which nothing else has changed
might as well not have been written. Two conditions must hold: between the row and the next one of the node only such rows
were written, and the node above runs too. (If that has ended and is ticked again, its end is new in each tick.)
"""

import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

from sar_compiler.journal.journal_entries import STATUS, JournalEntry, check_value_types
from sar_compiler.journal.recorded_ticks import StatusAndLabel, TickLog, outcome_of
from sar_compiler.json_values import json_value

RawRow = tuple[Any, ...]
"""A row as SQLite has it: number, run, wall, time, kind and data."""

_NODE, _TICK, _STATUS = '{"node": ', ', "tick": ', ', "status": '
_RUNNING = re.compile(r'"RUNNING", "message": "(?:[^"\\]|\\.)*"([^"]*|, "label": "[^"]*")\}')
# Messages can all differ, and must not fill the memory.
_MOST_KEPT = 10_000
_UNKNOWN = -1


class _StatusText:
    """The text of a status entry, starting at the status.

    Attributes:
        rest: For a running node, the part after the message; else None.
        values: The values in the text; None if not yet read, empty if other values are among them.
    """

    __slots__ = ("_outcome", "rest", "values")

    def __init__(self, text: str) -> None:
        running = _RUNNING.fullmatch(text)
        self.rest = running and running[1]
        self.values: Mapping[str, Any] | None = None
        self._outcome: StatusAndLabel | None = None

    def outcome(self, text: str) -> StatusAndLabel | None:
        """Return the status and the label; None if the text has other values.

        Raises:
            ValueError, TypeError: As `read`.
        """
        if self._outcome is None:
            # Of a running node that is left out, the message is not read.
            known = self.read(text) if self.rest is None else mapping(f'{{"status": "RUNNING"{self.rest}}}')
            if known:
                self._outcome = outcome_of(known)
        return self._outcome

    def read(self, text: str) -> Mapping[str, Any]:
        """Read and return the values.

        Raises:
            ValueError, TypeError: If they are not those of a status.
        """
        values = mapping(f'{{"status": {text}')
        check_value_types(STATUS, values)
        self.values = {} if "node" in values or "tick" in values else values
        return self.values


def entries_of(  # noqa: C901, PLR0912, PLR0915 - without calls, because a long journal has a million rows
    rows: Iterable[RawRow], parents: Sequence[int | None] | None = None, log: TickLog | None = None
) -> Iterator[JournalEntry]:
    """Yield the entries of rows in their order.

    Args:
        rows: The rows; condensed, those of one run.
        parents: For condensed reading, the number of each node's parent, by the node's number.
        log: Receives all rows, also those that condensed reading omits; if it is alone, its statuses are not yielded.

    Raises:
        ValueError, TypeError: If a row has values that the project never writes.
    """
    nodes: dict[str, int] = {}
    texts: dict[str, _StatusText] = {}
    tick, tick_text = _UNKNOWN, ""
    # For each running node the rest of its last row, then the last row that repeats it.
    running: dict[int, str] = {}
    held: dict[int, RawRow] = {}
    new = tuple.__new__
    for row in rows:
        number, run, wall, time, kind, data = row
        status: _StatusText | None = None
        if kind == STATUS and type(data) is str:
            # As this project writes it: the node, the tick, the status and the rest, most of which was read before.
            head, _, text = data.partition(_STATUS)
            node_text, _, now_text = head.partition(_TICK)
            if now_text != tick_text:
                tick, tick_text = _parse_integer(now_text), now_text
            node = nodes.get(node_text, _UNKNOWN)
            if node == _UNKNOWN and node_text.startswith(_NODE):
                node = nodes[node_text] = _parse_integer(node_text.removeprefix(_NODE))
            if _UNKNOWN not in (node, tick):
                status = texts.get(text)
                if status is None:
                    if len(texts) == _MOST_KEPT:
                        texts.clear()
                    status = texts[text] = _StatusText(text)
        if log is not None:
            outcome = None if status is None else status.outcome(text)
            if outcome is not None and 0 <= node < log.count and type(time) is float:
                log.add_status(node, tick, time, outcome)
                if log.is_alone and type(wall) is float and math.isfinite(wall + time):
                    continue
            else:
                log.add_entry(_entry(row))
        if parents is not None:
            if status is not None:
                rest = status.rest
                if rest is None:
                    running.pop(node, None)
                elif running.get(node) == rest and _runs_above(node, parents, running):
                    held.pop(node, None)  # the rows stay in their order
                    held[node] = row
                    continue
                else:
                    running[node] = rest
            elif kind == STATUS:  # not as this project writes it
                running.clear()
            if held:
                yield from map(_entry, held.values())
                held.clear()
        values = None if status is None else status.values
        if values is None and status is not None:
            values = status.read(text)
        if values and type(wall) is type(time) is float and math.isfinite(wall + time):
            # This takes half the time of `JournalEntry(…)`.
            yield new(JournalEntry, (number, run, wall, time, kind, {"node": node, "tick": tick, **values}))
        else:
            yield _entry(row)
    yield from map(_entry, held.values())


def _runs_above(node: int, parents: Sequence[int | None], running: Mapping[int, str]) -> bool:
    parent = parents[node] if node < len(parents) else None
    return parent is None or parent in running


def _parse_integer(text: str) -> int:
    """Return a number as the project writes it; `_UNKNOWN` for anything else."""
    return int(text) if text.isdecimal() and str(int(text)) == text else _UNKNOWN


def _entry(row: RawRow) -> JournalEntry:
    number, run, wall, time, kind, data = row
    entry = JournalEntry(number, run, finite(wall), finite(time), str(kind), mapping(data))
    check_value_types(entry.kind, entry.data)
    return entry


def finite(number: Any) -> float:
    """Return a time from a file, which must be finite.

    Raises:
        ValueError, TypeError: If it is no finite number.
    """
    if not math.isfinite(value := float(number)):
        raise ValueError(f"{number} is not a time")
    return value


def mapping(text: str) -> dict[str, Any]:
    """Parse a JSON object.

    Raises:
        ValueError, TypeError: If it is something else.
    """
    data = json_value(text)
    if not isinstance(data, dict):
        raise TypeError(f"{text} must be names with values")
    return data
