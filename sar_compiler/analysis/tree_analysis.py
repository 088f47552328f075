"""Analyses of a loaded tree's runs: simulation, verification, monitoring, comparison and prediction."""

import functools
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from sar_compiler.analysis.assumptions import StartValues
from sar_compiler.documents.located import Document
from sar_compiler.nodes.binding.bound import Binding
from sar_compiler.project.project_tree import ProjectTree
from sar_compiler.runtime.outcomes import Fact

if TYPE_CHECKING:
    from sar_compiler.analysis.conformance import Conformance
    from sar_compiler.analysis.predict import Prediction
    from sar_compiler.analysis.runtime_monitor import RuntimeMonitor
    from sar_compiler.analysis.simulate.scenario_files import ScenarioStage
    from sar_compiler.analysis.simulated_tree import SimulatedTree
    from sar_compiler.analysis.verify.properties import PropertyFile
    from sar_compiler.analysis.verify.verdicts import Verification
    from sar_compiler.budget import Budget
    from sar_compiler.compiler import CompiledTree
    from sar_compiler.journal.recorded_ticks import TickSource
    from sar_compiler.runtime.events import Event


def _start_values(
    tree: ProjectTree, params: str | Path | StartValues | None, binding: Binding
) -> StartValues:
    """Read a tree's start values from a parameter file, without ROS; report unusual values.

    Raises:
        ParameterFileError: If ROS would refuse or misread the file.
        ParameterError: If the mission cannot start with the parameters.
    """
    if params is None or isinstance(params, StartValues):
        return params or StartValues()
    from sar_compiler.missions.mission_start import start_without_ros

    values, _, begun = start_without_ros(tree, Path(params), binding)
    for text in begun.notes:
        tree.note(text if text.startswith(f"{params}:") else f"{params}: {text}")
    return StartValues(values, begun.mission.initial_facts(), 1.0 / begun.parameters.tick_rate_hz)


def stage_of(
    tree: ProjectTree, tree_id: str | None = None, params: str | Path | StartValues | None = None
) -> "ScenarioStage":
    """Return the stage that simulates scenarios of a tree.

    Args:
        tree: The tree file.
        tree_id: The tree to simulate if a scenario names none; by default the one that the file executes.
        params: The mission's ROS parameter file, or its content; by default, leaves declare the start values of facts.

    Raises:
        TreeError: If there are errors.
    """
    from sar_compiler.analysis.simulate.scenario_files import ScenarioStage

    tree.require_no_errors()
    start = functools.partial(_start_values, tree, params)
    return ScenarioStage(tree.forest, tree.project.registry, tree.palettes, tree_id, start)


def verify_tree(
    tree: ProjectTree,
    properties: str | Path | None = None,
    *,
    facts: Mapping[str, object] | Document | None = None,
    params: str | Path | None = None,
    tree_id: str | None = None,
    max_states: int = 1_000_000,
    budget: "Budget | None" = None,
) -> "Verification":
    """Check properties in all possible runs of the tree.

    Args:
        tree: The tree file.
        properties: A file with the properties; by default the mission's own.
        facts: The initial values of facts, in addition to the file's: `{"rooms_left": 4}`.
        params: The mission's ROS parameter file; *properties* and *facts* override what it says.
        tree_id: The tree in the file; by default the one that the file executes.
        max_states: The largest number of states to explore.
        budget: Limits time and memory, and receives the progress; by default only the number of states is limited.

    Raises:
        TreeError: If there are errors, or a property cannot apply to the tree.
        UndecidableError: If the runs of the tree cannot be enumerated.
        ParameterFileError, ParameterError: If the mission cannot start with the parameters.
    """
    from sar_compiler.analysis.proofs import search_runs
    from sar_compiler.analysis.verify import verify

    binding = tree.binding(tree_id)
    start = _start_values(tree, params, binding)
    search = functools.partial(verify, max_states=max_states, budget=budget)
    return search_runs(tree, binding, properties, facts, start, search)


def watch_tree(
    tree: ProjectTree,
    watched: "CompiledTree",
    properties: str | Path | None = None,
    *,
    facts: Mapping[str, Fact] | None = None,
    parameters: Mapping[str, object] | None = None,
    tree_id: str | None = None,
    clock: Callable[[], float] = lambda: 0.0,
) -> "RuntimeMonitor":
    """Return the monitor of a run of a tree for properties.

    Args:
        tree: The tree file.
        watched: The tree that is ticked.
        properties: As for `LoadedTree.verify`.
        facts: The facts at the start of the run; they override those of the file.
        parameters: The keys of the root blackboard.
        tree_id: As for `LoadedTree.verify`.
        clock: Returns the time, seconds since the run's start.

    Raises:
        TreeError, UndecidableError: As `LoadedTree.verify`.
    """
    from sar_compiler.analysis.proofs import search_runs, set_initial_facts
    from sar_compiler.analysis.runtime_monitor import RuntimeMonitor
    from sar_compiler.analysis.verify.limits import find_limits

    known = facts or {}

    def watch(
        simulated: "SimulatedTree", file: "PropertyFile | None", tags: Collection[str]
    ) -> RuntimeMonitor:
        set_initial_facts(simulated, known)
        return RuntimeMonitor(simulated, file, tags, watched, clock, find_limits(simulated, known))

    start = StartValues(parameters or {}, known)
    return search_runs(tree, tree.binding(tree_id), properties, None, start, watch)


def conform_tree(  # noqa: PLR0913 - each has its default
    tree: ProjectTree,
    record: "Iterable[Event]",
    names: Sequence[str],
    properties: str | Path | None = None,
    *,
    is_over: bool,
    start: StartValues,
    facts: Mapping[str, object] | Document | None = None,
    params: str | Path | None = None,
    tree_id: str | None = None,
    is_imported: bool = False,
    earlier: "Sequence[TickSource]" = (),
) -> "Conformance":
    """Compare a recorded run with all possible runs of a tree.

    Args:
        tree: The tree file.
        record: The events of the run.
        names: The names of the nodes that ran, in pre-order.
        properties: As for `LoadedTree.verify`.
        is_over: Whether the run met its own end condition.
        start: The parameters and facts at its start; *facts* override them, and they override files' facts.
        facts: As for `LoadedTree.verify`.
        params: As for `LoadedTree.verify`.
        tree_id: As for `LoadedTree.verify`.
        is_imported: Whether a program with BehaviorTree.CPP ran, whose leaves may be of classes with other rules for scripts.
        earlier: The earlier runs of that program.

    Raises:
        TreeError, UndecidableError, ParameterFileError, ParameterError: As `LoadedTree.verify`.
        OtherTreeError: If the tree has nodes other than those that ran.
    """
    from sar_compiler.analysis.conformance import conform
    from sar_compiler.analysis.cpp_leaves import (
        LeafClasses,
        adopt_cpp_scripts,
        describe_classes,
        possible_classes,
    )
    from sar_compiler.analysis.proofs import search_runs, set_initial_facts
    from sar_compiler.analysis.simulated_tree import Assumptions
    from sar_compiler.analysis.written_values import compare_with_written_values

    binding = tree.binding(tree_id)
    said = _start_values(tree, params, binding)
    begun = StartValues({**said.parameters, **start.parameters}, {**said.facts, **start.facts})
    given = facts.root.mapping if isinstance(facts, Document) else facts or {}

    possible: list[LeafClasses] = []

    def search(
        classes: LeafClasses,
        simulated: "SimulatedTree",
        file: "PropertyFile | None",
        tags: Collection[str],
    ) -> "Conformance":
        set_initial_facts(
            simulated, {name: value for name, value in start.facts.items() if name not in given}
        )
        if is_imported:
            possible[:] = possible_classes(simulated)
            adopt_cpp_scripts(simulated, classes)
        found = conform(simulated, file, tags, record, names, is_over=is_over, earlier=earlier)
        return found._replace(assumed=(*describe_classes(classes), *found.assumed))

    def compare(classes: LeafClasses, more: Assumptions | None) -> "Conformance":
        return search_runs(
            tree, binding, properties, facts, begun, functools.partial(search, classes), more=more
        )

    def best(more: Assumptions | None) -> "Conformance":
        """Return the result with the fewest assumptions about the leaves."""
        first = compare({}, more)
        if first.misfit is None and not first.assumed:
            return first
        tried = [first]
        for classes in [*possible]:
            tried.append(compare(classes, more))
            if tried[-1].misfit is None and len(tried[-1].assumed) == len(classes):
                return tried[-1]
        return next((found for found in tried if found.misfit is None), first)

    return compare_with_written_values(binding, best) if is_imported else best(None)


def predict_tree(  # noqa: PLR0913 - as `LoadedTree.predict`
    tree: ProjectTree,
    properties: str | Path | None = None,
    *,
    outcomes: Iterable[str | Path] = (),
    facts: Mapping[str, object] | Document | None = None,
    params: str | Path | None = None,
    tree_id: str | None = None,
    period_sec: float | None = None,
    max_states: int = 1_000_000,
    budget: "Budget | None" = None,
) -> "Prediction":
    """Compute the tree's probability of success and of its properties, and its duration.

    Args:
        tree: The tree file.
        properties: A file with the properties, and with the probabilities `p` and durations `sec` of outcomes; by
            default the mission's own.
        outcomes: Further files with probabilities of outcomes; the file of properties overrides them.
        facts: As for `verify`.
        params: As for `verify`.
        tree_id: As for `verify`.
        period_sec: The time between two ticks, seconds; by default that of *params*, or half a second.
        max_states: As for `verify`. The behaviour after unexplored states is unknown, which widens the bounds.
        budget: As for `verify`.

    Raises:
        TreeError, UndecidableError, ParameterFileError, ParameterError: As `verify`.
    """
    from sar_compiler.analysis.predict import predict
    from sar_compiler.analysis.proofs import search_runs
    from sar_compiler.analysis.simulate.scenario_files import PERIOD_SEC

    binding = tree.binding(tree_id)
    start = _start_values(tree, params, binding)
    period = period_sec or start.period_sec or PERIOD_SEC
    search = functools.partial(predict, period_sec=period, max_states=max_states, budget=budget)
    return search_runs(tree, binding, properties, facts, start, search, outcomes)
