"""Trees in which one leaf fails from some moment on: it is the first to be named."""

import pytest

from sar_compiler.reports.why import FailureAnalysis
from tests.views.flown import injected

pytestmark = pytest.mark.unmeasured

FAULTS, NAMED_FIRST = 100, 95


def test_of_a_hundred_faults_the_leaf_that_was_faulty_is_named_first_in_95(tmp_path):
    named = []
    for (faulty, stream, _), _ in zip(injected(tmp_path / "tree.xml"), range(FAULTS), strict=False):
        reasons = FailureAnalysis.from_stream(stream).find_cause()
        named.append((reasons.likeliest.name if reasons.likeliest else "", faulty))
    assert len(named) == FAULTS
    wrong = [pair for pair in named if pair[0] != pair[1]]
    assert len(named) - len(wrong) >= NAMED_FIRST, wrong
