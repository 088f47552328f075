"""The checks of tree files.

A rule is a function whose name begins with `check_`. It receives a `CheckContext` (the tree files and the results of
their analysis), and yields findings. Each module in `rules` contains one family of rules.
"""

import bisect
import functools
import itertools
import sys
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from types import FrameType

from sar_compiler.checks.document import check_document
from sar_compiler.checks.rules import (
    CheckContext,
    interruptions,
    keys,
    needless,
    order,
    scripts,
    single_nodes,
    subtrees,
    version_differences,
)
from sar_compiler.checks.schema_acceptance import is_surely_accepted
from sar_compiler.errors import SarError
from sar_compiler.nodes.btcpp import Version
from sar_compiler.nodes.collector import FindingCollector
from sar_compiler.nodes.models import compare_models, described_specs, read_models, registry_without
from sar_compiler.nodes.registry import Registry
from sar_compiler.nodes.spec import RegistrationError
from sar_compiler.tree.diagnostic import Diagnostic, Form, Severity, Source, Span
from sar_compiler.tree.forest import Forest
from sar_compiler.tree.model import INCLUDE_TAG, MODEL_TAG, NO_SPANS, Element, FileBeginning, TreeFile

Palettes = Iterable[TreeFile]
"""Files whose `TreeNodesModel` describes nodes that are not installed."""


def check_meaning(context: CheckContext) -> Iterable[Diagnostic]:
    """Bind all trees of a forest, including unused trees, to their nodes' specs, and return the findings."""
    findings = context.bound_forest.findings
    # A missing tree may be in a file that could not be read.
    return findings if context.is_whole else [each for each in findings if each.code != "unknown-tree"]


def check_leaf_classes(context: CheckContext) -> Iterator[Diagnostic]:
    """Yield findings about the classes of the leaves in the trees. Leaves declared by an import path are skipped."""
    specs = {
        spec.class_path: spec
        for spec in context.bound_forest.specs
        if not (spec.is_foreign or spec.is_by_path)
    }
    if specs:
        from sar_compiler.checks.leaf_classes import check_class

        for spec in specs.values():
            yield from check_class(spec)


MOST = 1000
"""The maximum number of findings of one kind that a check reports.

After the user has fixed them, the next check reports further findings.
"""

_FAMILIES = (single_nodes, interruptions, needless, order, keys, scripts, subtrees, version_differences)
RULES: tuple[Callable[[CheckContext], Iterable[Diagnostic]], ...] = (
    check_document,
    check_meaning,
    *(rule for family in _FAMILIES for name, rule in vars(family).items() if name.startswith("check_")),
    check_leaf_classes,
)


def check_palettes(palettes: Palettes, registry: Registry) -> list[Diagnostic]:
    """Return the findings about palettes, which do not depend on the checked tree file."""
    collector, palettes = FindingCollector(), tuple(palettes)
    models = read_models(palettes, collector)
    compare_models(models, registry_without(registry, models), collector)
    return [*_recovery_findings(palettes), *collector.findings]


def _recovery_findings(files: Palettes) -> Iterable[Diagnostic]:
    return itertools.chain.from_iterable(tree_file.findings for tree_file in files)


def _guard(
    name: str, rule: Callable[[], Iterable[Diagnostic]], forest: Forest, found: Iterable[Diagnostic]
) -> Iterator[Diagnostic]:
    """Yield a rule's findings. If the rule raises an error, yield a finding about this error and stop."""
    try:
        yield from rule()
    except Exception as error:  # noqa: BLE001 - the other rules run after any error
        yield from failure_of_rule(name, error, forest.main.root, found)


def check(
    forest: Forest, registry: Registry, palettes: Palettes = (), btcpp: Version | None = None
) -> list[Diagnostic]:
    """Return all findings about a file and the files that it includes, file by file.

    Suppressed findings are left out.

    Args:
        forest: The file and its includes.
        registry: The registered nodes.
        palettes: Further files whose `TreeNodesModel` describes nodes that are not installed; `check_palettes`
            returns the findings about these files.
        btcpp: The version of BehaviorTree.CPP that the trees are for; None if it is not configured.
    """
    return check_context(make_check_context(forest, registry, palettes, btcpp))


def make_check_context(
    forest: Forest,
    registry: Registry,
    palettes: Palettes = (),
    btcpp: Version | None = None,
) -> CheckContext:
    """Return the context that the rules need to check a forest; see `check` for the arguments."""
    palettes = tuple(palettes)
    registry = registry_without(registry, read_models([*forest.files, *palettes], FindingCollector()))
    return CheckContext(forest, registry, palettes, btcpp)


def _schema_findings(context: CheckContext, found: Sequence[Diagnostic]) -> list[Diagnostic]:
    """Return the schema's findings about elements for which no rule reports a finding.

    The list is empty in a browser, because lxml is not available there.
    """
    if sys.platform == "emscripten":
        return []
    forest, registry, findings = context.forest, context.registry, [*found]
    described = described_specs([*forest.files, *context.palettes], registry)

    def check_schema(tree_file: TreeFile) -> Iterable[Diagnostic]:
        if is_surely_accepted(tree_file, registry, described):
            return ()
        from sar_compiler.checks.schema_validation import check_schema as validate

        return validate(tree_file, registry, described, findings)

    for tree_file in forest.files:
        schema = functools.partial(check_schema, tree_file)
        findings += itertools.islice(_guard(check_schema.__name__, schema, forest, findings), MOST)
    return findings[len(found) :]


def check_context(context: CheckContext) -> list[Diagnostic]:
    """Return all findings about the forest of a context; see `check`."""
    forest = context.forest
    findings = [*forest.findings, *_recovery_findings(forest.files)]
    is_all = True
    for rule in RULES:
        found = list(_guard(rule.__name__, functools.partial(rule, context), forest, findings))
        is_all = is_all and sum(each.severity is Severity.ERROR for each in found) < MOST
        findings += found
    # The rules' messages are better, so the schema is used only for elements about which no rule has a finding. If one rule
    # has found a thousand errors, the schema is not used at all.
    if is_all:
        findings += _schema_findings(context, findings)
    files = (*reversed(forest.files), *forest.others)
    order = {tree_file.source.path: number for number, tree_file in reversed([*enumerate(files)])}

    def sort_key(finding: Diagnostic) -> tuple[int, int, int, str]:
        # Findings about the Python modules of leaves are last.
        return (
            order.get(finding.source.path, len(files)),
            finding.span.line,
            finding.span.column,
            finding.code,
        )

    return sorted(_apply_suppressions(forest, findings), key=sort_key)


def _apply_suppressions(forest: Forest, findings: list[Diagnostic]) -> list[Diagnostic]:
    """Return the findings that no comment suppresses, and the findings about suppression comments."""
    if not any("sar:" in each.source.text for each in (*forest.files, *forest.others)):
        return findings
    from sar_compiler.checks.suppressions import remove_suppressed

    return remove_suppressed(forest, findings)


def limit_findings(findings: Iterable[Diagnostic]) -> list[Diagnostic]:
    """Return at most `MOST` findings of each kind, and a note about the number of omitted findings."""
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
            message = f"{counts[finding.code] - MOST:,} more {finding.code} findings are not shown"
            hint = "fix the findings above, then run the check again"
            kept.append(Diagnostic("more-findings", message, finding.source, finding.span, hint=hint))
    return kept


_EXPECTED = (SarError, ImportError, OSError, UnicodeEncodeError)
"""The errors that each command reports in its own message, such as wrong usage or unwritable output."""

_HINT = "if you wrote this function, correct it. Otherwise, report this error together with the file and the output of sar-compile --version"
_CLASS_HINT = "fix the class. Other checks of this node were skipped"
_START = Span(1, 1, 1, 1)


def failure_of_rule(
    name: str, error: Exception, default: Element, found: Iterable[Diagnostic]
) -> Iterator[Diagnostic]:
    """Yield a finding about an error in a rule or in a user's class.

    Args:
        name: The rule's name.
        error: The error that it raised.
        default: The element to report if the error does not show which element the rule was checking.
        found: The findings so far. If another rule has raised the same error, it is not reported again.

    Raises:
        Exception: The error itself, if commands have a message for it.
    """
    element = _element_of(error) or default
    if isinstance(error, RegistrationError):
        reason = str(error)
        finding = element.finding("faulty-class", reason, hint=_CLASS_HINT)
    elif isinstance(error, _EXPECTED):
        raise error
    else:
        reason = _describe_error(error)
        message = f"the rule {name} raised an error at this element: {reason}"
        finding = element.finding("internal-error", message, hint=_HINT)
    messages = (each.message for each in found if each.code == finding.code)
    if not any(message == finding.message or message.endswith(reason) for message in messages):
        yield finding


def failure_of_file(path: Path, error: Exception, what: str = "check") -> Diagnostic:
    """Return a finding about an error that was raised while a file was checked, but not by a rule.

    Args:
        path: The file.
        error: The error.
        what: The part of the check that failed.

    Raises:
        Exception: The error itself, if commands have a message for it.
    """
    if isinstance(error, _EXPECTED):
        raise error
    message = f"the {what} of this file failed: {_describe_error(error)}"
    return Diagnostic("internal-error", message, Source(str(path), "", NO_SPANS), _START, hint=_HINT)


def _describe_error(error: Exception) -> str:
    """Return an error's type and text, with the file and function that raised it."""
    last = _calls(error)[-1]
    place = f"{Path(last.f_code.co_filename).name}, in {last.f_code.co_name}"
    return f"{type(error).__name__}: {error} ({place})"


def _element_of(error: Exception) -> Element | None:
    """Return the element that was being checked when an error was raised."""
    values = (value for frame in reversed(_calls(error)) for value in frame.f_locals.values())
    elements = (value if isinstance(value, Element) else getattr(value, "element", None) for value in values)
    return next((each for each in elements if isinstance(each, Element)), None)


def _calls(error: Exception) -> list[FrameType]:
    """Return the stack frames of an error's traceback, ending with the innermost frame."""
    import traceback

    return [frame for frame, _ in traceback.walk_tb(error.__traceback__)]


# The kinds of findings that are reported for the part of a file before a syntax error. The rest of the file cannot refute
# them, because they concern start tags and complete elements.
_OF_A_START_TAG = frozenset(
    {
        "conflicting-attributes",
        "duplicate-model",
        "duplicate-tree-id",
        "missing-attribute",
        "model-mismatch",
        "script-error",
        "unknown-attribute",
        "unknown-element",
        "unknown-node",
        "wrong-format",
        "wrong-kind",
        "wrong-root",
        "wrong-tree-id",
        "wrong-value",
    }
)
_OF_A_CHILD = frozenset({"child-of-leaf", "too-many-children"})
_OF_AN_ELEMENT = frozenset({"empty-control", "missing-child", "out-of-reach"})


def check_beginning(
    beginning: FileBeginning, cut: Span, forest: Forest, registry: Registry, palettes: tuple[TreeFile, ...]
) -> list[Diagnostic]:
    """Return the findings about the elements that precede a syntax error in a file.

    Args:
        beginning: The elements that precede the syntax error.
        cut: The location of the syntax error.
        forest: The part of the file that could be read, and the files that it includes.
        registry: The registered nodes.
        palettes: Further files whose `TreeNodesModel` describes nodes that are not installed.
    """
    context = CheckContext(forest, registry, palettes)
    found = [*check_document(context), *context.bound_forest.findings]
    source, unfinished = beginning.tree_file.source, {place[:2] for place in beginning.unfinished}
    parents: dict[tuple[int, int], tuple[int, int] | None] = {}
    for each in beginning.tree_file.root.iterate():
        parents.setdefault(each.position, None)
        parents.update({child.position: each.position for child in each.children})
    places = sorted(parents)
    ruled = {
        bound.element.position
        for tree in context.bound_forest.trees
        for bound in tree.nodes
        if bound.spec.rule is not None
    }
    rest = source.text[source.offset(cut.line, cut.column) :]
    describing = any(place.tag == MODEL_TAG for place in beginning.unfinished)
    is_known = not (describing or MODEL_TAG in rest or INCLUDE_TAG in rest or forest.findings)

    def is_kept(finding: Diagnostic) -> bool:
        if finding.source is not source:
            return False
        place = places[max(0, bisect.bisect_right(places, finding.span[:2]) - 1)]
        if finding.code == "unknown-node":
            return is_known
        if finding.code == "missing-attribute" and place in unfinished:  # in YAML, it may follow later
            return source.form is Form.XML
        if finding.code == "wrong-value":  # the rules of nodes also check their children
            return not (place in unfinished and place in ruled)
        if finding.code in _OF_A_CHILD:  # a tag that is not closed contains all elements that follow
            return parents[place] not in unfinished
        return finding.code in _OF_A_START_TAG or (finding.code in _OF_AN_ELEMENT and place not in unfinished)

    recovered = beginning.tree_file.findings
    kept = _apply_suppressions(forest, [*recovered, *(each for each in found if is_kept(each))])
    always_kept = {id(each) for each in recovered}
    return [*forest.findings, *(each for each in kept if id(each) in always_kept or is_kept(each))]
