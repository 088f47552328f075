"""The XML schema of tree files, generated from the registry."""

import functools
from collections.abc import Collection, Iterable
from pathlib import Path

from sar_compiler.nodes.binding.attributes import CONDITIONS, NOTES, ONESHOT, ONESHOT_HELP, ONESHOT_TYPE
from sar_compiler.nodes.registry import Registry
from sar_compiler.nodes.schemas import attributes_by_name, value_types
from sar_compiler.nodes.spec import Kind, NodeSpec, Parameter, ParameterRole
from sar_compiler.nodes.values import CONDITION, ValueType
from sar_compiler.tree.model import SUBTREE_TAG

_END = "</xs:schema>\n"


_TEXT_ESCAPES = str.maketrans({"&": "&amp;", "<": "&lt;", ">": "&gt;"})
_ESCAPES = {**_TEXT_ESCAPES, **str.maketrans({'"': "&quot;", "'": "&#x27;"})}
_NOTES = '    <xs:attributeGroup ref="notes"/>'
_EXPLICIT = frozenset(kind.value for kind in Kind)


def xml_schema(
    registry: Registry,
    described: Iterable[NodeSpec] = (),
    only: Collection[str] | None = None,
    notes: Iterable[str] = NOTES,
) -> str:
    """Return the schema (XSD 1.0) of the files that may be written with a registry.

    Args:
        registry: The registered nodes.
        described: The specs of nodes that are only described by a model.
        only: The tags to include, for a file that has no other tags; None for all tags.
        notes: The attributes in which editors store notes; XSD 1.0 cannot allow all names that begin with `_`.
    """
    tags = (
        registry.by_tag()
        if only is None
        else {tag: registry.variants(tag) for tag in only if tag in registry}
    )
    for spec in described:
        if only is None or spec.tag in only:
            tags.setdefault(spec.tag, [spec])
    lines = [*_editor_notes(notes), *_group(tags), *_common()]
    for value_type in value_types(tags):
        lines += _value_type(value_type)
    lines += _named_type(ONESHOT, _enumeration(ONESHOT_TYPE.choices))
    for tag, specs in tags.items():
        lines += _node_type(tag, specs)
    return _frame() + "\n".join([*lines, _END])


@functools.cache
def _frame() -> str:
    return Path(__file__).with_name("frame.xsd").read_text("utf-8").removesuffix(_END)


def _editor_notes(names: Iterable[str]) -> list[str]:
    attributes = [f'    <xs:attribute name="{name}" type="xs:string"/>' for name in names]
    return ['  <xs:attributeGroup name="notes">', *attributes, "  </xs:attributeGroup>"]


def _group(tags: Iterable[str]) -> list[str]:
    tags = list(tags)
    elements = [f'      <xs:element name="{tag}" type="{tag}.node"/>' for tag in tags]
    elements.append(f'      <xs:element name="{SUBTREE_TAG}" type="subtree"/>')
    # A node's own tag takes precedence over the explicit form of the same name (py_trees' Condition).
    elements += [
        f'      <xs:element name="{kind.value}" type="explicit"/>' for kind in Kind if kind.value not in tags
    ]
    return ['  <xs:group name="node">', "    <xs:choice>", *elements, "    </xs:choice>", "  </xs:group>"]


def _common() -> list[str]:
    described = [
        (ONESHOT, ONESHOT, ONESHOT_HELP),
        *((name, CONDITION.name, text) for name, text in CONDITIONS.items()),
    ]
    lines = [_NOTES]
    for name, value_type, text in described:
        lines.append(f'    <xs:attribute name="{name}" type="{value_type}.value">')
        lines += [*_documentation(text, "      "), "    </xs:attribute>"]
    return ['  <xs:attributeGroup name="common">', *lines, "  </xs:attributeGroup>"]


def _node_type(tag: str, specs: list[NodeSpec]) -> list[str]:
    if tag in _EXPLICIT:
        return _either_form(tag, specs[0])
    kind = specs[0].kind
    # In an element without children, XSD rejects even a line break unless its content is "mixed".
    mixed = ' mixed="true"' if kind.is_leaf else ""
    lines = [f'  <xs:complexType name="{tag}.node"{mixed}>', *_documentation(specs[0].doc, "    ")]
    least, most = specs[0].child_count
    limit = "unbounded" if most is None else most
    if not kind.is_leaf:
        lines.append(f'    <xs:group ref="node" minOccurs="{least}" maxOccurs="{limit}"/>')
    for choices in attributes_by_name(specs).values():
        spec, parameter = choices[0]
        lines += _attribute(spec, parameter, always=len(choices) == len(specs))
    return [*lines, '    <xs:attributeGroup ref="common"/>', "  </xs:complexType>"]


def _either_form(tag: str, spec: NodeSpec) -> list[str]:
    """Return the type of a tag that names a node and is also an explicit form, such as py_trees' Condition."""
    return [
        f'  <xs:complexType name="{tag}.node">',
        *_documentation(spec.doc, "    "),
        '    <xs:group ref="node" minOccurs="0" maxOccurs="unbounded"/>',
        '    <xs:attribute name="ID" type="name"/>',
        '    <xs:anyAttribute processContents="skip"/>',
        "  </xs:complexType>",
    ]


def _attribute(spec: NodeSpec, parameter: Parameter, *, always: bool) -> list[str]:
    head = f'    <xs:attribute name="{parameter.name}"'
    value_type = parameter.value_type
    if parameter.name in spec.implied_values:
        allowed = _enumeration(spec.fixed_value_names(parameter))
        return [f"{head}>", *_simple_type("      ", "", allowed), "    </xs:attribute>"]
    if parameter.role is ParameterRole.NAME:
        head += ' type="xs:string"'
    elif parameter.role is not ParameterRole.ATTRIBUTE:
        head += ' type="name"'
    else:
        head += f' type="{value_type.name}.value"'
    if parameter.required and always and parameter.role is ParameterRole.ATTRIBUTE:
        head += ' use="required"'
    if not parameter.help:
        return [f"{head}/>"]
    return [f"{head}>", *_documentation(parameter.help, "      "), "    </xs:attribute>"]


def _value_type(value_type: ValueType) -> list[str]:
    """Return the schema type of a value: a literal or a blackboard key."""
    if value_type.choices:
        literal = _enumeration(value_type.choices)
    elif value_type.pattern:
        literal = [f'<xs:pattern value="{value_type.pattern.translate(_ESCAPES)}"/>']
    else:
        return _named_type(value_type.name, [])
    union = ['<xs:union memberTypes="key">', *_simple_type("  ", "", literal), "</xs:union>"]
    return [
        f'  <xs:simpleType name="{value_type.name}.value">',
        *(f"    {line}" for line in union),
        "  </xs:simpleType>",
    ]


def _named_type(name: str, facets: list[str]) -> list[str]:
    return _simple_type("  ", f' name="{name}.value"', facets)


def _simple_type(indent: str, name: str, facets: list[str]) -> list[str]:
    inner = [f"    {facet}" for facet in facets]
    lines = [f"<xs:simpleType{name}>", '  <xs:restriction base="xs:string">', *inner, "  </xs:restriction>"]
    return [f"{indent}{line}" for line in [*lines, "</xs:simpleType>"]]


def _enumeration(texts: Iterable[str]) -> list[str]:
    return [f'<xs:enumeration value="{text.translate(_ESCAPES)}"/>' for text in texts]


def _documentation(text: str, indent: str) -> list[str]:
    if not text:
        return []
    return [
        f"{indent}<xs:annotation>",
        f"{indent}  <xs:documentation>{text.translate(_TEXT_ESCAPES)}</xs:documentation>",
        f"{indent}</xs:annotation>",
    ]
