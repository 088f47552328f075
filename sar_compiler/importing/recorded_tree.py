"""The tree of a recorded run: its file, and its nodes by BehaviorTree.CPP's numbers."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import zip_longest
from pathlib import Path
from typing import NamedTuple

from sar_compiler.compiler.sketch import Drawable
from sar_compiler.importing.recording import UnusableRecordingError
from sar_compiler.nodes.binding.attributes import KIND_TAGS
from sar_compiler.nodes.binding.bound import BoundNode
from sar_compiler.nodes.palettes import palette_attributes, palette_names, palettes_containing
from sar_compiler.nodes.registry import language_variants
from sar_compiler.nodes.spec import Kind
from sar_compiler.runtime.walking import pre_order
from sar_compiler.tree.diagnostic import TreeError
from sar_compiler.tree.model import MODEL_TAG, SUBTREE_TAG, TREE_TAG, Element, TreeFile, synthetic_element
from sar_compiler.tree.xml import parse_xml

_MOST_NODES = 0xFFFF
_MOST_NAMED = 5
_PARENTS = (Kind.CONTROL.value, Kind.DECORATOR.value)
_UID, _PATH = "_uid", "_fullpath"


class RunNode(NamedTuple):
    """A node of the recorded tree, including its conditions.

    Attributes:
        tag: Its tag.
        name: Its name; of a subtree, its ID.
        parent: The number of its parent; 0 at the root.
        children: The numbers of its children.
        rows: Its numbers in the journal: those of its conditions, the outermost first, and its own.
        bound: The bound node.
    """

    tag: str
    name: str
    parent: int
    children: tuple[int, ...]
    rows: tuple[int, ...]
    bound: BoundNode


@dataclass(frozen=True)
class ExportedTree:
    """A tree that BehaviorTree.CPP has exported.

    Attributes:
        file: The tree file, without numbers and repeated subtrees.
        nodes: The tag and the name of each node; of a subtree, its ID. The first node has the number 1.
    """

    file: TreeFile
    nodes: tuple[tuple[str, str], ...]

    @property
    def palette(self) -> str:
        """The installed palette that defines most of the tree's custom controls and decorators with their ports; empty if none."""
        models = [
            each for child in self.file.root.children if child.tag == MODEL_TAG for each in child.children
        ]
        ports = {
            each.attributes.get("ID", ""): {port.attributes.get("name", "") for port in each.children}
            for each in models
            if each.tag in _PARENTS
        }

        def rank(palette: str) -> tuple[int, int]:
            declared = {tag: palette_attributes(palette, tag) for tag in ports}
            known = {tag: names for tag, names in declared.items() if names is not None}
            return len(known), -sum(len(ports[tag] - names) for tag, names in known.items())

        best = max(palette_names(), key=rank, default="")
        return best if best and rank(best)[0] else ""

    @property
    def has_subtrees(self) -> bool:
        """Whether the tree uses a subtree."""
        return any(tag == SUBTREE_TAG for tag, _ in self.nodes)

    def with_autoremap(self) -> "ExportedTree":
        """Return the tree with `_autoremap` in all uses of subtrees."""
        return replace(self, file=replace(self.file, root=_with_autoremap(self.file.root)))

    def without_models_of(self, palette: str) -> TreeFile:
        """Return the tree file without the node models that a palette describes."""
        children = []
        for child in self.file.root.children:
            if child.tag != MODEL_TAG:
                children.append(child)
                continue
            kept = [
                each
                for each in child.children
                if palette not in palettes_containing(each.attributes.get("ID", ""))
            ]
            if kept:
                children.append(replace(child, children=tuple(kept)))
        return replace(self.file, root=replace(self.file.root, children=tuple(children)))


def read_exported(xml: str) -> ExportedTree:
    """Read the tree of an export with node numbers, in which each use of a subtree has its own `BehaviorTree`.

    Raises:
        UnusableRecordingError: If the text is not such an export.
    """
    try:
        root = parse_xml(xml, "its tree").root
    except TreeError as error:
        raise UnusableRecordingError(str(error)) from error
    uses = [child for child in root.children if child.tag == TREE_TAG]
    by_path = {each.attributes.get(_PATH): each for each in uses}
    if not uses or uses[0].attributes.get(_PATH) != "":
        raise UnusableRecordingError("its tree has no numbers: it is not an export of BehaviorTree.CPP")
    nodes = _expand(uses[0], by_path)
    used = {tag for tag, _ in nodes}
    trees = {each.attributes.get("ID", ""): _copy_without_numbers(each) for each in reversed(uses)}
    models = [
        each
        for child in root.children
        if child.tag == MODEL_TAG
        for each in child.children
        if each.attributes.get("ID") in used and not language_variants(each.attributes["ID"])
    ]
    inside = [*reversed(trees.values()), *([synthetic_element(MODEL_TAG, {}, models)] if models else [])]
    about = {"BTCPP_format": "4", "main_tree_to_execute": uses[0].attributes.get("ID", "")}
    file = TreeFile(root.source, synthetic_element("root", about, inside))
    return ExportedTree(file, tuple(nodes))


def _expand(main: Element, by_path: dict[str | None, Element]) -> list[tuple[str, str]]:
    """Return the nodes of a tree with those of its subtrees, in the order of their numbers."""
    nodes: list[tuple[str, str]] = []
    waiting = list(reversed(main.children))
    while waiting:
        element = waiting.pop()
        nodes.append(_tag_and_name(element))
        inside: Sequence[Element] = element.children
        if element.tag == SUBTREE_TAG:
            subtree = by_path.pop(element.attributes.get(_PATH), None)
            if subtree is None:
                raise UnusableRecordingError(f"its tree lacks the subtree '{element.attributes.get(_PATH)}'")
            inside = subtree.children
        if element.attributes.get(_UID) != str(len(nodes)) or len(nodes) > _MOST_NODES:
            raise UnusableRecordingError(
                f"node {len(nodes)} of its tree has the number {element.attributes.get(_UID)}"
            )
        waiting.extend(reversed(inside))
    return nodes


def _tag_and_name(element: Element) -> tuple[str, str]:
    given = element.attributes
    if element.tag == SUBTREE_TAG:
        return SUBTREE_TAG, given.get("ID", "")
    tag = given["ID"] if element.tag in KIND_TAGS and "ID" in given else element.tag
    return tag, given.get("name", tag)


def _with_autoremap(element: Element) -> Element:
    more = {"_autoremap": "true"} if element.tag == SUBTREE_TAG and "ID" in element.attributes else {}
    return replace(
        element,
        attributes={**element.attributes, **more},
        children=tuple(map(_with_autoremap, element.children)),
    )


def _copy_without_numbers(element: Element) -> Element:
    """Return a copy of an element and its descendants, without node numbers."""
    given = {name: text for name, text in element.attributes.items() if name not in (_UID, _PATH)}
    return replace(element, attributes=given, children=tuple(map(_copy_without_numbers, element.children)))


def run_nodes(tree: Drawable) -> list[RunNode]:
    """Return the nodes of a tree; the first one has the number 1."""
    nodes: list[RunNode] = []
    rows = {id(each): number for number, each in enumerate(pre_order(tree.root))}
    children: list[list[int]] = [[]]
    waiting = [(tree.root, 0)]
    while waiting:
        behaviour, parent = waiting.pop()
        around = [behaviour]
        bound = tree.origins[behaviour.id].bound
        while len(around[-1].children) == 1 and tree.origins[around[-1].children[0].id].bound is bound:
            around.append(around[-1].children[0])
        uid = len(nodes) + 1
        children.append([])
        children[parent].append(uid)
        is_subtree = bound.element.tag == SUBTREE_TAG
        tag = SUBTREE_TAG if is_subtree else bound.spec.tag
        name = bound.element.attributes.get("ID", "") if is_subtree else around[-1].name
        numbers = tuple(rows[id(each)] for each in around)
        nodes.append(RunNode(tag, name, parent, (), numbers, bound))
        waiting.extend((child, uid) for child in reversed(around[-1].children))
    return [node._replace(children=tuple(below)) for node, below in zip(nodes, children[1:], strict=True)]


def describe_node_differences(recorded: Sequence[tuple[str, str]], nodes: Sequence[RunNode]) -> list[str]:
    """Describe the nodes whose tags or names differ from those of a recording."""
    wrong = []
    for uid, (there, here) in enumerate(zip_longest(recorded, nodes), 1):
        if there is None or here is None or there != (here.tag, here.name):
            then = f"'{there[1]}' ({there[0]})" if there is not None else "missing"
            now = (
                f"'{here.name}' ({here.tag}), {here.bound.element.file_and_line}"
                if here is not None
                else "missing"
            )
            wrong.append(f"  node {uid} of the run is {then}; in the tree it is {now}")
    return wrong


def refuse_differences(wrong: Sequence[str], path: Path) -> None:
    """Raise an error that lists the different nodes, if there are any.

    Raises:
        UnusableRecordingError: If nodes differ.
    """
    if wrong:
        more = [f"  and {len(wrong) - _MOST_NAMED} more"] if len(wrong) > _MOST_NAMED else []
        raise UnusableRecordingError(
            "\n".join(
                [
                    f"{path} is not the tree of the run, {len(wrong)} nodes differ:",
                    *wrong[:_MOST_NAMED],
                    *more,
                ]
            )
        )


def describe_name_differences(recorded: Mapping[int, str], nodes: Sequence[RunNode]) -> list[str]:
    """Describe the nodes whose names differ from those of a recording with the same numbers."""
    names = {uid: node.name for uid, node in enumerate(nodes, 1) if node.tag != SUBTREE_TAG}
    subtrees = {uid for uid, node in enumerate(nodes, 1) if node.tag == SUBTREE_TAG}
    return [
        f"  node {uid} of the run is '{name}'; in the tree it is {repr(names[uid]) if uid in names else 'missing'}"
        for uid, name in sorted(recorded.items())
        if uid not in subtrees and names.get(uid) != name
    ]
