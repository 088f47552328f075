"""The view of a node that attribute rules receive, and a collector of findings."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Protocol

from sar_compiler.nodes.btcpp import NEWEST, OLDEST, Version, VersionChange
from sar_compiler.nodes.values import ConversionError
from sar_compiler.tree.diagnostic import Cause, Diagnostic, Span
from sar_compiler.tree.guessing import Guesses
from sar_compiler.tree.model import Element, FindingDetails

if TYPE_CHECKING:
    from typing_extensions import Unpack


class NodeView(Protocol):
    """The properties of a `BoundNode` that the functions of this package use."""

    @property
    def element(self) -> Element:
        """The node's element."""

    @property
    def tag(self) -> str:
        """The node's registered tag."""

    @property
    def name(self) -> str:
        """The node's name."""

    @property
    def values(self) -> Mapping[str, object]:
        """The parsed values of the attributes, by constructor parameter."""

    @property
    def keys(self) -> Mapping[str, str]:
        """The blackboard keys in the attributes, by constructor parameter."""

    @property
    def children(self) -> "Sequence[NodeView]":
        """The node's children."""

    @property
    def is_leaf(self) -> bool:
        """Whether the node can have no children."""

    @property
    def is_reactive(self) -> bool:
        """Whether the node re-evaluates all its children in every tick."""

    @property
    def counts(self) -> tuple[str, ...]:
        """The node's ports whose values are numbers of children."""

    def value(self, name: str) -> object:
        """Return the value or default of an attribute; None if the value is known only at runtime."""


def file_of(element: Element, seen_from: Element) -> str:
    """Return ` of FILE` for an element's file; empty if *seen_from* is in the same file."""
    return "" if element.source is seen_from.source else f" of {element.source.path}"


def text_of_output(code: str, element: Element, attribute: str, text: str) -> Diagnostic:
    """Return the finding about an output port that is set to a constant instead of a key."""
    message = f"{attribute}: an output needs a blackboard key, but '{text}' is not a key"
    key = text.strip(" ").removeprefix("$").removeprefix("{").removesuffix("}")
    suggestion = f"{{{key}}}" if key.isidentifier() else None
    hint = f'write {attribute}="{{key}}"'
    return element.finding(code, message, value=attribute, suggestion=suggestion, hint=hint)


class FindingCollector:
    """A collector of findings.

    Attributes:
        findings: The findings, in the order in which they were added.
        guesses: The suggestions for misspelt names.
        btcpp: The version of BehaviorTree.CPP that is configured for the trees; None if no version is configured.
        version: The configured version, or the newest version.
    """

    def __init__(self, btcpp: Version | None = None) -> None:
        self.btcpp = btcpp
        self.version = btcpp or NEWEST
        self.findings: list[Diagnostic] = []
        self.guesses = Guesses()

    def add(
        self,
        code: str,
        message: str,
        element: Element,
        span: Span | None = None,
        **about: "Unpack[FindingDetails]",
    ) -> None:
        """Add a finding about an element; see `Element.finding` for the arguments."""
        self.findings.append(element.finding(code, message, span, **about))

    def report_rejected_since(
        self,
        change: VersionChange,
        element: Element,
        message: str,
        span: Span | None = None,
        **about: "Unpack[FindingDetails]",
    ) -> None:
        """Report content that BehaviorTree.CPP rejects since a version.

        Nothing is reported if the trees target an older version.
        """
        if self.version >= change.since:
            refused = f", which BehaviorTree.CPP rejects since {change.release}"
            older = f'declare an older version in sar.toml: [language] btcpp = "{OLDEST}"'
            about["hint"] = f"{about['hint']}, or {older}"
            cause = about.get("common_cause")
            about["common_cause"] = cause and Cause(f"{cause.text}{refused}", cause.subject)
            self.add("btcpp-version", f"{message}{refused}", element, span, **about)

    def wrong_value(
        self, element: Element, attribute: str, error: ConversionError, code: str = "wrong-value"
    ) -> None:
        """Report an attribute's text that is not a valid value of the attribute's type."""
        span = (
            element.value_part_span(attribute, *error.place) if error.place else element.value_span(attribute)
        )
        message, suggestion, hint = f"{attribute}: {error.message}", error.suggestion, error.hint
        self.add(code, message, element, span, suggestion=suggestion, hint=hint)
