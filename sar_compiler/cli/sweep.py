"""`sar-compile sweep`: how often a tree succeeds, by many simulated runs."""

import argparse
import itertools
import shlex
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from sar_compiler.cli.arguments import TREE, YAML_FILE, add_tree_id, count
from sar_compiler.cli.loading import FILE_HELP, add_project_options, additions, workspace
from sar_compiler.cli.simulate import scenario_files, script
from sar_compiler.cli.sweep_command import (
    Written,
    add_sweep_options,
    add_varied_parameters,
    parse_variation,
    probabilities,
    run_sweep,
)
from sar_compiler.cli.writing import write_text
from sar_compiler.commands import CommandParser
from sar_compiler.errors import SarError

if TYPE_CHECKING:
    from sar_compiler.checks.sweep import Played, SweptRow
    from sar_compiler.project.swept import ScenarioRuns

# Half the width of the interval of a tree that always succeeds is below 0.02 after four batches.
_BATCH = 25


class NothingByChanceError(SarError):
    """All runs of a sweep would be the same."""


def add_sweep(parser: CommandParser) -> None:
    """Add the arguments of `sweep`."""
    add = parser.add_argument
    add("file", type=TREE, metavar="FILE", help=FILE_HELP)
    text = "the leaves' answers, each with its chance; or a folder of such files; may be repeated"
    add("--scenario", action="append", default=[], type=YAML_FILE, metavar="S.yaml", help=text)
    text = "the chance (0 to 1) of an unusual answer from a leaf that the scenario does not mention; with commas, one after the other (default 0)"
    add("--unusual", type=probabilities, default=(0.0,), metavar="P,P", help=text)
    add_varied_parameters(parser, "parameter")
    text = "vary the initial value of a fact: each value in turn; may be repeated"
    add("--set", action="append", default=[], type=parse_variation, metavar="FACT=A,B", help=text)
    text = "count an event, such as 'NavigateTo halted'; may be repeated"
    add("--count", action="append", default=[], metavar="EVENT", help=text)
    add_tree_id(parser, "tick")
    add("--ticks", type=count, metavar="N", help="stop a run after N ticks")
    text = "end a run when this is true (default: when the root has succeeded or failed)"
    add("--until", type=script, metavar="SCRIPT", help=text)
    add_project_options(parser)
    add_sweep_options(parser, runs=1000, half_width=0.02)
    parser.set_defaults(run=sweep_file)


def sweep_file(arguments: argparse.Namespace) -> int:
    """Play the combinations, print the table, and return the exit status: 0 if no run has failed.

    Raises:
        TreeError: If the tree, a scenario, or what is varied is not valid.
        SarError: If a file cannot be read, or nothing is left to chance.
    """
    from sar_compiler.checks.sweep.workers import in_processes
    from sar_compiler.project.swept import smallest_scenario

    rows = dict(_rows(arguments))
    if not any(runs.are_by_chance() for runs in rows.values()):
        message = "all runs would be the same: give steps of a scenario a chance: (or after: 4s to 9s), or say --unusual 0.1"
        raise NothingByChanceError(message)

    def write(row: "SweptRow", played: "Played") -> Written | None:
        text = smallest_scenario(rows[row], played.seed)
        if text is None:
            return None
        write_text(arguments.output, text)
        again = ["sar-compile", "simulate", arguments.file, "--scenario", str(arguments.output)]
        return arguments.output, shlex.join(again)

    return run_sweep(list(rows), _BATCH, in_processes, write, "the smallest scenario that fails", arguments)


def _rows(arguments: argparse.Namespace) -> "Iterator[tuple[SweptRow, ScenarioRuns]]":
    """Yield a row for each combination, with what it plays; all of them are known to be valid."""
    from sar_compiler.checks.simulate.scenario_files import read_scenario
    from sar_compiler.checks.sweep import SweptRow
    from sar_compiler.documents.yaml_files import read_yaml
    from sar_compiler.project.swept import ScenarioRuns, change_scenario, content_of

    tree = workspace(arguments).load(arguments.file)
    stage = tree.stage(arguments.tree)
    stage.binding()
    content = content_of(tree)
    paths = scenario_files(arguments.scenario)
    fixed = {"ticks": arguments.ticks, "until": arguments.until and arguments.until.text}
    for path in paths:
        scenario: Mapping[str, object] = {}
        if path is not None:
            if not arguments.vary:
                read_scenario(path, stage)  # mistakes in it are said at their places
            scenario = read_yaml(path, "").root.data
        for unusual, labels, changes in _combinations(arguments):
            own = {key: value for key, value in {**fixed, **changes}.items() if value}
            if arguments.tree and "tree" not in scenario:
                own["tree"] = arguments.tree
            runs = ScenarioRuns(
                tree.path.resolve(),
                content,
                additions(arguments),
                change_scenario(scenario, own),
                f"{path} (varied)" if path is not None else "command line",
                unusual,
                tuple(arguments.count),
            )
            runs.events(runs.understood().simulated)
            named = {"scenario": Path(path).stem} if path is not None and len(paths) > 1 else {}
            yield SweptRow({**named, **labels}, runs), runs


def _combinations(
    arguments: argparse.Namespace,
) -> Iterator[tuple[float, Mapping[str, str], Mapping[str, Mapping[str, object]]]]:
    """Yield the chance of what is unusual, the labels, and the changes of a scenario, for each combination."""
    axes = [("parameters", each) for each in arguments.vary] + [("facts", each) for each in arguments.set]
    for unusual in arguments.unusual:
        for values in itertools.product(*(listed for _, (_, listed) in axes)):
            labels = {"unusual": f"{unusual:g}"} if len(arguments.unusual) > 1 else {}
            changes: dict[str, dict[str, object]] = {}
            for (key, (name, _)), value in zip(axes, values, strict=True):
                labels[name], changes.setdefault(key, {})[name] = value
            yield unusual, labels, changes
