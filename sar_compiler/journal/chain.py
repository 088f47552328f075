"""The hash chain of a journal. It reveals entries that were altered, removed, moved or added.

Each entry has a link: a SHA-256 hash over the previous link (zeros for the first entry) and all columns of the entry's row
(`link_of_entry`). The start and the end of a run are entries of the chain, too. The link of the last entry, the
head, therefore represents the whole chain.
"""

import hashlib
import sqlite3
import struct
from collections import deque
from collections.abc import Iterable, Iterator
from typing import Any, NamedTuple

from sar_compiler.journal.journal_entries import RUN_BEGAN, RUN_ENDED
from sar_compiler.json_values import json_text

START = bytes(hashlib.sha256().digest_size)
"""The link that stands for the missing predecessor of the first entry."""

BEGAN, FACT, WATCHED, ENDED = b"b", b"f", b"w", b"e"
"""The possible categories of an entry: start of a run, event, observation, or end of a run."""

# Category, number, run, wall, time, length of the kind; most significant bytes first.
_HEAD = struct.Struct(">cqqddI")

_ENTRIES = (
    "SELECT x'66', number, run, wall, time, kind, data, link FROM main.fact UNION ALL "
    "SELECT x'77', number, run, wall, time, kind, data, link FROM main.watched ORDER BY number"
)


def link_of_entry(
    before: bytes, category: bytes, number: int, run: int, wall: float, time: float, kind: str, data: str
) -> bytes:
    """Compute the link of an entry from the previous link and the columns of the entry.

    Args:
        before: The link of the previous entry.
        category: The entry's category.
        number: The entry's number; for the start or end of a run, the number of the last event or observation before it, or 0.
        run: The number of the entry's run.
        wall: The time of writing, in seconds since 1970.
        time: The time of the mission's clock, in seconds; 0 for the start and end of a run.
        kind: The entry's kind.
        data: The entry's data, as JSON text, as in the file.
    """
    kind_bytes = kind.encode("utf-8", "surrogateescape")
    # The additions convert -0.0, which SQLite does not store, to 0.0.
    head = _HEAD.pack(category, number, run, wall + 0.0, time + 0.0, len(kind_bytes))
    return hashlib.sha256(before + head + kind_bytes + data.encode("utf-8", "surrogateescape")).digest()


class ChainPosition(NamedTuple):
    """A position between two entries of a chain, or at the end of the chain.

    Attributes:
        link: The link of the entry before the position.
        number: The number of the last event or observation before the position.
    """

    link: bytes = START
    number: int = 0


def run_start_link(
    position: ChainPosition, run: int, wall: float, about: str, of_mission: Iterable[tuple[str, str]]
) -> bytes:
    """Compute the link of the entry for the start of a run.

    Args:
        position: The position of the run's start.
        run: The run's number.
        wall: The start, in seconds since 1970.
        about: The description of the run, as JSON text, as in the file.
        of_mission: For the first run, the keys and values of the mission's description, ordered by key.
    """
    return link_of_entry(position.link, *_run_start_row(position.number, run, wall, about, of_mission))


def run_end_link(
    position: ChainPosition, run: int, wall: float, ending: str, status: int, reason: str
) -> bytes:
    """Compute the link of the entry for the end of a run, from its position and the run's columns."""
    return link_of_entry(position.link, *_run_end_row(position.number, run, wall, ending, status, reason))


def _run_start_row(
    last_number: Any, run: Any, wall: Any, about: Any, of_mission: Iterable[Any]
) -> tuple[Any, ...]:
    return BEGAN, last_number, run, wall, 0.0, RUN_BEGAN, _json_text([*of_mission, about])


def _run_end_row(last_number: Any, run: Any, wall: Any, *columns: Any) -> tuple[Any, ...]:
    return ENDED, last_number, run, wall, 0.0, RUN_ENDED, _json_text(columns)


def _json_text(values: Any) -> str:
    return json_text(values, default=_hex_list)


def _hex_list(value: bytes) -> list[str]:
    """Convert bytes to a JSON value that no valid entry contains. Only an altered journal contains bytes."""
    return [value.hex()]


class ChainEntry(NamedTuple):
    """An entry of the chain, as it is stored in the file.

    In an altered file, the values may have any type.

    Attributes:
        category: The entry's category.
        number: The entry's number, as in `link_of_entry`.
        run: The number of the entry's run.
        wall: The time of writing, in seconds since 1970.
        time: The time of the mission's clock, in seconds.
        kind: The entry's kind.
        data: The entry's data.
        link: The entry's link.
    """

    category: bytes
    number: Any
    run: Any
    wall: Any
    time: Any
    kind: Any
    data: Any
    link: Any


def chain_entries(connection: sqlite3.Connection) -> Iterator[tuple[Any, ...]]:
    """Yield the entries of the chain in order. Each tuple contains the fields of a `ChainEntry`.

    Args:
        connection: The database.
    """
    of_mission = connection.execute("SELECT key, value FROM main.about ORDER BY key").fetchall()
    rows = connection.execute(
        "SELECT number, began, about, ended, ending, status, reason, link, closed, began_behind, ended_behind FROM main.run "
        "ORDER BY number"
    ).fetchall()
    marks = deque(mark for index, row in enumerate(rows) for mark in _marks(row, () if index else of_mission))
    for entry in connection.execute(_ENTRIES):
        # In an altered journal, the number may have a type that cannot be compared.
        while marks and not (isinstance(marks[0][1], int) and marks[0][1] >= entry[1]):
            yield marks.popleft()
        yield entry
    yield from marks


def _marks(row: tuple[Any, ...], of_mission: Iterable[Any]) -> Iterator[tuple[Any, ...]]:
    """Yield the entry for the start of a run and, if the run has ended, the entry for the end."""
    run, began, about, *end, link, closed, began_behind, ended_behind = row
    yield *_run_start_row(began_behind, run, began, about, of_mission), link
    if (*end, closed, ended_behind) != (None, None, None, "", None, None):
        yield *_run_end_row(ended_behind, run, *end), closed


class JournalChain(NamedTuple):
    """The result of checking the hash chain of a journal.

    Attributes:
        entries: The number of unaltered events and observations.
        runs: The number of unaltered starts of runs.
        heads: The link of each run's end as hexadecimal digits, by the number of the run.
        is_closed: Whether the last entry is the end of a run.
        wrong: The first entry whose link is wrong; None if all links are correct.
    """

    entries: int
    runs: int
    heads: dict[int, str]
    is_closed: bool
    wrong: ChainEntry | None

    @property
    def head(self) -> str:
        """The link of the last run's end in hexadecimal, or an empty string if the chain is not closed."""
        return [*self.heads.values()][-1] if self.is_closed else ""


def check_chain(entries: Iterable[tuple[Any, ...]]) -> JournalChain:
    """Check a chain up to the first entry whose link is wrong, or up to the end of the chain.

    Args:
        entries: The entries, as `chain_entries` yields them.
    """
    before, category, read, runs, heads = START, b"", 0, 0, dict[int, str]()
    for entry in entries:
        if not _has_right_link(before, entry):
            return JournalChain(read, runs, heads, is_closed=False, wrong=ChainEntry(*entry))
        before, category = entry[7], entry[0]
        if category == ENDED:
            heads[entry[2]] = before.hex()
        elif category == BEGAN:
            runs += 1
        else:
            read += 1
    return JournalChain(read, runs, heads, is_closed=category == ENDED, wrong=None)


def _has_right_link(before: bytes, entry: tuple[Any, ...]) -> bool:
    try:
        return bool(entry[7] == link_of_entry(before, *entry[:7]))
    except (AttributeError, TypeError, OverflowError, struct.error):
        return False  # a value has a type that the project never writes


def last_position(connection: sqlite3.Connection) -> ChainPosition:
    """Return the chain position that follows the last entry.

    Args:
        connection: The database.
    """
    entries = "SELECT number, link FROM fact UNION ALL SELECT number, link FROM watched"
    entry = connection.execute(f"{entries} ORDER BY number DESC LIMIT 1").fetchone() or (0, START)
    runs = "SELECT link, closed, began_behind FROM run ORDER BY number DESC LIMIT 1"
    link, closed, behind = connection.execute(runs).fetchone() or (START, None, -1)
    found = closed or (link if behind == entry[0] else entry[1])
    # A last link that is not bytes was altered. The links after it are then wrong, whatever the predecessor.
    return ChainPosition(found if isinstance(found, bytes) else START, entry[0])
