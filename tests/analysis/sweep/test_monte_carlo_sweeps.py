"""Tests of Monte Carlo sweeps: when rows end, and that workers, order and crashes do not matter."""

import threading
from concurrent.futures import Executor, Future
from random import Random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sar_compiler.analysis.sweep import StoppingRule, SweepError, SweepRow, smallest_failure, sweep
from sar_compiler.analysis.sweep.workers import ReplaceableExecutor, worker_processes
from tests.analysis.sweep.run_functions import EndsItsWorker, all_succeed, odd_ones_fail


def ignore(_rows):
    pass


def run_sweep(rule, workers, seed=0, plays=(odd_ones_fail, all_succeed)):
    rows = [SweepRow({"row": str(number)}, play) for number, play in enumerate(plays)]
    with workers:
        sweep(rows, rule, seed, workers, ignore)
    return [row.outcomes for row in rows]


class RandomOrderExecutor(Executor):
    """Executes submitted calls in random order, in its own thread."""

    def __init__(self, random):
        self._random, self._todo, self._open = random, [], True
        self._news = threading.Condition()
        threading.Thread(target=self._work, daemon=True).start()

    def submit(self, fn, /, *arguments):  # type: ignore[override]
        future: Future[object] = Future()
        with self._news:
            self._todo.append((future, fn, arguments))
            self._news.notify()
        return future

    def shutdown(self, **_):  # type: ignore[override]
        with self._news:
            self._open = False
            self._news.notify()

    def _work(self):
        while True:
            with self._news:
                self._news.wait_for(lambda: self._todo or not self._open)
                if not self._open:
                    return
                future, fn, arguments = self._todo.pop(self._random.randrange(len(self._todo)))
            future.set_result(fn(*arguments))


def test_row_is_played_until_interval_is_narrow_enough():
    rule = StoppingRule(runs=1000, half_width=0.05, batch=10)
    half, whole = run_sweep(rule, worker_processes(1))
    assert rule.interval(half).half_width <= 0.05 < rule.interval(half[:-10]).half_width
    assert len(whole) == 40


def test_row_ends_after_maximum_number_of_runs():
    outcomes = run_sweep(StoppingRule(runs=25, half_width=0.0, batch=10), worker_processes(1))
    assert [len(each) for each in outcomes] == [25, 25]


def test_runs_of_row_have_consecutive_seeds():
    first, _ = run_sweep(StoppingRule(runs=5, half_width=0.0, batch=2), worker_processes(1), seed=7)
    assert [each.seed for each in first] == [7, 8, 9, 10, 11]


@given(st.integers(0, 99), st.integers(1, 8), st.integers(1, 30), st.sampled_from([0.0, 0.1, 0.2]))
def test_table_does_not_depend_on_completion_order(seed, count, batch, half_width):
    rule = StoppingRule(runs=100, half_width=half_width, batch=batch)
    workers = ReplaceableExecutor(lambda: RandomOrderExecutor(Random(seed)), count)  # noqa: S311 - no secret
    assert run_sweep(rule, workers) == run_sweep(rule, worker_processes(1))


def test_worker_processes_give_same_table_as_this_process():
    rule = StoppingRule(runs=60, half_width=0.12, batch=7)
    assert run_sweep(rule, worker_processes(2)) == run_sweep(rule, worker_processes(1))


@pytest.mark.parametrize("times", [1, 3])
def test_killed_worker_does_not_change_result(tmp_path, times):
    rule = StoppingRule(runs=40, half_width=0.0, batch=10)
    (killed,) = run_sweep(rule, worker_processes(2), plays=[EndsItsWorker(tmp_path, times)])
    (whole,) = run_sweep(rule, worker_processes(1), plays=[odd_ones_fail])
    assert len(list(tmp_path.iterdir())) >= times
    assert killed == whole


def test_runs_that_kill_every_worker_end_sweep(tmp_path):
    with pytest.raises(
        SweepError,
        match="worker processes have terminated 4 times during the runs with seeds 0 to 9 of row 0",
    ):
        run_sweep(StoppingRule(10, 0.0, batch=10), worker_processes(2), plays=[EndsItsWorker(tmp_path, 99)])


def test_exception_in_run_ends_sweep():
    def refuse(_seeds):
        message = "this cannot be played"
        raise ValueError(message)

    with pytest.raises(ValueError, match="this cannot be played"):
        run_sweep(StoppingRule(10, 0.0), worker_processes(1), plays=[refuse])


def test_smallest_failure_has_smallest_size():
    rows = [
        SweepRow({}, odd_ones_fail, odd_ones_fail([9, 8, 3])),
        SweepRow({}, odd_ones_fail, odd_ones_fail([5, 0])),
    ]
    found = smallest_failure(rows)
    assert found is not None
    assert (found[0], found[1].seed) == (rows[0], 3)
    assert smallest_failure([SweepRow({}, all_succeed, all_succeed([1]))]) is None
