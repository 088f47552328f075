"""`sar-compile sweep`: how often a tree succeeds, by many simulated runs."""

import argparse
import itertools
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from sar_compiler.cli.arguments import count
from sar_compiler.cli.loading import FILE_HELP, add_project_options, additions, workspace
from sar_compiler.cli.simulate import scenario_files, script
from sar_compiler.cli.sweep_command import Writer, add_sweep_options, cores, probabilities, swept, varied
from sar_compiler.errors import SarError

if TYPE_CHECKING:
    from sar_compiler.checks.sweep.sweeping import Played, SweptRow
    from sar_compiler.project.swept import ScenarioRuns

# Half the width of the interval of a tree that always succeeds is below 0.02 after four batches.
_BATCH = 25


class NothingByChanceError(SarError):
    """All runs of a sweep would be the same."""


def add_sweep(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of `sweep`."""
    parser.add_argument("file", metavar="FILE", help=FILE_HELP)
    parser.add_argument(
        "--scenario",
        action="append",
        default=[],
        type=Path,
        metavar="S.yaml",
        help="what leaves answer, with the chance of each; or a folder of such files; may be repeated",
    )
    parser.add_argument(
        "--unusual",
        type=probabilities,
        default=(0.0,),
        metavar="P,…",
        help="the chance that a leaf of which the scenario says nothing answers what is not usual (default 0)",
    )
    parser.add_argument(
        "--param", action="append", default=[], type=varied, metavar="NAME=A,B,…", help="vary a parameter"
    )
    parser.add_argument(
        "--set",
        action="append",
        default=[],
        type=varied,
        metavar="FACT=A,B,…",
        help="vary what a fact is at the start",
    )
    parser.add_argument(
        "--count",
        action="append",
        default=[],
        metavar="EVENT",
        help="count an event, such as 'NotifyBase acknowledged'",
    )
    parser.add_argument("--tree", metavar="ID", help="the tree to tick (default: the one the file executes)")
    parser.add_argument("--ticks", type=count, metavar="N", help="a run has failed after so many ticks")
    parser.add_argument(
        "--until",
        type=script,
        metavar="SCRIPT",
        help="end when this is true (default: when the root has succeeded or failed)",
    )
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

    rows = dict(_rows(arguments))
    if not any(runs.are_by_chance() for runs in rows.values()):
        message = "all runs would be the same: give steps of a scenario a chance: (or after: 4s to 9s), or say --unusual 0.1"
        raise NothingByChanceError(message)
    output = arguments.output or Path(f"{Path(arguments.file).stem}_failing.yaml")
    writer = Writer(
        lambda row, outcome: _write(rows[row], outcome, output),
        lambda path: f"sar-compile simulate {arguments.file} --scenario {path}",
    )
    return swept(list(rows), _BATCH, lambda: in_processes(arguments.jobs or cores()), writer, arguments)


def _rows(arguments: argparse.Namespace) -> "Iterator[tuple[SweptRow, ScenarioRuns]]":
    """Yield a row for each combination, with what it plays; all of them are known to be valid."""
    from sar_compiler.checks.simulate.scenario_files import read_scenario
    from sar_compiler.checks.sweep.sweeping import SweptRow
    from sar_compiler.documents.yaml_files import read_yaml
    from sar_compiler.project.swept import ScenarioRuns, content_of
    from sar_compiler.project.swept import varied as changed

    tree = workspace(arguments).load(arguments.file)
    stage = tree.stage(arguments.tree)
    stage.binding()
    content = content_of(tree)
    paths = scenario_files(arguments.scenario)
    fixed = {
        "ticks": arguments.ticks,
        "until": arguments.until and arguments.until.text,
    }
    for path in paths:
        scenario: Mapping[str, object] = {}
        if path is not None:
            if not arguments.param:
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
                changed(scenario, own),
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
    axes = [("parameters", each) for each in arguments.param] + [("facts", each) for each in arguments.set]
    for unusual in arguments.unusual:
        for values in itertools.product(*(each.values for _, each in axes)):
            labels = {"unusual": f"{unusual:g}"} if len(arguments.unusual) > 1 else {}
            changes: dict[str, dict[str, object]] = {}
            for (key, each), value in zip(axes, values, strict=True):
                labels[each.name], changes.setdefault(key, {})[each.name] = value
            yield unusual, labels, changes


def _write(runs: "ScenarioRuns", outcome: "Played", path: Path) -> Path | None:
    """Write the smallest scenario that fails as a run has."""
    from sar_compiler.project.swept import smallest_scenario

    text = smallest_scenario(runs, outcome.seed)
    if text is None:
        return None
    path.write_text(text, encoding="utf-8")
    return path
