"""Fixtures with one Nav2 for a module, a robot at home before each run, and a table of expected and observed results."""

import os
from pathlib import Path

import pytest

from tests.e2e.conftest import start
from tests.nav2.prefix import missing

__all__ = ["start"]

_ROWS: list[tuple[str, str, str, str]] = []


@pytest.fixture(scope="module")
def running(tmp_path_factory):
    lacking = missing(os.environ.get("NAV2_PREFIX", ""))
    if lacking:
        pytest.fail("\n".join(lacking), pytrace=False)
    from tests.nav2.stack import Nav2

    stack = Nav2(Path(os.environ["NAV2_PREFIX"]), tmp_path_factory.mktemp("nav2"))
    yield stack
    stack.stop()


@pytest.fixture
def nav2(running):
    """Nav2, with the robot at its start."""
    running.be_home()
    return running


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item):
    """Restart Nav2 after a failed test, so that its remains do not fail the next test."""
    report = yield
    if report.failed and "running" in item.funcargs:
        item.funcargs["running"].is_whole = False
    return report


@pytest.fixture
def start_mission(start):
    """Return a function that starts a mission in simulated time."""

    def start_in_simulated_time(*arguments, **parameters):
        given = {"use_sim_time": "true", "startup_timeout_sec": "120.0", **parameters}
        assigned = [word for name, value in given.items() for word in ("-p", f"{name}:={value}")]
        return start("sar-run", *arguments, "--until", "complete", "--ros-args", *assigned)

    return start_in_simulated_time


@pytest.fixture
def record_result(request, running):
    """Return a function that records expected and observed results and the computer's load; the rows are printed at the end, also those of failed tests."""

    def record(promised, what):
        load = f"load {os.getloadavg()[0]:.1f} on {os.cpu_count()} processors, {running.control_rate()}"
        _ROWS.append((request.node.name, promised, what, load))

    return record


def pytest_terminal_summary(terminalreporter):
    if _ROWS:
        terminalreporter.section("promised, and seen on Nav2")
        for name, promised, what, load in _ROWS:
            terminalreporter.write_line(
                f"{name}\n    promised: {promised}\n    seen:     {what}\n    computer: {load}"
            )
