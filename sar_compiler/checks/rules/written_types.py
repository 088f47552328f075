"""Rules about written values that a port cannot read, or that BehaviorTree.CPP cannot write to the entry."""

import itertools
from collections.abc import Collection, Iterator
from typing import NamedTuple, TypeAlias

from sar_compiler.checks.rules.entry_accesses import (
    EntryAccess,
    EntryAccesses,
    EntryTable,
    comes_first,
    is_root_key,
)
from sar_compiler.checks.rules.scripts import find_certain_errors, is_condition
from sar_compiler.nodes.binding.bound import BoundNode
from sar_compiler.nodes.binding.key_types import (
    EntryType,
    EntryTypes,
    btcpp_severity,
    can_share_key,
    cpp_type,
    fits,
    port_label,
    unknown_conversion,
)
from sar_compiler.nodes.btcpp import LISTS, NEWEST, NUMBERS, Version
from sar_compiler.nodes.btcpp.port_types import (
    can_be_converted,
    can_be_copied,
    can_be_read,
    can_replace,
    is_loop_queue,
    is_number,
    is_untyped,
    is_whole,
    may_share,
    needs_converter,
    type_of_constant,
)
from sar_compiler.nodes.collector import file_of
from sar_compiler.nodes.cpp_names import ANY, LONG, REAL, STATUS, TEXT
from sar_compiler.nodes.semantics import AccessKind
from sar_compiler.nodes.spec import Direction, Parameter, Provenance
from sar_compiler.nodes.values import ConversionError, literal_value
from sar_compiler.runtime.blackboard import Scope
from sar_compiler.runtime.expressions import (
    Access,
    Assignment,
    Expression,
    Literal,
    Name,
    Prefix,
    Script,
    name_uses,
)
from sar_compiler.runtime.queues import queue_items
from sar_compiler.tree.diagnostic import Diagnostic, Severity, Span
from sar_compiler.tree.model import Element

_MOST_COPIES = 50
_MOST_VALUES = 100
_SETTING = (":=", "=")
_QUEUE = "queue"
_WRITING = (AccessKind.WRITE, AccessKind.CHANGE, AccessKind.BOTH)


class _TypedPort(NamedTuple):
    """A port that reads or writes the checked blackboard entry.

    Attributes:
        bound: The node of the port.
        parameter: The port.
        cpp: The port's normalized C++ type. For the queue of a loop, it is the queue type's name.
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
    def is_of_user(self) -> bool:
        """Whether the port's type belongs to a C++ program, which must define its conversion from strings."""
        return needs_converter(self.cpp) and self.bound.spec.provenance is Provenance.DESCRIBED

    @property
    def type_text(self) -> str:
        """The name of the port's type in messages."""
        return "items" if is_loop_queue(self.cpp) else self.cpp or ANY


class _WrittenValue(NamedTuple):
    """A value that is written to an entry.

    Attributes:
        cpp: The value's normalized C++ type.
        value: The value itself, if the file contains it.
        is_shown: Whether the file contains the value.
        text: The constant as written, if BehaviorTree.CPP stores it as a string; None for any other value.
    """

    cpp: str
    value: object = None
    is_shown: bool = False
    text: str | None = None


_PossibleValues: TypeAlias = tuple[_WrittenValue, ...] | None


class _KeyWrite(NamedTuple):
    """A location in the file at which a node writes an entry.

    Attributes:
        element: The element that contains the location.
        attribute: The attribute that names the key.
        key: The key, by its name in the element's tree.
        place: The attribute that contains the written value, and the value's start and end in this attribute (None if
            the value is the whole attribute).
        values: The possible values; None if they are not known.
        port: The port that writes; None for a script, a constant, a copy or an item.
        is_copy: Whether a node copies the value with its type.
        is_constant: Whether the value is an argument of a subtree.
        is_item: Whether the value is an item of a loop.
    """

    element: Element
    attribute: str
    key: str
    place: tuple[str, tuple[int, int] | None]
    values: _PossibleValues
    port: _TypedPort | None = None
    is_copy: bool = False
    is_constant: bool = False
    is_item: bool = False

    @property
    def span(self) -> Span:
        """The location of the value in the file."""
        attribute, part = self.place
        if part is None:
            return self.element.value_span(attribute)
        return self.element.value_part_span(attribute, *part)


class KeyTypeRules:
    """The rules for the types of a tree's entries.

    Args:
        board: The entries.
        types: The types that ports and constants give the entries.
        btcpp: The version of BehaviorTree.CPP that the trees are for; None if it is not configured.
        enums: The names of the declared enumerators.
    """

    def __init__(
        self, board: EntryTable, types: EntryTypes, btcpp: Version | None, enums: Collection[str]
    ) -> None:
        self._board = board
        self._types = types
        self._enums = enums
        self._version = btcpp or NEWEST
        self._severity = btcpp_severity(btcpp)
        self._entries = {(entry.scope, entry.key): entry for entry in board.entries}
        # Sets of ports with the same type. An entry that is used only by the ports of one set needs no comparison.
        self._of_one_type: set[tuple[int, ...]] = set()
        # The possible values of entries are cached, because copies of copies request them often.
        self._values: dict[tuple[Scope, str], _PossibleValues] = {}

    def check_entry(self, entry: EntryAccesses) -> Iterator[Diagnostic]:
        """Yield findings about values that a port of the entry cannot read, or that BehaviorTree.CPP rejects."""
        first = self._types.get((entry.scope, entry.key))
        if first is None:
            return
        kinds, others_write = _kinds_of_ports(entry)
        if not others_write and tuple(kinds) in self._of_one_type:
            return
        ports = [port for use in kinds.values() if (port := self._port(use)) is not None]
        scripts = [port for port in ports if port.parameter.value_type.python is Script]
        if not others_write and not scripts and len({port.cpp for port in ports}) <= 1:
            self._of_one_type.add(tuple(kinds))
            return
        # Most entries have no type and are skipped: each port accepts any value written to them.
        if not first.cpp and not any(port.cpp or port.parameter.value_type.python for port in ports):
            return
        writes = [*self._constants(entry), *self._writes(entry)]
        for write in writes:
            found = [*self._check_ports(write, ports, first)]
            yield from found
            if found and write.is_item:
                break
        if not entry.is_parameter:
            # If an entry has a type, all ports have been compared with this type.
            is_open = is_untyped(first.cpp) or first.cpp == TEXT
            readers = [port for port in ports if is_open or is_loop_queue(port.cpp)]
            yield from self._check_unreadable(writes, readers)
            yield from self._check_replaced([*kinds.values()] if is_untyped(first.cpp) else [])
            if scripts and writes and not entry.given:
                yield from self._check_late_scripts(writes[0], scripts, first)
            if scripts and entry.given:
                yield from self._check_passed_scripts(entry)

    def _port(self, use: EntryAccess) -> _TypedPort | None:
        bound, name = use.node, use.access.attribute
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
            # `check_subtrees` reports a key without braces.
            is_shown = not (isinstance(value.value, str) and text in self._board.written_keys)
            written = (entry.key if entry.key in element.attributes else "ID", None)
            values = (value._replace(is_shown=is_shown),)
            yield _KeyWrite(element, entry.key, entry.key, written, values, is_constant=True)

    def _constant(self, text: str) -> _WrittenValue:
        cpp = type_of_constant(text, self._version) or TEXT
        return _WrittenValue(cpp, literal_value(text), is_shown=True, text=text if cpp == TEXT else None)

    def _writes(self, entry: EntryAccesses) -> Iterator[_KeyWrite]:
        for use in entry.of_kinds(*_WRITING):
            access, semantics = use.access, use.node.spec.semantics
            port, place = self._port(use), (access.attribute, access.place or access.position_in_braces)
            expression, is_copy = None, False
            if port is not None and _QUEUE in use.node.values:
                for item in _items_of(use.node, port.cpp):
                    yield _KeyWrite(
                        use.node.element, access.attribute, access.key, place, (item,), is_item=True
                    )
            if access.place is not None:
                expression = _assigned_expression(use)
                if expression is not None:
                    place = access.attribute, (expression.start, expression.end)
            elif semantics.copies:
                port, place, is_copy = None, (semantics.copies, None), True
            values = self._values_written(use, port, expression)
            yield _KeyWrite(use.node.element, access.attribute, access.key, place, values, port, is_copy)

    def _values_written(
        self, use: EntryAccess, port: _TypedPort | None, expression: Expression | None, depth: int = 0
    ) -> _PossibleValues:
        """Return the values that an access may write; None if these values are not known."""
        bound, scope = use.node, use.instance.scope
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
        for use in entry.of_kinds(*_WRITING):
            values = self._values_written(use, self._port(use), _assigned_expression(use), depth + 1)
            if values is None or len(found) > _MOST_VALUES:
                found = {}
                break
            found.update(dict.fromkeys(values))
        # A chain of copies that is too long from another entry may be short enough from this entry.
        if found or not depth:
            self._values[owner] = tuple(found) or None
        return tuple(found) or None

    def _values_of(self, expression: Expression, scope: Scope, depth: int) -> _PossibleValues:
        """Return the values that an expression may have; None if these values are not known."""
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

    def _check_ports(
        self, write: _KeyWrite, ports: list[_TypedPort], first: EntryType
    ) -> Iterator[Diagnostic]:
        """Yield a finding about the first port that does not accept the values of a write."""
        values, element = write.values, write.element
        if write.port is not None and not is_untyped(write.port.cpp):
            if first.cpp == TEXT and write.port.cpp != TEXT:
                what = f"{write.port.cpp} is written to '{write.key}', which is {first.label(element)}"
                yield self._refusal(f"{write.attribute}: {what}", element, write.span, write.port)
            return
        if not values:
            return
        for port in ports:
            if not any(_is_accepted(value, port, write) for value in values):
                yield _misfit_here(write, values[0], port)
                return
            if all(_exceeds_children(value, port) for value in values):
                yield _unreachable_count(write, values[0], port)
                return
        types = [value.cpp for value in values]
        shown = " or ".join(dict.fromkeys(types))
        is_number_given = first.parameter is None and is_number(first.cpp)
        if write.is_copy and not any(
            can_be_copied(each.cpp, first.cpp)
            and not (is_number_given and each.is_shown and not self._is_read_as(each, first.cpp))
            for each in values
        ):
            what = f"{shown} is copied, with its type, to '{write.key}', which is {first.label(element)}"
            yield self._refusal(f"{write.attribute}: {what}", element, write.span, None)
            return
        refused = filter(None, (self._refused_by(port, write, values, first) for port in ports))
        # Only the C++ code decides whether a string can be read as a user's type.
        is_text = set(types) == {TEXT} and not all(value.value in self._enums for value in values)
        open_ = (
            port for port in ports if is_text and port.is_of_user and (port.reads or not write.is_constant)
        )
        notes = (unknown_conversion(element, write.attribute, write.span, port.cpp) for port in open_)
        yield from itertools.islice(itertools.chain(refused, notes), 1)

    def _is_read_as(self, value: _WrittenValue, cpp: str) -> bool:
        """Return whether a known value can be read as a number type. This is true for all values except strings."""
        return not isinstance(value.value, str) or can_be_converted(value.value, cpp, self._version)

    def _refused_by(
        self, port: _TypedPort, write: _KeyWrite, values: tuple[_WrittenValue, ...], first: EntryType
    ) -> Diagnostic | None:
        """Return the finding about values that BehaviorTree.CPP rejects at a port; None if it accepts all values."""
        types = [value.cpp for value in values]
        shown, is_new, is_given = " or ".join(dict.fromkeys(types)), False, first.parameter is None
        # The types of constants, items and ports are compared when the tree is bound.
        is_compared = (is_given or write.is_item) and not is_loop_queue(port.cpp)
        if not is_compared and (
            (first.cpp == ANY and types == [TEXT] and not is_given)
            or self._is_text_lost(port, write, types, first)
            or (port.writes and all(_is_lost(value, port.cpp) for value in values))
            or not any(can_be_read(each, port.cpp, self._version) for each in types)
        ):
            is_new = is_given and types != [TEXT]
        elif any(self._is_converted(value, port, write) for value in values):
            return None
        else:
            shown = f"'{values[0].value}'"
        whose = port_label(port.parameter.name, port.bound, write.element)
        what = f"{write.attribute}: '{write.key}' is {shown} here, and {port.type_text} for {whose}"
        return self._refusal(what, write.element, write.span, port, is_new=is_new)

    def _is_text_lost(self, port: _TypedPort, write: _KeyWrite, types: list[str], first: EntryType) -> bool:
        """Return whether a loop's queue is empty because `SetBlackboard` copied a string to a new entry."""
        is_named_first = first.parameter is not None and not first.cpp
        is_loop = is_loop_queue(port.cpp) and self._version >= LISTS.since
        return is_loop and is_named_first and write.is_copy and types == [TEXT]

    def _is_converted(self, value: _WrittenValue, port: _TypedPort, write: _KeyWrite) -> bool:
        """Return whether BehaviorTree.CPP can convert a known value to the type of a port."""
        written = value.value if value.text is None else value.text
        if not value.is_shown or (not port.reads and (write.is_constant or write.is_item)):
            return True
        if port.cpp == STATUS and isinstance(written, str) and not (write.is_constant or write.is_item):
            # A script converts a string to a number if the entry contains a status. It does not accept names of statuses.
            is_number_there = written in ("true", "false") or _begins_as_number(written)
            return not write.is_copy and not port.reads and is_number_there
        return can_be_converted(written, port.cpp, self._version)

    def _check_unreadable(self, writes: list[_KeyWrite], ports: list[_TypedPort]) -> Iterator[Diagnostic]:
        """Yield a finding about the first port that can read none of the values that other ports write."""
        types = [value.cpp for write in writes for value in write.values or ()]
        writer = next((write for write in writes if write.port is not None), None)
        if writer is None or writer.port is None or any(write.values is None for write in writes):
            return
        # An output port accepts its own type, which is among the types.
        for port in ports:
            name, element = port.parameter.name, port.bound.element
            if not any(can_be_read(each, port.cpp, self._version) for each in types):
                line = f"line {writer.element.line}{file_of(writer.element, element)}"
                what = f"'{port.bound.keys[name]}' is {port.type_text} here, but {types[0]} is written to it ({line})"
                yield self._refusal(f"{name}: {what}", element, element.value_span(name), port)
                return
            if port.is_of_user and set(types) == {TEXT}:
                yield unknown_conversion(element, name, element.value_span(name), port.cpp)
                return

    def _check_replaced(self, uses: list[EntryAccess]) -> Iterator[Diagnostic]:
        """Yield a finding about the first port that cannot overwrite the value of another port."""
        ports = [(use, port) for use in uses if (port := self._port(use)) is not None and port.writes]
        for (earlier, first), (later, port) in itertools.combinations(ports, 2):
            if can_replace(port.cpp, first.cpp) or is_loop_queue(first.cpp) or is_loop_queue(port.cpp):
                continue
            if _has_written(earlier, later) or not can_replace(first.cpp, port.cpp):
                name, element = port.parameter.name, port.bound.element
                line = f"line {first.bound.element.line}{file_of(first.bound.element, element)}"
                what = (
                    f"'{port.bound.keys[name]}' is {port.cpp} here, but {first.cpp} is written to it ({line})"
                )
                yield self._refusal(f"{name}: {what}", element, element.value_span(name), port)
                return

    def _check_late_scripts(
        self, write: _KeyWrite, ports: list[_TypedPort], first: EntryType
    ) -> Iterator[Diagnostic]:
        """Yield findings about scripts that a node writes, although BehaviorTree.CPP needs them earlier."""
        for port in ports:
            spec, name, element = port.bound.spec, port.parameter.name, port.bound.element
            if not spec.semantics.counterpart.built_in:
                continue
            if may_share(first.cpp, port.cpp) and (
                first.parameter is None or can_share_key(first.parameter, port.parameter)
            ):
                line = f"line {write.element.line}{file_of(write.element, element)}"
                message = (
                    f"{name}: BehaviorTree.CPP refuses the tree, because it needs the script in '{port.bound.keys[name]}' "
                    f"before <{write.element.tag}> writes it ({line}). sar_compiler can run the tree"
                )
                hint = f'write the script directly in {name}="…", or pass it to a subtree: <SubTree ID="…" {port.bound.keys[name]}="…"/>'
                yield element.finding(
                    "cpp-type-mismatch", message, value=name, hint=hint, severity=self._severity
                )

    def _check_passed_scripts(self, entry: EntryAccesses) -> Iterator[Diagnostic]:
        """Yield findings about scripts that are passed to a subtree and raise an error in every tick."""
        for place, use in itertools.product(entry.given, entry.uses):
            constants, element = place.remapping.constants, place.element
            port = self._port(use)
            script = _script_in(constants.get(entry.key, ""), port) if port is not None else None
            if port is None or script is None:
                continue
            name = port.parameter.name
            span = element.value_span(entry.key if entry.key in element.attributes else "ID")
            what = f"{entry.key}: the script for {port_label(name, port.bound, element)}"
            for error in find_certain_errors(script, is_condition=is_condition(port.bound, name))[0]:
                message = f"{what} raises an error in every tick: {error.message}"
                yield element.finding("failing-script", message, span, hint=error.hint)
            given = [made for text in constants.values() if (made := _script_in(text, port)) is not None]
            uses = [each for made in given for each in name_uses(made)]
            made_there = {each.name for each in uses if each.access is Access.CREATE}
            for each in name_uses(script):
                is_known = each.name in made_there or is_root_key(each.name)
                if not is_known and not self._is_written(use.instance.scope, each.name):
                    hint = f"write the quoted string '{each.name}', or a key that is written earlier"
                    if each.name[0].isupper():
                        hint = f"{hint}, or declare an enumeration in [language.enums] of sar.toml"
                    message = f"{what} reads '{each.name}', which is never written"
                    severity = Severity.WARNING
                    yield element.finding("unwritten-key", message, span, hint=hint, severity=severity)
                    break

    def _is_written(self, scope: Scope, key: str) -> bool:
        """Return whether a name in a script is a key that may be written, or a declared enumerator."""
        entry = self._entries.get(scope.owner(key))
        return key in self._enums or (entry is not None and (entry.is_made or entry.is_parameter))

    def _refusal(
        self, message: str, element: Element, span: Span, port: _TypedPort | None, *, is_new: bool = False
    ) -> Diagnostic:
        """Return the finding about a value that makes BehaviorTree.CPP raise an error in a tick."""
        message = f"{message}, so BehaviorTree.CPP raises an error"
        code = "cpp-type-mismatch"
        if is_new:
            code, message = "btcpp-version", f"{message} since {NUMBERS.release}"
        elif port is not None and not port.bound.spec.is_foreign and not is_loop_queue(port.cpp):
            message = f"{message}, although sar_compiler converts the value"
        return element.finding(code, message, span, hint="use two keys", severity=self._severity)


def _has_written(earlier: EntryAccess, later: EntryAccess) -> bool:
    """Return whether a write always happens before a later write: both nodes must be in one sequence."""
    around = earlier.position.around
    if around is None or around is not later.position.around:
        return False
    return around.bound.spec.semantics.is_sequence and comes_first(earlier, later)


def _script_in(text: str, port: _TypedPort) -> Script | None:
    """Return the script in a string; None if the string is not a script (another rule reports this)."""
    try:
        script = port.parameter.value_type.convert(text)
    except ConversionError:
        return None
    return script if isinstance(script, Script) else None


def _kinds_of_ports(entry: EntryAccesses) -> tuple[dict[int, EntryAccess], bool]:
    """Return one access for each kind of port of an entry, and whether anything but a typed port writes the entry.

    An entry may have many uses, so each port of each kind of node is compared only once. A port whose value is a number of
    children is compared once for each number of children.
    """
    kinds: dict[int, EntryAccess] = {}
    others_write = bool(entry.given)
    for use in entry.uses:
        access = use.access
        bound, name = access.bound, access.attribute
        if access.place is None and name in bound.keys:
            kind = id(bound.spec.parameters.get(name))
            if bound.spec.semantics.counts:
                kind = hash((kind, len(bound.children)))
            kinds.setdefault(kind, use)
        if not others_write and access.kind in _WRITING:
            is_typed = access.place is None and not bound.spec.semantics.copies
            others_write = not is_typed or _QUEUE in bound.values
    return kinds, others_write


def _is_lost(value: _WrittenValue, cpp: str) -> bool:
    """Return whether a number would lose its value when written to an entry of a port's type."""
    if cpp == TEXT:
        return is_number(value.cpp)
    number = value.value
    if not is_whole(cpp) or not isinstance(number, float):
        return False
    return not number.is_integer() or (number < 0 and cpp == "uint64_t")


def _is_accepted(value: _WrittenValue, port: _TypedPort, write: _KeyWrite) -> bool:
    """Return whether a port accepts a value. For an output port, only strings from scripts are checked."""
    written = value.value
    if not value.is_shown or fits(port.parameter.value_type, written):
        return True
    if port.reads or write.is_constant or not isinstance(written, str):
        return not port.reads
    # BehaviorTree.CPP converts a script's string to the type of the entry, and reads a number at its start.
    return port.parameter.value_type.python is not bool and _begins_as_number(written)


def _begins_as_number(text: str) -> bool:
    return text.removeprefix("-")[:1].isdecimal()


def _items_of(bound: BoundNode, cpp: str) -> Iterator[_WrittenValue]:
    """Yield the items that a loop writes, if they are written in the file."""
    text, kind = bound.values[_QUEUE], bound.spec.implied_values.get("kind")
    if isinstance(text, str) and isinstance(kind, type):
        for item in queue_items(text, kind):
            yield _WrittenValue(cpp, item, is_shown=True)


def _exceeds_children(value: _WrittenValue, port: _TypedPort) -> bool:
    """Return whether the port's value is a number of children, and the written value exceeds the number of children."""
    there, name = len(port.bound.children), port.parameter.name
    if name not in port.bound.spec.semantics.counts or not value.is_shown or not there:
        return False
    kind = port.parameter.value_type
    number = kind.fit(value.value) if fits(kind, value.value) else None
    return isinstance(number, int) and number > there


def _unreachable_count(write: _KeyWrite, value: _WrittenValue, port: _TypedPort) -> Diagnostic:
    there = len(port.bound.children)
    whose = port_label(port.parameter.name, port.bound, write.element)
    message = f"{write.attribute}: '{write.key}' is {value.value} here, but {whose} has only {there} children"
    return write.element.finding("out-of-reach", message, write.span, hint=f"write {there} or fewer")


def _misfit_here(write: _KeyWrite, value: _WrittenValue, port: _TypedPort) -> Diagnostic:
    what = "a string" if isinstance(value.value, str) else str(value.value)
    label, whose = port.parameter.value_type.label, port_label(port.parameter.name, port.bound, write.element)
    message = f"{write.attribute}: '{write.key}' is {what} here, and {label} for {whose}"
    hint = f"write {label}, or use two keys"
    return write.element.finding("key-of-two-types", message, write.span, hint=hint)


def _assigned_expression(use: EntryAccess) -> Expression | None:
    """Return the expression that a script assigns to a key; None if the access is no assignment."""
    if use.access.place is None:
        return None
    for name, script in use.node.scripts():
        statement = script.by_start.get(use.access.place[0]) if name == use.access.attribute else None
        if isinstance(statement, Assignment) and statement.operator in _SETTING:
            return statement.value
    return None
