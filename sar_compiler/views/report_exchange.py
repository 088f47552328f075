"""The report of a mission in the forms that maps and rescue services read, in coordinates of the world.

GeoJSON by RFC 7946, Cursor on Target 2.0 as TAK reads it, the Common Alerting Protocol 1.2.
"""

import itertools
import re
from collections.abc import Iterator
from datetime import datetime, timedelta, timezone
from typing import Any

from lxml import etree

from sar_compiler.journal.georeference import Georeference
from sar_compiler.journal.mission_state import Instant, MissionState, SurvivorState
from sar_compiler.tree.showing import in_one_line
from sar_compiler.views.mission_report import ReportError, georeference, outcome, report_data, to_visit, utc
from sar_compiler.views.plain import as_json, speakable

# How near somebody is to where a find is told, metres: what is drawn around it.
_RADIUS_M = 2.0
_STALE = timedelta(days=1)
# What Cursor on Target writes for a number that is not known.
_UNKNOWN = "9999999.0"
# A spot on the map, with the colours of it (ARGB as a signed number): red for who is confirmed, orange else.
_SPOT, _RED, _ORANGE = "b-m-p-s-m", -65536, -35072
_NAMELESS = "survivor"
# A moment in an identifier, which has no colons.
_STAMP = "%Y%m%dT%H%M%SZ"


def geojson_report(state: MissionState) -> str:
    """Return a mission as a FeatureCollection: survivors, zones, base, path; longitude stands before latitude.

    Raises:
        ReportError: If the map's place on the earth is not known.
        ImportError: If a library is not installed.
    """
    import geojson

    reference = _reference(state)
    data = report_data(state)
    simulated = {"simulated": data["simulated"]}

    def point(position: Any) -> Any:
        return geojson.Point((position["lon"], position["lat"]), precision=8)

    features = [
        geojson.Feature(
            geometry=point(each.pop("position")), properties={"kind": kind, **simulated, **_flat(each)}
        )
        for kind, listed in (("survivor", data["survivors"]), ("zone", data["zones"]))
        for each in listed
        if each["position"] is not None
    ]
    if data["base_station"] is not None:
        features.append(
            geojson.Feature(
                geometry=point(data["base_station"]), properties={"kind": "base station", **simulated}
            )
        )
    for run in state.runs:
        way = [(each["lon"], each["lat"]) for each in data["path"] if each["run"] == run.number]
        if len(way) > 1:
            line = geojson.LineString(way, precision=8)
            about = {"kind": "path", **simulated, "run": run.number}
            features.append(geojson.Feature(geometry=line, properties=about))
    if state.fence:
        ring = [reference.located(*corner)[::-1] for corner in (*state.fence, state.fence[0])]
        # Its outside lies to the right of who walks along it.
        ring = ring if _is_counterclockwise(ring) else ring[::-1]
        features.append(
            geojson.Feature(
                geometry=geojson.Polygon([ring], precision=8), properties={"kind": "geofence", **simulated}
            )
        )
    about = {key: data[key] for key in ("mission", "simulated", "outcome", "reason", "home")}
    return as_json(geojson.FeatureCollection(features, **about)) + "\n"


def cot_report(state: MissionState, now: datetime | None = None) -> str:
    """Return an event for each survivor to whom somebody must go, one in a line: what a TAK server takes as a stream.

    Args:
        state: The mission.
        now: When the events are made; now, by default.

    Raises:
        ReportError: If the map's place on the earth is not known.
        ImportError: If a library is not installed.
    """
    reference, listed = _reference(state), to_visit(state)
    made = now or datetime.now(timezone.utc)
    # By its place among all of them: what the operator says, and a name, make nobody else of a survivor.
    events = (
        _event(state, each, number, reference, made)
        for number, each in enumerate(state.survivors, 1)
        if each in listed
    )
    return "".join(f"{etree.tostring(event, encoding='unicode')}\n" for event in events)


def cap_report(state: MissionState) -> str:
    """Return an alert for those who go to the survivors, with an info for each of them.

    Raises:
        ReportError: If the map's place on the earth is not known.
        ImportError: If a library is not installed.
    """
    from cap_tools.models import Alert, MsgType, Scope, Status
    from xsdata.formats.dataclass.serializers import XmlSerializer
    from xsdata.formats.dataclass.serializers.config import SerializerConfig
    from xsdata.models.datatype import XmlDateTime

    reference, sent = _reference(state), _moment(state.now)
    word, reason = outcome(state)
    alert = Alert(
        # A later state of the mission is another alert.
        identifier=f"{_mission_id(state)}-{sent:{_STAMP}}",
        sender="sar_compiler",
        sent=XmlDateTime.from_datetime(sent),
        status=Status.EXERCISE if state.about.get("simulated") else Status.ACTUAL,
        msg_type=MsgType.ALERT,
        scope=Scope.RESTRICTED,
        restriction="for those who coordinate the rescue",
        note=_text(f"The search is {word}{f': {reason}' if reason else ''}"),
        infos=list(_infos(state, reference)),
    )
    written = XmlSerializer(config=SerializerConfig(indent="  ")).render(alert, ns_map={None: _CAP})
    # The norm forbids the letter.
    return str(written).replace("Z</sent>", "-00:00</sent>")


_CAP = "urn:oasis:names:tc:emergency:cap:1.2"


def _infos(state: MissionState, reference: Georeference) -> Iterator[Any]:
    from cap_tools.models import Area, Category, Certainty, Info, ResponseType, Severity, Urgency

    for survivor in to_visit(state):
        lat, lon = reference.located(*survivor.place)
        yield Info(
            language="en-US",
            categories=[Category.RESCUE],
            event="survivor found by a search robot",
            response_types=[ResponseType.EXECUTE],
            urgency=Urgency.IMMEDIATE,
            severity=Severity.SEVERE,
            certainty=Certainty.OBSERVED if survivor.standing == "confirmed" else Certainty.LIKELY,
            headline=_text(f"{survivor.name or _NAMELESS}: {survivor.standing}"),
            description=_text(_remarks(survivor)),
            areas=[
                Area(
                    area_desc=_text(survivor.zone or "the area that was searched"),
                    circles=[f"{lat:.7f},{lon:.7f} {_RADIUS_M / 1000.0:g}"],
                )
            ],
        )


def _event(
    state: MissionState, survivor: SurvivorState, number: int, reference: Georeference, now: datetime
) -> Any:
    lat, lon = reference.located(*survivor.place)
    stamp = "%Y-%m-%dT%H:%M:%S.000Z"
    colour = str(_RED if survivor.standing == "confirmed" else _ORANGE)
    uid = f"{_mission_id(state)}.{number}"
    event = etree.Element("event", version="2.0", uid=uid, type=_SPOT, how="m-g")
    found = utc(survivor.found)
    event.set("time", now.strftime(stamp))
    event.set("start", found.replace("Z", ".000Z") if found else now.strftime(stamp))
    event.set("stale", (now + _STALE).strftime(stamp))
    where = {
        "lat": f"{lat:.7f}",
        "lon": f"{lon:.7f}",
        "hae": _UNKNOWN,
        "ce": f"{_RADIUS_M:g}",
        "le": _UNKNOWN,
    }
    etree.SubElement(event, "point", where)
    detail = etree.SubElement(event, "detail")
    simulated = bool(state.about.get("simulated"))
    callsign = f"{'SIM ' if simulated else ''}{survivor.name or f'{_NAMELESS} {number}'}"
    etree.SubElement(detail, "contact", callsign=_text(callsign))
    etree.SubElement(detail, "color", argb=colour)
    etree.SubElement(detail, "usericon", iconsetpath=f"COT_MAPPING_SPOTMAP/{_SPOT}/{colour}")
    etree.SubElement(detail, "remarks").text = _text(
        f"{'SIMULATED. ' if simulated else ''}{_remarks(survivor)}"
    )
    return event


def _remarks(survivor: SurvivorState) -> str:
    x, y = survivor.place
    zone = f" in {survivor.zone}" if survivor.zone else ""
    possibly = f", possibly {survivor.possibly}" if survivor.possibly else ""
    return f"{survivor.standing}{possibly}; found{zone} at ({x:.2f}, {y:.2f}) m of the robot's map; report {survivor.report}"


def _reference(state: MissionState) -> Georeference:
    reference = georeference(state)
    if reference is None:
        message = "where the map lies on the earth is not known"
        raise ReportError(message)
    return reference


def _mission_id(state: MissionState) -> str:
    """Return what no other mission has: the node, and when the first run began."""
    node = str((state.runs[0].about.get("node") if state.runs else None) or "mission").strip("/")
    began = _moment(state.runs[0].began if state.runs else None)
    return f"{re.sub(r'[^a-zA-Z0-9_-]', '.', node)}.{began:{_STAMP}}"


def _moment(instant: Instant | None) -> datetime:
    return datetime.fromisoformat((utc(instant) or "1970-01-01T00:00:00Z").replace("Z", "+00:00"))


def _text(text: str) -> str:
    """Return a text in one line, with nothing that XML cannot have."""
    return speakable(in_one_line(text))


def _flat(data: dict[str, Any]) -> dict[str, Any]:
    """Return properties of which each is a plain value: times as they are by the system's clock."""
    return {key: value["utc"] if isinstance(value, dict) else value for key, value in data.items()}


def _is_counterclockwise(ring: list[tuple[float, float]]) -> bool:
    return sum((bx - ax) * (by + ay) for (ax, ay), (bx, by) in itertools.pairwise(ring)) < 0
