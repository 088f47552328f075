"""Branches that stand for themselves: of which nothing is known but what can come of their ticks.

A branch below a parallel node that shares nothing with the rest of the tree is ticked on its own first (`AloneNode`). What its parent sees of it
is an `Automaton`, and a `BranchNode` does what that says, in place of the branch.

What is waited for. Nothing is composed that can run for ever without an end in a fair run. So whatever goes on in such a branch, a fair run comes
to its end or halts it: the branch is waited for from its start to there, as one leaf is.
"""

from collections.abc import Mapping
from typing import Any, NamedTuple

from mypy_extensions import i32

from sar_compiler.analysis.state_search.choices import Choices
from sar_compiler.analysis.state_search.stub_nodes import LeafNodes
from sar_compiler.runtime.kernel.cells import ENDED, INVALID, RUNNING
from sar_compiler.runtime.kernel.counting import ParallelNode
from sar_compiler.runtime.kernel.tree import FlatTree, children_of, flat_tree
from sar_compiler.runtime.kernel.tree_nodes import ChoosingNode, DecoratorNode, NodeBuilder, Ticker, TreeNode

BranchResult = tuple[int, int]
"""An outcome of a tick, INVALID where the branch was halted, and the state that it is in then."""


class Automaton(NamedTuple):
    """What can come of the ticks of a branch.

    Attributes:
        ticks: The results that a tick can have in each state.
        halts: The results of halting it in each state, without any where it does not run.
        start: The state before the first tick.
    """

    ticks: tuple[tuple[BranchResult, ...], ...]
    halts: tuple[tuple[BranchResult, ...], ...]
    start: int


class BranchDeed(NamedTuple):
    """What a branch that stands for itself has done in a tick.

    Attributes:
        number: Its index in the tree.
        first: How many choices there were before.
        behind: How many choices there were then.
        result: What has come of it.
    """

    number: int
    first: int
    behind: int
    result: BranchResult


class BranchNode(ChoosingNode):
    """A branch that stands for itself.

    Args:
        part: What it is built of.
        leaves: What decides, and is told what is waited for.
        automaton: What can come of its ticks.
        told: Where it is noted what it does, where events are kept.

    Attributes:
        place: The cell with the state of the automaton.
    """

    def __init__(
        self, part: NodeBuilder, leaves: LeafNodes, automaton: Automaton, told: list[BranchDeed]
    ) -> None:
        super().__init__(part)
        self.place = part.cell(automaton.start, keeps=True)
        self._bit = leaves.trail.bit(part.index)
        self._trail, self._choices, self._told = leaves.trail, leaves.choices, told
        self._ticks, self._halts = automaton.ticks, automaton.halts

    def ways(self, ticker: Ticker) -> int:
        """Return how many results a tick can have now."""
        return len(self._ticks[ticker.cells[self.place]])

    def begin(self, ticker: Ticker) -> int:
        """Come to one of the results that a tick can have."""
        cells, trail = ticker.cells, self._trail
        if cells[self.at] != RUNNING:
            trail.start(self._bit)
        outcome = self._come_to_one(ticker, self._ticks[cells[self.place]])
        if self._halts[cells[self.place]]:
            cells[self.at] = RUNNING
            trail.go_on(self._bit)
        else:
            cells[self.at] = outcome if outcome & ENDED else INVALID
            trail.end(self._bit)
        return outcome

    def stop(self, ticker: Ticker) -> None:
        """Halt the branch if it runs."""
        if ticker.cells[self.at] == RUNNING:
            self._come_to_one(ticker, self._halts[ticker.cells[self.place]])
            self._trail.end(self._bit)
        self.rest(ticker)

    def _come_to_one(self, ticker: Ticker, results: tuple[BranchResult, ...]) -> int:
        first = self._choices.asked
        result = results[self._choices.pick(len(results))]
        if self._trail.keeps:
            self._told.append(BranchDeed(self.index, first, self._choices.asked, result))
        ticker.cells[self.place] = i32(result[1])
        return result[0]


class AloneNode(DecoratorNode):
    """Ticks a branch again and again, or halts it between two ticks, as a parallel node around it does.

    Args:
        part: What it is built of.
        choices: Decide whether it is halted.
    """

    def __init__(self, part: NodeBuilder, choices: Choices) -> None:
        super().__init__(part)
        self._choices = choices

    def ways(self, ticker: Ticker) -> int:
        """Return 2 if the branch can be halted."""
        return 2 if ticker.cells[self.child.at] == RUNNING else 1

    def begin(self, ticker: Ticker) -> int:
        """Tick the branch, or halt it."""
        if self._choices.pick(self.ways(ticker)):
            self.child.stop(ticker)
            return INVALID
        return self.tick_child(self.child, ticker)

    def after(self, ticker: Ticker, outcome: int) -> int:  # noqa: ARG002 - it has no status of its own
        """Pass the outcome on."""
        return outcome


class AllNode(ParallelNode):
    """A Parallel that needs all of its children, of which it has fewer than its behaviour."""

    def threshold(self, port: str, wanted: int) -> int:  # noqa: ARG002 - it is that of more children
        """Return that all have to succeed, and none may fail."""
        return len(self.children) if port == "success_count" else 1


class FlatComposition:
    """A tree, or a branch that is ticked on its own, in which some branches stand for themselves.

    Args:
        root: Its root.
        automata: What can come of the ticks of these, by their roots.
        joined: The children of parallel nodes that need all of them, where there are fewer than in the tree.
        around: A behaviour for what ticks a branch on its own; None for a tree.
        told: Where it is noted what the branches do.
    """

    def __init__(
        self,
        root: Any,
        automata: Mapping[Any, Automaton],
        joined: Mapping[Any, list[Any]],
        around: Any,
        told: list[BranchDeed],
    ) -> None:
        self._root, self._around, self._told = root, around, told
        self._automata, self._joined = automata, joined

    def flat(self, leaves: LeafNodes) -> FlatTree:
        """Bring it into flat form, given what builds the other nodes."""
        root = self._root if self._around is None else self._around
        return flat_tree(root, lambda part: self._node_of(part, leaves), self._below)

    def _node_of(self, part: NodeBuilder, leaves: LeafNodes) -> TreeNode:
        behaviour = part.behaviour
        if behaviour is self._around:
            return AloneNode(part, leaves.choices)
        if behaviour in self._automata:
            return BranchNode(part, leaves, self._automata[behaviour], self._told)
        if behaviour in self._joined and hasattr(behaviour, "success_count"):
            return AllNode(part)
        return leaves.node_of(part)

    def _below(self, behaviour: Any) -> list[Any]:
        if behaviour is self._around:
            return [self._root]
        if behaviour in self._automata:
            return []
        return self._joined.get(behaviour) or children_of(behaviour)
