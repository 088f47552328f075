"""Plays all possible ticks of a state. Parts that several ticks have in common are played only once.

A ticked leaf may have several outcomes, and a timer may have expired or not. If k nodes of a tick choose among n
options each, there are n^k ticks. If each were played from its beginning, the nodes before the last choice would be
ticked again and again. So a tick is saved just before a node that may continue in several ways (a `Fork`). The next
tick starts there, and only the difference is played.

Why a fork is before the node: the node has done nothing yet, so there is nothing to undo. A fork is a copy of the lists
that make up a tree (cells, values, entries, the waiting nodes) and of the records of the tick, and restoring a fork
copies them back. A node is never in the middle of its own `begin` or `resume`, because these return between two
children. For this reason, nodes are not functions that call each other.

Why ticks may merge: two ticks that reach the same node with the same cells, values and entries continue in the same
way, whatever happened before and whatever their initial states are. So only the first of them is continued. Such a
place is an *intermediate state* (`middle` in the code), and the rest of the tick belongs to the intermediate state, not
to the tick's initial state. So k branches that each continue in n ways are k times n steps and not n^k ticks. The
following must be equal:

- the node, and with it the waiting nodes, since a node has only one parent;
- the statuses of the children of these nodes, even if a *state* forgets them: between two ticks no node reads how a
  child has ended, but in the middle of a tick the child's parent may be about to read it;
- the state of the properties and their violations, because the events before the merge are not seen again.

The leaves and timers for which the tree still waits may differ. The effect of a part of a tick on the waits is stored
with the part (`Trail.waits`), and fairness is decided for whole ticks, which are composed of parts (`liveness`).

The *events* may differ as well. Two ticks that merge may have had different events, and only the first of them is
continued to the end. The graph stores no events, so the search loses nothing. When a tick is played again for a
report, ticks of its state also merge, but only if they wait for the same leaves and timers. A caller that needs all
events, such as the counterfactual search, switches merging off.

Why an intermediate state is registered when it is left, and not when it is reached: a tick never reaches the same
place twice, or it would not end, so no tick looks it up in between. But the next tick may look it up immediately. So
it gets its number before that tick is played (`searching.LEFT`). Otherwise it would be played and numbered twice.

Why an unforeseen choice is not an error: `branch_count` may return 1 although the node calls `Choices`. Then there is
no fork at that choice, and the next combination is played from the fork before it. That is slower but equally right,
provided that the same options lead to the same further choices. `Choices.pick` checks this, since a node with a hidden
state would violate it.
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
"""A value returned instead of an outcome if the tick has reached a place that another tick has reached before."""
ENTERED: Final = 7
"""A value returned instead of an outcome if the tick has reached a new intermediate state, where it continues."""


class Fork:
    """A snapshot of a tick just before a node that may continue in several ways.

    Args:
        ticker: Ticks the nodes.
        node: The next node, whose ancestors are waiting.
        is_middle: Whether the fork is at an intermediate state.
    """

    def __init__(self, ticker: "ForkingTicker", node: TreeNode, *, is_middle: bool) -> None:
        trail = ticker.trail
        self.is_middle = is_middle
        self.node = node
        self.cells = ticker.cells[:]
        self.values = ticker.values[:]
        self.entries = ticker.entries.now[:]
        self.asked = ticker.choices.choice_count
        self.happened = len(trail.numbers)
        self.going_on, self.changed, self.settled = trail.waits
        self.watched, self.broken = trail.watched, trail.broken

    def restore(self, ticker: "ForkingTicker") -> None:
        """Reset the ticker to this fork."""
        trail = ticker.trail
        ticker.cells = self.cells[:]
        ticker.values = self.values[:]
        ticker.entries.restore(self.entries)
        ticker.choices.rewind(self.asked)
        trail.rewind(self.happened)
        trail.going_on, trail.changed, trail.settled = self.going_on, self.changed, self.settled
        trail.watched, trail.broken = self.watched, self.broken


class ForkingTicker(Ticker):
    """Plays all possible ticks of a state. Each tick starts at the last fork of the previous tick.

    Args:
        first: A ticker of the same tree that has not ticked yet; its cells and timers are used.
        entries: The contents of the blackboard's entries.
        choices: The choices.
        trail: Records the events.
        meets: Whether ticks that reach the same place are merged from there on.

    Attributes:
        middles: The intermediate states that ticks have reached; None if the ticks of a state are played separately.
        middle: The last intermediate state that a tick has reached.
        waits: The effect on the waits of the part of the tick that ends at `middle` or at the end of the tick.
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
        # In the middle of a tick, the last status of a node matters because its parent may be about to read it.
        self._code = StateCode(self.cells, self.values, [])
        self._forks: list[Fork] = []
        self._seen: set[tuple[bytes, Waits]] = set()
        self._forgotten: list[bool] = []
        self._none: list[int] = []
        # By the parent of the next node: the nodes whose forgotten statuses may be read in the middle of a tick.
        self._shown: dict[int, list[int]] = {}

    def ignore_statuses(self, forgotten: list[bool]) -> None:
        """Set which nodes' last statuses the states omit, because no later tick depends on these statuses.

        In the middle of a tick, the statuses of the children of ticked nodes still matter, because their parents may be
        about to read them.
        """
        self._code = StateCode(self.cells, self.values, forgotten)
        self._forgotten = forgotten

    def begin(self, root: TreeNode, watched: int, path: tuple[int, ...] = ()) -> None:
        """Prepare the first tick from the state that is stored in the cells and entries.

        Args:
            root: The node to tick.
            watched: The state of the properties.
            path: The first choices of the tick.
        """
        self.choices.begin(path)
        self.trail.begin(watched)
        self._seen.clear()
        self._forks = [Fork(self, root, is_middle=False)]

    def play(self) -> int:
        """Play the tick from the last fork on, and return the root's outcome, KNOWN or ENTERED."""
        node = self._forks[-1].node
        is_new = False
        while True:
            if is_new and node.branch_count(self) > 1:
                met = self._look_up_visit(node) if self._meets else CALLED
                if met != CALLED:
                    return met
                self._forks.append(Fork(self, node, is_middle=False))
            is_new = True
            outcome = node.begin(self)
            while outcome != CALLED:
                around = node.parent
                if around is None:
                    self.waits = self.trail.waits
                    return outcome
                node = around
                outcome = node.resume(self, outcome)
            called = self.called
            assert called is not None  # noqa: S101 - true for CALLED
            node = called

    def next_fork(self) -> int:
        """Restore the last fork with an untried option.

        Return the number of later forks that are at intermediate states, or -1 if no fork has an untried option.
        """
        choice = self.choices.advance()
        if choice < 0:
            return -1
        forks, left = self._forks, 0
        while forks[-1].asked > choice:
            left += forks.pop().is_middle
        forks[-1].restore(self)
        return left

    def _look_up_visit(self, node: TreeNode) -> int:
        """Return KNOWN if a tick has reached this place before, ENTERED for a new intermediate state, or CALLED."""
        trail, entries = self.trail, self.entries
        entries.update_contents()
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
        """Return the nodes whose omitted statuses matter just before *node* is ticked."""
        around = node.parent
        if around is None:
            return []
        shown = self._shown.get(around.index)
        if shown is None:
            own = [child.status_cell for child in around.children if self._forgotten[child.status_cell]]
            shown = self._shown[around.index] = own + self._shown_at(around)
        return shown
