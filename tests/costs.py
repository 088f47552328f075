"""Compares the CPU seconds of tests, including their child processes, with a record.

`--costs FILE` writes the table. `python -m tests.costs FILE` fails if a test module takes more than 1.5 times its recorded time.
`make test` does this last, so that the modules are at the end of its output. Times are relative to the median, so a slower machine
makes no difference.
"""

import json
import os
import resource
import sys
import time
from collections import defaultdict
from pathlib import Path
from statistics import median

import pytest

RECORD = Path(__file__).with_name("costs.json")
"""CPU seconds of each test module in a run on an idle machine; `make test-costs` writes them."""
GROWTH = 1.5
SLACK_SEC = 15.0
"""Seconds that a module may take above its expected time in any case; also the limit of a new module."""
_NAME = "cost"


def cpu_now():
    """Return the CPU seconds of this process and its ended child processes."""
    both = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(each.ru_utime + each.ru_stime for each in both)


def find_grown(taken, recorded):
    """Return a line for each test module that takes too long, with its expected time.

    Args:
        taken: CPU seconds by module, in this run.
        recorded: CPU seconds by module, in the record.
    """
    both = taken.keys() & recorded.keys()
    # The median, because omitted tests would change the sum.
    pace = median(taken[module] / recorded[module] for module in both) if both else 1.0
    lines = []
    for module, seconds in sorted(taken.items()):
        expected = pace * recorded.get(module, 0.0)
        if seconds > max(GROWTH * expected, expected + SLACK_SEC):
            lines.append(f"{module}: {seconds:.1f} s of CPU, expected were {expected:.1f}")
    return lines


class CostOfTests:
    """Measures tests in the processes that run them, and writes the table in the main process.

    Args:
        path: The path of the table.
        is_worker: Whether this process is a worker.
    """

    def __init__(self, path, *, is_worker):
        self._path = path
        self._is_worker = is_worker
        self._start = (0.0, 0.0)
        self._taken = {}

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtest_logstart(self):
        """Read the clocks before a test."""
        self._start = (time.perf_counter(), cpu_now())

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_makereport(self, call):
        """Add the cost of a test to the report of its end."""
        report = yield
        if call.when == "teardown":
            wall, cpu = time.perf_counter() - self._start[0], cpu_now() - self._start[1]
            # A test that reaps processes of an earlier test is charged for its own duration at most.
            report.user_properties.append((_NAME, (wall, min(cpu, wall * (os.cpu_count() or 1)))))
        return report

    def pytest_runtest_logreport(self, report):
        """Store the cost of a test that has ended."""
        for name, cost in report.user_properties if report.when == "teardown" else ():
            if name == _NAME:
                self._taken[report.nodeid] = cost

    def pytest_sessionfinish(self):
        """Write the table."""
        if self._is_worker:
            return
        rows = sorted(self._taken.items(), key=lambda row: -row[1][1])
        self._path.parent.mkdir(parents=True, exist_ok=True)
        lines = ["cpu_sec\twall_sec\ttest", *(f"{cpu:.3f}\t{wall:.3f}\t{name}" for name, (wall, cpu) in rows)]
        self._path.write_text("\n".join(lines) + "\n", encoding="utf-8")

    def pytest_terminal_summary(self, terminalreporter):
        """Print the cost of the run."""
        if self._is_worker or not self._path.exists():
            return
        whole = sum(cpu for _, cpu in self._taken.values())
        terminalreporter.write_line(f"{whole:.0f} s of CPU in {len(self._taken)} tests: {self._path}")


def by_module(path):
    """Return the CPU seconds of each module in a table."""
    taken: dict[str, float] = defaultdict(float)
    for line in path.read_text(encoding="utf-8").splitlines()[1:]:
        cpu, _, name = line.split("\t", 2)
        taken[name.partition("::")[0]] += float(cpu)
    return dict(taken)


def save(path):
    """Make the table of a run the record, without modules below 0.1 s."""
    kept = {
        module: round(seconds, 1) for module, seconds in sorted(by_module(path).items()) if seconds >= 0.1
    }
    RECORD.write_text(json.dumps(kept, indent=0) + "\n", encoding="utf-8")


def main(path: str) -> int:
    """Print the modules that take too long; return the exit status."""
    lines = find_grown(by_module(Path(path)), json.loads(RECORD.read_text(encoding="utf-8")))
    for line in lines:
        print(f"costs too much: {line}. If this is intended, run: make test-costs")
    return bool(lines)


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
