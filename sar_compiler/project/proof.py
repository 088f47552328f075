"""Verifying a loaded tree, with a file of properties and the user's facts."""

import contextlib
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from sar_compiler.checks.assumptions import raise_disputes, read_assumptions
from sar_compiler.checks.verify import PropertyFile, Report, Verification, read_property_file, verify
from sar_compiler.compiler.simulated_tree import Assumptions, SimulatedTree, compile_simulated
from sar_compiler.documents.located import Document
from sar_compiler.documents.yaml_files import document_of
from sar_compiler.missions.choosing import choose_mission
from sar_compiler.nodes.binding.bound import Binding

if TYPE_CHECKING:
    from sar_compiler.project import LoadedTree


def verified(
    tree: "LoadedTree",
    binding: Binding,
    properties: str | Path | None,
    facts: Mapping[str, object] | Document | None,
    max_states: int,
    report: Report,
) -> Verification:
    """Verify a bound tree; see `LoadedTree.verify`."""
    file = _properties(properties, binding, tree.project.checkout)
    parameters = {} if file is None else file.parameters
    # The findings about the file are raised when all of them are known.
    with contextlib.nullcontext() if file is None else file.document.findings_first():
        simulated = compile_simulated(binding, parameters)
        assumed = Assumptions()
        if file is not None:
            assumed = read_assumptions(file.document, file.facts, file.answers, simulated)
        if facts:
            # The file may declare facts of its own.
            typed = _of_the_user(facts, compile_simulated(binding, parameters, assumed))
            assumed = Assumptions({**assumed.facts, **typed.facts}, assumed.answers)
        simulated = compile_simulated(binding, parameters, assumed)
        raise_disputes(simulated)
        tags = {spec.tag for spec in tree.project.registry if spec.kind.is_leaf}
        return verify(simulated, file, tags, max_states, report)


def _properties(path: str | Path | None, binding: Binding, checkout: Path) -> PropertyFile | None:
    """Return the properties: those that the user names, else those of the tree's mission."""
    mission = choose_mission(binding, checkout=checkout) if path is None else None
    if mission is not None:
        path = mission.default_properties({bound.spec.cls for bound in binding.nodes() if bound.spec.cls})
    return None if path is None else read_property_file(path)


def _of_the_user(facts: Mapping[str, object] | Document, simulated: SimulatedTree) -> Assumptions:
    if not isinstance(facts, Document):
        facts = document_of(facts, "facts", "name a fact")
    said = read_assumptions(facts, facts.root, None, simulated)
    facts.raise_findings()
    return said
