"""Helpers that play scenarios in tests."""

from textwrap import dedent

from sar_compiler.analysis.simulate.scenario_files import ScenarioSimulation, ScenarioStage, load_scenario
from sar_compiler.analysis.simulate.scenario_run import ScenarioPlayer, ScenarioRun, failures
from sar_compiler.documents.yaml_files import parse_yaml
from sar_compiler.nodes.registry import default_registry
from tests.trees import forest

PATROL = """
<Selector name="Mission" memory="false">
  <Sequence name="Patrol">
    <ZonesRemaining name="ZonesRemaining?"/>
    <NavigateToZone/>
    <DetectSurvivor/>
    <AdvanceZone/>
  </Sequence>
  <NavigateToBase/>
</Selector>
"""


def stage(body: str = PATROL) -> ScenarioStage:
    """Return a stage with one tree."""
    return ScenarioStage(forest(body), default_registry())


def read(text: str, body: str = PATROL) -> ScenarioSimulation:
    """Read a scenario from its text."""
    return load_scenario(parse_yaml(dedent(text), "scenario.yaml", "write something"), stage(body))


def played(text: str, body: str = PATROL) -> ScenarioRun:
    """Play a scenario to its end."""
    play = read(text, body)
    return ScenarioPlayer(play.simulated, play.scenario).run_to_end()


def missed(text: str, body: str = PATROL) -> list[tuple[str, str, int]]:
    """Return the failed expectations of a scenario: the expectation, the message and the line."""
    return [(each.expected, each.message, each.line) for each in failures(played(text, body))]


def answers(run: ScenarioRun, leaf: str) -> list[str]:
    """Return the outcomes of a leaf, tick by tick; `halted` if it was halted."""
    return [
        event.action for event in run.events if event.leaf == leaf and event.what in ("returned", "halted")
    ]
