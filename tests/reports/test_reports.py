"""The report of a mission, in each form, read back by the libraries that others read it with."""

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
    """Yield entries of a search, each fact with the changes of the mission's display behind it, as a run writes them."""
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
    """Return a search with a survivor and three zones, of which one was given up."""
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
    """Return an entry that has a mission show a landmark."""
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
    """Return a mission by the run, the time of the system's clock, the kind and the data of each entry."""
    return MissionState.from_stream(
        JournalEntry(number, run, wall, wall, kind, data)
        for number, (run, wall, kind, data) in enumerate(told)
    )


CONFIRMED = ("survivor_judged", {"survivor": "survivor_1", "standing": "confirmed", "same_as": None})
REJECTED = ("survivor_judged", {"survivor": "survivor_1", "standing": "rejected", "same_as": None})
PLACE = {"name": "place", "plural": "places"}
PATROL = [("photo_taken", {"photo": "photo_1", "points": ["yard", 2]}), ("point_left", {})]
NAMELESS = ("zone_searched", {"zone": "zone_b", "survivor": [9.0, 9.0]})


class TestWhereTheMapLies:
    @pytest.mark.parametrize(
        ("heading", "x", "y", "lat", "lon"),
        [
            (90.0, 1000.0, 0.0, 0.0, 0.00898315),  # x is east
            (90.0, 0.0, 1000.0, 0.00904369, 0.0),  # y is north
            (0.0, 1000.0, 0.0, 0.00904369, 0.0),  # x is north
            (0.0, 0.0, 1000.0, 0.0, -0.00898315),  # y is west
        ],
    )
    def test_a_position_on_the_map_is_one_on_the_earth(self, heading, x, y, lat, lon):
        assert Georeference(0.0, 0.0, heading).to_coordinates(x, y) == pytest.approx((lat, lon), abs=1e-8)

    def test_it_is_known_only_if_all_of_it_is_said(self):
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
    def test_it_is_a_place_on_the_earth(self, name, value):
        assert Georeference.from_parameters({**VIENNA, f"georeference.{name}": value}) is None


HEAD = "6bd4f795" * 8


@pytest.mark.parametrize("form", [".html", ".json", ".geojson", ".kml"])
def test_the_head_of_the_journal_is_told_where_a_report_has_a_place_for_it(form):
    ended = ("run_ended", {"ending": "over", "status": 1, "reason": "", "head": HEAD})
    assert HEAD in report_text(mission(ended, ended=False), f"r{form}")


class TestJson:
    def test_it_has_who_was_found_where_and_when_base_knew(self):
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

    def test_it_has_what_has_happened(self):
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

    def test_an_alarm_says_since_when_it_is_there(self):
        (told,) = report_data(mission(alarm("low"), alarm("low", is_over=True)))["alarms"]
        assert (told["text"], told["time"], told["is_over"]) == ("low", 11.0, True)

    def test_each_watched_property_has_its_verdict_and_a_broken_one_since_when_and_by_what(self):
        assert report_data(mission())["properties"] == []
        broken, kept = report_data(mission(*WATCHED))["properties"]
        assert (broken["name"], broken["verdict"], broken["event"]) == ("a", "broken", "Drive aborted")
        assert broken["broken"]["time"] == 12.0
        assert (kept["name"], kept["verdict"], kept["broken"]) == ("b", "kept", None)

    def test_without_a_place_on_the_earth_positions_are_those_of_the_map(self):
        (survivor,) = report_data(mission(parameters={}))["landmarks"]["survivors"]
        assert survivor["position"] == {"x": 100.0, "y": 0.0}

    def test_what_a_mission_adds_of_a_landmark_takes_nothing_from_what_each_has(self):
        told = shown(name="a", details={"name": "b", "height": 3.0})
        survivor = report_data(mission(told))["landmarks"]["survivors"][-1]
        assert (survivor["name"], survivor["height"]) == ("a", 3.0)

    def test_it_says_of_when_it_is(self):
        assert report_data(mission())["as_of"] == "2023-11-14T22:13:31Z"
        assert report_data(MissionState())["as_of"] is None

    def test_a_run_without_an_end_is_what_it_is_at_until_its_process_is_gone(self):
        state = mission(ended=False)
        assert report_data(state)["outcome"] == "working"
        state.process = RunProcess(is_gone=True)
        assert report_data(state)["outcome"] == "crashed"


class TestGeoJson:
    def features(self, *told):
        read = geojson.loads(report_text(mission(*told), "r.geojson"))
        assert read.is_valid, read.errors()
        return read["features"]

    def test_longitude_stands_first(self):
        (survivor,) = [each for each in self.features() if each["properties"]["kind"] == "survivor"]
        assert survivor["geometry"]["coordinates"] == pytest.approx([16.3713452, 48.2], abs=1e-6)

    def test_there_is_a_feature_for_each_landmark_and_way(self):
        kinds = sorted(each["properties"]["kind"] for each in self.features())
        assert kinds == ["base", "geofence", "path", "survivor", "zone", "zone", "zone"]

    def test_an_area_lies_to_the_left_of_its_boundary(self):
        (fence,) = [each for each in self.features() if each["properties"]["kind"] == "geofence"]
        (ring,) = fence["geometry"]["coordinates"]
        area = sum(ax * by - bx * ay for (ax, ay), (bx, by) in itertools.pairwise(ring))
        assert ring[0] == ring[-1]
        assert area > 0

    def test_who_was_rejected_is_still_there_and_says_so(self):
        (survivor,) = [each for each in self.features(REJECTED) if each["properties"]["kind"] == "survivor"]
        assert (survivor["properties"]["state"], survivor["properties"]["level"]) == ("rejected", "given_up")

    @pytest.mark.parametrize("simulated", [True, False])
    def test_each_of_them_says_whether_it_is_of_a_simulation(self, simulated):
        text = report_text(mission(simulated=simulated), "r.geojson")
        assert {each["properties"]["simulated"] for each in json.loads(text)["features"]} == {simulated}

    def test_what_a_terminal_would_obey_or_no_encoding_has_is_escaped(self):
        text = report_text(mission(shown(name="\u202e\x1b[2J\ud800")), "r.geojson")
        assert r"\u202e\u001b[2J\ud800" in text
        assert text.encode().isascii()


OGC = "{http://www.opengis.net/kml/2.2}"
# What stands where by the norm, as far as it is used here.
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

    def test_its_elements_are_those_of_the_ogc_in_their_order(self):
        for element in self.read().iter():
            names = [each.tag.removeprefix(OGC) for each in element]
            order = OGC_ORDER.get(element.tag.removeprefix(OGC), [])
            assert names == sorted(names, key=order.index)

    def test_there_is_a_placemark_for_each_landmark_and_way(self):
        assert sorted(self.placemarks()) == [
            f"robot1/{name}"
            for name in ("base station", "geofence", "run 1", "survivor_1", "zone_a", "zone_b", "zone_c")
        ]

    def test_longitude_stands_first_and_an_area_is_closed(self):
        marks = self.placemarks()
        assert marks["robot1/survivor_1"].findtext(f".//{OGC}coordinates") == "16.37134523,48.19999999"
        ring = marks["robot1/geofence"].findtext(f".//{OGC}coordinates").split()
        assert (len(ring), ring[0]) == (4, ring[-1])
        way = marks["robot1/run 1"].findtext(f".//{OGC}coordinates").split()
        assert way == ["16.37000000,48.20000000", "16.37001345,48.20000000"]

    def test_each_says_what_it_is(self):
        said = {name: each.findtext(f"{OGC}description") for name, each in self.placemarks().items()}
        assert said["robot1/survivor_1"].startswith(
            "survivor: candidate; found in zone_a at (100.00, 0.00) m on the robot's map"
        )
        assert said["robot1/zone_b"] == "zone: abandoned, after attempt 2"
        assert said["robot1/base station"] == "base"

    def test_an_outline_says_what_is_known_of_it(self):
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
    def test_each_has_the_colour_that_it_has_on_a_dark_page(self, told, name, colour):
        red, green, blue = re.findall("[0-9a-f]{2}", COLOURS[colour].dark)
        drawn = self.placemarks(*told)[f"robot1/{name}"].findtext(f".//{OGC}IconStyle/{OGC}color")
        assert drawn == f"ff{blue}{green}{red}"

    def test_who_is_certainly_there_is_larger(self):
        scales = [
            self.placemarks(*told)["robot1/survivor_1"].findtext(f".//{OGC}IconStyle/{OGC}scale")
            for told in ([], [CONFIRMED])
        ]
        assert scales == [None, "1.4"]

    def test_what_lies_below_an_area_is_seen(self):
        assert self.placemarks()["robot1/geofence"].findtext(f".//{OGC}PolyStyle/{OGC}color")[:2] == "40"

    def test_of_a_simulation_each_placemark_says_so(self):
        marks = self.placemarks(simulated=True).values()
        assert all(each.findtext(f"{OGC}description").startswith("SIMULATED. ") for each in marks)

    def test_what_a_stranger_has_written_is_a_text_in_a_description_as_well(self):
        marks = self.placemarks(shown(name=NASTY, state=NASTY))
        mark = marks["robot1/" + NASTY.replace("\x1b", r"\x1b")]
        assert "survivor: &lt;script&gt;alert('x')&lt;/script&gt;&amp;" in mark.findtext(f"{OGC}description")


def as_tak_reads(line):
    return takproto.parse_proto(takproto.xml2proto(line)).cotEvent


class TestCursorOnTarget:
    def test_tak_reads_an_event_for_each_survivor(self):
        (line,) = report_text(mission(CONFIRMED), "r.cot").splitlines()
        event = as_tak_reads(line)
        assert (event.type, event.how) == ("b-m-p-s-m", "m-g")
        assert (event.lat, event.lon) == pytest.approx((48.2, 16.3713452), abs=1e-6)
        assert event.detail.contact.callsign == "robot1/survivor_1"
        assert ET.fromstring(line).get("version") == "2.0"  # noqa: S314 - our own

    def test_an_event_is_made_now_lasts_a_day_and_is_of_when_somebody_was_found(self):
        made = datetime(2024, 2, 28, 12, 0, tzinfo=timezone.utc)
        event = as_tak_reads(cot_report(mission(), made))
        assert event.startTime == 1_700_000_005_000
        assert event.sendTime == made.timestamp() * 1000
        assert event.staleTime == datetime(2024, 2, 29, 12, 0, tzinfo=timezone.utc).timestamp() * 1000

    def uids(self, *told, **about):
        return [
            ET.fromstring(line).get("uid")  # noqa: S314 - our own
            for line in report_text(mission(*told, **about), "r.cot").splitlines()
        ]

    def test_a_survivor_of_another_mission_is_another_one(self):
        assert self.uids() == ["robot1.sar.20231114T221320Z.1"]
        assert self.uids(wall=1_700_086_400.0) == ["robot1.sar.20231115T221320Z.1"]

    def test_somebody_is_the_same_whatever_the_operator_says_and_with_a_name(self):
        named = ("survivor_named", {"survivor": "survivor_2", "x": 9.0, "y": 9.0})
        later = [self.uids(NAMELESS, *told)[-1] for told in ((), (REJECTED,), (named,))]
        assert set(later) == {"robot1.sar.20231114T221320Z.2"}

    def test_nobody_is_sent_to_who_was_rejected(self):
        assert report_text(mission(REJECTED), "r.cot") == ""

    def test_of_a_simulation_it_is_said_to_be_one(self):
        text = report_text(mission(simulated=True), "r.cot")
        assert as_tak_reads(text).detail.contact.callsign == "SIM robot1/survivor_1"
        assert "SIMULATED" in text

    def test_what_a_stranger_has_written_is_a_text(self):
        told = shown(name=NASTY, state="a\nb\ud800\uffff", level=1)
        line = report_text(mission(told), "r.cot").splitlines()[1]
        assert as_tak_reads(line).detail.contact.callsign == "robot1/" + NASTY.replace("\x1b", r"\x1b")
        assert r">a\nb\ud800\ufffd; found" in line.replace("\ufffd", r"\ufffd")


class TestCommonAlertingProtocol:
    def read(self, *told, **about):
        return XmlParser().from_string(report_text(mission(*told, **about), "r.cap"), Alert)

    def test_an_alert_has_an_info_for_each_survivor_with_a_circle_around_it(self):
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

    def test_it_is_sent_at_a_time_as_the_norm_writes_it(self):
        text = report_text(mission(), "r.cap")
        # In UTC the norm has no letter, and no plus.
        assert ET.fromstring(text).findtext("{*}sent") == "2023-11-14T22:13:31-00:00"  # noqa: S314 - our own

    def test_what_has_become_of_the_mission_since_is_another_alert(self):
        identifiers = [
            self.read(ended=ended, wall=wall).identifier
            for ended, wall in ((False, 1_700_000_000.0), (True, 1_700_000_000.0), (True, 1_700_000_100.0))
        ]
        assert identifiers == [
            "robot1.sar.20231114T221320Z-20231114T221330Z",
            "robot1.sar.20231114T221320Z-20231114T221331Z",
            "robot1.sar.20231114T221500Z-20231114T221511Z",
        ]

    def test_who_is_confirmed_was_observed_and_others_are_likely(self):
        assert self.read().infos[0].certainty is Certainty.LIKELY
        assert self.read(CONFIRMED).infos[0].certainty is Certainty.OBSERVED

    def test_a_simulation_is_an_exercise(self):
        assert self.read(simulated=True).status is Status.EXERCISE

    def test_who_was_rejected_is_nobody_to_go_to(self):
        assert self.read(REJECTED).infos == []


def texts(page):
    """Return what is read on a page, without its style."""
    body = re.sub(r"<style>.*?</style>", "", page, flags=re.DOTALL)
    return html.unescape(re.sub(r"<[^>]*>", "\n", body))


def percent(value, name="share seen"):
    return ("changed", {"figures": [{"name": name, "value": value, "unit": "%"}]})


class TestCourses:
    def test_a_figure_in_percent_is_kept_with_each_moment_at_which_it_has_changed(self):
        data = report_data(mission(percent(10), percent(40.5)))
        assert [each["value"] for each in data["courses"]["share seen"]] == [10, 40.5]
        assert all(each["utc"] for each in data["courses"]["share seen"])

    def test_one_that_has_changed_is_drawn_in_steps_between_0_and_100(self):
        page = html_report(mission(percent(10), percent(150)))
        [points] = re.findall(r'<polyline class="course" points="([^"]+)"', page)
        heights = [float(point.partition(",")[2]) for point in points.split()]
        assert heights == [131.0, 131.0, 5.0, 5.0]
        assert "<h2>Share seen</h2>" in page
        assert 'aria-label="share seen: 10 % at the start, 150 % at the end"' in page

    @pytest.mark.parametrize(
        "told", [[percent(10)], [percent(10), percent(10)], [percent(math.nan), percent(10)]]
    )
    def test_one_that_has_not_changed_or_is_no_number_is_not_drawn(self, told):
        assert 'polyline class="course"' not in html_report(mission(*told))

    def test_what_a_stranger_has_called_a_figure_is_a_text(self):
        page = html_report(mission(percent(1, "<b>"), percent(2, "<b>")))
        assert "<b>" not in page
        assert "&lt;b&gt;" in page


class TestThePage:
    def test_it_needs_nothing_but_itself(self):
        page = html_report(mission())
        assert re.findall(r"""(?:src|href)=["'](?!data:)""", page) == []
        assert "@import" not in page
        assert "url(" not in page
        assert "<script" not in page
        policy = re.search('<meta http-equiv="Content-Security-Policy" content="([^"]*)">', page)
        assert policy is not None
        assert policy[1].startswith("default-src 'none'; style-src 'unsafe-inline'; img-src data:;")
        assert page.index(policy[0]) < page.index("<title>")

    def test_it_says_what_has_come_of_the_mission_and_who_was_found_where(self):
        read = texts(html_report(mission()))
        for words in (
            "FAILED: zone_b was abandoned.",
            "survivor_1",
            "candidate",
            "100.00, 0.00",
            "48.2000000",
        ):
            assert words in read

    def test_what_is_not_done_stands_at_the_top_by_its_state(self):
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

    def test_what_there_is_to_do_next_is_who_to_go_to_and_where_nobody_has_looked(self):
        assert self.steps() == [
            "Go to survivor_1 at 48.2000000, 16.3713452 (not confirmed)",
            "Fetch the robot: it has not reached base station",
            "Send people to search zone_b: abandoned",
            "Send people to search zone_c: not reached",
        ]

    def test_who_was_confirmed_is_gone_to_as_such_and_who_was_rejected_is_not(self):
        assert "(confirmed)" in self.steps(CONFIRMED)[0]
        assert not any("survivor_1" in step for step in self.steps(REJECTED))

    def test_whom_the_mission_was_not_done_with_must_be_passed_on(self):
        steps = self.steps(shown(name="survivor_2", level=1))
        assert "Report survivor_2 yourself: the mission did not finish reporting it" in steps

    def test_metres_of_the_map_are_no_coordinates_to_go_by(self):
        first, *_, last = self.steps(parameters={})
        assert first.startswith("Go to survivor_1 at 100.00, 0.00 (")
        assert "--georeference LAT,LON,HEADING" in last
        assert not any("--georeference" in step for step in self.steps(REJECTED, parameters={}))

    def test_of_a_mission_that_is_not_over_a_later_report_is_asked_for(self):
        assert self.steps(ended=False)[-1].startswith(
            "Ask for a later report: the run had not ended at 2023-11-1"
        )

    def test_the_properties_of_a_watched_run_are_for_engineers(self):
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
    def test_the_map_shows_north_or_its_axes_where_north_is_unknown(self, parameters, letters):
        sign = re.findall(r'<g class="north".*?</g>', html_report(mission(parameters=parameters)))
        assert re.findall("<text[^>]*>(.)</text>", sign[0]) == letters
        turned = html_report(mission(parameters={**VIENNA, "georeference.heading": 0.0}))
        assert 'rotate(90.0)"><path d="M0 -15' in turned

    def test_a_report_states_what_its_readers_cannot_rely_on(self):
        limits = lambda *told, **more: html_report(mission(*told, **more)).partition("<h2>Limits")[2]  # noqa: E731
        assert "No person has confirmed survivor_1." in limits()
        assert "No person has confirmed" not in limits(CONFIRMED)
        assert "Positions are coordinates on the robot&#39;s map, not latitude and longitude." in limits(
            parameters={}
        )
        assert "not on the earth" not in limits()
        assert "The end of the run is not recorded." in limits(ended=False)

    def test_a_mission_that_has_left_nothing_says_so(self):
        assert "There are no open tasks." in html_report(MissionState())

    def test_what_engineers_read_comes_last_and_is_not_printed(self):
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

    def test_it_says_where_the_robot_is(self):
        def robot(*told):
            (said,) = re.findall("<dt>robot</dt><dd>([^<]*)</dd>", html_report(mission(*told)))
            return said

        assert robot() == "last seen at (1.00, 0.00)"
        assert robot(("base_reached", {})) == "at base station"

    def test_an_unfinished_mission_says_of_when_that_is(self):
        assert "as of\n\n2023-11-1" in texts(html_report(mission(ended=False)))
        assert "as of" not in texts(html_report(mission()))

    def test_the_map_says_what_is_not_done(self):
        said = re.findall(r'<text class="label (?:said)?" [^>]*>([^<]*)</text>', report_map(mission()))
        assert said == ["zone_a", "zone_b", "abandoned", "zone_c", "open", "base station"]

    def test_somebody_whose_position_cannot_be_used_is_an_alarm_until_the_zone_is_searched_again(self):
        unplaced = ("survivor_unplaced", {"zone": "zone_c", "reason": "(nan, 1.0) is not a position"})
        again = ("zone_searched", {"zone": "zone_c", "survivor": None})
        said = "There is a survivor at an unusable position in zone_c: (nan, 1.0) is not a position"
        for told, is_over in (([unplaced], False), ([unplaced, again], True)):
            (alarm,) = report_data(mission(*told))["alarms"]
            assert (alarm["text"], alarm["is_over"]) == (said, is_over)
            assert said in html_report(mission(*told))

    def test_everything_on_the_map_and_nothing_else_is_in_its_legend(self):
        found = ("survivor_named", {"survivor": "survivor_2", "x": 1.0, "y": 1.0})
        square = ("changed", {"kinds": [{"name": "box", "plural": "boxes", "shape": "square"}]})
        page = html_report(mission(found, REJECTED, ("zone_visited", {"zone": "zone_c"})))
        drawn, rest = page.split('<ul class="legend">')
        items = rest.split("</ul>")[0]
        known = r'<(?:g|polygon|path|polyline) class="([^"]+)"'
        # The sign of the directions has its own letters.
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

    def test_times_of_other_days_and_runs_say_so(self):
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

    def test_who_base_does_not_know_of_stands_out(self):
        found = ("survivor_named", {"survivor": "survivor_2", "x": 1.0, "y": 1.0})
        kept = ("report_kept", {"survivor": "survivor_2", "x": 1.0, "y": 1.0})
        page = html_report(mission(found, kept))
        rows = dict(re.findall(r'<tr class="([^"]* found)"><td [^>]*>([^<]*)<', page))
        assert rows == {"done found": "survivor_1", "in-hand found": "survivor_2"}
        assert "tr.found.in-hand td { color: var(--failure) }" in page

    def test_faults_alarms_and_orders_are_told(self):
        told = [
            ("log", {"node": "bt_navigator", "level": 40, "text": "Goal aborted"}),
            ("alarmed", {"reason": "the battery is at 12 %"}),
            ("ordered", {"verb": "go_home", "label": "Go home", "by": "Ada"}),
            ("command_given", {"command": "go_home", "by": "the operator"}),
        ]
        read = texts(html_report(mission(*told)))
        for words in ("Goal aborted", "the battery is at 12 %", "Ada: Go home", "go home"):
            assert words in read

    def test_what_has_happened_is_told_in_words(self):
        (table,) = re.findall("<h2>All events</h2>(.*?)<h2>", html_report(mission(*PATROL)))
        cells = re.findall('data-head="event">([^<]*)</td>', table)
        assert [html.unescape(cell) for cell in cells[-2:]] == [
            'photo taken: photo: photo_1, points: ["yard", 2]',
            "point left",
        ]

    def test_of_very_much_the_page_says_how_much_more_there_is(self):
        page = html_report(mission(*[("reading", {"at": each}) for each in range(996)]))
        assert page.count('<td class="text" data-head="event">') == 1000 + 12
        assert "3 more are in the journal." in page

    def test_the_way_of_the_robot_is_drawn_over_the_map(self):
        page = html_report(mission())
        assert f"data:image/png;base64,{PNG}" in page
        assert '<polyline class="trail" points="0.000,-0.000 1.000,-0.000"/>' in page

    def test_a_picture_that_is_none_is_left_out(self):
        (change,) = [
            ("map", {"x": 0, "y": 0, "resolution": 1, "width": 1, "height": 1, "png": '"/><script>'})
        ]
        assert "<image" not in html_report(mission(change))

    @pytest.mark.parametrize(("yaw", "is_drawn"), [(1e-9, True), (-1e-9, True), (0.1, False), (-0.1, False)])
    def test_a_map_that_is_hardly_turned_is_drawn(self, yaw, is_drawn):
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
    def test_what_cannot_be_so_does_not_keep_a_report_from_being_made(self, told):
        for ending in FORMS:
            assert report_text(mission(told), f"r{ending}").encode()

    def test_a_mission_at_the_end_of_the_numbers_has_no_map(self):
        far = {"landmarks": [{"kind": "place", "name": "far", "x": 1e17, "y": 0.0}], "kinds": [PLACE]}
        state = MissionState.from_stream([JournalEntry(1, 1, 0.0, 0.0, "changed", far)])
        assert state.situation.landmarks
        assert report_map(state) == ""

    def test_a_simulation_says_not_to_act_on_it_and_has_no_next_steps(self):
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
    def test_what_a_stranger_has_written_is_a_text(self, told):
        page = html_report(mission(told, name=NASTY))
        assert "<script" not in page
        assert "\x1b" not in page

    def test_a_journal_of_no_mission_has_a_page_too(self):
        assert "not begun" in html_report(MissionState())


class TestWhatIsRefusedBeforehand:
    @pytest.mark.parametrize("ending", sorted(FORMS))
    def test_each_form_can_be_asked_for(self, ending, tmp_path):
        require_form(tmp_path / f"report{ending}", Georeference(48.2, 16.37, 90.0))

    @pytest.mark.parametrize("ending", [".geojson", ".kml", ".cot", ".cap"])
    def test_coordinates_of_the_world_take_the_place_of_the_map(self, ending, tmp_path):
        with pytest.raises(
            ReportError, match=r"Add georeference: {lat: …, lon: …, heading: …} to the parameter file"
        ):
            require_form(tmp_path / f"report{ending}", None)

    def test_another_ending_is_no_form(self, tmp_path):
        with pytest.raises(
            ReportError,
            match=r"the report format of .*report.pdf is unknown \(known file name endings: \.html, \.json, \.geojson, \.kml, \.cot, \.cap\)",
        ):
            require_form(tmp_path / "report.pdf", None)

    def test_there_must_be_the_folder(self, tmp_path):
        with pytest.raises(ReportError, match="does not exist"):
            require_form(tmp_path / "not" / "report.html", None)

    def test_a_folder_is_no_file(self, tmp_path):
        (tmp_path / "r.html").mkdir()
        with pytest.raises(ReportError, match="it is a folder"):
            require_form(tmp_path / "r.html", None)

    def test_the_folder_must_take_files(self, tmp_path, monkeypatch):
        # Root may write to each of them, and tests may be run by root.
        monkeypatch.setattr(os, "access", lambda path, mode: (path, mode) != (tmp_path, os.W_OK))
        with pytest.raises(ReportError, match=f"you do not have permission to write to {tmp_path}"):
            require_form(tmp_path / "r.html", None)

    def test_a_device_is_written_to_wherever_it_is(self, tmp_path, monkeypatch):
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
    def test_the_libraries_must_be_there(self, ending, library, tmp_path, monkeypatch):
        monkeypatch.setitem(sys.modules, library, None)
        with pytest.raises(ImportError, match=library):
            require_form(tmp_path / f"report{ending}", Georeference(48.2, 16.37, 90.0))
