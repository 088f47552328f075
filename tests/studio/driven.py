"""The graphical editor as its user drives it: the page in a browser, and random operations on it, compared with those on plain lists."""

from collections import Counter
from typing import ClassVar

from sar_compiler.editing.operations import edits_of
from sar_compiler.editing.text_edits import EditError
from sar_compiler.tree.discovery import parse_tree
from tests.editing.test_operations import Model, in_order, listed, place_of

_TAGS = ("Sequence", "Fallback", "Inverter", "AlwaysSuccess", "ForceFailure")
_VALUES = ("", "a b", "<&>\"'", "ä😀", "{key}", "{a}-{b}", "#1: x", "- y", "12")
_SHOWN = "return document.querySelector('tree-drawing').numbers"
# Where a drop means before, in and after, as a share of a box.
_SIDES = {"before": (0.15, 0.2), "in": (0.5, 0.5), "after": (0.85, 0.8)}
# The arguments that the page leaves out.
_OMITTED = {
    "wrap": lambda element: {"attributes": {}, "last": element},
    "insert": lambda _element: {"attributes": {}},
}
# A box of the drawing that can be hit by a mouse, in the middle and where it is dropped on; otherwise nothing.
_HIT = """
const drawing = document.querySelector('tree-drawing');
const node = drawing.nodes[drawing.numbers.indexOf(arguments[0])];
node.scrollIntoView({ block: 'center', inline: 'center' });
"""
_SPOT = """
const drawing = document.querySelector('tree-drawing');
const [number, x, y] = arguments;
const node = drawing.nodes[drawing.numbers.indexOf(number)];
const box = node.querySelector('path').getBoundingClientRect();
const spot = [Math.round(box.left + x * box.width), Math.round(box.top + y * box.height)];
return document.elementFromPoint(...spot)?.closest('g.node') === node ? spot : null;
"""


class DrivenPage:
    """The page of a file in a browser.

    Args:
        browser: The browser, in which the page is open.
        path: The file's name; its ending is the form of the text.
        rng: Chooses the operations.
    """

    def __init__(self, browser, path, rng):
        self.browser, self.path, self.rng = browser, str(path), rng
        self.done: Counter[str] = Counter()

    @property
    def text(self):
        return self.browser.js("return window.studio.text()")

    def operate(self):
        """Do a random operation with mouse or keyboard, and require that text and tree are right; return its name, or nothing if it is impossible."""
        before = self.text
        tree_file = parse_tree(before, self.path)
        pairs = in_order(listed(tree_file.root))
        shown = [
            each
            for each in self.browser.js(_SHOWN)
            if each is not None and pairs[each][0][0] != "BehaviorTree"
        ]
        if not shown:
            return ""
        element = self.rng.choice(shown)
        kind = self.rng.choice(sorted(self._KINDS))
        planned = self._KINDS[kind](self, pairs, element)
        if planned is None:
            return ""
        (name, arguments), act = planned
        try:
            edits = edits_of(tree_file, name, **arguments)
        except EditError:
            return ""
        if not edits or not self._choose(element):
            return ""
        if act() is False:
            return ""
        self.browser.wait(lambda: self.text != before, f"{name} {arguments} on {self.path}")
        self._settle()
        after = self.text
        expected = Model(listed(tree_file.root))
        getattr(expected, name)(**_OMITTED.get(name, lambda _element: {})(element), **arguments)
        assert listed(parse_tree(after, self.path).root) == expected.root, (self.path, name, arguments)
        require_untouched(tree_file, after, element)
        self.done[kind] += 1
        return kind

    def undo_all(self, first):
        """Undo until there is nothing left, and require the first text."""
        for _ in range(self.done.total()):
            before = self.text
            self.browser.click("#undo")
            self.browser.wait(lambda before=before: self.text != before, "an undone edit")
        assert self.text == first, self.path
        self._settle()

    def _settle(self):
        self.browser.wait(
            lambda: self.browser.js("return window.studio.isSettled()"), "the drawing of the text"
        )

    def _choose(self, element):
        from selenium.webdriver import ActionChains

        self.browser.js(_HIT, element)
        spot = self.browser.js(_SPOT, element, 0.5, 0.5)
        if spot is None:
            return False
        chain = ActionChains(self.browser.driver, duration=0)
        chain.w3c_actions.pointer_action.move_to_location(*spot).click()
        chain.perform()
        self.browser.wait(
            lambda: self.browser.js("return window.studio.chosen()") == element, "a chosen node"
        )
        return True

    def _button(self, text):
        def press():
            found = self.browser.js(
                "const found = [...document.querySelectorAll('#actions button')].find((each) => each.textContent === arguments[0]);"
                "found?.click(); return Boolean(found);",
                text,
            )
            assert found, f"no button {text} for {self.browser.text('#chosen')} in {self.path}"

        return press

    def _up(self, pairs, element):
        node, parent = pairs[element]
        index = place_of(node, parent)
        arguments = {"element": element, "parent": number_of(pairs, parent), "index": index - 1}
        return (("move", arguments), self._button("Up")) if index else None

    def _down(self, pairs, element):
        node, parent = pairs[element]
        index = place_of(node, parent)
        arguments = {"element": element, "parent": number_of(pairs, parent), "index": index + 2}
        return (("move", arguments), self._button("Down")) if index + 1 < len(parent[2]) else None

    def _keys(self, pairs, element):
        """Move it into the sibling before it by the keyboard."""
        from selenium.webdriver import ActionChains, Keys

        node, parent = pairs[element]
        index = place_of(node, parent)
        if not index:
            return None
        before = parent[2][index - 1]
        arguments = {"element": element, "parent": number_of(pairs, before), "index": len(before[2])}

        def press():
            self.browser.js("document.querySelector('g.node.chosen').focus()")
            chain = (
                ActionChains(self.browser.driver, duration=0).key_down(Keys.ALT).send_keys(Keys.ARROW_RIGHT)
            )
            chain.key_up(Keys.ALT).perform()

        return ("move", arguments), press

    def _duplicate(self, _pairs, element):
        return ("duplicate", {"element": element}), self._button("Duplicate")

    def _unwrap(self, pairs, element):
        return (("unwrap", {"element": element}), self._button("Unwrap")) if pairs[element][0][2] else None

    def _delete(self, pairs, element):
        is_small = len(in_order(pairs[element][0])) < 5
        return (("delete", {"element": element}), self._button("Delete")) if is_small else None

    def _palette(self, tag, *, around):
        return lambda: self.browser.js(
            "document.querySelector('#around').checked = arguments[1]; const search = document.querySelector('#search');"
            "search.value = arguments[0]; search.dispatchEvent(new Event('input'));"
            "[...document.querySelectorAll('#specs button')].find((each) => each.textContent === arguments[0]).click()",
            tag,
            around,
        )

    def _wrap(self, _pairs, element):
        tag = self.rng.choice(_TAGS)
        return ("wrap", {"element": element, "tag": tag}), self._palette(tag, around=True)

    def _insert(self, pairs, element):
        node, parent = pairs[element]
        tag = self.rng.choice(_TAGS)
        inside = {"parent": element, "index": len(node[2])}
        behind = {"parent": number_of(pairs, parent), "index": place_of(node, parent) + 1}
        place = inside if self.browser.js("return window.studio.canHold(arguments[0])", element) else behind
        return ("insert", {**place, "tag": tag}), self._palette(tag, around=False)

    def _set_attribute(self, pairs, element):
        name = self.rng.choice(["name", *pairs[element][0][1]])
        value = self.rng.choice(_VALUES)
        arguments = {"element": element, "name": name, "value": value or None}

        def fill():
            return self.browser.js(
                "const field = document.querySelector('#form').elements[arguments[0]]; if (!field?.matches?.('input')) return false;"
                "field.value = arguments[1]; field.dispatchEvent(new Event('change')); return true;",
                name,
                value,
            )

        return ("set_attribute", arguments), fill

    def _drag(self, pairs, element):
        from selenium.webdriver import ActionChains

        inside = {id(each) for each, _ in in_order(pairs[element][0])}
        others = [
            each
            for each in self.browser.js(_SHOWN)
            if each is not None and each > 1 and id(pairs[each][0]) not in inside
        ]
        if not others:
            return None
        target, side = self.rng.choice(others), self.rng.choice([*_SIDES])
        node, parent = pairs[target]
        can_hold = self.browser.js("return window.studio.canHold(arguments[0])", target)
        if side == "in" and not can_hold:
            return None
        beside = {"parent": number_of(pairs, parent), "index": place_of(node, parent) + (side == "after")}
        place = {"parent": target, "index": len(node[2])} if side == "in" else beside

        def drag():
            start, end = (
                self.browser.js(_SPOT, element, 0.5, 0.5),
                self.browser.js(_SPOT, target, *_SIDES[side]),
            )
            if start is None or end is None:
                return False
            chain = ActionChains(self.browser.driver, duration=0)
            pointer = chain.w3c_actions.pointer_action
            pointer.move_to_location(*start).pointer_down()
            pointer.move_to_location(start[0] + 9, start[1] + 9).move_to_location(*end).pointer_up()
            chain.perform()
            return True

        return ("move", {"element": element, **place}), drag

    _KINDS: ClassVar = {
        "up": _up, "down": _down, "keys": _keys, "duplicate": _duplicate, "unwrap": _unwrap, "delete": _delete, "wrap": _wrap,
        "insert": _insert, "set_attribute": _set_attribute, "drag": _drag,
    }  # fmt: skip


def number_of(pairs, node):
    return next(number for number, (each, _) in enumerate(pairs) if each is node)


def require_untouched(tree_file, after, element):
    """Require that the texts from each element to the next one stay, but for those of an element and around its old and its new place."""
    gone = Counter(texts_between(tree_file)) - Counter(
        texts_between(parse_tree(after, tree_file.source.path))
    )
    inside = sum(1 for _ in [*tree_file.root.iterate()][element].iterate())
    assert gone.total() <= inside + 4, gone


def texts_between(tree_file):
    text, starts = tree_file.source.text, [each.offset for each in tree_file.root.iterate()]
    return [text[start:end] for start, end in zip(starts, [*starts[1:], len(text)], strict=True)]
