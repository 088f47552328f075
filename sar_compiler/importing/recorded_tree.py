"""The tree of a recorded run: the tree file, and the nodes with BehaviorTree.CPP's numbers."""

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
    """A node of the recorded tree, together with its pre- and postconditions.

    Attributes:
        tag: The node's tag.
        name: The node's name; for a subtree, the tree's ID.
        parent: The number of the node's parent; 0 for the root.
        children: The numbers of the node's children.
        rows: The numbers in the journal of the node's conditions, from outermost to innermost, and of the node itself.
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
        file: The tree file, without node numbers, in which each subtree is defined once.
        nodes: The tag and name of each node, ordered by the node numbers from 1. The name of a subtree is the tree's ID.
    """

    file: TreeFile
    nodes: tuple[tuple[str, str], ...]

    @property
    def palette(self) -> str:
        """The installed palette that best matches the tree's custom controls and decorators; empty if no palette matches."""
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
        """Whether the tree contains a subtree."""
        return any(tag == SUBTREE_TAG for tag, _ in self.nodes)

    def with_autoremap(self) -> "ExportedTree":
        """Return the tree with `_autoremap` in every `SubTree` tag."""
        return replace(self, file=replace(self.file, root=_with_autoremap(self.file.root)))

    def without_models_of(self, palette: str) -> TreeFile:
        """Return the tree file without the models of nodes that the given palette already describes."""
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
    """Read a tree that BehaviorTree.CPP has exported.

    In such a tree, every node has a number, and each `SubTree` tag has its own `BehaviorTree`.

    Raises:
        UnusableRecordingError: If the text is not such an exported tree.
    """
    try:
        root = parse_xml(xml, "the recorded tree").root
    except TreeError as error:
        raise UnusableRecordingError(str(error)) from error
    uses = [child for child in root.children if child.tag == TREE_TAG]
    by_path = {each.attributes.get(_PATH): each for each in uses}
    if not uses or uses[0].attributes.get(_PATH) != "":
        raise UnusableRecordingError("the tree has no node numbers, so BehaviorTree.CPP did not export it")
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
    """Return the tag and name of each node of a tree and its subtrees, ordered by node number."""
    nodes: list[tuple[str, str]] = []
    waiting = list(reversed(main.children))
    while waiting:
        element = waiting.pop()
        nodes.append(_tag_and_name(element))
        inside: Sequence[Element] = element.children
        if element.tag == SUBTREE_TAG:
            subtree = by_path.pop(element.attributes.get(_PATH), None)
            if subtree is None:
                raise UnusableRecordingError(
                    f"the subtree '{element.attributes.get(_PATH)}' is missing in the tree"
                )
            inside = subtree.children
        if element.attributes.get(_UID) != str(len(nodes)) or len(nodes) > _MOST_NODES:
            raise UnusableRecordingError(
                f"node {len(nodes)} of the tree has the wrong number {element.attributes.get(_UID)}"
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
    """Return the nodes of a tree, ordered by BehaviorTree.CPP's numbers from 1."""
    nodes: list[RunNode] = []
    rows = {id(each): number for number, each in enumerate(pre_order(tree.root))}
    children: list[list[int]] = [[]]
    waiting = [(tree.root, 0)]
    while waiting:
        behaviour, parent = waiting.pop()
        chain = [behaviour]  # the behaviours of the node's conditions, and of the node itself
        bound = tree.origins[behaviour.id].bound
        while len(chain[-1].children) == 1 and tree.origins[chain[-1].children[0].id].bound is bound:
            chain.append(chain[-1].children[0])
        uid = len(nodes) + 1
        children.append([])
        children[parent].append(uid)
        is_subtree = bound.element.tag == SUBTREE_TAG
        tag = SUBTREE_TAG if is_subtree else bound.spec.tag
        name = bound.element.attributes.get("ID", "") if is_subtree else chain[-1].name
        numbers = tuple(rows[id(each)] for each in chain)
        nodes.append(RunNode(tag, name, parent, (), numbers, bound))
        waiting.extend((child, uid) for child in reversed(chain[-1].children))
    return [node._replace(children=tuple(below)) for node, below in zip(nodes, children[1:], strict=True)]


def describe_node_differences(recorded: Sequence[tuple[str, str]], nodes: Sequence[RunNode]) -> list[str]:
    """Return a line for each node whose tag or name differs between a recording and a tree."""
    wrong = []
    for uid, (there, here) in enumerate(zip_longest(recorded, nodes), 1):
        if there is None or here is None or there != (here.tag, here.name):
            then = f"'{there[1]}' ({there[0]})" if there is not None else "missing"
            now = (
                f"'{here.name}' ({here.tag}), {here.bound.element.file_and_line}"
                if here is not None
                else "missing"
            )
            wrong.append(f"  node {uid} is {then} in the run, but {now} in the tree")
    return wrong


def refuse_differences(wrong: Sequence[str], path: Path) -> None:
    """Check that a tree file is the tree of a run. Raise an error if there are differences.

    *wrong* contains a line for each node that differs.

    Raises:
        UnusableRecordingError: If nodes differ; lists the first of them.
    """
    if wrong:
        more = [f"  and {len(wrong) - _MOST_NAMED} more"] if len(wrong) > _MOST_NAMED else []
        raise UnusableRecordingError(
            "\n".join(
                [
                    f"{path} is not the tree of the run. {len(wrong)} node{'s differ' if len(wrong) > 1 else ' differs'}:",
                    *wrong[:_MOST_NAMED],
                    *more,
                ]
            )
        )


def describe_name_differences(recorded: Mapping[int, str], nodes: Sequence[RunNode]) -> list[str]:
    """Return a line for each node whose recorded name differs from the name in the tree.

    *recorded* contains the recorded names by node number.
    """
    names = {uid: node.name for uid, node in enumerate(nodes, 1) if node.tag != SUBTREE_TAG}
    subtrees = {uid for uid, node in enumerate(nodes, 1) if node.tag == SUBTREE_TAG}
    return [
        f"  node {uid} is '{name}' in the run, but {repr(names[uid]) if uid in names else 'missing'} in the tree"
        for uid, name in sorted(recorded.items())
        if uid not in subtrees and names.get(uid) != name
    ]
