"""Tests of Delay, Timeout and Sleep."""

import pytest
from hypothesis import given
from hypothesis import strategies as st
from py_trees.common import Status

from sar_compiler.runtime.clock import ManualClock
from sar_compiler.runtime.kernel.times import ClockTimes
from sar_compiler.runtime.kernel.timing import DurationError
from sar_compiler.runtime.ports import Input
from tests.runtime.node_factories import own
from tests.runtime.stage import Stage

Delay = own("Delay")
Sleep = own("Sleep")
Timeout = own("Timeout")


CLOCK = st.lists(st.floats(-100.0, 100.0), max_size=20)


def test_timer_counts_down_to_zero():
    clock = ManualClock()
    times = ClockTimes(lambda _: clock)
    token = times.start(0, 2.0)
    clock.advance(0.5)
    assert times.remaining_sec(0, token) == 1.5
    clock.advance(5.0)
    assert times.remaining_sec(0, token) == 0.0


def test_clock_jumping_back_is_treated_as_stopped():
    clock = ManualClock(1000.0)
    times = ClockTimes(lambda _: clock)
    token = times.start(0, 2.0)
    clock.advance(0.5)
    times.remaining_sec(0, token)
    clock.advance(-900.0)
    assert times.remaining_sec(0, token) == 1.5
    clock.advance(1.5)
    assert times.remaining_sec(0, token) == 0.0


@given(seconds=st.floats(0.0, 50.0), steps=CLOCK)
def test_remaining_time_never_grows_and_is_never_negative(seconds, steps):
    clock = ManualClock()
    times = ClockTimes(lambda _: clock)
    token = times.start(0, seconds)
    left = seconds
    for step in steps:
        clock.advance(step)
        assert 0.0 <= times.remaining_sec(0, token) <= left + 1e-9
        left = times.remaining_sec(0, token)


def test_delay_waits_before_each_activation_of_child():
    clock, stage = ManualClock(), Stage()
    root = Delay("d", stage.leaf("a", "R,S"), Input(300), clock)
    assert stage.tick(root) == "R:"
    assert root.feedback_message == "remaining: 0.3s"
    clock.advance(0.2)
    assert stage.tick(root) == "R:"
    clock.advance(0.2)
    assert stage.ticks(root, 3) == ["R: a=R", "S: a=S", "R:"]


def test_delay_of_zero_takes_one_tick():
    stage = Stage()
    root = stage.ready(Delay("d", stage.leaf("a"), Input(0), ManualClock()))
    assert stage.ticks(root, 2) == ["R:", "S: a=S"]
    assert stage.woken == 1


def test_halted_delay_starts_over():
    clock, stage = ManualClock(), Stage()
    root = Delay("d", stage.leaf("a"), Input(300), clock)
    stage.tick(root)
    clock.advance(0.29)
    root.stop(Status.INVALID)
    assert stage.tick(root) == "R:"
    clock.advance(0.29)
    assert stage.tick(root) == "R:"
    clock.advance(0.02)
    assert stage.tick(root) == "S: a=S"


def test_delay_waits_while_clock_stands_still():
    stage = Stage()
    root = Delay("d", stage.leaf("a"), Input(1), ManualClock())
    assert set(stage.ticks(root, 50)) == {"R:"}


def test_expired_timeout_halts_child_without_ticking_it():
    clock, stage = ManualClock(), Stage()
    root = Timeout("t", stage.leaf("a", "R"), Input(2000), clock)
    assert stage.tick(root) == "R: a=R"
    clock.advance(0.8)
    assert stage.tick(root) == "R: a=R"
    assert root.feedback_message == "remaining: 1.2s"
    clock.advance(1.3)
    assert stage.tick(root) == "F: halt a"
    assert root.feedback_message == "timed out"
    assert stage.tick(root) == "R: a=R"


def test_timeout_restarts_with_every_activation():
    clock, stage = ManualClock(), Stage()
    root = Timeout("t", stage.leaf("a", "R,S,R"), Input(1000), clock)
    stage.tick(root)
    clock.advance(0.9)
    assert stage.ticks(root, 2) == ["S: a=S", "R: a=R"]
    clock.advance(0.9)
    assert stage.tick(root) == "R: a=R"
    root.stop(Status.INVALID)
    stage.new_events()
    clock.advance(0.9)
    assert stage.tick(root) == "R: a=R"


def test_timeout_of_zero_never_expires():
    clock, stage = ManualClock(), Stage()
    root = Timeout("t", stage.leaf("a", "R"), Input(0), clock)
    for _ in range(5):
        assert stage.tick(root) == "R: a=R"
        clock.advance(1e6)


def test_timeout_restarts_if_it_expired_while_child_was_skipped():
    clock, stage = ManualClock(), Stage()
    root = Timeout("t", stage.leaf("a", "K,R"), Input(1000), clock)
    assert stage.tick(root) == "K: a=K"
    clock.advance(2.0)
    assert stage.tick(root) == "R: a=R"
    clock.advance(0.9)
    assert stage.tick(root) == "R: a=R"
    clock.advance(0.2)
    assert stage.tick(root) == "F: halt a"


def test_clock_jumping_back_does_not_make_timeout_endless():
    clock, stage = ManualClock(1e9), Stage()
    root = Timeout("t", stage.leaf("a", "R"), Input(1000), clock)
    stage.tick(root)
    clock.advance(-1e9)
    assert stage.tick(root) == "R: a=R"
    clock.advance(1.0)
    assert stage.tick(root) == "F: halt a"


def test_sleep_waits_and_shows_remaining_time():
    clock, stage = ManualClock(), Stage()
    root = Sleep("z", Input(1500), clock)
    assert stage.tick(root) == "R:"
    assert root.feedback_message == "remaining: 1.5s"
    clock.advance(1.5)
    assert stage.tick(root) == "S:"
    assert root.feedback_message == ""


def test_sleep_of_zero_succeeds_immediately():
    assert Stage().tick(Sleep("z", Input(0), ManualClock())) == "S:"


def test_halted_sleep_starts_over():
    clock, stage = ManualClock(), Stage()
    root = Sleep("z", Input(1000), clock)
    stage.tick(root)
    clock.advance(0.9)
    root.stop(Status.INVALID)
    assert stage.tick(root) == "R:"
    clock.advance(0.9)
    assert stage.tick(root) == "R:"


def test_sleep_reads_duration_from_blackboard_only_at_start():
    clock, stage = ManualClock(), Stage(t=1000)
    root = Sleep("z", stage.port("t"), clock)
    stage.tick(root)
    stage.entry("t").write(5)
    clock.advance(0.9)
    assert stage.tick(root) == "R:"


@pytest.mark.parametrize("make", [Delay, Timeout])
def test_negative_duration_raises_error(make):
    stage = Stage()
    with pytest.raises(DurationError, match=r"cannot wait -5 milliseconds. Write 0 or more as (delay_)?msec"):
        make("t", stage.leaf("a"), Input(-5), ManualClock()).tick_once()
    with pytest.raises(DurationError, match="'z' cannot wait -5"):
        Sleep("z", Input(-5), ManualClock()).tick_once()


@given(
    left=st.lists(
        st.one_of(st.floats(0.01, 90.0), st.integers(1, 900).map(lambda tenths: tenths / 10 - 0.05)),
        max_size=30,
    )
)
def test_remaining_time_is_shown_in_tenths_of_second(left):
    clock, stage = ManualClock(), Stage()
    root = stage.ready(Sleep("s", Input(100_000), clock))
    stage.tick(root)
    for seconds in sorted(left, reverse=True):
        clock.advance(100.0 - seconds - clock.now())
        stage.tick(root)
        assert root.feedback_message == f"remaining: {100.0 - clock.now():.1f}s"


@pytest.mark.parametrize(
    "make",
    [
        lambda _stage, clock: Sleep("s", Input(5000), clock),
        lambda stage, clock: Delay("d", stage.leaf("a"), Input(5000), clock),
    ],
)
def test_message_is_created_once_per_tenth_of_second(make):
    clock, stage = ManualClock(), Stage()
    root = stage.ready(make(stage, clock))
    messages = []
    for _ in range(4):
        stage.tick(root)
        messages.append(root.feedback_message)
        clock.advance(0.01)
    assert len({id(each) for each in messages}) == 1
