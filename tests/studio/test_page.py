"""The page of `sar-compile edit` in a browser: what is done on it is in the text, and in the file when it is saved."""

import shutil
from contextlib import closing
from functools import partial
from pathlib import Path

import pytest

from sar_compiler.studio.tree_studio import Studio
from sar_compiler.tree.discovery import read_tree_file
from sar_compiler.web.edit_page import EditedDocument, edit_app
from sar_compiler.web.page_server import AppServer
from tests.web.browsers import open_browser

pytestmark = pytest.mark.costly

SHIPPED = Path("trees")
_NODE = "return [...document.querySelectorAll('g.node')].find((each) => each.querySelector('text').textContent.endsWith(arguments[0]))"


@pytest.fixture(scope="module")
def browser():
    if not Path("sar_compiler/studio/static/codemirror.js").exists():
        pytest.skip("the page's text editor is not built here (make editor)")
    with open_browser() as opened:
        yield opened


@pytest.fixture(params=["search_and_rescue.xml", "search_and_rescue.yaml"])
def page(request, browser, tmp_path):
    """The editor of a copy of a shipped tree, open in the browser."""
    path = Path(shutil.copy(SHIPPED / request.param, tmp_path))
    document = EditedDocument(path)
    with closing(AppServer(partial(edit_app, document, Studio(path)), 0)) as server:
        server.start()
        browser.forget()
        browser.open(server.url)
        yield EditorPage(browser, path)
        browser.js("window.studio.saved()")
        browser.require_no_complaint()


class EditorPage:
    """The page as its user sees it, with its file."""

    def __init__(self, browser, path):
        self.browser, self.path, self.before = browser, path, path.read_bytes()

    @property
    def text(self):
        return self.browser.js("return window.studio.text()")

    def node(self, name):
        return self.browser.js(_NODE, name)

    def choose(self, name):
        from selenium.webdriver import ActionChains

        ActionChains(self.browser.driver).click(self.node(name)).perform()
        self.browser.wait_for("#chosen", name)

    def press(self, *keys):
        from selenium.webdriver import ActionChains

        chain = ActionChains(self.browser.driver)
        for key in keys[:-1]:
            chain.key_down(key)
        chain.send_keys(keys[-1])
        for key in keys[:-1]:
            chain.key_up(key)
        chain.perform()

    def drag(self, name, target, dx, dy):
        from selenium.webdriver import ActionChains

        chain = ActionChains(self.browser.driver, duration=50).click_and_hold(self.node(name))
        chain.move_to_element_with_offset(self.node(target), dx, dy).release().perform()

    def wait_for_text(self, is_right, what):
        self.browser.wait(lambda: is_right(self.text), what)

    def undo(self):
        self.browser.click("#undo")

    def names(self):
        return [each.attributes.get("name", each.tag) for each in read_tree_file(self.path).root.iterate()]


def test_what_is_dragged_is_moved_in_the_text_and_saved_and_undo_leads_back_to_the_first_byte(page):
    first = page.text
    assert first.encode() == page.before
    page.drag("AdvanceZone", "NavigateToZone", 0, -9)
    page.wait_for_text(lambda text: text != first, "a moved node")
    page.browser.wait_for("#chosen", "AdvanceZone")
    page.browser.click("#save")
    page.browser.wait_for("#state", "Saved")
    names = page.names()
    assert names.index("AdvanceZone") == names.index("NavigateToZone") - 1
    page.undo()
    page.wait_for_text(lambda text: text == first, "the first text")
    page.browser.click("#save")
    page.browser.wait(lambda: page.path.read_bytes() == page.before, "the first bytes")


def test_the_keyboard_alone_selects_moves_duplicates_and_deletes(page):
    from selenium.webdriver import Keys

    first = page.text
    page.browser.js("document.querySelector('g.node').focus()")
    for _ in range(3):
        page.press(Keys.ARROW_DOWN)
    page.browser.wait_for("#chosen", "NavigateToZone")
    page.press(Keys.ALT, Keys.ARROW_DOWN)
    page.wait_for_text(
        lambda text: text.index("NavigateToZone") > text.index("DetectSurvivor"), "a moved node"
    )
    page.browser.wait_for("#chosen", "NavigateToZone")
    page.browser.wait(
        lambda: page.browser.js("return document.activeElement.matches('g.node.chosen')"), "its focus"
    )
    page.press(Keys.CONTROL, "d")
    page.wait_for_text(lambda text: text.count("NavigateToZone") == 2, "a duplicate")
    page.browser.wait(
        lambda: page.browser.js("return document.querySelectorAll('g.node').length") == 15, "two"
    )
    page.browser.wait(
        lambda: page.browser.js("return document.activeElement.matches('g.node.chosen')"), "its focus"
    )
    page.press(Keys.DELETE)
    page.wait_for_text(lambda text: text.count("NavigateToZone") == 1, "one of them")
    for _ in range(3):
        page.undo()
    page.wait_for_text(lambda text: text == first, "the first text")


def test_a_mistake_in_the_text_leaves_the_drawing_and_is_repaired_by_a_click(page):
    first = page.text
    page.browser.js("window.studio.replace('AdvanceZone', 'AdvnceZone')")
    page.browser.wait_for("#findings", "there is no node 'AdvnceZone'")
    assert "error" in page.node("AdvnceZone").get_attribute("class")
    page.browser.js("document.querySelector('#findings li button:last-child').click()")
    page.browser.wait_for("#state", "No findings")
    assert page.text == first
    page.browser.js("window.studio.replace('AdvanceZone', '\\n<\\t:')")
    page.browser.wait_for("#stale", "last text without this error")
    page.browser.wait(lambda: page.browser.js("return !document.querySelector('#stale').hidden"), "a mark")
    assert page.node("AdvanceZone")


def test_a_node_from_the_palette_and_an_attribute_in_its_form_are_in_the_text(page):
    page.choose("NavigateToZone")
    page.browser.js(
        "const search = document.querySelector('#search'); search.value = 'Inverter';"
        "search.dispatchEvent(new Event('input')); document.querySelector('#around').checked = true;"
    )
    page.browser.click("#specs button")
    page.browser.wait_for("#chosen", "Inverter")
    page.browser.js(
        "const field = document.querySelector('#form [name=name]'); field.value = 'Not \"there\"';"
        "field.dispatchEvent(new Event('change'))"
    )
    page.browser.wait(lambda: page.node('Not "there"'), "its name")
    page.browser.click("#save")
    page.browser.wait_for("#state", "Saved")
    assert 'Not "there"' in page.names()


def test_a_counterexample_walks_over_the_drawing_and_selects_its_leaf(page):
    page.browser.click("#verify")
    page.browser.wait_for("#state", "states")
    page.browser.js("document.querySelector('#verdicts button').click()")
    page.browser.wait_for("#step", "tick 1: ZonesRemaining? some left")
    page.browser.wait_for("#chosen", "ZonesRemaining?")
    page.browser.click("#next")
    page.browser.wait_for("#step", "tick 1: NavigateToZone")


def test_a_file_that_another_program_has_changed_is_not_overwritten_without_a_question(page):
    page.browser.js("window.studio.replace('AdvanceZone', 'AlwaysSuccess')")
    page.path.write_bytes(page.before + b"\n")
    page.browser.js("document.querySelector('#save').disabled = false")
    page.browser.click("#save")
    page.browser.wait_for("#question", "Another program has changed the file")
    assert page.path.read_bytes() == page.before + b"\n"
    page.browser.js("document.querySelector('#choices button').click()")
    page.browser.wait_for("#state", "Saved")
    assert b"AlwaysSuccess" in page.path.read_bytes()
