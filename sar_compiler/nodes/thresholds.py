"""Counts of a Parallel that its children cannot reach."""

from sar_compiler.nodes.bound import BoundNode
from sar_compiler.nodes.collector import Collector

# By tag, the attributes that count children; negative ones count from the end, and fit always.
_COUNTS = {
    "Parallel": ("success_count", "failure_count"),
    "ParallelAll": ("max_failures",),
}


def report_out_of_reach(bound: BoundNode, collector: Collector) -> None:
    """Report a count that is larger than the number of children."""
    for name in _COUNTS.get(bound.spec.tag, ()):
        wanted, there = bound.values.get(name), len(bound.element.children)
        if isinstance(wanted, int) and wanted > there > 0:
            message = f"{name}: {wanted} of {there} children can never be"
            collector.value(bound.element, name, "out-of-reach", message, suggestion=str(there))
