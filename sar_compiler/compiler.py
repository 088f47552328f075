"""From a tree file and the registry to py_trees objects."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any
from uuid import UUID

from py_trees.behaviour import Behaviour
from py_trees.decorators import OneShot

from sar_compiler.nodes.binding import Binding, BoundNode, bind, find_main_tree
from sar_compiler.nodes.registry import Registry
from sar_compiler.nodes.spec import Parameter, Role, Use
from sar_compiler.nodes.values import ConversionError, nearest
from sar_compiler.runtime.context import preview_of
from sar_compiler.tree.diagnostic import Diagnostic, TreeError
from sar_compiler.tree.model import TreeFile
from sar_compiler.tree.source import Span

_ROOT_BLACKBOARD = "@"


@dataclass(frozen=True)
class Origin:
    """Where a behaviour comes from.

    Attributes:
        bound: The part of the file that it was made from.
        attributes: The values and references it was given, as one would write them: blackboard keys in
            braces where their value was not known, references as names.
        uses: What it needs outside the tree, with names filled in.
    """

    bound: BoundNode
    attributes: Mapping[str, object]
    uses: tuple[Use, ...] = ()


@dataclass(frozen=True)
class CompiledTree:
    """A tree that can be ticked.

    Attributes:
        root: The py_trees behaviour at its root.
        origins: Where each behaviour comes from, by the behaviour's id.
    """

    root: Behaviour
    origins: Mapping[UUID, Origin]

    def uses(self) -> list[Use]:
        """Return what its leaves need outside the tree, each once."""
        return list(dict.fromkeys(use for origin in self.origins.values() for use in origin.uses))


def bind_main(tree_file: TreeFile, registry: Registry, tree_id: str | None = None) -> Binding:
    """Bind the tree to execute.

    Raises:
        TreeError: If there is none, or anything in it is wrong; carries all the findings.
    """
    binding = bind(find_main_tree(tree_file, tree_id), registry)
    if binding.findings:
        raise TreeError(binding.findings)
    return binding


def context_types(binding: Binding) -> set[type]:
    """Return the types of which a mission has to hand an object to a bound tree."""
    nodes = binding.root.iterate() if binding.root else ()
    return {
        parameter.target
        for bound in nodes
        for parameter in bound.spec.parameters.values()
        if parameter.role is Role.CONTEXT and parameter.target is not None
    }


def compile_tree(
    binding: Binding, context: Mapping[type, object], parameters: Mapping[str, object]
) -> CompiledTree:
    """Compile a bound tree for a mission.

    Args:
        binding: The tree, without findings.
        context: The objects that the mission hands to its leaves, by their type.
        parameters: The keys of the root blackboard: the node parameters of the mission.

    Raises:
        TreeError: If a key is not there or its value does not fit, if the mission lacks an object that a
            leaf needs, or if a constructor refuses its arguments.
    """
    return _Builder(context, parameters).compile(binding)


def preview_tree(binding: Binding) -> CompiledTree:
    """Compile a bound tree to be looked at: with stand-ins for what only a mission has.

    Blackboard keys that are not known get the parameter's default or some value of its type.
    """
    return _PreviewBuilder({}, {}).compile(binding)


class _Builder:
    def __init__(self, context: Mapping[type, object], parameters: Mapping[str, object]) -> None:
        self._context = dict(context)
        self._parameters = parameters
        self._findings: list[Diagnostic] = []
        self._arguments: dict[BoundNode, dict[str, Any]] = {}
        self._built: dict[BoundNode, Behaviour] = {}
        self._origins: dict[UUID, Origin] = {}

    def compile(self, binding: Binding) -> CompiledTree:
        if binding.findings or binding.root is None:
            raise TreeError(binding.findings)
        # Everything that can be said of the arguments is said at once, before anything is made.
        for bound in binding.root.iterate():
            self._arguments[bound] = self._plain_arguments(bound)
        if self._findings:
            raise TreeError(self._findings)
        return CompiledTree(self._place(binding.root), self._origins)

    def _plain_arguments(self, bound: BoundNode) -> dict[str, Any]:
        arguments: dict[str, Any] = {}
        for name, parameter in bound.spec.parameters.items():
            if parameter.role is Role.NAME:
                arguments[name] = bound.name
            elif parameter.role is Role.CONTEXT:
                arguments[name] = self._handed_over(bound, parameter)
            elif parameter.role is Role.ATTRIBUTE:
                arguments[name] = self._value(bound, parameter)
        return arguments

    def _value(self, bound: BoundNode, parameter: Parameter) -> object:
        name = parameter.name
        if name in bound.keys:
            return self._blackboard_value(bound, parameter, bound.keys[name])
        if name in bound.spec.fixed:
            return bound.spec.fixed[name]
        return bound.values.get(name, parameter.default)

    def _handed_over(self, bound: BoundNode, parameter: Parameter) -> object:
        assert parameter.target is not None  # noqa: S101 - every context parameter has one
        if parameter.target in self._context or not parameter.required:
            return self._context.get(parameter.target, parameter.default)
        message = (
            f"<{bound.element.tag}> needs a {parameter.target.__name__}, which this mission does not have"
        )
        self._report(bound, bound.element.tag_span(), "missing-context", message)
        return None

    def _blackboard_value(self, bound: BoundNode, parameter: Parameter, key: str) -> object:
        assert parameter.value_type is not None  # noqa: S101 - every attribute has one
        name = key.removeprefix(_ROOT_BLACKBOARD)
        span = bound.element.value_span(parameter.name)
        if name not in self._parameters:
            message = f"{parameter.name}: the mission has no parameter '{name}'"
            near = nearest(name, self._parameters)
            prefix = key[: len(key) - len(name)]
            suggestion = f"{{{prefix}{near}}}" if near else None
            hint = f"give it one: --params FILE, or --ros-args -p {name}:=..."
            self._report(bound, span, "unknown-key", message, suggestion=suggestion, hint=hint)
            return None
        try:
            return parameter.value_type.convert(str(self._parameters[name]))
        except ConversionError as error:
            message = f"{parameter.name}: the mission's parameter '{name}' does not fit: {error.message}"
            hint = f"it must be {parameter.value_type.label}"
            self._report(bound, span, "wrong-value", message, hint=hint)
            return None

    def _report(self, bound: BoundNode, span: Span, code: str, message: str, **advice: str | None) -> None:
        finding = Diagnostic(code, message, bound.element.source, span, **advice)  # type: ignore[arg-type]
        self._findings.append(finding)

    def _place(self, bound: BoundNode) -> Behaviour:
        """Make a node where it stands in the tree, with what is wrapped around it there."""
        behaviour = self._make(bound)
        if bound.oneshot is None:
            return behaviour
        wrapper = OneShot(name=f"{bound.name}OneShot", child=behaviour, policy=bound.oneshot)
        self._origins[wrapper.id] = Origin(bound, {"policy": bound.oneshot})
        return wrapper

    def _make(self, bound: BoundNode) -> Behaviour:
        """Make a node itself; a node that another one refers to may be made before its place comes."""
        if bound in self._built:
            return self._built[bound]
        arguments = self._arguments[bound]
        attributes = {
            name: self._shown(bound, name, arguments[name])
            for name, parameter in bound.spec.parameters.items()
            if parameter.role is Role.ATTRIBUTE
        }
        for name, target in bound.references.items():
            arguments[name] = self._make(target)
            attributes[name] = target.name
        for name, parameter in bound.spec.parameters.items():
            if parameter.role is Role.CHILDREN:
                arguments[name] = [self._place(child) for child in bound.children]
            elif parameter.role is Role.CHILD:
                arguments[name] = self._place(bound.children[0])
        behaviour = self._construct(bound, arguments)
        self._built[bound] = behaviour
        uses = (Use(use.kind, use.name.format_map(attributes)) for use in bound.spec.uses)
        self._origins[behaviour.id] = Origin(bound, attributes, tuple(uses))
        return behaviour

    def _shown(self, _bound: BoundNode, _name: str, value: object) -> object:
        return value

    def _construct(self, bound: BoundNode, arguments: dict[str, Any]) -> Behaviour:
        try:
            behaviour: Behaviour = bound.spec.cls(**arguments)
        except Exception as error:  # whatever a user's constructor does
            message = f"<{bound.element.tag}> cannot be made: {type(error).__name__}: {error}"
            element = bound.element
            finding = Diagnostic("constructor-failed", message, element.source, element.tag_span())
            raise TreeError([finding]) from error
        return behaviour


class _PreviewBuilder(_Builder):
    def _handed_over(self, bound: BoundNode, parameter: Parameter) -> object:  # noqa: ARG002
        if not parameter.required or parameter.target is None:
            return parameter.default
        return self._context.setdefault(parameter.target, preview_of(parameter.target))

    def _blackboard_value(self, bound: BoundNode, parameter: Parameter, key: str) -> object:  # noqa: ARG002
        value_type = parameter.value_type
        if value_type is None or not parameter.required:
            return parameter.default
        return value_type.convert(value_type.choices[0] if value_type.choices else "0")

    def _shown(self, bound: BoundNode, name: str, value: object) -> object:
        return f"{{{bound.keys[name]}}}" if name in bound.keys else value
