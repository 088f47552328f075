"""A compiled tree in the terms of BehaviorTree.CPP's tools: node numbers, status changes, and XML."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import NamedTuple
from xml.sax.saxutils import quoteattr

from py_trees.behaviour import Behaviour
from py_trees.visitors import VisitorBase

from sar_compiler.compiler import CompiledTree, Construction, Origins
from sar_compiler.errors import SarError
from sar_compiler.nodes.btcpp.draft import NodeDraft
from sar_compiler.nodes.collector import FindingCollector
from sar_compiler.nodes.models.palette import describe, is_built_in
from sar_compiler.nodes.registry import language_variants
from sar_compiler.nodes.spec import NodeSpec
from sar_compiler.runtime.kernel.cells import ENDED, INVALID, RUNNING, number_of
from sar_compiler.runtime.skipping import was_skipped
from sar_compiler.tree.display_text import escape_to_one_line
from sar_compiler.tree.model import MODEL_TAG, SUBTREE_TAG, TREE_TAG, is_name, synthetic_element
from sar_compiler.tree.xml_writer import xml_with_tag_per_line

MOST_NODES = 0xFFFF
"""The maximum number of nodes in a tree. Node numbers have 16 bits, and 0 is reserved."""


class TooManyNodesError(SarError):
    """A tree has more than `MOST_NODES` nodes."""


class NumberedNode(NamedTuple):
    """A node of a `NumberedTree`.

    Attributes:
        uid: The node's number, from 1 in pre-order.
        name: The node's name.
        parent: The number of the parent node; 0 for the root.
        behaviour: The node's behaviour; the outermost wrapper if conditions are wrapped around the node.
        inner: The node's behaviour without the wrappers of its conditions.
        made: The record of how `inner` was constructed.
    """

    uid: int
    name: str
    parent: int
    behaviour: Behaviour
    inner: Behaviour
    made: Construction


class NumberedTree:
    """A compiled tree with node numbers as in BehaviorTree.CPP. A node and its conditions share one number.

    Args:
        tree: The compiled tree.

    Attributes:
        name: The tree's ID.
        scopes: The scopes of the tree and its subtrees, by scope path.
        nodes: The nodes, in the order of their numbers.

    Raises:
        TooManyNodesError: If the tree has more than `MOST_NODES` nodes.
    """

    def __init__(self, tree: CompiledTree) -> None:
        self.name = tree.instance.tree.name
        self.scopes = {each.scope.path: each.scope for each in tree.instance.iterate()}
        self.nodes = list(_number(tree.root, tree.origins))
        if len(self.nodes) > MOST_NODES:
            raise TooManyNodesError(
                f"the tree '{self.name}' has {len(self.nodes)} nodes. BehaviorTree.CPP's protocols allow at most "
                f"{MOST_NODES}, because their node numbers have 16 bits"
            )
        self._uids = {id(each.behaviour): each.uid for each in self.nodes}

    def uid(self, behaviour: Behaviour) -> int:
        """Return the node number of a behaviour; 0 if the behaviour has no number."""
        return self._uids.get(id(behaviour), 0)


def _number(root: Behaviour, origins: Origins) -> Iterator[NumberedNode]:
    waiting = [(root, 0)]
    uid = 0
    while waiting:
        behaviour, parent = waiting.pop()
        inner = behaviour
        while getattr(inner, "is_its_child", False):
            (inner,) = inner.children
        uid += 1
        yield NumberedNode(uid, inner.name, parent, behaviour, inner, origins.construction(inner.id))
        waiting.extend((child, uid) for child in reversed(inner.children))


IDLE = INVALID
"""The status of a node that is not active.

The other statuses are RUNNING, SUCCESS and FAILURE of `kernel.cells`.
"""


class StatusChange(NamedTuple):
    """A change of a node's status.

    Attributes:
        uid: The node's number.
        before: The old status.
        status: The new status.
    """

    uid: int
    before: int
    status: int


class StatusChanges(VisitorBase):
    """Reports the status changes of a tree's nodes.

    As in BehaviorTree.CPP, a node becomes IDLE when it is halted, or when it has ended and its parent has ended too.
    This also holds for nodes of py_trees. A skipped node keeps its status.

    Args:
        tree: The numbered tree.
        report: Called with each status change.

    Attributes:
        statuses: The status of each node, by node number; index 0 is unused.
    """

    def __init__(self, tree: NumberedTree, report: Callable[[StatusChange], object]) -> None:
        super().__init__(full=False)
        self.statuses = [IDLE] * (len(tree.nodes) + 1)
        self._tree = tree
        self._report = report
        self._busy: set[int] = set()

    def run(self, behaviour: Behaviour) -> None:
        """Report the status of a ticked node if the status has changed."""
        uid = self._tree.uid(behaviour)
        if uid and not was_skipped(behaviour):
            self._set(uid, number_of(behaviour.status))

    def finalise(self) -> None:
        """Set the status of ended and halted nodes to IDLE, starting with the parents."""
        for uid in sorted(self._busy):
            _, _, parent, behaviour, *_ = self._tree.nodes[uid - 1]
            status = number_of(behaviour.status)
            if status == INVALID or (status & ENDED and self.statuses[parent] != RUNNING):
                self._set(uid, IDLE)

    def _set(self, uid: int, status: int) -> None:
        before = self.statuses[uid]
        if before != status:
            self.statuses[uid] = status
            (self._busy.discard if status == IDLE else self._busy.add)(uid)
            self._report(StatusChange(uid, before, status))


def tree_xml(tree: NumberedTree) -> str:
    """Return a tree as XML, with a `BehaviorTree` for each use of a subtree.

    The XML also contains models of user-defined nodes.

    Nodes have their numbers, and the names and attributes of their equivalents in BehaviorTree.CPP.
    """
    children: dict[int, list[NumberedNode]] = {}
    for node in tree.nodes:
        children.setdefault(node.parent, []).append(node)
    writer = _NodeWriter(children)
    lines = ['<root BTCPP_format="4">']
    (root,) = children[0]
    waiting = [_UsedSubtree(tree.name, "", root)]
    while waiting:
        name, path, first = waiting.pop()
        lines += [
            _start(TREE_TAG, {"ID": name, "_fullpath": path}),
            *writer.node_lines(first),
            f"</{TREE_TAG}>",
        ]
        # The trees are written in pre-order, because readers process the uses of a tree in this order.
        waiting += reversed(writer.pop_subtrees())
    models = describe([spec for specs in writer.specs.values() for spec in specs])
    lines += [xml_with_tag_per_line(models) if models.children else f"<{MODEL_TAG}/>", "</root>"]
    return "\n".join(lines)


class _UsedSubtree(NamedTuple):
    name: str
    path: str
    root: NumberedNode


class _NodeWriter:
    """Writes nodes as XML elements.

    Args:
        children: The children of each node, by the node's number.

    Attributes:
        specs: The node specs of all written tags, by tag.
    """

    def __init__(self, children: Mapping[int, Sequence[NumberedNode]]) -> None:
        self.specs: dict[str, Sequence[NodeSpec]] = {}
        self._children = children
        self._subtrees: list[_UsedSubtree] = []

    def pop_subtrees(self) -> list[_UsedSubtree]:
        """Return the uses of subtrees that were written since the last call."""
        found, self._subtrees = self._subtrees, []
        return found

    def node_lines(self, first: NumberedNode) -> Iterator[str]:
        """Yield the XML lines of a node and its descendants.

        The function is not recursive, because trees may be deep.
        """
        waiting: list[NumberedNode | str] = [first]
        while waiting:
            node = waiting.pop()
            if isinstance(node, str):
                yield node
                continue
            children = self._children.get(node.uid, ())
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
        assert bound.subtree is not None  # noqa: S101 - checked by the caller
        self._subtrees.append(_UsedSubtree(bound.subtree.name, scope.path, root))
        # The remaining attributes are ports and conditions; `oneshot` has become a wrapper node.
        named = ("ID", "name", "oneshot")
        given = {name: text for name, text in bound.element.attributes.items() if name not in named}
        uid = str(node.uid)
        attributes = {"ID": bound.subtree.name, **given, "_fullpath": scope.path, "_uid": uid}
        return _start(SUBTREE_TAG, attributes, is_empty=True)

    def _tag_and_attributes(self, node: NumberedNode) -> tuple[str, dict[str, str]]:
        """Return the tag and attributes of a node, or of the node's equivalent in BehaviorTree.CPP."""
        bound = node.made.bound
        if node.made.wrapper is None:
            tag, attributes = bound.spec.tag, dict(bound.element.attributes)
            specs: Sequence[NodeSpec] = [bound.spec]
        else:
            # The node was created for an attribute. Its tag is the name of its py_trees class.
            tag = type(node.inner).__name__
            attributes = {
                name: getattr(value, "name", str(value)) for name, value in node.made.wrapper.items()
            }
            specs = language_variants(tag)
        draft = NodeDraft(synthetic_element(tag), tag, attributes, explicit=False)
        for spec in specs:
            if spec.semantics.counterpart.rewrite is not None:
                spec.semantics.counterpart.rewrite(draft, FindingCollector())
        if not draft.children:
            tag, attributes = draft.tag, draft.attributes
        if tag != specs[0].tag:
            specs = language_variants(tag)
        self.specs[tag] = specs
        known = {*_attribute_names(specs)}
        return tag, {name: text for name, text in attributes.items() if name in known or name.startswith("_")}


def _attribute_names(specs: Iterable[NodeSpec]) -> Iterator[str]:
    """Yield the names of a node's attributes that BehaviorTree.CPP knows.

    For a built-in node, these are only the ports.
    """
    specs = list(specs)
    built_in = is_built_in(specs)
    for spec in specs:
        for parameter in spec.attributes:
            if (parameter.direction is not None or not built_in) and parameter.name != "name":
                yield parameter.name


def _start(tag: str, attributes: Mapping[str, str], *, is_empty: bool = False) -> str:
    written = (f" {name}={quoteattr(escape_to_one_line(text))}" for name, text in attributes.items())
    return f"<{tag}{''.join(written)}{'/' if is_empty else ''}>"
