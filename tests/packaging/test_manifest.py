"""What package.xml says agrees with what is said and done elsewhere."""

import ast
import re
import sys
from pathlib import Path
from xml.etree import ElementTree as ET

import pytest
import yaml
from catkin_pkg.package import parse_package

# Modules whose rosdep key has another name.
KEYS = {
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
# Read by type checkers only.
NEVER_RUN = {"typing_extensions"}
# Python 3.10 lacks tomllib, and tomli stands in for it; the Pythons of a robot's apt have it.
NEVER_RUN |= {"tomli", "tomllib"}
# No package of apt's: lists stand in for it.
NEVER_RUN |= {"librt", "mypy_extensions"}
# Extras, which say what to install where they are missing.
NEVER_RUN |= {
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
NEVER_RUN |= {"starlette", "uvicorn", "pygls", "lsprotocol", "mcp", "anyio"}
# Of BehaviorTree.ROS2, which is no package of apt's: `--serve` says so where it is missing.
NEVER_RUN |= {"btcpp_ros2_interfaces"}


def manifest():
    return ET.parse("package.xml").getroot()  # noqa: S314 - it is ours


def imported(path):
    """The names of the packages that a file imports, wherever in it."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (alias.name.split(".")[0] for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            yield node.module.split(".")[0]


def test_the_version_is_that_of_the_project():
    project = re.search(
        r'^version = "(.+)"$', Path("pyproject.toml").read_text(encoding="utf-8"), re.MULTILINE
    )
    assert project
    assert manifest().findtext("version") == project[1]


def test_whatever_is_imported_is_a_dependency():
    names = (
        {name for path in FILES for name in imported(path)} - set(sys.stdlib_module_names) - OURS - NEVER_RUN
    )
    depended = {entry.text for entry in manifest().iter("exec_depend")}
    assert sorted({KEYS.get(name, name) for name in names} - depended) == []


def test_whatever_the_launch_files_start_is_a_dependency():
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
    # A package of this repository has a key once it is released with it.
    assert keys - {package.name for package in packages} == listed - {package.name for package in packages}


@pytest.mark.parametrize(("environment", "is_asked"), [({}, False), ({"SAR_BRINGUP": "1"}, True)])
def test_nav2_rviz_and_the_recorder_are_asked_for_only_by_who_wants_the_launch_file(environment, is_asked):
    package = parse_package("package.xml")
    package.evaluate_conditions({"ROS_VERSION": "2", "ROS_DISTRO": "jazzy", **environment})
    asked = {depend.name for depend in package.exec_depends if depend.evaluated_condition}
    started = {"nav2_bringup", "ros2bag", "rosbag2_storage_mcap", "rviz2"}
    assert asked & started == (started if is_asked else set())
    assert "rclpy" in asked


def test_the_changelog_has_a_section_for_what_is_not_released():
    text = Path("CHANGELOG.md").read_text(encoding="utf-8")
    sections = re.findall(r"^## \[(.+?)\](?: - (\d{4}-\d{2}-\d{2}))?$", text, re.MULTILINE)
    assert sections[0] == ("Unreleased", "")
    assert all(date for _, date in sections[1:]), "every released version has its date"
    kinds = {"Added", "Changed", "Deprecated", "Removed", "Fixed", "Security"}
    assert set(re.findall(r"^### (.+)$", text, re.MULTILINE)) <= kinds
