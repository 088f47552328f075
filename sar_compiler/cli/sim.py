"""`sar-sim`: run simulated worlds without a mission, map them, and run missions in them many times."""

import argparse
import sys
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from sar_compiler.cli.arguments import DEFAULT_WORLD, FILE, WORLD, report_argument_errors, seed, speed
from sar_compiler.cli.parser import Parser
from sar_compiler.cli.sim_sweep import add_sim_sweep, sweep_missions
from sar_compiler.commands import OK, add_version, interruptible, print_error, print_text, run
from sar_compiler.missions.faults import NAVIGATION_FAULTS, FaultPlan, parse_fault
from sar_compiler.ros.arguments import init_arguments, split_arguments
from sar_compiler.ros.middleware import require_middleware, ros_up
from sar_compiler.ros.signals import StopSignals
from sar_compiler.sim.placement import MANNER_NAMES, QUICK_NAME, Placement, parse_placement
from sar_compiler.terminal import ProgressLine

if TYPE_CHECKING:
    from sar_compiler.sim.simulation import Simulation
    from sar_compiler.sim.world import World as SimulatedWorld

# The interval between checks of whether the simulation is still running, in seconds.
_CHECK_SEC = 0.5
_ROBOT = report_argument_errors(parse_placement)
_FAULT = report_argument_errors(partial(parse_fault, targets=NAVIGATION_FAULTS))


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command `sar-sim`.

    Args:
        argv: The arguments without the command's name; by default those of the process.

    Returns:
        The exit status: 0, also after SIGINT or SIGTERM; 2 for wrong usage or input.
    """
    return run(lambda: _command(sys.argv[1:] if argv is None else argv), "sar-sim")


def _command(argv: Sequence[str]) -> int:
    split = split_arguments(argv)
    parser = _parser()
    options = parser.parse_args(split.own)
    if options.command == "run":
        return _run(options, split.ros)
    interruptible()
    return _map(options) if options.command == "map" else sweep_missions(options)


def _parser() -> Parser:
    parser = Parser("sar-sim", "Run or map simulated worlds, or run a mission in them many times.")
    add_version(parser)
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    text = "Run a world with a simulated Nav2 until Ctrl-C."
    epilog = "Write ROS arguments after --ros-args. Ctrl-C or SIGTERM ends the command with status 0."
    live = commands.add_parser("run", help=text, description=text, epilog=epilog)
    _add_run(live)
    text = "Drive through a world with a lidar, and write the resulting map."
    survey = commands.add_parser("map", help=text, description=text)
    text = "write PREFIX.pgm and PREFIX.yaml (default: the name of WORLD)"
    survey.add_argument("-o", "--output", type=FILE, metavar="PREFIX", help=text)
    text = "Run a mission many times, and print its success rate for each combination of world, faults and parameters."
    add_sim_sweep(commands.add_parser("sweep", help=text, description=text))
    for add in (live.add_argument, survey.add_argument):
        text = f"a world file, or a shipped world's name (default {DEFAULT_WORLD})"
        add("world", nargs="?", default=DEFAULT_WORLD, type=WORLD, metavar="WORLD", help=text)
        add("--seed", type=seed, default=0, metavar="N", help="the seed of all simulated noise (default 0)")
    return parser


def _add_run(parser: argparse.ArgumentParser) -> None:
    """Add the options of `run`."""
    add = parser.add_argument
    text = "maximum number of simulated seconds per second; no step is skipped (default 1)"
    add("--speed", type=speed, default=1.0, metavar="N", help=text)
    text = (
        "add a robot with the namespace /NAME, also for its /tf and /tf_static. It starts at X, Y (metres) with heading YAW "
        "(radians) in the frame map, by default at the world's start pose. May be repeated. Without this option "
        "there is one robot, in the namespace of the command line"
    )
    add("--robot", type=_ROBOT, action="append", default=[], metavar="NAME[:X,Y[,YAW]]", help=text)
    text = (
        "inject a fault: navigate_to_pose:abort=PLACE, :code=NUMBER[@PLACE][,after=SECONDS], "
        ":late=SECONDS[@PLACE][,drives=SECONDS], :starved[@PLACE], :succeed[@PLACE], :delay=SECONDS, :reject=COUNT, :die[@PLACE][,back=SECONDS], amcl:die[@PLACE][,back=SECONDS]; may be repeated. "
        "With several robots, the fault is injected in each robot and counted separately"
    )
    add("--fault", type=_FAULT, action="append", default=[], metavar="SPEC", help=text)
    text = (
        "how the simulated Nav2 drives: accurately and without recoveries (quick, default), or like Nav2 with the "
        "shipped parameters (nav2): at 0.4 m/s, to within 0.25 m of the goal, and with recoveries, which move the robot"
    )
    add("--like", choices=MANNER_NAMES, default=QUICK_NAME, help=text)
    add(
        "--keep",
        type=FILE,
        metavar="FILE",
        help="store the robots' poses in FILE, and start the robots at the poses stored there",
    )
    text = "localise the robots at the start, so that they need no initial pose; use this for robots that start at stored poses"
    add("--localised", action="store_true", help=text)


def _load_world(name: str) -> "SimulatedWorld":
    """Load a world by name or path, and print the warnings about the world's file."""
    from sar_compiler.sim.world import find_world

    world = find_world(name)
    for finding in world.warnings:
        print_error(finding.render())
    return world


def _map(options: argparse.Namespace) -> int:
    from sar_compiler.sim.occupancy import map_files
    from sar_compiler.sim.survey import survey
    from sar_compiler.writing import WriteError, same_file, write_bytes

    world = _load_world(options.world)
    prefix: Path = options.output or Path(world.name)
    if same_file(prefix.with_name(f"{prefix.name}.yaml"), Path(options.world)):
        message = f"{prefix}.yaml would overwrite the world {options.world}. Write -o {prefix}_map"
        raise WriteError(message)
    line = ProgressLine()

    def show_progress(part: float) -> None:
        line.show(lambda: f"mapping '{world.name}': {part:.0%} of the route has been driven")

    try:
        occupancy = survey(world, seed=options.seed, on_progress=show_progress)
    finally:
        line.clear()
    files = map_files(occupancy, prefix)
    for path, content in files.items():
        write_bytes(path, content)
        print_text(str(path))
    return OK


def _run(options: argparse.Namespace, ros_arguments: Sequence[str]) -> int:
    # Signals are handled before any slow step, so that Ctrl-C always ends the command gracefully.
    signals = StopSignals()
    require_middleware()
    from sar_compiler.execution.sim_isolation import require_isolation
    from sar_compiler.sim.isolation import stay_on_this_machine
    from sar_compiler.sim.placement import PoseFile
    from sar_compiler.sim.simulation import Simulation, check_placements

    world = _load_world(options.world)
    robots = options.robot or [Placement("")]
    kept = PoseFile(options.keep, world.name) if options.keep is not None else None
    if kept is not None:
        robots = kept.restore(robots)
    robots = [replace(each, localised=options.localised, like=options.like) for each in robots]
    check_placements(world, robots)
    arguments = init_arguments(ros_arguments)
    stay_on_this_machine()
    with ros_up(arguments) as context:
        require_isolation(signals, context=context, actions=[robot.action for robot in robots])
        if signals.came:
            return OK
        faults = FaultPlan(options.fault)
        simulation = Simulation(
            world, robots, context=context, speed=options.speed, faults=faults, seed=options.seed
        )
        if kept is not None:
            simulation.store_poses(kept)
        with simulation:
            speed_text = f"at most {options.speed:g} times as fast as real time"
            print(f"sar-sim: '{world.name}' runs{_robots_text(robots)}, {speed_text}", flush=True)
            return _wait_for_signal(simulation, signals)


def _robots_text(robots: Sequence[Placement]) -> str:
    names = [f"/{robot.name}" for robot in robots if robot.name]
    return f" with {' and '.join(names)}" if names else ""


def _wait_for_signal(simulation: "Simulation", signals: StopSignals) -> int:
    """Wait for a signal to stop the process. If the simulation fails first, raise its error."""
    while not signals.wait(_CHECK_SEC):
        if simulation.failure is not None:
            raise simulation.failure
    return OK


if __name__ == "__main__":
    sys.exit(main())
