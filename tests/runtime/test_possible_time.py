"""A time of which nobody knows how much has passed: what follows from the order of moments is known, all else is asked."""

import math

import pytest

from sar_compiler.runtime.clock import ManualClock
from sar_compiler.runtime.possible_time import PossibleClock, TimeComputedError


class Asked:
    """Notes what is asked, and answers."""

    def __init__(self, is_up):
        self.is_up = is_up
        self.looks = []

    def look(self, has_begun):
        self.looks.append(has_begun)
        return self.is_up

    def whose(self):
        return "'Here'"


def clock(is_up=True):
    made, asked = ManualClock(), Asked(is_up)
    PossibleClock.of(made, asked)
    return made, asked


def moments():
    """Return a moment of an earlier tick, one of this tick, and who is asked."""
    made, asked = clock()
    first = made.now()
    assert first.grow_old()
    return first, made.now(), asked


@pytest.mark.parametrize(
    ("known", "holds"),
    [
        (lambda old, now: now - old >= 0, True),
        (lambda old, now: now - old < 0, False),
        (lambda old, now: now >= old, True),
        (lambda old, now: old > now, False),
        (lambda old, now: old - now <= 0, True),
        (lambda old, now: now - old >= math.inf, False),
        (lambda old, now: now + 1 > old, True),
    ],
)
def test_what_follows_from_the_order_of_moments_is_known(known, holds):
    old, now, asked = moments()
    assert known(old, now) is holds
    assert asked.looks == []


@pytest.mark.parametrize("is_up", [True, False])
@pytest.mark.parametrize(
    ("is_late", "when_up"),
    [
        (lambda old, now: now - old >= 5, True),
        (lambda old, now: now - old < 5, False),
        (lambda old, now: now >= old + 5, True),
        (lambda old, now: 5 - (now - old) <= 0, True),
        (lambda old, now: old + 5 - now > 0, False),
    ],
)
def test_whether_a_time_is_up_that_has_begun_in_an_earlier_tick_is_asked(is_late, when_up, is_up):
    old, now, asked = moments()
    asked.is_up = is_up
    assert is_late(old, now) is (when_up if is_up else not when_up)
    assert asked.looks == [True]


def test_of_a_time_that_begins_in_this_tick_nobody_waits():
    made, asked = clock()
    start = made.now()
    assert made.now() - start >= 5
    assert asked.looks == [False]


def test_a_stored_difference_does_not_grow():
    old, now, asked = moments()
    passed = now - old
    passed.grow_old()
    assert not passed >= 0
    assert asked.looks == [None]


@pytest.mark.parametrize(
    "compute", [int, float, bool, round, math.floor, hash, lambda time: time * 2, lambda time: time % 3]
)
def test_a_time_is_no_number(compute):
    old, now, _ = moments()
    with pytest.raises((TimeComputedError, TypeError)):
        compute(now - old)
    assert f"{now - old:.1f} s" == "... s"
