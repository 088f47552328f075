"""Tests of untrusted journals: foreign content is rejected, and reading takes a time that is limited by the file's size."""

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
def journal_path(tmp_path):
    """Return the journal of a stopped mission with a pose."""
    journal_path = tmp_path / "mission.journal"
    journal = open_journal(journal_path)
    journal.begin({"mission": "patrol"}, {})
    journal.record_event("zone_searched", zone="zone_a", survivor=(1.0, 2.0))
    journal.record_observation("pose", x=float("nan"), y=float("inf"), yaw=0.5)
    journal.end_run(Ending.STOPPED, 130)
    journal.close()
    return journal_path


def execute_sql(journal_path, *statements):
    with closing(sqlite3.connect(journal_path, isolation_level=None)) as base:
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
def test_foreign_database_object_is_rejected_by_name(journal_path, statements, named):
    execute_sql(journal_path, *statements)
    for opened in (JournalFile.read, JournalFile.open):
        with pytest.raises(
            JournalError,
            match=f"was not read, because it contains {named}, which does not belong to a journal",
        ):
            opened(journal_path)


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
def test_invalid_value_is_a_journal_error_in_every_command(
    journal_path, command, statement, said, capsys, monkeypatch, tmp_path
):
    monkeypatch.chdir(tmp_path)
    execute_sql(journal_path, statement)
    assert main([command[0], str(journal_path), *command[1:]]) == 2
    error = capsys.readouterr().err
    assert f"the journal {journal_path} cannot be used: '{said}' of an entry" in error


def test_journal_after_analyze_and_vacuum_is_read(journal_path):
    execute_sql(journal_path, "ANALYZE", "VACUUM")
    assert [fact.kind for fact in open_journal(journal_path, resume=True).earlier_events()] == [
        "zone_searched"
    ]


def test_reading_stops_if_it_takes_too_many_steps_for_file_size(journal_path, monkeypatch):
    monkeypatch.setattr(database, "_STEPS", 0)
    monkeypatch.setattr(database, "_STEPS_PER_BYTE", 0)
    monkeypatch.setattr("sar_compiler.journal.database._QueryBudget.STRIDE", 1)
    with pytest.raises(JournalError, match="far more steps than expected for a file of this size"):
        JournalFile.read(journal_path)


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


def test_ctrl_c_ends_endless_query(journal_path):
    done = subprocess.run(
        [sys.executable, "-c", PATIENT, journal_path], capture_output=True, text=True, check=True, timeout=300
    )
    assert done.stdout == "ended\n"


def parse_strict_json(text):
    def refuse(constant):
        pytest.fail(f"{constant} is no JSON")

    return json.loads(text, parse_constant=refuse)


@pytest.mark.parametrize(
    "written", ['{"x": NaN, "y": Infinity, "yaw": 0.5}', '{"x": 1e999, "y": -1E+0400, "yaw": 0.5}', None]
)
def test_non_finite_number_is_null_in_json_output(journal_path, tmp_path, capsys, written):
    if written:
        execute_sql(journal_path, f"UPDATE watched SET data = '{written}'")  # noqa: S608 - the test's own
    assert main(["show", str(journal_path), "--all", "--format", "json"]) == 0
    (pose,) = parse_strict_json(capsys.readouterr().out)["watched"]
    assert pose["data"] == {"x": None, "y": None, "yaw": 0.5}
    assert main(["report", str(journal_path), "-o", str(tmp_path / "r.json"), str(tmp_path / "r.html")]) == 0
    facts = parse_strict_json((tmp_path / "r.json").read_text("utf-8"))["facts"]
    (strange,) = (fact for fact in facts if fact["kind"] == "pose")
    assert strange["data"] == {"x": None, "y": None, "yaw": 0.5}
    assert main(["why", str(journal_path), "--format", "json"]) == 0
    assert [each["status"] for each in parse_strict_json(capsys.readouterr().out)["causes"]] == ["STOPPED"]


@pytest.mark.parametrize("column", ["wall", "time"])
def test_infinite_time_is_rejected(journal_path, column):
    execute_sql(journal_path, f"UPDATE fact SET {column} = 9e999")  # noqa: S608 - the test's own
    with (
        closing(JournalFile.read(journal_path)) as file,
        pytest.raises(JournalError, match="inf is not a time"),
    ):
        [*file.events()]


def _make_link(name, other):
    name.symlink_to(other)


def _make_pipe(name, _other):
    os.mkfifo(name)


def _make_hardlink(name, other):
    name.hardlink_to(other)


@pytest.mark.parametrize("is_put_back", [False, True], ids=["for good", "for a moment"])
@pytest.mark.parametrize(
    "put", [_make_link, _make_hardlink, _make_pipe], ids=["a link", "another file", "a pipe"]
)
@pytest.mark.parametrize("way", ["read", "read while it is written", "written"])
def test_journal_replaced_after_check_is_not_read(journal_path, tmp_path, monkeypatch, way, put, is_put_back):
    other, aside = tmp_path / "secret", tmp_path / "aside"
    shutil.copy(journal_path, other)
    connect = database._connect

    def exchange_and_connect(*arguments, **options):
        journal_path.rename(aside)
        put(journal_path, other)
        try:
            return connect(*arguments, **options)
        finally:
            if is_put_back:
                aside.replace(journal_path)

    monkeypatch.setattr(database, "_connect", exchange_and_connect)
    monkeypatch.setattr(database, "_is_used", lambda _path: way == "read while it is written")
    # SQLite itself refuses most pipes.
    reason = None if put is _make_pipe else "it was replaced while it was opened"
    with pytest.raises(JournalError, match=reason):
        (JournalFile.open if way == "written" else JournalFile.read)(journal_path)


def test_journal_opened_by_this_process_is_opened_again(journal_path):
    with JournalFile.open_snapshot(journal_path) as first, JournalFile.open_snapshot(journal_path) as second:
        assert first.description() == second.description()


WRITER = """
import sqlite3, sys
base = sqlite3.connect(sys.argv[1], isolation_level=None)
for word in ["secret", "written"]:
    base.execute(f"UPDATE about SET value = '\\"{word}\\"'")
    print(word, flush=True)
    sys.stdin.readline()
"""


@pytest.mark.parametrize("put", [_make_link, _make_pipe], ids=["a link", "a pipe"])
@pytest.mark.parametrize("suffix", ["-wal", "-shm"])
def test_replaced_wal_or_shm_file_is_neither_followed_nor_waited_for(
    journal_path, tmp_path, monkeypatch, suffix, put
):
    beside, other = journal_path.with_name(f"{journal_path.name}{suffix}"), tmp_path / "secret"
    connect = database._connect

    def connect_and_exchange(*arguments, **options):
        connection = connect(*arguments, **options)
        beside.unlink()
        put(beside, other)
        return connection

    with subprocess.Popen(
        [sys.executable, "-c", WRITER, journal_path], stdin=subprocess.PIPE, stdout=subprocess.PIPE
    ) as writer:
        assert writer.stdin is not None
        assert writer.stdout is not None
        assert writer.stdout.readline() == b"secret\n"
        shutil.copy(beside, other)
        writer.stdin.write(b"\n")
        writer.stdin.flush()
        assert writer.stdout.readline() == b"written\n"
        monkeypatch.setattr(database, "_connect", connect_and_exchange)
        with suppress(JournalError), JournalFile.open_snapshot(journal_path) as file:
            assert file.description()["mission"] == "written"
        writer.communicate()
