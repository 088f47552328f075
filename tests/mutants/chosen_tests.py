"""A pytest plugin for the runs of `tests.mutants`: runs the selected tests, and records the result of each."""

import json
import os
from collections.abc import Iterator
from pathlib import Path

import pytest

CHOSEN, NOTED, PROCESSES = "MUTANTS_CHOSEN", "MUTANTS_NOTED", "MUTANTS_PROCESSES"
"""Environment variables: the file with the selected tests, the file for results, and the coverage settings of processes."""
CURRENT = "PYTEST_CURRENT_TEST"
"""The variable in which pytest names the current test and its phase to child processes."""
_seconds: dict[str, float | None] = {}


@pytest.hookimpl(trylast=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Keep the selected tests in their order, and tests that exist only with this mutant."""
    if CHOSEN not in os.environ:
        return
    asked = json.loads(Path(os.environ[CHOSEN]).read_text(encoding="utf-8"))
    by_id = {item.nodeid: item for item in items}
    known = set(asked["known"])
    new = [item for item in items if item.nodeid not in known]
    items[:] = [*(by_id[each] for each in asked["chosen"] if each in by_id), *new]


def pytest_runtest_setup() -> None:
    """Measure the coverage of processes that tests start, but not of the processes that run the tests."""
    if PROCESSES in os.environ:
        os.environ["COVERAGE_PROCESS_START"] = os.environ[PROCESSES]


@pytest.hookimpl(wrapper=True, trylast=True)
def pytest_runtest_teardown() -> Iterator[None]:
    """Restore the environment before `tests/conftest.py` compares it."""
    try:
        return (yield)
    finally:
        if PROCESSES in os.environ:
            del os.environ["COVERAGE_PROCESS_START"]


def pytest_runtest_logreport(report: pytest.TestReport) -> None:
    """Record the seconds of a test; None if it failed."""
    before = _seconds.get(report.nodeid, 0.0)
    _seconds[report.nodeid] = None if before is None or report.failed else before + report.duration


def pytest_sessionfinish(session: pytest.Session) -> None:
    """Write the results, including those of workers."""
    if not hasattr(session.config, "workerinput"):
        Path(os.environ[NOTED]).write_text(json.dumps(_seconds), encoding="utf-8")
