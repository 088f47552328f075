"""Read Nav2's `behavior_tree_log` from a rosbag2 bag (`.mcap`, `.db3`), without ROS.

Each message is of `nav2_msgs/msg/BehaviorTreeLog`: the changes of one tick, each with its time, the node's name and number, and both statuses. The bag does
not contain the tree.
"""

import os
import sqlite3
import struct
from collections.abc import Iterable, Iterator
from pathlib import Path

from sar_compiler.importing.recording import WORDS, Recording, UnusableRecordingError
from sar_compiler.opener import regular_file

MCAP_MAGIC = b"\x89MCAP0\r\n"
_TYPE = "nav2_msgs/msg/BehaviorTreeLog"
_MESSAGES = "SELECT data FROM messages JOIN topics ON messages.topic_id = topics.id WHERE topics.type = ? ORDER BY messages.timestamp"
_MOST_BYTES = 16 * 2**20


def read_mcap(path: Path) -> Recording:
    """Read a bag in MCAP format.

    Raises:
        UnusableRecordingError: If it cannot be used.
    """
    from mcap.exceptions import McapError
    from mcap.reader import NonSeekingReader

    def messages(descriptor: int) -> Iterator[bytes]:
        with os.fdopen(os.dup(descriptor), "rb") as stream:
            # In the order of the file, which a recorder that has crashed has left without an index.
            reader = NonSeekingReader(stream, record_size_limit=_MOST_BYTES)
            for schema, _, message in reader.iter_messages(log_time_order=False):
                if schema is not None and schema.name == _TYPE:
                    yield message.data

    with regular_file(path) as descriptor:
        try:
            return _read(messages(descriptor), "mcap")
        except (McapError, EOFError, ValueError, struct.error) as error:
            raise UnusableRecordingError(f"the bag is damaged: {error}") from error


def read_db3(connection: sqlite3.Connection) -> Recording:
    """Read a bag in SQLite format.

    Raises:
        UnusableRecordingError: If it cannot be used.
        sqlite3.Error: If it is damaged.
    """
    rows = connection.execute(_MESSAGES, (_TYPE,))
    return _read((data for (data,) in rows if isinstance(data, bytes)), "rosbag2")


def _read(messages: Iterable[bytes], form: str) -> Recording:
    reader = TreeLogReader(form)
    for data in messages:
        reader.add(data)
    if not reader.recording.times:
        raise UnusableRecordingError(f"it has no message of {_TYPE}. Record the topic behavior_tree_log")
    return reader.recording


class TreeLogReader:
    """Reads the messages of a `behavior_tree_log`.

    Args:
        form: The name of the format.

    Attributes:
        recording: The run.
    """

    def __init__(self, form: str) -> None:
        self.recording = Recording(form, 0.0)
        self._tick, self._first = 0, -1

    def add(self, data: bytes) -> None:
        """Add the changes of a message, which are one tick."""
        self._tick += 1
        found = self.recording
        try:
            changes = [*_changes(data)]
        except (ValueError, struct.error, IndexError):
            found.flaws.append(f"message {self._tick} of {_TYPE} is damaged. It is left out")
            return
        for time, name, uid, status in changes:
            if self._first < 0:
                self._first, found.began = time, time / 1e6
            found.add(time - self._first, uid, status)
            found.ticks.append(self._tick)
            found.names.setdefault(uid, name)


def _changes(data: bytes) -> Iterator[tuple[int, str, int, int]]:
    """Yield the status changes in a message: time in microseconds since 1970, name, number and status."""
    order = "<" if data[1] & 1 else ">"
    at = 4

    def number(form: str, size: int) -> int:
        nonlocal at
        at += -(at - 4) % size
        (value,) = struct.unpack_from(order + form, data, at)
        at += size
        return int(value)

    def cell_text() -> str:
        nonlocal at
        length = number("I", 4)
        at += length
        if at > len(data):
            raise ValueError("a string is longer than the message")
        return data[at - length : at - 1].decode()

    number("i", 4)
    number("I", 4)
    for _ in range(number("I", 4)):
        time = number("i", 4) * 1_000_000 + number("I", 4) // 1000
        name, uid = cell_text(), number("H", 2)
        cell_text()
        yield time, name, uid, WORDS.index(cell_text())
