"""Writer of the section `TreeNodesModel` for BehaviorTree.CPP and Groot2.

`nodes.models` reads the same format.
"""

from collections.abc import Iterable, Sequence
from datetime import timedelta
from enum import Enum

from sar_compiler.nodes.models import LIBRARY, METADATA_TAG
from sar_compiler.nodes.registry import is_library_tag
from sar_compiler.nodes.spec import Direction, NodeSpec, Parameter, ParameterRole
from sar_compiler.nodes.values import as_text
from sar_compiler.tree.model import MODEL_TAG, ROOT_TAG, Element, synthetic_element, synthetic_file
from sar_compiler.tree.xml_writer import write_xml


def palette(specs: Iterable[NodeSpec]) -> str:
    """Return a file for Groot2 that describes all nodes that are not built into BehaviorTree.CPP."""
    return palette_of(describe(specs))


def palette_of(models: Element) -> str:
    """Return a file for Groot2 with a `TreeNodesModel`."""
    return write_xml(synthetic_file(synthetic_element(ROOT_TAG, {"BTCPP_format": "4"}, [models])))


def describe(specs: Iterable[NodeSpec]) -> Element:
    """Return the `TreeNodesModel` of nodes. Nodes that are built into BehaviorTree.CPP are left out."""
    by_tag: dict[str, list[NodeSpec]] = {}
    for spec in specs:
        by_tag.setdefault(spec.tag, []).append(spec)
    return synthetic_element(
        MODEL_TAG,
        children=[description(variants) for variants in by_tag.values() if not is_built_in(variants)],
    )


def is_built_in(specs: Sequence[NodeSpec]) -> bool:
    """Return whether a node is built into BehaviorTree.CPP. Groot2 needs no model of such a node."""
    return any(spec.semantics.counterpart.built_in for spec in specs)


def description(specs: Sequence[NodeSpec]) -> Element:
    """Return the model of a tag, with the ports of all its specs."""
    ports = {
        parameter.name: _port(parameter, spec)
        for spec in specs
        for parameter in spec.attributes
        if parameter.role is not ParameterRole.NAME and parameter.name not in spec.implied_values
    }
    notes = [_LIBRARY] if is_library_tag(specs[0].tag) else []
    attributes = {"ID": specs[0].tag, "editable": "true"}
    return synthetic_element(specs[0].kind.value, attributes, [*ports.values(), *notes])


_LIBRARY = synthetic_element(METADATA_TAG, children=[synthetic_element("Metadata", LIBRARY)])


def inferred_model(kind: str, tag: str, ports: Iterable[str]) -> Element:
    """Return the model of an unknown node, derived from its use in a tree."""
    inputs = [synthetic_element(Direction.INPUT.value, {"name": port}) for port in ports]
    return synthetic_element(kind, {"ID": tag, "editable": "true"}, inputs)


def _port(parameter: Parameter, spec: NodeSpec) -> Element:
    attributes = {"name": parameter.name}
    if parameter.value_type.cpp:
        attributes["type"] = parameter.value_type.cpp
    if not parameter.required and parameter.default is not None and parameter.name not in spec.implied_values:
        attributes["default"] = value_text(parameter.default)
    return synthetic_element((parameter.direction or Direction.INPUT).value, attributes, text=_doc(parameter))


def _doc(parameter: Parameter) -> str:
    if parameter.role is not ParameterRole.REFERENCE:
        return parameter.doc
    return f"{parameter.doc} The name of a {parameter.target_name} node.".lstrip()


def value_text(value: object) -> str:
    """Return a value in the notation of tree files."""
    if isinstance(value, Enum):
        return value.name
    if isinstance(value, timedelta):
        return f"{value.total_seconds():g}"
    if isinstance(value, (list, tuple)):
        return ";".join(value_text(item) for item in value)
    if isinstance(value, bool):
        return as_text(value)
    return str(value)
