"""Operations on the elements of a tree file. Each operation is a list of edits of the file's text.

An element is identified by its index in the order of the file, from 0 for the root element. Before the edits of an
operation are returned, the edited text is parsed, so that edits never make a file invalid.
"""

import itertools
import re
from collections.abc import Callable, Iterator, Mapping
from typing import Any, NamedTuple

from sar_compiler.editing.text_edits import (
    EditError,
    Snippet,
    SnippetLine,
    TextEdit,
    apply_edits,
    edit_between,
)
from sar_compiler.editing.xml_text import XmlText
from sar_compiler.editing.yaml_text import YamlText
from sar_compiler.tree.diagnostic import Form, TreeError
from sar_compiler.tree.discovery import parse_tree
from sar_compiler.tree.model import SUBTREE_TAG, TREE_TAG, Element, TreeFile, synthetic_element

_KEY = re.compile(r"\{(@?\w+)\}")
_SCRIPTS = re.compile(r"_(?:skipIf|successIf|failureIf|while|on[A-Z]\w*)|code|if|condition")
_AUTOREMAP, _MAIN = "_autoremap", "main_tree_to_execute"
_OF_SUBTREE = ("ID", "name", _AUTOREMAP)


class Siblings(NamedTuple):
    """Consecutive children of an element.

    Attributes:
        parent: The parent element.
        place: The index of the first sibling.
        first: The first sibling.
        last: The last sibling.
    """

    parent: Element
    place: int
    first: Element
    last: Element


class EditedFile:
    """A file to which operations are applied.

    Args:
        tree_file: The file.

    Attributes:
        tree_file: The file.
        elements: All elements, in the order of the file.
        text: The edits of the file's text.
    """

    def __init__(self, tree_file: TreeFile) -> None:
        self.tree_file = tree_file
        self.elements = [*tree_file.root.iterate()]
        form = XmlText if tree_file.source.form is Form.XML else YamlText
        self.text: XmlText | YamlText = form(tree_file)
        # For each element's offset: the element's parent and its index among the parent's children.
        self._places = {
            child.offset: (each, index) for each in self.elements for index, child in enumerate(each.children)
        }

    def element(self, number: int) -> Element:
        """Return the element with a number.

        Raises:
            EditError: If no element has this number.
        """
        if not 0 <= number < len(self.elements):
            message = f"there is no element {number}. The text has changed"
            raise EditError(message)
        return self.elements[number]

    def number(self, element: Element) -> int:
        """Return an element's number."""
        return next(index for index, each in enumerate(self.elements) if each is element)

    def siblings(self, number: int, last: int | None = None) -> Siblings:
        """Return the siblings from a first to a last element. By default, the first element is also the last.

        Raises:
            EditError: If the first element is the root element, or the last element is not a later sibling.
        """
        first, end = self.element(number), self.element(number if last is None else last)
        if first.offset not in self._places:
            message = f"<{first.tag}> contains the whole file and cannot be moved or deleted"
            raise EditError(message)
        (parent, index), (other, last_index) = (self._places[each.offset] for each in (first, end))
        if other is not parent or last_index < index:
            message = "these elements are not adjacent siblings. Select adjacent children of one parent"
            raise EditError(message)
        return Siblings(parent, index, first, end)

    def tree_around(self, element: Element) -> Element:
        """Return the tree that contains an element.

        Raises:
            EditError: If the element is not in a tree.
        """
        while element.tag != TREE_TAG:
            if element.offset not in self._places:
                message = f"<{element.tag}> is not in a tree"
                raise EditError(message)
            element = self._places[element.offset][0]
        return element


def move(file: EditedFile, element: int, parent: int, index: int) -> list[TextEdit]:
    """Move an element to an index among the children of another element.

    The index refers to the file before the move.

    Raises:
        EditError: If the moved element contains the other element.
    """
    moved, target, here = file.element(element), file.element(parent), file.siblings(element)
    if any(each is target for each in moved.iterate()):
        message = f"<{moved.tag}> cannot be moved into itself"
        raise EditError(message)
    _require_index(target, index)
    if here.parent is target and here.place <= index <= here.place + 1:
        return []
    lines = file.text.copy(moved, moved)
    return [*file.text.insert(target, index, lines), *file.text.delete_element(moved)]


def insert(
    file: EditedFile, parent: int, index: int, tag: str, attributes: Mapping[str, str] | None = None
) -> list[TextEdit]:
    """Insert a new element at an index among the children of another element."""
    target = file.element(parent)
    _require_index(target, index)
    return file.text.insert(target, index, file.text.format_new(synthetic_element(tag, attributes)))


def wrap(
    file: EditedFile,
    element: int,
    tag: str,
    attributes: Mapping[str, str] | None = None,
    last: int | None = None,
) -> list[TextEdit]:
    """Wrap an element, or consecutive siblings, in a new element."""
    _, _, first, end = file.siblings(element, last)
    lines = file.text.wrap(synthetic_element(tag, attributes), file.text.copy(first, end))
    return file.text.replace(first, end, lines)


def unwrap(file: EditedFile, element: int) -> list[TextEdit]:
    """Replace an element by its children.

    Raises:
        EditError: If the element has no children.
    """
    outer = file.element(element)
    file.siblings(element)
    if not outer.children:
        message = f"<{outer.tag}> has no children. Delete it instead"
        raise EditError(message)
    return file.text.replace(outer, outer, file.text.contents(outer), with_comments=False)


def delete(file: EditedFile, element: int) -> list[TextEdit]:
    """Delete an element with its descendants and the comments directly above it."""
    file.siblings(element)
    return file.text.delete_element(file.element(element))


def duplicate(file: EditedFile, element: int) -> list[TextEdit]:
    """Insert a copy of an element after the element."""
    here, copied = file.siblings(element), file.element(element)
    return file.text.insert(here.parent, here.place + 1, file.text.copy(copied, copied))


def extract(file: EditedFile, element: int, tree: str) -> list[TextEdit]:
    """Move an element to a new tree, and replace it by a `SubTree` node that passes the same keys.

    Raises:
        EditError: If the tree already exists, or the element uses private keys.
    """
    moved, root = file.element(element), file.tree_file.root
    around = file.tree_around(moved)
    if moved is around:
        message = f"'{around.attributes.get('ID', '')}' is already a tree"
        raise EditError(message)
    if any(each.attributes.get("ID") == tree for each in file.tree_file.trees):
        message = f"there is already a tree '{tree}'. Choose another name"
        raise EditError(message)
    keys = set(_keys(moved))
    if private := sorted(key for key in keys if key.startswith("_")):
        message = f"the private key '{private[0]}' cannot be shared with a subtree. Rename the key first"
        raise EditError(message)
    remap = {_AUTOREMAP: "true"} if keys or any(_scripts(moved)) else {}
    call = synthetic_element(SUBTREE_TAG, {"ID": tree, **remap})
    new = file.text.wrap(synthetic_element(TREE_TAG, {"ID": tree}), file.text.copy(moved, moved))
    name = around.attributes.get("ID")
    is_only = _MAIN not in root.attributes and len(file.tree_file.trees) == 1 and name
    return [
        *file.text.replace(moved, moved, file.text.format_new(call)),
        *file.text.insert(root, file.siblings(file.number(around)).place + 1, new),
        *(file.text.set_attribute(root, _MAIN, name) if is_only else ()),
    ]


def inline(file: EditedFile, element: int) -> list[TextEdit]:
    """Replace a `SubTree` node by a copy of its tree's content.

    Raises:
        EditError: If the tree is not in this file, or its keys would have another meaning in the calling tree.
    """
    call = file.element(element)
    name = call.attributes.get("ID", "")
    tree = next((each for each in file.tree_file.trees if each.attributes.get("ID") == name), None)
    if call.tag != SUBTREE_TAG or tree is None or not tree.children:
        message = f"<{call.tag}> does not use a tree of this file"
        raise EditError(message)
    if tree is file.tree_around(call):
        message = f"this <{call.tag}> cannot be replaced, because the tree '{name}' contains it"
        raise EditError(message)
    lines = _with_ports(file.text.contents(tree), _ports(call, tree, file.tree_around(call)))
    return file.text.replace(call, call, lines, with_comments=False)


def set_attribute(file: EditedFile, element: int, name: str, value: str | None = None) -> list[TextEdit]:
    """Set the value of an attribute; None removes the attribute."""
    return file.text.set_attribute(file.element(element), name, value)


OPERATIONS: Mapping[str, Callable[..., list[TextEdit]]] = {
    each.__name__: each
    for each in (move, insert, wrap, unwrap, delete, duplicate, extract, inline, set_attribute)
}
"""The operations, by the names that editors use."""


def edits_of(tree_file: TreeFile, operation: str, /, **arguments: Any) -> list[TextEdit]:
    """Return the edits of an operation.

    Args:
        tree_file: The file.
        operation: The operation's name in `OPERATIONS`.
        **arguments: The operation's arguments.

    Raises:
        EditError: If the operation is impossible, or its arguments are wrong.
    """
    function = OPERATIONS.get(operation)
    if function is None:
        message = f"unknown operation '{operation}' (known: {', '.join(OPERATIONS)})"
        raise EditError(message)
    text = tree_file.source.text
    file = _without_brackets(tree_file, operation, arguments)
    try:
        edits = function(file, **arguments)
    except (TypeError, AttributeError) as error:
        message = f"the arguments of '{operation}' are wrong: {error}"
        raise EditError(message) from error
    edited = apply_edits(file.tree_file.source.text, edits)
    try:
        parse_tree(edited, tree_file.source.path)
    except TreeError as error:
        message = f"this change would make the file invalid: {error.findings[0].message}"
        raise EditError(message) from error
    return edits if file.tree_file is tree_file and edited != text else edit_between(text, edited)


def _without_brackets(tree_file: TreeFile, operation: str, arguments: Mapping[str, Any]) -> EditedFile:
    """Return the file with an operation's elements on separate lines.

    In a YAML file, the elements may be in brackets, which are removed.
    """
    given = [arguments.get(each) for each in ("element", "parent", "last")]
    numbers = [each for each in given if isinstance(each, int)] if operation != set_attribute.__name__ else []
    file = EditedFile(tree_file)
    while isinstance(file.text, YamlText):
        concerned = [
            each for one in numbers for each in _separate_elements(file, file.element(one), operation)
        ]
        found = next(filter(None, map(file.text.outermost_flow, concerned)), None)
        if found is None:
            break
        edited = apply_edits(file.tree_file.source.text, file.text.expand(found))
        file = EditedFile(parse_tree(edited, tree_file.source.path))
    return file


def _separate_elements(file: EditedFile, element: Element, operation: str) -> Iterator[Element]:
    """Yield the elements that must be on separate lines before an operation on an element."""
    yield element
    if operation == inline.__name__:
        for tree in file.tree_file.trees:
            if tree.attributes.get("ID") == element.attributes.get("ID"):
                yield from (tree, *tree.children)
    if operation == extract.__name__:
        yield from (file.tree_file.root, file.tree_around(element))
    yield from element.children if operation == unwrap.__name__ else ()


def _require_index(parent: Element, index: int) -> None:
    if not 0 <= index <= len(parent.children):
        message = f"{index} is not a position among the children of <{parent.tag}> (number of children: {len(parent.children)})"
        raise EditError(message)


def _keys(element: Element) -> Iterator[str]:
    """Yield the keys in braces of an element and its descendants."""
    for each in element.iterate():
        for value in each.attributes.values():
            yield from (found[1] for found in _KEY.finditer(value))


def _scripts(element: Element) -> Iterator[str]:
    """Yield the scripts of an element and its descendants."""
    for each in element.iterate():
        yield from (value for name, value in each.attributes.items() if _SCRIPTS.fullmatch(name))


def _ports(call: Element, tree: Element, around: Element) -> dict[str, str]:
    """Return the replacement of each key in braces when a tree's content replaces a `SubTree` node.

    Raises:
        EditError: If the node has a condition, or a key would have another meaning in the calling tree.
    """
    given = {name: value for name, value in call.attributes.items() if name not in _OF_SUBTREE}
    condition = next((name for name in given if name.startswith("_")), None)
    if condition is not None:
        message = f"<{call.tag}> has '{condition}'. Move it to another node first"
        raise EditError(message)
    changed = {name: value for name, value in given.items() if value != f"{{{name}}}"}
    in_scripts = set(re.findall(r"[A-Za-z_]\w*", " ".join(_scripts(tree))))
    clash = next((key for key in changed if key in in_scripts), None)
    if clash is None and call.attributes.get(_AUTOREMAP, "false") not in ("true", "1"):
        own = (set(_keys(tree)) | in_scripts) - given.keys()
        outer = set(_keys(around)) | set(re.findall(r"[A-Za-z_]\w*", " ".join(_scripts(around))))
        clash = next(iter(sorted(own & outer)), None)
    if clash is not None:
        message = f"the key '{clash}' has another meaning outside of <{call.tag}>. Rename the key first"
        raise EditError(message)
    return {f"{{{name}}}": value for name, value in changed.items()}


def _with_ports(lines: Snippet, ports: Mapping[str, str]) -> list[SnippetLine]:
    """Return lines in which each key in braces is replaced by the value of the port."""
    return [each._replace(text=_KEY.sub(lambda key: ports.get(key[0], key[0]), each.text)) for each in lines]


class Refactoring(NamedTuple):
    """An operation that is possible at an element.

    Attributes:
        title: The title in a menu.
        operation: The operation's name in `OPERATIONS`.
        arguments: The operation's arguments.
    """

    title: str
    operation: str
    arguments: Mapping[str, Any]


_WRAPPERS = ("Sequence", "Fallback", "Inverter")


def refactorings_at(tree_file: TreeFile, number: int) -> list[Refactoring]:
    """Return the operations that are possible at an element without further arguments."""
    file = EditedFile(tree_file)
    element = file.element(number)
    try:
        here, around = file.siblings(number), file.tree_around(element)
    except EditError:
        return []
    name = element.attributes.get("name") or element.attributes.get("ID") or element.tag
    at: dict[str, Any] = {"element": number}
    parent = file.number(here.parent)
    moves = [
        (direction, index)
        for direction, index in (("up", here.place - 1), ("down", here.place + 2))
        if 0 <= index <= len(here.parent.children)
    ]
    found = [
        *((f"Move {name} {to}", "move", {**at, "parent": parent, "index": index}) for to, index in moves),
        (f"Duplicate {name}", "duplicate", at),
        (f"Delete {name}", "delete", at),
    ]
    if element is not around:
        found += [(f"Wrap {name} in {tag}", "wrap", {**at, "tag": tag}) for tag in _WRAPPERS]
        found += [(f"Unwrap {name}", "unwrap", at)] if element.children else []
        found += [("Extract to a subtree", "extract", {**at, "tree": _free_name(tree_file, name)})]
    if element.tag == SUBTREE_TAG:
        found += [("Inline the subtree", "inline", at)]
    return [Refactoring(*each) for each in found]


def _free_name(tree_file: TreeFile, name: str) -> str:
    """Return an unused tree name that is similar to a given name."""
    taken = {each.attributes.get("ID") for each in tree_file.trees}
    plain = re.sub(r"[^\w.-]", "", name) or "Part"
    names = itertools.chain([plain], (f"{plain}{number}" for number in itertools.count(2)))
    return next(each for each in names if each not in taken)
