"""Where findings are collected while a tree is bound."""

from sar_compiler.tree.diagnostic import Diagnostic
from sar_compiler.tree.model import Element
from sar_compiler.tree.source import Span


def file_of(element: Element, seen_from: Element) -> str:
    """Say in words which file an element stands in; nothing where it is the same one."""
    return "" if element.source is seen_from.source else f" of {element.source.path}"


class Collector:
    """Findings, in the order in which they are made.

    Attributes:
        findings: The findings.
    """

    def __init__(self) -> None:
        self.findings: list[Diagnostic] = []

    def at(self, element: Element, span: Span, code: str, message: str, **advice: str | None) -> None:
        """Report something about a place in an element; *advice* as `Diagnostic` has it."""
        self.findings.append(Diagnostic(code, message, element.source, span, **advice))  # type: ignore[arg-type]

    def tag(self, element: Element, code: str, message: str, **advice: str | None) -> None:
        """Report something about an element as a whole."""
        self.at(element, element.tag_span(), code, message, **advice)

    def value(self, element: Element, attribute: str, code: str, message: str, **advice: str | None) -> None:
        """Report something about the value of an attribute."""
        self.at(element, element.value_span(attribute), code, message, **advice)

    def name(self, element: Element, attribute: str, code: str, message: str, **advice: str | None) -> None:
        """Report something about the name of an attribute."""
        self.at(element, element.name_span(attribute), code, message, **advice)
