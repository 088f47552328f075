"""States as bytes."""

from typing import Any, Final

from sar_compiler.runtime.kernel.cells import INVALID, RUNNING

_MORE: Final = 128
"""Added to a byte of a number of which more follows."""


class StateCode:
    """Writes states as bytes: only what is not as it was at first, which is little where few nodes run.

    A number is written as in Protocol Buffers, seven bits a byte; a cell as how many cells behind the last one it stands,
    and what is in it. First come the outcome of the last tick and what the properties remember.

    Args:
        cells: The cells with numbers, at the start.
        values: The cells with other values, at the start.
        forgotten: For each node whether it makes no difference, while it does not run, if and how it has ended.
    """

    def __init__(self, cells: list[int], values: list[Any], forgotten: list[bool]) -> None:
        self._cells = list(cells)
        self._values = list(values)
        self._forgotten = forgotten
        self._numbers: dict[Any, int] = {}
        self._numbered: list[Any] = []

    @property
    def known(self) -> int:
        """How many other values have a number."""
        return len(self._numbered)

    def write(self, head: list[int], cells: list[int], values: list[Any], entries: list[int]) -> bytes:
        """Return a state as bytes.

        Args:
            head: The outcome of the last tick, and what the properties remember.
            cells: The cells with numbers.
            values: The cells with other values.
            entries: The number of what each entry holds.
        """
        code: list[int] = []
        for number in head:
            _append(code, number)
        last = self._write_cells(code, cells)
        count = len(cells)
        for place, value in enumerate(values):
            if value != self._values[place]:
                number = self._numbers.setdefault(value, len(self._numbered))
                if number == len(self._numbered):
                    self._numbered.append(value)
                _append_pair(code, count + place - last, number)
                last = count + place
        count += len(values)
        for place, held in enumerate(entries):
            if held:
                _append_pair(code, count + place - last, held)
                last = count + place
        return bytes(code)

    def _write_cells(self, code: list[int], cells: list[int]) -> int:
        """Write the cells with numbers; return the last one that was written."""
        last = index = 0
        forgotten, nodes = self._forgotten, len(self._forgotten)
        while index < nodes:
            held = cells[index]
            if held != INVALID and (held == RUNNING or not forgotten[index]):
                _append_pair(code, index - last, held + 1)
                last = index
            index += 1
        first_cells, count = self._cells, len(cells)
        while index < count:
            held = cells[index]
            if held != first_cells[index]:
                _append_pair(code, index - last, held + 1)
                last = index
            index += 1
        return last

    def head(self, code: bytes) -> list[int]:
        """Return the outcome of the last tick, and what the properties remember."""
        outcome, behind = _read(code, 0)
        return [outcome, _read(code, behind)[0]]

    def read(self, code: bytes, cells: list[int], values: list[Any]) -> list[int]:
        """Return the numbers of what the entries hold in a state, and make the cells what they were in it."""
        cells[:] = self._cells
        values[:] = self._values
        entries: list[int] = []
        count, others = len(self._cells), len(self._values)
        place = 0
        at = _read(code, _read(code, 0)[1])[1]
        while at < len(code):
            step, at = _read(code, at)
            held, at = _read(code, at)
            place += step
            if place < count:
                cells[place] = held - 1
            elif place < count + others:
                values[place - count] = self._numbered[held]
            else:
                entries.extend([0] * (place - count - others - len(entries)))
                entries.append(held)
        return entries


def _append_pair(code: list[int], step: int, held: int) -> None:
    if step < _MORE and held < _MORE:
        code.append(step)
        code.append(held)
    else:
        _append(code, step)
        _append(code, held)


def _append(code: list[int], number: int) -> None:
    while number >= _MORE:
        code.append(_MORE | number & (_MORE - 1))
        number >>= 7
    code.append(number)


def _read(code: bytes, at: int) -> tuple[int, int]:
    number, shift = 0, 0
    while True:
        byte = code[at]
        at += 1
        number |= (byte & (_MORE - 1)) << shift
        if byte < _MORE:
            return number, at
        shift += 7
