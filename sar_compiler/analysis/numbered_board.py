"""A blackboard that stores entries as numbers, so that a search can store and restore millions of its states."""

from collections.abc import Hashable, Iterator, Sequence
from typing import Any, NamedTuple

from sar_compiler.analysis.merging import ValueMerging
from sar_compiler.runtime.blackboard import Board, Entry
from sar_compiler.runtime.frozen import PLAIN, FrozenValueError, can_change, freeze, thaw
from sar_compiler.runtime.kernel.entry_cells import EntryCells, Memo


class EntryContent(NamedTuple):
    """The content of an entry.

    Attributes:
        kind: A tuple with the entry's type, or with None for an entry without a type; None if it was never declared.
        frozen: The entry's value, as `freeze` returns it; None if no value was written.
        stamp: The number of writes if they are counted; else 1 if the entry was written.
    """

    kind: tuple[type | None] | None = None
    frozen: Any = None
    stamp: int = 0


_NOTHING = EntryContent()


class NumberedBoard(Board):
    """A blackboard whose entries are stored in cells, not on py_trees' blackboard.

    Attributes:
        cells: The cells, possibly shared with other boards.
        merging: Replaces values that are not distinguished; None if all values are distinguished.
    """

    cells: EntryCells
    merging: ValueMerging | None = None

    @classmethod
    def from_board(cls, board: Board, cells: EntryCells) -> None:
        """Convert a board to a numbered board in place, so that the ports of all nodes keep referring to it.

        Raises:
            FrozenValueError: If an entry holds a value that can neither be copied nor hashed.
        """
        kinds, values = dict(board.kinds), {name: board.get(name) for name in board.names()}
        for name in values:
            board.remove(name)
        board.__class__ = cls
        board.is_numbered = True
        assert isinstance(board, NumberedBoard)  # noqa: S101 - the class was set above
        board.cells = cells
        cells.freeze = board.freeze_lent
        for name in {**values, **kinds}:
            if name in kinds:
                board.declare(name, kinds[name])
            if name in values:
                board.set(name, values[name])

    def memo(self, entries: Sequence[Entry]) -> Memo:
        """Return a cache for the effects of code that reads and writes *entries*.

        The memo identifies entries by their cells, so it also works for entries of other boards with the same cells.
        """
        places = {self.cells.place_of(entry.name) for entry in entries}
        return Memo(
            self.cells, sorted(places.union(self.merging.add_switch(entries) if self.merging else ()))
        )

    def merge(self, merging: ValueMerging) -> None:
        """Merge the current values of the entries, and all values that are written from now on."""
        self.merging = merging
        for name in self.names():
            self._store(name, self._content_of(name))

    def has(self, name: str) -> bool:
        """Return whether the entry with the given absolute name has a value."""
        return self._content_of(name).frozen is not None

    def get(self, name: str) -> object:
        """Return an entry's value, or raise a `KeyError` if the entry has no value."""
        frozen = self._content_of(name).frozen
        if frozen is None:
            raise KeyError(name)
        kind, plain, *_ = frozen
        if kind in PLAIN:
            return plain
        place = self.cells.place_of(name)
        if place in self.cells.lent:
            return self.cells.lent[place]
        value: object = thaw(frozen)
        if can_change(value):
            self.cells.lent[place] = value
        return value

    def set(self, name: str, value: object) -> None:
        """Write a value to an entry. Create the entry if it does not exist."""
        content = self._content_of(name)
        self._store(name, content._replace(frozen=self._freeze(name, value), stamp=self._next_stamp(name)))

    def declare(self, name: str, kind: type | None) -> None:
        """Declare an entry, which stays empty until a value is written.

        A type declared earlier is not changed.
        """
        content = self._content_of(name)
        if content.kind is None:
            self._store(name, content._replace(kind=(kind,)))

    def set_kind(self, name: str, kind: type) -> None:
        """Set the type of an entry that has no type yet."""
        content = self._content_of(name)
        if content.kind in (None, (None,)):
            self._store(name, content._replace(kind=(kind,)))

    def is_declared(self, name: str) -> bool:
        """Return whether an entry is declared."""
        return self._content_of(name).kind is not None

    def kind_of(self, name: str) -> type | None:
        """Return the type of an entry, or None if the entry has no type."""
        kind = self._content_of(name).kind
        return None if kind is None else kind[0]

    def remove(self, name: str) -> None:
        """Remove an entry and the entry's type, if the entry exists."""
        self._store(name, _NOTHING)

    def stamp(self, name: str) -> int:
        """Return how often an entry was written. Without counting, return 1 for any entry that was written."""
        return self._content_of(name).stamp

    def names(self) -> Iterator[str]:
        """Yield the absolute names of all entries."""
        folder = f"{self.prefix}/"
        yield from [name for name in self.cells.names if name.startswith(folder) and self.has(name)]

    def restamp(self, name: str, stamp: int) -> None:
        """Set the number of times an entry was written, if the entry exists."""
        content = self._content_of(name)
        if content.stamp not in (0, stamp):
            self._store(name, content._replace(stamp=stamp))

    def _content_of(self, name: str) -> EntryContent:
        content: EntryContent | None = self.cells.content(self.cells.place_of(name))
        return content or _NOTHING

    def _store(self, name: str, content: EntryContent) -> None:
        place = self.cells.place_of(name)
        self.cells.lent.pop(place, None)
        if self.merging and content.frozen is not None and name in self.merging.values:
            content = content._replace(frozen=freeze(self.merging.representative(name, thaw(content.frozen))))
        self.cells.set_content(place, None if content == _NOTHING else content)

    def _next_stamp(self, name: str) -> int:
        return self.stamp(name) + 1 if name in self._watched else 1

    def _freeze(self, name: str, value: object) -> Hashable:
        try:
            return freeze(value)
        except FrozenValueError as error:
            message = f"the entry '{name.removeprefix(self.prefix + '/')}' holds {error}"
            raise FrozenValueError(message) from error

    def freeze_lent(self, place: int, value: object) -> Hashable:
        """Return the immutable form of an entry value that a leaf may have changed.

        The cells call this method.
        """
        name, content = self.cells.names[place], self.cells.content(place)
        return content._replace(frozen=self._freeze(name, value)) if content else None
