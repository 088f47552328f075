"""Names that do not distinguish nodes, or that read as something else."""

import re
from collections.abc import Iterator, Sequence

from sar_compiler.checks.rules.check_context import CheckContext
from sar_compiler.nodes.binding.bound import BoundNode
from sar_compiler.tree.diagnostic import Diagnostic

# One with a blank beside it is punctuation.
_SEPARATOR = re.compile(r"(?<=\S)[/.](?=\S)")
_SEPARATES = {
    "/": "separates the names of a path: scenarios, properties and py_trees' blackboard take it for two names",
    ".": "separates a key from its attributes on py_trees' blackboard, whose tools take it for two names",
}


def check_names(context: CheckContext) -> Iterator[Diagnostic]:
    """Yield siblings that were explicitly given the same name, and names that read as a path."""
    for tree in context.trees if context.sound and not context.is_foreign else ():
        yield from _separated(tree.nodes)
        for bound in tree.parents:
            children = bound.children
            if len(children) > 1 and len({child.name for child in children}) < len(children):
                yield from _same(children)


def _separated(nodes: Sequence[BoundNode]) -> Iterator[Diagnostic]:
    for bound in nodes:
        found = _SEPARATOR.search(bound.name)
        if found is None or "name" not in bound.element.attributes:
            continue
        sign = found[0]
        message = f"'{bound.name}' has a '{sign}', which {_SEPARATES[sign]}"
        hint = f"write '_' instead of '{sign}'"
        yield bound.element.finding("separator-in-name", message, value="name", hint=hint)


def _same(children: Sequence[BoundNode]) -> Iterator[Diagnostic]:
    first: dict[str, BoundNode] = {}
    for child in children:
        if not child.element.attributes.get("name") or child.subtree is not None:
            continue
        other = first.setdefault(child.name, child)
        if other is not child:
            message = (
                f"'{child.name}' is also the name of the node in line {other.element.line} beside it: drawings, logs "
                "and references cannot tell the two apart"
            )
            hint = "give each a name of its own"
            yield child.element.finding("same-name", message, value="name", hint=hint)
