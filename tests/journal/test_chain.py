"""A journal that nobody alters unseen: what is found in its chain, and what is said of it."""

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
from tests.chance import rounds

TABLES = "fact", "watched"
COLUMNS = "number, run, wall, time, kind, data, link"


def fly(place, *, ends=True, zones=4):
    """Write a run as a mission does; return the head of its chain."""
    journal = open_journal(place, resume=place.exists())
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
def flown(tmp_path_factory):
    """A mission that was stopped, broke off, and was stopped again; with the heads of the first and the last run."""
    place = tmp_path_factory.mktemp("flown") / "mission.journal"
    return place, fly(place), fly(place, ends=False), fly(place)


@pytest.fixture
def place(flown, tmp_path):
    return shutil.copy(flown[0], tmp_path / "mission.journal")


def verdict(place, head=None):
    return CheckedJournal.check(place, head)


def change(place, *statements):
    with closing(sqlite3.connect(place, isolation_level=None)) as base:
        for statement in statements:
            base.execute(*statement) if isinstance(statement, tuple) else base.execute(statement)


def entries(place):
    with closing(sqlite3.connect(place)) as base:
        tables = [
            [(name, *row) for row in base.execute(f"SELECT {COLUMNS} FROM {name}")]  # noqa: S608 - the test's own
            for name in TABLES
        ]
    return sorted((row for table in tables for row in table), key=lambda row: row[1])


def test_a_journal_is_whole_over_its_runs_and_closed_by_the_last_end(flown):
    place, first, broken, last = flown
    found = verdict(place, last)
    assert (found.state, found.chain.entries, found.chain.head) == ("whole", 48, last)
    assert found.chain.heads == {1: first, 3: last}
    assert broken == ""


def test_both_kinds_are_chained_in_the_order_in_which_things_happened(place):
    kinds = [kind for kind, *_ in entries(place)[:5]]
    assert kinds == ["watched", "watched", "fact", "watched", "watched"]
    assert verdict(place).is_good


def _flipped(row, chance):
    """Return an entry with one bit of one column changed; and its table."""
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
    """Return statements that alter an entry, and the numbers of which one must be the first that is wrong."""
    place = chance.randrange(len(rows) - 1)
    table, number, *columns = rows[place]
    following = rows[place + 1][1]
    if how == "flipped":
        return [_flipped(rows[place], chance)], {number, following}
    if how == "removed":
        return [f"DELETE FROM {table} WHERE number = {number}"], {number, following}  # noqa: S608 - the test's own
    if how == "swapped":
        other = chance.choice([row for row in rows if row[0] == table and row[5:7] != rows[place][5:7]])
        update = (
            f"UPDATE {table} SET run = ?, wall = ?, time = ?, kind = ?, data = ?, link = ? WHERE number = ?"  # noqa: S608 - the test's own
        )
        return [(update, (*columns, other[1])), (update, (*other[2:], number))], {min(number, other[1])}
    # Between two entries, or before the first one; the others make room.
    moves = [f"UPDATE {each} SET number = -number WHERE number >= {number}" for each in TABLES]  # noqa: S608 - the test's own
    back = [f"UPDATE {each} SET number = 1 - number WHERE number < 0" for each in TABLES]  # noqa: S608 - the test's own
    link = chance.choice([None, columns[-1], chance.randbytes(32)])
    values = (number, columns[0], columns[1], columns[2], "zone_visited", '{"zone": "zone_9"}', link)
    insert = (f"INSERT INTO {chance.choice(TABLES)} VALUES (?, ?, ?, ?, ?, ?, ?)", values)  # noqa: S608 - the test's own
    return [*moves, *back, insert], {number}


@pytest.mark.unmeasured
@pytest.mark.parametrize("how", ["flipped", "removed", "swapped", "inserted"])
def test_whatever_is_altered_inside_the_chain_is_found_with_the_first_entry_that_is_wrong(
    flown, tmp_path, how
):
    chance = random.Random(how)  # noqa: S311 - by seed
    rows = entries(flown[0])
    place = tmp_path / "mission.journal"
    for _ in range(rounds(80)):
        shutil.copy(flown[0], place)
        statements, first = _alter(how, rows, chance)
        change(place, *statements)
        found = verdict(place)
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
def test_nothing_in_a_row_is_outside_of_the_chain(place, statement, capsys):
    change(place, statement)
    assert verdict(place).state == "altered"
    assert main(["check", str(place)]) == 1
    out = capsys.readouterr().out
    assert "was altered: " in out
    assert main(["check", str(place), "--format", "json"]) == 1
    assert json.loads(capsys.readouterr().out)[0]["first_wrong"]["kind"]


@pytest.mark.unmeasured
def test_a_byte_of_the_file_is_found_or_changes_nothing_that_is_read(flown, tmp_path):
    chance, content = random.Random(1), flown[0].read_bytes()  # noqa: S311 - by seed
    place = tmp_path / "mission.journal"

    def read(file):
        return [*file.stream()], file.description(), file.runs(), [*file.observations("pose", "log")]

    with closing(JournalFile.read(flown[0])) as file:
        as_written = read(file)
    for _ in range(rounds(100)):
        offset = chance.randrange(len(content))
        place.write_bytes(
            content[:offset] + bytes([content[offset] ^ 1 << chance.randrange(8)]) + content[offset + 1 :]
        )
        if main(["check", str(place)]) == 0:
            with closing(JournalFile.read(place)) as file:
                assert read(file) == as_written, offset


LINKS = {
    chain.BEGAN: ("run", "link"),
    chain.FACT: ("fact", "link"),
    chain.WATCHED: ("watched", "link"),
    chain.ENDED: ("run", "closed"),
}


def anew(place):
    """Compute a chain anew, as somebody does who has altered what is in it."""
    with closing(sqlite3.connect(place, isolation_level=None)) as base:
        before = chain.START
        for what, number, run, *row, _ in [*chain.chain_entries(base)]:
            before = chain.link_of_entry(before, what, number, run, *row)
            table, link = LINKS[what]
            at = number if what in (chain.FACT, chain.WATCHED) else run
            base.execute(f"UPDATE {table} SET {link} = ? WHERE number = ?", (before, at))  # noqa: S608 - ours


def test_a_chain_that_was_computed_anew_is_found_with_the_head_and_only_with_it(flown, place, capsys):
    change(place, "DELETE FROM fact WHERE number = 3")
    anew(place)
    assert main(["check", str(place)]) == 0
    assert (
        "Without --head HEX, a recomputed or truncated chain cannot be detected. The head is in the run's summary and in reports"
        in capsys.readouterr().out
    )
    assert main(["check", str(place), "--head", flown[3]]) == 1
    assert "it was truncated or recomputed" in capsys.readouterr().out


CUT = "UPDATE run SET ended = NULL, ending = NULL, status = NULL, reason = '', closed = NULL, ended_behind = NULL WHERE number = 3"


def test_an_end_that_was_cut_off_is_found_with_the_head_and_only_with_it(flown, place, capsys):
    change(place, CUT, "DELETE FROM watched WHERE number > 40", "DELETE FROM fact WHERE number > 40")
    assert main(["check", str(place)]) == 0
    assert "not closed because the run crashed" in capsys.readouterr().out
    assert main(["check", str(place), "--head", flown[3]]) == 1


def test_the_head_of_an_earlier_run_does_not_vouch_for_the_next_one(flown, capsys):
    assert main(["check", str(flown[0]), "--head", flown[1].upper()]) == 1
    assert "is the head of run 1, and does not cover later entries" in capsys.readouterr().out


def test_the_head_that_the_run_has_told_is_that_of_its_file(flown, capsys):
    assert main(["check", str(flown[0]), "--head", flown[3], "--format", "json"]) == 0
    (told,) = json.loads(capsys.readouterr().out)
    assert (told["state"], told["head"], told["heads"]["1"], told["notes"]) == (
        "whole",
        flown[3],
        flown[1],
        [],
    )
    with closing(JournalFile.read(flown[0])) as file:
        assert [run.head for run in file.runs()] == [flown[1], "", flown[3]]


def test_a_head_is_that_of_one_journal_and_has_64_digits(place, capsys):
    for arguments in ([str(place), "--head", "0" * 64], ["--head", "abc"]):
        with pytest.raises(SystemExit) as ended:
            main(["check", str(place), *arguments])
        assert ended.value.code == 2
    assert "is not a journal hash, which has 64 hexadecimal digits" in capsys.readouterr().err


def test_several_journals_are_told_each_and_the_worst_counts(place, tmp_path, capsys):
    fly(tmp_path / "other.journal")
    change(place, "UPDATE fact SET time = 5 WHERE number = 3")
    assert main(["check", str(tmp_path / "other.journal"), str(place)]) == 1
    lines = [line for line in capsys.readouterr().out.splitlines() if not line.startswith(" ")]
    assert lines[0].startswith(f"{tmp_path / 'other.journal'} is unaltered: 16 entries in 1 run, closed")
    assert f"{place} was altered: entry 3 of run 1, zone_visited, 20" in lines[1]


KILLED = """
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


def test_what_sigkill_has_broken_off_is_an_open_chain_that_the_next_run_goes_on_with(tmp_path):
    place = tmp_path / "mission.journal"
    done = subprocess.run([sys.executable, "-c", KILLED, place], check=False)
    assert done.returncode == -signal.SIGKILL
    found = verdict(place)
    assert (found.state, found.chain.entries, found.chain.head) == ("open", 299, "")
    assert "not closed because the run crashed" in found.words
    assert verdict(place, fly(place)).state == "whole"


def test_a_journal_that_is_written_just_now_is_checked_too(tmp_path):
    place = tmp_path / "mission.journal"
    journal = open_journal(place)
    journal.begin({}, {})
    journal.record_event("zone_visited", zone="a")
    command = [sys.executable, "-m", "sar_compiler.cli.journal_command", "check", place]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (done.returncode, "not closed because the run is still active" in done.stdout) == (0, True)
    journal.close()


def test_nothing_comes_behind_the_end_of_a_run(tmp_path):
    place = tmp_path / "mission.journal"
    journal = open_journal(place)
    journal.begin({}, {})
    journal.end_run(Ending.OVER, 0)
    journal.record_observation("log", text="late")
    journal.record_event("base_reached")
    journal.close()
    assert verdict(place, journal.head).state == "whole"
    assert entries(place) == []


def test_what_could_not_be_written_is_chained_once_it_is(tmp_path):
    place = tmp_path / "mission.journal"
    journal = open_journal(place)
    journal.begin({}, {})
    journal.record_event("zone_visited", zone="a")
    with closing(sqlite3.connect(place, isolation_level=None)) as other:
        other.execute("BEGIN IMMEDIATE")
        journal.record_observation("pose", x=1.0)
        journal.record_event("zone_visited", zone="b")
        journal.end_run(Ending.OVER, 0)
        assert journal.head == ""
        other.execute("ROLLBACK")
    journal.record_observation("pose", x=2.0)
    journal.close()
    found = verdict(place, journal.head)
    assert (found.state, found.chain.entries) == ("whole", 4)


def test_what_waits_in_the_reserve_is_said_and_chained_by_the_next_run(tmp_path, capsys):
    place = tmp_path / "mission.journal"
    journal = open_journal(place)
    journal.begin({}, {})
    with closing(sqlite3.connect(place, isolation_level=None)) as other:
        other.execute("BEGIN IMMEDIATE")
        journal.record_event("zone_visited", zone="b")
        journal.end_run(Ending.STOPPED, 130)
        journal.close()
        other.execute("ROLLBACK")
    assert main(["check", str(place)]) == 0
    assert (
        "1 event in the journal's reserve file will be added to the chain by the next run"
        in capsys.readouterr().out
    )
    found = verdict(place, fly(place))
    assert (found.state, found.chain.entries, len(found.chain.heads)) == ("whole", 17, 2)


def test_a_link_is_what_the_page_says_of_it():
    import hashlib
    import struct

    row = Row(7, 1, 1.5, -0.0, "zone_visited", '{"zone": "a"}')
    packed = b"f" + struct.pack(">qq", 7, 1) + struct.pack(">dd", 1.5, 0.0) + struct.pack(">I", 12)
    made = hashlib.sha256(bytes(32) + packed + b"zone_visited" + b'{"zone": "a"}').digest()
    assert chain.link_of_entry(chain.START, chain.FACT, *row) == made


def test_what_was_written_by_halves_moves_the_chain_on_by_nothing(tmp_path):
    file = JournalFile.create(tmp_path / "m.journal")
    run = file.begin_run({}, {}, 0.0)
    head = file.head
    row = Row(1, run, 1.0, 1.0, "pose", "{}")
    with pytest.raises(sqlite3.Error):
        file.write([row, row])
    assert file.head == head
    file.write([row], (), RunEnd(run, 2.0, Ending.OVER, 0, ""))
    file.close()
    assert verdict(tmp_path / "m.journal", file.head).state == "whole"
