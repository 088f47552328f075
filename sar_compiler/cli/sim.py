"""`sar-sim`: the simulated world apart from the mission."""

import argparse
import math
import signal
import sys
import threading
from collections.abc import Sequence
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING

from sar_compiler.cli.arguments import OK, Parser, run, split_ros_arguments
from sar_compiler.errors import SarError
from sar_compiler.ros.faults import NAVIGATION, Fault, FaultError, FaultPlan, parse_fault

if TYPE_CHECKING:
    from sar_compiler.sim.simulation import Simulation

_WORLD = "disaster_zone"
# How often to look whether the simulation is still alive, seconds.
_LOOK_SEC = 0.5


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command `sar-sim`.

    Args:
        argv: The arguments after the command's name; those of the process if None.

    Returns:
        The exit status: 0, 2 for wrong usage or input, 130 and 143 when stopped by SIGINT and SIGTERM.
    """
    own, ros_arguments = split_ros_arguments(sys.argv[1:] if argv is None else argv)
    options = _parser().parse_args(own)
    if options.command == "map":
        return run(lambda: _map(options), "sar-sim")
    return run(lambda: _run(options, ros_arguments), "sar-sim")


def _parser() -> argparse.ArgumentParser:
    parser = Parser("sar-sim", "The simulated world, apart from the mission.")
    commands = parser.add_subparsers(dest="command", required=True)
    text = "Run the world and the stand-in for Nav2 until stopped."
    live = commands.add_parser(
        "run", help=text, description=text, epilog="ROS arguments go after --ros-args."
    )
    live.add_argument(
        "--speed", type=_speed, default=1.0, help="simulated seconds per second, at most (default 1)"
    )
    live.add_argument(
        "--fault",
        type=_fault,
        action="append",
        default=[],
        metavar="SPEC",
        help="misbehave: navigate_to_pose:abort=ZONE, :reject=COUNT, :die@ZONE[,back=SECONDS]",
    )
    text = "Drive through a world with a lidar and write the map that comes of it."
    survey = commands.add_parser("map", help=text, description=text)
    survey.add_argument(
        "-o",
        "--output",
        type=Path,
        metavar="PREFIX",
        help="write PREFIX.pgm and PREFIX.yaml (default: WORLD's name)",
    )
    for command in (live, survey):
        command.add_argument(
            "world", nargs="?", default=_WORLD, help=f"file or shipped world (default {_WORLD})"
        )
        command.add_argument("--seed", type=_seed, default=0, help="seed of all noise (default 0)")
    return parser


def _speed(text: str) -> float:
    try:
        speed = float(text)
    except ValueError:
        speed = math.nan
    if not (math.isfinite(speed) and speed > 0.0):
        message = f"'{text}' is not a number above 0"
        raise argparse.ArgumentTypeError(message)
    return speed


def _seed(text: str) -> int:
    if not (text.isascii() and text.isdigit()):
        message = f"'{text}' is not a whole number, 0 or above"
        raise argparse.ArgumentTypeError(message)
    return int(text)


def _fault(text: str) -> Fault:
    try:
        fault = parse_fault(text)
    except FaultError as error:
        raise argparse.ArgumentTypeError(str(error)) from error
    if fault.target != NAVIGATION:
        message = (
            f"'{text}': the world has no such service; give it to the service's own command, or to sar-run"
        )
        raise argparse.ArgumentTypeError(message)
    return fault


def _map(options: argparse.Namespace) -> int:
    from sar_compiler.sim.occupancy import write_map
    from sar_compiler.sim.survey import survey
    from sar_compiler.sim.world_file import find_world

    world = find_world(options.world)
    for path in write_map(survey(world, seed=options.seed), options.output or Path(world.name)):
        print(path)
    return OK


def _run(options: argparse.Namespace, ros_arguments: Sequence[str]) -> int:
    from sar_compiler.sim.world_file import find_world

    stop = _StopSignals()
    try:
        import rclpy

        from sar_compiler.sim.isolation import refuse_company, stay_on_this_machine
        from sar_compiler.sim.simulation import Simulation
    except ImportError as error:
        message = f"ROS 2 is not installed here ({error})"
        raise SarError(message) from error
    world = find_world(options.world)
    stay_on_this_machine()
    try:
        rclpy.init(args=list(ros_arguments), signal_handler_options=rclpy.signals.SignalHandlerOptions.NO)
    except RuntimeError as error:
        message = f"ROS does not accept the arguments {' '.join(ros_arguments)}: {error}"
        raise SarError(message) from error
    try:
        refuse_company()
        faults = FaultPlan(options.fault)
        with Simulation(world, speed=options.speed, faults=faults, seed=options.seed) as simulation:
            print(
                f"sar-sim: '{world.name}' runs, at most {options.speed:g} times as fast as real time",
                flush=True,
            )
            return stop.wait(simulation)
    finally:
        rclpy.try_shutdown()


class _StopSignals:
    """Turns SIGINT and SIGTERM into an exit status."""

    def __init__(self) -> None:
        self._number = 0
        self._came = threading.Event()
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, self._note)

    def wait(self, simulation: "Simulation") -> int:
        """Return the exit status once a signal has come; raise what ended the simulation if that is first."""
        while not self._came.wait(_LOOK_SEC):
            if simulation.failure is not None:
                raise simulation.failure
        return 128 + self._number

    def _note(self, number: int, _: FrameType | None) -> None:
        self._number = number
        self._came.set()
