"""A compiled tree as a picture: SVG that needs nothing else, in light and in dark.

Children stand side by side below their parent where there is room, else one below the other, indented: a small tree looks as in a book, and
a wide one stays narrow. Lengths are in pixels.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from unicodedata import combining, east_asian_width
from xml.sax.saxutils import escape

from sar_compiler.compiler import CompiledTree
from sar_compiler.tree.showing import in_one_line
from sar_compiler.views.drawing import DrawnNode, Shape, drawn_nodes
from sar_compiler.views.plain import speakable

# The sizes of the fonts, and the width of a character in them, as a part of these.
_LABEL, _DETAILS, _CELL = 13, 10.5, 0.605
_PADDING = 9
_INDENT, _TRUNK = 17, 9
# Between what stands beside or below each other; between a parent and a row of children, or a single one.
_GAP, _LEVEL, _STEP = 8, 24, 14
# Between a subtree and the line around it.
_FRAME = 7
_MARGIN = 10
# Every picture may be as wide as this: at 400 pixels its text can still be read. A larger one may be wider, so that it does not
# become much more than so many times as high as wide.
_NARROW, _TALL = 560, 4

_STYLE = """\
.ground{fill:#fff}.line,.frame{fill:none;stroke:#8a8f98}.frame{stroke-dasharray:4 3}
.node path{stroke:#5b6068}
text{font:13px ui-monospace,"DejaVu Sans Mono",Menlo,Consolas,monospace;fill:#16181d;text-anchor:middle;white-space:pre}
.details{font-size:10.5px;fill:#4a4f58}
.sequence path{fill:#ffd9a0}.selector path{fill:#b5eff4}.parallel path{fill:#ffec99}.control path{fill:#ece6b0}
.decorator path{fill:#f2f2fa}.condition path,.action path{fill:#e4e6e9}
@media (prefers-color-scheme:dark){
.ground{fill:#14161a}.line,.frame{stroke:#7d838d}.node path{stroke:#8d939d}text{fill:#f1f3f5}.details{fill:#c3c8cf}
.sequence path{fill:#6b4408}.selector path{fill:#0d565e}.parallel path{fill:#655300}.control path{fill:#54501f}
.decorator path{fill:#2b2d3d}.condition path,.action path{fill:#33373d}
}"""


@dataclass
class Block:
    """A node with everything below it, as a rectangle.

    Attributes:
        wide: The width of the node's own box.
        high: The height of that.
        frame: The distance of the box from the block's upper edge, and of all that is in it from the others.
        least: The width if nothing in it stands side by side.
        beside: Whether its children stand side by side.
        centred: Whether boxes stand above the middle of their children, not above their left edge.
        shift: The distance of the box from the block's left edge.
        width: Its width.
        height: Its height.
        x: Its left edge: in the block around it, at last in the picture.
        y: Its upper edge, likewise.
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
        """Where lines meet the box from above and leave it below, from the edge from which `x` is counted."""
        return self.x + self.shift + (self.wide / 2 if self.centred else _TRUNK)

    @property
    def top(self) -> float:
        """The upper edge of the box."""
        return self.y + self.frame

    @property
    def bottom(self) -> float:
        """The lower edge of the box."""
        return self.top + self.high


def svg(tree: CompiledTree) -> str:
    """Return a compiled tree as a picture."""
    nodes = drawn_nodes(tree)
    blocks = _placed(nodes)
    width, height = (math.ceil(size + 2 * _MARGIN) for size in (blocks[0].width, blocks[0].height))
    size = f'width="{width}" height="{height}"'
    title = f"{in_one_line(tree.instance.tree.name)}, {len(nodes)} {'node' if len(nodes) == 1 else 'nodes'}"
    lines = [
        f'<svg xmlns="http://www.w3.org/2000/svg" {size} viewBox="0 0 {width} {height}" role="img">',
        f"<title>{_text(title)}</title>",
        f"<style>\n{_STYLE}\n</style>",
        f'<rect class="ground" {size}/>',
        *(_frame(block) for block in blocks if block.frame),
        f'<path class="line" d="{"".join(_connections(nodes, blocks))}"/>',
        *(_node(node, block) for node, block in zip(nodes, blocks, strict=True)),
        "</svg>",
    ]
    return "".join(f"{line}\n" for line in lines)


def _placed(nodes: Sequence[DrawnNode]) -> list[Block]:
    blocks = [_block(node) for node in nodes]
    below = [[blocks[child] for child in node.children] for node in nodes]
    # Children come behind their parents in the list.
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
    """Return the width of a text in characters; those of East Asia count twice, accents not."""
    return sum(0 if combining(each) else 2 if east_asian_width(each) in "WF" else 1 for each in text)


def _choose(nodes: Sequence[DrawnNode], blocks: Sequence[Block]) -> None:
    """Decide whose children stand side by side: from the root down, where there is room for them."""
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
    """Give a block its size, and its children their places in it."""
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
            # In the middle of the gap, whatever stands in the way of the children's boxes.
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
    return f'<g class="node {node.shape.value}">{title}<path d="{outline}"/>{"".join(texts)}</g>'


def _outline(shape: Shape, x: int, y: int, wide: int, high: int) -> str:
    """Return the way around a node: octagons for selectors, as py_trees draws them; rounded ends for conditions."""
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
