"""The time in which a process ran, without ROS."""

import time

import pytest

from sar_compiler.ros.clock import AwakeTime


class Machine:
    """A process whose machine's clock is moved by hand."""

    def __init__(self, monkeypatch):
        self.steady_sec, self.said, self.awake = 7.0, [], AwakeTime()
        monkeypatch.setattr(time, "monotonic", lambda: self.steady_sec)

    def passes(self, seconds, step_sec):
        """Return what counts while the process is turned every *step_sec*."""
        before = self.awake.now()
        for _ in range(round(seconds / step_sec)):
            self.steady_sec += step_sec
            self.awake.now()
        return self.awake.now() - before


@pytest.fixture
def machine(monkeypatch):
    return Machine(monkeypatch)


def test_time_counts_as_it_passes_while_the_process_runs(machine):
    with machine.awake.mark_polling(machine.said.append):
        assert machine.passes(60.0, 0.5) == pytest.approx(60.0)
    assert machine.said == []


def test_a_standstill_and_the_seconds_to_hear_others_again_count_nothing_and_it_is_said_with_its_length(
    machine,
):
    with machine.awake.mark_polling(machine.said.append):
        assert machine.passes(12.0, 12.0) == pytest.approx(0.0)
        assert machine.passes(5.0, 0.5) == pytest.approx(0.0)
        assert machine.passes(10.0, 0.5) == pytest.approx(10.0)
    (line,) = machine.said
    assert line.startswith("This process was suspended for 12.0 s ")


def test_who_stands_still_again_and_again_is_named_and_spared_once_in_a_while(machine):
    with machine.awake.mark_polling(machine.said.append):
        machine.passes(3.0, 3.0)
        machine.passes(10.0, 0.5)
        assert machine.passes(3.0, 3.0) == pytest.approx(0.0)
        assert machine.passes(5.0, 0.5) == pytest.approx(5.0)
        machine.passes(70.0, 0.5)
        machine.passes(3.0, 3.0)
    assert len(machine.said) == 2


def test_who_does_not_turn_an_executor_stands_still_at_no_time(machine):
    assert machine.passes(30.0, 30.0) == pytest.approx(30.0)
