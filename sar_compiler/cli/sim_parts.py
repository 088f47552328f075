"""The processes of `sar-sim run --separate`."""

import os
import subprocess
import sys
import threading
import time
from argparse import Namespace
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

from sar_compiler.commands import OK, print_error
from sar_compiler.ros.arguments import init_arguments
from sar_compiler.ros.middleware import ros_up
from sar_compiler.ros.signals import StopSignals
from sar_compiler.sim.placement import PARTS, Placement

# How long a process may take to end, seconds.
_END_SEC = 5.0
# How often it is looked whether the process above is still there, seconds.
_LOOK_SEC = 0.5
# Tells a part whose process it belongs to: it ends with that one, also if that is killed.
_PARENT = "SAR_SIM_PARENT"


class PartProcesses:
    """The parts of a simulation in processes of their own.

    Args:
        processes: The processes by what they are.
    """

    def __init__(self, processes: "dict[str, subprocess.Popen[bytes]]") -> None:
        self._processes = processes

    def look(self) -> None:
        """Say which has ended since the last look."""
        for part in [part for part, process in self._processes.items() if process.poll() is not None]:
            process = self._processes.pop(part)
            print_error(
                f"sar-sim: {part} (process {process.pid}) has ended with status {process.returncode}; "
                f"sar-sim run --only {part} starts it again"
            )

    def end(self) -> None:
        """End those that are left."""
        for process in self._processes.values():
            process.terminate()
        for process in self._processes.values():
            _await_end(process)


def _await_end(process: "subprocess.Popen[bytes]") -> None:
    try:
        process.wait(_END_SEC)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()


@contextmanager
def other_parts(
    options: Namespace, robots: Sequence[Placement], ros: Sequence[str]
) -> Iterator[PartProcesses]:
    """Have all parts but the robot's own in processes, and say which these are.

    Args:
        options: Of `sar-sim run`.
        robots: The robots.
        ros: ROS arguments.
    """
    command = [sys.executable, "-m", "sar_compiler.cli.sim", "run", options.world, "--like", options.like]
    command += [word for robot in robots if robot.name for word in ("--robot", robot.name)]
    command += ["--localised"] if options.localised else []
    environment = {**os.environ, _PARENT: str(os.getpid())}
    parts: dict[str, subprocess.Popen[bytes]] = {}
    for part in PARTS[1:]:
        words = [*command, "--only", part, "--ros-args", *ros]
        parts[part] = subprocess.Popen(words, env=environment)  # noqa: S603 - ourselves
        print(f"sar-sim: {part} is process {parts[part].pid}", flush=True)
    processes = PartProcesses(parts)
    try:
        yield processes
    finally:
        processes.end()


def _end_with(parent: str) -> None:
    """End this process when its parent is gone, whatever it waits for: whom an orderly end would serve is gone, too."""
    while str(os.getppid()) == parent:
        time.sleep(_LOOK_SEC)
    os._exit(OK)


def run_part(
    options: Namespace, robots: Sequence[Placement], ros: Sequence[str], signals: StopSignals
) -> int:
    """Be one part of a simulation whose world is in another process; return the exit status."""
    from sar_compiler.sim.isolation import stay_on_this_machine
    from sar_compiler.sim.separate import SeparatePart
    from sar_compiler.sim.world import find_world

    world, parent = find_world(options.world), os.environ.get(_PARENT)
    if parent is not None:
        threading.Thread(target=_end_with, args=(parent,), daemon=True).start()
    stay_on_this_machine()
    with ros_up(init_arguments(ros)) as context:
        part = SeparatePart(options.only, world, robots, context=context, interrupted=lambda: signals.came)
        print(f"sar-sim: {options.only} runs in '{world.name}'", flush=True)
        part.run()
    return OK
