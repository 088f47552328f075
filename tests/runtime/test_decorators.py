"""Decorators that turn one end into another."""

import pytest
from py_trees.common import Status

from sar_compiler.runtime.ports import Input
from tests.runtime.own import own
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
def test_each_decorator_makes_of_its_childs_answers_what_it_is_for(cls, answers):
    stage = Stage()
    root = cls("d", stage.leaf("a", "R,K,S,F"))
    assert " ".join(answer[0] for answer in stage.ticks(root, 4)) == answers


@pytest.mark.parametrize(
    "cls", [Inverter, ForceSuccess, ForceFailure, KeepRunningUntilFailure, RunOnce, SubTree]
)
def test_a_child_that_has_ended_is_left_at_rest(cls):
    stage = Stage()
    root = cls("d", stage.leaf("a", "S"))
    stage.tick(root)
    assert root.decorated.status == Status.INVALID


def test_run_once_is_skipped_for_ever_after_its_child_has_ended():
    stage = Stage()
    root = RunOnce("r", stage.leaf("a", "K,R,F"))
    assert stage.ticks(root, 5) == ["K: a=K", "R: a=R", "F: a=F", "K:", "K:"]
    assert root.feedback_message == "has run"


def test_run_once_can_answer_the_same_again():
    stage = Stage()
    root = RunOnce("r", stage.leaf("a", "F,S"), Input(source=False))
    assert stage.ticks(root, 3) == ["F: a=F", "F:", "F:"]


def test_run_once_may_run_again_if_it_was_halted_before_the_end():
    stage = Stage()
    root = RunOnce("r", stage.leaf("a", "R,S"))
    stage.tick(root)
    root.stop(Status.INVALID)
    assert stage.told() == "halt a"
    assert stage.ticks(root, 2) == ["S: a=S", "K:"]
