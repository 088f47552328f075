"""What validating the shipped tree from a shell costs, against importing lxml alone.

Run it with the interpreter of an environment that has this project, and not the ROS
packages from PyPI: these do something whenever an interpreter starts, which would count for both. Each figure is
the median of many runs; what is compared runs in turn, so that both have the same share of a busy machine.

    python3 -m venv build/startup && build/startup/bin/pip install .
    cd build && startup/bin/python ../benchmarks/startup.py

An installation has its modules compiled; in a checkout Python may have to do that first (PYTHONDONTWRITEBYTECODE).
"""

import statistics
import subprocess
import sys
import time
from collections.abc import Sequence

RUNS = 40
TREE = "search_and_rescue"
_PYTHON = sys.executable
_VALIDATE = "import sys; from sar_compiler.cli.compile import main; sys.exit(main(sys.argv[1:]))"
COMMANDS = {
    "python, nothing else": [_PYTHON, "-c", "pass"],
    "import lxml.etree": [_PYTHON, "-c", "import lxml.etree"],
    "import py_trees": [_PYTHON, "-c", "import py_trees"],
    "sar-compile --help": [_PYTHON, "-c", _VALIDATE, "--help"],
    f"sar-compile validate {TREE}": [_PYTHON, "-c", _VALIDATE, "validate", TREE],
}


def seconds(command: Sequence[str]) -> float:
    """Return how long a command takes.

    Raises:
        CalledProcessError: If it fails.
    """
    start = time.perf_counter()
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    return time.perf_counter() - start


def main() -> None:
    """Measure and print."""
    runs = int(sys.argv[1]) if len(sys.argv) > 1 else RUNS
    taken: dict[str, list[float]] = {name: [] for name in COMMANDS}
    for _ in range(runs + 1):
        for name, command in COMMANDS.items():
            taken[name].append(seconds(command))
    # The first run of each fills the caches.
    medians = {name: statistics.median(times[1:]) for name, times in taken.items()}
    reference = medians["import lxml.etree"]
    for name, median in medians.items():
        print(f"{name:40} {median * 1e3:7.1f} ms  {median / reference:5.2f} x importing lxml")


if __name__ == "__main__":
    main()
