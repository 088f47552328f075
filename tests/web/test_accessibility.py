"""Both pages and the report for everybody: what axe-core finds, keys instead of a mouse, and what a finger can hit."""

import json
from importlib.resources import files

import pytest
from selenium.webdriver.common.keys import Keys

from sar_compiler.runtime.clock import ManualClock
from sar_compiler.web.run_page import _FailureExplainer, _form
from search_and_rescue.operator_commands import VERBS
from tests.web.conftest import as_address, patrol_report
from tests.web.flown import SCENES
from tests.web.test_page import Asked
from tests.web.test_page_server import Operator

pytestmark = pytest.mark.unmeasured

SIZES = [(width, dark) for width in (400, 800, 1600) for dark in (False, True)]
PAGES = ["", "tree"]
FINGER = 44
"""The least height and width of what is touched, in pixels."""


def tell(journal, scene):
    """Let a run come to a scene, with something of everything that a page can show."""
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
def told(live):
    """Begin a run that is at a scene; return it."""

    def begin(scene):
        run = live(orders=Operator(), verbs=[_form(verb) for verb in VERBS], tools=Asked().tools)
        run.journal.clock = ManualClock(100.0)
        run.journal.add_listener(_FailureExplainer(run.feed).add_entry)
        run.begin()
        tell(run.journal, scene)
        return run

    return begin


@pytest.fixture(scope="module")
def axe():
    """The source of axe-core."""
    package = pytest.importorskip("axe_core_python", reason="axe-core-python is not installed (extra dev)")
    return files(package).joinpath("axe.min.js").read_text("utf-8")


VIOLATIONS = """
const done = arguments[0];
axe.run().then(({ violations }) => done(violations.flatMap(({ id, nodes }) => nodes.map(({ html, failureSummary }) => `${id}: ${html}: ${failureSummary}`))));
"""


def require_none(browser, axe, what):
    """Fail with all that axe-core finds in a window of each size, in light and in dark."""
    browser.js(axe)
    found = {}
    for width, dark in SIZES:
        browser.size(width, 900, dark=dark)
        if violations := browser.driver.execute_async_script(VIOLATIONS):
            found[width, "dark" if dark else "light"] = violations
    assert not found, f"{what}: {json.dumps([*found.items()], indent=1)}"


def open_all(browser):
    """Unfold what can be unfolded."""
    browser.js("for (const each of document.querySelectorAll('details')) each.open = true")


def address(run, page):
    start, _, token = run.server.url.partition("#")
    return f"{start}{page}#{token}"


@pytest.mark.parametrize("page", PAGES)
@pytest.mark.parametrize("scene", ["driving", "paused", "failed"])
def test_axe_finds_nothing_wrong_with_the_page(told, browser, axe, page, scene):
    browser.open(address(told(scene), page))
    open_all(browser)
    require_none(browser, axe, f"/{page} while it is {scene}")


@pytest.mark.parametrize("page", PAGES)
def test_axe_finds_nothing_wrong_with_a_question(told, browser, axe, page):
    browser.open(address(told("driving"), page))
    browser.wait(lambda: browser.js("return !document.querySelector('.stop').disabled"), "STOP")
    browser.click(".stop")
    assert browser.js("return document.getElementById('ask').open")
    require_none(browser, axe, f"/{page} while it asks")


@pytest.mark.parametrize("page", PAGES)
def test_axe_finds_nothing_wrong_with_a_replay_of_two_robots(two, browser, axe, page):
    browser.open(f"{two.url}{page}")
    browser.wait(lambda: len(browser.js("return document.querySelectorAll('.card')")) == 2, "two cards")
    require_none(browser, axe, f"/{page} of two robots")


def test_axe_finds_nothing_wrong_with_the_report(browser, axe):
    browser.driver.get(as_address(patrol_report(lambda journal: tell(journal, "failed"))))
    require_none(browser, axe, "the report")


SMALL = """
const small = (each) => { const { width, height } = each.getBoundingClientRect(); return Math.min(width, height) < arguments[0]; };
const area = (each) => each.matches('input[type=checkbox]') ? each.closest('label') : each;
const all = [...document.querySelectorAll('button, a[href], input, select, summary')].filter((each) => each.checkVisibility());
return all.map(area).filter(small).map((each) => each.outerHTML);
"""


@pytest.fixture(params=[(400, False), (400, True), (1000, True), (1600, True)], ids=str)
def touched(browser, request):
    """A browser on a telephone, or on a larger screen that is touched."""
    width, is_touched = request.param
    browser.touch(is_touched=is_touched)
    browser.size(width, 900)
    assert browser.js("return matchMedia('(pointer: coarse)').matches") is is_touched
    return browser


def require_large(browser):
    """Fail with all that a finger could miss, in each part of a page."""
    open_all(browser)
    for view in ("tree", "map", "log", "lanes"):
        browser.js("document.querySelector(`nav [data-view=${arguments[0]}]`)?.click()", view)
        assert browser.js(SMALL, FINGER) == []


@pytest.mark.parametrize("page", PAGES)
def test_a_finger_hits_what_is_meant(told, touched, page):
    touched.open(address(told("failed"), page))
    require_large(touched)


def test_a_finger_hits_the_answer_to_a_question(told, touched):
    touched.open(address(told("driving"), ""))
    touched.wait(lambda: touched.js("return !document.querySelector('.stop').disabled"), "STOP")
    touched.click(".stop")
    require_large(touched)


@pytest.mark.parametrize("page", PAGES)
def test_a_finger_hits_a_robot_and_a_moment_of_a_replay(two, touched, page):
    touched.open(f"{two.url}{page}")
    touched.wait(lambda: len(touched.js("return document.querySelectorAll('.card')")) == 2, "two cards")
    require_large(touched)


REACHED = """
const at = document.activeElement;
return at === document.body ? '' : at.id || at.dataset.verb || at.className || at.textContent;
"""


@pytest.mark.parametrize("page", PAGES)
def test_everything_that_can_be_clicked_is_reached_by_tab(told, browser, page):
    run = told("driving")
    browser.open(address(run, page))
    browser.wait(lambda: browser.js("return !document.querySelector('.stop').disabled"), "STOP")
    wanted = browser.js(
        "return [...document.querySelectorAll('button:enabled, a[href], input, select, summary')]"
        ".filter((each) => each.checkVisibility()).length"
    )
    browser.js("document.body.tabIndex = -1; document.body.focus()")
    reached: list[str] = []
    while (at := tab(browser)) and len(reached) < 3 * wanted:
        reached.append(at)
    focusable = browser.js(
        "return document.querySelectorAll('#map, #log, #tree, #lanes, #chosen, #places[tabindex]').length"
    )
    assert wanted <= len(reached) <= wanted + focusable, reached


def tab(browser):
    """Press Tab; return what has the focus then, empty behind the last one."""
    browser.driver.switch_to.active_element.send_keys(Keys.TAB)
    return browser.js(REACHED)
