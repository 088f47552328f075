"""Omit journal rows that repeat a running node's status with another message; a reader needs the last one.

A leaf that drives says in every tick how far it is; such rows are most of a long journal. What a reader computes of statuses
(`mission_state`, `reports.why`, `reports.leaf_statistics`) is the same without them, because a tick in which nothing else has changed
might as well not have been written. Two things must be so: between the row and the next one of the node nothing else was written but such rows,
and the node above runs too. (Where that has ended and is ticked again, its end has come anew with each tick.)
"""

import re
from collections.abc import Iterable, Iterator, Sequence
from typing import Any

from sar_compiler.journal.journal_entries import STATUS

_HEAD = r'\{"node": (\d+), "tick": \d+, "status": '
_RUNNING = re.compile(rf'{_HEAD}"RUNNING", "message": "(?:[^"\\]|\\.)*"([^"]*|, "label": "[^"]*")\}}')
_OTHER = re.compile(rf'{_HEAD}"')

RawRow = tuple[Any, ...]
"""A row as SQLite has it: number, run, wall, time, kind and data."""


def condensed(rows: Iterable[RawRow], parents: Sequence[int | None]) -> Iterator[RawRow]:
    """Yield the rows of a run in their order without those that repeat a status.

    Args:
        rows: The rows.
        parents: The number of each node's parent, by the node's number.
    """
    # For each running node the fields of its last row besides tick and message, then the last repeated row.
    running: dict[int, str] = {}
    held: dict[int, RawRow] = {}
    for row in rows:
        data = row[5] if row[4] == STATUS else None
        said = _RUNNING.fullmatch(data) if isinstance(data, str) else None
        if said is not None:
            node, rest = int(said[1]), said[2]
            parent = parents[node] if node < len(parents) else None
            if running.get(node) == rest and (parent is None or parent in running):
                held.pop(node, None)  # the rows stay in their order
                held[node] = row
                continue
            running[node] = rest
        if held:
            yield from held.values()
            held.clear()
        if data is not None and said is None:
            other = _OTHER.match(data) if isinstance(data, str) else None
            if other is None:  # not as this project writes it
                running.clear()
            else:
                running.pop(int(other[1]), None)
        yield row
    yield from held.values()
