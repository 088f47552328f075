"""Tests of the engineer's page in a browser: a live run and a replay, by mouse and by keyboard."""

import json
import random
from contextlib import closing
from typing import Any

import pytest
from selenium.webdriver.common.action_chains import ActionChains
from selenium.webdriver.common.keys import Keys

from sar_compiler.errors import SarError
from sar_compiler.journal.journal_entries import Ending, JournalEntry
from sar_compiler.journal.journal_opening import open_journal
from sar_compiler.runtime.clock import ManualClock
from sar_compiler.web.feed import ReplayFeed, as_json
from sar_compiler.web.page_server import PageQuery, PageServer
from sar_compiler.web.page_state import PageState
from sar_compiler.web.replay import Replay
from sar_compiler.web.run_page import _FailureExplainer, _form
from search_and_rescue.operator_commands import VERBS
from tests.processes import free_port
from tests.web.conftest import ABOUT, KINDS, POINTS, TREE, Patrol
from tests.web.folding import history
from tests.web.test_page_server import Operator

pytestmark = pytest.mark.unmeasured

PAUSE = {"name": "pause", "label": "Pause", "help": "Stops it.", "confirm": "", "role": "", "fields": []}
SKIP = {**PAUSE, "name": "pause", "label": "Skip", "confirm": "Nobody goes there."}


def engineer_url(server):
    """Return the address of the engineer's page."""
    address, _, token = server.url.partition("#")
    return f"{address}tree#{token}"


def command_button(browser):
    """Return the button of the command once it is enabled."""
    button = "[data-verb=pause]:enabled"
    browser.wait(lambda: browser.js("return !!document.querySelector(arguments[0])", button), "the button")
    return browser.driver.find_element("css selector", button)


def test_late_browser_shows_current_state(live, browser):
    run = live().begin()
    run.status(0, "RUNNING")
    run.status(1, "RUNNING", "3 m left")
    run.journal.record_event("point_reached", point="north")
    browser.open(engineer_url(run.server))
    assert browser.rows() == [
        "Mission, Sequence, RUNNING",
        "Drive, Drive, RUNNING, 3 m left",
        "Search, Search, not ticked",
    ]
    assert "Drive" in browser.text("#now")
    assert browser.text("#progress") == "points visited 1 of 2 · finds 0 · battery 89 %"
    label = browser.driver.find_element("id", "map").get_attribute("aria-label")
    assert label is not None
    assert "north visited; east open" in label
    run.journal.record_event("point_reached", point="east", level="IN_HAND", state="under way")
    browser.wait_for("#map .mark.in-hand title", "east: under way")
    run.status(1, "RUNNING", "2 m left")
    browser.wait_for("#now", "2 m left")


def test_reload_shows_same_rows(live, browser):
    run = live().begin()
    run.status(0, "RUNNING")
    run.status(1, "FAILURE", "no way there")
    browser.open(engineer_url(run.server))
    before = browser.rows()
    assert before[1] == "Drive, Drive, FAILURE, no way there"
    browser.driver.refresh()
    browser.wait(lambda: browser.rows() == before, "the same rows")


def test_replacement_run_is_shown_automatically(live, browser):
    run = live(port=free_port()).begin()
    run.status(1, "FAILURE", "no way there")
    browser.open(engineer_url(run.server))
    browser.wait_for("#condition", "working")
    browser.allow("ERR_CONNECTION_REFUSED", "ERR_INCOMPLETE_CHUNKED_ENCODING")
    run.close()
    browser.wait_for("#condition", "No contact for")
    again = live(port=run.server.port).begin({**ABOUT, "mission": "second"})
    again.status(1, "SUCCESS")
    browser.wait_for("#mission", "second")
    browser.wait_for("#condition", "working")
    assert browser.rows()[1] == "Drive, Drive, SUCCESS"


def test_end_of_run_stays_on_page_after_server_closes(live, browser):
    run = live().begin()
    run.status(0, "FAILURE", "")
    browser.open(engineer_url(run.server))
    browser.allow("ERR_CONNECTION_REFUSED", "ERR_INCOMPLETE_CHUNKED_ENCODING")
    run.journal.record_event("alarmed", text="a find at an unusable position")
    run.journal.end_run(Ending.OVER, 1, "No point is left. north was not visited.")
    run.close()
    browser.wait_for("#condition strong", "failed").wait_for("#condition", "No point is left.")
    assert "north was not visited" in browser.text("#log")
    assert "a find at an unusable position" in browser.text("#progress")


def test_page_of_failed_run_shows_cause_and_keeps_later_selection(live, browser):
    run = live()
    run.journal.add_listener(_FailureExplainer(run.feed).add_entry)
    run.begin()
    browser.open(engineer_url(run.server))
    assert not browser.driver.find_element("id", "why").is_displayed()
    run.status(1, "FAILURE", "no way there")
    run.status(0, "FAILURE")
    run.journal.end_run(Ending.OVER, 1, "The root has failed.")
    browser.wait_for("#why summary", "Why: Drive FAILURE, no way there")
    browser.wait(lambda: browser.js("return document.getElementById('why').open"), "the chain of causes")
    assert browser.text("#details").startswith("nodeDrive")
    assert "Mission FAILURE  mission.xml:3" in browser.text("#why")
    browser.click("#why li:nth-child(1) button")
    assert browser.text("#details").startswith("nodeMission")
    run.journal.record_observation("log", node="patrol", level=20, text="later")
    browser.wait_for("#log", "later")
    assert browser.text("#details").startswith("nodeMission")


LANES = "return document.getElementById('lanes').getAttribute('aria-label')"


def drag_lanes(browser, *points):
    """Press the mouse at the first point of the lanes, move it over the others, and release it.

    Args:
        points: Pixels from the upper left corner of the lanes.
    """
    left, top = browser.js(
        "const { x, y } = document.getElementById('lanes').getBoundingClientRect(); return [x, y]"
    )
    places = [(left + x, top + y) for x, y in points]
    mouse(browser, "mousePressed", *places[0])
    for place in places[1:]:
        mouse(browser, "mouseMoved", *place, buttons=1)
    mouse(browser, "mouseReleased", *places[-1])


def test_timeline_has_selectable_lane_for_each_leaf_and_drag_zooms(live, browser):
    run = live()
    run.journal.clock = clock = ManualClock(100.0)
    run.begin()
    run.status(0, "RUNNING")
    run.status(1, "RUNNING")
    clock.advance(60.0)
    run.status(1, "SUCCESS", tick=2)
    run.status(2, "RUNNING", tick=2)
    clock.advance(60.0)
    run.status(2, "SUCCESS", tick=3)
    browser.open(engineer_url(run.server))
    browser.wait(lambda: browser.js(LANES) == "Timeline from 0:00 to 2:00: 2 leaves", "two lanes")
    drag_lanes(browser, (300, 18 + 16 + 8))
    browser.wait_for("#details", "nodeSearch")
    drag_lanes(browser, (300, 20), (500, 20), (600, 20))
    browser.wait(lambda: "from 0:00 to 2:00" not in browser.js(LANES), "a part of the time")
    browser.click("#all-time")
    assert browser.js(LANES) == "Timeline from 0:00 to 2:00: 2 leaves"


def test_large_tree_is_folded_to_its_running_branch(live, browser):
    leaves = [{**TREE["children"][0], "name": f"leaf {number}"} for number in range(40)]
    branches = [{**TREE, "name": f"branch {number}", "children": leaves} for number in range(2)]
    run = live().begin({**ABOUT, "tree": {**TREE, "children": branches}})
    run.status(45, "RUNNING")
    browser.open(engineer_url(run.server))
    browser.wait(lambda: any(row.startswith("leaf 3,") for row in browser.rows()), "the running leaf")
    browser.js("document.getElementById('tree').scrollTop = 0")
    browser.wait(lambda: any(row.startswith("branch 0,") for row in browser.rows()), "the folded branch")
    assert [row.split(",")[0] for row in browser.rows()][:4] == ["Mission", "branch 0", "branch 1", "leaf 0"]


def test_successful_mission_shows_no_cause(live, browser):
    run = live()
    run.journal.add_listener(_FailureExplainer(run.feed).add_entry)
    run.begin()
    run.status(0, "SUCCESS")
    run.journal.end_run(Ending.OVER, 0)
    browser.open(engineer_url(run.server)).wait_for("#condition", "complete")
    assert not browser.driver.find_element("id", "why").is_displayed()


def test_node_has_symbol_from_journal(live, browser):
    run = live()
    run.journal.begin(ABOUT, {"looks": [["sequence", "→R"], ["decorator", "↻"], ["condition", ""]]})
    browser.open(engineer_url(run.server))
    browser.wait_for("#tree", "→R Mission↻ DriveSearch")
    assert browser.text("#signs").endswith(
        "hollow: from an earlier activation→R sequence, reactive↻ runs its child again"
    )


def test_markup_in_untrusted_texts_is_escaped(live, browser):
    evil = "<img src=x onerror=alert(1)><script>alert(2)</script>"
    tree = {**ABOUT["tree"], "name": evil}
    run = live().begin({**ABOUT, "mission": evil, "tree": tree})
    run.status(0, "RUNNING", evil)
    run.status(1, "RUNNING", evil)
    run.journal.record_observation("log", node="patrol", level=40, text=evil)
    run.journal.record_event("found", name=evil, x=0.0, y=0.0)
    browser.open(engineer_url(run.server))
    assert evil in browser.text("#log")
    assert evil in browser.text("#tree")
    assert evil in browser.text("#map")
    assert evil in browser.text("#places")
    assert browser.js("return document.querySelectorAll('img, body script').length") == 0


def test_command_button_sends_command_and_shows_response(live, browser):
    operator = Operator()
    run = live(orders=operator, verbs=[PAUSE]).begin()
    browser.open(engineer_url(run.server))
    command_button(browser).click()
    browser.wait_for("#answer", "Pause: done")
    assert operator.given == [("pause", {})]


def test_hidden_pages_do_not_block_commands(live, browser):
    operator = Operator()
    run = live(orders=operator, verbs=[PAUSE]).begin()
    browser.open(engineer_url(run.server))
    first = browser.driver.current_window_handle
    for _ in range(7):
        browser.driver.switch_to.new_window("tab")
        browser.open(engineer_url(run.server))
    run.journal.record_event("came_back")
    for tab in [each for each in browser.driver.window_handles if each != first][1:]:
        browser.driver.switch_to.window(tab)
        browser.driver.close()
    browser.driver.switch_to.window(first)
    browser.wait_for("#log", "came back")
    command_button(browser).click()
    browser.wait_for("#answer", "Pause: done")
    assert operator.given == [("pause", {})]
    last = next(each for each in browser.driver.window_handles if each != first)
    browser.driver.switch_to.window(last)
    browser.driver.close()
    browser.driver.switch_to.window(first)


def test_command_with_confirmation_can_be_canceled(live, browser):
    operator = Operator()
    run = live(orders=operator, verbs=[SKIP]).begin()
    browser.open(engineer_url(run.server))
    button = command_button(browser)
    button.click()
    assert "Nobody goes there." in browser.text("#ask")
    browser.type("#ask .yes", Keys.ESCAPE)
    browser.wait(
        lambda: not browser.js("return document.getElementById('ask').open"), "the end of the question"
    )
    assert operator.given == []
    button.click()
    browser.click("#ask .yes")
    browser.wait_for("#answer", "done")
    assert operator.given == [("pause", {})]


def test_enter_in_field_sends_command(live, browser):
    operator = Operator()
    name = {
        "name": "point",
        "label": "Name",
        "kind": "text",
        "choices": [],
        "optional": False,
        "longest": 200,
    }
    run = live(orders=operator, verbs=[{**PAUSE, "fields": [name]}]).begin()
    browser.open(engineer_url(run.server))
    button = command_button(browser)
    button.click()
    browser.click("#ask .no")
    button.click()
    browser.type("#ask input", "west", Keys.ENTER)
    browser.wait_for("#answer", "Pause: done")
    assert operator.given == [("pause", {"point": "west"})]


ADD: dict[str, Any] = {
    **PAUSE,
    "label": "Add point",
    "fields": [
        {"name": name, "label": name, "kind": "number", "choices": [], "optional": False, "longest": 200}
        for name in "xy"
    ],
}


def test_location_can_be_picked_on_map_or_canceled(live, browser):
    operator = Operator()
    run = live(orders=operator, verbs=[ADD]).begin()
    browser.open(engineer_url(run.server))
    button = command_button(browser)
    button.click()
    browser.click("#ask label ~ button")
    browser.wait_for("#answer", "Escape cancels")
    browser.type("#map", Keys.ESCAPE)
    browser.wait(lambda: browser.text("#answer") == "", "the end of the question")
    browser.click("#map")
    assert not browser.js("return document.getElementById('ask').open")
    button.click()
    browser.click("#ask label ~ button")
    browser.click("#map [data-kind=dock]")
    browser.click("#ask .yes")
    browser.wait_for("#answer", "done")
    ((_, place),) = operator.given
    assert (round(place["x"]), round(place["y"])) == (0, 0)


AREA: dict[str, Any] = {
    **PAUSE,
    "label": "Draw an area",
    "fields": [
        {"name": "name", "label": "Name", "kind": "text", "choices": [], "optional": False, "longest": 200},
        {
            "name": "corners",
            "label": "Corners",
            "kind": "polygon",
            "choices": [],
            "optional": True,
            "longest": 200,
        },
    ],
}


def click_map(browser, *places):
    """Click on the map at points given in pixels from its centre."""
    plan = browser.driver.find_element("css selector", "#map")
    for x, y in places:
        ActionChains(browser.driver).move_to_element_with_offset(plan, x, y).click().perform()


def count_corners(browser):
    """Return the number of drawn corners."""
    return browser.js("return document.querySelectorAll('#map .drawn circle').length")


def test_area_is_drawn_by_corners_and_closed_at_first_one(live, browser):
    operator = Operator()
    run = live(orders=operator, verbs=[AREA]).begin()
    browser.open(engineer_url(run.server))
    command_button(browser).click()
    browser.type("#ask input[name=name]", "yard")
    browser.click("#ask label ~ button")
    browser.wait_for("#answer", "the first one again to close the outline")
    click_map(browser, (-60, -40), (60, -40), (90, 90))
    assert count_corners(browser) == 3
    browser.type("#map", Keys.BACKSPACE)
    browser.wait(lambda: count_corners(browser) == 2, "one corner less")
    # Two corners are not an area, so a click on the first one does not close it.
    click_map(browser, (-60, -40))
    assert count_corners(browser) == 2
    click_map(browser, (60, 40), (-60, -40))
    browser.wait(lambda: browser.js("return document.getElementById('ask').open"), "the question again")
    assert count_corners(browser) == 0
    browser.click("#ask .yes")
    browser.wait_for("#answer", "done")
    ((_, values),) = operator.given
    (left, top), (right, same), (below_x, below_y) = values["corners"]
    assert values["name"] == "yard"
    assert (same, below_x) == (top, right)
    assert left < right
    assert below_y < top


def test_escape_cancels_drawing(live, browser):
    operator = Operator()
    run = live(orders=operator, verbs=[AREA]).begin()
    browser.open(engineer_url(run.server))
    command_button(browser).click()
    browser.click("#ask label ~ button")
    click_map(browser, (-60, -40), (60, -40), (60, 40))
    browser.type("#map", Keys.ESCAPE)
    browser.wait(lambda: browser.text("#answer") == "", "the end of the question")
    assert count_corners(browser) == 0
    assert operator.given == []


def test_typed_corners_are_sent_as_numbers_and_other_text_unchanged(live, browser):
    operator = Operator()
    run = live(orders=operator, verbs=[AREA]).begin()
    browser.open(engineer_url(run.server))
    button = command_button(browser)
    for number, typed in enumerate(("[[0, 0], [4, 0], [4, 3]]", "four corners"), start=1):
        button.click()
        browser.type("#ask input[name=name]", "yard")
        browser.type("#ask input[name=corners]", typed)
        browser.click("#ask .yes")
        # The response to the previous command stays until this one is sent.
        browser.wait(lambda number=number: len(operator.given) == number, "the order")
    assert [values["corners"] for _, values in operator.given] == [[[0, 0], [4, 0], [4, 3]], "four corners"]


def dock_transform(browser):
    """Return the transform of the dock on the map."""
    return browser.js("return document.querySelector('#map [data-kind=dock]').getAttribute('transform')")


def test_map_is_moved_only_by_left_mouse_drag(live, browser):
    run = live().begin()
    browser.open(engineer_url(run.server))
    x, y = centre(browser, "#map")
    at_first = dock_transform(browser)
    touch = {"enabled": True}
    browser.driver.execute_cdp_cmd("Emulation.setTouchEmulationEnabled", touch)
    for kind, points in (("touchStart", [{"x": x, "y": y}]), ("touchCancel", [])):
        browser.driver.execute_cdp_cmd("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})
    browser.driver.execute_cdp_cmd("Emulation.setTouchEmulationEnabled", {"enabled": False})
    # Touch enlarges the controls, which moves the map too.
    browser.wait(lambda: dock_transform(browser) == at_first, "the map where it was")
    mouse(browser, "mouseMoved", x + 40, y + 40, button="none")
    mouse(browser, "mousePressed", x, y, button="right")
    mouse(browser, "mouseMoved", x + 40, y + 40, button="right")
    mouse(browser, "mouseReleased", x + 40, y + 40, button="right")
    mouse(browser, "mouseWheel", x, y, deltaX=50, deltaY=0)
    mouse(browser, "mouseMoved", x, y, button="none")
    assert dock_transform(browser) == at_first
    mouse(browser, "mousePressed", x, y)
    mouse(browser, "mouseMoved", x + 40, y + 40)
    mouse(browser, "mouseReleased", x + 40, y + 40)
    moved = dock_transform(browser)
    assert moved != at_first
    mouse(browser, "mouseMoved", x, y, button="none")
    assert dock_transform(browser) == moved


def test_page_without_token_is_read_only(live, browser):
    run = live(orders=Operator(), verbs=[PAUSE]).begin()
    browser.open(engineer_url(run.server).partition("#")[0])
    browser.wait_for("#answer", "open the complete address that the run has printed")
    browser.wait_for("#verbs", "Pause")
    assert not browser.driver.find_element("css selector", "[data-verb=pause]").is_enabled()


def test_tree_is_navigated_and_folded_by_keyboard(live, browser):
    run = live().begin()
    run.status(1, "FAILURE", "no way there")
    browser.open(engineer_url(run.server))
    browser.type("#tree", Keys.ARROW_DOWN)
    assert "no way there" in browser.text("#details")
    assert "trees/mission.xml:4" in browser.text("#details")
    browser.type("#tree", Keys.ARROW_LEFT, Keys.ARROW_LEFT)
    assert len(browser.rows()) == 1
    browser.type("#tree", Keys.ARROW_RIGHT, Keys.END)
    assert "leaves.Search" in browser.text("#details")
    assert (
        browser.js("return document.getElementById('tree').getAttribute('aria-activedescendant')") == "node2"
    )


class Asked:
    """Scripted tools of a run that store their requests."""

    def __init__(self):
        self.nodes, self.held, self.seen = set(), None, []

    def breakpoints(self, values):
        if "node" in values:
            (self.nodes.add if values["is_set"] else self.nodes.discard)(values["node"])
        if values.get("goes_on"):
            self.held = None
        return {"nodes": [*self.nodes], "held": self.held}

    def otherwise(self, values):
        self.seen.append(values)
        if values["node"] == 2:
            message = "the tree has another shape now"
            raise SarError(message)
        return [
            {
                "instead": {"status": "FAILURE", "label": "aborted"},
                "then": ["Search FAILURE"],
                "root": "FAILURE",
            }
        ]

    def entries(self, _):
        return [
            {"scope": "", "entries": [{"key": "goal", "value": "'east'", "type": "str", "writes": 2}]},
            {"scope": "Reach", "entries": [{"key": "left", "value": None, "type": "", "writes": 0}]},
        ]

    @property
    def tools(self):
        return {
            "entries": PageQuery(self.entries),
            "breakpoints": PageQuery(self.breakpoints, is_free=False),
            "otherwise": PageQuery(self.otherwise),
        }


@pytest.fixture
def recorded_tools(live, browser):
    """Open the engineer's page of a run with scripted tools; return the tools."""
    recorded_tools = Asked()
    run = live(orders=Operator(), tools=recorded_tools.tools).begin()
    run.status(1, "RUNNING", tick=1)
    run.status(1, "SUCCESS", tick=7)
    run.status(2, "RUNNING", tick=7)
    browser.open(engineer_url(run.server))
    return recorded_tools


def test_breakpoint_is_set_at_selected_node_and_paused_node_is_selected(recorded_tools, browser):
    browser.click("#tree [data-id='1']")
    browser.click("#tools button[aria-pressed]")
    browser.wait(lambda: any("breakpoint" in row for row in browser.rows()), "a row with a breakpoint")
    assert recorded_tools.nodes == {1}
    recorded_tools.held = 2
    browser.wait_for("#details", "nodeSearch")
    browser.click("#tools button:nth-child(2)")
    browser.wait(lambda: recorded_tools.held is None, "the order to go on")
    browser.wait(
        lambda: browser.js("return document.querySelector('#tools button:nth-child(2)').hidden"), "its end"
    )


def test_page_without_token_cannot_set_breakpoint(recorded_tools, browser):
    browser.open(browser.driver.current_url.partition("#")[0])
    browser.click("#tree [data-id='1']")
    browser.wait_for("#details", "nodeDrive")
    assert not browser.driver.find_element("css selector", "#tools button[aria-pressed]").is_displayed()


def test_consequence_of_other_outcome_is_shown_for_leaf(recorded_tools, browser):
    button = "#tools button:nth-child(3)"
    assert not browser.driver.find_element("css selector", button).is_displayed()
    browser.click("#tree [data-id='1']")
    browser.click(button)
    browser.wait_for("#otherwise", "FAILURE (aborted): Search FAILURE, the root FAILURE")
    assert recorded_tools.seen == [{"node": 1, "tick": 7, "run": 1, "robot": 0}]
    browser.click("#tree [data-id='2']")
    browser.wait(lambda: browser.text("#otherwise") == "", "nothing of the leaf before")
    browser.allow("409")
    browser.click(button)
    browser.wait_for("#otherwise", "Unknown: the tree has another shape now")


def test_blackboard_is_shown_when_opened(recorded_tools, browser):
    browser.click("#board summary")
    browser.wait_for("#board", "goal'east'str").wait_for("#board", "Reach/leftnot written")


def test_replay_states_that_blackboard_is_not_recorded(replay, browser):
    browser.open(engineer_url(replay)).click("#board summary")
    browser.wait_for("#board", "A journal does not contain the blackboard.")


def mouse(browser, kind, x, y, **said):
    """Send a mouse event at a point of the window."""
    said = {"type": kind, "x": x, "y": y, "button": "left", "clickCount": 1, **said}
    browser.driver.execute_cdp_cmd("Input.dispatchMouseEvent", said)


def centre(browser, selector):
    return browser.js(
        "const r = document.querySelector(arguments[0]).getBoundingClientRect(); return [r.x + r.width / 2, r.y + r.height / 2]",
        selector,
    )


def test_row_that_changes_during_click_is_selected(live, browser):
    run = live().begin()
    run.status(1, "RUNNING", "9 m left")
    browser.open(engineer_url(run.server))
    place = centre(browser, "#tree [data-id='1']")
    mouse(browser, "mousePressed", *place)
    run.status(1, "FAILURE", "no way there")
    browser.wait_for("#tree", "no way there")
    mouse(browser, "mouseReleased", *place)
    browser.wait_for("#details", "leaves.Drive")


def test_tree_is_folded_by_mouse(live, browser):
    run = live().begin()
    browser.open(engineer_url(run.server))
    for count in (1, 3):
        place = centre(browser, "#tree .twist")
        mouse(browser, "mousePressed", *place)
        mouse(browser, "mouseReleased", *place)
        assert len(browser.rows()) == count


def test_status_is_shown_by_shape_and_letter(live, browser):
    run = live().begin()
    statuses = ("RUNNING", "SUCCESS", "FAILURE")
    for node, status in enumerate(statuses):
        run.status(node, status)
    browser.open(engineer_url(run.server))
    signs = browser.js(
        "return [...document.querySelectorAll('#tree .badge')].map((b) => [b.textContent, b.firstChild.getAttribute('d')])"
    )
    assert [letter for letter, _ in signs] == ["R", "S", "F"]
    assert len({shape for _, shape in signs}) == 3


def wide_tree(count):
    """Return an outline of about `count` nodes, in groups of ten leaves."""
    (leaf, _), groups = ABOUT["tree"]["children"], []
    for group in range((count - 1) // 11):
        children = [{**leaf, "name": f"leaf {group}.{index}"} for index in range(10)]
        groups.append({**ABOUT["tree"], "name": f"group {group}", "children": children})
    return {**ABOUT["tree"], "children": groups}


@pytest.mark.parametrize("count", [1_000, 10_000])
def test_large_tree_renders_only_visible_rows(live, browser, count):
    run = live().begin({**ABOUT, "tree": wide_tree(count)})
    run.status(0, "RUNNING")
    run.status(16, "RUNNING", "here")
    browser.open(engineer_url(run.server))
    assert "leaf 1.3, Drive, RUNNING, here" in browser.rows()
    browser.click("#unfold")
    assert len(browser.rows()) < 60
    browser.type("#tree", Keys.END)
    last = (count - 1) // 11 - 1
    assert browser.rows()[-1].startswith(f"leaf {last}.9")
    browser.type("#search", "leaf 7.4")
    browser.wait_for("#found", " of ")
    assert [row.partition(",")[0] for row in browser.rows()[:3]] == ["Mission", "group 7", "leaf 7.4"]


def deep_tree(depth):
    """Return an outline of nested groups with a leaf in the innermost one."""
    tree = ABOUT["tree"]["children"][0]
    for level in reversed(range(depth)):
        tree = {**ABOUT["tree"], "name": f"level {level}", "children": [tree]}
    return tree


def test_deepest_name_fits_in_narrow_window(live, browser):
    run = live().begin({**ABOUT, "tree": deep_tree(120)})
    run.status(120, "RUNNING")
    browser.size(400, 640)
    browser.open(engineer_url(run.server))
    browser.type("#tree", Keys.END)
    browser.wait(lambda: browser.rows()[-1].startswith("Drive"), "the leaf")
    name = "return [...document.querySelectorAll('#tree .name')].at(-1).getBoundingClientRect().right"
    assert browser.js(name) < 400


def test_selected_text_of_node_stays_selected(live, browser):
    run = live().begin()
    run.status(1, "RUNNING", "9 m left")
    browser.open(engineer_url(run.server))
    browser.type("#tree", Keys.ARROW_DOWN)
    browser.js(
        "const place = [...document.querySelectorAll('#details dd')].find((dd) => dd.textContent.includes('mission.xml'));"
        "getSelection().selectAllChildren(place)"
    )
    run.status(1, "RUNNING", "8 m left")
    browser.wait_for("#details", "8 m left")
    assert browser.js("return String(getSelection())") == "trees/mission.xml:4"


def test_nothing_is_folded_during_search(live, browser):
    run = live().begin()
    browser.size(400, 640)
    browser.open(engineer_url(run.server))
    browser.click("nav [data-view=map]")
    browser.type("#map", "/")
    browser.type("#search", "Mission")
    browser.wait_for("#found", "3 of 3")
    browser.type("#tree", Keys.HOME, Keys.ARROW_LEFT, Keys.ENTER, Keys.ARROW_RIGHT)
    browser.type("#search", Keys.ESCAPE)
    assert len(browser.rows()) == 3


def test_screen_reader_gets_position_of_node_in_tree(live, browser):
    run = live().begin({**ABOUT, "tree": wide_tree(1_000)})
    browser.open(engineer_url(run.server))
    browser.click("#unfold")
    browser.type("#tree", Keys.END)
    current = "return document.getElementById('tree').getAttribute('aria-activedescendant')"
    places = "const row = document.getElementById(arguments[0]); return ['level', 'posinset', 'setsize'].map((name) => row.getAttribute(`aria-${name}`))"
    assert browser.js(places, browser.js(current)) == ["3", "10", "10"]

    def is_out_of_sight():
        # The browser may still be scrolling to the node that the key has selected.
        browser.js("document.getElementById('tree').scrollTop = 0")
        return browser.js(current) is None

    browser.wait(is_out_of_sight, "no node in sight")


@pytest.fixture
def replay(tmp_path):
    """Serve the page of a journal with two runs of 10 s, in each of which one point is reached."""
    place = tmp_path / "mission.journal"
    for number, point in enumerate(POINTS):
        clock = ManualClock()
        journal = open_journal(place, resume=bool(number))
        journal.clock = clock
        journal.attach(Patrol(), KINDS)
        journal.begin(ABOUT, {"node": "/patrol"})
        for tick in range(1, 11):
            clock.advance(1.0)
            journal.record_observation(
                "status", node=1, tick=tick, status="RUNNING", message=f"{10 - tick} m left"
            )
            journal.record_observation("pose", x=float(tick), y=0.0, yaw=0.0)
        journal.record_event("point_reached", point=point)
        journal.end_run(Ending.STOPPED, 130, "Stopped.")
        journal.close()
    with closing(PageServer(ReplayFeed(Replay([place]), {}), free_port())) as server:
        server.start()
        yield server


def go_to(browser, seconds):
    """Move the slider to a time."""
    browser.js(
        "const time = document.getElementById('time'); time.value = arguments[0]; time.dispatchEvent(new Event('input'))",
        seconds,
    )


def test_replay_end_is_reached_despite_rounding_to_hundredths(tmp_path, browser):
    place, clock = tmp_path / "mission.journal", ManualClock(100.0)
    journal = open_journal(place)
    journal.clock = clock
    journal.begin(ABOUT, {})
    clock.advance(5.14)
    journal.record_observation("pose", x=0.0, y=0.0, yaw=0.0)
    journal.end_run(Ending.STOPPED, 130, "Stopped.")
    journal.close()
    replay = Replay([place])
    assert replay.end > 5.14
    with closing(PageServer(ReplayFeed(replay, {}), free_port())) as server:
        server.start()
        browser.open(engineer_url(server))
        go_to(browser, 99)
        browser.wait_for("#condition", "stopped")


def test_replay_moves_back_and_forth_in_time(replay, browser):
    browser.open(engineer_url(replay))
    assert browser.text("#at").endswith("of 0:20")
    for seconds, left, points in (
        (3.5, "7 m left", 0),
        (19.0, "1 m left", 1),
        (20.0, "none", 2),
        (1.0, "9 m left", 0),
    ):
        go_to(browser, seconds)
        browser.wait_for("#now", left)
        browser.wait_for("#progress", f"points visited {points} of 2")


def test_slider_reaches_end_of_replay(tmp_path, browser):
    place = tmp_path / "mission.journal"
    journal = open_journal(place)
    journal.clock = clock = ManualClock()
    journal.begin(ABOUT, {})
    clock.advance(10.1237)
    journal.end_run(Ending.OVER, 0, "Complete.")
    journal.close()
    with closing(PageServer(ReplayFeed(Replay([place]), {}), 0)) as server:
        server.start()
        browser.open(engineer_url(server))
        browser.type("#time", Keys.END)
        browser.wait_for("#condition", "Complete.")


def test_going_back_in_replay_keeps_selection_and_folding(replay, browser):
    browser.open(engineer_url(replay))
    go_to(browser, 15.0)
    browser.wait_for("#clock", "run 2")
    browser.type("#tree", Keys.ARROW_DOWN)
    browser.wait_for("#details", "leaves.Drive")
    browser.type("#tree", Keys.ARROW_LEFT, Keys.ARROW_LEFT)
    go_to(browser, 3.0)
    browser.wait_for("#clock", "0:03")
    assert len(browser.rows()) == 1
    assert "py_trees.composites.Sequence" in browser.text("#details")


def test_reconnected_replay_keeps_its_time(replay, browser):
    browser.open(engineer_url(replay))
    go_to(browser, 13.0)
    browser.wait_for("#at", "0:13 of")
    browser.allow("ERR_CONNECTION_REFUSED", "ERR_INCOMPLETE_CHUNKED_ENCODING")
    feed, port = replay._feed, replay.port
    replay.close()
    browser.wait_for("#condition", "not connected")
    go_to(browser, 14.0)
    go_to(browser, 13.0)
    feed._ended = False
    with closing(PageServer(feed, port)) as again:
        browser.js("document.body.dataset.mode = ''")
        again.start()
        told = "return document.body.dataset.mode === 'replay' && document.body.classList.contains('ready')"
        browser.wait(lambda: browser.js(told), "the connection")
        assert browser.text("#at") == "0:13 of 0:20"


def test_hidden_replays_do_not_block_requests(replay, browser):
    browser.open(engineer_url(replay))
    first = browser.driver.current_window_handle
    for _ in range(7):
        browser.driver.switch_to.new_window("tab")
        browser.open(engineer_url(replay))
    browser.wait_for("#at", "of 0:20")
    go_to(browser, 13.0)
    browser.wait_for("#at", "0:13 of")
    for tab in [each for each in browser.driver.window_handles if each != first]:
        browser.driver.switch_to.window(tab)
        browser.driver.close()
    browser.driver.switch_to.window(first)
    go_to(browser, 15.0)
    browser.wait_for("#at", "0:15 of")


def log_lines(browser):
    return browser.js("return [...document.querySelectorAll('#log li span')].map((line) => line.textContent)")


def test_events_remain_after_many_log_lines(live, browser):
    run = live().begin()
    browser.open(engineer_url(run.server))
    run.journal.record_event("came_back")
    for number in range(450):
        run.journal.record_observation("log", node="patrol", level=20, text=f"line {number}")
    browser.wait_for("#log", "line 449")
    assert log_lines(browser)[0] == "line 50"
    browser.click("#facts")
    browser.wait(lambda: len(log_lines(browser)) == 2, "the facts")
    assert log_lines(browser) == ["The run began.", "came back"]


def test_log_has_no_lines_of_previous_mission(live, browser):
    run = live().begin()
    for number in range(2):
        run.journal.record_observation("log", node="patrol", level=20, text=f"first {number}")
    browser.open(engineer_url(run.server))
    told = [{"node": "patrol", "level": 20, "text": f"second {number}"} for number in range(9)]
    for entry in (("run_began", {**ABOUT, "run": {}}), *(("log", each) for each in told)):
        run.feed.add_entry(JournalEntry(9, 1, 0.0, 0.0, *entry))
    browser.wait_for("#log", "second 8")
    assert log_lines(browser) == ["The run began.", *(f"second {n}" for n in range(9))]


def test_log_follows_newest_line_unless_scrolled_up(live, browser):
    run = live().begin()
    browser.size(400, 800)
    browser.open(engineer_url(run.server))
    is_at_end = (
        "const log = document.getElementById('log');"
        "return log.clientHeight > 0 && log.scrollTop + log.clientHeight > log.scrollHeight - 5"
    )

    def tell(text):
        for _ in range(100):
            run.journal.record_observation("log", node="patrol", level=20, text=text)
        browser.wait_for("#log", text)

    tell("while the tree is shown")
    browser.click("nav [data-view=log]")
    browser.wait(lambda: browser.js(is_at_end), "the newest line")
    browser.type("#log", Keys.HOME)
    browser.wait(lambda: browser.js("return document.getElementById('log').scrollTop") == 0, "the beginning")
    tell("while somebody reads")
    assert browser.js("return document.getElementById('log').scrollTop") == 0


def test_replay_plays_to_its_end(replay, browser):
    browser.open(engineer_url(replay))
    browser.js("document.getElementById('speed').value = '100'")
    browser.type("body", " ")
    browser.wait_for("#at", "0:20 of 0:20")
    browser.wait_for("#condition strong", "stopped").wait_for("#condition", "Stopped.")
    assert browser.driver.find_element("id", "play").get_attribute("aria-label") == "Play"


def test_same_replay_time_shows_same_state_after_going_back(replay, browser):
    browser.open(engineer_url(replay))
    seen = []
    for seconds in (12.0, 20.0, 12.0):
        go_to(browser, seconds)
        browser.wait_for("#at", f"0:{seconds:.0f} of")
        seen.append((browser.rows(), browser.text("#log"), browser.text("#clock")))
    assert seen[0] == seen[2]
    assert seen[0] != seen[1]


def test_two_robots_share_map_and_have_own_trees(two, browser):
    browser.open(engineer_url(two))
    go_to(browser, 7.0)
    browser.wait_for("#now", "robot1 7")
    names = "return [...document.querySelectorAll('#map .label.name')].map((text) => text.textContent)"
    assert sorted(browser.js(names)) == ["robot1", "robot2"]
    browser.click("#robots .card:last-child")
    browser.wait_for("#now", "robot2 3").wait_for("#mission", "robot2")
    assert browser.text("#at") == "0:07 of 0:12"


FOLD = """
const done = arguments[1];
import('./static/run.js').then(({ Run }) => done(arguments[0].map((changes) => {
  const run = new Run();
  changes.forEach((change) => run.take(JSON.parse(change)));
  const { landmarks, version, ...parts } = run;
  const current = run.nodes.map(({ id }) => run.isCurrent(id));
  return JSON.stringify({ ...parts, landmarks: Object.fromEntries(landmarks), current });
})));
"""


def test_late_browser_has_same_state_as_early_one(live, browser):
    browser.open(engineer_url(live().server))
    early, late = [], []
    for seed in range(6):
        chance, state = random.Random(seed), PageState()  # noqa: S311
        changes: list[str] = []
        for entry in history(seed, 120):
            state.apply(entry)
            if chance.random() < 0.2:
                changes.append(as_json(state.change()))
                early.append(changes[:])
                late.append([as_json(state.full_state())])
    for known, whole in zip(states_of(browser, early), states_of(browser, late), strict=True):
        assert known == whole


def states_of(browser, runs):
    """Return the page's state after the changes of each run, with the order of landmarks, which matters."""
    folded = browser.driver.execute_async_script(FOLD, runs)
    return [(each := json.loads(text), [*each["landmarks"]]) for text in folded]


@pytest.mark.parametrize("size", [(400, 640), (400, 800), (1600, 800)])
def test_page_fits_in_window(live, browser, size):
    width, height = size
    run = live(orders=Operator(), verbs=[_form(verb) for verb in VERBS]).begin()
    run.status(
        1, "RUNNING", "navigating to a point with a long name, 3.14 m left, and more than there is room for"
    )
    run.journal.record_observation("log", node="patrol", level=30, text="long" * 100)
    run.journal.record_observation(
        "progress", target="a_point_with_a_long_name", distance=3.14, time_left=100.0
    )
    browser.size(width, height)
    browser.open(engineer_url(run.server))
    browser.wait(
        # The button to skip a zone is disabled, because there is no zone.
        lambda: (
            browser.js("return document.querySelectorAll('#orders button:enabled:not(#ask *)').length") == 7
        ),
        "the buttons",
    )
    for view in ("tree", "map", "log"):
        browser.js("document.querySelector(`nav [data-view=${arguments[0]}]`).click()", view)
        assert browser.js("return document.documentElement.scrollWidth") <= width
        assert browser.js("return document.documentElement.scrollHeight") <= height
