"""What is known of a tag, as plain data."""

import functools
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from enum import Enum
from typing import TYPE_CHECKING, Any, TypeAlias

from sar_compiler.nodes.values import ValueType
from sar_compiler.runtime.answers import Answer, Fact

if TYPE_CHECKING:
    from sar_compiler.nodes.bound import BoundNode
    from sar_compiler.nodes.collector import Collector

Rule: TypeAlias = "Callable[[BoundNode, Collector], None]"
"""Reports what is wrong with a node though each of its attributes is right by itself."""


class Kind(str, Enum):
    """What a node is, in BehaviorTree.CPP's terms (and its element names for the explicit form)."""

    CONTROL = "Control"
    DECORATOR = "Decorator"
    ACTION = "Action"
    CONDITION = "Condition"

    @property
    def is_leaf(self) -> bool:
        """Whether such a node has no children."""
        return self in (Kind.ACTION, Kind.CONDITION)


class Direction(str, Enum):
    """Which way the values of a port go, in the words of a `TreeNodesModel`."""

    INPUT = "input_port"
    OUTPUT = "output_port"
    INOUT = "inout_port"


class Skips(Enum):
    """Whether a tick of a node can be skipped."""

    NEVER = "never"
    FROM_CHILD = "from a child"
    """Where one of its children can."""
    ALWAYS = "always"


class Role(Enum):
    """What a constructor parameter becomes."""

    NAME = "name"
    """The node's name: the attribute `name`, by default the tag."""
    ATTRIBUTE = "attribute"
    """An attribute of the tag with a value."""
    REFERENCE = "reference"
    """An attribute of the tag that names another node of the tree."""
    CONTEXT = "context"
    """Something that the mission hands over; not written in the file."""
    CHILD = "child"
    """The one child of a decorator."""
    CHILDREN = "children"
    """The children of a control."""


@dataclass(frozen=True)
class Use:
    """Something outside the tree that a leaf needs before the first tick.

    Attributes:
        kind: `action`, `service`, `topic` (somebody publishes on it) or `nav2` (localised and active).
        name: The relative ROS name. `{parameter}` stands for the value of a constructor parameter.
    """

    kind: str
    name: str = ""

    @classmethod
    def action(cls, name: str) -> "Use":
        """Name an action that must have a server."""
        return cls("action", name)

    @classmethod
    def service(cls, name: str) -> "Use":
        """Name a service that must have a server."""
        return cls("service", name)

    @classmethod
    def topic(cls, name: str) -> "Use":
        """Name a topic that must have a publisher."""
        return cls("topic", name)

    @classmethod
    def nav2(cls) -> "Use":
        """Ask for a Nav2 that has an initial pose and reports itself active."""
        return cls("nav2")


@dataclass(frozen=True)
class Parameter:
    """One constructor parameter of a node's class.

    Attributes:
        name: The attribute's name; that of the parameter without a `_` at its end.
        role: What it becomes.
        required: Whether a file must (or, for the context, whether a mission must) provide it.
        default: Its value where nothing is written.
        value_type: For an attribute: how its text becomes a value.
        direction: For an attribute that is a port (`Input`, `Output`, `InOut`): which way its values go;
            None for a value that is fixed when the tree is compiled.
        target: For a reference the class referred to, for the context the class handed over.
        doc: Its description, from the class's docstring.
        keyword: Its name in the constructor, where that is another one (`if_` for `if`).
    """

    name: str
    role: Role
    required: bool
    default: object = None
    value_type: ValueType | None = None
    direction: Direction | None = None
    target: type | None = None
    doc: str = ""
    keyword: str = ""

    @property
    def is_whole_number(self) -> bool:
        """Whether it is a whole number that is fixed when the tree is compiled."""
        fixed = self.role is Role.ATTRIBUTE and self.direction is None
        return fixed and self.value_type is not None and self.value_type.python is int


@dataclass(frozen=True)
class NodeSpec:
    """What a tag means.

    Attributes:
        tag: The tag in a tree file.
        kind: What it is.
        cls: The class of which the compiler makes an instance; None where only a model describes the node.
        factory: What makes an instance, where it is not the class itself.
        parameters: The parameters of what makes an instance, by name, in their order.
        fixed: Parameters whose value the tag itself says (`ReactiveSequence`: `memory` is false).
        skips: Whether a tick can be skipped.
        skip_cls: The class that takes the place of *cls* where a child can skip.
        skips_if: The attribute, and its value, without which no tick is skipped by the node itself; None: whatever
            is written.
        skip_advice: How a node is written that does the same and knows of skipped children, where there is one.
        child_count: How many children it takes, at least and at most; None for any number.
        outcomes: The names of the statuses that a tick can return.
        effects: What it does to the world, in a few words; empty if nothing.
        uses: What it needs outside the tree.
        answers: For a leaf: what a tick can come to, where there is no robot.
        facts: The facts that these answers work on, with their values at the start.
        reads: Further facts or keys of the blackboard that what it does depends on.
        writes: Further facts or keys of the blackboard that it changes.
        doc: The first paragraph of the class's docstring.
        rule: Reports attributes that do not go with each other, or with the children.
    """

    tag: str
    kind: Kind
    cls: type[Any] | None
    parameters: Mapping[str, Parameter]
    fixed: Mapping[str, object] = field(default_factory=dict)
    skips: Skips = Skips.NEVER
    skip_cls: type[Any] | None = None
    skips_if: tuple[str, object] | None = None
    skip_advice: str = ""
    child_count: tuple[int, int | None] = (0, None)
    outcomes: frozenset[str] = frozenset()
    effects: str = ""
    uses: tuple[Use, ...] = ()
    doc: str = ""
    answers: tuple[Answer, ...] = ()
    facts: Mapping[str, Fact] = field(default_factory=dict)
    reads: tuple[str, ...] = ()
    writes: tuple[str, ...] = ()
    factory: Callable[..., Any] | None = None
    rule: "Rule | None" = None

    @functools.cached_property
    def references(self) -> list[Parameter]:
        """The parameters that refer to other nodes."""
        return [parameter for parameter in self.parameters.values() if parameter.role is Role.REFERENCE]

    @functools.cached_property
    def required(self) -> list[Parameter]:
        """The attributes that a file has to write."""
        attributes = (p for p in self.parameters.values() if p.role is Role.ATTRIBUTE)
        return [p for p in attributes if p.required and p.name not in self.fixed]

    @functools.cached_property
    def plain(self) -> list[Parameter]:
        """The attributes whose values are fixed when the tree is compiled."""
        return [p for p in self.parameters.values() if p.role is Role.ATTRIBUTE and p.direction is None]

    @functools.cached_property
    def plain_defaults(self) -> dict[str, object]:
        """What those attributes are where nothing is written."""
        return {p.name: self.fixed.get(p.name, p.default) for p in self.plain}

    @functools.cached_property
    def ports(self) -> list[Parameter]:
        """The attributes that are ports."""
        return [p for p in self.parameters.values() if p.role is Role.ATTRIBUTE and p.direction is not None]

    @functools.cached_property
    def handed_over(self) -> list[Parameter]:
        """The parameters that the mission provides."""
        return [p for p in self.parameters.values() if p.role is Role.CONTEXT]

    @functools.cached_property
    def is_plain(self) -> bool:
        """Whether it has no ports, and nothing from the mission."""
        return not self.ports and not self.handed_over

    @functools.cached_property
    def is_demanding(self) -> bool:
        """Whether more is needed to make one than its values and the nodes in it."""
        return bool(self.references or self.handed_over) or self.cls is None

    @functools.cached_property
    def structure(self) -> str:
        """What its constructor calls the nodes in it: `child` or `children`; empty for a leaf."""
        return {Kind.CONTROL: "children", Kind.DECORATOR: "child"}.get(self.kind, "")

    @functools.cached_property
    def skips_by_itself(self) -> bool:
        """Whether a tick can be skipped whatever the children do."""
        return self.skips is Skips.ALWAYS or (self.kind.is_leaf and "SKIPPED" in self.outcomes)

    @functools.cached_property
    def renamed(self) -> dict[str, str]:
        """The parameters that have another name in the constructor."""
        return {p.name: p.keyword for p in self.parameters.values() if p.keyword}

    @property
    def attributes(self) -> list[Parameter]:
        """The parameters that are written as attributes, in the constructor's order."""
        written = (Role.NAME, Role.ATTRIBUTE, Role.REFERENCE)
        return [parameter for parameter in self.parameters.values() if parameter.role in written]
