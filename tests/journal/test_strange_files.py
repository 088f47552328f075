"""A journal may be anybody's: what is in it that no journal has is refused, and it is read in a time that its size has."""

import json
import os
import shutil
import sqlite3
import subprocess
import sys
from contextlib import closing, suppress

import pytest

from sar_compiler.cli.journal_command import main
from sar_compiler.journal import database
from sar_compiler.journal.database import JournalFile
from sar_compiler.journal.errors import JournalError
from sar_compiler.journal.journal_entries import Ending
from sar_compiler.journal.journal_opening import open_journal

ENDLESS = "WITH RECURSIVE n(x) AS (SELECT 1 UNION ALL SELECT x + 1 FROM n)"


@pytest.fixture
def place(tmp_path):
    """A mission that was stopped, with a pose."""
    place = tmp_path / "mission.journal"
    journal = open_journal(place)
    journal.begin({"mission": "patrol"}, {})
    journal.record_event("zone_searched", zone="zone_a", survivor=(1.0, 2.0))
    journal.record_observation("pose", x=float("nan"), y=float("inf"), yaw=0.5)
    journal.end_run(Ending.STOPPED, 130)
    journal.close()
    return place


def change(place, *statements):
    with closing(sqlite3.connect(place, isolation_level=None)) as base:
        for statement in statements:
            base.execute(statement)


@pytest.mark.parametrize(
    ("statements", "named"),
    [
        (
            [
                "DROP TABLE watched",
                f"CREATE VIEW watched AS {ENDLESS} SELECT x AS number, 1 AS run, 1.0 AS wall, 1.0 AS time, 'k' AS kind, '{{}}' AS data FROM n",  # noqa: S608 - the test's own
            ],
            "the view 'watched'",
        ),
        (["CREATE TRIGGER t AFTER INSERT ON fact BEGIN DELETE FROM fact; END"], "the trigger 't'"),
        (["CREATE INDEX i ON fact (kind) WHERE data > 'x'"], "the index 'i'"),
        (["CREATE TABLE more (x)"], "the table 'more'"),
        (["ALTER TABLE fact ADD COLUMN more TEXT"], "the table 'fact'"),
    ],
)
def test_what_no_journal_has_is_refused_by_its_name(place, statements, named):
    change(place, *statements)
    for opened in (JournalFile.read, JournalFile.open):
        with pytest.raises(
            JournalError,
            match=f"was not read, because it contains {named}, which does not belong to a journal",
        ):
            opened(place)


@pytest.mark.parametrize("command", [["stats"], ["show"], ["why"], ["report", "-o", "report.html"]])
@pytest.mark.parametrize(
    ("statement", "said"),
    [
        (
            """UPDATE watched SET kind = 'status', data = '{"node": 0, "tick": 1, "status": "IDLE", "last": "x"}'""",
            "last",
        ),
        (
            """UPDATE watched SET kind = 'status', data = '{"node": [], "tick": 1, "status": "IDLE"}'""",
            "node",
        ),
        ("""UPDATE watched SET kind = 'changed', data = '{"leaf": {}, "tick": 1}'""", "leaf"),
        ("""UPDATE run SET about = '{"tree_id": [[1]]}'""", "tree_id"),
    ],
)
def test_a_value_that_is_never_written_is_an_error_of_the_journal_for_every_command(
    place, command, statement, said, capsys, monkeypatch, tmp_path
):
    monkeypatch.chdir(tmp_path)
    change(place, statement)
    assert main([command[0], str(place), *command[1:]]) == 2
    error = capsys.readouterr().err
    assert f"the journal {place} cannot be used: '{said}' of an entry" in error


def test_what_sqlites_own_tools_leave_is_read(place):
    change(place, "ANALYZE", "VACUUM")
    assert [fact.kind for fact in open_journal(place, resume=True).earlier_events()] == ["zone_searched"]


def test_a_file_that_takes_far_more_work_than_its_size_has_is_given_up(place, monkeypatch):
    monkeypatch.setattr(database, "_STEPS", 0)
    monkeypatch.setattr(database, "_STEPS_PER_BYTE", 0)
    monkeypatch.setattr("sar_compiler.journal.database._QueryBudget.STRIDE", 1)
    with pytest.raises(JournalError, match="far more steps than expected for a file of this size"):
        JournalFile.read(place)


PATIENT = f"""
import signal, sys
from pathlib import Path
from sar_compiler.journal.database import JournalFile
file = JournalFile.read(Path(sys.argv[1]))
file._query_budget._steps = 10 ** 18
signal.signal(signal.SIGALRM, signal.default_int_handler)
signal.setitimer(signal.ITIMER_REAL, 0.1)
try:
    with file._limit_reading():
        file._connection.execute("{ENDLESS} SELECT max(x) FROM n").fetchall()
except KeyboardInterrupt:
    print("ended")
"""  # noqa: S608 - the test's own


def test_ctrl_c_ends_a_reading_that_would_never_end(place):
    done = subprocess.run(
        [sys.executable, "-c", PATIENT, place], capture_output=True, text=True, check=True, timeout=300
    )
    assert done.stdout == "ended\n"


def strictly(text):
    def refuse(constant):
        pytest.fail(f"{constant} is no JSON")

    return json.loads(text, parse_constant=refuse)


@pytest.mark.parametrize(
    "written", ['{"x": NaN, "y": Infinity, "yaw": 0.5}', '{"x": 1e999, "y": -1E+0400, "yaw": 0.5}', None]
)
def test_a_number_that_is_not_finite_is_null_in_every_json(place, tmp_path, capsys, written):
    if written:
        change(place, f"UPDATE watched SET data = '{written}'")  # noqa: S608 - the test's own
    assert main(["show", str(place), "--all", "--format", "json"]) == 0
    (pose,) = strictly(capsys.readouterr().out)["watched"]
    assert pose["data"] == {"x": None, "y": None, "yaw": 0.5}
    assert main(["report", str(place), "-o", str(tmp_path / "r.json"), str(tmp_path / "r.html")]) == 0
    facts = strictly((tmp_path / "r.json").read_text("utf-8"))["facts"]
    (strange,) = (fact for fact in facts if fact["kind"] == "pose")
    assert strange["data"] == {"x": None, "y": None, "yaw": 0.5}
    assert main(["why", str(place), "--format", "json"]) == 0
    assert [each["status"] for each in strictly(capsys.readouterr().out)["causes"]] == ["STOPPED"]


@pytest.mark.parametrize("column", ["wall", "time"])
def test_a_time_that_is_none_is_refused(place, column):
    change(place, f"UPDATE fact SET {column} = 9e999")  # noqa: S608 - the test's own
    with closing(JournalFile.read(place)) as file, pytest.raises(JournalError, match="inf is not a time"):
        [*file.events()]


def _a_link(name, other):
    name.symlink_to(other)


def _a_pipe(name, _other):
    os.mkfifo(name)


def _another_file(name, other):
    name.hardlink_to(other)


@pytest.mark.parametrize("is_put_back", [False, True], ids=["for good", "for a moment"])
@pytest.mark.parametrize("put", [_a_link, _another_file, _a_pipe], ids=["a link", "another file", "a pipe"])
@pytest.mark.parametrize("way", ["read", "read while it is written", "written"])
def test_a_journal_that_is_exchanged_after_the_check_is_not_read(
    place, tmp_path, monkeypatch, way, put, is_put_back
):
    other, aside = tmp_path / "secret", tmp_path / "aside"
    shutil.copy(place, other)
    connect = database._connect

    def exchange_and_connect(*arguments, **options):
        place.rename(aside)
        put(place, other)
        try:
            return connect(*arguments, **options)
        finally:
            if is_put_back:
                aside.replace(place)

    monkeypatch.setattr(database, "_connect", exchange_and_connect)
    monkeypatch.setattr(database, "_is_used", lambda _path: way == "read while it is written")
    # SQLite itself refuses most pipes.
    reason = None if put is _a_pipe else "it was replaced while it was opened"
    with pytest.raises(JournalError, match=reason):
        (JournalFile.open if way == "written" else JournalFile.read)(place)


def test_a_journal_that_this_process_has_open_is_opened_again(place):
    with JournalFile.open_snapshot(place) as first, JournalFile.open_snapshot(place) as second:
        assert first.description() == second.description()


WRITER = """
import sqlite3, sys
base = sqlite3.connect(sys.argv[1], isolation_level=None)
for word in ["secret", "written"]:
    base.execute(f"UPDATE about SET value = '\\"{word}\\"'")
    print(word, flush=True)
    sys.stdin.readline()
"""


@pytest.mark.parametrize("put", [_a_link, _a_pipe], ids=["a link", "a pipe"])
@pytest.mark.parametrize("suffix", ["-wal", "-shm"])
def test_a_file_beside_a_journal_that_is_exchanged_is_neither_followed_nor_waited_for(
    place, tmp_path, monkeypatch, suffix, put
):
    beside, other = place.with_name(f"{place.name}{suffix}"), tmp_path / "secret"
    connect = database._connect

    def connect_and_exchange(*arguments, **options):
        connection = connect(*arguments, **options)
        beside.unlink()
        put(beside, other)
        return connection

    with subprocess.Popen(
        [sys.executable, "-c", WRITER, place], stdin=subprocess.PIPE, stdout=subprocess.PIPE
    ) as writer:
        assert writer.stdin is not None
        assert writer.stdout is not None
        assert writer.stdout.readline() == b"secret\n"
        shutil.copy(beside, other)
        writer.stdin.write(b"\n")
        writer.stdin.flush()
        assert writer.stdout.readline() == b"written\n"
        monkeypatch.setattr(database, "_connect", connect_and_exchange)
        with suppress(JournalError), JournalFile.open_snapshot(place) as file:
            assert file.description()["mission"] == "written"
        writer.communicate()
