"""`sar-compile sweep`: simulate many runs of a tree to measure its success rate.

`sar-sim sweep` shares this code.
"""

import argparse
import contextlib
import itertools
import math
import os
import shlex
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import CancelledError
from pathlib import Path
from typing import TYPE_CHECKING

from sar_compiler.budget import Budget, BudgetSpentError
from sar_compiler.cli.arguments import (
    FILE,
    FILE_HELP,
    FORMAT_HELP,
    TREE,
    YAML_FILE,
    add_budget,
    add_project_options,
    add_tree_id,
    additions,
    budget_of,
    confidence,
    count,
    jobs,
    load_checked,
    probability,
    seed,
)
from sar_compiler.cli.simulate import scenario_files, script
from sar_compiler.commands import FINDINGS, OK, CommandParser, print_error, print_text
from sar_compiler.errors import SarError
from sar_compiler.terminal import ProgressLine
from sar_compiler.tree.diagnostic import TreeError
from sar_compiler.writing import write_text

if TYPE_CHECKING:
    from sar_compiler.analysis.sweep import RunResultSample, SweepRow
    from sar_compiler.analysis.sweep.workers import ReplaceableExecutor
    from sar_compiler.analysis.sweep_runs import ScenarioRuns

# For a tree that always succeeds, the half-width of the confidence interval is below 0.02 after four batches.
_BATCH = 25
_MAX_SEC = 600.0


# A longer table would not be readable, and each row needs memory and processor time.
MAX_ROWS = 10_000


class TooManyRowsError(SarError):
    """The varied values have too many combinations."""


def require_rows(*counts: int) -> None:
    """Check that there are at most `MAX_ROWS` combinations; *counts* are the numbers of varied values.

    Raises:
        TooManyRowsError: If there are more combinations.
    """
    rows = math.prod(counts)
    if rows > MAX_ROWS:
        many = " x ".join(f"{each:,}" for each in counts if each > 1)
        raise TooManyRowsError(
            f"{many} = {rows:,} combinations, but at most {MAX_ROWS:,} are allowed: vary fewer values"
        )


class NothingRandomError(SarError):
    """All runs of a sweep would be the same, because nothing in them is random."""


def add_options(parser: CommandParser) -> None:
    """Add the arguments of `sweep`."""
    add = parser.add_argument
    add("file", type=TREE, metavar="FILE", help=FILE_HELP)
    text = "a scenario file with the probabilities of the leaves' outcomes, or a folder of scenario files; may be repeated"
    add("--scenario", action="append", default=[], type=YAML_FILE, metavar="S.yaml", help=text)
    text = "the probability (0 to 1) that a leaf returns an unusual outcome, for leaves that the scenario does not mention; several probabilities are separated by commas (default 0)"
    add("--unusual", type=probabilities, default=(0.0,), metavar="P,P", help=text)
    add_varied_parameters(parser, "parameter")
    text = "vary the initial value of a fact over these values; may be repeated"
    add("--set", action="append", default=[], type=parse_variation, metavar="FACT=A,B", help=text)
    text = "count an event, such as 'NavigateTo halted'; may be repeated"
    add("--count", action="append", default=[], metavar="EVENT", help=text)
    add_tree_id(parser, "tick")
    add("--ticks", type=count, metavar="N", help="stop a run after N ticks")
    text = "end a run when this condition is true (default: when the root has succeeded or failed)"
    add("--until", type=script, metavar="SCRIPT", help=text)
    add_project_options(parser)
    add_sweep_options(parser, runs=1000, half_width=0.02)
    add_budget(parser, _MAX_SEC, "elapsed time")
    parser.set_defaults(run=sweep_file)


def sweep_file(arguments: argparse.Namespace) -> int:
    """Run the combinations, print the table, and return the exit status: 0 if no run failed.

    Raises:
        TreeError: If the tree, a scenario, or a varied value is invalid.
        SarError: If a file cannot be read, or nothing is random.
    """
    from sar_compiler.analysis.sweep.workers import worker_processes
    from sar_compiler.analysis.sweep_runs import smallest_scenario

    varied = [len(values) for _, values in (*arguments.vary, *arguments.set)]
    require_rows(len(arguments.scenario) or 1, len(arguments.unusual), *varied)
    rows = dict(_rows(arguments))
    if not any(runs.has_randomness() for runs in rows.values()):
        message = "all runs would be the same. Add `probability:` or `after: 4s to 9s` to steps of a scenario, or --unusual 0.1"
        raise NothingRandomError(message)

    def write(row: "SweepRow", played: "RunResultSample") -> FailureFile | None:
        text = smallest_scenario(rows[row], played.seed)
        if text is None:
            return None
        write_text(arguments.output, text)
        again = ["sar-compile", "simulate", arguments.file, "--scenario", str(arguments.output)]
        return arguments.output, shlex.join(again)

    budget = budget_of(arguments, patience_sec=0.0, clock=time.monotonic)
    kind = "the smallest scenario that fails"
    return run_sweep(list(rows), _BATCH, worker_processes, write, kind, arguments, budget)


def _rows(arguments: argparse.Namespace) -> "Iterator[tuple[SweepRow, ScenarioRuns]]":
    """Check each combination, and yield its row together with the object that executes its runs."""
    from sar_compiler.analysis.simulate.scenario_files import read_scenario
    from sar_compiler.analysis.sweep import SweepRow
    from sar_compiler.analysis.sweep_runs import ScenarioRuns, change_scenario, content_of
    from sar_compiler.analysis.tree_analysis import stage_of
    from sar_compiler.documents.yaml_files import read_yaml
    from sar_compiler.opener import SCENARIO

    (tree,) = load_checked(arguments, arguments.file)
    stage = stage_of(tree, arguments.tree)
    stage.binding()
    content = content_of(tree)
    paths = scenario_files(arguments.scenario)
    fixed = {"ticks": arguments.ticks, "until": arguments.until and arguments.until.text}
    for path in paths:
        scenario: Mapping[str, object] = {}
        if path is not None:
            if not arguments.vary:
                # Without varied values, errors are reported at their lines in the file.
                for finding in read_scenario(path, stage).scenario.warnings:
                    print_error(finding.render())
            document = read_yaml(path, SCENARIO, "")
            # The values are checked later, in the scenario of each combination. Its line numbers differ from those of the file.
            document.validate("scenario")
            document.raise_findings()
            scenario = document.root.data
        for unusual, labels, changes in _combinations(arguments):
            own = {key: value for key, value in {**fixed, **changes}.items() if value}
            if arguments.tree and "tree" not in scenario:
                own["tree"] = arguments.tree
            source = f"{path} (varied)" if path is not None else "command line"
            changed, added = change_scenario(scenario, own), additions(arguments)
            counted = tuple(arguments.count)
            runs = ScenarioRuns(tree.path.resolve(), content, added, changed, source, unusual, counted)
            runs.events(runs.understood().simulated)
            named = {"scenario": Path(path).stem} if path is not None and len(paths) > 1 else {}
            yield SweepRow({**named, **labels}, runs), runs


def _combinations(
    arguments: argparse.Namespace,
) -> Iterator[tuple[float, Mapping[str, str], Mapping[str, Mapping[str, object]]]]:
    """Yield each combination: the probability of unusual outcomes, row labels, and changes of the scenario."""
    axes = [("parameters", each) for each in arguments.vary] + [("facts", each) for each in arguments.set]
    for unusual in arguments.unusual:
        for values in itertools.product(*(listed for _, (_, listed) in axes)):
            labels = {"unusual": f"{unusual:g}"} if len(arguments.unusual) > 1 else {}
            changes: dict[str, dict[str, object]] = {}
            for (key, (name, _)), value in zip(axes, values, strict=True):
                labels[name], changes.setdefault(key, {})[name] = value
            yield unusual, labels, changes


Variation = tuple[str, list[tuple[str, object]]]
"""The name of a varied parameter or fact, and its values. Each value is given as text and as data."""

FailureFile = tuple[Path, str]
"""The file to which a sweep's smallest failure was written, and the command that repeats this failure."""


def add_varied_parameters(parser: CommandParser, noun: str) -> None:
    """Add `--vary`; *noun* names the kind of value that the option varies."""
    text = f"vary a {noun} over these values; may be repeated"
    add = parser.add_argument
    add("--vary", action="append", default=[], type=parse_variation, metavar="NAME=A,B", help=text)


def add_sweep_options(parser: CommandParser, *, runs: int, half_width: float) -> None:
    """Add the options of `sar-compile sweep` and `sar-sim sweep`; *runs* and *half_width* are defaults."""
    add = parser.add_argument
    text = f"run each combination at most N times (default {runs})"
    add("--runs", type=count, default=runs, metavar="N", help=text)
    text = f"stop the runs of a combination when the half-width of its confidence interval is at most W (default {half_width:g}; 0: never)"
    add("--half-width", type=probability, default=half_width, metavar="W", help=text)
    text = "the confidence level of the Wilson intervals (default 0.95)"
    add("--confidence", type=confidence, default=0.95, metavar="C", help=text)
    text = "exit with status 0 if the lower bound of every interval is at least RATE (default: exit with 0 if no run failed)"
    add("--at-least", type=probability, metavar="RATE", help=text)
    text = "the seed of the first run of each combination; each further run uses the next integer (default 0)"
    add("--seed", type=seed, default=0, metavar="N", help=text)
    text = "number of parallel runs (default: the number of cores)"
    add("--jobs", type=jobs, default=os.cpu_count() or 1, metavar="N", help=text)
    text = "write the smallest failure, if any, to this file"
    add("-o", "--output", type=FILE, metavar="FAILING", help=text)
    add("--format", choices=("text", "json"), default="text", help=FORMAT_HELP)
    parser.abridge("--half-width", "--confidence", "--seed", "--trust", "--isolated", "--include-path")


def probabilities(text: str) -> tuple[float, ...]:
    """Parse probabilities that are separated by commas."""
    return tuple(probability(part) for part in text.split(","))


def parse_variation(text: str) -> Variation:
    """Parse `NAME=VALUE,VALUE`; commas in brackets or in quotes do not separate values."""
    from sar_compiler.documents.yaml_files import parse_yaml

    name, sign, listed = text.partition("=")
    values: list[tuple[str, object]] = []
    with contextlib.suppress(TreeError):
        items = parse_yaml(f"[{listed}]", "", "").root.as_list
        values = [(f"[{listed}]"[item.start : item.end], item.data) for item in items]
    if not (name.strip() and sign and values):
        raise argparse.ArgumentTypeError(f"'{text}' is not NAME=VALUE,VALUE, such as tries=1,2,3")
    return name.strip(), values


def run_sweep(
    rows: "Sequence[SweepRow]",
    batch: int,
    workers: "Callable[[int], ReplaceableExecutor]",
    write: "Callable[[SweepRow, RunResultSample], FailureFile | None]",
    smallest: str,
    arguments: argparse.Namespace,
    budget: Budget,
) -> int:
    """Execute the runs of all rows, print the table, and return the exit status.

    The table is also printed after Ctrl-C and when the budget is spent.

    Args:
        rows: The rows.
        batch: The number of runs of a row before each check whether the row needs further runs.
        workers: Creates an executor with the given number of workers.
        write: Writes the smallest failure to the file that `-o` names; returns None if the failure cannot be
            written.
        smallest: A description of the content of the file that `-o` names, for the hint to use `-o`.
        arguments: The command's arguments.
        budget: The budget of all rows.
    """
    from sar_compiler.analysis.sweep import StoppingRule, smallest_failure, sweep
    from sar_compiler.analysis.sweep_table import sweep_as_json, sweep_as_text

    rule = StoppingRule(arguments.runs, arguments.half_width, arguments.confidence, batch)
    line = ProgressLine()

    def show_rows(rows: "Sequence[SweepRow]") -> None:
        if not budget.reason:
            line.show(lambda: _progress(rows))

    stopped = False
    try:
        with workers(arguments.jobs) as working:
            budget.run(lambda: sweep(rows, rule, arguments.seed, working, show_rows))
    except (BudgetSpentError, CancelledError):
        stopped = True
    line.clear()
    failure = None if stopped else smallest_failure(rows)
    written = None if failure is None or arguments.output is None else write(*failure)
    view = sweep_as_json if arguments.format == "json" else sweep_as_text
    print_text(view(rows, rule, failure, written))
    if failure is not None and arguments.output is None and arguments.format == "text":
        print_text(f"  -o FILE writes {smallest}")
    if stopped:
        print_error(f"sweep: {budget.reason}")
        return budget.exit_status
    if arguments.at_least is not None:
        return OK if all(rule.interval(row.outcomes).low >= arguments.at_least for row in rows) else FINDINGS
    return OK if failure is None else FINDINGS


def _progress(rows: "Sequence[SweepRow]") -> str:
    done, runs = sum(row.is_done for row in rows), sum(len(row.outcomes) for row in rows)
    return f"{runs:,} runs, {done} of {len(rows)} rows done"
