"""Defines scenarios and parses scenario files.

Each error in a file is reported as a finding with a location.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from sar_compiler.analysis.assumptions import (
    StartValues,
    apply_controls,
    check_outcomes,
    raise_disputes,
    read_assumptions,
    start_assumptions,
)
from sar_compiler.analysis.leaf_vocabulary import (
    EventPattern,
    LeafVocabulary,
    parameters,
    parse_duration_range,
    parse_word,
    seconds,
)
from sar_compiler.analysis.simulated_tree import Assumptions, SimulatedTree, compile_simulated, match_rank
from sar_compiler.analysis.stub_leaf import StubLeaf
from sar_compiler.checks.configuration import path_inside
from sar_compiler.compiler import bind_main
from sar_compiler.documents.located import Document, Value
from sar_compiler.documents.yaml_files import read_yaml
from sar_compiler.nodes.binding.bound import Binding
from sar_compiler.nodes.registry import Registry
from sar_compiler.opener import SCENARIO
from sar_compiler.runtime.evaluation import Program
from sar_compiler.runtime.expressions import Script
from sar_compiler.runtime.outcomes import Fact
from sar_compiler.tree.diagnostic import Diagnostic
from sar_compiler.tree.forest import Forest
from sar_compiler.tree.guessing import nearest
from sar_compiler.tree.model import TreeFile

PERIOD_SEC = 0.5
"""The default time between two ticks, in seconds, as in `sar-run` (2 Hz)."""
OWN = ("root", "tick", "time")
"""The names under which conditions can use values of the run itself, such as the number of the tick."""

MAX_TICKS = 1000
"""The default number of ticks after which a run is aborted."""


@dataclass(frozen=True)
class OutcomeStep:
    """A step of a leaf's script: an outcome, and the conditions under which the leaf returns this outcome.

    Attributes:
        outcome: The label or the status of the outcome.
        after_sec: The time for which the leaf runs before the outcome, in seconds.
        longest_sec: If larger than `after_sec`, the upper bound of a random running time, in seconds.
        when: The condition of the step; None if there is no condition.
        times: The number of times that the step is used; None for any number.
        every: The number n if the step is only used at every n-th opportunity.
        probability: The probability with which a possible step is used.
    """

    outcome: str
    after_sec: float = 0.0
    longest_sec: float = 0.0
    when: Program | None = None
    times: int | None = 1
    every: int = 1
    probability: float = 1.0


@dataclass(frozen=True)
class Bounds:
    """The minimum and the maximum number of times that an event may happen.

    Attributes:
        least: The minimum number.
        most: The maximum number; None for no maximum.
    """

    least: int
    most: int | None

    def __str__(self) -> str:
        if self.least == self.most:
            return str(self.least)
        return f"at least {self.least}" if self.most is None else f"at most {self.most}"


@dataclass(frozen=True)
class Expectations:
    """The expected results of a run.

    Attributes:
        root: The root's status after the last tick: `SUCCESS`, `FAILURE`, `RUNNING` or `SKIPPED`.
        ends: Whether the run meets its end condition before it is aborted.
        within_ticks: The maximum number of ticks until the end.
        within_sec: The maximum time until the end, in seconds.
        facts: The values of facts at the end.
        order: Events that happen in this order.
        never: Events that must not happen.
        counts: Events with the number of times that they may happen.
        trace: The path of a file with the expected trace.
        lines: The line of each expectation in the scenario file, by its key and subject, such as `root`, `facts at` or
            `never NotifyBase refused`.
    """

    root: str | None = None
    ends: bool = True
    within_ticks: int | None = None
    within_sec: float | None = None
    facts: Mapping[str, Fact] = field(default_factory=dict)
    order: tuple[EventPattern, ...] = ()
    never: tuple[EventPattern, ...] = ()
    counts: tuple[tuple[EventPattern, Bounds], ...] = ()
    trace: Path | None = None
    lines: Mapping[str, int] = field(default_factory=dict)


@dataclass(frozen=True)
class Scenario:
    """A scripted run.

    Attributes:
        name: The name of the scenario.
        path: The path of the scenario file; empty if there is no file.
        period_sec: The time between two ticks, in seconds.
        max_ticks: The number of ticks after which the run is aborted.
        until: The end condition; None if the run ends when the root has succeeded or failed.
        scripts: The steps of scripted leaves; other leaves return their default outcomes.
        expect: The expectations.
        seed: The seed of all random choices.
        unusual: The probability with which an unscripted leaf returns another outcome than its default outcome.
        warnings: Findings about the scenario file that do not prevent the run.
    """

    name: str = "as usual"
    path: str = ""
    period_sec: float = PERIOD_SEC
    max_ticks: int = MAX_TICKS
    until: Program | None = None
    scripts: Mapping[StubLeaf, tuple[OutcomeStep, ...]] = field(default_factory=dict)
    expect: Expectations = field(default_factory=Expectations)
    seed: int = 0
    unusual: float = 0.0
    warnings: tuple[Diagnostic, ...] = ()


def read_expectations(value: Value | None, words: LeafVocabulary) -> Expectations:
    """Read the expectations of a scenario, and report impossible expectations."""
    document, parts = words.document, {} if value is None else value.mapping
    plain = {} if value is None else value.data
    ticks, limit_sec = _tick_window(parts["within"]) if "within" in parts else (None, None)
    return Expectations(
        root=plain.get("root"),
        ends=plain.get("ends", True),
        within_ticks=ticks,
        within_sec=limit_sec,
        facts=_facts(document, parts["facts"], words.simulated.fact_values()) if "facts" in parts else {},
        order=_event_patterns(parts.get("order"), words),
        never=_event_patterns(parts.get("never"), words),
        counts=_counts(parts["count"], words) if "count" in parts else (),
        trace=path_inside(document, Path(document.source.path).parent, parts["trace"], "trace")
        if "trace" in parts
        else None,
        lines=dict(_lines(document, parts)),
    )


def _lines(document: Document, parts: Mapping[str, Value]) -> Iterator[tuple[str, int]]:
    """Yield each key of `Expectations.lines` with its line number."""
    for name, value in parts.items():
        yield name, document.source.position_of(value.start)[0]
        below = [key for key, _ in value.entries] if value.entries is not None else value.as_list
        for key in below:
            yield f"{name} {key.text}", document.source.position_of(key.start)[0]


def _tick_window(value: Value) -> tuple[int | None, float | None]:
    text = value.text or ""
    return (int(text.split()[0]), None) if "tick" in text else (None, seconds(value))


def _facts(document: Document, value: Value, known: Mapping[str, Fact]) -> dict[str, Fact]:
    facts: dict[str, Fact] = {}
    for key, inner in value.entries or ():
        name = key.text or ""
        if name not in known:
            message = f"unknown fact '{name}' (known: {', '.join(known) or 'none'})"
            document.report("unknown-fact", message, key, suggestion=nearest(name, known))
        else:
            facts[name] = inner.data
    return facts


def _event_patterns(value: Value | None, words: LeafVocabulary) -> tuple[EventPattern, ...]:
    patterns = [] if value is None else [words.parse_event(item) for item in value.as_list]
    return tuple(pattern for pattern in patterns if pattern is not None)


def _counts(value: Value, words: LeafVocabulary) -> tuple[tuple[EventPattern, Bounds], ...]:
    counts = []
    for key, inner in value.entries or ():
        pattern = words.parse_event(key)
        if pattern is not None:
            counts.append((pattern, _parse_bounds(inner.data)))
    return tuple(counts)


def _parse_bounds(text: float | str) -> Bounds:
    """Parse bounds such as `2`, `at least 2` or `at most 2`."""
    *which, number = text.split() if isinstance(text, str) else [text]
    return Bounds(0 if "most" in which else int(number), None if "least" in which else int(number))


_ALWAYS = "always"


def read_scripts(value: Value, words: LeafVocabulary) -> dict[StubLeaf, tuple[OutcomeStep, ...]]:
    """Return the steps of each scripted leaf.

    If several keys name a leaf, a path overrides a name, and a name overrides a tag.
    """
    scripts: dict[StubLeaf, tuple[OutcomeStep, ...]] = {}
    ranks: dict[StubLeaf, int] = {}
    for key, inner in value.entries or ():
        leaves = words.find(key)
        steps = _steps(inner, words, leaves)
        for leaf in leaves:
            rank = match_rank(key.text or "", leaf.path, leaf.tag)
            if rank > ranks.get(leaf, 0):
                scripts[leaf], ranks[leaf] = steps, rank
    return scripts


def _steps(value: Value, words: LeafVocabulary, leaves: Sequence[StubLeaf]) -> tuple[OutcomeStep, ...]:
    """Read a step or a list of steps of a leaf's script."""
    one = value.items is None
    steps = [_step(item, words, leaves, always=one) for item in value.as_list]
    return tuple(step for step in steps if step is not None)


def _step(
    value: Value, words: LeafVocabulary, leaves: Sequence[StubLeaf], *, always: bool
) -> OutcomeStep | None:
    times = None if always else 1
    if value.entries is None:
        outcome = words.parse_outcome(value, leaves) if leaves else None
        return None if outcome is None else OutcomeStep(outcome, times=times)
    parts = value.mapping
    outcome = words.parse_outcome(parts["outcome"], leaves) if leaves else None
    after = parts.get("after")
    if after is not None:
        _check_running(words.document, after, leaves)
    least, longest = parse_duration_range(after) if after else (0.0, 0.0)
    step = OutcomeStep(
        outcome or "",
        after_sec=least,
        longest_sec=longest,
        when=_program(words.condition(parts.get("when"), OWN), words.simulated),
        times=_times(parts["times"]) if "times" in parts else None if "every" in parts else times,
        every=int(parts["every"].data) if "every" in parts else 1,
        probability=float(parts["probability"].data) if "probability" in parts else 1.0,
    )
    return step if outcome is not None else None


def _program(condition: Script | None, simulated: SimulatedTree) -> Program | None:
    return None if condition is None else Program(condition, simulated.enums)


def _times(value: Value) -> int | None:
    return None if value.data == _ALWAYS else int(value.data)


def _check_running(document: Document, value: Value, leaves: Sequence[StubLeaf]) -> None:
    for leaf in leaves:
        if all(outcome.status != "RUNNING" for outcome in leaf.outcomes):
            message = (
                f"'{leaf.name}' never returns RUNNING, so 'after' cannot set a running time for this leaf"
            )
            document.report("wrong-value", message, value, hint="omit 'after'")


_EMPTY_HINT = "write the outcomes of leaves under 'leaves:', and the expected results under 'expect:'"


@dataclass(eq=False, repr=False)
class ScenarioStage:
    """A tree file on which scenarios are simulated.

    Attributes:
        forest: The tree file and the files that it includes.
        registry: The registered nodes.
        palettes: Further files whose `TreeNodesModel` describes nodes that are not installed.
        tree_id: The ID of the tree to simulate if a scenario names none; by default the tree that the file executes.
        start: Returns the start values of a bound tree's runs from the mission's parameters.
    """

    forest: Forest
    registry: Registry
    palettes: tuple[TreeFile, ...] = ()
    tree_id: str | None = None
    start: Callable[[Binding], StartValues] = lambda _bind: StartValues()
    _bindings: dict[str | None, Binding] = field(default_factory=dict, init=False)

    def with_controls(self, document: Document, controls: Value, tree_id: str | None) -> Binding:
        """Bind a tree of the file, with the replacements of controls and decorators that a scenario requires."""
        binding = bind_main(self.forest, self.registry, tree_id or self.tree_id, self.palettes)
        files = (*self.palettes, *self.forest.files)
        apply_controls(document, controls, binding, self.registry, files)
        return binding

    def binding(self, tree_id: str | None = None) -> Binding:
        """Return a bound tree of the file.

        Raises:
            TreeError: If the file does not contain the tree, or the tree has an error.
        """
        wanted = tree_id or self.tree_id
        if wanted not in self._bindings:
            self._bindings[wanted] = bind_main(self.forest, self.registry, wanted, self.palettes)
        return self._bindings[wanted]

    def play(self) -> "ScenarioSimulation":
        """Simulate the tree without a scenario, so that every leaf returns its default outcome.

        Raises:
            TreeError: If the tree cannot be used.
            DisputedFactError: If leaves declare different initial values for a fact.
        """
        binding = self.binding()
        start = self.start(binding)
        simulated = _simulate(binding, start.parameters, lambda plain: start_assumptions(start, plain))
        raise_disputes(simulated)
        return ScenarioSimulation(simulated, Scenario(period_sec=start.period_sec or PERIOD_SEC))


@dataclass(frozen=True)
class ScenarioSimulation:
    """A simulated tree, together with the scenario of the simulation.

    Attributes:
        simulated: The tree, with the assumptions of the scenario.
        scenario: The scenario.
    """

    simulated: SimulatedTree
    scenario: Scenario


def read_scenario(path: str | Path, stage: ScenarioStage) -> ScenarioSimulation:
    """Read a scenario file, and return the simulated tree and the scenario.

    Raises:
        UnreadableFileError: If the file is missing or cannot be read.
        TreeError: If the scenario or the tree has errors; contains all findings.
    """
    return load_scenario(read_yaml(path, SCENARIO, _EMPTY_HINT), stage)


def load_scenario(document: Document, stage: ScenarioStage) -> ScenarioSimulation:
    """Convert a document to a scenario, and return the simulated tree and the scenario.

    Raises:
        TreeError: If the scenario or the tree has errors; contains all findings.
    """
    parts = document.validate("scenario").mapping
    with document.prefer_findings():
        binding = _bind(document, parts.get("tree"), parts.get("controls"), stage)
        if "enums" in parts:
            binding = replace(binding, enums={**binding.enums, **parts["enums"].data})
        start = stage.start(binding)
        facts, outcomes = parts.get("facts"), parts.get("outcomes")
        simulated = _simulate(
            binding,
            {**start.parameters, **parameters(parts.get("parameters"))},
            lambda plain: (
                start_assumptions(start, plain) | read_assumptions(document, facts, outcomes, plain)
            ),
        )
        for message in simulated.disputes.values():
            document.report("missing-value", message, facts or document.root)
    words = LeafVocabulary(document, simulated)
    check_outcomes(outcomes, words)
    path = document.source.path
    scenario = Scenario(
        name=(parts["name"].text if "name" in parts else None) or Path(path).stem,
        path=path,
        period_sec=seconds(parts["period"]) if "period" in parts else start.period_sec or PERIOD_SEC,
        max_ticks=int(parts["ticks"].data) if "ticks" in parts else MAX_TICKS,
        until=_program(words.condition(parts.get("until"), OWN), simulated),
        scripts=read_scripts(parts["leaves"], words) if "leaves" in parts else {},
        expect=read_expectations(parts.get("expect"), words),
        warnings=document.warnings,
    )
    document.raise_findings()
    return ScenarioSimulation(simulated, scenario)


def _bind(document: Document, tree: Value | None, controls: Value | None, stage: ScenarioStage) -> Binding:
    tree_id = None if tree is None else parse_word(document, tree, stage.forest.trees, "the tree")
    return stage.binding(tree_id) if controls is None else stage.with_controls(document, controls, tree_id)


def _simulate(
    binding: Binding,
    parameters: Mapping[str, object],
    assumptions_for: Callable[[SimulatedTree], Assumptions],
) -> SimulatedTree:
    """Compile a bound tree with stub leaves and the assumptions that *assumptions_for* returns."""
    # Which assumptions are possible depends on the leaves, so the tree is first compiled without assumptions.
    plain = compile_simulated(binding, parameters)
    assumed = assumptions_for(plain)
    return plain if assumed == Assumptions() else compile_simulated(binding, parameters, assumed)
