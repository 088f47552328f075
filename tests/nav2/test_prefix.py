"""Tests of the check for an installed Nav2 before a run."""

import os

import pytest

from tests.nav2.prefix import MANAGER, SERVERS, environment, executable, missing


@pytest.fixture
def installed(tmp_path):
    """A folder with all required programs."""
    for package, name in (*((package, name) for name, package in SERVERS.items()), MANAGER):
        path = executable(tmp_path, package, name)
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("#!/bin/sh\n", encoding="utf-8")
        path.chmod(0o755)
    (tmp_path / "setup.bash").write_text("export OF_THE_SETUP=1\n", encoding="utf-8")
    return tmp_path


def test_unset_prefix_is_explained():
    [line] = missing("")
    assert line.startswith(
        "NAV2_PREFIX is not set: write NAV2_PREFIX=/opt/ros/jazzy, or where Nav2 is installed"
    )
    assert "docs/how-to/nav2-trees.md#on-a-nav2-that-is-installed" in line


def test_folder_without_ros_is_named(tmp_path):
    [line] = missing(str(tmp_path))
    assert line.startswith(f"{tmp_path}/setup.bash: there is no such file")


def test_missing_program_is_named_with_its_package(installed):
    assert missing(str(installed)) == []
    path = executable(installed, "nav2_amcl", "amcl")
    path.unlink()
    assert missing(str(installed)) == [f"{path}: there is no such program (apt install ros-jazzy-nav2-amcl)"]


def test_environment_has_domain_and_nothing_of_ros_of_project(installed, monkeypatch):
    monkeypatch.setenv("AMENT_PREFIX_PATH", "/of/the/project")
    given = environment(installed)
    assert given["OF_THE_SETUP"] == "1"
    assert given["ROS_DOMAIN_ID"] == os.environ["ROS_DOMAIN_ID"]
    assert "AMENT_PREFIX_PATH" not in given
