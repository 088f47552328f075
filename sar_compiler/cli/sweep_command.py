"""What the two commands that sweep have in common: their options, progress, and result."""

import argparse
import contextlib
import json
import os
import sys
from collections.abc import Callable, Sequence
from concurrent.futures import CancelledError
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from sar_compiler.cli.arguments import FINDINGS, INTERRUPTED, OK, count, seed

if TYPE_CHECKING:
    from sar_compiler.checks.sweep.sweeping import Played, StoppingRule, SweptRow
    from sar_compiler.checks.sweep.workers import Workers


class Varied(NamedTuple):
    """Something that is varied, and its values.

    Attributes:
        name: What it is called.
        values: Its values, as written and as data.
    """

    name: str
    values: Sequence[tuple[str, object]]


def add_sweep_options(parser: argparse.ArgumentParser, *, runs: int, half_width: float) -> None:
    """Add the options that both commands have.

    Args:
        parser: The command's.
        runs: The largest number of runs of a row, by default.
        half_width: Half the width of the interval that is enough, by default.
    """
    parser.add_argument(
        "--runs",
        type=count,
        default=runs,
        metavar="N",
        help=f"play each combination so often at most (default {runs})",
    )
    parser.add_argument(
        "--half-width",
        type=_probability,
        default=half_width,
        metavar="W",
        help=f"stop earlier, once half the width of a success rate's interval is no more than this (default {half_width:g}; 0: never)",
    )
    parser.add_argument(
        "--confidence",
        type=_confidence,
        default=0.95,
        metavar="C",
        help="the confidence of the intervals, which are Wilson's (default 0.95)",
    )
    parser.add_argument(
        "--at-least",
        type=_probability,
        metavar="RATE",
        help="status 0 if every interval lies at or above this rate (default: if no run has failed)",
    )
    parser.add_argument(
        "--seed",
        type=seed,
        default=0,
        metavar="N",
        help="the seed of the first run of each combination (default 0)",
    )
    parser.add_argument(
        "--jobs",
        type=count,
        metavar="N",
        help="how many runs to play at the same time (default: one on each core)",
    )
    parser.add_argument(
        "--dask",
        metavar="ADDRESS",
        help="play on a Dask cluster instead: its scheduler, such as tcp://host:8786",
    )
    parser.add_argument(
        "-o",
        "--output",
        type=Path,
        metavar="FAILING",
        help="where to write the smallest scenario that fails, if any does",
    )
    parser.add_argument(
        "--format", choices=("text", "json"), default="text", help="for people, or for scripts"
    )


def probabilities(text: str) -> tuple[float, ...]:
    """Read probabilities with commas between them."""
    return tuple(_probability(part) for part in text.split(","))


def _confidence(text: str) -> float:
    value = _probability(text)
    if value in (0.0, 1.0):
        message = f"'{text}' is not a number above 0 and below 1"
        raise argparse.ArgumentTypeError(message)
    return value


def _probability(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = -1.0
    if not 0.0 <= value <= 1.0:
        message = f"'{text}' is not a number between 0 and 1"
        raise argparse.ArgumentTypeError(message)
    return value


def varied(text: str) -> Varied:
    """Read `NAME=VALUE,VALUE`; a comma in brackets or in quotes separates no values."""
    from sar_compiler.documents.yaml_files import parse_yaml
    from sar_compiler.tree.diagnostic import TreeError

    name, sign, listed = text.partition("=")
    values: Sequence[tuple[str, object]] = ()
    with contextlib.suppress(TreeError):
        items = parse_yaml(f"[{listed}]", "", "").root.listed
        values = [(f"[{listed}]"[item.start : item.end], item.data) for item in items]
    if not (name.strip() and sign and values):
        message = f"'{text}' is not NAME=VALUE,VALUE, such as tries=1,2,3"
        raise argparse.ArgumentTypeError(message)
    return Varied(name.strip(), values)


def cores() -> int:
    """Return the number of cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


class Writer(NamedTuple):
    """How a sweep's smallest failure is written out.

    Attributes:
        write: Writes it, and returns its path; None if that is not possible.
        advice: How to play it again, for a path.
    """

    write: "Callable[[SweptRow, Played], Path | None]"
    again: Callable[[Path], str]


def swept(
    rows: "Sequence[SweptRow]",
    batch: int,
    workers: "Callable[[], Workers]",
    writer: Writer,
    arguments: argparse.Namespace,
) -> int:
    """Play rows and print their table, also after Ctrl-C; return the exit status.

    Args:
        rows: What is to be played.
        batch: The number of runs after each of which a row may end.
        workers: Makes those who play, unless `--dask` says who.
        writer: Writes the smallest failure out.
        arguments: The command's arguments.
    """
    from sar_compiler.checks.sweep.sweeping import StoppingRule, smallest_failure, sweep
    from sar_compiler.checks.sweep.workers import on_dask

    rule = StoppingRule(arguments.runs, arguments.half_width, arguments.confidence, batch)
    stopped = False
    try:
        with on_dask(arguments.dask) if arguments.dask else workers() as working:
            sweep(rows, rule, arguments.seed, working, _show)
    except (KeyboardInterrupt, CancelledError):
        stopped = True
    _show(())
    failure = None if stopped else smallest_failure(rows)
    path = None if failure is None else writer.write(*failure)
    written = None if path is None else (path, writer.again(path))
    _print(rows, rule, failure, written, arguments)
    if stopped:
        return INTERRUPTED
    if arguments.at_least is not None:
        return OK if all(rule.interval(row.outcomes).low >= arguments.at_least for row in rows) else FINDINGS
    return OK if failure is None else FINDINGS


def _print(
    rows: "Sequence[SweptRow]",
    rule: "StoppingRule",
    failure: "tuple[SweptRow, Played] | None",
    written: tuple[Path, str] | None,
    arguments: argparse.Namespace,
) -> None:
    from sar_compiler.views.sweep_table import failure_as_text, sweep_as_json, sweep_as_text

    path, again = written or (None, "")
    if arguments.format == "json":
        smallest = failure and {
            "labels": failure[0].labels,
            "seed": failure[1].seed,
            "failure": failure[1].failure,
            "file": path and str(path),
            "again": again or None,
        }
        print(
            json.dumps(
                {"rows": sweep_as_json(rows, rule), "smallest": smallest}, indent=2, ensure_ascii=False
            )
        )
        return
    print(sweep_as_text(rows, rule))
    if failure is not None:
        print(f"\n{failure_as_text(*failure)}")
        if path is not None:
            print(f"  the smallest scenario that fails is written to {path}; play it again: {again}")


def _show(rows: "Sequence[SweptRow]") -> None:
    """Show the progress in a line that is overwritten, on a terminal; without rows, remove it."""
    if sys.stderr.isatty():
        done, runs = sum(row.is_done for row in rows), sum(len(row.outcomes) for row in rows)
        text = f"{runs:,} runs, {done} of {len(rows)} rows done" if rows else ""
        print(f"\r\x1b[K{text}", end="", file=sys.stderr, flush=True)
