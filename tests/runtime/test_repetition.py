"""Tests of Repeat and RetryUntilSuccessful."""

import pytest
from hypothesis import given
from hypothesis import strategies as st
from py_trees.common import Status

from sar_compiler.runtime.ports import Input, PortError
from tests.conformance.leaves import Scripted
from tests.runtime.node_factories import own
from tests.runtime.stage import Stage

Repeat = own("Repeat")
RetryUntilSuccessful = own("RetryUntilSuccessful")


def test_repeat_pauses_between_one_tick_cycles_and_shows_cycle():
    stage = Stage()
    root = stage.ready(Repeat("r", stage.leaf("a", "S"), Input(3)))
    assert stage.ticks(root, 2) == ["R: a=S", "R: a=S"]
    assert root.feedback_message == "cycle 2 of 3"
    assert stage.tick(root) == "S: a=S"
    assert stage.woken == 2


def test_repeat_starts_next_cycle_immediately_after_longer_one():
    stage = Stage()
    root = stage.ready(Repeat("r", stage.leaf("a", "R,S,R,S"), Input(2)))
    assert stage.ticks(root, 3) == ["R: a=R", "R: a=S a=R", "S: a=S"]
    assert stage.woken == 0


@pytest.mark.parametrize(
    ("cls", "times", "answer"),
    [
        (Repeat, 0, "S:"),
        (Repeat, -2, "S:"),
        (RetryUntilSuccessful, 0, "F:"),
        (RetryUntilSuccessful, -7, "F:"),
    ],
)
def test_count_of_zero_or_below_minus_one_ends_without_child_tick(cls, times, answer):
    stage = Stage()
    assert stage.tick(cls("r", stage.leaf("a"), Input(times))) == answer


@pytest.mark.parametrize(("cls", "again"), [(Repeat, "S"), (RetryUntilSuccessful, "F")])
def test_count_of_minus_one_never_ends(cls, again):
    stage = Stage()
    root = cls("r", stage.leaf("a", again), Input(-1))
    assert stage.ticks(root, 20) == [f"R: a={again}"] * 20
    assert root.feedback_message.endswith(" 20")


def test_failure_ends_repeat_and_resets_count():
    stage = Stage()
    root = Repeat("r", stage.leaf("a", "S,F,S"), Input(2))
    assert stage.ticks(root, 4) == ["R: a=S", "F: a=F", "R: a=S", "S: a=S"]


@pytest.mark.parametrize(("cls", "again"), [(Repeat, "S"), (RetryUntilSuccessful, "F")])
def test_halt_resets_count(cls, again):
    stage = Stage()
    root = cls("r", stage.leaf("a", again), Input(2))
    stage.tick(root)
    root.stop(Status.INVALID)
    assert stage.ticks(root, 2) == [f"R: a={again}", f"{again}: a={again}"]


def test_running_child_that_is_skipped_is_halted():
    stage = Stage()
    root = Repeat("r", stage.leaf("a", "R,K"), Input(2))
    assert stage.ticks(root, 2) == ["R: a=R", "K: a=K halt a"]


def test_number_of_attempts_is_read_again_after_each_failure():
    stage = Stage(attempts=2)

    class Lowering(Scripted):
        def terminate(self, new_status):
            stage.entry("attempts").write(1)

    root = RetryUntilSuccessful(
        "r", Lowering("a", Input("a"), stage.events, Input("F")), stage.port("attempts")
    )
    assert stage.tick(root) == "F: a=F"


def test_unwritten_count_raises_error_with_key():
    stage = Stage()
    with pytest.raises(PortError, match=r"\{attempts\}: the key .* has no value"):
        RetryUntilSuccessful("r", stage.leaf("a"), stage.port("attempts")).tick_once()


@given(times=st.integers(1, 8), answers=st.lists(st.sampled_from("SR"), min_size=1, max_size=30))
def test_repeat_succeeds_after_exact_number_of_successes(times, answers):
    stage = Stage()
    root = Repeat("r", stage.leaf("a", ",".join([*answers, "S"])), Input(times))
    ticks = [stage.tick(root)]
    while not ticks[-1].startswith("S"):
        ticks.append(stage.tick(root))
    assert " ".join(ticks).count("a=S") == times
