"""The cost of a command: its time, the CPU time of all its processes, and the peak memory of one of them."""

import json
import os
import signal
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from benchmarks.figures import UnmeasurableError

SCRIPTS = Path(sys.executable).parent
"""The project's commands in the environment that measures; it has ROS."""
PLAIN = Path(__file__).parents[1] / "build" / "plain" / "bin"
"""The commands in an environment with only the result of `pip install .` (`make build/plain/.installed`)."""

# Small and without site packages, because the memory of a process includes that of its parent at its start.
_LAUNCHER = """
import json, os, sys, time
start = time.perf_counter()
process = os.posix_spawnp(sys.argv[2], sys.argv[2:], os.environ)
_, status, usage = os.wait4(process, 0)
passed = time.perf_counter() - start
cost = [passed, usage.ru_utime + usage.ru_stime, usage.ru_maxrss * 1024 / 1e6, os.waitstatus_to_exitcode(status)]
with open(sys.argv[1], "w") as file:
    json.dump(cost, file)
"""


class Cost(NamedTuple):
    """The cost of a command.

    Attributes:
        passed: The seconds that passed.
        cpu: The CPU seconds of it and of all processes that it has waited for.
        memory: The peak memory of one of these processes, in MB.
        printed: Its standard output.
    """

    passed: float
    cpu: float
    memory: float
    printed: str


def run(
    command: Sequence[str | Path],
    *,
    statuses: Sequence[int] = (0,),
    more: Mapping[str, str] | None = None,
    folder: Path | None = None,
) -> Cost:
    """Run a command to its end.

    Args:
        command: The command.
        statuses: The exit statuses that it may have.
        more: Environment variables in addition to those of this process.
        folder: Its working folder.

    Raises:
        UnmeasurableError: It has another exit status.
    """
    with tempfile.TemporaryDirectory() as place:
        cost = Path(place, "cost.json")
        launch = [sys.executable, "-I", "-S", "-c", _LAUNCHER, str(cost), *map(str, command)]
        environment = {**os.environ, **(more or {})}
        process = subprocess.Popen(
            launch,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            env=environment,
            cwd=folder,
            start_new_session=True,
        )
        try:
            printed, said = process.communicate()
        except BaseException:
            # The launcher's child would continue after a row is abandoned.
            os.killpg(process.pid, signal.SIGKILL)
            process.communicate()
            raise
        passed, cpu, memory, status = json.loads(cost.read_bytes())
    if status not in statuses:
        last = (said or printed).strip().splitlines()[-1:]
        raise UnmeasurableError(f"{Path(command[0]).name} {command[1]} ended with {status}: {''.join(last)}")
    return Cost(passed, cpu, memory, printed)


def plain(name: str) -> Path:
    """Return a program of the environment without ROS.

    Raises:
        UnmeasurableError: The environment is missing.
    """
    if not (PLAIN / name).exists():
        raise UnmeasurableError("build/plain is missing: `make bench` installs it")
    return PLAIN / name


def require_ros() -> None:
    """Raise UnmeasurableError if this environment has no ROS 2."""
    from importlib.util import find_spec

    if not (find_spec("rclpy") and find_spec("nav2_msgs")):
        raise UnmeasurableError("there is no ROS 2 in this environment")
