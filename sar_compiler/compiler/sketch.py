"""Builds a tree that can be drawn from a parsed file, even if the file has errors.

A drawing shows py_trees behaviours with their origins in the file. A compiled tree contains both. A sketch contains
placeholders instead of behaviours. Subtrees that are missing or contain themselves are collapsed.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol
from uuid import UUID

from py_trees.behaviour import Behaviour
from py_trees.common import OneShotPolicy, ParallelPolicy, Status
from py_trees.composites import Parallel, Selector
from py_trees.composites import Sequence as SequenceNode
from py_trees.decorators import Decorator, OneShot

from sar_compiler.compiler import Origin
from sar_compiler.nodes.binding.attributes import KIND_TAGS
from sar_compiler.nodes.binding.bound import BoundNode, BoundTree
from sar_compiler.nodes.binding.nesting import MAX_LEVELS, MAX_NODES
from sar_compiler.nodes.semantics import Order
from sar_compiler.nodes.spec import Kind, NodeSpec, ParameterRole, Signature
from sar_compiler.runtime.language_nodes import Conditions
from sar_compiler.tree.diagnostic import Diagnostic
from sar_compiler.tree.model import SUBTREE_TAG, Element

_STOCK = "py_trees.composites."


class Drawable(Protocol):
    """An object that can be drawn: a compiled tree, or a `Sketch`."""

    @property
    def root(self) -> Behaviour:
        """The root behaviour."""

    @property
    def origins(self) -> Mapping[UUID, Origin]:
        """The origin of each behaviour, by behaviour ID."""

    @property
    def name(self) -> str:
        """The ID of the tree."""


@dataclass(frozen=True)
class Sketch:
    """A tree that can be drawn but not ticked, because placeholders replace its behaviours.

    Attributes:
        root: The root behaviour.
        origins: The origin of each behaviour, by its id.
        name: The ID of the tree.
        findings: The findings that prevent the compilation of the tree.
    """

    root: Behaviour
    origins: Mapping[UUID, Origin]
    name: str
    findings: tuple[Diagnostic, ...] = ()


class SketchedNode(Behaviour):
    """A placeholder for a node that no py_trees composite can represent.

    It can have any number of children.

    Attributes:
        class_name: The import path of the node's class; None if the node has no class.
    """

    def __init__(self, name: str, class_name: str | None = None) -> None:
        Behaviour.__init__(self, name)
        self.class_name = class_name

    def tip(self) -> None:
        """Return None, because a sketch is never ticked."""

    def update(self) -> Status:
        """Return INVALID, because a sketch is never ticked."""
        return Status.INVALID


class SketchedDecorator(SketchedNode, Decorator):
    """A placeholder for a decorator."""


class UnknownSpec(NodeSpec):
    """The spec of an unknown tag."""


def is_unknown(bound: BoundNode) -> bool:
    """Return whether a node's tag is unknown, which includes a tag that is only similar to a known tag."""
    return isinstance(bound.spec, UnknownSpec)


def class_of(behaviour: Behaviour) -> str | None:
    """Return the import path of the class of a behaviour or placeholder, or None if the node has no class."""
    return behaviour.class_name if isinstance(behaviour, SketchedNode) else _path_of(type(behaviour))


def _path_of(cls: type) -> str:
    return f"{cls.__module__}.{cls.__qualname__}"


def sketch_tree(tree: BoundTree, others: Iterable[BoundTree]) -> Sketch:
    """Return a sketch of a tree, in which the subtrees are expanded.

    Args:
        tree: The tree.
        others: All trees that were bound together with it.
    """
    known = {id(bound.element): bound for each in (tree, *others) for bound in each.nodes}
    return _SketchBuilder(known).sketch(tree)


class _SketchBuilder:
    def __init__(self, known: Mapping[int, BoundNode]) -> None:
        self._known = known
        self._origins: dict[UUID, Origin] = {}
        self._count = 0

    def sketch(self, tree: BoundTree) -> Sketch:
        # Each waiting element has its parent behaviour, its level, and the enclosing trees.
        top = SketchedNode(tree.name)
        waiting: list[tuple[Element, Behaviour, int, frozenset[int]]] = []
        self._add_children(tree.element.children or [tree.element], top, 1, frozenset({id(tree)}), waiting)
        while waiting:
            element, above, level, around = waiting.pop()
            bound = self._known.get(id(element))
            if bound is None or not _is_as_written(bound):
                bound = _unknown(element)
            behaviour = self._with_wrappers(bound, above)
            inner = bound.subtree
            if inner is not None and self._fits(inner, level, around):
                self._add_children(
                    inner.element.children, behaviour, level + 1, around | {id(inner)}, waiting
                )
            elif inner is None and element.tag != SUBTREE_TAG and element is not tree.element:
                self._add_children(element.children, behaviour, level + 1, around, waiting)
        root = top.children[0] if len(top.children) == 1 else top
        if root is top:
            self._origins[top.id] = Origin(_unknown(tree.element), {})
        else:
            root.parent = None
        return Sketch(root, self._origins, tree.name)

    @staticmethod
    def _add_children(
        elements: Sequence[Element],
        above: Behaviour,
        level: int,
        around: frozenset[int],
        waiting: list[tuple[Element, Behaviour, int, frozenset[int]]],
    ) -> None:
        waiting.extend((each, above, level, around) for each in reversed(elements))

    def _fits(self, tree: BoundTree, level: int, around: frozenset[int]) -> bool:
        """Return whether a subtree can be expanded because it is not recursive, too deep or too large."""
        is_deep = level + tree.nesting + tree.wrappers > MAX_LEVELS
        return not is_deep and id(tree) not in around and self._count + len(tree.nodes) <= MAX_NODES

    def _with_wrappers(self, bound: BoundNode, above: Behaviour) -> Behaviour:
        """Add a placeholder for a node to a parent, inside placeholders for its conditions and its OneShot."""
        self._count += 1
        if bound.oneshot is not None:
            policy = {"policy": OneShotPolicy[bound.oneshot]}
            above = self._wrapper(bound, OneShot, policy, above)
        if bound.conditions:
            scripts = {name: script.text for name, script in bound.conditions.items()}
            above = self._wrapper(bound, Conditions, scripts, above)
        return self._attach(above, _stand_in(bound), Origin(bound, dict(_attributes(bound))))

    def _wrapper(
        self, bound: BoundNode, cls: type, attributes: Mapping[str, object], above: Behaviour
    ) -> Behaviour:
        stand_in = SketchedDecorator(f"{bound.name}{cls.__name__}", _path_of(cls))
        return self._attach(above, stand_in, Origin(bound, attributes))

    def _attach(self, above: Behaviour, behaviour: Behaviour, origin: Origin) -> Behaviour:
        above.children.append(behaviour)
        behaviour.parent = above
        self._origins[behaviour.id] = origin
        return behaviour


def _is_as_written(bound: BoundNode) -> bool:
    """Return whether the tag of an element is identical, not only similar, to the tag of the bound node."""
    return bound.element.tag == SUBTREE_TAG or _tag(bound.element) == bound.spec.tag


def _unknown(element: Element) -> BoundNode:
    tag = _tag(element)
    spec = UnknownSpec(tag, None, Kind.ACTION, signature=Signature(described={}))
    return BoundNode(element, spec, element.attributes.get("name") or tag)


def _tag(element: Element) -> str:
    """Return the tag of a node. In explicit form (`<Action ID="..."/>`), this is the attribute `ID`."""
    return element.attributes.get("ID", element.tag) if element.tag in KIND_TAGS else element.tag


def _stand_in(bound: BoundNode) -> Behaviour:
    spec, name = bound.spec, bound.name
    path = spec.class_path.replace(":", ".")
    if spec.kind is Kind.DECORATOR:
        return SketchedDecorator(name, path or None)
    if spec.kind.is_leaf or (path and not path.startswith(_STOCK)):
        return SketchedNode(name, path or None)
    if spec.semantics.order is Order.TOGETHER:
        return Parallel(name, ParallelPolicy.SuccessOnAll())
    of_stock = Selector if spec.semantics.is_selector else SequenceNode
    return of_stock(name, memory=not bound.is_reactive)


def _attributes(bound: BoundNode) -> Iterator[tuple[str, object]]:
    """Yield the attributes of a node, each with the parsed value if possible, otherwise with the text."""
    written = bound.element.attributes
    if is_unknown(bound):
        yield from ((name, text) for name, text in written.items() if name not in ("name", "ID"))
        return
    for name, parameter in bound.spec.parameters.items():
        if parameter.role is ParameterRole.ATTRIBUTE:
            if name in bound.keys:
                yield name, f"{{{bound.keys[name]}}}"
            elif name in bound.values or name in written:
                yield name, bound.values.get(name, written.get(name))
            elif parameter.direction is None:
                yield name, bound.spec.implied_values.get(name, parameter.default)
    yield from ((name, target.name) for name, target in bound.references.items())
