"""Schemas for editors and validators, generated from a registry."""

from collections.abc import Iterable, Mapping, Sequence

from sar_compiler.nodes.spec import NodeSpec, Parameter
from sar_compiler.nodes.values import CONDITION, ValueType


def attributes_by_name(specs: Iterable[NodeSpec]) -> dict[str, list[tuple[NodeSpec, Parameter]]]:
    """Return the attributes of a tag's specs by name, each with the specs that have this attribute."""
    written: dict[str, list[tuple[NodeSpec, Parameter]]] = {}
    for spec in specs:
        for parameter in spec.attributes:
            written.setdefault(parameter.name, []).append((spec, parameter))
    return written


def required_names(specs: Sequence[NodeSpec]) -> list[str]:
    """Return the names of the attributes that all specs of a tag require."""
    return [
        name
        for name, choices in attributes_by_name(specs).items()
        if len(choices) == len(specs)
        and all(parameter in spec.required_attributes for spec, parameter in choices)
    ]


def value_types(tags: Mapping[str, Iterable[NodeSpec]]) -> list[ValueType]:
    """Return the value types of all attributes of *tags*, sorted by name.

    The type of conditions is always included.
    """
    attributes = (parameter for specs in tags.values() for spec in specs for parameter in spec.attributes)
    types = {each.value_type.name: each.value_type for each in attributes if each.value_type.name}
    return sorted({**types, CONDITION.name: CONDITION}.values(), key=lambda each: each.name)
