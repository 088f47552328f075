"""The spec of a node. A spec is derived from `register`, from a constructor or from a model."""

import functools
import importlib
import inspect
import re
import typing
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from enum import Enum
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias

from sar_compiler.errors import SarError
from sar_compiler.nodes.outcomes import SELF, find_script_error, outcomes_of, placeholders
from sar_compiler.nodes.semantics import Semantics
from sar_compiler.nodes.values import (
    ANYTHING,
    NO_VALUE,
    ValueType,
    is_class,
    port_type_of,
    require_value_type,
    strip_none,
    value_type_of,
)
from sar_compiler.runtime.context import is_mission_context
from sar_compiler.runtime.expressions import Script
from sar_compiler.runtime.outcomes import Fact, Outcome
from sar_compiler.runtime.ports import InOut, Input, Output
from sar_compiler.tree.diagnostic import Severity

if TYPE_CHECKING:
    from sar_compiler.nodes.collector import FindingCollector, NodeView


class RegistrationError(SarError):
    """A class cannot be registered for a tag."""


def path_of(thing: Any) -> str:
    """Return the import path of a class or function."""
    return f"{thing.__module__}:{thing.__qualname__}"


def load(path: str) -> Any:
    """Import a class or function.

    Raises:
        ImportError: If there is no such module.
        AttributeError: If the module does not define the name.
    """
    module, _, name = path.partition(":")
    return functools.reduce(getattr, name.split("."), importlib.import_module(module))


_PARENT = "sar_compiler.runtime.parents:EngineParent"
_KERNEL = "sar_compiler.runtime.kernel."
MARK = "__node_spec__"
"""The attribute of a registered class that contains its spec."""
Rule: TypeAlias = "Callable[[NodeView, FindingCollector], None]"
"""A function that reports conflicts between attributes of a node.

Each of these attributes is valid by itself.
"""


class Kind(str, Enum):
    """The kind of a node, as in BehaviorTree.CPP.

    The kinds are also the element names of the explicit form.
    """

    CONTROL = "Control"
    DECORATOR = "Decorator"
    ACTION = "Action"
    CONDITION = "Condition"

    @property
    def is_leaf(self) -> bool:
        """Whether nodes of this kind have no children."""
        return self in (Kind.ACTION, Kind.CONDITION)

    def takes(self, children: int) -> bool:
        """Return whether a node of this kind may have a given number of children in BehaviorTree.CPP."""
        if self is Kind.CONTROL:
            return children > 0
        return children == (0 if self.is_leaf else 1)


class Direction(str, Enum):
    """The direction in which a port passes values, in the terms of a `TreeNodesModel`."""

    INPUT = "input_port"
    OUTPUT = "output_port"
    INOUT = "inout_port"

    @property
    def message_name(self) -> str:
        """The description of the direction in messages."""
        words = {Direction.INPUT: "input", Direction.OUTPUT: "output, takes a {key}"}
        return words.get(self, "input and output")


class SkipPossibility(Enum):
    """The cases in which a tick of a node can be skipped."""

    NEVER = "never"
    FROM_CHILD = "from a child"
    """A tick can be skipped if a tick of a child can be skipped."""
    ALWAYS = "always"


class ParameterRole(Enum):
    """The role of a constructor parameter."""

    NAME = "name"
    """The name of the node, which is the attribute `name` or, without this attribute, the tag."""
    ATTRIBUTE = "attribute"
    """An attribute of the tag that contains a value."""
    REFERENCE = "reference"
    """An attribute of the tag that names another node of the tree."""
    CONTEXT = "context"
    """An object that the mission provides and that is not written in the file."""
    CHILD = "child"
    """The single child of a decorator."""
    CHILDREN = "children"
    """The children of a control."""


class Provenance(Enum):
    """The source of a node's spec. Some findings about the node, and their severities, depend on it."""

    INSTALLED = "an installed class"
    NAMED = "a named distribution"
    """A palette with a name and a version (`nav2:jazzy`), which lists every port."""
    DESCRIBED = "a file"
    """A model in a tree file or in a palette of the repository.

    Such files omit the ports that a node inherits.
    """
    FROM_USE = "its use"
    """A palette from `sar-compile nodes --from-use`.

    The tags and ports were found in trees. Their types and directions are guessed.
    """

    @property
    def is_description(self) -> bool:
        """Whether the node is known only from a description in a file."""
        return self in (Provenance.DESCRIBED, Provenance.FROM_USE)

    def severity_of_unlisted(self, *, is_near: bool) -> Severity:
        """Return the severity of a finding about an attribute that the spec does not list.

        Args:
            is_near: Whether the attribute's name is similar to a listed attribute.
        """
        if not self.is_description:
            return Severity.ERROR
        if self is Provenance.DESCRIBED:
            return Severity.ERROR if is_near else Severity.WARNING
        return Severity.WARNING if is_near else Severity.INFO


@dataclass(frozen=True)
class Use:
    """A resource outside the tree that must be available to a leaf before the first tick.

    Attributes:
        kind: `action`, `service`, `topic` (with a publisher), `transforms` or `nav2` (localised and active).
        name: The relative ROS name. `{parameter}` stands for the value of a constructor parameter.
    """

    kind: str
    name: str = ""

    @classmethod
    def action(cls, name: str) -> "Use":
        """Return the requirement that a server for an action is available."""
        return cls("action", name)

    @classmethod
    def service(cls, name: str) -> "Use":
        """Return the requirement that a server for a service is available."""
        return cls("service", name)

    @classmethod
    def topic(cls, name: str) -> "Use":
        """Return the requirement that a topic has a publisher."""
        return cls("topic", name)

    @classmethod
    def transforms(cls) -> "Use":
        """Return the requirement that `/tf` or `/tf_static` has transforms.

        Each frame must have one publisher.
        """
        return cls("transforms")

    @classmethod
    def nav2(cls) -> "Use":
        """Return the requirement that Nav2 has an initial pose and reports that it is active."""
        return cls("nav2")


@dataclass(frozen=True, repr=False)
class Parameter:
    """One constructor parameter of a node's class.

    Attributes:
        name: The attribute's name: the parameter's name without a trailing `_`.
        role: The parameter's role.
        required: Whether a file (or, for an object of the mission, the mission) must provide a value.
        default: The value if the attribute is not written.
        value_type: The type that converts an attribute's text to a value; `NO_VALUE` for a parameter without a text.
        direction: The direction of the values of a port (`Input`, `Output`, `InOut`); None for a parameter that is
            fixed when the tree is compiled.
        target_or_path: The class of a referenced node or of an object of the mission, or the class's import path.
        doc: The description, from the class's docstring.
        keyword: The parameter's name in the constructor, if different (`if_` for `if`).
    """

    name: str
    role: ParameterRole
    required: bool
    default: object = None
    value_type: ValueType = NO_VALUE
    direction: Direction | None = None
    target_or_path: type | str | None = None
    doc: str = ""
    keyword: str = ""

    @functools.cached_property
    def target(self) -> type | None:
        """The class of *target_or_path*, imported if necessary."""
        return load(self.target_or_path) if isinstance(self.target_or_path, str) else self.target_or_path

    @functools.cached_property
    def target_path(self) -> str:
        """The import path of the class of *target_or_path*; empty if there is no class."""
        return _path(self.target_or_path)

    @property
    def target_name(self) -> str:
        """The name of the class of *target_or_path*."""
        return self.target_path.rpartition(":")[2].rpartition(".")[2]

    @property
    def help(self) -> str:
        """The description for editors, which includes the direction of a port."""
        direction = f"{self.direction.message_name}.".capitalize() if self.direction else ""
        return f"{direction} {self.doc}".strip()

    @property
    def is_integer_parameter(self) -> bool:
        """Whether the parameter is an attribute with an integer that is fixed at compile time."""
        return (
            self.role is ParameterRole.ATTRIBUTE and self.direction is None and self.value_type.python is int
        )


def _path(class_or_path: type | str | None) -> str:
    if class_or_path is None or isinstance(class_or_path, str):
        return class_or_path or ""
    return path_of(class_or_path)


def _default_port(port: Parameter) -> Input[Any] | None:
    return None if port.direction is Direction.OUTPUT else Input(port.default)


def any_port(name: str, doc: str = "") -> Parameter:
    """Return an untyped port that can be read and written."""
    anything, inout = ANYTHING, Direction.INOUT
    return Parameter(
        name, ParameterRole.ATTRIBUTE, required=False, value_type=anything, direction=inout, doc=doc
    )


_DIRECTIONS: dict[object, Direction] = {
    Input: Direction.INPUT,
    Output: Direction.OUTPUT,
    InOut: Direction.INOUT,
}
_STRUCTURE = {"name": ParameterRole.NAME, "child": ParameterRole.CHILD, "children": ParameterRole.CHILDREN}
_VARIADIC = (inspect.Parameter.VAR_POSITIONAL, inspect.Parameter.VAR_KEYWORD)

CHILD_COUNTS: dict[Kind, tuple[int, int | None]] = {
    Kind.CONTROL: (1, None),
    Kind.DECORATOR: (1, 1),
    Kind.ACTION: (0, 0),
    Kind.CONDITION: (0, 0),
}
"""The minimum and maximum number of children by kind of node."""


class SkipSupport(NamedTuple):
    """How a node handles ticks that its children skip, and ticks in which the node itself is skipped.

    Attributes:
        possible: Whether a tick of the node can be skipped.
        replacement: The spec of the node that replaces this node if a child can be skipped.
        only_if: The attribute and value required for the node itself to skip a tick; None if neither is required.
        advice: An equivalent node that supports skipped children; empty if there is none.
        is_handled: Whether the node supports skipped children although it is never skipped itself.
    """

    possible: SkipPossibility = SkipPossibility.NEVER
    replacement: "NodeSpec | None" = None
    only_if: tuple[str, object] | None = None
    advice: str = ""
    is_handled: bool = False


class Signature(NamedTuple):
    """Declarations about a node's attributes that are missing from the node's constructor.

    Attributes:
        described: The parameters by name, in order, or a function that returns them; None to inspect the constructor.
        doc: The node's description; empty to use the docstring of the class.
        fixed: Values that the tag implies (`ReactiveSequence`: `memory` is false), including values of
            constructor arguments that are not attributes.
        factory: The import path of a function that creates the node from the spec and arguments; empty to call the class.
        from_use: Whether the signature was derived from the use of the tag in trees.
    """

    described: Mapping[str, Parameter] | Callable[[], Mapping[str, Parameter]] | None = None
    doc: str = ""
    fixed: Mapping[str, object] = {}
    factory: str = ""
    from_use: bool = False


@dataclass(frozen=True, repr=False)
class NodeSpec:
    """The spec of a tag: the class, the attributes, the outcomes and the semantics of the node.

    The parameters of a registered class are read from its constructor at the first access to `parameters`, because
    annotations may name classes that are defined later. The specs of this project's nodes contain the class's import path and
    the parameters, so that trees can be checked without importing the class.

    Attributes:
        tag: The tag in a tree file.
        class_or_path: The class that the compiler instantiates, or the import path (`module:name`) of the class or of a
            kernel node; None if the node has no class.
        kind: The kind of the node.
        statuses: The names of the statuses that a tick can return.
        effects: The node's effect on the world, in a few words; empty if it has no effect.
        uses: The resources outside the tree that the node needs.
        outcomes: For a leaf, the possible outcomes in a simulation; by default one for each status. For another node with a
            stand-in, the outcomes of the leaf that represents the world.
        facts: The facts that the outcomes use, with their initial values.
        reads: Further facts or blackboard keys on which the node's behaviour depends.
        writes: Further facts or blackboard keys that the node changes.
        semantics: How the node ticks its children, and how it uses time and the blackboard.
        skipping: How the node treats skipped ticks.
        signature: Declarations about the attributes, in addition to those of the constructor.
        child_count: The minimum and maximum number of children (None: no limit); the default depends on the kind.
        variant: Whether the spec is an alternative for an existing tag; the attributes in a file select one of them.
        former_tags: The node's tags in earlier versions of BehaviorTree.CPP and py_trees.
        former_attributes: The attributes in BehaviorTree.CPP 3, with their current names.
        rule: A function that reports attributes that conflict with each other or with the children.
        stand_in: For a control or decorator without a class, the spec of its replacement in runs without a robot. If there
            are outcomes, the replacement queries a leaf that represents the world.
    """

    tag: str
    class_or_path: type[Any] | str | None
    kind: Kind
    statuses: frozenset[str] = frozenset()
    effects: str = ""
    uses: tuple[Use, ...] = ()
    outcomes: tuple[Outcome, ...] = ()
    facts: Mapping[str, Fact] = field(default_factory=dict)
    reads: tuple[str, ...] = ()
    writes: tuple[str, ...] = ()
    semantics: Semantics = Semantics()  # noqa: RUF009 - frozen
    skipping: SkipSupport = SkipSupport()  # noqa: RUF009 - frozen
    signature: Signature = Signature()  # noqa: RUF009 - frozen
    child_count: tuple[int, int | None] = (-1, None)
    variant: bool = False
    former_tags: tuple[str, ...] = ()
    former_attributes: Mapping[str, str] = field(default_factory=dict)
    rule: "Rule | None" = None
    stand_in: "NodeSpec | None" = None

    def __post_init__(self) -> None:
        if self.child_count[0] < 0:
            object.__setattr__(self, "child_count", CHILD_COUNTS[self.kind])
        if self.kind.is_leaf and not self.outcomes:
            object.__setattr__(self, "outcomes", outcomes_of(self.statuses))

    @functools.cached_property
    def parameters(self) -> Mapping[str, Parameter]:
        """The constructor parameters by name, in order.

        Raises:
            RegistrationError: If a tree file cannot express one of the parameters. The message names the parameter.
        """
        described = self.signature.described
        if described is not None:
            return described() if callable(described) else described
        return _parameters_of(self)

    @functools.cached_property
    def doc(self) -> str:
        """The first paragraph of the node's description."""
        if self.signature.doc or self.is_by_path:
            return self.signature.doc
        return _documentation(self.cls)[0]

    @property
    def is_by_path(self) -> bool:
        """Whether the class is given as an import path."""
        return isinstance(self.class_or_path, str)

    @functools.cached_property
    def cls(self) -> type[Any] | None:
        """The node's class, imported if necessary; None if the node has no class.

        Raises:
            AttributeError: If the installed version of py_trees does not have the class.
        """
        if not isinstance(self.class_or_path, str):
            return self.class_or_path
        found: type[Any] = load(self.class_or_path)
        if not self._is_of_kernel:
            return found
        from sar_compiler.runtime import ticking

        bases = {Kind.CONTROL: ticking.OwnControl, Kind.DECORATOR: ticking.OwnDecorator}
        return ticking.behaviour_class(bases.get(self.kind, ticking.OwnLeaf), found)

    @property
    def _is_of_kernel(self) -> bool:
        return self.class_path.startswith(_KERNEL)

    @functools.cached_property
    def class_path(self) -> str:
        """The import path of the node's class; empty if the node has no class."""
        return _path(self.class_or_path)

    @functools.cached_property
    def maker(self) -> Callable[..., Any] | None:
        """The factory or class that creates instances of the node, imported if necessary."""
        if self.signature.factory:
            return functools.partial(load(self.signature.factory), self)
        if not self._is_of_kernel:
            return self.cls
        unwritten = {p.keyword or p.name: _default_port(p) for p in self.ports if not p.required}
        made: Callable[..., Any] | None = self.cls
        assert made is not None  # noqa: S101 - it has a path
        return functools.partial(made, **{**unwritten, **self.implied_values})

    @property
    def factory_path(self) -> str:
        """The import path of the factory or, if there is no factory, of the class; empty if there is neither."""
        return self.signature.factory or self.class_path

    def is_class_of(self, parameter: Parameter) -> bool:
        """Return whether an attribute that refers to another node can refer to this node.

        The node's class must be the parameter's class or a subclass of it.

        If both classes are given as import paths, only the paths are compared: none of these classes derives from another.
        """
        if self.is_by_path and isinstance(parameter.target_or_path, str):
            return self.class_path == parameter.target_path
        return parameter.target_path in self._ancestry

    @property
    def misreads_skips(self) -> bool:
        """Whether the node treats a skipped child as an interruption, and has no replacement in this project."""
        if self.kind.is_leaf or self.is_only_described:
            return False
        if self.is_by_path:
            skipping = self.skipping
            return skipping.possible is SkipPossibility.NEVER and not (
                skipping.replacement or skipping.is_handled
            )
        return _PARENT not in self._ancestry

    @functools.cached_property
    def _ancestry(self) -> frozenset[str]:
        """The import paths of the class and its bases; empty if the installed py_trees lacks the class."""
        with suppress(AttributeError):
            return frozenset(map(path_of, self.cls.__mro__)) if self.cls is not None else frozenset()
        return frozenset()

    @functools.cached_property
    def absent_methods(self) -> tuple[str, ...]:
        """The abstract methods of the class, which prevent its instantiation."""
        return tuple(sorted(() if self.is_by_path else getattr(self.cls, "__abstractmethods__", ())))

    @property
    def provenance(self) -> Provenance:
        """The source of this spec. For named palettes, `palettes.KnownSpec` overrides the source."""
        if not self.is_foreign:
            return Provenance.INSTALLED
        return Provenance.FROM_USE if self.signature.from_use else Provenance.DESCRIBED

    @property
    def is_only_described(self) -> bool:
        """Whether the node is known only from a model in a file, without a class or a named palette."""
        return self.provenance.is_description

    def with_port(self, unlisted: Parameter) -> "NodeSpec":
        """Return a copy of this spec with an additional port."""
        described = {**self.parameters, unlisted.name: unlisted}
        return replace(self, signature=self.signature._replace(described=described))

    @property
    def is_foreign(self) -> bool:
        """Whether the node has no class, because another program executes it."""
        return self.class_or_path is None

    @property
    def has_world_leaf(self) -> bool:
        """Whether the node queries the state of the world.

        In runs without a robot, the outcomes of a leaf represent this state.
        """
        return not self.kind.is_leaf and bool(self.outcomes)

    @functools.cached_property
    def implied_values(self) -> Mapping[str, object]:
        """The values that the tag implies, by parameter name."""
        return self.signature.fixed

    def fixed_value_names(self, parameter: Parameter) -> list[str]:
        """Return the texts that equal the value of a parameter that the tag implies."""
        kind, value = parameter.value_type, self.implied_values[parameter.name]
        return [text for text in kind.choices if kind.convert(text) == value]

    @functools.cached_property
    def references(self) -> list[Parameter]:
        """The parameters whose attributes name other nodes."""
        return [
            parameter for parameter in self.parameters.values() if parameter.role is ParameterRole.REFERENCE
        ]

    @functools.cached_property
    def required_attributes(self) -> list[Parameter]:
        """The attributes that are required in a file."""
        attributes = (p for p in self.parameters.values() if p.role is ParameterRole.ATTRIBUTE)
        return [p for p in attributes if p.required and p.name not in self.implied_values]

    @functools.cached_property
    def constant_attributes(self) -> list[Parameter]:
        """The attributes whose values are fixed at compile time."""
        return [
            p for p in self.parameters.values() if p.role is ParameterRole.ATTRIBUTE and p.direction is None
        ]

    @functools.cached_property
    def plain_defaults(self) -> dict[str, object]:
        """The value of each constant attribute that a file omits.

        The value is the one that the tag implies, or the default.
        """
        return {p.name: self.implied_values.get(p.name, p.default) for p in self.constant_attributes}

    @functools.cached_property
    def ports(self) -> list[Parameter]:
        """The attributes that are ports."""
        return [
            p
            for p in self.parameters.values()
            if p.role is ParameterRole.ATTRIBUTE and p.direction is not None
        ]

    @functools.cached_property
    def handed_over(self) -> list[Parameter]:
        """The parameters for objects that the mission provides."""
        return [p for p in self.parameters.values() if p.role is ParameterRole.CONTEXT]

    @functools.cached_property
    def needs_context(self) -> bool:
        """Whether an instance needs more than attribute values and children, such as facts or other nodes."""
        around = self.references or self.handed_over or self.facts or self.reads or self.writes
        return bool(around) or self.is_foreign

    @functools.cached_property
    def takes_script(self) -> bool:
        """Whether one of the attributes is a script."""
        return any(parameter.value_type.python is Script for parameter in self.parameters.values())

    @functools.cached_property
    def structure(self) -> str:
        """The name of the constructor parameter for children: `child` or `children`; empty for a leaf."""
        return {Kind.CONTROL: "children", Kind.DECORATOR: "child"}.get(self.kind, "")

    @functools.cached_property
    def skips_by_itself(self) -> bool:
        """Whether a tick of the node can be skipped even if no child is skipped.

        Every leaf of BehaviorTree.CPP can return SKIPPED, but hardly any does: a precondition skips a node before its tick.
        A leaf that only a model describes is therefore assumed not to skip, unless `skipping` says otherwise.
        """
        leaf = self.kind.is_leaf and not self.is_only_described and "SKIPPED" in self.statuses
        return self.skipping.possible is SkipPossibility.ALWAYS or leaf

    @functools.cached_property
    def is_plain(self) -> bool:
        """Whether the node is a leaf that depends only on its attribute values, none of which is a script."""
        is_special = self.references or self.needs_context or self.takes_script or self.skips_by_itself
        return self.kind.is_leaf and self.rule is None and not is_special

    @functools.cached_property
    def constructor_names(self) -> dict[str, str]:
        """The names of constructor parameters that differ from the attributes' names, by attribute name."""
        return {p.name: p.keyword for p in self.parameters.values() if p.keyword}

    @property
    def attributes(self) -> list[Parameter]:
        """The parameters that are written as attributes, in the order of the constructor."""
        written = (ParameterRole.NAME, ParameterRole.ATTRIBUTE, ParameterRole.REFERENCE)
        return [parameter for parameter in self.parameters.values() if parameter.role in written]


def _parameters_of(spec: NodeSpec) -> Mapping[str, Parameter]:
    """Return the constructor parameters of a node's class by attribute name, in order.

    Raises:
        RegistrationError: If a tree file cannot express a parameter, or if the outcomes use unknown parameters.
    """
    constructor: Callable[..., Any] = spec.cls.__init__  # type: ignore[misc]
    try:
        hints = typing.get_type_hints(constructor, include_extras=True)
    except Exception as error:
        message = f"<{spec.tag}>: the annotations of {_name_of(spec)} cannot be resolved: {error}"
        raise RegistrationError(message) from error
    docs = _inherited_documentation(spec.cls)
    found = (
        _parameter(spec, parameter, hints.get(name), docs.get(name, ""))
        for name, parameter in _writable(constructor)
    )
    parameters = {parameter.name: parameter for parameter in found}
    _require_child_parameter(spec, parameters)
    _require_valid_outcomes(spec, parameters)
    return parameters


def _writable(constructor: Callable[..., Any]) -> Iterator[tuple[str, inspect.Parameter]]:
    """Yield the parameters of a constructor, except `self`, `*args` and `**kwargs`."""
    for name, parameter in list(inspect.signature(constructor).parameters.items())[1:]:
        if parameter.kind not in _VARIADIC:
            yield name, parameter


def _parameter(spec: NodeSpec, parameter: inspect.Parameter, annotation: object, doc: str) -> Parameter:
    keyword, name = parameter.name, parameter.name.removesuffix("_")
    required = parameter.default is inspect.Parameter.empty
    common: dict[str, Any] = {
        "required": required,
        "default": None if required else parameter.default,
        "doc": doc,
        "keyword": "" if keyword == name else keyword,
    }
    structure = _STRUCTURE.get(name)
    if structure is ParameterRole.NAME:
        return Parameter(name, structure, required=False, value_type=require_value_type(str), doc=doc)
    if structure is not None and not spec.kind.is_leaf:
        return Parameter(name, structure, required=required, doc=doc)
    if annotation is None:
        raise RegistrationError(f"<{spec.tag}>: parameter '{keyword}' of {_name_of(spec)} has no annotation")
    target = strip_none(annotation)
    direction = _DIRECTIONS.get(typing.get_origin(target) or target)
    value_type = _carried_type(target) if direction else value_type_of(target)
    if value_type is not None:
        return Parameter(name, ParameterRole.ATTRIBUTE, value_type=value_type, direction=direction, **common)
    if is_class(target) and is_mission_context(target):
        # The parameter has no attribute, so its default is not used.
        return Parameter(name, ParameterRole.CONTEXT, target_or_path=target, **{**common, "default": None})
    # Imported late, because specs of nodes that are only described are created without py_trees.
    from py_trees.behaviour import Behaviour

    if is_class(target) and issubclass(target, Behaviour):
        return Parameter(name, ParameterRole.REFERENCE, target_or_path=target, **common)
    raise RegistrationError(
        f"<{spec.tag}>: parameter '{keyword}' of {_name_of(spec)} is annotated with {annotation!r}, which cannot be "
        "written in a file. Use float, int, bool, str, an enum, Path, timedelta, a list of these, a port such as "
        "Input[float], a leaf class, or a class marked with @mission_context"
    )


def _require_child_parameter(spec: NodeSpec, parameters: Mapping[str, Parameter]) -> None:
    roles = {parameter.role for parameter in parameters.values()}
    wanted = {Kind.CONTROL: ParameterRole.CHILDREN, Kind.DECORATOR: ParameterRole.CHILD}.get(spec.kind)
    if wanted is not None and wanted not in roles:
        raise RegistrationError(
            f"<{spec.tag}>: {_name_of(spec)} is a {spec.kind.value} without a parameter '{wanted.value}'"
        )
    if ParameterRole.NAME not in roles:
        raise RegistrationError(f"<{spec.tag}>: the constructor of {_name_of(spec)} has no parameter 'name'")


def _require_valid_outcomes(spec: NodeSpec, parameters: Mapping[str, Parameter]) -> None:
    known = [SELF, *(p.name for p in parameters.values() if p.role is ParameterRole.REFERENCE)]
    numbers = [p.name for p in parameters.values() if p.is_integer_parameter]
    for fact in spec.facts:
        _require_known_placeholders(spec, fact, known)
    for outcome in spec.outcomes:
        for text in (outcome.when, outcome.then):
            _require_known_placeholders(spec, text, [*known, *numbers])
        found = find_script_error(outcome, known, numbers)
        if found is not None:
            part, text, error = found
            raise RegistrationError(f"<{spec.tag}>: outcome '{outcome.name}': {part} '{text}': {error}")


def _require_known_placeholders(spec: NodeSpec, text: str, known: Sequence[str]) -> None:
    for placeholder in placeholders(text):
        if placeholder not in known:
            braced = ", ".join(f"{{{name}}}" for name in known)
            message = f"<{spec.tag}>: '{text}': unknown placeholder {{{placeholder}}} (known: {braced})"
            raise RegistrationError(message)


def _carried_type(port: object) -> ValueType | None:
    """Return the value type `T` of a port annotated with `Input[T]`. For `Input` alone, return any type."""
    carried = typing.get_args(port)[0] if typing.get_args(port) else object
    return ANYTHING if carried in (object, Any) else port_type_of(carried)


def _name_of(spec: NodeSpec) -> str:
    return spec.class_path.replace(":", ".")


def _inherited_documentation(cls: type | None) -> dict[str, str]:
    """Return the descriptions of parameters in the docstrings of a class and its bases.

    Docstrings of py_trees are left out.
    """
    described: dict[str, str] = {}
    for base in reversed(cls.__mro__ if cls is not None else ()):
        if base is cls or not base.__module__.startswith("py_trees."):
            described.update(_documentation(base)[1])
    return described


def _documentation(cls: type | None) -> tuple[str, dict[str, str]]:
    """Return a docstring's first paragraph, and the descriptions that follow `Args:`."""
    text = inspect.cleandoc(cls.__doc__ or "") if cls is not None else ""
    summary = " ".join(text.split("\n\n", 1)[0].split())
    section = re.search(r"^Args:\n((?:[ ]+.*(?:\n|$)|\n)*)", text, re.MULTILINE)
    described: dict[str, str] = {}
    if section:
        for entry in re.finditer(r"^ {4}(\w+)[^:\n]*:((?:.*)(?:\n {8,}.*)*)", section.group(1), re.MULTILINE):
            described[entry.group(1)] = " ".join(entry.group(2).split())
    return summary, described
