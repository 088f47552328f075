"""The draft of a node that is rewritten for BehaviorTree.CPP."""

from dataclasses import dataclass, field
from typing import TypeVar

from sar_compiler.nodes.collector import FindingCollector
from sar_compiler.nodes.values import ConversionError, ValueType, blackboard_key, require_value_type
from sar_compiler.tree.model import Element

T = TypeVar("T")


@dataclass(eq=False, repr=False)
class NodeDraft:
    """An element that is being rewritten.

    Attributes:
        element: The original element.
        tag: The tag of the new node.
        attributes: The attributes of the new node, without the `ID` of the explicit form.
        explicit: Whether the new node is written in explicit form.
        kept: Whether the node stays as it is, without a note about a missing counterpart.
        children: The elements added to a leaf that becomes several nodes.
    """

    element: Element
    tag: str
    attributes: dict[str, str]
    explicit: bool
    kept: bool = False
    children: list[Element] = field(default_factory=list)

    def literal(
        self, name: str, wanted: type[T], notes: FindingCollector, value_type: ValueType | None = None
    ) -> T | None:
        """Return an attribute's value.

        If the text cannot be converted, add a note, keep the node as it is, and return None.
        """
        text = self.attributes[name]
        try:
            if blackboard_key(text, name) is None:
                value = (value_type or require_value_type(wanted)).convert(text)
                assert isinstance(value, wanted)  # noqa: S101 - the type is known here
                return value
            message = f"{name}: '{text}' has no value before the run, but the conversion of the node needs the value"
            hint = f"write the value in place of '{text}'"
            notes.add("no-counterpart", message, self.element, value=name, hint=hint)
        except ConversionError as error:
            notes.wrong_value(self.element, name, error)
        self.kept = True
        return None
