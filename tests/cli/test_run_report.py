"""The reports of a run, and of a journal: what becomes of the others if one of them cannot be made or written."""

import re

import pytest

from sar_compiler.cli.arguments import REPORT_FORMS
from sar_compiler.cli.run_report import RunReport, report_journal
from sar_compiler.journal.journal_entries import JournalEntry
from sar_compiler.journal.opening import open_journal
from sar_compiler.views.mission_report import FORMS

BEGAN = JournalEntry(1, 1, 1.7e9, 0.0, "run_began", {"mission": "patrol", "identity": {}, "run": {}})


@pytest.fixture
def breaking(monkeypatch):
    """Let the first form of two be one that cannot be made."""

    def fail(*_):
        message = "no way"
        raise ZeroDivisionError(message)

    monkeypatch.setattr("sar_compiler.views.report_html.html_report", fail)


@pytest.fixture
def files(tmp_path):
    return [tmp_path / "r.html", tmp_path / "r.json"]


def test_a_report_that_cannot_be_made_is_told_and_the_others_are_written(breaking, files, capsys):
    report = RunReport(files, None, [])
    report.take(BEGAN)
    report.end(has_begun=True)
    assert capsys.readouterr().err == (
        f"sar-run: the report {files[0]} could not be made: ZeroDivisionError('no way')\n"
    )
    assert '"mission": "patrol"' in files[1].read_text(encoding="utf-8")


def test_a_file_that_cannot_be_written_any_more_is_told_and_the_others_are_written(files, capsys):
    report = RunReport(files, None, [])
    report.take(BEGAN)
    files[0].mkdir()
    report.end(has_begun=True)
    assert f"sar-run: cannot write {files[0]}: Is a directory" in capsys.readouterr().err
    assert files[1].exists()


def test_a_run_that_has_not_begun_has_no_report(files):
    RunReport(files, None, [BEGAN]).end(has_begun=False)
    assert not any(file.exists() for file in files)


def test_of_a_journal_none_is_written_if_one_cannot_be_made(breaking, files, tmp_path):
    journal = open_journal(tmp_path / "m.journal")
    journal.begin({"mission": "patrol"}, {})
    journal.close()
    with pytest.raises(ZeroDivisionError):
        report_journal(tmp_path / "m.journal", files[::-1])
    assert not any(file.exists() for file in files)


def test_the_help_names_every_form_of_a_report():
    assert re.findall(r"\.\w+", REPORT_FORMS) == [*FORMS]
