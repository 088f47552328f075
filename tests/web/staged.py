"""The operator's page in each condition of a search, and screenshots: `python -m tests.web.staged FOLDER [CONDITION…]`."""

import base64
import struct
import sys
import tempfile
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from sar_compiler.journal.display import AwaitedItem
from sar_compiler.journal.journal import Journal
from sar_compiler.journal.journal_entries import GOAL_ENDED, GOAL_SENT, CommandAuthor, Ending
from sar_compiler.journal.journal_opening import open_journal
from sar_compiler.journal.mission_state import RunProcess
from sar_compiler.runtime.clock import ManualClock
from sar_compiler.web.feed import LiveFeed, ReplayFeed
from sar_compiler.web.page_server import PageQuery, PageServer
from sar_compiler.web.replay import Replay
from sar_compiler.web.run_page import _form
from search_and_rescue.operator_commands import VERBS
from search_and_rescue.record import SurvivorReport
from search_and_rescue.search import Search
from search_and_rescue.search_theory import SearchExpectation
from search_and_rescue.zone_manager import Zone, ZoneManager
from tests.web.browsers import Browser, open_browser
from tests.web.run_scene import Deaf

WIDTHS = {360: 740, 768: 1024, 1280: 800, 2560: 1440}
"""Heights of windows by width, pixels."""
SETTLED = """
const orders = document.getElementById('orders');
return orders.hidden || Boolean(document.querySelector('.stop:enabled, .stop-all:enabled'));
"""
"""Whether the buttons are those of the condition, which they become with the first heartbeat."""
NEAR_END = "const time = document.getElementById('time'); time.value = time.max - 5; time.dispatchEvent(new Event('input'))"
ZONES = {"zone_a": (-3.0, 3.0), "zone_b": (3.5, 3.0), "zone_c": (4.0, -3.0)}


def floor() -> str:
    """Return the image of a hall with a wall inside, as base64."""
    rows = [
        bytes(
            [
                0,
                *(
                    0 if (row == 12 and column > 8) or row in (0, 31) or column in (0, 31) else 254
                    for column in range(32)
                ),
            ]
        )
        for row in range(32)
    ]
    parts = (
        (b"IHDR", struct.pack(">2I5B", 32, 32, 8, 0, 0, 0, 0)),
        (b"IDAT", zlib.compress(b"".join(rows))),
        (b"IEND", b""),
    )
    png = b"\x89PNG\r\n\x1a\n" + b"".join(
        struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))
        for name, data in parts
    )
    return base64.b64encode(png).decode()


class Robot:
    """A robot of a search whose events the test records."""

    def __init__(self, feed: LiveFeed, number: int, node: str, journal: Journal | None = None) -> None:
        # The robots of a team have shifted zones.
        zones = [
            Zone(id=name, x=x - 1.6 * number, y=y - 0.9 * number, yaw=0.0) for name, (x, y) in ZONES.items()
        ]
        areas = {name: SearchExpectation(0.3, 0.8, 60.0) for name in ZONES}
        self.search = Search(
            ZoneManager(zones, {"x": -1.6 * number, "y": -4.0, "yaw": 0.0}, areas=areas), wanted_success=0.8
        )
        self.feed, self.number, self.node, self.journal = feed, number, node, journal or Journal()
        self.journal.clock = self.clock = ManualClock(100.0)
        self.journal.add_listener(lambda entry: feed.add_entry(entry, number))
        self.search.use_journal(self.journal)

    def begin(self) -> None:
        """Start the run, search the first zone, and drive to the second one."""
        journal, record = self.journal, self.search.record
        journal.begin(
            {"mission": "search_and_rescue"},
            {
                "node": self.node,
                "parameters": {"time_limit_sec": 900.0},
                "command": ["search_and_rescue_guarded"],
            },
        )
        journal.record_observation(
            "map", x=-6.0, y=-6.0, yaw=0.0, resolution=0.375, width=32, height=32, png=floor()
        )
        journal.record_observation("battery", share=0.62, at_least=0.2)
        record.zone_started("zone_a")
        self.clock.advance(40.0)
        record.zone_searched("zone_a", None)
        self.search.zones.select_next_zone()
        record.zone_started("zone_b")
        journal.record_event(GOAL_SENT, action="/navigate_to_pose", goal="ab" * 16)
        self.clock.advance(25.0)
        x, y = -1.6 * self.number, -0.9 * self.number
        journal.record_observation("pose", x=x + 1.0, y=y + 2.0, yaw=0.4)
        journal.record_observation(
            "plan", frame="map", points=[[x + 1.0, y + 2.0], [x + 2.0, y + 2.5], [x + 3.5, y + 3.0]]
        )
        journal.record_observation("progress", target="zone_b", distance=2.7, time_left=4.0)

    def find(self) -> None:
        """Detect a survivor in the second zone."""
        self.search.record.zone_searched("zone_b", (2.5, 2.0))
        self.search.record.survivor_named("survivor_1", 2.5, 2.0)

    def command(self, name: str) -> None:
        """Record a command of an operator."""
        with self.journal.ordered_by(CommandAuthor("Ann (page, 127.0.0.1)", "smoke")):
            self.search.orders.record(name)

    def come_home(self) -> None:
        """Reach the base station."""
        self.clock.advance(30.0)
        self.journal.record_observation("pose", x=0.0, y=-4.0, yaw=0.0)
        self.search.record.base_reached()

    def end(self, status: int, reason: str) -> None:
        """End the goal and the run."""
        self.journal.record_observation(GOAL_ENDED, goal="ab" * 16, status=5)
        self.journal.end_run(Ending.OVER, status, reason)

    def finish(self, *left: str) -> None:
        """Search the remaining zones except `left`, which are abandoned; then come home and end the run."""
        while self.search.zones.has_remaining():
            zone = self.search.zones.current_zone()["id"]
            if zone in left:
                self.search.zones.abandon()
            else:
                self.search.record.zone_searched(zone, None)
                self.search.zones.select_next_zone()
        self.come_home()
        self.end(1 if left else 0, "No zone is left." if left else "Mission complete.")


def refuse_reports(robot: Robot) -> None:
    robot.find()
    robot.search.record.report_kept(SurvivorReport("survivor_1", 2.5, 2.0))
    for _ in range(9):
        robot.search.record.report_sent("survivor_1")


def run_low(robot: Robot) -> None:
    robot.journal.record_observation("battery", share=0.15)
    robot.search.record.record_alarm("the battery is at 15 %, below 20 %")
    for _ in range(2):
        robot.search.zones.abandon("the battery is low")
    robot.journal.record_observation("plan", frame="map", points=[[1.0, 2.0], [-4.5, 1.5], [0.0, -4.0]])
    robot.journal.record_observation("progress", target="base station", distance=12.1, time_left=30.0)


def complete(robot: Robot) -> None:
    robot.search.wanted_success = 0.0
    robot.finish()


def complete_unreviewed(robot: Robot) -> None:
    robot.find()
    robot.search.record.record_acknowledgement("survivor_1")
    complete(robot)


def abort(robot: Robot) -> None:
    robot.command("abort")
    robot.end(1, "zone_b and zone_c were not visited.")


def call_home(robot: Robot) -> None:
    robot.command("go_home")
    robot.come_home()
    robot.end(1, "zone_b and zone_c were not visited.")


def lose_position(robot: Robot) -> None:
    robot.journal.record_observation(
        "lacks", text="No transform from 'map' has come for 3 s", is_position_lost=True
    )


def wait_for_start(robot: Robot) -> None:
    problems = {"the robot's position": "", "navigation": "bt_navigator is inactive", "detect survivor": ""}
    robot.feed.set_awaited([*map(AwaitedItem, problems, problems.values())])


def stop(robot: Robot) -> None:
    robot.journal.record_observation(GOAL_ENDED, goal="ab" * 16, status=5)
    robot.journal.end_run(Ending.STOPPED, 130, "")


def wait_for_nav2(robot: Robot) -> None:
    robot.journal.record_observation(
        "lacks", text="the navigation (Nav2) is not active: bt_navigator is inactive"
    )


CONDITIONS: dict[str, tuple[Callable[[Robot], object], str, str]] = {
    "driving": (lambda _: None, "good", "Nothing to do"),
    "detection": (Robot.find, "warning", "Review survivor_1: is it a survivor?"),
    "reports refused": (refuse_reports, "error", "Report survivor_1 yourself"),
    "paused": (lambda robot: robot.command("pause"), "warning", "Resume the mission"),
    "waiting": (wait_for_nav2, "warning", "Ask an engineer for help: the navigation (Nav2) is not active"),
    "position lost": (lose_position, "error", "Press the robot's emergency stop if it moves"),
    "low battery": (run_low, "error", "zone_b, zone_c: abandoned because the battery is low"),
    "aborted": (abort, "warning", "Fetch the robot"),
    "called home": (call_home, "warning", "Send people to search zone_b"),
    "failed": (lambda robot: robot.finish("zone_c"), "error", "Send people to search zone_c: abandoned"),
    "complete": (complete, "good", "Nothing to do"),
    "complete, not reviewed": (
        complete_unreviewed,
        "warning",
        "Go to survivor_1: no person has confirmed it",
    ),
    "complete with less": (Robot.finish, "warning", "Decide whether to search again"),
    "crashed": (
        lambda robot: robot.feed.set_process(RunProcess(is_gone=True), robot.number),
        "error",
        "Press the emergency stop on the robot: STOP on the page may not reach it",
    ),
    "lost": (
        lambda robot: robot.feed.set_process(RunProcess(silent_sec=30.0), robot.number),
        "error",
        "Press the emergency stop on the robot: STOP on the page may not reach it",
    ),
    "not begun": (
        wait_for_start,
        "warning",
        "Wait for navigation, or ask an engineer to start it on the robot",
    ),
    "stopped": (stop, "warning", "Ask an engineer to resume the mission, or fetch the robot"),
    "replay": (Robot.find, "warning", "This is a recording"),
    "team": (
        lambda robot: robot.feed.set_process(RunProcess(is_gone=True), robot.number),
        "error",
        "robot3: Press the emergency stop on the robot: STOP on the page may not reach it",
    ),
}
"""The function that leads to each condition, the level of the page, and the text of a task."""


@contextmanager
def staged(name: str) -> Iterator[PageServer]:
    """Serve the page of a condition."""
    if name == "replay":
        with tempfile.TemporaryDirectory() as folder:
            yield from _recorded(Path(folder) / "search.journal")
        return
    robots = ["robot1", "robot2", "robot3"] if name == "team" else ["search_and_rescue"]
    verbs = [_form(verb) for verb in VERBS]
    names = [verb["name"] for verb in verbs]
    hello = {"robots": robots, "verbs": [verbs for _ in robots]}
    places = [Path("/robot/search_and_rescue.journal") for _ in robots]
    tools = {"report": PageQuery(lambda _: ""), "entries": PageQuery(lambda _: [])}
    hello["tools"] = [*tools]
    feed = LiveFeed(hello, lambda: {"verbs": [names for _ in robots]}, len(robots), places)
    server = PageServer(feed, 0, Deaf(), tools)
    server.start()
    try:
        for number, each in enumerate(robots):
            robot = Robot(feed, number, f"/{each}/search_and_rescue")
            if name != "not begun":
                robot.begin()
        CONDITIONS[name][0](robot)
        yield server
    finally:
        server.close()


def _recorded(path: Path) -> Iterator[PageServer]:
    """Serve the replay of a search with a detection."""
    journal = open_journal(path)
    robot = Robot(LiveFeed({}, dict), 0, "/search_and_rescue", journal)
    robot.begin()
    CONDITIONS["replay"][0](robot)
    robot.clock.advance(20.0)
    robot.journal.record_observation("pose", x=2.4, y=2.4, yaw=0.4)
    journal.close()
    server = PageServer(ReplayFeed(Replay([path]), {"robots": ["search_and_rescue"]}), 0)
    server.start()
    try:
        yield server
    finally:
        server.close()


def show(browser: Browser, server: PageServer, name: str, width: int) -> None:
    """Open the page of a condition; a replay is shown near its end."""
    browser.size(width, WIDTHS[width])
    browser.open(server.url)
    if name == "replay":
        browser.js(NEAR_END)
        browser.wait_for("#places", "survivor_1")
    browser.wait(lambda: browser.js(SETTLED), "the buttons")


def main(folder: str, *wanted: str) -> None:
    """Make a screenshot for each condition and width."""
    place = Path(folder)
    place.mkdir(parents=True, exist_ok=True)
    with open_browser() as browser:
        for name in wanted or CONDITIONS:
            with staged(name) as server:
                for width in WIDTHS:
                    show(browser, server, name, width)
                    (place / f"{name.replace(' ', '_')}_{width}.png").write_bytes(
                        browser.driver.get_screenshot_as_png()
                    )


if __name__ == "__main__":
    main(*sys.argv[1:])
