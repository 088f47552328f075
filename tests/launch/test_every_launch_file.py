"""Tests of every launch file: the mission's and those of the examples."""

import ast
from importlib.metadata import distribution
from pathlib import Path

import pytest

from tests.launch.launch_file import ROOT, LaunchFile, keyword, matches, pattern

FILES = sorted([*ROOT.glob("launch/*.launch.py"), *ROOT.glob("examples/**/*.launch.py")])

# Programs of other packages.
FOREIGN = {"rviz2": ["rviz2"]}


@pytest.fixture(params=FILES, ids=lambda path: str(path.relative_to(ROOT)))
def file(request: pytest.FixtureRequest) -> LaunchFile:
    return LaunchFile(request.param)


def commands() -> list[str]:
    return [
        script.name
        for script in distribution("sar_compiler").entry_points
        if script.group == "console_scripts"
    ]


def test_mission_and_examples_have_launch_files():
    assert {"launch", "examples"} <= {path.relative_to(ROOT).parts[0] for path in FILES}


def test_every_process_shows_its_output_as_on_terminal(file: LaunchFile):
    for call in file.starters():
        said = (ast.unparse(keyword(call, "output")), ast.unparse(keyword(call, "emulate_tty")))
        assert said == ("'screen'", "True"), f"line {call.lineno}: {ast.unparse(call)}"


def test_run_and_simulator_know_that_output_is_passed_on(file: LaunchFile):
    for call in file.calls("Node"):
        ours = pattern(keyword(call, "package")) == "sar_compiler"
        if ours and any(matches(keyword(call, "executable"), each) for each in ("sar-run", "sar-sim")):
            assert ast.unparse(keyword(call, "additional_env")) == "ENVIRONMENT", f"line {call.lineno}"


def test_every_used_argument_is_declared(file: LaunchFile):
    assert file.used() <= file.declared()


def test_every_declared_argument_is_used(file: LaunchFile):
    assert file.declared() <= file.used()


def test_every_argument_is_described(file: LaunchFile):
    for call in file.calls("DeclareLaunchArgument"):
        assert ast.unparse(keyword(call, "description")) != "None", f"line {call.lineno}"


def test_every_named_shipped_file_exists(file: LaunchFile):
    for path in file.paths():
        assert list(Path("/").glob(path.lstrip("/"))), f"there is no {path}"


def test_every_executable_belongs_to_its_package(file: LaunchFile):
    for call in file.calls("Node"):
        package, executable = keyword(call, "package"), keyword(call, "executable")
        name = pattern(package)
        if name == "None":  # a program by its path
            assert ast.unparse(executable) == "sys.executable", f"line {call.lineno}"
            continue
        known = commands() if name == "sar_compiler" else FOREIGN.get(name, [])
        assert any(matches(executable, each) for each in known), f"{name} has no {ast.unparse(executable)}"


def test_share_directories_belong_to_known_packages(file: LaunchFile):
    packages = {ast.unparse(call.args[0]) for call in file.calls("get_package_share_directory")}
    others = {"nav2_bringup", "ros2bag", "rosbag2_storage_mcap", "rviz2"}
    assert packages <= {repr(each) for each in ("sar_compiler", *others)}
