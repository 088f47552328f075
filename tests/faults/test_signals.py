"""Tests of ending a mission by signals in any phase: it ends without a traceback, and no goal stays active."""

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

# The localisation already knows the robot's position from the previous mission.
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
# The leaf blocks once the robot drives.
WHILE_DRIVING = """<Parallel success_count="2" failure_count="1">
  <NavigateToZone/>
  <Sequence><Sleep msec="3000"/><Block/></Sequence>
</Parallel>"""


@pytest.fixture
def blocking(tmp_path):
    """Return a tree that drives to a zone with a leaf whose `update` never returns, and its environment."""
    (tmp_path / "blocking_leaves.py").write_text(BLOCKING, encoding="utf-8")
    tree = tmp_path / "tree.xml"
    tree.write_text(document(WHILE_DRIVING), encoding="utf-8")
    return tree, {"PYTHONPATH": str(tmp_path)}


@pytest.fixture(scope="module")
def servers():
    """Start all servers of a mission in separate processes; the robot stays where the last test has left it."""
    commands = [
        Command("sar-sim", "run", "--localised").wait_for("runs"),
        Command("sar-detect-survivor-server").wait_for("ready"),
        Command("sar-report-survivor-server").wait_for("ready"),
    ]
    yield
    for command in commands:
        command.kill()


def interrupt_until_ended(command):
    """Press Ctrl-C repeatedly until the command ends."""
    command.send(signal.SIGINT)
    for _ in range(100):
        if command._process.poll() is None:
            command.send(signal.SIGINT)
            with suppress(subprocess.TimeoutExpired):
                command._process.wait(0.2)


def is_driving(goals):
    """Return whether the latest goal is active."""
    return goals[-1:] == [EXECUTING]


def is_stopped(goals):
    """Return whether the latest goal was canceled and no other is active."""
    return goals[-1:] == [CANCELED] and EXECUTING not in goals


class TestClosedTerminal:
    def test_goal_is_canceled_and_status_is_that_of_hangup(self, servers, witness, tmp_path):
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
            preexec_fn=take_terminal,  # noqa: PLW1509 - this process has no other threads that interfere
        )
        try:
            os.close(terminal)
            watching.wait_for_goals(is_driving)
            watching.wait_until_moving()
            os.close(keyboard)
            assert run.wait(60.0) == 128 + signal.SIGHUP
            watching.wait_for_goals(is_stopped)
        finally:
            run.kill()
            log.close()
        assert "Traceback" not in (tmp_path / "log").read_text(encoding="utf-8")

    def test_process_that_ignores_hangup_keeps_running(self, start):
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


class TestSecondSignal:
    def test_run_with_blocking_leaf_ends_and_its_goal_is_canceled(self, servers, start, witness, blocking):
        tree, environment = blocking
        watching = witness()
        arguments = ("--nodes", "blocking_leaves", "--ros-args", *ROS)
        run = start("sar-run", tree, *arguments, env=environment).wait_for("blocked")
        watching.wait_for_goals(is_driving)
        interrupt_until_ended(run)
        assert run.end() == 4, run.output
        assert "terminated at once after the second signal. The leaves were stopped" in run.output
        watching.wait_for_goals(is_stopped)

    def test_command_blocked_by_import_ends(self, start, tmp_path):
        (tmp_path / "endless.py").write_text("print('blocked', flush=True)\nimport time\ntime.sleep(600)\n")
        run = start("sar-run", "--nodes", "endless", env={"PYTHONPATH": str(tmp_path)}).wait_for("blocked")
        interrupt_until_ended(run)
        assert run.end() == 130, run.output

    def test_simultaneous_signals_are_one_request(self, servers, start, witness):
        watching = witness()
        run = start("sar-run", "--ros-args", *ROS)
        watching.wait_for_goals(is_driving)
        run.send(signal.SIGTERM)
        run.send(signal.SIGINT)
        assert run.end() in (130, 143), run.output
        assert "Summary: the mission is incomplete." in run.output
        watching.wait_for_goals(is_stopped)


class TestGuardian:
    def test_guardian_cancels_goal_of_killed_mission(self, servers, start, witness):
        watching = witness()
        run = start("sar-run", "--guardian", "--ros-args", *ROS)
        watching.wait_for_goals(is_driving)
        watching.wait_until_moving()
        run.send(signal.SIGKILL)
        watching.wait_for_goals(is_stopped)
        run.wait_for(
            "the mission's process has ended: the server of /navigate_to_pose was requested to cancel the goal. The goal is cancelled"
        )

    def test_guardian_ends_with_mission(self, servers, start, witness):
        watching = witness()
        run = start("sar-run", "--guardian", "--ros-args", *ROS)
        watching.wait_for_goals(is_driving)
        (guardian,) = children_of(run._process.pid)
        assert run.stop(within_sec=5.0) == 130, run.output
        wait_for_end_of(guardian)
        assert "the mission's process has ended" not in run.output

    def test_guardian_is_not_ended_by_ctrl_c_or_signals(self, servers, start, witness):
        watching = witness()
        run = start("sar-run", "--guardian", "--ros-args", *ROS)
        watching.wait_for_goals(is_driving)
        (guardian,) = children_of(run._process.pid)
        assert os.getpgid(guardian) != os.getpgid(run._process.pid)
        os.kill(guardian, signal.SIGINT)
        os.kill(guardian, signal.SIGTERM)
        os.kill(guardian, signal.SIGHUP)
        run.send(signal.SIGKILL)
        watching.wait_for_goals(is_stopped)


COMMANDS = dict(
    re.findall(r'^(sar-[\w-]+) = "([\w.:]+)"$', Path("pyproject.toml").read_text("utf-8"), re.MULTILINE)
)
EXIT_STATUSES = {
    "sar-run": 130,
    "sar-compile": 130,
    "sar-journal": 130,
    "sar-sim": 0,
    "sar-detect-survivor-server": 0,
    "sar-report-survivor-server": 0,
}
# Calls the function of a console script, and raises SIGINT during the n-th import after that.
INTERRUPTED_IMPORT = """
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
def test_ctrl_c_during_import_ends_every_command_without_traceback(command, moment):
    arguments = {
        "sar-sim": ["run"],
        "sar-compile": ["validate", "search_and_rescue"],
        "sar-journal": ["show", "no.journal"],
    }.get(command, [])
    done = subprocess.run(
        [sys.executable, "-c", INTERRUPTED_IMPORT, COMMANDS[command], str(moment), *arguments],
        capture_output=True,
        text=True,
        timeout=60.0,
        check=False,
    )
    assert (done.returncode, done.stderr) == (EXIT_STATUSES[command], ""), done
