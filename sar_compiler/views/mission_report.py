"""The report of a mission as plain data: what the forms in which it is written have in common."""

from collections.abc import Mapping
from datetime import datetime, timezone
from typing import Any, NamedTuple

from sar_compiler.errors import SarError
from sar_compiler.journal.georeference import Georeference
from sar_compiler.journal.mission_state import (
    Instant,
    MissionState,
    NodeState,
    Position,
    SurvivorState,
    Told,
    ZoneState,
)


class ReportError(SarError):
    """A report cannot be written like this."""


class MissionOutcome(NamedTuple):
    """The outcome of a mission: a word, and the reason."""

    word: str
    reason: str


def outcome(state: MissionState) -> MissionOutcome:
    """Return the outcome of a mission as of its last run."""
    run = state.runs[-1] if state.runs else None
    if run is None or not run.ending:
        return MissionOutcome("unfinished", "it still runs, or it has broken off")
    if run.status == 0:
        return MissionOutcome("complete", run.reason)
    word = {"over": "incomplete", "stopped": "stopped", "failed": "failed"}.get(run.ending, run.ending)
    return MissionOutcome(word, run.reason)


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


def to_visit(state: MissionState) -> list[SurvivorState]:
    """Return the survivors to whom somebody must go: those whom the operator has neither rejected nor merged."""
    return [each for each in state.survivors if each.standing not in ("rejected", "merged")]


def report_data(state: MissionState) -> dict[str, Any]:
    """Return the report of a mission as JSON values.

    Positions are metres in the frame `map`, with `lat` and `lon` in degrees where the map's place on the earth is known;
    times are `utc`, and `time`, the seconds of the mission's clock since the beginning of the run.

    Raises:
        ImportError: If pyproj is not installed, and the map's place on the earth is known.
    """
    place = _PlacesInTheWorld(georeference(state))
    word, reason = outcome(state)
    return {
        "mission": state.about.get("mission"),
        "simulated": bool(state.about.get("simulated")),
        "outcome": word,
        "reason": reason,
        "as_of": utc(state.now) if state.runs else None,
        "home": state.home,
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
        "survivors": [_survivor(each, place) for each in state.survivors],
        "zones": [_zone(each, place) for each in state.zones.values()],
        "base_station": place.of(state.base),
        "alarms": _told(state.alarms),
        "orders": _told(state.orders),
        "noted": [{**_at(each.at), "kind": each.kind, "data": dict(each.data)} for each in state.noted],
        "warnings": [{**_at(each.at), "text": each.text, "node": each.by} for each in state.warnings],
        "path": [{**_at(pose.at), **(place.of(Position(pose.x, pose.y)) or {})} for pose in state.trail],
        "parameters": dict(state.parameters),
        "tree": [_node(each) for each in state.nodes],
    }


class _PlacesInTheWorld(NamedTuple):
    reference: Georeference | None

    def of(self, position: Position | None) -> dict[str, float] | None:
        if position is None:
            return None
        place = {"x": position.x, "y": position.y}
        if self.reference is not None:
            lat, lon = self.reference.located(*position)
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


def _survivor(survivor: SurvivorState, place: _PlacesInTheWorld) -> dict[str, Any]:
    return {
        "name": survivor.name or None,
        "zone": survivor.zone or None,
        "position": place.of(survivor.place),
        "standing": survivor.standing,
        "possibly": survivor.possibly or None,
        "report": survivor.report,
        "found": _at(survivor.found),
        "sent": _at(survivor.sent),
        "acknowledged": _at(survivor.acknowledged),
    }


def _zone(zone: ZoneState, place: _PlacesInTheWorld) -> dict[str, Any]:
    return {
        "name": zone.name,
        "position": place.of(zone.place),
        "state": zone.state,
        "reason": zone.reason or None,
        "attempts": zone.attempts,
        "started": _at(zone.started),
        "searched": _at(zone.searched),
        "left": _at(zone.left),
        "unplaced": zone.unplaced or None,
    }


def _told(told: list[Told]) -> list[Mapping[str, Any]]:
    return [{**_at(each.at), "text": each.text} for each in told]


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
