"""A blackboard whose entries are stored as numbers, for millions of snapshots of its state."""

from collections.abc import Hashable, Iterator, Sequence
from typing import Any, NamedTuple

from sar_compiler.analysis.merging import ValueMerging
from sar_compiler.runtime.blackboard import Board, Entry
from sar_compiler.runtime.frozen import PLAIN, FrozenValueError, can_change, freeze, thaw
from sar_compiler.runtime.kernel.entry_cells import EntryCells, Memo


class EntryContent(NamedTuple):
    """The content of an entry.

    Attributes:
        kind: A tuple with its type, or with None if it has no type of its own; None if it was never named.
        frozen: Its value, as `freeze` returns it; None if nothing was written.
        stamp: The number of writes if it is counted; else 1 if the entry was written.
    """

    kind: tuple[type | None] | None = None
    frozen: Any = None
    stamp: int = 0


_NOTHING = EntryContent()


class NumberedBoard(Board):
    """A board whose entries are in cells, instead of on py_trees' blackboard.

    Attributes:
        cells: The cells, possibly shared with other boards.
        merging: The values that are not distinguished; None if all are.
    """

    cells: EntryCells
    merging: ValueMerging | None = None

    @classmethod
    def from_board(cls, board: Board, cells: EntryCells) -> None:
        """Convert a board to a numbered one in place, because the ports of all nodes refer to it.

        Raises:
            FrozenValueError: If an entry holds a value that can neither be copied nor hashed.
        """
        kinds, values = dict(board.kinds), {name: board.get(name) for name in board.names()}
        for name in values:
            board.remove(name)
        board.__class__ = cls
        board.is_numbered = True
        assert isinstance(board, NumberedBoard)  # noqa: S101 - the line above says so
        board.cells = cells
        cells.freeze = board.freeze_lent
        for name in {**values, **kinds}:
            if name in kinds:
                board.declare(name, kinds[name])
            if name in values:
                board.set(name, values[name])

    def memo(self, entries: Sequence[Entry]) -> Memo:
        """Return a memo that caches the effects of code on `entries`.

        It identifies entries by their cells, so it also covers entries of other boards that share these cells.
        """
        places = {self.cells.place_of(entry.name) for entry in entries}
        return Memo(
            self.cells, sorted(places.union(self.merging.add_switch(entries) if self.merging else ()))
        )

    def merge(self, merging: ValueMerging) -> None:
        """Merge some values, beginning with the current ones."""
        self.merging = merging
        for name in self.names():
            self._store(name, self._content_of(name))

    def has(self, name: str) -> bool:
        """Return whether there is an entry with an absolute name."""
        return self._content_of(name).frozen is not None

    def get(self, name: str) -> object:
        """Return an entry's value; raise a `KeyError` if it has none."""
        frozen = self._content_of(name).frozen
        if frozen is None:
            raise KeyError(name)
        kind, held, *_ = frozen
        if kind in PLAIN:
            return held
        place = self.cells.place_of(name)
        if place in self.cells.lent:
            return self.cells.lent[place]
        value: object = thaw(frozen)
        if can_change(value):
            self.cells.lent[place] = value
        return value

    def set(self, name: str, value: object) -> None:
        """Write an entry, which is created if missing."""
        held = self._content_of(name)
        self._store(name, held._replace(frozen=self._freeze(name, value), stamp=self._next_stamp(name)))

    def declare(self, name: str, kind: type | None) -> None:
        """Declare an entry, which stays empty until it is written; its first type is kept."""
        held = self._content_of(name)
        if held.kind is None:
            self._store(name, held._replace(kind=(kind,)))

    def set_kind(self, name: str, kind: type) -> None:
        """Set the type of an entry that has none of its own."""
        held = self._content_of(name)
        if held.kind in (None, (None,)):
            self._store(name, held._replace(kind=(kind,)))

    def is_declared(self, name: str) -> bool:
        """Return whether an entry is declared."""
        return self._content_of(name).kind is not None

    def kind_of(self, name: str) -> type | None:
        """Return the type of an entry; None if it has none of its own."""
        kind = self._content_of(name).kind
        return None if kind is None else kind[0]

    def remove(self, name: str) -> None:
        """Remove an entry if it exists, and forget its type."""
        self._store(name, _NOTHING)

    def stamp(self, name: str) -> int:
        """Return the number of writes of an entry, if that is monitored; 0 if it does not exist."""
        return self._content_of(name).stamp

    def names(self) -> Iterator[str]:
        """Yield the absolute names of all entries."""
        folder = f"{self.prefix}/"
        yield from [name for name in self.cells.names if name.startswith(folder) and self.has(name)]

    def restamp(self, name: str, stamp: int) -> None:
        """Set the number of writes of an entry, if it exists."""
        held = self._content_of(name)
        if held.stamp not in (0, stamp):
            self._store(name, held._replace(stamp=stamp))

    def _content_of(self, name: str) -> EntryContent:
        held: EntryContent | None = self.cells.content(self.cells.place_of(name))
        return held or _NOTHING

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
        """Return the immutable form of a value that a leaf may have changed; called by the cells."""
        name, held = self.cells.names[place], self.cells.content(place)
        return held._replace(frozen=self._freeze(name, value)) if held else None
