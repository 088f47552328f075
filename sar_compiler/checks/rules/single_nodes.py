"""Rules about a single node: its class, its name, and values of its attributes that are probably unintended."""

import math
import re
from collections.abc import Iterator, Sequence

from sar_compiler.checks.rules import CheckContext
from sar_compiler.nodes.binding.attributes import complete_key_braces
from sar_compiler.nodes.binding.bound import BoundNode
from sar_compiler.nodes.numbers import (
    UNITS,
    PlausibleRange,
    convert_mistaken,
    find_implausible_number,
    unit_of_key,
)
from sar_compiler.nodes.spec import NodeSpec, ParameterRole
from sar_compiler.tree.diagnostic import Diagnostic

_FORMER_KEY = r"(?a) *\$(\{@?[A-Za-z_]\w*\}) *"


def check_classes(context: CheckContext) -> Iterator[Diagnostic]:
    """Yield a finding about the first node of each abstract class, which cannot be instantiated."""
    abstract = {spec.tag: spec for spec in context.bound_forest.specs if spec.absent_methods}
    for bound in (node for tree in context.bound_forest.trees for node in tree.nodes if abstract):
        spec = abstract.pop(bound.spec.tag, None)
        if spec is not None:
            message, hint = (
                f"<{spec.tag}> cannot be created: {_missing_in(spec)}",
                "define the missing method in the class",
            )
            yield bound.element.finding("constructor-failed", message, hint=hint)


def _missing_in(spec: NodeSpec) -> str:
    methods = " and ".join(f"{name}()" for name in spec.absent_methods)
    return f"its class {spec.factory_path.replace(':', '.')} has no {methods}"


def check_strings(context: CheckContext) -> Iterator[Diagnostic]:
    """Yield findings about strings that resemble a key, because they begin or end like a key in braces."""
    for bound, names in context.nodes_with(_string_attributes):
        if bound.values:
            yield from _check_braces(bound, names)
    for use in (use for tree in context.trees for use in tree.uses):
        yield from _check_braces(
            use, [name for name in use.remapping.constants if name in use.element.attributes]
        )


def _string_attributes(spec: NodeSpec) -> list[str]:
    """Return the attributes of a node that accept any string."""
    attributes = (each for each in spec.parameters.values() if each.role is ParameterRole.ATTRIBUTE)
    return [each.name for each in attributes if each.value_type.python in (str, None)]


def _check_braces(bound: BoundNode, names: list[str]) -> Iterator[Diagnostic]:
    element = bound.element
    for name in names:
        written = element.attributes.get(name, "")
        suggestion, message = complete_key_braces(written), "a blackboard key is written in braces"
        if suggestion is None and (former := re.fullmatch(_FORMER_KEY, written)):
            suggestion, message = former[1], "$ before a key is the syntax of BehaviorTree.CPP 3"
        if suggestion is not None:
            message = f"{name}: '{written}' is read as a string, but {message}"
            yield element.finding("unclosed-key", message, value=name, suggestion=suggestion)


def check_bounds(context: CheckContext) -> Iterator[Diagnostic]:
    """Yield findings about numbers that a node accepts, but that are outside of the plausible range."""
    for bound, bounds_of in context.nodes_with(_bounds):
        for name, bounds in bounds_of.items():
            number = bound.values.get(name)
            if number is not None and number not in bounds:
                written = bound.element.attributes[name]
                message = f"{name}: {written} is not a plausible value for <{bound.spec.tag}>"
                yield bound.element.finding(
                    "out-of-range", message, value=name, hint=f"write a number {bounds}"
                )


def _bounds(spec: NodeSpec) -> dict[str, PlausibleRange]:
    return {each.name: each.value_type.usual for each in spec.parameters.values() if each.value_type.usual}


def check_units(context: CheckContext) -> Iterator[Diagnostic]:
    """Yield findings about numbers of unusual magnitude, given the unit of their attribute."""
    for bound, units in context.nodes_with(_units):
        for name, unit in units.items():
            number = bound.values.get(name)
            if not isinstance(number, int | float) or not math.isfinite(number):
                continue
            if find_implausible_number(abs(number), unit) is not None:
                written = bound.element.attributes[name]
                usual = f"{UNITS[unit].words} are usually {UNITS[unit].usual}"
                message = f"{name}: {written} is unusual, because {usual}"
                hint = convert_mistaken(written, unit) or None
                yield bound.element.finding("out-of-range", message, value=name, hint=hint)


def _units(spec: NodeSpec) -> dict[str, str]:
    """Return the units of a node's numeric attributes, by attribute name."""
    numbers = (each for each in spec.attributes if each.value_type.python in (int, float))
    units = {each.name: each.value_type.unit or unit_of_key(each.name) for each in numbers}
    return {name: unit for name, unit in units.items() if unit}


# A separator next to a blank is punctuation.
_SEPARATOR = r"(?<=\S)[/.](?=\S)"
_SEPARATES = {
    "/": "separates the names of a path, so scenarios, properties and py_trees' blackboard read it as two names",
    ".": "separates a key from its attributes on py_trees' blackboard, so py_trees' tools read it as two names",
}


def check_names(context: CheckContext) -> Iterator[Diagnostic]:
    """Yield findings about siblings that have the same explicit name, and about names that look like a path."""
    for tree in context.trees if context.is_complete and not context.is_foreign else ():
        yield from _check_separators(tree.nodes)
        for bound in tree.parents:
            children = bound.children
            if len(children) > 1 and len({child.name for child in children}) < len(children):
                yield from _check_equal_names(children)


def _check_separators(nodes: Sequence[BoundNode]) -> Iterator[Diagnostic]:
    for bound in nodes:
        found = None if bound.name.isidentifier() else re.search(_SEPARATOR, bound.name)
        if found is None or "name" not in bound.element.attributes:
            continue
        sign = found[0]
        message = f"'{bound.name}' has a '{sign}', which {_SEPARATES[sign]}"
        hint = f"write '_' instead of '{sign}'"
        yield bound.element.finding("separator-in-name", message, value="name", hint=hint)


def _check_equal_names(children: Sequence[BoundNode]) -> Iterator[Diagnostic]:
    first: dict[str, BoundNode] = {}
    for child in children:
        if not child.element.attributes.get("name") or child.subtree is not None:
            continue
        other = first.setdefault(child.name, child)
        if other is not child:
            message = (
                f"'{child.name}' is also the name of its sibling in line {other.element.line}: drawings, logs "
                "and references cannot distinguish these nodes"
            )
            hint = "give each node a different name"
            yield child.element.finding("same-name", message, value="name", hint=hint)
