"""Contents of blackboard entries as small numbers, for states that are stored and compared by the million.

An entry has few different contents in all runs of a tree. Each gets a number at its first occurrence, so the state of all
entries is a list of numbers, and the effect of a script on some entries is cached by their numbers.
"""

from collections.abc import Callable, Hashable
from typing import Any, Final

from librt.vecs import append, vec
from mypy_extensions import i32, i64

NOTHING: Final = 0
"""The number of an entry that does not exist."""


class EntryCells:
    """The contents of entries.

    Attributes:
        now: The number of each entry's current content.
        names: The names of the entries.
        known: The number of known entries and contents.
        lent: The values that were read and can be changed in place, by the index of the entry.
        freeze: Function that returns the content of an entry, given its index and the value that was read.
    """

    def __init__(self) -> None:
        self.now: vec[i32] = vec[i32]()
        self.known = 0
        self.names: list[str] = []
        self.lent: dict[int, Any] = {}
        self.freeze: Callable[[int, Any], Hashable] | None = None
        self._nothing: vec[i32] = vec[i32]()
        self._places: dict[str, int] = {}
        self._contents: list[list[Any]] = []
        self._numbers: list[dict[Any, int]] = []

    def place_of(self, name: str) -> int:
        """Return the index of an entry, which is created if there is none."""
        place = self._places.get(name, -1)
        if place < 0:
            place = self._places[name] = len(self.names)
            self.names.append(name)
            self.known += 1
            self.now = append(self.now, NOTHING)
            self._nothing = append(self._nothing, NOTHING)
            self._contents.append([None])
            self._numbers.append({None: NOTHING})
        return place

    def content(self, place: int) -> Any:
        """Return the content of an entry; None if it does not exist."""
        return self._contents[place][self.now[place]]

    def set_content(self, place: int, content: Any) -> None:
        """Replace the content of an entry; None removes it."""
        numbers = self._numbers[place]
        number = numbers.get(content, -1)
        if number < 0:
            contents = self._contents[place]
            number = numbers[content] = len(contents)
            contents.append(content)
            self.known += 1
        self.now[place] = number

    def restore(self, now: vec[i32]) -> None:
        """Restore the state of all entries; those that were unknown then are removed."""
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
        """Update the contents of the entries whose values were read and may have been changed in place."""
        if self.lent:
            freeze = self.freeze
            assert freeze is not None  # noqa: S101 - set together with `lent`
            for place, value in self.lent.items():
                self.set_content(place, freeze(place, value))
            self.lent.clear()


_UNKNOWN: Final[Any] = object()
_FEW: Final = 1 << 10
"""The number of contents of a single entry that are stored in a list."""
_BITS: Final = 15
"""The bits for the number of a content, so that four of them fit into a machine word."""


class Memo:
    """A cache of the effects of code, by the contents of the entries that it uses.

    Args:
        cells: The contents of entries.
        places: The indices of all entries that it can read or write; it must have no other inputs or effects.
    """

    def __init__(self, cells: EntryCells, places: list[int]) -> None:
        self._cells = cells
        self._places = places
        self._known: dict[Any, Any] = {}
        self._changes: dict[Any, list[tuple[int, int]]] = {}
        self._only: i64 = places[0] if len(places) == 1 else -1
        self._answers: list[Any] = []

    def _key(self, now: vec[i32]) -> Any:
        """Return the contents of the entries as one number, or as several if one is large."""
        key = 0
        for place in self._places:
            number = now[place]
            if number >> _BITS:
                return tuple([now[place] for place in self._places])
            key = key << _BITS | int(number)
        return key

    def call(self, run: Callable[[], Any]) -> Any:
        """Return the result of the code, and apply its changes; errors are raised, and not cached."""
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
            # The code may have declared another entry.
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
    """A cache of the outcome of code without effects, by the content of the only entry that it reads.

    It needs a byte for each content of the entry: a tree may have a thousand conditions on one with a thousand contents.

    Args:
        cells: The contents of entries.
        place: The index of the entry.
    """

    def __init__(self, cells: EntryCells, place: int) -> None:
        self._cells = cells
        self._place = place
        self._known = bytearray()

    def call(self, run: Callable[[], int]) -> int:
        """Return the result of the code, a number of `cells` other than INVALID."""
        number = self._cells.now[self._place]
        known = self._known
        if number >= len(known):
            known.extend(bytes(number + 1 - len(known)))
        if not known[number]:
            known[number] = run()
        return known[number]
