"""Creates the report of a mission as JSON, or in the format that a file name extension selects."""

import os
import re
from collections.abc import Iterable, Iterator, Mapping
from importlib import import_module
from pathlib import Path
from typing import Any

from sar_compiler.errors import SarError
from sar_compiler.journal.display import EventTime, Landmark, Level
from sar_compiler.journal.georeference import GEOREFERENCE, Georeference
from sar_compiler.journal.journal_entries import LOG, OF_ROBOT, RUN_BEGAN, STATUS, JournalEntry
from sar_compiler.journal.mission_state import MissionState, NodeState, tree_nodes
from sar_compiler.journal.open_tasks import find_open_tasks
from sar_compiler.journal.status_line import condition
from sar_compiler.nodes.spec import load
from sar_compiler.reports.report_forms import FORMS
from sar_compiler.reports.why import CauseOfFailure, cause_data
from sar_compiler.tree.content import real_path
from sar_compiler.tree.plain import as_json


class ReportError(SarError):
    """A report cannot be written to a file, or not in the format that the file name selects."""


def georeference(state: MissionState) -> Georeference | None:
    """Return the georeference of a mission's map, or None if the map has no known georeference."""
    return state.place or Georeference.from_parameters(state.parameters)


def detections_to_visit(state: MissionState) -> list[Landmark]:
    """Return the detections that a person must visit: all detections except abandoned ones."""
    return [each for each in state.situation.detections() if each.level != Level.GIVEN_UP]


def unfinished_locations(state: MissionState) -> dict[str, list[str]]:
    """Return the names of unfinished locations, grouped by state. The reason for the state follows each name."""
    places: dict[str, list[str]] = {}
    for each in state.situation.landmarks.values():
        if each.state and each.level != Level.DONE and not state.situation.kind_of(each).is_found:
            reason = f" ({each.reason})" if each.reason else ""
            places.setdefault(each.state, []).append(f"{each.name}{reason}")
    return places


def report_data(state: MissionState, why: CauseOfFailure | None = None) -> dict[str, Any]:
    """Return the report of a mission as a JSON object.

    For a failed mission, the report contains the cause.

    Positions are `x` and `y` in the frame `map`, in metres, and also `lat` and `lon` in degrees if the map has a
    georeference. Each time is given as `utc` and as `time`, which is the number of seconds on the mission's
    clock since the start of the run.

    Raises:
        ImportError: If the map has a georeference, but pyproj is not installed.
    """
    reference, situation, now = georeference(state), state.situation, condition(state)
    return {
        "mission": state.about.get("mission"),
        "simulated": bool(state.about.get("simulated")),
        "outcome": now.word,
        "reason": now.reason,
        "as_of": state.now.utc if state.runs else None,
        "phase": state.phase._asdict(),
        "georeference": reference and reference._asdict(),
        "runs": [
            {
                "began": run.began.utc,
                "ended": run.ended and run.ended.utc,
                "duration": run.ended and run.ended.time,
                "ending": run.ending or None,
                "status": run.status,
                "reason": run.reason,
                "version": run.about.get("version"),
                "after": run.about.get("after"),
                "head": run.head or None,
            }
            for run in state.runs
        ],
        "landmarks": {
            kind.plural: [_landmark(each, reference) for each in situation.of_kind(kind.name)]
            for kind in situation.kinds.values()
        },
        "figures": [each._asdict() for each in situation.figures.values()],
        "courses": {
            name: [{**_time_fields(at), "value": value} for at, value in course]
            for name, course in state.figure_history.items()
        },
        "gauges": [each._asdict() for each in state.gauges],
        "tasks": [task._asdict() for task in find_open_tasks(state)],
        "alarms": [
            {**_time_fields(state.since[text]), **each._asdict()} for text, each in situation.alarms.items()
        ],
        "properties": [
            {
                "name": each.name,
                "verdict": state.word_of(each),
                "broken": each.broken and _time_fields(each.broken),
                "event": each.event or None,
            }
            for each in state.properties.values()
        ],
        "why": why and cause_data(why),
        "facts": [
            {**_time_fields(each.at), "kind": each.kind, "data": dict(each.data), "text": each.text}
            for each in state.facts
        ],
        "warnings": [
            {**_time_fields(each.at), "text": each.text, "node": each.by} for each in state.warnings
        ],
        "path": [
            {**_time_fields(pose.at), **_position_fields(reference, pose.x, pose.y)} for pose in state.trail
        ],
        "parameters": dict(state.parameters),
        "tree": [_node(each) for each in state.nodes],
    }


def _position_fields(reference: Georeference | None, x: float, y: float) -> dict[str, float]:
    """Return the fields for a position in the frame `map`.

    With a georeference, add latitude and longitude.
    """
    if reference is None:
        return {"x": x, "y": y}
    lat, lon = reference.to_coordinates(x, y)
    return {"x": x, "y": y, "lat": round(lat, 8), "lon": round(lon, 8)}


def _time_fields(instant: EventTime | None) -> dict[str, Any]:
    if instant is None:
        return {"run": None, "time": None, "utc": None}
    return {"run": instant.run, "time": round(instant.time, 3), "utc": instant.utc}


def _landmark(landmark: Landmark, reference: Georeference | None) -> dict[str, Any]:
    corners = [_position_fields(reference, *corner) for corner in landmark.corners]
    fixed = {
        "name": landmark.name,
        "position": _position_fields(reference, landmark.x, landmark.y),
        **({"corners": corners} if corners else {}),
        "state": landmark.state,
        "level": Level(landmark.level).name.lower(),
        "reason": landmark.reason or None,
        "within": landmark.within or None,
        "certain": landmark.is_certain,
    }
    details = {
        name: _time_fields(each) if isinstance(each, EventTime) else each
        for name, each in landmark.details.items()
    }
    return {**fixed, **details, **fixed}


def _node(node: NodeState) -> dict[str, Any]:
    return {
        "name": node.name,
        "class": node.kind,
        "depth": node.depth,
        "file": node.file,
        "line": node.line,
        "attributes": dict(node.attributes),
        "status": node.status or None,
        "label": node.label,
        "message": node.message,
    }


def json_report(state: MissionState, why: CauseOfFailure | None = None) -> str:
    """Return the report of a mission as JSON."""
    return as_json(report_data(state, why)) + "\n"


def require_form(file: Path, place: Georeference | None) -> None:
    """Check, before a run starts, that the report can be written when the run has ended.

    Args:
        file: The path of the report.
        place: The georeference of the map; None if the map has no known georeference.

    Raises:
        ReportError: If the report cannot be written.
        ImportError: If a required library is not installed.
    """
    form = FORMS.get(file.suffix.lower())
    if form is None:
        raise ReportError(
            f"the report format of {file} is unknown (known file name endings: {', '.join(FORMS)})"
        )
    if form.is_of_the_world and place is None:
        raise ReportError(
            f"{file} contains world coordinates. Add {GEOREFERENCE}: {{lat: …, lon: …, heading: …}} to the parameter file, with the origin of the frame map, and the heading of the x axis clockwise from north, in degrees. Or create the report after the run: sar-journal report --georeference LAT,LON,HEADING"
        )
    for library in (*(() if place is None else ("pyproj",)), *form.libraries):
        import_module(library)
    obstacle = _write_obstacle(file.absolute())
    if obstacle:
        raise ReportError(f"{file} cannot be written: {obstacle}")


def _write_obstacle(file: Path) -> str:
    """Return the reason why a file cannot be written, or an empty string if there is none."""
    if not file.parent.is_dir():
        return f"the folder {file.parent} does not exist"
    if file.is_dir():
        return "it is a folder"
    # A device is opened for writing. A file is replaced, which requires write access to the folder.
    written = file if file.exists() and not file.is_file() else real_path(file).parent
    return "" if os.access(written, os.W_OK) else f"you do not have permission to write to {written}"


def report_text(state: MissionState, file: Path | str, why: CauseOfFailure | None = None) -> str:
    """Return the report of a mission as text, in the format that the file name extension selects."""
    form = FORMS[Path(file).suffix.lower()]
    write = load(form.function)
    text: str = write(state) if form.is_of_the_world else write(state, why)
    return text


# The kinds of entries that contain no paths; there are many of them.
_WITHOUT_PATHS = {*OF_ROBOT} - {LOG}


class PathShortener:
    """Shortens the paths in the entries of a journal.

    A path becomes relative to one of three folders: the common folder of the tree's files, the journal's
    folder or the current folder. The folder nearest to the path is used. Other paths in the user's folder
    begin with `~`.

    Args:
        folder: The journal's folder.
    """

    def __init__(self, folder: Path) -> None:
        self._folders = {str(folder.absolute()), str(Path.cwd())}
        self._path_pattern = self._pattern()

    def shorten_stream(self, stream: Iterable[JournalEntry]) -> Iterator[JournalEntry]:
        """Yield the entries of a stream with shortened paths."""
        return map(self.shorten, stream)

    def shorten(self, entry: JournalEntry) -> JournalEntry:
        """Return a copy of an entry in which paths are shortened."""
        if entry.kind == RUN_BEGAN:
            self._folders.add(_common_folder(entry.data.get("tree")))
            self._path_pattern = self._pattern()
        if entry.kind in _WITHOUT_PATHS or (entry.kind == STATUS and _is_short(entry.data)):
            return entry
        return entry._replace(data=self._shorten(entry.data))

    def _pattern(self) -> re.Pattern[str]:
        known = sorted({*self._folders, os.path.expanduser("~")} - {"/", "", "~"}, key=len, reverse=True)  # noqa: PTH111 - there may be none
        return re.compile(rf"(?<![\w./~-])({'|'.join(map(re.escape, known))})(/|(?![\w.-]))")

    def _shorten(self, value: Any) -> Any:
        if isinstance(value, str):
            return self._path_pattern.sub(self._short_form, value) if "/" in value else value
        if isinstance(value, Mapping):
            return {key: self._shorten(each) for key, each in value.items()}
        return [*map(self._shorten, value)] if isinstance(value, list | tuple) else value

    def _short_form(self, found: re.Match[str]) -> str:
        folder, slash = found.groups()
        if folder in self._folders:
            return "" if slash else "."
        return f"~{slash}"


def _is_short(data: Mapping[str, Any]) -> bool:
    """Return whether the data of a status entry contains no path that could be shortened."""
    for each in data.values():  # noqa: SIM110 - `any` takes twice as long
        if type(each) is str and "/" in each:
            return False
    return True


def _common_folder(tree: object) -> str:
    """Return the common folder of a tree's files, or an empty string if no file has an absolute path."""
    folders = {os.path.dirname(node.file) for node in tree_nodes(tree) if os.path.isabs(node.file)}  # noqa: PTH117, PTH120 - of another machine
    return os.path.commonpath(folders) if folders else ""
