"""Tests of the budgets of analyses: a command ends within its limits, or at the first Ctrl-C, and shows its partial result."""

import itertools
import json
import re
import signal
import subprocess
import sys
import threading
import time

import pytest

from sar_compiler.budget import Budget, BudgetSpentError, memory_mb, memory_now_mb
from tests.processes import BIN, Command, processor_sec
from tests.waiting import News

SAR_COMPILE = BIN / "sar-compile"
SHORT_LIMIT = ("--max-seconds", "0.3")
COUNTER = (
    '<Sequence><Script code="n := 0"/><KeepRunningUntilFailure><Sequence><Script code="n += 1"/>'
    '<ScriptCondition code="n &lt; 1000000000"/><Sleep msec="10"/></Sequence></KeepRunningUntilFailure></Sequence>'
)
NESTED = '<Repeat num_cycles="1000000">' * 2 + "<AlwaysSuccess/>" + "</Repeat>" * 2
WAITS = (
    '<Delay delay_msec="2000000000"><Timeout msec="2000000000"><Sleep msec="1999999999"/></Timeout></Delay>'
)
WIDE = "<Sequence>" + "<AlwaysSuccess/>" * 10_000 + "</Sequence>"
RANDOM_LEAVES = "<Sequence>" + "<AnyLeaf/>" * 3 + COUNTER + "</Sequence>"
TREES = {"counter": COUNTER, "nested": NESTED, "waits": WAITS, "wide": WIDE, "chance": RANDOM_LEAVES}
MODEL = '<TreeNodesModel><Action ID="AnyLeaf"/></TreeNodesModel>'


@pytest.fixture(scope="module")
def trees(tmp_path_factory):
    folder = tmp_path_factory.mktemp("trees")
    for name, body in TREES.items():
        text = f'<root BTCPP_format="4"><BehaviorTree ID="T">{body}</BehaviorTree>{MODEL}</root>'
        folder.joinpath(f"{name}.xml").write_text(text, encoding="utf-8")
    return folder


def run(*words):
    """Run a command in its own process, because abandoned work continues; return its status and its output."""
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    return done.returncode, done.stdout, done.stderr


EXPLODING = [
    *itertools.product(["verify"], ["counter", "nested", "waits", "chance"]),
    *itertools.product(["predict"], ["nested", "waits", "chance", "wide"]),
    *itertools.product(["validate", "show", "diff"], ["wide"]),
]


@pytest.mark.parametrize(("command", "name"), EXPLODING)
def test_analysis_of_exploding_tree_ends_with_documented_status(trees, command, name):
    more = {
        "diff": [trees / "counter.xml"],
        "simulate": ["--ticks", "1000000000"],
        "validate": ["--deep", "1000"],
    }
    status, out, err = run(SAR_COMPILE, command, trees / f"{name}.xml", *more.get(command, ()), *SHORT_LIMIT)
    assert status in (0, 1)
    assert "Traceback" not in err
    assert out or re.search("there is no result yet|no prediction is possible: .* --period", err)
    if "raise the limit" in err:
        assert status == 1


def test_stopped_prediction_reports_bounds_and_reason(trees):
    status, out, err = run(SAR_COMPILE, "predict", trees / "counter.xml", "--format", "json", *SHORT_LIMIT)
    found = json.loads(out)
    assert (status, found["success"], found["stopped"]) == (1, {"low": 0.0, "high": 1.0}, True)
    assert found["states"] > 0
    assert err == "sar-compile: stopped after 0.3 s. Raise the limit with --max-seconds\n"


def test_verification_at_memory_limit_has_no_result(trees):
    status, _, err = run(SAR_COMPILE, "verify", trees / "counter.xml", "--max-memory", "1")
    assert status == 1
    assert (
        err
        == "sar-compile: there is no result yet, because the analysis was stopped at 1 MB of memory. Raise the limit with --max-memory\n"
    )


def test_stopped_simulation_shows_its_ticks(trees):
    words = ("simulate", trees / "counter.xml", "--ticks", "1000000000")
    status, out, err = run(SAR_COMPILE, *words, *SHORT_LIMIT)
    assert status == 1
    assert out.startswith("tick 1, 0 s: root RUNNING\n")
    assert err == (
        "sar-compile: stopped after 0.3 s. Raise the limit with --max-seconds (1 of 1 scenarios were started)\n"
    )


@pytest.mark.parametrize("jobs", ["1", "2"])
def test_stopped_sweep_of_endless_runs_shows_its_table(trees, tmp_path, jobs):
    scenario = tmp_path / "s.yaml"
    scenario.write_text("ticks: 1000000000\n", encoding="utf-8")
    given = trees / "chance.xml", "--scenario", scenario, "--unusual", "0.1", "--jobs", jobs
    status, out, err = run(SAR_COMPILE, "sweep", *given, *SHORT_LIMIT)
    assert status == 1
    assert "0.0 to 100.0" in out
    assert err.endswith("sweep: stopped after 0.3 s. Raise the limit with --max-seconds\n")


def test_stopped_validation_reports_number_of_unchecked_files(trees):
    files = [trees / f"{name}.xml" for name in ("waits", "counter", "nested")]
    status, _, err = run(SAR_COMPILE, "validate", *files, "--deep", "1000", *SHORT_LIMIT)
    assert status == 1
    assert err.endswith(
        "sar-compile: stopped after 0.3 s. Raise the limit with --max-seconds (2 files not checked)\n"
    )


@pytest.mark.parametrize(
    "words",
    [
        ("predict", "nested.xml", "--max-states", "100000000"),
        ("simulate", "counter.xml", "--ticks", "1000000000"),
        ("validate", "counter.xml", "--deep", "1000"),
    ],
    ids=lambda words: words[0],
)
def test_first_ctrl_c_ends_analysis_with_partial_result(trees, words):
    name, tree, *more = words
    command = Command("sar-compile", name, trees / tree, *more)
    try:
        command.wait_until(lambda: processor_sec(command.pid) > 0.7, "0.7 s of work")
        assert command.stop(within_sec=4.0) == 130
        assert "sar-compile: stopped by Ctrl-C" in command.output
        assert len(command.output.splitlines()) > 1 or name == "validate"
    finally:
        command.kill()


class TestBudget:
    def test_result_of_work_is_returned_and_its_error_raised(self):
        assert Budget().run(lambda: 7) == 7
        with pytest.raises(ZeroDivisionError):
            Budget().run(lambda: 1 / 0)

    def test_endless_work_is_abandoned_and_last_published_result_returned(self):
        budget, is_over = Budget(0.2, patience_sec=0.0, clock=time.monotonic), threading.Event()

        def work():
            budget.publish(lambda: 1)
            budget.publish(lambda: 2)
            is_over.wait()

        assert budget.run(work) == 2
        is_over.set()
        assert budget.exit_status == 1

    @pytest.mark.unmeasured
    def test_thread_of_abandoned_work_ends(self):
        if sys.gettrace() is not None:
            pytest.skip("under a tracer, the work continues")

        def work():
            while True:
                sum(range(100))

        with pytest.raises(BudgetSpentError):
            Budget(0.1, patience_sec=0.0).run(work)
        news = News()
        with news:
            news.wait_until(
                lambda: all(each.name != "analysis" for each in threading.enumerate()),
                lambda: "the thread is still running",
            )

    def test_current_memory_decreases_after_release(self):
        before = memory_now_mb()
        held = bytearray(b"x") * 100_000_000
        assert memory_now_mb() > before + 90
        del held
        assert memory_now_mb() < before + 50

    def test_abandoned_work_without_published_result_raises_error_with_reason(self):
        budget, is_over = Budget(0.0, patience_sec=0.0), threading.Event()
        with pytest.raises(
            BudgetSpentError,
            match=r"there is no result yet, because the analysis was stopped after 0 s\. Raise the limit with --max-seconds",
        ):
            budget.run(is_over.wait)
        is_over.set()

    def test_work_that_polls_budget_may_finish_within_patience(self):
        budget = Budget(0.0, patience_sec=1000.0)

        def work():
            while not budget.is_spent():
                pass
            return "in order"

        assert budget.run(work) == "in order"

    def test_work_far_above_memory_limit_is_abandoned_at_once(self):
        budget, is_over = Budget(max_memory_mb=memory_mb() / 2, patience_sec=1000.0), threading.Event()
        with pytest.raises(BudgetSpentError, match=r"MB of memory\. Raise the limit with --max-memory"):
            budget.run(is_over.wait)
        is_over.set()

    def test_first_ctrl_c_sets_reason_and_second_ends_wait(self):
        budget, is_over = Budget(patience_sec=1000.0), threading.Event()

        def work():
            signal.raise_signal(signal.SIGINT)
            while not budget.is_interrupted:
                pass
            signal.raise_signal(signal.SIGINT)
            is_over.wait()

        with pytest.raises(KeyboardInterrupt):
            budget.run(work)
        is_over.set()
        assert (budget.exit_status, budget.reason) == (130, "stopped by Ctrl-C")

    def test_work_starts_once_even_if_ctrl_c_interrupts_its_start(self, monkeypatch):
        starts = []
        start = threading.Thread.start

        def interrupted(thread):
            starts.append(thread)
            if len(starts) == 1:
                start(thread)
                # As if Ctrl-C had come before the new thread set its identifier.
                thread._ident = None
                raise KeyboardInterrupt
            raise AssertionError("the thread is started again")

        monkeypatch.setattr(threading.Thread, "start", interrupted)
        budget, is_over = Budget(patience_sec=0.1), threading.Event()
        with pytest.raises(BudgetSpentError, match="stopped by Ctrl-C"):
            budget.run(is_over.wait)
        is_over.set()
        assert len(starts) == 1
