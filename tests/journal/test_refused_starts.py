"""A run that is refused before it begins writes no journal: `sar-journal why` says why all the same."""

import json
import os
import re

import pytest

from sar_compiler.cli.journal_command import main
from sar_compiler.journal.refused_start import SUFFIX, forget_refusal, read_refusal, record_refusal

REASON = "m.yaml:3:5: tick_rate_hz is 0, but must be above 0"


@pytest.fixture
def place(tmp_path):
    return tmp_path / "m.journal"


def test_where_no_run_has_begun_why_says_why_the_last_one_was_refused(place, capsys):
    record_refusal(place, 3, "there was no Nav2")
    record_refusal(place, 2, REASON)
    assert main(["why", str(place)]) == 0
    said = capsys.readouterr().out
    assert re.fullmatch(
        rf"The run on \d{{4}}-\d\d-\d\d \d\d:\d\d:\d\d did not start \(exit status 2\): {re.escape(REASON)}\n",
        said,
    )
    assert main(["why", str(place), "--format", "json"]) == 0
    start = json.loads(capsys.readouterr().out)["refused_start"]
    assert (start["status"], start["reason"]) == (2, REASON)


def test_a_journal_without_a_run_and_without_a_refusal_is_not_there(place, capsys):
    record_refusal(place, 2, REASON)
    forget_refusal(place)
    assert main(["why", str(place)]) == 2
    assert str(place) in capsys.readouterr().err


@pytest.mark.parametrize(
    "text", ["", "{}", "[1, 2]", '["a", 2, "r"]', "[" * 100_000, "[1e999, 2, 3, 4]", "\xff"]
)
def test_a_damaged_file_of_a_refusal_counts_as_none(place, text):
    place.with_name(f"{place.name}{SUFFIX}").write_text(text, encoding="latin-1")
    assert read_refusal(place) is None


def test_a_refusal_that_cannot_be_written_is_no_error(tmp_path):
    (tmp_path / "file").write_text("", encoding="utf-8")
    for place in (tmp_path / "file" / "m.journal", tmp_path / ("x" * 255), tmp_path / "nul\0"):
        record_refusal(place, 2, REASON)
        forget_refusal(place)
        assert read_refusal(place) is None
    assert os.listdir(tmp_path) == ["file"]  # noqa: PTH208 - of a name with a zero byte, pathlib says nothing
