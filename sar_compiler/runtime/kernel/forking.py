"""Ticks that go on in every possible way."""

from typing import Any, Final

from sar_compiler.runtime.kernel.cells import CALLED
from sar_compiler.runtime.kernel.choices import Choices
from sar_compiler.runtime.kernel.entry_cells import EntryCells
from sar_compiler.runtime.kernel.state_code import StateCode
from sar_compiler.runtime.kernel.times import Times
from sar_compiler.runtime.kernel.trail import Trail
from sar_compiler.runtime.kernel.tree_nodes import Ticker, TreeNode

KNOWN: Final = 6
"""In place of an outcome: the tick has come to where another one was before, and everything behind that is known."""
FEW: Final = 16
"""Where no more ticks than these begin in a state, it is not worth while to see whether they meet."""


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
    ) -> None:
        super().__init__(cells, values, times)
        self.tells = False
        self.entries = entries
        self.choices = choices
        self.trail = trail
        self._few = few
        # In the middle of a tick how a node has ended counts: its parent may be about to look.
        self._code = StateCode(cells, values, [])
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
        fork = self._forks[-1]
        node, waiting = fork.node, fork.waiting[:]
        is_new = False
        self._ticks += 1
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

    def _is_known(self, node: TreeNode, waiting: list[TreeNode]) -> bool:
        """Return whether a tick was here before, with nothing behind it that makes a difference."""
        if self._ticks <= self._few:
            return False
        cells = self.cells
        ended = [cells[child.at] for around in waiting for child in around.children]
        trail = self.trail
        self.entries.settle()
        head = [node.index, trail.watched, trail.broken, *ended]
        state = self._code.written(head, cells, self.values, self.entries.now)
        place = (node.index, state, trail.going_on, trail.changed)
        if place in self._seen:
            return True
        self._seen.add(place)
        return False
