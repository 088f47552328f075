"""Tests that a faulty leaf ends the run and is named."""

import os
from contextlib import closing
from pathlib import Path

import pytest

from sar_compiler.journal.database import JournalFile
from tests.trees import document

pytestmark = pytest.mark.ros

STAND_INS = Path(__file__).parents[1] / "stand_ins"

LEAVES = """
from py_trees.behaviour import Behaviour
from sar_compiler.leaves import Kind, register


@register("Forgetful", kind=Kind.ACTION)
class Forgetful(Behaviour):
    def __init__(self, name: str) -> None:
        super().__init__(name)

    def update(self):
        pass


@register("Unready", kind=Kind.ACTION)
class Unready(Forgetful):
    def setup(self, **kwargs):
        raise ValueError("boom")


@register("Restless", kind=Kind.ACTION)
class Restless(Forgetful):
    def setup(self, **kwargs):
        self.timer = kwargs["node"].create_timer(0.01, self.explode)

    def explode(self):
        raise ValueError("boom")


@register("Orderly", kind=Kind.ACTION)
class Orderly(Forgetful):
    def shutdown(self):
        print("shut down:", self.name, flush=True)
"""


@pytest.fixture(params=["own", "py_trees_ros"])
def run_tree(request, start, tmp_path):
    """Return a function that runs a tree of these leaves; for each engine."""
    (tmp_path / "misbehaving_leaves.py").write_text(LEAVES, encoding="utf-8")

    def run(body, *options):
        tree = tmp_path / "tree.xml"
        tree.write_text(document(body), encoding="utf-8")
        path = os.pathsep.join((str(tmp_path), str(STAND_INS)))
        arguments = ("--nodes", "misbehaving_leaves", "--engine", request.param, *options)
        return start("sar-run", tree, *arguments, env={"PYTHONPATH": path})

    return run


def test_journal_names_leaf_that_ended_run(run_tree, tmp_path):
    run = run_tree(
        '<Timeout duration="600"><Forgetful name="Out"/></Timeout>', "--journal", tmp_path / "m.journal"
    )
    assert run.end() == 1, run.output
    with closing(JournalFile.read(tmp_path / "m.journal")) as journal:
        (told,) = journal.runs()
    assert told.reason.startswith("'Out' (Forgetful) failed: update() returned None")
    assert "tree.xml:3" in told.reason


def test_callback_that_raises_ends_run_and_shuts_leaves_down(run_tree):
    run = run_tree('<Sequence><Sleep msec="60000"/><Restless/><Orderly name="Last"/></Sequence>')
    assert run.end() == 1, run.output
    assert "A callback failed: ValueError: boom. The tree is stopped." in run.output
    assert "sar-run: the tree was stopped, because a callback failed (see above)" in run.output
    assert "shut down: Last" in run.output


def test_leaf_that_returns_no_status_ends_run_despite_timeout(run_tree):
    run = run_tree('<Timeout duration="600"><Forgetful name="Out"/></Timeout>')
    assert run.end() == 1, run.output
    assert (
        "'Out' (Forgetful) failed: update() returned None, which is not a status. "
        "Return Status.SUCCESS, FAILURE or RUNNING (" in run.output
    )
    assert "tree.xml:3). The tree is stopped." in run.output


def test_leaf_that_fails_in_setup_is_named_and_earlier_leaves_are_shut_down(run_tree):
    run = run_tree('<Sequence><Orderly name="Before"/><Unready name="M"/><Orderly name="Behind"/></Sequence>')
    assert run.end() == 1, run.output
    assert "'M' (Unready) failed in setup: ValueError: boom (" in run.output
    assert "tree.xml:3; " in run.output
    assert "misbehaving_leaves.py:18, in setup)" in run.output
    assert run.output.count("shut down: Before") == 1
    assert "shut down: Behind" not in run.output
    assert "Traceback" not in run.output
    last = "sar-run: the tree was not started, because one of its leaves failed in setup (see above)"
    assert last in run.output


def test_traceback_option_shows_traceback(run_tree):
    run = run_tree('<Sequence><Orderly name="Before"/><Unready name="M"/></Sequence>', "--traceback")
    run.wait_for("Traceback (most recent call last):").wait_for('    raise ValueError("boom")')
    run.wait_for("sar-run: the tree was not started")


@pytest.mark.parametrize(
    ("given", "note"),
    [
        ("goalx:=5.0", "parameter 'goalx' is not used: did you mean 'goal_x'?"),
        ("time_limit:=5.0", "parameter 'time_limit' is not used: did you mean 'time_limit_sec'?"),
    ],
)
@pytest.mark.parametrize("is_in_file", [False, True])
def test_misspelt_tree_parameter_is_reported(start, tmp_path, given, note, is_in_file):
    folder = Path("examples/drive_to_goal")
    name, _, value = given.partition(":=")
    written = tmp_path / "own.yaml"
    written.write_text(f"/**: {{ros__parameters: {{{name}: {value}}}}}\n", encoding="utf-8")
    of_file = ["--ros-args", "--params-file", written]
    run = start(
        "sar-run", folder / "drive_to_goal.xml", "--nodes", "examples.drive_to_goal.leaves",
        "--params", folder / "params.yaml", *(of_file if is_in_file else ["--ros-args", "-p", given]),
    )  # fmt: skip
    run.wait_for(f"{written}:1:25: {note}" if is_in_file else f" {note}")
    run.wait_for("Waiting for")
    run.stop()
    assert run.output.count("is not used") == 1, run.output
