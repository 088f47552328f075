"""Converts the rows of a journal to entries. Repeated statuses take a fast path.

A row that repeats a running node's status with another message is called a repetition. Most rows of a long journal are repetitions,
because a leaf that drives reports its distance in every tick. Condensed reading omits a repetition if two
conditions hold: all rows up to the node's next row are repetitions, and the node's parent is also running. (A
parent that is not running may end in each of these ticks.) The results computed from statuses
(`mission_state`, `reports.why`, `reports.leaf_statistics`) are the same without the omitted rows, because no
status changes in a tick that contains only repetitions.
"""

import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

from sar_compiler.journal.journal_entries import STATUS, JournalEntry, check_value_types
from sar_compiler.journal.recorded_ticks import StatusAndLabel, TickLog, outcome_of
from sar_compiler.json_values import json_value

RawRow = tuple[Any, ...]
"""A row as SQLite returns it: number, run, wall, time, kind and data."""

_NODE, _TICK, _STATUS = '{"node": ', ', "tick": ', ', "status": '
_RUNNING = re.compile(r'"RUNNING", "message": "(?:[^"\\]|\\.)*"([^"]*|, "label": "[^"]*")\}')
# The maximum number of cached texts. Without a limit, different messages could fill the memory.
_MAX_TEXTS = 10_000
_UNKNOWN = -1


class _StatusText:
    """The text of a `status` entry's data, beginning with the value of `status`.

    Attributes:
        rest: The part of the text after the message if the node is running, otherwise None.
        values: The values in the text; None if they were not parsed yet, empty if they include a further `node` or `tick`.
    """

    __slots__ = ("_outcome", "rest", "values")

    def __init__(self, text: str) -> None:
        running = _RUNNING.fullmatch(text)
        self.rest = running and running[1]
        self.values: Mapping[str, Any] | None = None
        self._outcome: StatusAndLabel | None = None

    def outcome(self, text: str) -> StatusAndLabel | None:
        """Return the status and the label, or None if the text contains a further `node` or `tick`.

        Raises:
            ValueError, TypeError: As for `read`.
        """
        if self._outcome is None:
            # The message of a running node is not parsed, because its row may be omitted.
            known = self.read(text) if self.rest is None else mapping(f'{{"status": "RUNNING"{self.rest}}}')
            if known:
                self._outcome = outcome_of(known)
        return self._outcome

    def read(self, text: str) -> Mapping[str, Any]:
        """Parse the text, and return the values.

        Raises:
            ValueError, TypeError: If the text contains values that the project never writes for a status.
        """
        values = mapping(f'{{"status": {text}')
        check_value_types(STATUS, values)
        self.values = {} if "node" in values or "tick" in values else values
        return self.values


def entries_of(  # noqa: C901, PLR0912, PLR0915 - without calls, because a long journal has a million rows
    rows: Iterable[RawRow], parents: Sequence[int | None] | None = None, log: TickLog | None = None
) -> Iterator[JournalEntry]:
    """Convert rows to entries in the same order.

    Args:
        rows: The rows; for condensed reading, rows of a single run.
        parents: For condensed reading, the number of each node's parent, by the node's number; otherwise None.
        log: Receives all rows, including the rows that condensed reading omits. If `log.is_alone` is true,
            statuses are not yielded.

    Raises:
        ValueError, TypeError: If a row has values that the project never writes.
    """
    nodes: dict[str, int] = {}
    texts: dict[str, _StatusText] = {}
    tick, tick_text = _UNKNOWN, ""
    # For each running node, the text after the message in its last row, and its last repetition.
    running: dict[int, str] = {}
    repetitions: dict[int, RawRow] = {}
    new = tuple.__new__
    for row in rows:
        number, run, wall, time, kind, data = row
        status: _StatusText | None = None
        if kind == STATUS and type(data) is str:
            # The project writes the node and the tick first. The text that follows, with the status, is cached in most cases.
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
                    if len(texts) == _MAX_TEXTS:
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
                elif running.get(node) == rest and _is_parent_running(node, parents, running):
                    repetitions.pop(node, None)  # keeps the rows in order
                    repetitions[node] = row
                    continue
                else:
                    running[node] = rest
            elif kind == STATUS:  # in a form that the project does not write
                running.clear()
            if repetitions:
                yield from map(_entry, repetitions.values())
                repetitions.clear()
        values = None if status is None else status.values
        if values is None and status is not None:
            values = status.read(text)
        if values and type(wall) is type(time) is float and math.isfinite(wall + time):
            # This takes half the time of `JournalEntry(…)`.
            yield new(JournalEntry, (number, run, wall, time, kind, {"node": node, "tick": tick, **values}))
        else:
            yield _entry(row)
    yield from map(_entry, repetitions.values())


def _is_parent_running(node: int, parents: Sequence[int | None], running: Mapping[int, str]) -> bool:
    parent = parents[node] if node < len(parents) else None
    return parent is None or parent in running


def _parse_integer(text: str) -> int:
    """Parse an integer that has the form in which the project writes it.

    Return `_UNKNOWN` for any other text.
    """
    return int(text) if text.isdecimal() and str(int(text)) == text else _UNKNOWN


def _entry(row: RawRow) -> JournalEntry:
    number, run, wall, time, kind, data = row
    entry = JournalEntry(number, run, finite(wall), finite(time), str(kind), mapping(data))
    check_value_types(entry.kind, entry.data)
    return entry


def finite(number: Any) -> float:
    """Convert a value from a file to a time, which must be a finite number.

    Raises:
        ValueError, TypeError: If the value is not a finite number.
    """
    if not math.isfinite(value := float(number)):
        raise ValueError(f"{number} is not a time")
    return value


def mapping(text: str) -> dict[str, Any]:
    """Parse a JSON object.

    Raises:
        ValueError, TypeError: If the text is not a JSON object.
    """
    data = json_value(text)
    if not isinstance(data, dict):
        raise TypeError(f"{text} is not a JSON object")
    return data
