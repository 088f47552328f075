"""Test that the example of a mission test passes when a user runs it."""

import subprocess
import sys

import pytest

pytestmark = pytest.mark.ros


def test_example_mission_test_passes():
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "examples/mission_test"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300.0, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "1 passed" in done.stdout
