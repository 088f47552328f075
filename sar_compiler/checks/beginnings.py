"""Checking of the part of a file before the place where it is malformed.

Whatever the rest of the file may say, these findings stay: they are about start tags, and about elements that have ended.
"""

import bisect

from sar_compiler.checks.document import check_document
from sar_compiler.checks.rules import CheckContext
from sar_compiler.checks.suppressions import without_suppressed
from sar_compiler.nodes.registry import Registry
from sar_compiler.tree.diagnostic import Diagnostic
from sar_compiler.tree.forest import Forest
from sar_compiler.tree.model import INCLUDE_TAG, MODEL_TAG, FileBeginning, TreeFile
from sar_compiler.tree.source import Form, Span

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
