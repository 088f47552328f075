"""Runs many scenarios on one tree, which is compiled only once.

The whole state of a tree is in cells and blackboard entries (`runtime.kernel`), which can be restored. So every run starts
in the same state, and depends only on its scenario.
"""

from functools import partial

from sar_compiler.analysis.numbered_board import NumberedBoard
from sar_compiler.analysis.simulate.scenario_files import Scenario
from sar_compiler.analysis.simulate.scenario_run import Player, RunVariables
from sar_compiler.analysis.simulated_tree import SimulatedTree
from sar_compiler.runtime.kernel.entry_cells import EntryCells
from sar_compiler.runtime.kernel.table import NotFlatError, flatten
from sar_compiler.runtime.kernel.times import ClockTimes
from sar_compiler.runtime.kernel.user_nodes import UserNode

# The effects of scripts are cached by the values of entries. Trees are replaced because their caches grow forever.
_MAX_CHOICES = 50_000


class ReusedTree:
    """A simulated tree that can be restored to its start, so that it can be used for many runs.

    Args:
        simulated: The tree, which must not have been ticked.

    Raises:
        NotFlatError: If the class of a control or decorator belongs neither to this project nor to py_trees, so that the
            private state of its objects cannot be restored.
        FrozenValueError: If a key holds a value that can neither be copied nor hashed.

    Attributes:
        simulated: The tree.
    """

    def __init__(self, simulated: SimulatedTree) -> None:
        self.simulated = simulated
        self._entries = EntryCells()
        for board in (simulated.facts.board, simulated.compiled.board):
            NumberedBoard.from_board(board, self._entries)
        self._flat = flatten(simulated.root)
        for node in self._flat.nodes:
            if isinstance(node, UserNode):
                raise NotFlatError(node.behaviour)
        self._start = self._entries.now
        self._variables = RunVariables(simulated)
        self._choices = 0

    @property
    def needs_replacement(self) -> bool:
        """Whether the tree's cache is too large, so that the tree should be replaced."""
        return self._choices >= _MAX_CHOICES

    def play(self, scenario: Scenario) -> Player:
        """Play a complete run, and return the player of this run.

        The previous run's player is no longer usable.
        """
        clock = self.simulated.clock
        clock.advance(-clock.now())
        self._entries.restore(self._start)
        ticker = self._flat.ticker(ClockTimes(lambda _: clock))
        ticker.tells = False
        tick_tree = partial(ticker.run, self._flat.nodes[0])
        player = Player(self.simulated, scenario, self._variables, tick_tree)
        player.run_to_end()
        self._choices += len(player.run.ticks) + len(player.scripted.choices)
        return player
