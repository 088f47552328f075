"""Tests of following a journal while another process writes it."""

import fcntl
from contextlib import closing

import pytest

from sar_compiler.journal.database import JournalFile
from sar_compiler.journal.errors import JournalError
from sar_compiler.journal.journal_entries import Ending
from sar_compiler.journal.journal_follower import _TRIES, JournalFollower
from sar_compiler.journal.journal_opening import open_journal


@pytest.fixture
def journal_path(tmp_path):
    return tmp_path / "mission.journal"


def kinds(follower):
    return [entry.kind for entry in follower.read_new()]


def test_each_entry_is_read_once_in_order(journal_path):
    follower = JournalFollower(journal_path)
    assert kinds(follower) == []
    journal = open_journal(journal_path)
    assert kinds(follower) == []
    journal.begin({}, {})
    journal.record_event("zone_visited", zone="zone_a")
    assert kinds(follower) == ["run_began", "zone_visited"]
    assert kinds(follower) == []
    journal.record_observation("pose", x=1.0)
    journal.record_event("base_reached")
    assert kinds(follower) == ["pose", "base_reached"]
    journal.end_run(Ending.OVER, 0)
    journal.close()
    assert kinds(follower) == ["run_ended"]
    assert kinds(follower) == []


def test_observation_before_first_event_is_read(journal_path):
    with closing(open_journal(journal_path)) as journal:
        journal.begin({}, {})
        journal.record_observation("pose", x=1.0)
        journal.end_run(Ending.OVER, 0)
    assert kinds(JournalFollower(journal_path)) == ["run_began", "pose", "run_ended"]


def test_next_run_is_followed(journal_path):
    follower = JournalFollower(journal_path)
    for resume in (False, True):
        journal = open_journal(journal_path, resume=resume)
        journal.begin({}, {})
        journal.end_run(Ending.STOPPED, 130)
        journal.close()
        assert kinds(follower) == ["run_began", "run_ended"]


def test_new_mission_in_same_file_is_read_from_its_beginning(journal_path):
    follower = JournalFollower(journal_path)
    for _ in range(2):
        journal = open_journal(journal_path, start_over=True)
        journal.begin({}, {})
        journal.record_event("zone_visited", zone="zone_a")
        journal.close()
        assert kinds(follower) == ["run_began", "zone_visited"]


def test_persistently_unreadable_file_raises_error(journal_path):
    journal_path.write_text("no journal", encoding="utf-8")
    follower = JournalFollower(journal_path)
    for _ in range(_TRIES - 1):
        assert follower.read_new() == []
    with pytest.raises(JournalError, match="damaged, or not a journal"):
        follower.read_new()


def test_temporarily_unreadable_file_is_read_later(journal_path):
    follower = JournalFollower(journal_path)
    for _ in range(_TRIES):
        journal_path.write_text("half a journal", encoding="utf-8")
        assert follower.read_new() == []
        journal_path.unlink()
        journal = open_journal(journal_path, start_over=True)
        journal.begin({}, {})
        assert kinds(follower) == ["run_began"]
        journal.close()
        journal_path.unlink()


def test_snapshot_does_not_contain_later_entries(journal_path):
    journal = open_journal(journal_path)
    journal.begin({}, {})
    with closing(JournalFile.read(journal_path)) as file:
        with file.snapshot():
            assert len(file.runs()) == 1
            journal.record_event("zone_visited", zone="zone_a")
            assert [entry.kind for entry in file.stream()] == ["run_began"]
        assert [entry.kind for entry in file.stream()] == ["run_began", "zone_visited"]
    journal.close()


def test_file_locked_by_starting_run_is_read_with_later_entries(journal_path):
    journal = open_journal(journal_path)
    journal.begin({}, {})
    journal.close()
    with journal_path.open("rb") as opened:
        fcntl.flock(opened, fcntl.LOCK_EX)
        file = JournalFile.read(journal_path)
    with closing(file):
        assert [*file.events()] == []
        again = open_journal(journal_path, resume=True)
        again.begin({}, {})
        again.record_event("zone_visited", zone="zone_a")
        assert [fact.kind for fact in file.events()] == ["zone_visited"]
        again.close()
