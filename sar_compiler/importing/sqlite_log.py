"""Read the logs of BehaviorTree.CPP's `SqliteLogger` (`.db3`, `.btdb`).

A log has two tables. `Definitions` has the columns `session_id`, `date` and `xml_tree`, the tree as in `FileLogger2`. `Transitions` has the columns
`timestamp` in microseconds since 1970, `session_id`, `node_uid` and `state`. If a log has several sessions, the last session is read.
"""

import sqlite3
from contextlib import closing
from pathlib import Path

from sar_compiler.importing.bag import read_db3
from sar_compiler.importing.recording import IDLE, SKIPPED, Recording, UnusableRecordingError
from sar_compiler.opener import open_by_name, regular_file, release_pipes

MAGIC = b"SQLite format 3\0"
_TREE = "SELECT session_id, xml_tree FROM Definitions ORDER BY session_id DESC LIMIT 1"
_CHANGES = "SELECT timestamp, node_uid, state FROM Transitions WHERE session_id = ? ORDER BY timestamp"
_LATEST_USEC, _MOST_NODES = 2**53, 0xFFFF
# The limit of SQLite's virtual machine steps for each byte of the file is about twenty times the number that valid logs need. It is checked after
# every `_STRIDE` steps.
_STRIDE, _STEPS_OF_A_BYTE = 10_000, 20


def read_sqlite_log(path: Path) -> Recording:
    """Read a log of SqliteLogger, or a rosbag2 bag in SQLite format.

    Raises:
        UnusableRecordingError: If the log or bag is damaged, or contains no run.
        UnreadableFileError: If the file cannot be read.
    """
    uri = f"{path.absolute().as_uri()}?mode=ro&immutable=1"
    with release_pipes(path), regular_file(path) as checked:
        connection = open_by_name(path, checked, lambda: sqlite3.connect(uri, uri=True))
    with closing(connection):
        left = [path.stat().st_size * _STEPS_OF_A_BYTE + 100 * _STRIDE]

        def is_over() -> bool:
            left[0] -= _STRIDE
            return left[0] < 0

        connection.set_progress_handler(is_over, _STRIDE)
        connection.execute("PRAGMA trusted_schema = OFF")
        try:
            tables = {name for (name,) in connection.execute("SELECT name FROM sqlite_master")}
            return read_db3(connection) if {"messages", "topics"} <= tables else _read(connection)
        except (sqlite3.Error, OverflowError, UnicodeDecodeError) as error:
            raise UnusableRecordingError(f"the file is not a log of SqliteLogger: {error}") from error


def _read(connection: sqlite3.Connection) -> Recording:
    session, tree = connection.execute(_TREE).fetchone() or (None, "")
    if not isinstance(tree, str) or not tree:
        raise UnusableRecordingError("the table Definitions contains no tree")
    found = Recording("SqliteLogger", 0.0, tree)
    first: int | None = None
    for row, (time, uid, status) in enumerate(connection.execute(_CHANGES, (session,)), 1):
        is_number = all(isinstance(each, int) for each in (time, uid, status))
        if not (
            is_number and 0 <= time < _LATEST_USEC and 0 < uid <= _MOST_NODES and IDLE <= status <= SKIPPED
        ):
            found.flaws.append(f"row {row} of Transitions is not a status change. The rest was skipped")
            break
        first = time if first is None else first
        found.add(time - first, uid, status)
    found.began = (first or 0) / 1e6
    return found
