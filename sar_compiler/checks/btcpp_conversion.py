"""Conversion of a file to BehaviorTree.CPP 4, with all that BehaviorTree.CPP refuses of it."""

from collections.abc import Iterable, Iterator

from sar_compiler.checks.rules import CheckContext
from sar_compiler.checks.rules.keys import refused_key_types
from sar_compiler.nodes.btcpp import Version
from sar_compiler.nodes.btcpp.to_btcpp import to_btcpp
from sar_compiler.nodes.registry import Registry
from sar_compiler.tree.conversion import Converted, convert
from sar_compiler.tree.diagnostic import Diagnostic, Form
from sar_compiler.tree.forest import Forest
from sar_compiler.tree.model import TreeFile

_OF_TYPES = ("btcpp-version", "cpp-type-mismatch", "key-of-two-types")


def convert_to_btcpp(
    forest: Forest, registry: Registry, palettes: Iterable[TreeFile] = (), btcpp: Version | None = None
) -> Converted:
    """Write a tree file for BehaviorTree.CPP 4 and Groot2; see `to_btcpp`.

    Besides the notes about what has no counterpart there are the findings about keys whose types it refuses.

    Args:
        forest: The file, with those that it includes.
        registry: What tags mean.
        palettes: Further files with descriptions of nodes.
        btcpp: The version that the trees are said to be for; None if nothing says so.

    Raises:
        TreeError: If the file has content outside the trees that would be lost.
    """
    palettes = tuple(palettes)
    losses = convert(forest.main, Form.XML).losses
    rewritten, notes = to_btcpp(forest.main, registry, palettes, btcpp)
    context = CheckContext(forest, registry, palettes, btcpp)
    types = [each for each in _refused_types(context) if each.source is forest.main.source]
    found = dict.fromkeys((*notes, *types))
    return Converted(convert(rewritten, Form.XML).text, (*losses, *sorted(found, key=lambda each: each.span)))


def _refused_types(context: CheckContext) -> Iterator[Diagnostic]:
    yield from (each for each in context.bound.findings if each.code in _OF_TYPES)
    yield from refused_key_types(context)
