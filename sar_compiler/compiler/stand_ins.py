"""Stand-ins, in runs without a robot, for controls and decorators that only a model describes."""

from collections.abc import Mapping

from sar_compiler.errors import UndecidableError
from sar_compiler.nodes.binding.bound import Binding, BoundNode
from sar_compiler.nodes.binding.skips import by_itself
from sar_compiler.nodes.palettes import palettes_with
from sar_compiler.nodes.spec import NodeSpec
from sar_compiler.tree.diagnostic import Diagnostic


class OnlyDescribedError(UndecidableError):
    """A tree has controls or decorators that only a model describes, and they have no stand-ins.

    Attributes:
        findings: Where they are.
    """

    def __init__(self, nodes: list[BoundNode]) -> None:
        self.findings = tuple(map(_finding, {node.spec.tag: node for node in reversed(nodes)}.values()))[::-1]
        super().__init__("\n".join(finding.render() for finding in self.findings))


def _finding(bound: BoundNode) -> Diagnostic:
    tag, element = bound.spec.tag, bound.element
    message = f"<{tag}> is only described by a model, and when it ticks its children is not known"
    palettes = " or ".join(palettes_with(tag))
    known = f", or the palette that knows it (--model {palettes})" if palettes else ""
    hint = (
        f"load the module that has it (--nodes PKG.MOD){known}; or say in the scenario or the file of properties which node "
        f"replaces it: controls: {{{tag}: ...}}"
    )
    return Diagnostic("only-described", message, element.source, element.tag_span(), hint=hint)


def described(binding: Binding) -> list[BoundNode]:
    """Return the controls and decorators of a tree that only a model describes."""
    return [node for node in binding.nodes() if node.spec.is_only_described and not node.spec.kind.is_leaf]


def put_in_place(binding: Binding, controls: Mapping[str, NodeSpec]) -> None:
    """Put other nodes in the place of those that are only described, with the defaults of their attributes.

    Args:
        binding: The tree, which is changed.
        controls: The stand-in for each tag; it can have the children of all nodes with that tag.
    """
    for tree in binding.trees():
        for node in tree.nodes:
            if node.spec.is_only_described and node.spec.tag in controls:
                node.spec, node.values, node.keys = controls[node.spec.tag], {}, {}
                tree.skips = tree.skips or by_itself(node)
