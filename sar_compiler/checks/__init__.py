"""Checking trees.

A rule is a function from a `CheckContext`, which is a file with all that is known of it, to findings. Each family of rules
is a module in `rules`; its functions `check_...` are rules.
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
from sar_compiler.checks.leaf_classes import check_leaf_classes
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
from sar_compiler.checks.suppressions import without_suppressed
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
    """Return the findings of binding all trees of a forest, executed or not."""
    findings = context.bound.findings
    # A tree that is not there may be in a file that could not be read.
    return findings if context.is_whole else [each for each in findings if each.code != "unknown-tree"]


MOST = 1000
"""The most findings of a kind that are reported; the rest appear when these are corrected."""

_FAMILIES = (single_nodes, interruptions, needless, order, keys, scripts, subtrees, version_differences)
RULES: tuple[Callable[[CheckContext], Iterable[Diagnostic]], ...] = (
    check_document,
    check_meaning,
    *(rule for family in _FAMILIES for name, rule in vars(family).items() if name.startswith("check_")),
    check_leaf_classes,
)


def check_palettes(palettes: Palettes, registry: Registry) -> list[Diagnostic]:
    """Return the findings about palettes themselves, whatever tree files they are for."""
    collector, palettes = FindingCollector(), tuple(palettes)
    models = read_models(palettes, collector)
    compare_models(models, registry_without(registry, models), collector)
    return [*_recoveries(palettes), *collector.findings]


def _recoveries(files: Palettes) -> Iterable[Diagnostic]:
    return itertools.chain.from_iterable(tree_file.findings for tree_file in files)


def _guard(
    name: str, rule: Callable[[], Iterable[Diagnostic]], forest: Forest, found: Iterable[Diagnostic]
) -> Iterator[Diagnostic]:
    """Yield what a rule finds; if it fails, what it has found before, and that it has failed."""
    try:
        yield from rule()
    except Exception as error:  # noqa: BLE001 - whatever it is, the other rules have something to say
        yield from failure_of_rule(name, error, forest.main.root, found)


def check(
    forest: Forest, registry: Registry, palettes: Palettes = (), btcpp: Version | None = None
) -> list[Diagnostic]:
    """Return everything that is wrong with a file and those that it includes, file by file.

    What comments in the files allow is left out.

    Args:
        forest: The file and what it includes.
        registry: What tags mean.
        palettes: Further files whose `TreeNodesModel` describes nodes that are not installed; what is wrong with
            themselves, `check_palettes` says.
        btcpp: The version of BehaviorTree.CPP that the trees are said to be for; None if nothing says so.
    """
    return check_context(context_of(forest, registry, palettes, btcpp))


def context_of(
    forest: Forest,
    registry: Registry,
    palettes: Palettes = (),
    btcpp: Version | None = None,
) -> CheckContext:
    """Return a forest with what its tags mean; arguments as for `check`."""
    palettes = tuple(palettes)
    registry = registry_without(registry, read_models([*forest.files, *palettes], FindingCollector()))
    return CheckContext(forest, registry, palettes, btcpp)


def _of_schema(context: CheckContext, found: Sequence[Diagnostic]) -> list[Diagnostic]:
    """Return what the schema refuses, beside what the rules have found; nothing in a browser, for which there is no lxml."""
    if sys.platform == "emscripten":
        return []
    from sar_compiler.checks.schema_validation import check_schema

    forest, registry, findings = context.forest, context.registry, [*found]
    described = described_specs([*forest.files, *context.palettes], registry)
    for tree_file in forest.files:
        schema = functools.partial(check_schema, tree_file, registry, described, findings)
        findings += itertools.islice(_guard(check_schema.__name__, schema, forest, findings), MOST)
    return findings[len(found) :]


def check_context(context: CheckContext) -> list[Diagnostic]:
    """Return everything that is wrong with a forest; see `check`."""
    forest = context.forest
    findings = [*forest.findings, *_recoveries(forest.files)]
    is_all = True
    for rule in RULES:
        found = list(_guard(rule.__name__, functools.partial(rule, context), forest, findings))
        is_all = is_all and sum(each.severity is Severity.ERROR for each in found) < MOST
        findings += found
    # The rules say it better; the schema speaks only where they found nothing, and had nothing more to say.
    if is_all:
        findings += _of_schema(context, findings)
    files = (*reversed(forest.files), *forest.others)
    order = {tree_file.source.path: number for number, tree_file in reversed([*enumerate(files)])}

    def place(finding: Diagnostic) -> tuple[int, int, int, str]:
        # The modules of leaves come last.
        return (
            order.get(finding.source.path, len(files)),
            finding.span.line,
            finding.span.column,
            finding.code,
        )

    return sorted(without_suppressed(forest, findings), key=place)


def first_of_each(findings: Iterable[Diagnostic]) -> list[Diagnostic]:
    """Return the first `MOST` findings of each kind, with an information of how many more there are."""
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


# Errors of the project's own: what fails on one tree becomes a finding about that tree, and everything else goes on.
_EXPECTED = (SarError, ImportError, OSError, UnicodeEncodeError)
"""What commands have a message for: wrong use, what is not installed, and output that cannot be written."""

_HINT = (
    "the check is at fault, not the file: please report it, with the file and what sar-compile --version says"
)
_CLASS_HINT = "mend the class; nothing else that depends on this node is checked"
_START = Span(1, 1, 1, 1)


def failure_of_rule(
    name: str, error: Exception, default: Element, found: Iterable[Diagnostic]
) -> Iterator[Diagnostic]:
    """Yield the finding that a rule has failed, or that a user's class has.

    Args:
        name: The rule's name.
        error: What it raised.
        default: The element that is named where it is not known which one the rule was looking at.
        found: What was found so far: what fails in the same place for several rules, which all need it, is told once.

    Raises:
        Exception: The error itself, if commands have a message for it.
    """
    element = _element_of(error) or default
    if isinstance(error, RegistrationError):
        told = str(error)
        finding = element.finding("faulty-class", told, hint=_CLASS_HINT)
    elif isinstance(error, _EXPECTED):
        raise error
    else:
        told = _error_words(error)
        message = f"the rule {name} failed here: {told}"
        finding = element.finding("internal-error", message, hint=_HINT)
    said = (each.message for each in found if each.code == finding.code)
    if not any(message == finding.message or message.endswith(told) for message in said):
        yield finding


def failure_of_file(path: Path, error: Exception, what: str = "check") -> Diagnostic:
    """Return the finding that something else than a rule has failed on a file.

    Args:
        path: The file.
        error: What was raised.
        what: What has failed.

    Raises:
        Exception: The error itself, if commands have a message for it.
    """
    if isinstance(error, _EXPECTED):
        raise error
    message = f"the {what} of this file failed: {_error_words(error)}"
    return Diagnostic("internal-error", message, Source(str(path), "", NO_SPANS), _START, hint=_HINT)


def _error_words(error: Exception) -> str:
    """Return an error with the place in the sources that it comes from."""
    last = _calls(error)[-1]
    place = f"{Path(last.f_code.co_filename).name}, in {last.f_code.co_name}"
    return f"{type(error).__name__}: {error} ({place})"


def _element_of(error: Exception) -> Element | None:
    """Return the element that was looked at when an error was raised: that of the innermost call that has one."""
    values = (value for frame in reversed(_calls(error)) for value in frame.f_locals.values())
    elements = (value if isinstance(value, Element) else getattr(value, "element", None) for value in values)
    return next((each for each in elements if isinstance(each, Element)), None)


def _calls(error: Exception) -> list[FrameType]:
    """Return the calls that an error came through, the innermost last."""
    import traceback

    return [frame for frame, _ in traceback.walk_tb(error.__traceback__)]


# Of the part of a file before the place where it is malformed: whatever the rest of the file may say, these findings stay. They
# are about start tags, and about elements that have ended.
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
    """Return the findings about the elements before the place where a file is malformed.

    Args:
        beginning: These elements.
        cut: The place.
        forest: The file so far, and what it includes.
        registry: What tags mean.
        palettes: Further files whose `TreeNodesModel` describes nodes that are not installed.
    """
    context = CheckContext(forest, registry, palettes)
    found = [*check_document(context), *context.bound.findings]
    source, unfinished = beginning.tree_file.source, {place[:2] for place in beginning.unfinished}
    parents: dict[tuple[int, int], tuple[int, int] | None] = {}
    for each in beginning.tree_file.root.iterate():
        parents.setdefault(each.place, None)
        parents.update({child.place: each.place for child in each.children})
    places = sorted(parents)
    ruled = {
        bound.element.place
        for tree in context.bound.trees
        for bound in tree.nodes
        if bound.spec.rule is not None
    }
    rest = source.text[source.offset(cut.line, cut.column) :]
    describing = any(place.tag == MODEL_TAG for place in beginning.unfinished)
    is_known = not (describing or MODEL_TAG in rest or INCLUDE_TAG in rest or forest.findings)

    def stays(finding: Diagnostic) -> bool:
        if finding.source is not source:
            return False
        place = places[max(0, bisect.bisect_right(places, finding.span[:2]) - 1)]
        if finding.code == "unknown-node":
            return is_known
        if finding.code == "missing-attribute" and place in unfinished:  # in YAML, it may have come later
            return source.form is Form.XML
        if finding.code == "wrong-value":  # rules of nodes look at their children as well
            return not (place in unfinished and place in ruled)
        if finding.code in _OF_A_CHILD:  # a tag that was not closed has all that follows in it
            return parents[place] not in unfinished
        return finding.code in _OF_A_START_TAG or (finding.code in _OF_AN_ELEMENT and place not in unfinished)

    recovered = beginning.tree_file.findings
    kept = without_suppressed(forest, [*recovered, *(each for each in found if stays(each))])
    told = {id(each) for each in recovered}
    return [*forest.findings, *(each for each in kept if id(each) in told or stays(each))]
