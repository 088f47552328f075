"""Tests of leaves that block the tick: they are named, goals are canceled after a timeout, and Ctrl-C ends the run."""

import signal

import pytest

from tests.trees import document

pytestmark = pytest.mark.ros

LEAVES = """
import os, pathlib, re, time
from py_trees.behaviour import Behaviour
from py_trees.common import Status
from sar_compiler.leaves import Kind, register

GO = pathlib.Path(os.environ["GO"])


@register("Block", kind=Kind.ACTION)
class Block(Behaviour):
    def __init__(self, name: str, how: str) -> None:
        super().__init__(name)
        self._how = how

    def update(self):
        if GO.exists():
            getattr(self, self._how)()
        return Status.RUNNING

    def terminate(self, new_status):
        if self._how == "end":
            time.sleep(600)

    def sleep(self):
        time.sleep(600)

    def pause(self):
        while GO.exists():
            time.sleep(0.05)

    def compute(self):
        re.match("(a+)+b", "a" * 60)

    def end(self):
        pass
"""
# The lines of the calls that block.
LINES = {"sleep": 26, "pause": 30, "compute": 33, "end": 23}


@pytest.fixture
def write_tree(tmp_path):
    """Return a function that writes a tree with the leaf.

    It returns the tree file, the options and the environment of a run, and the file that makes the leaf block.
    """

    def write(body):
        (tmp_path / "blocking.py").write_text(LEAVES, encoding="utf-8")
        tree, go = tmp_path / "tree.xml", tmp_path / "go"
        tree.write_text(document(body), encoding="utf-8")
        return tree, ("--nodes", "blocking"), {"PYTHONPATH": str(tmp_path), "GO": str(go)}, go

    return write


@pytest.fixture
def block(serve, fly, write_tree):
    """Return a function that starts a run with a drive and a leaf that blocks once a file exists.

    It returns the server, the run and that file.
    """

    def start_mission(how, *options, cancel="grant", **parameters):
        tree, nodes, env, go = write_tree(
            f'<Parallel success_count="2" failure_count="1"><NavigateToZone/><Block how="{how}"/></Parallel>'
        )
        server = serve("navigation", goals=[{"drive": None, "cancel": cancel}])
        run = fly(tree, *nodes, *options, env=env, **parameters)
        server.wait_for("accepted")
        return server, run, go

    return start_mission


@pytest.fixture
def block_message(tmp_path):
    """Return a function that returns the message about a blocking leaf."""

    def say(how, method=None):
        lines = f"{tmp_path}/tree.xml:3; {tmp_path}/blocking.py:{LINES[how]}, in {method or how}"
        return f"'Block' (Block) blocks ({lines})"

    return say


def test_blocking_leaf_is_named_and_goals_are_canceled_after_timeout(block, block_message):
    server, run, go = block("pause", "--journal", "none", blocked_tick_timeout_sec=3.0)
    go.touch()
    run.wait_for(f"The tree was not ticked for 2 s: {block_message('pause')}.")
    server.wait_for("ended", how="cancel")
    run.wait_for("Canceling the goal of '/navigate_to_pose'.")
    go.unlink()
    run.wait_for("The tree is ticked again.")
    assert run.stop(within_sec=5.0) in (1, 130), run.output
    assert "guardian" not in run.output


@pytest.mark.parametrize(
    ("cancel", "status"), [("grant", 130), pytest.param("ignore", 4, marks=pytest.mark.slow)]
)
def test_first_ctrl_c_ends_run_with_blocking_leaf(block, block_message, cancel, status):
    server, run, go = block("sleep", cancel=cancel, settle_timeout_sec=2.0)
    go.touch()
    run.wait_for("The tree was not ticked for 2 s")
    assert run.stop(within_sec=20.0) == status, run.output
    assert f"sar-run: stopped although {block_message('sleep')}" in run.output
    assert ("the robot may still be moving: /navigate_to_pose" in run.output) == (status == 4)
    assert server.active == (status == 4)


@pytest.mark.costly
def test_guardian_names_leaf_that_holds_interpreter_and_cancels_goal(block):
    server, run, go = block("compute", "--guardian", blocked_tick_timeout_sec=3.0)
    go.touch()
    run.wait_for("and the mission cannot report this itself. The mission is blocked in ")
    assert f"blocking.py:{LINES['compute']}, in compute" in run.output
    server.wait_for("ended", how="cancel")
    run.wait_for("the server of /navigate_to_pose was requested to cancel the goal. The goal is cancelled")
    run.send(signal.SIGKILL)


@pytest.mark.costly
def test_leaf_that_blocks_while_stopping_does_not_prevent_end_of_run(block, block_message):
    server, run, _ = block("end", "--journal", "none", settle_timeout_sec=2.0)
    assert run.stop(within_sec=20.0) == 130, run.output
    assert f"sar-run: stopped although {block_message('end', 'terminate')}" in run.output
    server.wait_for("ended", how="cancel")


def test_blocking_leaf_of_simulated_run_is_named_and_ctrl_c_ends_run(start, write_tree, block_message):
    tree, nodes, env, go = write_tree('<Block how="sleep"/>')
    go.touch()
    run = start("sar-run", tree, *nodes, "--sim", "--journal", "none", env=env)
    run.wait_for(f"The tree was not ticked for 2 s: {block_message('sleep')}.")
    assert run.stop(within_sec=5.0) == 130, run.output
    assert "may still be moving" not in run.output
