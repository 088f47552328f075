"""Tests of the layout of maps and printed reports in a real browser: no hidden labels, and nothing cut off."""

import pytest

from sar_compiler.journal.journal_entries import Ending
from sar_compiler.reports.report_html import html_report
from tests.reports.test_reports import CONFIRMED, alarm, mission
from tests.web.conftest import as_address, patrol_report
from tests.web.staged import show, staged

pytestmark = pytest.mark.unmeasured

OFFSETS = ((0.5, 0.2), (-0.5, 0.2), (0.2, -0.6), (0.2, 0.6))
"""Offsets of detections from a point, at positions of its label, in metres."""


def find_around(journal):
    """Record a detection near each of the two points, on different sides."""
    places = [(-3.0 + OFFSETS[0][0], 3.0 + OFFSETS[0][1]), (3.5 + OFFSETS[1][0], 3.0 + OFFSETS[1][1])]
    for number, (x, y) in enumerate(places, 1):
        journal.record_event("found", name=f"find_{number}", x=x, y=y)


HIDDEN_LABELS = """
const boxes = (selector) => [...document.querySelectorAll(selector)].map((each) => [each.textContent, each.getBoundingClientRect()]);
const share = (a, b) => Math.max(0, Math.min(a.right, b.right) - Math.max(a.left, b.left)) * Math.max(0, Math.min(a.bottom, b.bottom) - Math.max(a.top, b.top));
const labels = boxes(`${arguments[0]} .label:not(.scale, .said)`);
const others = [...labels, ...boxes(`${arguments[0]} .mark > path`)];
return labels.flatMap(([text, box]) => others.filter(([, other]) => other !== box && share(box, other) > 4).map(([other]) => [text, other]));
"""
"""The labels that overlap a mark or another label by more than 4 square pixels."""


def find_around_and_end(journal):
    find_around(journal)
    journal.end_run(Ending.OVER, 0)


def test_labels_of_report_map_do_not_overlap(browser):
    browser.driver.get(as_address(patrol_report(find_around_and_end)))
    assert browser.js(HIDDEN_LABELS, ".map") == []


@pytest.mark.parametrize("width", [400, 1600])
def test_labels_of_page_map_do_not_overlap(live, browser, width):
    run = live().begin()
    find_around(run.journal)
    browser.size(width, 800)
    browser.open(run.server.url)
    browser.wait_for("#map", "find_2")
    assert browser.js(HIDDEN_LABELS, "#map") == []


MISPLACED_LABELS = """
const centre = (box) => [(box.left + box.right) / 2, (box.top + box.bottom) / 2];
const marks = [...document.querySelectorAll('#map .mark')].map((each) => [each.querySelector('title').textContent.split(':')[0], centre(each.querySelector('path').getBoundingClientRect())]);
const labels = [...document.querySelectorAll('#map .label')].map((each) => [each.textContent, each.getBoundingClientRect(), each.previousElementSibling?.matches('.leader')]);
const away = (box, [x, y]) => Math.hypot(Math.max(box.left - x, 0, x - box.right), Math.max(box.top - y, 0, y - box.bottom));
const least = (values) => Math.min(...values);
return labels.filter(([name, box, isLed]) => !isLed && least(marks.filter(([each]) => each === name).map(([, at]) => away(box, at))) > 2 + least(marks.map(([, at]) => away(box, at)))).map(([name]) => name);
"""
"""The labels without a line to their mark that are nearer to another mark."""


@pytest.mark.parametrize("width", [400, 1600])
def test_label_is_nearest_to_its_mark_or_has_leader(live, browser, width):
    run = live().begin()
    for number in range(9):
        x, y = -1.0 + 0.7 * (number % 3), 1.0 + 0.7 * (number // 3)
        run.journal.record_event("point_added", point=f"a point in a crowd {number}", x=x, y=y)
    browser.size(width, 800)
    browser.open(run.server.url)
    browser.wait_for("#map", "a point in a crowd 8")
    assert browser.js(MISPLACED_LABELS) == []
    assert browser.js("return document.querySelectorAll('#map .leader').length") > 0


COVERED_LABELS = """
const boxes = (selector) => [...document.querySelectorAll(selector)].map((each) => [each.textContent.trim() || each.className, each.getBoundingClientRect()]);
const floor = document.querySelector('#map image').getBoundingClientRect();
const at = (column, row) => [floor.left + floor.width * column / 32, floor.top + floor.height * row / 32];
const [[left, top], [right, bottom]] = [at(9, 12), at(32, 13)];
const above = [['wall', { left, top, right, bottom }], ...boxes('.zoom, .ruler, .north, #map-title, #legend')];
const meet = (a, b) => Math.min(a.right, b.right) - Math.max(a.left, b.left) > 2 && Math.min(a.bottom, b.bottom) - Math.max(a.top, b.top) > 2;
return boxes('#map .label').flatMap(([name, box]) => above.filter(([, other]) => meet(box, other)).map(([what]) => [name, what]));
"""
"""The labels on the wall inside the hall of `tests.web.staged`, or below a button or a symbol of the map."""


@pytest.mark.parametrize("width", [360, 1280])
def test_no_label_is_on_wall_or_below_button(browser, width):
    with staged("complete, not reviewed") as server:
        show(browser, server, "complete, not reviewed", width)
        browser.wait_for("#map", "survivor_1")
        browser.wait(lambda: browser.js(COVERED_LABELS) == [], "a map whose labels nothing covers")


A4 = (688, 1001)
"""The area within the margins of a sheet in pixels (182 mm by 265 mm)."""
MAX_SHEETS = 2
"""The maximum number of sheets for the coordinator."""


@pytest.fixture
def large_report():
    """Return the report of a search with world coordinates, six survivors, three zones and three alarms."""
    named = [
        ("survivor_named", {"survivor": f"survivor_{number}", "x": 10.0 * number, "y": 1.0, "possibly": None})
        for number in range(2, 7)
    ]
    alarms = [alarm(f"There is a survivor at an unusable position in zone_{each}") for each in "abc"]
    return as_address(html_report(mission(*named, CONFIRMED, *alarms, ("zone_visited", {"zone": "zone_c"}))))


def test_printed_report_has_at_most_two_sheets(browser, large_report):
    browser.driver.get(large_report)
    assert 1 <= browser.pdf().count(b"/Type /Page\n") <= MAX_SHEETS


CUT_ELEMENTS = """
const edge = document.documentElement.clientWidth;
const cut = (each) => each.getBoundingClientRect().right > edge + 1 || (each.scrollWidth > each.clientWidth + 1 && each.clientWidth && getComputedStyle(each).display !== 'inline');
return [...document.querySelectorAll('main *:not(svg *)')].filter(cut).map((each) => each.outerHTML.slice(0, 200));
"""
"""The elements that exceed the right margin, or whose content is wider than they are."""


def test_printed_report_is_not_cut_at_right_margin(browser, large_report):
    browser.size(*A4, media="print")
    browser.driver.get(large_report)
    assert browser.js("return matchMedia('print').matches")
    assert browser.js(CUT_ELEMENTS) == []
