"""Tests of the guardian: it reports the end of the goals of a crashed mission, and is replaced if it crashes itself."""

import os
import re
import signal

import pytest

from tests.processes import children_of

pytestmark = pytest.mark.ros

GONE = "the mission's process has ended"
REPLACED = "the guardian process has ended unexpectedly (by SIGKILL). A new guardian is started"


def count_deaths(run):
    return len(re.findall("the guardian process has ended", run.output))


@pytest.fixture
def start_driving(serve, fly):
    """Return a function that starts a mission with a guardian and waits until its first goal is accepted."""

    def start_mission(**manner):
        server = serve("navigation", goals=[{"drive": None, **manner}])
        run = fly("--guardian")
        server.wait_for("accepted")
        return server, run

    return start_mission


def test_guardian_waits_for_end_of_canceled_goal(start_driving):
    server, run = start_driving()
    run.send(signal.SIGKILL)
    server.wait_for("ended", how="cancel")
    run.wait_for(
        f"{GONE}: the server of /navigate_to_pose was requested to cancel the goal. The goal is cancelled"
    )


@pytest.mark.parametrize(
    "manner", ["ignore", *(pytest.param(manner, marks=pytest.mark.costly) for manner in ("refuse", "mute"))]
)
def test_unending_goal_is_reported_as_possible_motion(start_driving, manner):
    server, run = start_driving(cancel=manner)
    run.send(signal.SIGKILL)
    run.wait_for(
        f"{GONE}, and the server of /navigate_to_pose has not ended the goal. The robot may still be moving"
    )
    assert server.active == 1
    assert "was requested to cancel" not in run.output


def test_killed_guardian_is_replaced_and_new_one_knows_active_goal(start_driving):
    server, run = start_driving()
    (first,) = children_of(run.pid)
    os.kill(first, signal.SIGKILL)
    run.wait_for(REPLACED)
    run.send(signal.SIGKILL)
    server.wait_for("ended", how="cancel")
    run.wait_for(f"{GONE}: the server of /navigate_to_pose was requested")


def test_repeatedly_killed_guardian_is_not_replaced_and_mission_continues(start_driving):
    server, run = start_driving()
    for deaths in (1, 2, 3):
        (guardian,) = run.wait_until(lambda: children_of(run.pid), "a guardian")
        os.kill(guardian, signal.SIGKILL)
        run.wait_until(lambda deaths=deaths: count_deaths(run) == deaths, "the word of its end")
    run.wait_for(
        "the guardian process has ended again (by SIGKILL). No new guardian is started. Goals are no longer canceled if this process crashes"
    )
    assert children_of(run.pid) == []
    assert run.stop(within_sec=5.0) == 130, run.output
    server.wait_for("ended", how="cancel")
