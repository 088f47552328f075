"""Tests of the hash chain of a journal, which makes alterations detectable, and of `sar-journal check`."""

import json
import random
import shutil
import signal
import sqlite3
import subprocess
import sys
from contextlib import closing

import pytest

from sar_compiler.cli.journal_command import main
from sar_compiler.journal import chain
from sar_compiler.journal.database import JournalFile
from sar_compiler.journal.journal_entries import Ending, Row
from sar_compiler.journal.journal_opening import open_journal
from sar_compiler.journal.spill_file import RunEnd
from sar_compiler.reports.checked_journal import CheckedJournal
from tests.random_inputs import rounds

TABLES = "fact", "watched"
COLUMNS = "number, run, wall, time, kind, data, link"


def write_run(journal_path, *, ends=True, zones=4):
    """Write a run like a mission; return the head of its chain."""
    journal = open_journal(journal_path, resume=journal_path.exists())
    journal.begin({"mission": "patrol", "tree": {"name": "Root"}, "identity": ["zone_a"]}, {"version": "1"})
    for zone in range(zones):
        journal.record_observation("status", node=0, tick=zone, status="RUNNING")
        journal.record_observation("pose", x=float(zone), y=-0.0)
        journal.record_event("zone_visited", zone=f"zone_{zone}")
        journal.record_observation("log", text="Überall")
    if ends:
        journal.end_run(Ending.STOPPED, 130, "Öde.")
    journal.close()
    return journal.head


@pytest.fixture(scope="module")
def journal_of_three_runs(tmp_path_factory):
    """Return a journal of three runs (stopped, crashed, stopped) with the head after each run."""
    journal_path = tmp_path_factory.mktemp("flown") / "mission.journal"
    return journal_path, write_run(journal_path), write_run(journal_path, ends=False), write_run(journal_path)


@pytest.fixture
def journal_path(journal_of_three_runs, tmp_path):
    return shutil.copy(journal_of_three_runs[0], tmp_path / "mission.journal")


def check_journal(journal_path, head=None):
    return CheckedJournal.check(journal_path, head)


def execute_sql(journal_path, *statements):
    with closing(sqlite3.connect(journal_path, isolation_level=None)) as base:
        for statement in statements:
            base.execute(*statement) if isinstance(statement, tuple) else base.execute(statement)


def read_rows(journal_path):
    with closing(sqlite3.connect(journal_path)) as base:
        tables = [
            [(name, *row) for row in base.execute(f"SELECT {COLUMNS} FROM {name}")]  # noqa: S608 - the test's own
            for name in TABLES
        ]
    return sorted((row for table in tables for row in table), key=lambda row: row[1])


def test_chain_is_whole_over_all_runs_and_closed_by_last_end(journal_of_three_runs):
    journal_path, first, broken, last = journal_of_three_runs
    found = check_journal(journal_path, last)
    assert (found.state, found.chain.entries, found.chain.head) == ("whole", 48, last)
    assert found.chain.heads == {1: first, 3: last}
    assert broken == ""


def test_events_and_observations_are_chained_in_chronological_order(journal_path):
    kinds = [kind for kind, *_ in read_rows(journal_path)[:5]]
    assert kinds == ["watched", "watched", "fact", "watched", "watched"]
    assert check_journal(journal_path).is_good


def _flip_bit(row, chance):
    """Return a statement that changes one bit or number in one column of an entry."""
    table, number, *columns = row
    column = chance.randrange(len(columns))
    value = columns[column]
    if isinstance(value, str):
        place, bit = chance.randrange(len(value)), 1 << chance.randrange(6)
        value = value[:place] + chr(ord(value[place]) ^ bit) + value[place + 1 :]
    elif isinstance(value, bytes):
        place = chance.randrange(len(value))
        value = value[:place] + bytes([value[place] ^ (1 << chance.randrange(8))]) + value[place + 1 :]
    else:
        value = value + 1 if isinstance(value, int) else value + chance.choice((-1e-6, 1e-6, 3600.0))
    names = COLUMNS.split(", ")
    return (f"UPDATE {table} SET {names[column + 1]} = ? WHERE number = ?", (value, number))  # noqa: S608 - the test's own


def _alter(how, rows, chance):
    """Return statements that alter an entry, and the possible numbers of the first wrong entry."""
    place = chance.randrange(len(rows) - 1)
    table, number, *columns = rows[place]
    following = rows[place + 1][1]
    if how == "flipped":
        return [_flip_bit(rows[place], chance)], {number, following}
    if how == "removed":
        return [f"DELETE FROM {table} WHERE number = {number}"], {number, following}  # noqa: S608 - the test's own
    if how == "swapped":
        other = chance.choice([row for row in rows if row[0] == table and row[5:7] != rows[place][5:7]])
        update = (
            f"UPDATE {table} SET run = ?, wall = ?, time = ?, kind = ?, data = ?, link = ? WHERE number = ?"  # noqa: S608 - the test's own
        )
        return [(update, (*columns, other[1])), (update, (*other[2:], number))], {min(number, other[1])}
    # The entry is inserted between two entries or before the first one, and the later entries are renumbered.
    moves = [f"UPDATE {each} SET number = -number WHERE number >= {number}" for each in TABLES]  # noqa: S608 - the test's own
    back = [f"UPDATE {each} SET number = 1 - number WHERE number < 0" for each in TABLES]  # noqa: S608 - the test's own
    link = chance.choice([None, columns[-1], chance.randbytes(32)])
    values = (number, columns[0], columns[1], columns[2], "zone_visited", '{"zone": "zone_9"}', link)
    insert = (f"INSERT INTO {chance.choice(TABLES)} VALUES (?, ?, ?, ?, ?, ?, ?)", values)  # noqa: S608 - the test's own
    return [*moves, *back, insert], {number}


@pytest.mark.unmeasured
@pytest.mark.parametrize("how", ["flipped", "removed", "swapped", "inserted"])
def test_alteration_is_detected_with_its_first_wrong_entry(journal_of_three_runs, tmp_path, how):
    chance = random.Random(how)  # noqa: S311 - by seed
    rows = read_rows(journal_of_three_runs[0])
    journal_path = tmp_path / "mission.journal"
    for _ in range(rounds(80)):
        shutil.copy(journal_of_three_runs[0], journal_path)
        statements, first = _alter(how, rows, chance)
        execute_sql(journal_path, *statements)
        found = check_journal(journal_path)
        assert found.state == "altered", statements
        assert found.chain.wrong.number in first, statements


@pytest.mark.parametrize(
    "statement",
    [
        "UPDATE run SET began = began + 1 WHERE number = 2",
        "UPDATE run SET about = replace(about, '1', '2') WHERE number = 1",
        "UPDATE run SET status = 0 WHERE number = 1",
        "UPDATE run SET status = 130.5 WHERE number = 1",
        "UPDATE run SET ending = 'over' WHERE number = 3",
        "UPDATE run SET reason = 'well' WHERE number = 2",
        "UPDATE run SET ended = 5 WHERE number = 3",
        "UPDATE run SET closed = x'00' WHERE number = 2",
        "UPDATE run SET ended_behind = 1 WHERE number = 2",
        "UPDATE run SET ended_behind = 15 WHERE number = 1",
        "UPDATE run SET began_behind = 15 WHERE number = 2",
        "UPDATE run SET began_behind = NULL WHERE number = 3",
        "UPDATE run SET ended = NULL, ending = NULL, status = NULL, reason = '', closed = NULL, ended_behind = NULL WHERE number = 1",
        "UPDATE run SET number = 7 WHERE number = 2",
        "DELETE FROM run WHERE number = 2",
        "INSERT INTO run (number, began, about) VALUES (0, 1.0, '{}')",
        "INSERT INTO run (began, about) VALUES (1.0, '{}')",
        "UPDATE about SET value = '[]' WHERE key = 'identity'",
        "UPDATE about SET key = 'more' WHERE key = 'identity'",
        "DELETE FROM about WHERE key = 'identity'",
        "INSERT INTO about VALUES ('more', '1')",
        "UPDATE fact SET data = CAST(data AS BLOB) WHERE run = 2",
        "UPDATE watched SET kind = CAST(x'ff' AS TEXT) WHERE run = 2",
        "UPDATE fact SET run = 'one' WHERE run = 1",
        "UPDATE fact SET wall = 'then' WHERE run = 1",
        "UPDATE fact SET number = 9e18 WHERE run = 3 AND number = (SELECT max(number) FROM fact)",
        "UPDATE fact SET link = NULL WHERE run = 1",
        "UPDATE fact SET link = x'', wall = 'then' WHERE run = 1",
    ],
)  # fmt: skip
def test_chain_covers_every_column(journal_path, statement, capsys):
    execute_sql(journal_path, statement)
    assert check_journal(journal_path).state == "altered"
    assert main(["check", str(journal_path)]) == 1
    out = capsys.readouterr().out
    assert "was altered: " in out
    assert main(["check", str(journal_path), "--format", "json"]) == 1
    assert json.loads(capsys.readouterr().out)[0]["first_wrong"]["kind"]


@pytest.mark.unmeasured
def test_flipped_bit_of_file_is_detected_or_changes_no_entry(journal_of_three_runs, tmp_path):
    chance, content = random.Random(1), journal_of_three_runs[0].read_bytes()  # noqa: S311 - by seed
    journal_path = tmp_path / "mission.journal"

    def read(file):
        return [*file.stream()], file.description(), file.runs(), [*file.observations("pose", "log")]

    with closing(JournalFile.read(journal_of_three_runs[0])) as file:
        as_written = read(file)
    for _ in range(rounds(100)):
        offset = chance.randrange(len(content))
        journal_path.write_bytes(
            content[:offset] + bytes([content[offset] ^ 1 << chance.randrange(8)]) + content[offset + 1 :]
        )
        if main(["check", str(journal_path)]) == 0:
            with closing(JournalFile.read(journal_path)) as file:
                assert read(file) == as_written, offset


LINKS = {
    chain.BEGAN: ("run", "link"),
    chain.FACT: ("fact", "link"),
    chain.WATCHED: ("watched", "link"),
    chain.ENDED: ("run", "closed"),
}


def recompute_chain(journal_path):
    """Recompute a chain like an attacker who has altered entries."""
    with closing(sqlite3.connect(journal_path, isolation_level=None)) as base:
        before = chain.START
        for what, number, run, *row, _ in [*chain.chain_entries(base)]:
            before = chain.link_of_entry(before, what, number, run, *row)
            table, link = LINKS[what]
            at = number if what in (chain.FACT, chain.WATCHED) else run
            base.execute(f"UPDATE {table} SET {link} = ? WHERE number = ?", (before, at))  # noqa: S608 - ours


def test_recomputed_chain_is_detected_only_with_head(journal_of_three_runs, journal_path, capsys):
    execute_sql(journal_path, "DELETE FROM fact WHERE number = 3")
    recompute_chain(journal_path)
    assert main(["check", str(journal_path)]) == 0
    assert (
        "Without --head HEX, a recomputed or truncated chain cannot be detected. The head is in the run's summary and in reports"
        in capsys.readouterr().out
    )
    assert main(["check", str(journal_path), "--head", journal_of_three_runs[3]]) == 1
    assert "it was truncated or recomputed" in capsys.readouterr().out


REMOVE_LAST_END = "UPDATE run SET ended = NULL, ending = NULL, status = NULL, reason = '', closed = NULL, ended_behind = NULL WHERE number = 3"


def test_truncated_chain_is_detected_only_with_head(journal_of_three_runs, journal_path, capsys):
    execute_sql(
        journal_path,
        REMOVE_LAST_END,
        "DELETE FROM watched WHERE number > 40",
        "DELETE FROM fact WHERE number > 40",
    )
    assert main(["check", str(journal_path)]) == 0
    assert "not closed because the run crashed" in capsys.readouterr().out
    assert main(["check", str(journal_path), "--head", journal_of_three_runs[3]]) == 1


def test_head_of_earlier_run_does_not_cover_next_run(journal_of_three_runs, capsys):
    assert main(["check", str(journal_of_three_runs[0]), "--head", journal_of_three_runs[1].upper()]) == 1
    assert "is the head of run 1, and does not cover later entries" in capsys.readouterr().out


def test_head_from_run_is_head_of_its_file(journal_of_three_runs, capsys):
    assert (
        main(["check", str(journal_of_three_runs[0]), "--head", journal_of_three_runs[3], "--format", "json"])
        == 0
    )
    (told,) = json.loads(capsys.readouterr().out)
    assert (told["state"], told["head"], told["heads"]["1"], told["notes"]) == (
        "whole",
        journal_of_three_runs[3],
        journal_of_three_runs[1],
        [],
    )
    with closing(JournalFile.read(journal_of_three_runs[0])) as file:
        assert [run.head for run in file.runs()] == [journal_of_three_runs[1], "", journal_of_three_runs[3]]


def test_head_option_requires_one_journal_and_64_digits(journal_path, capsys):
    for arguments in ([str(journal_path), "--head", "0" * 64], ["--head", "abc"]):
        with pytest.raises(SystemExit) as ended:
            main(["check", str(journal_path), *arguments])
        assert ended.value.code == 2
    assert "is not a journal hash, which has 64 hexadecimal digits" in capsys.readouterr().err


def test_several_journals_are_reported_and_worst_sets_exit_status(journal_path, tmp_path, capsys):
    write_run(tmp_path / "other.journal")
    execute_sql(journal_path, "UPDATE fact SET time = 5 WHERE number = 3")
    assert main(["check", str(tmp_path / "other.journal"), str(journal_path)]) == 1
    lines = [line for line in capsys.readouterr().out.splitlines() if not line.startswith(" ")]
    assert lines[0].startswith(f"{tmp_path / 'other.journal'} is unaltered: 16 entries in 1 run, closed")
    assert f"{journal_path} was altered: entry 3 of run 1, zone_visited, 20" in lines[1]


KILLED_RUN = """
import os, signal, sys
from pathlib import Path
from sar_compiler.journal.journal_opening import open_journal
journal = open_journal(Path(sys.argv[1]))
journal.begin({}, {})
for number in range(100):
    journal.record_observation("pose", x=1.0)
    journal.record_event("zone_visited", zone="a")
    journal.record_observation("pose", x=2.0)
os.kill(os.getpid(), signal.SIGKILL)
"""


def test_chain_of_killed_run_is_open_and_continued_by_next_run(tmp_path):
    journal_path = tmp_path / "mission.journal"
    done = subprocess.run([sys.executable, "-c", KILLED_RUN, journal_path], check=False)
    assert done.returncode == -signal.SIGKILL
    found = check_journal(journal_path)
    assert (found.state, found.chain.entries, found.chain.head) == ("open", 299, "")
    assert "not closed because the run crashed" in found.words
    assert check_journal(journal_path, write_run(journal_path)).state == "whole"


def test_journal_of_active_run_can_be_checked(tmp_path):
    journal_path = tmp_path / "mission.journal"
    journal = open_journal(journal_path)
    journal.begin({}, {})
    journal.record_event("zone_visited", zone="a")
    command = [sys.executable, "-m", "sar_compiler.cli.journal_command", "check", journal_path]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (done.returncode, "not closed because the run is still active" in done.stdout) == (0, True)
    journal.close()


def test_no_entry_follows_end_of_run(tmp_path):
    journal_path = tmp_path / "mission.journal"
    journal = open_journal(journal_path)
    journal.begin({}, {})
    journal.end_run(Ending.OVER, 0)
    journal.record_observation("log", text="late")
    journal.record_event("base_reached")
    journal.close()
    assert check_journal(journal_path, journal.head).state == "whole"
    assert read_rows(journal_path) == []


def test_delayed_entries_are_chained_when_written(tmp_path):
    journal_path = tmp_path / "mission.journal"
    journal = open_journal(journal_path)
    journal.begin({}, {})
    journal.record_event("zone_visited", zone="a")
    with closing(sqlite3.connect(journal_path, isolation_level=None)) as other:
        other.execute("BEGIN IMMEDIATE")
        journal.record_observation("pose", x=1.0)
        journal.record_event("zone_visited", zone="b")
        journal.end_run(Ending.OVER, 0)
        assert journal.head == ""
        other.execute("ROLLBACK")
    journal.record_observation("pose", x=2.0)
    journal.close()
    found = check_journal(journal_path, journal.head)
    assert (found.state, found.chain.entries) == ("whole", 4)


def test_entries_in_reserve_are_reported_and_chained_by_next_run(tmp_path, capsys):
    journal_path = tmp_path / "mission.journal"
    journal = open_journal(journal_path)
    journal.begin({}, {})
    with closing(sqlite3.connect(journal_path, isolation_level=None)) as other:
        other.execute("BEGIN IMMEDIATE")
        journal.record_event("zone_visited", zone="b")
        journal.end_run(Ending.STOPPED, 130)
        journal.close()
        other.execute("ROLLBACK")
    assert main(["check", str(journal_path)]) == 0
    assert (
        "1 event in the journal's reserve file will be added to the chain by the next run"
        in capsys.readouterr().out
    )
    found = check_journal(journal_path, write_run(journal_path))
    assert (found.state, found.chain.entries, len(found.chain.heads)) == ("whole", 17, 2)


def test_link_is_computed_as_documented():
    import hashlib
    import struct

    row = Row(7, 1, 1.5, -0.0, "zone_visited", '{"zone": "a"}')
    packed = b"f" + struct.pack(">qq", 7, 1) + struct.pack(">dd", 1.5, 0.0) + struct.pack(">I", 12)
    made = hashlib.sha256(bytes(32) + packed + b"zone_visited" + b'{"zone": "a"}').digest()
    assert chain.link_of_entry(chain.START, chain.FACT, *row) == made


def test_failed_write_does_not_advance_chain(tmp_path):
    file = JournalFile.create(tmp_path / "m.journal")
    run = file.begin_run({}, {}, 0.0)
    head = file.head
    row = Row(1, run, 1.0, 1.0, "pose", "{}")
    with pytest.raises(sqlite3.Error):
        file.write([row, row])
    assert file.head == head
    file.write([row], (), RunEnd(run, 2.0, Ending.OVER, 0, ""))
    file.close()
    assert check_journal(tmp_path / "m.journal", file.head).state == "whole"
