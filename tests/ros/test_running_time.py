"""Tests of counting the time in which a process ran, without ROS."""

import time

import pytest

from sar_compiler.ros.clock import AwakeTime


class Machine:
    """A process on a machine whose clock the test advances."""

    def __init__(self, monkeypatch):
        self.steady_sec, self.said, self.awake = 7.0, [], AwakeTime()
        monkeypatch.setattr(time, "monotonic", lambda: self.steady_sec)

    def passes(self, seconds, step_sec):
        """Return the time counted while the process polls every *step_sec*."""
        before = self.awake.now()
        for _ in range(round(seconds / step_sec)):
            self.steady_sec += step_sec
            self.awake.now()
        return self.awake.now() - before


@pytest.fixture
def machine(monkeypatch):
    return Machine(monkeypatch)


def test_time_is_counted_while_process_runs(machine):
    with machine.awake.mark_polling(machine.said.append):
        assert machine.passes(60.0, 0.5) == pytest.approx(60.0)
    assert machine.said == []


def test_suspension_and_recovery_are_not_counted_and_suspension_is_logged(
    machine,
):
    with machine.awake.mark_polling(machine.said.append):
        assert machine.passes(12.0, 12.0) == pytest.approx(0.0)
        assert machine.passes(5.0, 0.5) == pytest.approx(0.0)
        assert machine.passes(10.0, 0.5) == pytest.approx(10.0)
    (line,) = machine.said
    assert line.startswith("This process was suspended for 12.0 s ")


def test_repeated_suspensions_have_limited_recovery_time_and_log(machine):
    with machine.awake.mark_polling(machine.said.append):
        machine.passes(3.0, 3.0)
        machine.passes(10.0, 0.5)
        assert machine.passes(3.0, 3.0) == pytest.approx(0.0)
        assert machine.passes(5.0, 0.5) == pytest.approx(5.0)
        machine.passes(70.0, 0.5)
        machine.passes(3.0, 3.0)
    assert len(machine.said) == 2


def test_suspension_is_not_detected_without_polling(machine):
    assert machine.passes(30.0, 30.0) == pytest.approx(30.0)
