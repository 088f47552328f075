"""The context of the rules: a file with all that it includes, bound once."""

import bisect
import functools
from collections.abc import Iterator, Mapping
from dataclasses import replace

from sar_compiler.checks.rules.key_accesses import KeyAccesses, key_accesses_of
from sar_compiler.checks.rules.outcome_analysis import PossibleOutcomes, is_telling
from sar_compiler.nodes.binding.binder import BoundForest, bind_all
from sar_compiler.nodes.binding.bound import BoundNode, BoundTree
from sar_compiler.nodes.binding.nesting import trees_in
from sar_compiler.nodes.registry import Registry
from sar_compiler.nodes.values import Guesses
from sar_compiler.tree.diagnostic import Diagnostic, Severity
from sar_compiler.tree.forest import Forest
from sar_compiler.tree.model import SECTIONS, TreeFile
from sar_compiler.tree.source import Span


class CheckContext:
    """A forest with the results of its analysis, each computed at most once.

    Attributes:
        forest: The file and what it includes.
        registry: The registered nodes.
        palettes: Files whose `TreeNodesModel` describes nodes that are not installed.
    """

    def __init__(self, forest: Forest, registry: Registry, palettes: tuple[TreeFile, ...] = ()) -> None:
        self.forest = forest
        self.registry = registry
        self.palettes = palettes

    @functools.cached_property
    def bound(self) -> BoundForest:
        """Every tree, bound."""
        return bind_all(self.forest, self.registry, self.palettes)

    @functools.cached_property
    def is_whole(self) -> bool:
        """Whether all trees are known: each include was read, and no other element may have been meant as a tree."""
        roots = (tree_file.root for tree_file in self.forest.files)
        return not self.forest.findings and all(
            child.tag in SECTIONS for root in roots for child in root.children
        )

    @functools.cached_property
    def trees(self) -> tuple[BoundTree, ...]:
        """The trees within the limits of size and depth, the inner ones first."""
        return tuple({tree: None for top in self.bound.tops for tree in trees_in(top.tree)})

    @functools.cached_property
    def key_accesses(self) -> Mapping[BoundTree, KeyAccesses]:
        """The accesses of the nodes of each of these trees to keys."""
        return {tree: key_accesses_of(tree) for tree in self.trees}

    @functools.cached_property
    def guesses(self) -> Guesses:
        """Guesses of what was meant."""
        return Guesses()

    @functools.cached_property
    def is_foreign(self) -> bool:
        """Whether a node is only described: another program executes the trees."""
        return any(bound.spec.is_foreign for tree in self.trees for bound in tree.demanding)

    @functools.cached_property
    def outcomes(self) -> PossibleOutcomes:
        """The possible outcomes of every node."""
        return PossibleOutcomes(self.trees, self.broken)

    @functools.cached_property
    def is_telling(self) -> bool:
        """Whether the nodes' outcomes allow any conclusions."""
        return any(is_telling(spec) for spec in self.bound.specs)

    @functools.cached_property
    def sound(self) -> bool:
        """Whether all files could be read and all elements bound."""
        found = (*self.forest.findings, *self.bound.findings)
        return all(finding.severity is not Severity.ERROR for finding in found)

    @functools.cached_property
    def broken(self) -> frozenset[BoundNode]:
        """The nodes with a mistake in their tags or attributes, from which no conclusions are drawn."""
        return frozenset(self._broken()) if self.bound.findings else frozenset()

    def _broken(self) -> Iterator[BoundNode]:
        nodes: dict[str, list[BoundNode]] = {}
        for tree in self.bound.trees:
            nodes.setdefault(tree.element.source.path, []).extend(tree.nodes)
        for of_file in nodes.values():
            of_file.sort(key=_place)
        for finding in self.bound.findings:
            of_file = nodes.get(finding.source.path, [])
            index = bisect.bisect_right(of_file, (finding.span.line, finding.span.column), key=_place)
            if index:
                yield of_file[index - 1]


def _place(bound: BoundNode) -> tuple[int, int]:
    return bound.element.line, bound.element.column


def warning(
    code: str,
    message: str,
    bound: BoundNode,
    span: Span | None = None,
    suggestion: str | None = None,
    hint: str | None = None,
) -> Diagnostic:
    """Return a warning about a part of a node, or about the node as a whole."""
    element = bound.element
    return Diagnostic(
        code, message, element.source, span or element.tag_span(), suggestion, hint, Severity.WARNING
    )


def information(
    code: str, message: str, bound: BoundNode, span: Span | None = None, *, hint: str | None = None
) -> Diagnostic:
    """Return an information about a part of a node, or about the node as a whole."""
    return replace(warning(code, message, bound, span, hint=hint), severity=Severity.INFO)
