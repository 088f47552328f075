"""Runs a tree as a scenario describes, on a simulated clock, and checks expectations and coverage."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from random import Random
from typing import NamedTuple
from uuid import UUID

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from sar_compiler.analysis.leaf_vocabulary import EventPattern
from sar_compiler.analysis.simulate.scenario_files import OWN, OutcomeStep, Scenario
from sar_compiler.analysis.simulated_tree import SimulatedTree
from sar_compiler.analysis.state_search.probabilities import TOLERANCE_SEC
from sar_compiler.analysis.stub_leaf import FactVariables, StubLeaf
from sar_compiler.errors import SarError
from sar_compiler.nodes.binding.bound import BoundNode
from sar_compiler.runtime.clock import Clock
from sar_compiler.runtime.evaluation import EvaluationError, Program
from sar_compiler.runtime.events import Event, TickRecord, append_end, value_changes
from sar_compiler.runtime.kernel.cells import WORDS
from sar_compiler.runtime.kernel.live import LiveTree
from sar_compiler.runtime.kernel.tree_nodes import Visit
from sar_compiler.runtime.outcomes import STATUSES, Outcome, middle, nominal, probabilities
from sar_compiler.runtime.script import parse
from sar_compiler.runtime.variables import (
    Enums,
    ScriptValue,
    UnknownVariableError,
    VariableError,
    unknown_value_of,
)
from sar_compiler.tree.guessing import did_you_mean, nearest


class RunVariables(FactVariables):
    """The variables that the conditions of a scenario can read.

    Attributes:
        now: The current values of the run itself, by name (`OWN`).
    """

    def __init__(self, simulated: SimulatedTree) -> None:
        super().__init__(simulated.facts, simulated.compiled.instance.scope, Enums(simulated.enums))
        self.now: Mapping[str, ScriptValue] = {}
        self._simulated = simulated

    def read(self, name: str) -> ScriptValue:
        """Return the value of a variable. An error about an unknown name suggests a similar name."""
        if name in self.now:
            return self.now[name]
        try:
            return super().read(name)
        except UnknownVariableError as error:
            near = nearest(name, [*OWN, *self._simulated.fact_values()])
            raise VariableError(f"{error}{did_you_mean(near)}") from error


class ScriptedError(SarError):
    """Raised if a scenario requests an outcome that a leaf cannot return at this point of the run."""


class DrawnChoice(NamedTuple):
    """The choice of an outcome for a leaf.

    Attributes:
        leaf: The leaf.
        outcome: The label or the status of the outcome.
        after_sec: The time for which the leaf runs before the outcome, in seconds.
        usual: Whether the outcome is the leaf's default outcome.
    """

    leaf: StubLeaf
    outcome: str
    after_sec: float = 0.0
    usual: bool = True


class ScenarioPolicy:
    """Chooses outcomes as a scenario describes.

    For other leaves, uses probabilities or the default outcome.

    Args:
        scenario: The scenario, with the steps of scripted leaves and the seed of random choices.
        variables: The variables of the steps' conditions.
        clock: The clock of running times.

    Attributes:
        choices: The choices so far, in order.
    """

    def __init__(self, scenario: Scenario, variables: RunVariables, clock: Clock) -> None:
        self.choices: list[DrawnChoice] = []
        self._random = Random(scenario.seed)  # noqa: S311 - it must be possible to repeat a run
        self._unusual = scenario.unusual
        scripts = scenario.scripts.items()
        self._clock = clock
        self._choosers: dict[StubLeaf, _ScriptedOutcomes | _RandomOutcomes] = {
            leaf: _ScriptedOutcomes(leaf, [*map(_RemainingUses, steps)], self._random, variables, clock)
            for leaf, steps in scripts
        }

    def choose(self, leaf: StubLeaf, options: Sequence[Outcome]) -> Outcome:
        """Return one of the outcomes *options* as the outcome of a leaf in the current tick.

        Raises:
            ScriptedError: If the leaf cannot return the scripted outcome now.
        """
        chooser = self._choosers.get(leaf)
        if chooser is None and leaf.is_random:
            chooser = self._choosers[leaf] = _RandomOutcomes(leaf, self._random, self._clock)
        if chooser is not None:
            return chooser.choose(options, self.choices)
        outcome = usual = nominal(options)
        if self._unusual and self._random.random() < self._unusual:
            others = [each for each in options if each.status != "RUNNING" and each != usual]
            outcome = self._random.choice(others or [usual])
        self.choices.append(DrawnChoice(leaf, outcome.name, usual=outcome == usual))
        return outcome


@dataclass(eq=False)
class _RandomOutcomes:
    """Chooses the outcome and the running time of an unscripted leaf by the known probabilities."""

    leaf: StubLeaf
    random: Random
    clock: Clock
    _drawn: Outcome | None = None
    _until: float = 0.0

    def choose(self, options: Sequence[Outcome], choices: list[DrawnChoice]) -> Outcome:
        """Return the leaf's next outcome, and record the choice."""
        now = self.clock.now() + TOLERANCE_SEC
        if self.leaf.status is not Status.RUNNING or (now >= self._until and self._drawn not in options):
            self._draw(options, choices)
        running = [outcome for outcome in options if outcome.status == "RUNNING"]
        if self._drawn is None or (running and now < self._until):
            return running[0]
        return self._drawn

    def _draw(self, options: Sequence[Outcome], choices: list[DrawnChoice]) -> None:
        ending = [outcome for outcome in options if outcome.status != "RUNNING"]
        self._drawn = None
        if ending:
            self._drawn = self.random.choices(ending, middle(probabilities(ending)))[0]
            after_sec = round(self.random.uniform(*self._drawn.sec), 3)
            self._until = self.clock.now() + after_sec
            usual = self._drawn == nominal(options) and not after_sec
            choices.append(DrawnChoice(self.leaf, self._drawn.name, after_sec, usual=usual))


@dataclass(eq=False)
class _ScriptedOutcomes:
    """Chooses a scripted leaf's outcomes from the remaining steps of its script."""

    leaf: StubLeaf
    steps: "Sequence[_RemainingUses]"
    random: Random
    variables: RunVariables
    clock: Clock
    _current: DrawnChoice | None = None
    _since: float = 0.0

    def choose(self, options: Sequence[Outcome], choices: list[DrawnChoice]) -> Outcome:
        """Return the leaf's next outcome, and record the choice."""
        if self.leaf.status is not Status.RUNNING:
            self._current = None  # a halted step is not repeated
        if self._current is None:
            self._current = self._next(options)
            self._since = self.clock.now()
            choices.append(self._current)
        choice = self._current
        if self.clock.now() - self._since < choice.after_sec - TOLERANCE_SEC:
            return self._named_outcome("RUNNING", options)
        self._current = None
        at_once = choice.usual and not choice.after_sec
        return nominal(options) if at_once else self._named_outcome(choice.outcome, options)

    def _next(self, options: Sequence[Outcome]) -> DrawnChoice:
        """Choose the outcome of the first usable step, or the default outcome if no step is usable."""
        step = next((left.step for left in self.steps if left.use(self._holds, self.random)), None)
        usual = nominal(options)
        if step is None:
            return DrawnChoice(self.leaf, usual.name)
        after_sec = step.after_sec
        if step.longest_sec > after_sec:
            after_sec = round(self.random.uniform(after_sec, step.longest_sec), 3)
        return DrawnChoice(
            self.leaf, step.outcome, after_sec, _outcomes_with_name(step.outcome, options)[:1] == [usual]
        )

    def _named_outcome(self, name: str, options: Sequence[Outcome]) -> Outcome:
        found = _outcomes_with_name(name, options)
        if found:
            return found[0]
        leaf = self.leaf
        conditions = [a.when for a in leaf.outcomes if name in (a.label, a.status) and a.when]
        raise ScriptedError(
            f"'{leaf.name}' cannot return '{name}' here, because '{name}' requires {' or '.join(conditions)}. It can return "
            f"{', '.join(outcome.name for outcome in options)}"
        )

    def _holds(self, step: OutcomeStep) -> bool:
        if step.when is None:
            return True
        try:
            return step.when.holds(self.variables)
        except EvaluationError as error:
            raise ScriptedError(f"'{self.leaf.name}': when '{step.when.script.text}': {error}") from error


def _outcomes_with_name(name: str, options: Sequence[Outcome]) -> list[Outcome]:
    """Return the outcomes whose label or status is *name*, starting with those whose label is *name*."""
    labelled = [outcome for outcome in options if outcome.label == name]
    return labelled + [outcome for outcome in options if outcome.status == name]


_Holds = Callable[[OutcomeStep], bool]


class _RemainingUses:
    """The number of times that a step can still be used."""

    def __init__(self, step: OutcomeStep) -> None:
        self.step = step
        self._left = step.times
        self._opportunities = 0

    def use(self, holds: _Holds, random: Random) -> bool:
        """Use the step if this is possible now, and return whether the step was used."""
        if self._left == 0 or not holds(self.step):
            return False
        self._opportunities += 1
        if self._opportunities % self.step.every:
            return False
        if self.step.probability < 1.0 and random.random() >= self.step.probability:
            return False
        if self._left is not None:
            self._left -= 1
        return True


_ROOT_IS_DONE = Program(parse("root == 'SUCCESS' || root == 'FAILURE'"))


class UntilError(SarError):
    """Raised if the condition that ends a run cannot be evaluated."""


@dataclass
class ScenarioRun:
    """A simulated run, with the ticks that were played so far.

    Attributes:
        simulated: The tree.
        scenario: The scenario.
        ticks: The ticks of the run.
        ended: Whether the end condition was met.
        trouble: The error that aborted the run; empty for none.
        is_undecided: Whether an unknown value caused the error.
    """

    simulated: SimulatedTree
    scenario: Scenario
    ticks: list[TickRecord] = field(default_factory=list)
    ended: bool = False
    trouble: str = ""
    is_undecided: bool = False

    @property
    def events(self) -> Iterator[Event]:
        """The events of all ticks so far, in order."""
        return (event for tick in self.ticks for event in tick.events)

    @property
    def root(self) -> str:
        """The root's status after the last tick, or `INVALID` before the first tick."""
        return self.ticks[-1].root if self.ticks else "INVALID"

    @property
    def time_sec(self) -> float:
        """The time of the last tick, in seconds since the first tick."""
        return self.ticks[-1].time_sec if self.ticks else 0.0


class Player:
    """Plays a run of a simulated tree according to a scenario.

    Args:
        simulated: The tree.
        scenario: The scenario.
        variables: The variables of the scenario's conditions.
        tick_tree: Ticks the tree once, and returns the number of the root's status.

    Attributes:
        run: The run so far.
        scripted: The policy that chooses the outcomes.
    """

    def __init__(
        self,
        simulated: SimulatedTree,
        scenario: Scenario,
        variables: RunVariables,
        tick_tree: Callable[[], int],
    ) -> None:
        self.run = ScenarioRun(simulated, scenario)
        self._simulated = simulated
        self._variables = variables
        self._tick_tree = tick_tree
        self._start_sec = simulated.clock.now()
        self._until = scenario.until or _ROOT_IS_DONE
        self.scripted = ScenarioPolicy(scenario, variables, simulated.clock)
        simulated.policy = self.scripted

    def tick(self) -> TickRecord:
        """Advance the clock by one period, except before the first tick.

        Tick the tree, and return the tick's record.

        Raises:
            Exception: Any exception that a node raises.
        """
        simulated, run = self._simulated, self.run
        if run.ticks:
            simulated.clock.advance(run.scenario.period_sec)
        number, time_sec = len(run.ticks) + 1, round(simulated.clock.now() - self._start_sec, 6)
        self._variables.now = {"root": run.root, "tick": number, "time": time_sec}
        simulated.events.clear()
        root = ""
        try:
            root = WORDS[self._tick_tree()]
        finally:
            events = append_end(simulated.events, simulated.root.name, root, number, time_sec)
            run.ticks.append(self._record(events))
        self._variables.now = {"root": root, "tick": number, "time": time_sec}
        return run.ticks[-1]

    def _record(self, events: tuple[Event, ...]) -> TickRecord:
        """Return the record of a tick with the given events."""
        return TickRecord(events, {}, {})

    def is_over(self) -> bool:
        """Return whether the end condition is met now.

        Raises:
            UntilError: If the end condition cannot be evaluated.
        """
        try:
            self.run.ended = self._until.holds(self._variables)
        except EvaluationError as error:
            raise UntilError(f"until '{self._until.script.text}': {error}") from error
        return self.run.ended

    def run_to_end(self, is_spent: Callable[[], bool] = lambda: False) -> ScenarioRun:
        """Tick until the end condition is met, an error occurs, or *is_spent* returns True before a tick."""
        run = self.run
        try:
            while len(run.ticks) < run.scenario.max_ticks and not is_spent():
                self.tick()
                if self.is_over():
                    break
        except Exception as error:  # noqa: BLE001 - any exception of a user's node would also end a real run
            run.trouble = self._simulated.explain(error)
            run.is_undecided = unknown_value_of(error) is not None
        return run


class ScenarioPlayer(Player):
    """Plays one run of a tree that was compiled only for this run.

    Also records the changes of facts and keys.

    Args:
        simulated: The tree.
        scenario: The scenario.
    """

    def __init__(self, simulated: SimulatedTree, scenario: Scenario) -> None:
        tree = LiveTree(simulated.root, is_strict=True)
        self._visits: list[Visit] = []
        tick_tree = partial(tree.tick_and_visit, self._visits)
        super().__init__(simulated, scenario, RunVariables(simulated), tick_tree)
        self._facts: Mapping[str, object] = dict(simulated.fact_values())
        self._keys = _keys(simulated)

    def _record(self, events: tuple[Event, ...]) -> TickRecord:
        simulated = self._simulated
        statuses = {visit.behaviour.id: WORDS[visit.outcome] for visit in self._visits}
        self._visits.clear()
        facts, keys = dict(simulated.fact_values()), _keys(simulated)
        changed, written = value_changes(self._facts, facts), value_changes(self._keys, keys)
        self._facts, self._keys = facts, keys
        return TickRecord(events, changed, written, statuses)


def _keys(simulated: SimulatedTree) -> Mapping[str, object]:
    """Return the values on the tree's blackboard by key.

    The keys of a subtree begin with the subtree's path.
    """
    return simulated.compiled.board.values()


@dataclass(frozen=True)
class Failure:
    """A violated expectation.

    Attributes:
        expected: The name of the expectation in a scenario; `run` for a run that could not be finished.
        message: The actual result.
        line: The line of the expectation in the scenario file; 0 for none.
    """

    expected: str
    message: str
    line: int = 0


def failures(run: ScenarioRun) -> list[Failure]:
    """Return the scenario's expectations that a run violates. An expected trace is not checked here."""
    if run.trouble:
        return [Failure("run", f"an error occurred in tick {len(run.ticks)}: {run.trouble}")]
    lines = run.scenario.expect.lines
    return [
        Failure(place.split()[0], message, lines.get(place, 0))
        for place, message in _failed_expectations(run)
    ]


def _failed_expectations(run: ScenarioRun) -> Iterator[tuple[str, str]]:
    """Yield each violated expectation, as its key in `Expectations.lines` and the actual result."""
    expect = run.scenario.expect
    yield from _end_mismatches(run)
    if expect.root is not None and run.root != expect.root:
        yield "root", f"the status of the root is {run.root} in the last tick, but {expect.root} was expected"
    values = run.simulated.fact_values()
    for name, fact in expect.facts.items():
        if values.get(name) != fact:
            yield (
                f"facts {name}",
                f"the fact '{name}' is {values.get(name)!r} at the end of the run, but {fact!r} was expected",
            )
    yield from _order_mismatches(run)
    for pattern in expect.never:
        event = next(filter(pattern.matches, run.events), None)
        if event is not None:
            yield (
                f"never {pattern.text}",
                f"'{pattern.text}' happens in tick {event.tick} ({event.time_sec:g} s)",
            )
    for pattern, bounds in expect.counts:
        number = sum(map(pattern.matches, run.events))
        if number < bounds.least or (bounds.most is not None and number > bounds.most):
            yield f"count {pattern.text}", f"'{pattern.text}' {_frequency_text(number)}, expected {bounds}"


def _end_mismatches(run: ScenarioRun) -> Iterator[tuple[str, str]]:
    expect, last = run.scenario.expect, f"tick {len(run.ticks)} ({run.time_sec:g} s)"
    if run.ended != expect.ends:
        until = run.scenario.until
        what = f"until '{until.script.text}' is" if until else "the root has"
        how = "true" if until else "succeeded or failed"
        if run.ended:
            yield "ends", f"the run ends with {last}: {what} {how}"
        else:
            yield "ends", f"the run has not ended by {last}: {what} not {how} yet"
    elif run.ended and expect.within_ticks is not None and len(run.ticks) > expect.within_ticks:
        yield "within", f"the run ends with {last}, but was expected to end by tick {expect.within_ticks}"
    elif run.ended and expect.within_sec is not None and run.time_sec > expect.within_sec:
        yield "within", f"the run ends with {last}, but was expected to end by {expect.within_sec:g} s"


def _order_mismatches(run: ScenarioRun) -> Iterator[tuple[str, str]]:
    """Yield the first expected event that does not happen after its predecessor in the list."""
    events = run.events
    before: EventPattern | None = None
    for pattern in run.scenario.expect.order:
        if not any(map(pattern.matches, events)):
            place = f" after '{before.text}'" if before else ""
            yield f"order {pattern.text}", f"'{pattern.text}' does not happen{place}"
            return
        before = pattern


def _frequency_text(number: int) -> str:
    return "never happens" if not number else f"happens {'once' if number == 1 else f'{number} times'}"


@dataclass
class NodeCoverage:
    """The outcomes observed for a node of a tree file, in all instances of the node's tree.

    Attributes:
        bound: The node.
        ticked: Whether any run has ticked the node.
        outcomes: The names of all possible outcomes; empty if the node is not a leaf.
        seen: The names of the observed outcomes.
    """

    bound: BoundNode
    ticked: bool = False
    outcomes: list[str] = field(default_factory=list)
    seen: set[str] = field(default_factory=set)

    @property
    def unseen_outcomes(self) -> list[str]:
        """The possible outcomes that were not observed."""
        return [outcome for outcome in self.outcomes if outcome not in self.seen]


class OutcomeCoverage:
    """Collects which nodes of a tree file were ticked in runs, and which outcomes they returned."""

    def __init__(self) -> None:
        self._nodes: dict[tuple[str, int, int], NodeCoverage] = {}

    @property
    def nodes(self) -> list[NodeCoverage]:
        """The nodes, sorted by file and location."""
        return [self._nodes[place] for place in sorted(self._nodes)]

    @property
    def never_ticked(self) -> list[NodeCoverage]:
        """The nodes that no run has ticked."""
        return [node for node in self.nodes if not node.ticked]

    @property
    def nodes_with_unseen_outcomes(self) -> list[NodeCoverage]:
        """The ticked leaves with outcomes that no run has returned."""
        return [node for node in self.nodes if node.ticked and node.unseen_outcomes]

    def add(self, run: ScenarioRun) -> None:
        """Add the nodes that a run has ticked, and the outcomes of these nodes."""
        origins = run.simulated.compiled.origins
        nodes: dict[UUID, NodeCoverage] = {}
        leaves = {leaf.number: leaf.id for leaf in run.simulated.leaves}
        for behaviour in run.simulated.root.iterate():
            bound = origins[behaviour.id].bound
            # The wrappers of a node (conditions, a OneShot) have other names than the node.
            if behaviour.name == bound.name:
                covered = nodes[behaviour.id] = self._nodes.setdefault(
                    _location_key(bound), NodeCoverage(bound)
                )
                covered.outcomes = list(dict.fromkeys([*covered.outcomes, *_outcomes(behaviour, bound)]))
        for event in run.events:
            if event.outcome:
                nodes[leaves[event.number]].seen.add(event.outcome)
        for tick in run.ticks:
            for node in tick.statuses.keys() & nodes.keys():
                nodes[node].ticked = True
                nodes[node].seen.add(tick.statuses[node])


def _outcomes(behaviour: Behaviour, bound: BoundNode) -> list[str]:
    if isinstance(behaviour, StubLeaf):
        return [outcome.name for outcome in behaviour.outcomes]
    leaf = bound.spec.kind.is_leaf and not behaviour.children
    return [status for status in STATUSES if leaf and status in bound.spec.statuses]


def _location_key(bound: BoundNode) -> tuple[str, int, int]:
    element = bound.element
    return element.source.path, element.line, element.column
