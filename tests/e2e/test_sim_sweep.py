"""Tests of `sar-sim sweep`, which runs missions in the simulator repeatedly."""

import json
import os
import signal
import sys
from pathlib import Path

import pytest

from sar_compiler.cli.sim import main
from sar_compiler.helper_process import helper_command
from sar_compiler.sim import simulated_runs
from search_and_rescue.hiding import HiddenSurvivor
from search_and_rescue.search_theory import SearchExpectation
from search_and_rescue.zone_manager import MapPose
from tests.processes import children_of
from tests.waiting import News

AREAS = Path("config/search_areas_params.yaml").resolve()
POSE = {"zone_c": MapPose(x=4.0, y=-3.0, yaw=3.14)}
PROGRAM = tuple(helper_command("sar_compiler.cli.console", "sar_run_repeatedly"))
REFUSED = "report_survivor:refuse=1"


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def wait_for_runs(sweep, count):
    """Return the processes that run missions for a sweep, once there are at least `count` of them."""

    def run_processes():
        found = children_of(sweep.pid, "sar_run")
        return found if len(found) >= count else []

    news = News()
    with news:
        return news.wait_until(run_processes, lambda: "no runs start")


@pytest.mark.ros
@pytest.mark.slow
def test_missions_run_for_each_set_of_faults_and_killed_run_is_repeated(start):
    mixes = ["--fault", "none", "--fault", f"{REFUSED} detect_survivor:delay=1"]
    wanted = ["-o", "small.sh", "--vary", "zone_order=[zone_a]", "--runs", 1, "--jobs", 2, "--format", "json"]
    sweep = start("sar-sim", "sweep", "search_and_rescue", *mixes, *wanted)
    os.kill(wait_for_runs(sweep, 1)[0], signal.SIGKILL)
    assert sweep.end() == 1, sweep.output
    result = json.loads(sweep.output)
    rows = result["rows"]
    assert [(row["runs"], row["successes"]) for row in rows] == [(1, 1), (1, 0)]
    assert [row["means"]["survivors reported"] for row in rows] == [1.0, 0.0]
    assert rows[0]["labels"] == {"faults": "none", "zone_order": "[zone_a]"}
    assert "did not acknowledge" in result["smallest"]["failure"]
    script = Path("small.sh").read_text(encoding="utf-8")
    command = "exec sar-run search_and_rescue --sim disaster_zone --speed 1000 --fault report_survivor:refuse=1 --seed 0"
    assert script.splitlines()[-1] == f"{command} --ros-args -p 'zone_order:=[zone_a]'"


@pytest.fixture
def one_zone():
    """Return short runs, in processes that end with the test."""
    with simulated_runs.mission_threads(1):
        arguments = ("search_and_rescue", "--sim", "--speed", "1000")
        yield simulated_runs.SimulatedRuns(PROGRAM, arguments, ros=("-p", "zone_order:=[zone_a]"))


@pytest.mark.costly
@pytest.mark.ros
def test_one_process_runs_several_missions_with_reproducible_results(one_zone):
    outcomes = [*one_zone([7]), *one_zone([8, 7])]
    assert [each.failure for each in outcomes] == ["", "", ""]
    assert outcomes[0].counts == outcomes[2].counts
    # A tick is half a second.
    assert outcomes[0].time_sec == pytest.approx(outcomes[2].time_sec, abs=1.0)
    assert len(simulated_runs._idle_processes) == 1


def test_run_without_result_raises_error(monkeypatch):
    monkeypatch.setattr(
        simulated_runs,
        "_execute_run",
        lambda _program, _: simulated_runs.SimulatedRunResult(1, problem="it broke"),
    )
    with pytest.raises(simulated_runs.SimulatedRunError, match="it broke"):
        simulated_runs.SimulatedRuns(PROGRAM, ("a_tree",))([0])


@pytest.mark.costly
@pytest.mark.ros
def test_seed_determines_detection_and_its_simulated_time():
    arguments = ("search_areas", "--sim", "--speed", "1000", "--params", str(AREAS))
    only = ("-p", "zone_order:=[zone_c]", "-p", "hidden_survivor:=true")
    area = {"zone_c": SearchExpectation(0.5, 0.7)}
    seeds = [
        next(
            seed
            for seed in range(99)
            if (HiddenSurvivor(POSE, area, seed).search("zone_c") is not None) is is_found
        )
        for is_found in (True, False)
    ]
    with simulated_runs.mission_threads(1):
        found, missed = simulated_runs.SimulatedRuns(PROGRAM, arguments, ros=only)(seeds)
    assert (found.counts["survivors found"], missed.counts["survivors found"]) == (1, 0)
    # 5 m at 0.6 m/s in simulated time; the wall time is only a fraction of it.
    assert 8.0 < found.counts["first detection after"] < found.time_sec
    assert "first detection after" not in missed.counts


@pytest.mark.ros
def test_single_threaded_executor_replaces_missing_events_executor(monkeypatch):
    from rclpy.context import Context
    from rclpy.executors import SingleThreadedExecutor

    from sar_compiler.ros.executors import make_executor

    monkeypatch.setitem(sys.modules, "rclpy.experimental", None)
    context = Context()
    context.init()
    assert isinstance(make_executor(context, "events"), SingleThreadedExecutor)
    context.try_shutdown()


@pytest.mark.usefixtures("one_zone")
def test_crashed_idle_process_is_replaced():
    dead = simulated_runs.RunProcessSlot(PROGRAM)
    dead.stop()
    dead._process.wait()
    simulated_runs._idle_processes.append(dead)
    run_result = simulated_runs._execute_run(PROGRAM, ["--tee"])
    assert run_result.status == 2
    assert run_result.problem == "sar-run: error: unrecognized arguments: --tee; did you mean '--tree'?"
    assert dead not in simulated_runs._idle_processes


@pytest.mark.ros
@pytest.mark.parametrize(("number", "status"), [(signal.SIGTERM, 143), (signal.SIGHUP, 129)])
def test_signal_stops_runs_and_shows_partial_result(start, number, status):
    sweep = start("sar-sim", "sweep", "search_and_rescue", "--runs", 9, "--jobs", 2)
    workers = wait_for_runs(sweep, 2)
    sweep.send(number)
    assert sweep.end() == status, sweep.output
    assert sweep.output.startswith("runs  success")
    assert sweep.output.endswith(f"sweep: stopped by {number.name}")
    assert not any(Path(f"/proc/{each}").exists() for each in workers)


@pytest.mark.ros
def test_time_limit_stops_runs_and_shows_partial_result(start):
    sweep = start("sar-sim", "sweep", "search_and_rescue", "--runs", 9, "--jobs", 2, "--max-seconds", 2)
    assert sweep.end() == 1, sweep.output
    assert "runs  success" in sweep.output
    assert "sweep: stopped after 2 s. Raise the limit with --max-seconds" in sweep.output


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--world", "moon"], "there is no world file 'moon'"),
        (["--fault", "report_survivor:drp=1"], "did you mean 'drop'?"),
        (["--vary", "zone_order"], "'zone_order' is not NAME=VALUE,VALUE"),
    ],
)
def test_invalid_arguments_are_rejected(arguments, words, capsys):
    try:
        assert main(["sweep", "search_and_rescue", *arguments]) == 2
    except SystemExit as end:
        assert end.code == 2  # noqa: PT017 - either way is how a command ends
    assert words in capsys.readouterr().err


@pytest.mark.ros
def test_run_that_cannot_start_ends_sweep_with_its_message(capsys):
    status = main(
        ["sweep", "search_and_rescue", "--vary", "zone_order=[zone_x]", "--jobs", "1", "--runs", "1"]
    )
    assert status == 2
    err = capsys.readouterr().err
    assert "sar-run search_and_rescue --sim disaster_zone" in err
    assert "zone_x" in err
