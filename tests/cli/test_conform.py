"""Tests of `sar-compile conform` on journals of runs with stub leaves."""

import json
import sqlite3
from contextlib import closing

import pytest

from sar_compiler.budget import Budget
from sar_compiler.compiler.outline import outline
from sar_compiler.journal.journal_entries import Ending
from sar_compiler.journal.journal_opening import open_journal
from sar_compiler.loaded_tree import load
from tests.cli.command_runner import press_ctrl_c, run
from tests.trees import document
from tests.views.recorded_runs import REGISTRY, ScriptedPolicy, run_and_record, simulated

BODY = '<Sequence><A name="Drive"/><X name="Look"/><Y name="Tell"/></Sequence>'
NODES = ("--nodes", "tests.analysis.verify.leaves")
PROPERTIES = "properties: {nothing is told: {never: Tell counted}, something is: {after: Drive SUCCESS, eventually: Tell counted}}"


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "tree.xml").write_text(document(BODY), encoding="utf-8")
    (tmp_path / "p.yaml").write_text(PROPERTIES, encoding="utf-8")
    return tmp_path


@pytest.fixture
def record_run(folder, monkeypatch):
    """Return a function that runs the tree, and returns the journal with the outline of the tree on a robot."""

    def record(name="m.journal", outcomes=None, **about):
        path = folder / name
        tree = load(folder / "tree.xml", registry=REGISTRY).preview()
        monkeypatch.setattr("tests.views.recorded_runs.outline", lambda _: outline(tree))
        about = {"tree_file": str(folder / "tree.xml"), "tree_id": "Main", **about}
        with closing(open_journal(path)) as journal:
            run_and_record(
                simulated(folder / "tree.xml"),
                ScriptedPolicy(**(outcomes or {"Tell": ["counted"]})),
                journal,
                **about,
            )
        return path

    return record


@pytest.fixture
def conform(folder, capsys):
    def conform(*journals, options=("--properties", "p.yaml")):
        words = [folder / word if str(word).endswith(".yaml") else word for word in options]
        return run(capsys, "conform", folder / "tree.xml", *journals, *NODES, *words)

    return conform


def test_conforming_run_has_status_0(conform, record_run):
    status, out, err = conform(record_run(), options=())
    assert (status, err) == (0, "")
    assert out.endswith("m.journal: run 1, over, 1 tick\nconforms: it is a possible run of the tree\n")


def test_violated_property_is_reported_with_event_and_location(conform, record_run, folder):
    status, out, _ = conform(record_run())
    assert status == 1
    assert "2 properties: 1 kept, 1 violated" in out
    assert f"nothing is told: violated by Tell counted in tick 1, 0:00  ({folder}/tree.xml:" in out
    assert "0:00  tick    1  Look SUCCESS\n" in out


def test_json_output_has_same_content(conform, record_run):
    status, out, _ = conform(record_run(), options=("--properties", "p.yaml", "--format", "json"))
    told = json.loads(out)
    assert (status, told["fine"]) == (1, False)
    (one,) = told["runs"]
    assert (one["run"], one["end"], one["conforms"], one["misfit"]) == (1, "over", True, None)
    broken, kept = one["properties"]
    assert (broken["fate"], broken["event"], broken["tick"]) == ("violated", "Tell counted", 1)
    assert [each[1:] for each in broken["run"]] == [[1, 1, "SUCCESS"], [1, 2, "SUCCESS"], [1, 3, "SUCCESS"]]
    assert (kept["fate"], kept["run"]) == ("kept", [])


def test_facts_start_with_values_of_run_unless_set_on_command_line(conform, record_run):
    # With f at 2, the counter starts over at 0, so Tell cannot return 'counted'.
    journal = record_run(facts={"f": 2})
    status, out, _ = conform(journal, options=())
    assert status == 1
    assert "does not conform from tick 1 on, 0:00: Tell SUCCESS" in out
    assert "  it is assumed that 'Tell' returns 'counted' only when f > 0 (f is 0)\n" in out
    assert "  possible instead: Tell " in out
    assert conform(journal, options=("--set", "f=1"))[0] == 0


def test_several_runs_are_shown_as_table_with_problems_below(conform, record_run, folder):
    fine = record_run("fine.journal", {"Tell": ["FAILURE"], "Drive": ["FAILURE"]})
    status, out, _ = conform(fine, record_run("loud.journal"), record_run("odd.journal", facts={"f": 2}))
    assert status == 1
    table, *others = out.split("\n\n")
    rows = [line.removeprefix(f"{folder}/").split(maxsplit=2) for line in table.splitlines()]
    assert rows[0] == ["journal", "end", "conforms         violated"]
    assert [(row[0], row[1]) for row in rows[1:]] == [
        ("fine.journal", "over"),
        ("loud.journal", "over"),
        ("odd.journal", "over"),
    ]
    assert [row[2].split() for row in rows[1:3]] == [["yes", "none"], ["yes", "nothing", "is", "told"]]
    assert rows[3][2].startswith("no, from tick 1  nothing is told")
    assert [each.split(":")[0] for each in others if each.startswith("/")] == [
        str(folder / "loud.journal"),
        str(folder / "odd.journal"),
    ]


def test_table_of_conforming_runs_has_no_details(conform, record_run):
    status, out, _ = conform(record_run("a.journal"), record_run("b.journal"), options=())
    assert (status, len(out.splitlines())) == (0, 3)


def test_journal_of_different_tree_is_not_compared(conform, record_run, folder):
    journal = record_run()
    (folder / "tree.xml").write_text(document(BODY.replace("Drive", "Fly")), encoding="utf-8")
    status, out, _ = conform(journal, options=())
    assert status == 1
    assert (
        "not compared: the tree's nodes differ from the nodes of the run. The journal records a run of 'Main' of "
        in out
    )


@pytest.mark.parametrize(
    ("options", "reason"),
    [
        (("--max-memory", "1"), "stopped at 1 MB of memory. Raise the limit with --max-memory"),
        (("--max-seconds", "1e-9"), "stopped after 1e-09 s. Raise the limit with --max-seconds"),
    ],
)
def test_run_that_exceeds_budget_is_not_compared(conform, record_run, options, reason):
    status, out, _ = conform(record_run(), options=options)
    assert status == 1
    assert f"not compared: there is no result yet, because the analysis was {reason}" in out


def test_ctrl_c_ends_comparison_and_is_reported(conform, record_run, monkeypatch):
    monkeypatch.setattr(Budget, "is_spent", press_ctrl_c)
    status, out, _ = conform(record_run())
    assert status == 130
    assert "not compared: there is no result yet, because the analysis was stopped by Ctrl-C" in out


def test_journal_of_tree_id_missing_from_file_is_not_compared(conform, record_run):
    status, out, _ = conform(record_run(tree_id="Elsewhere"))
    assert status == 1
    assert (
        "not compared: the tree's nodes differ from the nodes of the run. The journal records a run of 'Elsewhere' of "
        in out
    )


def test_changed_attributes_of_tree_are_reported(conform, record_run, folder):
    tries = '<RetryUntilSuccessful num_attempts="{}"><A name="Drive"/></RetryUntilSuccessful>'
    (folder / "tree.xml").write_text(document(tries.format(3)), encoding="utf-8")
    journal = record_run(outcomes={"Drive": ["FAILURE"]})
    assert "has changed" not in conform(journal, options=())[1]
    (folder / "tree.xml").write_text(document(tries.format(1)), encoding="utf-8")
    status, out, _ = conform(journal, options=())
    assert status == 1
    assert (
        "the tree has changed since the run: 'RetryUntilSuccessful' has different attributes\ndoes not conform"
        in out
    )


def test_journal_without_tree_is_not_compared(conform, folder):
    with closing(open_journal(folder / "bare.journal")) as journal:
        journal.begin({}, {})
        journal.end_run(Ending.STOPPED, 0)
    status, out, _ = conform(folder / "bare.journal")
    assert status == 1
    assert out.endswith("bare.journal: not compared: the journal contains no run of a tree\n")


def test_journal_of_unfinished_run_is_compared_so_far(conform, folder, monkeypatch):
    live = folder / "live.journal"
    with closing(open_journal(live)) as journal:
        monkeypatch.setattr(journal, "end_run", lambda *_: None)
        run_and_record(
            simulated(folder / "tree.xml"), ScriptedPolicy(Drive=["RUNNING"] * 9), journal, tree_id="Main"
        )
        status, out, _ = conform(live)
    assert status == 0
    assert "live.journal: run 1, running, compared so far, " in out


def test_file_that_is_no_journal_has_status_2(conform, folder):
    status, out, err = conform(folder / "p.yaml")
    assert (status, out) == (2, "")
    assert "p.yaml" in err


CONTROLLED = '<Fallback name="Either"><Sequence name="Both"><A name="Drive"/><Sleep msec="1000"/></Sequence><Y name="Tell"/></Fallback>'


@pytest.mark.parametrize(
    ("node", "status", "said"),
    [
        (0, "FAILURE", ""),
        (1, "HALTED", "Both HALTED"),
        (1, "FAILURE", "Both FAILURE"),
        (3, "HALTED", "Sleep HALTED"),
        (2, "HALTED", "Drive halted"),
    ],
)
def test_forged_control_status_or_halt_in_journal_does_not_conform(
    conform, record_run, folder, node, status, said
):
    (folder / "tree.xml").write_text(document(CONTROLLED), encoding="utf-8")
    journal = record_run(outcomes={"Drive": ["SUCCESS"]})
    assert conform(journal, options=())[0] == 0
    with sqlite3.connect(journal) as base:
        number, data = base.execute(
            "SELECT number, data FROM watched WHERE kind = 'status' AND json_extract(data, '$.tick') = 2 ORDER BY number DESC"
        ).fetchone()
        changed = {**json.loads(data), "node": node, "status": status, "tick": 2}
        base.execute(
            "INSERT INTO watched SELECT number + 100000, run, wall, time, kind, ?, NULL FROM watched WHERE number = ?",
            (json.dumps(changed), number),
        )
    outcome, out, _ = conform(journal, options=())
    assert outcome == 1
    assert "does not conform from tick 2 on" in out
    assert said in out
