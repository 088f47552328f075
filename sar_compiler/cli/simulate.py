"""`sar-compile simulate`: tick a tree with the leaf outcomes that scenarios define, without ROS."""

import argparse
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from sar_compiler.cli.arguments import (
    INPUT_HELP,
    TREE_INPUT,
    YAML_FILE,
    add_budget,
    add_mission,
    add_params,
    add_project_options,
    add_tree_id,
    budget_of,
    count,
    load_checked,
    seed,
)
from sar_compiler.commands import FINDINGS, OK, USAGE, print_error, print_text
from sar_compiler.errors import SarError
from sar_compiler.opener import is_folder
from sar_compiler.tree.guessing import did_you_mean

if TYPE_CHECKING:
    from sar_compiler.analysis.simulate.scenario_files import ScenarioStage
    from sar_compiler.analysis.simulate.scenario_run import Failure, OutcomeCoverage, ScenarioRun
    from sar_compiler.analysis.simulated_tree import SimulatedTree
    from sar_compiler.analysis.trace_view import PlayedScenario
    from sar_compiler.budget import Budget
    from sar_compiler.runtime.expressions import Script


class ScenarioFolderError(SarError):
    """A folder passed to `--scenario` contains no scenario file."""


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of `simulate`."""
    add = parser.add_argument
    add("file", type=TREE_INPUT, metavar="FILE", help=INPUT_HELP)
    text = "a scenario file, or a folder of scenario files; may be repeated (default: every leaf has its usual outcome)"
    add("--scenario", action="append", default=[], type=YAML_FILE, metavar="S.yaml", help=text)
    add_tree_id(parser, "tick")
    add("--ticks", type=count, metavar="N", help="stop after N ticks; stopping in this way is not a failure")
    text = "end when this condition is true; it can use facts, keys, 'root', 'tick' and 'time' (default: when the root has succeeded or failed)"
    add("--until", type=script, metavar="SCRIPT", help=text)
    text = "the seed of a scenario's random choices (default 0)"
    add("--seed", type=seed, default=0, metavar="N", help=text)
    text = "list the nodes and outcomes that the scenarios do not cover"
    add("--coverage", action="store_true", help=text)
    add_params(parser)
    add_project_options(parser)
    add_mission(parser)
    add_budget(parser)
    text = "text for people (default), json for scripts, or junit for continuous integration"
    add("--format", choices=("text", "json", "junit"), default="text", help=text)
    parser.set_defaults(run=simulate_file)


def simulate_file(arguments: argparse.Namespace) -> int:
    """Run the scenarios, and return the exit status.

    The exit status is 0 if all expectations are met, 130 after Ctrl-C, and otherwise 1.

    Raises:
        TreeError: If the tree has errors.
        UnreadableFileError: If the tree file does not exist or cannot be read.
    """
    from sar_compiler.analysis.simulate.scenario_run import OutcomeCoverage
    from sar_compiler.analysis.trace_view import PlayedScenario
    from sar_compiler.analysis.tree_analysis import stage_of

    stage = stage_of(load_checked(arguments, arguments.file)[0], arguments.tree, arguments.params)
    stage.binding()
    coverage, budget, played = OutcomeCoverage(), budget_of(arguments), list[PlayedScenario]()
    files = scenario_files(arguments.scenario)
    for path in files:
        if not budget.reason:
            played.append(_play(path, stage, coverage, budget, arguments))
    _print(played, coverage, arguments)
    if budget.reason:
        print_error(f"sar-compile: {budget.reason} ({len(played)} of {len(files)} scenarios were started)")
        return budget.exit_status
    if any(each.run is None and not each.is_finding for each in played):
        return USAGE
    return FINDINGS if any(each.failures or each.is_finding for each in played) else OK


def scenario_files(paths: "list[Path]") -> "list[Path | None]":
    """Return the scenario files in the given paths.

    Without paths, the result is `[None]`, which stands for one run without a scenario.

    Raises:
        ScenarioFolderError: If a folder contains no scenario file.
    """
    files: list[Path | None] = []
    for path in paths:
        if is_folder(path):
            found = sorted([*path.glob("*.yaml"), *path.glob("*.yml")])
            if not found:
                raise ScenarioFolderError(f"{path} contains no scenario file, such as scenario.yaml")
            files += found
        else:
            files.append(path)
    return files or [None]


def _play(
    path: Path | None,
    stage: "ScenarioStage",
    coverage: "OutcomeCoverage",
    budget: "Budget",
    arguments: argparse.Namespace,
) -> "PlayedScenario":
    """Run a scenario, or print the error if the scenario cannot be run."""
    from sar_compiler.analysis.simulate.scenario_files import read_scenario
    from sar_compiler.analysis.simulate.scenario_run import ScenarioPlayer, failures
    from sar_compiler.analysis.simulated_tree import UnknownBehaviourError
    from sar_compiler.analysis.trace_view import PlayedScenario
    from sar_compiler.runtime.evaluation import Program
    from sar_compiler.tree.diagnostic import TreeError

    try:
        play = stage.play() if path is None else read_scenario(path, stage)
    except SarError as error:
        is_finding = isinstance(error, (UnknownBehaviourError, TreeError))
        print_error(str(error) if is_finding else f"sar-compile: {error}")
        return PlayedScenario(str(path or arguments.file), problem=str(error), is_finding=is_finding)
    for finding in play.scenario.warnings:
        print_error(finding.render())
    error_in_until = _typo_message(arguments.until, play.simulated) if arguments.until else None
    if error_in_until is not None:
        print_error(f"sar-compile: {error_in_until}")
        return PlayedScenario(str(path or arguments.file), problem=error_in_until)
    until = Program(arguments.until, play.simulated.enums) if arguments.until else play.scenario.until
    max_ticks = arguments.ticks or play.scenario.max_ticks
    scenario = replace(play.scenario, until=until, max_ticks=max_ticks, seed=arguments.seed)
    player = ScenarioPlayer(play.simulated, scenario)

    def run_scenario() -> "ScenarioRun":
        # The ticks are copied, because an abandoned run may still append to them.
        budget.publish(lambda: replace(player.run, ticks=[*player.run.ticks]))
        return player.run_to_end(budget.is_spent)

    run = budget.run(run_scenario)
    coverage.add(run)
    missed = [*failures(run), *_trace_failure(run)]
    if arguments.ticks is not None and not run.ended:
        missed = [failure for failure in missed if failure.expected != "ends"]
    return PlayedScenario(scenario.name, run, tuple(missed))


def _typo_message(until: "Script", simulated: "SimulatedTree") -> str | None:
    """Return a message about a typo in the argument of `--until`; None if there is no typo."""
    from sar_compiler.analysis.leaf_vocabulary import names_of, typos
    from sar_compiler.analysis.simulate.scenario_files import OWN

    typo = next(typos(until, names_of(simulated), OWN), None)
    if typo is None:
        return None
    advice = did_you_mean(typo.suggestion) or (f"; {typo.hint}" if typo.hint else "")
    return f"--until: {typo.message}{advice}"


def _trace_failure(run: "ScenarioRun") -> "list[Failure]":
    """Compare a run's trace with the scenario's trace file.

    The result contains a failure if the traces differ. It is empty if they are equal, or if there is no trace file.
    """
    from sar_compiler.analysis.simulate.scenario_run import Failure
    from sar_compiler.analysis.trace_view import trace
    from sar_compiler.checks.golden import compare_golden

    expect = run.scenario.expect
    different = compare_golden(expect.trace, trace(run), "the trace now") if expect.trace else None
    return [Failure("trace", different, expect.lines.get("trace", 0))] if different else []


def _print(
    played: "list[PlayedScenario]", coverage: "OutcomeCoverage", arguments: argparse.Namespace
) -> None:
    from sar_compiler.analysis.trace_view import coverage_text, junit, runs_as_json, trace, verdict

    shown = coverage if arguments.coverage else None
    if arguments.format == "json":
        print(runs_as_json(arguments.file, played, shown))
        return
    if arguments.format == "junit":
        print(junit(arguments.file, played), end="")
        return
    for each in played:
        if each.run is not None:
            print_text(f"{trace(each.run)}{verdict(each.run, each.failures)}\n")
    if len(played) > 1:
        passed = sum(each.run is not None and not each.failures for each in played)
        print(f"{passed} of {len(played)} scenarios passed.")
    if shown is not None:
        print_text(coverage_text(shown))


def script(text: str) -> "Script":
    """Parse the condition that `--until` specifies."""
    from sar_compiler.runtime.script import parse
    from sar_compiler.runtime.tokens import ScriptError

    try:
        return parse(text)
    except ScriptError as error:
        message = f"'{text}' is not a valid condition: {error}{did_you_mean(error.suggestion)}"
        raise argparse.ArgumentTypeError(message) from error
