"""Enumerates all combinations of the choices that are made in a tick."""

from sar_compiler.errors import UnsteadyError


class Choices:
    """Enumerates the combinations of choices in a tick.

    Each combination is like a number with a digit per choice.

    Each time the tick, or the rest of it, is played again, its nodes call `pick`. The calls return the options of the
    current combination. After the end of the combination they return the first option. This requires that the same
    options always lead to the same further choices, which `pick` checks.
    """

    def __init__(self) -> None:
        self._path: list[int] = []
        self._counts: list[int] = []
        self._asked = 0

    @property
    def path(self) -> tuple[int, ...]:
        """The options picked so far in this tick. Choices with only one option are left out."""
        return tuple(self._path[: self._asked])

    @property
    def choice_count(self) -> int:
        """The number of choices made so far in this tick. Choices with only one option are not counted."""
        return self._asked

    def begin(self, path: tuple[int, ...] = ()) -> None:
        """Start with the first of the combinations that begin with the options *path*."""
        self._path = list(path)
        self._counts = [0 for _ in path]
        self._asked = 0

    def pick(self, count: int) -> int:
        """Return the option to choose, as a number from 0 to *count* - 1.

        Raises:
            UnsteadyError: If there was a different number of options after the same earlier choices.
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
                "the runs cannot be searched, because the tree behaves differently in equal states. "
                "Some node has a hidden state, or behaves randomly"
            )
            raise UnsteadyError(message)
        return self._path[asked]

    def advance(self) -> int:
        """Advance to the next combination.

        Return the index of the changed choice, or -1 if there is no next one.
        """
        path, counts = self._path, self._counts
        # Nodes requested fewer choices than the combination has.
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

    def rewind(self, asked: int) -> None:
        """Go back to an earlier choice. *asked* is the number of choices before that choice."""
        self._asked = asked
