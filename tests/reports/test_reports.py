"""Tests of the report of a mission in each form, parsed by the libraries that its readers use."""

import base64
import html
import itertools
import json
import math
import os
import re
import sys
import xml.etree.ElementTree as ET
from datetime import datetime, timezone

import geojson
import pytest
import takproto
from cap_tools.models import Alert, Category, Certainty, ResponseType, Scope, Severity, Status, Urgency
from lxml import etree
from xsdata.formats.dataclass.parsers import XmlParser

from sar_compiler.journal.display import Display, changes_of_event, initial_display
from sar_compiler.journal.georeference import Georeference
from sar_compiler.journal.journal_entries import CHANGED, OF_EVERY_MISSION, JournalEntry
from sar_compiler.journal.mission_state import MissionState, RunProcess
from sar_compiler.missions.parameter_reader import ParameterReader
from sar_compiler.reports.mission_report import ReportError, report_data, report_text, require_form
from sar_compiler.reports.report_exchange import cot_report
from sar_compiler.reports.report_forms import FORMS
from sar_compiler.reports.report_html import html_report, report_map
from sar_compiler.style import COLOURS, MARKS
from search_and_rescue.plugin import SearchAndRescue
from search_and_rescue.search import _SENTENCES

NASTY = "<script>alert('x')</script>&\x1b[2J"
VIENNA = {"georeference.lat": 48.2, "georeference.lon": 16.37, "georeference.heading": 90.0}
PNG = base64.b64encode(b"\x89PNG and so on").decode()


ZONES = {f"zone_{letter}": (x, 1.0) for letter, x in (("a", 10.0), ("b", 20.0), ("c", 30.0))}
FENCE = [0.0, 0.0, 0.0, 9.0, 40.0, 9.0]


def with_display(stream):
    """Yield the entries of a search, each event followed by the changes of the mission's display, as in a run."""
    for entry in stream:
        yield entry
        if entry.kind == "run_began":
            search, shown = (
                SearchAndRescue().begin(ParameterReader(entry.data["run"]["parameters"])),
                Display(),
            )
            yield entry._replace(kind=CHANGED, data=initial_display(search.kinds, shown := search.display()))
        elif entry.kind in {*_SENTENCES, *OF_EVERY_MISSION}:
            search.apply(entry)
            before, shown = shown, search.display()
            yield entry._replace(
                kind=CHANGED, data=changes_of_event(entry, search.sentence(entry), before, shown)
            )


def mission(*told, simulated=False, parameters=VIENNA, ended=True, name=None, wall=1_700_000_000.0):
    """Return the state of a search with one survivor and three zones, one of which was abandoned."""
    tree = {"class": "Sequence", "name": "Main", "attributes": {}, "children": [], "file": "m.xml", "line": 2}
    about = {"mission": "search_and_rescue", "simulated": simulated, "tree": tree}
    plan = {
        "zone_order": [*ZONES],
        **{
            f"zones.{zone}.{key}": value
            for zone, at in ZONES.items()
            for key, value in zip("xy", at, strict=True)
        },
        **{f"base_station.{key}": 0.0 for key in ("x", "y", "yaw")},
    }
    run = {
        "parameters": {**plan, **parameters, "geofence": FENCE},
        "node": "/robot1/sar",
        "version": "0.1.0",
    }
    entries = [
        ("run_began", {**about, "run": run}),
        ("map", {"x": -1.0, "y": -2.0, "resolution": 0.5, "width": 100, "height": 30, "png": PNG}),
        ("pose", {"x": 0.0, "y": 0.0, "yaw": 0.0}),
        ("zone_started", {"zone": "zone_a"}),
        ("pose", {"x": 1.0, "y": 0.0, "yaw": 0.0}),
        ("zone_searched", {"zone": "zone_a", "survivor": [100.0, 0.0]}),
        ("survivor_named", {"survivor": "survivor_1", "x": 100.0, "y": 0.0, "possibly": None}),
        ("report_sent", {"survivor": "survivor_1"}),
        ("report_acknowledged", {"survivor": "survivor_1"}),
        ("zone_visited", {"zone": "zone_a"}),
        ("zone_abandoned", {"zone": "zone_b", "attempts": 2, "reason": ""}),
        *told,
        *(
            [("run_ended", {"ending": "over", "status": 1, "reason": "zone_b was abandoned."})]
            if ended
            else []
        ),
    ]
    stream = with_display(
        JournalEntry(at, 1, wall + at, float(at), kind, data) for at, (kind, data) in enumerate(entries)
    )
    renamed = {"mission": name or "search_and_rescue"}
    return MissionState.from_stream(
        entry._replace(data={**entry.data, **renamed}) if entry.kind == "run_began" else entry
        for entry in stream
    )


def shown(kind="survivor", name="survivor_2", state="candidate", **more):
    """Return an entry that adds a landmark to a mission's display."""
    return "changed", {
        "landmarks": [{"kind": kind, "name": name, "x": 1.0, "y": 1.0, "state": state, **more}]
    }


WATCHED = (
    ("properties_watched", {"properties": [{"name": name, "if_broken": "tell"} for name in "ab"]}),
    ("property_broken", {"property": "a", "event": "Drive aborted"}),
)


def alarm(text, **more):
    return "changed", {"alarms": [{"text": text, **more}]}


def mission_of(told):
    """Return the state of a mission from entries: run, wall time, kind, data."""
    return MissionState.from_stream(
        JournalEntry(number, run, wall, wall, kind, data)
        for number, (run, wall, kind, data) in enumerate(told)
    )


CONFIRMED = ("survivor_judged", {"survivor": "survivor_1", "standing": "confirmed", "same_as": None})
REJECTED = ("survivor_judged", {"survivor": "survivor_1", "standing": "rejected", "same_as": None})
PLACE = {"name": "place", "plural": "places"}
PATROL = [("photo_taken", {"photo": "photo_1", "points": ["yard", 2]}), ("point_left", {})]
NAMELESS = ("zone_searched", {"zone": "zone_b", "survivor": [9.0, 9.0]})


class TestGeoreference:
    @pytest.mark.parametrize(
        ("heading", "x", "y", "lat", "lon"),
        [
            (90.0, 1000.0, 0.0, 0.0, 0.00898315),  # x is east
            (90.0, 0.0, 1000.0, 0.00904369, 0.0),  # y is north
            (0.0, 1000.0, 0.0, 0.00904369, 0.0),  # x is north
            (0.0, 0.0, 1000.0, 0.0, -0.00898315),  # y is west
        ],
    )
    def test_map_position_is_converted_to_coordinates(self, heading, x, y, lat, lon):
        assert Georeference(0.0, 0.0, heading).to_coordinates(x, y) == pytest.approx((lat, lon), abs=1e-8)

    def test_incomplete_georeference_is_none(self):
        assert Georeference.from_parameters(VIENNA) == (48.2, 16.37, 90.0)
        assert Georeference.from_parameters({"georeference.lat": 48.2}) is None

    @pytest.mark.parametrize(
        ("name", "value"),
        [
            ("lat", 90.1),
            ("lat", -91),
            ("lon", 180.5),
            ("heading", math.inf),
            *((n, math.nan) for n in ("lat", "lon")),
        ],
    )
    def test_georeference_outside_valid_range_is_none(self, name, value):
        assert Georeference.from_parameters({**VIENNA, f"georeference.{name}": value}) is None


HEAD = "6bd4f795" * 8


@pytest.mark.parametrize("form", [".html", ".json", ".geojson", ".kml"])
def test_report_contains_head_of_journal(form):
    ended = ("run_ended", {"ending": "over", "status": 1, "reason": "", "head": HEAD})
    assert HEAD in report_text(mission(ended, ended=False), f"r{form}")


class TestJson:
    def test_survivor_has_position_and_times_of_detection_and_acknowledgement(self):
        data = json.loads(report_text(mission(), "r.json"))
        (survivor,) = data["landmarks"]["survivors"]
        assert survivor["position"] == {"x": 100.0, "y": 0.0, "lat": 48.19999999, "lon": 16.37134523}
        assert (survivor["state"], survivor["level"], survivor["report"]) == (
            "candidate",
            "done",
            "acknowledged",
        )
        assert survivor["found"] == {"run": 1, "time": 5.0, "utc": "2023-11-14T22:13:25Z"}
        assert survivor["acknowledged"]["time"] == 8.0
        assert {zone["name"]: zone["state"] for zone in data["landmarks"]["zones"]} == {
            "zone_a": "visited",
            "zone_b": "abandoned",
            "zone_c": "open",
        }
        assert (data["outcome"], data["reason"]) == ("failed", "zone_b was abandoned.")
        assert [(each["name"], each["value"], each["of"]) for each in data["figures"]][:2] == [
            ("zones visited", 1, 3),
            ("survivors found", 1, None),
        ]
        assert [pose["x"] for pose in data["path"]] == [0.0, 1.0]

    def test_events_have_data_and_text(self):
        data = json.loads(report_text(mission(*PATROL), "r.json"))
        assert [(each["time"], each["kind"], each["data"], each["text"]) for each in data["facts"][-2:]] == [
            (
                11.0,
                "photo_taken",
                {"photo": "photo_1", "points": ["yard", 2]},
                'photo taken: photo: photo_1, points: ["yard", 2]',
            ),
            (12.0, "point_left", {}, "point left"),
        ]
        assert data["facts"][0]["text"] == "set out for zone_a"

    def test_alarm_has_time_of_its_first_report(self):
        (told,) = report_data(mission(alarm("low"), alarm("low", is_over=True)))["alarms"]
        assert (told["text"], told["time"], told["is_over"]) == ("low", 11.0, True)

    def test_property_has_verdict_and_time_and_event_of_violation(self):
        assert report_data(mission())["properties"] == []
        broken, kept = report_data(mission(*WATCHED))["properties"]
        assert (broken["name"], broken["verdict"], broken["event"]) == ("a", "broken", "Drive aborted")
        assert broken["broken"]["time"] == 12.0
        assert (kept["name"], kept["verdict"], kept["broken"]) == ("b", "kept", None)

    def test_positions_are_map_coordinates_without_georeference(self):
        (survivor,) = report_data(mission(parameters={}))["landmarks"]["survivors"]
        assert survivor["position"] == {"x": 100.0, "y": 0.0}

    def test_details_of_landmark_do_not_replace_its_standard_fields(self):
        told = shown(name="a", details={"name": "b", "height": 3.0})
        survivor = report_data(mission(told))["landmarks"]["survivors"][-1]
        assert (survivor["name"], survivor["height"]) == ("a", 3.0)

    def test_report_states_its_time(self):
        assert report_data(mission())["as_of"] == "2023-11-14T22:13:31Z"
        assert report_data(MissionState())["as_of"] is None

    def test_outcome_of_unfinished_run_is_its_phase_until_process_is_gone(self):
        state = mission(ended=False)
        assert report_data(state)["outcome"] == "working"
        state.process = RunProcess(is_gone=True)
        assert report_data(state)["outcome"] == "crashed"


class TestGeoJson:
    def features(self, *told):
        read = geojson.loads(report_text(mission(*told), "r.geojson"))
        assert read.is_valid, read.errors()
        return read["features"]

    def test_longitude_comes_first(self):
        (survivor,) = [each for each in self.features() if each["properties"]["kind"] == "survivor"]
        assert survivor["geometry"]["coordinates"] == pytest.approx([16.3713452, 48.2], abs=1e-6)

    def test_each_landmark_and_path_is_a_feature(self):
        kinds = sorted(each["properties"]["kind"] for each in self.features())
        assert kinds == ["base", "geofence", "path", "survivor", "zone", "zone", "zone"]

    def test_ring_of_area_is_closed_and_counterclockwise(self):
        (fence,) = [each for each in self.features() if each["properties"]["kind"] == "geofence"]
        (ring,) = fence["geometry"]["coordinates"]
        area = sum(ax * by - bx * ay for (ax, ay), (bx, by) in itertools.pairwise(ring))
        assert ring[0] == ring[-1]
        assert area > 0

    def test_rejected_survivor_is_included_as_rejected(self):
        (survivor,) = [each for each in self.features(REJECTED) if each["properties"]["kind"] == "survivor"]
        assert (survivor["properties"]["state"], survivor["properties"]["level"]) == ("rejected", "given_up")

    @pytest.mark.parametrize("simulated", [True, False])
    def test_each_feature_states_if_it_is_simulated(self, simulated):
        text = report_text(mission(simulated=simulated), "r.geojson")
        assert {each["properties"]["simulated"] for each in json.loads(text)["features"]} == {simulated}

    def test_control_characters_and_lone_surrogates_are_escaped(self):
        text = report_text(mission(shown(name="\u202e\x1b[2J\ud800")), "r.geojson")
        assert r"\u202e\u001b[2J\ud800" in text
        assert text.encode().isascii()


OGC = "{http://www.opengis.net/kml/2.2}"
# The order of child elements in the standard, for the elements that are used here.
OGC_ORDER = {
    "kml": ["Document"],
    "Document": ["name", "description", "Placemark"],
    "Placemark": ["name", "description", "Style", "Point", "LineString", "Polygon"],
    "Style": ["IconStyle", "LineStyle", "PolyStyle"],
    "IconStyle": ["color", "scale"],
    "LineStyle": ["color", "width"],
    "PolyStyle": ["color"],
    "Point": ["coordinates"],
    "LineString": ["tessellate", "coordinates"],
    "Polygon": ["outerBoundaryIs"],
    "outerBoundaryIs": ["LinearRing"],
    "LinearRing": ["coordinates"],
}


class TestKml:
    def read(self, *told, **about):
        return etree.fromstring(report_text(mission(*told, **about), "r.kml").encode())

    def placemarks(self, *told, **about):
        return {
            each.findtext(f"{OGC}name"): each for each in self.read(*told, **about).iter(f"{OGC}Placemark")
        }

    def test_elements_have_order_of_ogc_schema(self):
        for element in self.read().iter():
            names = [each.tag.removeprefix(OGC) for each in element]
            order = OGC_ORDER.get(element.tag.removeprefix(OGC), [])
            assert names == sorted(names, key=order.index)

    def test_each_landmark_and_path_is_a_placemark(self):
        assert sorted(self.placemarks()) == [
            f"robot1/{name}"
            for name in ("base station", "geofence", "run 1", "survivor_1", "zone_a", "zone_b", "zone_c")
        ]

    def test_longitude_comes_first_and_ring_is_closed(self):
        marks = self.placemarks()
        assert marks["robot1/survivor_1"].findtext(f".//{OGC}coordinates") == "16.37134523,48.19999999"
        ring = marks["robot1/geofence"].findtext(f".//{OGC}coordinates").split()
        assert (len(ring), ring[0]) == (4, ring[-1])
        way = marks["robot1/run 1"].findtext(f".//{OGC}coordinates").split()
        assert way == ["16.37000000,48.20000000", "16.37001345,48.20000000"]

    def test_description_names_kind_and_state(self):
        said = {name: each.findtext(f"{OGC}description") for name, each in self.placemarks().items()}
        assert said["robot1/survivor_1"].startswith(
            "survivor: candidate; found in zone_a at (100.00, 0.00) m on the robot's map"
        )
        assert said["robot1/zone_b"] == "zone: abandoned, after attempt 2"
        assert said["robot1/base station"] == "base"

    def test_description_of_outline_lists_its_nonempty_details(self):
        corners = [[0.0, 0.0], [4.0, 0.0], [4.0, 4.0]]
        details = {"POD": "61.8%", "sweep width W": "3.2 m", "area A": "", "gaps": 0}
        area = shown("geofence", "yard", "9 of 9 pieces", corners=corners, details=details)
        told = self.placemarks(area)["robot1/yard"].findtext(f"{OGC}description")
        assert told == "geofence: 9 of 9 pieces; POD 61.8%; sweep width W 3.2 m; gaps 0"

    @pytest.mark.parametrize(
        ("told", "name", "colour"),
        [
            ([], "survivor_1", "warning"),
            ([REJECTED], "survivor_1", "quiet"),
            ([shown("zone", "zone_a", "searched", level=2)], "zone_a", "success"),
            ([shown("zone", "zone_c", "under way", level=1)], "zone_c", "running"),
            ([], "zone_b", "failure"),
            ([], "zone_c", "quiet"),
            ([], "run 1", "trail"),
        ],
    )
    def test_placemark_has_colour_of_dark_page(self, told, name, colour):
        red, green, blue = re.findall("[0-9a-f]{2}", COLOURS[colour].dark)
        drawn = self.placemarks(*told)[f"robot1/{name}"].findtext(f".//{OGC}IconStyle/{OGC}color")
        assert drawn == f"ff{blue}{green}{red}"

    def test_confirmed_survivor_has_larger_icon(self):
        scales = [
            self.placemarks(*told)["robot1/survivor_1"].findtext(f".//{OGC}IconStyle/{OGC}scale")
            for told in ([], [CONFIRMED])
        ]
        assert scales == [None, "1.4"]

    def test_area_is_transparent(self):
        assert self.placemarks()["robot1/geofence"].findtext(f".//{OGC}PolyStyle/{OGC}color")[:2] == "40"

    def test_placemarks_of_simulation_are_marked_as_simulated(self):
        marks = self.placemarks(simulated=True).values()
        assert all(each.findtext(f"{OGC}description").startswith("SIMULATED. ") for each in marks)

    def test_markup_in_names_is_escaped_in_description(self):
        marks = self.placemarks(shown(name=NASTY, state=NASTY))
        mark = marks["robot1/" + NASTY.replace("\x1b", r"\x1b")]
        assert "survivor: &lt;script&gt;alert('x')&lt;/script&gt;&amp;" in mark.findtext(f"{OGC}description")


def parse_tak_event(line):
    return takproto.parse_proto(takproto.xml2proto(line)).cotEvent


class TestCursorOnTarget:
    def test_tak_parses_event_of_each_survivor(self):
        (line,) = report_text(mission(CONFIRMED), "r.cot").splitlines()
        event = parse_tak_event(line)
        assert (event.type, event.how) == ("b-m-p-s-m", "m-g")
        assert (event.lat, event.lon) == pytest.approx((48.2, 16.3713452), abs=1e-6)
        assert event.detail.contact.callsign == "robot1/survivor_1"
        assert ET.fromstring(line).get("version") == "2.0"  # noqa: S314 - our own

    def test_event_starts_at_detection_and_expires_one_day_after_sending(self):
        made = datetime(2024, 2, 28, 12, 0, tzinfo=timezone.utc)
        event = parse_tak_event(cot_report(mission(), made))
        assert event.startTime == 1_700_000_005_000
        assert event.sendTime == made.timestamp() * 1000
        assert event.staleTime == datetime(2024, 2, 29, 12, 0, tzinfo=timezone.utc).timestamp() * 1000

    def uids(self, *told, **about):
        return [
            ET.fromstring(line).get("uid")  # noqa: S314 - our own
            for line in report_text(mission(*told, **about), "r.cot").splitlines()
        ]

    def test_survivors_of_different_missions_have_different_uids(self):
        assert self.uids() == ["robot1.sar.20231114T221320Z.1"]
        assert self.uids(wall=1_700_086_400.0) == ["robot1.sar.20231115T221320Z.1"]

    def test_uid_of_survivor_is_independent_of_review_and_name(self):
        named = ("survivor_named", {"survivor": "survivor_2", "x": 9.0, "y": 9.0})
        later = [self.uids(NAMELESS, *told)[-1] for told in ((), (REJECTED,), (named,))]
        assert set(later) == {"robot1.sar.20231114T221320Z.2"}

    def test_rejected_survivor_has_no_event(self):
        assert report_text(mission(REJECTED), "r.cot") == ""

    def test_event_of_simulation_is_marked_as_simulated(self):
        text = report_text(mission(simulated=True), "r.cot")
        assert parse_tak_event(text).detail.contact.callsign == "SIM robot1/survivor_1"
        assert "SIMULATED" in text

    def test_markup_and_control_characters_are_escaped(self):
        told = shown(name=NASTY, state="a\nb\ud800\uffff", level=1)
        line = report_text(mission(told), "r.cot").splitlines()[1]
        assert parse_tak_event(line).detail.contact.callsign == "robot1/" + NASTY.replace("\x1b", r"\x1b")
        assert r">a\nb\ud800\ufffd; found" in line.replace("\ufffd", r"\ufffd")


class TestCommonAlertingProtocol:
    def read(self, *told, **about):
        return XmlParser().from_string(report_text(mission(*told, **about), "r.cap"), Alert)

    def test_alert_has_info_with_circle_for_each_survivor(self):
        alert = self.read()
        assert (alert.status, alert.scope) == (Status.ACTUAL, Scope.RESTRICTED)
        assert alert.note == "FAILED: zone_b was abandoned."
        (info,) = alert.infos
        assert info.headline == "robot1/survivor_1: candidate"
        assert (info.language, info.categories, info.response_types) == (
            "en-US",
            [Category.RESCUE],
            [ResponseType.EXECUTE],
        )
        assert (info.urgency, info.severity) == (Urgency.IMMEDIATE, Severity.SEVERE)
        assert info.areas[0].area_desc == "zone_a"
        place, radius = info.areas[0].circles[0].split()
        assert [float(each) for each in place.split(",")] == pytest.approx([48.2, 16.3713452], abs=1e-7)
        assert radius == "0.002"

    def test_sent_time_has_format_of_standard(self):
        text = report_text(mission(), "r.cap")
        # The standard writes UTC as -00:00, without Z and without a plus sign.
        assert ET.fromstring(text).findtext("{*}sent") == "2023-11-14T22:13:31-00:00"  # noqa: S314 - our own

    def test_alerts_of_different_times_or_missions_have_different_identifiers(self):
        identifiers = [
            self.read(ended=ended, wall=wall).identifier
            for ended, wall in ((False, 1_700_000_000.0), (True, 1_700_000_000.0), (True, 1_700_000_100.0))
        ]
        assert identifiers == [
            "robot1.sar.20231114T221320Z-20231114T221330Z",
            "robot1.sar.20231114T221320Z-20231114T221331Z",
            "robot1.sar.20231114T221500Z-20231114T221511Z",
        ]

    def test_confirmed_survivor_is_observed_and_others_are_likely(self):
        assert self.read().infos[0].certainty is Certainty.LIKELY
        assert self.read(CONFIRMED).infos[0].certainty is Certainty.OBSERVED

    def test_alert_of_simulation_is_an_exercise(self):
        assert self.read(simulated=True).status is Status.EXERCISE

    def test_rejected_survivor_has_no_info(self):
        assert self.read(REJECTED).infos == []


def texts(page):
    """Return the visible text of a page."""
    body = re.sub(r"<style>.*?</style>", "", page, flags=re.DOTALL)
    return html.unescape(re.sub(r"<[^>]*>", "\n", body))


def percent(value, name="share seen"):
    return ("changed", {"figures": [{"name": name, "value": value, "unit": "%"}]})


class TestFigureHistory:
    def test_percentage_figure_is_kept_with_time_of_each_change(self):
        data = report_data(mission(percent(10), percent(40.5)))
        assert [each["value"] for each in data["courses"]["share seen"]] == [10, 40.5]
        assert all(each["utc"] for each in data["courses"]["share seen"])

    def test_changed_figure_is_drawn_as_steps_between_0_and_100(self):
        page = html_report(mission(percent(10), percent(150)))
        [points] = re.findall(r'<polyline class="course" points="([^"]+)"', page)
        heights = [float(point.partition(",")[2]) for point in points.split()]
        assert heights == [131.0, 131.0, 5.0, 5.0]
        assert "<h2>Share seen</h2>" in page
        assert 'aria-label="share seen: 10 % at the start, 150 % at the end"' in page

    @pytest.mark.parametrize(
        "told", [[percent(10)], [percent(10), percent(10)], [percent(math.nan), percent(10)]]
    )
    def test_unchanged_or_non_numeric_figure_is_not_drawn(self, told):
        assert 'polyline class="course"' not in html_report(mission(*told))

    def test_markup_in_figure_name_is_escaped(self):
        page = html_report(mission(percent(1, "<b>"), percent(2, "<b>")))
        assert "<b>" not in page
        assert "&lt;b&gt;" in page


class TestHtml:
    def test_page_is_self_contained(self):
        page = html_report(mission())
        assert re.findall(r"""(?:src|href)=["'](?!data:)""", page) == []
        assert "@import" not in page
        assert "url(" not in page
        assert "<script" not in page
        policy = re.search('<meta http-equiv="Content-Security-Policy" content="([^"]*)">', page)
        assert policy is not None
        assert policy[1].startswith("default-src 'none'; style-src 'unsafe-inline'; img-src data:;")
        assert page.index(policy[0]) < page.index("<title>")

    def test_page_shows_outcome_and_survivor_positions(self):
        read = texts(html_report(mission()))
        for words in (
            "FAILED: zone_b was abandoned.",
            "survivor_1",
            "candidate",
            "100.00, 0.00",
            "48.2000000",
        ):
            assert words in read

    def test_unfinished_zones_are_listed_at_top_by_state(self):
        head, tables = html_report(mission(("zone_visited", {"zone": "zone_c"}))).split(
            '<section class="second">'
        )
        lacking = (("abandoned", "zone_b (after attempt 2)"), ("visited, not searched", "zone_c"))
        assert "".join(f"<dt>{state}</dt><dd>{places}</dd>" for state, places in lacking) in head
        assert "<dt>zones visited</dt><dd>2 of 3</dd>" in head
        for words in ("visited, not searched", "abandoned: after attempt 2"):
            assert words in texts(tables)

    def steps(self, *told, **about):
        part = html_report(mission(*told, **about)).partition("<h2>What to do next</h2>")[2]
        return [html.unescape(each) for each in re.findall("<li>(.*?)</li>", part.partition("<h2>")[0])]

    def test_next_steps_list_survivors_robot_and_unsearched_zones(self):
        assert self.steps() == [
            "Go to survivor_1 at 48.2000000, 16.3713452 (not confirmed)",
            "Fetch the robot: it has not reached base station",
            "Send people to search zone_b: abandoned",
            "Send people to search zone_c: not reached",
        ]

    def test_next_steps_mark_confirmed_survivor_and_omit_rejected_one(self):
        assert "(confirmed)" in self.steps(CONFIRMED)[0]
        assert not any("survivor_1" in step for step in self.steps(REJECTED))

    def test_next_steps_ask_to_report_survivor_with_unfinished_report(self):
        steps = self.steps(shown(name="survivor_2", level=1))
        assert "Report survivor_2 yourself: the mission did not finish reporting it" in steps

    def test_next_steps_ask_for_georeference_if_positions_are_on_map_only(self):
        first, *_, last = self.steps(parameters={})
        assert first.startswith("Go to survivor_1 at 100.00, 0.00 (")
        assert "--georeference LAT,LON,HEADING" in last
        assert not any("--georeference" in step for step in self.steps(REJECTED, parameters={}))

    def test_next_steps_ask_for_later_report_of_unfinished_mission(self):
        assert self.steps(ended=False)[-1].startswith(
            "Ask for a later report: the run had not ended at 2023-11-1"
        )

    def test_properties_are_in_engineers_section(self):
        page = html_report(mission(*WATCHED))
        _, _, table = page.partition('<section class="annex">')[2].partition("<h2>Properties</h2>")
        rows = re.findall(r"<tr.*?</tr>", table.partition("</table>")[0])
        assert [re.findall(r">([^<>]+)</td>", row)[:2] for row in rows[1:]] == [
            ["a", "broken"],
            ["b", "kept"],
        ]
        assert "<h2>Properties</h2>" not in html_report(mission())

    @pytest.mark.parametrize(
        ("parameters", "letters"), [(VIENNA, ["N"]), ({}, ["y", "x"])], ids=["on the earth", "nowhere"]
    )
    def test_map_shows_north_or_its_axes_if_north_is_unknown(self, parameters, letters):
        sign = re.findall(r'<g class="north".*?</g>', html_report(mission(parameters=parameters)))
        assert re.findall("<text[^>]*>(.)</text>", sign[0]) == letters
        turned = html_report(mission(parameters={**VIENNA, "georeference.heading": 0.0}))
        assert 'rotate(90.0)"><path d="M0 -15' in turned

    def test_page_states_limits_of_report(self):
        limits = lambda *told, **more: html_report(mission(*told, **more)).partition("<h2>Limits")[2]  # noqa: E731
        assert "No person has confirmed survivor_1." in limits()
        assert "No person has confirmed" not in limits(CONFIRMED)
        assert "Positions are coordinates on the robot&#39;s map, not latitude and longitude." in limits(
            parameters={}
        )
        assert "not latitude and longitude" not in limits()
        assert "The end of the run is not recorded." in limits(ended=False)

    def test_mission_without_open_tasks_states_so(self):
        assert "There are no open tasks." in html_report(MissionState())

    def test_engineers_section_comes_last_and_is_not_printed(self):
        page = html_report(mission(alarm("low"), *PATROL))
        first, engineers = page.split('<section class="annex">')
        heads = [re.findall("<h2>(.*?)</h2>", part) for part in (first, engineers)]
        assert heads == [
            [
                "What to do next",
                "Map",
                "Result",
                "Survivors",
                "Zones",
                "Events",
                "Alarms",
                "Limits of this report",
            ],
            ["All events", "Warnings and errors", "Parameters", "Tree"],
        ]
        assert ".annex { display: none }" in page.partition("@media print")[2]

    def test_page_states_location_of_robot(self):
        def robot(*told):
            (said,) = re.findall("<dt>robot</dt><dd>([^<]*)</dd>", html_report(mission(*told)))
            return said

        assert robot() == "last seen at (1.00, 0.00)"
        assert robot(("base_reached", {})) == "at base station"

    def test_page_of_unfinished_mission_states_its_time(self):
        assert "as of\n\n2023-11-1" in texts(html_report(mission(ended=False)))
        assert "as of" not in texts(html_report(mission()))

    def test_map_labels_state_of_unfinished_zones(self):
        said = re.findall(r'<text class="label (?:said)?" [^>]*>([^<]*)</text>', report_map(mission()))
        assert said == ["zone_a", "zone_b", "abandoned", "zone_c", "open", "base station"]

    def test_survivor_at_unusable_position_is_alarm_until_zone_is_searched_again(self):
        unplaced = ("survivor_unplaced", {"zone": "zone_c", "reason": "(nan, 1.0) is not a position"})
        again = ("zone_searched", {"zone": "zone_c", "survivor": None})
        said = "There is a survivor at an unusable position in zone_c: (nan, 1.0) is not a position"
        for told, is_over in (([unplaced], False), ([unplaced, again], True)):
            (alarm,) = report_data(mission(*told))["alarms"]
            assert (alarm["text"], alarm["is_over"]) == (said, is_over)
            assert said in html_report(mission(*told))

    def test_legend_lists_exactly_the_symbols_on_map(self):
        found = ("survivor_named", {"survivor": "survivor_2", "x": 1.0, "y": 1.0})
        square = ("changed", {"kinds": [{"name": "box", "plural": "boxes", "shape": "square"}]})
        page = html_report(mission(found, REJECTED, ("zone_visited", {"zone": "zone_c"})))
        drawn, rest = page.split('<ul class="legend">')
        items = rest.split("</ul>")[0]
        known = r'<(?:g|polygon|path|polyline) class="([^"]+)"'
        # The symbol of the directions is labelled and is not in the legend.
        classes = set(re.findall(known, drawn)) - {"north"}
        assert classes == {
            "mark done",
            "mark given-up",
            "mark given-up found",
            "mark in-hand found",
            "mark to-come",
            "area to-come",
            "trail",
        }
        assert set(re.findall(known, items)) == classes
        words = re.findall("</svg>([^<]*)</li>", items)
        assert words == [
            "zone, visited",
            "zone, abandoned",
            "zone, visited, not searched",
            "base",
            "geofence",
            "survivor, rejected",
            "survivor, candidate",
            "path of the robot",
        ]
        assert f'<path d="{MARKS["square"]}"/>' in html_report(mission(square, shown("box", "b", "")))

    def test_times_state_day_and_run_if_there_are_several(self):
        began: dict[str, object] = {"run": {}}
        noon = datetime(2024, 2, 28, 12, 0).timestamp()  # noqa: DTZ001 - the page's times are local
        told = [(1, noon, "run_began", began), (1, noon + 5, "first", {})]
        assert "\n12:00:05 (0:05)\n" in texts(html_report(mission_of(told)))
        told += [(1, noon + 86400, "next", {})]
        assert "\n2024-02-29 12:00:00 (24:00:00)\n" in texts(html_report(mission_of(told)))
        told += [(2, noon + 86400, "run_began", began), (2, noon + 86402, "last", {})]
        read = texts(html_report(mission_of(told)))
        assert "\nrun 1, 12:00:05 (0:05)\n" in read
        assert "\nrun 2, 2024-02-29 12:00:02 (0:02)\n" in read

    def test_unreported_survivor_is_highlighted(self):
        found = ("survivor_named", {"survivor": "survivor_2", "x": 1.0, "y": 1.0})
        kept = ("report_kept", {"survivor": "survivor_2", "x": 1.0, "y": 1.0})
        page = html_report(mission(found, kept))
        rows = dict(re.findall(r'<tr class="([^"]* found)"><td [^>]*>([^<]*)<', page))
        assert rows == {"done found": "survivor_1", "in-hand found": "survivor_2"}
        assert "tr.found.in-hand td { color: var(--failure) }" in page

    def test_page_lists_errors_alarms_and_commands(self):
        told = [
            ("log", {"node": "bt_navigator", "level": 40, "text": "Goal aborted"}),
            ("alarmed", {"reason": "the battery is at 12 %"}),
            ("ordered", {"verb": "go_home", "label": "Go home", "by": "Ada"}),
            ("command_given", {"command": "go_home", "by": "the operator"}),
        ]
        read = texts(html_report(mission(*told)))
        for words in ("Goal aborted", "the battery is at 12 %", "Ada: Go home", "go home"):
            assert words in read

    def test_all_events_have_text(self):
        (table,) = re.findall("<h2>All events</h2>(.*?)<h2>", html_report(mission(*PATROL)))
        cells = re.findall('data-head="event">([^<]*)</td>', table)
        assert [html.unescape(cell) for cell in cells[-2:]] == [
            'photo taken: photo: photo_1, points: ["yard", 2]',
            "point left",
        ]

    def test_page_limits_events_and_states_number_of_omitted_ones(self):
        page = html_report(mission(*[("reading", {"at": each}) for each in range(996)]))
        assert page.count('<td class="text" data-head="event">') == 1000 + 12
        assert "3 more are in the journal." in page

    def test_path_of_robot_is_drawn_over_map(self):
        page = html_report(mission())
        assert f"data:image/png;base64,{PNG}" in page
        assert '<polyline class="trail" points="0.000,-0.000 1.000,-0.000"/>' in page

    def test_invalid_map_image_is_omitted(self):
        (change,) = [
            ("map", {"x": 0, "y": 0, "resolution": 1, "width": 1, "height": 1, "png": '"/><script>'})
        ]
        assert "<image" not in html_report(mission(change))

    @pytest.mark.parametrize(("yaw", "is_drawn"), [(1e-9, True), (-1e-9, True), (0.1, False), (-0.1, False)])
    def test_map_is_drawn_only_if_its_rotation_is_negligible(self, yaw, is_drawn):
        change = ("map", {"x": 0, "y": 0, "resolution": 1, "width": 1, "height": 1, "png": PNG, "yaw": yaw})
        assert ("<image" in html_report(mission(change))) == is_drawn

    @pytest.mark.parametrize(
        "told",
        [
            ("photo_taken", {"\ud800": math.nan, "photo": ["\ud800"], "more": {"a": None}}),
            ("map", {"x": 0, "y": 0, "resolution": 1, "width": math.inf, "height": 1, "png": PNG}),
            ("pose", {"x": 1e308, "y": 0.0, "yaw": 0.0}),
            shown(state="\ud800", reason="\ud800", details={"\ud800": "\ud800"}),
            ("status", {"node": 0, "tick": 1, "status": "\ud800", "message": "\ud800"}),
        ],
    )
    def test_invalid_values_do_not_prevent_any_report_form(self, told):
        for ending in FORMS:
            assert report_text(mission(told), f"r{ending}").encode()

    def test_extremely_distant_landmark_yields_no_map(self):
        far = {"landmarks": [{"kind": "place", "name": "far", "x": 1e17, "y": 0.0}], "kinds": [PLACE]}
        state = MissionState.from_stream([JournalEntry(1, 1, 0.0, 0.0, "changed", far)])
        assert state.situation.landmarks
        assert report_map(state) == ""

    def test_page_of_simulation_warns_readers_and_has_no_next_steps(self):
        page = texts(html_report(mission(simulated=True)))
        assert "\nSIMULATED. Do not act on this report: no real people were involved.\n" in page
        assert "Go to survivor_1" not in page
        patrol = MissionState.from_stream(
            [JournalEntry(1, 1, 0.0, 0.0, "run_began", {"simulated": True, "run": {}})]
        )
        assert "\nSIMULATED. Do not act on this report.\n" in texts(html_report(patrol))

    @pytest.mark.parametrize(
        "told",
        [
            ("changed", {"kinds": [{"name": NASTY, "plural": NASTY, "shape": NASTY, "event": NASTY}]}),
            shown(name=NASTY, state='"><script>', reason=NASTY, within=NASTY, details={NASTY: NASTY}),
            shown("place", NASTY, NASTY),
            shown(NASTY, NASTY, '"><script>', corners=[[0, 0], [1, 1], [2, 0]]),
            ("changed", {"figures": [{"name": NASTY, "value": 1, "unit": NASTY}]}),
            ("log", {"node": NASTY, "level": 40, "text": NASTY}),
            alarm(NASTY),
            ("changed", {"phase": {"name": NASTY, "reason": NASTY, "place": NASTY}}),
            ("status", {"node": 0, "tick": 1, "status": '"><script>', "message": NASTY}),
            ("photo_taken", {"photo": NASTY}),
            (NASTY, {NASTY: [NASTY, {NASTY: NASTY}]}),
            ("run_ended", {"ending": NASTY, "status": 1, "reason": NASTY}),
        ],
    )
    def test_markup_and_control_characters_are_escaped(self, told):
        page = html_report(mission(told, name=NASTY))
        assert "<script" not in page
        assert "\x1b" not in page

    def test_empty_journal_has_page(self):
        assert "not begun" in html_report(MissionState())


class TestRequireForm:
    @pytest.mark.parametrize("ending", sorted(FORMS))
    def test_each_form_is_accepted(self, ending, tmp_path):
        require_form(tmp_path / f"report{ending}", Georeference(48.2, 16.37, 90.0))

    @pytest.mark.parametrize("ending", [".geojson", ".kml", ".cot", ".cap"])
    def test_world_coordinate_forms_require_georeference(self, ending, tmp_path):
        with pytest.raises(
            ReportError, match=r"Add georeference: {lat: …, lon: …, heading: …} to the parameter file"
        ):
            require_form(tmp_path / f"report{ending}", None)

    def test_unknown_file_name_ending_is_rejected(self, tmp_path):
        with pytest.raises(
            ReportError,
            match=r"the report format of .*report.pdf is unknown \(known file name endings: \.html, \.json, \.geojson, \.kml, \.cot, \.cap\)",
        ):
            require_form(tmp_path / "report.pdf", None)

    def test_missing_folder_is_rejected(self, tmp_path):
        with pytest.raises(ReportError, match="does not exist"):
            require_form(tmp_path / "not" / "report.html", None)

    def test_folder_instead_of_file_is_rejected(self, tmp_path):
        (tmp_path / "r.html").mkdir()
        with pytest.raises(ReportError, match="it is a folder"):
            require_form(tmp_path / "r.html", None)

    def test_folder_without_write_permission_is_rejected(self, tmp_path, monkeypatch):
        # The tests may run as root, who may write to every folder.
        monkeypatch.setattr(os, "access", lambda path, mode: (path, mode) != (tmp_path, os.W_OK))
        with pytest.raises(ReportError, match=f"you do not have permission to write to {tmp_path}"):
            require_form(tmp_path / "r.html", None)

    def test_device_is_accepted_in_folder_without_write_permission(self, tmp_path, monkeypatch):
        monkeypatch.setattr(os, "access", lambda path, _: path != tmp_path)
        (tmp_path / "r.html").symlink_to(os.devnull)
        require_form(tmp_path / "r.html", None)

    @pytest.mark.parametrize(
        ("ending", "library"),
        [
            *((ending, "pyproj") for ending in sorted(FORMS)),
            (".geojson", "geojson"),
            (".cap", "cap_tools"),
            (".cap", "xsdata"),
        ],
    )
    def test_missing_library_is_rejected(self, ending, library, tmp_path, monkeypatch):
        monkeypatch.setitem(sys.modules, library, None)
        with pytest.raises(ImportError, match=library):
            require_form(tmp_path / f"report{ending}", Georeference(48.2, 16.37, 90.0))
