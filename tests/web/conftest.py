"""Fixtures with pages, servers and browsers."""

import base64
import http.client
import json
from contextlib import closing
from typing import Any

import pytest

from sar_compiler.journal.display import (
    Alarm,
    Display,
    EventTime,
    Figure,
    Gauge,
    Landmark,
    LandmarkKind,
    Level,
    MissionPhase,
    RasterLayer,
)
from sar_compiler.journal.journal import Journal
from sar_compiler.journal.journal_entries import JournalEntry
from sar_compiler.journal.journal_opening import open_journal
from sar_compiler.journal.mission_state import MissionState
from sar_compiler.reports.report_html import html_report
from sar_compiler.runtime.clock import ManualClock
from sar_compiler.web.feed import LiveFeed, ReplayFeed
from sar_compiler.web.page_server import PageServer
from sar_compiler.web.replay import Replay
from tests.waiting import SILENCE_SEC
from tests.web.browsers import open_browser

TREE: dict[str, Any] = {
    "class": "py_trees.composites.Sequence",
    "name": "Mission",
    "memory": True,
    "attributes": {},
    "file": "trees/mission.xml",
    "line": 3,
    "children": [
        {
            "class": f"leaves.{name}",
            "name": name,
            "attributes": {},
            "file": "trees/mission.xml",
            "line": line,
            "children": [],
        }
        for line, name in ((4, "Drive"), (5, "Search"))
    ],
}
ABOUT: dict[str, Any] = {"mission": "patrol", "tree": TREE}
KINDS = (
    LandmarkKind("point", "points"),
    LandmarkKind("find", "finds", "triangle", is_found=True),
    LandmarkKind("dock", "dock", "house"),
    LandmarkKind("fence", "fences", shaded_by="chance of rain"),
)
POINTS = {"north": (-3.0, 3.0), "east": (3.5, 3.0)}


class Patrol:
    """A mission that the page does not know: points to visit, detections, a dock and a fence."""

    def __init__(self):
        self.points = {name: Landmark("point", name, *place, "open") for name, place in POINTS.items()}
        self.finds = {}
        self.alarms = {}
        self.lawns = {}
        self.rain = None
        self.phase = MissionPhase()
        self.objects = {}

    def apply(self, fact):
        data = fact.data
        if fact.kind == "point_reached":
            level = Level[data.get("level", "DONE")]
            known = self.points[data["point"]]
            self.points[data["point"]] = known._replace(
                state=data.get("state", "visited"), level=level, reason=data.get("reason", "")
            )
        elif fact.kind == "point_added":
            self.points[data["point"]] = Landmark("point", data["point"], data["x"], data["y"], "open")
        elif fact.kind == "found":
            at = EventTime(fact.run, fact.time, fact.wall)
            self.finds[data["name"]] = Landmark(
                "find", data["name"], data["x"], data["y"], "seen", within="north", details={"found": at}
            )
        elif fact.kind == "lost":
            self.finds.pop(data["name"], None)
        elif fact.kind == "forecast":
            self.rain = data["rain"]
        elif fact.kind == "mown":
            self.lawns[data["name"]] = RasterLayer.from_shares(
                data["name"], "mown", -1.0, -2.0, 0.5, data["rows"]
            )
        elif fact.kind == "next_point":
            self.objects = {"skip": data["point"]}
        elif fact.kind in ("held", "aborted"):
            is_over = not data.get("is_held", True)
            self.phase = MissionPhase() if is_over else MissionPhase(fact.kind, "by the operator")
        elif fact.kind == "alarmed":
            self.alarms[data["text"]] = Alarm(data["text"], is_over=data.get("is_over", False))

    def display(self):
        visited = sum(each.level == Level.DONE for each in self.points.values())
        return Display(
            [
                *self.points.values(),
                *self.finds.values(),
                Landmark("dock", "dock", 0.0, 0.0),
                Landmark(
                    "fence",
                    "fence",
                    -5.0,
                    -5.0,
                    corners=((-5.0, -5.0), (5.0, -5.0), (0.0, 5.0)),
                    shade=self.rain,
                ),
            ],
            [Figure("points visited", visited, len(self.points)), Figure("finds", len(self.finds))],
            [Gauge("battery", 90.0 - visited, "%", 20.0)],
            list(self.alarms.values()),
            self.phase,
            list(self.lawns.values()),
            self.objects,
        )

    def sentence(self, fact):
        return f"reached {fact.data['point']}" if fact.kind == "point_reached" else ""


class Live:
    """A run driven by a test: a journal without a file, and its page."""

    def __init__(self, orders=None, verbs=(), port=0, tools=None, journal="", kinds=KINDS):
        self.journal = Journal()
        self.journal.attach(Patrol(), kinds)
        self.verbs = list(verbs)
        hello: dict[str, object] = {"verbs": [self.verbs], "tools": [*(tools or ())]}
        self.feed = LiveFeed(
            hello,
            lambda: {"verbs": [[verb["name"] for verb in self.verbs]]},
            journals=[journal] if journal else [],
        )
        self.journal.add_listener(self.feed.add_entry)
        self.server = PageServer(self.feed, port, orders, tools)
        self.server.start()

    def begin(self, about=ABOUT):
        self.journal.begin(about, {"node": "/patrol"})
        return self

    def status(self, node, status, message="", tick=1):
        self.journal.record_observation("status", node=node, tick=tick, status=status, message=message)

    def ask(self, path, method="GET", body=None, **headers):
        """Send a request; return the status, text and headers of the response."""
        connection = http.client.HTTPConnection("127.0.0.1", self.server.port, timeout=SILENCE_SEC)
        with closing(connection):
            connection.request(
                method, path, body, {key.replace("_", "-"): value for key, value in headers.items()}
            )
            answer = connection.getresponse()
            return answer.status, answer.read().decode(), answer.headers

    def order(self, verb, values, **headers):
        """Send a command like the page; return the status and the text of the response."""
        said = {
            "Authorization": f"Bearer {self.server.token}",
            "Content_Type": "application/json",
            "X-Seen": "{}",
            **headers,
        }
        status, text, _ = self.ask(f"/orders/{verb}", "POST", json.dumps(values), **said)
        return status, text

    def close(self):
        self.server.close()


@pytest.fixture
def live():
    """Return a function that starts a run with a page; its server is closed after the test."""
    running = []

    def run(**options):
        running.append(Live(**options))
        return running[-1]

    yield run
    for each in running:
        each.close()


@pytest.fixture(scope="session")
def shared_browser():
    """Return a browser for all tests of the process."""
    with open_browser() as browser:
        yield browser


@pytest.fixture
def browser(shared_browser):
    """Return a browser with an empty page; errors in its log fail the test."""
    shared_browser.forget()
    yield shared_browser
    shared_browser.require_no_complaint()


@pytest.fixture
def two(tmp_path):
    """Serve a replay of two robots, the second of which begins 4 s later."""
    places = []
    for number, name in enumerate(("robot1", "robot2")):
        places.append(tmp_path / f"{name}.journal")
        journal = open_journal(places[-1])
        journal.clock = clock = ManualClock(100.0 + 4.0 * number)
        journal.begin({**ABOUT, "mission": name}, {"node": f"/{name}/patrol"})
        for second in range(1, 9):
            clock.advance(1.0)
            journal.record_observation(
                "status", node=1, tick=second, status="RUNNING", message=f"{name} {second}"
            )
            journal.record_observation("pose", x=float(second), y=float(number), yaw=0.0)
        journal.close()
    feed = ReplayFeed(Replay(places), {"robots": ["robot1", "robot2"]})
    with closing(PageServer(feed, 0)) as server:
        server.start()
        yield server


def patrol_report(tell):
    """Return the report of a patrol after `tell` has written to its journal."""
    entries: list[JournalEntry] = []
    journal = Journal()
    journal.clock = ManualClock(100.0)
    journal.add_listener(entries.append)
    journal.attach(Patrol(), KINDS)
    journal.begin(ABOUT, {"node": "/patrol"})
    tell(journal)
    return html_report(MissionState.from_stream(entries))


def as_address(page):
    """Return a page as a data URL."""
    return f"data:text/html;base64,{base64.b64encode(page.encode()).decode()}"
