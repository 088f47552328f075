"""Tests of stopped and failed runs: the goal is canceled, and the exit status states the reason."""

import signal

import pytest

pytestmark = pytest.mark.ros

CANCELED = 5
EXECUTING = 2
ONE_ZONE = ("--ros-args", "-p", "zone_order:=[zone_b]")


@pytest.mark.parametrize(
    ("number", "expected"),
    [
        (signal.SIGINT, 130),
        *(
            pytest.param(number, 128 + number, marks=pytest.mark.costly)
            for number in (signal.SIGTERM, signal.SIGHUP)
        ),
    ],
)
def test_run_stopped_during_navigation_cancels_its_goal(start, witness, number, expected):
    watching = witness()
    start("sar-sim", "run")
    start("sar-detect-survivor-server")
    start("sar-report-survivor-server")
    mission = start("sar-run", "--ros-args", "-p", "use_sim_time:=true").wait_for("Navigating to zone_a...")
    watching.wait_for_goals(lambda goals: goals == [EXECUTING])
    watching.wait_until_moving()
    status = mission.stop(number)
    assert status == expected, mission.output
    watching.wait_for_goals(lambda goals: goals == [CANCELED])
    assert "Summary: the mission is incomplete." in mission.output
    assert "missing:         zone_a, zone_b, zone_c and zone_d were not visited." in mission.output


def test_run_stopped_on_the_way_home_reports_missing_return(start):
    run = start("sar-run", "--sim", "--speed", 10, *ONE_ZONE).wait_for("Navigating to base station...")
    status = run.stop()
    assert status == 130
    assert "missing:         The robot did not return to the base station." in run.output


@pytest.mark.parametrize(
    "moment",
    ["DetectSurvivor service ready.", "Base station at", "Nav2 is active.", "Navigating to zone_a..."],
)
def test_ctrl_c_ends_simulated_run_at_any_time(start, moment):
    run = start("sar-run", "--sim").wait_for(moment)
    status = run.stop()
    assert status == 130, run.output


def test_ctrl_c_ends_wait_for_nav2(start):
    run = start("sar-run").wait_for("Base station at")
    status = run.stop()
    assert status == 130, run.output


def test_complete_mission_stopped_while_idle_succeeds(start):
    run = start("sar-run", "--sim", "--speed", 20, "--until", "forever", *ONE_ZONE).wait_for(
        "Mission complete."
    )
    status = run.stop()
    assert status == 0, run.output


def test_leaf_that_raises_ends_run_and_is_named(start, tmp_path):
    leaves = tmp_path / "failing_leaves.py"
    leaves.write_text(
        "from py_trees.behaviour import Behaviour\n"
        "from sar_compiler.leaves import Kind, register\n"
        "@register('Explode', kind=Kind.ACTION)\n"
        "class Explode(Behaviour):\n"
        "    def __init__(self, name: str) -> None:\n"
        "        super().__init__(name)\n"
        "    def update(self):\n"
        "        raise ValueError('boom')\n",
        encoding="utf-8",
    )
    tree = tmp_path / "explode.xml"
    tree.write_text(
        '<root><BehaviorTree ID="A"><Sequence><Success/><Explode name="Bang"/></Sequence></BehaviorTree></root>',
        encoding="utf-8",
    )
    run = start("sar-run", tree, "--nodes", "failing_leaves", env={"PYTHONPATH": str(tmp_path)})
    assert run.end() == 1
    place = f"({tree}:1; {leaves}:8, in update)"
    assert f"'Bang' (Explode) failed: ValueError: boom {place}. The tree is stopped." in run.output


@pytest.mark.ros
def test_signal_during_check_for_other_simulations_ends_run_before_start(start, witness):
    witness()
    run = start("sar-run", "--sim").wait_for("Checking for other simulations")
    run.send(signal.SIGINT)
    assert run.end() == 130, run.output
    assert "ready" not in run.output
    assert "Loaded" not in run.output
