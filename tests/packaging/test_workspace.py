"""Tests of the repository in a ROS 2 workspace: colcon builds it, and it runs from the install folder."""

import os
from importlib.metadata import distribution

import pytest

from tests.packaging.workspace import Workspace

pytestmark = [pytest.mark.ros, pytest.mark.costly]

SHIPPED = ("config", "docs/findings", "examples", "launch", "maps", "rviz", "schemas", "trees", "worlds")


def files_below(folder, tops=SHIPPED):
    """Return the files in some subfolders of a folder, as relative paths."""
    return {
        path.relative_to(folder).as_posix()
        for top in tops
        for path in (folder / top).rglob("*")
        if path.is_file() and "__pycache__" not in path.parts
    }


def test_both_packages_but_no_stand_ins_are_built(workspace):
    built = sorted(path.name for path in (workspace.path / "install").iterdir() if path.is_dir())
    assert built == ["sar_compiler", "sar_interfaces"]


def test_every_command_is_executable_in_the_folder_of_ros2_run(workspace):
    commands = distribution("sar_compiler").entry_points.select(group="console_scripts").names
    assert commands
    assert [name for name in commands if not os.access(workspace.executable(name), os.X_OK)] == []


def test_every_shipped_file_is_in_the_share_folder(workspace):
    assert {"trees/search_and_rescue.xml", "examples/drive_to_goal/params.yaml"} <= files_below(
        workspace.share
    )
    assert files_below(workspace.share) == files_below(workspace.repository)


def test_sourced_shell_runs_installed_code(workspace):
    where = workspace.evaluate(
        "import sar_compiler, sar_interfaces as i; print(sar_compiler.__file__, i.__file__)"
    )
    assert [path.split("/lib/")[0] for path in where.split()] == [
        str(workspace.path / "install" / "sar_compiler"),
        str(workspace.path / "install" / "sar_interfaces"),
    ]


def test_shipped_files_are_read_from_share_folder_of_ament_index(workspace):
    indexed = workspace.evaluate(
        "from ament_index_python.packages import get_package_share_directory as share; print(share('sar_compiler'))"
    )
    read = workspace.evaluate("from sar_compiler.resources import shipped_root; print(shipped_root())")
    assert indexed == read == str(workspace.share)


def test_shipped_tree_is_valid_and_shown_by_name(workspace):
    workspace.say("sar-compile", "validate", "search_and_rescue")
    assert "MissionOrReturnToBase" in workspace.say("sar-compile", "show", "search_and_rescue")


def test_one_installed_command_runs_the_whole_mission(start):
    run = start("sar-run", "--sim", "--speed", 20)
    assert run.end() == 0, run.output
    assert "Summary: the mission is complete." in run.output


def test_four_installed_processes_run_the_mission_together(start):
    start("sar-sim", "run", "--speed", 20)
    detection = start("sar-detect-survivor-server")
    reports = start("sar-report-survivor-server")
    run = start("sar-run", "--until", "complete", "--ros-args", "-p", "use_sim_time:=true")
    assert run.end() == 0, run.output
    assert "Detection request for zone_a: FOUND at (-2.50, 3.20)" in detection.log
    assert "Report received: survivor_2 at (4.10, -2.50). Acknowledged." in reports.log


def test_source_change_takes_effect_at_once_with_symlink_install(tmp_path):
    linked = Workspace(tmp_path / "workspace")
    linked.fill_and_build("--symlink-install", "--packages-select", "sar_compiler")
    tree = linked.repository / "trees" / "search_and_rescue.xml"
    tree.write_text(
        tree.read_text(encoding="utf-8").replace("MissionOrReturnToBase", "Changed"), encoding="utf-8"
    )
    assert "[o] Changed" in linked.say("sar-compile", "show", "search_and_rescue")
