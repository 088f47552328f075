"""`sar-sim sweep`: run a mission many times in the simulator to measure its success rate."""

import argparse
import itertools
import shlex
import signal
import time
from collections.abc import Iterator
from typing import TYPE_CHECKING

from sar_compiler.cli.arguments import (
    DEFAULT_WORLD,
    FILE_HELP,
    TREE,
    WORLD,
    YAML_FILE,
    add_budget,
    add_mission,
    add_project_options,
    additions,
    budget_of,
    speed,
)
from sar_compiler.cli.sweep import (
    FailureFile,
    add_sweep_options,
    add_varied_parameters,
    require_rows,
    run_sweep,
)
from sar_compiler.commands import CommandParser, interruptible
from sar_compiler.helper_process import helper_command
from sar_compiler.missions.mission_choice import mission_of
from sar_compiler.ros.middleware import require_middleware
from sar_compiler.writing import write_text

if TYPE_CHECKING:
    from sar_compiler.analysis.sweep import RunResultSample, SweepRow
    from sar_compiler.sim.simulated_runs import SimulatedRuns

_NO_FAULTS = "none"
# Faster than any machine can simulate, so that only processor time limits the speed of a run.
_SPEED = 1000.0
# Enough for thirty missions in each of several worlds. A mission of ten minutes takes a few seconds of processor time.
_MAX_SEC = 3600.0


def add_sim_sweep(parser: CommandParser) -> None:
    """Add the arguments of `sar-sim sweep`."""
    add = parser.add_argument
    add("tree", type=TREE, metavar="TREE", help=FILE_HELP)
    text = f"a world in which the mission runs; may be repeated (default {DEFAULT_WORLD})"
    add("--world", action="append", type=WORLD, metavar="W", help=text)
    text = f"the faults of a run, each in the notation of sar-run --fault, or {_NO_FAULTS}; repeat the option to compare several sets of faults"
    add("--fault", action="append", metavar="'SPEC SPEC'", help=text)
    add_varied_parameters(parser, "ROS parameter")
    add("--params", type=YAML_FILE, metavar="FILE", help="a ROS 2 parameter file")
    text = f"the maximum number of simulated seconds per second (default {_SPEED:g})"
    add("--speed", type=speed, default=_SPEED, metavar="N", help=text)
    add_project_options(parser)
    add_mission(parser)
    add_sweep_options(parser, runs=30, half_width=0.1)
    add_budget(parser, _MAX_SEC, "elapsed time")


def sweep_missions(options: argparse.Namespace) -> int:
    """Run the combinations, print the table, and return the exit status: 0 if no run failed.

    Raises:
        TreeError: If the tree or a world is not valid.
        SarError: If a file cannot be read, a fault is invalid, or a run ends before its mission starts.
    """
    from sar_compiler.sim.simulated_runs import minimize_faults, mission_threads

    require_middleware()
    # The runs are stopped gracefully, however the command ends.
    interruptible(signal.SIGTERM, signal.SIGHUP)
    varied = [len(values) for _, values in options.vary]
    require_rows(len(options.world or [""]), len(options.fault or [""]), *varied)
    rows = dict(_rows(options))

    def write(row: "SweepRow", played: "RunResultSample") -> FailureFile:
        command = ["sar-run", *minimize_faults(rows[row], played.seed).command(played.seed)]
        reason = " ".join(played.failure.split())
        write_text(options.output, f"#!/bin/sh\n# {reason}\nexec {shlex.join(command)}\n")
        return options.output, shlex.join(["sh", str(options.output)])

    budget = budget_of(options, patience_sec=0.0, clock=time.monotonic)
    kind = "a command that repeats the failure with as few faults as possible"
    return run_sweep(list(rows), 1, mission_threads, write, kind, options, budget)


def _rows(options: argparse.Namespace) -> "Iterator[tuple[SweepRow, SimulatedRuns]]":
    """Check all worlds and faults. Then yield the row of each combination, with an object that executes its runs."""
    from sar_compiler.analysis.sweep import SweepRow
    from sar_compiler.sim.simulated_runs import SimulatedRuns

    program = tuple(helper_command("sar_compiler.cli.console", "sar_run_repeatedly"))
    worlds, mixes = options.world or [DEFAULT_WORLD], options.fault or [_NO_FAULTS]
    _check(options, worlds, mixes)
    for world, mix, *values in itertools.product(worlds, mixes, *(listed for _, listed in options.vary)):
        labels = {"world": world} if len(worlds) > 1 else {}
        labels |= {"faults": mix} if len(mixes) > 1 else {}
        ros: list[str] = []
        for (name, _), (text, _) in zip(options.vary, values, strict=True):
            labels[name] = text
            ros += ["-p", f"{name}:={text}"]
        faults = () if mix == _NO_FAULTS else tuple(mix.split())
        runs = SimulatedRuns(
            program, (options.tree, "--sim", world, *_run_options(options)), faults, tuple(ros)
        )
        yield SweepRow(labels, runs), runs


def _check(options: argparse.Namespace, worlds: list[str], mixes: list[str]) -> None:
    from sar_compiler.missions.mission_start import parse_faults
    from sar_compiler.project import Workspace
    from sar_compiler.sim.world import find_world

    loaded = Workspace(additions(options)).load(options.tree)
    mission = mission_of(loaded, loaded.binding())
    for mix in mixes:
        parse_faults(mix.split() if mix != _NO_FAULTS else (), mission)
    for world in worlds:
        find_world(world)


def _run_options(options: argparse.Namespace) -> Iterator[str]:
    """Yield the options that are passed on to `sar-run`."""
    yield from ("--speed", f"{options.speed:g}")
    if options.params is not None:
        yield from ("--params", str(options.params))
    for name, values in (
        ("--nodes", options.nodes),
        ("--model", options.model),
        ("--include-path", options.include_path),
    ):
        yield from (part for value in values for part in (name, str(value)))
    if options.isolated:
        yield "--isolated"
    if options.mission is not None:
        yield from ("--mission", options.mission)
    if options.trust:
        yield "--trust"
