"""What another process writes to a journal is read as it comes."""

import pytest

from sar_compiler.journal.errors import JournalError
from sar_compiler.journal.following import JournalFollower
from sar_compiler.journal.journal_entries import Ending
from sar_compiler.journal.opening import open_journal


@pytest.fixture
def place(tmp_path):
    return tmp_path / "mission.journal"


def kinds(follower):
    return [entry.kind for entry in follower.news()]


def test_each_entry_comes_once_and_in_its_order(place):
    follower = JournalFollower(place)
    assert kinds(follower) == []
    journal = open_journal(place)
    assert kinds(follower) == []
    journal.begin({}, {})
    journal.note("zone_visited", zone="zone_a")
    assert kinds(follower) == ["run_began", "zone_visited"]
    assert kinds(follower) == []
    journal.watch("pose", x=1.0)
    journal.note("base_reached")
    assert kinds(follower) == ["pose", "base_reached"]
    journal.end(Ending.OVER, 0)
    journal.close()
    assert kinds(follower) == ["run_ended"]
    assert kinds(follower) == []


def test_the_next_run_follows(place):
    follower = JournalFollower(place)
    for resume in (False, True):
        journal = open_journal(place, resume=resume)
        journal.begin({}, {})
        journal.end(Ending.STOPPED, 130)
        journal.close()
        assert kinds(follower) == ["run_began", "run_ended"]


def test_another_mission_in_the_file_is_read_from_its_beginning(place):
    follower = JournalFollower(place)
    for _ in range(2):
        journal = open_journal(place, anew=True)
        journal.begin({}, {})
        journal.note("zone_visited", zone="zone_a")
        journal.close()
        assert kinds(follower) == ["run_began", "zone_visited"]


def test_what_is_no_journal_is_said(place):
    place.write_text("no journal", encoding="utf-8")
    with pytest.raises(JournalError, match="is it a journal"):
        JournalFollower(place).news()
