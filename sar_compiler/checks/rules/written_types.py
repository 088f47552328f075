"""Values that the ports of a key cannot read, or that BehaviorTree.CPP cannot write to it."""

from collections.abc import Iterator
from typing import NamedTuple

from sar_compiler.checks.rules.entry_accesses import EntryAccess, EntryAccesses, EntryTable
from sar_compiler.nodes.binding.bound import BoundNode, file_of
from sar_compiler.nodes.binding.key_types import EntryType, EntryTypes, cpp_type, fits
from sar_compiler.nodes.btcpp import NEWEST, NUMBERS, Version
from sar_compiler.nodes.btcpp.port_types import (
    can_be_copied,
    can_be_read,
    is_loop_queue,
    is_number,
    is_untyped,
    is_whole,
    type_of_constant,
)
from sar_compiler.nodes.cpp_names import ANY, LONG, REAL, TEXT
from sar_compiler.nodes.semantics import AccessKind
from sar_compiler.nodes.spec import Direction, Parameter
from sar_compiler.nodes.values import literal_value
from sar_compiler.runtime.blackboard import Scope
from sar_compiler.runtime.expressions import Assignment, Expression, Literal, Name, Prefix
from sar_compiler.tree.diagnostic import Diagnostic, Severity, Span
from sar_compiler.tree.model import Element

_MOST_COPIES = 8
_SETTING = (":=", "=")
_WRITING = (AccessKind.WRITE, AccessKind.CHANGE, AccessKind.BOTH)


class _TypedPort(NamedTuple):
    """A port of a node with the key.

    Attributes:
        bound: The node.
        parameter: The port.
        cpp: Its C++ type, normalized; the name of the queue's type for the queue of a loop.
    """

    bound: BoundNode
    parameter: Parameter
    cpp: str

    @property
    def reads(self) -> bool:
        """Whether the node reads the entry."""
        return self.parameter.direction is not Direction.OUTPUT

    @property
    def writes(self) -> bool:
        """Whether the node writes the entry with the type of the port."""
        return self.parameter.direction is not Direction.INPUT


class _WrittenValue(NamedTuple):
    """A value that something writes to an entry.

    Attributes:
        cpp: Its C++ type, normalized.
        value: The value itself, where the file shows it.
        is_shown: Whether the file shows it.
    """

    cpp: str
    value: object = None
    is_shown: bool = False


class _KeyWrite(NamedTuple):
    """A place that writes an entry.

    Attributes:
        element: The element.
        attribute: The attribute.
        key: The key, by its name there.
        place: The attribute and the part of its value that is written; None for all of it.
        values: What may be written; None if that is not known.
        port: The port that writes; None for a script, a constant or a copy.
        is_copy: Whether a node copies it with its type.
        is_constant: Whether a subtree is given it.
    """

    element: Element
    attribute: str
    key: str
    place: tuple[str, tuple[int, int] | None]
    values: tuple[_WrittenValue, ...] | None
    port: _TypedPort | None = None
    is_copy: bool = False
    is_constant: bool = False

    @property
    def span(self) -> Span:
        """The place of the value in the file."""
        attribute, part = self.place
        if part is None:
            return self.element.value_span(attribute)
        return self.element.within_value(attribute, *part)


class KeyTypeRules:
    """The rules for the types of a tree's entries.

    Args:
        board: The entries.
        types: The types that ports and constants give them.
        btcpp: The version of BehaviorTree.CPP that the trees are said to be for; None if nothing says so.
    """

    def __init__(self, board: EntryTable, types: EntryTypes, btcpp: Version | None) -> None:
        self._board = board
        self._types = types
        self._version = btcpp or NEWEST
        self._severity = Severity.WARNING if btcpp is None else Severity.ERROR
        self._cpp: dict[int, str] = {}
        self._entries = {(entry.scope, entry.key): entry for entry in board.entries}

    def misfits(self, entry: EntryAccesses) -> Iterator[Diagnostic]:
        """Yield values of an entry that one of its ports cannot read, or that BehaviorTree.CPP refuses in a tick."""
        first = self._types.get((entry.scope, entry.key))
        # Of an entry with many uses, each port of a kind of node is compared once.
        ports_by_kind: dict[int, _TypedPort] = {}
        for use in entry.uses:
            port = self._port(use)
            if port is not None:
                ports_by_kind.setdefault(id(port.parameter), port)
        ports = list(ports_by_kind.values())
        if len({port.cpp for port in ports}) == 1 and not entry.given and self._is_of_ports(entry):
            return
        if first is None or not ports:
            return
        writes = [*self._constants(entry), *self._writes(entry)]
        for write in writes:
            yield from self._misfit(write, ports, first)
        if not entry.is_parameter:
            # Of an entry with a type, all ports have been compared with that.
            readers = [port for port in ports if is_untyped(first.cpp) or is_loop_queue(port.cpp)]
            yield from self._unreadable(writes, readers)

    def _is_of_ports(self, entry: EntryAccesses) -> bool:
        """Return whether ports alone write an entry."""
        return all(
            use.access.place is None and not use.bound.spec.semantics.copies for use in entry.of(*_WRITING)
        )

    def _port(self, use: EntryAccess) -> _TypedPort | None:
        bound, name = use.bound, use.access.attribute
        parameter = bound.spec.parameters.get(name)
        if (
            use.access.place is not None
            or parameter is None
            or parameter.direction is None
            or name not in bound.keys
        ):
            return None
        cpp = self._cpp.get(id(parameter))
        if cpp is None:
            name = parameter.value_type.name
            cpp = name if is_loop_queue(name) else cpp_type(parameter, self._version)
            self._cpp[id(parameter)] = cpp
        return _TypedPort(bound, parameter, cpp)

    def _constants(self, entry: EntryAccesses) -> Iterator[_KeyWrite]:
        for place in entry.given:
            text = place.remapping.constants.get(entry.key)
            if text is None:
                continue
            value, element = literal_value(text), place.element
            cpp = type_of_constant(text, self._version) or TEXT
            # `check_subtrees` reports a key without its braces.
            is_shown = not (isinstance(value, str) and text in self._board.written_keys)
            written = (entry.key if entry.key in element.attributes else "ID", None)
            values = (_WrittenValue(cpp, value, is_shown),)
            yield _KeyWrite(element, entry.key, entry.key, written, values, is_constant=True)

    def _writes(self, entry: EntryAccesses) -> Iterator[_KeyWrite]:
        for use in entry.of(*_WRITING):
            access, bound = use.access, use.bound
            element = bound.element
            port, part = self._port(use), access.place or access.place_in_braces
            attribute = access.attribute
            values, is_copy = None, bool(bound.spec.semantics.copies) and access.place is None
            if access.place is not None:
                expression = _assigned(use)
                if expression is not None:
                    values = self._values_of(expression, use.instance.scope)
                    part = (expression.start, expression.end)
            elif is_copy:
                values, port = self._copied(use), None
                attribute, part = bound.spec.semantics.copies, None
            elif port is not None and port.writes and not is_untyped(port.cpp):
                values = (_WrittenValue(port.cpp),)
            yield _KeyWrite(element, access.attribute, access.key, (attribute, part), values, port, is_copy)

    def _copied(self, use: EntryAccess, depth: int = 0) -> tuple[_WrittenValue, ...] | None:
        """Return what a node writes that copies an entry, or writes a text."""
        source = use.bound.spec.semantics.copies
        if source in use.bound.keys:
            return self._values_in(use.instance.scope, use.bound.keys[source], depth)
        text = use.bound.values.get(source)
        return (_WrittenValue(TEXT, text, is_shown=True),) if isinstance(text, str) else None

    def _values_in(self, scope: Scope, key: str, depth: int) -> tuple[_WrittenValue, ...] | None:
        """Return the values that may be in an entry; None if not all of them are known."""
        entry = self._entries.get(scope.owner(key))
        if entry is None or entry.is_parameter or depth > _MOST_COPIES:
            return None
        found: list[_WrittenValue] = []
        for place in entry.given:
            text = place.remapping.constants.get(entry.key, "")
            found.append(
                _WrittenValue(
                    type_of_constant(text, self._version) or TEXT, literal_value(text), is_shown=True
                )
            )
        for use in entry.of(*_WRITING):
            values, port = None, self._port(use)
            if use.access.place is not None:
                expression = _assigned(use)
                if expression is not None:
                    values = self._values_of(expression, use.instance.scope, depth + 1)
            elif use.bound.spec.semantics.copies:
                values = self._copied(use, depth + 1)
            elif port is not None and port.writes and not is_untyped(port.cpp):
                values = (_WrittenValue(port.cpp),)
            if values is None:
                return None
            found += values
        return tuple(found) or None

    def _values_of(
        self, expression: Expression, scope: Scope, depth: int = 0
    ) -> tuple[_WrittenValue, ...] | None:
        """Return what an expression may be; None if that is not known."""
        if isinstance(expression, Literal):
            value = expression.value
            cpp = TEXT if isinstance(value, str) else LONG if isinstance(value, int) else REAL
            return (_WrittenValue(cpp, value, is_shown=True),)
        if isinstance(expression, Prefix) and isinstance(expression.operand, Literal):
            operand = expression.operand.value
            if expression.operator == "-" and not isinstance(operand, str):
                return (_WrittenValue(REAL, -float(operand), is_shown=True),)
        if isinstance(expression, Name):
            return self._values_in(scope, expression.name, depth + 1)
        return None

    def _misfit(self, write: _KeyWrite, ports: list[_TypedPort], first: EntryType) -> Iterator[Diagnostic]:
        """Yield the first port that does not go with what a place writes."""
        values = write.values
        if write.port is not None and not is_untyped(write.port.cpp):
            if first.cpp == TEXT and write.port.cpp != TEXT:
                message = (
                    f"{write.attribute}: {write.port.cpp} is written to '{write.key}', which is {first.label}"
                    f"{file_of(first.bound.element, write.element)})"
                )
                yield self._refused(write, message, write.port)
            return
        if not values:
            return
        for port in ports:
            if not any(_is_taken(value, port, write) for value in values):
                yield _misfit_here(write, values[0], port)
                return
        yield from self._misfit_there(write, values, ports, first)

    def _misfit_there(
        self, write: _KeyWrite, values: tuple[_WrittenValue, ...], ports: list[_TypedPort], first: EntryType
    ) -> Iterator[Diagnostic]:
        types = [value.cpp for value in values]
        shown = " or ".join(dict.fromkeys(types))
        if write.is_copy and not any(can_be_copied(each, first.cpp) for each in types):
            message = (
                f"{write.attribute}: {shown} is copied with its type to '{write.key}', which is {first.label}"
                f"{file_of(first.bound.element, write.element)})"
            )
            yield self._refused(write, message, None)
            return
        is_given = first.parameter is None
        for port in ports:
            if is_given and not is_loop_queue(port.cpp):
                continue  # the types of constants and ports are compared where the tree is bound
            refuses_text = first.cpp == ANY and types == [TEXT] and not is_given
            is_overwritten = port.writes and all(_is_lost(value, port.cpp) for value in values)
            if (
                refuses_text
                or is_overwritten
                or not any(can_be_read(each, port.cpp, self._version) for each in types)
            ):
                what = "items" if is_loop_queue(port.cpp) else port.cpp or ANY
                message = (
                    f"{write.attribute}: '{write.key}' is {shown} here, and {what} for {port.parameter.name} of "
                    f"'{port.bound.name}' (line {port.bound.element.line}{file_of(port.bound.element, write.element)})"
                )
                yield self._refused(write, message, port, is_new=is_given and types != [TEXT])
                return

    def _unreadable(self, writes: list[_KeyWrite], ports: list[_TypedPort]) -> Iterator[Diagnostic]:
        """Yield the ports that can read none of the values that other ports write."""
        types = [value.cpp for write in writes for value in write.values or ()]
        if not writes or any(write.values is None for write in writes):
            return
        writer = next((write for write in writes if write.port is not None), None)
        for port in ports:
            if (
                writer is None
                or not port.reads
                or (writer.port is not None and port.parameter is writer.port.parameter)
            ):
                continue
            if not any(can_be_read(each, port.cpp, self._version) for each in types):
                what = "items" if is_loop_queue(port.cpp) else port.cpp
                element = port.bound.element
                message = (
                    f"{port.parameter.name}: '{port.bound.keys[port.parameter.name]}' is {what} here, and {types[0]} is "
                    f"written to it (line {writer.element.line}{file_of(writer.element, element)})"
                )
                name = port.parameter.name
                yield self._refused(_KeyWrite(element, name, "", (name, None), None), message, port)
                return

    def _refused(
        self, write: _KeyWrite, message: str, port: _TypedPort | None, *, is_new: bool = False
    ) -> Diagnostic:
        """Return the finding about a value over which BehaviorTree.CPP raises an error in a tick."""
        message = f"{message}, over which BehaviorTree.CPP raises an error"
        code = "cpp-type-mismatch"
        if is_new:
            code, message = "btcpp-version", f"{message} since {NUMBERS.release}"
        elif port is not None and not port.bound.spec.is_foreign and not is_loop_queue(port.cpp):
            message = f"{message}, although it is converted here"
        return write.element.finding(code, message, write.span, hint="use two keys", severity=self._severity)


def _is_lost(value: _WrittenValue, cpp: str) -> bool:
    """Return whether a number cannot be written over what a port has written."""
    if cpp == TEXT:
        return is_number(value.cpp)
    number = value.value
    if not is_whole(cpp) or not isinstance(number, float):
        return False
    return not number.is_integer() or (number < 0 and cpp == "uint64_t")


def _is_taken(value: _WrittenValue, port: _TypedPort, write: _KeyWrite) -> bool:
    """Return whether a value goes with a port here: one that only writes has to go with what scripts write as texts."""
    if not value.is_shown or fits(port.parameter.value_type, value.value):
        return True
    if port.reads:
        return False
    # BehaviorTree.CPP converts a script's text to the type of the entry, and reads a number at its front.
    is_number_there = (
        isinstance(value.value, str)
        and port.parameter.value_type.python is not bool
        and value.value.lstrip("-")[:1].isdecimal()
    )
    return write.is_constant or not isinstance(value.value, str) or is_number_there


def _misfit_here(write: _KeyWrite, value: _WrittenValue, port: _TypedPort) -> Diagnostic:
    reader = port.bound.element
    what = "a text" if isinstance(value.value, str) else str(value.value)
    whose = (
        f"{port.parameter.name} of '{port.bound.name}' (line {reader.line}{file_of(reader, write.element)})"
    )
    label = port.parameter.value_type.label
    message = f"{write.attribute}: '{write.key}' is {what} here, and {label} for {whose}"
    return write.element.finding(
        "key-of-two-types", message, write.span, hint=f"write {label}, or use two keys"
    )


def _assigned(use: EntryAccess) -> Expression | None:
    """Return the expression that a script assigns to a key as it is; None for any other use."""
    script = dict(use.bound.scripts()).get(use.access.attribute)
    if use.access.place is None or script is None:
        return None
    statement = script.by_start.get(use.access.place[0])
    if not isinstance(statement, Assignment) or statement.operator not in _SETTING:
        return None
    return statement.value
