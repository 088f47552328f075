"""The reserve of a journal: a file of fixed size beside it, for facts that the journal's own file cannot take now.

Its blocks are made when a run begins, and afterwards only overwritten: a full disk, a quota or a lock on the database does not
keep facts from it. It has two slots, which are written in turn and have checksums, so that whoever dies in the middle of one
leaves the other. A slot has all facts that wait; where they do not fit, how many more there were, and the numbers that were given.
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
# Checksum, length, and number of the writing, in decimal digits.
_HEAD_BYTES = 40


class RunEnd(NamedTuple):
    """How a run has ended: when, in seconds since 1970, how, with which exit status, and why."""

    run: int
    wall: float
    ending: Ending
    status: int
    reason: str


class Kept(NamedTuple):
    """The content of a reserve.

    Attributes:
        began: When the journal's first run began, in seconds since 1970: another journal's reserve has another one.
        facts: The facts.
        end: How the run has ended, if it has, and that could not be written either.
    """

    began: float = 0.0
    facts: Sequence[Row] = ()
    end: RunEnd | None = None


def lost(rows: Sequence[Row], numbers: Mapping[str, int]) -> Row:
    """Return the fact that stands for lost facts: how many there were, and the numbers given until then."""
    count = sum(json.loads(row.data)["count"] if row.kind == FACTS_LOST else 1 for row in rows)
    return rows[-1]._replace(kind=FACTS_LOST, data=json.dumps({"count": count, "numbers": dict(numbers)}))


class Reserve:
    """An open reserve; it is made, with all of its blocks, if it is not there.

    Args:
        journal: Where the journal is.

    Raises:
        OSError: If it cannot be made.
    """

    def __init__(self, journal: Path) -> None:
        self.path = Path(f"{journal}{SUFFIX}")
        self._descriptor = _opened(self.path, os.O_RDWR | os.O_CREAT)
        try:
            self._writing = max((number for number, _ in _slots(_content(self._descriptor))), default=0)
            self._fill()
        except BaseException:
            os.close(self._descriptor)
            raise

    def _fill(self) -> None:
        # What is only allocated may still need room when it is written first.
        size = os.fstat(self._descriptor).st_size
        _write(self._descriptor, b"\0" * max(0, 2 * _SLOT_BYTES - size), size)

    def keep(self, kept: Kept, numbers: Mapping[str, int]) -> None:
        """Write what is to be kept, in place of what it has; it is on the disk when this returns.

        Args:
            kept: What is to be kept; of facts that do not fit, a fact says how many there are.
            numbers: The numbers that were given, by what they are of.

        Raises:
            OSError: If it cannot be written.
        """
        content = _fitting(kept, numbers).encode()
        self._writing += 1
        body = f"{len(content):10}{self._writing:20}".encode() + content
        _write(self._descriptor, f"{zlib.crc32(body):10}".encode() + body, self._writing % 2 * _SLOT_BYTES)

    def close(self, *, is_needed: bool) -> None:
        """Close it; one that is not needed is removed."""
        os.close(self._descriptor)
        if not is_needed:
            with suppress(OSError):
                self.path.unlink()


def read_reserve(journal: Path) -> Kept:
    """Return what the reserve of a journal has; nothing, if there is none.

    Raises:
        OSError: If it cannot be read.
        JournalError: If it is damaged.
    """
    path = Path(f"{journal}{SUFFIX}")
    try:
        # No link to elsewhere: what is wrong with its content is shown.
        content = read_file(NamedPath.within(path, [path.parent.resolve()]), RESERVE).data
    except MissingFileError:
        return Kept()
    slots = _slots(content[: 2 * _SLOT_BYTES])
    try:
        if not slots:
            raise ValueError("no part of it is whole")  # noqa: TRY301 - the words are below, for all that can be wrong
        return _kept(max(slots)[1])
    except (ValueError, TypeError, KeyError, RecursionError) as error:
        message = f"{path} is damaged ({error}): it has the last facts of the journal beside it; move it away to go without them"
        raise JournalError(message) from error


def _opened(path: Path, flags: int) -> int:
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
    """Return the slots that are whole, also those with nothing yet: the number of the writing, and what was written."""
    found = []
    for slot in (content[:_SLOT_BYTES], content[_SLOT_BYTES:]):
        if not slot.strip(b"\0"):
            found.append((0, b""))
        with suppress(ValueError):
            checksum, length, number = int(slot[:10]), int(slot[10:20]), int(slot[20:_HEAD_BYTES])
            if zlib.crc32(slot[10 : _HEAD_BYTES + length]) == checksum:
                found.append((number, slot[_HEAD_BYTES : _HEAD_BYTES + length]))
    return found


def _fitting(kept: Kept, numbers: Mapping[str, int]) -> str:
    """Return what is to be kept as text of a slot's size at most."""
    count = len(kept.facts)
    while True:
        facts = [*kept.facts[:count], *([lost(kept.facts[count:], numbers)] if kept.facts[count:] else [])]
        text = json.dumps({"began": kept.began, "facts": facts, "end": kept.end})
        if len(text) <= _SLOT_BYTES - _HEAD_BYTES:
            return text
        if not count:
            raise OSError(f"an end of a run does not fit: {kept.end}")
        count = count * 3 // 4


def _kept(content: bytes) -> Kept:
    if not content:
        return Kept()
    data = json.loads(content)
    end: Any = data["end"]
    return Kept(
        float(data["began"]),
        [_row(*fact) for fact in data["facts"]],
        None if end is None else RunEnd(int(end[0]), float(end[1]), Ending(end[2]), int(end[3]), str(end[4])),
    )


def _row(number: Any, run: Any, wall: Any, time: Any, kind: Any, data: Any) -> Row:
    return Row(int(number), int(run), float(wall), float(time), str(kind), str(data))
