"""What is wrong with a tree.

A rule is a function from a file and the registry to findings; each family of rules is a module here,
and `RULES` lists them.
"""

from collections.abc import Callable, Iterable

from sar_compiler.checks.document import check_document
from sar_compiler.checks.nodes import check_nodes
from sar_compiler.checks.schema import check_schema
from sar_compiler.nodes.models import described_specs
from sar_compiler.nodes.registry import Registry
from sar_compiler.tree.diagnostic import Diagnostic
from sar_compiler.tree.forest import Forest
from sar_compiler.tree.model import TreeFile

Palettes = Iterable[TreeFile]
"""Files whose `TreeNodesModel` describes nodes that are not installed."""

RULES: tuple[Callable[[Forest, Registry, Palettes], Iterable[Diagnostic]], ...] = (
    check_document,
    check_nodes,
)


def check(forest: Forest, registry: Registry, palettes: Palettes = ()) -> list[Diagnostic]:
    """Return everything that is wrong with a file and those that it includes, file by file.

    Args:
        forest: The file and what it includes.
        registry: What tags mean.
        palettes: Further files whose `TreeNodesModel` describes nodes that are not installed.
    """
    palettes = tuple(palettes)
    findings = [*forest.findings]
    findings += (finding for rule in RULES for finding in rule(forest, registry, palettes))
    # The rules say it better; the schema speaks only where they found nothing.
    described = described_specs([*forest.files, *palettes], registry)
    for tree_file in forest.files:
        findings += check_schema(tree_file, registry, described, findings)
    order = {tree_file.source.path: number for number, tree_file in enumerate(reversed(forest.files))}

    def place(finding: Diagnostic) -> tuple[int, int, int, str]:
        return order.get(finding.source.path, 0), finding.span.line, finding.span.column, finding.code

    return sorted(findings, key=place)
