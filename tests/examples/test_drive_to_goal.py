"""Tests of the example `drive_to_goal`: its leaves with scripted odometry, and the whole example in the simulator."""

import math
import re
from pathlib import Path

import pytest
import yaml

from sar_compiler.nodes.registry import load_registry
from sar_compiler.testing import assert_matches_golden, compile_for_test

FOLDER = Path("examples/drive_to_goal")
TREE = FOLDER / "drive_to_goal.xml"
LEAVES = "examples.drive_to_goal.leaves"


def test_tree_compiles_as_reviewed():
    assert_matches_golden(TREE, "tests/golden/examples/drive_to_goal.json", registry=load_registry([LEAVES]))


def test_leaves_have_lecture_values_by_default():
    specs = {spec.tag: spec for spec in load_registry([LEAVES])}
    defaults = {
        (tag, name): specs[tag].parameters[name].default
        for tag, name in [
            ("GoalNotReached", "goal_x"),
            ("GoalNotReached", "goal_y"),
            ("GoalNotReached", "tolerance"),
            ("DriveForward", "k_rho"),
            ("DriveForward", "k_alpha"),
            ("SpinInPlace", "k_yaw"),
            ("SpinInPlace", "goal_yaw"),
        ]
    }
    assert list(defaults.values()) == [2.0, 0.0, 0.3, 0.4, 0.8, 0.8, 0.0]


def test_parameter_file_has_every_parameter_of_the_tree():
    values = yaml.safe_load((FOLDER / "params.yaml").read_text(encoding="utf-8"))["/**"]["ros__parameters"]
    assert set(re.findall(r"\{@(\w+)\}", TREE.read_text(encoding="utf-8"))) == set(values) - {"tick_rate_hz"}


def test_timeout_uses_mission_clock():
    tree = compile_for_test(TREE, registry=load_registry([LEAVES]))
    timeouts = [node for node in tree.root.iterate() if node.name == "DriveForwardTimeout"]
    assert type(timeouts[0]).__name__ == "Timeout"


def run_example(start, until, *ros):
    return start(
        "sar-run", TREE, "--nodes", LEAVES, "--params", FOLDER / "params.yaml", "--sim", "empty",
        "--speed", 4, "--until", until, "--view", "text", "--ros-args", *ros,
    )  # fmt: skip


@pytest.mark.ros
def test_robot_reaches_goal_and_run_ends(start):
    run = run_example(start, "failure")
    assert run.end() == 0, run.output
    assert "DriveToGoal FAILURE" in run.output
    left = re.findall(r"GoalNotReached\? FAILURE, (\d\.\d\d) m to go", run.output)
    assert [0.2 < float(metres) <= 0.3 for metres in left] == [True]


@pytest.mark.ros
@pytest.mark.parametrize(("goal_x", "goal_y"), [(5.0, 0.0), (-1.0, 1.0)])
def test_robot_stops_at_goal_of_parameters(start, witness, goal_x, goal_y):
    watching = witness()
    run = run_example(start, "forever", "-p", f"goal_x:={goal_x}", "-p", f"goal_y:={goal_y}")
    run.wait_for("GoalNotReached? FAILURE")
    watching.wait_until_seen()
    assert 0.1 < math.dist(watching.place(), (goal_x, goal_y)) < 0.35
    status = run.stop()
    assert status == 130


@pytest.mark.ros
def test_recovery_turns_robot_after_timeout(start, witness):
    watching = witness()
    run = run_example(
        start, "forever", "-p", "goal_x:=10.0", "-p", "timeout_duration:=3.0", "-p", "goal_yaw:=1.57"
    )
    run.wait_for("DriveForwardTimeout FAILURE, timed out")
    run.wait_for("SpinInPlace RUNNING, ")
    watching.wait_for_yaw(lambda yaw: yaw > 0.02)
    status = run.stop()
    assert status == 130


@pytest.mark.ros
class TestWithoutOdometry:
    """Leaves command zero velocity while the robot's position is unknown."""

    @pytest.fixture
    def stage(self):
        from tests.examples.stage import Stage

        stage = Stage()
        yield stage
        stage.close()

    @pytest.mark.parametrize("leaf", ["DriveForward", "SpinInPlace"])
    def test_command_is_zero_before_first_message(self, stage, leaf):
        stage.tick(leaf)
        assert stage.next_command() == (0.0, 0.0)

    @pytest.mark.parametrize("leaf", ["DriveForward", "SpinInPlace"])
    def test_command_is_zero_if_last_message_is_too_old(self, stage, leaf):
        stage.tick(leaf)
        stage.next_command()
        stage.odometry(x=0.0, y=-3.0, yaw=-1.0)
        stage.tick(leaf)
        assert stage.next_command() != (0.0, 0.0)
        stage.clock(0.6)
        stage.tick(leaf)
        assert stage.next_command() == (0.0, 0.0)

    @pytest.mark.parametrize("leaf", ["DriveForward", "SpinInPlace"])
    def test_command_is_zero_after_clock_jumped_back(self, stage, leaf):
        stage.tick(leaf)
        stage.next_command()
        stage.odometry(x=0.0, y=-3.0, yaw=-1.0)
        stage.clock(-50.0)
        stage.tick(leaf)
        assert stage.next_command() == (0.0, 0.0)

    def test_stopped_leaf_commands_zero_velocity(self, stage):
        stage.tick("DriveForward")
        stage.next_command()
        stage.odometry(x=0.0, y=0.0, yaw=0.0)
        stage.tick("DriveForward")
        assert stage.next_command() == pytest.approx((0.8, 0.0))
        stage.stop_leaf("DriveForward")
        assert stage.next_command() == (0.0, 0.0)

    def test_goal_is_not_reached_without_odometry(self, stage):
        assert stage.tick("GoalNotReached") == "SUCCESS"
        stage.odometry(x=1.8, y=0.0, yaw=0.0)
        assert stage.tick("GoalNotReached") == "FAILURE"
