"""Tests of `sar-journal why`, which shows changes that would have led to success, on journals of runs with stub leaves."""

import json
from contextlib import closing
from pathlib import Path

import pytest

from sar_compiler.budget import Budget
from sar_compiler.cli.journal_command import main
from sar_compiler.execution.run_journal import _node_options
from sar_compiler.journal.journal_opening import open_journal
from sar_compiler.project import CommandLineSettings
from tests.cli.command_runner import press_ctrl_c
from tests.trees import document
from tests.views.recorded_runs import ScriptedPolicy, run_and_record, simulated

BODY = '<Sequence><A name="Drive"/><A name="Look"/></Sequence>'
NODES = ("--nodes", "tests.analysis.verify.leaves")


@pytest.fixture
def tree(tmp_path):
    path = tmp_path / "tree.xml"
    path.write_text(document(BODY), encoding="utf-8")
    return path


@pytest.fixture
def why(tree, tmp_path, capsys):
    """Return a function that runs the command on a run in which Look fails, and returns its output."""

    def run_why(*options, status=0, nodes=NODES, **about):
        place = tmp_path / "m.journal"
        if not place.exists():
            about = {"tree_file": str(tree), "tree_id": "Main", **about}
            with closing(open_journal(place)) as journal:
                run_and_record(simulated(tree), ScriptedPolicy(Look=["FAILURE"]), journal, **about)
        assert main(["why", str(place), *nodes, *map(str, options)]) == status
        return capsys.readouterr().out

    return run_why


def test_text_output_shows_change_that_leads_to_success(why):
    assert (
        "\nThe mission would have succeeded with another outcome:\n  0:00  Look SUCCESS instead of FAILURE  ("
        in why()
    )


def test_leaf_whose_success_suffices_ranks_above_decorator_with_same_failure(why, tree):
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
def test_reasons_are_shown_if_budget_is_exceeded(why, options, reason):
    told = why(*options)
    assert told.startswith(why().partition("\nThe mission would have succeeded")[0])
    assert f"would have led to success: there is no result yet, because the analysis was {reason}" in told


def test_ctrl_c_ends_search_and_reasons_are_shown(why, monkeypatch):
    reasons = why().partition("\nThe mission would have succeeded")[0]
    monkeypatch.setattr(Budget, "is_spent", press_ctrl_c)
    told = why(status=130)
    assert told.startswith(reasons)
    assert (
        "would have led to success: there is no result yet, because the analysis was stopped by Ctrl-C"
        in told
    )


def test_json_output_has_counterfactual(why):
    change = json.loads(why("--format", "json"))["counterfactual"]
    assert (change["tick"], change["unusual"], change["then"]) == (1, 0, [])
    assert change["instead"] == {"node": 2, "status": "SUCCESS", "label": "", "name": "Look"}


def test_missing_tree_file_can_be_given_with_option(why, tree):
    why()
    tree.rename(tree.with_name("moved.xml"))
    assert (
        f"It is unknown which changes would have led to success: {tree} does not exist. Add --tree-file TREE"
        in why()
    )
    assert "instead of FAILURE" in why("--tree-file", tree.with_name("moved.xml"))


def test_tree_file_is_requested_if_journal_does_not_name_it(why, tree):
    assert "Add --tree-file TREE" in why(tree_file=None)
    assert "instead of FAILURE" in why("--tree-file", tree)


def test_changed_tree_is_reported_as_different_tree(why, tree):
    why()
    tree.write_text(document(BODY.replace("Drive", "Fly")), encoding="utf-8")
    assert f"{tree} now contains another tree" in why()


def test_first_error_of_invalid_tree_is_reported(why, tree):
    why()
    tree.write_text(document(BODY.replace("<A ", "<Fly ")), encoding="utf-8")
    assert f"{tree} now has errors: there is no node 'Fly'" in why()
    assert json.loads(why("--format", "json"))["counterfactual"] is None


def test_missing_options_of_run_are_named(why):
    said = why(nodes=(), options=[["--nodes", NODES[1]], ["--model", "ros:jazzy"]])
    assert "cannot be loaded without the options of the run: there is no node 'A'" in said
    assert f"Add --nodes {NODES[1]}\n" in said
    assert "instead of FAILURE" in why()


def test_installed_palette_is_taken_from_journal(why, tree):
    why(options=[["--model", "ros:jazzy"], "damaged", ["--model"]])
    ros = '<RosTopic topic="t" type="std_msgs/msg/Bool"/>'
    tree.write_text(document(BODY.replace("<Sequence>", f"<Sequence>{ros}")), encoding="utf-8")
    # The tree loads with the palette; only the comparison shows that it is another tree.
    assert f"{tree} now contains another tree" in why()


def test_node_options_of_run_are_recorded_with_absolute_paths():
    given = CommandLineSettings(
        nodes=("a.b",), models=(Path("ros:jazzy"), Path("n.xml")), include_path=(Path("more"),)
    )
    assert _node_options(given) == [
        ["--nodes", "a.b"],
        ["--model", "ros:jazzy"],
        ["--model", str(Path("n.xml").resolve())],
        ["--include-path", str(Path("more").resolve())],
    ]
