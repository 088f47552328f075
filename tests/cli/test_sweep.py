"""Tests of `sar-compile sweep`."""

import json
import os
import signal
import subprocess
import sys
from contextlib import suppress
from pathlib import Path

import pytest

from sar_compiler.cli.arguments import MAX_JOBS
from sar_compiler.cli.compile import main
from tests.processes import children_of
from tests.slowness import without_progress
from tests.trees import document
from tests.waiting import News

SCENARIO = """
ticks: 100
until: "zones_left == 0 && at == 'base'"
leaves:
  NavigateToZone: [{outcome: aborted, probability: 0.2, times: always}, {outcome: arrived, after: 2s to 6s, times: always}]
  NavigateToBase: [{outcome: aborted, probability: 0.1, times: always}]
"""
MISSION = ("search_and_rescue", "--count", "NotifyBase acknowledged", "--set", "zones_left=1,2")

TRIES, ATS = f"tries={','.join(map(str, range(101)))}", f"at={','.join('12345' * 20)}"


def run(capsys, *arguments):
    status = main(["sweep", *map(str, arguments)])
    captured = capsys.readouterr()
    return status, captured.out, without_progress(captured.err)


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    """Work in a folder with a scenario and a tree."""
    monkeypatch.chdir(tmp_path)
    Path("day.yaml").write_text(SCENARIO, encoding="utf-8")
    Path("tree.xml").write_text(document('<NavigateToZone name="Go"/>'), encoding="utf-8")
    return tmp_path


def table(text):
    return [line.split() for line in text.split("\n\n")[0].splitlines()]


def test_table_has_row_for_each_combination(capsys):
    status, out, _ = run(
        capsys, *MISSION, "--scenario", "day.yaml", "--unusual", "0,0.2", "--runs", 25, "--jobs", 1
    )
    assert status == 1
    rows = table(out)
    assert [row[:3] for row in rows[1:]] == [
        ["0", "1", "25"],
        ["0", "2", "25"],
        ["0.2", "1", "25"],
        ["0.2", "2", "25"],
    ]
    assert out.startswith("unusual  zones_left  runs  success  95 % interval  time (median)")


def test_result_does_not_depend_on_number_of_processes(capsys):
    wanted = [*MISSION, "--scenario", "day.yaml", "--runs", 50, "--half-width", 0.12]
    one = run(capsys, *wanted, "--jobs", 1)
    assert run(capsys, *wanted, "--jobs", 2) == one


def two_workers(process):
    """Return the workers of a sweep once there are two."""
    found = children_of(process.pid, "spawn_main")
    return found if len(found) == 2 else []


@pytest.mark.skipif(sys.platform != "linux", reason="looks for the workers in /proc")
def test_killed_workers_do_not_change_table(capsys):
    wanted = [*map(str, MISSION), "--scenario", "day.yaml", "--runs", "100", "--half-width", "0"]
    command = [sys.executable, "-m", "sar_compiler.cli.compile", "sweep", *wanted, "--jobs", "2"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    try:
        news = News()
        with news:
            workers = news.wait_until(lambda: two_workers(process), lambda: "the two workers do not start")
        os.kill(workers[0], signal.SIGKILL)
        # The sweep itself ends the second worker as soon as it notices that the first has ended.
        with suppress(ProcessLookupError):
            os.kill(workers[1], signal.SIGKILL)
        out, err = process.communicate()
    finally:
        process.kill()
    assert (process.returncode, out, without_progress(err)) == run(capsys, *wanted, "--jobs", 1)


def test_smallest_failure_is_written_as_failing_scenario(capsys):
    options = ("--scenario", "day.yaml", "--runs", 50, "--jobs", 1)
    status, out, _ = run(capsys, "search_and_rescue", *options, "-o", "small.yaml")
    assert status == 1
    command = out.splitlines()[-1].partition("Replay it with: sar-compile ")[2].split()
    assert command[-1] == "small.yaml"
    assert main(command) == 1
    assert "does not hold" in capsys.readouterr().out


def test_failure_is_written_only_with_output_option(capsys):
    before = {*Path().iterdir()}
    _, out, _ = run(capsys, "search_and_rescue", "--scenario", "day.yaml", "--runs", 50, "--jobs", 1)
    assert out.endswith("\n  -o FILE writes the smallest scenario that fails\n")
    assert {*Path().iterdir()} == before


def test_json_output_has_rows_and_smallest_failure(capsys):
    options = ("--scenario", "day.yaml", "--runs", 50, "--jobs", 1, "--format", "json", "-o", "small.yaml")
    status, out, _ = run(capsys, *MISSION, *options)
    result = json.loads(out)
    assert status == 1
    assert [row["labels"] for row in result["rows"]] == [{"zones_left": "1"}, {"zones_left": "2"}]
    for row in result["rows"]:
        assert row["runs"] == row["successes"] + len(row["failures"]) == 50
        assert row["interval"][0] < row["rate"] < row["interval"][1]
        assert row["means"].keys() == {"NotifyBase acknowledged"}
    assert (result["smallest"]["file"], Path("small.yaml").is_file()) == ("small.yaml", True)


@pytest.mark.parametrize(
    ("unusual", "least", "status"), [("0.5", [], 1), ("0.5", [0.3], 0), ("0.5", [0.6], 1)]
)
def test_status_depends_on_required_success_rate(capsys, unusual, least, status):
    wanted = [f"--at-least={rate}" for rate in least]
    assert run(capsys, "tree.xml", "--unusual", unusual, "--runs", 100, "--jobs", 1, *wanted)[0] == status


def test_tree_that_never_fails_has_status_0_and_writes_no_file(capsys, folder):
    Path("tree.xml").write_text(document("<ForceSuccess><NavigateToZone/></ForceSuccess>"), encoding="utf-8")
    status, out, err = run(capsys, "tree.xml", "--unusual", "0.5", "--jobs", 1)
    assert (status, err) == (0, "")
    assert table(out)[1][:6] == ["100", "100.0", "%", "96.3", "to", "100.0"]
    assert {path.name for path in folder.iterdir()} == {"day.yaml", "tree.xml"}


def test_parameter_is_varied(capsys):
    tree = '<Retry num_failures="{@tries}"><NavigateToZone/></Retry>'
    Path("tree.xml").write_text(document(tree), encoding="utf-8")
    _, out, _ = run(capsys, "tree.xml", "--unusual", 0.5, "--vary", "tries=1,4", "--runs", 200, "--jobs", 1)
    rates = [float(row[2]) for row in table(out)[1:]]
    assert 40.0 < rates[0] < 60.0
    assert 85.0 < rates[1] < 99.0


def test_identical_runs_are_rejected(capsys):
    status, out, err = run(capsys, "tree.xml", "--jobs", 1)
    assert (status, out) == (2, "")
    assert "all runs would be the same" in err
    assert "--unusual 0.1" in err


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--set", "zones_lft=1"], "no leaf of this tree declares a fact 'zones_lft'"),
        (["--set", "zones_left=many"], "the fact 'zones_left' must be an integer, but is 'many'"),
        (["--count", "Go arived"], "did you mean 'arrived'?"),
        (["--scenario", "no.yaml"], "cannot read no.yaml"),
        (
            ["--vary", TRIES, "--set", ATS],
            "101 x 100 = 10,100 combinations, but at most 10,000 are allowed: vary fewer values",
        ),
    ],
)
def test_impossible_sweep_has_status_2_and_reason(capsys, arguments, words):
    status, out, err = run(capsys, "tree.xml", "--unusual", 0.1, *arguments)
    assert (status, out) == (2, "")
    assert words in err


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--vary", "tries"], "'tries' is not NAME=VALUE,VALUE"),
        (["--vary", "tries=[1"], "is not NAME=VALUE,VALUE"),
        (["--unusual", "2"], "'2' is not a number between 0 and 1"),
        (["--confidence", "1"], "'1' is not a number above 0 and below 1"),
        (["--seed", "-1"], "'-1' is not an integer of 0 or more"),
        (["--jobs", "100000"], f"'100000' is not a number of processes from 1 to {MAX_JOBS}"),
    ],
)
def test_invalid_option_value_is_rejected(capsys, arguments, words):
    with pytest.raises(SystemExit) as end:
        run(capsys, "tree.xml", *arguments)
    assert end.value.code == 2
    assert words in capsys.readouterr().err


def test_seed_determines_simulated_run_of_scenario(capsys):
    def played(seed):
        main(["simulate", "search_and_rescue", "--scenario", "day.yaml", "--seed", str(seed)])
        return capsys.readouterr().out

    assert played(1) == played(1) != played(2)
