"""What `sar-run` costs while its robot drives: of a core, beside a bare node of rclpy that has sent the same goal, and with each option.

The robot drives along a corridor so long that it never arrives, in `sar-sim`, whose process does not count. The bare node has an action
client, which hears feedback, and a timer at the rate at which `sar-run` ticks; "that listens as well" also hears the topics that `sar-run`
needs to know whether the robot is localised and stands. Neither counts before it has driven for a while.
"""

import importlib.util
import itertools
import signal
import statistics
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import closing
from functools import partial
from pathlib import Path
from typing import NamedTuple

from benchmarks.figures import Effort, Missing, Result, compared, in_turns, memory_now, plain
from benchmarks.startup import SCRIPTS, servers

RATES_HZ = (2, 10, 100)
RATES_WITH_OPTIONS_HZ = (10, 100)
BARE, LISTENING, BY_EVENTS = (
    "a bare node",
    "a bare node that listens as well",
    "a bare node on EventsExecutor",
)
MEMORY = "memory of sar-run, 10 Hz"
_SINGLE = "--executor single-threaded"
OPTIONS: Mapping[str, Sequence[str]] = {
    "--journal FILE": ("--new", "--journal", "{0}/mission.journal"),
    "--view web": ("--view", "web", "--web-port", "0"),
    "--publish": ("--publish",),
    "--groot2 PORT": ("--groot2", "1767"),
    "--record FILE": ("--record", "{0}/{1}.mcap"),
    "--properties": ("--properties",),
}
_LENGTH_M = 1200
_MAP = "image: map.pgm\nresolution: 0.5\norigin: [0.0, -3.0, 0.0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n"
_WORLD = "robot: {x: 2.0, y: 0.0, yaw: 0.0, radius: 0.22}\nmap: map.yaml\nwalls:\n  - {x: 5.0, y: 2.9, size_x: 10.0, size_y: 0.1}\n"
_PARAMETERS = f"""/**:
  ros__parameters:
    zone_order: ["far"]
    zones: {{far: {{x: {_LENGTH_M - 10.0}, y: 0.0, yaw: 0.0}}}}
    base_station: {{x: 2.0, y: 0.0, yaw: 0.0}}
    set_initial_pose: false
"""
_BARE = f"""
import sys
import rclpy
from geometry_msgs.msg import PoseWithCovarianceStamped
from nav2_msgs.action import NavigateToPose
from nav_msgs.msg import Odometry
from rclpy.action import ActionClient
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data
from tf2_msgs.msg import TFMessage

rate, by_events, listens = float(sys.argv[1]), sys.argv[2] == "events", sys.argv[3] == "listens"
rclpy.init()
node = Node("bare")
client = ActionClient(node, NavigateToPose, "navigate_to_pose")
if listens:
    for kind, topic in ((PoseWithCovarianceStamped, "amcl_pose"), (Odometry, "odometry/filtered"), (TFMessage, "/tf")):
        node.create_subscription(kind, topic, lambda _: None, qos_profile_sensor_data)
sent = []

def tick():
    if not sent and client.server_is_ready():
        goal = NavigateToPose.Goal()
        goal.pose.header.frame_id, goal.pose.pose.position.x = "map", {_LENGTH_M - 10.0}
        sent.append(client.send_goal_async(goal, lambda message: None))
        sent[0].add_done_callback(judge)

def judge(answer):
    if answer.result().accepted:
        print("Navigating to it", flush=True)
    else:
        # Who drives is not active yet.
        sent.clear()

node.create_timer(1.0 / rate, tick)
if by_events:
    from rclpy.experimental import EventsExecutor as Executor
else:
    from rclpy.executors import SingleThreadedExecutor as Executor
executor = Executor()
executor.add_node(node)
while rclpy.ok():
    executor.spin_once(timeout_sec=1.0)
"""
_DOMAIN = "86"
_WARM_SEC, _SEC, _PATIENCE_SEC, _LEAST = 2.0, 6.0, 60.0, 0.0005


def subject(rate_hz: float, option: str = "") -> str:
    """Return how the figure of a run is called."""
    return f"sar-run {option}".rstrip() + f", {rate_hz} Hz"


def points(option: str, rate_hz: float) -> str:
    """Return how the figure of what an option adds is called."""
    return f"{option} adds, {rate_hz} Hz"


def measure(effort: Effort) -> Iterator[Result]:
    """Yield the share of a core at each rate, and what each option adds."""
    if not (importlib.util.find_spec("rclpy") and importlib.util.find_spec("nav2_msgs")):
        yield Missing("", BARE, "there is no ROS 2")
        return
    seconds = max(1.0, _SEC * effort.share)
    with tempfile.TemporaryDirectory() as folder:
        _furnish(Path(folder))
        with servers(_DOMAIN, "run", f"{folder}/corridor.yaml", "--localised"):
            for rate in RATES_HZ:
                yield from _at_a_rate(rate, folder, seconds, effort)
            for rate in RATES_WITH_OPTIONS_HZ:
                yield from _with_options(rate, folder, seconds, effort)


def _with_options(rate: int, folder: str, seconds: float, effort: Effort) -> Iterator[Result]:
    options = {name: _run(folder, rate, words) for name, words in OPTIONS.items()}
    cases = {"": _run(folder, rate), **options}
    taken = in_turns({name: partial(_drive, run, seconds) for name, run in cases.items()}, effort.few)
    for name in OPTIONS:
        pairs = zip(taken[name], taken[""], strict=True)
        added = [with_it.share - without.share for with_it, without in pairs]
        # Less is what the same run differs by from turn to turn.
        yield plain(points(name, rate), max(statistics.median(added), _LEAST), "core")


def _at_a_rate(rate: int, folder: str, seconds: float, effort: Effort) -> Iterator[Result]:
    bare = [sys.executable, "-c", _BARE, str(rate)]
    cases = {
        BARE: itertools.repeat([*bare, "single", ""]),
        LISTENING: itertools.repeat([*bare, "single", "listens"]),
        BY_EVENTS: itertools.repeat([*bare, "events", ""]),
        "": _run(folder, rate),
        _SINGLE: _run(folder, rate, _SINGLE.split()),
    }
    drives = in_turns({name: partial(_drive, run, seconds) for name, run in cases.items()}, effort.few)
    taken = {name: [each.share for each in those] for name, those in drives.items()}
    ours, single = taken.pop(""), taken.pop(_SINGLE)
    yield from compared(subject(rate), ours, taken, "core")
    yield from compared(subject(rate, _SINGLE), single, taken, "core")
    if rate == RATES_WITH_OPTIONS_HZ[0]:
        held = {name: [each.memory for each in drives[name]] for name in ("", BARE, LISTENING)}
        yield from compared(MEMORY, held.pop(""), held, "bytes")


def _run(folder: str, rate: int, words: Sequence[str] = ()) -> Iterator[list[str]]:
    """Yield the command of one run after the other."""
    for number in itertools.count():
        given = [word.format(folder, f"{rate}.{number}") for word in words]
        journal = [] if "--journal" in given else ["--journal", "none"]
        ros = ["--ros-args", "-p", f"tick_rate_hz:={rate:.1f}"]
        yield [str(SCRIPTS / "sar-run"), "--params", f"{folder}/params.yaml", *journal, *given, *ros]


def _furnish(folder: Path) -> None:
    """Write a world that is a corridor, and the parameters of a mission in it."""
    width, height = _LENGTH_M * 2, 12
    (folder / "map.pgm").write_bytes(b"P5\n%d %d\n255\n" % (width, height) + b"\xfe" * (width * height))
    for name, text in (("map.yaml", _MAP), ("corridor.yaml", _WORLD), ("params.yaml", _PARAMETERS)):
        (folder / name).write_text(text, encoding="utf-8")


class Drive(NamedTuple):
    """What a command takes while the robot drives.

    Attributes:
        share: Of a core.
        memory: Bytes.
    """

    share: float
    memory: float


def _drive(commands: Iterator[list[str]], seconds: float) -> Drive:
    """Return what a command takes while the robot drives.

    Raises:
        ValueError: If it is none of a core.
    """
    command = next(commands)
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT) as process:
        assert process.stdout is not None
        late = threading.Timer(_PATIENCE_SEC, process.kill)
        late.start()
        with closing(process.stdout):
            try:
                assert any(b"Navigating to " in line for line in process.stdout), f"{command} does not drive"
                time.sleep(_WARM_SEC)
                start, cpu = time.monotonic(), _cpu_sec(process.pid)
                time.sleep(seconds)
                cpu, passed = _cpu_sec(process.pid) - cpu, time.monotonic() - start
                memory = memory_now(process.pid)
            finally:
                late.cancel()
                process.send_signal(signal.SIGINT)
                process.stdout.read()
    if cpu <= 0.0:
        message = f"{command} took {cpu} s of CPU: what it is measured with does not work"
        raise ValueError(message)
    return Drive(cpu / passed, memory)


def _cpu_sec(process: int) -> float:
    """Return the CPU seconds of all threads that a process has."""
    tasks = Path(f"/proc/{process}/task")
    return sum(int((each / "schedstat").read_text().split()[0]) for each in tasks.iterdir()) / 1e9
