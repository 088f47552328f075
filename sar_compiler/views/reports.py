"""Reports of a mission by the endings of their files."""

import os
from collections.abc import Callable, Mapping
from importlib import import_module
from pathlib import Path

from sar_compiler.journal.georeference import GEOREFERENCE, Georeference
from sar_compiler.journal.mission_state import MissionState
from sar_compiler.tree.content import real_path
from sar_compiler.views.mission_report import ReportError, report_data
from sar_compiler.views.plain import as_json


def _json(state: MissionState) -> str:
    return as_json(report_data(state)) + "\n"


def _writer(module: str, function: str) -> Callable[[MissionState], str]:
    """Return a function of a module of this folder, which is imported when it is called."""

    def write(state: MissionState) -> str:
        text: str = getattr(import_module(f"sar_compiler.views.{module}"), function)(state)
        return text

    return write


FORMS: Mapping[str, Callable[[MissionState], str]] = {
    ".html": _writer("report_html", "html_report"),
    ".json": _json,
    ".geojson": _writer("report_exchange", "geojson_report"),
    ".cot": _writer("report_exchange", "cot_report"),
    ".cap": _writer("report_exchange", "cap_report"),
}
"""What writes a report, by the ending of the file."""

# The libraries of those in coordinates of the world.
_LIBRARIES = {".geojson": ("geojson",), ".cot": (), ".cap": ("cap_tools", "xsdata")}


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
    if ending in _LIBRARIES and place is None:
        message = (
            f"{file} has coordinates of the world, which takes {GEOREFERENCE}: {{lat: …, lon: …, heading: …}} in the "
            "parameter file: where the origin of the frame map lies, in degrees, and where its x axis points, clockwise from "
            "north"
        )
        raise ReportError(message)
    for library in (*(() if place is None else ("pyproj",)), *_LIBRARIES.get(ending, ())):
        import_module(library)
    obstacle = _obstacle(file.absolute())
    if obstacle:
        message = f"{file} cannot be written: {obstacle}"
        raise ReportError(message)


def _obstacle(file: Path) -> str:
    """Return why a file cannot be written, as far as that is known before; empty if nothing is known."""
    if not file.parent.is_dir():
        return f"there is no folder {file.parent}"
    if file.is_dir():
        return "it is a folder"
    # A device is written to; a file is put in the place of the one that is there.
    written = file if file.exists() and not file.is_file() else real_path(file).parent
    return "" if os.access(written, os.W_OK) else f"{written} may not be written to"


def report_text(state: MissionState, file: Path | str) -> str:
    """Return the report of a mission in the form of a file."""
    return FORMS[Path(file).suffix.lower()](state)
