"""Values that the ports of a key cannot read, or that BehaviorTree.CPP cannot write to it."""

from collections.abc import Iterator
from typing import NamedTuple, TypeAlias

from sar_compiler.checks.rules.entry_accesses import EntryAccess, EntryAccesses, EntryTable
from sar_compiler.nodes.binding.bound import BoundNode, file_of
from sar_compiler.nodes.binding.key_types import EntryType, EntryTypes, cpp_type, fits, port_label
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

_MOST_COPIES = 50
_MOST_VALUES = 100
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

    @property
    def shown(self) -> str:
        """The type, for a message."""
        return "items" if is_loop_queue(self.cpp) else self.cpp or ANY


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


_PossibleValues: TypeAlias = tuple[_WrittenValue, ...] | None


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
    values: _PossibleValues
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
        self._entries = {(entry.scope, entry.key): entry for entry in board.entries}
        # Kinds of ports that have one type, and need no comparison where they alone use an entry.
        self._of_one_type: set[tuple[int, ...]] = set()
        # What may be in the entries that were asked for; a copy of a copy is asked for often.
        self._values: dict[tuple[Scope, str], _PossibleValues] = {}

    def misfits(self, entry: EntryAccesses) -> Iterator[Diagnostic]:
        """Yield values of an entry that one of its ports cannot read, or that BehaviorTree.CPP refuses in a tick."""
        first = self._types.get((entry.scope, entry.key))
        if first is None:
            return
        # Of an entry with many uses, each port of a kind of node is compared once.
        kinds: dict[int, EntryAccess] = {}
        others_write = bool(entry.given)
        for use in entry.uses:
            access = use.access
            bound, name = access.bound, access.attribute
            if access.place is None and name in bound.keys:
                kinds.setdefault(id(bound.spec.parameters.get(name)), use)
            if not others_write and access.kind in _WRITING:
                others_write = access.place is not None or bool(bound.spec.semantics.copies)
        if not others_write and tuple(kinds) in self._of_one_type:
            return
        ports = [port for use in kinds.values() if (port := self._port(use)) is not None]
        if not others_write and len({port.cpp for port in ports}) <= 1:
            self._of_one_type.add(tuple(kinds))
            return
        # Most entries without a type are passed over: whatever is written to them, each port takes it.
        if not first.cpp and not any(port.cpp or port.parameter.value_type.python for port in ports):
            return
        writes = [*self._constants(entry), *self._writes(entry)]
        for write in writes:
            yield from self._misfit(write, ports, first)
        if not entry.is_parameter:
            # Of an entry with a type, all ports have been compared with that.
            readers = [port for port in ports if is_untyped(first.cpp) or is_loop_queue(port.cpp)]
            yield from self._unreadable(writes, readers)

    def _port(self, use: EntryAccess) -> _TypedPort | None:
        bound, name = use.bound, use.access.attribute
        parameter = bound.spec.parameters.get(name)
        if use.access.place is not None or name not in bound.keys:
            return None
        if parameter is None or parameter.direction is None:
            return None
        kind = parameter.value_type.name
        cpp = kind if is_loop_queue(kind) else cpp_type(parameter, self._version)
        return _TypedPort(bound, parameter, cpp)

    def _constants(self, entry: EntryAccesses) -> Iterator[_KeyWrite]:
        for place in entry.given:
            text = place.remapping.constants.get(entry.key)
            if text is None:
                continue
            element, value = place.element, self._constant(text)
            # `check_subtrees` reports a key without its braces.
            is_shown = not (isinstance(value.value, str) and text in self._board.written_keys)
            written = (entry.key if entry.key in element.attributes else "ID", None)
            values = (value._replace(is_shown=is_shown),)
            yield _KeyWrite(element, entry.key, entry.key, written, values, is_constant=True)

    def _constant(self, text: str) -> _WrittenValue:
        return _WrittenValue(
            type_of_constant(text, self._version) or TEXT, literal_value(text), is_shown=True
        )

    def _writes(self, entry: EntryAccesses) -> Iterator[_KeyWrite]:
        for use in entry.of(*_WRITING):
            access, semantics = use.access, use.bound.spec.semantics
            port, place = self._port(use), (access.attribute, access.place or access.place_in_braces)
            expression, is_copy = None, False
            if access.place is not None:
                expression = _assigned(use)
                if expression is not None:
                    place = access.attribute, (expression.start, expression.end)
            elif semantics.copies:
                port, place, is_copy = None, (semantics.copies, None), True
            values = self._values_written(use, port, expression)
            yield _KeyWrite(use.bound.element, access.attribute, access.key, place, values, port, is_copy)

    def _values_written(
        self, use: EntryAccess, port: _TypedPort | None, expression: Expression | None, depth: int = 0
    ) -> _PossibleValues:
        """Return what a use writes: the values of a script's expression, of the key or the text that a node copies, or of a port."""
        bound, scope = use.bound, use.instance.scope
        source = bound.spec.semantics.copies
        if use.access.place is not None:
            return None if expression is None else self._values_of(expression, scope, depth)
        if source in bound.keys:
            return self._values_in(scope, bound.keys[source], depth)
        if source:
            text = bound.values.get(source)
            return (_WrittenValue(TEXT, text, is_shown=True),) if isinstance(text, str) else None
        is_typed = port is not None and port.writes and not is_untyped(port.cpp)
        return (_WrittenValue(port.cpp),) if port is not None and is_typed else None

    def _values_in(self, scope: Scope, key: str, depth: int) -> _PossibleValues:
        """Return the values that may be in an entry; None if not all of them are known."""
        owner = scope.owner(key)
        if owner in self._values:
            return self._values[owner]
        entry = self._entries.get(owner)
        if entry is None or entry.is_parameter or depth > _MOST_COPIES:
            return None
        found = dict.fromkeys(
            self._constant(place.remapping.constants.get(entry.key, "")) for place in entry.given
        )
        for use in entry.of(*_WRITING):
            values = self._values_written(use, self._port(use), _assigned(use), depth + 1)
            if values is None or len(found) > _MOST_VALUES:
                found = {}
                break
            found.update(dict.fromkeys(values))
        # A chain that was too long from elsewhere may be short enough from an entry further on.
        if found or not depth:
            self._values[owner] = tuple(found) or None
        return tuple(found) or None

    def _values_of(self, expression: Expression, scope: Scope, depth: int) -> _PossibleValues:
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
        values, element = write.values, write.element
        if write.port is not None and not is_untyped(write.port.cpp):
            if first.cpp == TEXT and write.port.cpp != TEXT:
                what = f"{write.port.cpp} is written to '{write.key}', which is {first.label(element)}"
                yield self._refused(f"{write.attribute}: {what}", element, write.span, write.port)
            return
        if not values:
            return
        for port in ports:
            if not any(_is_taken(value, port, write) for value in values):
                yield _misfit_here(write, values[0], port)
                return
        types = [value.cpp for value in values]
        shown = " or ".join(dict.fromkeys(types))
        if write.is_copy and not any(can_be_copied(each, first.cpp) for each in types):
            what = f"{shown} is copied with its type to '{write.key}', which is {first.label(element)}"
            yield self._refused(f"{write.attribute}: {what}", element, write.span, None)
            return
        is_given = first.parameter is None
        refuses_text = first.cpp == ANY and types == [TEXT] and not is_given
        for port in ports:
            if is_given and not is_loop_queue(port.cpp):
                continue  # the types of constants and ports are compared where the tree is bound
            is_overwritten = port.writes and all(_is_lost(value, port.cpp) for value in values)
            is_read = any(can_be_read(each, port.cpp, self._version) for each in types)
            if refuses_text or is_overwritten or not is_read:
                whose = port_label(port.parameter.name, port.bound, element)
                what = f"'{write.key}' is {shown} here, and {port.shown} for {whose}"
                is_new = is_given and types != [TEXT]
                yield self._refused(f"{write.attribute}: {what}", element, write.span, port, is_new=is_new)
                return

    def _unreadable(self, writes: list[_KeyWrite], ports: list[_TypedPort]) -> Iterator[Diagnostic]:
        """Yield the first port that can read none of the values that other ports write."""
        types = [value.cpp for write in writes for value in write.values or ()]
        writer = next((write for write in writes if write.port is not None), None)
        if writer is None or writer.port is None or any(write.values is None for write in writes):
            return
        for port in ports:
            if not port.reads or port.parameter is writer.port.parameter:
                continue
            if not any(can_be_read(each, port.cpp, self._version) for each in types):
                name, element = port.parameter.name, port.bound.element
                line = f"line {writer.element.line}{file_of(writer.element, element)}"
                what = f"'{port.bound.keys[name]}' is {port.shown} here, and {types[0]} is written to it ({line})"
                yield self._refused(f"{name}: {what}", element, element.value_span(name), port)
                return

    def _refused(
        self, message: str, element: Element, span: Span, port: _TypedPort | None, *, is_new: bool = False
    ) -> Diagnostic:
        """Return the finding about a value over which BehaviorTree.CPP raises an error in a tick."""
        message = f"{message}, over which BehaviorTree.CPP raises an error"
        code = "cpp-type-mismatch"
        if is_new:
            code, message = "btcpp-version", f"{message} since {NUMBERS.release}"
        elif port is not None and not port.bound.spec.is_foreign and not is_loop_queue(port.cpp):
            message = f"{message}, although it is converted here"
        return element.finding(code, message, span, hint="use two keys", severity=self._severity)


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
    written = value.value
    if not value.is_shown or fits(port.parameter.value_type, written):
        return True
    if port.reads or write.is_constant or not isinstance(written, str):
        return not port.reads
    # BehaviorTree.CPP converts a script's text to the type of the entry, and reads a number at its front.
    return port.parameter.value_type.python is not bool and written.lstrip("-")[:1].isdecimal()


def _misfit_here(write: _KeyWrite, value: _WrittenValue, port: _TypedPort) -> Diagnostic:
    what = "a text" if isinstance(value.value, str) else str(value.value)
    label, whose = port.parameter.value_type.label, port_label(port.parameter.name, port.bound, write.element)
    message = f"{write.attribute}: '{write.key}' is {what} here, and {label} for {whose}"
    hint = f"write {label}, or use two keys"
    return write.element.finding("key-of-two-types", message, write.span, hint=hint)


def _assigned(use: EntryAccess) -> Expression | None:
    """Return the expression that a script assigns to a key as it is; None for any other use."""
    if use.access.place is None:
        return None
    for name, script in use.bound.scripts():
        statement = script.by_start.get(use.access.place[0]) if name == use.access.attribute else None
        if isinstance(statement, Assignment) and statement.operator in _SETTING:
            return statement.value
    return None
