"""Tests of the process that runs `sar-run` repeatedly."""

import json
import subprocess
import sys

# Each run leaves an object that refers to itself, and prints the number of such objects from earlier runs.
_RUNS = """
import gc
from sar_compiler.cli import run, repeated_runs

class Left:
    pass

def run_with_ros(arguments, ros, *, stepped):
    print(sum(type(each) is Left for each in gc.get_objects()))
    left = Left()
    left.itself = left
    return 0

run.run_with_ros = run_with_ros
repeated_runs.serve()
"""


def test_objects_of_run_are_collected_before_next_run():
    done = subprocess.run(
        [sys.executable, "-c", _RUNS], input="[]\n" * 3, capture_output=True, text=True, check=True
    )
    assert [json.loads(line)[1] for line in done.stdout.splitlines()] == ["0\n"] * 3


_FAILING_RUNS = """
import sys
from sar_compiler.cli import run, repeated_runs

def run_with_ros(arguments, ros, *, stepped):
    print("[INFO] [1.0] [node]: begins", *arguments, "second mistake", sep="\\n", file=sys.stderr)
    return int(arguments[0])

run.run_with_ros = run_with_ros
repeated_runs.serve()
"""


def test_all_errors_are_reported_for_status_2_and_last_line_otherwise():
    asked = '["2", "first mistake"]\n["1", "on the way"]\n'
    done = subprocess.run(
        [sys.executable, "-c", _FAILING_RUNS], input=asked, capture_output=True, text=True, check=True
    )
    words = [json.loads(line)[2] for line in done.stdout.splitlines()]
    assert words == ["2\nfirst mistake\nsecond mistake", "second mistake"]
