"""Whatever ends a command or a program, and in whatever phase: no goal is active afterwards, and no process is alive.

The commands are those that are installed, and the programs those of the documentation: a new one is tried, or missing in a table.
`make soak` tries them all, beside two processes that keep the processors busy; a few are tried each time.
"""

import os
import re
import signal
import subprocess
import sys
import uuid
from contextlib import suppress
from importlib.metadata import entry_points
from pathlib import Path

import pytest

from tests.docs.markdown import PAGES, blocks
from tests.processes import Command
from tests.trees import document
from tests.waiting import News

pytestmark = pytest.mark.ros

SIGNALS = {signal.SIGINT: 130, signal.SIGTERM: 143, signal.SIGHUP: 129}
MARK = "SAR_TEST_ENDING"

# ---- programs ---------------------------------------------------------------------------------------------------------


def ticks(text):
    """Return whether a program of the documentation ticks a tree on a ROS node."""
    return "import rclpy" in text and "compile(" in text and "def test_" not in text


DOCUMENTED = {
    f"{page.name}:{block.file or block.line}": block.text
    for page in PAGES
    for block in blocks(page)
    if block.language == "python" and ticks(block.text)
}
START = """
import threading, time
import rclpy
import sar_compiler
from py_trees.common import Status
from rclpy.executors import ExternalShutdownException, MultiThreadedExecutor, SingleThreadedExecutor

rclpy.init()
node = rclpy.create_node("robot")
tree = sar_compiler.load("mission.xml").compile(node=node, parameters={"n": 3})
"""
RUNNING = f"""{START}
with sar_compiler.running(tree, node) as runner:
    runner.tick_tock(period_ms=50)
"""
ALONE = f"""{START}
runner = sar_compiler.TreeRunner(tree)
runner.setup(node=node)
runner.tick_tock(period_ms=50)
"""
SHAPES = {
    "spin": f"{RUNNING}    rclpy.spin(node)\n",
    "several threads": (
        f"{RUNNING}    executor = MultiThreadedExecutor()\n    executor.add_node(node)\n    executor.spin()\n"
    ),
    "a thread of its own": (
        f"{RUNNING}    executor = SingleThreadedExecutor()\n    executor.add_node(node)\n"
        "    threading.Thread(target=executor.spin, daemon=True).start()\n    time.sleep(600)\n"
    ),
    "an interrupt that is kept": (
        f"{RUNNING}    try:\n        rclpy.spin(node)\n    except KeyboardInterrupt:\n        pass\nprint('goes on')\n"
    ),
    "shut down within": (
        f"{RUNNING}    try:\n        rclpy.spin(node)\n    finally:\n        node.destroy_node()\n        rclpy.shutdown()\n"
    ),
    "a foreign thread": (
        f"threading_ = __import__('threading')\nthreading_.Thread(target=threading_.Event().wait, name='charger').start()\n"
        f"{RUNNING}    rclpy.spin(node)\n"
    ),
}
# What ticks without `running`: rclpy's own handlers have shut ROS down before the program learns of a signal.
LONELY = {
    "page of before": f"{ALONE}while True:\n    rclpy.spin_once(node)\n",
    "while ok": f"{ALONE}while rclpy.ok():\n    rclpy.spin_once(node, timeout_sec=0.1)\nrunner.shutdown()\n",
    "all caught": (
        f"{ALONE}try:\n    rclpy.spin(node)\nexcept (KeyboardInterrupt, ExternalShutdownException):\n    pass\n"
        "runner.shutdown()\nnode.destroy_node()\nrclpy.try_shutdown()\n"
    ),
    "several threads": (
        f"{ALONE}executor = MultiThreadedExecutor()\nexecutor.add_node(node)\ntry:\n    executor.spin()\nfinally:\n    runner.shutdown()\n"
    ),
}
DRIVE = '<RosAction name="Drive" action="navigate_to_pose" type="nav2_msgs/action/NavigateToPose" goal=""/>'


class Program(Command):
    """A program, or a command, all of whose processes can be found."""

    def __init__(self, name, *arguments, env=None):
        self.mark = uuid.uuid4().hex
        super().__init__(name, *arguments, env={**(env or {}), MARK: self.mark})

    def left(self):
        """Return the processes that are there, whichever of them has begun which."""
        found = []
        for process in (each for each in Path("/proc").iterdir() if each.name.isdigit()):
            with suppress(OSError):  # it has ended, or is another user's
                if f"{MARK}={self.mark}".encode() in (process / "environ").read_bytes():
                    found.append(int(process.name))
        return found

    def require_gone(self):
        """Wait until no process of it is alive."""
        news = News()
        with news:
            news.wait_until(lambda: not self.left(), lambda: f"{self.left()} do not end:\n{self.output}")


@pytest.fixture
def start():
    """Start programs; what is left of them after the test is killed."""
    started = []

    def begin(name, *arguments, env=None):
        started.append(Program(name, *arguments, env=env))
        return started[-1]

    yield begin
    for each in started:
        for pid in each.left():
            os.kill(pid, signal.SIGKILL)
        each.kill()


@pytest.fixture
def busy(request):
    """Keep the processors busy, if that is asked for."""
    loops = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(request.param)]
    yield
    for loop in loops:
        loop.kill()
        loop.wait()


@pytest.fixture
def program(start, tmp_path, monkeypatch):
    """Start a program with a tree that drives, in a folder of its own."""

    def begin(text, body=DRIVE):
        (tmp_path / "mission.xml").write_text(document(body), encoding="utf-8")
        (tmp_path / "sar.toml").write_text('models = ["ros:jazzy"]\n', encoding="utf-8")
        (tmp_path / "program.py").write_text(f"import os\nos.chdir({str(tmp_path)!r})\n{text}", "utf-8")
        return start("python", tmp_path / "program.py")

    return begin


def matrix(names, few):
    """Return names by signals, each beside busy processes and slow, and a few of them alone."""
    full = [
        pytest.param(name, number, 2, marks=pytest.mark.slow, id=f"{name}-{number.name}-busy")
        for name in names
        for number in SIGNALS
    ]
    return [*(pytest.param(name, number, 0, id=f"{name}-{number.name}") for name, number in few), *full]


NAMED = {**DOCUMENTED, **SHAPES}
FEW = [(name, signal.SIGINT) for name in DOCUMENTED]
FEW += [("a thread of its own", signal.SIGHUP)]


def test_every_program_of_the_documentation_that_ticks_a_tree_is_ended_by_running():
    assert DOCUMENTED
    assert [name for name, text in DOCUMENTED.items() if "sar_compiler.running(" not in text] == []


@pytest.mark.parametrize(("name", "number", "busy"), matrix(NAMED, FEW), indirect=["busy"])
def test_a_program_that_is_ended_with_a_goal_under_way_leaves_nothing(program, serve, name, number, busy):
    server = serve("navigation", goals=[{"drive": None}])
    run = program(NAMED[name])
    server.wait_for("accepted")
    run.send(number)
    assert run.end() == SIGNALS[number], run.output
    assert server.active == 0, run.output
    assert "Canceling the goal of" in run.output
    assert "goes on" not in run.output
    run.require_gone()


LONELY_FEW = [("page of before", signal.SIGINT)]
LONELY_SIGNALS = (signal.SIGINT, signal.SIGTERM)


@pytest.mark.parametrize(
    ("name", "number", "busy"),
    [each for each in matrix(LONELY, LONELY_FEW) if each.values[1] in LONELY_SIGNALS],
    indirect=["busy"],
)
def test_a_program_without_running_says_what_it_cannot_cancel_and_cancels_it_apart(
    program, serve, name, number, busy
):
    server = serve("navigation", goals=[{"drive": None}])
    run = program(LONELY[name])
    server.wait_for("accepted")
    run.send(number)
    run.wait_until(lambda: run.is_over, "the end")
    assert server.active == 0, run.output
    # rclpy shuts ROS down in a thread of its own, which a program can be ahead of.
    has_sent = "Canceling the goal of 'Drive'." in run.output
    told = "could not be canceled, because ROS is shut down here: the robot may still be moving."
    assert has_sent or run.output.index(told) < run.output.index("Canceling the goal of '/navigate_to_pose'.")
    run.require_gone()


@pytest.mark.parametrize("number", [signal.SIGINT, pytest.param(signal.SIGTERM, marks=pytest.mark.slow)])
def test_a_program_whose_goal_does_not_end_says_that_the_robot_may_be_moving(program, serve, number):
    server = serve("navigation", goals=[{"drive": None, "cancel": "ignore"}])
    run = program(SHAPES["spin"].replace("node) as", "node, settle_timeout_sec=1.0) as"))
    server.wait_for("accepted")
    run.send(number)
    assert run.end() == 4, run.output
    assert "a goal may still be active, and the robot may still be moving: Drive" in run.output
    run.require_gone()


@pytest.mark.parametrize("number", [pytest.param(each, marks=pytest.mark.slow) for each in SIGNALS])
@pytest.mark.parametrize("name", NAMED)
def test_a_program_that_waits_for_a_server_ends(program, name, number):
    run = program(NAMED[name]).wait_for("Waiting for the action server navigate_to_pose...")
    run.send(number)
    assert run.end() == SIGNALS[number], run.output
    run.require_gone()


def test_a_program_that_is_killed_leaves_its_goal_to_a_guardian(program, serve):
    server = serve("navigation", goals=[{"drive": None}])
    run = program(SHAPES["spin"].replace("node) as", "node, guardian=True) as"))
    server.wait_for("accepted")
    run.send(signal.SIGKILL)
    server.wait_for("ended", how="cancel")
    run.require_gone()


BLOCKS = """
from py_trees.behaviour import Behaviour
from py_trees.common import Status
from sar_compiler.leaves import Kind, register
import time

@register("Block", kind=Kind.ACTION)
class Block(Behaviour):
    def __init__(self, name: str) -> None:
        super().__init__(name)

    def update(self):
        if not os.path.exists("go"):
            return Status.RUNNING
        print("blocked", flush=True)
        time.sleep(600)
"""


@pytest.mark.parametrize(
    "number", [signal.SIGTERM, *(pytest.param(each, marks=pytest.mark.slow) for each in SIGNALS)]
)
def test_a_program_whose_leaf_blocks_ends_with_its_goal(program, serve, tmp_path, number):
    server = serve("navigation", goals=[{"drive": None}])
    body = f'<Parallel success_count="2" failure_count="2">{DRIVE}<Block/></Parallel>'
    text = BLOCKS + SHAPES["spin"].replace('"mission.xml")', '"mission.xml", nodes=[Block])')
    run = program(text, body)
    server.wait_for("accepted")
    (tmp_path / "go").touch()
    run.wait_for("blocked")
    run.send(number)
    assert run.end() == SIGNALS[number], run.output
    assert "program.py: stopped although 'Block' (Block) blocks" in run.output
    assert server.active == 0
    run.require_gone()


# ---- commands ---------------------------------------------------------------------------------------------------------

NO_GOAL = {
    signal.SIGINT: {130, 0},
    signal.SIGTERM: {143, 0, -signal.SIGTERM},
    signal.SIGHUP: {129, 0, -signal.SIGHUP},
}
ENDLESS = '<Repeat num_cycles="-1"><Sequence><Sleep msec="100"/><AlwaysSuccess/></Sequence></Repeat>'
# Of each command the ways in which it takes long, with the line that says that it does.
LONG: dict[str, dict[str, tuple[list[str], str]]] = {
    "sar-run": {
        "waiting": (["search_and_rescue"], "Waiting for"),
        "page": (
            ["{tree}", "--view", "web", "--web-port", "0", "--until", "forever"],
            "The page of this run",
        ),
        "serving": (["--serve", "search_and_rescue"], "Goals of 'bt_execution' start them"),
        "simulating": (["--sim", "--until", "forever"], "Navigating to"),
        "supervising": (["search_and_rescue", "--supervise"], "Waiting for"),
    },
    "sar-compile": {"importing": (["validate", "{tree}", "--nodes", "endless"], "blocked")},
    "sar-sim": {
        "running": (["run"], "runs, at most"),
        "running in parts": (["run", "--separate"], "runs in"),
    },
    "sar-journal": {"watching": (["watch", "{journal}"], "The page:")},
    "sar-detect-survivor-server": {"serving": ([], "ready")},
    "sar-report-survivor-server": {"serving": ([], "ready")},
}
INSTALLED = {
    each.name for each in entry_points(group="console_scripts") if each.value.startswith("sar_compiler.")
}
WAYS = [f"{command}: {way}" for command, ways in LONG.items() for way in ways]


def test_every_command_that_is_installed_is_tried():
    assert set(LONG) == INSTALLED


@pytest.fixture(scope="module")
def journal(tmp_path_factory):
    """A journal of a run that has ended."""
    folder = tmp_path_factory.mktemp("journal")
    (folder / "tree.xml").write_text(document("<AlwaysSuccess/>"), encoding="utf-8")
    run = Command("sar-run", folder / "tree.xml", "--journal", folder / "run.journal")
    assert run.end() == 0, run.output
    return folder / "run.journal"


@pytest.mark.parametrize(
    ("way", "number", "busy"), matrix(WAYS, [("sar-run: serving", signal.SIGTERM)]), indirect=["busy"]
)
def test_a_command_ends_and_leaves_no_process(start, tmp_path, request, way, number, busy):
    command, _, name = way.partition(": ")
    arguments, line = LONG[command][name]
    (tmp_path / "tree.xml").write_text(document(ENDLESS), encoding="utf-8")
    places = {"tree": tmp_path / "tree.xml"}
    if "{journal}" in arguments:
        places["journal"] = request.getfixturevalue("journal")
    (tmp_path / "endless.py").write_text(
        "print('blocked', flush=True)\nimport time\ntime.sleep(600)\n", "utf-8"
    )
    run = start(command, *(each.format(**places) for each in arguments), env={"PYTHONPATH": str(tmp_path)})
    run.wait_for(line)
    run.send(number)
    assert run.end() in NO_GOAL[number], run.output
    run.require_gone()


FOREIGN = """
import sys, threading
from py_trees.behaviour import Behaviour
from py_trees.common import Status
from sar_compiler.leaves import Kind, register

@register("Charge", kind=Kind.ACTION)
class Charge(Behaviour):
    def __init__(self, name: str) -> None:
        super().__init__(name)

    def setup(self, **kwargs):
        threading.Thread(target=threading.Event().wait, name="charger").start()
        print("charging", file=sys.stderr, flush=True)

    def update(self):
        return Status.RUNNING
"""
CHARGING = '<Parallel success_count="2" failure_count="1"><NavigateToZone/><Charge/></Parallel>'
PHASES = {"driving": (), "supervised": ("--supervise",), "guarded": ("--guardian",)}


@pytest.fixture
def foreign(start, serve, tmp_path):
    """Start a run whose leaf has started a thread that does not end, and wait until it drives."""

    def begin(*options, **manner):
        (tmp_path / "charging.py").write_text(FOREIGN, encoding="utf-8")
        (tmp_path / "tree.xml").write_text(document(CHARGING), encoding="utf-8")
        server = serve("navigation", goals=[{"drive": None, **manner}])
        serve("survivors")
        given = ("--ros-args", "-p", "set_initial_pose:=false", "-p", "settle_timeout_sec:=3.0")
        own = (tmp_path / "tree.xml", "--nodes", "charging", "--journal", tmp_path / "run.journal")
        run = start("sar-run", *own, *options, *given, env={"PYTHONPATH": str(tmp_path)})
        server.wait_for("accepted")
        return server, run

    return begin


@pytest.mark.parametrize(
    ("phase", "number", "busy"), matrix(PHASES, [("driving", signal.SIGINT)]), indirect=["busy"]
)
def test_a_run_with_a_goal_under_way_and_a_foreign_thread_leaves_nothing(foreign, phase, number, busy):
    server, run = foreign(*PHASES[phase])
    run.send(number)
    assert run.end() == SIGNALS[number], run.output
    assert server.active == 0, run.output
    assert re.search(r"sar-run: thread 'charger' is still running.*; the process ends without it", run.output)
    run.require_gone()


@pytest.mark.parametrize("number", [pytest.param(each, marks=pytest.mark.slow) for each in SIGNALS])
def test_a_second_signal_while_a_run_ends_ends_it_at_once(foreign, number):
    server, run = foreign(cancel="ignore")
    run.send(number)
    server.wait_for("cancel")
    run.wait_until(lambda: "Canceling the goal" in run.output, "the first answer")
    for _ in range(20):  # the second is one that comes half a second later
        run.send(signal.SIGINT)
        run._process.poll()
        if run.is_over:
            break
        signal.sigtimedwait([], 0.2)
    assert run.end() == 4, run.output
    run.require_gone()


@pytest.mark.parametrize("numbers", [1, pytest.param(3, marks=pytest.mark.slow)])
def test_a_served_run_with_a_foreign_thread_ends_and_the_next_goal_is_taken(
    ros, serve, start, tmp_path, numbers
):
    from btcpp_ros2_interfaces.action import ExecuteTree
    from rclpy.action import ActionClient

    (tmp_path / "charging.py").write_text(FOREIGN, encoding="utf-8")
    (tmp_path / "tree.xml").write_text(document("<Charge/>"), encoding="utf-8")
    options = ("--nodes", "charging", "--journal", "none")
    server = start("sar-run", "--serve", tmp_path / "tree.xml", *options, env={"PYTHONPATH": str(tmp_path)})
    server.wait_for("start them")
    client = ActionClient(ros.node("client"), ExecuteTree, "bt_execution")
    ros.spin_until(client.server_is_ready, "the server")
    for number in range(1, numbers + 1):
        sent = client.send_goal_async(ExecuteTree.Goal(target_tree="Main"))
        ros.spin_until(sent.done, "the acceptance")
        assert sent.result().accepted, server.output
        server.wait_until(lambda number=number: server.output.count("charging") == number, "its begin")
        asked = sent.result().get_result_async()
        sent.result().cancel_goal_async()
        ros.spin_until(asked.done, f"the result of goal {number}")
    server.send(signal.SIGTERM)
    assert server.end() == 0, server.output
    server.require_gone()
