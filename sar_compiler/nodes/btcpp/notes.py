"""Notes about a tree that was rewritten for BehaviorTree.CPP."""

from sar_compiler.nodes.spec import Parameter
from sar_compiler.nodes.values import ConversionError
from sar_compiler.tree.diagnostic import Diagnostic, Severity
from sar_compiler.tree.model import Element
from sar_compiler.tree.source import Span


class Notes:
    """Collects notes: each about one element of the original file."""

    def __init__(self) -> None:
        self._notes: list[Diagnostic] = []
        self._referring: set[tuple[str, str]] = set()

    def in_order(self) -> list[Diagnostic]:
        """Return the notes in the order of the file."""
        return sorted(self._notes, key=lambda note: (note.span.line, note.span.column))

    def no_counterpart(self, element: Element, message: str, hint: str) -> None:
        """Note that BehaviorTree.CPP has no counterpart of an element."""
        self._add("no-counterpart", element, element.tag_span(), message, hint, Severity.WARNING)

    def no_counterpart_of_value(self, element: Element, attribute: str, message: str, hint: str) -> None:
        """Note that BehaviorTree.CPP has no counterpart of an attribute's value."""
        span = element.value_span(attribute)
        self._add("no-counterpart", element, span, message, hint, Severity.WARNING)

    def too_large(self, element: Element, attribute: str, message: str, hint: str) -> None:
        """Note that a number is too large for BehaviorTree.CPP; the attribute may be one that was rewritten."""
        written = attribute in element.attributes
        span = element.value_span(attribute) if written else element.tag_span()
        self._add("no-counterpart", element, span, message, hint, Severity.WARNING)

    def wrong_value(self, element: Element, attribute: str, error: ConversionError) -> None:
        """Note that a value is invalid and was left unchanged."""
        message = f"{attribute}: {error.message}"
        span = element.value_span(attribute)
        self._add("wrong-value", element, span, message, error.hint, Severity.ERROR, error.suggestion)

    def differs(self, element: Element, message: str) -> None:
        """Note a slight difference in BehaviorTree.CPP."""
        self._add("differs", element, element.tag_span(), message)

    def include(self, element: Element) -> None:
        """Note that an included file is not converted."""
        message, hint = "the included file stays as it is", "convert it too, and include what that makes"
        self._add("not-converted", element, element.tag_span(), message, hint)

    def left_out(self, element: Element, attribute: str, message: str) -> None:
        """Note that an attribute was left out of the result."""
        self._add("left-out", element, element.name_span(attribute), f"{message}; it is left out")

    def reference(self, element: Element, tag: str, parameter: Parameter) -> None:
        """Note, once for each kind of node, that BehaviorTree.CPP treats a reference as a plain text."""
        if (tag, parameter.name) in self._referring:
            return
        self._referring.add((tag, parameter.name))
        written = parameter.name in element.attributes
        span = element.name_span(parameter.name) if written else element.tag_span()
        what = parameter.target_name or "node"
        message = f"{parameter.name}: in BehaviorTree.CPP <{tag}> gets the name of a {what}, not the node"
        hint = "in C++, let the two share what they need on the blackboard"
        self._add("reference", element, span, message, hint)

    def _add(
        self,
        code: str,
        element: Element,
        span: Span,
        message: str,
        hint: str | None = None,
        severity: Severity = Severity.INFO,
        suggestion: str | None = None,
    ) -> None:
        self._notes.append(Diagnostic(code, message, element.source, span, suggestion, hint, severity))
