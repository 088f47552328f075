"""Tests of `sar-journal show` and `sar-journal report`, as text and as JSON."""

import json

import pytest

from sar_compiler.cli.journal_command import main
from sar_compiler.journal.database import JournalFile
from sar_compiler.journal.journal_entries import Ending
from sar_compiler.journal.journal_opening import open_journal
from sar_compiler.runtime.clock import ManualClock

TREE = {
    "name": "Mission",
    "children": [{"name": "Drive", "children": []}, {"name": "Search", "children": []}],
}


@pytest.fixture
def journal_path(tmp_path):
    """Return the journal of a mission that was stopped, resumed and completed."""
    journal_path = tmp_path / "mission.journal"
    for ending, status, reason in ((Ending.STOPPED, 130, ""), (Ending.OVER, 0, "Mission complete.")):
        journal = open_journal(journal_path, resume=ending is Ending.OVER)
        journal.clock = clock = ManualClock(100.0)
        journal.begin({"mission": "search_and_rescue", "tree": TREE}, {})
        clock.advance(3.5)
        journal.record_event("zone_searched", zone="zone_a\x1b[2J\n", survivor=(-2.5, 3.2))
        journal.record_observation("status", node=2, status="SUCCESS", message="\u202e")
        journal.end_run(ending, status, reason)
        journal.close()
    return journal_path


def show(capsys, *arguments):
    assert main(["show", *map(str, arguments)]) == 0
    return capsys.readouterr().out


def test_show_lists_events_of_each_run_with_time(journal_path, capsys):
    lines = show(capsys, journal_path).splitlines()
    assert lines[0] == "search_and_rescue, complete"
    assert lines[1].startswith("run 1, started 20")
    assert lines[1].endswith(", stopped with status 130:")
    assert lines[2] == r"     0:03  zone_searched  zone zone_a\x1b[2J\n, survivor (-2.50, 3.20)"
    assert lines[3].endswith(", over with status 0, Mission complete.:")


def test_show_all_lists_observations_with_node_names(journal_path, capsys):
    assert "status" not in show(capsys, journal_path).replace("with status", "")
    assert "node 'Search', status SUCCESS" in show(capsys, journal_path, "--all")


def test_show_all_names_leaf_that_recorded_event(tmp_path, capsys):
    journal = open_journal(tmp_path / "mission.journal")
    journal.begin({"tree": TREE}, {})
    journal.leaf_in_hand = lambda: {"leaf": 0, "tick": 3}
    journal.record_event("base_reached")
    journal.close()
    assert f"changed       leaf '{TREE['name']}', tick 3" in show(
        capsys, tmp_path / "mission.journal", "--all"
    )


def test_json_contains_all_data(journal_path, capsys):
    text = show(capsys, journal_path, "--format", "json", "--all")
    assert "\x1b" not in text
    assert r"\u202e" in text
    data = json.loads(show(capsys, journal_path, "--format", "json"))
    assert (data["state"], data["condition"]["word"]) == ("over", "complete")
    assert data["tree"] == TREE
    assert [run["ending"] for run in data["runs"]] == ["stopped", "over"]
    assert [fact["data"] for fact in data["facts"]] == [
        {"zone": "zone_a\x1b[2J\n", "survivor": [-2.5, 3.2]}
    ] * 2
    assert "watched" not in data
    watched = json.loads(show(capsys, journal_path, "--format", "json", "--all"))["watched"]
    assert [entry["kind"] for entry in watched] == ["status", "status"]


def test_active_mission_is_shown_as_working(tmp_path, capsys):
    journal = open_journal(tmp_path / "mission.journal")
    journal.begin({"mission": None}, {})
    journal.record_event("base_reached")
    out = show(capsys, tmp_path / "mission.journal")
    assert out.startswith("a tree without a mission, working\n")
    assert "base_reached" in out
    journal.close()


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (None, "cannot be used: No such file or directory"),
        ("", "is a database, but not the journal of a mission"),
        ("text", "cannot be used: file is not a database. It may be damaged, or not a journal"),
    ],
)
def test_file_that_is_not_a_journal_is_an_error(tmp_path, capsys, content, words):
    journal_path = tmp_path / "other"
    if content is not None:
        journal_path.write_text(content, encoding="utf-8")
    assert main(["show", str(journal_path)]) == 2
    assert f"{journal_path} {words}" in capsys.readouterr().err


def test_empty_journal_has_report(tmp_path):
    JournalFile.create(tmp_path / "m.journal").close()
    assert main(["report", str(tmp_path / "m.journal"), "-o", str(tmp_path / "r.html")]) == 0
    assert "not begun" in (tmp_path / "r.html").read_text(encoding="utf-8")


def test_report_is_written_in_each_requested_form(tmp_path, capsys):
    journal = open_journal(tmp_path / "m.journal")
    journal.begin({"mission": "patrol", "tree": {"class": "x", "name": "Main", "children": []}}, {})
    journal.record_event("zone_visited", zone="zone_a")
    journal.end_run(Ending.OVER, 0)
    journal.close()
    out = tmp_path / "r.html", tmp_path / "r.json"
    assert main(["report", str(tmp_path / "m.journal"), "-o", *map(str, out)]) == 0
    assert "zone_a" in out[0].read_text(encoding="utf-8")
    assert json.loads(out[1].read_text(encoding="utf-8"))["facts"][0]["data"] == {"zone": "zone_a"}
    assert main(["report", str(tmp_path / "m.journal"), "-o", str(tmp_path / "r.cot")]) == 1
    assert "Add georeference" in capsys.readouterr().err
