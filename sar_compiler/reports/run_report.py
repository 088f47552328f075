"""Defines run extensions that write reports at the end of a run or find the cause of a failure."""

from collections.abc import Iterable, Sequence
from pathlib import Path

from sar_compiler.commands import print_error
from sar_compiler.journal.georeference import Georeference
from sar_compiler.journal.journal_entries import JournalEntry
from sar_compiler.journal.mission_state import MissionState, RunProcess
from sar_compiler.reports.mission_report import PathShortener, require_form
from sar_compiler.reports.report_files import write_report
from sar_compiler.reports.why import FailureAnalysis, likeliest_cause
from sar_compiler.ros.run_extension import RunExtension


class RunReport(RunExtension):
    """Writes the reports of a run when the run ends.

    Args:
        files: The paths of the reports.
        place: The georeference of the map; None if the map has no known georeference.
        earlier: The entries of earlier runs of the mission.
        folder: The journal's folder.

    Raises:
        ReportError: If one of the reports cannot be written.
        ImportError: If a required library is not installed.
    """

    def __init__(
        self, files: Sequence[Path], place: Georeference | None, earlier: Iterable[JournalEntry], folder: Path
    ) -> None:
        for file in files:
            require_form(file, place)
        self._files, self._paths = files, PathShortener(folder)
        self._state, self._analysis = (
            MissionState.from_stream(self._paths.shorten_stream(earlier)),
            FailureAnalysis(),
        )

    def on_entry(self, entry: JournalEntry) -> None:
        """Update the data of the reports with an entry of the run's journal."""
        shortened = self._paths.shorten(entry)
        self._state.apply(shortened)
        self._analysis.add_entry(shortened)

    def on_end(self, *, has_begun: bool) -> None:
        """Write the reports if the run has started."""
        if has_begun:
            self._state.process = RunProcess(is_gone=True)
            self._write()

    def _write(self) -> None:
        """Write the reports, and print an error for each report that cannot be written."""
        why = self._analysis.find_cause()
        for file in self._files:
            obstacle = write_report(self._state, file, why)
            if obstacle:
                print_error(f"sar-run: {obstacle}")


class FailureCause(RunExtension):
    """Analyses a run while it is active, to find the likeliest cause if the run fails."""

    def __init__(self) -> None:
        self._analysis = FailureAnalysis()

    def on_entry(self, entry: JournalEntry) -> None:
        """Add an entry of the run's journal to the analysis."""
        self._analysis.add_entry(entry)

    def cause_of_failure(self) -> str:
        """Return a line that states the likeliest cause of the failure, or an empty string if there is none."""
        return likeliest_cause(self._analysis.find_cause())
