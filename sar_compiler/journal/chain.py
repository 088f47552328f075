"""The hash chain of a journal, which shows if an entry was altered, removed, moved or added.

Each entry has a link: the SHA-256 of the previous link (zeros before the first one) and of all columns of its row, as
composed by `link_of_entry`. The start and the end of a run are entries of the chain, too. So the link of the last one, the
head, represents the whole chain.
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
"""The link before the first entry."""

BEGAN, FACT, WATCHED, ENDED = b"b", b"f", b"w", b"e"
"""The categories of an entry of the chain."""

# Category, number, run, wall, time, length of the kind; most significant bytes first.
_HEAD = struct.Struct(">cqqddI")

_ENTRIES = (
    "SELECT x'66', number, run, wall, time, kind, data, link FROM main.fact UNION ALL "
    "SELECT x'77', number, run, wall, time, kind, data, link FROM main.watched ORDER BY number"
)


def link_of_entry(
    before: bytes, what: bytes, number: int, run: int, wall: float, time: float, kind: str, data: str
) -> bytes:
    """Return the link of an entry.

    Args:
        before: The previous link.
        what: Its category.
        number: Its number; for a run's start or end the number of the entry before it, 0 if there is none.
        run: The number of its run.
        wall: The time of writing, in seconds since 1970.
        time: The time of the mission's clock, in seconds; 0 at a run's beginning and end.
        kind: Its kind.
        data: Its data, as text in the form of the file.
    """
    named = kind.encode("utf-8", "surrogateescape")
    # SQLite has one zero only.
    head = _HEAD.pack(what, number, run, wall + 0.0, time + 0.0, len(named))
    return hashlib.sha256(before + head + named + data.encode("utf-8", "surrogateescape")).digest()


class ChainPosition(NamedTuple):
    """A position in a chain.

    Attributes:
        link: The link before it.
        number: The number of the last entry before it that is not the start or end of a run.
    """

    link: bytes = START
    number: int = 0


def run_start_link(
    place: ChainPosition, run: int, wall: float, about: str, of_mission: Iterable[tuple[str, str]]
) -> bytes:
    """Return the link of a run's start.

    Args:
        place: Its position.
        run: The run's number.
        wall: The start, in seconds since 1970.
        about: The data of the run, as text in the form of the file.
        of_mission: For the first run, the mission's keys and values, ordered by key.
    """
    return link_of_entry(place.link, *_run_start_row(place.number, run, wall, about, of_mission))


def run_end_link(place: ChainPosition, run: int, wall: float, ending: str, status: int, reason: str) -> bytes:
    """Return the link of a run's end, given these columns of its row."""
    return link_of_entry(place.link, *_run_end_row(place.number, run, wall, ending, status, reason))


def _run_start_row(
    behind: Any, run: Any, wall: Any, about: Any, of_mission: Iterable[Any]
) -> tuple[Any, ...]:
    return BEGAN, behind, run, wall, 0.0, RUN_BEGAN, _text([*of_mission, about])


def _run_end_row(behind: Any, run: Any, wall: Any, *columns: Any) -> tuple[Any, ...]:
    return ENDED, behind, run, wall, 0.0, RUN_ENDED, _text(columns)


def _text(values: Any) -> str:
    return json_text(values, default=_blob)


def _blob(value: bytes) -> list[str]:
    """Return a text for bytes, which matches no entry, because journals contain no bytes."""
    return [value.hex()]


class ChainEntry(NamedTuple):
    """An entry of the chain as stored; in an altered file its values may have any type.

    Attributes:
        what: Its category.
        number: Its number.
        run: The number of its run.
        wall: The time of writing, in seconds since 1970.
        time: The time of the mission's clock, in seconds.
        kind: Its kind.
        data: Its data.
        link: Its link.
    """

    what: bytes
    number: Any
    run: Any
    wall: Any
    time: Any
    kind: Any
    data: Any
    link: Any


def chain_entries(connection: sqlite3.Connection) -> Iterator[tuple[Any, ...]]:
    """Yield the entries of the chain in order, one by one, as tuples of the fields of `ChainEntry`.

    Args:
        connection: The database.
    """
    of_mission = connection.execute("SELECT key, value FROM main.about ORDER BY key").fetchall()
    rows = connection.execute(
        "SELECT number, began, about, ended, ending, status, reason, link, closed, began_behind, ended_behind FROM main.run "
        "ORDER BY number"
    ).fetchall()
    marks = deque(mark for place, row in enumerate(rows) for mark in _marks(row, () if place else of_mission))
    for entry in connection.execute(_ENTRIES):
        # A number of another type has no position and is an error.
        while marks and not (isinstance(marks[0][1], int) and marks[0][1] >= entry[1]):
            yield marks.popleft()
        yield entry
    yield from marks


def _marks(row: tuple[Any, ...], of_mission: Iterable[Any]) -> Iterator[tuple[Any, ...]]:
    """Yield the start of a run, and its end if it has one."""
    run, began, about, *end, link, closed, began_behind, ended_behind = row
    yield *_run_start_row(began_behind, run, began, about, of_mission), link
    if (*end, closed, ended_behind) != (None, None, None, "", None, None):
        yield *_run_end_row(ended_behind, run, *end), closed


class JournalChain(NamedTuple):
    """The result of checking a chain.

    Attributes:
        entries: How many entries, without starts and ends of runs, are unaltered.
        runs: The number of runs that have started in it.
        heads: The link of each run's end as hexadecimal digits, by the number of the run.
        is_closed: Whether the last entry is the end of a run.
        wrong: The first entry that does not match the one before it; None if all match.
    """

    entries: int
    runs: int
    heads: dict[int, str]
    is_closed: bool
    wrong: ChainEntry | None

    @property
    def head(self) -> str:
        """The link that closes it; empty if it is open."""
        return [*self.heads.values()][-1] if self.is_closed else ""


def follow(entries: Iterable[tuple[Any, ...]]) -> JournalChain:
    """Check a chain up to its end or the first entry that does not match.

    Args:
        entries: The entries, as `chain_entries` yields them.
    """
    before, what, read, runs, heads = START, b"", 0, 0, dict[int, str]()
    for entry in entries:
        if not _follows(before, entry):
            return JournalChain(read, runs, heads, is_closed=False, wrong=ChainEntry(*entry))
        before, what = entry[7], entry[0]
        if what == ENDED:
            heads[entry[2]] = before.hex()
        elif what == BEGAN:
            runs += 1
        else:
            read += 1
    return JournalChain(read, runs, heads, is_closed=what == ENDED, wrong=None)


def _follows(before: bytes, entry: tuple[Any, ...]) -> bool:
    try:
        return bool(entry[7] == link_of_entry(before, *entry[:7]))
    except (AttributeError, TypeError, OverflowError, struct.error):
        return False  # a value has a type that the project never writes


def last_position(connection: sqlite3.Connection) -> ChainPosition:
    """Return the position after the last entry.

    Args:
        connection: The database.
    """
    entries = "SELECT number, link FROM fact UNION ALL SELECT number, link FROM watched"
    entry = connection.execute(f"{entries} ORDER BY number DESC LIMIT 1").fetchone() or (0, START)
    runs = "SELECT link, closed, began_behind FROM run ORDER BY number DESC LIMIT 1"
    link, closed, behind = connection.execute(runs).fetchone() or (START, None, -1)
    found = closed or (link if behind == entry[0] else entry[1])
    # After an altered entry no link can match, whatever follows.
    return ChainPosition(found if isinstance(found, bytes) else START, entry[0])
