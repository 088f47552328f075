"""The entries of a compiled tree on py_trees' blackboard.

py_trees' blackboard is one table for the whole process. Each compiled tree has a unique prefix in this table, and each
instance of a subtree has a path below the prefix. So each key is resolved to an entry when the tree is compiled: `Scope.resolve` follows
the remappings of subtrees up to the scope that owns the entry.
"""

import functools
import itertools
import weakref
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

from sar_compiler.errors import SarError
from sar_compiler.runtime.context import mission_context
from sar_compiler.runtime.variables import UnknownValue, UnknownValueError

if TYPE_CHECKING:
    from sar_compiler.runtime.kernel.entry_cells import Memo

ROOT_SIGN = "@"
"""The prefix that marks a key of the root scope."""
_PRIVATE = "_"
STROKE = "%2F"
"""The character that replaces `/` when a key or subtree name becomes part of an entry's absolute name."""

_instances = itertools.count()


class MissingEntryError(SarError, KeyError):
    """Raised if a key is read before a value was written to it.

    Attributes:
        key: The key, as written in the tree file.
    """

    def __init__(self, key: str) -> None:
        self.key = key
        super().__init__(f"the key '{key}' has no value yet")

    def __str__(self) -> str:
        # A KeyError would show its text in quotes.
        return str(self.args[0])


class Board:
    """All entries of one compiled tree.

    Args:
        name: The prefix of the entries' names on py_trees' blackboard; a suffix makes it unique in this process.

    Attributes:
        is_numbered: Whether the entries store numbers that stand for values, instead of the values; see `NumberedBoard`.
        stamps: The number of writes of each existing entry, by absolute name.
        kinds: The type of each declared entry, by absolute name; None if the entry may have any type. A declared entry need not exist.
            `stamps` and `kinds` are never replaced, because compiled scripts hold references to these dictionaries.
    """

    def __init__(self, name: str) -> None:
        self.is_numbered = False
        self.stamps: dict[str, int] = {}
        self.kinds: dict[str, type | None] = {}
        self._name = name
        # The entries whose writes are counted.
        self._watched: set[str] = set()
        weakref.finalize(self, _remove_entries, self.stamps)

    @functools.cached_property
    def storage(self) -> dict[str, Any]:
        """The dictionary of py_trees' blackboard. py_trees is imported only when a tree is run."""
        return _storage()

    @functools.cached_property
    def prefix(self) -> str:
        """The prefix of the absolute names of all entries."""
        number = next(_instances)
        return f"/{self._name}~{number}" if number else f"/{self._name}"

    def has(self, name: str) -> bool:
        """Return whether an entry with an absolute name exists."""
        return name in self.storage

    def get(self, name: str) -> object:
        """Return an entry's value; raise a `KeyError` if the entry does not exist."""
        return self.storage[name]

    def set(self, name: str, value: object) -> None:
        """Write an entry; create the entry if it does not exist."""
        self.storage[name] = value
        self.stamps[name] = self.stamps.get(name, 0) + 1

    def declare(self, name: str, kind: type | None) -> None:
        """Declare an entry without a value; a second declaration has no effect."""
        if name not in self.kinds:
            self.kinds[name] = kind

    def set_kind(self, name: str, kind: type) -> None:
        """Set the type of an entry without a declared type."""
        if self.kinds.get(name) is None:
            self.kinds[name] = kind

    def is_declared(self, name: str) -> bool:
        """Return whether an entry is declared."""
        return name in self.kinds

    def kind_of(self, name: str) -> type | None:
        """Return the declared type of an entry, or None if no type was declared."""
        return self.kinds.get(name)

    def remove(self, name: str) -> None:
        """Remove an entry, if it exists, and its declaration."""
        self.storage.pop(name, None)
        self.stamps.pop(name, None)
        self.kinds.pop(name, None)

    def stamp(self, name: str) -> int:
        """Return how often an entry has been written, or 0 if the entry does not exist."""
        return self.stamps.get(name, 0)

    def names(self) -> Iterator[str]:
        """Yield the absolute names of all entries."""
        yield from list(self.stamps)

    def values(self) -> dict[str, object]:
        """Return the values of all entries by name, without the prefix, in the order of creation."""
        begin = len(self.prefix) + 1
        return {name[begin:]: self.get(name) for name in self.names()}

    def watch_entry(self, name: str) -> None:
        """Start counting the writes to an entry, for a node whose behaviour depends on the count."""
        self._watched.add(name)

    def memo(self, entries: "Sequence[Entry]") -> "Memo | None":  # noqa: ARG002 - used by numbered boards
        """Return a cache for the results of code that uses the given entries, or None if there is no cache."""
        return None

    def restamp(self, name: str, stamp: int) -> None:
        """Set the number of writes to an entry. Do nothing if the entry does not exist."""
        if self.stamps.get(name, stamp) != stamp:
            self.stamps[name] = stamp


class Entry(NamedTuple):
    """A reference to an entry of the blackboard. The entry need not have a value.

    Attributes:
        board: The board that contains the entry.
        name: The absolute name of the entry.
        key: The key as written in the tree file.
        passed_on: Whether the key is remapped to an entry of an outer tree.
    """

    board: Board
    name: str
    key: str
    passed_on: bool = False

    @property
    def exists(self) -> bool:
        """Whether the entry has a value."""
        return self.board.has(self.name)

    @property
    def is_declared(self) -> bool:
        """Whether a port, a writing node or the mission has declared the entry."""
        return self.board.is_declared(self.name)

    @property
    def kind(self) -> type | None:
        """The declared type (`bool`, `int`, `float` or `str`), to which strings are converted; None if undeclared."""
        return self.board.kind_of(self.name)

    @property
    def stamp(self) -> int:
        """The number of times that the entry has been written."""
        return self.board.stamp(self.name)

    def read(self) -> object:
        """Return the entry's value.

        Raises:
            MissingEntryError: If the entry has not been written.
            UnknownValueError: If the value is unknown.
        """
        try:
            value = self.board.get(self.name)
        except KeyError:
            raise MissingEntryError(self.key) from None
        if isinstance(value, UnknownValue):
            raise UnknownValueError(value)
        return value

    @property
    def is_unknown(self) -> bool:
        """Whether the entry's value is unknown."""
        return self.exists and isinstance(self.board.get(self.name), UnknownValue)

    def declare(self, kind: type | None = None) -> None:
        """Declare the entry; a second declaration has no effect."""
        self.board.declare(self.name, kind)

    def write(self, value: object) -> None:
        """Write a value to the entry."""
        self.board.set(self.name, value)

    def remove(self) -> None:
        """Remove the entry."""
        self.board.remove(self.name)


@mission_context(preview=lambda: Scope(Board("preview")))
class Scope:
    """The scope of the main tree or of one instance of a subtree. It maps each key to an entry.

    Args:
        board: The board with the entries.
        path: The instance's path; empty for the main tree.
        parent: The scope of the tree that contains the `SubTree` node; None for the main tree.
        remapping: The parent scope's key for each remapped key.
        autoremap: Whether every other key is remapped to the parent scope's key of the same name.
        own: Keys that always belong to this scope, because the `SubTree` node passes a constant for each of them.
    """

    def __init__(
        self,
        board: Board,
        path: str = "",
        parent: "Scope | None" = None,
        remapping: Mapping[str, str] | None = None,
        *,
        autoremap: bool = False,
        own: frozenset[str] = frozenset(),
    ) -> None:
        self.board = board
        self.path = path
        self._parent = parent
        self._remapping = remapping or {}
        self._autoremap = autoremap
        self._own = own

    @property
    def root(self) -> "Scope":
        """The main tree's scope."""
        return self if self._parent is None else self._parent.root

    def resolve(self, key: str) -> Entry:
        """Return the entry to which a key refers in this scope."""
        scope, name = self.owner(key)
        folder = scope._folder
        # A key with a slash must not access the entries of a subtree.
        passed_on = scope is not self and not key.startswith(ROOT_SIGN)
        return Entry(self.board, f"{folder}/{name.replace('/', STROKE)}", key, passed_on)

    @property
    def _folder(self) -> str:
        return f"{self.board.prefix}/{self.path}" if self.path else self.board.prefix

    def entries(self) -> Iterator[tuple[str, Entry]]:
        """Yield the keys of existing entries and all remapped keys of this scope, each with its entry."""
        for name in self.board.names():
            folder, _, key = name.rpartition("/")
            if folder == self._folder:
                yield key.replace(STROKE, "/"), Entry(self.board, name, key)
        for key in self._remapping:
            yield key, self.resolve(key)

    def owner(self, key: str) -> "tuple[Scope, str]":
        """Return the scope that owns the entry to which a key refers, and the key of the entry in that scope."""
        scope = self
        while scope._parent is not None and not key.startswith(ROOT_SIGN) and key not in scope._own:
            if key in scope._remapping:
                key = scope._remapping[key]
            elif not scope._autoremap or key.startswith(_PRIVATE):
                break
            scope = scope._parent
        return (self.root, key.removeprefix(ROOT_SIGN)) if key.startswith(ROOT_SIGN) else (scope, key)


def entry_of(variable: str) -> str:
    """Return the key part of a py_trees variable name, such as `key` for `key.attribute`."""
    return variable.partition(".")[0]


def _remove_entries(stamps: dict[str, int]) -> None:
    """Remove the entries of a garbage-collected board from py_trees' blackboard."""
    for name in stamps:
        _storage().pop(name, None)


def _storage() -> dict[str, Any]:
    from py_trees.blackboard import Blackboard

    storage: dict[str, Any] = Blackboard.storage
    return storage
