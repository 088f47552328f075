"""Tests of the operator's page in each condition of a search, on a phone and on a desktop."""

import re

import pytest

from tests.web.staged import CONDITIONS, WIDTHS, show, staged

pytestmark = pytest.mark.unmeasured

FORBIDDEN = re.compile(
    r"\b(SUCCESS|FAILURE|RUNNING|NotHeld|NotAborted|NotRecalled|bt_navigator|amcl|transform|navigate_to_pose|error code|status \d|/search_and_rescue/)"
)
"""Names of nodes, classes and topics, and codes, which an operator does not know."""
HEIGHTS = """
const height = (selector) => document.querySelector(selector)?.getBoundingClientRect().height ?? 0;
return [height('header'), height('#state'), height('#orders .first')];
"""
OVERFLOW = "return document.documentElement.scrollWidth - window.innerWidth"
FONT_SIZES = """
const walker = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
const sizes = new Set();
while (walker.nextNode()) if (walker.currentNode.data.trim() && walker.currentNode.parentElement.checkVisibility()) sizes.add(getComputedStyle(walker.currentNode.parentElement).fontSize);
return [...sizes];
"""
MAX_FONT_SIZES = 4
CUT_TEXTS = "return [...document.querySelectorAll('#state, #condition > *')].filter((each) => each.scrollHeight > each.clientHeight + 1 && each.clientHeight).map((each) => each.textContent)"
"""The texts of the state band that are cut off."""
FIRST_TASK = (
    "return document.querySelector('#tasks li > span, #tasks .nothing').getBoundingClientRect().bottom"
)
MAX_FIRST_TASK_BOTTOM = 200
"""The maximum distance of the end of the first task's text from the top, pixels."""
BAND, PHONE_SHARE = 64, 0.3
"""Maximum height of the state band on a desktop in pixels, and maximum share of a phone's height for header, band and STOP."""


@pytest.mark.parametrize("width", [360, 1280])
@pytest.mark.parametrize("name", CONDITIONS)
def test_page_shows_tasks_in_operator_terms_and_fits_limits(browser, name, width):
    _, level, task = CONDITIONS[name]
    with staged(name) as server:
        show(browser, server, name, width)
        browser.wait_for("#tasks", task)
        browser.wait(lambda: browser.js("return document.body.dataset.level") == level, level)
        header, band, stop = browser.js(HEIGHTS)
        text = browser.js("return document.body.innerText")
        assert FORBIDDEN.findall(text) == []
        assert browser.js(OVERFLOW) <= 0
        assert len(sizes := browser.js(FONT_SIZES)) <= MAX_FONT_SIZES, sizes
        assert browser.js(FIRST_TASK) <= MAX_FIRST_TASK_BOTTOM
        assert browser.js(CUT_TEXTS) == []
    if width == 360:
        assert header + band + stop <= PHONE_SHARE * WIDTHS[width]
    else:
        assert band <= BAND


PAGE_TEXTS = """
const rows = (selector) => [...document.querySelectorAll(selector)];
const after = (heading) => [...document.querySelectorAll('#places h2')].find((each) => each.textContent.startsWith(heading))?.nextElementSibling;
return {
  title: document.title,
  band: [...document.querySelectorAll('#condition > :not(b)')].map((each) => each.textContent),
  open: rows('#tasks li.warning, #tasks li.error').length + rows('#alarms li').filter((each) => !each.querySelector('small').textContent.endsWith('over')).length,
  figures: Object.fromEntries(rows('#figures div').map((each) => [each.firstChild.textContent, each.lastChild.textContent])),
  gauges: Object.fromEntries(rows('.gauge').map((each) => [each.firstChild.firstChild.textContent, each.querySelector('b').textContent])),
  times: Object.fromEntries(rows('#times div').map((each) => [each.firstChild.textContent, each.lastChild.textContent])),
  zones: [...(after('zones')?.children ?? [])].map((each) => each.querySelector('span').textContent),
  survivors: [...(after('survivors')?.children ?? [])].map((each) => each.querySelector('span').textContent),
  level: document.body.dataset.level,
  text: document.body.innerText,
};
"""
"""The numbers of a page, and the texts that they refer to."""
BANDS = {
    "driving": ("driving", "", "to zone_b"),
    "detection": ("driving", "1 task", "to zone_b"),
    "reports refused": ("driving", "2 tasks", "to zone_b"),
    "paused": ("paused", "for 0:00", "by Ann: smoke"),
    "waiting": ("waiting", "for 0:00", ""),
    "position lost": ("position lost", "for 0:00", "the robot does not know where it is"),
    "low battery": ("driving", "2 tasks, 1 alarm", "to base station"),
    "aborted": ("aborted", "", "By Ann: smoke. zone_b and zone_c were not visited."),
    "called home": ("ended early", "", "Called home by Ann: smoke. zone_b and zone_c were not visited."),
    "failed": ("failed", "", "No zone is left."),
    "complete": ("complete", "", ""),
    "complete, not reviewed": ("complete", "1 task", ""),
    "complete with less": ("complete", "1 task", ""),
    "crashed": ("program crashed", "", "at 1:05, on the way to zone_b: the robot may still be driving"),
    "lost": ("lost", "", "No contact for 0:30. The robot may still be driving."),
    "not begun": ("not begun", "", "waiting for navigation"),
    "stopped": ("stopped", "3 tasks", ""),
    "replay": ("replay: driving", "1 task", "to zone_b"),
    "team": ("robot3: program crashed", "", "at 1:05, on the way to zone_b: the robot may still be driving"),
}
"""The large word of each condition, the text beside it, and the beginning of the reason."""
NO_CONTACT_TEXTS = {"times": {"last contact": "1:05"}, "gauges": {"last battery": "62 %"}}
"""The numbers of a robot without contact."""


@pytest.mark.parametrize("name", CONDITIONS)
def test_numbers_on_page_are_consistent(browser, name):
    with staged(name) as server:
        show(browser, server, name, 1280)
        said = browser.js(PAGE_TEXTS)
    word, beside, reason = said["band"]
    assert (word, re.sub(r"\d:\d\d", "0:00", beside)) == BANDS[name][:2]
    assert reason.startswith(BANDS[name][2])
    assert bool(reason) == bool(BANDS[name][2])
    if found := re.findall(r"(\d) (?:task|alarm)", beside):
        assert sum(map(int, found)) == said["open"]
    (counted,) = re.findall(r"\((\d+)\)", said["title"]) or ["0"]
    if name != "team":  # its tasks and its title cover all robots
        assert int(counted) == said["open"]
    assert (said["level"] in ("good", "quiet")) == (said["open"] == 0)
    for figure, value in said["figures"].items():
        first = value.split()[0]
        assert {*re.findall(rf"{figure} ([\d.]+)", said["text"].replace("\n", " "))} <= {first}
    if said["figures"]:
        visited, _, whole = said["figures"]["zones visited"].partition(" of ")
        states = [row.split(" ", 1)[1] for row in said["zones"]]
        assert int(whole) == len(states)
        assert int(visited) == sum(state.startswith("visited") for state in states)
        assert int(said["figures"]["survivors found"]) == len(said["survivors"])
        assert int(said["figures"]["survivors reported"]) <= len(said["survivors"])
    if name in ("crashed", "lost", "team"):
        assert {"times": said["times"], "gauges": said["gauges"]} == NO_CONTACT_TEXTS
    for gauge, value in said["gauges"].items():
        known = {value.removeprefix("▼ ").partition(" ")[0]}
        assert {*re.findall(rf"{gauge}(?: is)?(?: at)? ([\d.]+) %", said["text"])} <= known
    if "to go" in said["times"] and name in ("paused", "waiting", "position lost"):
        assert not re.search(r"\d", said["times"]["to go"])


def test_detection_is_not_offered_as_duplicate_of_itself(browser):
    with staged("detection") as server:
        show(browser, server, "detection", 1280)
        browser.click("#tasks button:not(.link)")
        offered = "return document.querySelector('#ask [name=same_as] [value=survivor_1]').disabled"
        assert browser.js(offered)
        chosen = "const field = document.querySelector('#ask [name=survivor]'); field.value = ''; field.dispatchEvent(new Event('change'))"
        browser.js(chosen)
        assert not browser.js(offered)
