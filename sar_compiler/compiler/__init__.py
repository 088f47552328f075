"""Compiles a bound tree to py_trees behaviours, and records the origin of each behaviour in the file."""

import functools
import weakref
from array import array
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple
from uuid import UUID

import py_trees
from py_trees.behaviour import Behaviour
from py_trees.behaviours import Dummy
from py_trees.common import OneShotPolicy
from py_trees.decorators import OneShot, PassThrough

from sar_compiler.gc_pause import gc_paused
from sar_compiler.nodes.binding.binder import bind
from sar_compiler.nodes.binding.bound import Binding, BoundNode, SkipAnalysis
from sar_compiler.nodes.binding.instances import TreeInstance, expand
from sar_compiler.nodes.binding.nesting import find_main_tree
from sar_compiler.nodes.collector import FindingCollector
from sar_compiler.nodes.registry import Registry, is_library_tag
from sar_compiler.nodes.spec import Direction, Kind, Parameter, ParameterRole, Use
from sar_compiler.nodes.values import ConversionError
from sar_compiler.runtime.blackboard import ROOT_SIGN, Board, Entry, Scope
from sar_compiler.runtime.clock import Clock, WallClock
from sar_compiler.runtime.context import preview_of
from sar_compiler.runtime.expressions import Script
from sar_compiler.runtime.language_nodes import Conditions
from sar_compiler.runtime.outcomes import Outcome
from sar_compiler.runtime.ports import InOut, Input, Output
from sar_compiler.runtime.variables import Enums
from sar_compiler.tree.diagnostic import Advice, Diagnostic, Severity, TreeError
from sar_compiler.tree.forest import Forest
from sar_compiler.tree.guessing import nearest
from sar_compiler.tree.model import SUBTREE_TAG, TreeFile

# Looked up once, because access to enumeration members is slow in Python 3.11, and every port needs these two.
_INOUT, _OUTPUT = Direction.INOUT, Direction.OUTPUT


@dataclass(frozen=True)
class Origin:
    """The node and the attributes from which a behaviour was built.

    Attributes:
        bound: The bound node.
        attributes: The values passed to the behaviour. A blackboard key with an unknown value is in braces, and a
            reference is the name of the node.
        uses: The resources outside the tree that the behaviour needs, with the placeholders in their names replaced.
    """

    bound: BoundNode
    attributes: Mapping[str, object]
    uses: tuple[Use, ...] = ()


class Construction(NamedTuple):
    """A record of how a behaviour was constructed: the node, the subtree instance and the values.

    Attributes:
        behaviour: The id of the behaviour.
        instance: The subtree instance that contains the behaviour.
        bound: The node for which the behaviour was constructed.
        wrapper: The attributes of a wrapper around the node; None if the behaviour is the node itself.
        known: The values of constant attributes that were read from the blackboard.
    """

    behaviour: UUID
    instance: TreeInstance
    bound: BoundNode
    wrapper: Mapping[str, object] | None = None
    known: Mapping[str, Any] | None = None


class Origins(Mapping[UUID, Origin]):
    """The origins of all behaviours of a tree, by behaviour ID.

    Each origin is computed when it is requested.
    """

    def __init__(self, constructions: Sequence[Construction]) -> None:
        self._constructions = constructions

    @functools.cached_property
    def _by_id(self) -> dict[UUID, Construction]:
        # Built on first use, because hashing the ids would double the cost of the records during compilation.
        return {each.behaviour: each for each in self._constructions}

    def __getitem__(self, behaviour: UUID) -> Origin:
        _, instance, bound, wrapper, known = self._by_id[behaviour]
        if wrapper is not None:
            return Origin(bound, wrapper)
        attributes = _attributes(instance, bound, known or {})
        return Origin(bound, attributes, tuple(_uses(instance, bound, attributes)))

    def construction(self, behaviour: UUID) -> Construction:
        """Return the record of how a behaviour was constructed."""
        return self._by_id[behaviour]

    def declared_outcomes(self) -> dict[UUID, tuple[Outcome, ...]]:
        """Return the declared outcomes of each leaf that has labelled outcomes, by behaviour ID."""
        return {
            each.behaviour: each.bound.spec.outcomes
            for each in self._constructions
            if each.wrapper is None
            and each.bound.spec.kind.is_leaf
            and any(outcome.label for outcome in each.bound.spec.outcomes)
        }

    def location(self, behaviour: UUID) -> str | None:
        """Return the file and line of a behaviour's element, or None if no file contains the behaviour."""
        made = self._by_id.get(behaviour)
        return None if made is None else made.bound.element.file_and_line

    def __iter__(self) -> Iterator[UUID]:
        return (each.behaviour for each in self._constructions)

    def __len__(self) -> int:
        return len(self._constructions)


# The origins of each compiled tree by its root, for callers that have only a failed behaviour. Both are weak references.
_of_trees: "weakref.WeakKeyDictionary[Behaviour, weakref.ref[Origins]]" = weakref.WeakKeyDictionary()


def register_origins(root: Behaviour, origins: Origins) -> None:
    """Register the origins of a tree's behaviours, so that they can be found while the tree exists."""
    _of_trees[root] = weakref.ref(origins)


def file_and_line_of(behaviour: Behaviour) -> str | None:
    """Return the file and line of a behaviour, or of its nearest ancestor from a file; None if neither exists."""
    around: list[Behaviour] = []
    each: Behaviour | None = behaviour
    while each is not None:
        around.append(each)
        origins = _of_trees[each]() if each in _of_trees else None
        if origins is not None:
            places = (origins.location(inner.id) for inner in around)
            return next((place for place in places if place is not None), None)
        each = each.parent
    return None


def _attributes(instance: TreeInstance, bound: BoundNode, known: Mapping[str, Any]) -> dict[str, object]:
    attributes: dict[str, object] = {}
    for name, parameter in bound.spec.parameters.items():
        if parameter.role is ParameterRole.ATTRIBUTE:
            if name in known:
                attributes[name] = known[name]
            elif name in bound.keys:
                attributes[name] = f"{{{bound.keys[name]}}}"
            elif name in bound.values:
                attributes[name] = bound.values[name]
            elif parameter.direction is None:
                attributes[name] = bound.spec.implied_values.get(name, parameter.default)
    for parameter in bound.spec.references:
        target = instance.target_of(bound, parameter.name)
        if target is not None:
            attributes[parameter.name] = target[1].name
    return attributes


def _uses(instance: TreeInstance, bound: BoundNode, attributes: Mapping[str, object]) -> Iterator[Use]:
    """Yield the external resources that a node needs, unless their names depend on unknown keys."""
    ports = {each.name for each in bound.spec.ports}
    entries = {name: instance.scope.resolve(key) for name, key in bound.keys.items() if name in ports}
    known = {name: entry for name, entry in entries.items() if entry.exists and not entry.is_unknown}
    names = {**attributes, **{name: entry.read() for name, entry in known.items()}}
    for use in bound.spec.uses:
        if not any(f"{{{name}}}" in use.name for name in entries.keys() - known.keys()):
            yield Use(use.kind, use.name.format_map(names))


class Arguments:
    """Provider of the constructor arguments of nodes, except for children and references.

    Args:
        context: The objects that the mission provides, by type.
        parameters: The values of the mission parameters, by key of the root blackboard.
        collector: The collector of findings about missing or wrong arguments.
        enums: The named constants and their numbers, unless *context* has `Enums`.
    """

    def __init__(
        self,
        context: Mapping[type, object],
        parameters: Mapping[str, object],
        collector: FindingCollector,
        enums: Mapping[str, int],
    ) -> None:
        # Every tree needs a clock.
        self._context: dict[type, object] = {Clock: WallClock(), Enums: Enums(enums), **context}
        self._parameters = parameters
        self._collector = collector

    parameter_advice = "set it: --params FILE, or --ros-args -p {name}:=..."
    """The hint that is shown for a missing mission parameter."""

    @property
    def enums(self) -> Enums:
        """The named constants that scripts can use."""
        enums = self._context[Enums]
        assert isinstance(enums, Enums)  # noqa: S101 - the type is the key
        return enums

    def node_arguments(self, instance: TreeInstance, bound: BoundNode) -> dict[str, Any]:
        """Return a node's constructor arguments, keyed by parameter name."""
        spec = bound.spec
        if not (spec.ports or spec.handed_over or bound.keys):
            return {"name": bound.name, **spec.plain_defaults, **bound.values}
        arguments: dict[str, Any] = {"name": bound.name, **spec.plain_defaults}
        for parameter in spec.constant_attributes:
            if parameter.name in bound.keys or parameter.name in bound.values:
                arguments[parameter.name] = self.fixed_value(instance, bound, parameter)
        for parameter in spec.ports:
            self._port(instance, bound, parameter, arguments)
        for parameter in spec.handed_over:
            arguments[parameter.name] = self._handed_over(instance, bound, parameter)
        return arguments

    def fixed_value(self, instance: TreeInstance, bound: BoundNode, parameter: Parameter) -> object:
        """Return the compile-time value of a constant attribute, or its default if the file does not set it."""
        if parameter.name in bound.keys:
            return self._blackboard_value(instance, bound, parameter)
        return bound.values.get(parameter.name, parameter.default)

    def _port(
        self, instance: TreeInstance, bound: BoundNode, parameter: Parameter, arguments: dict[str, Any]
    ) -> None:
        """Add the constructor argument for a port.

        Without a value in the file, keep the constructor's default.
        """
        name, value_type = parameter.name, parameter.value_type
        cls = InOut if parameter.direction is _INOUT else Input
        if name in bound.keys:
            entry = instance.scope.resolve(bound.keys[name])
            kind = kind_of(value_type.python)
            entry.declare(kind)
            self._check_mission_parameter(bound, parameter, bound.keys[name], instance.scope)
            written = parameter.direction is _OUTPUT
            arguments[name] = (
                Output(entry, kind)
                if written
                else cls(entry, value_type.fit, name, value_type.unchanged_type)
            )
        elif name in bound.values:
            arguments[name] = cls(bound.values[name], name=name)

    def _check_mission_parameter(
        self, bound: BoundNode, parameter: Parameter, key: str, scope: Scope
    ) -> None:
        """Report a mission parameter whose value is a number if the port expects a string."""
        if parameter.value_type.python is not str or not self._parameters:
            return
        owner, name = scope.owner(key)
        given = self._parameters.get(name) if owner is scope.root else None
        if isinstance(given, (int, float)):
            message = f"{parameter.name}: '{name}' is the number {given!r}, but this port reads a string"
            hint = f"set it to the string '{given}'"
            self._collector.add("wrong-value", message, bound.element, value=parameter.name, hint=hint)

    def _handed_over(self, instance: TreeInstance, bound: BoundNode, parameter: Parameter) -> object:
        target = parameter.target
        assert target is not None  # noqa: S101 - every context parameter has one
        if target is Scope:
            return instance.scope
        if target in self._context or not parameter.required:
            return self._context.get(target, parameter.default)
        message = f"<{bound.spec.tag}> needs an object of the type {target.__name__}, but this mission does not provide it"
        hint = "to display the tree without a mission, call preview(), which replaces missing objects by placeholders"
        self._collector.add("missing-context", message, bound.element, hint=hint)
        return None

    def _blackboard_value(self, instance: TreeInstance, bound: BoundNode, parameter: Parameter) -> object:
        """Return the compile-time value of an attribute for which the file names a blackboard key."""
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
            message = f"{name}: the mission parameter '{plain}' is invalid: {error.message}"
            hint = f"it must be {parameter.value_type.label}"
            self._collector.add("wrong-value", message, bound.element, value=name, hint=hint)
            return None

    def _missing_key(self, instance: TreeInstance, bound: BoundNode, parameter: Parameter, key: str) -> None:
        owner, name = instance.scope.owner(key)
        prefix = ROOT_SIGN if key.startswith(ROOT_SIGN) else ""
        if owner is instance.scope.root:
            message = f"{parameter.name}: the mission has no parameter '{name}'"
            hint = self.parameter_advice.format(name=name)
        else:
            message = f"{parameter.name}: the key '{key}' of this subtree has no value at compile time"
            hint = f"this attribute is fixed at compile time. Pass a value, or a mission parameter as {{{ROOT_SIGN}{key}}}"
        near = nearest(name, self._parameters)
        advice = Advice(suggestion=f"{{{prefix}{near}}}" if near else None, hint=hint)
        self._collector.add("unknown-key", message, bound.element, value=parameter.name, **advice)


def write_constant(entry: Entry, value: object) -> None:
    """Write a constant to an entry before the first tick. If it is a number, also set the entry's type."""
    entry.declare(kind_of(type(value)) if not isinstance(value, str) else None)
    entry.write(value)


def kind_of(python: type | None) -> type | None:
    """Return the type to which an entry converts strings, given the Python type of its port."""
    if python is Script:
        return str
    return python if python in (bool, int, float, str) else None


def _as_text(value: object) -> str:
    """Convert a mission parameter to the text of an attribute. List and array items are separated by `;`."""
    if isinstance(value, (list, tuple, array)):
        return ";".join(str(item) for item in value)
    return str(value)


class PreviewArguments(Arguments):
    """Provider of the constructor arguments for a preview.

    Placeholders replace the mission's objects and parameters.
    """

    def _handed_over(self, instance: TreeInstance, bound: BoundNode, parameter: Parameter) -> object:
        if parameter.target in (Scope, Enums):
            return super()._handed_over(instance, bound, parameter)
        if not parameter.required or parameter.target is None:
            return parameter.default
        return self._context.setdefault(parameter.target, preview_of(parameter.target))

    def _blackboard_value(self, instance: TreeInstance, bound: BoundNode, parameter: Parameter) -> object:  # noqa: ARG002
        value_type = parameter.value_type
        return value_type.convert(value_type.example) if parameter.required else parameter.default


_NodeInInstance = tuple[TreeInstance, BoundNode]
"""A tree instance, and a node in this instance."""


def report_without_class(bound: BoundNode, collector: FindingCollector) -> None:
    """Report a node that cannot be created, because it has no class."""
    if bound.element.tag == SUBTREE_TAG:
        message = f"the tree '{bound.spec.tag}' is described by a model, but no file contains it"
        hint = "add an <include> of its file, or list the file under [project] trees in sar.toml"
    else:
        what = "is described by a model" if bound.spec.is_only_described else "is a node of another program"
        message = f"<{bound.spec.tag}> {what}, but no class is registered for it"
        hint = "load its module: --nodes package.module"
    if bound.spec.is_only_described and is_library_tag(bound.spec.tag):
        hint += f", or delete the model to use py_trees' <{bound.spec.tag}>"
    collector.add("not-installed", message, bound.element, hint=hint)


class Builder:
    """Builds the behaviours of one tree.

    Attributes:
        constructions: The construction of each behaviour.
    """

    def __init__(self, binding: Binding, arguments: Arguments, collector: FindingCollector) -> None:
        self.constructions: list[Construction] = []
        self._source = arguments
        self._collector = collector
        self._skipping = SkipAnalysis(binding.used_trees())
        # A reference may need its target before the tree order reaches it, so built targets are stored.
        self._targets: set[BoundNode] = set()
        self._built: dict[tuple[TreeInstance, BoundNode], Behaviour] = {}
        self._arguments: dict[tuple[TreeInstance, BoundNode], dict[str, Any]] = {}

    def prepare(self, instance: TreeInstance) -> None:
        """Collect and check the arguments of the nodes in an instance and its subtrees, and write constants."""
        self._targets.update(target for _, target in instance.references.values())
        for bound in instance.tree.demanding:
            if bound.references:
                self._targets.update(bound.references.values())
            if bound.spec.is_foreign:
                self.report_only_described(bound)
            if bound.keys or bound.spec.handed_over:
                self._arguments[instance, bound] = self._source.node_arguments(instance, bound)
            if bound.subtree is not None:
                inner = instance.inner[bound]
                for key, value in inner.constants():
                    write_constant(inner.scope.resolve(key), value)
                self.prepare(inner)

    def report_only_described(self, bound: BoundNode) -> None:
        """Report a node for which no class is registered."""
        report_without_class(bound, self._collector)

    def build(self, instance: TreeInstance, bound: BoundNode) -> Behaviour:
        """Build a node with its wrappers and descendants. The method is not recursive, because trees may be deep."""
        left: Iterator[_NodeInInstance] = iter([(instance, bound)])
        children: list[Behaviour] = []
        # The enclosing nodes, each with its remaining siblings and the siblings that are already built.
        waiting: list[tuple[TreeInstance, BoundNode, Iterator[_NodeInInstance], list[Behaviour]]] = []
        while True:
            for inner, node in left:
                if node.children or node.subtree is not None:
                    waiting.append((inner, node, left, children))
                    left, children = self._child_nodes(inner, node), []
                    break
                children.append(self._with_wrappers(inner, node, []))
            else:
                if not waiting:
                    return children[0]
                inner, node, left, siblings = waiting.pop()
                siblings.append(self._with_wrappers(inner, node, children))
                children = siblings

    @staticmethod
    def _child_nodes(instance: TreeInstance, bound: BoundNode) -> "Iterator[_NodeInInstance]":
        if bound.subtree is not None:
            inner = instance.inner[bound]
            assert inner.tree.root is not None  # noqa: S101 - else there are findings
            yield inner, inner.tree.root
        elif bound.spec.structure:
            for child in bound.children:
                yield instance, child

    def _with_wrappers(
        self, instance: TreeInstance, bound: BoundNode, children: list[Behaviour]
    ) -> Behaviour:
        """Build a node and its wrappers."""
        make = self._build_oneshot if bound in self._targets else self._make
        behaviour = make(instance, bound, children)
        if bound.conditions:
            behaviour = self._conditions(instance, bound, behaviour)
        if bound.oneshot is not None:
            policy = OneShotPolicy[bound.oneshot]
            behaviour = OneShot(name=f"{bound.name}OneShot", child=behaviour, policy=policy)
            self.constructions.append(Construction(behaviour.id, instance, bound, {"policy": policy}))
        return behaviour

    def _conditions(self, instance: TreeInstance, bound: BoundNode, child: Behaviour) -> Behaviour:
        name = f"{bound.name}Conditions"
        wrapper = Conditions(name, child, bound.conditions, instance.scope, self._source.enums)
        shown = {name: script.text for name, script in bound.conditions.items()}
        self.constructions.append(Construction(wrapper.id, instance, bound, shown))
        return wrapper

    def _build_oneshot(
        self, instance: TreeInstance, bound: BoundNode, children: list[Behaviour] | None = None
    ) -> Behaviour:
        if (instance, bound) not in self._built:
            if children is None:
                children = [self.build(*below) for below in self._child_nodes(instance, bound)]
            self._built[instance, bound] = self._make(instance, bound, children)
        return self._built[instance, bound]

    def _make(self, instance: TreeInstance, bound: BoundNode, children: list[Behaviour]) -> Behaviour:
        spec = bound.spec
        known = self._arguments[instance, bound] if bound.keys or spec.handed_over else None
        arguments = self._source.node_arguments(instance, bound) if known is None else dict(known)
        for parameter in spec.references:
            target = instance.target_of(bound, parameter.name)
            if target is not None:
                arguments[parameter.name] = self._build_oneshot(*target)
        if bound.subtree is not None:
            (arguments["child"],) = children
        elif spec.structure:
            arguments[spec.structure] = children if spec.kind is Kind.CONTROL else children[0]
        if spec.constructor_names:
            arguments = {spec.constructor_names.get(name, name): value for name, value in arguments.items()}
        try:
            behaviour: Behaviour = self._maker(bound)(**arguments)
            if not hasattr(behaviour, "id"):
                raise TypeError("its constructor did not call super().__init__(name)")  # noqa: TRY301 - as its own errors are
        except TreeError:
            raise
        except Exception as error:
            stand_in = self.stand_in(bound, arguments)
            if stand_in is None:
                raise _constructor_error(bound, error) from error
            behaviour = stand_in
        self.constructions.append(
            Construction(behaviour.id, instance, bound, None, known and self.known_values(bound, known))
        )
        return behaviour

    def stand_in(self, bound: BoundNode, arguments: Mapping[str, Any]) -> Behaviour | None:  # noqa: ARG002
        """Return a replacement for a node whose constructor rejects the arguments, or None if there is none."""
        return None

    def known_values(self, bound: BoundNode, arguments: Mapping[str, Any]) -> Mapping[str, Any] | None:
        """Return the values that constant attributes have read from the blackboard; None if the node names no key."""
        if not bound.keys:
            return None
        return {parameter.name: arguments[parameter.name] for parameter in bound.spec.constant_attributes}

    def _maker(self, bound: BoundNode) -> Any:
        """Return the factory of a node.

        If the py_trees class would misinterpret a skip, return the factory of a replacement.

        For a node that has only a model, return the factory of a py_trees behaviour of the same kind.
        """
        spec = bound.spec
        replacement = spec.skipping.replacement
        if replacement is not None and self._skipping.has_skippable_child(bound):
            return replacement.maker
        return spec.maker or functools.partial(_stand_in, spec.kind)


class PreviewBuilder(Builder):
    """Builds a tree for display, without the objects of a mission and without the modules of leaves."""

    def report_only_described(self, bound: BoundNode) -> None:
        """Report nothing, because a py_trees behaviour of the same kind replaces the node."""

    def stand_in(self, bound: BoundNode, arguments: Mapping[str, Any]) -> Behaviour | None:
        """Return a py_trees behaviour as a replacement if one of the rejected arguments is a placeholder."""
        if not any(parameter.name in bound.keys for parameter in bound.spec.constant_attributes):
            return None
        return _stand_in(bound.spec.kind, **arguments)

    def known_values(self, bound: BoundNode, arguments: Mapping[str, Any]) -> None:  # noqa: ARG002
        """Return None, so that the tree shows keys instead of placeholders for their values."""
        return None  # noqa: RET501 - the base class returns a value


def _stand_in(kind: Kind, /, name: str, **structure: Any) -> Behaviour:
    if kind is Kind.CONTROL:
        return py_trees.composites.Sequence(name, memory=True, children=structure["children"])
    return PassThrough(name, structure["child"]) if kind is Kind.DECORATOR else Dummy(name)


def _constructor_error(bound: BoundNode, error: Exception) -> TreeError:
    element = bound.element
    message = f"<{bound.spec.tag}> cannot be created: {type(error).__name__}: {error}"
    return TreeError([element.finding("constructor-failed", message)])


__all__ = ["CompiledTree", "Origin", "bind_main", "compile_tree", "compile_with", "preview_tree"]


_OUTLINE = 25
"""The maximum number of lines of a tree in `repr()`."""


@dataclass(frozen=True, repr=False)
class CompiledTree:
    """A tree that can be ticked.

    Attributes:
        root: The root behaviour.
        origins: The origin of each behaviour, by its id.
        instance: The instance of the tree, which contains the instances and keys of its subtrees.
    """

    root: Behaviour
    origins: Origins
    instance: TreeInstance

    def __repr__(self) -> str:
        count = len(self.origins)
        lines = py_trees.display.ascii_tree(self.root).rstrip("\n").split("\n")
        shown = lines if len(lines) <= _OUTLINE else [*lines[: _OUTLINE - 1], "    ..."]
        head = f"<{type(self).__name__} of {count} {'node' if count == 1 else 'nodes'}>"
        return "\n".join([head, *(f"    {line}" for line in shown)])

    @property
    def name(self) -> str:
        """The ID of the tree."""
        return self.instance.tree.name

    @property
    def board(self) -> Board:
        """The blackboard entries of the tree."""
        return self.instance.scope.board

    def uses(self) -> list[Use]:
        """Return the external resources that the leaves of the tree need, without duplicates."""
        return list(dict.fromkeys(use for origin in self.origins.values() for use in origin.uses))


def bind_main(
    forest: Forest, registry: Registry, tree_id: str | None = None, palettes: Iterable[TreeFile] = ()
) -> Binding:
    """Bind the tree that is to be executed.

    Raises:
        TreeError: If there is no such tree, or it has errors. The exception contains all findings.
    """
    binding = bind(forest, registry, find_main_tree(forest, tree_id), palettes)
    findings = [*forest.findings, *forest.clashes, *binding.findings]
    if _has_error(findings):
        raise TreeError(findings)
    return binding


def compile_tree(
    binding: Binding, context: Mapping[type, object], parameters: Mapping[str, object]
) -> CompiledTree:
    """Compile a bound tree for a mission.

    Args:
        binding: The tree, without errors.
        context: The objects that the mission provides for its leaves, by type.
        parameters: The values of the mission parameters, by key of the root blackboard.

    Raises:
        TreeError: If a key is missing or its value is invalid, if the mission lacks an object that a leaf needs, or if a
            constructor rejects its arguments.
    """
    collector = FindingCollector()
    arguments = Arguments(context, parameters, collector, binding.enums)
    return compile_with(binding, Builder(binding, arguments, collector), parameters, collector)


def require_classes(binding: Binding) -> None:
    """Check that every node of a bound tree has a class.

    Raises:
        TreeError: If nodes have no class. The findings name each of these nodes.
    """
    collector = FindingCollector()
    for bound in binding.all_nodes():
        if bound.spec.is_foreign:
            report_without_class(bound, collector)
    if collector.findings:
        raise TreeError(collector.findings)


def preview_tree(binding: Binding) -> CompiledTree:
    """Compile a bound tree for display, with placeholders for mission objects.

    An attribute with an unknown key has its default or an example value. A py_trees behaviour of the same kind replaces
    each node that has only a model.
    """
    collector = FindingCollector()
    arguments = PreviewArguments({}, {}, collector, binding.enums)
    return compile_with(binding, PreviewBuilder(binding, arguments, collector), {}, collector)


@gc_paused()
def compile_with(
    binding: Binding, builder: Builder, parameters: Mapping[str, object], collector: FindingCollector
) -> CompiledTree:
    """Compile a bound tree, using the given builder.

    Raises:
        TreeError: If the tree has errors, or the builder has findings.
    """
    if _has_error(binding.findings) or binding.main.root is None:
        raise TreeError(binding.findings)
    top = expand(binding.main, collector)
    for name, value in parameters.items():
        write_constant(top.scope.resolve(name), value)
    # All findings about arguments are reported together, before the first behaviour is built.
    builder.prepare(top)
    if _has_error(collector.findings):
        raise TreeError(_sorted_findings(collector.findings))
    root, origins = builder.build(top, binding.main.root), Origins(builder.constructions)
    register_origins(root, origins)
    return CompiledTree(root, origins, top)


def _has_error(findings: Iterable[Diagnostic]) -> bool:
    return any(finding.severity is Severity.ERROR for finding in findings)


def _sorted_findings(findings: list[Diagnostic]) -> list[Diagnostic]:
    """Sort findings by file, line and column, and remove duplicates that repeated uses of a tree cause."""
    files = list(dict.fromkeys(finding.source.path for finding in findings))
    return sorted(
        dict.fromkeys(findings),
        key=lambda finding: (files.index(finding.source.path), finding.span.line, finding.span.column),
    )
