"""Tests of the messages of commands on a machine without a library."""

import os
import subprocess
import sys

import pytest

from sar_compiler.commands import run


def run_without(library, *arguments, **environment):
    """Run a command in an interpreter that cannot import a library; return its status and its standard error."""
    (module, function), *rest = arguments[0].split(":"), *arguments[1:]
    program = (
        f"import sys; sys.modules[{library!r}] = None\n"
        f"from {module} import {function} as main; sys.exit(main({rest!r}))"
    )
    done = subprocess.run(
        [sys.executable, "-c", program],
        capture_output=True,
        text=True,
        timeout=60.0,
        check=False,
        env={**os.environ, **environment},
    )
    return done.returncode, done.stderr


@pytest.mark.parametrize("library", ["numpy", "PIL"])
def test_simulator_names_missing_library(library, tmp_path):
    status, said = run_without(library, "sar_compiler.cli.sim:main", "map", "-o", str(tmp_path / "map"))
    assert (status, "Traceback" in said) == (2, False)
    assert f"a library of the simulator is missing (import of {library}" in said
    assert "pip install 'sar_compiler[sim]'" in said


SIMULATING = [("sar_compiler.cli.sim:main", "run"), ("sar_compiler.cli.run:main", "--sim")]


@pytest.mark.ros
@pytest.mark.parametrize("command", SIMULATING, ids=" ".join)
@pytest.mark.parametrize("library", ["numpy", "scipy", "PIL"])
def test_missing_simulator_library_is_not_reported_as_missing_ros(library, command):
    status, said = run_without(library, *command)
    assert (status, "Traceback" in said) == (2, False), said
    assert "a library of the simulator is missing (" in said
    assert library in said
    assert "ROS 2 is missing" not in said


SERVERS = [
    ("search_and_rescue.server_commands:detect",),
    ("search_and_rescue.server_commands:report",),
]


WITHOUT_ROS = [
    *(("rclpy", command) for command in (*SIMULATING, *SERVERS)),
]
WITHOUT_INTERFACES = [*(("sar_interfaces", command) for command in SERVERS), ("nav2_msgs", SIMULATING[0])]


@pytest.mark.parametrize(("library", "command"), WITHOUT_ROS)
def test_missing_ros_is_reported(library, command):
    status, said = run_without(library, *command)
    assert (status, "Traceback" in said) == (2, False), said
    assert "ROS 2 is missing (" in said
    assert library in said


@pytest.mark.parametrize("library", ["starlette", "uvicorn"])
def test_missing_web_server_is_reported_with_package_to_install(library, tmp_path):
    status, said = run_without(
        library, "sar_compiler.cli.journal_command:main", "replay", str(tmp_path / "m.journal")
    )
    assert (status, "Traceback" in said) == (2, False), said
    assert "sar-journal: the page needs a library that is missing (" in said
    assert "pip install 'sar_compiler[web]'" in said


@pytest.mark.ros
def test_mission_does_not_start_if_page_cannot_be_served():
    status, said = run_without("uvicorn", "sar_compiler.cli.run:main", "--sim", "--view", "web")
    assert (status, "Traceback" in said, "Checking for" in said) == (2, False, False), said
    assert "sar-run: the page needs a library that is missing (" in said
    assert "pip install 'sar_compiler[web]'" in said


@pytest.mark.ros
@pytest.mark.parametrize(("library", "command"), WITHOUT_INTERFACES)
def test_missing_interface_package_is_reported_with_remedy(library, command):
    status, said = run_without(library, *command)
    assert (status, "Traceback" in said) == (2, False), said
    assert f"ROS 2 is installed, but not the interface package '{library}' (" in said
    assert "--find-links dist 'sar_compiler[interfaces]'" in said


def test_unknown_missing_module_raises_error():
    def command():
        import no_such_module  # type: ignore[import-not-found]  # noqa: F401

    with pytest.raises(ModuleNotFoundError):
        run(command, "sar-run")


def register_middlewares(prefix, *names):
    """Register middlewares like a sourced workspace does."""
    index = prefix / "share/ament_index/resource_index/rmw_typesupport"
    index.mkdir(parents=True)
    for name in ("rmw_implementation", *names):
        (index / name).touch()


@pytest.mark.parametrize(
    "command",
    [*SIMULATING, *SERVERS, ("sar_compiler.cli.sim:main", "sweep", "search_and_rescue")],
    ids=" ".join,
)
def test_missing_middleware_is_reported_before_ros_is_loaded(command, tmp_path):
    register_middlewares(tmp_path, "rmw_other_cpp")
    status, said = run_without(
        "rclpy", *command, RMW_IMPLEMENTATION="rmw_zenoh_cpp", AMENT_PREFIX_PATH=str(tmp_path)
    )
    assert status == 2
    (line,) = said.splitlines()
    assert (
        "RMW_IMPLEMENTATION is set to 'rmw_zenoh_cpp', which is not installed. The installed middlewares are: "
        in line
    )
    assert "rmw_other_cpp" in line
    assert "rmw_implementation" not in line
    assert "apt install ros-jazzy-rmw-zenoh-cpp" in line


@pytest.mark.parametrize("wanted", ["", "rmw_other_cpp"])
def test_installed_middleware_is_left_to_ros(wanted, tmp_path):
    register_middlewares(tmp_path, "rmw_other_cpp")
    _, said = run_without("rclpy", *SERVERS[0], RMW_IMPLEMENTATION=wanted, AMENT_PREFIX_PATH=str(tmp_path))
    assert "ROS 2 is missing (" in said


@pytest.mark.ros
@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("import py_trees_ros_interfaces.msg", "cannot be loaded (py_trees_ros_interfaces is missing). "),
        ("from rclpy import nothing", "cannot be loaded (cannot import name 'nothing' from 'rclpy'"),
    ],
)
def test_engine_that_cannot_be_loaded_reports_missing_module(line, said, tmp_path):
    (tmp_path / "py_trees_ros").mkdir()
    (tmp_path / "py_trees_ros/__init__.py").touch()
    (tmp_path / "py_trees_ros/trees.py").write_text(line, encoding="utf-8")
    status, err = run_without(
        "nothing", "sar_compiler.cli.run:main", "--engine", "py_trees_ros", PYTHONPATH=str(tmp_path)
    )
    assert (status, "Traceback" in err, "not installed here" in err) == (2, False, False), err
    assert f"sar-run: --engine py_trees_ros: py_trees_ros {said}" in err
