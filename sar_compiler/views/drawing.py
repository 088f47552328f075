"""Drawings of a tree as Graphviz, Mermaid and SVG.

All formats share one list of nodes. In the picture, children are side by side below their parent if there is room, else
one below the other, indented: a small tree looks as in a book, and a wide one stays narrow. Lengths are in pixels.
"""

import itertools
import math
import re
from collections import Counter
from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass
from enum import Enum
from importlib.resources import files
from typing import NamedTuple
from unicodedata import combining, east_asian_width
from uuid import UUID
from xml.sax.saxutils import escape

from py_trees.behaviour import Behaviour

from sar_compiler.compiler import Origin
from sar_compiler.compiler.sketch import Drawable, is_unknown
from sar_compiler.nodes.binding.bound import BoundNode
from sar_compiler.nodes.semantics import Order
from sar_compiler.nodes.spec import Kind
from sar_compiler.runtime.walking import pre_order
from sar_compiler.style import COLOURS, DECORATORS, literal
from sar_compiler.tree.display_text import escape_to_one_line, shorten
from sar_compiler.tree.model import SUBTREE_TAG
from sar_compiler.tree.plain import speakable, to_json_value

# Maximum number of characters of a label and of the line below it; a title has the full texts.
_LONGEST = 40


class Shape(Enum):
    """The shape of a node in a drawing."""

    SEQUENCE = "sequence"
    SELECTOR = "selector"
    PARALLEL = "parallel"
    CONTROL = "control"
    DECORATOR = "decorator"
    CONDITION = "condition"
    ACTION = "action"
    UNKNOWN = "unknown"

    @property
    def colour(self) -> str:
        """Its colour, on light ground."""
        return COLOURS[self.value if self.value in COLOURS else "leaf"].light


class DrawnNode(NamedTuple):
    """A node of a drawing; no text of it has control characters or line breaks.

    Attributes:
        parent: The index of its parent in the list; -1 for the root.
        children: The indices of its children.
        end: The index after its last descendant: the list is in pre-order.
        shape: Its shape.
        sign: The sign of its control or decorator; empty for a leaf.
        name: Its name.
        details: Its tag, if neither sign nor name shows it, and its attributes as written; may be empty.
        title: The location in the file, and all texts of the node.
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


def drawn_nodes(
    tree: Drawable, *, folded: bool = False, hidden: Collection[UUID] = frozenset()
) -> list[DrawnNode]:
    """Return the nodes of a tree for a drawing, in pre-order.

    Args:
        tree: The tree.
        folded: Whether a subtree is one node, without its content.
        hidden: The IDs of nodes that are not drawn, with all of their descendants.
    """
    inside = {each.id for each in _inside_subtrees(tree)} if folded else hidden
    behaviours = [each for each in pre_order(tree.root) if each.id not in inside]
    place = {each.id: number for number, each in enumerate(behaviours)}
    below = [tuple(place[child.id] for child in each.children if child.id in place) for each in behaviours]
    parents, ends = [-1] * len(below), [*range(1, len(below) + 1)]
    for number in reversed(range(len(below))):
        for child in below[number]:
            parents[child], ends[number] = number, ends[child]
    origins = [tree.origins[each.id] for each in behaviours]
    drawn = []
    for each, origin, parent, children, end in zip(behaviours, origins, parents, below, ends, strict=True):
        # Conditions and `oneshot` of an element put nodes around its own.
        is_wrapper = any(origins[child].bound is origin.bound for child in children)
        drawn.append(DrawnNode(parent, children, end, *_looks(each.name, origin, is_wrapper=is_wrapper)))
    # A subtree with a frame is unfolded.
    return [each._replace(is_subtree=False) for each in drawn] if folded else drawn


def _inside_subtrees(tree: Drawable) -> Iterator[Behaviour]:
    """Yield the nodes in a subtree of the shown tree."""
    for each in pre_order(tree.root):
        if tree.origins[each.id].bound.subtree is not None:
            yield from itertools.islice(pre_order(each), 1, None)


def _graph_lines(
    nodes: Sequence[DrawnNode], frame: str, line: Callable[[int, DrawnNode], str], end: str, edge: str
) -> Iterator[str]:
    """Yield the lines of a graph: nodes in pre-order, frames around subtrees, then the edges.

    Args:
        nodes: The nodes.
        frame: The beginning of a frame, with a placeholder for the number of its first node.
        line: Returns the line of a node and its number.
        end: The end of a frame.
        edge: An edge, with placeholders for the numbers of parent and child.
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
    """Return the appearance of a drawn node."""
    bound = origin.bound
    tag, element = bound.spec.tag, bound.element
    if is_wrapper:
        shape, sign = Shape.DECORATOR, _OTHER
    else:
        shape, sign = (Shape.UNKNOWN, "?") if is_unknown(bound) else _shape_and_sign(bound)
    written = origin.attributes if is_wrapper else _attributes(bound)
    attributes = " ".join(f"{key}={_value(to_json_value(value))}" for key, value in written.items())
    says_tag = is_wrapper or bound.element.tag == SUBTREE_TAG or bound.spec.semantics.with_memory
    details = attributes if says_tag or name in (tag, f"{tag}?") else f"{tag} {attributes}"
    title = f"{element.file_and_line} <{tag}> {name} {attributes}"
    return (
        shape,
        sign,
        _cut(name),
        _cut(details),
        escape_to_one_line(shorten(title.rstrip())),
        bound.subtree is not None and not is_wrapper,
    )


_REPEATS, _SUBTREE, _OTHER = DECORATORS


def _shape_and_sign(bound: BoundNode) -> tuple[Shape, str]:
    """Return the shape of a node by its meaning."""
    semantics, kind = bound.spec.semantics, bound.spec.kind
    if kind.is_leaf:
        return (Shape.CONDITION if kind is Kind.CONDITION else Shape.ACTION), ""
    if kind is Kind.DECORATOR:
        sign = _SUBTREE if bound.element.tag == SUBTREE_TAG else _REPEATS if semantics.repeats else _OTHER
        return Shape.DECORATOR, sign
    if semantics.order is Order.TOGETHER:
        return Shape.PARALLEL, "⇉"
    if semantics.is_sequence:
        return Shape.SEQUENCE, "→R" if bound.is_reactive else "→"
    if semantics.is_selector:
        return Shape.SELECTOR, "?R" if bound.is_reactive else "?"
    return Shape.CONTROL, "◆"


def _attributes(bound: BoundNode) -> dict[str, str]:
    """Return the attributes of a node as written, except for those that the drawing shows."""
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
    text = escape_to_one_line(text).rstrip()
    return text if len(text) <= _LONGEST else f"{text[: _LONGEST - 1]}…"


# The colours of py_trees' own drawings.
_DOT_SHAPES = {
    Shape.SEQUENCE: "box",
    Shape.SELECTOR: "octagon",
    Shape.PARALLEL: "parallelogram",
    Shape.CONTROL: "hexagon",
    Shape.DECORATOR: "ellipse",
    Shape.CONDITION: "ellipse",
    Shape.ACTION: "ellipse",
    Shape.UNKNOWN: "box",
}


def dot(tree: Drawable, *, folded: bool = False) -> str:
    """Return a tree as a digraph; subtrees are clusters, or single nodes if they are folded."""
    lines = [
        f"digraph {_quote(escape_to_one_line(tree.name))} {{",
        "  ordering=out;",
        '  graph [fontname="sans-serif", style=dashed];',
        '  node [fontname="sans-serif", fontsize=9, style=filled];',
        *_graph_lines(
            drawn_nodes(tree, folded=folded), "  subgraph cluster_{} {{", _dot_node, "  }", "  n{} -> n{};"
        ),
        "}",
    ]
    return "".join(f"{line}\n" for line in lines)


def _dot_node(number: int, node: DrawnNode) -> str:
    label = "\\n".join(map(_dot_text, filter(None, (node.label, node.details))))
    return f'  n{number} [label="{label}", shape={_DOT_SHAPES[node.shape]}, fillcolor="{node.shape.colour}", tooltip={_quote(node.title)}];'


def _quote(text: str) -> str:
    return f'"{_dot_text(text)}"'


def _dot_text(text: str) -> str:
    # Graphviz reads entities of HTML everywhere.
    return text.replace("&", "&amp;").replace("\\", "\\\\").replace('"', '\\"')


# The text before and after a label.
_BRACKETS = {
    Shape.SEQUENCE: ("[", "]"),
    Shape.SELECTOR: ("{{", "}}"),
    Shape.PARALLEL: ("[/", "/]"),
    Shape.CONTROL: ("[[", "]]"),
    Shape.DECORATOR: ("([", "])"),
    Shape.CONDITION: ("(", ")"),
    Shape.ACTION: ("[", "]"),
    Shape.UNKNOWN: ("[", "]"),
}
_ON_SHAPES = f"stroke:{COLOURS['halted'].light},color:{COLOURS['text'].light}"
# All characters with a meaning in Mermaid, Markdown or HTML.
_SIGN = re.compile(r"[^\w ?/=\x80-\U0010ffff]|(?<!\w)[_=]|_(?!\w)")
# Characters with a meaning together with the next one even as entities (line breaks, formulas, icons): an invisible one
# separates them.
_APART = "\\$:"
# The limits of pages that draw Mermaid, such as GitHub and GitLab, which a page cannot raise.
_MOST_EDGES, _LONGEST_CHART = 499, 50_000
_EDGE = " --> "


def mermaid(tree: Drawable, *, folded: bool = False) -> str:
    """Return a tree as a flowchart from top to bottom; subtrees are boxes, or single nodes if they are folded."""
    nodes = drawn_nodes(tree, folded=folded)
    shapes = sorted({node.shape for node in nodes}, key=list(Shape).index)
    lines = [
        "flowchart TD",
        *_graph_lines(nodes, '  subgraph s{}[" "]', _mermaid_node, "  end", f"  n{{}}{_EDGE}n{{}}"),
        *(f"  classDef {each.value} fill:{each.colour},{_ON_SHAPES}" for each in shapes),
    ]
    return "".join(f"{line}\n" for line in lines)


def too_large(flowchart: str) -> bool:
    """Return whether a flowchart exceeds the limits of GitHub and GitLab."""
    return len(flowchart) > _LONGEST_CHART or flowchart.count(_EDGE) > _MOST_EDGES


def _mermaid_node(number: int, node: DrawnNode) -> str:
    before, behind = _BRACKETS[node.shape]
    label = "<br>".join(_SIGN.sub(_entity, text) for text in (node.label, node.details) if text)
    return f'  n{number}{before}"{label}"{behind}:::{node.shape.value}'


def _entity(match: re.Match[str]) -> str:
    return f"#{ord(match[0])};{'#8203;' if match[0] in _APART else ''}"


# Of a picture: the sizes of the fonts, and the width of a character in them, as a part of these.
_LABEL, _DETAILS, _CELL = 13, 10.5, 0.605
_PADDING = 9
_INDENT, _TRUNK = 17, 9
# Distances between neighbours side by side or in a column, and between a parent and a row of children, or a single child.
_GAP, _LEVEL, _STEP = 8, 24, 14
# Between a subtree and the line around it.
_FRAME = 7
_MARGIN = 10
# Every picture may be this wide: at 400 pixels its text is still readable. A larger one may be wider, to limit its
# ratio of height to width.
_NARROW, _TALL = 560, 4


@dataclass
class Block:
    """A node with its descendants, as a rectangle.

    Attributes:
        wide: The width of the node's own box.
        high: The height of the node's own box.
        frame: The distance of the box from the block's upper edge, and of the content from the other edges.
        least: The width if no children in it are side by side.
        beside: Whether its children are side by side.
        centred: Whether boxes are above the middle of their children, not above their left edge.
        shift: The distance of the box from the block's left edge.
        width: Its width.
        height: Its height.
        x: Its left edge: in the block around it, finally in the picture.
        y: Its upper edge, in the same way.
    """

    wide: float
    high: float
    frame: float
    least: float = 0.0
    beside: bool = False
    centred: bool = True
    shift: float = 0.0
    width: float = 0.0
    height: float = 0.0
    x: float = 0.0
    y: float = 0.0

    @property
    def anchor(self) -> float:
        """The x position of lines at the box above and below, measured like `x`."""
        return self.x + self.shift + (self.wide / 2 if self.centred else _TRUNK)

    @property
    def top(self) -> float:
        """The upper edge of the box."""
        return self.y + self.frame

    @property
    def bottom(self) -> float:
        """The lower edge of the box."""
        return self.top + self.high


def svg(
    tree: Drawable, *, folded: bool = False, hidden: Collection[UUID] = frozenset(), is_styled: bool = True
) -> str:
    """Return a tree as a picture.

    Args:
        tree: The tree.
        folded: Whether a subtree is one node, without its content.
        hidden: As for `drawn_nodes`.
        is_styled: Whether the picture contains its style; a page that has it as a file needs none.
    """
    nodes = drawn_nodes(tree, folded=folded, hidden=hidden)
    blocks = _place_blocks(nodes)
    width, height = (math.ceil(size + 2 * _MARGIN) for size in (blocks[0].width, blocks[0].height))
    size = f'width="{width}" height="{height}"'
    title = f"{escape_to_one_line(tree.name)}, {len(nodes)} {'node' if len(nodes) == 1 else 'nodes'}"
    lines = [
        f'<svg xmlns="http://www.w3.org/2000/svg" {size} viewBox="0 0 {width} {height}" role="img">',
        f"<title>{_text(title)}</title>",
        *([f"<style>\n{literal(drawing_style())}</style>"] if is_styled else []),
        f'<rect class="ground" {size}/>',
        *(_frame(block) for block in blocks if block.frame),
        f'<path class="line" d="{"".join(_connections(nodes, blocks))}"/>',
        *(_node(node, block) for node, block in zip(nodes, blocks, strict=True)),
        "</svg>",
    ]
    return "".join(f"{line}\n" for line in lines)


def drawing_style() -> str:
    """Return the style of pictures, with the names of colours that `style` defines."""
    return files(__package__).joinpath("drawing.css").read_text("utf-8")


def _place_blocks(nodes: Sequence[DrawnNode]) -> list[Block]:
    blocks = [_block(node) for node in nodes]
    below = [[blocks[child] for child in node.children] for node in nodes]
    # Children follow their parents in the list.
    pairs = list(zip(blocks, below, strict=True))
    for block, children in reversed(pairs):
        indent = _INDENT if len(children) > 1 else 0
        block.least = max(block.wide, *(indent + child.least for child in children), 0) + 2 * block.frame
    _choose(nodes, blocks)
    for block, children in reversed(pairs):
        _measure(block, children)
    blocks[0].x = blocks[0].y = _MARGIN
    for block, children in pairs:
        for child in children:
            child.x += block.x
            child.y += block.y
    return blocks


def _block(node: DrawnNode) -> Block:
    width = max(_cells(node.label) * _LABEL, _cells(node.details) * _DETAILS) * _CELL
    return Block(width + 2 * _PADDING, 37 if node.details else 24, _FRAME if node.is_subtree else 0)


def _cells(text: str) -> int:
    """Return the width of a text in characters; East Asian ones have width 2, accents 0."""
    return sum(0 if combining(each) else 2 if east_asian_width(each) in "WF" else 1 for each in text)


def _choose(nodes: Sequence[DrawnNode], blocks: Sequence[Block]) -> None:
    """Decide, from the root down, which children fit side by side."""
    area = blocks[0].least * sum(block.high + _GAP for block in blocks)
    room = [max(_NARROW, blocks[0].least, math.sqrt(area / _TALL))] * len(nodes)
    for number, (node, block) in enumerate(zip(nodes, blocks, strict=True)):
        inside, children = room[number] - 2 * block.frame, node.children
        spare = inside - sum(blocks[child].least + _GAP for child in children) + _GAP
        block.beside = len(children) == 1 or spare >= 0
        for child in children:
            blocks[child].centred = block.centred and block.beside
            part = spare * (nodes[child].end - child) / (node.end - number - 1)
            room[child] = blocks[child].least + part if block.beside else inside - _INDENT


def _measure(block: Block, children: Sequence[Block]) -> None:
    """Set the size of a block, and the positions of its children."""
    block.shift = x = block.frame
    y = block.bottom + (_GAP if not block.beside else _LEVEL if len(children) > 1 else _STEP)
    for child in children:
        child.x, child.y = (x, y) if block.beside else (x + _INDENT, y)
        x, y = (x + child.width + _GAP, y) if block.beside else (x, y + child.height + _GAP)
    if block.centred and block.beside and children:
        left = (children[0].anchor + children[-1].anchor - block.wide) / 2
        block.shift = max(block.frame, left)
        for child in children:
            child.x += block.shift - left
    block.width = (
        max([block.shift + block.wide, *(child.x + child.width for child in children)]) + block.frame
    )
    block.height = max([block.bottom, *(child.y + child.height for child in children)]) + block.frame


def _frame(block: Block) -> str:
    size = f'width="{block.width - 2:.0f}" height="{block.height - 2:.0f}"'
    return f'<rect class="frame" x="{block.x + 1:.0f}" y="{block.y + 1:.0f}" {size} rx="6"/>'


def _connections(nodes: Sequence[DrawnNode], blocks: Sequence[Block]) -> Iterator[str]:
    for node, block in zip(nodes, blocks, strict=True):
        children = [blocks[child] for child in node.children]
        if not children:
            continue
        if block.beside:
            # In the middle of the gap, regardless of the children's boxes.
            bend = (block.bottom + children[0].y) / 2
            yield f"M{block.anchor:.0f} {block.bottom:.0f}V{bend:.0f}"
            for child in children:
                yield f"M{block.anchor:.0f} {bend:.0f}H{child.anchor:.0f}V{child.top:.0f}"
        else:
            trunk = block.x + block.shift + _TRUNK
            middles = [child.top + child.high / 2 for child in children]
            yield f"M{trunk:.0f} {block.bottom:.0f}V{middles[-1]:.0f}"
            for child, middle in zip(children, middles, strict=True):
                yield f"M{trunk:.0f} {middle:.0f}H{child.x + child.shift:.0f}"


def _node(node: DrawnNode, block: Block) -> str:
    x, y, middle = block.x + block.shift, block.top, block.x + block.shift + block.wide / 2
    texts = [f'<text x="{middle:.0f}" y="{y + 16.5:g}">{_text(node.label)}</text>']
    if node.details:
        texts.append(f'<text class="details" x="{middle:.0f}" y="{y + 30.5:g}">{_text(node.details)}</text>')
    outline = _outline(node.shape, round(x), round(y), round(block.wide), round(block.high))
    title = f"<title>{_text(node.title)}</title>"
    dashes, shape = (
        (' stroke-dasharray="3 2"', "action unknown")
        if node.shape is Shape.UNKNOWN
        else ("", node.shape.value)
    )
    return f'<g class="node {shape}">{title}<path d="{outline}"{dashes}/>{"".join(texts)}</g>'


def _outline(shape: Shape, x: int, y: int, wide: int, high: int) -> str:
    """Return the outline of a node: octagons for selectors, as in py_trees, and rounded ends for conditions."""
    if shape is Shape.PARALLEL:
        return f"M{x} {y}h{wide}l-6 {high}h{-wide}z"
    if shape is Shape.DECORATOR:
        return (
            f"M{x} {y + high / 2:g}l6 {-high / 2:g}h{wide - 12}l6 {high / 2:g}l-6 {high / 2:g}h{12 - wide}z"
        )
    corner = {Shape.SELECTOR: 7, Shape.ACTION: 3, Shape.CONDITION: 12}.get(shape, 0)
    turn = "l" if shape is Shape.SELECTOR else f"a{corner} {corner} 0 0 1 "
    h, v = wide - 2 * corner, high - 2 * corner
    if not corner:
        return f"M{x} {y}h{wide}v{high}h{-wide}z"
    one, two, three, four = (f"{turn}{right * corner} {down * corner}" for right, down in _TURNS)
    return f"M{x + corner} {y}h{h}{one}v{v}{two}h{-h}{three}v{-v}{four}z"


# Right and down, for the corners of a box, clockwise from the upper right one.
_TURNS = ((1, 1), (-1, 1), (-1, -1), (1, -1))


def _text(text: str) -> str:
    return escape(speakable(text))
