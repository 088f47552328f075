"""Tests of Ctrl-C while a command is still importing its modules."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

COMMANDS = dict(
    re.findall(r'^(sar-[\w-]+) = "([\w.:]+)"$', Path("pyproject.toml").read_text("utf-8"), re.MULTILINE)
)
# The simulator and the servers run until they are stopped, so Ctrl-C is a regular end.
ENDINGS = {
    "sar-run": ([], 130),
    "sar-sim": (["run"], 0),
    "sar-detect-survivor-server": ([], 0),
    "sar-report-survivor-server": ([], 0),
}

# Starts a command like its console script, and sends SIGINT during the import of rclpy.
PROGRAM = """
import importlib, signal, sys

class Interrupting:
    def find_spec(self, name, path=None, target=None):
        if name == "rclpy":
            sys.meta_path.remove(self)
            signal.raise_signal(signal.SIGINT)

command, *sys.argv[1:] = sys.argv[1:]
module, _, function = command.partition(":")
main = getattr(importlib.import_module(module), function)
sys.meta_path.insert(0, Interrupting())
sys.exit(main())
"""


def test_every_command_that_needs_ros_has_expected_status():
    assert set(ENDINGS) == set(COMMANDS) - {"sar-compile", "sar-journal"}


@pytest.mark.ros
@pytest.mark.parametrize("command", sorted(ENDINGS))
def test_ctrl_c_during_import_ends_command_without_traceback(command):
    arguments, expected = ENDINGS[command]
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM, COMMANDS[command], *arguments],
        capture_output=True,
        text=True,
        timeout=60.0,
        check=False,
    )
    assert "Traceback" not in done.stderr, done.stderr
    assert done.returncode == expected, done.stderr
