"""Models of nodes and subtrees, which are read from a `TreeNodesModel`."""

import re
from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import replace
from typing import NamedTuple

from sar_compiler.nodes.binding.attributes import CONDITIONS, ONESHOT
from sar_compiler.nodes.collector import FindingCollector, file_of
from sar_compiler.nodes.outcomes import outcomes_of
from sar_compiler.nodes.registry import Registry, is_library_tag
from sar_compiler.nodes.spec import Direction, Kind, NodeSpec, Parameter, ParameterRole, Signature, any_port
from sar_compiler.nodes.values import (
    ANYTHING,
    NO_VALUE,
    ConversionError,
    ValueType,
    blackboard_key,
    port_type_of_cpp_name,
    require_value_type,
    type_of_cpp_name,
)
from sar_compiler.tree.diagnostic import Cause
from sar_compiler.tree.model import (
    MODEL_TAG,
    ROOT_TAG,
    SUBTREE_TAG,
    TREE_TAG,
    Element,
    TreeFile,
    is_name,
    synthetic_element,
    synthetic_file,
)

_KINDS = {kind.value: kind for kind in Kind}
_DIRECTIONS = {direction.value: direction for direction in Direction}
METADATA_TAG = "MetadataFields"
ENUM_TAG = "Enum"
"""The tag for a named constant of the C++ program.

The element contains the constant's number if it is known. BehaviorTree.CPP ignores the element.
"""
_SCRIPT = r"code|if|case_\d+|_(?:(?:failure|success|skip)If|while|on(?:Success|Failure|Halted)|post)"
_NAME = r"(?<![\w'{@.])[A-Za-z_]\w*(?![\w'}])"
_KEY = r"\{(\w+)\}|\b(\w+)\s*(?::=|[-+*/]?=(?!=))"
_QUOTED = r"'[^']*'"
FROM_USE = {"made": "from use"}
"""The marker of a model that is derived from the uses of a node. Its types and directions are guessed."""
LIBRARY = {"library": "py_trees"}
"""The marker of a py_trees node's model, which distinguishes the node from a user's node with the same name."""
# The assumed outcomes of a leaf that is only described.
_STATUSES = {Kind.ACTION: ("SUCCESS", "FAILURE", "RUNNING"), Kind.CONDITION: ("SUCCESS", "FAILURE")}
_DIRECTIONS_HINT = (
    "write input_port for a port that is read, output_port for a port that is written, inout_port for both"
)
_TAGS = (SUBTREE_TAG, TREE_TAG)
_NAMES = ("name", "ID", "_autoremap", "children", ONESHOT)


class Port(NamedTuple):
    """A port in a model.

    Attributes:
        element: The element that describes the port.
        name: The port's name.
        direction: The direction of the values.
        type_name: The declared C++ type; empty if no type is declared.
        default: The text of the default; None if there is no default.
    """

    element: Element
    name: str
    direction: Direction
    type_name: str = ""
    default: str | None = None


class NodeModel(NamedTuple):
    """A node or a subtree in a model.

    Attributes:
        element: The element that describes the node or subtree.
        tag: The node's tag, or the subtree's ID.
        kind: The kind of the node; None for a subtree.
        ports: The ports by name.
    """

    element: Element
    tag: str
    kind: Kind | None
    ports: Mapping[str, Port] = {}

    @property
    def is_of_py_trees(self) -> bool:
        """Whether the model describes a py_trees node, according to a marker written by `sar-compile`."""
        return self._has_note(LIBRARY)

    @property
    def is_from_use(self) -> bool:
        """Whether the model was derived from the use of the node."""
        return self._has_note(FROM_USE)

    def _has_note(self, attributes: Mapping[str, str]) -> bool:
        notes = (
            note for child in self.element.children if child.tag == METADATA_TAG for note in child.children
        )
        return any(note.attributes == attributes for note in notes)

    @property
    def content(self) -> object:
        """The content of the model, for comparison with another model."""
        ports = self.ports.values()
        return self.kind, {(port.name, port.direction, port.type_name, port.default) for port in ports}

    def spec(self) -> NodeSpec:
        """Return the spec of a node that has a model but no Python class."""
        kind = self.kind or Kind.ACTION
        name = Parameter("name", ParameterRole.NAME, required=False, value_type=require_value_type(str))
        parameter = _used_port if self.is_from_use else _parameter
        parameters = {"name": name, **{port.name: parameter(port) for port in self.ports.values()}}
        return NodeSpec(
            self.tag,
            None,
            kind,
            frozenset({"SUCCESS", "FAILURE", "RUNNING", "SKIPPED"}),
            outcomes=outcomes_of(_STATUSES.get(kind, ())) if kind.is_leaf else (),
            signature=Signature(described=parameters, from_use=self.is_from_use),
        )


class NodeModels(NamedTuple):
    """All models that apply to a tree.

    Attributes:
        nodes: The models of nodes, by tag.
        subtrees: The models of subtrees, by ID.
        enums: The numbers of named constants; None for a constant whose number no file states.
    """

    nodes: Mapping[str, NodeModel] = {}
    subtrees: Mapping[str, NodeModel] = {}
    enums: Mapping[str, int | None] = {}


def read_models(files: Iterable[TreeFile], collector: FindingCollector) -> NodeModels:
    """Read the models in files. If several models describe a node, the first model is used.

    Models in files that the user did not name are not compared with other models.
    """
    nodes: dict[str, NodeModel] = {}
    subtrees: dict[str, NodeModel] = {}
    enums: dict[str, int | None] = {}
    for tree_file in files:
        for element in _descriptions([tree_file]):
            if element.tag == ENUM_TAG:
                _read_enum(element, enums, collector)
                continue
            model = _model(element, collector)
            if model is not None:
                first = (subtrees if model.kind is None else nodes).setdefault(model.tag, model)
                if first is not model and tree_file.is_named:
                    _report_second_model(first, model, collector)
    return NodeModels(nodes, subtrees, enums)


def enums_file(numbers: Mapping[str, int]) -> TreeFile:
    """Return a palette that declares named constants."""
    declared = [
        synthetic_element(ENUM_TAG, {"ID": name, "value": str(each)}) for name, each in numbers.items()
    ]
    return synthetic_file(
        synthetic_element(ROOT_TAG, children=[synthetic_element(MODEL_TAG, children=declared)])
    )


def _read_enum(element: Element, enums: dict[str, int | None], collector: FindingCollector) -> None:
    """Add a named constant. If the name has several numbers, the first number is used."""
    name, written = element.attributes.get("ID", ""), element.attributes.get("value")
    if not (name.isidentifier() and name.isascii()):
        message = f"this <{ENUM_TAG}> needs an ID: a name of letters, digits and _"
        collector.add("wrong-model", message, element, hint='write <Enum ID="RED" value="1"/>, for example')
        return
    number: int | None = None
    if written is not None:
        try:
            number = int(str(require_value_type(int).convert(written)))
        except ConversionError as error:
            collector.wrong_value(element, "value", error, "wrong-model")
    known = enums.get(name)
    if None not in (known, number) and known != number:
        message = f"'{name}' is already defined as {known}, but is {number} here"
        collector.add(
            "wrong-model", message, element, value="value", hint="delete one of the two definitions"
        )
    enums[name] = number if known is None else known


def _descriptions(files: Iterable[TreeFile]) -> Iterator[Element]:
    for tree_file in files:
        for section in tree_file.root.children:
            if section.tag == MODEL_TAG:
                yield from (child for child in section.children if child.tag != METADATA_TAG)


def undescribed_tags(files: Iterable[TreeFile], palettes: Iterable[TreeFile]) -> set[str]:
    """Return the tags in files that are described neither by a model in the same file nor by a palette."""
    tags: set[str] = set()
    for tree_file in files:
        described = {*map(_described_name, _descriptions([tree_file]))}
        elements = (each for tree in tree_file.trees for child in tree.children for each in child.iterate())
        tags |= {
            each.attributes.get("ID", each.tag) if each.tag in _KINDS else each.tag for each in elements
        } - described
    return tags - {SUBTREE_TAG, *map(_described_name, _descriptions(palettes))}


def undeclared_names(files: Iterable[TreeFile], palettes: Iterable[TreeFile]) -> set[str]:
    """Return the names in scripts and cases that may be undeclared named constants.

    These are names that are not keys in the files, and names with a capital first letter (they are rarely keys).
    """
    files = tuple(files)
    names: set[str] = set()
    keys = {"true", "false"}
    for element in (each for tree_file in files for each in tree_file.root.iterate()):
        if element.tag == SUBTREE_TAG:
            keys.update(element.attributes)
        for name, value in element.attributes.items():
            is_script = re.fullmatch(_SCRIPT, name) is not None
            if is_script or "{" in value:
                keys.update(*re.findall(_KEY, value))
            if is_script:
                names.update(re.findall(_NAME, re.sub(_QUOTED, "", value)))
            elif value.strip("{} ") == "=":
                keys.add(name)
            elif element.tag.endswith("_port") or name.endswith(("key", "variable")):
                keys.add(value)
    names = {each for each in names if each not in keys or each[0].isupper()}
    return names - {*map(_described_name, _enums([*files, *palettes]))}


def _enums(files: Iterable[TreeFile]) -> Iterator[Element]:
    return (each for each in _descriptions(files) if each.tag == ENUM_TAG)


def supplements(
    palettes: Iterable[TreeFile], tags: Collection[str], names: Collection[str] = ()
) -> Iterator[TreeFile]:
    """Yield the parts of palettes that describe nodes in *tags* or named constants in *names*.

    If several palettes describe a node, the first is used. Models of subtrees are left out, because they belong to the
    trees of one file, and another file may have a tree with the same name.
    """
    wanted = {*tags}
    for palette in palettes:
        new = [each for each in _descriptions([palette]) if _described_name(each) in wanted]
        wanted.difference_update(map(_described_name, new))
        enums = [*_enums([palette])]
        section = replace(palette.root, tag=MODEL_TAG, attributes={}, children=(*new, *enums))
        if new or any(_described_name(each) in names for each in enums):
            yield replace(palette, root=replace(palette.root, children=(section,)), is_named=False)


def _described_name(description: Element) -> str:
    return SUBTREE_TAG if description.tag == SUBTREE_TAG else description.attributes.get("ID", "")


def _report_second_model(first: NodeModel, second: NodeModel, collector: FindingCollector) -> None:
    """Report different models of the same node, or several models of the same subtree in one file."""
    same_file = second.element.source is first.element.source
    if first.content == second.content and not (second.kind is None and same_file):
        return
    # If the second model is in another file, the finding is about the first file, because the other file may be a palette.
    here, there = (second.element, first.element) if same_file else (first.element, second.element)
    how = "described differently" if first.content != second.content else "already described"
    message = f"'{second.tag}' is {how} on line {there.line}{file_of(there, here)}"
    cause = (
        Cause("these nodes or subtrees are described differently in another file", second.tag)
        if not same_file
        else None
    )
    collector.add(
        "wrong-model", message, here, value="ID", hint="delete one of the two models", common_cause=cause
    )


def registry_without(registry: Registry, models: NodeModels) -> Registry:
    """Return a registry without the py_trees nodes whose tags the user's models declare for other nodes."""
    taken = {
        tag
        for tag, model in models.nodes.items()
        if tag in registry and is_library_tag(tag) and not model.is_of_py_trees
    }
    return registry.without_tags(taken) if taken else registry


def described_specs(files: Iterable[TreeFile], registry: Registry) -> list[NodeSpec]:
    """Return the specs of nodes that are described but not registered, if their names are valid tags."""
    models = read_models(files, FindingCollector())
    return [model.spec() for tag, model in models.nodes.items() if tag not in registry and can_be_tag(tag)]


def can_be_tag(name: str) -> bool:
    """Return whether the name of a node or port can be written in a tree file."""
    return is_name(name) and ":" not in name


def _model(element: Element, collector: FindingCollector) -> NodeModel | None:
    kind = _KINDS.get(element.tag)
    if kind is None and element.tag != SUBTREE_TAG:
        known = [*_KINDS, SUBTREE_TAG, ENUM_TAG]
        message = f"<{element.tag}> is not allowed in a <{MODEL_TAG}> (known: {', '.join(known)})"
        near = collector.guesses.nearest(element.tag, known)
        collector.add("wrong-model", message, element, suggestion=near)
        return None
    tag = element.attributes.get("ID")
    if not tag:
        message = f"this <{element.tag}> has no effect, because it has no ID"
        _report_typo(element, None, message, kind, collector, 'write ID="..."')
        return None
    if kind is not None and tag in _TAGS:
        message = f"'{tag}' cannot be the name of a node, because it is reserved"
        collector.add("wrong-model", message, element, value="ID")
        return None
    return NodeModel(element, tag, kind, _ports(element, kind, collector))


def _ports(element: Element, kind: Kind | None, collector: FindingCollector) -> dict[str, Port]:
    ports: dict[str, Port] = {}
    for child in element.children:
        port = _port(child, kind, collector) if child.tag != METADATA_TAG else None
        if port is not None and ports.setdefault(port.name, port) is not port:
            message = f"the port '{port.name}' is already described on line {ports[port.name].element.line}"
            collector.add("wrong-model", message, child, value="name", hint="delete one of the two")
    return ports


def _port(element: Element, kind: Kind | None, collector: FindingCollector) -> Port | None:
    direction, name = _DIRECTIONS.get(element.tag), element.attributes.get("name")
    if direction is None:
        message = f"<{element.tag}> is not a port (known: {', '.join(_DIRECTIONS)})"
        near = collector.guesses.nearest(element.tag, _DIRECTIONS)
        collector.add("wrong-model", message, element, suggestion=near, hint=_DIRECTIONS_HINT)
        # BehaviorTree.CPP reads the models of subtrees, and ignores such an element.
        if kind is None or not name:
            return None
    if not name:
        _report_typo(element, None, f"<{element.tag}> has no name", kind, collector, 'write name="..."')
        return None
    taken = name in (*_NAMES, *CONDITIONS)
    if taken or not can_be_tag(name):
        why = "it is reserved" if taken else "use only letters, digits and _"
        _report_typo(element, "name", f"'{name}' cannot be the name of a port: {why}", kind, collector)
        return None
    # If the direction is unknown, both directions are possible.
    attributes, direction = element.attributes, direction or Direction.INOUT
    return Port(element, name, direction, attributes.get("type", ""), attributes.get("default"))


def _report_typo(
    element: Element,
    attribute: str | None,
    message: str,
    kind: Kind | None,
    collector: FindingCollector,
    hint: str | None = None,
) -> None:
    """Report a wrong or missing attribute in a model. In the model of a subtree, this is an error."""
    of_subtree = "missing-attribute" if attribute is None else "wrong-value"
    code = of_subtree if kind is None else "wrong-model"
    collector.add(code, message, element, value=attribute, hint=hint)


def _used_port(port: Port) -> Parameter:
    """Return the parameter for a port that is known only from its uses.

    The port accepts values of any type and any direction.
    """
    return any_port(port.name, port.element.text)


def _parameter(port: Port) -> Parameter:
    value_type = port_type_of_cpp_name(port.type_name)
    return Parameter(
        port.name,
        ParameterRole.ATTRIBUTE,
        required=False,
        default=port.default,
        value_type=value_type,
        direction=port.direction,
        doc=port.element.text,
    )


_TEXT = require_value_type(str)
# The types whose names in C++ can be compared. Durations and enumerations, for example, have C++ types of their own.
_COMPARED = (bool, int, float, str, list)


def compare_models(models: NodeModels, registry: Registry, collector: FindingCollector) -> None:
    """Report models that contradict the registry, and defaults that their ports do not accept.

    The findings are warnings, because BehaviorTree.CPP does not read the models of nodes.
    """
    for model in models.nodes.values():
        specs = registry.variants(model.tag)
        if specs:
            _compare_kind(model, specs[0], collector)
        known = {parameter.name: parameter for spec in specs for parameter in spec.attributes}
        for port in model.ports.values():
            parameter = known.get(port.name)
            if parameter is not None:
                _compare_port(model, port, parameter, collector)
                _check_default(port, _written_type(parameter), collector)
            elif specs:
                message = f"<{model.tag}> has no port '{port.name}' (known: {', '.join(known)})"
                near = collector.guesses.nearest(port.name, known)
                collector.add("model-mismatch", message, port.element, value="name", suggestion=near)
            else:
                _check_default(port, type_of_cpp_name(port.type_name) or ANYTHING, collector)


def _compare_kind(model: NodeModel, spec: NodeSpec, collector: FindingCollector) -> None:
    if model.kind is not spec.kind:
        article = "an" if spec.kind is Kind.ACTION else "a"
        message = f"<{model.tag}> is {article} {spec.kind.value}, but the model declares {model.element.tag}"
        collector.add("model-mismatch", message, model.element, suggestion=spec.kind.value)


def _compare_port(model: NodeModel, port: Port, parameter: Parameter, collector: FindingCollector) -> None:
    if {parameter.direction, port.direction} == {Direction.INPUT, Direction.OUTPUT}:
        right = Direction.INPUT if port.direction is Direction.OUTPUT else Direction.OUTPUT
        message = f"the port '{port.name}' of <{model.tag}> is an {right.value}"
        collector.add("model-mismatch", message, port.element, suggestion=right.value)
    said, real = type_of_cpp_name(port.type_name), _written_type(parameter)
    if said is not None and not _types_fit(said, real):
        message = f"the port '{port.name}' of <{model.tag}> is {real.label}, but the model declares {port.type_name}"
        collector.add("model-mismatch", message, port.element, value="type", suggestion=real.cpp)


def _written_type(parameter: Parameter) -> ValueType:
    """Return the value type of an attribute in a tree file. References are strings there."""
    return _TEXT if parameter.value_type is NO_VALUE else parameter.value_type


def _types_fit(said: ValueType, real: ValueType) -> bool:
    """Return whether the type in a model fits a port's type. The size of integers is ignored."""
    if real.python not in _COMPARED:
        return True
    return said.cpp == real.cpp if list in (said.python, real.python) else said.python is real.python


def _check_default(port: Port, value_type: ValueType, collector: FindingCollector) -> None:
    """Report an invalid default of an input port, unless the default is empty or a key."""
    text = port.default
    if not text or port.direction is Direction.OUTPUT or blackboard_key(text, port.name) is not None:
        return
    try:
        value_type.convert(text)
    except ConversionError as error:
        message, near, hint = f"default: {error.message}", error.suggestion, error.hint
        collector.add("wrong-model", message, port.element, value="default", suggestion=near, hint=hint)
