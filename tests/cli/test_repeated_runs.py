"""The process that runs `sar-run` again and again."""

import json
import subprocess
import sys

# What each run leaves behind refers to itself; each tells how many are left of those before it.
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


def test_nothing_that_a_run_leaves_behind_is_there_in_the_next_one():
    done = subprocess.run(
        [sys.executable, "-c", _RUNS], input="[]\n" * 3, capture_output=True, text=True, check=True
    )
    assert [json.loads(line)[1] for line in done.stdout.splitlines()] == ["0\n"] * 3


_MISTAKEN = """
import sys
from sar_compiler.cli import run, repeated_runs

def run_with_ros(arguments, ros, *, stepped):
    print("[INFO] [1.0] [node]: begins", *arguments, "second mistake", sep="\\n", file=sys.stderr)
    return int(arguments[0])

run.run_with_ros = run_with_ros
repeated_runs.serve()
"""


def test_of_a_run_that_has_not_begun_all_mistakes_are_told_and_of_others_the_last_line():
    asked = '["2", "first mistake"]\n["1", "on the way"]\n'
    done = subprocess.run(
        [sys.executable, "-c", _MISTAKEN], input=asked, capture_output=True, text=True, check=True
    )
    words = [json.loads(line)[2] for line in done.stdout.splitlines()]
    assert words == ["2\nfirst mistake\nsecond mistake", "second mistake"]
