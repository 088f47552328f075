"""A compiled tree as a flowchart of Mermaid, which GitHub and GitLab draw in Markdown."""

import re
from collections.abc import Iterator

from sar_compiler.compiler import CompiledTree
from sar_compiler.views.drawing import DrawnNode, Shape, drawn_nodes, graph_lines

# What is before and behind a label, and the colours: those of py_trees' drawings, lighter.
_LOOKS = {
    Shape.SEQUENCE: ("[", "]", "#ffd08a"),
    Shape.SELECTOR: ("{{", "}}", "#a5ecf2"),
    Shape.PARALLEL: ("[/", "/]", "#ffe680"),
    Shape.CONTROL: ("[[", "]]", "#f0e68c"),
    Shape.DECORATOR: ("([", "])", "#f4f4fb"),
    Shape.CONDITION: ("(", ")", "#dcdcdc"),
    Shape.ACTION: ("[", "]", "#dcdcdc"),
}
# Everything that is a sign of Mermaid's, of Markdown's or of HTML's somewhere.
_SIGN = re.compile(r"[^\w ?/=\x80-\U0010ffff]|(?<!\w)[_=]|_(?!\w)")
# Those that mean something together with the next character even as entities (line breaks, formulas, icons): something unseen comes
# between.
_APART = "\\$:"
# What pages that draw Mermaid leave undrawn, as GitHub's and GitLab's do: no page may choose more.
_MOST_EDGES, _LONGEST = 499, 50_000
_EDGE = " --> "


def mermaid(tree: CompiledTree) -> str:
    """Return a compiled tree as a flowchart from top to bottom; subtrees are boxes."""
    return "".join(f"{line}\n" for line in _lines(tree))


def too_large(flowchart: str) -> bool:
    """Return whether a flowchart is more than GitHub and GitLab draw."""
    return len(flowchart) > _LONGEST or flowchart.count(_EDGE) > _MOST_EDGES


def _lines(tree: CompiledTree) -> Iterator[str]:
    nodes = drawn_nodes(tree)
    yield "flowchart TD"
    yield from graph_lines(nodes, '  subgraph s{}[" "]', _node, "  end", f"  n{{}}{_EDGE}n{{}}")
    for shape in sorted({node.shape for node in nodes}, key=list(Shape).index):
        yield f"  classDef {shape.value} fill:{_LOOKS[shape][2]},stroke:#555,color:#111"


def _node(number: int, node: DrawnNode) -> str:
    before, behind, _ = _LOOKS[node.shape]
    label = "<br>".join(map(_escaped, filter(None, (node.label, node.details))))
    return f'  n{number}{before}"{label}"{behind}:::{node.shape.value}'


def _escaped(text: str) -> str:
    return _SIGN.sub(_entity, text)


def _entity(match: re.Match[str]) -> str:
    return f"#{ord(match[0])};{'#8203;' if match[0] in _APART else ''}"
