"""Writes reports of a mission from the journal of the mission."""

from collections.abc import Sequence
from pathlib import Path

from sar_compiler.commands import FINDINGS, OK, missing_library_message, print_error
from sar_compiler.errors import SarError
from sar_compiler.journal.georeference import Georeference
from sar_compiler.journal.mission_state import MissionState
from sar_compiler.reports.mission_report import (
    PathShortener,
    ReportError,
    georeference,
    report_text,
    require_form,
)
from sar_compiler.reports.why import CauseOfFailure, FailureAnalysis
from sar_compiler.writing import write_text


def write_report(state: MissionState, file: Path, why: CauseOfFailure | None) -> str:
    """Write a report. Return the reason if it cannot be written, otherwise an empty string."""
    try:
        write_text(file, report_text(state, file, why))
    except SarError as error:
        return str(error)
    except Exception as error:  # noqa: BLE001 - it does not change the result of the mission
        return f"the report {file} could not be created: {error!r}"
    return ""


def report_journal(journal: Path, files: Sequence[Path], place: Georeference | None = None) -> int:
    """Write reports of the mission in a journal. Print the reason for each report that cannot be written.

    Args:
        journal: The journal.
        files: The paths of the reports.
        place: The georeference of the map; by default the georeference in the journal.

    Returns:
        The exit status: 1 if a report could not be written.

    Raises:
        SarError: If the journal cannot be read.
    """
    state, why = _mission(journal)
    known, state.place = georeference(state), place
    if place and known and place != known:
        given, recorded = _georeference_text(place), _georeference_text(known)
        print_error(f"sar-journal: note: --georeference {given} replaces the journal's {recorded}")
    obstacles = [_report_obstacle(state, file) or write_report(state, file, why) for file in files]
    for obstacle in filter(None, obstacles):
        print_error(f"sar-journal: {obstacle}")
    return FINDINGS if any(obstacles) else OK


def report_page(journal: Path) -> str:
    """Return the report of the mission in a journal as an HTML page.

    Raises:
        SarError: If the journal cannot be read, or a library is not installed.
    """
    state, why = _mission(journal)
    try:
        return report_text(state, Path("report.html"), why)
    except ImportError as error:
        raise ReportError(missing_library_message(error) or str(error)) from error


def _mission(journal: Path) -> tuple[MissionState, CauseOfFailure]:
    from sar_compiler.journal.database import JournalFile

    with JournalFile.open_snapshot(journal) as file:
        entries = PathShortener(journal.parent).shorten_stream(file.every_run(is_condensed=True))
        analysis, state = FailureAnalysis.with_state(entries)
    state.update_process(is_gone=not file.is_written)
    return state, analysis.find_cause()


def _georeference_text(place: Georeference) -> str:
    return ",".join(map(str, place))


def _report_obstacle(state: MissionState, file: Path) -> str:
    """Return the reason why a report cannot be written in the file's format, or an empty string."""
    try:
        require_form(file, georeference(state))
    except SarError as error:
        return str(error)
    except ImportError as error:
        return f"{file}: {missing_library_message(error) or error}"
    return ""
