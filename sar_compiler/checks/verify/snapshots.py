"""Boards as numbers: each content that a board has had is kept once."""

from sar_compiler.runtime.blackboard import Board, Snapshot


class Snapshots:
    """Numbers the contents of a board.

    Args:
        board: The board.
    """

    def __init__(self, board: Board) -> None:
        self._board = board
        self._numbers: dict[Snapshot, int] = {}
        self._snapshots: list[Snapshot] = []
        self._last: Snapshot | None = None
        self._number = 0

    def take(self) -> int:
        """Return the number of the entries as they are now."""
        taken = self._board.snapshot()
        # A board without changes gives the same snapshot again, which need not be looked for.
        if taken is not self._last:
            self._number = self._numbers.setdefault(taken, len(self._snapshots))
            if self._number == len(self._snapshots):
                self._snapshots.append(taken)
            self._last = taken
        return self._number

    def restore(self, number: int) -> None:
        """Make all entries as they were."""
        self._board.restore(self._snapshots[number])
        self._last, self._number = self._snapshots[number], number
