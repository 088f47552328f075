"""Creates reports in world coordinates for map programs and emergency services.

The formats are GeoJSON (RFC 7946), KML 2.2 (OGC), Cursor on Target 2.0 (TAK) and Common Alerting Protocol 1.2 (CAP).
"""

import html
import itertools
import re
from collections.abc import Iterable, Iterator
from datetime import datetime, timedelta, timezone
from typing import Any

from lxml import etree
from lxml.builder import ElementMaker

from sar_compiler.journal.display import EventTime, Landmark
from sar_compiler.journal.georeference import Georeference
from sar_compiler.journal.mission_state import MissionState
from sar_compiler.journal.status_line import status_line_text
from sar_compiler.reports.mission_report import ReportError, detections_to_visit, georeference, report_data
from sar_compiler.style import TAK_CERTAIN, TAK_LIKELY, colour_of, rgb
from sar_compiler.tree.display_text import escape_to_one_line
from sar_compiler.tree.plain import as_json, speakable

# The radius of the circle around a detection, in metres.
_RADIUS_M = 2.0
_STALE = timedelta(days=1)
# The value of an unknown number in Cursor on Target.
_UNKNOWN = "9999999.0"
# The type of a point on the map.
_SPOT = "b-m-p-s-m"
# The format of times in identifiers, which must not contain colons.
_STAMP = "%Y%m%dT%H%M%SZ"


def geojson_report(state: MissionState) -> str:
    """Return the report as a GeoJSON FeatureCollection: the landmarks, and the robot's path in each run.

    Raises:
        ReportError: If the map has no georeference.
        ImportError: If a library is not installed.
    """
    import geojson

    _reference(state)
    data = report_data(state)
    simulated = {"simulated": data["simulated"]}

    def point(position: Any) -> Any:
        return geojson.Point((position["lon"], position["lat"]), precision=8)

    def area(corners: Any) -> Any:
        ring = [(each["lon"], each["lat"]) for each in (*corners, corners[0])]
        # The ring of a GeoJSON polygon is counterclockwise.
        return geojson.Polygon([ring if _is_counterclockwise(ring) else ring[::-1]], precision=8)

    features = [
        geojson.Feature(
            geometry=area(each["corners"]) if "corners" in each else point(each["position"]),
            properties={
                "kind": kind.name,
                **simulated,
                **_to_plain_properties(each),
                "name": _name(state, each["name"]),
            },
        )
        for kind in state.situation.kinds.values()
        for each in data["landmarks"][kind.plural]
    ]
    for run in state.runs:
        path = [(each["lon"], each["lat"]) for each in data["path"] if each["run"] == run.number]
        if len(path) > 1:
            line = geojson.LineString(path, precision=8)
            about = {"kind": "path", **simulated, "run": run.number}
            features.append(geojson.Feature(geometry=line, properties=about))
    about = {key: data[key] for key in ("mission", "simulated", "outcome", "reason")}
    about["head"] = state.head or None
    return as_json(geojson.FeatureCollection(features, **about)) + "\n"


_KML = "http://www.opengis.net/kml/2.2"
_E = ElementMaker(namespace=_KML, nsmap={None: _KML})
# The scale of the icon of a confirmed detection.
_CERTAIN_SCALE = "1.4"


def kml_report(state: MissionState) -> str:
    """Return the report as a KML document: the landmarks, and the robot's path in each run.

    Raises:
        ReportError: If the map has no georeference.
        ImportError: If a library is not installed.
    """
    reference, situation = _reference(state), state.situation
    document = _E.Document(
        _E.name(_text(state.title)),
        _description(
            state, f"{status_line_text(state)}{state.head and f' Head of the journal: {state.head}'}"
        ),
        *(
            _placemark(state, each, reference)
            for kind in situation.kinds.values()
            for each in situation.of_kind(kind.name)
        ),
        *_path_placemarks(state, reference),
    )
    written: str = etree.tostring(_E.kml(document), encoding="unicode", pretty_print=True)
    return written


def _placemark(state: MissionState, landmark: Landmark, reference: Georeference) -> Any:
    kind = state.situation.kind_of(landmark)
    remarks = _remarks(landmark) if kind.is_found else _state_of(landmark)
    if landmark.corners:
        ring = _coordinates((*landmark.corners, landmark.corners[0]), reference)
        shape = _E.Polygon(_E.outerBoundaryIs(_E.LinearRing(ring)))
    else:
        shape = _E.Point(_coordinates([(landmark.x, landmark.y)], reference))
    return _E.Placemark(
        _E.name(_text(_name(state, landmark.name))),
        _description(state, f"{kind.name}: {remarks}" if remarks else kind.name),
        _style(colour_of(landmark.level, is_found=kind.is_found), is_certain=landmark.is_certain),
        shape,
    )


def _path_placemarks(state: MissionState, reference: Georeference) -> Iterator[Any]:
    for run in state.runs:
        path = [(pose.x, pose.y) for pose in state.trail if pose.at.run == run.number]
        if len(path) > 1:
            line = _E.LineString(_E.tessellate("1"), _coordinates(path, reference))
            about = _description(state, "the driven path of the robot")
            yield _E.Placemark(
                _E.name(_text(_name(state, f"run {run.number}"))), about, _style("trail"), line
            )


def _style(name: str, *, is_certain: bool = False) -> Any:
    """Return the style of a placemark. Its colours suit aerial pictures, which are dark."""
    colour = "".join(f"{round(part * 255):02x}" for part in reversed(rgb(name, dark=True)))
    return _E.Style(
        _E.IconStyle(_E.color(f"ff{colour}"), *([_E.scale(_CERTAIN_SCALE)] if is_certain else [])),
        _E.LineStyle(_E.color(f"ff{colour}"), _E.width("3")),
        _E.PolyStyle(_E.color(f"40{colour}")),  # objects below an area stay visible
    )


def _description(state: MissionState, text: str) -> Any:
    """Return the description of a KML element with markup escaped, because programs show it as HTML."""
    simulated = "SIMULATED. " if state.about.get("simulated") else ""
    return _E.description(html.escape(_text(f"{simulated}{text}"), quote=False))


def _coordinates(places: Iterable[tuple[float, float]], reference: Georeference) -> Any:
    """Convert positions in the frame `map`, in metres, to a KML element with world coordinates."""
    located = (reference.to_coordinates(*place) for place in places)
    return _E.coordinates(" ".join(f"{lon:.8f},{lat:.8f}" for lat, lon in located))


def cot_report(state: MissionState, now: datetime | None = None) -> str:
    """Return the report as Cursor on Target events: one line for each detection that a person must visit.

    Args:
        state: The state of the mission.
        now: The time of the events; by default the current time.

    Raises:
        ReportError: If the map has no georeference.
        ImportError: If a library is not installed.
    """
    reference, listed = _reference(state), detections_to_visit(state)
    made = now or datetime.now(timezone.utc)
    # The index among all detections identifies a detection even after a review or a new name.
    events = (
        _cot_event(state, each, number, reference, made)
        for number, each in enumerate(state.situation.detections(), 1)
        if each in listed
    )
    return "".join(f"{etree.tostring(event, encoding='unicode')}\n" for event in events)


def cap_report(state: MissionState) -> str:
    """Return the report as a CAP alert, with an info block for each detection that a person must visit.

    Raises:
        ReportError: If the map has no georeference.
        ImportError: If a library is not installed.
    """
    from cap_tools.models import Alert, MsgType, Scope, Status
    from xsdata.formats.dataclass.serializers import XmlSerializer
    from xsdata.formats.dataclass.serializers.config import SerializerConfig
    from xsdata.models.datatype import XmlDateTime

    reference, sent = _reference(state), _moment(state.now)
    alert = Alert(
        # A later report of the same mission is a new alert with its own identifier.
        identifier=f"{_mission_id(state)}-{sent:{_STAMP}}",
        sender="sar_compiler",
        sent=XmlDateTime.from_datetime(sent),
        status=Status.EXERCISE if state.about.get("simulated") else Status.ACTUAL,
        msg_type=MsgType.ALERT,
        scope=Scope.RESTRICTED,
        restriction="for the coordinators of the response",
        note=_text(status_line_text(state)),
        infos=list(_infos(state, reference)),
    )
    written = XmlSerializer(config=SerializerConfig(indent="  ")).render(alert, ns_map={None: _CAP})
    # CAP forbids the letter Z as a UTC offset.
    return str(written).replace("Z</sent>", "-00:00</sent>")


_CAP = "urn:oasis:names:tc:emergency:cap:1.2"


def _infos(state: MissionState, reference: Georeference) -> Iterator[Any]:
    from cap_tools.models import Area, Category, Certainty, Info, ResponseType, Severity, Urgency

    for find in detections_to_visit(state):
        lat, lon = reference.to_coordinates(find.x, find.y)
        yield Info(
            language="en-US",
            categories=[Category.RESCUE],
            event=_text(state.situation.kind_of(find).event or find.kind),
            response_types=[ResponseType.EXECUTE],
            urgency=Urgency.IMMEDIATE,
            severity=Severity.SEVERE,
            certainty=Certainty.OBSERVED if find.is_certain else Certainty.LIKELY,
            headline=_text(f"{_name(state, find.name)}: {find.state}"),
            description=_text(_remarks(find)),
            areas=[
                Area(
                    area_desc=_text(find.within or "the searched area"),
                    circles=[f"{lat:.7f},{lon:.7f} {_RADIUS_M / 1000.0:g}"],
                )
            ],
        )


def _cot_event(
    state: MissionState, find: Landmark, number: int, reference: Georeference, now: datetime
) -> Any:
    lat, lon = reference.to_coordinates(find.x, find.y)
    stamp = "%Y-%m-%dT%H:%M:%S.000Z"
    colour = str(TAK_CERTAIN if find.is_certain else TAK_LIKELY)
    uid = f"{_mission_id(state)}.{number}"
    event = etree.Element("event", version="2.0", uid=uid, type=_SPOT, how="m-g")
    times = (each.utc for each in find.details.values() if isinstance(each, EventTime))
    found = next(times, None)
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
    callsign = f"{'SIM ' if simulated else ''}{_name(state, find.name)}"
    etree.SubElement(detail, "contact", callsign=_text(callsign))
    etree.SubElement(detail, "color", argb=colour)
    etree.SubElement(detail, "usericon", iconsetpath=f"COT_MAPPING_SPOTMAP/{_SPOT}/{colour}")
    etree.SubElement(detail, "remarks").text = _text(f"{'SIMULATED. ' if simulated else ''}{_remarks(find)}")
    return event


def _name(state: MissionState, name: str) -> str:
    """Return a name for a landmark that is unique among several robots, such as `robot1/find_1`."""
    return f"{state.robot}/{name}" if state.robot else name


def _state_of(landmark: Landmark) -> str:
    """Return the state of a landmark and the reason for this state as text. For an area, add the details."""
    state = ", ".join(filter(None, (landmark.state, landmark.reason)))
    return "; ".join(filter(None, (state, *(_details(landmark) if landmark.corners else ()))))


def _details(landmark: Landmark) -> list[str]:
    return [
        f"{name} {each}"
        for name, each in landmark.details.items()
        if each not in ("", None) and not isinstance(each, EventTime)
    ]


def _remarks(find: Landmark) -> str:
    reason = f", {find.reason}" if find.reason else ""
    place = f" in {find.within}" if find.within else ""
    found = f"{find.state}{reason}; found{place} at ({find.x:.2f}, {find.y:.2f}) m on the robot's map"
    return "; ".join((found, *_details(find)))


def _reference(state: MissionState) -> Georeference:
    reference = georeference(state)
    if reference is None:
        raise ReportError("the georeference of the map is unknown")
    return reference


def _mission_id(state: MissionState) -> str:
    """Return an identifier of a mission: the name of the ROS node, and the start of the first run."""
    node = str((state.runs[0].about.get("node") if state.runs else None) or "mission").strip("/")
    began = _moment(state.runs[0].began if state.runs else None)
    return f"{re.sub(r'[^a-zA-Z0-9_-]', '.', node)}.{began:{_STAMP}}"


def _moment(instant: EventTime | None) -> datetime:
    return datetime.fromisoformat(
        ((instant and instant.utc) or "1970-01-01T00:00:00Z").replace("Z", "+00:00")
    )


def _text(text: str) -> str:
    """Convert text to a single line, and remove characters that XML does not allow."""
    return speakable(escape_to_one_line(text))


def _to_plain_properties(data: dict[str, Any]) -> dict[str, Any]:
    """Return the data of a landmark, except positions, as GeoJSON properties with times in UTC."""
    return {
        key: value["utc"] if isinstance(value, dict) else value
        for key, value in data.items()
        if key not in ("position", "corners")
    }


def _is_counterclockwise(ring: list[tuple[float, float]]) -> bool:
    return sum((bx - ax) * (by + ay) for (ax, ay), (bx, by) in itertools.pairwise(ring)) < 0
