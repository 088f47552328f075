"""Tests of `sar-journal stats`: the outcomes of leaves in journals, how often they occur, and after which time."""

import json
from collections import Counter

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sar_compiler.analysis.sweep import wilson
from sar_compiler.cli.journal_command import main
from sar_compiler.documents.yaml_files import parse_yaml
from sar_compiler.journal.journal_entries import RUN_BEGAN, Ending, JournalEntry
from sar_compiler.journal.journal_opening import open_journal
from sar_compiler.reports.leaf_statistics import RunStatistics, statistics_as_json, statistics_as_yaml
from sar_compiler.runtime.clock import ManualClock
from tests.random_inputs import rounds


def leaf(name, **more):
    return {"class": "a.Leaf", "name": name, "children": [], **more}


TREE = {"class": "a.Sequence", "name": "Main", "children": [leaf("Drive"), leaf("Look")]}
DRIVE, LOOK = 1, 2


def write_run(journal_path, *ticks, tree=TREE):
    """Write a run with ticks 2 s apart, each a list of node statuses: number, status, and a label if one is declared."""
    journal = open_journal(journal_path, resume=journal_path.exists())
    journal.clock = clock = ManualClock(100.0)
    journal.begin({"mission": "patrol", "tree": tree}, {})
    for number, tick in enumerate(ticks, 1):
        clock.advance(2.0)
        for node, status, *label in tick:
            said = {"label": label[0]} if label else {}
            journal.record_observation("status", node=node, tick=number, status=status, message="", **said)
        journal.record_observation("pose", x=1.0, y=1.0, yaw=0.0)
    journal.end_run(Ending.STOPPED, 130)
    journal.close()
    return journal_path


def drives(*answers):
    """Return ticks in which a leaf runs for 2 s and then returns each status and label."""
    return [
        tick for status, label in answers for tick in ([(DRIVE, "RUNNING", "")], [(DRIVE, status, label)])
    ]


@pytest.fixture
def journal_path(tmp_path):
    return tmp_path / "m.journal"


def stats_output(capsys, *arguments):
    assert main(["stats", *map(str, arguments)]) == 0
    return capsys.readouterr().out


def data(capsys, *arguments):
    return json.loads(stats_output(capsys, *arguments, "--format", "json"))


def test_outcomes_have_count_share_interval_and_times(journal_path, capsys):
    write_run(journal_path, *drives(("SUCCESS", "arrived"), ("SUCCESS", "arrived"), ("FAILURE", "blocked")))
    write_run(journal_path, [(DRIVE, "RUNNING", "")], [], [], [(DRIVE, "SUCCESS", "arrived")])
    found = data(capsys, journal_path)
    assert (found["runs"], found["confidence"], found["interval"]) == (2, 0.95, "Wilson")
    (drive,) = found["leaves"]
    assert (drive["path"], drive["count"], drive["retries"], drive["stopped"]) == (["Main", "Drive"], 4, 0, 0)
    arrived, blocked = drive["outcomes"]
    assert (arrived["label"], arrived["count"], arrived["share"]) == ("arrived", 3, 0.75)
    assert arrived["interval"] == pytest.approx(wilson(3, 4, 0.95))
    assert arrived["time"] == {"p5": 2.0, "median": 2.0, "p95": 6.0}
    assert (blocked["status"], blocked["count"]) == ("FAILURE", 1)


def test_journals_are_combined_in_a_table(journal_path, tmp_path, capsys):
    write_run(journal_path, *drives(("SUCCESS", "arrived")))
    write_run(
        tmp_path / "other.journal",
        *drives(("SUCCESS", "arrived"), ("FAILURE", "blocked")),
        [(LOOK, "SUCCESS")],
    )
    lines = stats_output(capsys, journal_path, tmp_path / "other.journal", "--confidence", "0.9").splitlines()
    assert lines[0].split("  ")[0] == "leaf"
    assert "90 % interval" in lines[0]
    assert lines[1].split() == ["Main/Drive", "arrived", "2", "66.7", "%", *lines[1].split()[5:]]
    assert lines[1].split()[-2:] == ["0", "0"]
    assert lines[2].split()[:4] == ["blocked", "1", "33.3", "%"]
    assert lines[3].split()[:5] == ["Main/Look", "SUCCESS", "1", "100.0", "%"]
    assert lines[-1].startswith("2 runs. A share is the part of a leaf's activations that ended")


def test_outcome_after_failure_in_same_run_is_a_retry(journal_path, capsys):
    write_run(
        journal_path,
        *drives(("FAILURE", ""), ("FAILURE", ""), ("SUCCESS", ""), ("SUCCESS", ""), ("FAILURE", "")),
    )
    write_run(journal_path, *drives(("SUCCESS", "")))
    assert data(capsys, journal_path)["leaves"][0]["retries"] == 2


def test_stopped_or_skipped_leaf_has_no_outcome(journal_path, capsys):
    write_run(
        journal_path,
        [(DRIVE, "RUNNING", ""), (LOOK, "SKIPPED")],
        [(DRIVE, "HALTED")],
        [(DRIVE, "RUNNING", "")],
        [(DRIVE, "SKIPPED", "")],
        [(DRIVE, "SUCCESS", "arrived")],
        [(DRIVE, "IDLE")],
        [(DRIVE, "RUNNING", "")],
    )
    drive, look = data(capsys, journal_path)["leaves"]
    assert (drive["count"], drive["stopped"], look["count"], look["outcomes"]) == (1, 1, 0, [])
    assert drive["outcomes"][0]["time"]["median"] == 4.0
    assert "Main/Look" in stats_output(capsys, journal_path)


def test_journal_without_outcomes_states_so(journal_path, capsys):
    write_run(journal_path)
    assert stats_output(capsys, journal_path) == "1 run. No leaf has returned a result.\n"
    assert parse_yaml(stats_output(capsys, journal_path, "--format", "yaml"), "s.yaml", "").root.data == {
        "outcomes": {}
    }


@pytest.mark.parametrize(
    ("children", "words"),
    [
        ([leaf("Drive"), leaf("Fly")], "'Fly' (a.Leaf) replaces 'Look' (a.Leaf)"),
        ([leaf("Drive"), leaf("Look", attributes={"x": 2})], "'Look' has different attributes"),
        ([leaf("Drive")], "the tree has 2 nodes instead of 3"),
    ],
)
def test_journal_of_other_tree_is_rejected_with_difference(journal_path, tmp_path, capsys, children, words):
    write_run(journal_path)
    other = write_run(tmp_path / "other.journal", tree={**TREE, "children": children})
    assert main(["stats", str(journal_path), str(other)]) == 2
    assert f"{other} and {journal_path} record different trees: {words}. " in capsys.readouterr().err


def test_tree_with_moved_file_is_the_same_tree(journal_path, tmp_path, capsys):
    write_run(journal_path)
    moved = {**TREE, "children": [leaf("Drive", file="/a.xml", line=7), leaf("Look")]}
    assert data(capsys, journal_path, write_run(tmp_path / "other.journal", tree=moved))["runs"] == 2


def test_assumptions_of_declared_outcomes_have_probability_and_time(journal_path, capsys):
    write_run(
        journal_path, *drives(*[("SUCCESS", "arrived")] * 9, ("FAILURE", "blocked")), [(LOOK, "SUCCESS")]
    )
    text = stats_output(capsys, journal_path, "--format", "yaml")
    assert parse_yaml(text, "s.yaml", "").root.data == {
        "outcomes": {
            "Main/Drive": [
                {"outcome": "arrived", "p": [0.5958, 0.9821], "sec": [2.0, 2.0]},
                {"outcome": "blocked", "p": [0.0179, 0.4042], "sec": [2.0, 2.0]},
            ]
        }
    }
    assert "# Fewer than 10 results, so no assumption is written: Main/Look (1)" in text
    assert '"Main/Drive":  # 10 outcomes' in text


def test_assumptions_of_undeclared_leaf_include_unseen_failure(journal_path, capsys):
    write_run(journal_path, *[tick for _ in range(10) for tick in ([(LOOK, "SUCCESS")], [(LOOK, "IDLE")])])
    assert parse_yaml(stats_output(capsys, journal_path, "--format", "yaml"), "s.yaml", "").root.data[
        "outcomes"
    ] == {"Main/Look": [{"status": "SUCCESS", "p": [0.7225, 1.0]}, {"status": "FAILURE", "p": [0.0, 0.2775]}]}


def test_assumptions_of_running_leaf_have_duration(journal_path, capsys):
    write_run(journal_path, *[tick for _ in range(10) for tick in ([(LOOK, "RUNNING")], [(LOOK, "SUCCESS")])])
    (look,) = (
        parse_yaml(stats_output(capsys, journal_path, "--format", "yaml"), "s.yaml", "")
        .root.data["outcomes"]
        .values()
    )
    assert look[0]["sec"] == [2.0, 2.0]
    assert "sec" not in look[1]
    assert look[2] == "RUNNING"


def test_line_break_or_slash_in_name_is_preserved(journal_path, capsys):
    names = [leaf("Dri\nve"), leaf("a/b: {"), leaf("few\n- x")]
    ticks = [
        tick for _ in range(10) for tick in ([(1, "SUCCESS"), (2, "SUCCESS")], [(1, "IDLE"), (2, "IDLE")])
    ]
    write_run(journal_path, *ticks, [(3, "SUCCESS")], tree={**TREE, "children": names})
    answers = parse_yaml(stats_output(capsys, journal_path, "--format", "yaml"), "s.yaml", "").root.data[
        "outcomes"
    ]
    assert [*answers] == ["Main/Dri\nve", "a/b: {"]


ANSWERS = st.lists(
    st.tuples(st.sampled_from(["SUCCESS", "FAILURE"]), st.sampled_from(["", "a", "b"]), st.integers(0, 3))
)


@settings(max_examples=rounds(50))
@given(ANSWERS, st.floats(0.5, 0.999))
def test_all_outcomes_are_counted_and_intervals_permit_a_sum_of_one(answers, confidence):
    entries = [JournalEntry(0, 1, 0.0, 0.0, RUN_BEGAN, {"tree": TREE, "run": {}})]
    tick = 0
    for status, label, running in answers:
        for now in ["RUNNING"] * min(running, 1) + [status]:
            tick += max(1, running if now == status else 1)
            data = {"node": LOOK, "tick": tick, "status": now, "label": label if now == status else ""}
            entries.append(JournalEntry(tick, 1, 0.0, float(tick), "status", data))
    found = RunStatistics()
    found.add(entries)
    leaves = json.loads(statistics_as_json(found, confidence))["leaves"]
    counted = {(each["status"], each["label"]): each["count"] for look in leaves for each in look["outcomes"]}
    assert counted == Counter((status, label) for status, label, _ in answers)
    for look in leaves:
        lows, highs = zip(*(each["interval"] for each in look["outcomes"]), strict=True)
        assert sum(lows) <= 1.0 + 1e-9 <= sum(highs) + 2e-9
    parse_yaml(statistics_as_yaml(found, confidence), "s.yaml", "")


LIMITED = {"class": "a.Timeout", "name": "Limit", "children": [leaf("Drive")]}


def test_expired_time_limits_are_counted_as_decisions(journal_path, capsys):
    expired = [
        [(1, "RUNNING", ""), (0, "RUNNING")],
        [],
        [(0, "FAILURE"), (1, "HALTED")],
    ]
    write_run(journal_path, *expired, *expired, tree=LIMITED)
    (decision,) = data(capsys, journal_path)["decisions"]
    assert (decision["path"], decision["status"], decision["count"]) == (["Limit"], "FAILURE", 2)
    assert decision["time"]["median"] == 4.0
    assert ["Limit", "FAILURE", "2", "4.0", "s"] in [
        line.split() for line in stats_output(capsys, journal_path).splitlines()
    ]
