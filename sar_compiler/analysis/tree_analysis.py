"""Analyses the runs of a loaded tree: simulates, verifies, predicts, monitors or compares them."""

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
    """Read the start values of a tree's runs from a parameter file without ROS, and report unusual values.

    Raises:
        ParameterFileError: If ROS would refuse or misread the file.
        ParameterError: If the mission cannot start with the parameters.
    """
    if params is None or isinstance(params, StartValues):
        return params or StartValues()
    from sar_compiler.missions.mission_start import start_without_ros

    values, _, started = start_without_ros(tree, Path(params), binding)
    for text in started.notes:
        tree.note(text if text.startswith(f"{params}:") else f"{params}: {text}")
    return StartValues(values, started.mission.initial_facts(), 1.0 / started.parameters.tick_rate_hz)


def stage_of(
    tree: ProjectTree, tree_id: str | None = None, params: str | Path | StartValues | None = None
) -> "ScenarioStage":
    """Return the tree together with the settings for simulating scenarios on this tree.

    Args:
        tree: The tree file.
        tree_id: The ID of the tree to simulate if a scenario names none; by default the tree that the file executes.
        params: The mission's ROS parameter file or start values; by default only leaves declare start values of facts.

    Raises:
        TreeError: If the tree file has errors.
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
        properties: The properties file; by default the mission's properties file.
        facts: The initial values of facts, such as `{"rooms_left": 4}`; they override the facts of the properties file.
        params: The mission's ROS parameter file; *properties* and *facts* override its values.
        tree_id: The ID of the tree to verify; by default the tree that the file executes.
        max_states: The maximum number of states to explore.
        budget: Limits time and memory, and receives the progress; by default only the number of states is limited.

    Raises:
        TreeError: If the tree or the properties file has errors, or a property cannot apply to the tree.
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
    """Return a monitor that checks properties while a tree runs.

    Args:
        tree: The tree file.
        watched: The compiled tree that runs.
        properties: The properties file, as for `LoadedTree.verify`.
        facts: The facts at the start of the run; they override the facts of the properties file.
        parameters: The values of the root blackboard's keys.
        tree_id: The ID of the tree; by default the tree that the file executes.
        clock: Returns the time in seconds since the start of the run.

    Raises:
        TreeError, UndecidableError: As for `LoadedTree.verify`.
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
        properties: The properties file, as for `LoadedTree.verify`.
        is_over: Whether the run met its own end condition.
        start: The recorded parameters and facts at the start of the run. They override files, and *facts* overrides
            them.
        facts: The initial values of facts, as for `LoadedTree.verify`.
        params: The parameter file, as for `LoadedTree.verify`.
        tree_id: The ID of the tree, as for `LoadedTree.verify`.
        is_imported: Whether the run was imported from BehaviorTree.CPP, in which leaf classes treat scripts differently.
        earlier: The earlier runs of that program.

    Raises:
        TreeError, UndecidableError, ParameterFileError, ParameterError: As for `LoadedTree.verify`.
        OtherTreeError: If the nodes that ran are not the nodes of the tree.
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
    from_file = _start_values(tree, params, binding)
    assumed_start = StartValues(
        {**from_file.parameters, **start.parameters}, {**from_file.facts, **start.facts}
    )
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
            tree, binding, properties, facts, assumed_start, functools.partial(search, classes), more=more
        )

    def best(more: Assumptions | None) -> "Conformance":
        """Return the result of the comparison that needs the fewest assumptions about leaves."""
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
    """Predict the tree's success probability, the probability that each property holds, and the duration.

    Args:
        tree: The tree file.
        properties: The properties file, which also contains the probabilities `p` and the durations `sec` of outcomes;
            by default the mission's properties file.
        outcomes: Further files with probabilities of outcomes; the properties file overrides them.
        facts: The initial values of facts, as for `verify`.
        params: The parameter file, as for `verify`.
        tree_id: The ID of the tree, as for `verify`.
        period_sec: The time between two ticks, in seconds; by default the period in *params*, or half a second.
        max_states: The maximum number of states to explore. Unexplored behaviour is unknown, which widens the bounds.
        budget: The budget, as for `verify`.

    Raises:
        TreeError, UndecidableError, ParameterFileError, ParameterError: As for `verify`.
    """
    from sar_compiler.analysis.predict import predict
    from sar_compiler.analysis.proofs import search_runs
    from sar_compiler.analysis.simulate.scenario_files import PERIOD_SEC

    binding = tree.binding(tree_id)
    start = _start_values(tree, params, binding)
    period = period_sec or start.period_sec or PERIOD_SEC
    search = functools.partial(predict, period_sec=period, max_states=max_states, budget=budget)
    return search_runs(tree, binding, properties, facts, start, search, outcomes)
