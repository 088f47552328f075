"""Branches of parallel nodes that are replaced by automata, which describe only the results of their ticks.

A branch below a parallel node that shares nothing with the rest of the tree is first ticked on its own (`AloneNode`).
Its behaviour as its parent observes it is an `Automaton`, and a `BranchNode` replays the automaton in place of the
branch.

Fairness: a branch is replaced only if every fair run of it ends. So a fair run of the tree ends the branch or halts
it, and the branch is waited for from its start to that tick, as a single leaf is.
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
"""The outcome of a tick, INVALID if the branch was halted, and the state after it."""


class Automaton(NamedTuple):
    """The possible results of a branch's ticks.

    Attributes:
        ticks: The possible results of a tick in each state.
        halts: The possible results of halting it in each state; none if it does not run.
        start: The state before the first tick.
    """

    ticks: tuple[tuple[BranchResult, ...], ...]
    halts: tuple[tuple[BranchResult, ...], ...]
    start: int


class BranchDeed(NamedTuple):
    """The result of a replaced branch in a tick.

    Attributes:
        number: Its index in the tree.
        first: The number of choices before it.
        behind: The number of choices after it.
        result: The result.
    """

    number: int
    first: int
    behind: int
    result: BranchResult


class BranchNode(ChoosingNode):
    """A branch that is replaced by an automaton.

    Args:
        part: Its builder.
        leaves: Makes the choices, and records the waits.
        automaton: The possible results of its ticks.
        told: The list that receives its results, if events are kept.

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

    def branch_count(self, ticker: Ticker) -> int:
        """Return the number of possible results of a tick now."""
        return len(self._ticks[ticker.cells[self.place]])

    def begin(self, ticker: Ticker) -> int:
        """Return one of the possible outcomes of a tick."""
        cells, trail = ticker.cells, self._trail
        if cells[self.status_cell] != RUNNING:
            trail.start(self._bit)
        outcome = self._choose_result(ticker, self._ticks[cells[self.place]])
        if self._halts[cells[self.place]]:
            cells[self.status_cell] = RUNNING
            trail.mark_running(self._bit)
        else:
            cells[self.status_cell] = outcome if outcome & ENDED else INVALID
            trail.mark_ended(self._bit)
        return outcome

    def stop(self, ticker: Ticker) -> None:
        """Halt the branch if it runs."""
        if ticker.cells[self.status_cell] == RUNNING:
            self._choose_result(ticker, self._halts[ticker.cells[self.place]])
            self._trail.mark_ended(self._bit)
        self.reset_outcome(ticker)

    def _choose_result(self, ticker: Ticker, results: tuple[BranchResult, ...]) -> int:
        first = self._choices.choice_count
        result = results[self._choices.pick(len(results))]
        if self._trail.keeps:
            self._told.append(BranchDeed(self.index, first, self._choices.choice_count, result))
        ticker.cells[self.place] = i32(result[1])
        return result[0]


class AloneNode(DecoratorNode):
    """Ticks a branch repeatedly, or halts it between two ticks, like a parallel node around it.

    Args:
        part: Its builder.
        choices: Decide whether it is halted.
    """

    def __init__(self, part: NodeBuilder, choices: Choices) -> None:
        super().__init__(part)
        self._choices = choices

    def branch_count(self, ticker: Ticker) -> int:
        """Return 2 if the branch can be halted."""
        return 2 if ticker.cells[self.child.status_cell] == RUNNING else 1

    def begin(self, ticker: Ticker) -> int:
        """Tick the branch, or halt it."""
        if self._choices.pick(self.branch_count(ticker)):
            self.child.stop(ticker)
            return INVALID
        return self.tick_child(self.child, ticker)

    def on_child_outcome(self, ticker: Ticker, outcome: int) -> int:  # noqa: ARG002 - it has no status of its own
        """Pass on the outcome."""
        return outcome


class AllNode(ParallelNode):
    """A Parallel that needs all of its children, some of which were joined, so that its behaviour has more."""

    def threshold(self, port: str, wanted: int) -> int:  # noqa: ARG002 - it is that of more children
        """Return that all must succeed, and none may fail."""
        return len(self.children) if port == "success_count" else 1


class FlatComposition:
    """A tree, or a branch that is ticked on its own, with some branches replaced by automata.

    Args:
        root: Its root.
        automata: The automata of these branches, by their roots.
        joined: The remaining children of each parallel node whose neighbouring branches were joined.
        around: The behaviour that ticks a branch on its own; None for a tree.
        told: The list that receives the results of the branches.
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
        """Convert it to flat form, given a builder of the other nodes."""
        root = self._root if self._around is None else self._around
        return flat_tree(root, lambda part: self._node_of(part, leaves), self._ticked_children)

    def _node_of(self, part: NodeBuilder, leaves: LeafNodes) -> TreeNode:
        behaviour = part.behaviour
        if behaviour is self._around:
            return AloneNode(part, leaves.choices)
        if behaviour in self._automata:
            return BranchNode(part, leaves, self._automata[behaviour], self._told)
        if behaviour in self._joined and hasattr(behaviour, "success_count"):
            return AllNode(part)
        return leaves.node_of(part)

    def _ticked_children(self, behaviour: Any) -> list[Any]:
        if behaviour is self._around:
            return [self._root]
        if behaviour in self._automata:
            return []
        return self._joined.get(behaviour) or children_of(behaviour)
