"""Fixtures for the tests of faults: a mission in its own process, with servers that misbehave."""

import os

import pytest

from tests.e2e.conftest import start, witness
from tests.ros.conftest import make_ros, ros, said

__all__ = ["make_ros", "ros", "said", "start", "witness"]

# No initial pose is sent, ticks are frequent, and the startup timeout is short.
QUICK = (
    ("set_initial_pose", "false"),
    ("tick_rate_hz", "10.0"),
    ("startup_timeout_sec", "30.0"),
)
# `make soak` also runs the tests with the other executor.
EXECUTOR = os.environ.get("SAR_TEST_EXECUTOR", "events")


@pytest.fixture
def serve():
    """Return a function that starts servers; running servers are killed after the test."""
    from tests.faults.servers import Servers

    processes = []

    def start_servers(role, env=None, **script):
        processes.append(Servers(role, env, **script))
        return processes[-1]

    yield start_servers
    for process in processes:
        process.thaw()
        process.kill()


@pytest.fixture
def fly(start, serve):
    """Return a function that starts `sar-run` with servers for detection and reports, by default with one zone."""

    served: list[object] = []

    def start_mission(*arguments, env=None, zones=("zone_a",), survivors=None, **parameters):
        if not served:
            served.append(serve("survivors", env, **(survivors or {})))
        given = {**dict(QUICK), "zone_order": f"[{', '.join(zones)}]", **parameters}
        assigned = [word for name, value in given.items() for word in ("-p", f"{name}:={value}")]
        words = (*arguments, "--until", "complete", "--executor", EXECUTOR)
        return start("sar-run", *words, "--ros-args", *assigned, env=env)

    return start_mission
