"""Scripts and keys that mean something else than was thought, as a rule has told: what ticks raise for that is no news."""

from collections.abc import Iterable, Iterator

from sar_compiler.checks.rules.key_accesses import key_accesses_of
from sar_compiler.nodes.binding.bound import Binding, BoundNode, BoundTree
from sar_compiler.nodes.semantics import AccessKind
from sar_compiler.tree.diagnostic import Diagnostic

_CODES = frozenset({"assignment-as-condition", "idle-statement", "touching-statements", "key-as-text"})
_WRITING = (AccessKind.WRITE, AccessKind.CHANGE)


class Mistaken:
    """The attributes of a bound tree that such findings are about, and the keys whose values come from there.

    Args:
        binding: The tree.
        findings: What the rules have found.
    """

    def __init__(self, binding: Binding, findings: Iterable[Diagnostic]) -> None:
        self._trees = {bound: tree for tree in binding.trees() for bound in tree.nodes}
        told = [each for each in findings if each.code in _CODES]
        self._attributes = {
            (bound, attribute) for bound in self._trees for attribute in _told_of(bound, told)
        }
        self._keys = {key for place in self._attributes for key in self._written(*place)}
        links = [*self._links()]
        before = -1
        while before != len(self._keys):  # a subtree in another one has it from there
            before = len(self._keys)
            self._keys |= {inner for outer, inner in links if outer in self._keys}

    def explains(self, bound: BoundNode, attribute: str) -> bool:
        """Return whether one of them is why an attribute of a node raises; where that is not known, any of the node's."""
        return (bound, attribute) in self._attributes or any(
            (tree, key) in self._keys for tree, key, _ in self._accesses(bound, attribute)
        )

    def _written(self, bound: BoundNode, attribute: str) -> Iterator[tuple[BoundTree, str]]:
        if bound.subtree is not None and attribute in bound.remapping.constants:
            yield bound.subtree, attribute
        yield from ((tree, key) for tree, key, kind in self._accesses(bound, attribute) if kind in _WRITING)

    def _accesses(self, bound: BoundNode, attribute: str) -> Iterator[tuple[BoundTree, str, AccessKind]]:
        tree = self._trees[bound]
        for each in key_accesses_of(tree).accesses if self._attributes else ():
            if each.bound is bound and attribute in ("", each.attribute):
                yield tree, each.key, each.kind

    def _links(self) -> Iterator[tuple[tuple[BoundTree, str], tuple[BoundTree, str]]]:
        """Yield the keys that are passed to subtrees, each with that in there."""
        for tree in dict.fromkeys(self._trees.values()):
            for use in tree.uses:
                if use.subtree is not None:
                    for inner, outer in use.remapping.keys.items():
                        yield (tree, outer), (use.subtree, inner)


def _told_of(bound: BoundNode, told: list[Diagnostic]) -> Iterator[str]:
    element = bound.element
    for finding in told:
        if finding.source.path == element.source.path and finding.span.line >= element.line:
            for attribute in element.attributes:
                span = element.value_span(attribute)
                if span[:2] <= finding.span[:2] and finding.span[2:] <= span[2:]:
                    yield attribute
