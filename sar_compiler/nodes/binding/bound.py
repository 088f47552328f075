"""Bound trees as plain data: elements with resolved tags, values and references."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from sar_compiler.nodes.collector import FindingCollector
from sar_compiler.nodes.spec import NodeSpec, Parameter, SkipPossibility
from sar_compiler.runtime.expressions import Script
from sar_compiler.tree.diagnostic import Diagnostic
from sar_compiler.tree.model import Element


class Remapping(NamedTuple):
    """The key remapping that the attributes of a `SubTree` declare.

    Attributes:
        keys: The outer key of each remapped key of the subtree.
        constants: The texts of the constants that are passed to keys of the subtree.
        autoremap: Whether every other key is remapped to the outer key of the same name.
    """

    keys: Mapping[str, str] = {}
    constants: Mapping[str, str] = {}
    autoremap: bool = False


_NOTHING: Mapping[str, Any] = {}
_APART = Remapping()


class BoundNode:
    """An element that is bound to the spec of its tag.

    The mappings are replaced, never modified, because most of them are empty and shared.

    Attributes:
        element: The element.
        spec: The spec of the element's tag.
        name: The node's name.
        values: The parsed values of the attributes, by constructor parameter.
        keys: The blackboard keys (`{key}`) in the attributes, by constructor parameter.
        references: The nodes of the same tree to which attributes refer, by constructor parameter.
        children: The node's children.
        conditions: The scripts of the pre- and postconditions, by attribute name.
        oneshot: The policy name of the OneShot that wraps the node; None without a OneShot.
        subtree: The tree to which a `SubTree` refers; None for other nodes.
        remapping: The key remapping of a `SubTree`.
    """

    __slots__ = (
        "children",
        "conditions",
        "element",
        "keys",
        "name",
        "oneshot",
        "references",
        "remapping",
        "spec",
        "subtree",
        "values",
    )

    def __init__(
        self,
        element: Element,
        spec: NodeSpec,
        name: str,
        values: Mapping[str, object] = _NOTHING,
        keys: Mapping[str, str] = _NOTHING,
        conditions: Mapping[str, Script] = _NOTHING,
        oneshot: str | None = None,
    ) -> None:
        self.element = element
        self.spec = spec
        self.name = name
        self.values = values
        self.keys = keys
        self.references: Mapping[str, BoundNode] = _NOTHING
        self.conditions = conditions
        self.children: Sequence[BoundNode] = ()
        self.oneshot = oneshot
        self.subtree: BoundTree | None = None
        self.remapping = _APART

    @property
    def tag(self) -> str:
        """The node's registered tag."""
        return self.spec.tag

    @property
    def is_leaf(self) -> bool:
        """Whether the node can have no children."""
        return self.spec.kind.is_leaf

    @property
    def counts(self) -> tuple[str, ...]:
        """The node's ports whose values are numbers of children."""
        return self.spec.semantics.counts

    @property
    def is_reactive(self) -> bool:
        """Whether the node re-evaluates all its children in every tick."""
        return self.spec.semantics.reactive or self.value("memory") is False

    def scripts(self) -> Iterator[tuple[str, Script]]:
        """Yield the attributes that contain scripts (as conditions or values), each with its script."""
        if self.conditions:
            yield from self.conditions.items()
        for attribute, value in self.values.items():
            if isinstance(value, Script):
                yield attribute, value

    def value(self, name: str) -> object:
        """Return the value or default of an attribute; None if the value is known only at runtime."""
        if name in self.values:
            return self.values[name]
        if name in self.element.attributes:  # a key, or an invalid value
            return None
        parameter = self.spec.parameters.get(name)
        return self.spec.implied_values.get(name, parameter.default if parameter is not None else None)


class BoundTree:
    """A bound `BehaviorTree`, whose subtrees are not expanded.

    Attributes:
        element: The `BehaviorTree` element.
        name: The ID of the tree; a generated ID for a tree without an ID.
        root: The bound root node; None if the tree is empty or the root node is unknown.
        nodes: All nodes of the tree, in the order of the file.
        uses: The `SubTree` nodes.
        parents: The nodes with children, inner nodes first.
        keyed: The nodes with blackboard keys.
        scripted: The nodes that can have scripts, as conditions or as values.
        referring: The nodes that refer to other nodes.
        demanding: The nodes that depend on more than their attribute values: on keys, subtrees, other nodes, facts or
            objects of the mission. Nodes that only a model describes are included.
        skips: Whether one of the nodes can be skipped independently of its children.
        nesting: The nesting depth of the elements.
        wrappers: The number of conditions and OneShots that wrap nodes of the tree.
        open_references: References to nodes that are not in this tree, but may be in an enclosing tree.
        unknown_names: The names of nodes with unknown tags; references to these names are not reported again.
    """

    def __init__(self, element: Element, name: str) -> None:
        self.element = element
        self.name = name
        self.root: BoundNode | None = None
        self.nodes: list[BoundNode] = []
        self.uses: list[BoundNode] = []
        self.parents: list[BoundNode] = []
        self.keyed: list[BoundNode] = []
        self.scripted: list[BoundNode] = []
        self.referring: list[BoundNode] = []
        self.demanding: list[BoundNode] = []
        self.skips = False
        self.nesting = 0
        self.wrappers = 0
        self.open_references: list[tuple[BoundNode, Parameter]] = []
        self.unknown_names: set[str] = set()

    def subtrees(self) -> Iterator[BoundNode]:
        """Yield the `SubTree` nodes whose trees are known."""
        return (node for node in self.uses if node.subtree is not None)


@dataclass(frozen=True)
class Binding:
    """A main tree with all its subtrees.

    Attributes:
        main: The tree to execute.
        findings: The findings of binding; the tree can be compiled only if there are no errors.
        enums: The named constants of scripts and `Switch` nodes, with their numbers.
    """

    main: BoundTree
    findings: tuple[Diagnostic, ...]
    enums: Mapping[str, int] = field(default_factory=dict)

    def used_trees(self) -> list[BoundTree]:
        """Return the main tree and the trees that it uses, each once."""
        found = [self.main]
        known = {self.main}
        for tree in found:
            for node in tree.subtrees():
                if node.subtree is not None and node.subtree not in known:
                    known.add(node.subtree)
                    found.append(node.subtree)
        return found

    def all_nodes(self) -> Iterator[BoundNode]:
        """Yield every node of the main tree and of the trees that it uses."""
        for tree in self.used_trees():
            yield from tree.nodes


_CONDITIONS = ("_skipIf", "_while")


class SkipAnalysis:
    """Analysis of the nodes that can be skipped, in a tree and its subtrees.

    Args:
        trees: The trees.
        skipped: Further nodes that are declared as skippable independently of their children.

    Attributes:
        possible: Whether at least one node in the trees can be skipped independently of its children.
    """

    def __init__(self, trees: Iterable[BoundTree], skipped: Iterable[BoundNode] = ()) -> None:
        self._known: dict[BoundNode, bool] = dict.fromkeys(skipped, True)
        # In most trees no node can be skipped, so no analysis is needed.
        self.possible = bool(self._known) or any(tree.skips for tree in trees)

    def has_skippable_child(self, bound: BoundNode) -> bool:
        """Return whether a child of a node can be skipped."""
        if not self.possible:
            return False
        if bound.subtree is not None:
            root = bound.subtree.root
            return root is not None and self.can_be_skipped(root)
        return any(self.can_be_skipped(child) for child in bound.children)

    def can_be_skipped(self, bound: BoundNode) -> bool:
        """Return whether a node can be skipped."""
        if bound not in self._known:
            self._known[bound] = is_skippable_itself(bound) or (
                bound.spec.skipping.possible is not SkipPossibility.NEVER and self.has_skippable_child(bound)
            )
        return self._known[bound]


def is_skippable_itself(bound: BoundNode) -> bool:
    """Return whether a node can be skipped even if none of its children is."""
    if bound.spec.skips_by_itself and _can_have_required_value(bound):
        return True
    return bool(bound.conditions) and any(condition in bound.conditions for condition in _CONDITIONS)


def _can_have_required_value(bound: BoundNode) -> bool:
    """Return whether a node's attribute may have the value for which the node can be skipped."""
    if bound.spec.skipping.only_if is None:
        return True
    name, value = bound.spec.skipping.only_if
    if name in bound.keys:
        return True
    return bool(bound.values.get(name, bound.spec.parameters[name].default) == value)


def report_misread_skips(
    trees: Sequence[BoundTree], collector: FindingCollector, skipped: Iterable[BoundNode] = ()
) -> None:
    """Report skippable children below a node that treats a skip as an interruption.

    Args:
        trees: The trees.
        collector: The collector of findings.
        skipped: Further nodes that are declared as skippable independently of their children.
    """
    skipping = SkipAnalysis(trees, skipped)
    if not skipping.possible:
        return
    for bound in [bound for tree in trees for bound in tree.nodes]:
        if bound.oneshot is not None and skipping.can_be_skipped(bound):
            message = f"oneshot: '{bound.name}' can be skipped, which OneShot treats as an interruption"
            hint = "use a <RunOnce> instead"
            collector.add("skip-misread", message, bound.element, name="oneshot", hint=hint)
        if bound.spec.misreads_skips:
            _report_children(bound, skipping, collector)


def _report_children(bound: BoundNode, skipping: SkipAnalysis, collector: FindingCollector) -> None:
    for child in bound.children:
        if skipping.can_be_skipped(child):
            message = f"'{child.name}' can be skipped, which <{bound.element.tag}> treats as an interruption"
            advice = bound.spec.skipping.advice
            hint = (
                f"write {advice} instead"
                if advice
                else "let the child succeed or fail instead of being skipped"
            )
            collector.add("skip-misread", message, child.element, hint=hint)
