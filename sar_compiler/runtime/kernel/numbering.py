"""Numbers of states, in the order in which they are found."""

from array import array
from typing import Any, Final

_FIRST_SIZE: Final = 1024
_FREE: Final = 0


class Numbering:
    """Numbers states from 0 on.

    A dictionary would take 90 bytes more for each: states are found by a table of their numbers, which takes six to twelve.

    Attributes:
        keys: The states, by their numbers.
    """

    def __init__(self) -> None:
        self.keys: list[Any] = []
        # One more than the number of a state, where its hash leads to or behind that; the size is a power of two.
        self._table = array("I", bytes(4 * _FIRST_SIZE))
        self._mask = _FIRST_SIZE - 1

    def find(self, key: Any) -> int:
        """Return the number of a state; -1 if it has none."""
        table, keys, mask = self._table, self.keys, self._mask
        at: int = hash(key) & mask
        while True:
            slot: int = table[at]
            if slot == _FREE:
                return -1
            if keys[slot - 1] == key:
                return slot - 1
            at = (at + 1) & mask

    def add(self, key: Any) -> int:
        """Return the number of a state that has none yet."""
        number = len(self.keys)
        self.keys.append(key)
        if 3 * number > 2 * self._mask:
            self._grow()
        else:
            self._place(key, number)
        return number

    def _grow(self) -> None:
        size = 2 * (self._mask + 1)
        self._table = array("I", bytes(4 * size))
        self._mask = size - 1
        for number, key in enumerate(self.keys):
            self._place(key, number)

    def _place(self, key: Any, number: int) -> None:
        table, mask = self._table, self._mask
        at: int = hash(key) & mask
        while table[at] != _FREE:
            at = (at + 1) & mask
        table[at] = number + 1
