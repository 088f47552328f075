"""Encoding of states as bytes."""

from typing import Any, Final

from librt.vecs import vec
from mypy_extensions import i32, i64, u8

from sar_compiler.runtime.kernel.cells import RUNNING

_MORE: Final = 128
"""Added to a byte of a number that continues."""
_HALF: Final = 15
"""The maximum of half a byte; a number of at least this size continues in further bytes."""
_LONGEST: Final = 21
"""The maximum number of bytes of a place and a machine number."""


class StateCode:
    """Encodes states as bytes: only the differences from the initial state, which are few if few nodes run.

    First come the outcome of the last tick and the state of the properties, encoded like numbers in Protocol Buffers:
    seven bits in a byte. Then comes a byte for each changed place: its distance from the previous one, and its
    content. A number that does not fit into a half of that byte continues after it.

    Args:
        cells: The cells with numbers, at the start; no node has ended.
        values: The cells with other values, at the start.
        forgotten: For each node whether its last status makes no difference while it does not run.
    """

    def __init__(self, cells: vec[i32], values: list[Any], forgotten: list[bool]) -> None:
        self._cells = cells[:]
        self._values = list(values)
        self._forgotten = vec[u8](forgotten)
        self._numbers: dict[Any, int] = {}
        self._numbered: list[Any] = []
        # The code that is being written, and the last place that was written.
        self._room = vec[u8]()
        self._last: i64 = 0

    @property
    def value_count(self) -> int:
        """The number of other values with a number."""
        return len(self._numbered)

    def write(
        self, outcome: int, watched: int, cells: vec[i32], values: list[Any], entries: vec[i32]
    ) -> bytes:
        """Return a state as bytes.

        Args:
            outcome: The outcome of the last tick.
            watched: The state of the properties.
            cells: The cells with numbers.
            values: The cells with other values.
            entries: The number of each entry's content.
        """
        self._make_room(watched.bit_length(), len(cells) + len(values) + len(entries))
        at = _write_number(self._room, _write_number(self._room, 0, outcome), watched)
        return self._write(at, cells, values, entries)

    def write_middle(
        self,
        node: int,
        watched: int,
        broken: int,
        shown: list[int],
        cells: vec[i32],
        values: list[Any],
        entries: vec[i32],
    ) -> bytes:
        """Return an intermediate state of a tick as bytes, which are never decoded.

        Args:
            node: The next node.
            watched: The state of the properties.
            broken: The violated properties, as bits.
            shown: Forgotten nodes whose last statuses matter here.
            cells: The cells with numbers.
            values: The cells with other values.
            entries: The number of each entry's content.
        """
        most = watched.bit_length() + broken.bit_length()
        self._make_room(most, len(cells) + len(values) + len(entries))
        at = _write_number(self._room, _write_number(self._room, 0, node), watched)
        at = _write_number(self._room, at, broken)
        forgotten = self._forgotten
        for place in shown:
            forgotten[place] = 0
        written = self._write(at, cells, values, entries)
        for place in shown:
            forgotten[place] = 1
        return written

    def _make_room(self, bits: int, places: i64) -> None:
        """Make room for a head with a number of bits, and for a number of places."""
        most = bits + _LONGEST * (places + 3)
        if len(self._room) < most:
            self._room = vec[u8](bytes(most))

    def _write(self, at: i64, cells: vec[i32], values: list[Any], entries: vec[i32]) -> bytes:
        """Return the head, followed by all places."""
        at = self._write_cells(at, cells)
        at = self._write_values(at, len(cells), values)
        at = self._write_entries(at, len(cells) + len(values), entries)
        return bytes(self._room[:at])

    def _write_cells(self, at: i64, cells: vec[i32]) -> i64:
        room, first, forgotten = self._room, self._cells, self._forgotten
        nodes = len(forgotten)
        index: i64 = 0
        last: i64 = 0
        for held in cells:
            if held != first[index] and (index >= nodes or held == RUNNING or not forgotten[index]):
                at = _write_place(room, at, index - last, i64(held) + 1)
                last = index
            index += 1  # noqa: SIM113 - a machine number
        self._last = last
        return at

    def _write_values(self, at: i64, before: i64, values: list[Any]) -> i64:
        for place, first in enumerate(self._values):
            value = values[place]
            if value is not first and value != first:
                now = before + i64(place)
                at = _write_place(self._room, at, now - self._last, i64(self._number(value)))
                self._last = now
        return at

    def _write_entries(self, at: i64, before: i64, entries: vec[i32]) -> i64:
        room, last = self._room, self._last - before
        index: i64 = 0
        while index < len(entries):
            held = entries[index]
            if held:
                at = _write_place(room, at, index - last, i64(held))
                last = index
            index += 1
        return at

    def _number(self, value: Any) -> int:
        number = self._numbers.setdefault(value, len(self._numbered))
        if number == len(self._numbered):
            self._numbered.append(value)
        return number

    def head(self, code: bytes) -> tuple[int, int]:
        """Return the outcome of the last tick, and the state of the properties."""
        watched, shift, at = 0, 0, 1
        while True:
            byte = code[at]
            watched |= (byte & (_MORE - 1)) << shift
            if byte < _MORE:
                return code[0], watched
            shift += 7
            at += 1

    def read(self, code: bytes, values: list[Any], entries: vec[i32]) -> vec[i32]:
        """Return the contents of the cells in a state.

        Args:
            code: The state.
            values: The contents of the other cells, which are replaced.
            entries: 0 for each entry, which is replaced by the number of its content.
        """
        cells, count, others = self._cells[:], len(self._cells), len(self._values)
        values[:] = self._values
        place: i64 = 0
        at, end = _skip_number(code, 1), len(code)
        while at < end:
            both: i64 = code[at]
            step, held = both >> 4, both & _HALF
            at += 1
            if step == _HALF:
                step, at = _read_rest(code, at)
            if held == _HALF:
                held, at = _read_rest(code, at)
            place += step
            if place < count:
                cells[place] = i32(held - 1)
            elif place < count + others:
                values[place - count] = self._numbered[held]
            else:
                entries[place - count - others] = i32(held)
        return cells


def _write_place(code: vec[u8], at: i64, step: i64, held: i64) -> i64:
    """Write a place, as its distance from the previous one, with its content; return the next index."""
    if step < _HALF and held < _HALF:
        code[at] = u8(step << 4 | held)
        return at + 1
    code[at] = u8(min(step, _HALF) << 4 | min(held, _HALF))
    at += 1
    if step >= _HALF:
        at = _write_number(code, at, step - _HALF)
    return _write_number(code, at, held - _HALF) if held >= _HALF else at


def _write_number(code: vec[u8], at: i64, number: int) -> i64:
    """Write a number at an index; return the next index."""
    while number >= _MORE:
        code[at] = u8(_MORE | number & (_MORE - 1))
        at += 1
        number >>= 7
    code[at] = u8(number)
    return at + 1


def _skip_number(code: bytes, at: i64) -> i64:
    """Return the index after the number at an index."""
    while code[at] >= _MORE:
        at += 1
    return at + 1


def _read_rest(code: bytes, at: i64) -> tuple[i64, i64]:
    """Return the number whose rest begins at an index, and the index after it."""
    number: i64 = _HALF
    shift: i64 = 0
    while True:
        byte: i64 = code[at]
        at += 1
        number += (byte & (_MORE - 1)) << shift
        if byte < _MORE:
            return number, at
        shift += 7
