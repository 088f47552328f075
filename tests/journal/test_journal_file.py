"""Tests of the journal file: its content, its locks, and the errors for files that are no journals."""

import fcntl
import itertools
import json
import os
import sqlite3
import subprocess
import sys
import threading
from contextlib import suppress

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sar_compiler.journal.database import VERSION, JournalFile, is_locked
from sar_compiler.journal.errors import JournalError
from sar_compiler.journal.journal_entries import Ending, Row
from sar_compiler.journal.mission_state import MissionState
from sar_compiler.journal.spill_file import RunEnd
from sar_compiler.reports.journals import journal_json, journal_lines

NUMBERS = itertools.count(1)


def event_row(kind, data="{}", run=1):
    return Row(next(NUMBERS), run, 10.0, 1.5, kind, data)


@pytest.fixture
def journal_path(tmp_path):
    return tmp_path / "mission.journal"


@pytest.fixture
def finished_journal(journal_path):
    """Return a journal with a finished run, one event and one observation."""
    file = JournalFile.create(journal_path)
    run = file.begin_run({"mission": "patrol", "tree": {"name": "Root"}}, {"pid": 1, "time": 0.5}, 9.0)
    file.write([event_row("pose", '{"x": 1.0}')], [event_row("zone_visited", '{"zone": "zone_a"}')])
    file.write((), (), RunEnd(run, 11.0, Ending.OVER, 0, "Mission complete."))
    file.close()
    return journal_path


def read_json(journal_path):
    file = JournalFile.read(journal_path)
    try:
        return json.loads(
            "\n".join(journal_json(file, MissionState.from_stream(file.stream()), with_watched=True))
        )
    finally:
        file.close()


def refusal(open_file, journal_path):
    with pytest.raises(JournalError) as error:
        open_file(journal_path)
    assert str(journal_path) in str(error.value)
    return str(error.value)


def test_written_entries_are_read(finished_journal):
    data = read_json(finished_journal)
    assert data["state"] == "over"
    assert data["mission"] == "patrol"
    assert [(each["kind"], each["data"], each["time"]) for each in data["facts"]] == [
        ("zone_visited", {"zone": "zone_a"}, 1.5)
    ]
    assert [each["data"] for each in data["watched"]] == [{"x": 1.0}]
    assert data["runs"][0]["reason"] == "Mission complete."


def test_event_is_on_disk_when_written(journal_path):
    file = JournalFile.create(journal_path)
    file.begin_run({}, {}, 0.0)
    file.write([], [event_row("first")])
    # Read while the writer still has the file open, as another process would.
    assert [each["kind"] for each in read_json(journal_path)["facts"]] == ["first"]
    assert file._connection.execute("PRAGMA synchronous").fetchone() == (2,)
    assert file._connection.execute("PRAGMA journal_mode").fetchone() == ("wal",)
    file.close()


def test_observation_does_not_wait_for_disk(journal_path):
    file = JournalFile.create(journal_path)
    file.write([event_row("pose")])
    assert file._connection.execute("PRAGMA synchronous").fetchone() == (1,)
    file.close()


def test_second_process_is_refused_until_first_closes_file(finished_journal):
    file = JournalFile.open(finished_journal)
    assert is_locked(finished_journal)
    program = (
        "import sys; from pathlib import Path; from sar_compiler.journal.database import JournalFile\n"
        "JournalFile.open(Path(sys.argv[1]))"
    )
    done = subprocess.run(
        [sys.executable, "-c", program, finished_journal], capture_output=True, text=True, check=False
    )
    assert "runs in another process" in done.stderr
    file.close()
    JournalFile.open(finished_journal).close()
    assert not is_locked(finished_journal)


def test_brief_shared_lock_does_not_prevent_opening(finished_journal):
    descriptor = os.open(finished_journal, os.O_RDONLY)
    fcntl.flock(descriptor, fcntl.LOCK_SH)
    threading.Timer(0.03, lambda: fcntl.flock(descriptor, fcntl.LOCK_UN)).start()
    JournalFile.open(finished_journal).close()
    os.close(descriptor)


def test_reader_does_not_prevent_next_run(finished_journal):
    reader = JournalFile.read(finished_journal)
    JournalFile.open(finished_journal).close()
    reader.close()


def test_journal_with_mission_is_not_created_again(finished_journal):
    assert "already contains a mission" in refusal(JournalFile.create, finished_journal)


# Kills itself before its Nth SQL statement.
DYING_PROGRAM = """
import os, signal, sqlite3, sys
from pathlib import Path
from sar_compiler.journal import database

class Dying(sqlite3.Connection):
    left = int(sys.argv[2])

def connect(*arguments, **options):
    connection = sqlite3.connect(*arguments, **options, factory=Dying)
    def count(_):
        Dying.left -= 1
        if Dying.left == 0:
            os.kill(os.getpid(), signal.SIGKILL)
    connection.set_trace_callback(count)
    return connection

database.sqlite3 = type("sqlite3", (), {**vars(sqlite3), "connect": connect})
file = database.JournalFile.create(Path(sys.argv[1]))
file.begin_run({"mission": "patrol"}, {}, 0.0)
file.close()
"""


def test_creation_killed_at_any_statement_leaves_nothing_or_complete_run(journal_path):
    for statement in range(1, 100):
        done = subprocess.run(
            [sys.executable, "-c", DYING_PROGRAM, journal_path, str(statement)], check=False
        )
        file = JournalFile.open(journal_path)
        assert [run.about for run in file.runs()] == ([] if done.returncode else [{}])
        file.remove()
        if not done.returncode:
            break
    assert done.returncode == 0
    assert statement > 10


def test_database_of_other_program_is_rejected_unchanged(journal_path):
    with sqlite3.connect(journal_path) as other:
        other.execute("CREATE TABLE t (x)")
    other.close()
    before = journal_path.read_bytes()
    for open_file in (JournalFile.open, JournalFile.read):
        assert "not the journal of a mission" in refusal(open_file, journal_path)
    assert journal_path.read_bytes() == before


def test_journal_of_other_version_is_rejected_with_both_versions(finished_journal):
    with sqlite3.connect(finished_journal) as other:
        other.execute(f"PRAGMA user_version = {VERSION + 1}")
    other.close()
    words = refusal(JournalFile.open, finished_journal)
    assert f"is a journal of version {VERSION + 1}" in words
    assert f"reads only version {VERSION}" in words


@pytest.mark.parametrize("open_file", [JournalFile.open, JournalFile.read, JournalFile.create])
@pytest.mark.parametrize("kind", ["folder", "pipe", "device", "text"])
def test_path_that_is_no_journal_is_rejected(journal_path, kind, open_file):
    if kind == "folder":
        journal_path.mkdir()
    elif kind == "pipe":
        os.mkfifo(journal_path)
    elif kind == "device":
        journal_path.symlink_to("/dev/zero")
    else:
        journal_path.write_text("a shopping list\n" * 100, encoding="utf-8")
    assert refusal(open_file, journal_path)


def test_missing_file_cannot_be_read(journal_path):
    assert "No such file" in refusal(JournalFile.read, journal_path)


def test_journal_is_moved_with_all_entries(finished_journal, tmp_path):
    file = JournalFile.open(finished_journal)
    file.write([], [event_row("late")])
    reader = JournalFile.read(finished_journal)  # so that SQLite keeps its write-ahead log
    file.move(tmp_path / "aside.journal")
    reader.close()
    assert [each["kind"] for each in read_json(tmp_path / "aside.journal")["facts"]] == [
        "zone_visited",
        "late",
    ]
    JournalFile.create(finished_journal).close()
    assert read_json(finished_journal)["facts"] == []


def test_journal_is_not_moved_over_existing_file(finished_journal, tmp_path):
    other = tmp_path / "other"
    other.write_text("mine", encoding="utf-8")
    file = JournalFile.open(finished_journal)
    with pytest.raises(JournalError, match="File exists"):
        file.move(other)
    file.close()
    assert other.read_text(encoding="utf-8") == "mine"


@given(st.data())
def test_damaged_journal_is_read_or_raises_journal_error(tmp_path_factory, data):
    journal_path = tmp_path_factory.mktemp("damaged") / "mission.journal"
    file = JournalFile.create(journal_path)
    file.begin_run({"mission": "patrol", "tree": {"name": "Root", "children": []}}, {"time": 0.0}, 9.0)
    for number in range(20):
        file.write(
            [event_row("pose", '{"x": 1.0}')], [event_row("zone_visited", f'{{"zone": "zone_{number}"}}')]
        )
    file.close()
    content = bytearray(journal_path.read_bytes())
    for _ in range(data.draw(st.integers(1, 8))):
        content[data.draw(st.integers(0, len(content) - 1))] = data.draw(st.integers(0, 255))
    journal_path.write_bytes(content[: data.draw(st.integers(0, len(content)))])
    with suppress(JournalError):  # a user would see any other exception as a traceback
        reader = JournalFile.read(journal_path)
        try:
            [*journal_lines(reader, MissionState(), with_watched=True)]
            [*journal_json(reader, MissionState(), with_watched=True)]
        finally:
            reader.close()
