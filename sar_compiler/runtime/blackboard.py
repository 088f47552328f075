"""The keys of a compiled tree, on py_trees' blackboard.

py_trees has one store for the whole process. Each compiled tree has a prefix of its own in it, and each
instance of a subtree a path below that, so which entry a key means is settled when the tree is compiled:
`Scope.resolve` follows the subtree's remapping up to the scope that owns the entry.
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
"""The prefix of a key of the root scope."""
_PRIVATE = "_"
STROKE = "%2F"
"""The replacement of a `/` of a key or of a subtree's name in the absolute name of an entry."""

_instances = itertools.count()


class MissingEntryError(SarError, KeyError):
    """A key is read to which nothing has been written.

    Attributes:
        key: The key, as it was written.
    """

    def __init__(self, key: str) -> None:
        self.key = key
        super().__init__(f"nothing has been written to '{key}' yet")

    def __str__(self) -> str:
        # A KeyError would show its text in quotes.
        return str(self.args[0])


class Board:
    """All entries of one compiled tree.

    Args:
        name: What its keys on py_trees' blackboard begin with; made unique in this process.

    Attributes:
        is_numbered: Whether what its entries hold are numbers; see `NumberedBoard`.
        stamps: How often each entry was written; an entry is there if it has a number here.
        kinds: The entries that somebody has named, written or not, with their types; None for those of any type. Both tables are
            changed in place, and never replaced: functions of scripts have them as arguments.
    """

    def __init__(self, name: str) -> None:
        self.is_numbered = False
        self.stamps: dict[str, int] = {}
        self.kinds: dict[str, type | None] = {}
        self._name = name
        # The entries of which it counts how often they were written.
        self._watched: set[str] = set()
        weakref.finalize(self, _forget, self.stamps)

    @functools.cached_property
    def storage(self) -> dict[str, Any]:
        """py_trees' blackboard, which need not be imported to check a tree."""
        return _storage()

    @functools.cached_property
    def prefix(self) -> str:
        """The prefix of the absolute names of its entries."""
        number = next(_instances)
        return f"/{self._name}~{number}" if number else f"/{self._name}"

    def has(self, name: str) -> bool:
        """Return whether there is an entry with an absolute name."""
        return name in self.storage

    def get(self, name: str) -> object:
        """Return an entry's value; a `KeyError` if there is none."""
        return self.storage[name]

    def set(self, name: str, value: object) -> None:
        """Write an entry, which is made if there is none."""
        self.storage[name] = value
        self.stamps[name] = self.stamps.get(name, 0) + 1

    def declare(self, name: str, kind: type | None) -> None:
        """Name an entry, which stays empty until it is written; the first type that it is given counts."""
        if name not in self.kinds:
            self.kinds[name] = kind

    def settle(self, name: str, kind: type) -> None:
        """Give an entry a type, if it has none of its own."""
        if self.kinds.get(name) is None:
            self.kinds[name] = kind

    def is_declared(self, name: str) -> bool:
        """Return whether an entry is named."""
        return name in self.kinds

    def kind(self, name: str) -> type | None:
        """Return the type of an entry; None if it has none of its own."""
        return self.kinds.get(name)

    def remove(self, name: str) -> None:
        """Remove an entry, if there is one, and forget its type."""
        self.storage.pop(name, None)
        self.stamps.pop(name, None)
        self.kinds.pop(name, None)

    def stamp(self, name: str) -> int:
        """Return how often an entry was written; 0 if there is none."""
        return self.stamps.get(name, 0)

    def names(self) -> Iterator[str]:
        """Yield the absolute names of all entries."""
        yield from list(self.stamps)

    def values(self) -> dict[str, object]:
        """Return its entries by their names below the prefix, in the order in which they were made."""
        begin = len(self.prefix) + 1
        return {name[begin:]: self.get(name) for name in self.names()}

    def watch(self, name: str) -> None:
        """Have it count how often an entry is written, because a node's behaviour depends on it."""
        self._watched.add(name)

    def memo(self, entries: "Sequence[Entry]") -> "Memo | None":  # noqa: ARG002 - for numbered ones
        """Return what remembers the effect of code on some entries; None unless the board is numbered."""
        return None

    def restamp(self, name: str, stamp: int) -> None:
        """Have an entry, if there is one, count as written so often."""
        if self.stamps.get(name, stamp) != stamp:
            self.stamps[name] = stamp


class Entry(NamedTuple):
    """One entry, which may not have been written yet.

    Attributes:
        board: Where it is.
        name: Its absolute name.
        key: The key as it was written in the tree file.
        passed_on: Whether the key stands for one of a tree around it.
    """

    board: Board
    name: str
    key: str
    passed_on: bool = False

    @property
    def exists(self) -> bool:
        """Whether it has been written."""
        return self.board.has(self.name)

    @property
    def is_declared(self) -> bool:
        """Whether a port, a write or the mission has named it."""
        return self.board.is_declared(self.name)

    @property
    def kind(self) -> type | None:
        """The type that a text given to it is read as: `bool`, `int`, `float` or `str`; None if it has none."""
        return self.board.kind(self.name)

    @property
    def stamp(self) -> int:
        """How often it has been written."""
        return self.board.stamp(self.name)

    def read(self) -> object:
        """Return its value.

        Raises:
            MissingEntryError: If it has not been written.
            UnknownValueError: If its value is not known.
        """
        try:
            held = self.board.get(self.name)
        except KeyError:
            raise MissingEntryError(self.key) from None
        if isinstance(held, UnknownValue):
            raise UnknownValueError(held)
        return held

    @property
    def is_unknown(self) -> bool:
        """Whether it was written, and its value is not known."""
        return self.exists and isinstance(self.board.get(self.name), UnknownValue)

    def declare(self, kind: type | None = None) -> None:
        """Name it; the first type that it is given counts."""
        self.board.declare(self.name, kind)

    def write(self, value: object) -> None:
        """Write it."""
        self.board.set(self.name, value)

    def remove(self) -> None:
        """Remove it."""
        self.board.remove(self.name)


@mission_context(preview=lambda: Scope(Board("preview")))
class Scope:
    """The keys of one tree instance: the main tree's or a subtree's.

    Args:
        board: Where the entries are.
        path: The instance's path; empty for the main tree.
        parent: The scope of the tree around it.
        remapping: Which key of the parent each of these keys stands for.
        autoremap: Whether every other key stands for the parent's of the same name.
        own: Keys that are this scope's own, whatever else is said (they were given as constants).
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
        """Return the entry that a key means here."""
        scope, name = self.owner(key)
        folder = scope._folder
        # A stroke in a key must not lead into the folder of a subtree.
        passed_on = scope is not self and not key.startswith(ROOT_SIGN)
        return Entry(self.board, f"{folder}/{name.replace('/', STROKE)}", key, passed_on)

    @property
    def _folder(self) -> str:
        return f"{self.board.prefix}/{self.path}" if self.path else self.board.prefix

    def entries(self) -> Iterator[tuple[str, Entry]]:
        """Yield the keys that were written here, and those that stand for others by a remapping, with their entries."""
        for name in self.board.names():
            folder, _, key = name.rpartition("/")
            if folder == self._folder:
                yield key.replace(STROKE, "/"), Entry(self.board, name, key)
        for key in self._remapping:
            yield key, self.resolve(key)

    def owner(self, key: str) -> "tuple[Scope, str]":
        """Return the scope that owns what a key means here, and the key there."""
        scope = self
        while scope._parent is not None and not key.startswith(ROOT_SIGN) and key not in scope._own:
            if key in scope._remapping:
                key = scope._remapping[key]
            elif not scope._autoremap or key.startswith(_PRIVATE):
                break
            scope = scope._parent
        return (self.root, key.removeprefix(ROOT_SIGN)) if key.startswith(ROOT_SIGN) else (scope, key)


def entry_of(variable: str) -> str:
    """Return the key of a variable such as `key.attribute`."""
    return variable.partition(".")[0]


def _forget(stamps: dict[str, int]) -> None:
    """Remove the entries of a board that was garbage-collected from py_trees' blackboard."""
    for name in stamps:
        _storage().pop(name, None)


def _storage() -> dict[str, Any]:
    from py_trees.blackboard import Blackboard

    storage: dict[str, Any] = Blackboard.storage
    return storage
