"""`sar-compile conform`, as it is typed, by journals of runs of stub leaves."""

import json
import sqlite3
from contextlib import closing

import pytest

from sar_compiler.budget import Budget
from sar_compiler.compiler.outline import outline
from sar_compiler.journal.journal_entries import Ending
from sar_compiler.journal.journal_opening import open_journal
from sar_compiler.loaded_tree import load
from tests.cli.running import press_ctrl_c, run
from tests.trees import document
from tests.views.flown import REGISTRY, Said, flown, simulated

BODY = '<Sequence><A name="Drive"/><X name="Look"/><Y name="Tell"/></Sequence>'
NODES = ("--nodes", "tests.analysis.verify.leaves")
PROPERTIES = "properties: {nothing is told: {never: Tell counted}, something is: {after: Drive SUCCESS, eventually: Tell counted}}"


@pytest.fixture
def place(tmp_path):
    (tmp_path / "tree.xml").write_text(document(BODY), encoding="utf-8")
    (tmp_path / "p.yaml").write_text(PROPERTIES, encoding="utf-8")
    return tmp_path


@pytest.fixture
def flight(place, monkeypatch):
    """Fly the tree; return the journal, in which leaves are what they are on a robot."""

    def fly(name="m.journal", outcomes=None, **about):
        path = place / name
        tree = load(place / "tree.xml", registry=REGISTRY).preview()
        monkeypatch.setattr("tests.views.flown.outline", lambda _: outline(tree))
        about = {"tree_file": str(place / "tree.xml"), "tree_id": "Main", **about}
        with closing(open_journal(path)) as journal:
            flown(
                simulated(place / "tree.xml"), Said(**(outcomes or {"Tell": ["counted"]})), journal, **about
            )
        return path

    return fly


@pytest.fixture
def conform(place, capsys):
    def conform(*journals, options=("--properties", "p.yaml")):
        words = [place / word if str(word).endswith(".yaml") else word for word in options]
        return run(capsys, "conform", place / "tree.xml", *journals, *NODES, *words)

    return conform


def test_a_flight_that_conforms_and_keeps_its_properties_is_fine(conform, flight):
    status, out, err = conform(flight(), options=())
    assert (status, err) == (0, "")
    assert out.endswith("m.journal: run 1, over, 1 tick\nconforms: it is a possible run of the tree\n")


def test_a_broken_property_is_told_with_its_event_and_place(conform, flight, place):
    status, out, _ = conform(flight())
    assert status == 1
    assert "2 properties: 1 kept, 1 violated" in out
    assert f"nothing is told: violated by Tell counted in tick 1, 0:00  ({place}/tree.xml:" in out
    assert "0:00  tick    1  Look SUCCESS\n" in out


def test_as_json_there_is_the_same(conform, flight):
    status, out, _ = conform(flight(), options=("--properties", "p.yaml", "--format", "json"))
    told = json.loads(out)
    assert (status, told["fine"]) == (1, False)
    (one,) = told["runs"]
    assert (one["run"], one["end"], one["conforms"], one["misfit"]) == (1, "over", True, None)
    broken, kept = one["properties"]
    assert (broken["fate"], broken["event"], broken["tick"]) == ("violated", "Tell counted", 1)
    assert [each[1:] for each in broken["run"]] == [[1, 1, "SUCCESS"], [1, 2, "SUCCESS"], [1, 3, "SUCCESS"]]
    assert (kept["fate"], kept["run"]) == ("kept", [])


def test_facts_begin_as_the_run_did_unless_something_else_is_said(conform, flight):
    # With f at 2 the count begins anew, and Tell has nothing to tell.
    journal = flight(facts={"f": 2})
    status, out, _ = conform(journal, options=())
    assert status == 1
    assert "does not conform from tick 1 on, 0:00: Tell SUCCESS" in out
    assert "  it is assumed that 'Tell' returns 'counted' only when f > 0 (f is 0)\n" in out
    assert "  possible instead: Tell " in out
    assert conform(journal, options=("--set", "f=1"))[0] == 0


def test_several_flights_are_a_table_with_what_was_wrong_below(conform, flight, place):
    fine = flight("fine.journal", {"Tell": ["FAILURE"], "Drive": ["FAILURE"]})
    status, out, _ = conform(fine, flight("loud.journal"), flight("odd.journal", facts={"f": 2}))
    assert status == 1
    table, *others = out.split("\n\n")
    rows = [line.removeprefix(f"{place}/").split(maxsplit=2) for line in table.splitlines()]
    assert rows[0] == ["journal", "end", "conforms         violated"]
    assert [(row[0], row[1]) for row in rows[1:]] == [
        ("fine.journal", "over"),
        ("loud.journal", "over"),
        ("odd.journal", "over"),
    ]
    assert [row[2].split() for row in rows[1:3]] == [["yes", "none"], ["yes", "nothing", "is", "told"]]
    assert rows[3][2].startswith("no, from tick 1  nothing is told")
    assert [each.split(":")[0] for each in others if each.startswith("/")] == [
        str(place / "loud.journal"),
        str(place / "odd.journal"),
    ]


def test_flights_that_are_fine_have_the_table_alone(conform, flight):
    status, out, _ = conform(flight("a.journal"), flight("b.journal"), options=())
    assert (status, len(out.splitlines())) == (0, 3)


def test_a_journal_of_another_tree_is_told_so(conform, flight, place):
    journal = flight()
    (place / "tree.xml").write_text(document(BODY.replace("Drive", "Fly")), encoding="utf-8")
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
def test_a_flight_for_which_the_budget_does_not_suffice_is_not_judged(conform, flight, options, reason):
    status, out, _ = conform(flight(), options=options)
    assert status == 1
    assert f"not compared: there is no result yet, because the analysis was {reason}" in out


def test_ctrl_c_ends_the_comparison_and_what_is_known_is_shown(conform, flight, monkeypatch):
    monkeypatch.setattr(Budget, "is_spent", press_ctrl_c)
    status, out, _ = conform(flight())
    assert status == 130
    assert "not compared: there is no result yet, because the analysis was stopped by Ctrl-C" in out


def test_a_journal_of_a_tree_that_the_file_does_not_have_is_told_so(conform, flight):
    status, out, _ = conform(flight(tree_id="Elsewhere"))
    assert status == 1
    assert (
        "not compared: the tree's nodes differ from the nodes of the run. The journal records a run of 'Elsewhere' of "
        in out
    )


def test_what_is_otherwise_in_the_tree_since_is_told(conform, flight, place):
    tries = '<RetryUntilSuccessful num_attempts="{}"><A name="Drive"/></RetryUntilSuccessful>'
    (place / "tree.xml").write_text(document(tries.format(3)), encoding="utf-8")
    journal = flight(outcomes={"Drive": ["FAILURE"]})
    assert "has changed" not in conform(journal, options=())[1]
    (place / "tree.xml").write_text(document(tries.format(1)), encoding="utf-8")
    status, out, _ = conform(journal, options=())
    assert status == 1
    assert (
        "the tree has changed since the run: 'RetryUntilSuccessful' has different attributes\ndoes not conform"
        in out
    )


def test_a_journal_without_a_tree_is_told_so(conform, place):
    with closing(open_journal(place / "bare.journal")) as journal:
        journal.begin({}, {})
        journal.end_run(Ending.STOPPED, 0)
    status, out, _ = conform(place / "bare.journal")
    assert status == 1
    assert out.endswith("bare.journal: not compared: the journal contains no run of a tree\n")


def test_a_journal_that_is_still_written_is_judged_so_far(conform, place, monkeypatch):
    live = place / "live.journal"
    with closing(open_journal(live)) as journal:
        monkeypatch.setattr(journal, "end_run", lambda *_: None)
        flown(simulated(place / "tree.xml"), Said(Drive=["RUNNING"] * 9), journal, tree_id="Main")
        status, out, _ = conform(live)
    assert status == 0
    assert "live.journal: run 1, running, compared so far, " in out


def test_a_file_that_is_no_journal_is_wrong_usage(conform, place):
    status, out, err = conform(place / "p.yaml")
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
def test_a_status_of_a_control_or_a_halt_that_was_put_into_a_journal_does_not_fit(
    conform, flight, place, node, status, said
):
    (place / "tree.xml").write_text(document(CONTROLLED), encoding="utf-8")
    journal = flight(outcomes={"Drive": ["SUCCESS"]})
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
