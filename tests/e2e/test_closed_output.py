"""Test of a run whose standard output is closed."""

import os
import subprocess

import pytest

from tests.processes import BIN

pytestmark = pytest.mark.ros


def test_closed_output_does_not_stop_run():
    arguments = ["--sim", "--speed", "20", "--view", "text", "--ros-args", "-p", "zone_order:=[zone_b]"]
    with subprocess.Popen(
        [BIN / "sar-run", *arguments],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        env={**os.environ, "PYTHONFAULTHANDLER": "1"},
        text=True,
    ) as run:
        try:
            assert run.stdout is not None
            assert run.stdout.readline().strip()
            run.stdout.close()
            run.stdout = None
            _, log = run.communicate(timeout=60.0)
        finally:
            run.kill()
    assert run.returncode == 0, log
    assert log.count("standard output can no longer be written (Broken pipe)") == 1
    assert "zones visited:   1 of 1 (zone_b)" in log
    assert "Traceback" not in log
