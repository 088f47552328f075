"""Replays: every moment of them, in whatever order it is asked for."""

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
    """Have checkpoints in short journals."""
    monkeypatch.setattr(replay_module, "_MIN_ENTRIES", 9)


@pytest.fixture
def journal(tmp_path):
    """Write a journal of three runs, the last of which broke off."""
    return written(tmp_path / "mission.journal")


def written(path, begin=100.0, count=120):
    for run in range(3):
        kept = open_journal(path, resume=run > 0)
        fly(kept, run, count, clock=ManualClock(begin - 20.0 * run), is_ended=run < 2)
        kept.close()
    return path


def steps(path):
    """Return the entries of a journal, each with the time of the replay at which it happens."""
    end = began = before = 0.0
    found = []
    with closing(JournalFile.read(path)) as file:
        for entry in file.stream():
            if entry.kind == "run_began":
                began, before = entry.time, end
            end = max(end, before + entry.time - began)
            found.append((end, entry))
    return found


def whole(replay, time):
    """Return what a page shows at a time that it has not asked for before."""
    (change,) = replay.moment(time, since=-1)["changes"]
    return folded({}, change)


def test_every_moment_is_what_all_entries_until_then_come_to(journal):
    replay, told = Replay([journal]), steps(journal)
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
        shown = whole(replay, time)
        assert shown == folded({}, state.full_state())
        marks = MissionState.from_stream(until).situation.landmarks
        assert {key: each["state"] for key, each in shown["landmarks"].items()} == {
            "/".join(key): each.state for key, each in marks.items()
        }


def test_a_page_that_plays_is_told_the_changes_alone(journal):
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
        assert known == whole(Replay([journal]), time)
    assert larger < 20


def test_of_two_pages_none_is_told_the_changes_of_the_other(journal):
    replay = Replay([journal])
    first = replay.moment(10.0)
    replay.moment(11.0)
    (change,) = replay.moment(12.0, first["number"])["changes"]
    assert folded({}, change) == whole(Replay([journal]), 12.0)


def test_robots_are_side_by_side_by_their_clocks(tmp_path):
    paths = [written(tmp_path / f"robot{number}.journal", 100.0 + 5.0 * number) for number in range(2)]
    replay = Replay(paths)
    assert replay.end == steps(paths[1])[-1][0] + 5.0
    first, second = replay.moment(20.0)["changes"]
    assert (first["robot"], second["robot"]) == (0, 1)
    assert folded({}, second) | {"robot": 0} == whole(Replay(paths[1:]), 15.0)
    early = folded({}, replay.moment(3.0, -1)["changes"][1])
    assert (early["run"], early["time"]) == ({"number": 0}, 0.0)


def test_robots_whose_clocks_are_days_apart_begin_together(tmp_path):
    paths = [written(tmp_path / f"robot{number}.journal", 100.0 + 1e6 * number) for number in range(2)]
    assert Replay(paths).end == max(steps(path)[-1][0] for path in paths)


def test_why_the_run_has_failed_is_shown_at_its_end_alone(journal):
    replay = Replay([journal], lambda path: {"why": path.name})
    assert whole(replay, replay.end)["why"] == {"why": journal.name}
    assert whole(replay, 7.0)["why"] is None


def test_the_journal_s_folder_is_left_as_it_was(journal):
    before = {path: path.read_bytes() for path in journal.parent.iterdir() if path.is_file()}
    Replay([journal]).moment(5.0)
    assert {path: path.read_bytes() for path in journal.parent.iterdir() if path.is_file()} == before


def test_a_journal_that_went_on_is_read_again(journal):
    before = Replay([journal])
    kept = open_journal(journal, resume=True)
    fly(kept, 9, 50, clock=ManualClock(1000.0))
    kept.close()
    assert Replay([journal]).end > before.end
    assert whole(Replay([journal]), 1e9)["run"]["number"] == 4
    assert whole(before, 1e9)["run"]["number"] == 3


def test_an_empty_journal_has_a_moment(tmp_path):
    path = tmp_path / "empty.journal"
    JournalFile.open(path).close()
    replay = Replay([path])
    assert (replay.end, whole(replay, 5.0)["run"]) == (0.0, {"number": 0})
