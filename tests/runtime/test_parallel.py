"""Tests of Parallel and ParallelAll with their counts."""

import pytest
from py_trees.common import Status

from sar_compiler.runtime.kernel.counting import ThresholdError
from sar_compiler.runtime.ports import Input
from tests.runtime.node_factories import own
from tests.runtime.stage import Stage

Parallel = own("Parallel")
ParallelAll = own("ParallelAll")


def parallel(stage, success_count=-1, failure_count=1, **outcomes):
    return Parallel("p", stage.leaves(**outcomes), Input(success_count), Input(failure_count))


def test_children_after_deciding_one_are_not_ticked():
    stage = Stage()
    assert stage.tick(parallel(stage, success_count=1, a="S", b="R")) == "S: a=S"
    assert stage.tick(parallel(stage, a="R", b="F", c="R")) == "F: a=R b=F halt a"


def test_ended_child_is_not_ticked_again_and_progress_is_shown():
    stage = Stage()
    root = parallel(stage, success_count=2, failure_count=2, a="S", b="R,S", c="R")
    assert stage.tick(root) == "R: a=S b=R c=R"
    assert root.feedback_message == "1 of 2"
    assert stage.tick(root) == "S: b=S halt c"
    assert root.feedback_message == "2 succeeded, 0 failed"


def test_parallel_fails_as_soon_as_too_few_children_are_left():
    stage = Stage()
    assert stage.tick(parallel(stage, success_count=2, failure_count=3, a="F", b="F", c="S")) == "F: a=F b=F"


def test_skipped_child_counts_as_success_only_if_all_must_succeed():
    stage = Stage()
    assert stage.tick(parallel(stage, a="K", b="S")) == "S: a=K b=S"
    assert stage.tick(parallel(stage, success_count=2, a="K", b="S")) == "R: a=K b=S"


def test_halted_parallel_counts_from_zero():
    stage = Stage()
    root = parallel(stage, failure_count=2, success_count=1, a="F,R", b="R", c="R")
    stage.tick(root)
    root.stop(Status.INVALID)
    assert stage.new_events() == "halt b halt c"
    assert stage.tick(root) == "R: a=R b=R c=R"
    assert root.feedback_message == "0 of 1"


@pytest.mark.parametrize("counts", [{"success_count": 3}, {"failure_count": 3}])
def test_unreachable_count_raises_error_before_any_child_is_ticked(counts):
    stage = Stage()
    with pytest.raises(ThresholdError, match=f"'p' waits for 3 .*Write at most 2 as {next(iter(counts))}"):
        parallel(stage, a="S", b="S", **counts).tick_once()
    assert stage.new_events() == ""


def test_counts_are_read_from_blackboard_in_every_tick():
    stage = Stage(enough=2)
    root = Parallel("p", stage.leaves(a="S", b="R"), stage.port("enough"))
    assert stage.tick(root) == "R: a=S b=R"
    stage.entry("enough").write(1)
    assert stage.tick(root) == "S: halt b"


def test_all_children_must_succeed_by_default():
    stage = Stage()
    assert stage.ticks(Parallel("p", stage.leaves(a="S", b="R,S")), 2) == ["R: a=S b=R", "S: b=S"]


def test_parallel_all_waits_for_all_children_and_limits_failures():
    stage = Stage()
    assert stage.ticks(ParallelAll("p", stage.leaves(a="F", b="R,S")), 2) == ["R: a=F b=R", "F: b=S"]
    assert stage.tick(ParallelAll("p", stage.leaves(a="F", b="S"), Input(2))) == "S: a=F b=S"
    assert stage.tick(ParallelAll("p", stage.leaves(a="F", b="F"), Input(-1))) == "F: a=F b=F"


def test_parallel_all_with_zero_as_max_failures_always_fails():
    stage = Stage()
    assert stage.tick(ParallelAll("p", stage.leaves(a="S", b="S"), Input(0))) == "F: a=S b=S"


def test_parallel_all_is_skipped_if_all_children_are_skipped():
    stage = Stage()
    root = ParallelAll("p", stage.leaves(a="K", b="K,R,S"))
    assert stage.ticks(root, 3) == ["K: a=K b=K", "R: a=K b=R", "S: a=K b=S"]


def test_parallel_all_shows_number_of_ended_children():
    stage = Stage()
    root = ParallelAll("p", stage.leaves(a="S", b="R", c="R"))
    stage.tick(root)
    assert root.feedback_message == "1 of 3"


def test_parallel_all_rejects_more_max_failures_than_children():
    stage = Stage()
    with pytest.raises(ThresholdError, match="Write at most 1 as max_failures"):
        ParallelAll("p", stage.leaves(a="S"), Input(2)).tick_once()


@pytest.mark.parametrize("kind", [Parallel, ParallelAll])
def test_each_of_hundred_children_is_ticked_until_it_has_ended(kind):
    stage = Stage()
    outcomes = {f"c{number}": "S" if number % 3 else "R,S" for number in range(100)}
    limits = [Input(-1), Input(1)] if kind is Parallel else [Input(1)]
    root = kind("p", stage.leaves(**outcomes), *limits)
    assert stage.tick(root).startswith("R: ")
    slow = " ".join(f"c{number}=S" for number in range(0, 100, 3))
    assert stage.tick(root) == f"S: {slow}"
