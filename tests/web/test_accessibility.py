"""Tests of the accessibility of both pages and the report: axe-core, keyboard navigation, and sizes of touch targets."""

import json
from importlib.resources import files

import pytest
from selenium.webdriver.common.keys import Keys

from sar_compiler.runtime.clock import ManualClock
from sar_compiler.web.run_page import _FailureExplainer, _form
from search_and_rescue.operator_commands import VERBS
from tests.web.conftest import as_address, patrol_report
from tests.web.run_scene import SCENES
from tests.web.test_page import Asked
from tests.web.test_page_server import Operator

pytestmark = pytest.mark.unmeasured

SIZES = [(width, dark) for width in (400, 800, 1600) for dark in (False, True)]
PAGES = ["", "tree"]
MIN_TARGET_SIZE = 44
"""The minimum height and width of a touch target, in pixels."""


def record_scene(journal, scene):
    """Bring a run to a scene, with an example of everything that a page can show."""
    journal.record_observation("status", node=0, tick=1, status="RUNNING", message="")
    journal.record_observation("status", node=1, tick=1, status="RUNNING", message="3 m left")
    journal.record_event("found", name="find_1", x=-2.0, y=2.0)
    journal.record_event("alarmed", text="a find at an unusable position")
    watched = [{"name": each, "if_broken": "hold"} for each in ("at home at the end", "no way twice")]
    journal.record_observation("properties_watched", properties=watched)
    journal.raise_alarm("Property broken", "property_broken", property="no way twice", event="Drive driven")
    journal.record_observation("properties_owed", owed=["at home at the end"])
    journal.record_observation("log", node="patrol", level=30, text="the way is long")
    journal.record_observation("log", node="patrol", level=40, text="the way is gone")
    SCENES[scene](journal)


@pytest.fixture
def start_scene(live):
    """Return a function that starts a run and brings it to a scene."""

    def begin(scene):
        run = live(orders=Operator(), verbs=[_form(verb) for verb in VERBS], tools=Asked().tools)
        run.journal.clock = ManualClock(100.0)
        run.journal.add_listener(_FailureExplainer(run.feed).add_entry)
        run.begin()
        record_scene(run.journal, scene)
        return run

    return begin


@pytest.fixture(scope="module")
def axe():
    """Return the source of axe-core."""
    package = pytest.importorskip("axe_core_python", reason="axe-core-python is not installed (extra dev)")
    return files(package).joinpath("axe.min.js").read_text("utf-8")


VIOLATIONS = """
const done = arguments[0];
axe.run().then(({ violations }) => done(violations.flatMap(({ id, nodes }) => nodes.map(({ html, failureSummary }) => `${id}: ${html}: ${failureSummary}`))));
"""


def require_none(browser, axe, what):
    """Fail if axe-core finds violations in a window of any size, in light or dark mode."""
    browser.js(axe)
    found = {}
    for width, dark in SIZES:
        browser.size(width, 900, dark=dark)
        if violations := browser.driver.execute_async_script(VIOLATIONS):
            found[width, "dark" if dark else "light"] = violations
    assert not found, f"{what}: {json.dumps([*found.items()], indent=1)}"


def open_all(browser):
    """Open all collapsed sections."""
    browser.js("for (const each of document.querySelectorAll('details')) each.open = true")


def address(run, page):
    start, _, token = run.server.url.partition("#")
    return f"{start}{page}#{token}"


@pytest.mark.parametrize("page", PAGES)
@pytest.mark.parametrize("scene", ["driving", "paused", "failed"])
def test_page_has_no_axe_violations(start_scene, browser, axe, page, scene):
    browser.open(address(start_scene(scene), page))
    open_all(browser)
    require_none(browser, axe, f"/{page} while it is {scene}")


@pytest.mark.parametrize("page", PAGES)
def test_dialog_has_no_axe_violations(start_scene, browser, axe, page):
    browser.open(address(start_scene("driving"), page))
    browser.wait(lambda: browser.js("return !document.querySelector('.stop').disabled"), "STOP")
    browser.click(".stop")
    assert browser.js("return document.getElementById('ask').open")
    require_none(browser, axe, f"/{page} while it asks")


@pytest.mark.parametrize("page", PAGES)
def test_replay_of_two_robots_has_no_axe_violations(two, browser, axe, page):
    browser.open(f"{two.url}{page}")
    browser.wait(lambda: len(browser.js("return document.querySelectorAll('.card')")) == 2, "two cards")
    require_none(browser, axe, f"/{page} of two robots")


def test_report_has_no_axe_violations(browser, axe):
    browser.driver.get(as_address(patrol_report(lambda journal: record_scene(journal, "failed"))))
    require_none(browser, axe, "the report")


SMALL_TARGETS = """
const small = (each) => { const { width, height } = each.getBoundingClientRect(); return Math.min(width, height) < arguments[0]; };
const area = (each) => each.matches('input[type=checkbox]') ? each.closest('label') : each;
const all = [...document.querySelectorAll('button, a[href], input, select, summary')].filter((each) => each.checkVisibility());
return all.map(area).filter(small).map((each) => each.outerHTML);
"""


@pytest.fixture(params=[(400, False), (400, True), (1000, True), (1600, True)], ids=str)
def touch_browser(browser, request):
    """Return a browser of the size of a phone or a larger one, with or without touch."""
    width, is_touched = request.param
    browser.touch(is_touched=is_touched)
    browser.size(width, 900)
    assert browser.js("return matchMedia('(pointer: coarse)').matches") is is_touched
    return browser


def require_large_targets(browser):
    """Fail if a touch target in any view of a page is too small."""
    open_all(browser)
    for view in ("tree", "map", "log", "lanes"):
        browser.js("document.querySelector(`nav [data-view=${arguments[0]}]`)?.click()", view)
        assert browser.js(SMALL_TARGETS, MIN_TARGET_SIZE) == []


@pytest.mark.parametrize("page", PAGES)
def test_touch_targets_of_page_are_large_enough(start_scene, touch_browser, page):
    touch_browser.open(address(start_scene("failed"), page))
    require_large_targets(touch_browser)


def test_touch_targets_of_dialog_are_large_enough(start_scene, touch_browser):
    touch_browser.open(address(start_scene("driving"), ""))
    touch_browser.wait(lambda: touch_browser.js("return !document.querySelector('.stop').disabled"), "STOP")
    touch_browser.click(".stop")
    require_large_targets(touch_browser)


@pytest.mark.parametrize("page", PAGES)
def test_touch_targets_of_replay_are_large_enough(two, touch_browser, page):
    touch_browser.open(f"{two.url}{page}")
    touch_browser.wait(
        lambda: len(touch_browser.js("return document.querySelectorAll('.card')")) == 2, "two cards"
    )
    require_large_targets(touch_browser)


FOCUSED = """
const at = document.activeElement;
return at === document.body ? '' : at.id || at.dataset.verb || at.className || at.textContent;
"""


@pytest.mark.parametrize("page", PAGES)
def test_every_clickable_element_is_reachable_by_tab(start_scene, browser, page):
    run = start_scene("driving")
    browser.open(address(run, page))
    browser.wait(lambda: browser.js("return !document.querySelector('.stop').disabled"), "STOP")
    wanted = browser.js(
        "return [...document.querySelectorAll('button:enabled, a[href], input, select, summary')]"
        ".filter((each) => each.checkVisibility()).length"
    )
    browser.js("document.body.tabIndex = -1; document.body.focus()")
    reached: list[str] = []
    while (at := press_tab(browser)) and len(reached) < 3 * wanted:
        reached.append(at)
    focusable = browser.js(
        "return document.querySelectorAll('#map, #log, #tree, #lanes, #chosen, #places[tabindex]').length"
    )
    assert wanted <= len(reached) <= wanted + focusable, reached


def press_tab(browser):
    """Press Tab; return the focused element, empty after the last one."""
    browser.driver.switch_to.active_element.send_keys(Keys.TAB)
    return browser.js(FOCUSED)
