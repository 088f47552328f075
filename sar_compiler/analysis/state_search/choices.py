"""The possible results of one tick: every combination of choices, one after another."""

from sar_compiler.errors import UnsteadyError


class Choices:
    """Goes through the combinations of a tick in order, like the digits of a number.

    Each time the tick, or the rest of it, is played again, it asks `pick` as it goes; the first answers are those of the
    combination in hand, and where that ends the first option is taken. That is right only if the same choices lead to
    the same questions, which `pick` checks.
    """

    def __init__(self) -> None:
        self._path: list[int] = []
        self._counts: list[int] = []
        self._asked = 0

    @property
    def path(self) -> tuple[int, ...]:
        """The options picked so far in this tick; questions with one option are left out."""
        return tuple(self._path[: self._asked])

    @property
    def asked(self) -> int:
        """How many choices there were so far in this tick."""
        return self._asked

    def begin(self, path: tuple[int, ...] = ()) -> None:
        """Begin with the first combination; with *path* the first one that begins with these options."""
        self._path = list(path)
        self._counts = [0 for _ in path]
        self._asked = 0

    def pick(self, count: int) -> int:
        """Return the option to take, from 0 to *count* - 1.

        Raises:
            UnsteadyError: If another number of options was there when the same choices were made before.
        """
        if count == 1:
            return 0
        asked = self._asked
        self._asked = asked + 1
        if asked == len(self._path):
            self._path.append(0)
            self._counts.append(count)
            return 0
        known = self._counts[asked]
        if known and known != count:
            message = (
                "the tree does not do the same in the same state: something in it keeps a state of its own, "
                "or is left to chance, so its runs cannot be gone through"
            )
            raise UnsteadyError(message)
        return self._path[asked]

    def advance(self) -> int:
        """Go to the next combination; return the index of the choice that is another one, -1 if there is none left."""
        path, counts = self._path, self._counts
        # What is left of a longer combination was not asked for this time.
        while len(path) > self._asked:
            path.pop()
            counts.pop()
        while path and path[-1] + 1 == counts[-1]:
            path.pop()
            counts.pop()
        if not path:
            return -1
        path[-1] += 1
        self._asked = 0
        return len(path) - 1

    def go_back(self, asked: int) -> None:
        """Go back to where so many choices had been asked for; the next one is one of those that follow."""
        self._asked = asked
