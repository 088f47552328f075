"""The causes that are planted to score `why` fit the shipped trees."""

import re
import subprocess
from pathlib import Path

import pytest

from benchmarks import explaining
from benchmarks.explaining import CAUSES

LEAST = 28


def test_so_many_kinds_of_causes_are_planted_each_once():
    kinds = [cause.kind for cause in CAUSES]
    assert len(kinds) >= LEAST
    assert len({*kinds}) == len(kinds)


@pytest.mark.parametrize("cause", CAUSES, ids=lambda each: each.kind)
def test_a_cause_is_planted_in_a_tree_that_has_the_place_for_it(cause):
    assert Path(f"trees/{cause.tree}.xml").is_file()
    for name, edits in cause.edits.items():
        text = Path(f"trees/{name}.xml").read_text(encoding="utf-8")
        assert [old for old, _ in edits if old not in text] == []
    # Something named by any line would always be found.
    assert not re.search(cause.named, "0:00  run ENDED, The time limit of 1:00 has expired.")


@pytest.mark.parametrize(
    "error", [TimeoutError("no zone_b"), subprocess.TimeoutExpired("sar-run", 120.0)], ids=repr
)
def test_a_run_that_does_not_end_is_a_cause_that_is_missed(error, monkeypatch):
    def first_named(*_):
        raise error

    monkeypatch.setattr(explaining, "first_named", first_named)
    assert explaining.judge(0) == (False, str(error))
