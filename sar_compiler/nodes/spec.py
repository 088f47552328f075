"""What is known of a tag: the one record of a node, made by `register` or read off a model."""

import functools
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from enum import Enum
from typing import TYPE_CHECKING, Any, TypeAlias

from sar_compiler.nodes.answers import answers_of
from sar_compiler.nodes.semantics import Semantics
from sar_compiler.nodes.values import ValueType
from sar_compiler.runtime.answers import Answer, Fact

if TYPE_CHECKING:
    from sar_compiler.nodes.binding.bound import BoundNode
    from sar_compiler.nodes.binding.collector import Collector

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

    @property
    def words(self) -> str:
        """What somebody who writes a tree is told of it."""
        words = {Direction.INPUT: "input", Direction.OUTPUT: "output, takes a {key}"}
        return words.get(self, "input and output")


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
    def help(self) -> str:
        """Its description as an editor shows it: for a port with the direction before it."""
        direction = f"{self.direction.words}.".capitalize() if self.direction else ""
        return f"{direction} {self.doc}".strip()

    @property
    def is_whole_number(self) -> bool:
        """Whether it is a whole number that is fixed when the tree is compiled."""
        fixed = self.role is Role.ATTRIBUTE and self.direction is None
        return fixed and self.value_type is not None and self.value_type.python is int


CHILD_COUNTS: dict[Kind, tuple[int, int | None]] = {
    Kind.CONTROL: (1, None),
    Kind.DECORATOR: (1, 1),
    Kind.ACTION: (0, 0),
    Kind.CONDITION: (0, 0),
}
"""How many children a node of a kind takes, at least and at most."""


@dataclass(frozen=True)
class Skipping:
    """What becomes of ticks that are skipped.

    Attributes:
        possible: Whether a tick of the node can be skipped.
        cls: The class that takes the place of the node's own where a child can be skipped.
        only_if: The attribute, and its value, without which no tick is skipped by the node itself; None: whatever
            is written.
        advice: How a node is written that does the same and knows of skipped children, where there is one.
    """

    possible: Skips = Skips.NEVER
    cls: type[Any] | None = None
    only_if: tuple[str, object] | None = None
    advice: str = ""


@dataclass(frozen=True)
class Signature:
    """What a tag says about its attributes where the constructor of its class does not say it, or says it otherwise.

    Attributes:
        factory: Makes the node in place of the class; its signature then counts instead of the constructor's.
        defaults: Defaults for parameters that have none in the constructor.
        fixed: Parameters whose value the tag itself says (`ReactiveSequence`: `memory` is false).
        hidden: Constructor parameters that this tag does not have.
        required: Parameters that must be written, though the constructor can do without.
        types: What parameters take, where their annotations say less.
        doc: A description to take the place of the docstring, for classes of other libraries.
        parameter_docs: Descriptions of parameters, likewise.
        described: All parameters, for a node that only a model describes.
    """

    factory: Callable[..., Any] | None = None
    defaults: Mapping[str, object] = field(default_factory=dict)
    fixed: Mapping[str, object] = field(default_factory=dict)
    hidden: frozenset[str] = frozenset()
    required: frozenset[str] = frozenset()
    types: Mapping[str, ValueType] = field(default_factory=dict)
    doc: str = ""
    parameter_docs: Mapping[str, str] = field(default_factory=dict)
    described: Mapping[str, Parameter] | None = None


@dataclass(frozen=True)
class NodeSpec:
    """What a tag means.

    The constructor of the class, which may name classes defined later, is looked at when `parameters` is first
    asked for.

    Attributes:
        tag: The tag in a tree file.
        cls: The class of which the compiler makes an instance; None where only a model describes the node.
        kind: What it is.
        outcomes: The names of the statuses that a tick can return.
        effects: What it does to the world, in a few words; empty if nothing.
        uses: What it needs outside the tree.
        answers: For a leaf: what a tick can come to where there is no robot; by default one for each outcome.
        facts: The facts that these answers work on, with their values at the start.
        reads: Further facts or keys of the blackboard that what it does depends on.
        writes: Further facts or keys of the blackboard that it changes.
        semantics: What it makes of the nodes in it, of time, and of the blackboard.
        skipping: What becomes of ticks that are skipped.
        signature: What its tag says about its attributes beside the constructor.
        child_count: How many children it takes, at least and at most (None: any number); by default what its kind
            says.
        variant: Whether it is one more meaning of a tag that means something already: the attributes that a
            file writes choose between them.
        former_tags: What it was called in earlier versions of BehaviorTree.CPP and py_trees.
        rule: Reports attributes that do not go with each other, or with the children.
    """

    tag: str
    cls: type[Any] | None
    kind: Kind
    outcomes: frozenset[str] = frozenset()
    effects: str = ""
    uses: tuple[Use, ...] = ()
    answers: tuple[Answer, ...] = ()
    facts: Mapping[str, Fact] = field(default_factory=dict)
    reads: tuple[str, ...] = ()
    writes: tuple[str, ...] = ()
    semantics: Semantics = Semantics()  # noqa: RUF009 - frozen
    skipping: Skipping = Skipping()
    signature: Signature = Signature()
    child_count: tuple[int, int | None] = (-1, None)
    variant: bool = False
    former_tags: tuple[str, ...] = ()
    rule: "Rule | None" = None

    def __post_init__(self) -> None:
        if self.child_count[0] < 0:
            object.__setattr__(self, "child_count", CHILD_COUNTS[self.kind])
        if self.kind.is_leaf and not self.answers:
            object.__setattr__(self, "answers", answers_of(self.outcomes))

    @functools.cached_property
    def parameters(self) -> Mapping[str, Parameter]:
        """The parameters of what makes an instance, by name, in their order.

        Raises:
            RegistrationError: If the constructor cannot be written in a tree file; names the parameter.
        """
        from sar_compiler.nodes.constructors import parameters_of

        return self.signature.described or parameters_of(self)

    @functools.cached_property
    def doc(self) -> str:
        """The first paragraph of its description."""
        from sar_compiler.nodes.constructors import summary_of

        return self.signature.doc or summary_of(self.maker)

    @property
    def maker(self) -> Callable[..., Any] | None:
        """What makes an instance: a function of its own, or the class."""
        return self.signature.factory or self.cls

    @property
    def fixed(self) -> Mapping[str, object]:
        """The parameters whose value the tag itself says."""
        return self.signature.fixed

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
        return self.skipping.possible is Skips.ALWAYS or (self.kind.is_leaf and "SKIPPED" in self.outcomes)

    @functools.cached_property
    def renamed(self) -> dict[str, str]:
        """The parameters that have another name in the constructor."""
        return {p.name: p.keyword for p in self.parameters.values() if p.keyword}

    @property
    def attributes(self) -> list[Parameter]:
        """The parameters that are written as attributes, in the constructor's order."""
        written = (Role.NAME, Role.ATTRIBUTE, Role.REFERENCE)
        return [parameter for parameter in self.parameters.values() if parameter.role in written]
