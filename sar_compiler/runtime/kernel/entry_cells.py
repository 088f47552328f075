"""Represent the contents of blackboard entries by numbers, so that millions of states can be compared.

An entry has only a few different contents in all runs of a tree. Each content gets a number when it first occurs. So the
state of all entries is a list of numbers, and the effects of a script are cached by these numbers.
"""

from collections.abc import Callable, Hashable
from typing import Any, Final

from librt.vecs import append, vec
from mypy_extensions import i32, i64

NOTHING: Final = 0
"""The content number of a blackboard entry that does not exist."""


class EntryCells:
    """The contents of all blackboard entries.

    Attributes:
        now: The number of each entry's current content, by the entry's index.
        names: The names of the entries, by index.
        lent: By entry index, the values that were read and can be changed in place.
        freeze: Function that converts a value read from an entry to the entry's content; the first argument is the entry's index.
    """

    def __init__(self) -> None:
        self.now: vec[i32] = vec[i32]()
        self.names: list[str] = []
        self.lent: dict[int, Any] = {}
        self.freeze: Callable[[int, Any], Hashable] | None = None
        self._nothing: vec[i32] = vec[i32]()
        self._places: dict[str, int] = {}
        self._contents: list[list[Any]] = []
        self._numbers: list[dict[Any, int]] = []

    def place_of(self, name: str) -> int:
        """Return the index of the entry with a name. A new name gets the next free index."""
        place = self._places.get(name, -1)
        if place < 0:
            place = self._places[name] = len(self.names)
            self.names.append(name)
            self.now = append(self.now, NOTHING)
            self._nothing = append(self._nothing, NOTHING)
            self._contents.append([None])
            self._numbers.append({None: NOTHING})
        return place

    def content(self, place: int) -> Any:
        """Return the content of an entry, or None if the entry does not exist."""
        return self._contents[place][self.now[place]]

    def set_content(self, place: int, content: Any) -> None:
        """Replace the content of an entry; None removes the entry."""
        numbers = self._numbers[place]
        number = numbers.get(content, -1)
        if number < 0:
            contents = self._contents[place]
            number = numbers[content] = len(contents)
            contents.append(content)
        self.now[place] = number

    def restore(self, now: vec[i32]) -> None:
        """Restore an earlier state of all entries. An entry created after that state is removed."""
        self.lent.clear()
        entries = now[:]
        while len(entries) < len(self._nothing):
            entries = append(entries, NOTHING)
        self.now = entries

    def clear(self) -> None:
        """Remove all entries."""
        self.lent.clear()
        self.now = self._nothing[:]

    def update_contents(self) -> None:
        """Update the content of each entry whose value was read, because other code may have changed this value."""
        if self.lent:
            freeze = self.freeze
            assert freeze is not None  # noqa: S101 - set together with `lent`
            for place, value in self.lent.items():
                self.set_content(place, freeze(place, value))
            self.lent.clear()


_UNKNOWN: Final[Any] = object()
_FEW: Final = 1 << 10
"""For code that uses only one entry, the results for content numbers below this limit are stored in a list."""
_BITS: Final = 15
"""The number of bits that each content number has in a cache key. Four such numbers fit into a machine word."""


class Memo:
    """A cache of the results and effects of code. The contents of the entries used by the code are the cache key.

    Args:
        cells: The contents of all entries.
        places: The indices of all entries that the code can read or write. The code must have no other inputs or effects.
    """

    def __init__(self, cells: EntryCells, places: list[int]) -> None:
        self._cells = cells
        self._places = places
        self._known: dict[Any, Any] = {}
        self._changes: dict[Any, list[tuple[int, int]]] = {}
        self._only: i64 = places[0] if len(places) == 1 else -1
        self._answers: list[Any] = []

    def _key(self, now: vec[i32]) -> Any:
        """Return the cache key: the content numbers, combined into one number if all of them are small."""
        key = 0
        for place in self._places:
            number = now[place]
            if number >> _BITS:
                return tuple([now[place] for place in self._places])
            key = key << _BITS | int(number)
        return key

    def call(self, run: Callable[[], Any]) -> Any:
        """Run the code, or apply its cached result and effects. Errors are raised, but not cached."""
        only, answers = self._only, self._answers
        number = int(self._cells.now[only]) if only >= 0 else _FEW
        if number >= len(answers) or answers[number] is _UNKNOWN:
            answer = self._call(run)
            if number < _FEW:
                answers.extend([_UNKNOWN] * (number + 1 - len(answers)))
                answers[number] = answer
            return answer
        if self._changes:
            self._change(number)
        return answers[number]

    def _change(self, key: Any) -> None:
        now = self._cells.now
        for place, number in self._changes.get(key, ()):
            now[place] = number

    def _call(self, run: Callable[[], Any]) -> Any:
        now = self._cells.now
        key: Any = self._key(now)
        answer = self._known.get(key, _UNKNOWN)
        if answer is _UNKNOWN:
            before = [now[place] for place in self._places]
            answer = self._known[key] = run()
            # The vector may be a new one, because the code may have declared another entry.
            now = self._cells.now
            changes = [
                (place, now[place]) for index, place in enumerate(self._places) if now[place] != before[index]
            ]
            if changes:
                self._changes[key] = changes
        elif self._changes:
            self._change(key)
        return answer


class OutcomeMemo:
    """A cache for the outcomes of code that reads only one blackboard entry and has no effects.

    A tree may have a thousand conditions on an entry with a thousand contents, so the cache needs only one byte for each content.

    Args:
        cells: The contents of all entries.
        place: The index of the entry.
    """

    def __init__(self, cells: EntryCells, place: int) -> None:
        self._cells = cells
        self._place = place
        self._known = bytearray()

    def call(self, run: Callable[[], int]) -> int:
        """Return the outcome of the code, as a number of `kernel.cells`. The code must not return INVALID."""
        number = self._cells.now[self._place]
        known = self._known
        if number >= len(known):
            known.extend(bytes(number + 1 - len(known)))
        if not known[number]:
            known[number] = run()
        return known[number]
