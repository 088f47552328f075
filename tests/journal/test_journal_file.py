"""The file of a journal: what is in it, who may open it, and what is said of a file that is none."""

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


def fact(kind, data="{}", run=1):
    return Row(next(NUMBERS), run, 10.0, 1.5, kind, data)


@pytest.fixture
def place(tmp_path):
    return tmp_path / "mission.journal"


@pytest.fixture
def written(place):
    """A journal with a run that is over, a fact, and something that was watched."""
    file = JournalFile.create(place)
    run = file.begin_run({"mission": "patrol", "tree": {"name": "Root"}}, {"pid": 1, "time": 0.5}, 9.0)
    file.write([fact("pose", '{"x": 1.0}')], [fact("zone_visited", '{"zone": "zone_a"}')])
    file.write((), (), RunEnd(run, 11.0, Ending.OVER, 0, "Mission complete."))
    file.close()
    return place


def read(place):
    file = JournalFile.read(place)
    try:
        return json.loads(
            "\n".join(journal_json(file, MissionState.from_stream(file.stream()), with_watched=True))
        )
    finally:
        file.close()


def refused(open_file, place):
    with pytest.raises(JournalError) as error:
        open_file(place)
    assert str(place) in str(error.value)
    return str(error.value)


def test_what_is_written_is_read(written):
    data = read(written)
    assert data["state"] == "over"
    assert data["mission"] == "patrol"
    assert [(each["kind"], each["data"], each["time"]) for each in data["facts"]] == [
        ("zone_visited", {"zone": "zone_a"}, 1.5)
    ]
    assert [each["data"] for each in data["watched"]] == [{"x": 1.0}]
    assert data["runs"][0]["reason"] == "Mission complete."


def test_a_fact_is_on_the_disk_when_it_is_written(place):
    file = JournalFile.create(place)
    file.begin_run({}, {}, 0.0)
    file.write([], [fact("first")])
    # As another process sees it, while this one still has it open.
    assert [each["kind"] for each in read(place)["facts"]] == ["first"]
    assert file._connection.execute("PRAGMA synchronous").fetchone() == (2,)
    assert file._connection.execute("PRAGMA journal_mode").fetchone() == ("wal",)
    file.close()


def test_what_is_watched_does_not_wait_for_the_disk(place):
    file = JournalFile.create(place)
    file.write([fact("pose")])
    assert file._connection.execute("PRAGMA synchronous").fetchone() == (1,)
    file.close()


def test_a_second_process_is_refused_until_the_first_ends(written):
    file = JournalFile.open(written)
    assert is_locked(written)
    program = (
        "import sys; from pathlib import Path; from sar_compiler.journal.database import JournalFile\n"
        "JournalFile.open(Path(sys.argv[1]))"
    )
    done = subprocess.run(
        [sys.executable, "-c", program, written], capture_output=True, text=True, check=False
    )
    assert "runs in another process" in done.stderr
    file.close()
    JournalFile.open(written).close()
    assert not is_locked(written)


def test_a_look_at_the_lock_keeps_nobody_out(written):
    descriptor = os.open(written, os.O_RDONLY)
    fcntl.flock(descriptor, fcntl.LOCK_SH)
    threading.Timer(0.03, lambda: fcntl.flock(descriptor, fcntl.LOCK_UN)).start()
    JournalFile.open(written).close()
    os.close(descriptor)


def test_a_reader_does_not_keep_the_next_run_out(written):
    reader = JournalFile.read(written)
    JournalFile.open(written).close()
    reader.close()


def test_a_journal_with_a_mission_in_it_is_not_begun_again(written):
    assert "already contains a mission" in refused(JournalFile.create, written)


# Dies before its Nth statement.
DYING = """
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


def test_whoever_dies_while_a_journal_is_made_leaves_nothing_or_all_of_it(place):
    for statement in range(1, 100):
        done = subprocess.run([sys.executable, "-c", DYING, place, str(statement)], check=False)
        file = JournalFile.open(place)
        assert [run.about for run in file.runs()] == ([] if done.returncode else [{}])
        file.remove()
        if not done.returncode:
            break
    assert done.returncode == 0
    assert statement > 10


def test_a_database_of_another_program_is_no_journal(place):
    with sqlite3.connect(place) as other:
        other.execute("CREATE TABLE t (x)")
    other.close()
    before = place.read_bytes()
    for open_file in (JournalFile.open, JournalFile.read):
        assert "not the journal of a mission" in refused(open_file, place)
    assert place.read_bytes() == before


def test_a_journal_of_another_version_is_refused_with_both_numbers(written):
    with sqlite3.connect(written) as other:
        other.execute(f"PRAGMA user_version = {VERSION + 1}")
    other.close()
    words = refused(JournalFile.open, written)
    assert f"is a journal of version {VERSION + 1}" in words
    assert f"reads only version {VERSION}" in words


@pytest.mark.parametrize("open_file", [JournalFile.open, JournalFile.read, JournalFile.create])
@pytest.mark.parametrize("kind", ["folder", "pipe", "device", "text"])
def test_what_is_no_file_of_a_journal_is_refused_at_once(place, kind, open_file):
    if kind == "folder":
        place.mkdir()
    elif kind == "pipe":
        os.mkfifo(place)
    elif kind == "device":
        place.symlink_to("/dev/zero")
    else:
        place.write_text("a shopping list\n" * 100, encoding="utf-8")
    assert refused(open_file, place)


def test_a_file_that_is_not_there_cannot_be_read(place):
    assert "No such file" in refused(JournalFile.read, place)


def test_a_journal_is_put_aside_with_all_that_is_in_it(written, tmp_path):
    file = JournalFile.open(written)
    file.write([], [fact("late")])
    reader = JournalFile.read(written)  # so that SQLite leaves its log beside the file
    file.move(tmp_path / "aside.journal")
    reader.close()
    assert [each["kind"] for each in read(tmp_path / "aside.journal")["facts"]] == ["zone_visited", "late"]
    JournalFile.create(written).close()
    assert read(written)["facts"] == []


def test_a_journal_is_not_put_in_the_place_of_another_file(written, tmp_path):
    other = tmp_path / "other"
    other.write_text("mine", encoding="utf-8")
    file = JournalFile.open(written)
    with pytest.raises(JournalError, match="File exists"):
        file.move(other)
    file.close()
    assert other.read_text(encoding="utf-8") == "mine"


@given(st.data())
def test_a_damaged_journal_is_told_or_refused_in_words(tmp_path_factory, data):
    place = tmp_path_factory.mktemp("damaged") / "mission.journal"
    file = JournalFile.create(place)
    file.begin_run({"mission": "patrol", "tree": {"name": "Root", "children": []}}, {"time": 0.0}, 9.0)
    for number in range(20):
        file.write([fact("pose", '{"x": 1.0}')], [fact("zone_visited", f'{{"zone": "zone_{number}"}}')])
    file.close()
    content = bytearray(place.read_bytes())
    for _ in range(data.draw(st.integers(1, 8))):
        content[data.draw(st.integers(0, len(content) - 1))] = data.draw(st.integers(0, 255))
    place.write_bytes(content[: data.draw(st.integers(0, len(content)))])
    with suppress(JournalError):  # anything else is a traceback for somebody
        reader = JournalFile.read(place)
        try:
            [*journal_lines(reader, MissionState(), with_watched=True)]
            [*journal_json(reader, MissionState(), with_watched=True)]
        finally:
            reader.close()
