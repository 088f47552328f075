"""Fast recognition of files that the XML schema is certain to accept.

Building the schema and importing lxml takes longer than applying all rules. If the rules have no findings, the schema
accepts nearly every file. This module therefore applies the definitions of `nodes.schemas.xml_schema` directly to the
elements of a file. lxml validates only files with unusual content: namespaces, text between elements, models, or special
characters.
"""

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import NamedTuple
from weakref import WeakKeyDictionary

from sar_compiler.nodes.binding.attributes import CONDITIONS, ONESHOT, ONESHOT_TYPE
from sar_compiler.nodes.registry import Registry
from sar_compiler.nodes.schemas import attributes_by_name
from sar_compiler.nodes.spec import Kind, NodeSpec, ParameterRole
from sar_compiler.nodes.values import CONDITION, ValueType
from sar_compiler.tree.diagnostic import Form
from sar_compiler.tree.model import (
    INCLUDE_TAG,
    PROJECT_ATTRIBUTE,
    ROOT_TAG,
    SUBTREE_TAG,
    TREE_TAG,
    Element,
    TreeFile,
)

_LONGEST = 1_000_000
"""The maximum number of characters in a file that this module checks. It is far below the limits of libxml2."""
_SPACE = " \t\r\n"
_ROOT_ATTRIBUTES = ("BTCPP_format", "main_tree_to_execute", PROJECT_ATTRIBUTE)


class _Values(NamedTuple):
    """The strings that an attribute may have as its value.

    Attributes:
        choices: All allowed strings; empty if they cannot be listed.
        pattern: A regular expression that allowed strings match; empty if any string is allowed.
        is_key: Whether a blackboard key is allowed as well.
        least: The minimum length of a string.
    """

    choices: tuple[str, ...] = ()
    pattern: str = ""
    is_key: bool = False
    least: int = 0

    @classmethod
    def from_type(cls, value_type: ValueType) -> "_Values":
        """Return the strings that a value type allows."""
        return cls(value_type.choices, "" if value_type.choices else value_type.pattern, is_key=True)

    def accept(self, text: str) -> bool:
        """Return whether a string is allowed.

        If there is a pattern, strings with non-ASCII characters are never allowed.
        """
        if self.is_key and _is_key(text.strip(" ")):
            return True
        if self.choices:
            return text in self.choices
        return len(text) >= self.least and (
            not self.pattern or (text.isascii() and re.fullmatch(self.pattern, text) is not None)
        )


def _is_key(text: str) -> bool:
    return text == "=" or (text.startswith("{") and text.endswith("}") and text != "{}")


_ANY, _NAME = _Values(), _Values(least=1)
_COMMON = {ONESHOT: _Values(ONESHOT_TYPE.choices), **dict.fromkeys(CONDITIONS, _Values.from_type(CONDITION))}


class _NodeType(NamedTuple):
    """The definition of a tag in the schema.

    Attributes:
        attributes: The allowed strings of each attribute.
        required: The names of the required attributes.
        least: The minimum number of children.
        most: The maximum number of children; None for no limit.
        is_open: Whether any other attribute is allowed.
        types: The allowed strings of each attribute type that has a name.
    """

    attributes: Mapping[str, _Values]
    required: Sequence[str] = ()
    least: int = 0
    most: int | None = None
    is_open: bool = False
    types: Mapping[str, _Values] = {}

    def accepts(self, element: Element) -> bool:
        """Return whether an element's attributes and number of children match the definition."""
        written = element.attributes
        return (
            self.least <= len(element.children)
            and (self.most is None or len(element.children) <= self.most)
            and all(name in written for name in self.required)
            and all(self._accepts(name, text) for name, text in written.items())
        )

    def _accepts(self, name: str, text: str) -> bool:
        values = self.attributes.get(name)
        if values is None and not self.is_open:
            values = _COMMON.get(name, _ANY if name.startswith("_") else None)
            return values is not None and values.accept(text)
        return values is None or values.accept(text)


_SUBTREE = _NodeType({"ID": _NAME}, ("ID",), most=0, is_open=True)
_EXPLICIT = dict.fromkeys((kind.value for kind in Kind), _NodeType({"ID": _NAME}, ("ID",), is_open=True))
_EXPLICIT_OR_NODE = _NodeType({"ID": _NAME}, is_open=True)
_node_types: "WeakKeyDictionary[Registry, dict[str, _NodeType | None]]" = WeakKeyDictionary()


def is_surely_accepted(tree_file: TreeFile, registry: Registry, described: Iterable[NodeSpec] = ()) -> bool:
    """Return whether the schema is certain to accept a file.

    If the result is False, the schema may still accept it.

    Args:
        tree_file: The file.
        registry: The registered nodes.
        described: Nodes that only a model describes.
    """
    root = tree_file.root
    return (
        not tree_file.findings
        and root.tag == ROOT_TAG
        and bool(root.children)
        and all(_is_plain(element) for element in root.iterate())
        and _is_plain_text(tree_file)
        and _are_attributes(root, _ROOT_ATTRIBUTES)
        and root.attributes.get("BTCPP_format", "4") == "4"
        and all(map(_is_section, root.children))
        and _are_unique([tree.attributes["ID"] for tree in tree_file.trees if "ID" in tree.attributes])
        and _are_nodes([*_nodes_of(tree_file)], _editor_attributes(root), registry, described)
    )


def _is_plain(element: Element) -> bool:
    """Return whether an element has no text, and all XML parsers read its attributes in the same way."""
    return not element.text and all(
        name.isidentifier() and name.isascii() and text.isprintable()
        for name, text in element.attributes.items()
    )


def _is_plain_text(tree_file: TreeFile) -> bool:
    """Return whether a file is short and, if it is XML, consists of tags, comments and white space."""
    text = tree_file.source.text
    if len(text) > _LONGEST:
        return False
    if tree_file.source.form is not Form.XML:
        return True
    if text.startswith("<?xml"):
        declaration, _, text = text.partition("?>")
        if ">" in declaration or not declaration[5:6].isspace():
            return False
    before, *parts = _without_comments(text).split("<")
    return not before.strip(_SPACE) and all(map(_is_tag, parts))


def _without_comments(text: str) -> str:
    before, *parts = text.split("<!--")
    return "".join([before, *(part.partition("-->")[2] for part in parts)])


def _is_tag(part: str) -> bool:
    """Return whether the text between two successive `<` consists of a tag and white space.

    Only values in double quotes may contain a `>`.
    """
    if part.startswith(("!", "?", f"/{INCLUDE_TAG}")):
        return False
    _, end, after = part.partition(">")
    if after.strip(_SPACE):
        pieces = part.split('"')
        *outside, last = pieces[::2]
        _, end, after = last.partition(">")
        if len(pieces) % 2 == 0 or "'" in part or any(">" in each for each in outside):
            return False
    return bool(end) and not after.strip(_SPACE)


def _is_section(element: Element) -> bool:
    written = element.attributes
    if element.tag == TREE_TAG:
        return len(element.children) == 1 and _are_attributes(element, ("ID",)) and written.get("ID") != ""
    return (
        element.tag == INCLUDE_TAG
        and not element.children
        and _are_attributes(element, ("path", "ros_pkg"))
        and bool(written.get("path"))
        and written.get("ros_pkg") != ""
    )


def _are_attributes(element: Element, names: Sequence[str]) -> bool:
    """Return whether an element outside of trees has only the named attributes and the attributes of editors."""
    return all(
        name in names or (name.startswith("_") and name not in CONDITIONS) for name in element.attributes
    )


def _are_unique(names: Sequence[str]) -> bool:
    return len(set(names)) == len(names)


def _nodes_of(tree_file: TreeFile) -> Iterator[Element]:
    for tree in tree_file.trees:
        yield from tree.children[0].iterate()


def _editor_attributes(root: Element) -> frozenset[str]:
    names = {name for element in root.iterate() for name in element.attributes if name.startswith("_")}
    return frozenset(names.difference(CONDITIONS))


def _are_nodes(
    nodes: Sequence[Element], notes: frozenset[str], registry: Registry, described: Iterable[NodeSpec]
) -> bool:
    """Return whether all elements match the schema's definitions of nodes, and no two definitions conflict."""
    specs = {spec.tag: [spec] for spec in reversed([*described])}
    node_types: dict[str, _NodeType] = {}
    types: dict[str, _Values] = {CONDITION.name: _Values.from_type(CONDITION)}
    for tag in {node.tag for node in nodes}:
        found = _node_type_of(tag, registry, specs)
        if found is None or not notes.isdisjoint(found.attributes):
            return False
        if any(types.setdefault(name, values) != values for name, values in found.types.items()):
            return False
        node_types[tag] = found
    return all(node_types[node.tag].accepts(node) for node in nodes)


def _node_type_of(tag: str, registry: Registry, described: Mapping[str, list[NodeSpec]]) -> _NodeType | None:
    """Return the definition of a tag; None if the tag is unknown or its definition is unusual."""
    if tag == SUBTREE_TAG:
        return _SUBTREE
    if tag not in registry:
        return _node_type(described[tag]) if tag in described else _EXPLICIT.get(tag)
    known = _node_types.setdefault(registry, {})
    if tag not in known:
        known[tag] = _node_type(registry.variants(tag))
    return known[tag]


def _node_type(specs: Sequence[NodeSpec]) -> _NodeType | None:
    """Return the definition of a node's tag, which all variants of the node share; None if it is unusual."""
    if specs[0].tag in _EXPLICIT:
        return _EXPLICIT_OR_NODE
    attributes: dict[str, _Values] = {}
    types: dict[str, _Values] = {}
    required = []
    for name, choices in attributes_by_name(specs).items():
        spec, parameter = choices[0]
        if name in spec.implied_values:
            attributes[name] = _Values(tuple(spec.fixed_value_names(parameter)))
        elif parameter.role is not ParameterRole.ATTRIBUTE:
            attributes[name] = _ANY if parameter.role is ParameterRole.NAME else _NAME
        elif not parameter.value_type.name:
            return None
        else:
            attributes[name] = _Values.from_type(parameter.value_type)
            if parameter.required and len(choices) == len(specs):
                required.append(name)
        if any(
            types.setdefault(each.value_type.name, values) != values
            for _, each in choices
            if each.value_type.name
            for values in [_Values.from_type(each.value_type)]
        ):
            return None
    if not (_COMMON.keys().isdisjoint(attributes) and all(map(_is_usual, attributes, attributes.values()))):
        return None
    least, most = (0, 0) if specs[0].kind.is_leaf else specs[0].child_count
    return _NodeType(attributes, required, least, most, types=types)


def _is_usual(name: str, values: _Values) -> bool:
    return name.isascii() and "".join(values.choices).isprintable()
