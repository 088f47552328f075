"""What a robot costs where many share a process: CPU time for each, and ticks that come late.

Run it with `make bench`, or `python benchmarks/robots.py 1 10 50 100 --processes 2`; needs ROS 2. `--executor wait_set` is
rclpy's usual one, which looks at all that its nodes have each time something happens. Every robot has a node
in a namespace of its own and the shipped tree, ticked at 2 Hz, which drives to its first zone: its goal is with a null
server, one for each robot and all in another process, which accepts goals and does nothing with them. A tick is late
if it begins more than a tenth of the period after its time; the times are those of the robot's earliest tick.
"""

import argparse
import contextlib
import multiprocessing
import os
import time
from collections.abc import Iterator
from multiprocessing.synchronize import Barrier, Event
from pathlib import Path
from queue import Queue
from typing import Any, NamedTuple

ROOT = Path(__file__).parents[1]
PERIOD_SEC = 0.5
STUCK_SEC = 300.0
LATE = 0.1
# After this time all goals are accepted, also those whose first acceptance got lost: no tick comes by a wake any more.
SETTLED_SEC = 12.0
# A null server gives no feedback, which a leaf takes for a dead one after a while.
DRIVE, PATIENT_DRIVE = "<NavigateToZone/>", '<NavigateToZone feedback_timeout_sec="3600"/>'


class Measured(NamedTuple):
    """What one process has measured.

    Attributes:
        cpu_sec: The CPU time that it took.
        lateness_sec: How late each tick was, seconds.
    """

    cpu_sec: float
    lateness_sec: list[float]


def serve(robots: int, ready: Event, over: Event) -> None:
    """Run the null servers."""
    import rclpy
    from nav2_msgs.action import NavigateToPose
    from rclpy.action import ActionServer
    from rclpy.executors import ExternalShutdownException
    from rclpy.experimental import EventsExecutor

    rclpy.init()
    executor = EventsExecutor()
    for number in range(robots):
        node = rclpy.create_node("null_server", namespace=f"/robot_{number}")
        server = {"execute_callback": print, "handle_accepted_callback": lambda _goal: None}
        ActionServer(node, NavigateToPose, "navigate_to_pose", **server)
        executor.add_node(node)
    ready.set()
    with contextlib.suppress(ExternalShutdownException):
        while not over.is_set():
            executor.spin_once(timeout_sec=0.1)


def fly(numbers: range, options: argparse.Namespace, together: Barrier, results: "Queue[Measured]") -> None:
    """Tick the trees of some robots, and measure."""
    import rclpy
    from py_trees.common import Status
    from rclpy.executors import SingleThreadedExecutor
    from rclpy.experimental import EventsExecutor

    rclpy.init(args=["--ros-args", "--log-level", "error"])
    executor: Any = EventsExecutor() if options.executor == "events" else SingleThreadedExecutor()
    runners, begun = [], []
    for number in numbers:
        runner, ticks = robot(number, options.tree, executor)
        runners.append(runner)
        begun.append(ticks)

    def spin(seconds: float) -> None:
        end = time.monotonic() + seconds
        while (left := end - time.monotonic()) > 0.0:
            executor.spin_once(timeout_sec=left)

    for runner in runners:  # robots do not start at the same moment
        runner.tick_tock(1000.0 * PERIOD_SEC)
        spin(PERIOD_SEC / len(runners))
    while not all(runner.root.status == Status.RUNNING for runner in runners):
        spin(PERIOD_SEC)
    together.wait()
    spin(SETTLED_SEC)
    for ticks in begun:
        ticks.clear()
    cpu_sec = time.process_time()
    spin(options.seconds)
    cpu_sec = time.process_time() - cpu_sec
    results.put(Measured(cpu_sec, [late for ticks in begun for late in lateness(ticks)]))
    together.wait()
    os._exit(0)  # the goals end with the servers


def robot(number: int, tree: str, executor: Any) -> tuple[Any, list[float]]:
    """Return a runner that is set up, and the list of the times at which its ticks begin."""
    from rclpy.utilities import get_default_context

    from sar_compiler import load
    from sar_compiler.compiler import compile_tree
    from sar_compiler.missions.choosing import choose_mission
    from sar_compiler.missions.parameter_reader import ParameterReader
    from sar_compiler.ros.clock import mission_clock
    from sar_compiler.ros.parameters import DataNode, flat_parameters
    from sar_compiler.ros.runner import TreeRunner
    from sar_compiler.runtime.clock import Clock

    params = str(ROOT / "config" / "mission_params.yaml")
    arguments = [
        "--ros-args",
        "--log-level",
        "error",
        "-r",
        f"__ns:=/robot_{number}",
        "--params-file",
        params,
    ]
    node = DataNode("search_and_rescue", get_default_context(), cli_args=arguments)
    executor.add_node(node)
    binding = load(tree).binding()
    mission = choose_mission(binding)
    assert mission is not None
    reader = ParameterReader(flat_parameters(node))
    context = {Clock: mission_clock(node), **mission.begin(reader).context}
    runner = TreeRunner(compile_tree(binding, context, reader.parameters))
    ticks: list[float] = []
    runner.add_pre_tick_handler(lambda _tree: ticks.append(time.monotonic()))
    runner.setup(node=node)
    return runner, ticks


def lateness(ticks: list[float]) -> Iterator[float]:
    """Yield how late each tick was, seconds: after a time that comes once in each period."""
    offsets = [tick - number * PERIOD_SEC for number, tick in enumerate(ticks)]
    yield from (offset - min(offsets) for offset in offsets)


def measured(robots: int, options: argparse.Namespace) -> list[Measured]:
    """Return what the processes have measured that share so many robots."""
    context = multiprocessing.get_context("spawn")
    ready, over, results = context.Event(), context.Event(), context.Queue()
    count = min(options.processes, robots)
    together = context.Barrier(count + 1, timeout=STUCK_SEC)
    server = context.Process(target=serve, args=(robots, ready, over))
    server.start()
    ready.wait(STUCK_SEC)
    shares = [range(first, robots, count) for first in range(count)]
    fleets = [context.Process(target=fly, args=(share, options, together, results)) for share in shares]
    for fleet in fleets:
        fleet.start()
    together.wait()
    found = [results.get(timeout=STUCK_SEC) for _ in fleets]
    together.wait()
    over.set()
    for process in (*fleets, server):
        process.join()
    return found


def main() -> None:
    """Measure with so many robots as the arguments say."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("robots", nargs="*", type=int, default=[1, 10, 50, 100])
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--seconds", type=float, default=20.0)
    parser.add_argument("--executor", choices=("events", "wait_set"), default="events")
    options = parser.parse_args()
    options.tree = str(Path(os.environ.get("TMPDIR", "/tmp")) / f"robots_{os.getpid()}.xml")  # noqa: S108 - removed below
    text = (ROOT / "trees" / "search_and_rescue.xml").read_text(encoding="utf-8")
    assert DRIVE in text
    Path(options.tree).write_text(text.replace(DRIVE, PATIENT_DRIVE), encoding="utf-8")
    os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    os.environ.setdefault("ROS_DOMAIN_ID", str(1 + os.getpid() % 100))
    print(f"{'robots':>6} {'processes':>9} {'CPU for each':>14} {'ticks':>7} {'late':>5} {'latest':>9}")
    try:
        for robots in options.robots:
            found = measured(robots, options)
            late = [each for one in found for each in one.lateness_sec]
            share = 1000.0 * sum(one.cpu_sec for one in found) / robots / options.seconds
            behind = sum(each > LATE * PERIOD_SEC for each in late)
            print(
                f"{robots:6} {len(found):9} {share:9.2f} ms/s {len(late):7} {behind:5} {1000.0 * max(late):6.1f} ms",
                flush=True,
            )
    finally:
        Path(options.tree).unlink()


if __name__ == "__main__":
    main()
