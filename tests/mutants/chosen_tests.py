"""A pytest plugin for the runs of `tests.mutants`: runs the tests that are asked for, and notes what became of each."""

import json
import os
from collections.abc import Iterator
from pathlib import Path

import pytest

CHOSEN, NOTED, PROCESSES = "MUTANTS_CHOSEN", "MUTANTS_NOTED", "MUTANTS_PROCESSES"
"""The environment variables that name a file with what to run, one for what came of it, and how processes are measured."""
CURRENT = "PYTEST_CURRENT_TEST"
"""The variable in which pytest tells the processes of a test which one and which part of it began them."""
_seconds: dict[str, float | None] = {}


@pytest.hookimpl(trylast=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Keep the chosen tests, in their order, and those that there are only with this mutant."""
    if CHOSEN not in os.environ:
        return
    asked = json.loads(Path(os.environ[CHOSEN]).read_text(encoding="utf-8"))
    by_id = {item.nodeid: item for item in items}
    known = set(asked["known"])
    new = [item for item in items if item.nodeid not in known]
    items[:] = [*(by_id[each] for each in asked["chosen"] if each in by_id), *new]


def pytest_runtest_setup() -> None:
    """Have the processes that tests begin measured: not those in which the tests are run."""
    if PROCESSES in os.environ:
        os.environ["COVERAGE_PROCESS_START"] = os.environ[PROCESSES]


@pytest.hookimpl(wrapper=True, trylast=True)
def pytest_runtest_teardown() -> Iterator[None]:
    """Let the environment be as before when `tests/conftest.py` compares it."""
    try:
        return (yield)
    finally:
        if PROCESSES in os.environ:
            del os.environ["COVERAGE_PROCESS_START"]


def pytest_runtest_logreport(report: pytest.TestReport) -> None:
    """Note how many seconds a test took; None if it failed."""
    before = _seconds.get(report.nodeid, 0.0)
    _seconds[report.nodeid] = None if before is None or report.failed else before + report.duration


def pytest_sessionfinish(session: pytest.Session) -> None:
    """Write what was noted, also of what was run by workers."""
    if not hasattr(session.config, "workerinput"):
        Path(os.environ[NOTED]).write_text(json.dumps(_seconds), encoding="utf-8")
