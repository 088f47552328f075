"""Automata that replace branches below parallel nodes.

An automaton describes only the results of a branch's ticks.

A branch below a parallel node that shares nothing with the rest of the tree is first ticked on its own (`AloneNode`).
The results of its ticks, which are all that its parent observes, form an `Automaton`. A `BranchNode` then plays the
automaton in place of the branch.

Fairness: a branch is only replaced if every fair run of the branch ends. So a fair run of the tree ends the branch or
halts it. From its start until then, the tree waits for the branch as it waits for a single leaf.
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
"""The outcome of a branch's tick, or INVALID for a halted branch, and the state of the automaton after the tick."""


class Automaton(NamedTuple):
    """The possible results of a branch's ticks.

    Attributes:
        ticks: The possible results of a tick, by state.
        halts: The possible results of a halt, by state; no results if the branch does not run in the state.
        start: The state before the first tick.
    """

    ticks: tuple[tuple[BranchResult, ...], ...]
    halts: tuple[tuple[BranchResult, ...], ...]
    start: int


class BranchDeed(NamedTuple):
    """The result of a tick of a branch that an automaton replaces.

    Attributes:
        number: The index of the branch in the tree.
        first: The number of choices that the tick had made before it reached the branch.
        behind: The number of choices that the tick had made when it left the branch.
        result: The result.
    """

    number: int
    first: int
    behind: int
    result: BranchResult


class BranchNode(ChoosingNode):
    """A node that replaces a branch by an automaton.

    Args:
        part: The builder of the node.
        leaves: Makes the choices, and records the waits.
        automaton: The automaton.
        told: The list to which the node's results are appended while events are kept.

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
        """Return the number of possible results of a tick in the current state."""
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
        """Halt the branch if it is running."""
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
    """Ticks only one branch. Like a parallel node, it may also halt the branch between two ticks.

    Args:
        part: The builder of the node.
        choices: Decide whether the branch is halted.
    """

    def __init__(self, part: NodeBuilder, choices: Choices) -> None:
        super().__init__(part)
        self._choices = choices

    def branch_count(self, ticker: Ticker) -> int:
        """Return 2 if the branch can be halted, otherwise 1."""
        return 2 if ticker.cells[self.child.status_cell] == RUNNING else 1

    def begin(self, ticker: Ticker) -> int:
        """Tick the branch or halt it, depending on the choice in this tick."""
        if self._choices.pick(self.branch_count(ticker)):
            self.child.stop(ticker)
            return INVALID
        return self.tick_child(self.child, ticker)

    def on_child_outcome(self, ticker: Ticker, outcome: int) -> int:  # noqa: ARG002 - it has no status of its own
        """Return the child's outcome unchanged."""
        return outcome


class AllNode(ParallelNode):
    """A Parallel node whose children must all succeed.

    Joined branches count as one child, so the node may have fewer children than in the original tree.
    """

    def threshold(self, port: str, wanted: int) -> int:  # noqa: ARG002 - it refers to the children before the join
        """Return the number of children as the threshold `success_count`, and 1 as `failure_count`."""
        return len(self.children) if port == "success_count" else 1


class FlatComposition:
    """A tree, or a single branch of a tree, in which automata replace branches.

    Args:
        root: The root of the tree or of the branch.
        automata: The automata that replace branches, by the root of the branch.
        joined: The remaining children of each parallel node whose neighbouring branches were joined.
        around: The behaviour that ticks a branch on its own; None for a tree.
        told: The list to which the results of replaced branches are appended.
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
        """Convert the composition to a flat tree. *leaves* builds the nodes that no automaton replaces."""
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
