"""Encodes the states of a tree as bytes, and decodes them."""

from typing import Any, Final

from librt.vecs import vec
from mypy_extensions import i32, i64, u8

from sar_compiler.runtime.kernel.cells import RUNNING

_CONTINUES: Final = 128
"""The bit that is set in every byte of a number except the last byte."""
_HALF_FULL: Final = 15
"""The maximum value of half a byte. A number of at least this value continues in further bytes."""
_LONGEST: Final = 21
"""The maximum number of bytes that encode a place and the content of this place."""


class StateCode:
    """Encodes states as bytes, which contain only the differences from the initial state.

    A code begins with the outcome of the last tick and the state of the properties, encoded like numbers in Protocol
    Buffers, with seven bits in a byte. A byte for each changed place follows, which contains the distance from the
    previous changed place and the content. A number that does not fit into half a byte continues in further bytes.

    Args:
        cells: The initial contents of the cells with numbers, before any node has ended.
        values: The initial contents of the cells with other values.
        forgotten: For each node, whether states forget its last status, because it makes no difference between ticks.
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

    def write(
        self, outcome: int, watched: int, cells: vec[i32], values: list[Any], entries: vec[i32]
    ) -> bytes:
        """Encode a state.

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
        """Encode an intermediate state of a tick. The result is only compared, never decoded.

        Args:
            node: The next node.
            watched: The state of the properties.
            broken: The violated properties, as bits.
            shown: The nodes whose forgotten statuses matter at this point of the tick.
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
        """Enlarge the buffer if it is too small for a head of *bits* bits followed by *places* places."""
        most = bits + _LONGEST * (places + 3)
        if len(self._room) < most:
            self._room = vec[u8](bytes(most))

    def _write(self, at: i64, cells: vec[i32], values: list[Any], entries: vec[i32]) -> bytes:
        """Write all changed places after the head, and return the complete code."""
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
        """Decode the head of a code: return the outcome of the last tick and the state of the properties."""
        watched, shift, at = 0, 0, 1
        while True:
            byte = code[at]
            watched |= (byte & (_CONTINUES - 1)) << shift
            if byte < _CONTINUES:
                return code[0], watched
            shift += 7
            at += 1

    def read(self, code: bytes, values: list[Any], entries: vec[i32]) -> vec[i32]:
        """Decode a state, and return the contents of the cells with numbers.

        Args:
            code: The encoded state.
            values: The list to which the contents of the cells with other values are written.
            entries: The array of zeros to which the number of each entry's content is written.
        """
        cells, count, others = self._cells[:], len(self._cells), len(self._values)
        values[:] = self._values
        place: i64 = 0
        at, end = _skip_number(code, 1), len(code)
        while at < end:
            both: i64 = code[at]
            step, held = both >> 4, both & _HALF_FULL
            at += 1
            if step == _HALF_FULL:
                step, at = _read_rest(code, at)
            if held == _HALF_FULL:
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
    """Write a place: its distance from the previous place, and its content. Return the next index."""
    if step < _HALF_FULL and held < _HALF_FULL:
        code[at] = u8(step << 4 | held)
        return at + 1
    code[at] = u8(min(step, _HALF_FULL) << 4 | min(held, _HALF_FULL))
    at += 1
    if step >= _HALF_FULL:
        at = _write_number(code, at, step - _HALF_FULL)
    return _write_number(code, at, held - _HALF_FULL) if held >= _HALF_FULL else at


def _write_number(code: vec[u8], at: i64, number: int) -> i64:
    """Write a number at index *at*, and return the index of the byte after the number."""
    while number >= _CONTINUES:
        code[at] = u8(_CONTINUES | number & (_CONTINUES - 1))
        at += 1
        number >>= 7
    code[at] = u8(number)
    return at + 1


def _skip_number(code: bytes, at: i64) -> i64:
    """Return the index of the first byte that follows the number at index *at*."""
    while code[at] >= _CONTINUES:
        at += 1
    return at + 1


def _read_rest(code: bytes, at: i64) -> tuple[i64, i64]:
    """Read the rest of a number, which continues at *at*.

    Return the number and the index of the byte after it.
    """
    number: i64 = _HALF_FULL
    shift: i64 = 0
    while True:
        byte: i64 = code[at]
        at += 1
        number += (byte & (_CONTINUES - 1)) << shift
        if byte < _CONTINUES:
            return number, at
        shift += 7
