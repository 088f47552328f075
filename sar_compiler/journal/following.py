"""What a mission in another process writes to its journal, as it does."""

from contextlib import closing
from pathlib import Path

from sar_compiler.journal.database import JournalFile, StreamMark
from sar_compiler.journal.journal_entries import JournalEntry


class JournalFollower:
    """Reads a journal again and again; there may be none yet.

    Args:
        path: Where it is, or will be.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._mark = StreamMark()
        self._began: float | None = None

    def news(self) -> list[JournalEntry]:
        """Return what has come since the last call; everything, if another mission has begun in the file.

        Raises:
            JournalError: If it is no journal, or cannot be read.
        """
        # A file that is being made is empty for a moment.
        if not self.path.exists() or not self.path.stat().st_size:
            return []
        with closing(JournalFile.read(self.path)) as file:
            began = next((run.began for run in file.runs()), None)
            if began != self._began:
                self._began, self._mark = began, StreamMark()
            entries, self._mark = file.news(self._mark)
        return entries
