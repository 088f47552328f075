"""Ports: values that a leaf reads and writes on the blackboard while the tree runs.

A constructor parameter that is annotated with one of these types becomes an attribute of the leaf's tag. In a tree file, the attribute's
value is a constant, or a `{key}` that names an entry of the blackboard::

    class Say(py_trees.behaviour.Behaviour):
        def __init__(self, name: str, message: Input[str], said: Output[int] | None = None) -> None: ...

        def update(self) -> Status: print(self.message.get())
"""

from collections.abc import Callable
from typing import Any, Generic, TypeVar, overload

from sar_compiler.errors import SarError
from sar_compiler.runtime.blackboard import Entry, MissingEntryError
from sar_compiler.runtime.entry_types import value_to_write
from sar_compiler.runtime.variables import UnknownValue, UnknownValueError

T = TypeVar("T")
D = TypeVar("D")

Convert = Callable[[object], Any]
"""A function that converts a blackboard value to a port's value. It raises `ValueError` if this is impossible."""


class PortError(SarError):
    """Raised if a port cannot be read or written, for example because its key has no value.

    Attributes:
        port: The port's name; empty if it is not known.
        source: The key that the port reads, as written in the tree file; empty if no read has failed.
    """

    def __init__(self, message: str, port: str = "", source: str = "") -> None:
        super().__init__(message)
        self.port = port
        self.source = source


class Input(Generic[T]):
    """A port: a value that a node reads.

    Args:
        source: The entry to read, or a constant.
        convert: Function that converts a value of the entry to a value of the port.
        name: The port's name, for messages.
        kind: The type whose values need no conversion.

    Attributes:
        entry: The entry that is read; None for a constant.
    """

    def __init__(
        self,
        source: Entry | T,
        convert: Convert = lambda value: value,
        name: str = "",
        kind: type | None = None,
    ) -> None:
        self.entry = source if isinstance(source, Entry) else None
        self._source = source
        self._convert = convert
        self._name = name
        self._kind = kind

    @overload
    def get(self) -> T: ...
    @overload
    def get(self, default: D, /) -> T | D: ...
    def get(self, *default: Any) -> Any:
        """Return the current value of the port.

        Args:
            default: The value to return if the port's key has no value.

        Raises:
            PortError: If the key has no value and there is no default, or the value is invalid.
        """
        entry = self.entry
        if entry is None:
            return self._source
        try:
            value = entry.board.get(entry.name)
        except KeyError:
            if default:
                return default[0]
            missing = MissingEntryError(entry.key)
            raise self._failure(entry, missing) from missing
        if type(value) is self._kind:
            return value
        try:
            if isinstance(value, UnknownValue):
                raise UnknownValueError(value)
            return self._convert(value)
        except (SarError, ValueError) as error:
            raise self._failure(entry, error) from error

    def _failure(self, entry: Entry, error: Exception) -> PortError:
        prefix = f"{self._name}: " if self._name else ""
        return PortError(f"{prefix}{{{entry.key}}}: {error}", self._name, entry.key)


class Output(Generic[T]):
    """A port: a value that a node writes.

    Args:
        entry: The entry to write; None if the tree file names no key. Values are then discarded.
        kind: The type that a write declares for an entry without a type: `bool`, `int`, `float` or `str`.

    Attributes:
        value: The last value that the node wrote, for tests of the node; None before the first write.
    """

    def __init__(self, entry: Entry | None = None, kind: type | None = None) -> None:
        self.entry = entry
        self.value: T | None = None
        self._kind = kind

    def set(self, value: T) -> None:
        """Write the value. A number is converted to the entry's type if no precision is lost."""
        self.value = value
        if self.entry is not None:
            _write(self.entry, value, self._kind)


class InOut(Input[T]):
    """A port: a value that a node reads and writes. If the port is a constant, the node can only read it."""

    def set(self, value: T) -> None:
        """Write the value in the same way as `Output.set`.

        Raises:
            PortError: If the port is a constant.
        """
        if self.entry is None:
            message = f"{self._name or 'the port'} is a constant and cannot be written. Write a {{key}} in the tree file"
            raise PortError(message, self._name)
        _write(self.entry, value)


def _write(entry: Entry, value: object, kind: type | None = None) -> None:
    board, name = entry.board, entry.name
    if entry.passed_on:
        pass  # as in BehaviorTree.CPP, which checks only entries of the node's own tree
    elif board.kind_of(name) is None:
        if kind is not None:
            board.set_kind(name, kind)
    elif board.has(name):
        current = board.get(name)
        value = value if type(current) is type(value) else value_to_write(current, value)
    board.set(name, value)
