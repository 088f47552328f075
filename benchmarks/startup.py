"""What it costs to begin: to validate the shipped tree from a shell, and to come to the first tick of `sar-run`.

Both are compared with the least that such a command needs: an import of lxml, and a bare node of rclpy with an action
client and a subscription. CPU time is user and system time of the process with all its threads. Each figure is the
median of many runs; what is compared runs in turn, so that all have the same share of a busy machine.

    python benchmarks/startup.py             # validate
    python benchmarks/startup.py first-tick  # sar-run, with `sar-sim` and the mission's servers in processes of their own

The first is best run with an environment that has this project, and not the ROS packages from PyPI, which do something
whenever an interpreter starts:

    python3 -m venv build/startup && build/startup/bin/pip install .
    cd build && startup/bin/python ../benchmarks/startup.py

An installation has its modules compiled; in a checkout Python may have to do that first (PYTHONDONTWRITEBYTECODE).
"""

import os
import resource
import signal
import statistics
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path

RUNS = {"validate": 40, "first-tick": 10}
TREE = "search_and_rescue"
_PYTHON = sys.executable
_VALIDATE = "import sys; from sar_compiler.cli.compile import main; sys.exit(main(sys.argv[1:]))"
_BARE_NODE = """
import rclpy
from geometry_msgs.msg import PoseWithCovarianceStamped
from nav2_msgs.action import NavigateToPose
from rclpy.action import ActionClient
from rclpy.node import Node

rclpy.init()
node = Node("bare")
client = ActionClient(node, NavigateToPose, "navigate_to_pose")
node.create_subscription(PoseWithCovarianceStamped, "amcl_pose", lambda _: None, 10)
node.create_timer(0.05, lambda: client.server_is_ready() and print("ready", flush=True))
rclpy.spin(node)
"""
_TICKS_PER_SEC = os.sysconf("SC_CLK_TCK")
_SCRIPTS = Path(_PYTHON).parent
VALIDATING = {
    "import lxml.etree": [_PYTHON, "-c", "import lxml.etree"],
    "python, nothing else": [_PYTHON, "-c", "pass"],
    "import py_trees": [_PYTHON, "-c", "import py_trees"],
    "sar-compile --help": [_PYTHON, "-c", _VALIDATE, "--help"],
    f"sar-compile validate {TREE}": [_PYTHON, "-c", _VALIDATE, "validate", TREE],
}
BEGINNING = {
    "a bare node finds its action server": [_PYTHON, "-c", _BARE_NODE],
    f"sar-run {TREE}, to the first tick": [str(_SCRIPTS / "sar-run"), TREE, "--view", "text"],
}
SERVERS = {
    "sar-sim": ["run"],
    "sar-detect-survivor-server": [],
    "sar-report-survivor-server": [],
}

Seconds = tuple[float, float]
"""CPU time and wall time."""


def to_the_end(command: Sequence[str]) -> Seconds:
    """Return how long a command takes.

    Raises:
        CalledProcessError: If it fails.
    """
    before, start = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    wall, after = time.perf_counter() - start, resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime, wall


def to_the_first_line(command: Sequence[str]) -> Seconds:
    """Return how long a command takes until it has written its first line; it is interrupted then."""
    start = time.perf_counter()
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL) as process:
        assert process.stdout is not None
        assert process.stdout.readline(), f"{command} has written nothing"
        wall = time.perf_counter() - start
        fields = Path(f"/proc/{process.pid}/stat").read_text(encoding="ascii").rpartition(")")[2].split()
        process.send_signal(signal.SIGINT)
        process.stdout.read()
    # The 14th and 15th fields; the first two stand before the name's bracket.
    return (int(fields[11]) + int(fields[12])) / _TICKS_PER_SEC, wall


@contextmanager
def servers() -> Iterator[None]:
    """Run the simulator and the mission's servers, apart from any other ROS on this machine."""
    os.environ.setdefault("ROS_DOMAIN_ID", "87")
    os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
    running = [
        subprocess.Popen(
            [str(_SCRIPTS / name), *arguments], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL
        )
        for name, arguments in SERVERS.items()
    ]
    try:
        assert running[0].stdout is not None
        assert running[0].stdout.readline(), "sar-sim has not started"
        yield
    finally:
        for process in running:
            process.send_signal(signal.SIGINT)
        for process in running:
            process.communicate()


def compare(
    commands: Mapping[str, Sequence[str]], seconds: Callable[[Sequence[str]], Seconds], runs: int
) -> None:
    """Measure and print; the first command is what the others are compared with."""
    taken: dict[str, list[Seconds]] = {name: [] for name in commands}
    for _ in range(runs + 1):
        for name, command in commands.items():
            taken[name].append(seconds(command))
    # The first run of each fills the caches.
    medians = {
        name: [statistics.median(each) for each in zip(*all_[1:], strict=True)]
        for name, all_ in taken.items()
    }
    reference = next(iter(medians.values()))
    for name, (cpu, wall) in medians.items():
        ratios = f"{cpu / reference[0]:5.2f} x CPU  {wall / reference[1]:5.2f} x wall"
        print(f"{name:45} {cpu * 1e3:7.1f} ms CPU {wall * 1e3:8.1f} ms wall  {ratios}")


def main() -> None:
    """Measure what is asked for: `validate` or `first-tick`, and how many runs of it."""
    what = sys.argv[1] if len(sys.argv) > 1 else "validate"
    runs = int(sys.argv[2]) if len(sys.argv) > 2 else RUNS[what]  # noqa: PLR2004
    if what == "validate":
        compare(VALIDATING, to_the_end, runs)
    else:
        with servers():
            compare(BEGINNING, to_the_first_line, runs)


if __name__ == "__main__":
    main()
