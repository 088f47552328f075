"""Tests of the wheels of interface packages, made from a package as colcon installs it. `make wheels` builds them."""

import importlib.util
import re
import sys
from pathlib import Path

import pytest

_spec = importlib.util.spec_from_file_location("wheels", "pip_interfaces/wheels.py")
assert _spec is not None
assert _spec.loader is not None
wheels = importlib.util.module_from_spec(_spec)
_spec.loader.exec_module(wheels)

PACKAGES = {
    path.parent.name: path
    for top in ("interfaces", "pip_interfaces")
    for path in Path(top).glob("*/package.xml")
}
INSTALLED = (
    "include/nav2_msgs/action/navigate_to_pose.hpp",
    "lib/libnav2_msgs__rosidl_typesupport_c.so",
    "lib/python3.11/site-packages/nav2_msgs/__init__.py",
    "lib/python3.11/site-packages/nav2_msgs/_nav2_msgs_s.c",
    "lib/python3.11/site-packages/nav2_msgs/action/_navigate_to_pose.py",
    "lib/python3.11/site-packages/nav2_msgs/action/__pycache__/_navigate_to_pose.cpython-311.pyc",
    "share/ament_index/resource_index/packages/nav2_msgs",
    "share/ament_index/resource_index/parent_prefix_path/nav2_msgs",
    "share/nav2_msgs/action/NavigateToPose.action",
    "share/nav2_msgs/cmake/nav2_msgsConfig.cmake",
    "share/nav2_msgs/local_setup.bash",
)


@pytest.fixture
def wheel(tmp_path):
    """Fill the wheel of `nav2_msgs` from an installed package; return the folder."""
    prefix, folder = tmp_path / "installed" / "nav2_msgs", tmp_path / "wheel"
    for name in INSTALLED:
        (prefix / name).parent.mkdir(parents=True, exist_ok=True)
        (prefix / name).touch()
    manifest = prefix / "share" / "nav2_msgs" / "package.xml"
    manifest.write_bytes(PACKAGES["nav2_msgs"].read_bytes())
    folder.mkdir()
    wheels.fill(folder, manifest)
    return folder


def test_wheel_has_only_runtime_files_in_their_installed_locations(wheel):
    data, info = "sar_compiler_nav2_msgs-0.1.0.data/data", "sar_compiler_nav2_msgs-0.1.0.dist-info"
    assert {path.relative_to(wheel).as_posix() for path in wheel.rglob("*") if path.is_file()} == {
        "nav2_msgs/__init__.py",
        "nav2_msgs/action/_navigate_to_pose.py",
        f"{data}/lib/libnav2_msgs__rosidl_typesupport_c.so",
        f"{data}/share/ament_index/resource_index/packages/nav2_msgs",
        f"{data}/share/nav2_msgs/action/NavigateToPose.action",
        f"{data}/share/nav2_msgs/package.xml",
        f"{info}/METADATA",
        f"{info}/WHEEL",
    }


def test_wheel_names_its_requirements_as_on_the_index(wheel):
    (metadata,) = wheel.glob("*.dist-info/METADATA")
    lines = metadata.read_text(encoding="utf-8").splitlines()
    assert lines[1:3] == ["Name: sar_compiler_nav2_msgs", "Version: 0.1.0"]
    assert [line.partition(": ")[2] for line in lines if line.startswith("Requires-Dist")] == [
        "ros-jazzy-geometry-msgs",
        "ros-jazzy-nav-msgs",
        "ros-jazzy-builtin-interfaces",
        "ros-jazzy-action-msgs",
        "ros-jazzy-rosidl-default-runtime",
    ]


def test_wheel_is_tagged_for_this_python_on_linux(wheel):
    (said,) = wheel.glob("*.dist-info/WHEEL")
    python = f"cp{sys.version_info.major}{sys.version_info.minor}"
    assert f"Tag: {python}-{python}-linux_x86_64\n" in said.read_text(encoding="utf-8")


def test_interfaces_extra_names_all_wheels():
    text = Path("pyproject.toml").read_text(encoding="utf-8")
    extra = re.search(r"^interfaces = \[\n(.*?)^\]", text, re.DOTALL | re.MULTILINE)
    assert extra
    assert set(re.findall(r'^  "(\w+);', extra[1], re.MULTILINE)) == set(map(wheels.distribution, PACKAGES))
