"""What elements meant when they were bound before, for an editor's file, of which a keystroke changes next to nothing."""

from typing import Any, NamedTuple, TypeAlias
from weakref import WeakKeyDictionary

from sar_compiler.nodes.binding.bound import BoundNode
from sar_compiler.nodes.registry import Registry
from sar_compiler.nodes.spec import NodeSpec
from sar_compiler.tree.diagnostic import Source
from sar_compiler.tree.model import Element

_KEPT = 50_000
"""How many elements are kept, at least, of those that were asked for last; some 30 MB."""

_WrittenElement: TypeAlias = tuple[str, ...]
_ElementMeaning: TypeAlias = tuple[NodeSpec, str, Any, Any, Any, str | None]


class KnownElements:
    """The elements of which binding had nothing to say, by what they say themselves: tag and attributes.

    What is between their tags is not part of it, nor are references, which depend on the tree around.
    """

    def __init__(self) -> None:
        self._recent: dict[_WrittenElement, _ElementMeaning] = {}
        self._older: dict[_WrittenElement, _ElementMeaning] = {}

    def again(self, element: Element) -> BoundNode | None:
        """Return an element, bound as the one before that says the same; None if there was none."""
        attributes = element.attributes
        # As many names as values: no two elements have the same.
        key = (element.tag, *attributes, *attributes.values())
        meaning = self._recent.get(key)
        if meaning is None:
            meaning = self._older.get(key)
            if meaning is None:
                return None
            self._keep(key, meaning)
        bound = BoundNode(element, meaning[0], meaning[1])
        _, _, bound.values, bound.keys, bound.conditions, bound.oneshot = meaning
        return bound

    def keep(self, bound: BoundNode) -> None:
        """Keep what an element means, before its children and references are known."""
        attributes = bound.element.attributes
        key = (bound.element.tag, *attributes, *attributes.values())
        self._keep(key, (bound.spec, bound.name, bound.values, bound.keys, bound.conditions, bound.oneshot))

    def _keep(self, key: _WrittenElement, meaning: _ElementMeaning) -> None:
        if len(self._recent) >= _KEPT:
            self._recent, self._older = {}, self._recent
        self._recent[key] = meaning


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
