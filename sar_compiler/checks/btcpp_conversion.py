"""Conversion of a file to BehaviorTree.CPP 4, with a finding for each construct that BehaviorTree.CPP refuses."""

import dataclasses
from collections.abc import Iterable, Iterator

from sar_compiler.checks.rules import CheckContext
from sar_compiler.checks.rules.keys import refused_key_types
from sar_compiler.checks.rules.version_differences import check_literals
from sar_compiler.nodes.btcpp import Version
from sar_compiler.nodes.btcpp.to_btcpp import to_btcpp
from sar_compiler.nodes.registry import Registry
from sar_compiler.tree.conversion import ConvertedTree, convert
from sar_compiler.tree.diagnostic import Diagnostic, Form, Severity
from sar_compiler.tree.forest import Forest
from sar_compiler.tree.model import TreeFile

_WARNINGS = ("btcpp-version", "cpp-type-mismatch", "ignored-attribute")
"""The warnings about constructs that BehaviorTree.CPP refuses."""
_MODELLED = ("unknown-node",)
"""The errors that do not apply to the converted file, because it contains a model of each node."""


def convert_to_btcpp(
    forest: Forest, registry: Registry, palettes: Iterable[TreeFile] = (), btcpp: Version | None = None
) -> ConvertedTree:
    """Convert a tree file for BehaviorTree.CPP 4 and Groot2; see `to_btcpp`.

    The result includes notes about constructs without a counterpart, and findings about constructs that
    BehaviorTree.CPP refuses.

    Args:
        forest: The file and its includes.
        registry: The registered nodes.
        palettes: Further files that describe nodes.
        btcpp: The version of BehaviorTree.CPP that the trees are for; None if it is not configured.

    Raises:
        TreeError: If the file has content outside its trees, because the conversion would lose this content.
    """
    palettes = tuple(palettes)
    losses = convert(forest.main, Form.XML).losses
    rewritten, notes = to_btcpp(forest.main, registry, palettes, btcpp)
    written = CheckContext(_replace_main(forest, rewritten), registry, palettes, btcpp)
    noted = {each.span for each in notes if each.severity is not Severity.INFO}
    refused = [
        each for each in _refusals(written) if each.source is forest.main.source and each.span not in noted
    ]
    found = dict.fromkeys((*notes, *refused))
    return ConvertedTree(
        convert(rewritten, Form.XML).text, (*losses, *sorted(found, key=lambda each: each.span))
    )


def _replace_main(forest: Forest, main: TreeFile) -> Forest:
    """Replace the main file of a forest by a rewritten file whose elements keep their original locations."""
    files = tuple(main if each is forest.main else each for each in forest.files)
    meant = {each.position: forest.targets.get(id(each)) for each in forest.main.root.iterate()}
    targets = {
        id(each): tree for each in main.root.iterate() if (tree := meant.get(each.position)) is not None
    }
    return dataclasses.replace(forest, main=main, files=files, targets=targets)


def _refusals(context: CheckContext) -> Iterator[Diagnostic]:
    for finding in (*context.bound_forest.findings, *refused_key_types(context), *check_literals(context)):
        is_error = finding.severity is Severity.ERROR and finding.code not in _MODELLED
        if is_error or finding.code in _WARNINGS:
            yield finding
