"""`sar-journal`: what a mission has left behind, in words and as JSON."""

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
def place(tmp_path):
    """A mission that was stopped, and resumed, and is over."""
    place = tmp_path / "mission.journal"
    for ending, status, reason in ((Ending.STOPPED, 130, ""), (Ending.OVER, 0, "Mission complete.")):
        journal = open_journal(place, resume=ending is Ending.OVER)
        journal.clock = clock = ManualClock(100.0)
        journal.begin({"mission": "search_and_rescue", "tree": TREE}, {})
        clock.advance(3.5)
        journal.record_event("zone_searched", zone="zone_a\x1b[2J\n", survivor=(-2.5, 3.2))
        journal.record_observation("status", node=2, status="SUCCESS", message="\u202e")
        journal.end_run(ending, status, reason)
        journal.close()
    return place


def shown(capsys, *arguments):
    assert main(["show", *map(str, arguments)]) == 0
    return capsys.readouterr().out


def test_the_facts_of_each_run_are_told_with_their_time(place, capsys):
    lines = shown(capsys, place).splitlines()
    assert lines[0] == "search_and_rescue, complete"
    assert lines[1].startswith("run 1, started 20")
    assert lines[1].endswith(", stopped with status 130:")
    assert lines[2] == r"     0:03  zone_searched  zone zone_a\x1b[2J\n, survivor (-2.50, 3.20)"
    assert lines[3].endswith(", over with status 0, Mission complete.:")


def test_what_was_watched_is_told_on_request_with_the_names_of_nodes(place, capsys):
    assert "status" not in shown(capsys, place).replace("with status", "")
    assert "node 'Search', status SUCCESS" in shown(capsys, place, "--all")


def test_the_leaf_that_has_noted_a_fact_is_told_by_its_name(tmp_path, capsys):
    journal = open_journal(tmp_path / "mission.journal")
    journal.begin({"tree": TREE}, {})
    journal.leaf_in_hand = lambda: {"leaf": 0, "tick": 3}
    journal.record_event("base_reached")
    journal.close()
    assert f"changed       leaf '{TREE['name']}', tick 3" in shown(
        capsys, tmp_path / "mission.journal", "--all"
    )


def test_json_has_everything_as_it_is(place, capsys):
    text = shown(capsys, place, "--format", "json", "--all")
    assert "\x1b" not in text
    assert r"\u202e" in text
    data = json.loads(shown(capsys, place, "--format", "json"))
    assert (data["state"], data["condition"]["word"]) == ("over", "complete")
    assert data["tree"] == TREE
    assert [run["ending"] for run in data["runs"]] == ["stopped", "over"]
    assert [fact["data"] for fact in data["facts"]] == [
        {"zone": "zone_a\x1b[2J\n", "survivor": [-2.5, 3.2]}
    ] * 2
    assert "watched" not in data
    watched = json.loads(shown(capsys, place, "--format", "json", "--all"))["watched"]
    assert [entry["kind"] for entry in watched] == ["status", "status"]


def test_a_mission_that_runs_is_told_as_running(tmp_path, capsys):
    journal = open_journal(tmp_path / "mission.journal")
    journal.begin({"mission": None}, {})
    journal.record_event("base_reached")
    out = shown(capsys, tmp_path / "mission.journal")
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
def test_what_is_no_journal_is_said(tmp_path, capsys, content, words):
    place = tmp_path / "other"
    if content is not None:
        place.write_text(content, encoding="utf-8")
    assert main(["show", str(place)]) == 2
    assert f"{place} {words}" in capsys.readouterr().err


def test_a_journal_in_which_nothing_has_begun_has_a_report_too(tmp_path):
    JournalFile.create(tmp_path / "m.journal").close()
    assert main(["report", str(tmp_path / "m.journal"), "-o", str(tmp_path / "r.html")]) == 0
    assert "not begun" in (tmp_path / "r.html").read_text(encoding="utf-8")


def test_a_report_is_written_of_a_journal_in_each_form_that_is_asked_for(tmp_path, capsys):
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
