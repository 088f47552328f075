"""Tests of frozen values, which can be compared, hashed and restored."""

import enum
import math
from collections import deque

import pytest

from sar_compiler.runtime.frozen import FrozenValueError, can_change, freeze, thaw


class Colour(enum.Enum):
    RED = 1


VALUES = [
    None,
    True,
    1,
    1.0,
    -0.0,
    "1",
    b"1",
    Colour.RED,
    (1, 2),
    [1, [2.0, "x"]],
    {"a": [1], "b": {"c": None}},
    {1, 2},
    frozenset({1}),
    deque([1, 2], maxlen=2),
]


@pytest.mark.parametrize("value", VALUES, ids=repr)
def test_thawed_value_equals_original(value):
    back = thaw(freeze(value))
    assert (back, type(back), repr(back)) == (value, type(value), repr(value))


def test_equal_values_of_different_type_or_sign_freeze_differently():
    values = [1, 1.0, True, 0.0, -0.0, 0, False, [1], [1.0], (1,)]
    assert len({freeze(value) for value in values}) == len(values)


def test_frozen_nan_equals_itself():
    assert freeze(math.nan) == freeze(float("nan"))
    assert math.isnan(thaw(freeze(math.nan)))


def test_frozen_list_does_not_change_with_original():
    inner = [2]
    frozen = freeze([1, {"a": inner}])
    inner.append(3)
    assert thaw(frozen) == [1, {"a": [2]}]


def test_thaw_returns_new_list_each_time():
    frozen = freeze([1])
    thaw(frozen).append(2)
    assert thaw(frozen) == [1]


def test_other_objects_are_returned_unchanged():
    held = object()
    assert thaw(freeze(held)) is held


def test_value_that_can_be_neither_copied_nor_hashed_is_rejected():
    with pytest.raises(
        FrozenValueError, match=r"type bytearray, which can neither be copied nor hashed\. Store"
    ):
        freeze(bytearray(b"x"))


@pytest.mark.parametrize(
    ("value", "changes"), [([], True), ({}, True), (deque(), True), (([],), True), (1, False)]
)
def test_can_change_detects_mutable_values(value, changes):
    assert can_change(value) is changes
