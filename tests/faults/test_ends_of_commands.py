"""Tests that ending a command or a program in any phase leaves no active goal and no process.

They cover all installed commands and all documented programs; a new one must be added to a table.
`make soak` tests all of them on a busy machine; a few are tested in every run.
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


def ticks_tree(text):
    """Return whether a program of the documentation ticks a tree on a ROS node."""
    return "import rclpy" in text and "compile(" in text and "def test_" not in text


DOCUMENTED = {
    f"{page.name}:{block.file or block.line}": block.text
    for page in PAGES
    for block in blocks(page)
    if block.language == "python" and ticks_tree(block.text)
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
# Programs without `running_tree`: rclpy's signal handlers shut ROS down before the program learns of a signal.
WITHOUT_RUNNING_TREE = {
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
    """A program or command whose processes can all be found."""

    def __init__(self, name, *arguments, env=None, **more):
        self.mark = uuid.uuid4().hex
        super().__init__(name, *arguments, env={**(env or {}), MARK: self.mark}, **more)

    def left(self):
        """Return the ids of its running processes, including descendants."""
        found = []
        for process in (each for each in Path("/proc").iterdir() if each.name.isdigit()):
            with suppress(OSError):  # it has ended, or is another user's
                if f"{MARK}={self.mark}".encode() in (process / "environ").read_bytes():
                    found.append(int(process.name))
        return found

    def wait_for_goal(self, server):
        """Wait until a server has accepted a goal; time without a processor does not count."""
        self.wait_until(lambda: server.of("accepted") or self.is_over, "the goal")
        assert server.of("accepted"), self.output

    def require_gone(self):
        """Wait until none of its processes is running."""
        news = News()
        with news:
            news.wait_until(lambda: not self.left(), lambda: f"{self.left()} do not end:\n{self.output}")


class OnTerminal(Terminal):
    """A program or command on a terminal."""

    left, require_gone = Program.left, Program.require_gone

    def __init__(self, name, *arguments, env):
        self.mark = uuid.uuid4().hex
        super().__init__(name, *arguments, env={**env, MARK: self.mark})

    @property
    def output(self):
        """Return its printed lines."""
        return "\n".join(self.history)


@pytest.fixture
def start():
    """Return a function that starts programs; their remaining processes are killed after the test."""
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
    """Keep the processors busy with the number of processes in the parameter."""
    # They end with this process, also if it is killed.
    program = "import os\nparent = os.getppid()\nwhile os.getppid() == parent: pass"
    loops = [subprocess.Popen([sys.executable, "-c", program]) for _ in range(request.param)]
    yield
    for loop in loops:
        loop.kill()
        loop.wait()


@pytest.fixture
def program(start, tmp_path, monkeypatch):
    """Return a function that starts a program with a driving tree in its own folder."""

    def begin(text, body=DRIVE):
        (tmp_path / "mission.xml").write_text(document(body), encoding="utf-8")
        (tmp_path / "sar.toml").write_text('models = ["ros:jazzy"]\n', encoding="utf-8")
        (tmp_path / "program.py").write_text(f"import os\nos.chdir({str(tmp_path)!r})\n{text}", "utf-8")
        return start("python", tmp_path / "program.py")

    return begin


def matrix(names, few):
    """Return all pairs of names and signals on a busy machine, marked slow, and a few pairs without load."""
    full = [
        pytest.param(name, number, 2, marks=pytest.mark.slow, id=f"{name}-{number.name}-busy")
        for name in names
        for number in SIGNALS
    ]
    return [*(pytest.param(name, number, 0, id=f"{name}-{number.name}") for name, number in few), *full]


NAMED = {**DOCUMENTED, **SHAPES}
FEW = [(name, signal.SIGINT) for name in DOCUMENTED]
FEW += [("a thread of its own", signal.SIGHUP)]


def test_documented_programs_use_running_tree():
    assert DOCUMENTED
    assert [name for name, text in DOCUMENTED.items() if "sar_compiler.running_tree(" not in text] == []


@pytest.mark.parametrize(("name", "number", "busy"), matrix(NAMED, FEW), indirect=["busy"])
def test_program_ended_with_active_goal_leaves_no_goal_or_process(program, serve, name, number, busy):
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
    [each for each in matrix(WITHOUT_RUNNING_TREE, LONELY_FEW) if each.values[1] in LONELY_SIGNALS],
    indirect=["busy"],
)
def test_program_without_running_tree_cancels_goal_in_separate_context(program, serve, name, number, busy):
    server = serve("navigation", goals=[{"drive": None}])
    run = program(WITHOUT_RUNNING_TREE[name])
    run.wait_for_goal(server)
    run.send(number)
    run.wait_until(lambda: run.is_over, "the end")
    assert server.active == 0, run.output
    # rclpy shuts ROS down in its own thread, so the program can be faster.
    has_sent = "Canceling the goal of 'Drive'." in run.output
    told = "could not be canceled, because ROS is shut down in this process. The robot may still be moving."
    assert has_sent or run.output.index(told) < run.output.index("Canceling the goal of '/navigate_to_pose'.")
    run.require_gone()


@pytest.mark.parametrize("number", [signal.SIGINT, pytest.param(signal.SIGTERM, marks=pytest.mark.slow)])
def test_program_with_unending_goal_reports_possible_motion(program, serve, number):
    server = serve("navigation", goals=[{"drive": None, "cancel": "ignore"}])
    run = program(SHAPES["spin"].replace("node) as", "node, settle_timeout_sec=1.0) as"))
    run.wait_for_goal(server)
    run.send(number)
    assert run.end() == 4, run.output
    assert "a goal may still be active, and the robot may still be moving: Drive" in run.output
    run.require_gone()


@pytest.mark.parametrize("number", [pytest.param(each, marks=pytest.mark.slow) for each in SIGNALS])
@pytest.mark.parametrize("name", NAMED)
def test_program_waiting_for_server_ends_on_signal(program, name, number):
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
def test_program_setting_up_its_tree_ends_on_signal(program, name, number, busy):
    text = SETS_UP + NAMED[name].replace('load("mission.xml")', 'load("mission.xml", nodes=[Open])')
    run = program(text, "<Open/>").wait_for("setting up")
    run.send(number)
    assert run.end() == SIGNALS[number], run.output
    run.require_gone()


# The foreign thread is omitted: the interpreter waits for it, because the block that would end the program has not begun.
@pytest.mark.parametrize(
    "name", [pytest.param(each, marks=pytest.mark.slow) for each in SHAPES if each != "a foreign thread"]
)
def test_program_loading_its_tree_during_shutdown_gets_exception_of_rclpy(program, name):
    text = SHAPES[name].replace(
        "with sar", "print('loading', flush=True)\nwhile rclpy.ok():\n    time.sleep(0.01)\nwith sar"
    )
    run = program(text).wait_for("loading")
    run.send(signal.SIGTERM)  # SIGINT is raised in the program, as in any
    run.wait_until(lambda: run.is_over, "the end")
    assert run.output.rstrip().rpartition("\n")[2] == "rclpy.executors.ExternalShutdownException"
    run.require_gone()


def test_goal_of_killed_program_is_canceled_by_guardian(program, serve):
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
def test_program_with_blocking_leaf_ends_and_cancels_its_goal(program, serve, tmp_path, number):
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


def is_computing(run):
    """Return whether a command has computed for longer than its start takes."""
    return processor_sec(run.pid) > _WORKS_SEC


def has_read(run):
    """Return whether a command has read all its input."""
    return not int.from_bytes(fcntl.ioctl(run.typed_on, termios.FIONREAD, bytes(4)), sys.byteorder)


def has_child_process(run):
    """Return whether a command has a child process, which may hardly compute on a busy machine because of its nice value."""
    return bool(children_of(run.pid))


def children_are_computing(count):
    """Return a function that returns whether `count` child processes of a command have computed for a while."""
    return lambda run: sum(processor_sec(each) > _BEGUN_SEC for each in children_of(run.pid)) >= count


class Phase(NamedTuple):
    """A long phase of a command.

    Attributes:
        words: The command's arguments.
        reached: A line that marks its beginning, or a function that detects it.
        typed: Returns the standard input, which stays open.
        kind: Whether the command is on a terminal.
    """

    words: list[str]
    reached: str | Callable[[Program], bool]
    typed: Callable[[Path], bytes] = lambda _folder: b""
    kind: type[Program | OnTerminal] = Program


def agent_messages(folder, *calls):
    """Return the messages of an agent to the MCP server."""
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


def editor_messages(folder, *commands):
    """Return the messages of an editor to the language server."""
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
# The subcommands that import a user's leaves, with their arguments.
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
# The long phases of each command; the first argument is the subcommand, if the command has subcommands.
LONG_PHASES: dict[str, dict[str, Phase]] = {
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
        "validate, trying": Phase(["validate", "{many}", "--deep", "1000"], is_computing),
        "simulate, ticking": Phase(["simulate", "{many}", "--ticks", "1000000000"], is_computing),
        "verify, exploring": Phase(["verify", "{many}"], is_computing),
        "predict, exploring": Phase(["predict", "{many}"], is_computing),
        "sweep, playing": Phase(
            ["sweep", "{many}", "--unusual", "0.1", "--ticks", "1000000000", "--jobs", "2"],
            children_are_computing(2),
        ),
        # If its text editor is not built, the command ends at once.
        **(
            {"edit, serving": Phase(["edit", "{tree}", "--web-port", "0"], "The editor:")}
            if IS_EDITOR_BUILT
            else {}
        ),
        "lsp, serving": Phase(["lsp"], "Content-Length", editor_messages),
        "lsp, verifying": Phase(
            ["lsp"], children_are_computing(1), lambda folder: editor_messages(folder, "sar.verify")
        ),
        "mcp, serving": Phase(["mcp"], '"id":1', agent_messages),
        "mcp, verifying": Phase(
            ["mcp"],
            has_child_process,
            lambda folder: agent_messages(folder, {"name": "verify", "arguments": {"file": "many.xml"}}),
        ),
    },
    "sar-sim": {
        "running": Phase(["run"], "runs, at most"),
        "mapping": Phase(["map", "-o", "{folder}/map"], is_computing),
        "importing": Phase(["sweep", "{tree}", "--nodes", "endless"], "blocked"),
        "sweeping": Phase(
            ["sweep", "search_and_rescue", "--speed", "1", "--jobs", "2", "--runs", "100"],
            children_are_computing(2),
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
# The subcommands that read their input, print, and end.
AT_ONCE = {
    "sar-compile": {"format", "explain", "completion", *(() if IS_EDITOR_BUILT else ("edit",))},
    "sar-journal": {"show", "report", "check", "stats"},
}
INSTALLED = {
    each.name
    for each in entry_points(group="console_scripts")
    if each.value.startswith(("sar_compiler.", "search_and_rescue."))
}
COMMAND_PHASES = [f"{command}: {way}" for command, ways in LONG_PHASES.items() for way in ways]


def subcommands(parser):
    """Return the subcommands of a command by name."""
    found = [each.choices for each in parser._actions if isinstance(each, argparse._SubParsersAction)]
    return found[0] if found else {}


def test_every_installed_command_is_tested():
    assert set(LONG_PHASES) == INSTALLED == {parser.prog for parser in PARSERS}


@pytest.mark.parametrize("parser", PARSERS, ids=lambda parser: parser.prog)
def test_every_subcommand_is_tested_and_importing_ones_during_import(parser):
    tried = {phase.words[0] for phase in LONG_PHASES[parser.prog].values() if phase.words}
    importing = {phase.words[0] for phase in LONG_PHASES[parser.prog].values() if "--nodes" in phase.words}
    known = subcommands(parser)
    if known:
        assert tried | AT_ONCE.get(parser.prog, set()) == set(known)
    imports = {name for name, each in known.items() if "--nodes" in each._option_string_actions}
    # These import in child processes or on a request of their page.
    assert imports - {"edit", "lsp", "mcp", "watch"} == importing


@pytest.fixture(scope="module")
def journal(tmp_path_factory):
    """Return the journal of a failed run."""
    folder = tmp_path_factory.mktemp("journal")
    (folder / "tree.xml").write_text(document("<AlwaysFailure/>"), encoding="utf-8")
    run = Command("sar-run", folder / "tree.xml", "--journal", folder / "run.journal")
    assert run.end() == 1, run.output
    return folder / "run.journal"


@pytest.fixture
def begin(start, tmp_path, request):
    """Return a function that starts a command and waits until a phase of it is reached."""
    pipes = []

    def begin_phase(command, phase):
        places = {"folder": tmp_path}
        for name, body in TREES.items():
            places[name] = tmp_path / f"{name}.xml"
            places[name].write_text(document(body).replace("</root>", f"{MODEL}</root>"), encoding="utf-8")
        if "{journal}" in phase.words:
            places["journal"] = request.getfixturevalue("journal")
        (tmp_path / "sar.toml").touch()  # so that no configuration of a parent folder applies
        # The sleeps are short, because Python handles a signal just before a sleep only after it.
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


@pytest.mark.parametrize(("way", "number", "busy"), matrix(COMMAND_PHASES, COMMANDS_FEW), indirect=["busy"])
def test_command_ends_on_signal_without_leftover_process(begin, monkeypatch, tmp_path, way, number, busy):
    monkeypatch.chdir(tmp_path)
    command, _, name = way.partition(": ")
    run = begin(command, LONG_PHASES[command][name])
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
def test_starting_command_ends_on_signal(start, tmp_path, command, number, busy):
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
def start_with_foreign_thread(start, serve, tmp_path):
    """Return a function that starts a run whose leaf has started an unending thread, and waits until it drives."""

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
def test_run_with_active_goal_and_foreign_thread_leaves_no_goal_or_process(
    start_with_foreign_thread, phase, number, busy
):
    server, run = start_with_foreign_thread(*PHASES[phase])
    run.send(number)
    assert run.end() == SIGNALS[number], run.output
    assert server.active == 0, run.output
    assert re.search(
        r"sar-run: thread 'charger' is still running.*, so the process ends without it", run.output
    )
    run.require_gone()


@pytest.mark.parametrize("number", [pytest.param(each, marks=pytest.mark.slow) for each in SIGNALS])
def test_second_signal_ends_run_at_once(start_with_foreign_thread, number):
    server, run = start_with_foreign_thread(cancel="ignore")
    run.send(number)
    server.wait_for("cancel")
    run.wait_until(lambda: "Canceling the goal" in run.output, "the first answer")
    for _ in range(20):  # a signal counts as the second one from half a second after the first
        run.send(signal.SIGINT)
        run._process.poll()
        if run.is_over:
            break
        signal.sigtimedwait([], 0.2)
    assert run.end() == 4, run.output
    run.require_gone()


@pytest.mark.parametrize("numbers", [1, pytest.param(3, marks=pytest.mark.slow)])
def test_served_run_with_foreign_thread_ends_and_next_goal_is_accepted(ros, serve, start, tmp_path, numbers):
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
