"""Configuration of all tests: a separate ROS domain for each test process, default signals, and the scope of coverage."""

import fcntl
import gc
import itertools
import os
import signal
import subprocess
import sys
import tempfile
import threading
from contextlib import contextmanager, nullcontext
from pathlib import Path
from typing import Any

import pytest
from coverage import Coverage
from hypothesis import HealthCheck, is_hypothesis_test, settings

from tests import warm
from tests.costs import CostOfTests
from tests.random_inputs import rounds

# Ports of higher domains are in the range of ephemeral ports of Linux.
_DOMAINS = 100


def _reserve_domain():
    """Return a domain that no other test process of this machine uses, and its lock, which ends with the process."""
    for number in range(_DOMAINS):
        # Workers of one run start at different domains, and not at the domain of a process that has just ended.
        domain = 1 + (os.getpid() + number) % _DOMAINS
        # Sweeps of simulated missions use the same lock, so their runs stay out of the domains of tests.
        path = Path(tempfile.gettempdir()) / f"sar_sim_domain_{domain}.lock"
        try:
            file = path.open("a")
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:  # in use, or a file of another user
            continue
        return domain, file
    message = f"all {_DOMAINS} ROS domains are taken by test processes of this machine"
    raise RuntimeError(message)


# conftest.py is imported before any import of rclpy. LOCALHOST prevents listening on every interface.
_domain, _lock = _reserve_domain()
os.environ["ROS_DOMAIN_ID"] = str(_domain)
os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"

subprocess.Popen = warm.Popen  # type: ignore[misc]

# For journals of missions that tests start without `tests.processes`.
_state = tempfile.TemporaryDirectory(prefix="state_of_tests")
os.environ["XDG_STATE_HOME"] = _state.name
os.environ["XDG_CACHE_HOME"] = f"{_state.name}/cache"

# The duration of an example depends on the machine, so there is no deadline.
settings.register_profile(
    "untimed", max_examples=rounds(25), deadline=None, suppress_health_check=[HealthCheck.too_slow]
)
settings.load_profile("untimed")

# Folders whose tests are not about the packages whose coverage is measured.
_ELSEWHERE = (
    "agent",
    "cli",
    "docs",
    "e2e",
    "examples",
    "fuzz",
    "groot2",
    "launch",
    "lsp",
    "packaging",
    "port_types",
    "sim",
    "views",
)

# Folders whose tests build, run missions, or wait for other processes; the slowest first.
_LONG = ("packaging", "e2e", "examples", "faults", "web", "project", "launch")

# The trace functions of tests and their threads while coverage is measured.
_TRACERS = pytest.StashKey[tuple[Any, Any]]()

# Under nohup or in the background of a script these signals are ignored, and processes of tests would inherit that.
signal.signal(signal.SIGHUP, signal.SIG_DFL)
signal.signal(signal.SIGINT, signal.default_int_handler)


def pytest_addoption(parser):
    """Add the option of `tests.costs`."""
    parser.addoption("--costs", metavar="FILE", type=Path, help="write the CPU seconds of each test")


def pytest_configure(config):
    """Measure the cost of tests if `--costs` is given."""
    if path := config.getoption("costs"):
        config.pluginmanager.register(CostOfTests(path, is_worker=hasattr(config, "workerinput")))


@pytest.hookimpl(wrapper=True)
def pytest_collection(session):
    """Collect the tests without measuring coverage, which would take twice the time in every worker.

    One worker measures the import of all modules of the package before. The collected tests stay in memory, so the
    garbage collector would scan them in vain.
    """
    gc.disable()
    try:
        if not hasattr(session.config, "workerinput") or _is_all_measured(session.config):
            return (yield)
        if Coverage.current() is not None and session.config.workerinput["workerid"] == "gw0":
            warm.import_all()
        with _traced_by(None, None):
            return (yield)
    finally:
        gc.enable()


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_runtestloop(session):
    """Measure coverage only in tests and fixtures, because pytest itself takes three times as long with it."""
    if _is_all_measured(session.config):
        return (yield)
    session.config.stash[_TRACERS] = sys.gettrace(), threading.gettrace()
    with _traced_by(None, None):
        return (yield)


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_collection_modifyitems(items):
    """Mark the tests with random inputs, of which `make soak` tries more; start the long tests first."""
    for item in items:
        names = dir(getattr(item, "module", None))
        if is_hypothesis_test(getattr(item, "obj", None)) or "rounds" in names or "TIMES" in names:
            item.add_marker("random")
    yield
    if workers := int(os.environ.get("PYTEST_XDIST_WORKER_COUNT", "0")):
        items[:] = _dealt(items, workers)


def _dealt(items, workers):
    """Return tests in an order in which workers, which get equal parts of it, start with the same number of long tests.

    Short tests are last, when workers take tests from each other. The long tests of a module stay together, because
    they may share a run.
    """
    long = [[item for item in items if _folder(item) == folder] for folder in _LONG]
    modules = [list(same) for each in long for _, same in itertools.groupby(each, key=lambda item: item.path)]
    short = (item for item in items if _folder(item) not in _LONG)
    dealt: list[pytest.Item] = []
    for number in range(workers):
        stretch = (len(items) - len(dealt)) // (workers - number)
        own = list(itertools.chain(*modules[number::workers]))
        dealt += [*own, *itertools.islice(short, max(0, stretch - len(own)))]
    return [*dealt, *short]


@pytest.hookimpl(wrapper=True, trylast=True)
def pytest_pyfunc_call(pyfuncitem):
    """Measure coverage of a test."""
    with _measured(pyfuncitem):
        return (yield)


@pytest.hookimpl(wrapper=True, trylast=True)
def pytest_fixture_setup(fixturedef, request):
    """Measure coverage of a fixture of this project."""
    with _measured(request._pyfuncitem) if fixturedef.baseid.startswith("tests") else nullcontext():
        return (yield)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_teardown():
    """Check that a test restores the variables that Python reads at its start; otherwise commands are no longer forked."""
    yield
    left = warm.read_at_start(os.environ)
    for name in left.keys() - warm.AT_START.keys():
        del os.environ[name]
    os.environ.update(warm.AT_START)
    assert left == warm.AT_START


@contextmanager
def _traced_by(tracer, of_threads):
    """Set the trace functions of this thread and of threads that start meanwhile."""
    former = sys.gettrace(), threading.gettrace()
    sys.settrace(tracer)
    threading.settrace(of_threads)
    try:
        yield
    finally:
        sys.settrace(former[0])
        threading.settrace(former[1])


def _measured(item):
    """Measure coverage except for random inputs, which would take twice the time and cover lines by chance."""
    tracers = item.config.stash.get(_TRACERS, (None, None))
    return nullcontext() if tracers == (None, None) or _is_unmeasured(item) else _traced_by(*tracers)


def _is_all_measured(config):
    """Return whether coverage is recorded for each test, which must then include all tests."""
    return bool(config.getoption("cov_context", None))


def _folder(item):
    """Return the folder of a test below `tests`."""
    return item.path.relative_to(Path(__file__).parent).parts[0]


def _is_unmeasured(item):
    return (
        _folder(item) in _ELSEWHERE
        or is_hypothesis_test(getattr(item, "obj", None))
        or item.get_closest_marker("unmeasured") is not None
    )
