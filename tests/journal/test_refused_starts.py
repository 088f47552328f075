"""Tests of runs that are refused before they begin: they write no journal, but `sar-journal why` prints the reason."""

import json
import os
import re

import pytest

from sar_compiler.cli.journal_command import main
from sar_compiler.journal.refused_start import SUFFIX, forget_refusal, read_refusal, record_refusal

REASON = "m.yaml:3:5: tick_rate_hz is 0, but must be above 0"


@pytest.fixture
def journal_path(tmp_path):
    return tmp_path / "m.journal"


def test_why_prints_reason_of_last_refused_start(journal_path, capsys):
    record_refusal(journal_path, 3, "there was no Nav2")
    record_refusal(journal_path, 2, REASON)
    assert main(["why", str(journal_path)]) == 0
    said = capsys.readouterr().out
    assert re.fullmatch(
        rf"The run on \d{{4}}-\d\d-\d\d \d\d:\d\d:\d\d did not start \(exit status 2\): {re.escape(REASON)}\n",
        said,
    )
    assert main(["why", str(journal_path), "--format", "json"]) == 0
    start = json.loads(capsys.readouterr().out)["refused_start"]
    assert (start["status"], start["reason"]) == (2, REASON)


def test_missing_journal_without_refusal_is_an_error(journal_path, capsys):
    record_refusal(journal_path, 2, REASON)
    forget_refusal(journal_path)
    assert main(["why", str(journal_path)]) == 2
    assert str(journal_path) in capsys.readouterr().err


@pytest.mark.parametrize(
    "text", ["", "{}", "[1, 2]", '["a", 2, "r"]', "[" * 100_000, "[1e999, 2, 3, 4]", "\xff"]
)
def test_damaged_refusal_file_is_ignored(journal_path, text):
    journal_path.with_name(f"{journal_path.name}{SUFFIX}").write_text(text, encoding="latin-1")
    assert read_refusal(journal_path) is None


def test_refusal_that_cannot_be_written_is_no_error(tmp_path):
    (tmp_path / "file").write_text("", encoding="utf-8")
    for journal_path in (tmp_path / "file" / "m.journal", tmp_path / ("x" * 255), tmp_path / "nul\0"):
        record_refusal(journal_path, 2, REASON)
        forget_refusal(journal_path)
        assert read_refusal(journal_path) is None
    assert os.listdir(tmp_path) == ["file"]  # noqa: PTH208 - pathlib ignores a name with a zero byte
