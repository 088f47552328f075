"""Values of entries that a search does not distinguish; `analysis.verify.slicing` determines them."""

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
        name: The key or the fact.
        above: Numbers that are larger by 1 or more are merged.
        below: Numbers that are smaller by 1 or more are merged.
        is_unread: Whether nothing reads it, so that only types matter.
        is_real: Whether neither it nor a key into which its values flow can hold an `int`.
        is_used: Whether the search has replaced a value.
    """

    name: str
    above: float
    below: float
    is_unread: bool
    is_real: bool
    is_used: bool = False
    _kept: dict[object, object] = field(default_factory=dict)

    @property
    def is_irrelevant(self) -> bool:
        """Whether nothing depends on it."""
        return self.is_unread or self.above == -math.inf

    def __call__(self, value: object) -> object:
        """Return the representative of a value: the first value of its kind."""
        kind = self._kind_of(value)
        kept = value if kind is None else self._kept.setdefault(kind, value)
        self.is_used = self.is_used or kept != value
        return kept

    def _kind_of(self, value: object) -> object:
        """Return the kind of a value, which determines its representative; None if it represents itself."""
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
        listed = ", and those ".join(text for bound, text in bounds if math.isfinite(bound))
        return f"{self.name} is only compared with constants: values {listed} are not distinguished."


def merging_notes(merged: Sequence[MergedValues]) -> Iterator[str]:
    """Yield notes on the values that a search has not distinguished, with the reasons."""
    irrelevant = [each.name for each in merged if each.is_irrelevant]
    if irrelevant:
        listed = " and ".join(filter(None, [", ".join(irrelevant[:-1]), irrelevant[-1]]))
        yield f"Values of {listed} are not distinguished: no condition, control or property depends on them."
    yield from (str(each) for each in merged if not each.is_irrelevant)


class ValueMerging:
    """Replaces written values by representatives, so that a search does not distinguish equivalent ones.

    The switch for this is an entry itself, so that it is part of each state, and of the remembered effects of
    scripts.

    Args:
        cells: The contents of entries.
        values: Returns the representative of a value, by the absolute names of entries.
    """

    def __init__(self, cells: EntryCells, values: Mapping[str, MergedValues]) -> None:
        self.values = values
        # All other names begin with a slash.
        self._switch = cells.place_of("values as they are")
        self._cells = cells

    def switch_off(self) -> None:
        """Stop merging in this state and in the following ones."""
        self._cells.set_content(self._switch, True)  # noqa: FBT003 - what an entry holds

    def add_switch(self, entries: Iterable[Entry]) -> list[int]:
        """Return the place of the switch for merging, on which code that uses some entries depends."""
        return [self._switch] if any(entry.name in self.values for entry in entries) else []

    def representative(self, name: str, value: object) -> object:
        """Return the value to store when a value is written to an entry."""
        return value if self._cells.now[self._switch] else self.values[name](value)
