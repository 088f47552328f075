"""Follow the journal of a mission in another process."""

from pathlib import Path

from sar_compiler.journal.database import JournalFile, ReadCursor
from sar_compiler.journal.errors import JournalError
from sar_compiler.journal.journal_entries import JournalEntry

# While a mission starts or ends, the file may be unreadable for a moment. An error is raised after this many failures
# in a row.
_TRIES = 4


class JournalFollower:
    """Reads the new entries of a journal, which need not exist yet.

    Args:
        path: Its present or future path.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._mark = ReadCursor()
        self._began: float | None = None
        self._failed = 0

    def read_new(self) -> list[JournalEntry]:
        """Return the entries since the last call, or all entries if a different mission has started in the file.

        Raises:
            JournalError: If it is no journal or is unreadable, in several calls in a row.
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
