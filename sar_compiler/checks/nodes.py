"""What binding finds: tags, attributes, values, children and references."""

from collections.abc import Iterator

from sar_compiler.nodes.binding import bind
from sar_compiler.nodes.registry import Registry
from sar_compiler.tree.diagnostic import Diagnostic
from sar_compiler.tree.model import TreeFile


def check_nodes(tree_file: TreeFile, registry: Registry) -> Iterator[Diagnostic]:
    """Yield what keeps the trees of a file, executed or not, from meaning something."""
    for tree in tree_file.trees:
        yield from bind(tree, registry).findings
