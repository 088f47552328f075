"""Reports of a mission by the endings of their files."""

from collections.abc import Callable, Mapping
from importlib import import_module
from pathlib import Path

from sar_compiler.journal.georeference import GEOREFERENCE, Georeference
from sar_compiler.journal.mission_state import MissionState
from sar_compiler.views.mission_report import ReportError, report_data
from sar_compiler.views.plain import as_json


def _html(state: MissionState) -> str:
    from sar_compiler.views.report_html import html_report

    return html_report(state)


def _json(state: MissionState) -> str:
    return as_json(report_data(state)) + "\n"


def _geojson(state: MissionState) -> str:
    from sar_compiler.views.report_exchange import geojson_report

    return geojson_report(state)


def _cot(state: MissionState) -> str:
    from sar_compiler.views.report_exchange import cot_report

    return cot_report(state)


def _cap(state: MissionState) -> str:
    from sar_compiler.views.report_exchange import cap_report

    return cap_report(state)


FORMS: Mapping[str, Callable[[MissionState], str]] = {
    ".html": _html,
    ".json": _json,
    ".geojson": _geojson,
    ".cot": _cot,
    ".cap": _cap,
}
"""What writes a report, by the ending of the file."""

# The libraries of those in coordinates of the world.
_LIBRARIES = {".geojson": ("pyproj", "geojson"), ".cot": ("pyproj",), ".cap": ("pyproj", "cap_tools")}


def require_form(file: Path, place: Georeference | None) -> None:
    """Check that a report can be written, before there is anything to report.

    Args:
        file: Where it is to be written.
        place: Where the map lies on the earth, if that is known.

    Raises:
        ReportError: If it cannot.
        ImportError: If a library that it takes is not installed.
    """
    ending = file.suffix.lower()
    if ending not in FORMS:
        message = f"a report ends in {', '.join(FORMS)}, and {file} does not"
        raise ReportError(message)
    libraries = _LIBRARIES.get(ending, ())
    if libraries and place is None:
        message = (
            f"{file} has coordinates of the world, which takes {GEOREFERENCE}: {{lat: …, lon: …, heading: …}} in the "
            "parameter file: where the origin of the frame map lies, in degrees, and where its x axis points, clockwise from "
            "north"
        )
        raise ReportError(message)
    for library in libraries:
        import_module(library)
    if not file.absolute().parent.is_dir():
        message = f"{file} cannot be written: there is no folder {file.absolute().parent}"
        raise ReportError(message)


def report_text(state: MissionState, file: Path | str) -> str:
    """Return the report of a mission in the form of a file."""
    return FORMS[Path(file).suffix.lower()](state)
