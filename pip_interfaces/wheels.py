"""Make a wheel of each interface package that colcon has installed: `wheels.py INSTALLED DIST`, after `colcon build`.

A wheel has what a running program needs: the Python package, the libraries (in `lib` of the environment, where those of the
ROS wheels are, too), the definitions, and the entries of the ament index. What a build against the package would need, headers and CMake
files, stays behind: it holds paths of the machine.

The stand-ins' wheels have names of their own: `nav2_msgs` and `tf2_msgs` as distributions are not this project's to name.
"""

import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from xml.etree import ElementTree as ET

OURS = "sar_"
LEFT = (".c", ".pyc")
PYTHON = f"cp{sys.version_info.major}{sys.version_info.minor}"
METADATA = """Metadata-Version: 2.1
Name: {name}
Version: {version}
Summary: {description}
License: {license}
"""
# Not `manylinux`: nobody has looked whether the libraries need more of the system than that promises.
WHEEL = f"""Wheel-Version: 1.0
Generator: sar_compiler
Root-Is-Purelib: false
Tag: {PYTHON}-{PYTHON}-linux_x86_64
"""


def main(installed: Path, dist: Path) -> None:
    """Write the wheels of all packages that are below *installed*, in a folder each, into *dist*."""
    dist.mkdir(parents=True, exist_ok=True)
    for manifest in sorted(installed.glob("*/share/*/package.xml")):
        with tempfile.TemporaryDirectory() as folder:
            fill(Path(folder), manifest)
            command = [sys.executable, "-m", "wheel", "pack", folder, "--dest-dir", str(dist)]
            subprocess.run(command, check=True, stdout=subprocess.DEVNULL)  # noqa: S603 - our own words


def fill(folder: Path, manifest: Path) -> None:
    """Lay out in a folder what the wheel of a package has in it."""
    package, share = ET.parse(manifest).getroot(), manifest.parent  # noqa: S314 - it is ours
    said = {entry.tag: " ".join((entry.text or "").split()) for entry in package}
    module, version, prefix = said["name"], said["version"], share.parents[1]
    name = distribution(module)
    data = folder / f"{name}-{version}.data" / "data"
    for path in needed(prefix, module):
        target = data / path.relative_to(prefix)
        if "site-packages" in path.parts:
            target = folder / Path(*path.parts[path.parts.index("site-packages") + 1 :])
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(path, target)
    info = folder / f"{name}-{version}.dist-info"
    info.mkdir()
    info.joinpath("WHEEL").write_text(WHEEL, encoding="utf-8")
    requirements = "".join(f"Requires-Dist: {each}\n" for each in required(package))
    metadata = METADATA.format(**{**said, "name": name}) + requirements
    info.joinpath("METADATA").write_text(metadata, encoding="utf-8")


def distribution(package: str) -> str:
    """Return what the wheel of an interface package is called."""
    return package if package.startswith(OURS) else f"{OURS}compiler_{package}"


def required(package: ET.Element) -> Iterator[str]:
    """Yield the names, on PyPI, of the packages that a package needs where it runs."""
    for tag in ("depend", "exec_depend"):
        for entry in package.iter(tag):
            yield f"ros-jazzy-{(entry.text or '').replace('_', '-')}"


def needed(prefix: Path, module: str) -> Iterator[Path]:
    """Yield the files below an installed package's folder that a running program needs."""
    patterns = (
        "lib/*.so",
        f"lib/python3*/site-packages/{module}/**/*",
        "share/ament_index/**/*",
        f"share/{module}/package.xml",
        f"share/{module}/*/*.msg",
        f"share/{module}/*/*.srv",
        f"share/{module}/*/*.action",
    )
    for path in sorted({path for pattern in patterns for path in prefix.glob(pattern)}):
        if path.is_file() and path.suffix not in LEFT and path.parent.name != "parent_prefix_path":
            yield path


if __name__ == "__main__":
    main(*map(Path, sys.argv[1:]))
