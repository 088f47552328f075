"""The arguments of the constructors of a tree's nodes."""

from array import array
from collections.abc import Mapping
from typing import Any

from sar_compiler.nodes.binding.bound import BoundNode
from sar_compiler.nodes.binding.collector import Collector
from sar_compiler.nodes.binding.instances import Instance
from sar_compiler.nodes.spec import Direction, Parameter
from sar_compiler.nodes.values import ConversionError
from sar_compiler.runtime.blackboard import ROOT_SIGN, Entry, Scope
from sar_compiler.runtime.clock import Clock, WallClock
from sar_compiler.runtime.context import preview_of
from sar_compiler.runtime.enums import Enums
from sar_compiler.runtime.expressions import Script
from sar_compiler.runtime.ports import InOut, Input, Output
from sar_compiler.tree.diagnostic import Advice
from sar_compiler.tree.guessing import nearest


class Arguments:
    """Collects the arguments of nodes, but for their children and the nodes that they refer to.

    Args:
        context: The objects that the mission hands over, by their type.
        parameters: The keys of the root blackboard that have a value when the tree is made.
        collector: Is told what is missing or does not fit.
    """

    def __init__(
        self, context: Mapping[type, object], parameters: Mapping[str, object], collector: Collector
    ) -> None:
        # Time passes in every tree.
        self._context: dict[type, object] = {Clock: WallClock(), **context}
        self._parameters = parameters
        self._collector = collector

    parameter_advice = "give it one: --params FILE, or --ros-args -p {name}:=..."
    """Advice for a parameter of the mission that is missing."""

    @property
    def enums(self) -> Enums:
        """The names that scripts know."""
        enums = self._context.setdefault(Enums, Enums())
        assert isinstance(enums, Enums)  # noqa: S101 - the type is the key
        return enums

    def of(self, instance: Instance, bound: BoundNode) -> dict[str, Any]:
        """Return the arguments of a node, by its parameters' names."""
        spec = bound.spec
        if spec.is_plain and not bound.keys:
            return {"name": bound.name, **spec.plain_defaults, **bound.values}
        arguments: dict[str, Any] = {"name": bound.name, **spec.plain_defaults}
        for parameter in spec.plain:
            if parameter.name in bound.keys or parameter.name in bound.values:
                arguments[parameter.name] = self.fixed_value(instance, bound, parameter)
        for parameter in spec.ports:
            self._port(instance, bound, parameter, arguments)
        for parameter in spec.handed_over:
            arguments[parameter.name] = self._handed_over(instance, bound, parameter)
        return arguments

    def fixed_value(self, instance: Instance, bound: BoundNode, parameter: Parameter) -> object:
        """Return the value of an attribute that is fixed when the tree is compiled; its default if it is not written."""
        if parameter.name in bound.keys:
            return self._blackboard_value(instance, bound, parameter)
        return bound.values.get(parameter.name, parameter.default)

    def _port(
        self, instance: Instance, bound: BoundNode, parameter: Parameter, arguments: dict[str, Any]
    ) -> None:
        """Add a port; one that is not written is left to the constructor's default."""
        name, value_type = parameter.name, parameter.value_type
        assert value_type is not None  # noqa: S101 - every attribute has one
        cls = InOut if parameter.direction is Direction.INOUT else Input
        if name in bound.keys:
            entry = instance.scope.resolve(bound.keys[name])
            kind = kind_of(value_type.python)
            entry.declare(kind)
            self._check_given(bound, parameter, bound.keys[name], instance.scope)
            written = parameter.direction is Direction.OUTPUT
            arguments[name] = Output(entry, kind) if written else cls(entry, value_type.fit, name)
        elif name in bound.values:
            arguments[name] = cls(bound.values[name], name=name)

    def _check_given(self, bound: BoundNode, parameter: Parameter, key: str, scope: Scope) -> None:
        """Report a number of the mission's that a port reads as a text: in a file the two are different."""
        text_wanted = parameter.value_type is not None and parameter.value_type.python is str
        if not text_wanted or not self._parameters:
            return
        owner, name = scope.owner(key)
        given = self._parameters.get(name) if owner is scope.root else None
        if isinstance(given, (int, float)):
            message = (
                f"{parameter.name}: '{name}' is given as the number {given!r}, and this port reads a text"
            )
            hint = f"give it as a text: '{given}'"
            self._collector.add("wrong-value", message, bound.element, value=parameter.name, hint=hint)

    def _handed_over(self, instance: Instance, bound: BoundNode, parameter: Parameter) -> object:
        target = parameter.target
        assert target is not None  # noqa: S101 - every context parameter has one
        if target is Scope:
            return instance.scope
        if target is Enums:
            return self.enums
        if target in self._context or not parameter.required:
            return self._context.get(target, parameter.default)
        message = f"<{bound.spec.tag}> needs a {target.__name__}, which this mission does not have"
        self._collector.add("missing-context", message, bound.element)
        return None

    def _blackboard_value(self, instance: Instance, bound: BoundNode, parameter: Parameter) -> object:
        """Return the value that a key has when the tree is compiled."""
        assert parameter.value_type is not None  # noqa: S101 - every attribute has one
        key, name = bound.keys[parameter.name], parameter.name
        entry = instance.scope.resolve(key)
        if not entry.exists:
            self._missing_key(instance, bound, parameter, key)
            return None
        value = entry.read()
        try:
            return parameter.value_type.convert(_as_text(value))
        except ConversionError as error:
            _, plain = instance.scope.owner(key)
            message = f"{name}: the mission's parameter '{plain}' does not fit: {error.message}"
            hint = f"it must be {parameter.value_type.label}"
            self._collector.add("wrong-value", message, bound.element, value=name, hint=hint)
            return None

    def _missing_key(self, instance: Instance, bound: BoundNode, parameter: Parameter, key: str) -> None:
        owner, name = instance.scope.owner(key)
        prefix = ROOT_SIGN if key.startswith(ROOT_SIGN) else ""
        if owner is instance.scope.root:
            message = f"{parameter.name}: the mission has no parameter '{name}'"
            hint = self.parameter_advice.format(name=name)
        else:
            message = (
                f"{parameter.name}: the key '{key}' of this subtree has no value yet when the tree is made"
            )
            hint = f"this attribute is fixed then: pass a value, or a parameter as {{{ROOT_SIGN}{key}}}"
        near = nearest(name, self._parameters)
        advice = Advice(suggestion=f"{{{prefix}{near}}}" if near else None, hint=hint)
        self._collector.add("unknown-key", message, bound.element, value=parameter.name, **advice)


def write_constant(entry: Entry, value: object) -> None:
    """Write what an entry holds before the first tick; a number gives it its type."""
    entry.declare(kind_of(type(value)) if not isinstance(value, str) else None)
    entry.write(value)


def kind_of(python: type | None) -> type | None:
    """Return the type that an entry has for texts that are given to it, from a type of Python's."""
    if python is Script:
        return str
    return python if python in (bool, int, float, str) else None


def _as_text(value: object) -> str:
    """Write a parameter of the mission as it would be written in a file; arrays become lists."""
    if isinstance(value, (list, tuple, array)):
        return ";".join(str(item) for item in value)
    return str(value)


class PreviewArguments(Arguments):
    """Stand-ins for what only a mission has."""

    def _handed_over(self, instance: Instance, bound: BoundNode, parameter: Parameter) -> object:
        if parameter.target in (Scope, Enums):
            return super()._handed_over(instance, bound, parameter)
        if not parameter.required or parameter.target is None:
            return parameter.default
        return self._context.setdefault(parameter.target, preview_of(parameter.target))

    def _blackboard_value(self, instance: Instance, bound: BoundNode, parameter: Parameter) -> object:  # noqa: ARG002
        value_type = parameter.value_type
        if value_type is None or not parameter.required:
            return parameter.default
        return value_type.convert(value_type.example)
