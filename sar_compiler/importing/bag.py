"""Read Nav2's `behavior_tree_log` from a rosbag2 bag (`.mcap`, `.db3`), without ROS.

Each message of the type `nav2_msgs/msg/BehaviorTreeLog` contains the status changes of one tick. Each change has a time, the node's name and number, and
the statuses before and after it. The bag does not contain the tree.
"""

import os
import sqlite3
import struct
from collections.abc import Iterable, Iterator
from pathlib import Path

from sar_compiler.importing.recording import WORDS, Recording, UnusableRecordingError
from sar_compiler.nodes.nav2.log_lines import LoggedLine
from sar_compiler.opener import regular_file

MCAP_MAGIC = b"\x89MCAP0\r\n"
_TYPE = "nav2_msgs/msg/BehaviorTreeLog"
_LOG = "rcl_interfaces/msg/Log"
_WARNING, _ERROR = 30, 40
_MOST_LINES = 100_000
_MESSAGES = "SELECT topics.type, data FROM messages JOIN topics ON messages.topic_id = topics.id WHERE topics.type IN (?, ?) ORDER BY messages.timestamp"
_MOST_BYTES = 16 * 2**20


def read_mcap(path: Path) -> Recording:
    """Read a bag in MCAP format.

    Raises:
        UnusableRecordingError: If the bag is damaged or has no messages of the type.
    """
    from mcap.exceptions import McapError
    from mcap.reader import NonSeekingReader

    def messages(descriptor: int) -> Iterator[tuple[str, bytes]]:
        with os.fdopen(os.dup(descriptor), "rb") as stream:
            # Read in file order, because the file of a crashed recorder has no index.
            reader = NonSeekingReader(stream, record_size_limit=_MOST_BYTES)
            for schema, _, message in reader.iter_messages(log_time_order=False):
                if schema is not None and schema.name in (_TYPE, _LOG):
                    yield schema.name, message.data

    with regular_file(path) as descriptor:
        try:
            return _read(messages(descriptor), "mcap")
        except (McapError, EOFError, ValueError, struct.error) as error:
            raise UnusableRecordingError(f"the bag is damaged: {error}") from error


def read_db3(connection: sqlite3.Connection) -> Recording:
    """Read a bag in SQLite format.

    Raises:
        UnusableRecordingError: If the bag has no messages of the type.
        sqlite3.Error: If the bag is damaged.
    """
    rows = connection.execute(_MESSAGES, (_TYPE, _LOG))
    return _read(((kind, data) for kind, data in rows if isinstance(data, bytes)), "rosbag2")


def _read(messages: Iterable[tuple[str, bytes]], form: str) -> Recording:
    reader, lines = TreeLogReader(form), list[LoggedLine]()
    for kind, data in messages:
        if kind == _TYPE:
            reader.add(data)
        elif len(lines) < _MOST_LINES and (line := _logged_line(data)) is not None:
            lines.append(line)
    began = reader.recording.began
    reader.recording.lines = sorted(line._replace(at=line.at - began) for line in lines)
    if not reader.recording.times:
        raise UnusableRecordingError(
            f"the bag has no messages of the type {_TYPE}. Record the topic behavior_tree_log"
        )
    return reader.recording


class TreeLogReader:
    """Collects a run from messages of `behavior_tree_log`.

    Args:
        form: The name of the recording's format.

    Attributes:
        recording: The run so far.
    """

    def __init__(self, form: str) -> None:
        self.recording = Recording(form, 0.0)
        self._tick, self._first = 0, -1

    def add(self, data: bytes) -> None:
        """Add the status changes in a message. All changes in a message belong to the same tick."""
        self._tick += 1
        found = self.recording
        try:
            changes = [*_changes(data)]
        except (ValueError, struct.error, IndexError):
            found.flaws.append(f"message {self._tick} of the type {_TYPE} is damaged and was skipped")
            return
        for time, name, uid, status in changes:
            if self._first < 0:
                self._first, found.began = time, time / 1e6
            found.add(time - self._first, uid, status)
            found.ticks.append(self._tick)
            found.names.setdefault(uid, name)


class _Decoder:
    """Reads the values of a CDR-encoded message in order."""

    def __init__(self, data: bytes) -> None:
        self._data, self._order, self._at = data, "<" if data[1] & 1 else ">", 4

    def next_integer(self, form: str) -> int:
        """Read the next integer. Its size and sign are given by a format character of the `struct` module."""
        size = struct.calcsize(form)
        self._at += -(self._at - 4) % size
        (value,) = struct.unpack_from(self._order + form, self._data, self._at)
        self._at += size
        return int(value)

    def next_string(self) -> str:
        """Return the next string."""
        length = self.next_integer("I")
        self._at += length
        if self._at > len(self._data):
            raise ValueError("a string is longer than the message")
        return self._data[self._at - length : self._at - 1].decode()


def _changes(data: bytes) -> Iterator[tuple[int, str, int, int]]:
    """Yield the status changes in a message: time in microseconds since 1970, name, number and status."""
    values = _Decoder(data)
    values.next_integer("i")
    values.next_integer("I")
    for _ in range(values.next_integer("I")):
        time = values.next_integer("i") * 1_000_000 + values.next_integer("I") // 1000
        name, uid = values.next_string(), values.next_integer("H")
        values.next_string()
        yield time, name, uid, WORDS.index(values.next_string())


def _logged_line(data: bytes) -> LoggedLine | None:
    """Return the warning or error in a message of `/rosout`, or None for any other message.

    The time of the returned line is in seconds since 1970.
    """
    try:
        values = _Decoder(data)
        time = values.next_integer("i") + values.next_integer("I") / 1e9
        level, name, text = values.next_integer("B"), values.next_string(), values.next_string()
    except (ValueError, struct.error, IndexError):
        return None
    return LoggedLine(time, name, text, level >= _ERROR) if level >= _WARNING else None
