"""Tests that package.xml matches the project: version, dependencies, rosdep keys, changelog."""

import ast
import re
import sys
from pathlib import Path
from xml.etree import ElementTree as ET

import pytest
import yaml
from catkin_pkg.package import parse_package

# Modules whose rosdep keys have other names.
ROSDEP_KEYS = {
    "PIL": "python3-pil",
    "argcomplete": "python3-argcomplete",
    "jsonschema": "python3-jsonschema",
    "lxml": "python3-lxml",
    "numpy": "python3-numpy",
    "scipy": "python3-scipy",
    "yaml": "python3-yaml",
}
FILES = sorted(path for top in ("sar_compiler", "launch", "examples") for path in Path(top).rglob("*.py"))
# The examples' files import each other.
OURS = {"sar_compiler", *(path.stem for path in Path("examples").rglob("*.py"))}
# Modules that only type checkers read.
NOT_REQUIRED = {"typing_extensions"}
# tomli replaces tomllib on Python 3.10; the Python versions of ROS distributions have tomllib.
NOT_REQUIRED |= {"tomli", "tomllib"}
# apt has no such packages; the code falls back to lists.
NOT_REQUIRED |= {"librt", "mypy_extensions"}
# Extras: messages say what to install if they are missing.
NOT_REQUIRED |= {
    "jinja2",
    "markupsafe",
    "mcap",
    "msgpack",
    "zmq",
    "rich",
    "cap_tools",
    "geojson",
    "pyproj",
    "shapely",
    "xsdata",
}
NOT_REQUIRED |= {"starlette", "uvicorn", "pygls", "lsprotocol", "mcp", "anyio"}
# Part of BehaviorTree.ROS2, which apt does not have. `--serve` reports it if it is missing.
NOT_REQUIRED |= {"btcpp_ros2_interfaces"}


def manifest():
    return ET.parse("package.xml").getroot()  # noqa: S314 - it is ours


def packages_imported_by(path):
    """Yield the names of the packages that a file imports at any level."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (alias.name.split(".")[0] for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            yield node.module.split(".")[0]


def test_manifest_version_matches_project():
    project = re.search(
        r'^version = "(.+)"$', Path("pyproject.toml").read_text(encoding="utf-8"), re.MULTILINE
    )
    assert project
    assert manifest().findtext("version") == project[1]


def test_every_imported_package_is_a_dependency():
    names = (
        {name for path in FILES for name in packages_imported_by(path)}
        - set(sys.stdlib_module_names)
        - OURS
        - NOT_REQUIRED
    )
    depended = {entry.text for entry in manifest().iter("exec_depend")}
    assert sorted({ROSDEP_KEYS.get(name, name) for name in names} - depended) == []


def test_every_package_started_by_launch_files_is_a_dependency():
    text = "".join(path.read_text(encoding="utf-8") for path in Path("launch").glob("*.py"))
    started = set(re.findall(r'(?:get_package_share_directory\(|\bpackage=)"(\w+)"', text)) - OURS
    depended = {entry.text for entry in manifest().iter("exec_depend")}
    assert started
    assert sorted(started - depended) == []


MANIFESTS = sorted(
    [Path("package.xml"), *Path("interfaces").glob("*/*.xml"), *Path("pip_interfaces").glob("*/*.xml")]
)


def test_rosdep_knows_every_key():
    packages = [parse_package(str(path)) for path in MANIFESTS]
    keys = {
        depend.name
        for package in packages
        for depends in (
            package.build_depends,
            package.buildtool_depends,
            package.exec_depends,
            package.test_depends,
        )
        for depend in depends
    }
    known = yaml.safe_load(Path("tests/packaging/rosdep_keys.yaml").read_text(encoding="utf-8"))
    listed = {*known["jazzy/distribution.yaml"], *known["rosdep/python.yaml"]}
    # The packages of this repository get keys with their release.
    assert keys - {package.name for package in packages} == listed - {package.name for package in packages}


@pytest.mark.parametrize(("environment", "is_asked"), [({}, False), ({"SAR_BRINGUP": "1"}, True)])
def test_nav2_rviz_and_recorder_are_dependencies_only_with_bringup(environment, is_asked):
    package = parse_package("package.xml")
    package.evaluate_conditions({"ROS_VERSION": "2", "ROS_DISTRO": "jazzy", **environment})
    asked = {depend.name for depend in package.exec_depends if depend.evaluated_condition}
    started = {"nav2_bringup", "ros2bag", "rosbag2_storage_mcap", "rviz2"}
    assert asked & started == (started if is_asked else set())
    assert "rclpy" in asked


def test_changelog_has_an_unreleased_section():
    text = Path("CHANGELOG.md").read_text(encoding="utf-8")
    sections = re.findall(r"^## \[(.+?)\](?: - (\d{4}-\d{2}-\d{2}))?$", text, re.MULTILINE)
    assert sections[0] == ("Unreleased", "")
    assert all(date for _, date in sections[1:]), "every released version has its date"
    kinds = {"Added", "Changed", "Deprecated", "Removed", "Fixed", "Security"}
    assert set(re.findall(r"^### (.+)$", text, re.MULTILINE)) <= kinds
