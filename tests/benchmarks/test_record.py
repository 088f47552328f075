"""Tests of the comparison with the record, of the record itself, and of the table of results."""

import pytest

from benchmarks import __main__ as command
from benchmarks import record, running
from benchmarks.record import Run
from benchmarks.rows import Limit, Measured, Result, Row, seconds, write_result

ROWS = (
    Row("a proof", (Limit(2.0, "s CPU"), Limit(150.0, "MB")), "by hand", lambda *_: Measured((1.0, 1.0))),
    Row("a rate", (Limit(60.0, "/min", is_least=True),), "by hand", lambda *_: Measured((1.0,))),
)


def run_of(*values, note="", what="a proof"):
    return Run({"machine": "a fast one"}, {what: Result(values, note)})


def test_value_of_1_5_times_the_record_is_reported():
    (line,) = record.find_worse(ROWS, run_of(3.0, 100.0), run_of(2.0, 90.0))
    assert line == "a proof: 3 s CPU, recorded was 2 s CPU"


def test_lower_rate_is_worse():
    before = run_of(90.0, what="a rate")
    assert record.find_worse(ROWS, run_of(120.0, what="a rate"), before) == []
    assert record.find_worse(ROWS, run_of(50.0, what="a rate"), before) == [
        "a rate: 50 a minute, recorded was 90 a minute"
    ]


@pytest.mark.parametrize("values", [(2.99, 149.0), (0.5, 10.0)])
def test_slightly_worse_or_better_value_is_not_reported(values):
    assert record.find_worse(ROWS, run_of(*values), run_of(2.0, 100.0)) == []


def test_row_missing_in_run_or_record_is_not_reported():
    assert record.find_worse(ROWS, run_of(9.0, 9.0), Run({}, {})) == []
    assert record.find_worse(ROWS, Run({}, {}), run_of(9.0, 9.0)) == []
    assert record.find_worse(ROWS, run_of(9.0, 9.0), run_of(note="not installed")) == []


def test_record_is_loaded_as_it_was_saved(tmp_path):
    run = Run(
        {"machine": "a fast one"},
        {"a proof": Result((2.0, 90.5), "as ever"), "a rate": Result(note="not decided", is_missed=True)},
    )
    record.save(ROWS, run, tmp_path / "recorded.json")
    assert record.load(tmp_path / "recorded.json") == run
    assert record.load(tmp_path / "none.json") == Run({}, {})


def test_new_record_of_one_benchmark_keeps_other_rows():
    merged = record.merged(run_of(70.0, what="a rate"), run_of(1.0, 2.0))
    assert merged.results == {"a proof": Result((1.0, 2.0)), "a rate": Result((70.0,))}


@pytest.mark.parametrize(
    ("result", "text"),
    [
        (Result((2.0, 150.0)), "met: 2 s CPU, 150 MB"),
        (Result((0.12345, 150.1), "in turns"), "**missed**: 123 ms CPU, 150 MB (in turns)"),
        (Result(note="the halves differ"), "not measured: the halves differ"),
        (Result(note="not decided", is_missed=True), "**missed**: not decided"),
        (None, "not measured"),
    ],
)
def test_result_is_written_with_verdict_and_reason(result, text):
    assert write_result(ROWS[0], result) == text


def test_table_row_has_name_goal_result_and_method():
    lines = record.write_tables(ROWS, run_of(1.5, 20.0)).splitlines()
    assert "| machine | a fast one |" in lines
    assert "| a proof | ≤ 2 s CPU, ≤ 150 MB | met: 1.5 s CPU, 20 MB | by hand |" in lines
    assert "| a rate | ≥ 60 a minute | not measured | by hand |" in lines


@pytest.mark.parametrize(("value", "text"), [(2.5, "2.5 s"), (0.1, "100 ms"), (3.1e-6, "3.1 µs")])
def test_seconds_are_written_in_a_suitable_unit(value, text):
    assert seconds(value) == text


def test_only_tables_of_page_are_rewritten(tmp_path):
    page = tmp_path / "README.md"
    page.write_text(f"# Above\n{record.BEGIN}old\n{record.END}below\n", encoding="utf-8")
    run = run_of(1.0, 2.0)
    for _ in range(2):
        record.rewrite(ROWS, run, page)
    assert page.read_text(encoding="utf-8") == (
        f"# Above\n{record.BEGIN}{record.write_tables(ROWS, run)}{record.END}below\n"
    )


@pytest.fixture
def measuring(monkeypatch, tmp_path):
    """Return a function that gives the command a prepared run, with the record in a separate folder."""

    def prepare(run, *, is_failed=False):
        monkeypatch.setattr(command, "measure_benchmarks", lambda *_: (run, is_failed))
        monkeypatch.setattr(record, "RECORD", tmp_path / "recorded.json")
        monkeypatch.setattr(record, "PAGE", tmp_path / "README.md")
        (tmp_path / "README.md").write_text(record.BEGIN + record.END, encoding="utf-8")
        return tmp_path

    return prepare


PATROL = "`verify` of a patrol that counts its rounds"


def test_command_fails_and_names_rows_worse_than_record(measuring, capsys):
    measuring(run_of(0.2, 90.0, what=PATROL))
    assert command.main(["--only", "proofs", "--save"]) == 0
    measuring(run_of(0.4, 90.0, what=PATROL))
    assert command.main(["--only", "proofs"]) == 1
    assert capsys.readouterr().err == (
        f"worse than recorded: {PATROL}: 400 ms CPU, recorded was 200 ms CPU\n"
    )


def test_command_fails_if_a_row_fails(measuring):
    measuring(Run({}, {}), is_failed=True)
    assert command.main(["--only", "proofs"]) == 1


def test_page_is_rewritten_only_by_full_run(measuring):
    page = measuring(run_of(0.2, 90.0, what=PATROL)) / "README.md"
    for options in (["--quick"], ["--only", "proofs"]):
        command.main(options)
        assert page.read_text(encoding="utf-8") == record.BEGIN + record.END
    command.main([])
    assert PATROL in page.read_text(encoding="utf-8")


def test_quick_run_cannot_become_the_record(measuring, capsys):
    measuring(Run({}, {}))
    with pytest.raises(SystemExit):
        command.main(["--quick", "--save"])
    assert "a trial is no record" in capsys.readouterr().err


def test_recorded_rows_exist_in_the_table():
    names = {row.what for row in running.ROWS}
    assert {*record.load(record.RECORD).results} <= names
