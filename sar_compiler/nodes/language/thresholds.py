"""Check of a Parallel's counts against its number of children."""

from sar_compiler.nodes.binding.bound import BoundNode
from sar_compiler.nodes.binding.collector import Collector
from sar_compiler.nodes.spec import Rule


def within_reach(*names: str) -> Rule:
    """Return a rule: these attributes must not exceed the number of children.

    Negative counts are relative to the number of children, and always valid.
    """

    def rule(bound: BoundNode, collector: Collector) -> None:
        there = len(bound.element.children)
        for name in names:
            wanted = bound.values.get(name)
            if isinstance(wanted, int) and wanted > there > 0:
                message = f"{name}: {wanted} of {there} children can never be"
                collector.value(bound.element, name, "out-of-reach", message, suggestion=str(there))

    return rule
