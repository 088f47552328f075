"""Tests of the supervisor: it resumes a mission after any crash, and no survivor is lost, named twice or reported twice."""

import json
import logging
import os
import random
import signal
import threading
from contextlib import suppress

import pytest

from tests.faults.worlds import arguments, end, hold, world
from tests.processes import Command, children_of
from tests.trees import document

__all__ = ["world"]

pytestmark = pytest.mark.ros

# A process that is suspended before its first heartbeat is killed after a minute.
_STOPPED_SEC = 150.0
TREES = ("search_and_rescue", "search_and_rescue_resilient")
LEAVES = """
import os, pathlib, signal, time
from py_trees.behaviour import Behaviour
from py_trees.common import Status
from sar_compiler.leaves import Kind, register


@register("Misbehave", kind=Kind.ACTION)
class Misbehave(Behaviour):
    def __init__(self, name: str, times: int, how: str) -> None:
        super().__init__(name)
        self._times, self._how = times, how

    def update(self):
        count = pathlib.Path("count")
        lives = int(count.read_text()) if count.exists() else 0
        count.write_text(str(lives + 1))
        if self._how == "die before the report":
            from sar_compiler.reports.run_report import RunReport

            RunReport.write = lambda _: os.kill(os.getpid(), signal.SIGKILL)
            return Status.SUCCESS
        if lives >= self._times:
            return Status.SUCCESS
        print(f"life {lives + 1}", flush=True)
        if self._how == "block":
            time.sleep(600)
        os.kill(os.getpid(), getattr(signal, self._how))
        return Status.RUNNING
"""


@pytest.fixture
def misbehave(start, tmp_path, monkeypatch):
    """Return a function that starts a mission whose leaf misbehaves in its first lives."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "misbehaving.py").write_text(LEAVES, encoding="utf-8")

    def start_mission(times, how, *more):
        body = f'<Misbehave times="{times}" how="{how}"/>'
        (tmp_path / "tree.xml").write_text(document(body), encoding="utf-8")
        command = ("tree.xml", "--nodes", "misbehaving", "--until", "end", "--journal", "run.journal")
        return start("sar-run", *command, *more, env={"PYTHONPATH": str(tmp_path)})

    return start_mission


def show_journal():
    """Return the output of `sar-journal show`."""
    command = Command("sar-journal", "show", "run.journal")
    assert command.end() == 0
    return command.output


@pytest.mark.parametrize("how", ["SIGKILL", "SIGSEGV"])
def test_crashed_mission_is_resumed_and_reported(misbehave, how):
    run = misbehave(2, how, "--supervise")
    assert run.end() == 0, run.output
    for number in (1, 2):
        assert f"sar-run: the mission has crashed (by {how}) and is resumed ({number} of 3)" in run.output
    assert f"The supervisor restarted the mission 2 times: by {how}; by {how}." in run.output
    assert show_journal().count(f"by its supervisor (the previous process has died: by {how})") == 2


@pytest.mark.costly
def test_blocked_mission_is_killed_and_resumed(misbehave):
    run = misbehave(1, "block", "--supervise")
    assert run.end() == 0, run.output
    assert "the mission has crashed (no heartbeat for 10 s) and is resumed (1 of 3)" in run.output


@pytest.mark.costly
def test_suspended_mission_is_killed_and_resumed(misbehave):
    run = misbehave(1, "SIGSTOP", "--supervise", "1")
    assert run.end() == 0, run.output
    assert "(no heartbeat for 10 s) and is resumed (1 of 1)" in run.output


def test_mission_that_keeps_crashing_is_given_up_with_its_last_status(misbehave):
    run = misbehave(9, "SIGKILL", "--supervise", "1")
    assert run.end() == 128 + signal.SIGKILL, run.output
    assert "the mission has crashed (by SIGKILL) after 1 restarts" in run.output
    assert "life 2" in run.output
    assert "life 3" not in run.output


@pytest.mark.costly
def test_mission_with_missing_requirement_is_restarted(start, tmp_path):
    place = tmp_path / "run.journal"
    more = ("--supervise", 1, "--journal", place, "--ros-args", "-p", "startup_timeout_sec:=1.0")
    run = start("sar-run", *more)
    assert run.end() == 3, run.output
    assert "(exit status 3, because a requirement was missing) and is restarted (1 of 1)" in run.output
    assert run.output.count("not ready after") == 2


def test_stopped_mission_is_not_restarted(misbehave):
    run = misbehave(0, "SIGKILL", "--supervise", "--until", "failure")
    run.wait_for("starting again")
    assert run.stop(within_sec=5.0) == 130, run.output
    assert "has crashed" not in run.output


def test_supervisor_writes_reports_of_killed_process(misbehave, tmp_path):
    reports = ("--report", "run.html", "--report", "run.json")
    run = misbehave(0, "die before the report", "--supervise", *reports)
    assert run.end() == 0, run.output
    assert "has crashed" not in run.output
    assert json.loads((tmp_path / "run.json").read_text())["runs"]
    assert (tmp_path / "run.html").is_file()


def kill_after(run, child, seconds, how):
    """Send a signal to a run's process after some seconds."""

    def kill():
        with suppress(ProcessLookupError):
            os.kill(child, how)

    timer = threading.Timer(seconds, kill)
    timer.daemon = True
    timer.start()


def kill_repeatedly(run, chance, kills, hows=(signal.SIGKILL,)):
    """Kill the processes of a supervised mission at random times; return how often that happened before its end."""
    for number in range(1, kills + 1):
        found = run.wait_until(lambda: children_of(run.pid) or run.is_over, "a process")
        if run.is_over:
            return number - 1
        kill_after(run, found[0], chance.uniform(0.0, 6.0), chance.choice(hows))
        told = f"({number} of "
        run.wait_until(lambda told=told: told in run.output or run.is_over, "the next life", _STOPPED_SEC)
        if run.is_over and told not in run.output:
            return number - 1
    return kills


def run_supervised_mission(start, world, witness, place, seed, *, kills, hows):
    chance = random.Random(seed)  # noqa: S311 - as many as there are seeds
    base = world.base()
    run = start("sar-run", *arguments(place, chance.choice(TREES), "--supervise", kills))
    done = kill_repeatedly(run, chance, kills, hows)
    end(run)
    hold(witness(), base, place)
    return done


@pytest.mark.costly
def test_supervised_mission_killed_at_random_times_reaches_its_end(world, start, witness, tmp_path):
    run_supervised_mission(start, world, witness, tmp_path / "run.journal", 0, kills=3, hows=[signal.SIGKILL])


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(1, 13))
def test_supervised_mission_killed_or_suspended_reaches_its_end(world, start, witness, tmp_path, seed):
    hows = [*[signal.SIGKILL] * 4, signal.SIGSTOP]
    done = run_supervised_mission(start, world, witness, tmp_path / "run.journal", seed, kills=5, hows=hows)
    logging.getLogger(__name__).info("killed or stopped %d times", done)


def test_supervise_without_journal_is_refused(start):
    run = start("sar-run", "--supervise", "--journal", "none")
    assert run.end() == 2
    assert "--supervise resumes a mission from its journal: remove --journal none and --check" in run.output
