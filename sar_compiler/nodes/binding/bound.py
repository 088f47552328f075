"""What a tree means once its tags, texts and names are understood; plain data."""

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
    """What the attributes of a `SubTree` say about the keys in it.

    Attributes:
        keys: Which key around the subtree each of these keys in it stands for.
        constants: The texts of keys that are constants.
        autoremap: Whether every other key stands for the one of the same name.
    """

    keys: Mapping[str, str] = field(default_factory=dict)
    constants: Mapping[str, str] = field(default_factory=dict)
    autoremap: bool = False


_NOTHING: Mapping[str, Any] = {}
_APART = Remapping()


@dataclass(eq=False, slots=True, init=False)
class BoundNode:
    """An element and what it means.

    Its mappings are replaced, not written to: most nodes have nothing in most of them, and share that.

    Attributes:
        element: The element.
        spec: What its tag means.
        name: The node's name.
        values: The values written for constructor parameters.
        keys: The blackboard keys written for constructor parameters (`{key}`).
        references: The nodes that constructor parameters refer to, as far as they stand in the same tree.
        children: The nodes in it.
        conditions: The scripts of its pre- and post-conditions, by their attributes' names.
        oneshot: The policy of the OneShot to wrap it in.
        subtree: The tree that it stands for, if it is a `SubTree`.
        remapping: What it says about that tree's keys.
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

    # What @dataclass would write calls a factory for each mapping, which takes three times as long.
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
        """Whether it looks at every child again in every tick."""
        return self.spec.semantics.reactive or self.value("memory") is False

    def value(self, name: str) -> object:
        """Return the value of an attribute, the default where it is not written; None where that is not known yet."""
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
        name: Its ID; a made-up one for a tree without.
        root: The bound tree; None where there is nothing to bind.
        nodes: Everything in it, in the order of the file.
        uses: Those of its nodes that stand for subtrees.
        parents: Those with nodes in them, the inner ones first.
        keyed: Those that have keys of the blackboard.
        referring: Those that refer to others.
        demanding: Those that are more than their tag and values: that have keys or stand for subtrees, refer to
            others, need something of the mission, or are only described.
        skips: Whether one of them can be skipped by itself.
        nesting: How deep its elements are nested.
        wrappers: How many conditions and OneShots are wrapped around its nodes.
        open_references: References to nodes that are not in this tree, but may be in one around it.
        unknown_names: Names of nodes whose tags are not known; nothing more is said of references to them.
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
    """A whole tree, with everything that it consists of.

    Attributes:
        main: The tree to execute.
        findings: What is wrong; the tree can be compiled only if there is nothing.
    """

    main: BoundTree
    findings: tuple[Diagnostic, ...]

    def trees(self) -> list[BoundTree]:
        """Return the main tree and the trees that it uses, each once."""
        found = [self.main]
        for tree in found:
            found.extend(
                node.subtree for node in tree.subtrees() if node.subtree and node.subtree not in found
            )
        return found

    def nodes(self) -> Iterator[BoundNode]:
        """Yield every node of every tree."""
        for tree in self.trees():
            yield from tree.nodes
