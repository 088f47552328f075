"""Bound trees: tags, texts and names resolved to their meanings, as plain data."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from py_trees.common import OneShotPolicy

from sar_compiler.nodes.spec import NodeSpec, Parameter
from sar_compiler.runtime.expressions import Script
from sar_compiler.tree.diagnostic import Diagnostic
from sar_compiler.tree.model import Element


@dataclass(frozen=True)
class Remapping:
    """The key remapping that the attributes of a `SubTree` declare.

    Attributes:
        keys: The outer key for each remapped key of the subtree.
        constants: The texts of the keys that are constants.
        autoremap: Whether every other key is remapped to the outer key of the same name.
    """

    keys: Mapping[str, str] = field(default_factory=dict)
    constants: Mapping[str, str] = field(default_factory=dict)
    autoremap: bool = False


_NOTHING: Mapping[str, Any] = {}
_APART = Remapping()


@dataclass(eq=False, slots=True, init=False)
class BoundNode:
    """An element with its meaning.

    Its mappings are replaced, never modified: most of them are empty, and these are shared.

    Attributes:
        element: The element.
        spec: The meaning of its tag.
        name: The node's name.
        values: The values written for constructor parameters.
        keys: The blackboard keys written for constructor parameters (`{key}`).
        references: The nodes that constructor parameters refer to, if they are in the same tree.
        children: Its children.
        conditions: The scripts of its pre- and post-conditions, by their attributes' names.
        oneshot: The policy of the OneShot to wrap it in.
        subtree: The tree that it refers to, if it is a `SubTree`.
        remapping: The remapping of that tree's keys.
    """

    element: Element
    spec: NodeSpec
    name: str
    values: Mapping[str, object]
    keys: Mapping[str, str]
    references: "Mapping[str, BoundNode]"
    children: "Sequence[BoundNode]"
    conditions: Mapping[str, Script]
    oneshot: OneShotPolicy | None
    subtree: "BoundTree | None"
    remapping: Remapping

    # The __init__ of @dataclass would call a factory for each mapping, which takes three times as long.
    def __init__(self, element: Element, spec: NodeSpec, name: str) -> None:
        self.element = element
        self.spec = spec
        self.name = name
        self.values = self.keys = self.references = self.conditions = _NOTHING
        self.children = ()
        self.oneshot = None
        self.subtree = None
        self.remapping = _APART

    @property
    def is_reactive(self) -> bool:
        """Whether it re-evaluates all its children in every tick."""
        return self.spec.semantics.reactive or self.value("memory") is False

    def value(self, name: str) -> object:
        """Return the value of an attribute, or its default; None if the value is known only at runtime."""
        if name in self.values:
            return self.values[name]
        if name in self.element.attributes:  # a key, or a mistake
            return None
        parameter = self.spec.parameters.get(name)
        return self.spec.fixed.get(name, parameter.default if parameter is not None else None)


@dataclass(eq=False)
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
        referring: The nodes that refer to others.
        demanding: The nodes that are more than their tag and values: those with keys, subtrees or references,
            those that need an object of the mission, and those that are only described.
        skips: Whether one of the nodes can be skipped by itself.
        nesting: How deep its elements are nested.
        wrappers: How many conditions and OneShots are wrapped around its nodes.
        open_references: References to nodes that are not in this tree, but may be in an enclosing one.
        unknown_names: Names of nodes with unknown tags; references to them are not reported again.
    """

    element: Element
    name: str
    root: BoundNode | None = None
    nodes: list[BoundNode] = field(default_factory=list)
    uses: list[BoundNode] = field(default_factory=list)
    parents: list[BoundNode] = field(default_factory=list)
    keyed: list[BoundNode] = field(default_factory=list)
    referring: list[BoundNode] = field(default_factory=list)
    demanding: list[BoundNode] = field(default_factory=list)
    skips: bool = False
    nesting: int = 0
    wrappers: int = 0
    open_references: list[tuple[BoundNode, Parameter]] = field(default_factory=list)
    unknown_names: set[str] = field(default_factory=set)

    def subtrees(self) -> Iterator[BoundNode]:
        """Yield its `SubTree` nodes whose trees are known."""
        return (node for node in self.uses if node.subtree is not None)


@dataclass(frozen=True)
class Binding:
    """A main tree with all its subtrees.

    Attributes:
        main: The tree to execute.
        findings: The errors; the tree can be compiled only if there are none.
    """

    main: BoundTree
    findings: tuple[Diagnostic, ...]

    def trees(self) -> list[BoundTree]:
        """Return the main tree and the trees that it uses, each once."""
        found = [self.main]
        known = {self.main}
        for tree in found:
            for node in tree.subtrees():
                if node.subtree is not None and node.subtree not in known:
                    known.add(node.subtree)
                    found.append(node.subtree)
        return found

    def nodes(self) -> Iterator[BoundNode]:
        """Yield every node of every tree."""
        for tree in self.trees():
            yield from tree.nodes
