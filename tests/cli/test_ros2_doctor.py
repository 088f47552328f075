"""Tests of the project's check and report in `ros2 doctor`."""

import sys
from importlib.metadata import entry_points, version
from pathlib import Path

import pytest

from sar_compiler.missions.mission_choice import MissionError
from sar_compiler.runtime import kernel

STAND_INS = Path(__file__).parents[1] / "stand_ins"
MODULES = ("ros2doctor", "ros2doctor.api", "ros2doctor.api.format", "sar_compiler.cli.ros2_doctor")

pytestmark = pytest.mark.ros


@pytest.fixture
def doctor(monkeypatch):
    """Return a function that loads a check or a report by its group and name, as `ros2 doctor` does."""
    monkeypatch.syspath_prepend(str(STAND_INS))
    for name in MODULES:
        monkeypatch.delitem(sys.modules, name, raising=False)

    def load_entry(group, name):
        (entry,) = entry_points(group=group, name=name)
        return entry.load()()

    yield load_entry
    for name in MODULES:
        sys.modules.pop(name, None)


@pytest.fixture
def check(doctor):
    return doctor("ros2doctor.checks", "MissionCheck")


def test_complete_installation_has_no_errors_or_warnings(check, capsys, monkeypatch):
    monkeypatch.setattr(kernel, "IS_COMPILED", True)
    result = check.check()
    assert (result.error, result.warning) == (0, 0)
    assert capsys.readouterr().err == ""


def test_missing_interface_package_is_reported_with_remedy(check, capsys, monkeypatch):
    import rclpy  # noqa: F401 - ROS is here

    def without(name, *rest):
        if name == "nav2_msgs":
            raise ModuleNotFoundError(f"No module named '{name}'", name=name)
        return imported(name, *rest)

    module = sys.modules["sar_compiler.cli.ros2_doctor"]
    imported = module.import_module
    monkeypatch.setattr(module, "import_module", without)
    assert check.check().error == 1
    said = capsys.readouterr().err
    assert "not the interface package 'nav2_msgs'" in said
    assert "make wheels" in said


def test_mission_that_cannot_be_imported_is_reported(check, capsys, monkeypatch):
    def broken():
        raise MissionError("the mission 'patrol' cannot be imported")

    monkeypatch.setattr(sys.modules["sar_compiler.cli.ros2_doctor"], "load_missions", broken)
    assert check.check().error == 1
    assert "the mission 'patrol' cannot be imported" in capsys.readouterr().err


def test_uncompiled_kernel_is_warning(check, capsys, monkeypatch):
    monkeypatch.setattr(kernel, "IS_COMPILED", False)
    monkeypatch.setattr(kernel, "STATE", "absent")
    result = check.check()
    assert (result.error, result.warning) == (0, 1)
    assert "trees are ticked by Python. This is several times slower" in capsys.readouterr().err


def test_two_publishers_of_map_are_reported(check, capsys, monkeypatch):
    from nav_msgs.msg import OccupancyGrid
    from rclpy.context import Context
    from rclpy.node import Node

    monkeypatch.setattr(kernel, "IS_COMPILED", True)
    context = Context()
    context.init(initialize_logging=False)
    try:
        nodes = [Node(name, context=context) for name in ("one", "two")]
        publishers = [node.create_publisher(OccupancyGrid, "/map", 1) for node in nodes]
        assert (check.check().error, len(publishers)) == (1, 2)
    finally:
        context.try_shutdown()
    assert (
        "sar_compiler: topic /map: published by /one and /two. Stop all of these nodes but one"
        in capsys.readouterr().err
    )


def test_report_contains_version_kernel_and_missions(doctor, check):
    report = doctor("ros2doctor.report", "MissionReport")
    assert report.category() == check.category()
    told = dict(report.report().items)
    assert told["sar_compiler"] == version("sar_compiler")
    assert told["kernel"] == kernel.describe()
    assert "search_and_rescue" in told["missions"]
