"""The guard, the record, and the tables that are made of a run."""

import pytest

from benchmarks import __main__ as command
from benchmarks import record, running, tables
from benchmarks.figures import Figure, Missing
from benchmarks.goals import GOALS
from benchmarks.record import Run

TICK = "balanced, 10,000 leaves"
GOAL = next(goal for goal in GOALS if goal.subject == TICK)


def figure(ratio, against="BehaviorTree.CPP", subject=TICK):
    return Figure(subject, against, ratio, ratio * 0.9, ratio * 1.1, 0.0025, "s")


def run_of(*figures, missing=(), name="ticking"):
    return Run({"machine": "a fast one"}, {name: list(figures)}, {name: list(missing)})


def test_a_ratio_that_is_one_and_a_half_times_the_recorded_one_is_named():
    (line,) = record.worse(
        run_of(figure(3.0), figure(2.9, "py_trees")), run_of(figure(2.0), figure(2.0, "py_trees"))
    )
    assert line == f"ticking: {TICK} beside BehaviorTree.CPP: 3, recorded was 2: 1.5 times as much"


@pytest.mark.parametrize("ratio", [2.99, 0.5])
def test_a_ratio_that_is_a_little_worse_or_better_is_not_named(ratio):
    assert record.worse(run_of(figure(ratio)), run_of(figure(2.0))) == []


def test_a_figure_that_was_too_small_to_be_recorded_is_not_named():
    assert record.worse(run_of(figure(9.0)), run_of(figure(0.0))) == []


def test_a_figure_that_only_the_run_or_only_the_record_has_is_not_named():
    assert record.worse(run_of(figure(9.0)), run_of(figure(1.0, "py_trees"))) == []


def test_the_record_is_read_as_it_was_written(tmp_path):
    run = run_of(figure(2.0), missing=[Missing("", "SPIN", "it is not installed")])
    record.save(run, tmp_path / "recorded.json")
    assert record.load(tmp_path / "recorded.json") == run


def test_without_a_record_there_is_nothing_to_compare_with(tmp_path):
    assert record.worse(run_of(figure(2.0)), record.load(tmp_path / "none.json")) == []


def test_a_new_record_of_one_benchmark_keeps_those_of_the_others():
    merged = record.merged(run_of(figure(3.0)), run_of(figure(1.0), name="verify"))
    assert merged.figures == {"verify": [figure(1.0)], "ticking": [figure(3.0)]}


def row(run, start=GOAL.what):
    (line,) = [line for line in tables.tables(run).splitlines() if line.startswith(f"| {start} |")]
    return [cell.strip() for cell in line.strip("|").split("|")]


def test_a_goal_that_is_reached_is_told_with_its_figures():
    assert row(run_of(figure(1.5), figure(2.0, "bare calls")))[2:4] == [
        "≤ 1.5 x BehaviorTree.CPP, ≤ 2 x bare calls",
        "met: 2.50 ms, 1.50 (1.35 to 1.65) x BehaviorTree.CPP, 2.00 (1.80 to 2.20) x bare calls",
    ]


def test_a_goal_of_which_one_part_is_missed_is_missed():
    assert row(run_of(figure(1.5), figure(2.1, "bare calls")))[3].startswith("**missed**: ")


def test_a_goal_that_was_not_measured_says_so_with_the_reason():
    run = run_of(figure(2.0, "bare calls"), missing=[Missing("", "BehaviorTree.CPP", "it is not installed")])
    assert row(run)[3] == "not measured: it is not installed"
    assert row(Run({}, {}, {}))[3] == "not measured"


def test_a_table_has_a_column_for_each_reference_and_says_below_what_is_missing():
    run = run_of(
        figure(0.5, "py_trees"),
        figure(2.0, "bare calls", "wide"),
        missing=[Missing("wide", "py_trees", "too wide")],
    )
    assert tables.benchmark_table(run, "ticking") == (
        "|  | takes | x py_trees | x bare calls |\n"
        "| --- | --- | --- | --- |\n"
        f"| {TICK} | 2.50 ms | 0.500 (0.450 to 0.550) |  |\n"
        "| wide | 2.50 ms |  | 2.00 (1.80 to 2.20) |\n"
        "\n- not measured: wide beside py_trees: too wide\n"
    )


@pytest.mark.parametrize(
    ("value", "unit", "written"),
    [
        (2.5, "s", "2.50 s"),
        (3.1e-6, "s", "3.10 µs"),
        (1 / 50_000, "s/state", "50,000 states/s"),
        (2**21, "bytes", "2 MiB"),
    ],
)
def test_a_figure_is_written_in_its_unit(value, unit, written):
    assert tables.UNITS[unit](value) == written


def test_only_the_tables_of_the_page_are_rewritten(tmp_path):
    page = tmp_path / "README.md"
    page.write_text(f"# Above\n{tables.BEGIN}old\n{tables.END}below\n", encoding="utf-8")
    for _ in range(2):
        tables.rewrite(run_of(figure(1.0)), page)
    assert page.read_text(encoding="utf-8") == (
        f"# Above\n{tables.BEGIN}{tables.tables(run_of(figure(1.0)))}{tables.END}below\n"
    )
    assert "a fast one" in page.read_text(encoding="utf-8")


@pytest.fixture
def measuring(monkeypatch, tmp_path):
    """The command with a run that need not be measured, and a record in a folder of its own."""

    def prepare(run, failed=False):
        monkeypatch.setattr(command, "measured", lambda *_: (run, failed))
        monkeypatch.setattr(record, "RECORD", tmp_path / "recorded.json")
        monkeypatch.setattr(tables, "README", tmp_path / "README.md")
        (tmp_path / "README.md").write_text(tables.BEGIN + tables.END, encoding="utf-8")
        return tmp_path

    return prepare


def test_the_command_fails_and_names_what_is_worse_than_recorded(measuring, capsys):
    measuring(run_of(figure(2.0)))
    assert command.main(["--only", "ticking", "--save"]) == 0
    measuring(run_of(figure(4.0)))
    assert command.main(["--only", "ticking"]) == 1
    assert capsys.readouterr().err == (
        f"worse than recorded: ticking: {TICK} beside BehaviorTree.CPP: 4, recorded was 2: 2.0 times as much\n"
    )


def test_the_command_fails_if_a_benchmark_has(measuring):
    measuring(run_of(), failed=True)
    assert command.main(["--only", "ticking"]) == 1


def test_the_page_is_rewritten_by_a_whole_run_only(measuring):
    run = Run({}, {name: [figure(1.0)] for name in running.BENCHMARKS}, {})
    page = measuring(run) / "README.md"
    for options in (["--quick"], ["--only", "ticking"]):
        command.main(options)
        assert page.read_text(encoding="utf-8") == tables.BEGIN + tables.END
    command.main([])
    assert page.read_text(encoding="utf-8") == tables.BEGIN + tables.tables(run) + tables.END


def test_a_trial_cannot_be_the_record(measuring, capsys):
    measuring(run_of())
    with pytest.raises(SystemExit):
        command.main(["--quick", "--save"])
    assert "a trial is no record" in capsys.readouterr().err
