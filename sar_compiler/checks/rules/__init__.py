"""Rules that find errors in trees whose nodes are all valid. Each module contains one family of rules."""

import bisect
import functools
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from operator import attrgetter
from typing import TypeVar

from sar_compiler.checks.rules.entry_accesses import KeyAccesses, key_accesses_of
from sar_compiler.checks.rules.outcome_analysis import PossibleOutcomes, is_informative
from sar_compiler.nodes.binding.binder import BoundForest, bind_all
from sar_compiler.nodes.binding.bound import BoundNode, BoundTree
from sar_compiler.nodes.binding.nesting import trees_in
from sar_compiler.nodes.btcpp import NEWEST, Version
from sar_compiler.nodes.registry import Registry
from sar_compiler.nodes.spec import NodeSpec
from sar_compiler.runtime.expressions import Script
from sar_compiler.tree.diagnostic import Diagnostic, Form, Severity
from sar_compiler.tree.forest import Forest
from sar_compiler.tree.guessing import Guesses
from sar_compiler.tree.model import SECTIONS, Element, TreeFile, last_element_before

_OfSpec = TypeVar("_OfSpec")


@dataclass(eq=False, repr=False)
class CheckContext:
    """A forest and the results of its analysis. Each result is computed at most once.

    Attributes:
        forest: The file and its includes.
        registry: The registered nodes.
        palettes: Files whose `TreeNodesModel` describes nodes that are not installed.
        btcpp: The version of BehaviorTree.CPP that the trees are for; None if it is not configured.
    """

    forest: Forest
    registry: Registry
    palettes: tuple[TreeFile, ...] = ()
    btcpp: Version | None = None

    @functools.cached_property
    def bound_forest(self) -> BoundForest:
        """All trees of the forest, with every element bound to its node's spec."""
        return bind_all(self.forest, self.registry, self.palettes, self.btcpp)

    @property
    def version(self) -> Version:
        """The BehaviorTree.CPP version for which the trees are written; the newest one if none is configured."""
        return self.btcpp or NEWEST

    @functools.cached_property
    def is_whole(self) -> bool:
        """Whether all trees are known.

        This requires that each include was read, and that no element looks like a misspelt tree.
        """
        roots = (tree_file.root for tree_file in self.forest.files)
        return (
            not self.forest.findings
            and all(child.tag in SECTIONS for root in roots for child in root.children)
            and not any(is_misnamed(tree) for tree in self.forest.iterate())
        )

    @functools.cached_property
    def trees(self) -> tuple[BoundTree, ...]:
        """The trees that are within the limits of size and depth. Subtrees precede the trees that use them."""
        return tuple({tree: None for top in self.bound_forest.tops for tree in trees_in(top.tree)})

    def parents(self) -> Iterator[BoundNode]:
        """Yield the nodes that have children and no errors."""
        return (bound for tree in self.trees for bound in tree.parents if bound not in self.nodes_with_errors)

    @functools.cached_property
    def scripts(self) -> Sequence[tuple[BoundNode, str, Script]]:
        """The scripts of all `trees`, each with the node and the attribute that contain it."""
        return [
            (bound, attribute, script)
            for tree in self.trees
            for bound in tree.scripted
            for attribute, script in bound.scripts()
        ]

    def nodes_with(self, find: Callable[[NodeSpec], _OfSpec]) -> Iterator[tuple[BoundNode, _OfSpec]]:
        """Call *find* with the spec of each tag. Yield each node whose spec has a result, with this result.

        The trees are not traversed if no spec has a result, as in most files.
        """
        found = {id(spec): each for spec in self.bound_forest.specs if (each := find(spec))}
        for bound in (bound for tree in self.trees for bound in tree.nodes if found):
            if id(bound.spec) in found:
                yield bound, found[id(bound.spec)]

    def is_main(self, tree: BoundTree) -> bool:
        """Return whether a tree may be executed: it is the main tree, or no other tree uses it.

        If the file names no main tree, uses in other files of the project are considered as well.
        """
        return id(tree.element) in self._executable

    @functools.cached_property
    def _executable(self) -> frozenset[int]:
        return frozenset(map(id, self.forest.executable))

    @functools.cached_property
    def key_accesses(self) -> Mapping[BoundTree, KeyAccesses]:
        """For each tree, the accesses of its nodes to blackboard keys."""
        return {tree: key_accesses_of(tree) for tree in self.trees}

    @functools.cached_property
    def guesses(self) -> Guesses:
        """The suggestions for misspelt names."""
        return Guesses()

    @functools.cached_property
    def is_foreign(self) -> bool:
        """Whether any node is known only from a model. Another program then executes the trees."""
        return any(bound.spec.is_foreign for tree in self.trees for bound in tree.demanding)

    @functools.cached_property
    def outcomes(self) -> PossibleOutcomes:
        """The possible outcomes of all nodes in `trees`."""
        return PossibleOutcomes(self.trees, self.nodes_with_errors)

    @functools.cached_property
    def is_informative(self) -> bool:
        """Whether a node has outcomes from which the rules can draw conclusions."""
        return any(is_informative(spec) for spec in self.bound_forest.specs)

    @functools.cached_property
    def is_complete(self) -> bool:
        """Whether all files were read, and all elements bound to their nodes, without errors."""
        found = (*self.forest.findings, *self.bound_forest.findings)
        return all(finding.severity is not Severity.ERROR for finding in found)

    @functools.cached_property
    def nodes_with_errors(self) -> frozenset[BoundNode]:
        """The nodes that the rules skip because their tag, attributes or children have an error."""
        return frozenset(self._find_nodes_with_errors()) if self._errors else frozenset()

    @functools.cached_property
    def elements_with_errors(self) -> Sequence[Element]:
        """The elements in the trees that have errors, or could not be bound to nodes."""
        bound = {id(node.element) for tree in self.bound_forest.trees for node in tree.nodes}
        found: list[Element] = []
        for tree_file in self.forest.files:
            elements = [
                each for tree in tree_file.trees for child in tree.children for each in child.iterate()
            ]
            found += [each for each in elements if id(each) not in bound]
            elements.sort(key=attrgetter("position"))  # in YAML, a node's children may precede its attributes
            errors = [each for each in self._errors if each.source is tree_file.source]
            found += filter(None, (last_element_before(elements, each.span[:2]) for each in errors))
        return [*{id(each): each for each in found}.values()]

    @functools.cached_property
    def _errors(self) -> list[Diagnostic]:
        return [finding for finding in self.bound_forest.findings if finding.severity is Severity.ERROR]

    def _find_nodes_with_errors(self) -> Iterator[BoundNode]:
        nodes: dict[str, list[BoundNode]] = {}
        for tree in sorted(self.bound_forest.trees, key=attrgetter("element.position")):
            nodes.setdefault(tree.element.source.path, []).extend(tree.nodes)
        for of_file in nodes.values():
            # In YAML, a node's children may precede its attributes.
            if of_file and of_file[0].element.source.form is not Form.XML:
                of_file.sort(key=attrgetter("element.position"))
        for finding in self._errors:
            of_file = nodes.get(finding.source.path, [])
            index = bisect.bisect_right(of_file, finding.span[:2], key=attrgetter("element.position"))
            if index:
                yield of_file[index - 1]
        # If a child could not be bound, the indices of the bound children differ from those in the file.
        for tree in self.bound_forest.trees:
            yield from (each for each in tree.parents if len(each.children) != len(each.element.children))


def is_misnamed(tree: Element) -> bool:
    """Return whether a tree has the attribute `name` instead of `ID`."""
    return "ID" not in tree.attributes and "name" in tree.attributes
