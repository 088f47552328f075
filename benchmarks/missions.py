"""The cost of a mission, and its latencies: the first tick, the next goal, a run that drives, a whole simulated mission.

A robot drives in `sar-sim` along a corridor so long that it never arrives. The process of `sar-sim` is not measured. For comparison, a plain rclpy
node sends the same goal and subscribes to the same topics. Servers and runs use simulated time.
"""

import itertools
import json
import os
import signal
import statistics
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

from benchmarks.commands import SCRIPTS, require_ros, run
from benchmarks.figures import Effort, UnmeasurableError, measured, medians
from benchmarks.rows import Benchmark, Limit, Measured, Row, seconds

_TREE = "search_and_rescue"
_BARE = "x a bare node"
_RATE_HZ = 10
_WARM_SEC, _DRIVE_SEC, _PATIENCE_SEC = 2.0, 6.0, 60.0
_GOALS, _BROWSERS, _SIMULATED = 100, 5, 24
# Discovery takes 0 to 3 s at random, also for a plain node.
_STARTS = 11
_SERVERS_DOMAIN, _GOALS_DOMAIN, _SWEEP_DOMAIN = "86", "84", "85"
# A server that has just ended may still be discovered, and a call to it would wait for its deadline.
_MISSION_DOMAINS = itertools.count(88)
_LENGTH_M = 1200
_FILES: Mapping[str, str] = {
    "map.yaml": "image: map.pgm\nresolution: 0.5\norigin: [0.0, -3.0, 0.0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n",
    "corridor.yaml": "robot: {x: 2.0, y: 0.0, yaw: 0.0, radius: 0.22}\nmap: map.yaml\nwalls:\n  - {x: 5.0, y: 2.9, size_x: 10.0, size_y: 0.1}\n",
    "params.yaml": f"""/**:
  ros__parameters:
    use_sim_time: true
    zone_order: ["far"]
    zones: {{far: {{x: {_LENGTH_M - 10.0}, y: 0.0, yaw: 0.0}}}}
    base_station: {{x: 2.0, y: 0.0, yaw: 0.0}}
    set_initial_pose: false
""",
    "bare.py": f"""
import rclpy
from geometry_msgs.msg import PoseWithCovarianceStamped
from nav2_msgs.action import NavigateToPose
from nav_msgs.msg import Odometry
from rclpy.action import ActionClient
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import qos_profile_sensor_data
from tf2_msgs.msg import TFMessage

rclpy.init()
node = Node("bare", parameter_overrides=[Parameter("use_sim_time", value=True)])
client = ActionClient(node, NavigateToPose, "navigate_to_pose")
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
        sent.clear()  # Nav2 is not active yet.

node.create_timer({1.0 / _RATE_HZ}, tick)
executor = SingleThreadedExecutor()
executor.add_node(node)
while rclpy.ok():
    executor.spin_once(timeout_sec=1.0)
""",
    # The time from the result of a goal until the next goal comes, seen by the server.
    "server.py": f"""
import time
import rclpy
from nav2_msgs.action import ComputePathToPose as Goal
from rclpy.action import ActionServer
from rclpy.node import Node

rclpy.init()
node, ended, taken = Node("server"), [], []

def on_goal(_goal):
    if ended:
        taken.append(time.perf_counter() - ended[-1])
    return rclpy.action.GoalResponse.ACCEPT

def execute(handle):
    time.sleep(0.05)
    handle.succeed()
    ended.append(time.perf_counter())
    return Goal.Result()

server = ActionServer(node, Goal, "next_goal", execute, goal_callback=on_goal)
print("ready", flush=True)
while len(taken) < {_GOALS}:
    rclpy.spin_once(node, timeout_sec=1.0)
print(sorted(taken[10:])[len(taken[10:]) // 2], flush=True)
rclpy.spin(node)
""",
    "client.py": """
import rclpy
from nav2_msgs.action import ComputePathToPose as Goal
from rclpy.action import ActionClient
from rclpy.node import Node

rclpy.init()
node = Node("client")
client = ActionClient(node, Goal, "next_goal")
client.wait_for_server()

def send(_):
    client.send_goal_async(Goal.Goal()).add_done_callback(ask)

def ask(handle):
    handle.result().get_result_async().add_done_callback(send)

send(None)
rclpy.spin(node)
""",
    "next_goal.py": '''"""A leaf that sends a goal."""

from typing import Any

from sar_compiler.leaves import ActionLeaf, Kind, Use, register


@register("NextGoal", kind=Kind.ACTION, uses=[Use.action("next_goal")])
class NextGoal(ActionLeaf):
    """Send a goal that ends at once."""

    action_type = "nav2_msgs/action/ComputePathToPose"
    action_name = "next_goal"

    def goal(self) -> Any:
        return self.interface.Goal()
''',
    "next_goal.xml": '<root BTCPP_format="4"><BehaviorTree ID="Main"><Sequence>'
    + "<NextGoal/>" * (_GOALS + 20)
    + "</Sequence></BehaviorTree></root>",
}
_OPTIONS = (
    "--journal",
    "{0}/{1}.journal",
    "--view",
    "web",
    "--web-port",
    "0",
    "--publish",
    "--groot2",
    "1767",
    "--record",
    "{0}/{1}.mcap",
    "--properties",
)


class Drive(NamedTuple):
    """The cost of a process while the robot drives.

    Attributes:
        share: Of a core, in %.
        memory: In MB.
    """

    share: float
    memory: float


class Stage:
    """A folder with files, and running servers of a mission.

    Args:
        folder: The folder.
        effort: The amount of measurement.
    """

    def __init__(self, folder: Path, effort: Effort) -> None:
        self.folder = folder
        self._effort = effort
        self._runs = itertools.count()

    @cached_property
    def drives(self) -> dict[str, list[Drive]]:
        """The drives of a plain node, of a run, and of a run with all options, in turns."""
        bare = [sys.executable, str(self.folder / "bare.py")]
        duration = max(1.0, _DRIVE_SEC * self._effort.share)
        found: dict[str, list[Drive]] = {"bare": [], "run": [], "options": []}

        def once() -> list[float]:
            drives = {
                "bare": self._drive(bare, duration),
                "run": self._drive(self.run_command("--journal", "none"), duration),
                "options": self._drive(self.run_command(*_OPTIONS), duration),
            }
            for name, drive in drives.items():
                found[name].append(drive)
            return [drive.share for drive in drives.values()]

        count = len(measured(once, min(self._effort.rounds, 2)))
        return {name: taken[-count:] for name, taken in found.items()}

    def next_port(self) -> str:
        """Return a port of this machine for a page."""
        return str(18100 + next(self._runs) % 100)

    def run_command(self, *words: str) -> list[str]:
        """Return the command of a run that drives along the corridor."""
        given = [word.format(self.folder, next(self._runs)) for word in words]
        params = ["--params", str(self.folder / "params.yaml")]
        ros = ["--ros-args", "-p", f"tick_rate_hz:={_RATE_HZ}.0"]
        return [str(SCRIPTS / "sar-run"), *params, *given, *ros]

    def _drive(self, command: Sequence[str], duration: float) -> Drive:
        with started(command, "Navigating to ") as process:
            time.sleep(_WARM_SEC)
            start, cpu = time.monotonic(), cpu_seconds(process.pid)
            time.sleep(duration)
            taken, passed = cpu_seconds(process.pid) - cpu, time.monotonic() - start
            return Drive(100.0 * taken / passed, memory_of(process.pid))


@contextmanager
def started(command: Sequence[str], words: str) -> "Iterator[subprocess.Popen[bytes]]":
    """Start a command, wait until it prints a line with some words, and interrupt it at the end.

    Raises:
        UnmeasurableError: It ends or times out before it prints them; the message has its last line.
    """
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
    late = threading.Timer(_PATIENCE_SEC, process.kill)
    late.start()
    assert process.stdout is not None
    try:
        last = b"nothing"
        for line in process.stdout:
            last = line
            if words.encode() in line:
                break
        else:
            name = " ".join(Path(word).name for word in command[:2])
            raise UnmeasurableError(f"{name} has not written '{words}', but last: {last.decode().strip()}")
        late.cancel()
        # A full pipe would stop the process.
        threading.Thread(target=process.stdout.read, daemon=True).start()
        yield process
    finally:
        late.cancel()
        process.send_signal(signal.SIGINT)
        with suppress(subprocess.TimeoutExpired):
            process.wait(20.0)
        process.kill()
        process.wait()


def cpu_seconds(process: int) -> float:
    """Return the CPU seconds of all threads of a process."""
    tasks = Path(f"/proc/{process}/task")
    return sum(int((each / "schedstat").read_text().split()[0]) for each in tasks.iterdir()) / 1e9


def memory_of(process: int) -> float:
    """Return the current memory of a process, in MB."""
    status = Path(f"/proc/{process}/status").read_text(encoding="ascii")
    return int(status.partition("VmRSS:")[2].split()[0]) * 1024 / 1e6


@contextmanager
def set_up(effort: Effort) -> Iterator[Stage]:
    """Write the files, and start the simulator and the mission's servers, apart from any other ROS on this machine.

    Raises:
        UnmeasurableError: There is no ROS 2.
    """
    require_ros()
    os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
    os.environ["ROS_DOMAIN_ID"] = _SERVERS_DOMAIN
    with tempfile.TemporaryDirectory() as name, ExitStack() as stack:
        folder = Path(name)
        width, height = _LENGTH_M * 2, 12
        (folder / "map.pgm").write_bytes(b"P5\n%d %d\n255\n" % (width, height) + b"\xfe" * (width * height))
        for file, text in _FILES.items():
            (folder / file).write_text(text, encoding="utf-8")
        for server in ("sar-detect-survivor-server", "sar-report-survivor-server"):
            process = subprocess.Popen(
                [SCRIPTS / server], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
            )
            stack.callback(process.wait)
            stack.callback(process.send_signal, signal.SIGINT)
        command = [str(SCRIPTS / "sar-sim"), "run", f"{folder}/corridor.yaml", "--localised"]
        stack.enter_context(started(command, " runs, at most "))
        yield Stage(folder, effort)


def _first_tick(stage: Stage, effort: Effort) -> Measured:
    """Return the time from the command to the first goal of the robot, and that of a plain node."""

    def first_goal(command: Sequence[str]) -> tuple[float, float]:
        start = time.perf_counter()
        with started(command, "Navigating to ") as process:
            return time.perf_counter() - start, cpu_seconds(process.pid)

    bare: list[float] = []

    def once() -> tuple[float, float]:
        bare.append(first_goal([sys.executable, str(stage.folder / "bare.py")])[0])
        return first_goal(stage.run_command("--journal", "none"))

    once()
    passed, cpu = medians(once, max(effort.few, effort.size(_STARTS, 2)))
    words = f"{seconds(cpu)} CPU; a bare node, which only discovers Nav2, {seconds(statistics.median(bare))}"
    return Measured((passed,), words)


def _next_goal(stage: Stage, effort: Effort) -> Measured:
    """Return the time from a goal's result until the next goal, as its server sees it."""
    tree = [
        "next_goal.xml",
        "--nodes",
        "next_goal",
        "--journal",
        "none",
        "--ros-args",
        "-p",
        "tick_rate_hz:=10.0",
    ]
    clients = ([str(SCRIPTS / "sar-run"), *tree], [sys.executable, "client.py"])
    environment = {**os.environ, "ROS_DOMAIN_ID": _GOALS_DOMAIN, "PYTHONPATH": str(stage.folder)}

    def latency(client: Sequence[str]) -> float:
        with ExitStack() as stack:
            server = subprocess.Popen(
                [sys.executable, "server.py"],
                stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL,
                text=True,
                env=environment,
                cwd=stage.folder,
            )
            stack.callback(_end, server)
            late = threading.Timer(_PATIENCE_SEC, server.kill)
            late.start()
            stack.callback(late.cancel)
            assert server.stdout is not None
            server.stdout.readline()
            output = (stage.folder / "client.log").open("w+", encoding="utf-8")
            stack.enter_context(output)
            run = subprocess.Popen(
                client, env=environment, cwd=stage.folder, stdout=output, stderr=subprocess.STDOUT
            )
            stack.callback(_end, run)
            line = server.stdout.readline()
            if not line:
                output.seek(0)
                last = output.read().strip().rpartition("\n")[2]
                raise UnmeasurableError(
                    f"the server has not received {_GOALS} goals; the client's last line: {last}"
                )
            return float(line)

    ours, theirs = medians(lambda: tuple(map(latency, clients)), min(effort.few, 2))
    return Measured((1000.0 * ours,), f"a bare client {1000.0 * theirs:.1f} ms")


def _end(process: "subprocess.Popen[Any]") -> None:
    process.send_signal(signal.SIGINT)
    try:
        process.wait(10.0)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()


def _driving(stage: Stage, _effort: Effort) -> Measured:
    ours, bare = ([each.share for each in stage.drives[name]] for name in ("run", "bare"))
    ratio = statistics.median(one / other for one, other in zip(ours, bare, strict=True))
    return Measured((statistics.median(ours), ratio))


def _options(stage: Stage, _effort: Effort) -> Measured:
    return Measured((statistics.median(each.share for each in stage.drives["options"]),))


def _memory(stage: Stage, _effort: Effort) -> Measured:
    memory = {
        name: statistics.median(each.memory for each in drives) for name, drives in stage.drives.items()
    }
    return Measured((memory["run"], memory["options"]), f"a bare node {memory['bare']:.0f} MB")


_READ = "import sys, urllib.request\nfor line in urllib.request.urlopen(sys.argv[1]): pass"


def _page(stage: Stage, effort: Effort) -> Measured:
    """Return the additional share of a core that a run with a page uses while browsers read it."""
    duration = max(1.0, _DRIVE_SEC * effort.share)

    def share(browsers: int) -> float:
        port = stage.next_port()
        words = ("--journal", "none", "--view", "web", "--web-port", port)
        with started(stage.run_command(*words), "Navigating to ") as process, ExitStack() as stack:
            readers = [
                subprocess.Popen([sys.executable, "-c", _READ, f"http://127.0.0.1:{port}/events"])
                for _ in range(browsers)
            ]
            for reader in readers:
                stack.callback(reader.wait)
                stack.callback(reader.kill)
            time.sleep(_WARM_SEC)
            cpu, start = cpu_seconds(process.pid), time.monotonic()
            time.sleep(duration)
            taken, passed = cpu_seconds(process.pid) - cpu, time.monotonic() - start
            assert all(reader.poll() is None for reader in readers), "a browser has lost the page"
            return 100.0 * taken / passed

    read, unread = medians(lambda: (share(_BROWSERS), share(0)), 2)
    return Measured((read,), f"{unread:.1f} % while no browser reads it")


def _whole_mission(_stage: Stage, effort: Effort) -> Measured:
    """Return the elapsed time until the summary of a simulated mission."""
    command: list[str | Path] = [
        SCRIPTS / "sar-run",
        _TREE,
        "--sim",
        "--speed",
        "1000",
        "--journal",
        "none",
        "--view",
        "none",
    ]

    def once() -> tuple[float, float]:
        cost = run([*command, "--format", "json"], more={"ROS_DOMAIN_ID": str(next(_MISSION_DOMAINS))})
        assert json.loads(cost.printed)["duration"] > 0
        return cost.passed, cost.cpu

    passed, cpu = medians(once, effort.few)
    return Measured((passed,), f"{seconds(cpu)} CPU")


def _sweep(_stage: Stage, effort: Effort) -> Measured:
    """Return the number of simulated missions per minute of `sar-sim sweep`, including the start of the command."""

    def once() -> tuple[float]:
        count = str(effort.size(_SIMULATED, 4))
        # So few runs cannot prove the rate, so the sweep does not stop early.
        words = ("sweep", _TREE, "--runs", count, "--at-least", "0.999", "--format", "json")
        cost = run([SCRIPTS / "sar-sim", *words], statuses=(0, 1), more={"ROS_DOMAIN_ID": _SWEEP_DOMAIN})
        (row,) = json.loads(cost.printed)["rows"]
        return (60.0 * int(row["runs"]) / cost.passed,)

    return Measured(medians(once, 2))


_AT_RATE = f"drives at {_RATE_HZ} ticks a second"

BENCHMARK = Benchmark(
    (
        Row(
            "`sar-run` to the first tick",
            (Limit(2.5, "s passing"),),
            "until the first goal is sent; servers already run; includes the search for another mission",
            _first_tick,
        ),
        Row(
            "the result of a goal to the next goal",
            (Limit(8.0, "ms passing"),),
            f"measured by the server; the median of {_GOALS} goals",
            _next_goal,
        ),
        Row(
            f"`sar-run` that {_AT_RATE}",
            (Limit(4.0, "% of a core"), Limit(1.0, _BARE)),
            "compared with a bare node that sends the same goal and subscribes to the same topics",
            _driving,
        ),
        Row(
            "the same with all six options together",
            (Limit(6.0, "% of a core"),),
            "journal, page, topics, Groot2, recording, properties",
            _options,
        ),
        Row(
            "memory of a run",
            (Limit(115.0, "MB"), Limit(190.0, "MB", what="with all options")),
            "resident memory during a drive",
            _memory,
        ),
        Row(
            "a run with a page that five browsers read",
            (Limit(5.0, "% of a core"),),
            "during a drive, without the time of the browsers",
            _page,
        ),
        Row(
            "a whole simulated mission, to its summary",
            (Limit(6.0, "s passing"),),
            "`sar-run --sim --speed 1000`",
            _whole_mission,
        ),
        Row(
            "missions of `sar-sim sweep`",
            (Limit(60.0, "/min", is_least=True),),
            "the shipped mission, one at a time for each processor",
            _sweep,
        ),
    ),
    set_up,
)
