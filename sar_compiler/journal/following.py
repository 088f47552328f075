"""Following of the journal that a mission in another process writes."""

from pathlib import Path

from sar_compiler.journal.database import JournalFile, StreamMark
from sar_compiler.journal.errors import JournalError
from sar_compiler.journal.journal_entries import JournalEntry

# While a mission begins or ends a file may be none for a moment: so often in a row it cannot be read before that is said.
_TRIES = 4


class JournalFollower:
    """Reads what is new in a journal at each call; the file need not exist yet.

    Args:
        path: Where it is, or will be.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._mark = StreamMark()
        self._began: float | None = None
        self._failed = 0

    def news(self) -> list[JournalEntry]:
        """Return what has come since the last call; everything, if another mission has begun in the file.

        Raises:
            JournalError: If it is no journal, or cannot be read, and that has not changed for some calls.
        """
        try:
            entries = self._news()
        except JournalError:
            self._failed += 1
            if self._failed == _TRIES:
                raise
            return []
        self._failed = 0
        return entries

    def _news(self) -> list[JournalEntry]:
        try:
            # A file that is being made is empty for a moment.
            if not self.path.stat().st_size:
                return []
        except FileNotFoundError:
            return []
        with JournalFile.reading(self.path) as file:
            began = next((run.began for run in file.runs()), None)
            entries, mark = file.news(self._mark if began == self._began else StreamMark())
        self._began, self._mark = began, mark
        return entries
