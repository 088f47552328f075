"""What elements meant when they were bound before, for an editor's file, of which a keystroke changes next to nothing."""

from typing import Any, NamedTuple, TypeAlias
from weakref import WeakKeyDictionary

from sar_compiler.nodes.binding.bound import BoundNode
from sar_compiler.nodes.registry import Registry
from sar_compiler.tree.diagnostic import Source
from sar_compiler.tree.model import Element

_KEPT = 50_000
"""How many elements are kept, at least, of those that were asked for last; some 30 MB."""

_WrittenElement: TypeAlias = tuple[str, ...]


_Known: TypeAlias = tuple[Any, ...]
"""What an element means by what it says itself: the arguments of `BoundNode` behind the element."""


class KnownElements:
    """The elements of which binding had nothing to say, by what they say themselves: tag and attributes.

    What is between their tags is not part of it, nor are references, which depend on the tree around.
    """

    def __init__(self) -> None:
        self._recent: dict[_WrittenElement, _Known] = {}
        self._older: dict[_WrittenElement, _Known] = {}

    def get(self, element: Element) -> _Known | None:
        """Return what an element meant that said the same; None if there was none."""
        written = _written(element)
        known = self._recent.get(written)
        if known is None:
            known = self._older.get(written)
            if known is not None:
                self._keep(written, known)
        return known

    def keep(self, bound: BoundNode) -> None:
        """Keep what an element means, before its children and references are known."""
        known = (bound.spec, bound.name, bound.values, bound.keys, bound.conditions, bound.oneshot)
        self._keep(_written(bound.element), known)

    def _keep(self, written: _WrittenElement, known: _Known) -> None:
        if len(self._recent) >= _KEPT:
            self._recent, self._older = {}, self._recent
        self._recent[written] = known


def _written(element: Element) -> _WrittenElement:
    """Return what an element says: its names are as many as its values, so that no two say the same."""
    attributes = element.attributes
    return (element.tag, *attributes, *attributes.values())


class Validated(NamedTuple):
    """What a schema has said of a text.

    Attributes:
        source: The text.
        registry: What tags meant.
        schema: The schema, of lxml.
        errors: The lines, and what is wrong there.
    """

    source: Source
    registry: Registry
    schema: Any
    errors: list[tuple[int, str]]


class Memory:
    """What was found out about the files of a project, for the next check of them.

    Attributes:
        validated: What their schema has said of files that describe no nodes, by their paths.
    """

    def __init__(self) -> None:
        self.validated: dict[str, Validated] = {}
        self._elements: WeakKeyDictionary[Registry, KnownElements] = WeakKeyDictionary()

    def elements(self, registry: Registry) -> KnownElements:
        """Return the elements that were bound by a registry."""
        return self._elements.setdefault(registry, KnownElements())
