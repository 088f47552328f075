"""Follows the growing journal of a mission that runs in another process."""

from pathlib import Path

from sar_compiler.journal.database import JournalFile, ReadCursor
from sar_compiler.journal.errors import JournalError
from sar_compiler.journal.journal_entries import JournalEntry

# The number of consecutive failures after which an error is raised. While a mission starts or ends, the file may be
# unreadable for a moment.
_TRIES = 4


class JournalFollower:
    """Reads the new entries of a journal. The file of the journal need not exist yet.

    Args:
        path: The path of the journal.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._mark = ReadCursor()
        self._began: float | None = None
        self._failed = 0

    def read_new(self) -> list[JournalEntry]:
        """Return the entries since the last call, or all entries if another mission has started in the file.

        Raises:
            JournalError: If the file is unreadable or not a journal in several consecutive calls.
        """
        try:
            entries = self._read_new()
        except JournalError:
            self._failed += 1
            if self._failed == _TRIES:
                raise
            return []
        self._failed = 0
        return entries

    def _read_new(self) -> list[JournalEntry]:
        try:
            # A file that is being created is empty for a moment.
            if not self.path.stat().st_size:
                return []
        except FileNotFoundError:
            return []
        with JournalFile.open_snapshot(self.path) as file:
            began = next((run.began for run in file.runs()), None)
            entries, mark = file.read_new(self._mark if began == self._began else ReadCursor())
        self._began, self._mark = began, mark
        return entries
