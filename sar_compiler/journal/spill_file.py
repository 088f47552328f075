"""Defines the reserve file of a journal.

It has a fixed size, and stores events while the journal cannot be written.

The blocks of the file are allocated when a run starts, and later only overwritten. A full disk, a quota or a lock on the database
therefore does not affect the file. It has two slots with checksums, which are written in turn. A process that dies while
writing one slot leaves the other slot intact. A slot contains all waiting events. If they do not fit, it contains the number of
omitted events, and the highest numbers in use (`Journal.store_highest_number`).
"""

import json
import os
import zlib
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple

from sar_compiler.journal.errors import JournalError
from sar_compiler.journal.journal_entries import FACTS_LOST, Ending, Row
from sar_compiler.opener import RESERVE, MissingFileError, NamedPath, read_file, require_regular_mode

SUFFIX = "-reserve"

_SLOT_BYTES = 64 * 1024
# The size of a slot's head: checksum, length and sequence number of the content, in decimal digits.
_HEAD_BYTES = 40


class RunEnd(NamedTuple):
    """The end of a run: the time in seconds since 1970, the kind of end, the exit status and the reason."""

    run: int
    wall: float
    ending: Ending
    status: int
    reason: str


class SpilledEntries(NamedTuple):
    """The content of a reserve file.

    Attributes:
        began: The start of the journal's first run, in seconds since 1970, which identifies the journal.
        facts: The waiting events.
        end: The end of the run, if it is not in the journal yet; otherwise None.
    """

    began: float = 0.0
    facts: Sequence[Row] = ()
    end: RunEnd | None = None


def lost_events_row(rows: Sequence[Row], numbers: Mapping[str, int]) -> Row:
    """Return an event that replaces lost events: their count, and the highest numbers in use."""
    count = sum(json.loads(row.data)["count"] if row.kind == FACTS_LOST else 1 for row in rows)
    return rows[-1]._replace(kind=FACTS_LOST, data=json.dumps({"count": count, "numbers": dict(numbers)}))


class SpillFile:
    """An open reserve file. If the file is missing, it is created and all of its blocks are allocated.

    Args:
        journal: The path of the journal.

    Raises:
        OSError: If the file cannot be created.
    """

    def __init__(self, journal: Path) -> None:
        self.path = Path(f"{journal}{SUFFIX}")
        self._descriptor = _open_file(self.path, os.O_RDWR | os.O_CREAT)
        try:
            self._sequence_number = max(
                (number for number, _ in _slots(_content(self._descriptor))), default=0
            )
            self._fill()
        except BaseException:
            os.close(self._descriptor)
            raise

    def _fill(self) -> None:
        # The blocks are really written. Blocks that are only reserved may still need space at their first write.
        size = os.fstat(self._descriptor).st_size
        _write(self._descriptor, b"\0" * max(0, 2 * _SLOT_BYTES - size), size)

    def replace_content(self, spilled: SpilledEntries, numbers: Mapping[str, int]) -> None:
        """Replace the content of the reserve file. The new content is on disk when this function returns.

        Args:
            spilled: The new content; events that do not fit are replaced by one event that states how many
                were replaced.
            numbers: The highest numbers in use, by the kind of the numbered objects.

        Raises:
            OSError: If the file cannot be written.
        """
        content = _fit_into_slot(spilled, numbers).encode()
        self._sequence_number += 1
        body = f"{len(content):10}{self._sequence_number:20}".encode() + content
        _write(
            self._descriptor,
            f"{zlib.crc32(body):10}".encode() + body,
            self._sequence_number % 2 * _SLOT_BYTES,
        )

    def close(self, *, is_needed: bool) -> None:
        """Close the reserve file. Delete the file if it is no longer needed."""
        os.close(self._descriptor)
        if not is_needed:
            with suppress(OSError):
                self.path.unlink()


def read_reserve(journal: Path) -> SpilledEntries:
    """Return the content of a journal's reserve file, which is empty if there is no such file.

    Raises:
        OSError: If the reserve file cannot be read.
        JournalError: If the reserve file is damaged.
    """
    path = Path(f"{journal}{SUFFIX}")
    try:
        # Links are not followed, because error messages would show the content of their targets.
        content = read_file(NamedPath.confined_to(path, [path.parent.resolve()]), RESERVE).data
    except MissingFileError:
        return SpilledEntries()
    slots = _slots(content[: 2 * _SLOT_BYTES])
    try:
        if not slots:
            raise ValueError("no slot is intact")  # noqa: TRY301 - the message about all kinds of damage is below
        return _parse_content(max(slots)[1])
    except (ValueError, TypeError, KeyError, RecursionError) as error:
        message = f"{path} is damaged ({error}). This file contains the last events of the journal in the same folder. Move the file away to continue without these events"
        raise JournalError(message) from error


def _open_file(path: Path, flags: int) -> int:
    descriptor = os.open(path, flags | os.O_NONBLOCK | os.O_NOFOLLOW, 0o644)
    try:
        require_regular_mode(os.fstat(descriptor).st_mode)
    except OSError:
        os.close(descriptor)
        raise
    return descriptor


def _content(descriptor: int) -> bytes:
    return os.pread(descriptor, 2 * _SLOT_BYTES, 0)


def _write(descriptor: int, content: bytes, offset: int) -> None:
    while content:
        written = os.pwrite(descriptor, content, offset)
        content, offset = content[written:], offset + written
    os.fsync(descriptor)


def _slots(content: bytes) -> list[tuple[int, bytes]]:
    """Return the sequence number and the content of each intact slot, including empty slots."""
    found = []
    for slot in (content[:_SLOT_BYTES], content[_SLOT_BYTES:]):
        if not slot.strip(b"\0"):
            found.append((0, b""))
        with suppress(ValueError):
            checksum, length, number = int(slot[:10]), int(slot[10:20]), int(slot[20:_HEAD_BYTES])
            if zlib.crc32(slot[10 : _HEAD_BYTES + length]) == checksum:
                found.append((number, slot[_HEAD_BYTES : _HEAD_BYTES + length]))
    return found


def _fit_into_slot(spilled: SpilledEntries, numbers: Mapping[str, int]) -> str:
    """Convert the content to text that fits into a slot.

    If the text is too long, one event replaces the last events.
    """
    count = len(spilled.facts)
    while True:
        facts = [
            *spilled.facts[:count],
            *([lost_events_row(spilled.facts[count:], numbers)] if spilled.facts[count:] else []),
        ]
        text = json.dumps({"began": spilled.began, "facts": facts, "end": spilled.end})
        if len(text) <= _SLOT_BYTES - _HEAD_BYTES:
            return text
        if not count:
            raise OSError(f"the record of the run's end is too long for the reserve file: {spilled.end}")
        count = count * 3 // 4


def _parse_content(content: bytes) -> SpilledEntries:
    if not content:
        return SpilledEntries()
    data = json.loads(content)
    end: Any = data["end"]
    return SpilledEntries(
        float(data["began"]),
        [_row(*fact) for fact in data["facts"]],
        None if end is None else RunEnd(int(end[0]), float(end[1]), Ending(end[2]), int(end[3]), str(end[4])),
    )


def _row(number: Any, run: Any, wall: Any, time: Any, kind: Any, data: Any) -> Row:
    return Row(int(number), int(run), float(wall), float(time), str(kind), str(data))
