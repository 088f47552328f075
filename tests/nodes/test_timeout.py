"""Tests of the Timeout decorator, which uses the clock of the mission, and of the wall clock."""

import pytest
from py_trees.behaviours import Running, StatusQueue
from py_trees.common import Status

from sar_compiler.runtime.clock import ManualClock, WallClock
from sar_compiler.runtime.stock import Timeout


def test_timeout_stops_slow_child_and_fails():
    clock = ManualClock()
    child = Running("child")
    timeout = Timeout("t", child, duration=2.0, clock=clock)
    timeout.tick_once()
    clock.advance(2.1)
    timeout.tick_once()
    assert timeout.status == Status.FAILURE
    assert timeout.feedback_message == "timed out"
    assert child.status == Status.INVALID


def test_remaining_time_is_shown():
    clock = ManualClock()
    timeout = Timeout("t", Running("child"), duration=2.0, clock=clock)
    timeout.tick_once()
    clock.advance(0.5)
    timeout.tick_once()
    assert timeout.feedback_message == "remaining: 1.5s"


@pytest.mark.parametrize("status", [Status.SUCCESS, Status.FAILURE])
def test_timeout_returns_status_of_child_that_ends_late(status):
    clock = ManualClock()
    child = StatusQueue("child", queue=[Status.RUNNING, status], eventually=None)
    timeout = Timeout("t", child, duration=2.0, clock=clock)
    timeout.tick_once()
    clock.advance(5.0)
    timeout.tick_once()
    assert timeout.status is status


def test_timeout_restarts_with_every_activation():
    clock = ManualClock()
    timeout = Timeout("t", Running("child"), duration=2.0, clock=clock)
    statuses = []
    for _ in range(2):
        timeout.tick_once()
        statuses.append(timeout.status)
        clock.advance(3.0)
        timeout.tick_once()
        statuses.append(timeout.status)
    assert statuses == [Status.RUNNING, Status.FAILURE] * 2


def test_wall_clock_never_runs_backwards():
    clock = WallClock()
    assert clock.now() <= clock.now()
