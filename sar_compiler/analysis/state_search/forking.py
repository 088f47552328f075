"""Ticks that go on in every possible way.

A leaf that is ticked may answer several things, and a timer be up or not. A tick in which k nodes choose among n ways each is n^k ticks;
played from their beginnings, each of them would tick the nodes before the last choice once more. So a tick is put aside just before a
node that may go on in several ways (a `Fork`), and the next one begins there: nothing but what is different is played.

Why before the node. It has done nothing yet, so there is nothing to undo: a fork is a copy of the lists that a tree consists of (cells, values,
entries, the nodes that wait) and of what the tick has noted, and to go back is to copy them again. A node is never in the middle of its own
`begin` or `resume`, because those return between two children; that is why nodes are no functions that call each other.

Why ticks may meet. Two ticks that come to the same node with the same cells, values and entries go on alike, whatever led there, and from whatever
state; so only the first is played on. Such a place is a *middle*, and what is played from there on belongs to it, not to the state in which the tick has
begun: k branches that each go on in n ways are k times n steps and not n^k ticks. These belong to what must be the same:

- the node, and with it the nodes that wait, since a node has one parent;
- what the children of these have come to, even where a *state* forgets it: between two ticks nobody looks at how a child has ended, but in the
  middle of one its parent may be about to;
- what the properties remember and whether one is broken, for the events before the meeting are behind it.

Which leaves and timers go on being waited for does not: what a part of a tick does to that is noted with the part (`Trail.waits`), and fairness is asked of
whole ticks, which are put together of parts (`liveness`).

What has *happened* does not belong to it either. Two ticks that meet may have had different events, and only those of the first are seen to the end. The graph
keeps none, so the search loses nothing. Where a tick is played again to be told, those of its state meet as well, but only where they also wait for the same;
whoever asks for all events, as a counterfactual does, has them never meet.

Why a middle is known when it is left, and not when it is come to. A tick never comes to the same place twice, or it would not end; so nobody asks in between.
But the next tick may ask at once: so what was left has its number before that is played (`searching.LEFT`), or it would be played, and numbered, twice.

Why a choice that nobody foresaw is no mistake. `ways` may say 1, and the node asks `Choices` all the same. Then there is no fork at that choice, and the next
combination is played from the last fork before it: slower, and as right, provided that the same choices lead to the same questions. `Choices.pick` sees
to that, since a node that keeps a state of its own would break it.
"""

from typing import Final

from sar_compiler.analysis.state_search.choices import Choices
from sar_compiler.analysis.state_search.numbering import Middles
from sar_compiler.analysis.state_search.state_code import StateCode
from sar_compiler.analysis.state_search.trail import Trail, Waits
from sar_compiler.runtime.kernel.cells import CALLED
from sar_compiler.runtime.kernel.entry_cells import EntryCells
from sar_compiler.runtime.kernel.tree_nodes import Ticker, TreeNode

KNOWN: Final = 6
"""In place of an outcome: the tick has come to where another one was before, and everything behind that is known."""
ENTERED: Final = 7
"""In place of an outcome: the tick has come to a middle where none was before, and goes on there."""


class Fork:
    """A tick just before a node may go on in several ways.

    Args:
        ticker: What ticks the nodes.
        node: The node that is next; those around it wait.
        is_middle: Whether it is a middle of ticks.
    """

    def __init__(self, ticker: "ForkingTicker", node: TreeNode, *, is_middle: bool) -> None:
        trail = ticker.trail
        self.is_middle = is_middle
        self.node = node
        self.cells = ticker.cells[:]
        self.values = ticker.values[:]
        self.entries = ticker.entries.now[:]
        self.asked = ticker.choices.asked
        self.happened = len(trail.numbers)
        self.going_on, self.changed, self.settled = trail.waits
        self.watched, self.broken = trail.watched, trail.broken

    def restore(self, ticker: "ForkingTicker") -> None:
        """Make the tick what it was."""
        trail = ticker.trail
        ticker.cells = self.cells[:]
        ticker.values = self.values[:]
        ticker.entries.restore(self.entries)
        ticker.choices.go_back(self.asked)
        trail.go_back(self.happened)
        trail.going_on, trail.changed, trail.settled = self.going_on, self.changed, self.settled
        trail.watched, trail.broken = self.watched, self.broken


class ForkingTicker(Ticker):
    """Plays every possible tick of a state: each one begins where the one before it has chosen last.

    What ticks without a fork, because it chooses where that was not to be expected, is played again from the fork before.

    Args:
        first: What ticks the same tree, and has not yet; its cells and timers are taken.
        entries: What the entries of the blackboard hold.
        choices: What is chosen.
        trail: What happens.
        meets: Whether ticks that come to the same place are one from there on.

    Attributes:
        middles: The middles that ticks have been to, by what they are; None where those of a state are played on their own.
        middle: The middle that a tick has come to last.
        waits: What the part of the tick up to there, or to its end, does to what is waited for.
    """

    def __init__(
        self, first: Ticker, entries: EntryCells, choices: Choices, trail: Trail, *, meets: bool
    ) -> None:
        super().__init__(first.cells, first.values, first.times)
        self.tells = False
        self.entries = entries
        self.choices = choices
        self.trail = trail
        self.middles: Middles | None = None
        self.middle = b""
        self.waits: Waits = (0, 0, 0)
        self._meets = meets
        # In the middle of a tick how a node has ended counts: its parent may be about to look.
        self._code = StateCode(self.cells, self.values, [])
        self._forks: list[Fork] = []
        self._seen: set[tuple[bytes, Waits]] = set()
        self._forgotten: list[bool] = []
        self._none: list[int] = []
        # By the node around the next one: whose ends may be looked at in the middle of a tick, although they are forgotten.
        self._shown: dict[int, list[int]] = {}

    def forget(self, forgotten: list[bool]) -> None:
        """Take for each node whether it makes no difference, while it does not run, if and how it has ended.

        In the middle of a tick it makes one for the children of the nodes that are ticked: those may be about to look.
        """
        self._code = StateCode(self.cells, self.values, forgotten)
        self._forgotten = forgotten

    def begin(self, root: TreeNode, watched: int, path: tuple[int, ...] = ()) -> None:
        """Begin with the first tick of the state that the cells and entries have.

        Args:
            root: What is ticked.
            watched: What the properties remember.
            path: The choices with which the tick begins.
        """
        self.choices.begin(path)
        self.trail.begin(watched)
        self._seen.clear()
        self._forks = [Fork(self, root, is_middle=False)]

    def play(self) -> int:
        """Tick from the last fork on; return the outcome, KNOWN or ENTERED."""
        node = self._forks[-1].node
        is_new = False
        while True:
            if is_new and node.ways(self) > 1:
                met = self._meet(node) if self._meets else CALLED
                if met != CALLED:
                    return met
                self._forks.append(Fork(self, node, is_middle=False))
            is_new = True
            outcome = node.begin(self)
            while outcome != CALLED:
                around = node.around
                if around is None:
                    self.waits = self.trail.waits
                    return outcome
                node = around
                outcome = node.resume(self, outcome)
            called = self.called
            assert called is not None  # noqa: S101 - CALLED says so
            node = called

    def advance(self) -> int:
        """Go back to the last fork with another way to go on; return how many middles are left by that, -1 if there is no such fork."""
        choice = self.choices.advance()
        if choice < 0:
            return -1
        forks, left = self._forks, 0
        while forks[-1].asked > choice:
            left += forks.pop().is_middle
        forks[-1].restore(self)
        return left

    def _meet(self, node: TreeNode) -> int:
        """Return KNOWN if a tick was here before, with nothing behind it that makes a difference; else ENTERED in a middle, or CALLED."""
        trail, entries = self.trail, self.entries
        entries.settle()
        shown = self._shown_at(node) if self._forgotten else self._none
        middle = self._code.write_middle(
            node.index, trail.watched, trail.broken, shown, self.cells, self.values, entries.now
        )
        if self.middles is not None:
            self.middle, self.waits = middle, trail.waits
            if self.middles.find(middle) >= 0:
                return KNOWN
            trail.begin_part()
            self._forks.append(Fork(self, node, is_middle=True))
            return ENTERED
        place = middle, (trail.going_on, trail.changed, 0)
        if place in self._seen:
            return KNOWN
        self._seen.add(place)
        return CALLED

    def _shown_at(self, node: TreeNode) -> list[int]:
        """Return the forgotten nodes of which it makes a difference how they have ended while a node is next."""
        around = node.around
        if around is None:
            return []
        shown = self._shown.get(around.index)
        if shown is None:
            own = [child.at for child in around.children if self._forgotten[child.at]]
            shown = self._shown[around.index] = own + self._shown_at(around)
        return shown
