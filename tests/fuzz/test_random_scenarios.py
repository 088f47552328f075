"""Tests that a changed scenario either runs or has findings."""

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sar_compiler.analysis.simulate.scenario_files import ScenarioSimulation, ScenarioStage, load_scenario
from sar_compiler.analysis.simulate.scenario_run import ScenarioPlayer, failures
from sar_compiler.analysis.trace_view import trace
from sar_compiler.documents.yaml_files import parse_yaml
from sar_compiler.nodes.registry import default_registry
from sar_compiler.tree.diagnostic import Diagnostic, TreeError
from sar_compiler.tree.discovery import read_tree_file
from sar_compiler.tree.forest import load_forest

SCENARIOS = [path.read_text(encoding="utf-8") for path in sorted(Path("examples/scenarios").glob("*.yaml"))]
PIECES = [
    *"{}[]:,-'\"#&*!|>%@`? \n",
    "always",
    "when",
    "4s",
    "SUCCESS",
    "zones_left",
    "NavigateToZone arrived",
    "-1",
]


@pytest.fixture(scope="module")
def stage() -> ScenarioStage:
    return ScenarioStage(load_forest(Path("trees/search_and_rescue.xml"), read_tree_file), default_registry())


@st.composite
def changed_scenario(draw: st.DrawFn) -> str:
    """Return a shipped scenario with a few stretches replaced."""
    text = draw(st.sampled_from(SCENARIOS))
    for _ in range(draw(st.integers(1, 4))):
        start = draw(st.integers(0, len(text)))
        end = min(len(text), start + draw(st.integers(0, 12)))
        text = text[:start] + "".join(draw(st.lists(st.sampled_from(PIECES), max_size=3))) + text[end:]
    return text


def load_or_findings(
    text: str, stage: ScenarioStage
) -> tuple[ScenarioSimulation | None, tuple[Diagnostic, ...]]:
    """Return the loaded scenario, or its findings."""
    try:
        return load_scenario(parse_yaml(text, "scenario.yaml", "write something"), stage), ()
    except TreeError as error:
        return None, error.findings


@given(changed_scenario())
def test_changed_scenario_runs_or_has_located_findings(stage, text):
    play, findings = load_or_findings(text, stage)
    lines = text.count("\n") + text.count("\r") + 1
    assert all(finding.render() and finding.span.line <= lines for finding in findings)
    if play is None:
        assert findings
        return
    run = ScenarioPlayer(play.simulated, play.scenario).run_to_end()
    assert "Error:" not in run.trouble  # only errors that the project raises itself
    assert trace(run)
    assert isinstance(failures(run), list)
