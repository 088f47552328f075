"""Checking trees.

A rule is a function from a `CheckContext`, which is a file with all that is known of it, to findings. Each family of rules
is a module in `rules`, and `RULES` lists them.
"""

import functools
import itertools
from collections import Counter
from collections.abc import Callable, Iterable, Iterator

from sar_compiler.checks.document import check_document
from sar_compiler.checks.rules.check_context import CheckContext
from sar_compiler.checks.rules.classes import check_classes
from sar_compiler.checks.rules.keys import check_keys
from sar_compiler.checks.rules.names import check_names
from sar_compiler.checks.rules.needless import check_needless
from sar_compiler.checks.rules.order import check_order
from sar_compiler.checks.rules.parallels import check_parallels
from sar_compiler.checks.rules.reach import check_reach
from sar_compiler.checks.rules.reactive import check_reactive
from sar_compiler.checks.rules.scripts import check_scripts
from sar_compiler.checks.rules.subtrees import check_subtrees
from sar_compiler.checks.rules.texts import check_bounds, check_texts
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
"""The most findings of a kind that are reported; the rest appear when these are corrected."""

RULES: tuple[Callable[[CheckContext], Iterable[Diagnostic]], ...] = (
    check_document,
    check_meaning,
    check_classes,
    check_reactive,
    check_reach,
    check_needless,
    check_parallels,
    check_order,
    check_keys,
    check_scripts,
    check_texts,
    check_bounds,
    check_subtrees,
    check_names,
    check_versions,
)


def check_palettes(palettes: Palettes, registry: Registry) -> list[Diagnostic]:
    """Return what is wrong with palettes themselves, whatever files they are for."""
    collector, palettes = Collector(), tuple(palettes)
    models = read_models(palettes, collector)
    compare(models, yielding(registry, models), collector)
    return [*_mended(palettes), *collector.findings]


def _mended(files: Palettes) -> Iterable[Diagnostic]:
    return itertools.chain.from_iterable(tree_file.findings for tree_file in files)


def _is_error(finding: Diagnostic) -> bool:
    return finding.severity is Severity.ERROR


def _guarded(
    name: str, rule: Callable[[], Iterable[Diagnostic]], forest: Forest, found: Iterable[Diagnostic]
) -> Iterator[Diagnostic]:
    """Yield what a rule finds; if it fails, what it has found before, and that it has failed."""
    try:
        yield from rule()
    except Exception as error:  # noqa: BLE001 - whatever it is, the other rules have something to say
        from sar_compiler.checks.internal_errors import failure_of_rule

        yield from failure_of_rule(name, error, forest.main.root, found)


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
    registry = yielding(registry, read_models([*forest.files, *palettes], Collector()))
    findings = [*forest.findings, *_mended(forest.files)]
    context = CheckContext(forest, registry, palettes, btcpp)
    is_all = True
    for rule in RULES:
        found = list(_guarded(rule.__name__, functools.partial(rule, context), forest, findings))
        is_all = is_all and sum(map(_is_error, found)) < MOST
        findings += found
    from sar_compiler.checks.schema_validation import check_schema

    # The rules say it better; the schema speaks only where they found nothing, and had nothing more to say.
    described = described_specs([*forest.files, *palettes], registry)
    for tree_file in forest.files if is_all else ():
        schema = functools.partial(check_schema, tree_file, registry, described, findings)
        findings += itertools.islice(_guarded(check_schema.__name__, schema, forest, findings), MOST)
    files = (*reversed(forest.files), *forest.others)
    order = {tree_file.source.path: number for number, tree_file in reversed([*enumerate(files)])}

    def place(finding: Diagnostic) -> tuple[int, int, int, str]:
        return order.get(finding.source.path, 0), finding.span.line, finding.span.column, finding.code

    return sorted(without_suppressed(forest, findings), key=place)


def first_of_each(findings: Iterable[Diagnostic]) -> list[Diagnostic]:
    """Return findings, of each kind the first `MOST` and an information about how many more there are."""
    findings = list(findings)
    counts = Counter(finding.code for finding in findings)
    if max(counts.values(), default=0) <= MOST:
        return findings
    seen: Counter[str] = Counter()
    kept = []
    for finding in findings:
        seen[finding.code] += 1
        if seen[finding.code] <= MOST:
            kept.append(finding)
        elif seen[finding.code] == MOST + 1:
            message = f"{counts[finding.code] - MOST:,} more of this kind: {finding.code}"
            hint = "correct those above, and they appear"
            kept.append(Diagnostic("more-findings", message, finding.source, finding.span, hint=hint))
    return kept
