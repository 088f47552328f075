"""Tests of `constant_truth`: conditions whose result does not depend on the values of their variables."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sar_compiler.runtime.constant_conditions import constant_truth
from sar_compiler.runtime.evaluation import EvaluationError, Program
from sar_compiler.runtime.script import parse
from sar_compiler.runtime.variables import PlainVariables

ALWAYS_TRUE = [
    "true",
    "x != 'A' || x != 'B'",
    "x == x",
    "x >= 1 || x < 1",
    "!x || x",
    "x == 1 || true",
    "x + 1 < y || x + 1 >= y",
    "x == y || y != x",
    "x > y || x <= y",
    "x > 2 ? x != 1 : x < 3",
]
ALWAYS_FALSE = [
    "false",
    "x == 1 && x == 2",
    "x < 1 && x > 2",
    "x == 'A' && x == 'B'",
    "x < 'a' && x > 'b'",
    "1 < x < 0",
    "x != x",
    "x && !x",
    "x + 1 == 2 && x + 1 != 2",
    "battery > 20 && battery < 10 && go",
]
EITHER = [
    "x",
    "x == 1",
    "x > 1 && x < 2",
    "x <= 5 && x >= 5",
    "x < y",
    "x & 2",
    "x == RED && x == BLUE",
    "x != 'A' || y != 'B'",
    "(x := 1) == 1",
]


@pytest.mark.parametrize("text", ALWAYS_TRUE)
def test_condition_true_for_every_value_is_constant_true(text: str) -> None:
    assert constant_truth(parse(text)) is True


@pytest.mark.parametrize("text", ALWAYS_FALSE)
def test_condition_true_for_no_value_is_constant_false(text: str) -> None:
    assert constant_truth(parse(text)) is False


@pytest.mark.parametrize("text", EITHER)
def test_condition_depending_on_values_has_no_constant_truth(text: str) -> None:
    assert constant_truth(parse(text)) is None


def test_condition_raising_for_every_value_has_no_constant_truth() -> None:
    assert constant_truth(parse("x == 1 && x == 'A'")) is None


def test_condition_with_too_many_variables_has_no_constant_truth() -> None:
    text = " && ".join(f"x{number}" for number in range(13)) + " && false"
    assert constant_truth(parse(text)) is None


_OPERANDS = st.sampled_from(["x", "y", "0", "1", "2.5", "'a'", "'b'", "x + 1"])
_COMPARISONS = st.builds(
    "{} {} {}".format, _OPERANDS, st.sampled_from(["==", "!=", "<", ">", "<=", ">="]), _OPERANDS
)
_CONDITIONS = st.recursive(
    _COMPARISONS | st.sampled_from(["x", "y"]),
    lambda inner: st.one_of(
        st.builds("({} {} {})".format, inner, st.sampled_from(["&&", "||"]), inner),
        st.builds("!({})".format, inner),
        st.builds("({} ? {} : {})".format, inner, inner, inner),
    ),
    max_leaves=5,
)
_VALUES = st.one_of(st.integers(-3, 4), st.floats(-3, 4), st.sampled_from(["", "a", "ab", "b", "c", "1"]))


@given(_CONDITIONS, _VALUES, _VALUES)
def test_evaluation_never_contradicts_constant_truth(text: str, x: float | str, y: float | str) -> None:
    script = parse(text)
    truth = constant_truth(script)
    if truth is None:
        return
    try:
        result = Program(script).holds(PlainVariables({"x": x, "y": y}))
    except EvaluationError:
        return
    assert result is truth
