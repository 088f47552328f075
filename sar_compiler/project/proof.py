"""Verifying a loaded tree, with what a file of properties and its user say of the world."""

import contextlib
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import yaml

from sar_compiler.checks.assumptions import raise_disputes, read_assumptions
from sar_compiler.checks.verify import Progress, PropertyFile, Verification, read_property_file, verify
from sar_compiler.compiler.simulated_tree import Assumptions, SimulatedTree, compile_simulated
from sar_compiler.documents.located import Document
from sar_compiler.documents.yaml_files import parse_yaml
from sar_compiler.nodes.binding.bound import Binding
from sar_compiler.resources import shipped

if TYPE_CHECKING:
    from sar_compiler.project import LoadedTree

# A tree with these leaves is a mission with zones.
_MISSION_LEAVES = {"ZonesRemaining", "NavigateToBase"}
_MISSION_PROPERTIES = ("config", "mission_properties.yaml")


def verified(
    tree: "LoadedTree",
    binding: Binding,
    properties: str | Path | None,
    facts: Mapping[str, object] | Document | None,
    max_states: int,
    report: Callable[[Progress], None],
) -> Verification:
    """Verify a bound tree; see `LoadedTree.verify`."""
    file = _properties(properties, binding)
    parameters = {} if file is None else file.parameters
    # What is wrong with the file is raised when all of it is known.
    with contextlib.nullcontext() if file is None else file.document.findings_first():
        simulated = compile_simulated(binding, parameters)
        assumed = Assumptions()
        if file is not None:
            assumed = read_assumptions(file.document, file.facts, file.answers, simulated)
        if facts:
            # What the file says may be about facts of its own.
            typed = _of_the_user(facts, compile_simulated(binding, parameters, assumed))
            assumed = Assumptions({**assumed.facts, **typed.facts}, assumed.answers)
        simulated = compile_simulated(binding, parameters, assumed)
        raise_disputes(simulated)
        tags = {spec.tag for spec in tree.project.registry if spec.kind.is_leaf}
        return verify(simulated, file, tags, max_states, report)


def _properties(path: str | Path | None, binding: Binding) -> PropertyFile | None:
    """Return what must hold: what the user names, else the mission's own for a mission."""
    if path is not None:
        return read_property_file(path)
    if {bound.spec.tag for bound in binding.nodes()} >= _MISSION_LEAVES:
        return read_property_file(shipped(*_MISSION_PROPERTIES))
    return None


def _of_the_user(facts: Mapping[str, object] | Document, simulated: SimulatedTree) -> Assumptions:
    """Return what the user says of facts."""
    if not isinstance(facts, Document):
        text = yaml.safe_dump(dict(facts), allow_unicode=True, sort_keys=False)
        facts = parse_yaml(text, "facts", "name a fact")
    said = read_assumptions(facts, facts.root, None, simulated)
    facts.raise_findings()
    return said
