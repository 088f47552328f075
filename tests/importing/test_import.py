"""Tests of the import of runs that BehaviorTree.CPP's loggers or Nav2 recorded."""

import itertools
import json
import random
import re
import sqlite3
import struct
from contextlib import closing
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from sar_compiler.cli.compile import main as compile_command
from sar_compiler.cli.journal_command import main as journal_command
from sar_compiler.importing.btlog import MAGIC
from sar_compiler.journal.database import JournalFile
from sar_compiler.journal.journal_entries import STATUS, Ending

LOGS = sorted(Path("tests/importing/logs").glob("*.btlog"))
FAILED, DONE = (Path(f"examples/recorded_runs/delivery_{how}.btlog") for how in ("failed", "done"))


def import_log(log, folder, *options):
    """Import a log; return the journal."""
    journal = folder / f"{Path(log).stem}.journal"
    assert journal_command(["import", str(log), "-o", str(journal), *options]) == 0
    return journal


def parts_of(log):
    """Return the bytes of a log before its changes, and the changes (microseconds, node number, status)."""
    data = log.read_bytes()
    (length,) = struct.unpack_from("<i", data, len(MAGIC) + 1)
    head = len(MAGIC) + 1 + 4 + length + 8
    changes = [
        (low | high << 32, uid, status) for low, high, uid, status in struct.iter_unpack("<IHHB", data[head:])
    ]
    return data[:head], changes


def log_bytes(head, changes):
    """Return the bytes of a log."""
    return head + b"".join(
        struct.pack("<IHHB", time & 0xFFFFFFFF, time >> 32, uid, status) for time, uid, status in changes
    )


def answer(command, words, capsys):
    """Run a command; return its exit status and its output."""
    capsys.readouterr()
    status = command([str(word) for word in words])
    said = capsys.readouterr()
    return status, said.out + said.err


@pytest.mark.parametrize("log", [*LOGS, FAILED, DONE], ids=lambda log: log.stem)
def test_run_of_cpp_library_conforms_to_tree_in_its_log(log, tmp_path, capsys):
    journal = import_log(log, tmp_path)
    status, said = answer(compile_command, ["conform", f"{journal}.xml", journal], capsys)
    assert (status, "conforms: it is a possible run of the tree" in said) == (0, True), said


@pytest.mark.parametrize(
    ("log", "assumption"),
    [
        ("1096", ", if Thread is a ThreadedAction, which ignores its conditions and scripts"),
        ("coroutine", ", if Coro is a CoroActionNode, which evaluates _while only at its start"),
        ("1058", ""),
    ],
)
def test_leaf_class_is_assumed_only_if_run_does_not_conform_otherwise(log, assumption, tmp_path, capsys):
    journal = import_log(Path(f"tests/importing/logs/{log}.btlog"), tmp_path)
    _, said = answer(compile_command, ["conform", f"{journal}.xml", journal], capsys)
    assert f"conforms: it is a possible run of the tree{assumption}\n" in said


def test_subtree_that_reads_key_of_calling_tree_is_remapped(tmp_path, capsys):
    words = ["import", "tests/importing/logs/9161.btlog", "-o", tmp_path / "j"]
    _, said = answer(journal_command, words, capsys)
    assert "because their scripts read a key before they write it: Tree2" in said
    text = Path(f"{tmp_path}/j.xml").read_text(encoding="utf-8")
    assert text.count("_autoremap") == 1
    assert '<SubTree ID="Tree2" _autoremap="true"/>' in text


def test_subtrees_are_not_remapped_if_run_is_possible_only_without_it(tmp_path, capsys):
    # The Switch2 of Sub2 had no variable, and ticked its default, although another subtree writes the key.
    words = ["import", "tests/importing/logs/300127.btlog", "-o", tmp_path / "j"]
    _, said = answer(journal_command, words, capsys)
    assert "_autoremap" not in said
    assert "_autoremap" not in Path(f"{tmp_path}/j.xml").read_text(encoding="utf-8")


def test_run_with_unknown_control_is_imported(tmp_path, capsys):
    head, changes = parts_of(Path("tests/importing/logs/300127.btlog"))
    xml = head[len(MAGIC) + 5 : -8]
    renamed = xml.replace(b"<WhileDoElse ", b"<MyControl ").replace(b"</WhileDoElse>", b"</MyControl>")
    described = b'<Control ID="MyControl"/>'
    renamed = renamed.replace(b"<TreeNodesModel>", b"<TreeNodesModel>" + described, 1)
    log = tmp_path / "own.btlog"
    size = struct.pack("<i", len(renamed))
    log.write_bytes(log_bytes(head[: len(MAGIC) + 1] + size + renamed + head[-8:], changes))
    status, said = answer(journal_command, ["import", log, "-o", tmp_path / "j"], capsys)
    assert status == 0, said


def test_palette_of_release_that_matches_ports_in_log_is_used(tmp_path, capsys):
    # RoundRobin has wrap_around since Nav2's main.
    words = ["import", "tests/importing/logs/1001.btlog", "-o", tmp_path / "j"]
    assert "--model nav2:main" in answer(journal_command, words, capsys)[1]


def test_why_names_failed_leaf_first_with_chain_and_smallest_change(tmp_path, capsys):
    journal = import_log(FAILED, tmp_path)
    status, said = answer(journal_command, ["why", journal], capsys)
    assert status == 0
    assert f"Likeliest cause:\n  0:06  grasp the box FAILURE  ({journal}.xml:" in said
    assert "The root has failed:\n  0:06  deliver the box FAILURE" in said
    assert "grasp the box SUCCESS instead of FAILURE" in said


def test_two_imported_runs_are_compared(tmp_path, capsys):
    failed, done = import_log(FAILED, tmp_path), import_log(DONE, tmp_path)
    _, said = answer(journal_command, ["why", failed, "--against", done], capsys)
    assert f"{failed}: 0:05  grasp the box FAILURE" in said
    assert f"{done}: 0:04  grasp the box SUCCESS" in said


def test_outcomes_of_imported_run_are_counted_and_predict_its_tree(tmp_path, capsys):
    journal = import_log(DONE, tmp_path)
    status, said = answer(journal_command, ["stats", journal, "--format", "json"], capsys)
    counts = {
        (leaf["path"][-1] if isinstance(leaf["path"], list) else leaf["path"].split("/")[-1]): leaf
        for leaf in json.loads(said)["leaves"]
    }
    assert status == 0
    assert "grasp the box" in counts
    _, shares = answer(journal_command, ["stats", journal, "--format", "yaml"], capsys)
    (tmp_path / "shares.yaml").write_text(shares, encoding="utf-8")
    status, said = answer(
        compile_command, ["predict", f"{journal}.xml", "--outcomes", tmp_path / "shares.yaml"], capsys
    )
    assert (status, "success:" in said) == (0, True), said


def test_tree_file_of_user_provides_locations(tmp_path, capsys):
    own = tmp_path / "mine.xml"
    own.write_bytes(
        Path(f"{import_log(FAILED, tmp_path)}.xml").read_bytes().replace(b"<root", b"<!-- mine -->\n<root")
    )
    (tmp_path / "delivery_failed.journal").unlink()
    journal = import_log(FAILED, tmp_path, "--tree", str(own))
    _, said = answer(journal_command, ["why", journal], capsys)
    assert f"grasp the box FAILURE  ({own}:" in said


def test_different_tree_is_rejected_with_differing_nodes(tmp_path, capsys):
    other = tmp_path / "other.xml"
    text = Path(f"{import_log(FAILED, tmp_path)}.xml").read_text(encoding="utf-8")
    other.write_text(text.replace('name="grasp the box"', 'name="take the box"'), encoding="utf-8")
    (tmp_path / "delivery_failed.journal").unlink()
    words = ["import", FAILED, "-o", tmp_path / "delivery_failed.journal", "--tree", other]
    status, said = answer(journal_command, words, capsys)
    assert status == 2
    assert f"{other} is not the tree of the run. 1 node differs:" in said
    assert "node 10 is 'grasp the box' (Grasp) in the run, but 'take the box' (Grasp)" in said


def test_truncated_log_is_read_to_its_end(tmp_path, capsys):
    log = tmp_path / "cut.btlog"
    log.write_bytes(FAILED.read_bytes()[:-4])
    status, said = answer(journal_command, ["import", log, "-o", tmp_path / "cut.journal"], capsys)
    assert status == 0
    assert f"the log ends at byte {len(log.read_bytes())}, within a status change" in said
    assert "175 status changes" in said


def test_log_of_killed_program_has_no_result(tmp_path, capsys):
    head, changes = parts_of(FAILED)
    log = tmp_path / "killed.btlog"
    log.write_bytes(log_bytes(head, changes[:40]))
    _, said = answer(journal_command, ["why", import_log(log, tmp_path)], capsys)
    assert "The root has not failed." in said


def test_halted_tree_has_one_run_before_and_one_after(tmp_path):
    head, begun, later = log_halted_after_first_drive()
    log = tmp_path / "halted.btlog"
    log.write_bytes(log_bytes(head, [*begun, *later]))
    with JournalFile.open_snapshot(import_log(log, tmp_path)) as file:
        runs = file.runs()
    assert [(run.ending, run.status) for run in runs] == [(Ending.STOPPED, 1), (Ending.OVER, 0)]


def test_ticks_without_pause_between_them_are_distinguished(tmp_path):
    head, changes = parts_of(FAILED)
    log = tmp_path / "busy.btlog"
    log.write_bytes(
        log_bytes(head, [(3 * place, uid, status) for place, (_, uid, status) in enumerate(changes)])
    )

    def ticks(journal):
        with JournalFile.open_snapshot(journal) as file:
            return [
                (each.data["node"], each.data["tick"], each.data["status"])
                for each in file.observations(STATUS)
            ]

    assert ticks(import_log(log, tmp_path)) == ticks(import_log(FAILED, tmp_path))


def test_pause_within_tick_does_not_end_it(tmp_path):
    head, changes = parts_of(FAILED)
    log = tmp_path / "slow.btlog"
    # A Sequence whose child has ended has no RUNNING child: the computer was busy before the next child
    # started.
    at = next(place for place, (_, uid, status) in enumerate(changes) if uid == 8 and status == 2)
    late = [
        (time + (3_000_000 if place > at else 0), uid, status)
        for place, (time, uid, status) in enumerate(changes)
    ]
    log.write_bytes(log_bytes(head, late))
    with (
        JournalFile.open_snapshot(import_log(log, tmp_path)) as file,
        JournalFile.open_snapshot(import_log(FAILED, tmp_path)) as known,
    ):
        assert [each.data for each in file.observations(STATUS)] == [
            each.data for each in known.observations(STATUS)
        ]


def sqlite_log(log, path):
    """Write a log in the format of `SqliteLogger`, with the tree and the changes of another log."""
    head, changes = parts_of(log)
    (start,) = struct.unpack("<q", head[-8:])
    with closing(sqlite3.connect(path)) as file, file:
        file.execute(
            "CREATE TABLE Transitions (timestamp INTEGER PRIMARY KEY NOT NULL, session_id INTEGER NOT NULL, "
            "node_uid INTEGER NOT NULL, duration INTEGER, state INTEGER NOT NULL, extra_data VARCHAR)"
        )
        file.execute(
            "CREATE TABLE Definitions (session_id INTEGER PRIMARY KEY AUTOINCREMENT, date TEXT NOT NULL, xml_tree TEXT NOT NULL)"
        )
        tree = head[len(MAGIC) + 5 : -8].decode()
        file.execute("INSERT INTO Definitions (date, xml_tree) VALUES ('2026-11-29', ?)", (tree,))
        last = 0
        for time, uid, status in changes:
            last = max(last + 1, start + time)
            file.execute("INSERT INTO Transitions VALUES (?, 1, ?, 0, ?, '')", (last, uid, status))
    return path


def test_sqlite_log_is_imported_like_binary_log(tmp_path, capsys):
    log = sqlite_log(FAILED, tmp_path / "run.db3")
    journal = import_log(log, tmp_path)
    _, said = answer(journal_command, ["why", journal, "--against", import_log(FAILED, tmp_path)], capsys)
    assert "grasp the box SUCCESS instead of FAILURE" in said
    assert "In both runs, all nodes had the same statuses in the same order." in said
    status, said = answer(compile_command, ["conform", f"{journal}.xml", journal], capsys)
    assert status == 0, said


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ("DROP TABLE Transitions", "the file is not a log of SqliteLogger: no such table: Transitions"),
        ("DELETE FROM Definitions", "the table Definitions contains no tree"),
        ("UPDATE Definitions SET xml_tree = x'00'", "the table Definitions contains no tree"),
        ("DELETE FROM Transitions", "contains no status change"),
        (
            "UPDATE Transitions SET state = 'x' WHERE rowid % 50 = 0",
            "is not a status change. The rest was skipped",
        ),
    ],
)
def test_damaged_sqlite_log_is_reported(change, reason, tmp_path, capsys):
    log = sqlite_log(FAILED, tmp_path / "run.db3")
    with closing(sqlite3.connect(log)) as file, file:
        file.execute(change)
    status, said = answer(journal_command, ["import", log, "-o", tmp_path / "run.journal"], capsys)
    assert (status, reason in said) == (0 if "rest" in reason else 2, True), said


def test_sqlite_log_with_non_utf_8_schema_is_reported(tmp_path, capsys):
    log = sqlite_log(FAILED, tmp_path / "run.db3")
    log.write_bytes(log.read_bytes().replace(b"CREATE TABLE D", b"CREATE\xffTABLE D"))
    status, said = answer(journal_command, ["import", log, "-o", tmp_path / "run.journal"], capsys)
    assert (status, "the file is not a log of SqliteLogger: " in said) == (2, True), said


def bag_messages(log):
    """Return the messages that Nav2 publishes for the ticks of a log, which long pauses separate."""
    (start,), changes = struct.unpack("<q", parts_of(log)[0][-8:]), parts_of(log)[1]
    names = {
        1: "deliver the box",
        2: "BatteryOk",
        3: "steps",
        4: "drive to the shelf",
        5: "PickUp",
        6: "try three times",
    }
    names |= {
        7: "pick up",
        8: "find the box",
        9: "open",
        10: "grasp the box",
        11: "at most one minute",
        12: "drive to the table",
        13: "Release",
    }
    words = ("IDLE", "RUNNING", "SUCCESS", "FAILURE")
    ticks = [[changes[0]]]
    for before, change in itertools.pairwise(changes):
        if change[0] - before[0] > 50_000:
            ticks.append([])
        ticks[-1].append(change)

    for tick in ticks:
        yield tree_message([(start + time, names[uid], uid, words[status]) for time, uid, status in tick])


def tree_message(changes):
    """Return a message of `behavior_tree_log`; times are in microseconds since 1970."""
    data = bytearray(b"\0\1\0\0" + struct.pack("<iII", 0, 0, len(changes)))

    def align(size):
        data.extend(bytes(-(len(data) - 4) % size))

    def add_text(word):
        align(4)
        data.extend(struct.pack("<I", len(word) + 1) + word.encode() + b"\0")

    for time, name, uid, status in changes:
        align(4)
        data.extend(struct.pack("<iI", time // 1_000_000, time % 1_000_000 * 1000))
        add_text(name)
        align(2)
        data.extend(struct.pack("<H", uid))
        add_text("IDLE")
        add_text(status)
    return bytes(data)


def log_message(time, level, name, text):
    """Return a message of `/rosout`; the time is in seconds since 1970."""
    data = bytearray(b"\0\1\0\0" + struct.pack("<iIB", int(time), int(time % 1 * 1e9), level))
    for word in (name, text, "file.cpp", "function"):
        data.extend(bytes(-len(data) % 4) + struct.pack("<I", len(word) + 1) + word.encode() + b"\0")
    return bytes(data + bytes(-len(data) % 4) + struct.pack("<I", 1))


def write_bag(path, messages, lines=()):
    """Write messages of `behavior_tree_log`, and of `/rosout`, to a bag."""
    topics = [
        ("/behavior_tree_log", "nav2_msgs/msg/BehaviorTreeLog", messages),
        ("/rosout", "rcl_interfaces/msg/Log", lines),
    ]
    if path.suffix == ".db3":
        with closing(sqlite3.connect(path)) as file, file:
            file.execute(
                "CREATE TABLE topics (id INTEGER PRIMARY KEY, name TEXT NOT NULL, type TEXT NOT NULL)"
            )
            file.execute(
                "CREATE TABLE messages (id INTEGER PRIMARY KEY, topic_id INTEGER NOT NULL, timestamp INTEGER NOT NULL, data BLOB NOT NULL)"
            )
            for place, (topic, kind, found) in enumerate(topics, 1):
                file.execute("INSERT INTO topics VALUES (?, ?, ?)", (place, topic, kind))
                rows = [(place, number, data) for number, data in enumerate(found)]
                file.executemany("INSERT INTO messages (topic_id, timestamp, data) VALUES (?, ?, ?)", rows)
        return
    writer_module = pytest.importorskip("mcap.writer")
    with path.open("wb") as stream:
        writer = writer_module.Writer(stream)
        writer.start("ros2", "test")
        for topic, kind, found in topics:
            schema = writer.register_schema(kind, "ros2msg", b"")
            channel = writer.register_channel(topic, "cdr", schema)
            for number, data in enumerate(found):
                writer.add_message(channel, number, data, number)
        writer.finish()


@pytest.mark.parametrize("form", [".mcap", ".db3"])
def test_why_quotes_rosout_line_that_explains_failure_of_action(form, tmp_path, capsys):
    (start,) = struct.unpack("<q", parts_of(FAILED)[0][-8:])
    failed = next(time for time, uid, status in reversed(parts_of(FAILED)[1]) if (uid, status) == (10, 3))
    end = (start + failed) / 1e6
    lines = [
        (end - 60.0, 40, "planner_server", "Failed to create a plan: no valid path found"),
        (end - 0.01, 30, "controller_server", "Control loop missed its desired rate of 20 Hz"),
        (end - 0.01, 40, "gripper", "the object has slipped"),
        (end + 0.01, 20, "controller_server", "Failed to make progress"),
        (end + 60.0, 40, "controller_server", "Failed to make progress"),
    ]
    bag = tmp_path / f"bag{form}"
    messages = [log_message(*line) for line in lines]
    write_bag(bag, bag_messages(FAILED), [messages[0][:20], *messages])
    journal = import_log(bag, tmp_path, "--tree", f"{import_log(FAILED, tmp_path)}.xml")
    _, said = answer(journal_command, ["why", journal], capsys)
    assert 'grasp the box FAILURE, gripper: "the object has slipped"  (' in said
    assert "Failed to" not in said


@pytest.mark.parametrize("form", [".mcap", ".db3"])
def test_nav2_bag_is_imported_with_matching_tree(form, tmp_path, capsys):
    known = import_log(FAILED, tmp_path)
    other = tmp_path / "other.xml"
    other.write_text(
        Path(f"{known}.xml").read_text(encoding="utf-8").replace("grasp the box", "take the box"),
        encoding="utf-8",
    )
    bag = tmp_path / f"bag{form}"
    write_bag(bag, bag_messages(FAILED))
    journal = import_log(bag, tmp_path, "--tree", str(other), "--tree", f"{known}.xml")
    with JournalFile.open_snapshot(journal) as file, JournalFile.open_snapshot(known) as same:
        assert [each.data for each in file.observations(STATUS)] == [
            each.data for each in same.observations(STATUS)
        ]
    status, said = answer(journal_command, ["import", bag, "-o", tmp_path / "none", "--tree", other], capsys)
    assert status == 2
    assert "node 10 is 'grasp the box' in the run, but 'take the box' in the tree" in said
    status, said = answer(journal_command, ["import", bag, "-o", tmp_path / "none"], capsys)
    assert (status, "has no tree. Add --tree TREE" in said) == (2, True), said


@pytest.mark.parametrize("form", [".mcap", ".db3"])
def test_damaged_bag_is_reported(form, tmp_path, capsys):
    known = import_log(FAILED, tmp_path)
    first, second, *others = bag_messages(FAILED)
    bag = tmp_path / f"bag{form}"
    write_bag(bag, [first, second[:40], b"", *others])
    words = ["import", bag, "-o", tmp_path / "j", "--tree", f"{known}.xml"]
    status, said = answer(journal_command, words, capsys)
    assert (status, "message 2 of the type nav2_msgs/msg/BehaviorTreeLog is damaged" in said) == (0, True), (
        said
    )
    bag.write_bytes(bag.read_bytes()[:100])
    status, said = answer(journal_command, words, capsys)
    assert (status, "cannot be imported" in said) == (2, True), said


def test_existing_journal_and_tree_are_not_overwritten(tmp_path, capsys):
    journal = import_log(FAILED, tmp_path)
    status, said = answer(
        journal_command, ["import", FAILED, "-o", journal, "--tree", f"{journal}.xml"], capsys
    )
    assert (status, "already contains a mission" in said) == (2, True), said
    status, said = answer(journal_command, ["import", FAILED, "-o", journal], capsys)
    assert (status, f"{journal}.xml already exists" in said) == (2, True), said


@pytest.mark.parametrize(
    ("data", "reason"),
    [
        (b"", "the file is neither a log of FileLogger2"),
        (MAGIC, "Only version 1 is supported"),
        (MAGIC + b"\x02", "Only version 1 is supported"),
        (MAGIC + b"\x01\x05", "the log ends at byte 20, before the tree"),
        (
            MAGIC + b"\x01\xff\xff\xff\x7f",
            "within the tree, which starts at byte 23 and has 2147483647 bytes",
        ),
        (MAGIC + b"\x01\x01\x00\x00\x00\xff" + bytes(8), "byte 23 of the tree is not UTF-8"),
        (MAGIC + b"\x01\x04\x00\x00\x00<a/>" + b"\xff" * 8, "the start time at byte 27 is not a date"),
        (MAGIC + b"\x01\x04\x00\x00\x00<a/>" + bytes(17), "the tree has no node numbers"),
    ],
)
def test_damaged_log_is_rejected_with_location(data, reason, tmp_path, capsys):
    log = tmp_path / "bad.btlog"
    log.write_bytes(data)
    status, said = answer(journal_command, ["import", log, "-o", tmp_path / "bad.journal"], capsys)
    assert (status, reason in said) == (2, True), said
    assert not (tmp_path / "bad.journal").exists()


@pytest.mark.costly
@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(seed=st.integers(0, 2**32), log=st.sampled_from([FAILED, *LOGS]))
def test_altered_log_is_imported_or_rejected_without_traceback(seed, log, tmp_path_factory, capsys):
    chance, data = random.Random(seed), bytearray(log.read_bytes())  # noqa: S311
    begin = chance.choice([0, len(MAGIC), data.rindex(b"</root>")])
    for _ in range(chance.randint(1, 12)):
        data[chance.randrange(begin, len(data))] = chance.randrange(256)
    if chance.random() < 0.3:
        del data[chance.randrange(len(data)) :]
    folder = tmp_path_factory.mktemp("altered")
    (folder / "altered.btlog").write_bytes(data)
    status, said = answer(journal_command, ["import", folder / "altered.btlog", "-o", folder / "j"], capsys)
    assert status in (0, 1, 2), said
    assert "Traceback" not in said
    if status == 0:
        status, said = answer(journal_command, ["why", folder / "j", "--max-seconds", "5"], capsys)
        assert status == 0, said


@pytest.mark.parametrize(
    ("log", "assumption"),
    [("50359", ", if Compute writes a suitable value to 'k0'"), ("50355", ""), ("50389", "")],
)
def test_values_are_assumed_only_if_needed_and_earlier_runs_are_replayed(log, assumption, tmp_path, capsys):
    journal = import_log(Path(f"tests/importing/logs/{log}.btlog"), tmp_path)
    _, said = answer(compile_command, ["conform", f"{journal}.xml", journal], capsys)
    assert f"conforms: it is a possible run of the tree{assumption}\n" in said


@pytest.mark.parametrize(("log", "at"), [("50355", 4), ("50389", 5)])
def test_impossible_memory_of_earlier_runs_does_not_conform(log, at, tmp_path, capsys):
    head, changes = parts_of(Path(f"tests/importing/logs/{log}.btlog"))
    time, uid, status = changes[at]
    altered = tmp_path / "altered.btlog"
    altered.write_bytes(log_bytes(head, [*changes[:at], (time, uid, 5 - status), *changes[at + 1 :]]))
    journal = import_log(altered, tmp_path)
    _, said = answer(compile_command, ["conform", f"{journal}.xml", journal], capsys)
    assert "does not conform" in said


def log_halted_after_first_drive():
    """Return a log whose program halts the tree in its first drive, and then ticks it to its end."""
    head, changes = parts_of(DONE)
    # Up to the first drive: BatteryOk is reset in each tick, the root and the drive run.
    begun = changes[:6]
    running = [uid for _, uid, status in begun if status == 1]
    time = begun[-1][0]
    halted = [(time + 200_000 + place, uid, 0) for place, uid in enumerate(reversed(running))]
    later = [(when + 1_000_000, uid, status) for when, uid, status in changes]
    return head, begun, [*halted, *later]


def test_run_is_compared_alone_if_earlier_run_is_impossible(tmp_path, capsys):
    head, begun, later = log_halted_after_first_drive()
    for is_altered in (False, True):
        # In the altered log, BatteryOk fails, and the tree continues.
        first = [(time, uid, 3 if status == 2 and is_altered else status) for time, uid, status in begun]
        log = tmp_path / f"{is_altered}.btlog"
        log.write_bytes(log_bytes(head, [*first, *later]))
        journal = import_log(log, tmp_path)
        _, said = answer(compile_command, ["conform", f"{journal}.xml", journal], capsys)
        assumed = (
            ", if nodes and blackboard keep nothing from the earlier runs, because these runs do not conform to the tree"
            if is_altered
            else ""
        )
        assert f"conforms: it is a possible run of the tree{assumed}\n" in said


@pytest.mark.parametrize("log", LOGS[::6], ids=lambda log: log.stem)
def test_changes_of_unknown_nodes_are_ignored(log, tmp_path):
    head, changes = parts_of(log)
    others = tmp_path / "others.btlog"
    others.write_bytes(
        log_bytes(head, [each for change in changes for each in ((change[0], 60_000, 0), change)])
    )
    import_log(others, tmp_path)


@pytest.mark.parametrize("tenth", range(10))
def test_run_with_altered_outcome_does_not_conform(tenth, tmp_path, capsys):
    head, changes = parts_of(FAILED if tenth % 2 else DONE)
    ends = [place for place, (_, uid, status) in enumerate(changes) if uid > 1 and status in (2, 3)]
    at = ends[len(ends) * tenth // 10]
    time, uid, status = changes[at]
    log = tmp_path / "altered.btlog"
    log.write_bytes(log_bytes(head, [*changes[:at], (time, uid, 5 - status), *changes[at + 1 :]]))
    journal = import_log(log, tmp_path)
    status, said = answer(compile_command, ["conform", f"{journal}.xml", journal], capsys)
    assert (status, "does not conform" in said) == (1, True)


NAV2 = Path(__file__).with_name("nav2")


def nav2_messages():
    """Return the messages of `behavior_tree_log` and of `/rosout` that Nav2 1.3.13 published for four goals.

    The file contains a line `message COUNT` for each message of `behavior_tree_log`, followed by its changes
    (microseconds, node and status), and a line `line` for each message of `/rosout` (microseconds, level,
    logger and text). The first message begins with the end of another goal. The four goals are: a goal that
    succeeds, one in an obstacle, one that is canceled during the drive, and again one in an obstacle.
    """
    names = ["", *re.findall(r'name="([^"]*)"', (NAV2 / "goals.xml").read_text(encoding="utf-8"))]
    rows = iter((NAV2 / "goals.txt").read_text(encoding="utf-8").splitlines())
    start, messages, lines = 1_796_008_350, [], []
    for row in rows:
        kind, rest = row.split(maxsplit=1)
        if kind == "line":
            time, level, name, text = rest.split(maxsplit=3)
            lines.append(log_message(start + int(time) / 1e6, int(level), name, text))
            continue
        changes = [next(rows).split() for _ in range(int(rest))]
        messages.append(
            tree_message(
                [
                    (start * 1_000_000 + int(time), names[int(uid)], int(uid), word)
                    for time, uid, word in changes
                ]
            )
        )
    return messages, lines


def nav2_bag(tmp_path):
    bag = tmp_path / "nav2.mcap"
    write_bag(bag, *nav2_messages())
    return bag


def why_goal_ended(number, tmp_path, capsys):
    """Return the output of `why` for one of Nav2's goals, after checking that its run conforms."""
    words = ["--tree", str(NAV2 / "goals.xml"), *(["--run", str(number)] if number else [])]
    journal = import_log(nav2_bag(tmp_path), tmp_path, *words)
    _, said = answer(journal_command, ["why", journal], capsys)
    status, compared = answer(
        compile_command, ["conform", NAV2 / "goals.xml", journal, "--model", "nav2:jazzy"], capsys
    )
    assert status == 0, compared
    return said


def test_each_nav2_goal_is_separate_run(tmp_path, capsys):
    words = ["import", nav2_bag(tmp_path), "-o", tmp_path / "j", "--tree", NAV2 / "goals.xml"]
    status, said = answer(journal_command, words, capsys)
    assert status == 0, said
    for line in (
        "run 1: 4.1 s, the tree returned SUCCESS",
        "run 2: 0.2 s, the tree returned FAILURE",
        "run 3: 1.6 s, the goal was canceled",
        "run 4: 0.2 s, Nav2 has reported 'Goal failed'. planner_server: ",
        "the last tick of the last run is missing, because Nav2 publishes this tick only when the next goal starts",
    ):
        assert line in said
    status, said = answer(journal_command, [*words[:3], tmp_path / "k", *words[4:], "--run", "5"], capsys)
    assert (status, "has no run 5: its last run is run 4" in said) == (2, True), said


def test_end_of_goal_published_with_next_goal_is_explained(tmp_path, capsys):
    said = why_goal_ended(2, tmp_path, capsys)
    cause = (
        'plan FAILURE, planner_server: "GridBased plugin failed to plan from (-1.18, 1.44) to (2.00, 0.00)'
    )
    assert "FAILED: the tree returned FAILURE" in said
    assert cause in said[said.index("The root has failed") :]


def test_canceled_goal_is_not_failure_of_leaf(tmp_path, capsys):
    said = why_goal_ended(3, tmp_path, capsys)
    assert said.startswith("stopped: the goal was canceled")
    assert "FAILURE" not in said


def test_goal_without_last_tick_has_failed_according_to_nav2_log(tmp_path, capsys):
    said = why_goal_ended(None, tmp_path, capsys)
    assert said.startswith(
        "FAILED: Nav2 has reported 'Goal failed'. planner_server: \"GridBased plugin failed to plan"
    )
    # Each failure is explained by the line that was logged while the action ran.
    assert said.count("(-1.17, 1.41)") == 2


def test_bag_with_only_log_of_goal_is_rejected_with_what_to_record(tmp_path, capsys):
    bag = tmp_path / "bag.db3"
    write_bag(bag, [], nav2_messages()[1])
    status, said = answer(
        journal_command, ["import", bag, "-o", tmp_path / "j", "--tree", NAV2 / "goals.xml"], capsys
    )
    assert (status, "Nav2 publishes the last tick of a goal only when the next goal starts" in said) == (
        2,
        True,
    )


def test_recording_that_ends_before_run_is_not_crash(tmp_path, capsys):
    bag = tmp_path / "bag.db3"
    write_bag(bag, nav2_messages()[0])
    journal = import_log(bag, tmp_path, "--tree", str(NAV2 / "goals.xml"))
    _, said = answer(journal_command, ["why", journal], capsys)
    assert said.startswith("stopped: the recording ends before the end of the run")


def test_recording_that_begins_in_middle_of_run_is_reported(tmp_path, capsys):
    bag = tmp_path / "bag.db3"
    write_bag(bag, nav2_messages()[0][1:4])
    words = ["import", bag, "-o", tmp_path / "j", "--tree", NAV2 / "goals.xml"]
    status, said = answer(journal_command, words, capsys)
    assert (status, "the recording begins in the middle of a run" in said) == (0, True), said
