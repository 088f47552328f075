"""Searches the runs of a loaded tree under the assumptions of a properties file and the user's facts."""

import contextlib
import functools
from collections.abc import Callable, Collection, Iterable, Mapping
from pathlib import Path
from typing import TypeVar

from sar_compiler.analysis.assumptions import (
    StartValues,
    apply_controls,
    check_outcomes,
    raise_disputes,
    read_assumptions,
    start_assumptions,
)
from sar_compiler.analysis.bounded_search import SearchBudget, can_prepare, findings_of_runs, mark
from sar_compiler.analysis.leaf_vocabulary import LeafVocabulary
from sar_compiler.analysis.simulated_tree import Assumptions, SimulatedTree, compile_simulated
from sar_compiler.analysis.verify.properties import PropertyFile, read_property_file
from sar_compiler.documents.located import Document
from sar_compiler.errors import SarError
from sar_compiler.nodes.binding.bound import Binding
from sar_compiler.opener import allow_reading
from sar_compiler.parts import is_part_installed
from sar_compiler.project.project_tree import ProjectTree
from sar_compiler.runtime.outcomes import Fact
from sar_compiler.tree.diagnostic import Diagnostic

SearchResult = TypeVar("SearchResult")
TreeSearch = Callable[[SimulatedTree, PropertyFile | None, Collection[str]], SearchResult]
"""A search function such as `verify.verify`. Its arguments are the tree, the properties file and all leaf tags."""


def search_runs(
    tree: ProjectTree,
    binding: Binding,
    properties: str | Path | None,
    facts: Mapping[str, object] | Document | None,
    start: StartValues,
    search: TreeSearch[SearchResult],
    outcomes: Iterable[str | Path] = (),
    more: Assumptions | None = None,
) -> SearchResult:
    """Search a bound tree's runs under the assumptions of the files and of *more*, and return the result."""
    path = default_properties(tree, binding) if properties is None else properties
    file = None if path is None else read_property_file(path)
    others = [read_property_file(each) for each in outcomes]
    parameters = {**start.parameters, **({} if file is None else file.parameters)}
    # All findings about the properties file are raised together.
    with contextlib.nullcontext() if file is None else file.document.prefer_findings():
        if file is not None and file.controls is not None:
            files = (*tree.project.palettes, *tree.forest.files)
            apply_controls(file.document, file.controls, binding, tree.project.registry, files)
        compiled = functools.partial(compile_simulated, binding, parameters, all_runs=True)
        simulated = compiled()
        assumed = start_assumptions(start, simulated)
        for each in others:
            assumed |= read_assumptions(each.document, each.facts, each.outcomes, simulated)
            each.document.raise_findings()
        if file is not None:
            assumed |= read_assumptions(file.document, file.facts, file.outcomes, simulated)
        if facts:
            # The file may declare additional facts.
            assumed |= _user_assumptions(facts, compiled(assumed))
        if more is not None:
            assumed |= more
        if assumed != Assumptions():
            simulated = compiled(assumed)
        raise_disputes(simulated)
        for each in others if file is None else [file, *others]:
            tree.report_warnings(each.document.warnings)
        if file is not None:
            check_outcomes(file.outcomes, LeafVocabulary(file.document, simulated))
        return search(simulated, file, {spec.tag for spec in tree.project.registry if spec.kind.is_leaf})


def set_initial_facts(simulated: SimulatedTree, facts: Mapping[str, Fact]) -> None:
    """Set the initial facts of a run. These facts override the facts of a properties file."""
    for name in facts.keys() & simulated.fact_values().keys():
        simulated.facts.resolve(name).write(facts[name])


def try_runs(tree: ProjectTree, binding: Binding, budget: SearchBudget, how_to_see: str) -> list[Diagnostic]:
    """Return findings about the ticks in which a bound tree raises errors; see `trial.try_tree`."""
    if not can_prepare(binding, budget):
        return []
    mark(binding)

    def search(
        simulated: SimulatedTree, _file: PropertyFile | None, _tags: Collection[str]
    ) -> list[Diagnostic]:
        return findings_of_runs(simulated, binding, budget, how_to_see, tree.findings)

    try:
        return search_runs(tree, binding, None, None, StartValues(), search)
    except SarError:  # a missing parameter or an unknown node: `verify` reports it
        return []


def default_properties(tree: ProjectTree, binding: Binding) -> Path | None:
    """Return the default properties file of a bound tree's mission, or None if there is no such file."""
    if not is_part_installed("missions"):
        return None
    from sar_compiler.missions.mission_choice import mission_of

    mission = mission_of(tree, binding)
    if mission is None:
        return None
    specs = [bound.spec for bound in binding.all_nodes() if bound.spec.kind.is_leaf]
    path = mission.default_properties({spec.cls for spec in specs if spec.cls and not spec.signature.factory})
    if path is not None:
        allow_reading(path)
    return path


def _user_assumptions(facts: Mapping[str, object] | Document, simulated: SimulatedTree) -> Assumptions:
    if not isinstance(facts, Document):
        from sar_compiler.documents.yaml_files import document_from_data

        facts = document_from_data(facts, "facts", "name a fact")
    assumed = read_assumptions(facts, facts.root, None, simulated)
    facts.raise_findings()
    return assumed
