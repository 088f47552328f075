"""Drawings of a tree as Graphviz, Mermaid and SVG.

All formats are drawn from the same list of nodes. In an SVG picture, children are side by side below their parent if
there is enough space. Otherwise they are indented, one below the other, so that a large tree stays narrow. Lengths are
in pixels.
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

# The maximum number of characters of a label and of the details below it; the title contains the full texts.
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
        """The shape's colour on a light background."""
        return COLOURS[self.value if self.value in COLOURS else "leaf"].light


class DrawnNode(NamedTuple):
    """A node of a drawing. The strings of the node contain no control characters or line breaks.

    Attributes:
        parent: The parent's index in the pre-order list of nodes; -1 for the root.
        children: The indices of the children.
        end: The index after the last descendant.
        shape: The node's shape.
        sign: The sign of a control, decorator or unknown node; empty for a leaf.
        name: The node's name.
        details: The tag, if neither sign nor name shows it, and the attributes as written; may be empty.
        title: The location in the tree file, the tag, the name and the attributes.
        is_subtree: Whether the node is a `SubTree` whose content is drawn in a frame.
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
        """The sign and the name."""
        return f"{self.sign} {self.name}".lstrip()


def drawn_nodes(
    tree: Drawable, *, folded: bool = False, hidden: Collection[UUID] = frozenset()
) -> list[DrawnNode]:
    """Return the nodes to draw for a tree, in pre-order.

    Args:
        tree: The tree.
        folded: Whether a subtree is drawn as a single node, without its content.
        hidden: The IDs of nodes that are not drawn, and of all their descendants; ignored if *folded*.
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
        # An element with conditions or `oneshot` has wrapper nodes.
        is_wrapper = any(origins[child].bound is origin.bound for child in children)
        drawn.append(DrawnNode(parent, children, end, *_appearance(each.name, origin, is_wrapper=is_wrapper)))
    # A folded subtree has no frame.
    return [each._replace(is_subtree=False) for each in drawn] if folded else drawn


def _inside_subtrees(tree: Drawable) -> Iterator[Behaviour]:
    """Yield the nodes that are inside the subtrees of a tree."""
    for each in pre_order(tree.root):
        if tree.origins[each.id].bound.subtree is not None:
            yield from itertools.islice(pre_order(each), 1, None)


def _graph_lines(
    nodes: Sequence[DrawnNode], frame: str, line: Callable[[int, DrawnNode], str], end: str, edge: str
) -> Iterator[str]:
    """Yield the lines of a graph: the nodes in pre-order, the frames around subtrees, and the edges.

    Args:
        nodes: The nodes.
        frame: The line that begins a frame, with a placeholder for the number of the frame's first node.
        line: Returns the line of a node, given the node's number and the node.
        end: The line that ends a frame.
        edge: The line of an edge, with placeholders for the numbers of parent and child.
    """
    ends = Counter(node.end for node in nodes if node.is_subtree)
    for number, node in enumerate(nodes):
        yield from [end] * ends[number]
        if node.is_subtree:
            yield frame.format(number)
        yield line(number, node)
    yield from [end] * ends[len(nodes)]
    yield from (edge.format(node.parent, number) for number, node in enumerate(nodes) if node.parent >= 0)


def _appearance(name: str, origin: Origin, *, is_wrapper: bool) -> tuple[Shape, str, str, str, str, bool]:
    """Return the last six fields of a `DrawnNode`, starting with `shape`."""
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
    """Return the shape and the sign for a node's kind and semantics."""
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
    """Return the attributes of a node as written.

    Attributes that the drawing shows in another form are left out.
    """
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
    """Return a tree as a Graphviz digraph. Subtrees are clusters, or single nodes if *folded*."""
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
    # Graphviz replaces HTML entities in all strings.
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
# All characters with a special meaning in Mermaid, Markdown or HTML.
_SIGN = re.compile(r"[^\w ?/=\x80-\U0010ffff]|(?<!\w)[_=]|_(?!\w)")
# Characters that even as entities form markup with the next character (line breaks, formulas, icons). A zero-width
# space separates them.
_APART = "\\$:"
# The limits of sites that draw Mermaid, such as GitHub and GitLab. A page cannot raise these limits.
_MOST_EDGES, _LONGEST_CHART = 499, 50_000
_EDGE = " --> "


def mermaid(tree: Drawable, *, folded: bool = False) -> str:
    """Return a tree as a Mermaid flowchart. Subtrees are boxes, or single nodes if *folded*."""
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


# The font sizes of labels and details in a picture, and the width of a character as a fraction of the font size.
_LABEL, _DETAILS, _CELL = 13, 10.5, 0.605
_PADDING = 9
_INDENT, _TRUNK = 17, 9
# The distances between siblings, between a parent and a row of children, and between a parent and a single child.
_GAP, _LEVEL, _STEP = 8, 24, 14
# The distance between a subtree and its frame.
_FRAME = 7
_MARGIN = 10
# A picture may always be `_NARROW` wide: its text stays readable if a page shows it 400 pixels wide. A picture of a
# large tree may be wider, so that its ratio of height to width stays near `_TALL`.
_NARROW, _TALL = 560, 4


@dataclass
class Block:
    """The rectangle of a picture that contains a node and its descendants.

    Attributes:
        wide: The width of the node's own box.
        high: The height of the node's own box.
        frame: The distance of the box from the block's upper edge, and of the content from the other edges.
        least: The block's width if no siblings in it are side by side.
        beside: Whether the node's children are side by side.
        centred: Whether the box is above the middle of the children, instead of above their left edge.
        shift: The distance of the box from the block's left edge.
        width: The block's width.
        height: The block's height.
        x: The block's left edge, relative to the parent's block during the layout, finally to the picture.
        y: The block's upper edge, relative to the same origin as `x`.
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
        """The x position of the edges above and below the box. It has the same origin as `x`."""
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
    """Return a tree as an SVG picture.

    Args:
        tree: The tree.
        folded: Whether a subtree is drawn as a single node, without its content.
        hidden: The IDs of nodes that are not drawn, see `drawn_nodes`.
        is_styled: Whether the picture contains its stylesheet; not needed in a page that loads the stylesheet itself.
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
    """Return the stylesheet of pictures. It uses the names of colours that `sar_compiler.style` defines."""
    return files(__package__).joinpath("drawing.css").read_text("utf-8")


def _place_blocks(nodes: Sequence[DrawnNode]) -> list[Block]:
    blocks = [_block(node) for node in nodes]
    below = [[blocks[child] for child in node.children] for node in nodes]
    # Children follow their parents in the list.
    pairs = list(zip(blocks, below, strict=True))
    for block, children in reversed(pairs):
        indent = _INDENT if len(children) > 1 else 0
        block.least = max(block.wide, *(indent + child.least for child in children), 0) + 2 * block.frame
    _choose_layout(nodes, blocks)
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
    """Return the width of a text in character cells.

    A wide East Asian character has width 2, and an accent has width 0.
    """
    return sum(0 if combining(each) else 2 if east_asian_width(each) in "WF" else 1 for each in text)


def _choose_layout(nodes: Sequence[DrawnNode], blocks: Sequence[Block]) -> None:
    """Decide which children fit side by side, starting with the children of the root."""
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
            # The edges bend in the middle of the gap between the levels, regardless of the children's boxes.
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
    """Return the SVG path of a node's outline, such as an octagon for a selector."""
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


# The directions (1 or -1) of the x and y steps at the corners of a box, clockwise from the upper right corner.
_TURNS = ((1, 1), (-1, 1), (-1, -1), (1, -1))


def _text(text: str) -> str:
    return escape(speakable(text))
