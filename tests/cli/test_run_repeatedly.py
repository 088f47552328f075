"""The process that runs `sar-run` again and again."""

import json
import subprocess
import sys

# What each run leaves behind refers to itself; each tells how many are left of those before it.
_RUNS = """
import gc
from sar_compiler.cli import run, run_repeatedly

class Left:
    pass

def run_in(arguments, ros, *, stepped):
    print(sum(type(each) is Left for each in gc.get_objects()))
    left = Left()
    left.itself = left
    return 0

run.run_in = run_in
run_repeatedly.serve()
"""


def test_nothing_that_a_run_leaves_behind_is_there_in_the_next_one():
    done = subprocess.run(
        [sys.executable, "-c", _RUNS], input="[]\n" * 3, capture_output=True, text=True, check=True
    )
    assert [json.loads(line)[1] for line in done.stdout.splitlines()] == ["0\n"] * 3
