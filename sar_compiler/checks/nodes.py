"""What binding finds: tags, attributes, values, children, references, subtrees, keys and models."""

from collections.abc import Iterable

from sar_compiler.nodes.binding import bind_all
from sar_compiler.nodes.registry import Registry
from sar_compiler.tree.diagnostic import Diagnostic
from sar_compiler.tree.forest import Forest
from sar_compiler.tree.model import TreeFile


def check_nodes(forest: Forest, registry: Registry, palettes: Iterable[TreeFile] = ()) -> list[Diagnostic]:
    """Return what keeps the trees of a forest, executed or not, from meaning something."""
    return bind_all(forest, registry, palettes)
