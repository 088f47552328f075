"""Palettes that nobody has named and that lie beside a file with nodes which they describe."""

import contextlib
import dataclasses
import functools
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path

from sar_compiler.nodes.binding.bound import Collector
from sar_compiler.nodes.models import read_models
from sar_compiler.tree.diagnostic import Cause, Diagnostic, TreeError, UnreadableFileError
from sar_compiler.tree.gathering import palettes_beside, read_tree_file

_UNKNOWN = "unknown-node"


def naming_palettes(findings: Iterable[Diagnostic]) -> Iterator[Diagnostic]:
    """Yield findings; those about unknown nodes name the palette in the folder of their file that describes the node.

    It is not taken without being named: what a file means would depend on what happens to lie beside it.
    """
    described = functools.cache(_palettes_by_tag)
    for finding in findings:
        source, span = finding.source, finding.span
        if finding.code == _UNKNOWN:
            start, end = (source.offset(*place) for place in (span[:2], span[2:]))
            palette = described(Path(source.path)).get(source.text[start:end].lstrip("<"))
            if palette is not None:
                hint = f"{palette.name} beside this file describes it: --model {palette}"
                cause = finding.common_cause and Cause(
                    f"these are nodes of {palette}", finding.common_cause.subject
                )
                yield dataclasses.replace(finding, suggestion=None, hint=hint, common_cause=cause)
                continue
        yield finding


def _palettes_by_tag(tree_file: Path) -> Mapping[str, Path]:
    """Return the nodes that palettes beside a file describe, with the palette."""
    found: dict[str, Path] = {}
    for path in palettes_beside(tree_file):
        with contextlib.suppress(TreeError, UnreadableFileError):
            for tag in read_models([read_tree_file(path)], Collector()).nodes:
                found.setdefault(tag, path)
    return found
