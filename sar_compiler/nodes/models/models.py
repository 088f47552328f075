"""Models of nodes, read from the `TreeNodesModel` of a tree file or a palette."""

from collections.abc import Iterable, Iterator, Mapping
from typing import NamedTuple

from sar_compiler.nodes.answers import answers_of
from sar_compiler.nodes.binding.attributes import CONDITIONS, ONESHOT
from sar_compiler.nodes.binding.collector import Collector, file_of
from sar_compiler.nodes.registry import Registry
from sar_compiler.nodes.spec import Direction, Kind, NodeSpec, Parameter, Role, Signature
from sar_compiler.nodes.values import ANYTHING, type_of_cpp_name, value_type_of
from sar_compiler.tree.model import MODEL_TAG, SUBTREE_TAG, TREE_TAG, Element, TreeFile
from sar_compiler.tree.xml_names import is_name

_KINDS = {kind.value: kind for kind in Kind}
_DIRECTIONS = {direction.value: direction for direction in Direction}
_IGNORED = ("MetadataFields",)
# The assumed outcomes of a leaf that is only described.
_ANSWERS = {Kind.ACTION: ("SUCCESS", "FAILURE", "RUNNING"), Kind.CONDITION: ("SUCCESS", "FAILURE")}
_TAGS = (SUBTREE_TAG, TREE_TAG)
_NAMES = ("name", "ID", "_autoremap", "children", ONESHOT)


class Port(NamedTuple):
    """A port as a model describes it.

    Attributes:
        element: The element that describes it.
        name: Its name.
        direction: The direction of its values.
        type_name: Its declared type, by BehaviorTree.CPP's name; empty if none is declared.
        default: The text of its default; None if there is no default.
    """

    element: Element
    name: str
    direction: Direction
    type_name: str = ""
    default: str | None = None


class Model(NamedTuple):
    """A node or a subtree as a model describes it.

    Attributes:
        element: The element that describes it.
        tag: The tag, or the subtree's ID.
        kind: The kind of node; None for a subtree.
        ports: Its ports by name.
    """

    element: Element
    tag: str
    kind: Kind | None
    ports: Mapping[str, Port] = {}

    @property
    def says(self) -> object:
        """Its content, for comparison with another model."""
        ports = self.ports.values()
        return self.kind, {(port.name, port.direction, port.type_name, port.default) for port in ports}

    def spec(self) -> NodeSpec:
        """Return the spec of a node that is only described."""
        kind = self.kind or Kind.ACTION
        name = Parameter("name", Role.NAME, required=False, value_type=value_type_of(str))
        parameters = {"name": name, **{port.name: _parameter(port) for port in self.ports.values()}}
        return NodeSpec(
            self.tag,
            None,
            kind,
            frozenset({"SUCCESS", "FAILURE", "RUNNING", "SKIPPED"}),
            answers=answers_of(_ANSWERS.get(kind, ())) if kind.is_leaf else (),
            signature=Signature(described=parameters),
        )


class Models(NamedTuple):
    """All models that apply to a tree.

    Attributes:
        nodes: The models of nodes, by tag.
        subtrees: The models of subtrees, by ID.
    """

    nodes: Mapping[str, Model] = {}
    subtrees: Mapping[str, Model] = {}


def read_models(files: Iterable[TreeFile], collector: Collector) -> Models:
    """Read the models of some files; the first description of a node counts."""
    nodes: dict[str, Model] = {}
    subtrees: dict[str, Model] = {}
    for element in _descriptions(files):
        model = _model(element, collector)
        if model is not None:
            first = (subtrees if model.kind is None else nodes).setdefault(model.tag, model)
            if first is not model:
                _compare_twice(first, model, collector)
    return Models(nodes, subtrees)


def _descriptions(files: Iterable[TreeFile]) -> Iterator[Element]:
    for tree_file in files:
        for section in tree_file.root.children:
            if section.tag == MODEL_TAG:
                yield from (child for child in section.children if child.tag not in _IGNORED)


def _compare_twice(first: Model, second: Model, collector: Collector) -> None:
    """Report a second description that differs, or a second one of a subtree in the same file."""
    element = second.element
    same_file = element.source is first.element.source
    if first.says == second.says and not (second.kind is None and same_file):
        return
    where = f"line {first.element.line}{file_of(first.element, element)}"
    differs = ", differently" if first.says != second.says else ""
    message = f"'{second.tag}' is described in {where} already{differs}"
    collector.value(element, "ID", "duplicate-model", message, hint="delete one of the two")


def described_specs(files: Iterable[TreeFile], registry: Registry) -> list[NodeSpec]:
    """Return the nodes that files describe and that are not registered."""
    models = read_models(files, Collector())
    return [model.spec() for tag, model in models.nodes.items() if tag not in registry]


def _model(element: Element, collector: Collector) -> Model | None:
    kind = _KINDS.get(element.tag)
    if kind is None and element.tag != SUBTREE_TAG:
        known = [*_KINDS, SUBTREE_TAG]
        message = f"<{element.tag}> cannot stand in a <{MODEL_TAG}>; it has {', '.join(known)}"
        collector.tag(
            element, "unknown-element", message, suggestion=collector.guesses.nearest(element.tag, known)
        )
        return None
    tag = element.attributes.get("ID")
    if not tag:
        message = f"this <{element.tag}> describes nothing: it has no ID"
        collector.tag(element, "missing-attribute", message, hint='write ID="..."')
        return None
    if kind is not None and not _can_be_written(element, "ID", "node", _TAGS, collector):
        return None
    return Model(element, tag, kind, _ports(element, collector))


def _ports(element: Element, collector: Collector) -> dict[str, Port]:
    ports: dict[str, Port] = {}
    for child in element.children:
        port = _port(child, collector) if child.tag not in _IGNORED else None
        if port is not None and ports.setdefault(port.name, port) is not port:
            message = f"the port '{port.name}' is described in line {ports[port.name].element.line} already"
            collector.value(child, "name", "duplicate-model", message, hint="delete one of the two")
    return ports


def _port(element: Element, collector: Collector) -> Port | None:
    direction = _DIRECTIONS.get(element.tag)
    if direction is None:
        message = f"<{element.tag}> is no port; a model has {', '.join(_DIRECTIONS)}"
        collector.tag(
            element,
            "unknown-element",
            message,
            suggestion=collector.guesses.nearest(element.tag, _DIRECTIONS),
        )
        return None
    name = element.attributes.get("name")
    if not name:
        collector.tag(element, "missing-attribute", f"<{element.tag}> has no name", hint='write name="..."')
        return None
    if not _can_be_written(element, "name", "port", (*_NAMES, *CONDITIONS), collector):
        return None
    attributes = element.attributes
    return Port(element, name, direction, attributes.get("type", ""), attributes.get("default"))


def _can_be_written(
    element: Element, attribute: str, what: str, taken: Iterable[str], collector: Collector
) -> bool:
    """Return whether a name is valid for a tag or an attribute; report it if not."""
    name = element.attributes[attribute]
    if name not in taken and is_name(name) and ":" not in name:
        return True
    why = "it has a meaning already" if name in taken else "a name has letters, digits and _ only"
    collector.value(element, attribute, "wrong-value", f"a {what} cannot be called '{name}': {why}")
    return False


def _parameter(port: Port) -> Parameter:
    value_type = type_of_cpp_name(port.type_name) or ANYTHING
    return Parameter(
        port.name,
        Role.ATTRIBUTE,
        required=False,
        default=port.default,
        value_type=value_type,
        direction=port.direction,
        doc=port.element.text,
    )
