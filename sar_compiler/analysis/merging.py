"""Merges values that a search need not distinguish.

`analysis.verify.slicing` determines these values.
"""

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field

from sar_compiler.runtime.blackboard import Entry
from sar_compiler.runtime.kernel.entry_cells import EntryCells

_LARGEST = 2.0**50
_PLAIN = (bool, int, float, str)


@dataclass(eq=False)
class MergedValues:
    """The values of a key or fact that a search does not distinguish.

    Attributes:
        name: The name of the key or fact.
        above: The largest compared number. Numbers that exceed it by 1 or more are merged.
        below: The smallest compared number. Numbers that are smaller by 1 or more are merged.
        is_unread: Whether no condition, control or property reads the values, so that only types are distinguished.
        is_real: Whether neither the key nor any key that receives its values can hold an `int`.
        is_used: Whether the search has replaced a value.
    """

    name: str
    above: float
    below: float
    is_unread: bool
    is_real: bool
    is_used: bool = False
    _representatives: dict[object, object] = field(default_factory=dict)

    @property
    def is_irrelevant(self) -> bool:
        """Whether the values affect no condition, control or property."""
        return self.is_unread or self.above == -math.inf

    def __call__(self, value: object) -> object:
        """Return the representative of a value: the first value that belongs to the same class."""
        kind = self._kind_of(value)
        representative = value if kind is None else self._representatives.setdefault(kind, value)
        self.is_used = self.is_used or representative != value
        return representative

    def _kind_of(self, value: object) -> object:
        """Return the class of equivalent values to which a value belongs, or None if the value is not merged."""
        kind = type(value)
        if self.is_unread and kind in _PLAIN:
            return kind
        if not isinstance(value, (int, float)) or kind is bool or not abs(value) <= _LARGEST:
            return None
        if not self.is_real and value != math.floor(value):
            return None
        if self.is_irrelevant or value >= self.above + 1:
            return kind
        return (kind, "below") if value <= self.below - 1 else None

    def __str__(self) -> str:
        bounds = [
            (self.above, f"of {self.above + 1:g} and more"),
            (self.below, f"of {self.below - 1:g} and less"),
        ]
        listed = ", and values ".join(text for bound, text in bounds if math.isfinite(bound))
        return f"{self.name} is only compared with constants, so values {listed} are not distinguished."


def merging_notes(merged: Sequence[MergedValues]) -> Iterator[str]:
    """Yield a note for each group of values that a search did not distinguish. The note states the reason."""
    irrelevant = [each.name for each in merged if each.is_irrelevant]
    if irrelevant:
        listed = " and ".join(filter(None, [", ".join(irrelevant[:-1]), irrelevant[-1]]))
        yield f"Values of {listed} are not distinguished, because no condition, control or property depends on these values."
    yield from (str(each) for each in merged if not each.is_irrelevant)


class ValueMerging:
    """Replaces written values by representatives, so that a search does not distinguish equivalent values.

    A blackboard entry switches merging on and off, so that the switch is part of each state and of the cached
    effects of scripts.

    Args:
        cells: The contents of entries.
        values: The merged values, by the absolute name of the entry.
    """

    def __init__(self, cells: EntryCells, values: Mapping[str, MergedValues]) -> None:
        self.values = values
        # All other names begin with a slash.
        self._switch = cells.place_of("values as they are")
        self._cells = cells

    def switch_off(self) -> None:
        """Stop merging in the current state and in the states that follow it."""
        self._cells.set_content(self._switch, True)  # noqa: FBT003 - the value of an entry

    def add_switch(self, entries: Iterable[Entry]) -> list[int]:
        """Return a list with the cell of the merging switch, or an empty list if no entry is merged."""
        return [self._switch] if any(entry.name in self.values for entry in entries) else []

    def representative(self, name: str, value: object) -> object:
        """Return the value to store in an entry when a value is written."""
        return value if self._cells.now[self._switch] else self.values[name](value)
