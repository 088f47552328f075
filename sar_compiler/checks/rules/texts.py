"""Texts that were probably meant as keys."""

from collections.abc import Iterator

from sar_compiler.checks.rules.check_context import CheckContext, warning
from sar_compiler.nodes.binding.attributes import closed
from sar_compiler.nodes.binding.bound import BoundNode
from sar_compiler.nodes.spec import NodeSpec, Role
from sar_compiler.tree.diagnostic import Diagnostic


def check_texts(context: CheckContext) -> Iterator[Diagnostic]:
    """Yield texts that begin or end like a key."""
    texts = {id(spec): names for spec in context.bound.specs if (names := _texts(spec))}
    for tree in context.trees:
        for bound in tree.nodes if texts else ():
            names = texts.get(id(bound.spec), [])
            if names and bound.values:
                yield from _unclosed(bound, names)
        for use in tree.uses:
            yield from _unclosed(
                use, [name for name in use.remapping.constants if name in use.element.attributes]
            )


def _texts(spec: NodeSpec) -> list[str]:
    """Return the attributes of a node that take any text."""
    types = ((p.name, p.value_type) for p in spec.parameters.values() if p.role is Role.ATTRIBUTE)
    return [name for name, value_type in types if value_type is not None and value_type.python in (str, None)]


def _unclosed(bound: BoundNode, names: list[str]) -> Iterator[Diagnostic]:
    element = bound.element
    for name in names:
        suggestion = closed(element.attributes.get(name, ""))
        if suggestion is not None:
            message = f"{name}: '{element.attributes[name]}' is a text; a key of the blackboard is written between two braces"
            span = element.value_span(name)
            yield warning("unclosed-key", message, bound, span, suggestion)
