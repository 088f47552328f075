"""Runs by a scenario, one after the other, of a tree that was compiled once.

All that a tree remembers is in cells and in the entries of its blackboard (`runtime.kernel`), and both can be put back. So each run begins with
what the first one began with, and depends on its scenario alone.
"""

from functools import partial

from sar_compiler.analysis.numbered_board import NumberedBoard
from sar_compiler.analysis.simulate.running import Player, RunVariables
from sar_compiler.analysis.simulate.scenario_files import Scenario
from sar_compiler.analysis.simulated_tree import SimulatedTree
from sar_compiler.runtime.kernel.entry_cells import EntryCells
from sar_compiler.runtime.kernel.table import NotFlatError, flatten
from sar_compiler.runtime.kernel.times import ClockTimes
from sar_compiler.runtime.kernel.user_nodes import UserNode

# What scripts do is remembered by what entries hold: a tree that is not made anew from time to time would remember ever more.
_MOST_CHOICES = 50_000


class ReusedTree:
    """A simulated tree for many runs.

    Args:
        simulated: The tree, which was never ticked.

    Raises:
        NotFlatError: If a control or a decorator of it is of a class that is neither the project's nor py_trees': what its
            objects keep to themselves, nobody can put back.
        FrozenValueError: If a key holds a value that can neither be copied nor hashed.

    Attributes:
        simulated: The tree.
    """

    def __init__(self, simulated: SimulatedTree) -> None:
        self.simulated = simulated
        self._entries = EntryCells()
        for board in (simulated.facts.board, simulated.compiled.board):
            NumberedBoard.of(board, self._entries)
        self._flat = flatten(simulated.root)
        for node in self._flat.nodes:
            if isinstance(node, UserNode):
                raise NotFlatError(node.behaviour)
        self._start = self._entries.now
        self._variables = RunVariables(simulated)
        self._choices = 0

    @property
    def is_worn(self) -> bool:
        """Whether it is time for another tree, because this one remembers too much."""
        return self._choices >= _MOST_CHOICES

    def play(self, scenario: Scenario) -> Player:
        """Return a run that was played from the start; the one before is over."""
        clock = self.simulated.clock
        clock.advance(-clock.now())
        self._entries.restore(self._start)
        ticker = self._flat.ticker(ClockTimes(lambda _: clock))
        ticker.tells = False
        tick_tree = partial(ticker.run, self._flat.nodes[0])
        player = Player(self.simulated, scenario, self._variables, tick_tree)
        player.go()
        self._choices += len(player.run.ticks) + len(player.scripted.choices)
        return player
