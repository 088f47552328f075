"""Reads and writes the SQLite file of a journal."""

import errno
import functools
import math
import os
import sqlite3
import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import closing, contextmanager, suppress
from pathlib import Path
from typing import Any, NamedTuple

from sar_compiler.journal.chain import (
    FACT,
    WATCHED,
    ChainPosition,
    JournalChain,
    chain_entries,
    check_chain,
    last_position,
    link_of_entry,
    run_end_link,
    run_start_link,
)
from sar_compiler.journal.errors import JournalError, JournalPlaceError
from sar_compiler.journal.journal_entries import (
    RUN_BEGAN,
    RUN_ENDED,
    Ending,
    JournalEntry,
    JournalRun,
    Row,
    check_value_types,
    end_data,
)
from sar_compiler.journal.mission_state import tree_nodes
from sar_compiler.journal.recorded_ticks import TickLog
from sar_compiler.journal.row_reader import entries_of, finite, mapping
from sar_compiler.journal.spill_file import SUFFIX, RunEnd, SpilledEntries, SpillFile, read_reserve
from sar_compiler.json_values import json_text, json_value
from sar_compiler.opener import (
    MissingFileError,
    UnreadableFileError,
    open_by_name,
    regular_file,
    release_pipes,
    require_regular,
    require_regular_mode,
)
from sar_compiler.resources import state_folder

# How an event survives a crash, and why commits work in this way.
#
# A mission writes an event *before* its effect: first "photo 1 was taken", then the picture and its message. If the process is
# killed in between, the next run repeats the effect under the same name, which the receiver knows. In the opposite order, a receiver
# could know a name that the next run assigns to another picture. So `write` returns only when an event is on disk, and the tick waits
# for `write`. Statuses and poses are far more frequent, and resuming does not need them, so they are not synced one by one.
#
# Both go into one file, by SQLite's write-ahead log. `synchronous` is chosen for each transaction: FULL syncs the log
# with the commit, NORMAL leaves that to a later sync. A NORMAL commit has been handed to the kernel, so SIGKILL loses
# nothing that was committed; only a power cut loses it. The log is written from front to back, and a FULL commit also
# syncs everything before it: a power cut removes the end of the history, and never a part of its middle. (With two
# files, only one of them durable, an event could survive without the statuses that led to it.) The pragma precedes BEGIN,
# because SQLite does not change the level within a transaction.
#
# BEGIN IMMEDIATE takes the write lock at once, so that a refusal comes before any row is written. After the start of a run, this
# process does not wait for that lock (`reserve` sets `busy_timeout` to 0): this thread ticks the tree and cancels goals, and a
# person's open `sqlite3` shell must not stop a robot's mission. A lock, a full disk and a quota are handled alike: the transaction
# has failed, and none of its rows is in the file. `Journal` keeps the rows with their numbers, events also in the reserve, and
# writes them again in one transaction, in order. If a transaction could be applied in part, a second attempt would write rows
# twice, or omit them. On a full disk, SQLite has already rolled back, so the ROLLBACK fails; this failure is ignored.
#
# A process can die after the commit and before its reserve is emptied. So `_write_spilled` skips events whose numbers are
# already in the file.
#
# There are two locks on the file. SQLite's POSIX locks belong to the process: closing *any* descriptor of the file releases them.
# Our `flock` belongs to its descriptor. It marks a running mission for as long as the process lives, also between transactions and
# before the database is open. The two kinds of locks are independent. Hence the order in `close`: first the connection, then the
# descriptor. Hence also `is_locked`, which opens and closes a descriptor, must not be called by the writing process.
#
# Each entry is linked to the previous entry (`chain`), in the order of the numbers. The numbers of a transaction's entries are higher
# than all numbers in the file. A failed transaction has no effect: `_end` is the position after the last successful transaction.
#
# The schema is created in one transaction, and the folder is synced after it: a new file is a journal or empty, and its
# name is on disk before any event.

VERSION = 4
"""The version of the database schema. Journals with another version are refused."""

# The ID by which `file` and SQLite recognise a journal: "SARJ".
_APPLICATION_ID = 0x5341524A

_SCHEMA = f"""
PRAGMA application_id = {_APPLICATION_ID};
CREATE TABLE about (key TEXT PRIMARY KEY, value TEXT NOT NULL);
CREATE TABLE run (
    number INTEGER PRIMARY KEY, began REAL NOT NULL, about TEXT NOT NULL,
    ended REAL, ending TEXT, status INTEGER, reason TEXT NOT NULL DEFAULT '',
    link BLOB, closed BLOB, began_behind INTEGER, ended_behind INTEGER
);
CREATE TABLE fact (
    number INTEGER PRIMARY KEY, run INTEGER NOT NULL, wall REAL NOT NULL, time REAL NOT NULL,
    kind TEXT NOT NULL, data TEXT NOT NULL, link BLOB
);
CREATE TABLE watched (
    number INTEGER PRIMARY KEY, run INTEGER NOT NULL, wall REAL NOT NULL, time REAL NOT NULL,
    kind TEXT NOT NULL, data TEXT NOT NULL, link BLOB
);
CREATE INDEX watched_by_kind ON watched (kind);
"""

# A single transaction: if the process dies during it, the file stays empty.
_CREATE_SCHEMA = f"BEGIN IMMEDIATE; {_SCHEMA} PRAGMA user_version = {VERSION}; COMMIT;"

_RUNS = "SELECT number, began, about, ended, ending, status, reason, hex(closed) FROM run ORDER BY number"
_ENTRIES = "SELECT number, run, wall, time, kind, data FROM"

# The maximum number of SQLite's steps in one read, about twenty times the usual number: a constant plus a number per byte of the file.
_STEPS, _STEPS_PER_BYTE = 2_000_000, 20

# The number of attempts to lock a file that another process may be testing, and the interval between them, in seconds.
_ATTEMPTS, _RETRY_SEC = 10, 0.02

_SIDECARS = ("-wal", "-shm", SUFFIX)

_END_OF_RUN = "UPDATE run SET ended = ?, ending = ?, status = ?, reason = ? WHERE number = ?"

# Temporary views that show a reader the entries of the reserve as if they were in the journal.
_OVERLAY = """
PRAGMA temp_store = MEMORY;
CREATE TEMP TABLE spilled AS SELECT number, run, wall, time, kind, data FROM main.fact WHERE 0;
CREATE TEMP VIEW fact AS
    SELECT number, run, wall, time, kind, data FROM main.fact UNION ALL SELECT * FROM temp.spilled WHERE number NOT IN (SELECT number FROM main.fact);
CREATE TEMP TABLE run AS SELECT * FROM main.run;
"""


class ReadCursor(NamedTuple):
    """A read position in the stream of a journal. The default is the start of the stream.

    Attributes:
        fact: The number of the last event that was read.
        watched: The number of the last observation that was read.
        begun: The numbers of the runs whose starts were read.
        ended: The numbers of the runs whose ends were read.
    """

    fact: int = 0
    watched: int = 0
    begun: frozenset[int] = frozenset()
    ended: frozenset[int] = frozenset()


class StreamPosition(NamedTuple):
    """A position after an entry in the stream of a journal. The default is the start of the stream.

    Attributes:
        run: The number of the run.
        number: The number of the entry in the run: 0 for the run's start, `END` for its end.
        time: The latest time of the mission's clock in the run up to this position, in seconds.
    """

    run: int = 0
    number: int = 0
    time: float = -math.inf

    def next_position(self, entry: JournalEntry) -> "StreamPosition":
        """Return the position after *entry*, which must be the first entry after this position."""
        latest = max(self.time, entry.time) if entry.run == self.run else entry.time
        return StreamPosition(entry.run, entry.number, latest)


_SQLITE_SUFFIXES = ("-wal", "-shm", "-journal")
"""The suffixes of the files that SQLite creates beside a database."""

END = 2**63 - 1
"""The entry number that stands for a run's end in a `StreamPosition`."""


class JournalFile:
    """An open journal.

    Args:
        path: The path of the file.
        connection: The database.
        lock: The descriptor that holds the lock; None if the journal is only read.

    Attributes:
        path: The path of the file.
        is_written: Whether another process was writing to the journal when it was opened for reading.
    """

    is_written = False

    def __init__(self, path: Path, connection: sqlite3.Connection, lock: int | None = None) -> None:
        self.path = path
        self._connection = connection
        self._lock = lock
        # The position after the last entry; unknown before the first write.
        self._end: ChainPosition | None = None
        # Whether the last transaction was synced to disk; None before the first one.
        self._durable: bool | None = None
        self._query_budget = _QueryBudget(_STEPS + _STEPS_PER_BYTE * (_size(path) + _size(f"{path}-wal")))
        connection.set_progress_handler(self._query_budget.is_over, _QueryBudget.STRIDE)

    @classmethod
    def create(cls, path: Path) -> "JournalFile":
        """Create and lock a journal. A journal in which no run has started may be reused.

        Raises:
            JournalError: If the file cannot be created, belongs to another process, or contains a mission.
        """
        file = cls.open(path)
        if file.runs():
            file.close()
            raise JournalError(f"{path} already contains a mission")
        return file

    @classmethod
    def open(cls, path: Path) -> "JournalFile":
        """Open and lock a journal for a run. Create the journal if the file is missing or empty.

        Raises:
            JournalError: If the file cannot be opened or created, belongs to another process, or is not a journal of this version.
        """
        with _convert_errors(path):
            path.parent.mkdir(parents=True, exist_ok=True)
            lock = _open_locked(path)
            try:
                connection = open_by_name(path, lock, lambda: _connect(path))
            except BaseException:
                os.close(lock)
                raise
            file = cls(path, connection, lock)
            try:
                with file._limit_reading():
                    file._prepare()
            except BaseException:
                file.close()
                raise
        return file

    def _prepare(self) -> None:
        (tables,) = self._connection.execute("SELECT count(*) FROM sqlite_master").fetchone()
        if not tables:
            self._connection.executescript(_CREATE_SCHEMA)
            _sync_folder(self.path.parent)
        # The file is checked before the journal mode is set, because setting the mode changes the file.
        self._require_journal()
        self._connection.execute("PRAGMA journal_mode = WAL")
        self._write_spilled(self._spilled_entries())

    def _spilled_entries(self) -> SpilledEntries:
        """Return the entries in the reserve file beside the journal if that file belongs to this journal."""
        spilled = read_reserve(self.path)
        began = self._connection.execute("SELECT min(began) FROM run").fetchone()[0]
        return spilled if spilled.began == began else SpilledEntries()

    def _write_spilled(self, spilled: SpilledEntries) -> None:
        """Write the entries that an earlier run could only store in the reserve file."""
        if spilled.facts or spilled.end:
            known = {number for (number,) in self._connection.execute("SELECT number FROM fact")}
            self.write((), [fact for fact in spilled.facts if fact.number not in known], spilled.end)

    def _overlay_spilled(self, spilled: SpilledEntries) -> None:
        """Make all reads also return the entries of the reserve file."""
        if spilled.facts or spilled.end:
            self._connection.executescript(_OVERLAY)
            self._connection.executemany("INSERT INTO spilled VALUES (?, ?, ?, ?, ?, ?)", spilled.facts)
            if spilled.end is not None:
                self._connection.execute(_END_OF_RUN, _end_of_run(spilled.end))

    def reserve(self) -> SpillFile:
        """Open or create the reserve file.

        Transactions after this call do not wait for locks of other processes.

        Raises:
            JournalError: If the reserve file cannot be created.
        """
        with self._limit_reading():
            reserve = SpillFile(self.path)
            self._connection.execute("PRAGMA busy_timeout = 0")
            _sync_folder(self.path.parent)
        return reserve

    @classmethod
    def read(cls, path: Path) -> "JournalFile":
        """Open a journal for reading, even while a run writes to it.

        Raises:
            JournalError: If the file cannot be opened, or is not a journal of this version.
        """
        with _convert_errors(path):
            # SQLite also opens the files beside the journal. If one of them were a pipe, SQLite would wait for a writer of the pipe.
            for each in (f"{path}{suffix}" for suffix in _SQLITE_SUFFIXES):
                if os.path.lexists(each):
                    require_regular(each)
            is_written = is_locked(path)
            # Without a writer, SQLite can read the journal without creating files beside it. The files of a writer are not
            # changed, because the writer may be renaming the journal and creating a new one.
            passive = "mode=ro&readonly_shm=1" if Path(f"{path}-shm").exists() else "mode=ro"
            uri = f"{path.absolute().as_uri()}?{passive if _is_used(path) else 'immutable=1'}"
            with release_pipes(path, f"{path}-shm"):
                with regular_file(path) as checked:
                    connection = open_by_name(path, checked, lambda: _connect(uri, uri=True))
                file = cls(path, connection)
                file.is_written = is_written
                try:
                    with file._limit_reading():
                        file._require_journal()
                        file._overlay_spilled(file._spilled_entries())
                        return file
                except BaseException:
                    file.close()
                    raise

    @classmethod
    @contextmanager
    def open_snapshot(cls, path: Path) -> "Iterator[JournalFile]":
        """Open a snapshot of a journal for reading, like `read`."""
        with closing(cls.read(path)) as file, file.snapshot():
            yield file

    def _require_journal(self) -> None:
        if flaw := self._flaw():
            raise JournalError(flaw)

    def _flaw(self) -> str:
        known, version = (
            self._connection.execute(f"PRAGMA {name}").fetchone()[0]
            for name in ("application_id", "user_version")
        )
        if known != _APPLICATION_ID:
            return f"{self.path} is a database, but not the journal of a mission"
        if version != VERSION:
            return (
                f"{self.path} is a journal of version {version}, but this sar_compiler reads only version {VERSION}. "
                "Use the sar_compiler that wrote the journal, or move the file away to start over"
            )
        known = _schema_definitions()
        objects = self._connection.execute("SELECT type, name, sql FROM main.sqlite_master")
        unknown = [
            (kind, name)
            for kind, name, text in objects
            # ANALYZE creates tables for statistics.
            if text not in known and not str(name).startswith("sqlite_stat")
        ]
        if unknown:
            kind, name = unknown[0]
            return f"{self.path} was not read, because it contains the {kind} {name!r}, which does not belong to a journal"
        return ""

    @contextmanager
    def _limit_reading(self) -> Iterator[None]:
        """Limit the work of the reads in the block, and convert errors of these reads to a `JournalError`.

        Raises:
            JournalError: If the journal cannot be read.
            KeyboardInterrupt: If Ctrl-C was pressed during the read.
        """
        self._query_budget.begin()
        with _convert_errors(self.path):
            try:
                yield
            except sqlite3.OperationalError as error:
                if str(error) != "interrupted":
                    raise
                if self._query_budget.was_interrupted:
                    raise KeyboardInterrupt from error
                raise ValueError(
                    "reading the journal takes far more steps than expected for a file of this size"
                ) from error

    def description(self) -> dict[str, Any]:
        """Return the mission's description, such as `mission` and `tree`. It is empty before the first run."""
        with self._limit_reading():
            rows = self._connection.execute("SELECT key, value FROM about").fetchall()
            return {key: json_value(value) for key, value in rows}

    def runs(self) -> list[JournalRun]:
        """Return the runs in the order in which they started."""
        with self._limit_reading():
            rows = self._connection.execute(_RUNS)
            runs = [
                JournalRun(
                    number,
                    finite(began),
                    mapping(about),
                    None if ended is None else finite(ended),
                    None if ending is None else Ending(ending),
                    status,
                    str(reason),
                    str(head).lower(),
                )
                for number, began, about, ended, ending, status, reason, head in rows
            ]
            for run in runs:
                check_value_types(RUN_BEGAN, run.about)
            return runs

    def events(self) -> Iterator[JournalEntry]:
        """Yield all events in order."""
        return self._read("fact")

    def observations(self, *kinds: str) -> Iterator[JournalEntry]:
        """Yield the observations of the given kinds in order. Without kinds, yield all observations."""
        return self._read(f"watched WHERE kind IN ({_placeholders(kinds)})" if kinds else "watched", kinds)

    def stream(self, *, without: Sequence[str] = ()) -> Iterator[JournalEntry]:
        """Yield all entries in order, as listeners receive them. Omit observations of the kinds *without*."""
        for number, entry in enumerate(self.every_run(without=without), 1):
            yield JournalEntry(number, *entry[1:])

    def every_run(self, *, without: Sequence[str] = (), is_condensed: bool = False) -> Iterator[JournalEntry]:
        """Yield the entries of all runs in order, with their numbers in the file.

        The arguments are those of `last_run`.
        """
        with self.snapshot():
            for run in self.runs():
                yield from self._run_entries(run, without, is_condensed=is_condensed)

    def stream_after(self, after: StreamPosition, *, without: Sequence[str] = ()) -> Iterator[JournalEntry]:
        """Yield all entries after a position in order. Omit observations of the kinds *without*."""
        with self.snapshot():
            for run in self.runs():
                if run.number >= after.run:
                    yield from self._run_entries(run, without, after if run.number == after.run else None)

    def last_run(
        self, *, without: Sequence[str] = (), is_condensed: bool = False, log: TickLog | None = None
    ) -> Iterator[JournalEntry]:
        """Yield the entries of the last run in order.

        Args:
            without: The kinds of observations to omit.
            is_condensed: Whether to omit statuses that only repeat earlier statuses (`row_reader`).
            log: Receives the start of the run, and its events and observations except the omitted kinds.
        """
        with self.snapshot():
            for run in self.runs()[-1:]:
                yield from self._run_entries(run, without, is_condensed=is_condensed, log=log)

    def run_entries(
        self, number: int, *, without: Sequence[str] = (), log: TickLog | None = None
    ) -> Iterator[JournalEntry]:
        """Yield the entries of the run *number* in order, like `last_run`."""
        with self.snapshot():
            for run in self.runs():
                if run.number == number:
                    yield from self._run_entries(run, without, log=log)

    def _run_entries(
        self,
        run: JournalRun,
        without: Sequence[str] = (),
        after: StreamPosition | None = None,
        *,
        is_condensed: bool = False,
        log: TickLog | None = None,
    ) -> Iterator[JournalEntry]:
        if after is None:
            after = StreamPosition(run.number, 0, _start(run))
            begin = self._begin_of(run, self.description())
            if log is not None:
                log.add_entry(begin)
            yield begin
        if after.number == END:
            return
        latest = after.time
        entries = self.entries(
            run.number, without=without, after=after.number, is_condensed=is_condensed, log=log
        )
        if without:
            yield from entries
        else:
            for entry in entries:
                latest = max(latest, entry.time)
                yield entry
        # The time of an omitted entry may be even later.
        if (end := self._end_of(run, None if without else latest)) is not None:
            yield end

    def entries(
        self,
        run: int,
        *,
        with_watched: bool = True,
        without: Sequence[str] = (),
        after: int = 0,
        is_condensed: bool = False,
        log: TickLog | None = None,
    ) -> Iterator[JournalEntry]:
        """Yield the events of a run in order. By default, also yield the observations of the run.

        Args:
            run: The number of the run.
            with_watched: Whether to yield observations.
            without: The kinds of observations to omit.
            after: The number of the entry after which to start.
            is_condensed: As for `last_run`.
            log: As for `last_run`.
        """
        chosen = "WHERE run = ?1 AND number > ?2"
        source = f"fact {chosen}"
        if with_watched:
            source += f" UNION ALL {_ENTRIES} watched {chosen} AND kind NOT IN ({_placeholders(without)})"
        return self._read(source, (run, after, *without), is_condensed=is_condensed, log=log)

    def widest_kind(self, run: int, *, with_watched: bool) -> int:
        """Return the length of the longest entry kind in a run, for aligned output, or 0 without entries."""
        query = "SELECT max(length(kind)) FROM fact WHERE run = ?1"
        if with_watched:
            query += " UNION ALL SELECT max(length(kind)) FROM watched WHERE run = ?1"
        with self._limit_reading():
            return max(int(widest or 0) for (widest,) in self._connection.execute(query, (run,)))

    def _begin_of(self, run: JournalRun, about: Mapping[str, Any]) -> JournalEntry:
        return JournalEntry(0, run.number, run.began, _start(run), RUN_BEGAN, {**about, "run": run.about})

    def _end_of(self, run: JournalRun, latest: float | None = None) -> JournalEntry | None:
        if run.ended is None or run.ending is None:
            return None
        data = end_data(run.ending, run.status, run.reason, run.head)
        last = max(_start(run), self._last_time(run.number) if latest is None else latest)
        return JournalEntry(END, run.number, run.ended, last, RUN_ENDED, data)

    def read_new(self, mark: "ReadCursor") -> "tuple[list[JournalEntry], ReadCursor]":
        """Return the entries after a read position, and the read position that follows these entries.

        Args:
            mark: The read position.
        """
        with self.snapshot():
            return self._read_new(mark)

    @contextmanager
    def snapshot(self) -> Iterator[None]:
        """Let all reads in the block see the same state of the file, even if another process writes meanwhile."""
        if self._connection.in_transaction:
            yield
            return
        with self._limit_reading():
            self._connection.execute("BEGIN")
        try:
            yield
        finally:
            with suppress(sqlite3.Error):
                self._connection.execute("COMMIT")

    def _read_new(self, mark: "ReadCursor") -> "tuple[list[JournalEntry], ReadCursor]":
        runs = self.runs()
        about = self.description() if any(run.number not in mark.begun for run in runs) else {}
        facts = [*self._read("fact WHERE number > ?", (mark.fact,))]
        watched = [*self._read("watched WHERE number > ?", (mark.watched,))]
        entries = [*facts, *watched]
        for run in runs:
            if run.number not in mark.begun:
                entries.append(self._begin_of(run, about))
            if run.number not in mark.ended and (end := self._end_of(run)) is not None:
                entries.append(end)
        # The entries are not sorted by time, because the system's clock may have been set back.
        rank = {RUN_BEGAN: 0, RUN_ENDED: 2}
        entries.sort(key=lambda entry: (entry.run, rank.get(entry.kind, 1), entry.number))
        following = ReadCursor(
            max((entry.number for entry in facts), default=mark.fact),
            max((entry.number for entry in watched), default=mark.watched),
            frozenset(run.number for run in runs),
            frozenset(run.number for run in runs if run.ended is not None),
        )
        return entries, following

    def last_number(self) -> int:
        """Return the number of the last entry, or 0 if there are no entries."""
        with self._limit_reading():
            query = "SELECT max(number) FROM (SELECT number FROM fact UNION ALL SELECT number FROM watched)"
            (last,) = self._connection.execute(query).fetchone()
            return int(last or 0)

    def _last_time(self, run: int) -> float:
        """Return the latest mission clock time in the entries of a run, or minus infinity without entries."""
        with self._limit_reading():
            query = "SELECT max(time) FROM (SELECT run, time FROM fact UNION ALL SELECT run, time FROM watched) WHERE run = ?"
            (last,) = self._connection.execute(query, (run,)).fetchone()
        return -math.inf if last is None else float(last)

    def _read(
        self,
        source: str,
        values: Iterable[str | int] = (),
        *,
        is_condensed: bool = False,
        log: TickLog | None = None,
    ) -> Iterator[JournalEntry]:
        """Yield the entries of *source*, a table with an optional SQL condition, in the order of numbers."""
        query = f"{_ENTRIES} {source} ORDER BY number"
        with self._limit_reading():
            rows = self._connection.execute(query, tuple(values))
            nodes = tree_nodes(self.description().get("tree")) if is_condensed else ()
            yield from entries_of(rows, [each.parent for each in nodes] if is_condensed else None, log)

    @property
    def head(self) -> str:
        """The link of the last written entry, as hexadecimal digits."""
        return self._last_position().link.hex()

    def chain(self) -> JournalChain:
        """Check the hash chain of the journal.

        Raises:
            JournalError: If the file is damaged.
        """
        with self._limit_reading():
            # If an index differs from its table, queries that use the index return entries that the chain does not cover.
            (flaw,) = self._connection.execute("PRAGMA integrity_check(1)").fetchone()
            if flaw != "ok":
                raise ValueError(flaw)
            self._connection.text_factory = functools.partial(str, encoding="utf-8", errors="surrogateescape")
            try:
                return check_chain(chain_entries(self._connection))
            finally:
                self._connection.text_factory = str

    def spilled_count(self) -> int:
        """Return how many events are stored in the reserve file but not yet in the hash chain."""
        with self._limit_reading():
            counts = "SELECT (SELECT count(*) FROM fact) - (SELECT count(*) FROM main.fact)"
            return int(self._connection.execute(counts).fetchone()[0])

    def _last_position(self) -> ChainPosition:
        """Return the chain position that follows the last entry."""
        if self._end is None:
            with self._limit_reading():
                self._end = last_position(self._connection)
        return self._end

    def begin_run(self, about: Mapping[str, object], run_about: Mapping[str, object], wall: float) -> int:
        """Add a run, and return the number of the run. For the first run, also add the mission's description."""
        # The limit of steps is only needed for reading files that other programs may have written.
        self._connection.set_progress_handler(None, 0)
        position, text = self._last_position(), json_text(run_about)
        with self._transaction():
            (number,) = self._connection.execute("SELECT 1 + ifnull(max(number), 0) FROM run").fetchone()
            rows = [] if number > 1 else [(key, json_text(value)) for key, value in sorted(about.items())]
            self._connection.executemany("INSERT INTO about VALUES (?, ?)", rows)
            link = run_start_link(position, number, wall, text, rows)
            row = number, wall, text, link, position.number
            self._connection.execute(
                "INSERT INTO run (number, began, about, link, began_behind) VALUES (?, ?, ?, ?, ?)", row
            )
        self._end = ChainPosition(link, position.number)
        return int(number)

    def write(self, watched: Iterable[Row], facts: Sequence[Row] = (), end: RunEnd | None = None) -> None:
        """Write observations, events and a run's end.

        When this function returns, events and end are safe on disk.

        The function does not wait for locks. If another process has locked the file, or the file cannot be written, the function
        raises an error and writes no row.
        """
        link, number = self._last_position()
        added: dict[bytes, list[tuple[object, ...]]] = {FACT: [], WATCHED: []}
        for row, category in sorted([*((row, WATCHED) for row in watched), *((row, FACT) for row in facts)]):
            link, number = link_of_entry(link, category, *row), row.number
            added[category].append((*row, link))
        position = ChainPosition(link, number)
        with self._transaction(durable=bool(facts or end)):
            self._connection.executemany("INSERT INTO watched VALUES (?, ?, ?, ?, ?, ?, ?)", added[WATCHED])
            self._connection.executemany("INSERT INTO fact VALUES (?, ?, ?, ?, ?, ?, ?)", added[FACT])
            if end is not None:
                position = self._end_run(end, position)
        self._end = position

    def _end_run(self, end: RunEnd, position: ChainPosition) -> ChainPosition:
        """Write the end of a run, and return the chain position that follows it."""
        self._connection.execute(_END_OF_RUN, _end_of_run(end))
        link = run_end_link(position, end.run, end.wall, end.ending.value, end.status, end.reason)
        closing = "UPDATE run SET closed = ?, ended_behind = ? WHERE number = ?"
        self._connection.execute(closing, (link, position.number, end.run))
        return ChainPosition(link, position.number)

    @contextmanager
    def _transaction(self, *, durable: bool = True) -> Iterator[None]:
        # With NORMAL, a commit survives a crash of the process but not a power cut; SQLite syncs at its next checkpoint.
        if durable is not self._durable:
            self._connection.execute(f"PRAGMA synchronous = {'FULL' if durable else 'NORMAL'}")
            self._durable = durable
        self._connection.execute("BEGIN IMMEDIATE")
        try:
            yield
            self._connection.execute("COMMIT")
        except BaseException:
            with suppress(sqlite3.Error):
                self._connection.execute("ROLLBACK")
            raise

    def move(self, path: Path) -> None:
        """Close and rename the journal, with its reserve file and the files that SQLite has created beside it.

        Raises:
            JournalError: If the new name exists, or the file cannot be renamed.
        """
        with _convert_errors(path):
            if path.exists():
                raise FileExistsError(errno.EEXIST, os.strerror(errno.EEXIST))
            # Closing the database writes the write-ahead log into the file, unless another process is reading the file.
            self._connection.close()
            for ending in ("", *_SIDECARS):
                with suppress(FileNotFoundError):
                    Path(f"{self.path}{ending}").rename(f"{path}{ending}")
            _sync_folder(path.parent)
            self.close()

    def remove(self) -> None:
        """Close and delete the journal, with its reserve file and the files that SQLite has created beside it."""
        with self._limit_reading():
            self._connection.close()
            for ending in ("", *_SIDECARS):
                Path(f"{self.path}{ending}").unlink(missing_ok=True)
            self.close()

    def close(self) -> None:
        """Close the journal, and release the lock of the file."""
        with suppress(sqlite3.Error):
            self._connection.close()
        # The lock is released last, because closing any descriptor of the file releases SQLite's locks.
        if self._lock is not None:
            os.close(self._lock)
            self._lock = None


def is_locked(path: Path) -> bool:
    """Return whether another process is writing to a journal."""
    import fcntl

    try:
        descriptor = os.open(path, os.O_RDONLY | os.O_NONBLOCK)
    except OSError:
        return False
    try:
        fcntl.flock(descriptor, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except OSError:
        return True
    finally:
        os.close(descriptor)
    return False


def _is_used(path: Path) -> bool:
    """Return whether a process may be writing to the journal, judging by its lock and write-ahead log."""
    for _ in range(_ATTEMPTS):
        if Path(f"{path}-wal").exists():
            return True
        if not is_locked(path):
            return False
        time.sleep(_RETRY_SEC)
    return True


def _open_locked(path: Path) -> int:
    """Open or create a file, and lock it until the process ends."""
    # Without `O_NONBLOCK`, opening a pipe without a reader would block forever.
    descriptor = os.open(path, os.O_RDWR | os.O_NONBLOCK | os.O_CREAT, 0o644)
    try:
        require_regular_mode(os.fstat(descriptor).st_mode)
        _lock_exclusively(descriptor)
    except BlockingIOError:
        os.close(descriptor)
        message = f"{path} is the journal of a mission that runs in another process. Stop the mission, or wait until it ends"
        raise JournalError(message) from None
    except BaseException:
        os.close(descriptor)
        raise
    return descriptor


def _lock_exclusively(descriptor: int) -> None:
    """Lock a file. Retry if this fails, because another process may only be testing the lock."""
    import fcntl

    for left in reversed(range(_ATTEMPTS)):
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:  # noqa: PERF203 - ten times at most
            if not left:
                raise
            time.sleep(_RETRY_SEC)
        else:
            return


@functools.cache
def _schema_definitions() -> frozenset[str]:
    """Return the SQL definitions of all schema objects in a journal.

    Files with other schema objects are refused.
    """
    with closing(sqlite3.connect(":memory:")) as empty:
        empty.executescript(_CREATE_SCHEMA)
        return frozenset(text for (text,) in empty.execute("SELECT sql FROM sqlite_master"))


def _end_of_run(end: RunEnd) -> tuple[object, ...]:
    return end.wall, end.ending.value, end.status, end.reason, end.run


def _placeholders(values: Sequence[str]) -> str:
    """Return one SQL placeholder for each value, separated by commas."""
    return ", ".join("?" * len(values))


def _size(path: str | Path) -> int:
    with suppress(OSError):
        return os.stat(path).st_size  # noqa: PTH116 - the path may be a string
    return 0


def _start(run: JournalRun) -> float:
    """Return the time of the mission's clock at the start of a run in seconds, or 0 if it is unknown."""
    began = run.about.get("time")
    return float(began) if isinstance(began, (int, float)) else 0.0


def _sync_folder(folder: Path) -> None:
    """Write a folder to disk, so that the names of the files in it survive a power cut."""
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


class _QueryBudget:
    """A limit on the number of steps that SQLite may take for one read.

    A malicious file could make a read endless.

    Args:
        steps: The maximum number of SQLite's steps in one read.
    """

    STRIDE = 10_000

    def __init__(self, steps: int) -> None:
        self._steps = self._left = steps

    def begin(self) -> None:
        """Start to count the steps of a new read."""
        self._left = self._steps

    def is_over(self) -> bool:
        """Return whether SQLite must abort the read. SQLite calls this progress handler every `STRIDE` steps."""
        self._left -= self.STRIDE
        return self._left < 0

    @property
    def was_interrupted(self) -> bool:
        """Whether the read was aborted for a reason other than the limit, such as Ctrl-C."""
        return self._left >= 0


def _connect(target: str | Path, **options: Any) -> sqlite3.Connection:
    # Only explicit statements start and end transactions. The timeout is long enough, because readers block the file only briefly.
    connection: sqlite3.Connection = sqlite3.connect(target, timeout=5.0, isolation_level=None, **options)
    connection.execute("PRAGMA trusted_schema = OFF")
    connection.execute("PRAGMA cell_size_check = ON")
    return connection


@contextmanager
def _convert_errors(path: Path) -> Iterator[None]:
    """Convert errors that SQLite, the file system or damaged content cause to a `JournalError`."""
    try:
        yield
    except UnreadableFileError as error:
        name = "" if error.path == path else f"{error.path.name}: "
        hint = f". Journals are in {state_folder()}" if isinstance(error, MissingFileError) else ""
        raise JournalPlaceError(f"the journal {path} cannot be used: {name}{error.reason}{hint}") from error
    except OSError as error:
        raise JournalPlaceError(f"the journal {path} cannot be used: {error.strerror or error}") from error
    except (sqlite3.Error, sqlite3.Warning, ValueError, TypeError, OverflowError, RecursionError) as error:
        message = f"the journal {path} cannot be used: {error}. It may be damaged, or not a journal"
        raise JournalError(message) from error
