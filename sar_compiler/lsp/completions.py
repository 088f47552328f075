"""Completions at the cursor: tags, attributes, values, keys and trees.

The text is incomplete when an editor requests completions, so only the text before the cursor determines the syntactic
context. The completions come from the registry, and from the last version of the file that could be parsed.
"""

import re
from collections.abc import Iterable, Iterator
from typing import NamedTuple

from sar_compiler.nodes.binding.attributes import AUTOREMAP, CONDITIONS, ONESHOT, ONESHOT_HELP, ONESHOT_TYPE
from sar_compiler.nodes.registry import Registry, subtree
from sar_compiler.nodes.spec import Kind, NodeSpec, Parameter, ParameterRole
from sar_compiler.project import ProjectTree
from sar_compiler.tree.diagnostic import Form
from sar_compiler.tree.model import (
    CHILDREN_KEY,
    INCLUDE_TAG,
    MODEL_TAG,
    ROOT_TAG,
    SUBTREE_TAG,
    TREE_TAG,
)
from sar_compiler.tree.xml_recovery import NAME, attributes_end
from sar_compiler.views.nodes import nodes_as_text

_WORD = re.compile(r"[\w:.-]*\Z")
_IN_TAG = re.compile(r"\s+[\w:.-]*\Z")
_IN_VALUE = re.compile(r"\s*([^\s=/>\"'<]+)\s*=\s*(?:\"([^\"]*)|'([^']*))\Z")
_YAML_TAG = re.compile(r"\s*(?:-[ ]+)+[\"']?([\w:.-]*)\Z")
_YAML_KEY = re.compile(r"[ ]*[\w:.-]*\Z")
_YAML_VALUE = re.compile(r"[ ]*(?:-[ ]+)?([\w:.-]+):[ ]+[\"']?([^\"'#]*)\Z")
_YAML_FLOW = re.compile(
    r"[ ]*(?:-[ ]+)*([\w:.-]+):[ ]+\{(?:.*[,{])?[ ]*(?:([\w:.-]+):[ ]*[\"']?([^,}\"']*)|[\w:.-]*)\Z"
)
_YAML_OPENED = re.compile(r"([ ]*)(?:-[ ]+)*([\w:.-]+):[ ]*\Z")
_ROOT_ATTRIBUTES = {
    ROOT_TAG: ("BTCPP_format", "main_tree_to_execute"),
    TREE_TAG: ("ID",),
    INCLUDE_TAG: ("path", "ros_pkg"),
}
_NAMES_TREE = {(SUBTREE_TAG, "ID"), (ROOT_TAG, "main_tree_to_execute")}


class CompletionContext(NamedTuple):
    """The syntactic context at the cursor, which determines the completions.

    Attributes:
        tag: The tag of the element; None if the tag itself is being typed.
        attribute: The attribute whose value is being typed; None if no value is being typed.
        value: The part of the value before the cursor.
    """

    tag: str | None = None
    attribute: str | None = None
    value: str = ""


class Completion(NamedTuple):
    """A completion.

    Attributes:
        kind: `tag`, `attribute`, `value`, `key` or `tree`.
        text: The text to insert.
        doc: The description of the tag, attribute, value, key or tree.
    """

    kind: str
    text: str
    doc: str = ""


def context_at(text: str, offset: int, form: Form) -> CompletionContext | None:
    """Return the syntactic context at an offset of a text; None if there are no completions."""
    return _xml_context(text[:offset]) if form is Form.XML else _yaml_context(text[:offset])


def _xml_context(before: str) -> CompletionContext | None:
    tag = before.rfind("<")
    if tag < 0:
        return None
    if _WORD.match(before, tag + 1):
        return CompletionContext()
    name = NAME.match(before, tag)
    if name is None or before.startswith(("<!", "<?", "</"), tag):
        return None
    offset = attributes_end(before, name.end())
    written = name[0].removeprefix("<")
    if value := _IN_VALUE.match(before, offset):
        return CompletionContext(written, value[1], value[2] if value[2] is not None else value[3])
    return CompletionContext(written) if _IN_TAG.match(before, offset) else None


def _yaml_context(before: str) -> CompletionContext | None:
    start = before.rfind("\n") + 1
    line = before[start:]
    if flow := _YAML_FLOW.match(line):
        return CompletionContext(flow[1], flow[2], flow[3] or "")
    if _YAML_TAG.match(line):
        return CompletionContext()
    value = _YAML_VALUE.match(line)
    if value or _YAML_KEY.match(line):
        tag = _yaml_parent_tag(before[:start], len(line) - len(line.lstrip(" ")))
        return None if tag is None else CompletionContext(tag, *(value.groups() if value else ()))
    return None


def _yaml_parent_tag(before: str, indent: int) -> str | None:
    """Return the tag of the YAML mapping around the line after *before*, which is indented by *indent*."""
    for line in reversed(before.split("\n")):
        blanks = len(line) - len(line.lstrip(" "))
        if line.strip() and not line.lstrip().startswith("#") and blanks < indent:
            opened = _YAML_OPENED.match(line.rstrip())
            return None if opened is None or opened[2] == CHILDREN_KEY else opened[2]
    return None


def completions_for(
    context: CompletionContext, registry: Registry, tree: ProjectTree | None, form: Form
) -> list[Completion]:
    """Return the completions for a syntactic context.

    Args:
        context: The syntactic context.
        registry: The known tags.
        tree: The last version of the file that could be parsed; None if there is none.
        form: The format of the file.
    """
    if context.tag is None:
        return [*_tags(registry)]
    if context.attribute is None:
        children = [Completion("attribute", CHILDREN_KEY)] if form is Form.YAML else []
        return [*_attributes(context.tag, registry, tree), *children]
    return [*_values(context, registry, tree)]


def _tags(registry: Registry) -> Iterator[Completion]:
    for tag, specs in registry.by_tag().items():
        yield Completion("tag", tag, specs[0].doc)
    yield Completion("tag", SUBTREE_TAG, subtree().doc)
    yield from (Completion("tag", tag) for tag in (TREE_TAG, INCLUDE_TAG, MODEL_TAG))


def _attributes(tag: str, registry: Registry, tree: ProjectTree | None) -> Iterator[Completion]:
    if tag in _ROOT_ATTRIBUTES:
        yield from (Completion("attribute", name) for name in _ROOT_ATTRIBUTES[tag])
        return
    if tag == SUBTREE_TAG:
        yield Completion("attribute", "ID", "The ID of the tree to tick.")
        yield Completion(
            "attribute",
            AUTOREMAP,
            "Remaps every key of the subtree to the key of the same name in this tree.",
        )
        yield from (Completion("attribute", key, "A key of the subtree.") for key in _keys(tree))
    for parameter in _parameters(registry.variants(tag)).values():
        yield Completion("attribute", parameter.name, parameter.help)
    yield Completion("attribute", ONESHOT, ONESHOT_HELP)
    yield from (Completion("attribute", name, text) for name, text in CONDITIONS.items())


def _parameters(specs: Iterable[NodeSpec]) -> dict[str, Parameter]:
    return {parameter.name: parameter for spec in specs for parameter in spec.attributes}


def _values(context: CompletionContext, registry: Registry, tree: ProjectTree | None) -> Iterator[Completion]:
    tag, attribute = context.tag or "", context.attribute or ""
    if (tag, attribute) in _NAMES_TREE:
        yield from (Completion("tree", name) for name in (tree.forest.known_ids if tree else ()))
        return
    if "{" in context.value:
        yield from (Completion("key", key) for key in _keys(tree))
        return
    if tag in {kind.value for kind in Kind} and attribute == "ID":
        yield from (Completion("value", spec.tag, spec.doc) for spec in registry if spec.kind.value == tag)
    parameter = _parameters(registry.variants(tag)).get(attribute)
    choices = (
        ONESHOT_TYPE.choices if attribute == ONESHOT else parameter.value_type.choices if parameter else ()
    )
    yield from (Completion("value", choice) for choice in choices)
    if parameter is not None and parameter.role is ParameterRole.REFERENCE:
        yield from (Completion("value", name) for name in _referable_nodes(parameter, tree))
    elif parameter is not None and parameter.direction is not None:
        yield from (Completion("key", f"{{{key}}}") for key in _keys(tree))


def _keys(tree: ProjectTree | None) -> list[str]:
    """Return all blackboard keys used by the trees of a file."""
    if tree is None:
        return []
    return sorted({key for each in tree.context.key_accesses.values() for key in each.keys})


def _referable_nodes(parameter: Parameter, tree: ProjectTree | None) -> list[str]:
    """Return the names of the nodes to which a reference parameter can refer."""
    nodes = (node for each in (tree.context.trees if tree else ()) for node in each.nodes)
    return sorted({node.name for node in nodes if node.spec.is_class_of(parameter)})


def page_of_tag(tag: str, registry: Registry) -> str | None:
    """Describe a tag, with attributes and possible outcomes. Return None if the tag is unknown."""
    specs = registry.variants(tag) or ([subtree()] if tag == SUBTREE_TAG else [])
    return nodes_as_text(specs) if specs else None
