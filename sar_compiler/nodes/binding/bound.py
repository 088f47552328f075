"""Bound trees: tags, texts and names resolved to their meanings, as plain data."""

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
        keys: The outer key for each remapped key of the subtree.
        constants: The texts of the keys that are constants.
        autoremap: Whether every other key is remapped to the outer key of the same name.
    """

    keys: Mapping[str, str] = {}
    constants: Mapping[str, str] = {}
    autoremap: bool = False


_NOTHING: Mapping[str, Any] = {}
_APART = Remapping()


class BoundNode:
    """An element with its meaning.

    Its mappings are replaced, never modified: most of them are empty and shared.

    Attributes:
        element: The element.
        spec: The meaning of its tag.
        name: The node's name.
        values: The values written for constructor parameters.
        keys: The blackboard keys written for constructor parameters (`{key}`).
        references: The nodes that constructor parameters refer to, if they are in the same tree.
        children: Its children.
        conditions: The scripts of its pre- and post-conditions, by their attributes' names.
        oneshot: The policy's name of the OneShot that wraps it.
        subtree: The tree that it refers to, if it is a `SubTree`.
        remapping: The remapping of that tree's keys.
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
        """Its registered tag."""
        return self.spec.tag

    @property
    def is_leaf(self) -> bool:
        """Whether the node can have no children."""
        return self.spec.kind.is_leaf

    @property
    def counts(self) -> tuple[str, ...]:
        """Its ports whose values are numbers of its children."""
        return self.spec.semantics.counts

    @property
    def is_reactive(self) -> bool:
        """Whether it re-evaluates all its children in every tick."""
        return self.spec.semantics.reactive or self.value("memory") is False

    def scripts(self) -> Iterator[tuple[str, Script]]:
        """Yield its scripts with their attributes: conditions and values."""
        if self.conditions:
            yield from self.conditions.items()
        for attribute, value in self.values.items():
            if isinstance(value, Script):
                yield attribute, value

    def value(self, name: str) -> object:
        """Return the value of an attribute, or its default; None if the value is known only at runtime."""
        if name in self.values:
            return self.values[name]
        if name in self.element.attributes:  # a key, or an invalid value
            return None
        parameter = self.spec.parameters.get(name)
        return self.spec.implied_values.get(name, parameter.default if parameter is not None else None)


class BoundTree:
    """A `BehaviorTree`, bound by itself.

    Attributes:
        element: The `BehaviorTree` element.
        name: Its ID; a generated one for a tree without an ID.
        root: The bound root node; None if there is nothing to bind.
        nodes: All its nodes, in the order of the file.
        uses: Its `SubTree` nodes.
        parents: The nodes with children, the inner ones first.
        keyed: The nodes with blackboard keys.
        scripted: The nodes that can have scripts: as conditions or as values.
        referring: The nodes that refer to others.
        demanding: The nodes that need more than their tag and values: those with keys, subtrees, references or facts, those that
            need an object of the mission, and those that are only described.
        skips: Whether one of the nodes can be skipped independently of its children.
        nesting: The nesting depth of its elements.
        wrappers: The number of conditions and OneShots that wrap its nodes.
        open_references: References to nodes that are not in this tree, but may be in an enclosing one.
        unknown_names: Names of nodes with unknown tags; references to them are not reported again.
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
        """Yield its `SubTree` nodes whose trees are known."""
        return (node for node in self.uses if node.subtree is not None)


@dataclass(frozen=True)
class Binding:
    """A main tree with all its subtrees.

    Attributes:
        main: The tree to execute.
        findings: The findings; the tree can be compiled only if there is no error.
        enums: The numbers of named constants in scripts and in `Switch`.
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
        """Yield every node of every tree."""
        for tree in self.used_trees():
            yield from tree.nodes


_CONDITIONS = ("_skipIf", "_while")


class SkipAnalysis:
    """Skip analysis of one tree and its subtrees, with each node analysed once.

    Args:
        trees: The trees.
        skipped: Further nodes that are declared as skippable by themselves.

    Attributes:
        possible: Whether any node in them can be skipped independently of its children.
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
    """Return whether a node can be skipped independently of its children."""
    if bound.spec.skips_by_itself and _can_have_required_value(bound):
        return True
    return bool(bound.conditions) and any(condition in bound.conditions for condition in _CONDITIONS)


def _can_have_required_value(bound: BoundNode) -> bool:
    """Return whether the attribute that controls skipping may have the required value."""
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
        collector: Receives the findings.
        skipped: Further nodes that are declared as skippable by themselves.
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
            hint = f"write {advice} instead" if advice else "let the child succeed or fail instead"
            collector.add("skip-misread", message, child.element, hint=hint)
