"""Analysis of which nodes of a bound tree can be skipped."""

from collections.abc import Iterable, Sequence

from sar_compiler.nodes.binding.bound import BoundNode, BoundTree
from sar_compiler.nodes.collector import FindingCollector
from sar_compiler.nodes.spec import SkipPossibility

_CONDITIONS = ("_skipIf", "_while")


class SkipAnalysis:
    """Skip analysis of one tree and its subtrees, with each node analysed once.

    Args:
        trees: The trees.
        skipped: Further nodes that are declared as skippable by themselves.

    Attributes:
        possible: Whether any node in them can be skipped independently of its children.
    """

    def __init__(self, trees: Iterable[BoundTree], skipped: Iterable[BoundNode] = ()) -> None:
        self._known: dict[BoundNode, bool] = dict.fromkeys(skipped, True)
        # In most trees no node can be skipped, so no analysis is needed.
        self.possible = bool(self._known) or any(tree.skips for tree in trees)

    def among_children(self, bound: BoundNode) -> bool:
        """Return whether a child of a node can be skipped."""
        if not self.possible:
            return False
        if bound.subtree is not None:
            root = bound.subtree.root
            return root is not None and self.of(root)
        return any(self.of(child) for child in bound.children)

    def of(self, bound: BoundNode) -> bool:
        """Return whether a node can be skipped."""
        if bound not in self._known:
            self._known[bound] = by_itself(bound) or (
                bound.spec.skipping.possible is not SkipPossibility.NEVER and self.among_children(bound)
            )
        return self._known[bound]


def by_itself(bound: BoundNode) -> bool:
    """Return whether a node can be skipped independently of its children."""
    if bound.spec.skips_by_itself and _as_it_is_written(bound):
        return True
    return bool(bound.conditions) and any(condition in bound.conditions for condition in _CONDITIONS)


def _as_it_is_written(bound: BoundNode) -> bool:
    """Return whether the attribute that controls skipping can have the required value."""
    if bound.spec.skipping.only_if is None:
        return True
    name, value = bound.spec.skipping.only_if
    if name in bound.keys:
        return True
    return bool(bound.values.get(name, bound.spec.parameters[name].default) == value)


def report_misread(
    trees: Sequence[BoundTree], collector: FindingCollector, skipped: Iterable[BoundNode] = ()
) -> None:
    """Report skippable children below a node that treats a skip as an interruption.

    Args:
        trees: The trees.
        collector: Receives the findings.
        skipped: Further nodes that are declared as skippable by themselves.
    """
    skipping = SkipAnalysis(trees, skipped)
    if not skipping.possible:
        return
    for bound in [bound for tree in trees for bound in tree.nodes]:
        if bound.oneshot is not None and skipping.of(bound):
            message = f"oneshot: '{bound.name}' can be skipped, which OneShot treats as an interruption"
            hint = "use a <RunOnce> instead"
            collector.add("skip-misread", message, bound.element, name="oneshot", hint=hint)
        if bound.spec.misreads_skips:
            _report_children(bound, skipping, collector)


def _report_children(bound: BoundNode, skipping: SkipAnalysis, collector: FindingCollector) -> None:
    for child in bound.children:
        if skipping.of(child):
            message = f"'{child.name}' can be skipped, which <{bound.element.tag}> treats as an interruption"
            advice = bound.spec.skipping.advice
            hint = f"write {advice} instead" if advice else "let the child succeed or fail instead"
            collector.add("skip-misread", message, child.element, hint=hint)
