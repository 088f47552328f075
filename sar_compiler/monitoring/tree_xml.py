"""A compiled tree in XML with the numbers of its nodes, as BehaviorTree.CPP hands it to Groot2."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import NamedTuple
from xml.sax.saxutils import quoteattr

from sar_compiler.monitoring.numbered_tree import NumberedNode, NumberedTree
from sar_compiler.nodes.binding.bound import Collector
from sar_compiler.nodes.btcpp.rewrites import Draft
from sar_compiler.nodes.models.palette import describe, is_built_in
from sar_compiler.nodes.registry import language_variants
from sar_compiler.nodes.spec import NodeSpec
from sar_compiler.tree.model import MODEL_TAG, SUBTREE_TAG, TREE_TAG, is_name, synthetic_element
from sar_compiler.tree.showing import in_one_line
from sar_compiler.tree.xml_writer import one_tag_a_line


def tree_xml(tree: NumberedTree) -> str:
    """Return a tree in XML: one `BehaviorTree` for each use of a subtree, and models of the nodes that are not built in.

    Nodes are BehaviorTree.CPP's where it has them, and have the attributes that it knows; names and numbers are theirs.
    """
    inside: dict[int, list[NumberedNode]] = {}
    for node in tree.nodes:
        inside.setdefault(node.around, []).append(node)
    writer = _NodeWriter(inside)
    lines = ['<root BTCPP_format="4">']
    (root,) = inside[0]
    waiting = [_UsedSubtree(tree.name, "", root)]
    while waiting:
        name, path, first = waiting.pop()
        lines += [_start(TREE_TAG, {"ID": name, "_fullpath": path}), *writer.nodes(first), f"</{TREE_TAG}>"]
        # In pre-order: who reads it takes the uses of a tree one by one.
        waiting += reversed(writer.take_subtrees())
    models = describe([spec for specs in writer.specs.values() for spec in specs])
    lines += [one_tag_a_line(models) if models.children else f"<{MODEL_TAG}/>", "</root>"]
    return "\n".join(lines)


class _UsedSubtree(NamedTuple):
    name: str
    path: str
    root: NumberedNode


class _NodeWriter:
    """Writes nodes.

    Args:
        inside: The nodes within each, by its number.

    Attributes:
        specs: The specs of all tags, by tag.
    """

    def __init__(self, inside: Mapping[int, Sequence[NumberedNode]]) -> None:
        self.specs: dict[str, Sequence[NodeSpec]] = {}
        self._inside = inside
        self._subtrees: list[_UsedSubtree] = []

    def take_subtrees(self) -> list[_UsedSubtree]:
        """Return the subtrees that were named since the last call."""
        found, self._subtrees = self._subtrees, []
        return found

    def nodes(self, first: NumberedNode) -> Iterator[str]:
        """Yield the lines of a node and those below it; not recursively, since trees may be deep."""
        waiting: list[NumberedNode | str] = [first]
        while waiting:
            node = waiting.pop()
            if isinstance(node, str):
                yield node
                continue
            children = self._inside.get(node.uid, ())
            if node.made.wrapper is None and node.made.bound.subtree is not None:
                yield self._subtree(node, children[0])
                continue
            tag, attributes = self._tag_and_attributes(node)
            if not is_name(tag):
                attributes, tag = {"ID": tag, **attributes}, self.specs[tag][0].kind.value
            yield _start(tag, {**attributes, "name": node.name, "_uid": str(node.uid)}, is_empty=not children)
            if children:
                waiting += [f"</{tag}>", *reversed(children)]

    def _subtree(self, node: NumberedNode, root: NumberedNode) -> str:
        bound, scope = node.made.bound, node.made.instance.inner[node.made.bound].scope
        assert bound.subtree is not None  # noqa: S101 - the caller has looked
        self._subtrees.append(_UsedSubtree(bound.subtree.name, scope.path, root))
        # What is left are ports and conditions; `oneshot` is a node of its own around this one.
        named = ("ID", "name", "oneshot")
        given = {name: text for name, text in bound.element.attributes.items() if name not in named}
        uid = str(node.uid)
        attributes = {"ID": bound.subtree.name, **given, "_fullpath": scope.path, "_uid": uid}
        return _start(SUBTREE_TAG, attributes, is_empty=True)

    def _tag_and_attributes(self, node: NumberedNode) -> tuple[str, dict[str, str]]:
        """Return the tag and the attributes that a node has in BehaviorTree.CPP, as far as it has the like."""
        bound = node.made.bound
        if node.made.wrapper is None:
            tag, attributes = bound.spec.tag, dict(bound.element.attributes)
            specs: Sequence[NodeSpec] = [bound.spec]
        else:
            # Made for an attribute: of py_trees, whose classes are called as their tags.
            tag = type(node.inner).__name__
            attributes = {
                name: getattr(value, "name", str(value)) for name, value in node.made.wrapper.items()
            }
            specs = language_variants(tag)
        draft = Draft(synthetic_element(tag), tag, attributes, explicit=False)
        for spec in specs:
            if spec.semantics.counterpart.rewrite is not None:
                spec.semantics.counterpart.rewrite(draft, Collector())
        if not draft.children:
            tag, attributes = draft.tag, draft.attributes
        if tag != specs[0].tag:
            specs = language_variants(tag)
        self.specs[tag] = specs
        known = {*_attribute_names(specs)}
        return tag, {name: text for name, text in attributes.items() if name in known or name.startswith("_")}


def _attribute_names(specs: Iterable[NodeSpec]) -> Iterator[str]:
    """Yield the attributes that BehaviorTree.CPP knows of a node; of one that is built in, that is its ports."""
    specs = list(specs)
    built_in = is_built_in(specs)
    for spec in specs:
        for parameter in spec.attributes:
            if (parameter.direction is not None or not built_in) and parameter.name != "name":
                yield parameter.name


def _start(tag: str, attributes: Mapping[str, str], *, is_empty: bool = False) -> str:
    written = (f" {name}={quoteattr(in_one_line(text))}" for name, text in attributes.items())
    return f"<{tag}{''.join(written)}{'/' if is_empty else ''}>"
