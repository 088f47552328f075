"""What depends on the version of BehaviorTree.CPP that trees are for, and that binding has not found."""

from collections.abc import Iterator

from sar_compiler.checks.rules.check_context import CheckContext, warning
from sar_compiler.nodes.binding.collector import Collector
from sar_compiler.nodes.binding.tree_ids import fault_of
from sar_compiler.nodes.btcpp.versions import NAMES, VERSIONS
from sar_compiler.tree.diagnostic import Diagnostic


def check_versions(context: CheckContext) -> Iterator[Diagnostic]:
    """Yield IDs of trees that newer versions refuse, and nodes that older ones do not have."""
    collector = Collector(context.btcpp)
    for tree in (tree for tree_file in context.forest.files for tree in tree_file.trees):
        fault = fault_of(tree.attributes.get("ID", ""))
        if fault is not None:
            message, hint = fault
            collector.refused_since(NAMES, tree, tree.value_span("ID"), message, hint)
    yield from collector.findings
    since = {spec.tag: spec.semantics.counterpart.since for spec in context.bound.specs}
    later = {tag for tag, version in since.items() if version and VERSIONS[version] > context.btcpp}
    for bound in (bound for tree in context.trees for bound in tree.nodes if later):
        tag = bound.spec.tag
        if tag in later:
            message = (
                f"BehaviorTree.CPP has <{tag}> since {since[tag]}, and these trees are for {context.btcpp}"
            )
            yield warning(
                "btcpp-version", message, bound, hint="do without it, or have them run by a newer one"
            )
