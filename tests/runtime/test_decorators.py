"""Tests of decorators that change the outcome of their child."""

import pytest
from py_trees.common import Status

from sar_compiler.runtime.ports import Input
from tests.runtime.node_factories import own
from tests.runtime.stage import Stage

ForceFailure = own("ForceFailure")
ForceSuccess = own("ForceSuccess")
Inverter = own("Inverter")
KeepRunningUntilFailure = own("KeepRunningUntilFailure")
RunOnce = own("RunOnce")
SubTree = own("SubTree")


@pytest.mark.parametrize(
    ("cls", "answers"),
    [
        (Inverter, "R K F S"),
        (ForceSuccess, "R K S S"),
        (ForceFailure, "R K F F"),
        (KeepRunningUntilFailure, "R R R F"),
        (SubTree, "R K S F"),
    ],
)
def test_decorator_maps_outcomes_of_child(cls, answers):
    stage = Stage()
    root = cls("d", stage.leaf("a", "R,K,S,F"))
    assert " ".join(answer[0] for answer in stage.ticks(root, 4)) == answers


@pytest.mark.parametrize(
    "cls", [Inverter, ForceSuccess, ForceFailure, KeepRunningUntilFailure, RunOnce, SubTree]
)
def test_ended_child_is_reset(cls):
    stage = Stage()
    root = cls("d", stage.leaf("a", "S"))
    stage.tick(root)
    assert root.decorated.status == Status.INVALID


def test_run_once_is_skipped_after_child_has_ended():
    stage = Stage()
    root = RunOnce("r", stage.leaf("a", "K,R,F"))
    assert stage.ticks(root, 5) == ["K: a=K", "R: a=R", "F: a=F", "K:", "K:"]
    assert root.feedback_message == "has run"


def test_run_once_can_repeat_outcome_instead_of_being_skipped():
    stage = Stage()
    root = RunOnce("r", stage.leaf("a", "F,S"), Input(source=False))
    assert stage.ticks(root, 3) == ["F: a=F", "F:", "F:"]


def test_run_once_halted_before_end_runs_again():
    stage = Stage()
    root = RunOnce("r", stage.leaf("a", "R,S"))
    stage.tick(root)
    root.stop(Status.INVALID)
    assert stage.new_events() == "halt a"
    assert stage.ticks(root, 2) == ["S: a=S", "K:"]
