"""The JSON schema of tree files in YAML, generated from the registry.

Editors use it for completion, and other tools for validation. A node is a mapping with one key, its tag. Therefore
`properties` and `maxProperties` define the allowed content. With alternatives (`oneOf`) between nodes, every message would
be "is not valid under any of the given schemas".
"""

from collections.abc import Iterable, Mapping
from typing import Any
from urllib.parse import quote

from sar_compiler.nodes.binding.attributes import CONDITIONS, ONESHOT, ONESHOT_HELP, ONESHOT_TYPE
from sar_compiler.nodes.registry import Registry
from sar_compiler.nodes.schemas import attributes_by_name, required_names, value_types
from sar_compiler.nodes.spec import CHILD_COUNTS, Kind, NodeSpec, Parameter, ParameterRole
from sar_compiler.nodes.values import CONDITION, ValueType
from sar_compiler.runtime.expressions import Script
from sar_compiler.tree.model import CHILDREN_KEY, INCLUDE_TAG, MODEL_TAG, ROOT_TAG, SUBTREE_TAG, TREE_TAG

Schema = dict[str, Any]


def _ref(definition: str) -> Schema:
    """Return a reference to a definition, encoded as a URI."""
    return {"$ref": f"#/$defs/{quote(definition)}"}


_KINDS = sorted(kind.value for kind in Kind)
"""The tags of nodes in explicit form."""

_KEY_PATTERN = r"^ *(\{.+\}|=) *$"
_NAME: Schema = {"type": ["string", "number", "boolean"], "minLength": 1}
_SCALAR: Schema = {"type": ["string", "number", "boolean"]}
_NOTES: Schema = {"patternProperties": {"^_": _SCALAR}}
"""The schema of attributes that begin with `_`, in which editors store notes."""
_COMMON: dict[str, Schema] = {
    ONESHOT: {"enum": list(ONESHOT_TYPE.choices), "description": ONESHOT_HELP},
    **{name: {**_ref(f"value.{CONDITION.name}"), "description": text} for name, text in CONDITIONS.items()},
}
"""The attributes that any node may have."""


def json_schema(registry: Registry) -> Schema:
    """Return the schema (draft 2020-12) of the YAML files that may be written with a registry."""
    tags = registry.by_tag()
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "$comment": "Generated from the node registry by `make schemas`; do not edit.",
        "title": "A file with behaviour trees",
        **_mapping({ROOT_TAG: _ref("root")}, required=[ROOT_TAG]),
        "$defs": {
            "root": _root(),
            "section": _section(),
            "tree": _with_children({"ID": _NAME}, _nodes(1, 1)),
            **{f"value.{value_type.name}": _value(value_type) for value_type in value_types(tags)},
            **_COMMON,
            "node": _node(tags),
            "model": {"type": ["object", "null"]},
            SUBTREE_TAG: _explicit_form(0, 0),
            # <Condition> is a py_trees node, or with an ID the explicit form of another node.
            **{
                f"explicit.{kind.value}": _explicit_form(*((0, None) if kind.value in tags else count))
                for kind, count in CHILD_COUNTS.items()
            },
            **{f"tag.{tag}": _tag(specs) for tag, specs in tags.items() if tag not in _KINDS},
        },
    }


def _root() -> Schema:
    attributes = {
        "BTCPP_format": {"enum": [4, "4"]},
        "main_tree_to_execute": _NAME,
        "project_name": {"type": "string"},
    }
    return _with_children(attributes, {"type": "array", "items": _ref("section"), "minItems": 1})


def _section() -> Schema:
    written = {"path": _NAME, "ros_pkg": _NAME, CHILDREN_KEY: _nodes(0, 0)}
    include = {**_mapping(written, required=["path"]), **_NOTES}
    return {
        **_mapping({TREE_TAG: _ref("tree"), INCLUDE_TAG: include, MODEL_TAG: _ref("model")}),
        "minProperties": 1,
        "maxProperties": 1,
    }


def _node(specs: Mapping[str, list[NodeSpec]]) -> Schema:
    """Return the schema of a node.

    In YAML, a node is a mapping whose only key is the tag, or the bare tag of a node without content.
    """
    tags = list(dict.fromkeys([*specs, SUBTREE_TAG, *_KINDS]))
    targets = {tag: _ref(_definition(tag)) for tag in tags}
    # `enumDescriptions` is not a keyword of JSON Schema, but editors show it for a bare tag.
    described = [specs[tag][0].doc if tag in specs else "" for tag in tags]
    return {
        "type": ["object", "string"],
        "if": {"type": "string"},
        "then": {"enum": tags, "enumDescriptions": described},
        "else": {
            "properties": targets,
            "additionalProperties": False,
            "minProperties": 1,
            "maxProperties": 1,
        },
    }


def _definition(tag: str) -> str:
    return tag if tag == SUBTREE_TAG else f"explicit.{tag}" if tag in _KINDS else f"tag.{tag}"


def _nodes(least: int, most: int | None) -> Schema:
    """Return the schema of a list of nodes whose length is limited."""
    schema: Schema = {"type": "array", "items": _ref("node")}
    if least:
        schema["minItems"] = least
    return schema if most is None else {**schema, "maxItems": most}


def _explicit_form(least: int, most: int | None) -> Schema:
    """Return the schema of a tag whose ID names a node or a tree.

    The ID determines which other attributes are allowed.
    """
    needed = ["ID", CHILDREN_KEY] if least else [] if most is None else ["ID"]
    properties = {"ID": _NAME, CHILDREN_KEY: _nodes(least, most)}
    return {"type": "object", "properties": properties, **({"required": needed} if needed else {})}


def _tag(specs: list[NodeSpec]) -> Schema:
    kind = specs[0].kind
    written = attributes_by_name(specs)
    attributes = {name: _attribute(*choices[0]) for name, choices in written.items()}
    required = required_names(specs)
    attributes |= {name: _ref(name) for name in _COMMON}
    if kind.is_leaf:
        schema = {**_mapping({**attributes, CHILDREN_KEY: _nodes(0, 0)}, required), **_NOTES}
        if not required:  # a bare tag or an empty value has no attributes
            schema["type"] = ["object", "null"]
    else:
        schema = _with_children(attributes, _nodes(*specs[0].child_count), required)
    if specs[0].doc:
        schema["description"] = specs[0].doc
    return schema


def _attribute(spec: NodeSpec, parameter: Parameter) -> Schema:
    if parameter.role is ParameterRole.NAME:
        schema: Schema = dict(_SCALAR)
    elif parameter.role is not ParameterRole.ATTRIBUTE:
        schema = dict(_NAME)
    elif parameter.name in spec.implied_values:
        schema = {"enum": _both_ways(spec.fixed_value_names(parameter))}
    else:
        schema = _ref(f"value.{parameter.value_type.name}")
    if parameter.help:
        schema["description"] = parameter.help
    return schema


def _value(value_type: ValueType) -> Schema:
    """Return the schema of a value.

    A value is a literal of the type or a blackboard key, written as a string or a YAML scalar.
    """
    key: Schema = {"type": "string", "pattern": _KEY_PATTERN}
    if value_type.choices:
        return {"anyOf": [{"enum": _both_ways(value_type.choices)}, key]}
    if value_type.pattern and value_type.python is Script:
        return {**_SCALAR, "pattern": f"^({value_type.pattern})$", "description": value_type.label}
    if value_type.pattern:
        text = {"type": "string", "pattern": f"^({value_type.pattern})$"}
        return {"anyOf": [_number(value_type), text, key], "description": value_type.label}
    if value_type.takes_braces:
        return {"type": [*_SCALAR["type"], "object"], "description": value_type.label}
    return dict(_SCALAR)


def _number(value_type: ValueType) -> Schema:
    schema: Schema = {"type": "integer" if value_type.python is int else "number"}
    if value_type.least is not None:
        schema["minimum"] = value_type.least
    return schema if value_type.most is None else {**schema, "maximum": value_type.most}


def _both_ways(texts: Iterable[str]) -> list[object]:
    """Return texts as allowed values. The values `true` and `false` are also allowed as YAML bools."""
    own: dict[str, object] = {"true": True, "false": False}
    texts = list(texts)
    return [*(own[text] for text in texts if text in own), *texts]


def _with_children(attributes: Schema, children: Schema, required: Iterable[str] = ()) -> Schema:
    """Return the schema of a tag that requires children."""
    return {**_mapping({**attributes, CHILDREN_KEY: children}, [*required, CHILDREN_KEY]), **_NOTES}


def _mapping(properties: Schema, required: Iterable[str] = ()) -> Schema:
    schema: Schema = {"type": "object", "properties": properties, "additionalProperties": False}
    names = list(required)
    return {**schema, "required": names} if names else schema
