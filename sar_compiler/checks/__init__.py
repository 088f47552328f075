"""What is wrong with a tree.

A rule is a function from a file and the registry to findings; each family of rules is a module here,
and `RULES` lists them.
"""

from collections.abc import Callable, Iterable

from sar_compiler.checks.document import check_document
from sar_compiler.checks.nodes import check_nodes
from sar_compiler.checks.schema import check_schema
from sar_compiler.nodes.registry import Registry
from sar_compiler.tree.diagnostic import Diagnostic
from sar_compiler.tree.model import TreeFile

RULES: tuple[Callable[[TreeFile, Registry], Iterable[Diagnostic]], ...] = (check_document, check_nodes)


def check(tree_file: TreeFile, registry: Registry) -> list[Diagnostic]:
    """Return everything that is wrong with a file, in the order of the file.

    Args:
        tree_file: The file.
        registry: What tags mean.
    """
    findings = [finding for rule in RULES for finding in rule(tree_file, registry)]
    # The rules say it better; the schema speaks only where they found nothing.
    findings += check_schema(tree_file, registry, findings)
    return sorted(findings, key=lambda finding: (finding.span.line, finding.span.column, finding.code))
