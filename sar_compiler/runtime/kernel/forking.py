"""Ticks that go on in every possible way."""

from typing import Any, Final

from sar_compiler.runtime.kernel.cells import CALLED
from sar_compiler.runtime.kernel.choices import Choices
from sar_compiler.runtime.kernel.entry_cells import EntryCells
from sar_compiler.runtime.kernel.foreign_nodes import ForeignObjects
from sar_compiler.runtime.kernel.state_code import StateCode
from sar_compiler.runtime.kernel.times import Times
from sar_compiler.runtime.kernel.trail import Trail
from sar_compiler.runtime.kernel.tree_nodes import Ticker, TreeNode

KNOWN: Final = 6
"""In place of an outcome: the tick has come to where another one was before, and everything behind that is known."""
FEW: Final = 16
"""Where no more ticks than these begin in a state, it is not worth while to see whether they meet."""


class KnownTickError(BaseException):
    """A tick in the middle of a user's own methods has come to where another one was before. Nobody else is to catch it."""


class Fork:
    """A tick just before a node may go on in several ways.

    Args:
        ticker: What ticks the nodes.
        node: The node that is next.
        waiting: The nodes around it.
    """

    def __init__(self, ticker: "ForkingTicker", node: TreeNode, waiting: list[TreeNode]) -> None:
        trail = ticker.trail
        self.node = node
        self.waiting = waiting[:]
        self.cells = ticker.cells[:]
        self.values = ticker.values[:]
        self.entries = ticker.entries.now[:]
        self.asked = ticker.choices.asked
        self.happened = len(trail.numbers)
        self.going_on, self.changed = trail.going_on, trail.changed
        self.watched, self.broken = trail.watched, trail.broken

    def restore(self, ticker: "ForkingTicker") -> None:
        """Make the tick what it was."""
        trail = ticker.trail
        ticker.cells = self.cells[:]
        ticker.values = self.values[:]
        ticker.entries.restore(self.entries)
        ticker.choices.go_back(self.asked)
        del trail.numbers[self.happened :]
        trail.going_on, trail.changed = self.going_on, self.changed
        trail.watched, trail.broken = self.watched, self.broken


class ForkingTicker(Ticker):
    """Plays every possible tick of a state: each one begins where the one before it has chosen last.

    What ticks without a fork, because it chooses where that was not to be expected, is played again from the fork before.

    Args:
        cells: The cells with numbers.
        values: The cells with other values.
        times: The timers.
        entries: What the entries of the blackboard hold.
        choices: What is chosen.
        trail: What happens.
        few: After how many ticks of a state it begins to see whether they meet.
        objects: The behaviours that are ticked by their own methods.
    """

    def __init__(
        self,
        cells: list[int],
        values: list[Any],
        times: Times,
        entries: EntryCells,
        choices: Choices,
        trail: Trail,
        few: int = FEW,
        objects: ForeignObjects | None = None,
    ) -> None:
        super().__init__(cells, values, times)
        self._objects = objects
        self.tells = False
        self.entries = entries
        self.choices = choices
        self.trail = trail
        self._few = few
        # In the middle of a tick how a node has ended counts: its parent may be about to look.
        self._code = self._whole_code = StateCode(cells, values, [])
        self._forks: list[Fork] = []
        self._ticks = 0
        self._seen: set[tuple[Any, ...]] = set()

    def forget(self, forgotten: list[bool]) -> None:
        """Take for each node whether it makes no difference, while it does not run, if and how it has ended.

        In the middle of a tick it makes one for the children of the nodes that are ticked: those may be about to look.
        """
        self._code = StateCode(self.cells, self.values, forgotten)

    def begin(self, root: TreeNode, watched: int) -> None:
        """Begin with the first tick of the state that the cells and entries have.

        Args:
            root: What is ticked.
            watched: What the properties remember.
        """
        self.choices.begin()
        self.trail.begin(watched)
        self._ticks = 0
        self._seen.clear()
        self._forks = [Fork(self, root, [])]

    def play(self) -> int:
        """Tick from the last fork on; return the outcome, or KNOWN."""
        try:
            return self._play()
        except KnownTickError:
            return KNOWN

    def run(self, node: TreeNode) -> int:
        """Tick a node that a user's own methods call; return the outcome.

        Raises:
            KnownTickError: If the tick has come to where another one was before.
        """
        waiting: list[TreeNode] = []
        while True:
            if self.choices.is_new and node.ways(self) > 1 and self._is_known_inside(node):
                raise KnownTickError
            outcome = node.begin(self)
            while outcome != CALLED:
                if not waiting:
                    return outcome
                node = waiting.pop()
                outcome = node.resume(self, outcome)
            waiting.append(node)
            called = self.called
            assert called is not None  # noqa: S101 - CALLED says so
            node = called

    def _play(self) -> int:
        fork = self._forks[-1]
        node, waiting = fork.node, fork.waiting[:]
        is_new = False
        self._ticks += 1
        if self._objects is not None:
            self._objects.begin_play(is_merging=self._ticks > self._few)
        while True:
            if is_new and node.ways(self) > 1:
                if self._is_known(node, waiting):
                    return KNOWN
                self._forks.append(Fork(self, node, waiting))
            is_new = True
            outcome = node.begin(self)
            while outcome != CALLED:
                if not waiting:
                    return outcome
                node = waiting.pop()
                outcome = node.resume(self, outcome)
            waiting.append(node)
            called = self.called
            assert called is not None  # noqa: S101 - CALLED says so
            node = called

    def advance(self) -> bool:
        """Go back to the last fork with another way to go on; return False if there is none."""
        choice = self.choices.advance()
        if choice < 0:
            return False
        forks = self._forks
        while forks[-1].asked > choice:
            forks.pop()
        forks[-1].restore(self)
        return True

    def _is_known_inside(self, node: TreeNode) -> bool:
        """Return whether a tick was here before, in the middle of a user's own methods."""
        if self._ticks <= self._few:
            return False
        inside = None if self._objects is None else self._objects.now()
        # Who waits around the user's methods is not known here, so how nodes have ended always makes a difference.
        return inside is not None and self._was_at(node, self._whole_code, [], inside)

    def _is_known(self, node: TreeNode, waiting: list[TreeNode]) -> bool:
        """Return whether a tick was here before, with nothing behind it that makes a difference."""
        if self._ticks <= self._few:
            return False
        cells = self.cells
        ended = [cells[child.at] for around in waiting for child in around.children]
        return self._was_at(node, self._code, ended, None)

    def _was_at(self, node: TreeNode, code: StateCode, ended: list[int], inside: Any) -> bool:
        trail = self.trail
        self.entries.settle()
        head = [node.index, trail.watched, trail.broken, *ended]
        state = code.written(head, self.cells, self.values, self.entries.now)
        place = (node.index, state, trail.going_on, trail.changed, inside)
        if place in self._seen:
            return True
        self._seen.add(place)
        return False
