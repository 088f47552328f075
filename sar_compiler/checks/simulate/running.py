"""Ticking a tree by a scenario, on a clock that is moved by hand."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

from sar_compiler.checks.simulate.run_variables import RunVariables
from sar_compiler.checks.simulate.scenario import Scenario
from sar_compiler.checks.simulate.scripted import Scripted
from sar_compiler.compiler.simulated_tree import SimulatedTree
from sar_compiler.errors import SarError
from sar_compiler.runtime.evaluation import EvaluationError, Program
from sar_compiler.runtime.events import Event, TickRecord, value_changes, with_end
from sar_compiler.runtime.kernel.cells import WORDS
from sar_compiler.runtime.kernel.live import LiveTree
from sar_compiler.runtime.kernel.tree_nodes import Visit
from sar_compiler.runtime.script import parse

_ROOT_IS_DONE = parse("root == 'SUCCESS' || root == 'FAILURE'")


class UntilError(SarError):
    """The condition that ends a run cannot be evaluated."""


@dataclass
class Run:
    """A run so far.

    Attributes:
        simulated: The tree.
        scenario: The scenario.
        ticks: Its ticks.
        ended: Whether the condition for its end has come true.
        trouble: What broke it off; empty if nothing did.
    """

    simulated: SimulatedTree
    scenario: Scenario
    ticks: list[TickRecord] = field(default_factory=list)
    ended: bool = False
    trouble: str = ""

    @property
    def events(self) -> Iterator[Event]:
        """What has happened, one by one."""
        return (event for tick in self.ticks for event in tick.events)

    @property
    def root(self) -> str:
        """The root's status after the last tick; `INVALID` before the first one."""
        return self.ticks[-1].root if self.ticks else "INVALID"

    @property
    def time_sec(self) -> float:
        """When the last tick was, seconds from the first one."""
        return self.ticks[-1].time_sec if self.ticks else 0.0


class ScenarioPlayer:
    """Ticks a tree by a scenario, tick by tick.

    Attributes:
        run: What has come of it so far.
        scripted: What has chosen the answers.
    """

    def __init__(self, simulated: SimulatedTree, scenario: Scenario) -> None:
        self.run = Run(simulated, scenario)
        self._simulated = simulated
        self._tree = LiveTree(simulated.root, is_strict=True)
        self._start_sec = simulated.clock.now()
        self._variables = RunVariables(simulated)
        self._until = Program(scenario.until or _ROOT_IS_DONE)
        self._facts: Mapping[str, object] = dict(simulated.fact_values())
        self._keys = _keys(simulated)
        self.scripted = Scripted(scenario, self._variables, simulated.clock)
        simulated.policy = self.scripted

    def tick(self) -> TickRecord:
        """Tick the tree once, a period after the last time.

        Raises:
            Exception: Whatever a node raises.
        """
        simulated, run = self._simulated, self.run
        if run.ticks:
            simulated.clock.advance(run.scenario.period_sec)
        number, time_sec = len(run.ticks) + 1, round(simulated.clock.now() - self._start_sec, 6)
        self._variables.now = {"root": run.root, "tick": number, "time": time_sec}
        visits: list[Visit] = []
        simulated.events.clear()
        root = ""
        try:
            root = WORDS[self._tree.tick_and_visit(visits)]
        finally:
            statuses = {visit.behaviour.id: WORDS[visit.outcome] for visit in visits}
            facts, keys = dict(simulated.fact_values()), _keys(simulated)
            events = with_end(simulated.events, simulated.root.name, root, number, time_sec)
            changed, written = value_changes(self._facts, facts), value_changes(self._keys, keys)
            self._facts, self._keys = facts, keys
            run.ticks.append(TickRecord(events, changed, written, statuses))
        self._variables.now = {"root": root, "tick": number, "time": time_sec}
        return run.ticks[-1]

    def is_over(self) -> bool:
        """Return whether the condition for the end is true now.

        Raises:
            UntilError: If that cannot be said.
        """
        try:
            self.run.ended = self._until.holds(self._variables)
        except EvaluationError as error:
            raise UntilError(f"until '{self._until.script.text}': {error}") from error
        return self.run.ended

    def go(self) -> Run:
        """Tick until the end, or until the run is broken off."""
        run = self.run
        try:
            while len(run.ticks) < run.scenario.max_ticks:
                self.tick()
                if self.is_over():
                    break
        except Exception as error:  # noqa: BLE001 - whatever a user's decorator raises ends a real run as well
            run.trouble = self._simulated.explain(error)
        return run


def _keys(simulated: SimulatedTree) -> Mapping[str, object]:
    """Return the entries of the tree's blackboard, by their keys; those of a subtree with its path before."""
    return simulated.compiled.board.values()
