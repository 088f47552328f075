"""What another process writes to a journal is read as it comes."""

import fcntl
from contextlib import closing

import pytest

from sar_compiler.journal.database import JournalFile
from sar_compiler.journal.errors import JournalError
from sar_compiler.journal.journal_entries import Ending
from sar_compiler.journal.journal_follower import _TRIES, JournalFollower
from sar_compiler.journal.journal_opening import open_journal


@pytest.fixture
def place(tmp_path):
    return tmp_path / "mission.journal"


def kinds(follower):
    return [entry.kind for entry in follower.read_new()]


def test_each_entry_comes_once_and_in_its_order(place):
    follower = JournalFollower(place)
    assert kinds(follower) == []
    journal = open_journal(place)
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


def test_an_observation_before_every_event_is_read(place):
    with closing(open_journal(place)) as journal:
        journal.begin({}, {})
        journal.record_observation("pose", x=1.0)
        journal.end_run(Ending.OVER, 0)
    assert kinds(JournalFollower(place)) == ["run_began", "pose", "run_ended"]


def test_the_next_run_follows(place):
    follower = JournalFollower(place)
    for resume in (False, True):
        journal = open_journal(place, resume=resume)
        journal.begin({}, {})
        journal.end_run(Ending.STOPPED, 130)
        journal.close()
        assert kinds(follower) == ["run_began", "run_ended"]


def test_another_mission_in_the_file_is_read_from_its_beginning(place):
    follower = JournalFollower(place)
    for _ in range(2):
        journal = open_journal(place, start_over=True)
        journal.begin({}, {})
        journal.record_event("zone_visited", zone="zone_a")
        journal.close()
        assert kinds(follower) == ["run_began", "zone_visited"]


def test_what_is_no_journal_is_said_if_it_stays_so(place):
    place.write_text("no journal", encoding="utf-8")
    follower = JournalFollower(place)
    for _ in range(_TRIES - 1):
        assert follower.read_new() == []
    with pytest.raises(JournalError, match="damaged, or not a journal"):
        follower.read_new()


def test_a_file_that_cannot_be_read_for_a_moment_is_read_afterwards(place):
    follower = JournalFollower(place)
    for _ in range(_TRIES):
        place.write_text("half a journal", encoding="utf-8")
        assert follower.read_new() == []
        place.unlink()
        journal = open_journal(place, start_over=True)
        journal.begin({}, {})
        assert kinds(follower) == ["run_began"]
        journal.close()
        place.unlink()


def test_what_is_read_at_once_is_of_one_moment(place):
    journal = open_journal(place)
    journal.begin({}, {})
    with closing(JournalFile.read(place)) as file:
        with file.snapshot():
            assert len(file.runs()) == 1
            journal.record_event("zone_visited", zone="zone_a")
            assert [entry.kind for entry in file.stream()] == ["run_began"]
        assert [entry.kind for entry in file.stream()] == ["run_began", "zone_visited"]
    journal.close()


def test_a_file_that_a_run_has_just_opened_is_read_as_one_that_changes(place):
    journal = open_journal(place)
    journal.begin({}, {})
    journal.close()
    with place.open("rb") as opened:
        fcntl.flock(opened, fcntl.LOCK_EX)
        file = JournalFile.read(place)
    with closing(file):
        assert [*file.events()] == []
        again = open_journal(place, resume=True)
        again.begin({}, {})
        again.record_event("zone_visited", zone="zone_a")
        assert [fact.kind for fact in file.events()] == ["zone_visited"]
        again.close()
