"""Bound trees: tags, texts and names resolved to their meanings, as plain data, and the findings of binding them."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, NamedTuple

from sar_compiler.nodes.btcpp import NEWEST, OLDEST, Version, VersionChange
from sar_compiler.nodes.spec import NodeSpec, Parameter
from sar_compiler.nodes.values import ConversionError
from sar_compiler.runtime.expressions import Script
from sar_compiler.tree.diagnostic import Cause, Diagnostic, Span
from sar_compiler.tree.guessing import Guesses
from sar_compiler.tree.model import About, Element

if TYPE_CHECKING:
    from typing_extensions import Unpack


class Remapping(NamedTuple):
    """The key remapping that the attributes of a `SubTree` declare.

    Attributes:
        keys: The outer key for each remapped key of the subtree.
        constants: The texts of the keys that are constants.
        autoremap: Whether every other key is remapped to the outer key of the same name.
    """

    keys: Mapping[str, str] = {}
    constants: Mapping[str, str] = {}
    autoremap: bool = False


_NOTHING: Mapping[str, Any] = {}
_APART = Remapping()


class BoundNode:
    """An element with its meaning.

    Its mappings are replaced, never modified: most of them are empty, and these are shared.

    Attributes:
        element: The element.
        spec: The meaning of its tag.
        name: The node's name.
        values: The values written for constructor parameters.
        keys: The blackboard keys written for constructor parameters (`{key}`).
        references: The nodes that constructor parameters refer to, if they are in the same tree.
        children: Its children.
        conditions: The scripts of its pre- and post-conditions, by their attributes' names.
        oneshot: The name of the policy of the OneShot to wrap it in.
        subtree: The tree that it refers to, if it is a `SubTree`.
        remapping: The remapping of that tree's keys.
    """

    __slots__ = (
        "children",
        "conditions",
        "element",
        "keys",
        "name",
        "oneshot",
        "references",
        "remapping",
        "spec",
        "subtree",
        "values",
    )

    def __init__(
        self,
        element: Element,
        spec: NodeSpec,
        name: str,
        values: Mapping[str, object] = _NOTHING,
        keys: Mapping[str, str] = _NOTHING,
        conditions: Mapping[str, Script] = _NOTHING,
        oneshot: str | None = None,
    ) -> None:
        self.element = element
        self.spec = spec
        self.name = name
        self.values = values
        self.keys = keys
        self.references: Mapping[str, BoundNode] = _NOTHING
        self.conditions = conditions
        self.children: Sequence[BoundNode] = ()
        self.oneshot = oneshot
        self.subtree: BoundTree | None = None
        self.remapping = _APART

    @property
    def is_reactive(self) -> bool:
        """Whether it re-evaluates all its children in every tick."""
        return self.spec.semantics.reactive or self.value("memory") is False

    def scripts(self) -> Iterator[tuple[str, Script]]:
        """Yield its scripts with their attributes: those of its conditions, and those that are values."""
        if self.conditions:
            yield from self.conditions.items()
        for attribute, value in self.values.items():
            if isinstance(value, Script):
                yield attribute, value

    def value(self, name: str) -> object:
        """Return the value of an attribute, or its default; None if the value is known only at runtime."""
        if name in self.values:
            return self.values[name]
        if name in self.element.attributes:  # a key, or a mistake
            return None
        parameter = self.spec.parameters.get(name)
        return self.spec.fixed.get(name, parameter.default if parameter is not None else None)


class BoundTree:
    """A `BehaviorTree`, bound by itself.

    Attributes:
        element: The `BehaviorTree` element.
        name: Its ID; a generated one for a tree without an ID.
        root: The bound root node; None if there is nothing to bind.
        nodes: All its nodes, in the order of the file.
        uses: Its `SubTree` nodes.
        parents: The nodes with children, the inner ones first.
        keyed: The nodes with blackboard keys.
        scripted: The nodes that can have scripts: as conditions or as values.
        referring: The nodes that refer to others.
        demanding: The nodes that are more than their tag and values: those with keys, subtrees or references,
            those that need an object of the mission or have to do with facts, and those that are only described.
        skips: Whether one of the nodes can be skipped by itself.
        nesting: How deep its elements are nested.
        wrappers: How many conditions and OneShots are wrapped around its nodes.
        open_references: References to nodes that are not in this tree, but may be in an enclosing one.
        unknown_names: Names of nodes with unknown tags; references to them are not reported again.
    """

    def __init__(self, element: Element, name: str) -> None:
        self.element = element
        self.name = name
        self.root: BoundNode | None = None
        self.nodes: list[BoundNode] = []
        self.uses: list[BoundNode] = []
        self.parents: list[BoundNode] = []
        self.keyed: list[BoundNode] = []
        self.scripted: list[BoundNode] = []
        self.referring: list[BoundNode] = []
        self.demanding: list[BoundNode] = []
        self.skips = False
        self.nesting = 0
        self.wrappers = 0
        self.open_references: list[tuple[BoundNode, Parameter]] = []
        self.unknown_names: set[str] = set()

    def subtrees(self) -> Iterator[BoundNode]:
        """Yield its `SubTree` nodes whose trees are known."""
        return (node for node in self.uses if node.subtree is not None)


@dataclass(frozen=True)
class Binding:
    """A main tree with all its subtrees.

    Attributes:
        main: The tree to execute.
        findings: What was found; the tree can be compiled only if there is no error.
        enums: The numbers that names stand for in scripts and in `Switch`.
    """

    main: BoundTree
    findings: tuple[Diagnostic, ...]
    enums: Mapping[str, int] = field(default_factory=dict)

    def trees(self) -> list[BoundTree]:
        """Return the main tree and the trees that it uses, each once."""
        found = [self.main]
        known = {self.main}
        for tree in found:
            for node in tree.subtrees():
                if node.subtree is not None and node.subtree not in known:
                    known.add(node.subtree)
                    found.append(node.subtree)
        return found

    def nodes(self) -> Iterator[BoundNode]:
        """Yield every node of every tree."""
        for tree in self.trees():
            yield from tree.nodes


def file_of(element: Element, seen_from: Element) -> str:
    """Return a phrase that names an element's file; empty if it is the same file."""
    return "" if element.source is seen_from.source else f" of {element.source.path}"


def text_of_output(code: str, element: Element, attribute: str, text: str) -> Diagnostic:
    """Return the finding about a text in place of the key that an output is written to."""
    message = f"{attribute}: an output is written to the blackboard, and '{text}' is no key of it"
    key = text.strip(" ").removeprefix("$").removeprefix("{").removesuffix("}")
    suggestion = f"{{{key}}}" if key.isidentifier() else None
    hint = f'write {attribute}="{{key}}"'
    return element.finding(code, message, value=attribute, suggestion=suggestion, hint=hint)


class Collector:
    """A collection of findings, in the order in which they are reported.

    Attributes:
        findings: The findings.
        guesses: Guesses of what was meant.
        btcpp: The version of BehaviorTree.CPP that the trees are said to be for; None if nothing says so.
        version: The same, or the newest one.
    """

    def __init__(self, btcpp: Version | None = None) -> None:
        self.btcpp = btcpp
        self.version = btcpp or NEWEST
        self.findings: list[Diagnostic] = []
        self.guesses = Guesses()

    def add(
        self, code: str, message: str, element: Element, span: Span | None = None, **about: "Unpack[About]"
    ) -> None:
        """Add a finding about an element; the arguments are those of its method `finding`."""
        self.findings.append(element.finding(code, message, span, **about))

    def refused_since(
        self,
        change: VersionChange,
        element: Element,
        message: str,
        span: Span | None = None,
        **about: "Unpack[About]",
    ) -> None:
        """Report what BehaviorTree.CPP refuses since a version, if the trees are for that or a later one."""
        if self.version >= change.since:
            refused = f"BehaviorTree.CPP refuses that since {change.release}"
            older = f'say that the trees are for an older one: [language] btcpp = "{OLDEST}"'
            about["hint"] = f"{about['hint']}, or {older}"
            cause = about.get("common_cause")
            about["common_cause"] = cause and Cause(f"{cause.text}; {refused}", cause.subject)
            self.add("btcpp-version", f"{message}; {refused}", element, span, **about)

    def wrong_value(
        self, element: Element, attribute: str, error: ConversionError, code: str = "wrong-value"
    ) -> None:
        """Report that an attribute's text is not a value of its type, at the wrong part of it if that is known."""
        span = element.within_value(attribute, *error.place) if error.place else element.value_span(attribute)
        message, suggestion, hint = f"{attribute}: {error.message}", error.suggestion, error.hint
        self.add(code, message, element, span, suggestion=suggestion, hint=hint)
