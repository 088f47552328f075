"""A guardian says what it has seen of the goals of a mission that has died, and one that dies itself is replaced."""

import os
import re
import signal

import pytest

from tests.processes import children_of

pytestmark = pytest.mark.ros

GONE = "the mission's process has ended"
REPLACED = "the guardian process has ended unexpectedly (by SIGKILL). A new guardian is started"


def told_deaths(run):
    return len(re.findall("the guardian process has ended", run.output))


@pytest.fixture
def driving(serve, fly):
    """Start a mission with a guardian, and wait until its first goal is under way."""

    def start_mission(**manner):
        server = serve("navigation", goals=[{"drive": None, **manner}])
        run = fly("--guardian")
        server.wait_for("accepted")
        return server, run

    return start_mission


def test_it_waits_for_the_end_of_the_goal_that_it_has_cancelled(driving):
    server, run = driving()
    run.send(signal.SIGKILL)
    server.wait_for("ended", how="cancel")
    run.wait_for(
        f"{GONE}: the server of /navigate_to_pose was requested to cancel the goal. The goal is cancelled"
    )


@pytest.mark.parametrize(
    "manner", ["ignore", *(pytest.param(manner, marks=pytest.mark.costly) for manner in ("refuse", "mute"))]
)
def test_a_goal_that_does_not_end_is_told_to_be_under_way(driving, manner):
    server, run = driving(cancel=manner)
    run.send(signal.SIGKILL)
    run.wait_for(
        f"{GONE}, and the server of /navigate_to_pose has not ended the goal. The robot may still be moving"
    )
    assert server.active == 1
    assert "was requested to cancel" not in run.output


def test_one_that_is_killed_is_replaced_and_the_new_one_knows_the_goal_under_way(driving):
    server, run = driving()
    (first,) = children_of(run.pid)
    os.kill(first, signal.SIGKILL)
    run.wait_for(REPLACED)
    run.send(signal.SIGKILL)
    server.wait_for("ended", how="cancel")
    run.wait_for(f"{GONE}: the server of /navigate_to_pose was requested")


def test_one_that_cannot_live_is_given_up_and_the_mission_goes_on(driving):
    server, run = driving()
    for deaths in (1, 2, 3):
        (guardian,) = run.wait_until(lambda: children_of(run.pid), "a guardian")
        os.kill(guardian, signal.SIGKILL)
        run.wait_until(lambda deaths=deaths: told_deaths(run) == deaths, "the word of its end")
    run.wait_for(
        "the guardian process has ended again (by SIGKILL). No new guardian is started. Goals are no longer canceled if this process crashes"
    )
    assert children_of(run.pid) == []
    assert run.stop(within_sec=5.0) == 130, run.output
    server.wait_for("ended", how="cancel")
