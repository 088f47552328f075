"""Counts of a Parallel that its children cannot reach."""

from sar_compiler.nodes.binding.bound import BoundNode
from sar_compiler.nodes.binding.collector import Collector
from sar_compiler.nodes.spec import Rule


def within_reach(*names: str) -> Rule:
    """Return a rule: what these attributes count must not be more than there are children.

    Negative counts are from the end, and fit always.
    """

    def rule(bound: BoundNode, collector: Collector) -> None:
        there = len(bound.element.children)
        for name in names:
            wanted = bound.values.get(name)
            if isinstance(wanted, int) and wanted > there > 0:
                message = f"{name}: {wanted} of {there} children can never be"
                collector.value(bound.element, name, "out-of-reach", message, suggestion=str(there))

    return rule
