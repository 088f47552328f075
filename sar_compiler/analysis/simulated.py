"""Lets Python tests simulate a loaded tree, with scripted outcomes of leaves, and check the results."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from sar_compiler.analysis.leaf_vocabulary import LeafVocabulary
from sar_compiler.analysis.simulate.scenario_files import (
    ScenarioSimulation,
    load_scenario,
    read_expectations,
    read_scenario,
)
from sar_compiler.analysis.simulate.scenario_run import Failure, ScenarioPlayer, ScenarioRun, failures
from sar_compiler.analysis.trace_view import failure_line, trace
from sar_compiler.analysis.tree_analysis import stage_of
from sar_compiler.checks.golden import compare_golden
from sar_compiler.documents.located import Document
from sar_compiler.documents.yaml_files import document_from_data
from sar_compiler.project.project_tree import ProjectTree


def simulate_tree(tree: ProjectTree, script: Mapping[str, object]) -> "Simulated":
    """Return a simulation of a tree with scripted outcomes of leaves; see `LoadedTree.simulate`."""
    return Simulated(load_scenario(_document(script), stage_of(tree)))


def play_scenario(tree: ProjectTree, scenario: str | Path) -> None:
    """Play a scenario file, and compare the result with the file's expectations.

    Raises:
        AssertionError: If an expectation is not met; contains the trace.
        TreeError: If the tree or the scenario is not valid.
    """
    play = read_scenario(scenario, stage_of(tree))
    tree.report_warnings(play.scenario.warnings)
    run = ScenarioPlayer(play.simulated, play.scenario).run_to_end()
    _raise_unmet(run, failures(run), run.scenario.expect.trace)


class Simulated:
    """A simulation of a tree in which a script determines the outcomes of leaves."""

    def __init__(self, play: ScenarioSimulation) -> None:
        self._simulation = ScenarioPlayer(play.simulated, play.scenario)

    def __repr__(self) -> str:
        return f"<{type(self).__name__}: root {self.root} after tick {len(self.run.ticks)}>"

    @property
    def run(self) -> ScenarioRun:
        """The run, with the ticks played so far."""
        return self._simulation.run

    @property
    def root(self) -> str:
        """The root's status after the last tick."""
        return self.run.root

    @property
    def facts(self) -> Mapping[str, object]:
        """The current facts."""
        return self.run.simulated.fact_values()

    @property
    def trace(self) -> str:
        """The trace of the run so far, in the form that `sar-compile simulate` prints."""
        return trace(self.run)

    def run_to_end(self) -> "Simulated":
        """Tick until the scenario's end condition is met.

        By default, the run ends when the root succeeds or fails.

        Raises:
            AssertionError: If there is no end within the scenario's `ticks`, or a tick cannot be finished.
        """
        run = self._simulation.run_to_end()
        _raise_unmet(run, [failure for failure in failures(run) if failure.expected in ("run", "ends")])
        return self

    def tick(self, times: int = 1) -> "Simulated":
        """Tick the tree the given number of times, even if the run has already ended.

        Raises:
            Exception: Any exception of a node.
        """
        for _ in range(times):
            self._simulation.tick()
        return self

    def expect(self, *, trace: str | Path | None = None, **expectations: object) -> None:
        """Compare the run with expectations. They have the same form as the section `expect` of a scenario.

        Args:
            trace: The path of the file with the expected trace, relative to the current folder.
            **expectations: The other expectations.

        Raises:
            AssertionError: If an expectation is not met; contains the trace.
            TreeError: If an expected outcome is impossible for its leaf.
        """
        run = self.run
        document = _document({"expect": expectations})
        parts = document.validate("scenario").mapping["expect"]
        expect = read_expectations(parts, LeafVocabulary(document, run.simulated))
        document.raise_findings()
        if "ends" not in expectations:
            expect = replace(expect, ends=run.ended)
        judged = replace(run, scenario=replace(run.scenario, path="", expect=expect))
        _raise_unmet(judged, failures(judged), None if trace is None else Path(trace))


def _document(parts: Mapping[str, object]) -> Document:
    return document_from_data(parts, "script", "list the outcomes of the leaves")


def _raise_unmet(run: ScenarioRun, missed: list[Failure], golden: Path | None = None) -> None:
    """Raise an error if expectations are violated.

    The error contains the violated expectations and the trace.
    """
    different = compare_golden(golden, trace(run), "the trace now") if golden else None
    if different is not None:
        missed = [*missed, Failure("trace", different)]
    if missed:
        lines = [failure_line(run, failure) for failure in missed]
        raise AssertionError("\n".join([*lines, "", trace(run)]))
