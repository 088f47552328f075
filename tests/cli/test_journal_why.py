"""`sar-journal why`: what would have succeeded, by journals of runs of stub leaves."""

import json
from contextlib import closing
from pathlib import Path

import pytest

from sar_compiler.budget import Budget
from sar_compiler.cli.journal_command import main
from sar_compiler.execution.run_journal import _node_options
from sar_compiler.journal.journal_opening import open_journal
from sar_compiler.project import CommandLineSettings
from tests.cli.running import press_ctrl_c
from tests.trees import document
from tests.views.flown import Said, flown, simulated

BODY = '<Sequence><A name="Drive"/><A name="Look"/></Sequence>'
NODES = ("--nodes", "tests.analysis.verify.leaves")


@pytest.fixture
def tree(tmp_path):
    path = tmp_path / "tree.xml"
    path.write_text(document(BODY), encoding="utf-8")
    return path


@pytest.fixture
def why(tree, tmp_path, capsys):
    """Returns what is told of a run in which the robot does not look, with further arguments of the command."""

    def told(*options, status=0, nodes=NODES, **about):
        place = tmp_path / "m.journal"
        if not place.exists():
            about = {"tree_file": str(tree), "tree_id": "Main", **about}
            with closing(open_journal(place)) as journal:
                flown(simulated(tree), Said(Look=["FAILURE"]), journal, **about)
        assert main(["why", str(place), *nodes, *map(str, options)]) == status
        return capsys.readouterr().out

    return told


def test_it_tells_people_what_would_have_succeeded(why):
    assert (
        "\nThe mission would have succeeded with another outcome:\n  0:00  Look SUCCESS instead of FAILURE  ("
        in why()
    )


def test_the_leaf_whose_success_alone_suffices_ranks_above_a_decorator_that_repeats_its_failure(why, tree):
    once = f'<RunOnce name="Once" then_skip="false">{BODY}</RunOnce>'
    body = f'<RetryUntilSuccessful num_attempts="2">{once}</RetryUntilSuccessful>'
    tree.write_text(document(body), encoding="utf-8")
    told = why()
    assert "\nLikeliest cause:\n  0:00  Look FAILURE" in told
    assert "Once FAILURE" in told.partition("The root has failed:")[2]


@pytest.mark.parametrize(
    ("options", "reason"),
    [
        (("--max-memory", "1"), "stopped at 1 MB of memory. Raise the limit with --max-memory"),
        (("--max-seconds", "1e-9"), "stopped after 1e-09 s. Raise the limit with --max-seconds"),
    ],
)
def test_where_the_budget_does_not_suffice_the_reasons_are_told_without_it(why, options, reason):
    told = why(*options)
    assert told.startswith(why().partition("\nThe mission would have succeeded")[0])
    assert f"would have led to success: there is no result yet, because the analysis was {reason}" in told


def test_ctrl_c_ends_the_search_and_the_reasons_are_shown(why, monkeypatch):
    reasons = why().partition("\nThe mission would have succeeded")[0]
    monkeypatch.setattr(Budget, "is_spent", press_ctrl_c)
    told = why(status=130)
    assert told.startswith(reasons)
    assert (
        "would have led to success: there is no result yet, because the analysis was stopped by Ctrl-C"
        in told
    )


def test_it_tells_scripts_what_would_have_succeeded(why):
    change = json.loads(why("--format", "json"))["counterfactual"]
    assert (change["tick"], change["unusual"], change["then"]) == (1, 0, [])
    assert change["instead"] == {"node": 2, "status": "SUCCESS", "label": "", "name": "Look"}


def test_a_tree_that_is_gone_is_asked_for(why, tree):
    why()
    tree.rename(tree.with_name("moved.xml"))
    assert (
        f"It is unknown which changes would have led to success: {tree} does not exist. Add --tree-file TREE"
        in why()
    )
    assert "instead of FAILURE" in why("--tree-file", tree.with_name("moved.xml"))


def test_a_journal_that_does_not_name_the_file_asks_for_it(why, tree):
    assert "Add --tree-file TREE" in why(tree_file=None)
    assert "instead of FAILURE" in why("--tree-file", tree)


def test_a_tree_that_was_changed_since_is_not_taken_for_the_one_that_ran(why, tree):
    why()
    tree.write_text(document(BODY.replace("Drive", "Fly")), encoding="utf-8")
    assert f"{tree} now contains another tree" in why()


def test_a_tree_with_mistakes_says_the_first_of_them(why, tree):
    why()
    tree.write_text(document(BODY.replace("<A ", "<Fly ")), encoding="utf-8")
    assert f"{tree} now has errors: there is no node 'Fly'" in why()
    assert json.loads(why("--format", "json"))["counterfactual"] is None


def test_the_options_of_the_run_that_are_missing_are_named(why):
    said = why(nodes=(), options=[["--nodes", NODES[1]], ["--model", "ros:jazzy"]])
    assert "cannot be loaded without the options of the run: there is no node 'A'" in said
    assert f"Add --nodes {NODES[1]}\n" in said
    assert "instead of FAILURE" in why()


def test_an_installed_palette_of_the_run_is_taken_from_the_journal(why, tree):
    why(options=[["--model", "ros:jazzy"], "damaged", ["--model"]])
    ros = '<RosTopic topic="t" type="std_msgs/msg/Bool"/>'
    tree.write_text(document(BODY.replace("<Sequence>", f"<Sequence>{ros}")), encoding="utf-8")
    # It can be read; that it is another tree is found out afterwards.
    assert f"{tree} now contains another tree" in why()


def test_a_run_notes_the_options_that_decide_which_nodes_there_are():
    given = CommandLineSettings(
        nodes=("a.b",), models=(Path("ros:jazzy"), Path("n.xml")), include_path=(Path("more"),)
    )
    assert _node_options(given) == [
        ["--nodes", "a.b"],
        ["--model", "ros:jazzy"],
        ["--model", str(Path("n.xml").resolve())],
        ["--include-path", str(Path("more").resolve())],
    ]
