"""A tree file as data: elements, attributes and their places, whatever form the file had."""

import functools
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

from sar_compiler.tree.source import Source, Span

ROOT_TAG = "root"
TREE_TAG = "BehaviorTree"
MODEL_TAG = "TreeNodesModel"


@dataclass(frozen=True, slots=True)
class Element:
    """One element of a tree file.

    Attributes:
        tag: Its tag.
        attributes: Its attributes, in the order written.
        children: The elements in it.
        source: The file.
        line: The line where it begins, from 1.
        column: The column where it begins, from 1.
    """

    tag: str
    attributes: Mapping[str, str]
    children: "tuple[Element, ...]"
    source: Source = field(repr=False, compare=False)
    line: int = field(repr=False, compare=False)
    column: int = field(repr=False, compare=False)

    def tag_span(self) -> Span:
        """Return where it begins, up to the end of its tag's name."""
        return self.source.spans.tag(self.source, self)

    def name_span(self, attribute: str) -> Span:
        """Return where the name of one of its attributes stands."""
        return self.source.spans.attribute_name(self.source, self, attribute)

    def value_span(self, attribute: str) -> Span:
        """Return where the value of one of its attributes stands, without quotes."""
        return self.source.spans.attribute_value(self.source, self, attribute)

    def iterate(self) -> Iterator["Element"]:
        """Yield it and everything in it, in the order of the file."""
        yield self
        for child in self.children:
            yield from child.iterate()


@dataclass(frozen=True)
class TreeFile:
    """A file with behaviour trees.

    Attributes:
        source: The file's text and name.
        root: Its outermost element.
    """

    source: Source
    root: Element

    @functools.cached_property
    def trees(self) -> tuple[Element, ...]:
        """The `BehaviorTree` elements, in the order of the file."""
        return tuple(child for child in self.root.children if child.tag == TREE_TAG)

    @property
    def main_tree_name(self) -> str | None:
        """The tree that the file itself names as the one to execute."""
        return self.root.attributes.get("main_tree_to_execute")

    def main_tree(self, tree_id: str | None = None) -> Element | None:
        """Return the tree to execute: the one asked for, the one the file names, or the only one.

        Args:
            tree_id: The ID asked for; None leaves the choice to the file.

        Returns:
            The `BehaviorTree` element; None if there is no such tree, or several to choose from.
        """
        wanted = tree_id if tree_id is not None else self.main_tree_name
        if wanted is None:
            return self.trees[0] if len(self.trees) == 1 else None
        return next((tree for tree in self.trees if tree.attributes.get("ID") == wanted), None)
