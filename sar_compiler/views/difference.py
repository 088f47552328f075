"""Structural differences between two tree files, as objects, text and JSON."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from enum import Enum

from sar_compiler.nodes.btcpp.port_types import is_same
from sar_compiler.nodes.cpp_names import normalize
from sar_compiler.tree.model import TEXT_KEY, Element, TreeFile
from sar_compiler.tree.plain import as_json, count_with_noun
from sar_compiler.views.matching import ComparedNode, match, pairs_in_order


class Change(str, Enum):
    """The kind of a difference between two trees."""

    ADDED = "added"
    REMOVED = "removed"
    MOVED = "moved"
    CHANGED = "changed"


@dataclass(frozen=True)
class Difference:
    """A difference between two tree files.

    Attributes:
        change: The kind of the difference.
        path: The path of the node in the newer file; for a removed node, in the older file.
        old: The node in the older file; None if the node was added.
        new: The node in the newer file; None if the node was removed.
        what: The changed item: an attribute's name, `$text` for the text of the element, or empty for the tag.
        before: The old value of the attribute (None: not written) or the old tag. For a moved node its old path, or
            `child 2` if only its position among its siblings has changed.
        after: The new value, in the same form.
        inner: The number of descendants that were added or removed with the node.
    """

    change: Change
    path: str
    old: Element | None
    new: Element | None
    what: str = ""
    before: str | None = None
    after: str | None = None
    inner: int = 0


def difference(old: TreeFile, new: TreeFile) -> list[Difference]:
    """Compare the nodes and attributes of two tree files.

    These differences are ignored: comments, the file format, `<Say/>` instead of `<Action ID="Say"/>`, another name of
    the same port type, and the order of attributes, trees, includes and node models.

    Args:
        old: The older file.
        new: The newer file.

    Returns:
        The differences, in the order of the newer file. Removed nodes precede the other changes of their siblings.
    """
    first, second = match(old, new)
    return [each for each in _differences(first, second) if not _renames_type(each)]


def _renames_type(one: Difference) -> bool:
    """Return whether a difference is only another name of the same port type."""
    return (
        one.what == "type"
        and one.new is not None
        and one.new.tag.endswith("_port")
        and one.before is not None
        and one.after is not None
        and is_same(normalize(one.before), normalize(one.after))
    )


def _differences(old: ComparedNode, new: ComparedNode) -> Iterator[Difference]:
    if old.mark == new.mark:
        return
    yield from _attribute_changes(old, new)
    for child in old.children:
        if child.partner is None:
            yield Difference(
                Change.REMOVED, child.path, child.element, None, before=child.path, inner=_count(child)
            )
    stayed = {other for _, other in pairs_in_order(old, new)}
    for child in new.children:
        yield from _child(child, stayed)


def _child(node: ComparedNode, stayed: set[ComparedNode]) -> Iterator[Difference]:
    partner = node.partner
    if partner is None:
        yield Difference(Change.ADDED, node.path, None, node.element, after=node.path, inner=_count(node))
        for child in node.children:
            yield from _inside_added(child)
        return
    if node not in stayed:
        yield _move(partner, node)
    yield from _differences(partner, node)


def _inside_added(node: ComparedNode) -> Iterator[Difference]:
    """Yield the differences of nodes that already existed and were moved into an added node."""
    if node.partner is not None:
        yield from _child(node, set())
        return
    for child in node.children:
        yield from _inside_added(child)


def _attribute_changes(old: ComparedNode, new: ComparedNode) -> Iterator[Difference]:
    if old.type != new.type:
        yield _change(old, new, "", old.type, new.type)
    for name in dict.fromkeys([*old.attributes, *new.attributes]):
        before, after = old.attributes.get(name), new.attributes.get(name)
        if before != after:
            yield _change(old, new, name, before, after)
    if old.element.text != new.element.text:
        yield _change(old, new, TEXT_KEY, old.element.text, new.element.text)


def _change(
    old: ComparedNode, new: ComparedNode, what: str, before: str | None, after: str | None
) -> Difference:
    return Difference(Change.CHANGED, new.path, old.element, new.element, what, before, after)


def _count(node: ComparedNode) -> int:
    """Count the descendants that were added or removed together with an added or removed node."""
    return sum(1 + _count(child) for child in node.children if child.partner is None)


def _move(old: ComparedNode, new: ComparedNode) -> Difference:
    before, after = old.path, new.path
    if old.parent and old.parent.partner is new.parent:
        before, after = f"child {old.number + 1}", f"child {new.number + 1}"
    return Difference(Change.MOVED, new.path, old.element, new.element, before=before, after=after)


def difference_as_text(differences: Iterable[Difference]) -> str:
    """Return a line for each difference, with the locations in both files."""
    return "".join(f"{_line(one)}\n" for one in differences)


def difference_as_json(differences: Iterable[Difference]) -> str:
    """Return differences as a JSON array, with the locations of both nodes."""
    return as_json([*map(_difference_data, differences)])


def _difference_data(one: Difference) -> dict[str, object]:
    sides = {"old": one.old, "new": one.new}
    places = {side: each and {"tag": each.tag, "place": each.file_and_line} for side, each in sides.items()}
    words = {"what": one.what, "before": one.before, "after": one.after, "inner": one.inner}
    return {"change": one.change.value, "path": one.path, **places, **words}


def _line(one: Difference) -> str:
    elements = [element for element in (one.old, one.new) if element is not None]
    places = ", ".join(element.file_and_line for element in elements)
    return f"{one.change.value:8} {_difference_text(one, elements[-1].tag)}  ({places})"


def _difference_text(one: Difference, tag: str) -> str:
    if one.change is Change.MOVED:
        place = "" if one.after == one.path else f"{one.path}: "
        return f"{place}{one.before} -> {one.after}"
    if one.change is not Change.CHANGED:
        inner = f", with {count_with_noun(one.inner, 'node')} in it" if one.inner else ""
        return f"{one.path} <{tag}>{inner}"
    if not one.what:
        return f"{one.path}: <{one.before}> -> <{one.after}>"
    name = "description" if one.what == TEXT_KEY else one.what
    return f"{one.path}: {name} {_quote(one.before)} -> {_quote(one.after)}"


def _quote(text: str | None) -> str:
    if text is None:
        return "not written"
    return '"' + text.replace("\\", "\\\\").replace("\n", "\\n").replace("\r", "\\r") + '"'
