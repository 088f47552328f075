"""For tests of your own trees.

A golden test holds a compiled tree against a file that was committed, so that a change of the tree, of
the registry or of the compiler shows in a review::

    from sar_compiler.testing import assert_matches_golden

    def test_my_mission_compiles_as_reviewed():
        assert_matches_golden("trees/my_mission.xml", "tests/golden/my_mission.json")

`SAR_RENEW_GOLDEN=1 pytest` writes the files anew.

A scripted run holds what a tree does against what its leaves answer, without ROS::

    from sar_compiler.testing import simulate

    def test_a_zone_that_is_not_reached_at_once_is_tried_again():
        run = simulate("trees/my_mission.xml", NavigateToZone=["aborted", "arrived"]).until_end()
        run.expect(root="SUCCESS", order=["NavigateToZone aborted", "NavigateToZone arrived"])
"""

import json
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import yaml

from sar_compiler.checks.golden import RENEW, difference
from sar_compiler.checks.leaf_words import LeafWords
from sar_compiler.checks.simulate.expecting import read_expectations
from sar_compiler.checks.simulate.judging import Failure, failures
from sar_compiler.checks.simulate.running import Run, ScenarioPlayer
from sar_compiler.checks.simulate.scenario import Scenario
from sar_compiler.checks.simulate.scenario_files import Play, Stage, read_scenario, understand
from sar_compiler.compiler import CompiledTree, bind_main, preview_tree
from sar_compiler.compiler.simulated_tree import SimulatedTree
from sar_compiler.documents.located import Document
from sar_compiler.documents.yaml_files import parse_yaml
from sar_compiler.nodes.registry import Registry, default_registry
from sar_compiler.tree.forest import load_forest
from sar_compiler.tree.reading import read_tree_file
from sar_compiler.views.outline import outline
from sar_compiler.views.text import ascii_tree
from sar_compiler.views.trace import failure_line, trace

__all__ = [
    "RENEW",
    "Simulated",
    "assert_matches_golden",
    "assert_scenario_holds",
    "compiled",
    "simulate",
]


def compiled(tree: str | Path, tree_id: str | None = None, registry: Registry | None = None) -> CompiledTree:
    """Compile a tree file with stand-ins for what only a mission has.

    Args:
        tree: The file.
        tree_id: The tree in it; by default the one that the file executes.
        registry: What tags mean; by default everything installed.

    Raises:
        TreeError: If the tree is not valid.
    """
    return preview_tree(
        bind_main(load_forest(Path(tree), read_tree_file), registry or default_registry(), tree_id)
    )


def assert_matches_golden(
    tree: str | Path, golden: str | Path, tree_id: str | None = None, registry: Registry | None = None
) -> None:
    """Compare a compiled tree with a committed file.

    Args:
        tree: The tree file.
        golden: The committed file: `.json` holds what `sar-compile show --format json` prints, any other
            ending what `--format ascii` prints.
        tree_id: The tree in the file; by default the one that the file executes.
        registry: What tags mean; by default everything installed.

    Raises:
        AssertionError: If they differ, with the difference; or if there is no committed file yet.
    """
    result = compiled(tree, tree_id, registry)
    as_json = Path(golden).suffix == ".json"
    text = (
        json.dumps(outline(result), indent=2, ensure_ascii=False) + "\n"
        if as_json
        else ascii_tree(result.root)
    )
    different = difference(Path(golden), text, f"{tree} (compiled now)")
    if different is not None:
        message = f"the compiled tree is not the committed one:\n{different}"
        raise AssertionError(message)


def simulate(
    tree: str | Path,
    *,
    registry: Registry | None = None,
    leaves: Mapping[str, object] | None = None,
    scenario: Mapping[str, object] | None = None,
    **scripts: object,
) -> "Simulated":
    """Rehearse a tree, to be ticked on a clock that is moved by hand, with leaves that answer by a script.

    What is written is what a scenario's file has, with lists and dictionaries for YAML's.

    Args:
        tree: The file.
        registry: What tags mean; by default everything installed.
        leaves: What leaves answer, by path, name or tag: `{"Patrol/NavigateToZone": ["aborted", "arrived"]}`.
        scenario: What else a scenario says: `{"tree": "Main", "facts": {"zones_left": 1}, "period": "0.1s"}`.
        **scripts: What leaves answer, for names that are Python's: `NavigateToZone=["aborted", "arrived"]`.

    Raises:
        TreeError: If the tree is not valid, or the script says something of a leaf that it never does.
    """
    said = {**(scenario or {}), "leaves": {**(leaves or {}), **scripts}}
    return Simulated(understand(_written(said), _stage(tree, registry)))


def assert_scenario_holds(tree: str | Path, scenario: str | Path, registry: Registry | None = None) -> None:
    """Play a scenario's file, and compare with what it expects.

    Args:
        tree: The tree file.
        scenario: The scenario's file.
        registry: What tags mean; by default everything installed.

    Raises:
        AssertionError: If something does not hold, with the trace.
        TreeError: If the tree or the scenario is not valid.
    """
    run = ScenarioPlayer(*_parts(read_scenario(scenario, _stage(tree, registry)))).go()
    _complain(run, failures(run), run.scenario.expect.trace)


class Simulated:
    """A tree that is being ticked by a script.

    Args:
        play: The tree and the script.
    """

    def __init__(self, play: Play) -> None:
        self._simulation = ScenarioPlayer(*_parts(play))

    @property
    def run(self) -> Run:
        """What has come of it so far, tick by tick."""
        return self._simulation.run

    @property
    def root(self) -> str:
        """What the root came to in the last tick."""
        return self.run.root

    @property
    def facts(self) -> Mapping[str, object]:
        """The facts as they are now."""
        return self.run.simulated.fact_values()

    @property
    def trace(self) -> str:
        """What has happened, as `sar-compile simulate` prints it."""
        return trace(self.run)

    def until_end(self) -> "Simulated":
        """Tick until the end: until the root has succeeded or failed, if the scenario's `until` is nothing else.

        Raises:
            AssertionError: If there is no end within the scenario's `ticks`, or a tick cannot be finished.
        """
        run = self._simulation.go()
        ending = [failure for failure in failures(run) if failure.expected in ("run", "ends")]
        _complain(run, ending)
        return self

    def tick(self, times: int = 1) -> "Simulated":
        """Tick so many times, whether the end has come or not.

        Raises:
            Exception: Whatever a node raises.
        """
        for _ in range(times):
            self._simulation.tick()
        return self

    def expect(self, **expectations: object) -> None:
        """Compare what has happened with what a scenario's `expect` would say: `root`, `order`, `never`, `count`...

        Raises:
            AssertionError: If something does not hold, with the trace.
            TreeError: If something is expected of a leaf that it never does.
        """
        run = self.run
        document = _written({"expect": expectations})
        said = document.hold("scenario").mapping["expect"]
        expect = read_expectations(document, said, run.simulated, LeafWords(run.simulated))
        document.raise_findings()
        if "ends" not in expectations:
            expect = replace(expect, ends=run.ended)
        judged = replace(run, scenario=replace(run.scenario, path="", expect=expect))
        _complain(judged, failures(judged), expect.trace)


def _stage(tree: str | Path, registry: Registry | None) -> Stage:
    return Stage(load_forest(Path(tree), read_tree_file), registry or default_registry())


def _written(said: Mapping[str, object]) -> Document:
    text = yaml.safe_dump(dict(said), allow_unicode=True, sort_keys=False, width=1000)
    return parse_yaml(text, "script", "say what the leaves answer")


def _parts(play: Play) -> tuple[SimulatedTree, Scenario]:
    return play.simulated, play.scenario


def _complain(run: Run, missed: list[Failure], golden: Path | None = None) -> None:
    """Raise what does not hold, with the trace."""
    different = difference(golden, trace(run), "the trace now") if golden else None
    if different is not None:
        missed = [*missed, Failure("trace", different)]
    if missed:
        lines = [failure_line(run, failure) for failure in missed]
        message = "\n".join([*lines, "", trace(run)])
        raise AssertionError(message)
