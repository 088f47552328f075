"""Checking trees.

A rule is a function from a `CheckContext`, which is a file with all that is known of it, to findings. Each family of rules
is a module in `rules`, and `RULES` lists them.
"""

import itertools
from collections.abc import Callable, Iterable

from sar_compiler.checks.document import check_document
from sar_compiler.checks.rules.check_context import CheckContext
from sar_compiler.checks.rules.keys import check_keys
from sar_compiler.checks.rules.names import check_names
from sar_compiler.checks.rules.needless import check_needless
from sar_compiler.checks.rules.order import check_order
from sar_compiler.checks.rules.parallels import check_parallels
from sar_compiler.checks.rules.reach import check_reach
from sar_compiler.checks.rules.reactive import check_reactive
from sar_compiler.checks.rules.scripts import check_scripts
from sar_compiler.checks.rules.subtrees import check_subtrees
from sar_compiler.checks.rules.texts import check_texts
from sar_compiler.checks.rules.version_differences import check_versions
from sar_compiler.checks.suppressions import without_suppressed
from sar_compiler.nodes.binding.collector import Collector
from sar_compiler.nodes.btcpp.versions import NEWEST, Version
from sar_compiler.nodes.models.model_comparison import compare
from sar_compiler.nodes.models.models import described_specs, read_models, yielding
from sar_compiler.nodes.registry import Registry
from sar_compiler.tree.diagnostic import Diagnostic, Severity
from sar_compiler.tree.forest import Forest
from sar_compiler.tree.model import TreeFile

Palettes = Iterable[TreeFile]
"""Files whose `TreeNodesModel` describes nodes that are not installed."""


def check_meaning(context: CheckContext) -> Iterable[Diagnostic]:
    """Return what keeps the trees of a forest, executed or not, from meaning something."""
    findings = context.bound.findings
    # A tree that is not there may be in a file that could not be read.
    return findings if context.is_whole else [each for each in findings if each.code != "unknown-tree"]


MOST = 1000
"""The most findings reported for one rule; the rest appear when these are corrected."""

RULES: tuple[Callable[[CheckContext], Iterable[Diagnostic]], ...] = (
    check_document,
    check_meaning,
    check_reactive,
    check_reach,
    check_needless,
    check_parallels,
    check_order,
    check_keys,
    check_scripts,
    check_texts,
    check_subtrees,
    check_names,
    check_versions,
)


def check_palettes(palettes: Palettes, registry: Registry) -> list[Diagnostic]:
    """Return what is wrong with palettes themselves, whatever files they are for."""
    collector = Collector()
    models = read_models(palettes, collector)
    compare(models, yielding(registry, models), collector)
    return collector.findings


def _is_error(finding: Diagnostic) -> bool:
    return finding.severity is Severity.ERROR


def _first(findings: Iterable[Diagnostic]) -> Iterable[Diagnostic]:
    """Yield the first errors and the first others: no number of warnings hides an error."""
    left = {True: MOST, False: MOST}
    for finding in findings:
        is_error = _is_error(finding)
        if left[is_error]:
            left[is_error] -= 1
            yield finding
        elif is_error:
            return


def check(
    forest: Forest, registry: Registry, palettes: Palettes = (), btcpp: Version = NEWEST
) -> list[Diagnostic]:
    """Return everything that is wrong with a file and those that it includes, file by file.

    What comments in the files allow is left out.

    Args:
        forest: The file and what it includes.
        registry: What tags mean.
        palettes: Further files whose `TreeNodesModel` describes nodes that are not installed; what is wrong with
            themselves, `check_palettes` says.
        btcpp: The version of BehaviorTree.CPP that the trees are for.
    """
    palettes = tuple(palettes)
    registry = yielding(registry, read_models([*palettes, *forest.files], Collector()))
    findings = [*forest.findings]
    context = CheckContext(forest, registry, palettes, btcpp)
    is_all = True
    for rule in RULES:
        found = list(_first(rule(context)))
        is_all = is_all and sum(map(_is_error, found)) < MOST
        findings += found
    from sar_compiler.checks.schema_validation import check_schema

    # The rules say it better; the schema speaks only where they found nothing, and had nothing more to say.
    described = described_specs([*palettes, *forest.files], registry)
    for tree_file in forest.files if is_all else ():
        findings += itertools.islice(check_schema(tree_file, registry, described, findings), MOST)
    order = {tree_file.source.path: number for number, tree_file in enumerate(reversed(forest.files))}

    def place(finding: Diagnostic) -> tuple[int, int, int, str]:
        return order.get(finding.source.path, 0), finding.span.line, finding.span.column, finding.code

    return sorted(without_suppressed(forest, findings), key=place)
