"""Read Nav2's `behavior_tree_log` from a rosbag2 bag (`.mcap`, `.db3`), without ROS.

Each message of the type `nav2_msgs/msg/BehaviorTreeLog` contains the status changes since the message before. Each change has a time, the node's name and
number, and the statuses before and after it. The bag does not contain the tree.

Nav2 publishes a message after each tick that leaves the tree running. The changes of the tick in which a tree ends, and those of a halt, are therefore in
the first message of the next goal. If a leaf wakes the tree up, a message contains several ticks.
"""

import os
import sqlite3
import struct
from bisect import insort
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

from sar_compiler.importing.recording import IDLE, RUNNING, WORDS, Recording, UnusableRecordingError
from sar_compiler.nodes.nav2.log_lines import LoggedLine, goal_end
from sar_compiler.opener import regular_file

MCAP_MAGIC = b"\x89MCAP0\r\n"
_TYPE = "nav2_msgs/msg/BehaviorTreeLog"
_LOG = "rcl_interfaces/msg/Log"
_WARNING, _ERROR = 30, 40
# The number of the root.
_ROOT = 1
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
    reader = TreeLogReader(form)
    for kind, data in messages:
        (reader.add if kind == _TYPE else reader.add_line)(data)
    if not reader.recording.times and reader.has_goal_end:
        raise UnusableRecordingError(
            "the bag contains the end of a goal, but no status changes. Nav2 publishes the last tick of a goal only when the next "
            "goal starts: record until the tree has started again"
        )
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
        self._number, self._first = 0, -1
        # The lines that were logged before the first change, with their levels; their times are in seconds since 1970.
        self._early: list[tuple[int, LoggedLine]] = []

    @property
    def has_goal_end(self) -> bool:
        """Whether Nav2 has logged the end of a goal."""
        return bool(self.recording.goal_ends) or any(goal_end(line.who, line.text) for _, line in self._early)

    def add_line(self, data: bytes) -> None:
        """Add the line in a message of `/rosout` if it is a warning or an error, or reports the end of a goal."""
        found = _logged_line(data)
        if found is None or len(self.recording.lines) + len(self._early) >= _MOST_LINES:
            return
        if self._first < 0:
            self._early.append(found)
        else:
            self._add_line(*found)

    def _add_line(self, level: int, line: LoggedLine) -> None:
        recording = self.recording
        line = line._replace(at=line.at - recording.began)
        if level >= _WARNING:
            insort(recording.lines, line)
        if (end := goal_end(line.who, line.text)) is not None:
            insort(recording.goal_ends, (line.at, end), key=lambda each: each[0])

    def add(self, data: bytes) -> None:
        """Add the status changes in a message. A tick never continues in the next message."""
        self._number += 1
        found = self.recording
        try:
            changes = [*_changes(data)]
            if self._first < 0:
                changes = changes[_end_of_earlier_run(changes) :]
        except (ValueError, struct.error, IndexError):
            found.flaws.append(f"message {self._number} of the type {_TYPE} is damaged and was skipped")
            return
        if self._first < 0 and changes and all(uid != _ROOT for _, _, uid, _ in changes):
            found.flaws.append(
                "the recording begins in the middle of a run, so the first run is not a possible run of the whole tree"
            )
        for time, name, uid, status in changes:
            if self._first < 0:
                self._first, found.began = time, time / 1e6
                for line in self._early:
                    self._add_line(*line)
                self._early.clear()
            found.add(time - self._first, uid, status)
            found.messages.append(self._number)
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


def _end_of_earlier_run(changes: Sequence[tuple[int, str, int, int]]) -> int:
    """Return the number of changes, at the start of the first message, that belong to the end of an earlier run.

    Only this end of the earlier run is known, so it is left out.
    """
    begun = next((i for i, (_, _, uid, status) in enumerate(changes) if (uid, status) == (_ROOT, RUNNING)), 0)
    rested = [i for i, (_, _, uid, status) in enumerate(changes[:begun]) if (uid, status) == (_ROOT, IDLE)]
    if not rested:
        return 0
    behind = rested[-1] + 1
    while changes[behind][3] == IDLE:
        behind += 1
    return behind


def _logged_line(data: bytes) -> tuple[int, LoggedLine] | None:
    """Return the level and the line in a message of `/rosout`, or None for other messages.

    Lines below the level of a warning are only returned if they report the end of a goal.

    The time of the line is in seconds since 1970.
    """
    try:
        values = _Decoder(data)
        time = values.next_integer("i") + values.next_integer("I") / 1e9
        level, name, text = values.next_integer("B"), values.next_string(), values.next_string()
    except (ValueError, struct.error, IndexError):
        return None
    is_wanted = level >= _WARNING or goal_end(name, text) is not None
    return (level, LoggedLine(time, name, text, level >= _ERROR)) if is_wanted else None
