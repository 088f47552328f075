"""Numbers states in the order in which a search finds them."""

from collections.abc import Iterator
from typing import Final

from librt.vecs import append, extend, vec
from mypy_extensions import i32, i64, u8

_FIRST_SIZE: Final = 1024
_FREE: Final = 0
_BITS_OF_NUMBER: Final = 32
_NUMBER: Final = (1 << _BITS_OF_NUMBER) - 1
_HASH: Final = (1 << 31) - 1
"""The mask for the bits of a hash that the table stores. It also limits the size of the table."""
_STRETCH: Final = 1 << 12
"""The number of states in a stretch. A stretch takes at most 2^31 bytes, so a state may take 500,000 bytes."""
_KEPT_MIDDLES: Final = 1 << 15
"""The number of other intermediate states after which one is forgotten. They take about 6 MB of memory."""


class StateStore:
    """Stores encoded states by number.

    States are stored consecutively, because a separate object for each state would take 50 bytes more. They are divided
    into stretches, which are not copied when the next stretch is created. A single growing array would exist twice
    while it is copied, and would leave a hole in the memory.
    """

    def __init__(self) -> None:
        self._stretches: list[_Stretch] = []
        self._count = 0

    def __len__(self) -> int:
        return self._count

    def __getitem__(self, number: int) -> bytes:
        return self._stretches[number // _STRETCH].state_at(number % _STRETCH)

    def __iter__(self) -> Iterator[bytes]:
        return iter(self.states_between(0, len(self)))

    def states_between(self, first: int, end: int) -> list[bytes]:
        """Return the states with the numbers from *first* to *end* - 1."""
        return [self[number] for number in range(first, end)]

    def append(self, state: bytes) -> None:
        """Store a state, which gets the next number."""
        if self._count % _STRETCH == 0:
            self._stretches.append(_Stretch())
        self._stretches[-1].append(state)
        self._count += 1


class _Stretch:
    """A block of encoded states with consecutive numbers."""

    def __init__(self) -> None:
        self._written = vec[u8]()
        # The end of each state, which is also the start of the next state.
        self._ends = vec[i32]([0])

    def state_at(self, place: int) -> bytes:
        """Return the state with the given index in the stretch."""
        return bytes(self._written[self._ends[place] : self._ends[place + 1]])

    def append(self, state: bytes) -> None:
        """Append a state."""
        self._written = extend(self._written, state)
        self._ends = append(self._ends, i32(len(self._written)))


class Numbering:
    """Assigns numbers to states, starting with 0.

    The number of a state is found with a hash table of numbers, which takes 12 to 24 bytes for each state. A dictionary
    would take 90 bytes more.

    Attributes:
        states: The states, by number.
    """

    def __init__(self) -> None:
        self.states = StateStore()
        # Each slot contains a state's hash and its number plus 1, at the index of the hash or after it. The size is a
        # power of two.
        self._table = vec[i64](bytes(_FIRST_SIZE))
        self._mask: i64 = _FIRST_SIZE - 1

    def find(self, state: bytes) -> int:
        """Return the number of a state, or -1 if the state has no number."""
        table, mask = self._table, self._mask
        hashed = i64(hash(state)) & _HASH
        at = hashed & mask
        while True:
            slot = table[at]
            if slot == _FREE:
                return -1
            # The hash is compared first, because comparing a state requires a copy of it.
            if slot >> _BITS_OF_NUMBER == hashed and self.states[int(slot & _NUMBER) - 1] == state:
                return int(slot & _NUMBER) - 1
            at = (at + 1) & mask

    def add(self, state: bytes) -> int:
        """Store a state, and return its new number."""
        number = len(self.states)
        self.states.append(state)
        if 3 * number > 2 * self._mask:
            self._grow()
        self._store_in_slot((i64(hash(state)) & _HASH) << _BITS_OF_NUMBER | (number + 1))
        return number

    def _grow(self) -> None:
        before = self._table
        self._mask = 2 * self._mask + 1
        table = vec[i64](capacity=self._mask + 1)
        while len(table) <= self._mask:
            table = append(table, _FREE)
        self._table = table
        for slot in before:
            if slot != _FREE:
                self._store_in_slot(slot)

    def _store_in_slot(self, slot: i64) -> None:
        table, mask = self._table, self._mask
        at = (slot >> _BITS_OF_NUMBER) & mask
        while table[at] != _FREE:
            at = (at + 1) & mask
        table[at] = slot


class Middles:
    """Assigns numbers to intermediate states, and forgets those that no recent tick has reached.

    An intermediate state takes as much memory as a state, and there are several for each state. But ticks that merge
    start in states that are found at about the same time. A forgotten intermediate state gets another number when a
    tick reaches it again.

    Args:
        room: The minimum number of other intermediate states that ticks reach before one is forgotten.
    """

    def __init__(self, room: int = _KEPT_MIDDLES) -> None:
        self._room = room
        self._lately, self._before = _Recent(), _Recent()
        self._count = 0

    def find(self, middle: bytes) -> int:
        """Return the number of an intermediate state, or -1 if it has no number or was forgotten."""
        number = self._lately.find(middle)
        if number < 0:
            number = self._before.find(middle)
            if number >= 0:
                self._store(middle, number)
        return number

    def add(self, middle: bytes) -> int:
        """Store an intermediate state, and return its new number."""
        number = self._count
        self._store(middle, number)
        self._count = number + 1
        return number

    def _store(self, middle: bytes, number: int) -> None:
        if len(self._lately) >= self._room:
            self._before, self._lately = self._lately, _Recent()
        self._lately.add(middle, number)


class _Recent:
    """The intermediate states that ticks have recently reached, with their numbers."""

    def __init__(self) -> None:
        self._numbering = Numbering()
        self._numbers = vec[i32]()

    def __len__(self) -> int:
        return len(self._numbers)

    def find(self, middle: bytes) -> int:
        at = self._numbering.find(middle)
        return -1 if at < 0 else int(self._numbers[at])

    def add(self, middle: bytes, number: int) -> None:
        self._numbering.add(middle)
        self._numbers = append(self._numbers, i32(number))
