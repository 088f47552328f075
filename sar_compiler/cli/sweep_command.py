"""What the two commands that sweep have in common: their options, progress, and result."""

import argparse
import contextlib
import os
from collections.abc import Callable, Sequence
from concurrent.futures import CancelledError
from pathlib import Path
from typing import TYPE_CHECKING

from sar_compiler.cli.arguments import FILE, confidence, count, probability, seed
from sar_compiler.cli.loading import FORMAT_HELP
from sar_compiler.cli.terminal import ProgressLine
from sar_compiler.commands import FINDINGS, INTERRUPTED, OK, CommandParser, print_text

if TYPE_CHECKING:
    from sar_compiler.checks.sweep import Played, SweptRow
    from sar_compiler.checks.sweep.workers import Workers


Variation = tuple[str, list[tuple[str, object]]]
"""The name of what is varied, and its values: as written, and as data."""

Written = tuple[Path, str]
"""The file of a sweep's smallest failure, and the command that plays it again."""


def add_varied_parameters(parser: CommandParser, noun: str) -> None:
    """Add `--vary`."""
    text = f"vary a {noun}: each value in turn; may be repeated"
    add = parser.add_argument
    add("--vary", action="append", default=[], type=parse_variation, metavar="NAME=A,B", help=text)
    parser.rename("--param", "--vary")


def add_sweep_options(parser: CommandParser, *, runs: int, half_width: float) -> None:
    """Add the options that both commands have; *runs* and *half_width* are the defaults of two."""
    add = parser.add_argument
    text = f"run each combination at most N times (default {runs})"
    add("--runs", type=count, default=runs, metavar="N", help=text)
    text = f"end a row once half the width of its interval is at most W (default {half_width:g}; 0: never)"
    half = add("--half-width", type=probability, default=half_width, metavar="W", help=text)
    text = "the confidence of the intervals, which are Wilson's (default 0.95)"
    sure = add("--confidence", type=confidence, default=0.95, metavar="C", help=text)
    text = "status 0 if every interval lies at or above this rate (default: if no run has failed)"
    add("--at-least", type=probability, metavar="RATE", help=text)
    text = "the seed of the first run of each combination; the next runs have the next numbers (default 0)"
    first = add("--seed", type=seed, default=0, metavar="N", help=text)
    text = "how many runs go on at the same time (default: as many as there are cores)"
    add("--jobs", type=count, default=os.cpu_count() or 1, metavar="N", help=text)
    text = "run on a Dask cluster instead: the address of its scheduler, such as tcp://host:8786"
    dask = add("--dask", metavar="ADDRESS", help=text)
    text = "write the smallest failure to this file, if there is one"
    add("-o", "--output", type=FILE, metavar="FAILING", help=text)
    add("--format", choices=("text", "json"), default="text", help=FORMAT_HELP)
    parser.hide(half, sure, first, dask)


def probabilities(text: str) -> tuple[float, ...]:
    """Read probabilities with commas between them."""
    return tuple(probability(part) for part in text.split(","))


def parse_variation(text: str) -> Variation:
    """Read `NAME=VALUE,VALUE`; a comma in brackets or in quotes separates no values."""
    from sar_compiler.documents.yaml_files import parse_yaml
    from sar_compiler.tree.diagnostic import TreeError

    name, sign, listed = text.partition("=")
    values: list[tuple[str, object]] = []
    with contextlib.suppress(TreeError):
        items = parse_yaml(f"[{listed}]", "", "").root.listed
        values = [(f"[{listed}]"[item.start : item.end], item.data) for item in items]
    if not (name.strip() and sign and values):
        raise argparse.ArgumentTypeError(f"'{text}' is not NAME=VALUE,VALUE, such as tries=1,2,3")
    return name.strip(), values


def run_sweep(
    rows: "Sequence[SweptRow]",
    batch: int,
    workers: "Callable[[int], Workers]",
    write: "Callable[[SweptRow, Played], Written | None]",
    smallest: str,
    arguments: argparse.Namespace,
) -> int:
    """Play rows and print their table, also after Ctrl-C; return the exit status.

    Args:
        rows: What is to be played.
        batch: The number of runs after each of which a row may end.
        workers: Returns as many who play, unless `--dask` says who.
        write: Writes the smallest failure to the file of `-o`; returns None if that is not possible.
        smallest: What that is, in words.
        arguments: The command's arguments.
    """
    from sar_compiler.checks.sweep import StoppingRule, smallest_failure, sweep
    from sar_compiler.checks.sweep.workers import on_dask
    from sar_compiler.views.sweep_table import sweep_as_json, sweep_as_text

    rule = StoppingRule(arguments.runs, arguments.half_width, arguments.confidence, batch)
    line = ProgressLine("sweep")
    stopped = False
    try:
        with on_dask(arguments.dask) if arguments.dask else workers(arguments.jobs) as working:
            sweep(rows, rule, arguments.seed, working, lambda rows: line.show(lambda: _progress(rows)))
    except (KeyboardInterrupt, CancelledError):
        stopped = True
    line.clear()
    failure = None if stopped else smallest_failure(rows)
    written = None if failure is None or arguments.output is None else write(*failure)
    view = sweep_as_json if arguments.format == "json" else sweep_as_text
    print_text(view(rows, rule, failure, written))
    if failure is not None and arguments.output is None and arguments.format == "text":
        print_text(f"  -o FILE writes {smallest}")
    if stopped:
        return INTERRUPTED
    if arguments.at_least is not None:
        return OK if all(rule.interval(row.outcomes).low >= arguments.at_least for row in rows) else FINDINGS
    return OK if failure is None else FINDINGS


def _progress(rows: "Sequence[SweptRow]") -> str:
    done, runs = sum(row.is_done for row in rows), sum(len(row.outcomes) for row in rows)
    return f"{runs:,} runs, {done} of {len(rows)} rows done"
