"""Tests that the failure analysis names the faulty leaf first, on random trees with one leaf that starts to fail."""

import pytest

from sar_compiler.reports.why import FailureAnalysis
from tests.views.recorded_runs import missions_with_fault

pytestmark = pytest.mark.unmeasured

FAULTS, NAMED_FIRST = 100, 95


def test_faulty_leaf_is_named_first_for_95_of_100_faults(tmp_path):
    named = []
    for (faulty, stream, _), _ in zip(
        missions_with_fault(tmp_path / "tree.xml"), range(FAULTS), strict=False
    ):
        reasons = FailureAnalysis.from_stream(stream).find_cause()
        named.append((reasons.likeliest.name if reasons.likeliest else "", faulty))
    assert len(named) == FAULTS
    wrong = [pair for pair in named if pair[0] != pair[1]]
    assert len(named) - len(wrong) >= NAMED_FIRST, wrong
