"""What it costs to begin: to validate the shipped tree from a shell, to come to the first tick of `sar-run`, to fly a mission.

Validating is compared with an import of lxml, in the environment of the peers: it has this project, and not the ROS packages
from PyPI, which do something whenever an interpreter starts. `sar-run` is compared with a bare node of rclpy that has an action
client and a subscription, with `sar-sim` and the mission's servers in processes of their own. CPU time is user and system
time of a process with all its threads.
"""

import importlib.util
import itertools
import json
import os
import signal
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path

from benchmarks.figures import Effort, Missing, Result, compared, cpu_of_children, in_turns, plain
from benchmarks.peers import PYTHON

TREE = "search_and_rescue"
LXML, BARE_NODE, WAITING = "import lxml.etree", "a bare node", "a bare node, time that passes"
VALIDATE = f"sar-compile validate {TREE}"
FIRST_TICK = f"sar-run {TREE}, to the first tick"
WITH_JOURNAL = f"{FIRST_TICK}, with a journal"
LOOK = f"{FIRST_TICK}, time that passes, of it looking for another mission"
MISSION = f"sar-run {TREE} --sim, the whole mission"
FIRST_GOAL = f"sar-run {TREE} --sim, to the first goal, time that passes"
SUMMARY = f"{MISSION}, time that passes"
_FIRST_TICK_SAYS = "Navigating to "
_MAIN = "import sys; from sar_compiler.cli.compile import main; "
_ARGUMENTS = f"['validate', '{TREE}']"
_AGAIN = f"import time; main({_ARGUMENTS}); start = time.process_time(); main({_ARGUMENTS}); "
# The same without the look for another mission.
_UNLOOKED = "import sys; from sar_compiler.cli import run_mission_tree, run; run_mission_tree.LOOK_SEC = 0.0; sys.exit(run.main())"
_SHORT: Mapping[str, str] = {
    LXML: "import lxml.etree",
    "python, nothing else": "pass",
    "import py_trees": "import py_trees",
    "sar-compile --help": f"{_MAIN}main(['--help'])",
    VALIDATE: f"import sys; sys.argv = ['sar-compile', *{_ARGUMENTS}]; "
    "from sar_compiler.cli.console import sar_compile; sar_compile()",
}
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
SCRIPTS = Path(sys.executable).parent
_DOMAIN = "87"
_DOMAINS_OF_MISSIONS = itertools.count(88)
_TICKS_PER_SEC = os.sysconf("SC_CLK_TCK")
# A short process needs more rounds than others.
_MORE = 3


def measure(effort: Effort) -> Iterator[Result]:
    """Yield the figures of short commands, of the first tick and of a mission."""
    if PYTHON.exists():
        yield from _short(effort)
    else:
        yield Missing("", LXML, "the environment of the peers is not there")
    # The message packages are what is missing where only the wheels are.
    if importlib.util.find_spec("rclpy") and importlib.util.find_spec("nav2_msgs"):
        yield from _with_ros(effort)
    else:
        yield Missing("", BARE_NODE, "there is no ROS 2")


def _short(effort: Effort) -> Iterator[Result]:
    actions = {name: partial(_to_the_end, [str(PYTHON), "-c", code]) for name, code in _SHORT.items()}
    actions["validate, again in the same process"] = partial(
        _printed, f"{_MAIN}{_AGAIN}print(time.process_time() - start)"
    )
    for action in actions.values():
        action()  # which fills the caches
    taken = in_turns(actions, effort.rounds * _MORE)
    reference = {LXML: taken.pop(LXML)}
    for name, seconds in taken.items():
        yield from compared(name, seconds, reference)
    counted = _printed(
        f"{_MAIN}main({_ARGUMENTS}); print(sum(name.startswith('sar_compiler') for name in sys.modules))"
    )
    yield plain("modules of this project that it imports", counted, "modules")


def _with_ros(effort: Effort) -> Iterator[Result]:
    bare = [sys.executable, "-c", _BARE_NODE]
    run = [str(SCRIPTS / "sar-run"), TREE]
    unlooked = [sys.executable, "-c", _UNLOOKED, TREE, "--journal", "none"]
    with servers(_DOMAIN), tempfile.TemporaryDirectory() as folder:
        journal = ["--new", "--journal", str(Path(folder, "mission.journal"))]
        taken = in_turns(
            {
                BARE_NODE: lambda: _to_a_line(bare),
                "": lambda: _to_a_line([*run, "--journal", "none"], _FIRST_TICK_SAYS),
                WITH_JOURNAL: lambda: _to_a_line([*run, *journal], _FIRST_TICK_SAYS),
                LOOK: lambda: _to_a_line(unlooked, _FIRST_TICK_SAYS),
            },
            effort.rounds,
        )
    (cpu, wall), (bare_cpu, bare_wall) = (zip(*taken[name], strict=True) for name in ("", BARE_NODE))
    yield from compared(FIRST_TICK, cpu, {BARE_NODE: bare_cpu})
    yield from compared(WITH_JOURNAL, [each[0] for each in taken[WITH_JOURNAL]], {BARE_NODE: bare_cpu})
    yield from compared(f"{FIRST_TICK}, time that passes", wall, {WAITING: bare_wall})
    yield plain(WAITING, statistics.median(bare_wall), "s")
    yield plain(LOOK, statistics.median(wall) - statistics.median(each[1] for each in taken[LOOK]), "s")
    begun = [_to_a_line(_simulated(), _FIRST_TICK_SAYS)[1] for _ in range(effort.few)]
    yield plain(FIRST_GOAL, statistics.median(begun), "s")
    missions = [_mission() for _ in range(effort.few)]
    cpu, wall, simulated = zip(*missions, strict=True)
    yield from compared(MISSION, cpu, {BARE_NODE: bare_cpu[: len(missions)]})
    yield plain(SUMMARY, statistics.median(wall), "s")
    yield plain(f"{MISSION}, simulated time", statistics.median(simulated), "s")


def _to_the_end(command: Sequence[str]) -> float:
    """Return the CPU seconds of a command.

    Raises:
        CalledProcessError: If it fails.
    """
    before = cpu_of_children()
    # A folder from which nothing can be imported in place of what is installed.
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL, cwd=PYTHON.parent)
    return cpu_of_children() - before


def _printed(code: str) -> float:
    """Return the number that a piece of code prints last."""
    command = [str(PYTHON), "-c", code]
    done = subprocess.run(command, check=True, capture_output=True, text=True, cwd=PYTHON.parent)
    return float(done.stdout.splitlines()[-1])


def _to_a_line(command: Sequence[str], words: str = "") -> tuple[float, float]:
    """Return the CPU seconds and the seconds until a command has written a line with some words; it is interrupted then."""
    start = time.perf_counter()
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT) as process:
        assert process.stdout is not None
        assert any(words.encode() in line for line in process.stdout), f"{command} has not written '{words}'"
        wall = time.perf_counter() - start
        fields = Path(f"/proc/{process.pid}/stat").read_text(encoding="ascii").rpartition(")")[2].split()
        process.send_signal(signal.SIGINT)
        process.stdout.read()
    # The 14th and 15th fields; the first two stand before the name's bracket.
    return (int(fields[11]) + int(fields[12])) / _TICKS_PER_SEC, wall


def _mission() -> tuple[float, float, float]:
    """Return the CPU seconds of a simulated mission, those that pass, and how many it takes in the simulation."""
    before, start = cpu_of_children(), time.perf_counter()
    command = [*_simulated(), "--view", "none", "--format", "json"]
    done = subprocess.run(command, check=True, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL)
    wall = time.perf_counter() - start
    return cpu_of_children() - before, wall, float(json.loads(done.stdout)["duration"])


def _simulated() -> list[str]:
    """Return the command of a simulated mission, apart from all servers of before.

    What has just gone may still be seen, and a call to it waits for its deadline.
    """
    os.environ["ROS_DOMAIN_ID"] = str(next(_DOMAINS_OF_MISSIONS))
    return [str(SCRIPTS / "sar-run"), TREE, "--sim", "--speed", "1000", "--journal", "none"]


@contextmanager
def servers(domain: str, *sim: str) -> Iterator[None]:
    """Run the simulator, by default in the shipped world, and the mission's servers, apart from any other ROS on this machine.

    Two calls take two domains: what has just gone may still be seen, and who sends a goal to it never hears of it.
    """
    os.environ["ROS_DOMAIN_ID"] = domain
    os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
    commands = (
        ["sar-sim", *(sim or ("run",))],
        ["sar-detect-survivor-server"],
        ["sar-report-survivor-server"],
    )
    running = [
        subprocess.Popen([SCRIPTS / name, *arguments], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL)
        for name, *arguments in commands
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
