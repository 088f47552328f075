"""Tests of the harness: both sides of a ratio are warmed up alike, and inconsistent measurements are refused."""

import signal
import sys
import time
from collections.abc import Callable

import pytest

from benchmarks import commands, driver, figures, running
from benchmarks.figures import Effort, UnmeasurableError, compared_calls, enough_calls, measured
from benchmarks.rows import Benchmark, Limit, Measured, MissedError, Result, Row

CALL_SEC = 0.001
FIRST_CALL_SEC = 1000 * CALL_SEC


class Clocked:
    """Calls with given durations, so that no test depends on the load of the machine.

    Args:
        seconds: The seconds of a call, by its number from 0.
    """

    def __init__(self, seconds: Callable[[int], float]) -> None:
        self._seconds = seconds
        self.calls = 0
        self.counts: list[int] = []

    def __call__(self, count: int) -> float:
        taken = sum(self._seconds(self.calls + each) for each in range(count))
        self.calls += count
        self.counts.append(count)
        return taken / count


def first_is_slow(number):
    return FIRST_CALL_SEC if number == 0 else CALL_SEC


def test_slow_first_call_of_peer_does_not_change_ratio():
    ours, peer = Clocked(lambda _: CALL_SEC), Clocked(first_is_slow)
    found = compared_calls(ours, peer, 8)
    assert (found.ratio, found.ours, found.theirs) == pytest.approx((1.0, CALL_SEC, CALL_SEC))
    # The first call is not timed, so all timed calls are like ours.
    assert ours.counts[-8:] == peer.counts[-8:]
    assert min(peer.counts[-8:]) * CALL_SEC >= 0.05


def test_slow_first_tick_of_process_does_not_change_ratio(tmp_path):
    peer = tmp_path / "peer.py"
    peer.write_text(
        "import json, sys\n"
        "ticks = 0\n"
        "for line in sys.stdin:\n"
        "    command, argument = json.loads(line)\n"
        "    count = argument if command == 'tick' else 1\n"
        f"    taken = sum({FIRST_CALL_SEC} if ticks + each == 0 else {CALL_SEC} for each in range(count))\n"
        "    ticks += count * (command == 'tick')\n"
        "    print(json.dumps(taken / count), flush=True)\n",
        encoding="utf-8",
    )
    process = driver.Driver([sys.executable, peer])
    try:
        found = compared_calls(Clocked(lambda _: 2 * CALL_SEC), process.tick, 4)
    finally:
        process.close()
    assert found.ratio == pytest.approx(2.0)


def test_number_of_calls_ignores_first_call():
    assert enough_calls(Clocked(first_is_slow)) >= 50
    # With the first call, one call would have been enough.
    assert FIRST_CALL_SEC >= 0.05


def test_both_sides_of_ratio_use_the_larger_number_of_calls():
    fast, slow = Clocked(lambda _: 0.0001), Clocked(lambda _: 0.01)
    assert compared_calls(fast, slow, 4).ratio == pytest.approx(0.01)
    assert {*fast.counts[-4:]} == {*slow.counts[-4:]}
    assert fast.counts[-1] * 0.0001 >= 0.05


def test_differing_halves_are_measured_again_and_then_refused():
    # Each half of four rounds is twice as slow as the previous half.
    rounds = iter(range(1000))
    with pytest.raises(UnmeasurableError, match=r"the two halves differ by a factor of 2\.0, in 4 attempts"):
        measured(lambda: (float(2 ** (next(rounds) // 2 % 2 + 1)),), 4)
    assert next(rounds) == 4 * figures.ATTEMPTS


def test_consistent_later_attempt_is_used():
    values = iter([1.0, 9.0, 5.0, 5.0])
    assert measured(lambda: (next(values),), 2) == [(5.0,), (5.0,)]


def test_differing_halves_of_reference_refuse_the_ratio():
    slower = iter(range(1, 1000))
    with pytest.raises(UnmeasurableError, match="halves differ"):
        measured(lambda: (1.0, 10.0 ** next(slower)), 2)


def test_zero_measurement_is_refused():
    with pytest.raises(UnmeasurableError, match="it does not work"):
        measured(lambda: (0.0,), 2)


def row_of(measure, what="it"):
    return Row(what, (Limit(1.0, "s CPU"),), "by hand", measure)


def raises(error):
    def measure(_stage, _effort):
        raise error

    return measure


@pytest.fixture
def measuring(monkeypatch):
    def measure(*rows, set_up=lambda _effort: commands_stage()):
        monkeypatch.setattr(running, "BENCHMARKS", {"own": Benchmark(rows, set_up)})
        return running.measure_rows("own", Effort(2, 0.01))

    return measure


def commands_stage():
    from contextlib import nullcontext

    return nullcontext()


def test_failing_row_does_not_stop_other_rows(measuring, capsys):
    results, is_failed = measuring(
        row_of(raises(RuntimeError("no such file")), "one"),
        row_of(raises(UnmeasurableError("the two halves differ")), "two"),
        row_of(raises(MissedError("not decided")), "three"),
        row_of(lambda *_: Measured((0.5,), "as ever"), "four"),
    )
    assert results == {
        "one": Result(note="it failed: RuntimeError: no such file"),
        "two": Result(note="the two halves differ"),
        "three": Result(note="not decided", is_missed=True),
        "four": Result((0.5,), "as ever"),
    }
    assert is_failed
    assert "  four: met: 500 ms CPU (as ever) [" in capsys.readouterr().out


def test_unmeasurable_row_is_not_a_failure(measuring):
    assert measuring(row_of(raises(UnmeasurableError("it is not installed"))))[1] is False


def test_set_up_error_is_reported_for_each_row(measuring):
    results, is_failed = measuring(
        row_of(lambda *_: Measured((0.5,))), set_up=raises_on_set_up(UnmeasurableError("there is no ROS 2"))
    )
    assert (results, is_failed) == ({"it": Result(note="there is no ROS 2")}, False)
    results, is_failed = measuring(
        row_of(lambda *_: Measured((0.5,))), set_up=raises_on_set_up(OSError("no space left"))
    )
    assert (results, is_failed) == ({"it": Result(note="it failed: OSError: no space left")}, True)


def raises_on_set_up(error):
    def set_up(_effort):
        raise error

    return set_up


def test_row_over_time_limit_is_aborted(measuring, monkeypatch):
    monkeypatch.setattr(running, "_ROW_SEC", 1)

    def endless(_stage, _effort):
        while True:
            pass

    results, is_failed = measuring(row_of(endless))
    assert (results["it"].note, is_failed) == ("it failed: TimeoutError: not done in 1 s", True)


def test_table_has_at_most_35_rows_each_with_a_goal():
    assert len(running.ROWS) <= 35
    assert len({row.what for row in running.ROWS}) == len(running.ROWS)
    assert all(row.limits and row.how for row in running.ROWS)


def test_cost_of_command_includes_child_processes():
    size = 80_000_000
    child = f"import time; kept = b'x' * {size}; end = time.process_time() + 0.2\nwhile time.process_time() < end: pass"
    parent = f"import subprocess, sys; subprocess.run([sys.executable, '-c', {child!r}]); print('done')"
    cost = commands.run([sys.executable, "-c", parent])
    assert cost.printed == "done\n"
    assert cost.cpu >= 0.2
    assert cost.passed >= 0.2
    # The memory of this process is not counted.
    assert size / 1e6 < cost.memory < 2 * size / 1e6


def test_failing_command_is_reported_with_its_last_line():
    with pytest.raises(UnmeasurableError, match=r"python\S* -c ended with 3: no world"):
        commands.run([sys.executable, "-c", "import sys; print('no world', file=sys.stderr); sys.exit(3)"])


@pytest.mark.costly
def test_figures_without_driver_are_seconds_without_ratio(monkeypatch):
    from benchmarks import ticks

    monkeypatch.delenv(driver.VARIABLE, raising=False)
    with (
        ticks.set_up(Effort(2, 0.01)) as stage,
        pytest.raises(
            UnmeasurableError, match=r"no ratio, BTCPP_DRIVER names no driver; a tick takes: a [\d.]+ .?s"
        ),
    ):
        stage.compare({"a": "<AlwaysSuccess/>"}, 2)


def test_command_of_aborted_row_is_killed(tmp_path):
    begun, start = tmp_path / "begun", time.monotonic()
    endless = f"import time; open({str(begun)!r}, 'w').close(); time.sleep(600)"

    def give_up(*_):
        if begun.exists():
            raise TimeoutError

    before = signal.signal(signal.SIGALRM, give_up)
    signal.setitimer(signal.ITIMER_REAL, 0.1, 0.1)
    try:
        # run() reads the pipe to its end, so it cannot return while the process lives.
        with pytest.raises(TimeoutError):
            commands.run([sys.executable, "-c", endless])
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)
    assert time.monotonic() - start < 300
