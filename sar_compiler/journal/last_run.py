"""Provides the events and ticks of a journal's last run.

To save memory, each use reads the file again.
"""

from collections.abc import Iterator, Sequence
from pathlib import Path

from sar_compiler.journal.database import JournalFile
from sar_compiler.journal.journal_entries import OF_ROBOT
from sar_compiler.journal.mission_state import NodeState
from sar_compiler.journal.recorded_events import recorded_events
from sar_compiler.journal.recorded_ticks import LoggedTick, TickLog, TickSource
from sar_compiler.runtime.events import Event


class LastRunEvents(TickSource):
    """The events and ticks of the last run in a journal.

    Each read opens the file, because SQLite only allows reads in the thread that has opened the file.

    Args:
        path: The journal.
        run: The number of the run; a later run that has started in the meantime is not read.
        nodes: The nodes of the tree.
    """

    def __init__(self, path: Path, run: int, nodes: Sequence[NodeState]) -> None:
        self._path, self._run, self._nodes = path, run, nodes
        self._omits_ticks = False

    @property
    def omits_ticks(self) -> bool:
        """Whether unchanged ticks may be missing, as in imported runs.

        This is only known after the ticks were read.
        """
        return self._omits_ticks

    def __iter__(self) -> Iterator[Event]:
        with JournalFile.open_snapshot(self._path) as file:
            yield from recorded_events(file.run_entries(self._run, without=OF_ROBOT))

    def read_ticks(self) -> Iterator[LoggedTick]:
        """Yield the ticks of the run in order."""
        log = TickLog(self._nodes, is_alone=True)
        with JournalFile.open_snapshot(self._path) as file:
            for _ in file.run_entries(self._run, without=OF_ROBOT, log=log):
                pass
        self._omits_ticks = log.omits_ticks
        yield from log.read_ticks()
