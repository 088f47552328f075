"""What the operator's page shows in each condition of a search, on a phone and on a desk."""

import re

import pytest

from tests.web.staged import CONDITIONS, WIDTHS, staged

pytestmark = pytest.mark.unmeasured

FORBIDDEN = re.compile(
    r"\b(SUCCESS|FAILURE|RUNNING|NotHeld|NotAborted|NotRecalled|bt_navigator|amcl|transform|navigate_to_pose|error code|status \d|/search_and_rescue/)"
)
"""Words of nodes, classes, topics and codes, which an operator does not know."""
HEIGHTS = """
const height = (selector) => document.querySelector(selector)?.getBoundingClientRect().height ?? 0;
return [height('header'), height('#state'), height('#orders .first')];
"""
STICKING_OUT = "return document.documentElement.scrollWidth - window.innerWidth"
BAND, PHONE_SHARE = 64, 0.3
"""Height of the band on a desk, pixels, and the share of a phone for header, band and STOP."""


@pytest.mark.parametrize("width", [360, 1280])
@pytest.mark.parametrize("name", CONDITIONS)
def test_the_page_says_what_to_do_in_words_of_operators_and_leaves_room_for_the_map(browser, name, width):
    _, level, task = CONDITIONS[name]
    with staged(name) as server:
        browser.size(width, WIDTHS[width])
        browser.open(server.url)
        browser.wait_for("#tasks", task)
        browser.wait(lambda: browser.js("return document.body.dataset.level") == level, level)
        header, band, stop = browser.js(HEIGHTS)
        text = browser.js("return document.body.innerText")
        assert FORBIDDEN.findall(text) == []
        assert browser.js(STICKING_OUT) <= 0
    if width == 360:
        assert header + band + stop <= PHONE_SHARE * WIDTHS[width]
    else:
        assert band <= BAND
