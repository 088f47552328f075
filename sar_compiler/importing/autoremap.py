"""Infer which subtrees have `_autoremap`. Trees exported by BehaviorTree.CPP do not show this attribute.

A program stops when a script reads a key that does not exist. So if a subtree has run although its scripts read a key before they write it, the key
was remapped from the calling tree.
"""

from collections.abc import Collection, Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import replace

from sar_compiler.errors import SarError
from sar_compiler.nodes.registry import language_variants
from sar_compiler.nodes.spec import Direction
from sar_compiler.runtime.blackboard import ROOT_SIGN
from sar_compiler.runtime.expressions import Access, NameUse, name_uses
from sar_compiler.runtime.script import parse
from sar_compiler.tree.model import MODEL_TAG, SUBTREE_TAG, TREE_TAG, Element, TreeFile

# The attributes whose scripts are executed before a node's children, and those whose scripts are executed afterwards.
_BEFORE = ("_failureIf", "_successIf", "_skipIf", "_while", "code", "if")
_AFTER = ("_onSuccess", "_onFailure", "_onHalted", "_post")


def with_remapped_subtrees(file: TreeFile) -> tuple[TreeFile, list[str]]:
    """Add `_autoremap` to each `SubTree` tag whose tree reads a key of the calling tree.

    Return the file and the IDs of the trees with the added attribute.
    """
    trees = {each.attributes.get("ID", ""): each for each in file.root.children if each.tag == TREE_TAG}
    written = {
        use.name for tree in trees.values() for use in _all_uses(tree) if use.access is not Access.READ
    }
    inputs = {
        (node.attributes.get("ID", ""), port.attributes.get("name", ""))
        for models in file.root.children
        if models.tag == MODEL_TAG
        for node in models.children
        for port in node.children
        if port.tag == "input_port"
    }
    needed: dict[str, frozenset[str]] = {}
    found: list[str] = []

    def needed_keys(name: str) -> frozenset[str]:
        """Return the keys that a tree reads before it writes them."""
        if name not in needed:
            needed[name] = frozenset()  # a tree that contains itself is an error elsewhere
            tree = trees.get(name)
            known: set[str] = set()
            read: dict[str, None] = {}
            if tree is not None:
                _collect(tree, known, read)
            needed[name] = frozenset(read)
        return needed[name]

    def _collect(element: Element, known: set[str], read: dict[str, None]) -> None:
        given = element.attributes
        _apply(_uses(given, _BEFORE), known, read)
        if element.tag == SUBTREE_TAG:
            outer = {_outer_key(given, key) for key in needed_keys(given.get("ID", ""))}
            read.update(dict.fromkeys(sorted(outer - known - {""})))
        known.update(_written_keys(element, inputs))
        for child in element.children:
            _collect(child, known, read)
        _apply(_uses(given, _AFTER), known, read)

    def remap(element: Element) -> Element:
        given = element.attributes
        if element.tag == SUBTREE_TAG and (needed_keys(given.get("ID", "")) - given.keys()) & written:
            found.append(given["ID"])
            given = {**given, "_autoremap": "true"}
        return replace(element, attributes=given, children=tuple(map(remap, element.children)))

    return replace(file, root=remap(file.root)), list(dict.fromkeys(found))


def _written_keys(element: Element, inputs: Collection[tuple[str, str]]) -> Iterator[str]:
    """Yield the keys that an element may write: the keys in all attributes that are not input ports.

    If a node model describes the element, *inputs* contains the input ports.
    """
    specs = language_variants(element.tag)
    for name, text in element.attributes.items():
        is_input = (element.tag, name) in inputs or any(
            each.direction is Direction.INPUT
            for spec in specs
            for each in spec.parameters.values()
            if name in (each.name, each.name.rstrip("_"))
        )
        if name == "output_key":
            yield text.strip("{}")  # of SetBlackboard
        elif text.startswith("{") and text.endswith("}") and not is_input:
            yield text[1:-1]


def _outer_key(given: Mapping[str, str], key: str) -> str:
    """Return the calling tree's key for a key that a subtree reads, or an empty string for a constant."""
    text = given.get(key, "{=}")
    if not (text.startswith("{") and text.endswith("}")):
        return ""
    return key if text == "{=}" else text[1:-1]


def _apply(uses: Iterable[NameUse], known: set[str], read: dict[str, None]) -> None:
    """Add the names that scripts create to *known*, and the names that they read too early to *read*."""
    for use in uses:
        if use.access is Access.CREATE:
            known.add(use.name)
        elif use.name not in known and use.certain:
            read[use.name] = None


def _uses(given: Mapping[str, str], names: Iterable[str]) -> Iterator[NameUse]:
    for name in names:
        with suppress(SarError):
            yield from (
                use for use in name_uses(parse(given.get(name, ""))) if not use.name.startswith(ROOT_SIGN)
            )


def _all_uses(element: Element) -> Iterator[NameUse]:
    yield from _uses(element.attributes, (*_BEFORE, *_AFTER))
    for child in element.children:
        yield from _all_uses(child)
