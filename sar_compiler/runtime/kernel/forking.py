"""Ticks that go on in every possible way.

A leaf that is ticked may answer several things, and a timer be up or not. A tick in which k nodes choose among n ways each is n^k ticks;
played from their beginnings, each of them would tick the nodes before the last choice once more. So a tick is put aside just before a
node that may go on in several ways (a `Fork`), and the next one begins there: nothing but what is different is played.

Why before the node. It has done nothing yet, so there is nothing to undo: a fork is a copy of the lists that a tree consists of (cells, values,
entries, the nodes that wait) and of what the tick has noted, and to go back is to copy them again. A node is never in the middle of its own
`begin` or `resume`, because those return between two children; that is why nodes are no functions that call each other.

Why ticks may meet. Two ticks of one state that come to the same node with the same cells, values and entries go on alike, whatever led there; so only
the first is played on. These belong to what must be the same:

- the node, and with it the nodes that wait, since a node has one parent;
- what the children of these have come to, even where a *state* forgets it: between two ticks nobody looks at how a child has ended, but in the
  middle of one its parent may be about to;
- what the properties remember and whether one is broken, for the events before the meeting are behind it;
- which leaves and timers go on being waited for: that belongs to the edge of the graph, and fairness is asked of edges (`liveness`).

What has *happened* does not belong to it. Two ticks that meet may have had different events, and only those of the first are seen to the end. The graph
keeps none, so the search loses nothing; whoever asks for events, as a counterfactual does, has `few` so high that ticks never meet.

Why the first ticks of a state are not looked at. To write down where a tick is takes as long as some nodes do, and most states have few ticks.

Why a choice that nobody foresaw is no mistake. `ways` may say 1, and the node asks `Choices` all the same. Then there is no fork at that choice, and the next
combination is played from the last fork before it: slower, and as right, provided that the same choices lead to the same questions. `Choices.pick` sees
to that, since a node that keeps a state of its own would break it.
"""

from typing import Any, Final

from librt.vecs import vec
from mypy_extensions import i32

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
        trail.go_back(self.happened)
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
        cells: vec[i32],
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
        state = self._code.write(head, cells, self.values, self.entries.now)
        place = (node.index, state, trail.going_on, trail.changed)
        if place in self._seen:
            return True
        self._seen.add(place)
        return False
