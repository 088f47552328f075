"""`--report` of `sar-run`, and `sar-journal report`."""

from collections.abc import Iterable, Sequence
from contextlib import closing
from pathlib import Path

from sar_compiler.cli.writing import WriteError, write_text
from sar_compiler.commands import print_error
from sar_compiler.journal.georeference import Georeference
from sar_compiler.journal.journal_entries import OF_ROBOT, JournalEntry
from sar_compiler.journal.mission_state import MissionState, RunProcess
from sar_compiler.missions.displaying import add_displays
from sar_compiler.ros.companion import Companion
from sar_compiler.views.mission_report import georeference, report_text, require_form
from sar_compiler.views.why import Inquiry


class RunReport(Companion):
    """The reports of a run, which are written when it has ended.

    Args:
        files: Where to.
        place: Where the map lies on the earth, if that is known.
        earlier: The entries of earlier runs of the mission.

    Raises:
        ReportError: If one of them could not be written then.
        ImportError: If a library of theirs is not installed.
    """

    def __init__(
        self, files: Sequence[Path], place: Georeference | None, earlier: Iterable[JournalEntry]
    ) -> None:
        for file in files:
            require_form(file, place)
        self._files = files
        self._state, self._inquiry = MissionState.of(add_displays(earlier)), Inquiry()

    def take(self, entry: JournalEntry) -> None:
        """Take an entry of the run's journal."""
        self._state.take(entry)
        self._inquiry.take(entry)

    def end(self, *, has_begun: bool) -> None:
        """Write them, if the run has begun; after this nobody else goes on with it."""
        if has_begun:
            self._state.process = RunProcess(is_gone=True)
            self.write()

    def write(self) -> None:
        """Write them; what cannot be written is said, because the mission is over."""
        why = self._inquiry.why()
        for file in self._files:
            try:
                write_text(file, report_text(self._state, file, why))
            except WriteError as error:  # noqa: PERF203 - the next one is tried as well
                print_error(f"sar-run: {error}")
            except Exception as error:  # noqa: BLE001 - nor does it change what the mission has come to
                print_error(f"sar-run: the report {file} could not be made: {error!r}")


def report_journal(journal: Path, files: Sequence[Path]) -> None:
    """Write the reports of the mission that a journal has.

    Raises:
        SarError: If the journal cannot be read; if one of them cannot be asked for, and then none is written; or if a file cannot be written.
        ImportError: If a library of theirs is not installed; then none is written.
    """
    from sar_compiler.journal.database import JournalFile, is_locked

    is_gone = not is_locked(journal)
    with closing(JournalFile.read(journal)) as file, file.snapshot():
        state = MissionState.of(add_displays(file.stream()))
        why = Inquiry.of(file.last_run(without=OF_ROBOT)).why()
    state.look_at_process(is_gone=is_gone)
    for each in files:
        require_form(each, georeference(state))
    for each, text in [(each, report_text(state, each, why)) for each in files]:
        write_text(each, text)
