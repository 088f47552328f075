"""Whatever ends a mission, and whatever it is doing then: it ends, no goal is left active, and no traceback is shown."""

import fcntl
import os
import re
import signal
import subprocess
import sys
import termios
from contextlib import suppress
from pathlib import Path

import pytest

from tests.processes import BIN, Command, children_of, wait_for_end_of
from tests.trees import document

pytestmark = pytest.mark.ros

# The localisation knows where the last mission has left the robot.
ROS = ("-p", "use_sim_time:=true", "-p", "set_initial_pose:=false")
CANCELED = 5
EXECUTING = 2
BLOCKING = """
import time
from py_trees.behaviour import Behaviour
from py_trees.common import Status
from sar_compiler.leaves import Kind, register


@register("Block", kind=Kind.ACTION)
class Block(Behaviour):
    def __init__(self, name: str) -> None:
        super().__init__(name)

    def update(self):
        print("blocked", flush=True)
        time.sleep(600)
        return Status.RUNNING
"""
# The leaf blocks once the robot is on its way.
WHILE_DRIVING = """<Parallel success_count="2" failure_count="1">
  <NavigateToZone/>
  <Sequence><Sleep msec="3000"/><Block/></Sequence>
</Parallel>"""


@pytest.fixture
def blocking(tmp_path):
    """A tree that drives to a zone, with a leaf that never returns from its `update`."""
    (tmp_path / "blocking_leaves.py").write_text(BLOCKING, encoding="utf-8")
    tree = tmp_path / "tree.xml"
    tree.write_text(document(WHILE_DRIVING), encoding="utf-8")
    return tree, {"PYTHONPATH": str(tmp_path)}


@pytest.fixture(scope="module")
def servers():
    """All that a mission needs, in processes of their own; the robot stays where the last test has left it."""
    commands = [
        Command("sar-sim", "run", "--localised").wait_for("runs"),
        Command("sar-detect-survivor-server").wait_for("ready"),
        Command("sar-report-survivor-server").wait_for("ready"),
    ]
    yield
    for command in commands:
        command.kill()


def ask_until_over(command):
    """Press Ctrl-C as somebody does who sees that nothing happens; a second request is one that comes later."""
    command.send(signal.SIGINT)
    for _ in range(100):
        if command._process.poll() is None:
            command.send(signal.SIGINT)
            with suppress(subprocess.TimeoutExpired):
                command._process.wait(0.2)


def driving(goals):
    """Return whether the latest goal is under way."""
    return goals[-1:] == [EXECUTING]


def stopped(goals):
    """Return whether the latest goal was cancelled, and no other is under way."""
    return goals[-1:] == [CANCELED] and EXECUTING not in goals


class TestTheTerminalIsClosed:
    def test_the_goal_is_cancelled_and_the_status_is_that_of_a_hangup(self, servers, witness, tmp_path):
        watching = witness()
        keyboard, terminal = os.openpty()
        log = (tmp_path / "log").open("w")

        def take_terminal():
            os.setsid()
            fcntl.ioctl(0, termios.TIOCSCTTY, 0)

        run = subprocess.Popen(
            [BIN / "sar-run", "--ros-args", *ROS],
            stdin=terminal,
            stdout=terminal,
            stderr=log,
            preexec_fn=take_terminal,  # noqa: PLW1509 - no other threads of this process are in its way
        )
        try:
            os.close(terminal)
            watching.wait_for_goals(driving)
            watching.wait_until_moving()
            os.close(keyboard)
            assert run.wait(60.0) == 128 + signal.SIGHUP
            watching.wait_for_goals(stopped)
        finally:
            run.kill()
            log.close()
        assert "Traceback" not in (tmp_path / "log").read_text(encoding="utf-8")

    def test_what_was_started_to_outlive_it_does(self, start):
        program = "import os, signal, sys; signal.signal(signal.SIGHUP, signal.SIG_IGN); os.execv(sys.argv[1], sys.argv[1:])"
        server = subprocess.Popen(
            [sys.executable, "-c", program, BIN / "sar-report-survivor-server"],
            stderr=subprocess.PIPE,
            text=True,
        )
        try:
            assert server.stderr is not None
            assert "ready" in server.stderr.readline()
            server.send_signal(signal.SIGHUP)
            server.send_signal(signal.SIGINT)
            assert server.wait(60.0) == 0
        finally:
            server.kill()
            server.communicate()


class TestTheSecondRequest:
    def test_it_ends_a_run_whose_leaf_blocks_and_its_goal_is_cancelled(
        self, servers, start, witness, blocking
    ):
        tree, environment = blocking
        watching = witness()
        arguments = ("--nodes", "blocking_leaves", "--ros-args", *ROS)
        run = start("sar-run", tree, *arguments, env=environment).wait_for("blocked")
        watching.wait_for_goals(driving)
        ask_until_over(run)
        assert run.end() == 4, run.output
        assert "terminated at once after the second signal. The leaves were stopped" in run.output
        watching.wait_for_goals(stopped)

    def test_it_ends_a_command_that_blocks_while_it_imports(self, start, tmp_path):
        (tmp_path / "endless.py").write_text("print('blocked', flush=True)\nimport time\ntime.sleep(600)\n")
        run = start("sar-run", "--nodes", "endless", env={"PYTHONPATH": str(tmp_path)}).wait_for("blocked")
        ask_until_over(run)
        assert run.end() == 130, run.output

    def test_two_signals_at_once_are_one_request(self, servers, start, witness):
        watching = witness()
        run = start("sar-run", "--ros-args", *ROS)
        watching.wait_for_goals(driving)
        run.send(signal.SIGTERM)
        run.send(signal.SIGINT)
        assert run.end() in (130, 143), run.output
        assert "Summary: the mission is incomplete." in run.output
        watching.wait_for_goals(stopped)


class TestAGuardian:
    def test_it_cancels_the_goal_of_a_mission_that_is_killed(self, servers, start, witness):
        watching = witness()
        run = start("sar-run", "--guardian", "--ros-args", *ROS)
        watching.wait_for_goals(driving)
        watching.wait_until_moving()
        run.send(signal.SIGKILL)
        watching.wait_for_goals(stopped)
        run.wait_for(
            "the mission's process has ended: the server of /navigate_to_pose was requested to cancel the goal. The goal is cancelled"
        )

    def test_it_ends_with_a_mission_that_ends_in_order(self, servers, start, witness):
        watching = witness()
        run = start("sar-run", "--guardian", "--ros-args", *ROS)
        watching.wait_for_goals(driving)
        (guardian,) = children_of(run._process.pid)
        assert run.stop(within_sec=5.0) == 130, run.output
        wait_for_end_of(guardian)
        assert "the mission's process has ended" not in run.output

    def test_ctrl_c_in_a_terminal_does_not_reach_it(self, servers, start, witness):
        watching = witness()
        run = start("sar-run", "--guardian", "--ros-args", *ROS)
        watching.wait_for_goals(driving)
        (guardian,) = children_of(run._process.pid)
        assert os.getpgid(guardian) != os.getpgid(run._process.pid)
        os.kill(guardian, signal.SIGINT)
        os.kill(guardian, signal.SIGTERM)
        os.kill(guardian, signal.SIGHUP)
        run.send(signal.SIGKILL)
        watching.wait_for_goals(stopped)


COMMANDS = dict(
    re.findall(r'^(sar-[\w-]+) = "([\w.:]+)"$', Path("pyproject.toml").read_text("utf-8"), re.MULTILINE)
)
STOPPED = {
    "sar-run": 130,
    "sar-compile": 130,
    "sar-journal": 130,
    "sar-sim": 0,
    "sar-detect-survivor-server": 0,
    "sar-report-survivor-server": 0,
}
# Calls a console script's function, and sends SIGINT in the midst of the n-th import from there on.
FROM_THE_FIRST_LINE = """
import importlib, signal, sys

class Interrupting:
    def find_spec(self, name, path=None, target=None):
        global left
        left -= 1
        if left == 0:
            signal.raise_signal(signal.SIGINT)

script, number, *sys.argv[1:] = sys.argv[1:]
left = int(number)
module, _, function = script.partition(":")
function = getattr(importlib.import_module(module), function)
sys.meta_path.insert(0, Interrupting())
status = function()
if left > 0:
    status = f"only {int(number) - left} imports"
sys.exit(status)
"""


@pytest.mark.parametrize("moment", [1, 5, 20])
@pytest.mark.parametrize("command", sorted(COMMANDS))
def test_ctrl_c_in_the_first_moments_ends_every_command_without_a_traceback(command, moment):
    arguments = {
        "sar-sim": ["run"],
        "sar-compile": ["validate", "search_and_rescue"],
        "sar-journal": ["show", "no.journal"],
    }.get(command, [])
    done = subprocess.run(
        [sys.executable, "-c", FROM_THE_FIRST_LINE, COMMANDS[command], str(moment), *arguments],
        capture_output=True,
        text=True,
        timeout=60.0,
        check=False,
    )
    assert (done.returncode, done.stderr) == (STOPPED[command], ""), done
