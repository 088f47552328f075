"""Tests of the operator's page in a browser: state, commands, alarms, map and log."""

from concurrent.futures import Future
from contextlib import closing

import pytest
from selenium.webdriver.common.keys import Keys

from sar_compiler.journal.display import AwaitedItem
from sar_compiler.journal.journal import Journal
from sar_compiler.journal.journal_entries import Ending
from sar_compiler.journal.mission_state import RunProcess
from sar_compiler.runtime.clock import ManualClock
from sar_compiler.web.feed import LiveFeed
from sar_compiler.web.page_server import PageQuery, PageServer
from tests.web.conftest import ABOUT, KINDS, Patrol
from tests.web.run_scene import VERBS, drive

pytestmark = pytest.mark.unmeasured


class RecordingOperator:
    """Accepts every command, and stores its author, reason and displayed state."""

    def __init__(self):
        self.given = []
        self.reasons = []
        self.seen = []

    def send(self, verb, values, giver):
        self.given.append((verb, giver.name))
        self.seen.append(giver.seen)
        self.reasons.append(giver.reason)
        answer: Future[tuple[bool, str]] = Future()
        answer.set_result((True, "done"))
        return answer


@pytest.fixture
def operator():
    return RecordingOperator()


@pytest.fixture
def patrol(live, browser, operator):
    """Open the operator's page of a started patrol, with empty local storage."""
    run = live(orders=operator, verbs=VERBS)
    run.journal.clock = ManualClock(100.0)
    run.begin({**ABOUT})
    browser.open(run.server.url)
    browser.js("localStorage.clear()")
    browser.open(run.server.url)
    browser.wait(lambda: browser.js("return !document.querySelector('.stop').disabled"), "STOP")
    return run


def test_stop_pauses_at_once_and_offers_abort(patrol, operator, browser):
    browser.click(".stop")
    browser.wait(lambda: operator.given == [("pause", "")], "the pause")
    browser.wait_for("#ask", "The robot has been told to stop.")
    assert "Sure?" not in browser.text("#ask")
    assert (browser.text("#ask .no"), browser.text("#ask .yes")) == ("Stay paused", "Abort…")
    patrol.journal.record_event("held", is_held=True)
    browser.wait_for("#ask", "The robot has been told to stop. The mission is paused.")
    browser.type("#ask .no", Keys.ENTER)
    browser.wait(lambda: not browser.js("return document.getElementById('ask').open"), "the end of it")
    assert operator.given == [("pause", "")]
    browser.click(".stop")
    browser.click("#ask .yes")
    browser.wait_for("#ask", "Sure?")
    browser.click("#ask .yes")
    browser.wait(lambda: ("abort", "") in operator.given, "the end of the mission")


def test_one_button_pauses_and_resumes(patrol, operator, browser):
    assert browser.text(".toggle") == "Pause"
    browser.click(".toggle")
    browser.wait(lambda: operator.given == [("pause", "")], "the pause")
    patrol.journal.record_event("held", is_held=True)
    browser.wait_for("#condition strong", "paused").wait_for(".toggle", "Resume")
    browser.click(".toggle")
    browser.wait(lambda: operator.given[-1] == ("resume", ""), "the order to go on")


def test_operator_name_is_sent_with_command_and_remembered(patrol, operator, browser):
    browser.type("#by", "Ada ∀", Keys.TAB)
    browser.click(".toggle")
    browser.wait(lambda: operator.given == [("pause", "Ada ∀")], "the pause")
    browser.open(patrol.server.url)
    assert browser.js("return document.getElementById('by').value") == "Ada ∀"


def test_command_has_reason_entered_beside_buttons_or_in_dialog(patrol, operator, browser):
    browser.type("#reason", "smoke ∀", Keys.TAB)
    browser.click(".toggle")
    browser.wait(lambda: operator.reasons == ["smoke ∀"], "the pause")
    assert browser.js("return document.getElementById('reason').value") == ""
    browser.click(".stop")
    browser.click("#ask .yes")
    browser.wait_for("#ask", "Sure?")
    browser.type("#ask input[name=reason]", "the lift is stuck")
    browser.click("#ask .yes")
    browser.wait(lambda: operator.reasons[-1] == "the lift is stuck", "the end of the mission")


SKIP = {**VERBS[0], "name": "skip", "label": "Skip point", "confirm": "Sure?", "role": "", "named": "Skip {}"}
REVIEW = {
    **SKIP,
    "name": "review",
    "label": "Review",
    "named": "",
    "fields": [
        {"name": "find", "label": "Find", "kind": "found", "choices": [], "optional": False, "longest": 200},
        {
            "name": "verdict",
            "label": "It is",
            "kind": "choice",
            "choices": [["YES", "a find"]],
            "optional": False,
            "longest": 200,
        },
    ],
}


@pytest.fixture
def skip_patrol(live, browser, operator):
    """Open the page of a patrol that can skip its next point and review its detections."""
    run = live(orders=operator, verbs=[*VERBS, SKIP, REVIEW])
    run.journal.clock = ManualClock(100.0)
    run.begin({**ABOUT})
    run.journal.record_event("found", name="find_1", x=-2.0, y=2.25)
    run.journal.record_event("next_point", point="north")
    browser.open(run.server.url)
    browser.wait_for("[data-verb=skip]", "Skip north")
    return run


def test_command_names_its_object_and_carries_displayed_state(skip_patrol, operator, browser):
    browser.click("[data-verb=skip]")
    assert (browser.text("#ask h2"), browser.text("#ask .yes")) == ("Skip north", "Skip north")
    browser.click("#ask .yes")
    browser.wait(lambda: operator.given == [("skip", "")], "the command")
    (seen,) = operator.seen
    assert seen["object"] == "north"
    assert seen["run"].startswith("run 1 (process ")


def test_dialog_whose_object_has_changed_can_only_be_canceled(skip_patrol, operator, browser):
    browser.click("[data-verb=skip]")
    skip_patrol.journal.record_event("next_point", point="east")
    browser.wait_for("#ask .expired", "The state has changed since this question was opened.")
    assert not browser.driver.find_element("css selector", "#ask .yes").is_enabled()
    assert browser.text("#ask .yes") == "Skip north"
    browser.click("#ask .no")
    browser.wait_for("[data-verb=skip]", "Skip east")
    assert operator.given == []


def test_review_carries_displayed_state_and_preselects_nothing(skip_patrol, operator, browser):
    browser.click("[data-verb=review]")
    chosen = "return [...document.querySelectorAll('#ask select')].map((each) => each.value)"
    assert browser.js(chosen) == ["", ""]
    browser.js("document.querySelector('#ask select[name=find]').value = 'find_1'")
    browser.js("document.querySelector('#ask select[name=verdict]').value = 'YES'")
    skip_patrol.journal.record_event("found", name="find_1", x=3.0, y=2.25)
    browser.wait_for("#places", "x 3.00, y 2.25")
    browser.click("#ask .yes")
    browser.wait(lambda: operator.given == [("review", "")], "the command")
    assert operator.seen[0]["find/find_1"] == "seen at (-2.00, 2.25)"


COVERED = """
const [map, ask] = ['map', 'ask'].map((id) => document.getElementById(id).getBoundingClientRect());
return ask.left < map.right && ask.right > map.left && ask.top < map.bottom && ask.bottom > map.top;
"""


def test_dialog_does_not_cover_map(skip_patrol, browser):
    browser.click("[data-verb=skip]")
    assert not browser.js(COVERED)


def test_ended_run_hides_commands(patrol, browser):
    patrol.journal.end_run(Ending.OVER, 0)
    browser.wait_for("#condition strong", "complete")
    browser.wait(lambda: browser.js("return document.getElementById('orders').hidden"), "the end of orders")


def test_report_is_available_after_end_of_run(live, browser):
    report = "<!DOCTYPE html><style>p { color: rgb(1, 2, 3) }</style><p>robot 0</p>"
    run = live(tools={"report": PageQuery(lambda _: report), "entries": PageQuery(lambda _: [])})
    run.begin()
    browser.open(run.server.url)
    assert browser.js("return document.getElementById('report').hidden")
    run.journal.end_run(Ending.OVER, 0)
    browser.wait(lambda: browser.js("return !document.getElementById('report').hidden"), "the report")
    browser.driver.get(browser.js("return document.getElementById('report').href"))
    style = "return getComputedStyle(document.querySelector('p')).color"
    assert (browser.text("p"), browser.js(style)) == ("robot 0", "rgb(1, 2, 3)")


def test_watch_page_always_offers_report(live, browser):
    run = live(tools={"report": PageQuery(lambda _: "")})
    run.begin()
    browser.open(run.server.url)
    assert browser.js("return document.getElementById('report').getAttribute('href')") == "report?robot=0"
    assert not browser.js("return document.getElementById('report').hidden")


def test_tasks_are_shown_below_state_with_command_and_set_its_level(patrol, operator, browser):
    browser.wait_for("#tasks", "Nothing to do")
    assert browser.js("return document.body.dataset.level") == "good"
    patrol.journal.record_event("point_reached", point="north", level="GIVEN_UP")
    browser.wait_for("#tasks", "Check north: ")
    assert browser.js("return document.body.dataset.level") == "warning"
    assert browser.js("return document.title").startswith("(1) ")
    patrol.journal.record_event("held", is_held=True)
    browser.wait_for("#tasks button", "Resume")
    browser.click("#tasks button")
    browser.wait(lambda: operator.given == [("resume", "")], "the order to resume")


def alarms(browser):
    """Return the texts of the shown alarms; an alarm that is not acknowledged ends with its button."""
    return browser.js("return [...document.querySelectorAll('#alarms li')].map((each) => each.textContent)")


def test_alarm_stays_until_it_is_acknowledged(patrol, browser):
    patrol.journal.record_event("alarmed", text="no water")
    browser.wait(lambda: alarms(browser) == ["■no waterat 0:00Seen"], "the alarm")
    patrol.journal.record_event("alarmed", text="no water", is_over=True)
    browser.wait(lambda: alarms(browser) == ["■no waterat 0:00, overSeen"], "its end")
    browser.click("#alarms button")
    browser.wait(lambda: alarms(browser) == [], "no alarm")
    browser.open(patrol.server.url)
    assert alarms(browser) == []


def test_acknowledged_alarm_stays_while_it_is_active(patrol, browser):
    patrol.journal.record_event("alarmed", text="no water")
    browser.wait(lambda: alarms(browser) == ["■no waterat 0:00Seen"], "the alarm")
    browser.click("#alarms button")
    browser.wait(lambda: alarms(browser) == ["■no waterat 0:00"], "the alarm that was seen")


FIGURES = "return Object.fromEntries([...document.querySelectorAll('.figures div')].map((each) => [each.firstChild.textContent, each.lastChild.textContent]))"


def test_remaining_time_is_estimated_from_completed_drives(patrol, browser):
    assert "about" not in browser.js(FIGURES)["to go"]
    drive(patrol.journal)
    browser.wait_for("#drive", "2.5 m, about 0:05")
    # The rest of this drive, and the mean of the earlier drives for the path to the dock.
    browser.wait(lambda: browser.js(FIGURES)["to go"] == "about 0:47", "the estimate")
    assert browser.js(FIGURES)["time"] == "1:24"
    assert browser.js(FIGURES)["points visited"] == "1 of 2"


LIMIT = """
const [bar, line] = ['meter', 'i'].map((each) => document.querySelector(`#gauges ${each}`).getBoundingClientRect());
return ((line.left + line.right) / 2 - bar.left) / bar.width;
"""


def test_gauge_shows_limit_and_legend_shows_age_of_position(patrol, browser):
    assert browser.js("return document.querySelector('#gauges meter').value") == 90
    assert browser.text("#gauges span") == "battery, low below 20 %"
    assert browser.js(LIMIT) == pytest.approx(0.2, abs=0.02)
    patrol.journal.record_observation("pose", x=1.0, y=2.0, yaw=0.5)
    patrol.journal.clock.advance(65.0)
    patrol.journal.record_event("came_back")
    browser.wait_for("#legend table", "robot1:05 ago")


def read_cells(browser):
    """Return the opacity and the lengths of the cell runs of each path of coloured cells."""
    return browser.js(
        """return [...document.querySelectorAll('#map g.cells path')].map(
            (each) => [each.getAttribute('fill-opacity'), each.getAttribute('d').match(/h(?=\\d)\\d+/g).map((run) => Number(run.slice(1)))])"""
    )


def test_raster_layer_is_drawn_by_cells_and_explained_in_legend(patrol, browser):
    patrol.journal.record_event("mown", name="lawn", rows=[[0.0, 0.55, 0.55], [1.0, 1.0, 0.0]])
    browser.wait(lambda: len(read_cells(browser)) == 2, "the cells")
    assert read_cells(browser) == [["0.51", [2]], ["0.75", [2]]]
    box = "return document.querySelector('#map g.cells').getBBox()"
    assert browser.js(f"{box}.width") == 3
    assert browser.js(f"{box}.height") == 2
    patrol.journal.record_event("mown", name="lawn", rows=[[1.0, 1.0, 1.0], [1.0, 1.0, 1.0]])
    browser.wait(lambda: read_cells(browser) == [["0.75", [3, 3]]], "the later cells")
    browser.open(patrol.server.url)
    assert read_cells(browser) == [["0.75", [3, 3]]]
    legend = browser.text("#legend table")
    assert all(f"mown to {percent} %" in legend for percent in (20, 50, 100))


def test_outline_is_shaded_and_legend_shows_scale(patrol, browser):
    assert browser.js("return document.querySelector('#map .shade')") is None
    patrol.journal.record_event("forecast", rain=0.45)
    browser.wait(lambda: browser.js("return document.querySelectorAll('#map .shade').length") == 1, "a shade")
    fills = "return document.querySelector('#map .shade').getAttribute('fill-opacity')"
    assert browser.js(fills) == "0.55"
    legend = browser.text("#legend table")
    assert "chance of rain 45.0 %" in legend
    assert "chance of rain 15.0 %" in legend


def test_locations_show_state_and_detections_show_coordinates(patrol, browser):
    patrol.journal.record_event("found", name="find_1", x=-2.0, y=2.25)
    patrol.journal.record_event(
        "point_reached", point="north", level="GIVEN_UP", state="given up", reason="no way"
    )
    browser.wait_for("#places", "north given up, no way")
    browser.wait_for("#places", "find_1 seenx -2.00, y 2.25 · in north · found at 0:00")


HIGHLIGHTED = "return [...document.querySelectorAll('.looked-at')].map((each) => each.closest('#map, #places, #log').id).sort()"


def test_name_in_log_highlights_its_location_everywhere(patrol, browser):
    patrol.journal.record_event("point_reached", point="north")
    browser.wait_for("#log .link", "north")
    browser.click("#log .link")
    assert browser.js(HIGHLIGHTED) == ["log", "map", "places"]
    assert browser.text("#places .looked-at").startswith("✓north visited")


def test_mark_on_map_highlights_its_row_and_log_lines(patrol, browser):
    patrol.journal.record_event("point_reached", point="north")
    browser.wait_for("#log .link", "north")
    browser.js(
        "document.querySelector('#map .mark.done').dispatchEvent(new MouseEvent('click', { bubbles: true }))"
    )
    assert browser.js(HIGHLIGHTED) == ["log", "places"]


def test_names_in_tasks_and_alarms_are_links(patrol, browser):
    patrol.journal.record_event("point_reached", point="north", level="GIVEN_UP")
    patrol.journal.record_event("point_reached", point="east", level="GIVEN_UP", state="visited")
    patrol.journal.record_event("alarmed", text="no water at east")
    names = "return [...document.querySelectorAll(`${arguments[0]} .link`)].map((each) => each.textContent)"
    browser.wait(lambda: browser.js(names, "#tasks") == ["north", "east"], "the names of the tasks")
    browser.wait(lambda: browser.js(names, "#alarms") == ["east"], "the name in the alarm")


def test_timeline_shows_events_and_latest_one(patrol, browser):
    patrol.journal.clock.advance(30.0)
    patrol.journal.record_event("point_reached", point="north")
    patrol.journal.clock.advance(30.0)
    patrol.journal.record_event("alarmed", text="no water")
    browser.wait_for("#line p", "last: 1:00 alarmed")
    label = browser.js("return document.querySelector('#line [role=img]').getAttribute('aria-label')")
    assert label == "The mission until 1:00: 0:30 north visited, 1:00 no water"
    places = "return [...document.querySelectorAll('#line div > span > span')].map((each) => parseFloat(each.style.left))"
    first, second = browser.js(places)
    assert second == pytest.approx(2 * first, abs=0.1)


def test_detection_is_reviewed_by_buttons_of_its_row(live, operator, browser):
    kinds = [kind._replace(review="review") if kind.is_found else kind for kind in KINDS]
    run = live(orders=operator, verbs=[*VERBS, REVIEW], kinds=kinds).begin()
    run.journal.record_event("found", name="find_1", x=-2.0, y=2.25)
    browser.open(run.server.url)
    browser.wait_for("#places .verdicts button", "a find")
    browser.click("#places .verdicts button")
    chosen = "return [...document.querySelectorAll('#ask select')].map((each) => each.value)"
    assert browser.js(chosen) == ["find_1", "YES"]
    assert operator.given == []
    browser.click("#ask .yes")
    browser.wait(lambda: operator.given == [("review", "")], "the review")
    assert operator.seen[0]["find/find_1"] == "seen at (-2.00, 2.25)"


def test_page_lists_awaited_items_before_start_in_operator_terms(live, browser):
    run = live()
    run.feed.set_awaited(
        [AwaitedItem("navigation", "bt_navigator is inactive"), AwaitedItem("detect survivor")]
    )
    browser.open(run.server.url)
    browser.wait_for("#tasks", "Wait for navigation, or ask an engineer to start it on the robot")
    items = "return [...document.querySelectorAll('.checklist > span')].map((each) => each.textContent)"
    assert browser.js(items) == ["…waiting for navigation", "✓available: detect survivor"]
    assert "bt_navigator" not in browser.text("body")
    run.begin()
    browser.wait_for("#tasks", "Nothing to do")
    assert browser.js(items) == []


def test_page_shows_resume_command_after_interruption(live, browser):
    run = live(journal="/robot/patrol.journal")
    run.journal.begin(ABOUT, {"node": "/patrol", "command": ["patrol", "--view", "web"]})
    browser.open(run.server.url)
    assert browser.js("return document.getElementById('ending').hidden")
    run.journal.end_run(Ending.STOPPED, 130)
    browser.wait_for("#ending code", "sar-run --resume --journal /robot/patrol.journal patrol --view web")


def test_finished_mission_offers_report_and_no_resume_command(live, browser):
    run = live(
        tools={"report": PageQuery(lambda _: ""), "entries": PageQuery(lambda _: [])}, journal="/a.journal"
    )
    run.journal.begin(ABOUT, {"node": "/patrol", "command": ["patrol"]})
    run.journal.end_run(Ending.OVER, 1, "No point is left.")
    browser.open(run.server.url)
    browser.wait_for("#ending", "A new run starts a new mission.")
    assert browser.js("return document.querySelector('#ending a').getAttribute('href')") == "report?robot=0"
    assert browser.text("#ending code") == ""


def test_log_shows_only_events_until_all_lines_are_requested(patrol, browser):
    patrol.journal.record_observation("log", node="patrol", level=20, text="a line")
    patrol.journal.record_observation("log", node="patrol", level=30, text="a warning")
    patrol.journal.record_event("point_reached", point="north")
    browser.wait_for("#log", "reached north")
    assert "a line" not in browser.text("#log")
    assert "a warning" not in browser.text("#log")
    browser.click("#all")
    browser.wait_for("#log", "a line").wait_for("#log", "a warning")


class Team:
    """Two robots on one page; the first accepts every command, and each command is stored with its robot."""

    def __init__(self):
        self.given = []
        names = [verb["name"] for verb in VERBS]
        self.heeded = [names, names]
        hello = {"robots": ["robot1", "robot2"], "verbs": [VERBS, VERBS]}
        self.feed = LiveFeed(hello, lambda: {"verbs": self.heeded}, 2)
        self.journals = [self._journal(robot) for robot in range(2)]
        self.server = PageServer(self.feed, 0, self)
        self.server.start()

    def _journal(self, robot):
        journal = Journal()
        journal.attach(Patrol(), KINDS)
        journal.add_listener(lambda entry: self.feed.add_entry(entry, robot))
        journal.clock = ManualClock(100.0)
        journal.begin(ABOUT, {"node": f"/robot{robot + 1}/patrol"})
        return journal

    def send(self, verb, values, giver):
        self.given.append((verb, giver.robot))
        answer: Future[tuple[bool, str]] = Future()
        answer.set_result((giver.robot == 0, "" if giver.robot == 0 else "not now"))
        return answer


@pytest.fixture
def team():
    made = Team()
    with closing(made.server):
        yield made


STOP_ALL = ".stop-all"


def open_team(browser, team):
    browser.open(team.server.url)
    browser.wait(lambda: browser.js("return document.querySelector('.stop-all').disabled === false"), "STOP")


def test_stop_all_pauses_all_robots_and_offers_abort(team, browser):
    open_team(browser, team)
    assert browser.text(".stop") == "STOP robot1"
    browser.click(STOP_ALL)
    browser.wait(lambda: sorted(team.given) == [("pause", 0), ("pause", 1)], "both pauses")
    browser.wait_for("#ask", "robot1 has been told to stop.")
    browser.wait_for(
        "#ask", "robot2 has not confirmed the stop: refused: not now. Press the emergency stop on the robot."
    )
    browser.click("#ask .no")
    browser.wait_for("#answer", "robot1: Pause: done; robot2: Pause: refused: not now")
    assert len(team.given) == 2
    browser.click(STOP_ALL)
    browser.click("#ask .yes")
    browser.wait_for("#ask h2", "Abort: robot1, robot2")
    browser.click("#ask .yes")
    browser.wait(lambda: {("abort", 0), ("abort", 1)} <= {*team.given}, "the end of both missions")


def test_stop_all_skips_paused_and_ended_robots(team, browser):
    team.journals[0].record_event("held", is_held=True)
    open_team(browser, team)
    browser.wait_for("#condition strong", "paused")
    browser.click(STOP_ALL)
    browser.wait(lambda: team.given == [("pause", 1)], "the pause of robot2")
    browser.click("#ask .no")
    team.journals[0].end_run(Ending.STOPPED, 130)
    browser.wait_for("#condition strong", "stopped")
    browser.click(STOP_ALL)
    browser.click("#ask .yes")
    browser.wait_for("#ask", "Sure?")
    browser.click("#ask .yes")
    browser.wait(lambda: team.given == [("pause", 1), ("pause", 1), ("abort", 1)], "the end of robot2")


ENABLED_BUTTONS = "return [...document.querySelectorAll('#orders button:not(#ask button)')].filter((each) => !each.disabled && !each.hidden).map((each) => each.textContent)"


def test_crashed_robot_has_no_commands_and_is_marked_on_card_and_map(team, browser):
    for journal in team.journals:
        drive(journal)
    open_team(browser, team)
    browser.wait_for("#robots button", "east, 2.5 m")
    team.feed.set_process(RunProcess(is_gone=True), 0)
    browser.wait_for("#robots button", "crashed")
    assert "2.5 m" not in browser.text("#robots button")
    assert browser.text("#drive") == "last seen 2.2 m from dock"
    browser.wait(lambda: browser.js(ENABLED_BUTTONS) == ["STOP ALL"], "no commands to robot1")
    assert browser.js("return document.querySelectorAll('#robots .stale, #map .robot.stale').length") == 2
    browser.click(STOP_ALL)
    browser.wait_for("#ask", "robot1 cannot be told to stop. Press the emergency stop on the robot.")
    assert team.given == [("pause", 1)]


def test_lost_robot_can_only_be_stopped_or_paused(team, browser):
    drive(team.journals[0])
    open_team(browser, team)
    team.feed.set_process(RunProcess(silent_sec=30.0), 0)
    browser.wait_for("#condition strong", "lost")
    assert browser.js(ENABLED_BUTTONS) == ["STOP ALL", "STOP robot1", "Pause"]


def test_commands_are_hidden_after_all_runs_have_ended(team, browser):
    open_team(browser, team)
    for journal in team.journals:
        journal.end_run(Ending.OVER, 0)
    browser.wait(lambda: browser.js("return document.getElementById('orders').hidden"), "the end of orders")


def test_page_of_one_robot_has_one_stop_button(patrol, browser):
    assert browser.text(".stop") == "STOP"
    assert browser.js("return document.querySelector('.stop-all').hidden")


def test_tree_without_commands_is_reported_once_known(team, browser):
    team.heeded = []
    browser.open(team.server.url)
    browser.wait_for("#orders .to", "Commands to robot1")
    assert browser.text("#answer") == ""
    team.heeded = [[], []]
    browser.wait_for("#answer", "This tree accepts no commands.")


def test_each_property_has_a_card_with_its_state(patrol, browser):
    assert not browser.driver.find_element("id", "properties").is_displayed()
    patrol.journal.record_observation(
        "properties_watched", properties=[{"name": each, "if_broken": "hold"} for each in "abc"]
    )
    browser.wait_for("#properties summary", "Properties: 3 watched")
    patrol.journal.record_observation("properties_owed", owed=["b"])
    patrol.journal.clock.advance(42.0)
    patrol.journal.raise_alarm("Property violated: c", "property_broken", property="c", event="Drive aborted")
    browser.wait_for("#properties summary", "1 broken, 1 owed, 1 watched")
    cards = browser.js(
        "return [...document.querySelectorAll('#properties li')].map((each) => [...each.children].map((part) => part.textContent))"
    )
    assert cards == [
        ["c", "✗ violated at 0:42 (Drive aborted)"],
        ["a", "○ monitored", "a violation pauses the mission"],
        ["b", "… pending: a required event is missing", "a violation pauses the mission"],
    ]
    browser.wait_for("#alarms", "Property violated: c")


def test_failed_assumption_is_shown_on_property_cards_with_time(patrol, browser):
    patrol.journal.record_observation("properties_watched", properties=[{"name": "a", "if_broken": "tell"}])
    browser.wait_for("#properties li", "monitored")
    assert not browser.text("#properties p")
    patrol.journal.clock.advance(5.0)
    patrol.journal.raise_alarm("Assumption failed: b", "assumption_failed", assumption="b")
    browser.wait_for("#properties p", "Since 0:05, the run contradicts an assumption")
