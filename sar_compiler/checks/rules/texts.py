"""Values that nodes take, and that were hardly meant: texts in place of keys, and numbers that make no sense."""

from collections.abc import Iterator

from sar_compiler.checks.rules.check_context import CheckContext
from sar_compiler.nodes.binding.attributes import closed
from sar_compiler.nodes.binding.bound import BoundNode
from sar_compiler.nodes.numbers import SensibleNumbers
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
            yield element.finding("unclosed-key", message, value=name, suggestion=suggestion)


def check_bounds(context: CheckContext) -> Iterator[Diagnostic]:
    """Yield numbers that make no sense to a node, though it takes them."""
    bounded = {id(spec): found for spec in context.bound.specs if (found := _bounds(spec))}
    for tree in context.trees if bounded else ():
        for bound in tree.nodes:
            if bound.values and id(bound.spec) in bounded:
                yield from _beyond(bound, bounded[id(bound.spec)])


def _bounds(spec: NodeSpec) -> dict[str, SensibleNumbers]:
    types = ((parameter.name, parameter.value_type) for parameter in spec.parameters.values())
    return {name: each.usual for name, each in types if each is not None and each.usual is not None}


def _beyond(bound: BoundNode, bounded: dict[str, SensibleNumbers]) -> Iterator[Diagnostic]:
    for name, bounds in bounded.items():
        number = bound.values.get(name)
        if number is not None and number not in bounds:
            written = bound.element.attributes[name]
            message = f"{name}: <{bound.spec.tag}> takes {written}, and can do nothing sensible with it"
            yield bound.element.finding("out-of-range", message, value=name, hint=f"write a number, {bounds}")
