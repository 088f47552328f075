"""What a `TreeNodesModel` says about nodes: in a tree file, or in a palette beside it."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

from sar_compiler.nodes.attributes import CONDITIONS, ONESHOT
from sar_compiler.nodes.collector import Collector
from sar_compiler.nodes.register import CHILD_COUNTS
from sar_compiler.nodes.registry import Registry
from sar_compiler.nodes.spec import Direction, Kind, NodeSpec, Parameter, Role
from sar_compiler.nodes.values import ANYTHING, ValueType, nearest, type_of_cpp_name, value_type_of
from sar_compiler.tree.model import MODEL_TAG, SUBTREE_TAG, TREE_TAG, Element, TreeFile
from sar_compiler.tree.names import is_name

_KINDS = {kind.value: kind for kind in Kind}
_DIRECTIONS = {direction.value: direction for direction in Direction}
_IGNORED = ("MetadataFields",)
_TAGS = (SUBTREE_TAG, TREE_TAG)
_NAMES = ("name", "ID", "_autoremap", "children", ONESHOT)


@dataclass(frozen=True)
class Port:
    """A port as a model describes it.

    Attributes:
        element: Where it is described.
        name: Its name.
        direction: Which way its values go.
        type_name: The type it is said to have, in BehaviorTree.CPP's words; empty if none is said.
        default: The text that it has where nothing is written; None if there is no default.
    """

    element: Element
    name: str
    direction: Direction
    type_name: str = ""
    default: str | None = None


@dataclass(frozen=True)
class Model:
    """A node or a subtree as a model describes it.

    Attributes:
        element: Where it is described.
        tag: The tag, or the subtree's ID.
        kind: What it is; None for a subtree.
        ports: Its ports by name.
    """

    element: Element
    tag: str
    kind: Kind | None
    ports: Mapping[str, Port] = field(default_factory=dict)

    def spec(self) -> NodeSpec:
        """Return what is known of a node that is only described."""
        kind = self.kind or Kind.ACTION
        name = Parameter("name", Role.NAME, required=False, value_type=value_type_of(str))
        parameters = {"name": name, **{port.name: _parameter(port) for port in self.ports.values()}}
        return NodeSpec(
            tag=self.tag,
            kind=kind,
            cls=None,
            parameters=parameters,
            outcomes=frozenset({"SUCCESS", "FAILURE", "RUNNING", "SKIPPED"}),
            child_count=CHILD_COUNTS[kind],
        )


@dataclass(frozen=True)
class Models:
    """All models that count for a tree.

    Attributes:
        nodes: Those of nodes, by tag.
        subtrees: Those of subtrees, by ID.
    """

    nodes: Mapping[str, Model] = field(default_factory=dict)
    subtrees: Mapping[str, Model] = field(default_factory=dict)


def read_models(files: Iterable[TreeFile], collector: Collector) -> Models:
    """Read the models of some files; the first description of a node counts."""
    nodes: dict[str, Model] = {}
    subtrees: dict[str, Model] = {}
    for tree_file in files:
        for section in tree_file.root.children:
            if section.tag == MODEL_TAG:
                for element in section.children:
                    model = _model(element, collector)
                    if model is not None:
                        (subtrees if model.kind is None else nodes).setdefault(model.tag, model)
    return Models(nodes, subtrees)


def described_specs(files: Iterable[TreeFile], registry: Registry) -> list[NodeSpec]:
    """Return the nodes that some files describe and nobody has registered."""
    models = read_models(files, Collector())
    return [model.spec() for tag, model in models.nodes.items() if tag not in registry]


def compare(models: Models, registry: Registry, collector: Collector) -> None:
    """Report where the models of nodes contradict the registry."""
    for model in models.nodes.values():
        specs = registry.variants(model.tag)
        if specs:
            _compare_kind(model, specs[0], collector)
            for port in model.ports.values():
                _compare_port(model, port, specs, collector)


def _compare_kind(model: Model, spec: NodeSpec, collector: Collector) -> None:
    if model.kind is not spec.kind:
        article = "an" if spec.kind is Kind.ACTION else "a"
        message = f"<{model.tag}> is {article} {spec.kind.value}, and the model says {model.element.tag}"
        collector.tag(model.element, "model-mismatch", message, suggestion=spec.kind.value)


def _compare_port(model: Model, port: Port, specs: list[NodeSpec], collector: Collector) -> None:
    known = {p.name: p for spec in specs for p in spec.attributes}
    parameter = known.get(port.name)
    if parameter is None:
        message = f"<{model.tag}> has no port '{port.name}'; it has {', '.join(known)}"
        near = nearest(port.name, known)
        collector.value(port.element, "name", "model-mismatch", message, suggestion=near)
    elif {parameter.direction, port.direction} == {Direction.INPUT, Direction.OUTPUT}:
        right = Direction.INPUT if port.direction is Direction.OUTPUT else Direction.OUTPUT
        message = f"the port '{port.name}' of <{model.tag}> is an {right.value}"
        collector.tag(port.element, "model-mismatch", message, suggestion=right.value)


def _model(element: Element, collector: Collector) -> Model | None:
    kind = _KINDS.get(element.tag)
    if kind is None and element.tag != SUBTREE_TAG:
        known = [*_KINDS, SUBTREE_TAG]
        message = f"<{element.tag}> cannot stand in a <{MODEL_TAG}>; it has {', '.join(known)}"
        collector.tag(element, "unknown-element", message, suggestion=nearest(element.tag, known))
        return None
    tag = element.attributes.get("ID")
    if not tag:
        message = f"this <{element.tag}> describes nothing: it has no ID"
        collector.tag(element, "missing-attribute", message, hint='write ID="..."')
        return None
    if kind is not None and not _can_be_written(element, "ID", "node", _TAGS, collector):
        return None
    ports = [_port(child, collector) for child in element.children if child.tag not in _IGNORED]
    return Model(element, tag, kind, {port.name: port for port in ports if port is not None})


def _port(element: Element, collector: Collector) -> Port | None:
    direction = _DIRECTIONS.get(element.tag)
    if direction is None:
        message = f"<{element.tag}> is no port; a model has {', '.join(_DIRECTIONS)}"
        collector.tag(element, "unknown-element", message, suggestion=nearest(element.tag, _DIRECTIONS))
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
    """Say whether a name can be that of a tag or an attribute; report it if not."""
    name = element.attributes[attribute]
    if name not in taken and is_name(name) and ":" not in name:
        return True
    why = "it has a meaning already" if name in taken else "a name has letters, digits and _ only"
    collector.value(element, attribute, "wrong-value", f"a {what} cannot be called '{name}': {why}")
    return False


def _parameter(port: Port) -> Parameter:
    value_type: ValueType = type_of_cpp_name(port.type_name) or ANYTHING
    return Parameter(
        port.name,
        Role.ATTRIBUTE,
        required=False,
        default=port.default,
        value_type=value_type,
        direction=port.direction,
    )
