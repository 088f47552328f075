"""Tests of tree reuse: a reused tree plays each run exactly as a newly compiled tree does."""

import random
from collections.abc import Iterator
from dataclasses import replace

import pytest

from sar_compiler.analysis.simulate.reused_tree import ReusedTree
from sar_compiler.analysis.simulate.scenario_files import (
    Scenario,
    ScenarioSimulation,
    ScenarioStage,
    load_scenario,
)
from sar_compiler.analysis.simulate.scenario_run import Player, ScenarioPlayer, failures
from sar_compiler.documents.yaml_files import parse_yaml
from sar_compiler.tree.diagnostic import TreeError
from sar_compiler.tree.forest import Forest
from sar_compiler.tree.xml import parse_xml
from tests.random_inputs import rounds
from tests.runtime.kernel.random_trees import RandomTree
from tests.runtime.kernel.stage import entries, registry

SCENARIO = """
ticks: 30
period: 0.05
until: "{until}"
parameters: {{a: 0, b: 1, n: 0}}
leaves:
  {leaf}:
    - {{outcome: RUNNING, probability: 0.2, times: 3}}
    - {{outcome: FAILURE, after: 0s to 0.6s, probability: 0.4, times: always}}
    - {{outcome: SUCCESS, probability: 0.7, every: 2, when: "n != 2", times: always}}
"""
ENDS = ("tick == 20", "n == 3", "root == 'SUCCESS'", "time > 1 || b == 0")


def compile_scenario(stage: ScenarioStage, text: str) -> ScenarioSimulation:
    """Compile a tree for a scenario, with lists and a queue among its keys."""
    play = load_scenario(parse_yaml(text, "scenario.yaml", ""), stage)
    for key, value in entries().items():
        play.simulated.compiled.instance.scope.resolve(key).write(value)
    return play


def random_plays(count: int, *, skips: bool) -> Iterator[tuple[ScenarioStage, str, ScenarioSimulation]]:
    """Yield random trees on stages, each with a valid scenario as text and compiled."""
    seed = 0
    while count:
        seed += 1
        stage = ScenarioStage(Forest.from_file(parse_xml(RandomTree(seed, skips=skips).text())), registry())
        until = random.Random(seed).choice(ENDS)  # noqa: S311 - the same trees in every run
        text = SCENARIO.format(leaf="Skipper" if skips else "Probe", until=until)
        try:
            play = compile_scenario(stage, text)
        except TreeError:
            continue
        count -= 1
        yield stage, text, play


def with_random_outcomes(scenario: Scenario, seed: int) -> Scenario:
    return replace(scenario, seed=seed, unusual=0.3)


def observations(player: Player) -> dict[str, object]:
    """Return all observable results of a run."""
    run, board = player.run, player.run.simulated.compiled.board
    return {
        "events": list(run.events),
        "end": (run.root, run.time_sec, run.ended, run.trouble.replace(board.prefix, "")),
        "choices": [(choice.leaf.path, *choice[1:]) for choice in player.scripted.choices],
        "failures": [] if run.trouble else failures(run),
        "facts": run.simulated.fact_values(),
        "keys": board.values(),
    }


@pytest.mark.unmeasured
@pytest.mark.parametrize("skips", [False, True], ids=["stock", "skips"])
def test_reused_tree_plays_every_run_as_new_tree_does(skips):
    for stage, text, play in random_plays(rounds(120), skips=skips):
        tree = ReusedTree(play.simulated)
        for seed in (0, 1, 0):
            fresh = compile_scenario(stage, text)
            player = ScenarioPlayer(fresh.simulated, with_random_outcomes(fresh.scenario, seed))
            player.run_to_end()
            assert observations(tree.play(with_random_outcomes(play.scenario, seed))) == observations(player)
