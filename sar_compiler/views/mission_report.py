"""The report of a mission as plain data: what the forms in which it is written have in common."""

from datetime import datetime, timezone
from typing import Any, NamedTuple

from sar_compiler.errors import SarError
from sar_compiler.journal.georeference import Georeference
from sar_compiler.journal.mission_state import Instant, MissionState, NodeState
from sar_compiler.journal.situation import FactTime, Landmark, Level


class ReportError(SarError):
    """A report cannot be written like this."""


def outcome(state: MissionState) -> tuple[str, str]:
    """Return what a mission has come to as of its last run: a word, and the reason."""
    if not state.runs or not state.runs[-1].ending:
        return "unfinished", "it still runs, or it has broken off"
    return state.phase.name, state.phase.reason


def utc(instant: Instant | None) -> str | None:
    """Return when something was by the system's clock, in ISO 8601; None if it was not, or there is no such day."""
    if instant is None:
        return None
    try:
        return datetime.fromtimestamp(instant.wall, timezone.utc).strftime("%Y-%m-%dT%H:%M:%SZ")
    except (OSError, OverflowError, ValueError):
        return None


def georeference(state: MissionState) -> Georeference | None:
    """Return where the map of a mission lies on the earth; None if that is not known."""
    return Georeference.among(state.parameters)


def to_visit(state: MissionState) -> list[Landmark]:
    """Return the finds to which somebody must go: those that nobody has given up."""
    return [each for each in state.situation.found() if each.level != Level.GIVEN_UP]


def report_data(state: MissionState) -> dict[str, Any]:
    """Return the report of a mission as JSON values.

    Positions are metres in the frame `map`, with `lat` and `lon` in degrees where the map's place on the earth is known;
    times are `utc`, and `time`, the seconds of the mission's clock since the beginning of the run.

    Raises:
        ImportError: If pyproj is not installed, and the map's place on the earth is known.
    """
    place, situation = _PlacesInTheWorld(georeference(state)), state.situation
    word, reason = outcome(state)
    return {
        "mission": state.about.get("mission"),
        "simulated": bool(state.about.get("simulated")),
        "outcome": word,
        "reason": reason,
        "as_of": utc(state.now) if state.runs else None,
        "phase": state.phase._asdict(),
        "georeference": place.reference and place.reference._asdict(),
        "runs": [
            {
                "began": utc(run.began),
                "ended": utc(run.ended),
                "duration": run.ended and run.ended.time,
                "ending": run.ending or None,
                "status": run.status,
                "reason": run.reason,
                "version": run.about.get("version"),
                "after": run.about.get("after"),
            }
            for run in state.runs
        ],
        "landmarks": {
            kind.plural: [_landmark(state, each, place) for each in situation.of_kind(kind.name)]
            for kind in situation.kinds.values()
        },
        "figures": [each._asdict() for each in situation.figures.values()],
        "gauges": [each._asdict() for each in situation.gauges.values()],
        "alarms": [{**_at(state.since[text]), **each._asdict()} for text, each in situation.alarms.items()],
        "facts": [
            {**_at(each.at), "kind": each.kind, "data": dict(each.data), "text": each.text}
            for each in state.facts
        ],
        "warnings": [{**_at(each.at), "text": each.text, "node": each.by} for each in state.warnings],
        "path": [{**_at(pose.at), **place.of(pose.x, pose.y)} for pose in state.trail],
        "parameters": dict(state.parameters),
        "tree": [_node(each) for each in state.nodes],
    }


class _PlacesInTheWorld(NamedTuple):
    reference: Georeference | None

    def of(self, x: float, y: float) -> dict[str, float]:
        place = {"x": x, "y": y}
        if self.reference is not None:
            lat, lon = self.reference.located(x, y)
            place |= {"lat": round(lat, 8), "lon": round(lon, 8)}
        return place


def _at(instant: Instant | None) -> dict[str, Any]:
    return (
        {"run": None, "time": None, "utc": None}
        if instant is None
        else {
            "run": instant.run,
            "time": round(instant.time, 3),
            "utc": utc(instant),
        }
    )


def _landmark(state: MissionState, landmark: Landmark, place: _PlacesInTheWorld) -> dict[str, Any]:
    fixed = {
        "name": landmark.name,
        "position": place.of(landmark.x, landmark.y),
        **({"corners": [place.of(*corner) for corner in landmark.corners]} if landmark.corners else {}),
        "state": landmark.state,
        "level": Level(landmark.level).name.lower(),
        "reason": landmark.reason or None,
        "within": landmark.within or None,
        "certain": landmark.is_certain,
    }
    details = {
        name: _at(state.instant(each)) if isinstance(each, FactTime) else each
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
        "message": node.message,
    }
