"""Tests of comparing the verdicts about two trees."""

import pytest

from sar_compiler.analysis.verify.verdicts import (
    BETTER,
    OTHER,
    SAME,
    WORSE,
    ComparedVerdict,
    Verdict,
    VerificationComparison,
)
from tests.analysis.verify.stage import BROKEN, PROVED, UNDECIDED, verified


@pytest.mark.parametrize(
    ("before", "now", "change"),
    [
        (PROVED, PROVED, SAME),
        (BROKEN, BROKEN, SAME),
        (PROVED, BROKEN, WORSE),
        (PROVED, UNDECIDED, WORSE),
        (PROVED, None, WORSE),
        (UNDECIDED, BROKEN, WORSE),
        (None, BROKEN, WORSE),
        (BROKEN, PROVED, BETTER),
        (BROKEN, None, BETTER),
        (None, PROVED, BETTER),
        (UNDECIDED, None, OTHER),
    ],
)
def test_verdict_change_ranks_proved_best_and_violated_worst(before, now, change):
    sides = [None if outcome is None else Verdict("q", outcome) for outcome in (before, now)]
    assert ComparedVerdict("q", *sides).change == change


def test_property_of_only_one_tree_is_compared():
    properties = "properties: {p: {never: B starts}}"
    with_b, without = verified("<Sequence><A/><B/></Sequence>", properties), verified("<A/>", properties)
    last = VerificationComparison(with_b, without).verdicts[-1]
    assert last.before is not None
    assert (last.question, last.before.outcome, last.now) == ("p", BROKEN, None)
    assert not VerificationComparison(with_b, without).is_worse
    assert VerificationComparison(without, with_b).is_worse
