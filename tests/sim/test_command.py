"""Tests of the command `sar-sim`."""

import os
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from sar_compiler.cli.sim import main
from tests.sim.conftest import Client, Navigation
from tests.waiting import SILENCE_SEC


def start_simulator(*arguments: str) -> "subprocess.Popen[str]":
    command = [sys.executable, "-c", "import sys; from sar_compiler.cli.sim import main; sys.exit(main())"]
    pipe = subprocess.PIPE
    return subprocess.Popen(
        [*command, "run", *arguments], stdout=pipe, stderr=pipe, text=True, env=dict(os.environ)
    )


@pytest.mark.ros
@pytest.mark.parametrize(("number", "status"), [(signal.SIGINT, 0), (signal.SIGTERM, 0)])
def test_signal_ends_simulation_with_status_and_no_traceback(
    client: Client, number: signal.Signals, status: int
) -> None:
    process = start_simulator("--speed", "20")
    try:
        client.make_ready()
        navigation = Navigation(client)
        handle = navigation.send(-3.0, 3.0)
        result = handle.get_result_async()
        process.send_signal(number)
        assert client.result(result, "the goal's end").status == 6
        assert process.wait(timeout=SILENCE_SEC) == status
        navigation.close()
    finally:
        process.kill()
        output, errors = process.communicate()
    assert output.startswith("sar-sim: 'disaster_zone' runs")
    assert "Traceback" not in errors


@pytest.mark.ros
@pytest.mark.usefixtures("client")
def test_signal_during_discovery_ends_command_before_simulation_starts() -> None:
    process = start_simulator("--robot", "r1")
    try:
        assert process.stderr is not None
        assert "Checking for other simulations" in process.stderr.readline()
        process.send_signal(signal.SIGINT)
        assert process.wait(timeout=SILENCE_SEC) == 0
    finally:
        process.kill()
        output, errors = process.communicate()
    assert (output, errors) == ("", "")


@pytest.mark.ros
def test_namespace_on_command_line_applies_to_robot(ros_context: Any) -> None:
    client = Client(ros_context, namespace="/robot1")
    remaps = ["-r", "__ns:=/robot1", "-r", "/tf:=tf"]
    process = start_simulator("--speed", "20", "--ros-args", *remaps)
    try:
        client.make_ready()
        names = {name for name, _ in client.node.get_topic_names_and_types()}
        assert {"/robot1/tf", "/clock", "/robot1/scan"} <= names
    finally:
        client.close()
        process.terminate()
        process.communicate(timeout=SILENCE_SEC)
    assert process.returncode == 0


@pytest.mark.costly
@pytest.mark.ros
def test_named_robots_ignore_namespace_of_command_line(ros_context: Any) -> None:
    client = Client(ros_context, namespace="/robot1")
    pair = ["--robot", "robot1:-0.7,0,3.14", "--robot", "robot2:0.7,0"]
    process = start_simulator(
        *pair, "--speed", "20", "--ros-args", "-r", "__ns:=/lab", "-r", "/tf:=elsewhere"
    )
    try:
        client.make_ready()
        names = {name for name, _ in client.node.get_topic_names_and_types()}
        assert {"/robot1/tf", "/robot2/tf", "/robot2/scan", "/clock"} <= names
        assert not {"/tf", "/elsewhere", "/lab/tf", "/lab/scan"} & names
        assert ("simulator", "/lab") in client.node.get_node_names_and_namespaces()
    finally:
        client.close()
        process.terminate()
        output, _ = process.communicate(timeout=SILENCE_SEC)
    assert process.returncode == 0
    assert output.startswith("sar-sim: 'disaster_zone' runs with /robot1 and /robot2, at most 20 times")


@pytest.mark.ros
def test_simulation_is_refused_if_other_node_provides_clock(client: Client) -> None:
    from rosgraph_msgs.msg import Clock

    client.node.create_publisher(Clock, "/clock", 10)
    process = start_simulator()
    _, errors = process.communicate(timeout=SILENCE_SEC)
    assert process.returncode == 2
    assert errors.splitlines()[-1].startswith(
        "sar-sim: node '/client' already provides /clock in this ROS domain"
    )


@pytest.mark.parametrize(
    ("arguments", "problem"),
    [
        (["run", "--speed", "0"], "'0' is not a number from 0.001 to 10000"),
        (["run", "--speed", "fast"], "'fast' is not a number from 0.001 to 10000"),
        (["run", "--seed", "-1"], "'-1' is not an integer"),
        (["run", "--fault", "navigate_to_pose:abrt=zone_a"], "did you mean 'abort'?"),
        (
            ["run", "--fault", "report_survivor:drop=1"],
            "unknown target 'report_survivor' (known: navigate_to_pose, amcl)",
        ),
        (["run", "--robot", ""], "the robot has no name. Write NAME, NAME:X,Y"),
        (["run", "--robot", ":1,2"], "robot ':1,2': has no name. Write NAME, NAME:X,Y"),
        (["run", "--robot", "robot-1"], "'robot-1' is not a valid namespace"),
        (["run", "--robot", "robot1:0.5"], "Write NAME, NAME:X,Y or NAME:X,Y,YAW (metres and radians"),
        (["run", "--robot", "robot1:0,north"], "'north' is not a finite number"),
        (["fly"], "invalid choice: 'fly'"),
        ([], "required: COMMAND"),
    ],
)
def test_invalid_usage_is_reported(
    arguments: list[str], problem: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as raised:
        main(arguments)
    assert raised.value.code == 2
    assert problem in capsys.readouterr().err


@pytest.mark.ros
@pytest.mark.parametrize(
    ("robots", "problem"),
    [
        (["a", "a:2,0"], "sar-sim: robot 'a': 2 robots have this name"),
        (["a", "b"], "sar-sim: robot 'b': would start at (0.00, 0.00), in contact with robot 'a'"),
        (["a:3,-3"], "sar-sim: robot 'a': would start in contact with an obstacle"),
    ],
)
def test_invalid_robot_placement_is_reported(robots: list[str], problem: str) -> None:
    process = start_simulator(*(part for robot in robots for part in ("--robot", robot)))
    _, errors = process.communicate(timeout=SILENCE_SEC)
    assert process.returncode == 2
    assert errors.startswith(problem)


def test_mapping_of_world_without_survey_route_is_reported(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["map", "empty"]) == 2
    assert "has no survey route" in capsys.readouterr().err


def test_map_is_written_to_given_path(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["map", "disaster_zone", "-o", str(tmp_path / "there"), "--seed", "3"]) == 0
    assert capsys.readouterr().out.split() == [str(tmp_path / "there.pgm"), str(tmp_path / "there.yaml")]
    assert (tmp_path / "there.yaml").read_text(encoding="utf-8").startswith("image: there.pgm\n")


@pytest.mark.parametrize("output", [[], ["-o", "./flat"]])
def test_map_does_not_overwrite_its_world(
    output: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    text = Path("worlds/empty.yaml").read_text(encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    Path("flat.yaml").write_text(text, encoding="utf-8")
    assert main(["map", "flat.yaml", *output]) == 2
    assert "would overwrite the world flat.yaml. Write -o flat_map" in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ["flat.yaml"]
    assert Path("flat.yaml").read_text(encoding="utf-8") == text


def test_core_needs_no_ros() -> None:
    modules = ["world", "robot", "survey", "planner", "navigator", "occupancy", "placement"]
    code = (
        "import sys; sys.modules['rclpy'] = None\n"
        + "".join(f"import sar_compiler.sim.{name}\n" for name in modules)
        + "import sar_compiler.missions.faults, sar_compiler.cli.sim\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True, timeout=60)
