"""A compiled tree in Graphviz' language, with the shapes and colours of py_trees' own drawings."""

from collections.abc import Iterator

from sar_compiler.compiler import CompiledTree
from sar_compiler.tree.showing import in_one_line
from sar_compiler.views.drawing import DrawnNode, Shape, drawn_nodes, graph_lines

_LOOKS = {
    Shape.SEQUENCE: ("box", "orange"),
    Shape.SELECTOR: ("octagon", "cyan"),
    Shape.PARALLEL: ("parallelogram", "gold"),
    Shape.CONTROL: ("hexagon", "khaki"),
    Shape.DECORATOR: ("ellipse", "ghostwhite"),
    Shape.CONDITION: ("ellipse", "gray"),
    Shape.ACTION: ("ellipse", "gray"),
}


def dot(tree: CompiledTree) -> str:
    """Return a compiled tree as a digraph; subtrees are clusters."""
    return "".join(f"{line}\n" for line in _lines(tree))


def _lines(tree: CompiledTree) -> Iterator[str]:
    nodes = drawn_nodes(tree)
    yield f"digraph {_quoted(in_one_line(tree.instance.tree.name))} {{"
    yield "  ordering=out;"
    yield '  graph [fontname="sans-serif", style=dashed];'
    yield '  node [fontname="sans-serif", fontsize=9, style=filled];'
    yield from graph_lines(nodes, "  subgraph cluster_{} {{", _node, "  }", "  n{} -> n{};")
    yield "}"


def _node(number: int, node: DrawnNode) -> str:
    shape, colour = _LOOKS[node.shape]
    label = "\\n".join(map(_escaped, filter(None, (node.label, node.details))))
    return f'  n{number} [label="{label}", shape={shape}, fillcolor={colour}, tooltip={_quoted(node.title)}];'


def _quoted(text: str) -> str:
    return f'"{_escaped(text)}"'


def _escaped(text: str) -> str:
    # Graphviz reads entities of HTML everywhere.
    return text.replace("&", "&amp;").replace("\\", "\\\\").replace('"', '\\"')
