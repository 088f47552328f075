"""What is known of a tag, as plain data."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum
from typing import Any

from sar_compiler.nodes.values import ValueType


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
        name: Its name, which is also the attribute's.
        role: What it becomes.
        required: Whether a file must (or, for the context, whether a mission must) provide it.
        default: Its value where nothing is written.
        value_type: For an attribute: how its text becomes a value.
        target: For a reference the class referred to, for the context the class handed over.
        doc: Its description, from the class's docstring.
    """

    name: str
    role: Role
    required: bool
    default: object = None
    value_type: ValueType | None = None
    target: type | None = None
    doc: str = ""


@dataclass(frozen=True)
class NodeSpec:
    """What a tag means.

    Attributes:
        tag: The tag in a tree file.
        kind: What it is.
        cls: The class of which the compiler makes an instance.
        parameters: The class's constructor parameters by name, in their order.
        fixed: Parameters whose value the tag itself says (`ReactiveSequence`: `memory` is false).
        outcomes: The names of the statuses that a tick can return.
        effects: What it does to the world, in a few words; empty if nothing.
        uses: What it needs outside the tree.
        doc: The first paragraph of the class's docstring.
    """

    tag: str
    kind: Kind
    cls: type[Any]
    parameters: Mapping[str, Parameter]
    fixed: Mapping[str, object] = field(default_factory=dict)
    outcomes: frozenset[str] = frozenset()
    effects: str = ""
    uses: tuple[Use, ...] = ()
    doc: str = ""

    @property
    def attributes(self) -> list[Parameter]:
        """The parameters that are written as attributes, in the constructor's order."""
        written = (Role.NAME, Role.ATTRIBUTE, Role.REFERENCE)
        return [parameter for parameter in self.parameters.values() if parameter.role in written]
