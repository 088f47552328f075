"""Texts that are written to a key from which a port reads a number."""

from collections.abc import Iterator

from sar_compiler.checks.rules.entry_accesses import EntryAccess, EntryAccesses, EntryTable
from sar_compiler.nodes.binding.collector import file_of
from sar_compiler.nodes.semantics import AccessKind
from sar_compiler.nodes.values import ConversionError, ValueType, literal_value
from sar_compiler.runtime.expressions import Assignment, Literal, Script
from sar_compiler.tree.diagnostic import Diagnostic
from sar_compiler.tree.model import Element
from sar_compiler.tree.source import Span


def misfits(entry: EntryAccesses, board: EntryTable) -> Iterator[Diagnostic]:
    """Yield texts that scripts and subtrees write to an entry whose type is that of a port, which cannot be read from them."""
    typed = next(((use, each) for use in entry.uses if (each := _number_of_port(use)) is not None), None)
    if typed is None:
        return
    port, value_type = typed
    for place in entry.given:
        constant = literal_value(place.remapping.constants.get(entry.key, "0"))
        if (
            isinstance(constant, str)
            and constant not in board.written_keys  # which `check_subtrees` tells
            and entry.key in place.element.attributes
            and not _fits(value_type, constant)
        ):
            yield _misfit(
                place.element, entry.key, entry.key, place.element.value_span(entry.key), port, value_type
            )
    for use in entry.of(AccessKind.WRITE, AccessKind.CHANGE):
        literal = _text_written(use)
        if literal is not None and not _fits(value_type, literal.value):
            attribute, element = use.access.attribute, use.bound.element
            span = element.within_value(attribute, literal.start, literal.end)
            yield _misfit(element, attribute, use.access.key, span, port, value_type)


def _misfit(
    element: Element, attribute: str, key: str, span: Span, port: EntryAccess, value_type: ValueType
) -> Diagnostic:
    reader = port.bound.element
    whose = f"{port.access.attribute} of '{port.bound.name}' (line {reader.line}{file_of(reader, element)})"
    message = f"{attribute}: '{key}' is a text here, and {value_type.label} for {whose}"
    hint = f"write {value_type.label}, or use two keys"
    return element.finding("key-of-two-types", message, span, hint=hint)


def _number_of_port(use: EntryAccess) -> ValueType | None:
    """Return the type of a port that has numbers; None for any other use."""
    parameter = use.bound.spec.parameters.get(use.access.attribute)
    if use.access.place is not None or parameter is None or parameter.direction is None:
        return None
    if use.access.attribute not in use.bound.keys or parameter.value_type is None:
        return None
    return parameter.value_type if parameter.value_type.python in (int, float, bool) else None


def _text_written(use: EntryAccess) -> Literal | None:
    """Return the text that a script assigns to a key as it is; None for any other use."""
    script = use.bound.conditions.get(use.access.attribute) or use.bound.values.get(use.access.attribute)
    if use.access.place is None or not isinstance(script, Script):
        return None
    statement = script.by_start.get(use.access.place[0])
    if not isinstance(statement, Assignment) or statement.operator not in {":=", "="}:
        return None
    value = statement.value
    return value if isinstance(value, Literal) and isinstance(value.value, str) else None


def _fits(value_type: ValueType, text: object) -> bool:
    try:
        value_type.fit(text)
    except ConversionError:
        return False
    return True
