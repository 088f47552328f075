"""Tests of writing several reports of a run or a journal: one that fails does not prevent the others."""

import json
import re
import sys
from contextlib import closing

import pytest

from sar_compiler.cli.journal_command import main
from sar_compiler.journal.journal_entries import JournalEntry
from sar_compiler.journal.journal_opening import open_journal
from sar_compiler.reports.report_forms import FORMS, describe_forms
from sar_compiler.reports.run_report import RunReport

BEGAN = JournalEntry(1, 1, 1.7e9, 0.0, "run_began", {"mission": "patrol", "identity": {}, "run": {}})


@pytest.fixture
def failing_html(monkeypatch):
    """Let the HTML report fail."""

    def fail(*_):
        message = "no way"
        raise ZeroDivisionError(message)

    monkeypatch.setattr("sar_compiler.reports.report_html.html_report", fail)


@pytest.fixture
def files(tmp_path):
    return [tmp_path / "r.html", tmp_path / "r.json"]


def test_failing_form_is_reported_and_other_forms_are_written(failing_html, files, capsys):
    report = RunReport(files, None, [], files[0].parent)
    report.on_entry(BEGAN)
    report.on_end(has_begun=True)
    assert capsys.readouterr().err == (
        f"sar-run: the report {files[0]} could not be created: ZeroDivisionError('no way')\n"
    )
    assert '"mission": "patrol"' in files[1].read_text(encoding="utf-8")


def test_unwritable_file_is_reported_and_other_forms_are_written(files, capsys):
    report = RunReport(files, None, [], files[0].parent)
    report.on_entry(BEGAN)
    files[0].mkdir()
    report.on_end(has_begun=True)
    assert f"sar-run: cannot write {files[0]}: Is a directory" in capsys.readouterr().err
    assert files[1].exists()


def test_run_that_has_not_begun_has_no_report(files):
    RunReport(files, None, [BEGAN], files[0].parent).on_end(has_begun=False)
    assert not any(file.exists() for file in files)


PLACE = {"georeference.lat": 48.2, "georeference.lon": 16.37, "georeference.heading": 90.0}
OPTION = ("--georeference", "-33.9,18.4,0")


@pytest.fixture
def write_journal(tmp_path):
    """Return a function that writes the journal of a run with parameters and returns its path."""

    def write(**parameters):
        journal = open_journal(tmp_path / "m.journal")
        journal.begin({"mission": "patrol"}, {"parameters": parameters})
        journal.record_event("survivor_named", survivor="survivor_1", x=0.0, y=0.0)
        journal.close()
        return str(tmp_path / "m.journal")

    return write


def written_reports(tmp_path):
    return {file.name for file in tmp_path.iterdir() if file.name.startswith("r.")}


def test_command_writes_other_forms_if_one_fails(failing_html, files, write_journal, capsys):
    assert main(["report", write_journal(), "-o", *map(str, files)]) == 1
    assert not files[0].exists()
    assert files[1].exists()
    assert capsys.readouterr().err == (
        f"sar-journal: the report {files[0]} could not be created: ZeroDivisionError('no way')\n"
    )


def test_command_writes_possible_forms_and_reports_others(write_journal, tmp_path, capsys):
    out = [str(tmp_path / f"r.{ending}") for ending in ("geojson", "pdf", "html", "cot", "json")]
    assert main(["report", write_journal(), "-o", *out]) == 1
    assert written_reports(tmp_path) == {"r.html", "r.json"}
    told = capsys.readouterr().err.splitlines()
    assert [
        line.startswith(f"sar-journal: {out[at]} contains world coordinates")
        for line, at in zip(told, (0, 1, 3), strict=True)
    ] == [True, False, True]
    assert "--georeference LAT,LON,HEADING" in told[0]
    assert "the report format of " in told[1]


@pytest.mark.parametrize(("form", "library"), [("geojson", "geojson"), ("html", "jinja2")])
def test_command_reports_form_with_missing_library(
    write_journal, tmp_path, capsys, monkeypatch, form, library
):
    monkeypatch.setitem(sys.modules, library, None)
    out = [str(tmp_path / f"r.{form}"), str(tmp_path / "r.json")]
    assert main(["report", write_journal(**PLACE), "-o", *out]) == 1
    assert written_reports(tmp_path) == {"r.json"}
    assert (
        f"sar-journal: {out[0]}: a report as a page or in world coordinates needs" in capsys.readouterr().err
    )


def georeference_in(file):
    data = json.loads(file.read_text(encoding="utf-8"))
    return [*data["georeference"].values()]


def test_georeference_can_be_set_by_option(write_journal, tmp_path, capsys):
    out = tmp_path / "r.json", tmp_path / "r.geojson"
    assert main(["report", write_journal(), "-o", *map(str, out), *OPTION]) == 0
    assert georeference_in(out[0]) == [-33.9, 18.4, 0.0]
    assert out[1].exists()
    assert not capsys.readouterr().err


def test_georeference_option_replaces_that_of_journal_with_note(write_journal, tmp_path, capsys):
    out = tmp_path / "r.json"
    assert main(["report", write_journal(**PLACE), "-o", str(out), *OPTION]) == 0
    assert georeference_in(out) == [-33.9, 18.4, 0.0]
    assert capsys.readouterr().err == (
        "sar-journal: note: --georeference -33.9,18.4,0.0 replaces the journal's 48.2,16.37,90.0\n"
    )


def test_georeference_option_equal_to_journal_prints_no_note(write_journal, tmp_path, capsys):
    out = str(tmp_path / "r.json")
    assert main(["report", write_journal(**PLACE), "-o", out, "--georeference", "48.2,16.37,90"]) == 0
    assert not capsys.readouterr().err


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("91,0,0", "'91,0,0': lat must be degrees between -90 and 90, not 91"),
        ("0,-181,0", "'0,-181,0': lon must be degrees between -180 and 180, not -181"),
        ("0,0,361", "'0,0,361': heading must be degrees between -360 and 360, not 361"),
        ("nan,0,0", "'nan,0,0': lat must be degrees between -90 and 90, not nan"),
        ("48.2,16.37", "'48.2,16.37' is not LAT,LON,HEADING in degrees"),
        ("48.2,16.37,90,1", "'48.2,16.37,90,1' is not LAT,LON,HEADING in degrees"),
        ("here", "'here' is not LAT,LON,HEADING in degrees"),
    ],
)
def test_invalid_georeference_option_is_usage_error(text, words, capsys):
    with pytest.raises(SystemExit) as ended:
        main(["report", "m.journal", "-o", "r.json", f"--georeference={text}"])
    assert ended.value.code == 2
    assert words in capsys.readouterr().err


def test_help_names_every_report_form():
    assert re.findall(r"\.\w+", describe_forms()) == [*FORMS]


@pytest.mark.parametrize("is_of_journal", [True, False])
def test_paths_in_reports_are_relative_to_journal(files, tmp_path, is_of_journal):
    place = tmp_path / "m.journal"
    photo = {"file": str(tmp_path / "photos" / "1.jpg")}
    if is_of_journal:
        with closing(open_journal(place)) as journal:
            journal.begin({"mission": "patrol"}, {"parameters": photo})
            journal.record_event("photo_taken", **photo)
        assert main(["report", str(place), "-o", *map(str, files)]) == 0
    else:
        report = RunReport(files, None, [], tmp_path)
        report.on_entry(BEGAN._replace(data={**BEGAN.data, "run": {"parameters": photo}}))
        report.on_entry(BEGAN._replace(kind="photo_taken", data=photo))
        report.on_end(has_begun=True)
    for file in files:
        text = file.read_text(encoding="utf-8")
        assert text.count("photos/1.jpg") >= 2
        assert str(tmp_path) not in text
