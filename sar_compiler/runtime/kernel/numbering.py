"""Numbers of states, in the order in which they are found."""

from collections.abc import Iterator
from typing import Final

from librt.vecs import append, extend, vec
from mypy_extensions import i32, i64, u8

_FIRST_SIZE: Final = 1024
_FREE: Final = 0


class StateStore:
    """The states, as bytes, by their numbers.

    They stand one behind the other: an object for each would take 50 bytes more.
    """

    def __init__(self) -> None:
        self._written = vec[u8]()
        # Where each ends, and the next one begins.
        self._ends = vec[i64]([0])

    def __len__(self) -> int:
        return len(self._ends) - 1

    def __getitem__(self, number: int) -> bytes:
        return bytes(self._written[self._ends[number] : self._ends[number + 1]])

    def __iter__(self) -> Iterator[bytes]:
        return iter(self.between(0, len(self)))

    def between(self, first: int, end: int) -> list[bytes]:
        """Return the states from one number up to another, which does not count."""
        return [self[number] for number in range(first, end)]

    def append(self, state: bytes) -> None:
        """Give a state the next number."""
        self._written = extend(self._written, state)
        self._ends = append(self._ends, len(self._written))


class Numbering:
    """Numbers states from 0 on.

    A dictionary would take 90 bytes more for each: states are found by a table of their numbers, which takes six to twelve.

    Attributes:
        states: The states, by their numbers.
    """

    def __init__(self) -> None:
        self.states = StateStore()
        # One more than the number of a state, where its hash leads to or behind that; the size is a power of two.
        self._table = vec[i32](bytes(_FIRST_SIZE))
        self._mask = _FIRST_SIZE - 1

    def find(self, state: bytes) -> int:
        """Return the number of a state; -1 if it has none."""
        table, states, mask = self._table, self.states, self._mask
        at = hash(state) & mask
        while True:
            slot = table[at]
            if slot == _FREE:
                return -1
            if states[slot - 1] == state:
                return slot - 1
            at = (at + 1) & mask

    def add(self, state: bytes) -> int:
        """Return the number of a state that has none yet."""
        number = len(self.states)
        self.states.append(state)
        if 3 * number > 2 * self._mask:
            self._grow()
        else:
            self._place(state, number)
        return number

    def _grow(self) -> None:
        size = 2 * (self._mask + 1)
        self._table = vec[i32](bytes(size))
        self._mask = size - 1
        for number in range(len(self.states)):
            self._place(self.states[number], number)

    def _place(self, state: bytes, number: int) -> None:
        table, mask = self._table, self._mask
        at = hash(state) & mask
        while table[at] != _FREE:
            at = (at + 1) & mask
        table[at] = number + 1
