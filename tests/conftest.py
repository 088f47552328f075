"""What every test shares: a ROS domain of its own for each test process, signals as a terminal has them, and what coverage is measured of."""

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
from tests.chance import rounds
from tests.costs import CostOfTests

# Ports of higher domains are among those that Linux gives to anybody.
_DOMAINS = 100


def _take_domain():
    """Return a domain that no other test process of this machine has, and its lock, which ends with the process."""
    for number in range(_DOMAINS):
        # The workers of one run begin at different ones, and none where a process that ended now was.
        domain = 1 + (os.getpid() + number) % _DOMAINS
        # The lock that sweeps of simulated missions take: their flights stay out of the tests' domains.
        path = Path(tempfile.gettempdir()) / f"sar_sim_domain_{domain}.lock"
        try:
            file = path.open("a")
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:  # taken, or somebody else's file
            continue
        return domain, file
    message = f"all {_DOMAINS} ROS domains are taken by test processes of this machine"
    raise RuntimeError(message)


# conftest.py is imported before anything imports rclpy. LOCALHOST keeps it from listening on every interface.
_domain, _lock = _take_domain()
os.environ["ROS_DOMAIN_ID"] = str(_domain)
os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"

subprocess.Popen = warm.Popen  # type: ignore[misc]

# The journals of missions that tests start otherwise than by `tests.processes`.
_state = tempfile.TemporaryDirectory(prefix="state_of_tests")
os.environ["XDG_STATE_HOME"] = _state.name
os.environ["XDG_CACHE_HOME"] = f"{_state.name}/cache"

# How long an example takes depends on the machine, which is no property of the code.
settings.register_profile(
    "untimed", max_examples=rounds(25), deadline=None, suppress_health_check=[HealthCheck.too_slow]
)
settings.load_profile("untimed")

# Folders whose tests are about other things than the rooms that coverage is measured of.
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

# Folders whose tests build, fly, or wait for others; what takes longest stands first.
_LONG = ("packaging", "e2e", "examples", "faults", "web", "project", "launch")

# What traces the tests, and their threads, where coverage is measured.
_TRACERS = pytest.StashKey[tuple[Any, Any]]()

# Under nohup, or in the background of a script, they are ignored, and what the tests start would inherit that.
signal.signal(signal.SIGHUP, signal.SIG_DFL)
signal.signal(signal.SIGINT, signal.default_int_handler)


def pytest_addoption(parser):
    """Add the option of `tests.costs`."""
    parser.addoption("--costs", metavar="FILE", type=Path, help="write the CPU seconds of each test")


def pytest_configure(config):
    """Measure what tests cost, if that is wanted."""
    if path := config.getoption("costs"):
        config.pluginmanager.register(CostOfTests(path, is_worker=hasattr(config, "workerinput")))


@pytest.hookimpl(wrapper=True)
def pytest_collection(session):
    """Look for the tests without measuring coverage: every worker does, and it takes twice the time.

    What is run where a module of the package is imported is measured, by one of them: all are imported before. What
    is found stays, so the garbage collector would look at it in vain, now and in every later test.
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
    """Measure coverage of tests and of their fixtures alone: pytest itself takes three times as long with it."""
    if _is_all_measured(session.config):
        return (yield)
    session.config.stash[_TRACERS] = sys.gettrace(), threading.gettrace()
    with _traced_by(None, None):
        return (yield)


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_collection_modifyitems(items):
    """Mark the tests whose inputs are random, of which `make soak` tries more; have the long ones begin first."""
    for item in items:
        names = dir(getattr(item, "module", None))
        if is_hypothesis_test(getattr(item, "obj", None)) or "rounds" in names or "TIMES" in names:
            item.add_marker("random")
    yield
    if workers := int(os.environ.get("PYTEST_XDIST_WORKER_COUNT", "0")):
        items[:] = _dealt(items, workers)


def _dealt(items, workers):
    """Return tests in an order in which workers that are given equal stretches of it begin with as many long ones each.

    What is left for the end, when one worker takes over what another has not begun, are short ones; and long ones stay
    together with those of their module, with which they may share a run.
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
    """Measure coverage of a fixture that is ours."""
    with _measured(request._pyfuncitem) if fixturedef.baseid.startswith("tests") else nullcontext():
        return (yield)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_teardown():
    """Hold that variables which Python reads at its start are as before: with others no command is forked any more."""
    yield
    left = warm.read_at_start(os.environ)
    for name in left.keys() - warm.AT_START.keys():
        del os.environ[name]
    os.environ.update(warm.AT_START)
    assert left == warm.AT_START


@contextmanager
def _traced_by(tracer, of_threads):
    """Have a function that traces this thread, and one that traces those that begin meanwhile."""
    former = sys.gettrace(), threading.gettrace()
    sys.settrace(tracer)
    threading.settrace(of_threads)
    try:
        yield
    finally:
        sys.settrace(former[0])
        threading.settrace(former[1])


def _measured(item):
    """Have coverage measured of inputs that somebody chose: with it random ones take twice the time, and cover by luck."""
    tracers = item.config.stash.get(_TRACERS, (None, None))
    return nullcontext() if tracers == (None, None) or _is_unmeasured(item) else _traced_by(*tracers)


def _is_all_measured(config):
    """Return whether somebody asks which test reaches which line, and is told of all."""
    return bool(config.getoption("cov_context", None))


def _folder(item):
    """Return the folder of the tests' that a test is in."""
    return item.path.relative_to(Path(__file__).parent).parts[0]


def _is_unmeasured(item):
    return (
        _folder(item) in _ELSEWHERE
        or is_hypothesis_test(getattr(item, "obj", None))
        or item.get_closest_marker("unmeasured") is not None
    )
