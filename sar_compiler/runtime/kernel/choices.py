"""The possible results of one tick: every combination of choices, one after another."""

from sar_compiler.errors import SarError


class UnsteadyError(SarError):
    """The same tick, played twice with the same choices, did not ask the same questions."""


class Choices:
    """Goes through the combinations of a tick in order, like the digits of a number.

    A tick cannot be forked in the middle, where leaves and timers choose: what has happened in it is on Python's
    stack. So it is restarted from the state before it, once for each combination. Each time it asks `pick` as it
    goes; the first answers are those of the combination in hand, and where that ends the first option is taken.
    Restarting is right only if the same choices lead to the same questions, which `pick` checks.
    """

    def __init__(self) -> None:
        self._path: list[int] = []
        self._counts: list[int] = []
        self._asked = 0

    @property
    def path(self) -> tuple[int, ...]:
        """The options picked so far in this tick; questions with one option are left out."""
        return tuple(self._path[: self._asked])

    def begin(self) -> None:
        """Begin with the first combination."""
        self._path.clear()
        self._counts.clear()
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

    def advance(self) -> bool:
        """Go to the next combination; return False if that was the last one."""
        path, counts = self._path, self._counts
        # What is left of a longer combination was not asked for this time.
        del path[self._asked :], counts[self._asked :]
        while path and path[-1] + 1 == counts[-1]:
            path.pop()
            counts.pop()
        if not path:
            return False
        path[-1] += 1
        self._asked = 0
        return True
