"""Tests of storing a mission's events in the reserve file while its journal cannot be written."""

import json
import os
import sqlite3
import time
import zlib
from contextlib import closing
from typing import Any, cast

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sar_compiler.journal import journal as journals
from sar_compiler.journal import spill_file as reserves
from sar_compiler.journal.database import JournalFile
from sar_compiler.journal.errors import JournalError
from sar_compiler.journal.journal_entries import FACTS_LOST, Ending, Row
from sar_compiler.journal.journal_follower import JournalFollower
from sar_compiler.journal.journal_opening import open_journal
from sar_compiler.journal.mission_state import MissionState
from sar_compiler.journal.spill_file import SpilledEntries, SpillFile, read_reserve
from sar_compiler.reports.journals import journal_json
from tests.full_disk import full_disk


@pytest.fixture
def journal_path(tmp_path):
    return tmp_path / "mission.journal"


class Mission:
    """A mission with a journal, whose disk can be full.

    Attributes:
        said: The reported failures and recoveries of the journal.
    """

    def __init__(self, journal_path, **options):
        self.said: list[str] = []
        self.journal = open_journal(journal_path, **options)
        self.journal.on_failure = self.journal.on_recovery = self.said.append
        self.journal.begin({"mission": "patrol"}, {})
        self.file = cast("Any", self.journal._file)
        self._write = self.file.write
        self.full = False
        self.file.write = self._written

    def _written(self, *rows):
        if not self.full:
            return self._write(*rows)
        with full_disk():
            return self._write(*rows)

    def die(self):
        """Leave the files as after SIGKILL."""
        self.file.close()
        assert self.journal._reserve is not None
        os.close(self.journal._reserve._descriptor)


def read(journal_path):
    with closing(JournalFile.read(journal_path)) as file:
        return json.loads("\n".join(journal_json(file, MissionState(), with_watched=True)))


def kinds(journal_path, which="facts"):
    return [fact["kind"] for fact in read(journal_path)[which]]


def resume(journal_path):
    journal = open_journal(journal_path, resume=True)
    found = [fact.kind for fact in journal.earlier_events()]
    journal.close()
    return found


def test_entries_delayed_by_full_disk_are_written_in_order(journal_path):
    mission = Mission(journal_path)
    mission.journal.record_event("first")
    mission.full = True
    mission.journal.record_event("second")
    mission.journal.record_observation("pose", x=1.0)
    mission.journal.record_event("third")
    mission.full = False
    mission.journal.record_event("fourth")
    mission.journal.end_run(Ending.OVER, 0)
    mission.journal.close()
    assert kinds(journal_path) == ["first", "second", "third", "fourth"]
    assert [fact["number"] for fact in read(journal_path)["facts"]] == [1, 2, 4, 5]
    assert kinds(journal_path, "watched") == ["pose"]
    assert len(mission.said) == 2
    assert "cannot be written (" in mission.said[0]
    assert (
        "and writing is retried every second. Until then, events are stored in the reserve file beside the journal."
        in mission.said[0]
    )
    assert "can be written again, and the waiting events have been written." in mission.said[1]
    assert [path.name for path in journal_path.parent.iterdir()] == [journal_path.name]


def test_writing_is_retried_each_second_without_new_entries(journal_path, monkeypatch):
    mission = Mission(journal_path)
    mission.full = True
    mission.journal.record_event("first")
    mission.full = False
    mission.journal.write_when_due()
    assert len(mission.said) == 1
    now = time.monotonic()
    monkeypatch.setattr("time.monotonic", lambda: now + 1.0)
    mission.journal.write_when_due()
    assert len(mission.said) == 2
    mission.journal.close()


def test_mission_killed_with_full_disk_resumes_with_all_events(journal_path):
    mission = Mission(journal_path)
    mission.journal.record_event("first")
    mission.full = True
    for number in range(200):
        mission.journal.record_event(f"fact_{number}", zone="zone_a", x=1.25)
    mission.die()
    expected = ["first", *(f"fact_{number}" for number in range(200))]
    assert kinds(journal_path) == expected
    assert resume(journal_path) == expected
    with sqlite3.connect(journal_path) as base:
        assert base.execute("SELECT count(*) FROM fact").fetchone() == (201,)
    base.close()


def test_mission_that_ended_with_full_disk_is_over(journal_path):
    mission = Mission(journal_path)
    mission.full = True
    mission.journal.record_event("base_reached")
    mission.journal.end_run(Ending.OVER, 0, "Mission complete.")
    mission.journal.close()
    assert "are in the reserve file beside the journal" in mission.said[-1]
    assert read(journal_path)["runs"][-1]["ending"] == "over"
    assert kinds(journal_path) == ["base_reached"]
    with pytest.raises(JournalError, match="is over"):
        open_journal(journal_path, resume=True)
    open_journal(journal_path).close()
    aside = Mission(journal_path)
    aside.journal.close()
    moved = next(
        path
        for path in journal_path.parent.iterdir()
        if path.name.startswith("mission.2") and path.suffix == ".journal"
    )
    assert kinds(moved) == ["base_reached"]


def test_foreign_lock_neither_delays_nor_loses_events(journal_path):
    mission = Mission(journal_path)
    other = sqlite3.connect(journal_path, isolation_level=None)
    other.execute("BEGIN IMMEDIATE")
    assert mission.file._connection.execute("PRAGMA busy_timeout").fetchone() == (0,)
    mission.journal.record_event("first")
    assert "database is locked" in mission.said[0]
    with closing(JournalFile.read(journal_path)) as file:
        assert [fact.kind for fact in file.events()] == ["first"]
    other.execute("COMMIT")
    other.close()
    mission.journal.record_event("second")
    mission.journal.close()
    assert kinds(journal_path) == ["first", "second"]


def test_follower_reads_each_event_once_also_from_reserve(journal_path):
    mission = Mission(journal_path)
    follower = JournalFollower(journal_path)
    mission.full = True
    mission.journal.record_event("first")
    assert [entry.kind for entry in follower.read_new()] == ["run_began", "first"]
    mission.full = False
    mission.journal.record_event("second")
    assert [entry.kind for entry in follower.read_new()] == ["second"]
    mission.journal.close()


def test_overflow_of_reserve_records_lost_count_and_given_numbers(journal_path):
    mission = Mission(journal_path)
    mission.journal.store_highest_number("survivor", 7)
    mission.full = True
    for _ in range(50):
        mission.journal.record_event("much", text="x" * 5_000)
    mission.die()
    *kept, last = read(journal_path)["facts"]
    assert {fact["kind"] for fact in kept} == {"much"}
    assert last["kind"] == FACTS_LOST
    assert last["data"] == {"count": 50 - len(kept), "numbers": {"survivor": 7}}
    assert resume(journal_path)[-1] == FACTS_LOST


def test_waiting_entries_in_memory_are_limited_and_losses_reported(journal_path, monkeypatch):
    monkeypatch.setattr(journals, "_MAX_FACTS", 10)
    monkeypatch.setattr(journals, "_MAX_WATCHED", 5)
    mission = Mission(journal_path)
    mission.full = True
    for _ in range(30):
        mission.journal.record_event("fact")
        mission.journal.record_observation("pose")
    assert len(mission.journal._pending) == 10
    mission.full = False
    mission.journal.close()
    assert kinds(journal_path) == ["fact"] * 9 + [FACTS_LOST]
    assert read(journal_path)["facts"][-1]["data"] == {"count": 21, "numbers": {}}
    assert len(kinds(journal_path, "watched")) == 5
    assert "25 observations were lost." in mission.said[-1]


def test_unwritable_reserve_is_reported(journal_path):
    mission = Mission(journal_path)
    mission.full = True
    with full_disk():
        mission.journal.record_event("first")
        mission.journal.record_event("second")
    assert len(mission.said) == 1
    assert "Until then, the mission cannot be resumed from its current state." in mission.said[0]
    mission.full = False
    mission.journal.close()
    assert kinds(journal_path) == ["first", "second"]


def test_reserve_of_other_journal_is_ignored(journal_path):
    mission = Mission(journal_path)
    mission.full = True
    mission.journal.record_event("first")
    mission.die()
    for ending in ("", "-wal", "-shm"):
        journal_path.with_name(journal_path.name + ending).unlink(missing_ok=True)
    other = Mission(journal_path)
    other.journal.record_event("mine")
    other.die()
    assert resume(journal_path) == ["mine"]


def fact(number, data="{}"):
    return Row(number, 1, 10.0, 1.5, "fact", data)


@given(st.lists(st.integers(0, 400), max_size=6), st.integers(0, 70_000))
def test_torn_write_of_reserve_leaves_old_or_new_content(tmp_path_factory, counts, torn):
    journal_path = tmp_path_factory.mktemp("reserve") / "mission.journal"
    reserve = SpillFile(journal_path)
    size = reserve.path.stat().st_size
    before = SpilledEntries()
    for count in counts:
        before = SpilledEntries(1.0, [fact(number, json.dumps({"x": number})) for number in range(count)])
        reserve.replace_content(before, {})
    old = reserve.path.read_bytes()
    after = SpilledEntries(1.0, [fact(9)])
    reserve.replace_content(after, {})
    new = reserve.path.read_bytes()
    assert read_reserve(journal_path) == after
    first = next(index for index in range(size) if old[index] != new[index])
    reserve.path.write_bytes(new[: first + torn] + old[first + torn :])
    assert reserve.path.stat().st_size == size
    assert read_reserve(journal_path) in (before, after)
    reserve.close(is_needed=False)


@pytest.mark.parametrize(
    "content", ["not json", '{"began": 1.0}', '{"began": 1.0, "facts": [[1]], "end": null}']
)
def test_damaged_reserve_is_rejected_with_remedy(journal_path, content):
    mission = Mission(journal_path)
    mission.die()
    reserve = SpillFile(journal_path)
    reserves._write(reserve._descriptor, b"", 0)
    body = f"{len(content):10}{99:20}".encode() + content.encode()
    reserves._write(reserve._descriptor, f"{zlib.crc32(body):10}".encode() + body, 0)
    reserve.close(is_needed=True)
    for opened in (JournalFile.read, JournalFile.open):
        with pytest.raises(
            JournalError,
            match=r"mission.journal-reserve is damaged \(.*Move the file away to continue without",
        ):
            opened(journal_path)


def test_reserve_that_is_not_a_file_is_rejected(journal_path):
    Mission(journal_path).die()
    reserve = journal_path.with_name(journal_path.name + reserves.SUFFIX)
    reserve.unlink()
    os.mkfifo(reserve)
    with pytest.raises(JournalError, match=r"mission\.journal-reserve: it is a pipe, not a file"):
        JournalFile.read(journal_path)
