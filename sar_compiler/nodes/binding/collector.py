"""Collection of findings while a tree is bound."""

from sar_compiler.nodes.btcpp.versions import NEWEST, OLDEST, Version, VersionChange
from sar_compiler.nodes.values import ConversionError
from sar_compiler.tree.diagnostic import Cause, Diagnostic, Severity
from sar_compiler.tree.guessing import Guesses
from sar_compiler.tree.model import Element
from sar_compiler.tree.source import Span


def file_of(element: Element, seen_from: Element) -> str:
    """Return a phrase that names an element's file; empty if it is the same file."""
    return "" if element.source is seen_from.source else f" of {element.source.path}"


class Collector:
    """A collection of findings, in the order in which they are reported.

    Attributes:
        findings: The findings.
        guesses: Guesses of what was meant.
        btcpp: The version of BehaviorTree.CPP that the trees are for.
    """

    def __init__(self, btcpp: Version = NEWEST) -> None:
        self.btcpp = btcpp
        self.findings: list[Diagnostic] = []
        self.guesses = Guesses()

    def at(
        self, element: Element, span: Span, code: str, message: str, **advice: str | Severity | Cause | None
    ) -> None:
        """Report a finding about a place in an element; *advice* as in `Diagnostic`."""
        self.findings.append(Diagnostic(code, message, element.source, span, **advice))  # type: ignore[arg-type]

    def tag(self, element: Element, code: str, message: str, **advice: str | Severity | Cause | None) -> None:
        """Report a finding about an element as a whole."""
        self.at(element, element.tag_span(), code, message, **advice)

    def value(
        self,
        element: Element,
        attribute: str,
        code: str,
        message: str,
        **advice: str | Severity | Cause | None,
    ) -> None:
        """Report a finding about the value of an attribute."""
        self.at(element, element.value_span(attribute), code, message, **advice)

    def refused_since(
        self,
        change: VersionChange,
        element: Element,
        span: Span,
        message: str,
        hint: str,
        suggestion: str | None = None,
        cause: Cause | None = None,
    ) -> None:
        """Report what BehaviorTree.CPP refuses since a version, if the trees are for that or a later one."""
        if self.btcpp >= change.since:
            refused = f"BehaviorTree.CPP refuses that since {change.release}"
            hint += f', or say that the trees are for an older one: [language] btcpp = "{OLDEST}"'
            common = cause and Cause(f"{cause.text}; {refused}", cause.subject)
            advice = {"suggestion": suggestion, "hint": hint, "severity": Severity.WARNING}
            self.at(element, span, "btcpp-version", f"{message}; {refused}", common_cause=common, **advice)

    def slip_in_model(
        self, element: Element, attribute: str | None, message: str, **advice: str | Severity | Cause | None
    ) -> None:
        """Report a slip in the description of a node, which BehaviorTree.CPP does not read.

        Args:
            element: The element.
            attribute: The attribute with the wrong value; None for the element as a whole.
            message: What is wrong.
            **advice: As in `Diagnostic`.
        """
        span = element.value_span(attribute) if attribute else element.tag_span()
        self.at(element, span, "wrong-model", message, severity=Severity.WARNING, **advice)

    def wrong_value(
        self, element: Element, attribute: str, error: ConversionError, code: str = "wrong-value"
    ) -> None:
        """Report that an attribute's text is not a value of its type, at the wrong part of it if that is known."""
        span = element.within_value(attribute, *error.place) if error.place else element.value_span(attribute)
        advice = {"suggestion": error.suggestion, "hint": error.hint}
        self.at(element, span, code, f"{attribute}: {error.message}", **advice)

    def text_of_output(self, element: Element, attribute: str, text: str) -> None:
        """Report a text in place of the key that an output is written to."""
        message = f"{attribute}: an output is written to the blackboard, and '{text}' is no key of it"
        suggestion = f"{{{text}}}" if text.isidentifier() else None
        hint = f'write {attribute}="{{key}}"'
        self.value(element, attribute, "wrong-value", message, suggestion=suggestion, hint=hint)

    def name(
        self,
        element: Element,
        attribute: str,
        code: str,
        message: str,
        **advice: str | Severity | Cause | None,
    ) -> None:
        """Report a finding about the name of an attribute."""
        self.at(element, element.name_span(attribute), code, message, **advice)
