"""Tests of the confidence interval of a success rate."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sar_compiler.analysis.sweep import wilson


@st.composite
def counts(draw):
    runs = draw(st.integers(1, 10_000))
    return draw(st.integers(0, runs)), runs


@pytest.mark.parametrize(
    ("successes", "runs", "low", "high"),
    # Newcombe, "Two-sided confidence intervals for the single proportion", Statistics in Medicine 17 (1998), table I.
    [(81, 263, 0.2553, 0.3662), (15, 148, 0.0624, 0.1605), (0, 20, 0.0, 0.1611), (1, 29, 0.0061, 0.1718)],
)
def test_interval_matches_literature(successes, runs, low, high):
    assert wilson(successes, runs, 0.95) == pytest.approx((low, high), abs=5e-5)


@given(counts(), st.floats(0.5, 0.999))
def test_interval_contains_rate_and_is_within_0_and_1(pair, confidence):
    successes, runs = pair
    low, high = wilson(successes, runs, confidence)
    assert 0.0 <= low <= successes / runs <= high <= 1.0


@given(counts())
def test_failures_have_mirrored_interval_of_successes(pair):
    successes, runs = pair
    low, high = wilson(runs - successes, runs, 0.95)
    assert wilson(successes, runs, 0.95) == pytest.approx((1.0 - high, 1.0 - low))


def test_more_runs_or_less_confidence_narrow_interval():
    assert wilson(90, 100, 0.95).half_width > wilson(900, 1000, 0.95).half_width
    assert wilson(90, 100, 0.95).half_width > wilson(90, 100, 0.9).half_width


def test_interval_without_runs_is_0_to_1():
    assert wilson(0, 0, 0.95) == (0.0, 1.0)
