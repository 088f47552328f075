"""Whatever ends a command or a program, and in whatever phase: no goal is active afterwards, and no process is alive.

The commands are those that are installed, and the programs those of the documentation: a new one is tried, or missing in a table.
`make soak` tries them all, beside two processes that keep the processors busy; a few are tried each time.
"""

import argparse
import fcntl
import json
import os
import re
import signal
import subprocess
import sys
import termios
import uuid
from collections.abc import Callable
from contextlib import suppress
from importlib.metadata import entry_points
from pathlib import Path
from typing import NamedTuple

import pytest

from tests.docs.markdown import PAGES, blocks
from tests.docs.test_commands_page import PARSERS
from tests.processes import Command, children_of, processor_sec
from tests.terminals import Terminal
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
with sar_compiler.running_tree(tree, node) as runner:
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
    "a guardian": f"{RUNNING}    rclpy.spin(node)\n".replace("node) as", "node, guardian=True) as"),
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

    def __init__(self, name, *arguments, env=None, **more):
        self.mark = uuid.uuid4().hex
        super().__init__(name, *arguments, env={**(env or {}), MARK: self.mark}, **more)

    def left(self):
        """Return the processes that are there, whichever of them has begun which."""
        found = []
        for process in (each for each in Path("/proc").iterdir() if each.name.isdigit()):
            with suppress(OSError):  # it has ended, or is another user's
                if f"{MARK}={self.mark}".encode() in (process / "environ").read_bytes():
                    found.append(int(process.name))
        return found

    def wait_for_goal(self, server):
        """Wait, as long as it is kept from a processor, until a server has accepted a goal."""
        self.wait_until(lambda: server.of("accepted") or self.is_over, "the goal")
        assert server.of("accepted"), self.output

    def require_gone(self):
        """Wait until no process of it is alive."""
        news = News()
        with news:
            news.wait_until(lambda: not self.left(), lambda: f"{self.left()} do not end:\n{self.output}")


class OnTerminal(Terminal):
    """The same on a terminal."""

    left, require_gone = Program.left, Program.require_gone

    def __init__(self, name, *arguments, env):
        self.mark = uuid.uuid4().hex
        super().__init__(name, *arguments, env={**env, MARK: self.mark})

    @property
    def output(self):
        """What it has printed."""
        return "\n".join(self.history)


@pytest.fixture
def start():
    """Start programs; what is left of them after the test is killed."""
    started = []

    def begin(name, *arguments, kind=Program, **more):
        started.append(kind(name, *arguments, **more))
        return started[-1]

    yield begin
    for each in started:
        for pid in each.left():
            os.kill(pid, signal.SIGKILL)
        each.kill()


@pytest.fixture
def busy(request):
    """Keep the processors busy, if that is asked for."""
    # As long as this process, also if that is killed.
    program = "import os\nparent = os.getppid()\nwhile os.getppid() == parent: pass"
    loops = [subprocess.Popen([sys.executable, "-c", program]) for _ in range(request.param)]
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
    assert [name for name, text in DOCUMENTED.items() if "sar_compiler.running_tree(" not in text] == []


@pytest.mark.parametrize(("name", "number", "busy"), matrix(NAMED, FEW), indirect=["busy"])
def test_a_program_that_is_ended_with_a_goal_under_way_leaves_nothing(program, serve, name, number, busy):
    server = serve("navigation", goals=[{"drive": None}])
    run = program(NAMED[name])
    run.wait_for_goal(server)
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
    run.wait_for_goal(server)
    run.send(number)
    run.wait_until(lambda: run.is_over, "the end")
    assert server.active == 0, run.output
    # rclpy shuts ROS down in a thread of its own, which a program can be ahead of.
    has_sent = "Canceling the goal of 'Drive'." in run.output
    told = "could not be canceled, because ROS is shut down in this process. The robot may still be moving."
    assert has_sent or run.output.index(told) < run.output.index("Canceling the goal of '/navigate_to_pose'.")
    run.require_gone()


@pytest.mark.parametrize("number", [signal.SIGINT, pytest.param(signal.SIGTERM, marks=pytest.mark.slow)])
def test_a_program_whose_goal_does_not_end_says_that_the_robot_may_be_moving(program, serve, number):
    server = serve("navigation", goals=[{"drive": None, "cancel": "ignore"}])
    run = program(SHAPES["spin"].replace("node) as", "node, settle_timeout_sec=1.0) as"))
    run.wait_for_goal(server)
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


SETS_UP = """
import os, time
from py_trees.behaviour import Behaviour
from py_trees.common import Status
from sar_compiler.leaves import Kind, register

@register("Open", kind=Kind.ACTION)
class Open(Behaviour):
    def __init__(self, name: str) -> None:
        super().__init__(name)

    def setup(self, **kwargs):
        print("setting up", flush=True)
        time.sleep(600)

    def update(self):
        return Status.RUNNING
"""


@pytest.mark.parametrize(
    ("name", "number", "busy"), matrix(NAMED, [("a guardian", signal.SIGTERM)]), indirect=["busy"]
)
def test_a_program_whose_tree_is_being_set_up_ends(program, name, number, busy):
    text = SETS_UP + NAMED[name].replace('load("mission.xml")', 'load("mission.xml", nodes=[Open])')
    run = program(text, "<Open/>").wait_for("setting up")
    run.send(number)
    assert run.end() == SIGNALS[number], run.output
    run.require_gone()


# Without the foreign thread, for which the interpreter waits: the block that would end the program has not begun.
@pytest.mark.parametrize(
    "name", [pytest.param(each, marks=pytest.mark.slow) for each in SHAPES if each != "a foreign thread"]
)
def test_a_program_that_loads_its_tree_while_ros_is_shut_down_is_told_so_by_rclpy(program, name):
    text = SHAPES[name].replace(
        "with sar", "print('loading', flush=True)\nwhile rclpy.ok():\n    time.sleep(0.01)\nwith sar"
    )
    run = program(text).wait_for("loading")
    run.send(signal.SIGTERM)  # SIGINT is raised in the program, as in any
    run.wait_until(lambda: run.is_over, "the end")
    assert run.output.rstrip().rpartition("\n")[2] == "rclpy.executors.ExternalShutdownException"
    run.require_gone()


def test_a_program_that_is_killed_leaves_its_goal_to_a_guardian(program, serve):
    server = serve("navigation", goals=[{"drive": None}])
    run = program(SHAPES["a guardian"])
    run.wait_for_goal(server)
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
    run.wait_for_goal(server)
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
COUNTER = (
    '<Sequence><Script code="n := 0"/><KeepRunningUntilFailure><Sequence><Script code="n += 1"/>'
    '<ScriptCondition code="n &lt; 1000000000"/><Sleep msec="10"/></Sequence></KeepRunningUntilFailure></Sequence>'
)
TREES = {
    "tree": '<Repeat num_cycles="-1"><Sequence><Sleep msec="100"/><AlwaysSuccess/></Sequence></Repeat>',
    "done": "<AlwaysSuccess/>",
    "many": f"<Sequence><AnyLeaf/>{COUNTER}</Sequence>",
}
MODEL = '<TreeNodesModel><Action ID="AnyLeaf"/></TreeNodesModel>'
_WORKS_SEC, _BEGUN_SEC = 0.7, 0.2


def works(run):
    """Return whether a command has computed for longer than its beginning takes."""
    return processor_sec(run.pid) > _WORKS_SEC


def has_read(run):
    """Return whether a command has read what was typed, and waits for more."""
    return not int.from_bytes(fcntl.ioctl(run.typed_on, termios.FIONREAD, bytes(4)), sys.byteorder)


def calls(run):
    """Return whether a command has begun a process: it may be so nice that it hardly computes on a busy machine."""
    return bool(children_of(run.pid))


def children_work(count):
    """Return a function which tells whether so many processes that a command has begun have computed for a while."""
    return lambda run: sum(processor_sec(each) > _BEGUN_SEC for each in children_of(run.pid)) >= count


class Phase(NamedTuple):
    """Something of a command that takes long.

    Attributes:
        words: The command's arguments.
        reached: A line that tells that it has begun, or a function which does.
        typed: What comes in by standard input, which stays open.
        kind: Whether it is on a terminal.
    """

    words: list[str]
    reached: str | Callable[[Program], bool]
    typed: Callable[[Path], bytes] = lambda _folder: b""
    kind: type[Program | OnTerminal] = Program


def of_agent(folder, *calls):
    """Return what an agent sends to the server of tools."""
    told = {
        "protocolVersion": "2025-03-26",
        "capabilities": {},
        "clientInfo": {"name": "agent", "version": "1"},
    }
    begin: list[dict[str, object]] = [
        {"id": 1, "method": "initialize", "params": told},
        {"method": "notifications/initialized"},
    ]
    called = [{"id": 2, "method": "tools/call", "params": each} for each in calls]
    return b"".join(json.dumps({"jsonrpc": "2.0", **each}).encode() + b"\n" for each in (*begin, *called))


def of_editor(folder, *commands):
    """Return what an editor sends to the language server."""
    uri = (folder / "many.xml").as_uri()
    text = {"uri": uri, "languageId": "xml", "version": 1, "text": (folder / "many.xml").read_text("utf-8")}
    messages: list[dict[str, object]] = [
        {"id": 1, "method": "initialize", "params": {"capabilities": {}, "processId": None, "rootUri": None}},
        {"method": "initialized", "params": {}},
        {"method": "textDocument/didOpen", "params": {"textDocument": text}},
        *(
            {
                "id": 2,
                "method": "workspace/executeCommand",
                "params": {"command": each, "arguments": [uri, None]},
            }
            for each in commands
        ),
    ]
    bodies = [json.dumps({"jsonrpc": "2.0", **each}).encode() for each in messages]
    return b"".join(b"Content-Length: %d\r\n\r\n%s" % (len(each), each) for each in bodies)


IS_EDITOR_BUILT = Path("sar_compiler/studio/static/codemirror.js").exists()
# Of each subcommand that imports a user's leaves, the arguments with which it does.
IMPORTING = {
    "validate": ["{tree}"],
    "show": ["{tree}"],
    "convert": ["{tree}", "--to", "btcpp"],
    "simulate": ["{tree}"],
    "sweep": ["{tree}", "--unusual", "0.1"],
    "verify": ["{tree}"],
    "predict": ["{tree}"],
    "conform": ["{tree}", "{journal}"],
    "approve": ["{tree}"],
    "nodes": [],
    "schema": [],
}
# Of each command what takes long in it; the first argument is the subcommand, where there are some.
LONG: dict[str, dict[str, Phase]] = {
    "sar-run": {
        "waiting": Phase(["search_and_rescue"], "Waiting for"),
        "page": Phase(
            ["{tree}", "--view", "web", "--web-port", "0", "--until", "forever"], "The page of this run"
        ),
        "page of a run that has ended": Phase(
            ["{done}", "--view", "web", "--web-port", "0"],
            "Its page stays open until Ctrl-C",
            kind=OnTerminal,
        ),
        "view on a terminal": Phase(
            ["{tree}", "--view", "text", "--until", "forever"], "cycle", kind=OnTerminal
        ),
        "serving": Phase(["--serve", "search_and_rescue"], "Send a goal to 'bt_execution' to start one"),
        "simulating": Phase(["--sim", "--until", "forever"], "Navigating to"),
        "supervising": Phase(["search_and_rescue", "--supervise"], "Waiting for"),
    },
    "sar-compile": {
        **{
            f"{name}, importing": Phase([name, *words, "--nodes", "endless"], "blocked")
            for name, words in IMPORTING.items()
        },
        "diff, reading": Phase(["diff", "-", "{tree}"], has_read, lambda _: b"<root"),
        "validate, trying": Phase(["validate", "{many}", "--deep", "1000"], works),
        "simulate, ticking": Phase(["simulate", "{many}", "--ticks", "1000000000"], works),
        "verify, exploring": Phase(["verify", "{many}"], works),
        "predict, exploring": Phase(["predict", "{many}"], works),
        "sweep, playing": Phase(
            ["sweep", "{many}", "--unusual", "0.1", "--ticks", "1000000000", "--jobs", "2"], children_work(2)
        ),
        # Where its text editor is not built, it ends at once.
        **(
            {"edit, serving": Phase(["edit", "{tree}", "--web-port", "0"], "The editor:")}
            if IS_EDITOR_BUILT
            else {}
        ),
        "lsp, serving": Phase(["lsp"], "Content-Length", of_editor),
        "lsp, verifying": Phase(["lsp"], children_work(1), lambda folder: of_editor(folder, "sar.verify")),
        "mcp, serving": Phase(["mcp"], '"id":1', of_agent),
        "mcp, verifying": Phase(
            ["mcp"],
            calls,
            lambda folder: of_agent(folder, {"name": "verify", "arguments": {"file": "many.xml"}}),
        ),
    },
    "sar-sim": {
        "running": Phase(["run"], "runs, at most"),
        "mapping": Phase(["map", "-o", "{folder}/map"], works),
        "importing": Phase(["sweep", "{tree}", "--nodes", "endless"], "blocked"),
        "sweeping": Phase(
            ["sweep", "search_and_rescue", "--speed", "1", "--jobs", "2", "--runs", "100"], children_work(2)
        ),
    },
    "sar-journal": {
        "explaining": Phase(["why", "{journal}", "--tree-file", "{tree}", "--nodes", "endless"], "blocked"),
        "importing": Phase(
            ["import", "delivery_failed", "-o", "{folder}/run.journal", "--nodes", "endless"], "blocked"
        ),
        "replaying": Phase(["replay", "{journal}", "--web-port", "0"], "The page:"),
        "watching": Phase(["watch", "{journal}", "--web-port", "0"], "The page:"),
    },
    "sar-detect-survivor-server": {"serving": Phase([], "ready")},
    "sar-report-survivor-server": {"serving": Phase([], "ready")},
}
# Those that read what they are given, print, and end.
AT_ONCE = {
    "sar-compile": {"format", "explain", "completion", *(() if IS_EDITOR_BUILT else ("edit",))},
    "sar-journal": {"show", "report", "check", "stats"},
}
INSTALLED = {
    each.name
    for each in entry_points(group="console_scripts")
    if each.value.startswith(("sar_compiler.", "search_and_rescue."))
}
WAYS = [f"{command}: {way}" for command, ways in LONG.items() for way in ways]


def subcommands(parser):
    """Return the subcommands of a command, by their names."""
    found = [each.choices for each in parser._actions if isinstance(each, argparse._SubParsersAction)]
    return found[0] if found else {}


def test_every_command_that_is_installed_is_tried():
    assert set(LONG) == INSTALLED == {parser.prog for parser in PARSERS}


@pytest.mark.parametrize("parser", PARSERS, ids=lambda parser: parser.prog)
def test_every_subcommand_is_tried_and_each_that_imports_leaves_while_it_does(parser):
    tried = {phase.words[0] for phase in LONG[parser.prog].values() if phase.words}
    importing = {phase.words[0] for phase in LONG[parser.prog].values() if "--nodes" in phase.words}
    known = subcommands(parser)
    if known:
        assert tried | AT_ONCE.get(parser.prog, set()) == set(known)
    imports = {name for name, each in known.items() if "--nodes" in each._option_string_actions}
    # Processes of their calls, or a call of their pages, import for these.
    assert imports - {"edit", "lsp", "mcp", "watch"} == importing


@pytest.fixture(scope="module")
def journal(tmp_path_factory):
    """A journal of a run that has failed."""
    folder = tmp_path_factory.mktemp("journal")
    (folder / "tree.xml").write_text(document("<AlwaysFailure/>"), encoding="utf-8")
    run = Command("sar-run", folder / "tree.xml", "--journal", folder / "run.journal")
    assert run.end() == 1, run.output
    return folder / "run.journal"


@pytest.fixture
def begin(start, tmp_path, request):
    """Start a command, and wait until a phase of it is reached."""
    pipes = []

    def begin_phase(command, phase):
        places = {"folder": tmp_path}
        for name, body in TREES.items():
            places[name] = tmp_path / f"{name}.xml"
            places[name].write_text(document(body).replace("</root>", f"{MODEL}</root>"), encoding="utf-8")
        if "{journal}" in phase.words:
            places["journal"] = request.getfixturevalue("journal")
        (tmp_path / "sar.toml").touch()  # no other project's counts
        # Short sleeps: Python does not notice a signal that comes just before a sleep until that is over.
        (tmp_path / "endless.py").write_text(
            "import time\nprint('blocked', flush=True)\nwhile True:\n    time.sleep(0.05)\n", "utf-8"
        )
        more = {}
        if phase.kind is Program:
            reads, writes = os.pipe()
            os.write(writes, phase.typed(tmp_path))
            pipes.extend([reads, writes])
            more["stdin"] = reads
        words = (each.format(**places) for each in phase.words)
        run = start(command, *words, kind=phase.kind, env={"PYTHONPATH": str(tmp_path)}, **more)
        run.typed_on = more.get("stdin")
        if isinstance(phase.reached, str):
            return run.wait_for(phase.reached)
        run.wait_until(lambda: phase.reached(run) or run.is_over, "the phase")
        assert not run.is_over, run.output
        return run

    yield begin_phase
    for each in pipes:
        os.close(each)


COMMANDS_FEW = [
    ("sar-run: serving", signal.SIGTERM),
    ("sar-run: page of a run that has ended", signal.SIGHUP),
    ("sar-compile: lsp, serving", signal.SIGINT),
    ("sar-compile: mcp, verifying", signal.SIGTERM),
]


@pytest.mark.parametrize(("way", "number", "busy"), matrix(WAYS, COMMANDS_FEW), indirect=["busy"])
def test_a_command_ends_and_leaves_no_process(begin, monkeypatch, tmp_path, way, number, busy):
    monkeypatch.chdir(tmp_path)
    command, _, name = way.partition(": ")
    run = begin(command, LONG[command][name])
    run.send(number)
    assert run.end() in NO_GOAL[number], run.output
    run.require_gone()


STARTS = """
import sys, time

class Blocking:
    def find_spec(self, name, path=None, target=None):
        if name == "sar_compiler.commands":
            print("starting", flush=True)
            time.sleep(600)

sys.meta_path.insert(0, Blocking())
"""


@pytest.mark.parametrize(("command", "number", "busy"), matrix(sorted(INSTALLED), []), indirect=["busy"])
def test_a_command_that_starts_ends_at_once(start, tmp_path, command, number, busy):
    (tmp_path / "sitecustomize.py").write_text(STARTS, encoding="utf-8")
    run = start(command, env={"PYTHONPATH": str(tmp_path)}).wait_for("starting")
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
        run.wait_for_goal(server)
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
    assert re.search(
        r"sar-run: thread 'charger' is still running.*, so the process ends without it", run.output
    )
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
    server.wait_for("Ready to run the trees Main")
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
