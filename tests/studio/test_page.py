"""Tests of the page of `sar-compile edit` in a browser: edits change the text, and the file after saving."""

import random
import shutil
import threading
from contextlib import closing
from functools import partial
from html import escape
from pathlib import Path

import pytest

from sar_compiler.studio import edited_document
from sar_compiler.studio.tree_studio import Studio
from sar_compiler.tree.discovery import read_tree_file
from sar_compiler.web.edit_page import edit_app
from sar_compiler.web.page_server import AppServer
from sar_compiler.writing import write_bytes
from tests.random_inputs import rounds
from tests.trees import document
from tests.web.browsers import open_browser
from tests.web.test_accessibility import axe, require_none

pytestmark = pytest.mark.costly
__all__ = ["axe"]  # a fixture

SHIPPED = Path("trees")
COMPARED = "return performance.getEntriesByType('resource').filter((each) => each.name.endsWith('ask/compare')).length"
_NODE = "return [...document.querySelectorAll('g.node')].find((each) => each.querySelector('text').textContent.endsWith(arguments[0]))"


@pytest.fixture(scope="module")
def browser():
    if not Path("sar_compiler/studio/static/codemirror.js").exists():
        pytest.skip("the page's text editor is not built here (make editor)")
    with open_browser() as opened:
        yield opened


@pytest.fixture(params=["search_and_rescue.xml", "search_and_rescue.yaml"])
def page(request, browser, tmp_path):
    """Open the editor with a copy of a shipped tree in the browser."""
    path = Path(shutil.copy(SHIPPED / request.param, tmp_path))
    with closing(AppServer(partial(edit_app, Studio(path)), 0)) as server:
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


def test_dragged_node_is_moved_saved_and_restored_by_undo(page):
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


@pytest.mark.parametrize("size", [(1400, 900), (820, 700)])
def test_drawing_stays_still_during_drag_and_node_drops_at_mark(page, size):
    from selenium.webdriver import ActionChains

    page.browser.size(*size)
    first, before = page.text, page.node("Patrol").rect
    pressed = ActionChains(page.browser.driver, duration=50).click_and_hold(page.node("ZonesRemaining?"))
    pressed.move_by_offset(9, 0).perform()
    page.browser.js("window.studio.replace('AdvanceZone', 'AlwaysSuccess')")
    page.browser.js("window.studio.replace('AlwaysSuccess', 'AdvanceZone')")
    assert page.node("Patrol").rect == before
    left = ActionChains(page.browser.driver, duration=50)
    left.move_to_element_with_offset(page.node("Patrol"), 4 - before["width"] // 2, 0).perform()
    assert page.node("Patrol").rect == before
    left.release().perform()
    page.wait_for_text(lambda text: text.index("ZonesRemaining?") < text.index("Patrol"), "a moved node")
    page.browser.wait_for("#chosen", "ZonesRemaining?")
    for _ in range(3):
        page.undo()
    page.wait_for_text(lambda text: text == first, "the first text")


def test_keyboard_selects_moves_duplicates_and_deletes(page):
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


def test_text_error_keeps_drawing_and_is_fixed_by_click(page):
    first = page.text
    page.browser.js("window.studio.replace('AdvanceZone', 'AdvnceZone')")
    page.browser.wait_for("#findings", "there is no node 'AdvnceZone'")
    assert "error" in page.node("AdvnceZone").get_attribute("class")
    page.browser.js("document.querySelector('#findings li button:last-child').click()")
    page.browser.wait_for("#state", "No findings")
    assert page.text == first
    page.browser.js("window.studio.replace('AdvanceZone', '\\n<\\t:')")
    page.browser.wait_for("#stale", "last version of the text that could be parsed")
    page.browser.wait(lambda: page.browser.js("return !document.querySelector('#stale').hidden"), "a mark")
    assert page.node("AdvanceZone")


def test_palette_node_and_form_attribute_are_saved(page):
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


def test_next_field_keeps_focus_after_attribute_edit(page):
    from selenium.webdriver import Keys

    page.choose("Patrol")
    page.browser.type("#form [name=name]", "led", Keys.TAB)
    page.browser.wait(lambda: page.node("Patrolled"), "its name")
    page.browser.wait(lambda: page.browser.js("return window.studio.isSettled()"), "its findings")
    assert page.browser.js("return document.activeElement.name") == "memory"


def test_counterexample_steps_select_their_leaf(page):
    page.browser.click("#verify")
    page.browser.wait_for("#verdicts", "does not hold")
    page.browser.js("document.querySelector('#verdicts button').click()")
    page.browser.wait_for("#step", "tick 1: ZonesRemaining? some left")
    page.browser.wait_for("#chosen", "ZonesRemaining?")
    page.browser.click("#next")
    page.browser.wait_for("#step", "tick 1: NavigateToZone")


def test_file_changed_by_other_program_is_overwritten_only_after_question(page):
    page.browser.js("window.studio.replace('AdvanceZone', 'AlwaysSuccess')")
    page.path.write_bytes(page.before + b"\n")
    page.browser.js("document.querySelector('#save').disabled = false")
    page.browser.click("#save")
    page.browser.wait_for("#question", "Another program has changed the file")
    assert page.path.read_bytes() == page.before + b"\n"
    page.browser.js("document.querySelector('#choices button').click()")
    page.browser.wait_for("#state", "Saved")
    assert b"AlwaysSuccess" in page.path.read_bytes()


@pytest.mark.parametrize("page", ["search_and_rescue.xml"], indirect=True)
def test_slow_save_is_not_mistaken_for_change_by_other_program(page, monkeypatch):
    is_late = threading.Event()

    def write_slowly(path, data):
        write_bytes(path, data)
        assert is_late.wait(60.0), "the page's timer did not run"

    monkeypatch.setattr(edited_document, "write_bytes", write_slowly)
    page.browser.js("window.studio.replace('AdvanceZone', 'AlwaysSuccess')")
    page.browser.click("#save")
    # The page's timer that compares the file has the same period.
    page.browser.js("window.periods = 0; setInterval(() => { window.periods += 1; }, 2000)")
    page.browser.wait(lambda: page.browser.js("return window.periods") > 1, "two periods")
    is_late.set()
    page.browser.wait_for("#state", "Saved")
    compared = page.browser.js(COMPARED)
    page.browser.wait(lambda: page.browser.js(COMPARED) > compared + 1, "two comparisons")
    page.undo()
    page.wait_for_text(lambda text: text.encode() == page.before, "the first text")


COUNTER = (
    '<Sequence><Script code="n := 0"/><KeepRunningUntilFailure><Sequence><NavigateToZone/><Script code="n += 1"/>'
    '<ScriptCondition code="n &lt; 1000000000"/></Sequence></KeepRunningUntilFailure></Sequence>'
)
"""A tree with more states than a search can explore."""


def test_proof_shows_progress_and_can_be_stopped(page):
    page.browser.js(REPLACE_ALL, document(COUNTER))
    if page.path.suffix == ".yaml":
        return
    page.browser.wait_for("#state", "No findings")
    page.browser.click("#verify")
    page.browser.wait_for("#state", "Exploring all runs")
    page.browser.wait_for("#state", " states, ")
    page.browser.click("#stop")
    page.browser.wait_for("#state", "not all explored (stopped)")
    page.browser.wait_for("#verdicts", "not decided")


def test_run_is_played_with_facts_and_saved_as_scenario(page):
    page.browser.click("#play")
    page.browser.wait_for("#state", "6 ticks")
    page.browser.wait_for("#values", "zones_left")
    page.browser.click("#record")
    page.browser.js("document.querySelector('#choices button').click()")
    page.browser.wait_for("#state", "Saved as")
    assert [each.name for each in page.path.parent.glob("*.scenario.yaml")]


@pytest.mark.parametrize("page", ["search_and_rescue.xml"], indirect=True)
def test_leaf_can_have_name_of_a_javascript_property(page):
    page.browser.js(REPLACE_ALL, document('<AlwaysSuccess name="constructor"/>'))
    page.browser.wait(lambda: page.node("constructor"), "the leaf")
    page.choose("constructor")
    assert page.browser.js("return document.querySelector('#scripted input').value") == ""


def test_prediction_is_shown(page):
    page.browser.click("#predict")
    page.browser.wait_for("#prediction", "success:")


def test_folded_node_stays_folded_through_edits(page):
    page.choose("Patrol")
    count = len(page.browser.js("return document.querySelector('tree-drawing').nodes"))
    page.press(" ")
    page.browser.wait(
        lambda: len(page.browser.js("return document.querySelector('tree-drawing').nodes")) < count, "a fold"
    )
    assert page.node("Patrol").get_attribute("aria-expanded") == "false"
    page.browser.js("window.studio.replace('MissionOrReturnToBase', 'Other')")
    page.browser.wait(lambda: page.node("Other"), "the edited name")
    assert page.node("Patrol").get_attribute("aria-expanded") == "false"
    page.browser.click("#unfold")
    page.browser.wait(lambda: page.node("AdvanceZone"), "a leaf")


def test_node_is_found_and_key_marks_its_writers_and_readers(page):
    page.browser.type("#find", "advance", "\ue007")
    page.browser.wait_for("#chosen", "AdvanceZone")
    if page.path.suffix == ".yaml":
        return
    text = document('<Sequence><Script code="a := 1"/><AlwaysSuccess _skipIf="a == 2"/></Sequence>')
    page.browser.js(REPLACE_ALL, text)
    page.browser.wait(
        lambda: page.browser.js("return document.querySelector('#key').options.length") == 2, "a key"
    )
    page.browser.js("const key = document.querySelector('#key'); key.value = 'a'; key.onchange()")
    assert len(page.browser.js("return document.querySelectorAll('g.node.writes')")) == 1
    assert len(page.browser.js("return document.querySelectorAll('g.node.reads')")) >= 2


def test_page_has_no_accessibility_violations(page, axe):
    page.choose("NavigateToZone")
    page.browser.click("#verify")
    page.browser.wait_for("#verdicts", "does not hold")
    page.browser.js("document.querySelector('#verdicts button').click()")
    page.browser.js("window.studio.replace('AdvanceZone', 'AdvnceZone')")
    page.browser.wait_for("#findings", "AdvnceZone")
    require_none(page.browser, axe, "the editor")


HOSTILE = [
    "<script>hacked()</script>", "<img src=x onerror=hacked()>", '"><svg onload=hacked()>', "javascript:hacked()", "{<b onclick=hacked()>}",
    "</text></svg><script>hacked()</script>", "&lt;script&gt;", "'-hacked()-'", "<a href='javascript:hacked()'>", "]]><script>hacked()</script>",
]  # fmt: skip
REPLACE_ALL = "window.studio.replace(window.studio.text(), arguments[0])"
ACTIVE_CONTENT = """
const found = [...document.querySelectorAll('*')].filter((each) => [...each.attributes].some(({ name, value }) => /^on/i.test(name) || /javascript:/i.test(/^(href|src|xlink:href|action)$/.test(name) ? value : '')));
const drawn = [...document.querySelectorAll('tree-drawing *')].filter((each) => !/^(svg|g|path|rect|text|title)$/.test(each.localName));
return [...found, ...drawn, ...document.querySelectorAll('script:not([src="studio.js"]), iframe, object, embed, img, a')].map((each) => each.outerHTML);
"""


def hostile_tree(rng):
    """Return a tree with markup and scripts in names, values, keys and comments."""

    def attribute():
        name = rng.choice(["name", "ID", "onload", "code", "_skipIf", "href", "xlink", "style", "value"])
        return f'{name}="{escape(rng.choice(HOSTILE))}"'

    def node(depth):
        tag = rng.choice(
            [
                "Sequence",
                "Fallback",
                "Script",
                "script",
                "img",
                "svg",
                "SubTree",
                "foreignObject",
                "a",
                "AlwaysSuccess",
            ]
        )
        pairs = {each.partition("=")[0]: each for each in (attribute() for _ in range(rng.randrange(4)))}
        inside = "".join(node(depth + 1) for _ in range(rng.randrange(3) if depth < 4 else 0))
        return f"<{tag} {' '.join(pairs.values())}><!-- {rng.choice(HOSTILE).replace('--', '')} -->{inside}</{tag}>"

    name = escape(rng.choice(HOSTILE))
    return f'<root BTCPP_format="4"><BehaviorTree ID="{name}"><Sequence>{node(0)}{node(0)}</Sequence></BehaviorTree></root>'


@pytest.mark.parametrize("page", ["search_and_rescue.xml"], indirect=True)
def test_hostile_tree_runs_no_script_on_the_page(page):
    rng = random.Random(3)  # noqa: S311 - a test
    page.browser.js("window.hacked = () => { window.isHacked = true }")
    for _ in range(rounds(20)):
        page.browser.js(REPLACE_ALL, hostile_tree(rng))
        page.browser.wait(lambda: page.browser.js("return window.studio.isSettled()"), "a look")
        for choose in ("nodes.at(-1)", "nodes[1]"):
            page.browser.js(
                f"const node = document.querySelector('tree-drawing').{choose}; node?.dispatchEvent(new MouseEvent('click', {{bubbles: true}}))"
            )
        assert page.browser.js(ACTIVE_CONTENT) == []
    assert page.browser.js("return window.isHacked") is None
