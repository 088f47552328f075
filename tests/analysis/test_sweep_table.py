"""Tests of the means in the table of a sweep."""

import json

from sar_compiler.analysis.sweep import RunResultSample, StoppingRule, SweepRow
from sar_compiler.analysis.sweep_table import sweep_as_json, sweep_as_text

RULE = StoppingRule(runs=4, half_width=0.0, confidence=0.95)


def row(*counts: dict[str, float]) -> SweepRow:
    outcomes = [RunResultSample(seed, "", 1.0, each) for seed, each in enumerate(counts)]
    return SweepRow({}, lambda _seeds: [], outcomes)


def test_missing_count_is_not_zero_in_mean() -> None:
    played = row({"finds": 1, "first": 10.0}, {"finds": 0}, {"finds": 1, "first": 30.0}, {"finds": 0})
    (said,) = json.loads(sweep_as_json([played], RULE, None, None))["rows"]
    assert said["means"] == {"finds": 0.5, "first": 20.0}


def test_mean_has_margin_of_confidence_interval() -> None:
    played = row({"first": 10.0}, {"first": 20.0}, {"first": 30.0}, {"first": 40.0})
    (said,) = json.loads(sweep_as_json([played], RULE, None, None))["rows"]
    # 1.96 standard deviations (12.91) over the square root of 4.
    assert round(said["margins"]["first"], 2) == 12.65
    assert sweep_as_text([played], RULE, None, None).splitlines()[1].endswith("25.00 ± 12.65")


def test_mean_of_one_run_has_no_margin() -> None:
    played = row({"first": 10.0})
    (said,) = json.loads(sweep_as_json([played], RULE, None, None))["rows"]
    assert said["margins"] == {"first": None}
    assert sweep_as_text([played], RULE, None, None).splitlines()[1].endswith(" 10.00")
