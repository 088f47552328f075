"""States as bytes."""

from typing import Any, Final

from librt.vecs import append, vec
from mypy_extensions import i32, i64, u8

from sar_compiler.runtime.kernel.cells import INVALID, RUNNING

_MORE: Final = 128
"""Added to a byte of a number of which more follows."""
_LONGEST: Final = 10
"""So many bytes a number of the machine takes at most."""
_LARGE: Final = 60
"""A number with more bits may be none of the machine."""


class StateCode:
    """Writes states as bytes: only what is not as it was at first, which is little where few nodes run.

    A number is written as in Protocol Buffers, seven bits a byte; a cell as how many cells behind the last one it stands,
    and what is in it. First come the outcome of the last tick and what the properties remember.

    Args:
        cells: The cells with numbers, at the start.
        values: The cells with other values, at the start.
        forgotten: For each node whether it makes no difference, while it does not run, if and how it has ended.
    """

    def __init__(self, cells: vec[i32], values: list[Any], forgotten: list[bool]) -> None:
        self._cells = cells[:]
        self._values = list(values)
        self._forgotten = vec[u8](forgotten)
        self._code = _Code()
        self._numbers: dict[Any, int] = {}
        self._numbered: list[Any] = []

    @property
    def known(self) -> int:
        """How many other values have a number."""
        return len(self._numbered)

    def write(self, head: list[int], cells: vec[i32], values: list[Any], entries: vec[i32]) -> bytes:
        """Return a state as bytes.

        Args:
            head: The outcome of the last tick, and what the properties remember.
            cells: The cells with numbers.
            values: The cells with other values.
            entries: The number of what each entry holds.
        """
        code = self._code
        code.begin(head, len(cells) + len(values) + len(entries))
        self._write_cells(code, cells)
        count = len(cells)
        for place, value in enumerate(values):
            if value != self._values[place]:
                code.put(count + place, self._number(value))
        count += len(values)
        index: i64 = 0
        while index < len(entries):
            if entries[index]:
                code.put(count + index, i64(entries[index]))
            index += 1
        return code.written()

    def _write_cells(self, code: "_Code", cells: vec[i32]) -> None:
        index: i64 = 0
        forgotten, nodes = self._forgotten, len(self._forgotten)
        while index < nodes:
            held = cells[index]
            if held != INVALID and (held == RUNNING or not forgotten[index]):
                code.put(index, i64(held) + 1)
            index += 1
        first, count = self._cells, len(cells)
        while index < count:
            held = cells[index]
            if held != first[index]:
                code.put(index, i64(held) + 1)
            index += 1

    def _number(self, value: Any) -> int:
        number = self._numbers.setdefault(value, len(self._numbered))
        if number == len(self._numbered):
            self._numbered.append(value)
        return number

    def head(self, code: bytes) -> list[int]:
        """Return the outcome of the last tick, and what the properties remember."""
        outcome, at = _read(code, 0)
        watched, shift = 0, 0
        for byte in code[at : _behind(code, at)]:
            watched |= (byte & (_MORE - 1)) << shift
            shift += 7
        return [outcome, watched]

    def read(self, code: bytes, cells: vec[i32], values: list[Any]) -> vec[i32]:
        """Return the numbers of what the entries hold in a state, and make the cells what they were in it."""
        count, others = len(self._cells), len(self._values)
        index: i64 = 0
        while index < count:
            cells[index] = self._cells[index]
            index += 1
        values[:] = self._values
        entries = vec[i32]()
        place: i64 = 0
        at = _behind(code, _behind(code, 0))
        while at < len(code):
            step, at = _read(code, at)
            held, at = _read(code, at)
            place += step
            if place < count:
                cells[place] = i32(held - 1)
            elif place < count + others:
                values[place - count] = self._numbered[held]
            else:
                while len(entries) < place - count - others:
                    entries = append(entries, 0)
                entries = append(entries, i32(held))
        return entries


class _Code:
    """A state that is being written."""

    def __init__(self) -> None:
        self._room = vec[u8]()
        self._at: i64 = 0
        self._last: i64 = 0

    def begin(self, head: list[int], most: i64) -> None:
        """Begin with the numbers at the head, of which any may have more bits than those of the machine.

        Args:
            head: The numbers.
            most: How many places may follow.
        """
        room = _LONGEST * (len(head) + 2 * most)
        for number in head:
            if number >> _LARGE:
                room += number.bit_length()
        if len(self._room) < room:
            self._room = vec[u8](bytes(room))
        self._at = self._last = 0
        for number in head:
            while number >= _MORE:
                self._room[self._at] = u8(_MORE | number & (_MORE - 1))
                self._at += 1
                number >>= 7  # noqa: PLW2901 - the rest of it
            self._room[self._at] = u8(number)
            self._at += 1

    def put(self, place: i64, held: i64) -> None:
        """Add what a place holds."""
        self._at = _put(self._room, _put(self._room, self._at, place - self._last), held)
        self._last = place

    def written(self) -> bytes:
        """Return what was written."""
        return bytes(self._room[: self._at])


def _put(code: vec[u8], at: i64, number: i64) -> i64:
    """Write a number at a place; return where the next one begins."""
    while number >= _MORE:
        code[at] = u8(_MORE | number & (_MORE - 1))
        at += 1
        number >>= 7
    code[at] = u8(number)
    return at + 1


def _behind(code: bytes, at: i64) -> i64:
    """Return where the number behind the one at a place begins."""
    while code[at] >= _MORE:
        at += 1
    return at + 1


def _read(code: bytes, at: i64) -> tuple[i64, i64]:
    number: i64 = 0
    shift: i64 = 0
    while True:
        byte: i64 = code[at]
        at += 1
        number |= (byte & (_MORE - 1)) << shift
        if byte < _MORE:
            return number, at
        shift += 7
