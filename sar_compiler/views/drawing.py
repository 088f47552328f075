"""A compiled tree as what a drawing has of it: one list of nodes, which all formats share."""

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from enum import Enum
from typing import NamedTuple

from sar_compiler.compiler import CompiledTree, Origin
from sar_compiler.nodes.binding.bound import BoundNode
from sar_compiler.nodes.semantics import Order
from sar_compiler.nodes.spec import Kind
from sar_compiler.runtime.walking import pre_order
from sar_compiler.tree.showing import in_one_line, shortened
from sar_compiler.views.plain import plain

# Characters of a label and of the line below it; a title has the whole of them.
_LONGEST = 40


class Shape(Enum):
    """The shape of a node in a drawing; each format has a colour for it, after py_trees' drawings."""

    SEQUENCE = "sequence"
    SELECTOR = "selector"
    PARALLEL = "parallel"
    CONTROL = "control"
    DECORATOR = "decorator"
    CONDITION = "condition"
    ACTION = "action"


class DrawnNode(NamedTuple):
    """A node of a drawing; no text of it has control characters or line breaks.

    Attributes:
        parent: The place of its parent in the list; -1 for the root.
        children: The places of its children.
        end: The place after the last node below it: the list is in pre-order.
        shape: Its shape.
        sign: The sign of what it does with its children; empty for a leaf.
        name: Its name.
        details: Its tag, where neither sign nor name says it, and its attributes as written; may be empty.
        title: The place in the file, and everything that is written there.
        is_subtree: Whether it is the top of a subtree.
    """

    parent: int
    children: tuple[int, ...]
    end: int
    shape: Shape
    sign: str
    name: str
    details: str
    title: str
    is_subtree: bool

    @property
    def label(self) -> str:
        """Its name, after its sign."""
        return f"{self.sign} {self.name}".lstrip()


def drawn_nodes(tree: CompiledTree) -> list[DrawnNode]:
    """Return the nodes of a compiled tree for a drawing, in pre-order."""
    behaviours = list(pre_order(tree.root))
    place = {each.id: number for number, each in enumerate(behaviours)}
    below = [tuple(place[child.id] for child in each.children) for each in behaviours]
    parents, ends = [-1] * len(below), [*range(1, len(below) + 1)]
    for number in reversed(range(len(below))):
        for child in below[number]:
            parents[child], ends[number] = number, ends[child]
    origins = [tree.origins[each.id] for each in behaviours]
    drawn = []
    for each, origin, parent, children, end in zip(behaviours, origins, parents, below, ends, strict=True):
        # What conditions and `oneshot` put around a node was made from the same element.
        is_wrapper = any(origins[child].bound is origin.bound for child in children)
        drawn.append(DrawnNode(parent, children, end, *_looks(each.name, origin, is_wrapper=is_wrapper)))
    return drawn


def graph_lines(
    nodes: Sequence[DrawnNode], frame: str, line: Callable[[int, DrawnNode], str], end: str, edge: str
) -> Iterator[str]:
    """Yield the lines of a graph: nodes in pre-order, frames around subtrees, then the edges.

    Args:
        nodes: The nodes.
        frame: What begins a frame, with a place for the number of its first node.
        line: Returns the line of a node and its number.
        end: What ends a frame.
        edge: An edge, with places for the numbers of parent and child.
    """
    ends = Counter(node.end for node in nodes if node.is_subtree)
    for number, node in enumerate(nodes):
        yield from [end] * ends[number]
        if node.is_subtree:
            yield frame.format(number)
        yield line(number, node)
    yield from [end] * ends[len(nodes)]
    yield from (edge.format(node.parent, number) for number, node in enumerate(nodes) if node.parent >= 0)


def _looks(name: str, origin: Origin, *, is_wrapper: bool) -> tuple[Shape, str, str, str, str, bool]:
    """Return what a drawn node is from its shape on."""
    bound = origin.bound
    tag, element = bound.spec.tag, bound.element
    shape, sign = (Shape.DECORATOR, _OTHER) if is_wrapper else _shape_and_sign(bound)
    written = origin.attributes if is_wrapper else _attributes(bound)
    attributes = " ".join(f"{key}={_value(plain(value))}" for key, value in written.items())
    says_tag = is_wrapper or bound.subtree is not None or bound.spec.semantics.with_memory
    details = attributes if says_tag or name in (tag, f"{tag}?") else f"{tag} {attributes}"
    title = f"{element.source.path}:{element.line} <{tag}> {name} {attributes}"
    return (
        shape,
        sign,
        _cut(name),
        _cut(details),
        in_one_line(shortened(title.rstrip())),
        bound.subtree is not None and not is_wrapper,
    )


_OTHER = "◇"
"""The sign of a decorator that has no other."""


def _shape_and_sign(bound: BoundNode) -> tuple[Shape, str]:
    """Return what a node is drawn as, by its meaning."""
    semantics, kind = bound.spec.semantics, bound.spec.kind
    if kind.is_leaf:
        return (Shape.CONDITION if kind is Kind.CONDITION else Shape.ACTION), ""
    if kind is Kind.DECORATOR:
        sign = "▣" if bound.subtree is not None else "↻" if semantics.repeats else _OTHER
        return Shape.DECORATOR, sign
    if semantics.order is Order.TOGETHER:
        return Shape.PARALLEL, "⇉"
    if semantics.is_sequence:
        return Shape.SEQUENCE, "→R" if bound.is_reactive else "→"
    if semantics.is_selector:
        return Shape.SELECTOR, "?R" if bound.is_reactive else "?"
    return Shape.CONTROL, "◆"


def _attributes(bound: BoundNode) -> dict[str, str]:
    """Return the attributes of a node as they are written, without what the drawing shows anyway."""
    attributes = bound.element.attributes
    shown = {"name", "oneshot", *bound.conditions}
    if bound.spec.semantics.with_memory:
        shown.add("memory")
    if bound.subtree is None or attributes.get("ID") == bound.name:
        shown.add("ID")
    return {key: value for key, value in attributes.items() if key not in shown}


def _value(value: object) -> str:
    text = str(value)
    return text if text and " " not in text else f"'{text}'"


def _cut(text: str) -> str:
    text = in_one_line(text).rstrip()
    return text if len(text) <= _LONGEST else f"{text[: _LONGEST - 1]}…"
