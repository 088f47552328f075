"""Tests of the causes that the benchmark of `why` plants in shipped trees."""

import re
import subprocess
from pathlib import Path

import pytest

from benchmarks import explaining
from benchmarks.explaining import CAUSES

MINIMUM_KINDS = 28


def test_at_least_28_kinds_of_causes_are_planted_once_each():
    kinds = [cause.kind for cause in CAUSES]
    assert len(kinds) >= MINIMUM_KINDS
    assert len({*kinds}) == len(kinds)


@pytest.mark.parametrize("cause", CAUSES, ids=lambda each: each.kind)
def test_cause_edits_match_text_of_shipped_tree(cause):
    assert Path(f"trees/{cause.tree}.xml").is_file()
    for name, edits in cause.edits.items():
        text = Path(f"trees/{name}.xml").read_text(encoding="utf-8")
        assert [old for old, _ in edits if old not in text] == []
    # A pattern that matches any line would always count as found.
    assert not re.search(cause.named, "0:00  run ENDED, The time limit of 1:00 has expired.")


@pytest.mark.parametrize(
    "error", [TimeoutError("no zone_b"), subprocess.TimeoutExpired("sar-run", 120.0)], ids=repr
)
def test_run_that_does_not_end_counts_as_missed_cause(error, monkeypatch):
    def first_named(*_):
        raise error

    monkeypatch.setattr(explaining, "first_named", first_named)
    assert explaining.judge(0) == (False, str(error))
