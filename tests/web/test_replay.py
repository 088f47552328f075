"""Tests of replays: their state at every time, requested in any order."""

import random
from contextlib import closing
from typing import Any

import pytest

from sar_compiler.journal.database import JournalFile
from sar_compiler.journal.journal_opening import open_journal
from sar_compiler.journal.mission_state import MissionState, RunProcess
from sar_compiler.runtime.clock import ManualClock
from sar_compiler.web import replay as replay_module
from sar_compiler.web.page_state import PageState
from sar_compiler.web.replay import Replay
from tests.web.folding import fly, folded


@pytest.fixture(autouse=True)
def checkpoints(monkeypatch):
    """Create checkpoints also in short journals."""
    monkeypatch.setattr(replay_module, "_MIN_ENTRIES", 9)


@pytest.fixture
def journal(tmp_path):
    """Return a journal of three runs, the last of which has crashed."""
    return write_journal(tmp_path / "mission.journal")


def write_journal(path, begin=100.0, count=120):
    for run in range(3):
        kept = open_journal(path, resume=run > 0)
        fly(kept, run, count, clock=ManualClock(begin - 20.0 * run), is_ended=run < 2)
        kept.close()
    return path


def timed_entries(path):
    """Return the entries of a journal, each with its time in the replay."""
    end = began = before = 0.0
    found = []
    with closing(JournalFile.read(path)) as file:
        for entry in file.stream():
            if entry.kind == "run_began":
                began, before = entry.time, end
            end = max(end, before + entry.time - began)
            found.append((end, entry))
    return found


def full_state(replay, time):
    """Return the state at a time for a page without earlier state."""
    (change,) = replay.moment(time, since=-1)["changes"]
    return folded({}, change)


def test_state_at_any_time_results_from_all_earlier_entries(journal):
    replay, told = Replay([journal]), timed_entries(journal)
    assert replay.end == told[-1][0]
    chance = random.Random(1)  # noqa: S311
    times = [chance.uniform(0.0, replay.end) for _ in range(40)] + [chance.choice(told)[0] for _ in range(40)]
    for time in [*times, 0.0, replay.end]:
        until = [entry for end, entry in told if end <= time]
        state = PageState()
        for entry in until:
            state.apply(entry)
        state.let_pass(time - max(end for end, _ in told if end <= time))
        state.set_process(RunProcess(is_gone=len(until) == len(told)))
        shown = full_state(replay, time)
        assert shown == folded({}, state.full_state())
        marks = MissionState.from_stream(until).situation.landmarks
        assert {key: each["state"] for key, each in shown["landmarks"].items()} == {
            "/".join(key): each.state for key, each in marks.items()
        }


def test_playing_page_receives_mostly_changes(journal):
    replay = Replay([journal])
    known: dict[str, Any] = {}
    since = larger = 0
    for step in range(101):
        time = replay.end * step / 100
        answer = replay.moment(time, since)
        for change in answer["changes"]:
            larger += "begin" in change
            known = folded(known, change)
        since = answer["number"]
        assert known == full_state(Replay([journal]), time)
    assert larger < 20


def test_pages_do_not_receive_changes_of_each_other(journal):
    replay = Replay([journal])
    first = replay.moment(10.0)
    replay.moment(11.0)
    (change,) = replay.moment(12.0, first["number"])["changes"]
    assert folded({}, change) == full_state(Replay([journal]), 12.0)


def test_robots_are_aligned_by_their_clocks(tmp_path):
    paths = [write_journal(tmp_path / f"robot{number}.journal", 100.0 + 5.0 * number) for number in range(2)]
    replay = Replay(paths)
    assert replay.end == timed_entries(paths[1])[-1][0] + 5.0
    first, second = replay.moment(20.0)["changes"]
    assert (first["robot"], second["robot"]) == (0, 1)
    assert folded({}, second) | {"robot": 0} == full_state(Replay(paths[1:]), 15.0)
    early = folded({}, replay.moment(3.0, -1)["changes"][1])
    assert (early["run"], early["time"]) == ({"number": 0}, 0.0)


def test_robots_with_clocks_days_apart_begin_together(tmp_path):
    paths = [write_journal(tmp_path / f"robot{number}.journal", 100.0 + 1e6 * number) for number in range(2)]
    assert Replay(paths).end == max(timed_entries(path)[-1][0] for path in paths)


def test_cause_of_failure_is_shown_only_at_end(journal):
    replay = Replay([journal], lambda path: {"why": path.name})
    assert full_state(replay, replay.end)["why"] == {"why": journal.name}
    assert full_state(replay, 7.0)["why"] is None


def test_replay_does_not_change_folder_of_journal(journal):
    before = {path: path.read_bytes() for path in journal.parent.iterdir() if path.is_file()}
    Replay([journal]).moment(5.0)
    assert {path: path.read_bytes() for path in journal.parent.iterdir() if path.is_file()} == before


def test_extended_journal_is_read_again(journal):
    before = Replay([journal])
    kept = open_journal(journal, resume=True)
    fly(kept, 9, 50, clock=ManualClock(1000.0))
    kept.close()
    assert Replay([journal]).end > before.end
    assert full_state(Replay([journal]), 1e9)["run"]["number"] == 4
    assert full_state(before, 1e9)["run"]["number"] == 3


def test_empty_journal_has_a_state(tmp_path):
    path = tmp_path / "empty.journal"
    JournalFile.open(path).close()
    replay = Replay([path])
    assert (replay.end, full_state(replay, 5.0)["run"]) == (0.0, {"number": 0})
